"""The control law of every joint: adaptive PID around the actuator's model. Structure of arrays, numba.

The PID works in torque and the model turns torque into pressure, so that its gains mean the same at every angle:

    e   = phi_ref - phi,   v = filtered speed of the measured angle                        [rad, rad/s]
    tau = Kp e + I + Kd (phi_ref' - v),   I' = Ki e                                        [N m]
    p   = p_hold + T p_hold' phi_ref' + (d phi_ref' + (J + d T) phi_ref'') / (a2 + a3 phi_ref)
        + tau / (a2 + a3 phi)

p_hold is the pressure at which Eq. 11 with the present creeping ratio (Eq. 12, from the measured pressure) gives no
torque at the reference. T, the valve's lag and dead time, leads a moving reference by as much as the valve follows it
late; the acceleration term holds the joint's inertia and the lead of its friction.

Scheduled gains follow the model over (phi, p): the joint's stiffness k = -(a1 + a3 p), its friction and the valve's lag
are cancelled and replaced by one closed-loop time constant R (internal model control; Rivera, Morari, Skogestad 1986):
Ki = k / R, Kp = (d + k T) / R, Kd = (d T + J) / R.

p is cut to 0 ... the lowest of the pressure limit and the torque ceiling, the pressure at which Eq. 11 gives the
maximum torque at the measured angle; its rate is bounded; at rest it is filtered, a change smaller than the dead-band
is not sent, and the integrator stands still where the error is one that the dead-band itself leaves, so that no limit
cycle remains. Anti-windup is conditional integration, or back-calculation with a tracking time.

The map adapts (`adapt.py`) and contact is detected (`contact.py`) from the same filtered torque balance. After any
change of the gains the integrator takes over what else would jump. A joint whose measurement or reference is not
finite keeps its last command, which is finite: no non-finite number leaves the law.
"""

from __future__ import annotations

import hashlib
import inspect
import math
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from hand_control.adapt import adapt, doubt, forget, map_variance
from hand_control.contact import detect, refuted
from hand_control.law_rows import CONTACT, CONTACT_AGE, CONTACT_TORQUE, OUTPUT, PRESSURE, SATURATED, STATE, TORQUE, G, S
from hand_model.arrays import Array
from hand_model.material import creep_rate
from hand_model.statics import pressure_for_torque, torque

_A0, _A1, _A2, _A3, _PHI_MAX = G["a0"], G["a1"], G["a2"], G["a3"], G["phi_max"]
_P_MIN, _B1, _T_EXT, _B0, _T_REC = G["p_min"], G["b1"], G["extension_rate"], G["b0"], G["recovery_rate"]
_J, _D, _JC, _PARTNER = G["inertia"], G["viscous"], G["coupling"], G["partner"]
_LAG, _DEAD, _HIGH, _P_MAX = G["valve_lag"], G["dead_time"], G["high"], G["p_max"]
_KP, _KI, _KD, _I_MAX, _T_SPEED, _T_OBS = (
    G["kp"], G["ki"], G["kd"], G["i_max"], G["speed_filter"], G["observer_filter"]
)  # fmt: skip
_STD, _MAP_ERROR = G["residual_std"], G["map_error"]
_RATE, _BAND, _TRACK, _RESPONSE = G["p_rate"], G["deadband"], G["tracking_time"], G["response_time"]
_BACK, _FORWARD, _CREEPS, _SCHEDULE, _ADAPT, _DETECT, _TORQUE_MODE = (
    G["back_calculation"], G["feed_forward"], G["creep"], G["schedule"], G["adapt"], G["detect"], G["torque_mode"]
)  # fmt: skip
_INTEGRAL, _COMMAND, _FRESH, _CREEP, _LAST, _SPEED = (
    S["integral"], S["command"], S["fresh"], S["creep"], S["last"], S["speed"]
)  # fmt: skip
_F1, _F2, _P1, _P2, _Q1, _Q2, _ACC, _STARTED = (
    S["phi_1"], S["phi_2"], S["p_1"], S["p_2"], S["q_1"], S["q_2"], S["acceleration"], S["started"]
)  # fmt: skip
_D0, _D1, _D3, _DD = S["d_a0"], S["d_a1"], S["d_a3"], S["d_viscous"]
_IN_CONTACT, _AGE, _CALM = S["contact"], S["age"], S["calm"]
_MIN_LEVERAGE = 1e-9
_REST_RAD_S, _MOVING_RAD_S, _REST_RAD, _CALM_S = 0.02, 0.3, 0.01, 0.1
"""A joint rests whose reference stands, that is slower and nearer than this; then commands are filtered so long."""
_NOISE_RAD = 3e-4
"""An error smaller than this is noise of the angle sensor; the integrator does not follow it while a dead-band acts."""


