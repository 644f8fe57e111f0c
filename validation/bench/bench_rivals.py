"""This controller compared with four others on plants of another form, with constants up to 30 % off the description.

Every controller gets the same plants (`rough_plant`), noise and reference: the steps after the reference filter. The
others are tuned by differential evolution on joints of the same kind that are drawn separately, so that each is at its
best for wrong plants; this controller has its default settings.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from hand_control.declared import OUT, Settings, U
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from validation.bench.result import figure
from validation.bench.rivals import Control, fixed_pid, lqg, scheduled_pi, simple_pid
from validation.bench.rough_plant import PHI, P, RoughPlants, draw, partners
from validation.paper.step_rig import many_gains

SEED, RATE_HZ, ERROR = 20261126, 200.0, 0.3
NOISE_RAD, NOISE_PA = float(np.radians(0.03)), 150.0
LOW_DEG, HIGH_DEG, HOLD_S, SETTLED_DEG = 30.0, 80.0, 2.0, 1.0


class Rival(NamedTuple):
    """A controller, and the bounds of the logarithms of its tuning numbers."""

    name: str
    make: Callable[[Hand, int, float, Array], Control]
    bounds: tuple[tuple[float, float], ...]


RIVALS = (
    Rival("fixed PID", fixed_pid, ((4.0, 6.0), (4.5, 7.0), (2.0, 4.5), (-2.5, -1.3))),
    Rival("simple-pid", simple_pid, ((4.0, 6.0), (4.5, 7.0), (1.0, 4.5))),
    Rival("scheduled PI with feed-forward", scheduled_pi, ((-1.5, 0.0), (-2.5, -0.7))),
    Rival("LQG with feed-forward", lqg, ((-1.0, 2.5), (-4.0, 0.0), (-4.0, 0.0), (-2.5, -0.7))),
)


def run(quick: bool) -> list[dict[str, Any]]:
    """Settling, overshoot and unsettled steps of each controller; quick: one hand, one rival, a short search."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    settings, hands = Settings.of(hand, {}), 1 if quick else 8
    q = draw(hand, hands, ERROR, np.random.default_rng([SEED, 1]))
    results = _figures("this controller", steps(hand, settings, q, _ours(hand, settings, hands)))
    for rival in RIVALS[2:3] if quick else RIVALS:
        tuning = tuned(hand, settings, rival, 2 if quick else 10)
        print(f"{rival.name}: tuning 10^{np.round(tuning, 2).tolist()}")
        results += _figures(rival.name, steps(hand, settings, q, rival.make(hand, hands, 1.0 / RATE_HZ, tuning)))
    return results


def _ours(hand: Hand, settings: Settings, hands: int) -> Control:
    law = Law(many_gains(hand, settings, hands))
    law.inputs[U.limit] = np.tile(hand.limits.max_torque_nm, hands)
    before = np.zeros(law.inputs.shape[1])

    def control(reference: Array, speed: Array, angle: Array, pressure: Array) -> Array:
        law.inputs[U.acceleration] = (speed - before) * RATE_HZ
        before[:] = speed
        for row, values in ((U.reference, reference), (U.speed, speed), (U.position, angle), (U.pressure, pressure)):
            law.inputs[row] = values
        sent: Array = law.tick(law.inputs, 1.0 / RATE_HZ)[OUT.pressure]
        return sent

    return control


def tuned(hand: Hand, settings: Settings, rival: Rival, rounds: int) -> Array:
    """Logarithms (numbers,) [-] of the tuning with the least settling time and overshoot on other wrong plants."""
    q = draw(hand, 1, ERROR, np.random.default_rng([SEED, 2]))

    def cost(tuning: Array) -> float:
        settle, over = steps(hand, settings, q, rival.make(hand, 1, 1.0 / RATE_HZ, tuning), count=3)
        return float(settle.mean() + np.quantile(settle, 0.95) + 10.0 * np.maximum(over - 0.05, 0.0).mean())

    found = differential_evolution(cost, rival.bounds, popsize=6, maxiter=rounds, polish=False, rng=SEED)
    return np.asarray(found.x)


def steps(hand: Hand, settings: Settings, q: Array, control: Control, count: int = 8) -> tuple[Array, Array]:
    """Settling times [s] and overshoots [-], (steps, n), of plants q under a controller; unsettled is HOLD_S."""
    rng, n = np.random.default_rng([SEED, 3]), q.shape[1]
    hands = n // len(hand.joints)
    plants = RoughPlants(q, partners(hand, hands), 1.0 / RATE_HZ)
    shaper = Shaper(n, None, (np.tile(hand.limits.low_rad, hands), np.tile(hand.limits.high_rad, hands)))
    shaper.latch(plants.state[PHI])
    length = round(HOLD_S * RATE_HZ)
    angle = np.empty(((count + 2) * length, n))
    for k in range(len(angle)):
        goal = HIGH_DEG if k // length % 2 == 0 and k >= length else LOW_DEG
        shaper.step(np.full(n, np.radians(goal)), np.zeros(n), settings, 1.0 / RATE_HZ)
        seen = plants.state[PHI] + NOISE_RAD * rng.standard_normal(n)
        pressure = plants.state[P] + NOISE_PA * rng.standard_normal(n)
        plants.advance(np.clip(control(shaper.r, shaper.v, seen, pressure), 0.0, 6e5))
        angle[k] = np.degrees(plants.state[PHI])
    settle, over = [], []
    for number in range(2, count + 2):
        part = angle[number * length : (number + 1) * length]
        goal, sign = (HIGH_DEG, 1.0) if number % 2 == 0 else (LOW_DEG, -1.0)
        outside = np.abs(part - goal) > SETTLED_DEG
        settle.append(np.where(outside.any(axis=0), length - outside[::-1].argmax(axis=0), 0) / RATE_HZ)
        over.append(np.maximum((sign * (part - goal)).max(axis=0), 0.0) / (HIGH_DEG - LOW_DEG))
    return np.array(settle), np.array(over)


def _figures(name: str, measured: tuple[Array, Array]) -> list[dict[str, Any]]:
    settle, over = measured
    return [
        figure(f"{name}: settling time, median", np.median(settle), None, "s"),
        figure(f"{name}: settling time, 95th percentile", np.quantile(settle, 0.95), None, "s"),
        figure(f"{name}: overshoot, 95th percentile", 100 * np.quantile(over, 0.95), None, "%"),
        figure(f"{name}: largest overshoot", 100 * over.max(), None, "%"),
        figure(f"{name}: not settled in {HOLD_S:g} s", 100 * (settle >= HOLD_S - 0.01).mean(), None, "%"),
    ]
