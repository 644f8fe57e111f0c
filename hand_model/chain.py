"""One joint's signal chain with every effect of the catalogue, opened at the measured signals or closed.

    set-point -> valve -> pressure -> reading            (the valve stage)
    pressure -> torque -> motion -> angle -> reading     (the joint stage)
    angle, pressure -> torque of the surroundings -> force -> reading   (the force stage)

Opened, every stage runs on what was measured at its input, so that a fault in one leaves the others alone. Closed,
one stage feeds the next: that is the plant of a hand whose description has effects. The equations are those of
plant.py (Eqs. 6, 8, 11, 12) with the hooks of hand_model/effects; where no effect acts both agree.

Integrator: the valve by Heun's method, creep by exact decay towards its zone, motion by the linearly implicit
trapezoidal rule, which is of second order and stable for any stiffness; dry friction as an impulse that stops the
joint or slows it (Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988). Lanes are parameter
sets of one joint: the inputs are common, which is what a fit by finite differences needs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, njit, prange
from numpy.typing import NDArray

from hand_model.effects import CATALOGUE
from hand_model.effects.effect import ACCELERATION, ANGLE, PARTNER, SPEED
from hand_model.joint import one_sided
from hand_model.kernel.hooks import compose, equations_key
from hand_model.kernel.inline import FAST, inline, inlined
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, STARTS, STATE_ROW, WORK_ROWS
from hand_model.material import creep_rate
from hand_model.stack_rows import stack_doubles
from hand_model.statics import torque as static_torque

Array = NDArray[np.float64]
LANES = 4
"""Parameter sets computed side by side: one vector of a processor; more of them would not stay in its registers."""
OUTPUTS = 3
"""Readings of pressure [Pa], angle [rad] and force [N]."""
STANDSTILL_RAD_S = 0.02
"""Speed below which a machine with imposed motion counts as standing, and friction has no full size yet."""
STATES = 4
P, PHI, OMEGA, CREEP = range(STATES)
_ROWS = len(JOINT_PARAMETERS)

_torque, _one_sided, _creep_rate = inlined(static_torque), inlined(one_sided), inlined(creep_rate)
(
    _prepare,
    _set_point,
    _valve_error,
    _pressure_rate,
    read_pressure,
    _true_pressure,
    at_actuator,
    _added_torque,
    _added_damping,
    _dry_friction,
    _keep_motion,
    angle_sensor,
    read_angle,
    _force_sensor,
    _read_force,
    valve_replaced,
    replacing_valve,
) = compose(CATALOGUE)
prepare = _prepare
_DEAD, _TAU = ROW["valve.dead_time_s"], ROW["valve.time_constant_s"]
_FILL, _VENT = ROW["valve.fill_rate_pa_per_s"], ROW["valve.vent_rate_pa_per_s"]
_A0, _A1, _A2, _A3 = (ROW[f"statics.{key}"] for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad"))
_PHI_MAX, _P_MIN = ROW["material.phi_max_deg"], ROW["material.p_min_pa"]
_B1, _T_EXT = ROW["material.b1_per_pa"], ROW["material.extension_time_s"]
_B0, _T_REC = ROW["material.b0_per_pa"], ROW["material.recovery_time_s"]
_J, _D = ROW["dynamics.inertia_kg_m2"], ROW["dynamics.viscous_friction_nm_s_per_rad"]
_JC = ROW["dynamics.coupling_inertia_kg_m2"]
_LOW, _HIGH = ROW["end_stop.low_deg"], ROW["end_stop.high_deg"]
_K_STOP, _D_STOP = ROW["end_stop.stiffness_nm_per_rad"], ROW["end_stop.damping_nm_s_per_rad"]
_W_STOP = ROW["end_stop.engagement_deg"]
_LOAD = ROW["constant_load.torque_nm"]
_CONTACT, _K_CONTACT = ROW["contact.angle_deg"], ROW["contact.stiffness_nm_per_rad"]
_D_CONTACT, _W_CONTACT = ROW["contact.damping_nm_s_per_rad"], ROW["contact.engagement_deg"]
_SUPPLY, _CLOCK, _SHARE = ROW["supply.pressure_pa"], ROW["clock_offset.offset_s"], ROW["clock_offset.share"]


@inline
def _filling(w, i, p, u, e):  # type: ignore[no-untyped-def]
    """Pressure rate [Pa/s] at p under the set-point u."""
    rate = _valve_error(w, i, u - p) / w[_TAU, i]
    rate = min(max(rate, -w[_VENT, i]), w[_FILL, i])
    return _pressure_rate(w, i, rate, p, u, e)


@inline
def valve_step(w, i, p, u, e, h):  # type: ignore[no-untyped-def]
    """Pressure [Pa] after h [s] under the delayed set-point u (Eq. 8's valve); Heun's method."""
    u = _set_point(w, i, min(max(u, 0.0), w[_SUPPLY, i]), p, e, h)
    first = _filling(w, i, p, u, e)
    second = _filling(w, i, p + h * first, u, e)
    return p + 0.5 * h * (first + second)


@inline
def _engaged(depth, width):  # type: ignore[no-untyped-def]
    """Share of a stop's stiffness and damping that acts."""
    return min(max(depth / width, 0.0), 1.0)


@inline
def _acting_torque(w, i, phi, omega, p, creep, e):  # type: ignore[no-untyped-def]
    """Torque on the joint but for damping and dry friction [N m], its stiffness [N m/rad], and damping in it."""
    added, stiffness = _added_torque(w, i, phi, omega, p, creep * w[_PHI_MAX, i], e)
    width, contact_width = w[_W_STOP, i], w[_W_CONTACT, i]
    high, low, contact = phi - w[_HIGH, i], w[_LOW, i] - phi, phi - w[_CONTACT, i]
    total = (
        _torque(p, phi, creep, w[_A0, i], w[_A1, i], w[_A2, i], w[_A3, i], w[_PHI_MAX, i])
        + added
        - w[_LOAD, i]
        - w[_JC, i] * e[PARTNER]
        - _one_sided(high, omega, w[_K_STOP, i], w[_D_STOP, i], width, 1.0 / width)
        + _one_sided(low, -omega, w[_K_STOP, i], w[_D_STOP, i], width, 1.0 / width)
        - _one_sided(contact, omega, w[_K_CONTACT, i], w[_D_CONTACT, i], contact_width, 1.0 / contact_width)
    )
    stops, touch = _engaged(high, width) + _engaged(low, width), _engaged(contact, contact_width)
    stiffness += w[_K_STOP, i] * stops + w[_K_CONTACT, i] * touch - w[_A1, i] - w[_A3, i] * p
    return total, max(stiffness, 0.0), w[_D_STOP, i] * stops + w[_D_CONTACT, i] * touch


@inline
def creep_step(w, i, p, creep, h):  # type: ignore[no-untyped-def]
    """Creeping ratio after h [s], Eq. 12; Heun's method (h is far below both time constants)."""
    ext, rec = 1.0 / w[_T_EXT, i], 1.0 / w[_T_REC, i]
    first = _creep_rate(p, creep, w[_P_MIN, i], w[_B1, i], ext, w[_B0, i], rec)
    second = _creep_rate(p, creep + h * first, w[_P_MIN, i], w[_B1, i], ext, w[_B0, i], rec)
    return creep + 0.5 * h * (first + second)


@inline
def joint_step(w, i, phi, omega, p, creep, e, h):  # type: ignore[no-untyped-def]
    """Angle [rad] and speed [rad/s] after h [s] at the actuator pressure p, Eq. 8."""
    total, stiffness, included = _acting_torque(w, i, phi, omega, p, creep, e)
    damping = w[_D, i] + _added_damping(w, i, omega)
    implicit = 0.5 * h * damping + 0.25 * h * h * stiffness
    mass = w[_J, i] + implicit + 0.5 * h * included  # whose torque at omega is part of the total
    free = ((w[_J, i] - implicit) * omega + h * total) / mass
    stopping = h * _dry_friction(w, i, omega, p) / mass
    after = max(abs(free) - stopping, 0.0)
    after = after if free > 0.0 else -after
    moved = phi + 0.5 * h * (omega + after)
    _keep_motion(w, i, phi, moved, h)
    return moved, after


@inline
def _outside_torque(w, i, p, creep, e):  # type: ignore[no-untyped-def]
    """Torque [N m] that the surroundings must exert for the measured motion, stops left out; Eq. 8 for M_d."""
    phi, omega = e[ANGLE], e[SPEED]
    added, _ = _added_torque(w, i, phi, omega, p, creep * w[_PHI_MAX, i], e)
    damping = w[_D, i] + _added_damping(w, i, omega)
    actuator = _torque(p, phi, creep, w[_A0, i], w[_A1, i], w[_A2, i], w[_A3, i], w[_PHI_MAX, i])
    inertial = w[_J, i] * e[ACCELERATION] + w[_JC, i] * e[PARTNER]
    return actuator + added - w[_LOAD, i] - damping * omega - inertial


@inline
def _delayed(u, x, y):  # type: ignore[no-untyped-def]
    """Mean of the piecewise constant u between the sample positions x <= y, less than one apart."""
    last = u.shape[0] - 1
    a = math.floor(x)
    b = math.floor(y)
    first, second = u[min(max(a, 0), last)], u[min(max(b, 0), last)]
    share = (y - b) / (y - x) if b > a else 1.0
    return first + share * (second - first)


@inline
def _between(signal, x):  # type: ignore[no-untyped-def]
    """Linear interpolation of samples at the position x."""
    x = min(max(x, 0.0), signal.shape[0] - 1.0)
    a = min(int(x), signal.shape[0] - 2)
    return signal[a] + (x - a) * (signal[a + 1] - signal[a])


X = STATE_ROW
"""First state row of the working array."""
# Above it, what is the input of a step.
_COMMAND, _INPUT, _ACTUATOR = range(WORK_ROWS, WORK_ROWS + 3)
WORK = WORK_ROWS + 3
_SIZE = WORK * LANES


@inline
def _inputs(w, u, reading, begin, end, dt, finer, late):  # type: ignore[no-untyped-def]
    """Delayed set-point and measured pressure of a step, lane by lane (gathers keep a loop from being vectorised).

    finer: readings per sample.  late: by how much they, and the pressures predicted, are later than its ticks.
    """
    for i in range(LANES):
        lag = (w[_DEAD, i] + w[_CLOCK, i] * w[_SHARE, i] - late) / dt
        w[_COMMAND, i] = _delayed(u, begin - lag, end - lag)
        w[_INPUT, i] = _between(reading, finer * (0.5 * (begin + end) + (w[_CLOCK, i] - late) / dt))


@inline
def _open_step(w, e, h):  # type: ignore[no-untyped-def]
    """One step of the valve stage on the set-points and of the joint stage on the measured pressures."""
    for i in range(LANES):
        w[X + P, i] = valve_step(w, i, w[X + P, i], w[_COMMAND, i], e, h)
        p = at_actuator(w, i, _true_pressure(w, i, w[_INPUT, i]), h)
        w[_ACTUATOR, i] = p
        creep = w[X + CREEP, i]
        phi, omega = joint_step(w, i, w[X + PHI, i], w[X + OMEGA, i], p, creep, e, h)
        w[X + PHI, i], w[X + OMEGA, i] = phi, omega
        w[X + CREEP, i] = creep_step(w, i, p, creep, h)
        angle_sensor(w, i, phi, h)


@inline
def _driven_step(w, e, phi, h):  # type: ignore[no-untyped-def]
    """One step of a machine whose motion is imposed: the joint goes to phi, where it was measured."""
    for i in range(LANES):
        w[X + P, i] = valve_step(w, i, w[X + P, i], w[_COMMAND, i], e, h)
        p = at_actuator(w, i, _true_pressure(w, i, w[_INPUT, i]), h)
        w[_ACTUATOR, i] = p
        _keep_motion(w, i, w[X + PHI, i], phi, h)
        w[X + PHI, i], w[X + OMEGA, i] = phi, e[SPEED]
        w[X + CREEP, i] = creep_step(w, i, p, w[X + CREEP, i], h)
        angle_sensor(w, i, phi, h)


@inline
def _read_driven(w, e, dt, lever, out, k):  # type: ignore[no-untyped-def]
    """Readings of such a machine: the force it gives outward, dry friction against the motion included."""
    for i in range(LANES):
        out[i, 0, k] = read_pressure(w, i, w[X + P, i])
        out[i, 1, k] = read_angle(w, i, w[X + PHI, i])
        outside = _outside_torque(w, i, w[_ACTUATOR, i], w[X + CREEP, i], e)
        direction = min(max(e[SPEED] / STANDSTILL_RAD_S, -1.0), 1.0)
        friction = direction * _dry_friction(w, i, e[SPEED], w[_ACTUATOR, i])
        force = (outside - friction) / lever
        _force_sensor(w, i, force, dt)
        out[i, 2, k] = _read_force(w, i, force)


@inline
def _read(w, e, dt, lever, out, k):  # type: ignore[no-untyped-def]
    """Readings at the end of a sample."""
    for i in range(LANES):
        out[i, 0, k] = read_pressure(w, i, w[X + P, i])
        out[i, 1, k] = read_angle(w, i, w[X + PHI, i])
        force = max(_outside_torque(w, i, w[_ACTUATOR, i], w[X + CREEP, i], e) / lever, 0.0)
        _force_sensor(w, i, force, dt)
        out[i, 2, k] = _read_force(w, i, force)


@inline
def _around(e, k):  # type: ignore[no-untyped-def]
    return e[k, 0], e[k, 1], e[k, 2], e[k, 3], e[k, 4], e[k, 5], e[k, 6]


@inline
def _around_between(e, k, x):  # type: ignore[no-untyped-def]
    """What is measured around the joint at the share x from sample k to the next."""
    a, b, y = _around(e, k), _around(e, k + 1), 1.0 - x
    return (
        y * a[0] + x * b[0], y * a[1] + x * b[1], y * a[2] + x * b[2], y * a[3] + x * b[3],
        y * a[4] + x * b[4], y * a[5] + x * b[5], y * a[6] + x * b[6],
    )  # fmt: skip


def _block_kernel() -> Any:
    """One block through all samples, compiled alone: a parallel region would keep it from being vectorised."""
    key = equations_key()

    def open_block(work, u, reading, e, dt, steps, lever, driven, late, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_SIZE), (WORK, LANES))  # of known shape: rows cannot overlap
        for row in range(WORK):
            for i in range(LANES):
                w[row, i] = work[row, i]
        h = dt / steps
        for i in range(LANES):
            prepare(w, i, h)
        finer = (reading.shape[0] - 1) / max(e.shape[0] - 1, 1)
        for k in range(e.shape[0] - 1):
            for n in range(steps):
                _inputs(w, u, reading, k + n / steps, k + (n + 1) / steps, dt, finer, late)
                now = _around_between(e, k, (n + 0.5) / steps)
                if driven:
                    way = e[k + 1, ANGLE] - e[k, ANGLE]
                    _driven_step(w, now, e[k, ANGLE] + (n + 1.0) / steps * way, h)
                else:
                    _open_step(w, now, h)
            if driven:
                _read_driven(w, _around(e, k + 1), dt, lever, out, k + 1)
            else:
                _read(w, _around(e, k + 1), dt, lever, out, k + 1)

    return njit(cache=True, fastmath=FAST, error_model="numpy")(open_block)


