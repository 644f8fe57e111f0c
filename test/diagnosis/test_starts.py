"""Starts elsewhere: a fit that ended in a wrong minimum arrives from one of them."""

from __future__ import annotations

import numpy as np

from hand_diagnosis.problem import Task
from hand_diagnosis.search import ELSEWHERE
from hand_identification.free_parameters import effect_free_parameters, merged
from hand_identification.map_fit import costs_at, map_fit
from hand_identification.starts import around
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import ROW
from test.diagnosis.recordings import changed, record

JOINT = "ring_proximal"
SEED = 77


def test_a_limit_that_does_not_act_is_left(hand: Hand) -> None:
    """Fails when a fit of a narrow valve that ended without its limit of venting, which has no slope, stays there."""
    print(f"seed {SEED}")
    rates = {"valve__fill_rate_pa_per_s": 3e5, "valve__vent_rate_pa_per_s": 2.5e5, "valve_flow_limit__choking": 1.0}
    signals = record(changed(hand, JOINT, **rates), np.random.default_rng(SEED), 16.0)
    ready = Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={}).prepare(
        JOINT
    )
    effect = EFFECTS["valve_flow_limit"]
    free = merged(ready.free, effect_free_parameters(effect, ready.problem.nominal))
    off = {"valve.vent_rate_pa_per_s", "valve_flow_limit.choking"}
    part = [p for p in free if p.key not in off]
    start = [p.coordinate(3e5) if p.key == "valve.fill_rate_pa_per_s" else 0.0 for p in part]
    known = {p.row: z for p, z in zip(part, map_fit(ready.problem, part, np.array(start), 10).z, strict=True)}
    wrong = map_fit(ready.problem, free, np.array([known.get(p.row, 0.0) for p in free]), 1)
    rows = {ROW[key] for key in effect.keys}
    points = around(ready.problem, wrong, rows, ELSEWHERE, np.random.default_rng(SEED))
    costs = costs_at(ready.problem, free, np.array(points))
    again = min(map_fit(ready.problem, free, point, 15).cost for point in points)
    print(wrong.cost, costs, again)
    assert len(points) <= ELSEWHERE.kept
    assert costs.min() < 0.9 * wrong.cost  # nearer than where the fit stands
    assert again < 0.05 * wrong.cost
