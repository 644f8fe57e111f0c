"""The watch for swings, term by term."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_control.declared import STATE, C, G, S, Settings, U
from hand_control.law import Law
from hand_control.swings import slowed, watch_swings
from hand_control.tuning import gains
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
SETTINGS = Settings.of(HAND, {})
DT_S = 0.005
GAINS = gains(HAND, SETTINGS)[:, :1].copy()
FIRST_S = float(C.swing_step * (GAINS[G.response_time, 0] + GAINS[G.dead_time, 0]))


def watched(error: Array, rests: bool = True, state: Array | None = None) -> Array:
    """The state (rows, 1) after an error (ticks,) [rad]."""
    s = np.zeros((len(STATE), 1)) if state is None else state
    for value in error:
        watch_swings(GAINS, s, 0, float(value), rests, DT_S)
    return s


def halves(*peaks: float, half_s: float = 0.2) -> Array:
    """Half sine waves of these peaks [rad], and the first value of one more."""
    phase = np.sin(np.pi * (np.arange(round(half_s / DT_S)) + 0.5) * DT_S / half_s)
    return np.concatenate([peak * phase for peak in peaks] + [[-0.1 * peaks[-1]]])


SWING = 2.0 * C.swing_error


@pytest.mark.parametrize(
    ("error", "steps"),
    [
        (halves(SWING), 0),
        (halves(SWING, -SWING), 1),
        (halves(SWING, -1.5 * SWING, 2.0 * SWING), 2),
        (halves(SWING, -1.05 * C.swing_decay * SWING), 1),
        (halves(SWING, -0.95 * C.swing_decay * SWING), 0),
        (halves(0.99 * C.swing_error, -0.99 * C.swing_error, 0.99 * C.swing_error), 0),
        (halves(SWING, -SWING, SWING, half_s=1.02 * C.swing_half), 0),
        (halves(SWING, -SWING, half_s=0.95 * C.swing_half), 1),
        (np.concatenate([halves(SWING)[:-1], halves(-2.0 * C.noise)[:-1], halves(SWING, -SWING)]), 1),
    ],
    ids=["one", "two", "growing", "slowly less", "quickly less", "small", "slow", "nearly slow", "between"],
)
def test_what_counts_as_a_swing(error: Array, steps: int) -> None:
    """Fails when a swing that shrinks, is small or slow counts, one that stays does not, or a step has another size."""
    expected = 0.0
    for _ in range(steps):
        expected += C.swing_step * (GAINS[G.response_time, 0] + GAINS[G.dead_time, 0] + expected)
    assert watched(error)[S.slower, 0] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert watched(-error)[S.slower, 0] == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_noise_at_the_crossing_does_not_hide_a_swing() -> None:
    """Fails when a change of sign within the noise of the sensor counts as a half wave of its own."""
    first, second = halves(SWING)[:-1], halves(-SWING)
    noisy = np.concatenate([first, [-0.3 * C.noise, 0.3 * C.noise, -0.3 * C.noise, 0.3 * C.noise], second])
    assert watched(noisy)[S.slower, 0] == pytest.approx(FIRST_S)


def test_motion_and_contact_begin_again() -> None:
    """Fails when half a wave before a motion or a contact is compared with one after it."""
    s = watched(halves(SWING))
    watched(np.array([0.0]), rests=False, state=s)
    watched(halves(-SWING), state=s)
    assert s[S.slower, 0] == 0.0
    s[S.contact] = 1.0
    assert watched(halves(SWING, -SWING, SWING), state=s)[S.slower, 0] == 0.0


def test_the_response_time_has_a_bound_and_a_release_ends_it() -> None:
    """Fails when swings lengthen the response time without end, or a release does not restore it."""
    most = C.most_slower * GAINS[G.response_time, 0]
    s = watched(halves(*(SWING * (-1.0) ** k for k in range(40))))
    assert s[S.slower, 0] == pytest.approx(most)
    law = Law(GAINS)
    law.state[:] = s
    law.release()
    assert not law.state[[S.slower, S.peak, S.last_peak, S.swing_time]].any()


def test_the_gains_fall_with_the_longer_response_time() -> None:
    """Fails when Kp is not (d + k T) over response time, dead time and what swings have added."""
    settings = Settings.of(HAND, {"deadband_pa": 0.0, "creep_compensation": False, "feed_forward": False})
    g, commands = gains(HAND, settings)[:, :1].copy(), []
    for slower in (0.0, 0.065):
        law = Law(g)
        law.state[S.slower] = slower
        law.inputs[:, 0] = [0.62, 0.0, 0.0, 0.6, 0.6, 9e4]
        assert (U.reference, U.limit, U.position, U.pressure) == (0, 3, 4, 5)
        commands.append(float(law.tick(law.inputs, DT_S)[0, 0]))
    per = GAINS[G.response_time, 0] + GAINS[G.dead_time, 0]
    assert commands[0] / commands[1] == pytest.approx((per + 0.065) / per)


def test_the_joint_that_swung_is_named_with_what_to_check() -> None:
    """Fails when diagnostics do not say that a joint has become slower, which, by how much and why."""
    state = np.zeros((len(STATE), len(HAND.joints)))
    assert slowed(HAND.joints, state) == ""
    state[S.slower, 3] = 0.65
    line = slowed(HAND.joints, state)
    assert line.startswith(f"{HAND.joints[3]}: ") and "650 ms" in line and "valve.dead_time_s" in line
    state[S.slower, [1, 5]] = 0.02, 0.9
    assert slowed(HAND.joints, state).startswith(f"{HAND.joints[5]}, and 2 more joints: ")