@njit(cache=True, inline="always", error_model="numpy")
def _observe(g, s, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Advance the filters of joint i by dt [s]: speed, creeping ratio and twice filtered angle, pressure and p phi.

    Filters are backward Euler, so that (phi_1 - phi_2) / T is the exact difference quotient of phi_2.
    """
    if s[_STARTED, i] == 0.0:
        s[_STARTED, i] = 1.0
        s[_LAST, i] = s[_F1, i] = s[_F2, i] = phi
        s[_P1, i] = s[_P2, i] = p
        s[_Q1, i] = s[_Q2, i] = p * phi
        s[_SPEED, i] = 0.0
        return
    if dt <= 0.0:
        return
    rate = (phi - s[_LAST, i]) / dt
    s[_SPEED, i] += dt / (dt + g[_T_SPEED, i]) * (rate - s[_SPEED, i])
    s[_LAST, i] = phi
    t = g[_T_OBS, i]
    share = dt / (dt + t)
    s[_F1, i] += share * (phi - s[_F1, i])
    s[_P1, i] += share * (p - s[_P1, i])
    s[_Q1, i] += share * (p * phi - s[_Q1, i])
    s[_F2, i] += share * (s[_F1, i] - s[_F2, i])
    s[_P2, i] += share * (s[_P1, i] - s[_P2, i])
    s[_Q2, i] += share * (s[_Q1, i] - s[_Q2, i])
    s[_ACC, i] = (phi - 2.0 * s[_F1, i] + s[_F2, i]) / (t * t)
    if g[_CREEPS, i] != 0.0:
        step = creep_rate(p, s[_CREEP, i], g[_P_MIN, i], g[_B1, i], g[_T_EXT, i], g[_B0, i], g[_T_REC, i]) * dt
        s[_CREEP, i] = min(max(s[_CREEP, i] + step, 0.0), 1.0)


@njit(cache=True, inline="always", error_model="numpy")
def _cut(g, s, i, wanted, ceiling, dt):  # type: ignore[no-untyped-def]
    """What is sent of a wanted pressure: limits, bounded rate, dead-band."""
    command = min(max(wanted, 0.0), ceiling)
    last = min(s[_COMMAND, i], ceiling)  # a falling ceiling is obeyed at once
    if dt > 0.0:
        most = g[_RATE, i] * dt
        command = min(max(command, last - most), last + most)
    if abs(command - last) < g[_BAND, i] and command > 0.0 and command < ceiling:
        command = last
    return command


def _tick(g, s, reference, speed, acceleration, limit, position, pressure, dt, integrate, drive, out):  # type: ignore[no-untyped-def]
    """One tick of every joint.

    g: gains (rows, n).  s: state (rows, n), changed.  reference [rad], its speed [rad/s] and acceleration [rad/s^2],
    limit [N m], position [rad], pressure [Pa]: (n,).  dt: [s].  integrate: False freezes the integrators.
    drive: False observes only.  out: (6, n).
    """
    for i in range(g.shape[1]):
        phi, p = position[i], pressure[i]
        if not math.isfinite(phi + p + reference[i] + speed[i] + acceleration[i] + limit[i]):
            out[PRESSURE, i] = s[_COMMAND, i]
            out[SATURATED, i] = 0.0
            continue
        _observe(g, s, i, phi, p, dt)
        a0, a1, a2 = g[_A0, i] * (1.0 + s[_D0, i]), g[_A1, i] * (1.0 + s[_D1, i]), g[_A2, i]
        a3, d = g[_A3, i] * (1.0 + s[_D3, i]), g[_D, i] * (1.0 + s[_DD, i])
        creep, phi_max = s[_CREEP, i], g[_PHI_MAX, i]
        out[TORQUE, i] = torque(p, phi, creep, a0, a1, a2, a3, phi_max)
        speed_2 = (s[_F1, i] - s[_F2, i]) / g[_T_OBS, i]
        partner = int(g[_PARTNER, i])
        felt = g[_J, i] * s[_ACC, i] + (g[_JC, i] * s[_ACC, partner] if partner >= 0 else 0.0)
        balance = a0 + a1 * (s[_F2, i] - creep * phi_max) + a2 * s[_P2, i] + a3 * s[_Q2, i] - d * speed_2 - felt
        share = g[_MAP_ERROR, i] * a2 * s[_P2, i]
        unsure = g[_STD, i] * g[_STD, i] + share * share
        if g[_ADAPT, i] != 0.0:
            unsure += map_variance(g, s, i, speed_2)
        if g[_DETECT, i] != 0.0:
            detect(g, s, i, balance, unsure, dt)
            if refuted(s, i, speed[i], s[_SPEED, i], dt):
                doubt(g, s, i)
        out[CONTACT, i], out[CONTACT_AGE, i], out[CONTACT_TORQUE, i] = s[_IN_CONTACT, i], s[_AGE, i], balance
        if not drive:
            out[PRESSURE, i] = out[SATURATED, i] = 0.0
            continue
        error, lag = reference[i] - phi, g[_LAG, i]
        stiffness = -(a1 + a3 * p)
        here = max(a2 + a3 * min(phi, g[_HIGH, i]), _MIN_LEVERAGE)
        kp, ki, kd = g[_KP, i], g[_KI, i], g[_KD, i]
        if g[_SCHEDULE, i] != 0.0:
            per = 1.0 / g[_RESPONSE, i]
            kp, ki, kd = (d + stiffness * lag) * per, stiffness * per, (d * lag + g[_J, i]) * per
        ceiling = pressure_for_torque(limit[i], min(phi, g[_HIGH, i]), creep, a0, a1, a2, a3, phi_max)
        wanted = 0.0
        if g[_TORQUE_MODE, i] != 0.0:
            # The limit is the wanted torque; the valve gives its pressure without an error that would need an integral.
            error = 0.0
            wanted = ceiling
        else:
            if g[_FORWARD, i] != 0.0:
                at = min(reference[i], g[_HIGH, i])  # the description guarantees leverage up to the joint's limit
                there = max(a2 + a3 * at, _MIN_LEVERAGE)
                lead = lag + g[_DEAD, i]
                force = -a0 - a1 * (at - creep * phi_max)
                slope = (-a1 * there - force * a3) / (there * there)
                moving = d * speed[i] + (g[_J, i] + d * lead) * acceleration[i]
                wanted = force / there + lead * slope * speed[i] + moving / there
            wanted += (kp * error + kd * (speed[i] - s[_SPEED, i])) / here
            if s[_FRESH, i] != 0.0:
                s[_FRESH, i] = 0.0
                s[_INTEGRAL, i] = min(max((s[_COMMAND, i] - wanted) * here, -g[_I_MAX, i]), g[_I_MAX, i])
            wanted += s[_INTEGRAL, i] / here
        ceiling = min(max(ceiling, 0.0), g[_P_MAX, i])
        if not math.isfinite(wanted + ceiling):
            out[PRESSURE, i], out[SATURATED, i] = s[_COMMAND, i], 0.0
            continue
        # At rest the feedback is noise: a filter keeps it below the dead-band.
        calm = abs(speed[i]) < _REST_RAD_S and abs(s[_SPEED, i]) < _MOVING_RAD_S and abs(error) < _REST_RAD
        share_calm = dt / (dt + _CALM_S) if calm and g[_BAND, i] > 0.0 and dt > 0.0 else 1.0
        s[_CALM, i] += share_calm * (wanted - s[_CALM, i])
        command = _cut(g, s, i, s[_CALM, i], ceiling, dt)
        beyond = wanted - min(max(wanted, 0.0), ceiling)
        resolved = g[_BAND, i] * here / stiffness + _NOISE_RAD if g[_BAND, i] > 0.0 and stiffness > 0.0 else 0.0
        if integrate and abs(error) > resolved:
            growth = ki * error
            if g[_BACK, i] != 0.0:
                growth -= beyond * here / g[_TRACK, i]
            elif beyond * error > 0.0:
                growth = 0.0
            s[_INTEGRAL, i] = min(max(s[_INTEGRAL, i] + growth * dt, -g[_I_MAX, i]), g[_I_MAX, i])
        s[_COMMAND, i] = command
        out[PRESSURE, i] = command
        out[SATURATED, i] = 1.0 if beyond != 0.0 else 0.0
        if g[_ADAPT, i] != 0.0 and dt > 0.0 and integrate:
            adapt(g, s, i, balance, unsure, speed_2, beyond != 0.0, dt)


def _compiled() -> Any:
    """The tick compiled; its cache is keyed by every equation it uses, since numba looks at one file alone."""
    names = ("law", "adapt", "contact", "law_rows")
    sources = [Path(__file__).with_name(f"{name}.py").read_bytes() for name in names]
    sources += [Path(inspect.getfile(f.py_func)).read_bytes() for f in (creep_rate, torque)]
    key = hashlib.sha256(b"".join(sources)).hexdigest()
    joint = njit(cache=False, error_model="numpy")(_tick)

    def tick(g, s, reference, speed, acceleration, limit, position, pressure, dt, integrate, drive, out):  # type: ignore[no-untyped-def]
        _ = key
        joint(g, s, reference, speed, acceleration, limit, position, pressure, dt, integrate, drive, out)

    # A division by zero gives what is not finite, and that is caught.
    return njit(cache=True, error_model="numpy")(tick)


tick = _compiled()


class Law:
    """The law's memory between ticks: integrators, filters, creep, adapted map and detectors of n joints."""

    def __init__(self, g: Array) -> None:
        """Begin released, with a rested material."""
        self.gains = g
        self.state = np.zeros((len(STATE), g.shape[1]))
        self.out = np.zeros((len(OUTPUT), g.shape[1]))
        self.forget()

    def release(self) -> None:
        """Forget what drove the joints: integrators and commands to 0. What was observed of them stays."""
        self.state[_INTEGRAL] = self.state[_COMMAND] = self.state[_FRESH] = self.state[_CALM] = 0.0

    def forget(self) -> None:
        """Return to the description's map."""
        for i in range(self.state.shape[1]):
            forget(self.gains, self.state, i)

    def change(self, g: Array) -> None:
        """New gains from the next tick on, without a jump: the integrator takes over the difference."""
        off = (g[_ADAPT] == 0.0) & (self.gains[_ADAPT] != 0.0)
        for i in np.flatnonzero(off):
            forget(self.gains, self.state, i)
        if not np.array_equal(g, self.gains):
            self.state[_FRESH] = 1.0
        self.gains = g

    def tick(
        self,
        reference: Array,
        speed: Array,
        acceleration: Array,
        limit: Array,
        position: Array,
        pressure: Array,
        dt: float,
        integrate: bool = True,
        drive: bool = True,
    ) -> Array:
        """One tick, see `tick`; returns out (6, n), overwritten by the next."""
        tick(
            self.gains, self.state, reference, speed, acceleration, limit, position, pressure, dt, integrate, drive,
            self.out,
        )  # fmt: skip
        return self.out


__all__ = ["CONTACT", "CONTACT_AGE", "CONTACT_TORQUE", "PRESSURE", "SATURATED", "TORQUE", "Law"]
