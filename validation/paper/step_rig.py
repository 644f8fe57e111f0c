"""The protocol of Fig. 14 on many plants at once: steps between 30 and 80 degrees over 30 s, under the law or a PID.

The plants differ from the model in each of a0 ... a3, J and d, creep is on, and both controllers get the same noise and
the same reference: the steps after the reference filter of the controller. Errors are given against the reference and
against the unfiltered steps.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution

from hand_control.declared import OUT, G, Settings, U
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_control.tuning import gains
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.statics import pressure_for_torque
from hand_sim.plant import PHI, HandPlants, P

RATE_HZ, DURATION_S, HOLD_S, SETTLE_S = 200.0, 30.0, 3.0, 3.0
LOW_RAD, HIGH_RAD = float(np.radians(30.0)), float(np.radians(80.0))
NOISE_RAD, NOISE_PA = float(np.radians(0.02)), 100.0
DRAWN = (
    "statics.a0_nm",
    "statics.a1_nm_per_rad",
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
)
REACH_PA = 5.0e5
"""A plant that needs more pressure to hold 80 degrees at rest is redrawn: it has no supply left to move there."""


@dataclass(frozen=True, slots=True)
class Run:
    """angle (samples, joints) [rad], pressure commands (samples, joints) [Pa], the reference (3, samples)."""

    angle: Array
    command: Array
    reference: Array

    @property
    def rms_deg(self) -> Array:
        """RMS error against the reference, (joints,) [deg]."""
        return _rms_deg(self.angle, self.reference[0])

    @property
    def rms_step_deg(self) -> Array:
        """RMS error against the unfiltered steps, (joints,) [deg]."""
        return _rms_deg(self.angle, steps())

    @property
    def travel_pa(self) -> Array:
        """Sum of the absolute changes of the command, (joints,) [Pa]."""
        travel: Array = np.abs(np.diff(self.command, axis=0)).sum(axis=0)
        return travel

    @property
    def overshoot(self) -> Array:
        """Largest overshoot as a share of the step, (joints,)."""
        target, over = steps(), np.zeros(self.angle.shape[1])
        edges = [*np.flatnonzero(np.diff(target) != 0.0), len(target) - 1]
        for begin, end in itertools.pairwise(edges):
            part = self.angle[begin + 1 : end]
            rising = target[begin + 1] > target[begin]
            peak = part.max(axis=0) - HIGH_RAD if rising else LOW_RAD - part.min(axis=0)
            over = np.maximum(over, peak / (HIGH_RAD - LOW_RAD))
        return over


def steps() -> Array:
    """The unfiltered steps (samples,) [rad]."""
    tick = np.arange(round(DURATION_S * RATE_HZ))
    return np.where((tick / (HOLD_S * RATE_HZ)).astype(int) % 2 == 1, HIGH_RAD, LOW_RAD)


def reference(settings: Settings) -> Array:
    """Steps through the reference filter: angle, speed and acceleration, (3, samples), SI."""
    target, shaper = steps(), Shaper(1)
    shaper.latch(target[:1])
    out = np.empty((3, len(target)))
    for k, angle in enumerate(target):
        shaper.step(np.array([angle]), np.zeros(1), settings, 1.0 / RATE_HZ)
        out[:, k] = shaper.r[0], shaper.v[0], shaper.a[0]
    return out


def draw(hand: Hand, hands: int, error: float, rng: np.random.Generator) -> Array:
    """Parameters (hands, rows, joints); each of DRAWN has a uniform relative error of at most `error` [-]."""
    parameters = np.repeat(hand.parameters[None], hands, axis=0)
    todo = np.ones((hands, len(hand.joints)), dtype=np.bool_)
    while todo.any():
        for key in DRAWN:
            factor = rng.uniform(1.0 - error, 1.0 + error, todo.shape)
            parameters[:, ROW[key]] = np.where(todo, hand.row(key) * factor, parameters[:, ROW[key]])
        a0, a1, a2, a3 = (parameters[:, ROW[key]] for key in DRAWN[:4])
        needed_pa = pressure_for_torque(0.0, HIGH_RAD, 0.0, a0, a1, a2, a3, 0.0)
        todo = (needed_pa > REACH_PA) | (a2 + a3 * HIGH_RAD <= 0.0)
    return parameters


def many_gains(hand: Hand, settings: Settings, hands: int) -> Array:
    """The law's gains, SI, for many hands side by side, (rows, hands * joints); partners stay within their hand."""
    joints = len(hand.joints)
    g = np.tile(gains(hand, settings), (1, hands))
    partner = g[G.partner]
    g[G.partner] = np.where(partner >= 0.0, partner + np.repeat(np.arange(hands) * joints, joints), -1.0)
    return g


