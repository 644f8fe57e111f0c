"""Joints that close on a rigid obstacle under a torque limit: the torque they hold, and when contact is reported.

The controller's model of each plant has the errors that an identification leaves; the obstacle is at a random angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_control.declared import OUT, G, Settings, U
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.statics import torque
from hand_sim.plant import CREEP, PHI, HandPlants, P
from validation.paper.step_rig import DRAWN, NOISE_PA, NOISE_RAD, RATE_HZ, draw, many_gains

STIFFNESS_NM_PER_RAD = 20.0
FROM_RAD, TO_RAD = 0.1, 1.6
PERIOD_S = 1.0 / RATE_HZ
FORCE_NOISE_N, FORCE_THRESHOLD_N = 0.05, 0.5
SPEED_RAD_S = float(np.radians(90.0))


@dataclass(frozen=True, slots=True)
class Trial:
    """The result of each joint, (joints,): torques [N m], times [s]; NaN where an event did not happen.

    limit, held (mean of the last second), peak: true actuator torque.  met: time of the first contact.  by_model,
    by_force: time of the report.  false_model, false_force: the report came before the contact.  able: the supply
    suffices for the limit.
    """

    limit: Array
    held: Array
    peak: Array
    met: Array
    by_model: Array
    by_force: Array
    false_model: Flags
    false_force: Flags
    able: Flags
    hours: float


def identified(hand: Hand, plants: Array, settings: Settings, error: float, rng: np.random.Generator) -> Array:
    """Gains (rows, hands * joints): each joint's own constants with relative errors of at most `error` [-]."""
    hands, joints = plants.shape[0], plants.shape[2]
    g = many_gains(hand, settings, hands)
    for name, key in zip(("a0", "a1", "a2", "a3", "inertia", "viscous"), DRAWN, strict=True):
        g[getattr(G, name)] = plants[:, ROW[key]].ravel() * rng.uniform(1.0 - error, 1.0 + error, hands * joints)
    return g


def close_on_obstacles(
    hand: Hand, hands: int, settings: Settings, seed: int, error: float = 0.02, obstacle: bool = True
) -> Trial:
    """Every joint of `hands` hands closes at 90 deg/s from 6 to 92 degrees, obstacles drawn between; 5 s.

    error: largest relative error of the identified constants [-].
    """
    rng = np.random.default_rng([seed, 4])
    plants = draw(hand, hands, 0.3, rng)
    count = hands * len(hand.joints)
    shape = (hands, len(hand.joints))
    angle = rng.uniform(np.radians(15.0), np.radians(75.0), shape)
    plants[:, ROW["contact.angle_deg"]] = angle if obstacle else np.radians(130.0)
    plants[:, ROW["contact.stiffness_nm_per_rad"]] = STIFFNESS_NM_PER_RAD
    limit = rng.uniform(0.05, 0.3, count)
    law = Law(identified(hand, plants, settings, error, rng))
    rig = HandPlants(hand, plants, PERIOD_S)
    shaper = Shaper(count, law.inputs)
    law.inputs[U.limit] = limit
    shaper.latch(np.full(count, FROM_RAD))
    constants = [plants[:, ROW[key]] for key in DRAWN[:4]] + [plants[:, ROW["material.phi_max_deg"]]]
    lead, ticks = round(1.5 * RATE_HZ), round(5.0 * RATE_HZ)
    peak, held, tail = np.zeros(count), np.zeros(count), round(RATE_HZ)
    met, by_model, by_force = (np.full(count, np.nan) for _ in range(3))
    for k in range(-lead, ticks):
        state = rig.state
        seen = state[:, PHI].ravel() + NOISE_RAD * rng.standard_normal(count)
        pressure = state[:, P].ravel() + NOISE_PA * rng.standard_normal(count)
        target = min(FROM_RAD + SPEED_RAD_S * max(k, 0) / RATE_HZ, TO_RAD)
        shaper.step(np.full(count, target), np.zeros(count), settings, PERIOD_S)
        law.inputs[U.position], law.inputs[U.pressure] = seen, pressure
        out = law.tick(law.inputs, PERIOD_S)
        if k >= 0:
            true = torque(state[:, P], state[:, PHI], state[:, CREEP], *constants).ravel()
            peak = np.maximum(peak, true)
            held += np.where(k >= ticks - tail, true / tail, 0.0)
            depth = (state[:, PHI] - plants[:, ROW["contact.angle_deg"]]).ravel()
            force = np.maximum(depth, 0.0) * STIFFNESS_NM_PER_RAD / 0.025 + FORCE_NOISE_N * rng.standard_normal(count)
            _first(met, depth > 0.0, k)
            _first(by_model, out[OUT.contact] != 0.0, k)
            _first(by_force, force > FORCE_THRESHOLD_N, k)
        rig.advance(out[OUT.pressure].reshape(hands, 1, -1).copy())
    early = np.where(np.isnan(met), np.inf, met)
    return Trial(
        limit, held, peak, met, by_model, by_force, by_model < early - 0.01, by_force < early - 0.01,
        rig.state[:, P].ravel() < 0.99 * hand.supply_pressure_pa,
        count * ticks / RATE_HZ / 3600.0,
    )  # fmt: skip


def _first(when: Array, now: Flags, tick: int) -> None:
    when[now & np.isnan(when)] = tick / RATE_HZ
