"""A hand whose valves have a dead time, or friction, that the law does not know: whether it swings, and is watched."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hand_control.declared import C, G, S, Settings
from hand_control.law import Law
from hand_model.arrays import Array
from hand_model.description import load_hand
from validation.bench.bench_motion import ERROR, HOLD_S, Bench, swings_deg, up_and_down
from validation.bench.rough_plant import Q, draw

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
SETTINGS = Settings.of(HAND, {})


def moved(change: Callable[[Array], None], watching: bool, monkeypatch: pytest.MonkeyPatch) -> tuple[Array, Law]:
    """Swing [deg] (rests, joints) in the last second of four rests of one hand of rough plants, and its law.

    change: of the plants.  watching: False: the response time never gets longer.
    """
    made: list[Law] = []

    class Watched(Law):
        def __init__(self, g: Array) -> None:
            super().__init__(g)
            made.append(self)

        def tick(self, *args, **kwargs):  # type: ignore[no-untyped-def]
            if not watching:
                self.state[[S.peak, S.last_peak, S.slower]] = 0.0
            return super().tick(*args, **kwargs)

    monkeypatch.setattr("validation.bench.bench_motion.Law", Watched)
    bench = Bench(HAND, SETTINGS, 1, 7)
    q = draw(HAND, 1, ERROR, np.random.default_rng(7))
    change(q)
    angle = np.array([s.angle for s in bench.ticks(q, ERROR, bench.limits(), up_and_down, 5 * HOLD_S)])
    return swings_deg(angle, 4), made[0]


def test_a_dead_time_that_the_model_lacks_does_not_make_the_hand_swing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a valve with ten times the described dead time swings; without the watch it does (seed 7)."""

    def slow(q: Array) -> None:
        q[Q["delay"]] = 0.05

    with_watch, law = moved(slow, True, monkeypatch)
    without, _ = moved(slow, False, monkeypatch)
    assert (with_watch < 1.0).all() and (without > 3.0).mean() > 0.2
    assert (law.state[S.slower] < C.most_slower * law.gains[G.response_time]).all()


@pytest.mark.parametrize("friction_nm", [0.0, 0.003, 0.010])
def test_a_usual_hand_keeps_its_response_time(friction_nm: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when constants 30 % off the model, or stick and slip, count as a swing (plants of seed 7)."""

    def rough(q: Array) -> None:
        q[Q["friction"]] = friction_nm

    swing, law = moved(rough, True, monkeypatch)
    assert not law.state[S.slower].any() and math.isfinite(swing.max())
