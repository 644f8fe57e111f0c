"""The compiled tolerances of trajectories against the plain equations, over drawn motions."""

from __future__ import annotations

import secrets
from pathlib import Path

import numpy as np

from hand_control.declared import Settings
from hand_control.tolerance_watch import PATIENCE_S, ToleranceWatch
from hand_model.arrays import Array, Flags
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT, DT_S, GOAL_S = len(HAND.joints), 0.005, 0.2


class Plain:
    """The same watch with arrays as a whole."""

    def __init__(self) -> None:
        self.away_s, self.late_s = np.zeros(COUNT), np.zeros(COUNT)

    def reason(self, error: Array, on_path: Flags, at_goal: Flags, path_deg: float, goal_deg: float) -> str:
        """Joint, what it misses and by how much, or an empty text; (COUNT,) each, error [rad]."""
        size_deg = np.degrees(np.abs(error))
        self.away_s = np.where(on_path & (size_deg > path_deg) & (path_deg > 0.0), self.away_s + DT_S, 0.0)
        self.late_s = np.where(at_goal & (size_deg > goal_deg) & (goal_deg > 0.0), self.late_s + DT_S, 0.0)
        for time_s, patience_s, what in (
            (self.away_s, PATIENCE_S, "is off the path"),
            (self.late_s, GOAL_S, "is not at the goal"),
        ):
            worst = int(np.argmax(time_s))
            if time_s[worst] > patience_s:
                return f"{HAND.joints[worst]} {what} by {size_deg[worst]:.1f} degrees"
        return ""


def test_drawn_motions_end_where_the_plain_equations_end_them() -> None:
    """Fails when a motion ends at another frame, or for another joint or reason, than by the plain equations."""
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    reasons = []
    for path_deg, goal_deg in ((5.0, 2.0), (0.0, 2.0), (5.0, 0.0)):
        values = {"path_tolerance_deg": path_deg, "goal_tolerance_deg": goal_deg, "goal_time_s": GOAL_S}
        settings, watch, plain = Settings.of(HAND, values), ToleranceWatch(HAND), Plain()
        for _ in range(300):
            error = np.radians(rng.normal(0.0, 6.0, COUNT))
            on_path = rng.random(COUNT) < 0.5
            for _ in range(rng.integers(5, 60)):
                wanted = plain.reason(error, on_path, ~on_path, path_deg, goal_deg)
                line = watch.check(error, on_path, ~on_path, settings, DT_S)
                assert wanted in line and bool(wanted) == bool(line)
                reasons.append(wanted)
    assert {"path", "goal"} <= {word for reason in reasons for word in reason.split()}


def test_without_a_tolerance_the_times_begin_again() -> None:
    """Fails when a tolerance that is set to zero in between leaves the time that counted before it."""
    off, every, none = np.full(COUNT, 1.0), np.ones(COUNT, dtype=np.bool_), np.zeros(COUNT, dtype=np.bool_)
    tolerant, free = Settings.of(HAND, {"path_tolerance_deg": 5.0}), Settings.of(HAND, {})
    watch = ToleranceWatch(HAND)
    assert not any(watch.check(off, every, none, tolerant, DT_S) for _ in range(18))
    assert watch.configure(tolerant) and not watch.configure(free)
    assert not any(watch.check(off, every, none, tolerant, DT_S) for _ in range(18))
