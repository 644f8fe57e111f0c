"""Other controllers for the same joints: fixed PID, simple-pid, scheduled PI with feed-forward, and LQG.

Each is made for n joints from a vector of tuning numbers, and gives set-points [Pa] from reference, its speed, measured
angle [rad] and pressure [Pa], every period. All know the description of the hand; none adapts.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm, solve_discrete_are
from simple_pid import PID

from hand_model.arrays import Array
from hand_model.description import Hand

Control = Callable[[Array, Array, Array, Array], Array]
"""(reference, its speed, angle, pressure), (n,) each -> set-points (n,) [Pa]."""
MOST_PA = 6.0e5
MIDDLE_RAD = float(np.radians(55.0))
"""Angle at which the linear model of the LQG holds."""


def fixed_pid(hand: Hand, hands: int, period_s: float, tuning: Array) -> Control:
    """PID with filtered derivative. tuning (numbers,): logarithms of Kp, Ki, Kd [Pa/rad ...] and filter time [s]."""
    kp, ki, kd, filter_s = 10.0**tuning
    n = hands * len(hand.joints)
    integral, slope, last = np.zeros(n), np.zeros(n), np.full(n, np.nan)

    def control(reference: Array, speed: Array, angle: Array, pressure: Array) -> Array:
        nonlocal slope, last
        error = reference - angle
        rate = np.where(np.isnan(last), 0.0, angle - last) / period_s
        slope, last = slope + period_s / (period_s + filter_s) * (rate - slope), angle.copy()
        wanted = kp * error + integral - kd * slope
        command = np.clip(wanted, 0.0, MOST_PA)
        integral[:] += np.where((wanted - command) * error <= 0.0, ki * error * period_s, 0.0)
        return np.asarray(command, dtype=np.float64)

    return control


def simple_pid(hand: Hand, hands: int, period_s: float, tuning: Array) -> Control:
    """The library simple-pid, one object a joint. tuning (numbers,): logarithms of Kp, Ki, Kd [Pa/rad ...]."""
    kp, ki, kd = 10.0**tuning
    objects = [
        PID(kp, ki, kd, sample_time=None, output_limits=(0.0, MOST_PA), differential_on_measurement=True)
        for _ in range(hands * len(hand.joints))
    ]

    def control(reference: Array, speed: Array, angle: Array, pressure: Array) -> Array:
        for pid, wanted in zip(objects, reference, strict=True):
            pid.setpoint = float(wanted)
        return np.array([pid(float(at), period_s) for pid, at in zip(objects, angle, strict=True)])

    return control


def scheduled_pi(hand: Hand, hands: int, period_s: float, tuning: Array) -> Control:
    """Feed-forward of Eq. 6 with lead, and a PI whose gains follow the stiffness over the leverage.

    tuning (numbers,): logarithms of the closed-loop time constant [s] and of the lead of the feed-forward [s].
    """
    response_s, lead_s = 10.0**tuning
    a0, a1, a2, a3, d = (np.tile(hand.row(key), hands) for key in _KEYS)
    lag = np.tile(hand.row("valve.time_constant_s"), hands)
    integral = np.zeros(len(a0))

    def control(reference: Array, speed: Array, angle: Array, pressure: Array) -> Array:
        at, error = reference + lead_s * speed, reference - angle
        lever, stiffness = np.maximum(a2 + a3 * angle, 1e-7), -(a1 + a3 * pressure)
        hold = (d * speed - a0 - a1 * at) / np.maximum(a2 + a3 * at, 1e-7)
        wanted = hold + ((d + stiffness * lag) / response_s * error + integral) / lever
        command = np.clip(wanted, 0.0, MOST_PA)
        growth = stiffness / response_s * error * period_s
        integral[:] += np.where((wanted - command) * error <= 0.0, growth, 0.0)
        return np.asarray(command, dtype=np.float64)

    return control


_KEYS = ("statics.a0_nm", "statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad",
         "dynamics.viscous_friction_nm_s_per_rad")  # fmt: skip


def lqg(hand: Hand, hands: int, period_s: float, tuning: Array) -> Control:
    """LQR with integral action and Kalman filter (scipy's Riccati solver), in addition to the feed-forward of Eq. 6.

    The linear model has angle, speed and pressure; the filter also estimates a disturbing torque. tuning (numbers,):
    logarithms of the weight of the integral [1/s^2], of that of the pressure [rad^2/bar^2], of the disturbance's noise
    [N m/s^0.5], and of the lead of the feed-forward [s].
    """
    integral_weight, effort, noise, lead_s = 10.0**tuning
    a0, a1, a2, a3, d = (hand.row(key) for key in _KEYS)
    inertia, lag = hand.row("dynamics.inertia_kg_m2"), hand.row("valve.time_constant_s")
    hold = -(a0 + a1 * MIDDLE_RAD) / (a2 + a3 * MIDDLE_RAD)
    gains, filters, models = [], [], []
    for j in range(len(a0)):
        k, lever = -(a1[j] + a3[j] * hold[j]), 1e5 * (a2[j] + a3[j] * MIDDLE_RAD)
        rates = np.zeros((5, 5))  # angle, speed, pressure [bar], disturbance, set-point [bar]
        rates[0, 1] = 1.0
        rates[1, :4] = np.array([-k, -d[j], lever, 1.0]) / inertia[j]
        rates[2, 2], rates[2, 4] = -1.0 / lag[j], 1.0 / lag[j]
        step = expm(rates * period_s)
        f, g = step[:4, :4], step[:4, 4:]
        wide = np.zeros((4, 4))
        wide[:3, :3], wide[3, 3], wide[3, 0] = f[:3, :3], 1.0, period_s
        drive = np.vstack([g[:3], np.zeros((1, 1))])
        cost, price = np.diag([1.0, 1e-4, 1e-6, integral_weight]), np.array([[effort]])
        riccati = solve_discrete_are(wide, drive, cost, price)
        gains.append(np.linalg.solve(price + drive.T @ riccati @ drive, drive.T @ riccati @ wide)[0])
        seen = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
        process = np.diag([1e-10, 1e-4, 1e-6, noise**2 * period_s])
        measured = np.diag([(5e-4) ** 2, (1.5e-3) ** 2])
        spread = solve_discrete_are(f.T, seen.T, process, measured)
        filters.append(spread @ seen.T @ np.linalg.inv(seen @ spread @ seen.T + measured))
        models.append(np.hstack([f, g]))
    gain, kalman, model = (np.tile(np.array(x), (hands, *[1] * (np.ndim(x) - 1))) for x in (gains, filters, models))
    c0, c1, c2, c3, drag = (np.tile(values, hands) for values in (a0, a1, a2, a3, d))
    state, integral = np.zeros((len(c0), 4)), np.zeros(len(c0))
    started = False

    def control(reference: Array, speed: Array, angle: Array, pressure: Array) -> Array:
        nonlocal started
        at = reference + lead_s * speed
        still = (-c0 - c1 * reference) / np.maximum(c2 + c3 * reference, 1e-7)
        ahead = (drag * speed - c0 - c1 * at) / np.maximum(c2 + c3 * at, 1e-7)
        if not started:
            state[:, 0], state[:, 2], started = angle - MIDDLE_RAD, 1e-5 * pressure - np.tile(1e-5 * hold, hands), True
        seen = np.stack([angle - MIDDLE_RAD, 1e-5 * pressure - np.tile(1e-5 * hold, hands)], axis=1)
        state[:] += np.einsum("nij,nj->ni", kalman, seen - state[:, [0, 2]])
        error = state[:, 0] + MIDDLE_RAD - reference
        moving, above = state[:, 1] - speed, state[:, 2] + np.tile(1e-5 * hold, hands) - 1e-5 * still
        change = -(gain[:, 0] * error + gain[:, 1] * moving + gain[:, 2] * above + gain[:, 3] * integral)
        wanted = ahead + 1e5 * change
        command = np.clip(wanted, 0.0, MOST_PA)
        integral[:] += np.where((wanted - command) * error >= 0.0, error * period_s, 0.0)
        given = np.concatenate([state, (1e-5 * command - np.tile(1e-5 * hold, hands))[:, None]], axis=1)
        state[:] = np.einsum("nij,nj->ni", model, given)
        return np.asarray(command, dtype=np.float64)

    return control
