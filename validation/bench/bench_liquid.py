"""Steps of hands filled with a liquid under the whole controller, its supervisor and sensor checks included.

Map, inertia, viscous friction and the volume that a pressure displaces differ from the controller's model; friction is
Coulomb's. The plant is the simulated hand, whose equations the controller's checks share.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from validation.bench.result import figure
from validation.faults.sensor_loop import Loop, Plant

SEED, HANDS = 20261123, 10
ERRORS = (0.0, 0.1, 0.2, 0.3)
TARGETS_DEG, HOLD_S = (30.0, 70.0, 40.0, 10.0, 70.0, 30.0), 2.0
VOLUME = "hydraulic.volume_m3_per_pa"


def run(quick: bool) -> list[dict[str, Any]]:
    """Hands that vent themselves and the error at rest, for each error of the model; quick: one hand 30 % off."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    errors, hands = (ERRORS[-1:], 1) if quick else (ERRORS, HANDS)
    results = []
    for error in errors:
        late = [steps(hand, error, number) for number in range(hands)]
        driven = np.array([np.abs(part) for part, _ in late if part is not None])
        faults = [line for part, line in late if part is None]
        for line in faults:
            print(f"model within {100 * error:g} %: {line}")
        name = f"liquid, model within {100 * error:g} %"
        results.append(figure(f"{name}: hands of {hands} that vent themselves", len(faults), 0.0, ""))
        if len(driven):
            results.append(figure(f"{name}: error at rest, 95th percentile", np.quantile(driven, 0.95), 1.0, "deg"))
    return results


def steps(hand: Hand, error: float, number: int) -> tuple[Array | None, str]:
    """Errors (steps, joints) [deg] at the ends of the steps of one hand, None where it was vented, and the fault.

    error: largest relative error of each constant [-].  number: of the hand; it seeds the plant.
    """
    rng = np.random.default_rng([SEED, number, round(100 * error)])
    loop = Loop(hand, Plant(error=error, liquid=True), int(rng.integers(2**31)))
    joints = len(hand.joints)
    loop.change(VOLUME, loop.hand.row(VOLUME) * rng.uniform(1.0 - error, 1.0 + error, joints))
    loop.controller.enable(True)
    loop.step()
    late = []
    for target_deg in TARGETS_DEG:
        loop.command(np.full(joints, np.radians(target_deg)))
        for _ in range(round(HOLD_S * loop.rate_hz)):
            if not loop.step():
                return None, loop.controller.safety.fault
        late.append(np.degrees(loop.angle) - target_deg)
    return np.array(late), ""