def run_law(hand: Hand, parameters: Array, settings: Settings, seed: int) -> Run:
    """The controller's law, with the model of `hand`, on plants (hands, rows, joints), SI."""
    hands = parameters.shape[0]
    law = Law(many_gains(hand, settings, hands))
    inputs = law.inputs
    inputs[U.limit] = np.tile(hand.limits.max_torque_nm, hands)

    def control(target: Array, angle: Array, pressure: Array) -> Array:
        inputs[:3] = target[:, None]
        inputs[U.position], inputs[U.pressure] = angle, pressure
        sent: Array = law.tick(inputs, 1.0 / RATE_HZ)[OUT.pressure]
        return sent

    return closed_loop(hand, parameters, reference(settings), control, seed)


def run_pid(hand: Hand, parameters: Array, settings: Settings, pid: Array, seed: int) -> Run:
    """Fixed-gain PIDs in pressure; pid (4, joints): Kp, Ki, Kd in Pa per rad, and the filter time [s] of D."""
    angles = parameters.shape[0] * parameters.shape[2]
    kp, ki, kd, filter_s = pid
    integral, slope, last = np.zeros(angles), np.zeros(angles), np.full(angles, np.nan)
    share = 1.0 / (1.0 + filter_s * RATE_HZ)

    def control(target: Array, angle: Array, _pressure: Array) -> Array:
        nonlocal integral, slope, last
        error = target[0] - angle
        rate = (angle - np.where(np.isnan(last), angle, last)) * RATE_HZ
        slope, last = slope + share * (rate - slope), angle
        wanted = kp * error + integral - kd * slope
        command: Array = np.clip(wanted, 0.0, 6e5)
        integral = integral + np.where((wanted - command) * error <= 0.0, ki * error / RATE_HZ, 0.0)
        return command

    return closed_loop(hand, parameters, reference(settings), control, seed)


def tune_pid(
    hand: Hand, settings: Settings, seed: int, rounds: int = 30, plants: Array | None = None, crowd: int = 10
) -> Array:
    """The fixed gains (4,), SI, with the least RMS error, overshoot at most 5 %, all joints alike.

    plants: (hands, rows, joints) to tune on; the nominal one where None.  crowd: members of the search per gain.
    """
    tuned_on = hand.parameters[None] if plants is None else plants
    joints = tuned_on.shape[0] * tuned_on.shape[2]

    def cost(logs: Array) -> Array:
        trials = np.atleast_2d(logs.T)
        each = np.repeat(10.0**trials, joints, axis=0).T
        run = run_pid(hand, np.tile(tuned_on, (len(trials), 1, 1)), settings, each, seed)
        over = run.overshoot.reshape(-1, joints).max(axis=1)
        price: Array = run.rms_deg.reshape(-1, joints).mean(axis=1) + 200.0 * np.maximum(over - 0.05, 0.0)
        return price

    bounds = [(4.0, 6.5), (4.0, 7.7), (2.0, 5.0), (-3.0, -1.0)]
    found = differential_evolution(
        cost, bounds, vectorized=True, updating="deferred", popsize=crowd, maxiter=rounds, polish=False, rng=seed
    )
    best: Array = 10.0**found.x
    return best


def closed_loop(
    hand: Hand, parameters: Array, target: Array, control: Callable[[Array, Array, Array], Array], seed: int
) -> Run:
    """Plants (hands, rows, joints) under control(target (3,), angles, pressures) -> commands, all (hands * joints,),
    SI."""
    rng = np.random.default_rng([seed, 14])
    hands, joints = parameters.shape[0], parameters.shape[2]
    plants = HandPlants(hand, parameters, 1.0 / RATE_HZ)
    count = target.shape[1]
    angle, command = np.empty((count, hands * joints)), np.empty((count, hands * joints))
    still = np.array([target[0, 0], 0.0, 0.0])
    for k in range(-round(SETTLE_S * RATE_HZ), count):
        state = plants.state
        seen = state[:, PHI].ravel() + NOISE_RAD * rng.standard_normal(hands * joints)
        pressure = state[:, P].ravel() + NOISE_PA * rng.standard_normal(hands * joints)
        sent = control(target[:, k] if k >= 0 else still, seen, pressure)
        if k >= 0:
            angle[k], command[k] = state[:, PHI].ravel(), sent
        plants.advance(sent.reshape(hands, 1, joints).copy())
    return Run(angle, command, target)


def _rms_deg(angle: Array, target: Array) -> Array:
    rms: Array = np.degrees(np.sqrt(np.mean((angle - target[:, None]) ** 2, axis=0)))
    return rms
