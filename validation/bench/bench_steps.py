"""A step from 30 to 80 degrees on every joint of the simulated hand, from ADC counts to set-points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hand_model.description import load_hand
from validation.bench.result import figure
from validation.step_response import figures, step_response

SETTLE_GOAL_S, OVERSHOOT_GOAL_PERCENT = 1.5, 5.0
SEED = 20


def run(quick: bool) -> list[dict[str, Any]]:
    """Settling time and overshoot at 200, 500 and 1000 Hz; quick: at 200 Hz only, with the same result there."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    results = []
    for rate_hz in (200,) if quick else (200, 500, 1000):
        settle_s, overshoot = figures(step_response(hand, rate_hz, SEED), rate_hz)
        for what, value, goal, unit in (
            ("settling time", settle_s, SETTLE_GOAL_S, "s"),
            ("overshoot", overshoot, OVERSHOOT_GOAL_PERCENT, "%"),
        ):
            name = f"step from 30 to 80 degrees at {rate_hz} Hz, worst joint: {what}"
            results.append(figure(name, value, goal, unit))
    return results