_open_block = _block_kernel()


def _kernel() -> Any:
    key = equations_key()

    def open_lanes(w, u, reading, e, dt, steps, lever, driven, late, out):  # type: ignore[no-untyped-def]
        _ = key
        for block in prange(w.shape[0]):
            lanes = out[LANES * block : LANES * (block + 1)]
            _open_block(w[block], u, reading, e, dt, steps, lever, driven, late, lanes)

    return njit(cache=True, parallel=True, fastmath=FAST)(open_lanes)


_open_lanes = _kernel()


def open_chain(
    columns: Array,
    start: Array,
    set_point_pa: Array,
    pressure_pa: Array,
    exogenous: Array,
    period_s: float,
    lever_m: float = 1.0,
    step_s: float = 1.3e-3,
    driven: bool = False,
    late_s: float = 0.0,
) -> Array:
    """Readings (columns, OUTPUTS, samples) that each parameter set predicts from each stage's measured inputs.

    Eqs. 6, 8, 11 and 12 with every effect of the catalogue.

    columns: (columns, rows of JOINT_PARAMETERS) SI.  start: (columns, STATES) at the first sample.  set_point_pa:
    (samples,), each holds until the next.  pressure_pa: (finer (samples - 1) + 1,), no gaps, `finer` readings evenly
    over each sample.  exogenous: (samples, EXOGENOUS).
    lever_m: arm of the force sensor.  step_s: largest step of integration.  driven: the motion is imposed, and the
    force is what is predicted.  late_s: pressures were read so much after the ticks of all else, less than a sample.
    """
    count, samples = len(columns), len(exogenous)
    blocks = -(-count // LANES)
    w = np.zeros((blocks * LANES, WORK))
    w[:count, :_ROWS], w[count:, :_ROWS] = columns, columns[-1]
    w[:count, X : X + STATES], w[count:, X : X + STATES] = start, start[-1]
    for row, kind in STARTS:
        w[:, row] = w[:, X + PHI] if kind == "angle" else pressure_pa[0]
    work = np.ascontiguousarray(w.reshape(blocks, LANES, WORK).transpose(0, 2, 1))
    out = np.empty((blocks * LANES, OUTPUTS, samples))
    out[:, 0, 0], out[:, 1, 0], out[:, 2, 0] = w[:, X + P], w[:, X + PHI], 0.0
    steps = max(1, math.ceil(period_s / step_s - 1e-9))
    u, p, e = (np.ascontiguousarray(signal, dtype=np.float64) for signal in (set_point_pa, pressure_pa, exogenous))
    _open_lanes(work, u, p, e, period_s, steps, lever_m, driven, late_s, out)
    return out[:count]
