"""The control law of every joint: adaptive PID around the model of the actuator. Structure of arrays, numba.

The PID acts in torque and the model converts torque to pressure, so that its gains mean the same at every angle:

    e   = phi_ref - phi,   v = filtered speed of the measured angle                        [rad, rad/s]
    tau = Kp e + I + Kd (phi_ref' - v),   I' = Ki e                                        [N m]
    p   = p_hold + ((d + T k_hold) phi_ref' + (J + d T + T_2 k_hold) phi_ref'') / (a2 + a3 phi_ref)
        + tau / (a2 + a3 phi)

p_hold is the pressure at which Eq. 11 with the present creeping ratio (Eq. 12, from the measured pressure) gives no
torque at the reference, and k_hold = -(a1 + a3 p_hold) the stiffness there. T, lag and dead time of the valve, is the
time by which a moving reference is anticipated, and T_2 the term of second order of that lead: the products of any two
lags, of each lag with the dead time, and half the square of the dead time.

Scheduled gains follow the model over (phi, p): the stiffness k = -(a1 + a3 p) of the joint, its friction and the lag of
the valve are cancelled and replaced by one closed-loop time constant R, the response time and the dead time (internal
model control; Rivera, Morari, Skogestad 1986): Ki = k / R, Kp = (d + k T) / R, Kd = (d T + J) / R; T is the lag alone.
A joint that swings at rest gets a longer R (`swings.py`).

Torques of the found physics (`found.py`) stand in four rows of the state, which the caller fills before each tick.

The pressure is limited to 0 ... the lower of the pressure limit and the torque ceiling, the pressure at which Eq. 11
gives the maximum torque at the measured angle. Its rate is bounded. At rest it is filtered, a change smaller than the
dead-band is not sent, and the integrator stops where the error is one that the dead-band itself or friction leaves, so
that no limit cycle remains. Anti-windup is conditional integration, or back-calculation with a tracking time.

The map adapts (`adaptation.py`) and contact is detected (`contact.py`) from the same filtered torque balance. After a
change of the gains the integrator takes over the difference, so that the pressure does not jump. A joint with a
measurement or reference that is not finite keeps its last command, which is finite: every command is finite.
"""

from __future__ import annotations

import hashlib
import inspect
import math
from pathlib import Path
from typing import Any

import numpy as np

from hand_control.adaptation import adapt, learn_at_rest, map_variance, reset_covariance, reset_map
from hand_control.contact import contradicted_by_motion, detect, follows, partner_impact
from hand_control.declared import INPUTS, OUT, OUTPUTS, STATE, C, G, S, U, bounded_dt, inlined
from hand_control.swings import watch_swings
from hand_model.arrays import Array, Flags
from hand_model.compile_cache import njit
from hand_model.material import creep_rate
from hand_model.statics import leverage, pressure_for_torque, stiffness, torque

RELEASED = (
    *(S.integral, S.free_integral, S.command, S.take_over, S.wanted, S.stood, S.stood_error),
    *(S.peak, S.last_peak, S.swing_time, S.slower),
)
"""Rows of the state that are 0 after a release."""


@inlined
def _observe(g, s, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Advance the filters of joint i by dt [s]: speed, creeping ratio, and twice filtered angle, pressure and p phi.

    The filters are backward Euler, so that (phi_1 - phi_2) / T is the exact difference quotient of phi_2.
    """
    if s[S.started, i] == 0.0:
        s[S.started, i] = 1.0
        s[S.last_angle, i] = s[S.phi_1, i] = s[S.phi_2, i] = phi
        s[S.p_1, i] = s[S.p_2, i] = p
        s[S.q_1, i] = s[S.q_2, i] = p * phi
        s[S.found_1, i] = s[S.found_2, i] = s[S.load, i] + s[S.drag, i]
        s[S.speed, i] = 0.0
        return
    if dt <= 0.0:
        return
    rate = (phi - s[S.last_angle, i]) / dt
    s[S.speed, i] += dt / (dt + g[G.speed_filter, i]) * (rate - s[S.speed, i])
    s[S.last_angle, i] = phi
    t = g[G.observer_filter, i]
    share = dt / (dt + t)
    s[S.phi_1, i] += share * (phi - s[S.phi_1, i])
    s[S.p_1, i] += share * (p - s[S.p_1, i])
    s[S.q_1, i] += share * (p * phi - s[S.q_1, i])
    s[S.phi_2, i] += share * (s[S.phi_1, i] - s[S.phi_2, i])
    s[S.p_2, i] += share * (s[S.p_1, i] - s[S.p_2, i])
    s[S.q_2, i] += share * (s[S.q_1, i] - s[S.q_2, i])
    s[S.found_1, i] += share * (s[S.load, i] + s[S.drag, i] - s[S.found_1, i])
    s[S.found_2, i] += share * (s[S.found_1, i] - s[S.found_2, i])
    s[S.acceleration, i] = (phi - 2.0 * s[S.phi_1, i] + s[S.phi_2, i]) / (t * t)
    if g[G.creep, i] != 0.0:
        zones = g[G.p_min, i], g[G.b1, i], g[G.extension_rate, i], g[G.b0, i], g[G.recovery_rate, i]
        step = creep_rate(p, s[S.creep, i], *zones) * dt
        s[S.creep, i] = min(max(s[S.creep, i] + step, 0.0), 1.0)


@inlined
def _adapted_map(g, s, i):  # type: ignore[no-untyped-def]
    """a0 with the load, a1, a2, a3 and d of joint i with their adapted relative changes."""
    return (
        g[G.a0, i] + s[S.offset, i],
        g[G.a1, i] * (1.0 + s[S.d_a1, i]),
        g[G.a2, i],
        g[G.a3, i] * (1.0 + s[S.d_a3, i]),
        g[G.viscous, i] * (1.0 + s[S.d_viscous, i]),
    )


@inlined
def _torque_scale(s, i):  # type: ignore[no-untyped-def]
    """True torque over that of the adapted map: the common part of the changes is an error of a2, on average."""
    common = -C.common / (1.0 + 2.0 * C.common) * (s[S.d_a1, i] + s[S.d_a3, i])
    return 1.0 + min(max(common, -C.most_scale), C.most_scale)


@inlined
def _torque_balance(g, s, i, a0, a1, a2, a3, d, speed):  # type: ignore[no-untyped-def]
    """Torque [N m] of Eq. 8 that the filtered motion of joint i leaves: what an obstacle holds."""
    product = s[S.q_2, i] - s[S.p_2, i] * s[S.phi_2, i]  # the filter of a product is not the product of filters
    static = torque(s[S.p_2, i], s[S.phi_2, i], s[S.creep, i], a0, a1, a2, a3, g[G.phi_max, i]) + a3 * product
    partner = int(g[G.partner, i])
    inertial = g[G.inertia, i] * s[S.acceleration, i]
    if partner >= 0:
        inertial += g[G.coupling, i] * s[S.acceleration, partner]
    return static + s[S.found_2, i] - d * speed - inertial


@inlined
def _balance_variance(g, s, i, speed):  # type: ignore[no-untyped-def]
    """Variance [(N m)^2] of the balance: what was observed, error of identification, uncertainty of the adapted map."""
    share = g[G.map_error, i] * g[G.a2, i] * s[S.p_2, i]
    least = C.least_residual * g[G.residual_std, i]
    own = max(C.residual_factor * s[S.misfit, i], least * least)
    variance = own + share * share + s[S.spread, i] * s[S.spread, i]
    if g[G.adapt, i] != 0.0:
        variance += map_variance(g, s, i, speed)
    return variance


@inlined
def _pid_gains(g, s, i, d, k):  # type: ignore[no-untyped-def]
    """Kp [N m/rad], Ki [N m/(rad s)] and Kd [N m s/rad] of joint i with friction d and stiffness k."""
    if g[G.schedule, i] == 0.0:
        return g[G.kp, i], g[G.ki, i], g[G.kd, i]
    lag, per = g[G.valve_lag, i], 1.0 / (g[G.response_time, i] + g[G.dead_time, i] + s[S.slower, i])
    return (d + k * lag) * per, k * per, (d * lag + g[G.inertia, i]) * per


@inlined
def _feed_forward(g, s, u, i, a0, a1, a2, a3, d):  # type: ignore[no-untyped-def]
    """Pressure [Pa] that holds the reference of joint i and moves it along, ahead of valve and dead time."""
    at = min(u[U.reference, i], g[G.high, i])  # the description guarantees leverage up to this limit
    hold = pressure_for_torque(-s[S.ahead, i], at, s[S.creep, i], a0, a1, a2, a3, g[G.phi_max, i])
    lead = g[G.valve_lag, i] + g[G.dead_time, i]
    k = -stiffness(hold, a1, a3)
    moving = (d + lead * k) * u[U.speed, i]
    mass = g[G.inertia, i] + d * lead + k * g[G.lead_2, i]
    return hold + (moving + mass * u[U.acceleration, i]) / leverage(at, a2, a3)


@inlined
def _steady_pressure(g, s, u, i):  # type: ignore[no-untyped-def]
    """Pressure [Pa] of feed-forward and integral of joint i with the present map."""
    a0, a1, a2, a3, d = _adapted_map(g, s, i)
    here = max(leverage(min(u[U.position, i], g[G.high, i]), a2, a3), C.min_leverage)
    return _feed_forward(g, s, u, i, a0, a1, a2, a3, d) + s[S.integral, i] / here


@inlined
def _take_over_map(g, s, u, i, before):  # type: ignore[no-untyped-def]
    """Let the integral of joint i take over a change of its map; before: the steady pressure with the old map [Pa].

    With a slow reference the integral has long compensated what the map learns, and the joint would jump. A faster
    motion has not waited for the integral: there the map brings the joint to its reference.
    """
    if g[G.feed_forward, i] == 0.0 or g[G.torque_mode, i] != 0.0 or abs(u[U.speed, i]) >= C.min_speed:
        return
    _, _, a2, a3, _ = _adapted_map(g, s, i)
    here = max(leverage(min(u[U.position, i], g[G.high, i]), a2, a3), C.min_leverage)
    difference = (before - _steady_pressure(g, s, u, i)) * here
    if math.isfinite(difference):
        s[S.integral, i] = min(max(s[S.integral, i] + difference, -g[G.i_max, i]), g[G.i_max, i])
        s[S.free_integral, i] = min(max(s[S.free_integral, i] + difference, -g[G.i_max, i]), g[G.i_max, i])
        s[S.stood_integral, i] += difference


@inlined
def _send(g, s, i, wanted, ceiling, rests, dt):  # type: ignore[no-untyped-def]
    """Command [Pa] for a wanted pressure: limits, bounded rate, and the dead-band where the joint rests."""
    command = min(max(wanted, 0.0), ceiling)
    last = min(s[S.command, i], ceiling)  # a falling ceiling is obeyed at once
    step = g[G.p_rate, i] * dt
    command = min(max(command, last - step), last + step)
    if rests and abs(command - last) < g[G.deadband, i] and command > 0.0 and command < ceiling:
        command = last
    return command


@inlined
def _rests(g, s, u, i):  # type: ignore[no-untyped-def]
    """Whether joint i is to rest: its reference does; in torque mode, which has no reference, the joint does."""
    if g[G.torque_mode, i] != 0.0:
        return abs(s[S.speed, i]) < C.rest_speed
    return abs(u[U.speed, i]) < C.rest_reference


@inlined
def _filter_at_rest(g, s, i, wanted, error, rests, dt):  # type: ignore[no-untyped-def]
    """Wanted pressure [Pa]; at rest its feedback is noise, and a filter keeps it below the dead-band."""
    filtered = rests and abs(error) < C.rest_error and g[G.deadband, i] > 0.0 and dt > 0.0
    share = dt / (dt + C.rest_filter) if filtered else 1.0
    s[S.wanted, i] += share * (wanted - s[S.wanted, i])
    return s[S.wanted, i]


@inlined
def _let_go(s, i, reference_speed):  # type: ignore[no-untyped-def]
    """Drop what the integral of joint i gained in contact, once the reference retreats [rad/s]."""
    if s[S.contact, i] == 0.0 and s[S.sum, i] == 0.0:
        s[S.free_integral, i] = s[S.integral, i]
    elif reference_speed < -C.rest_reference:
        s[S.integral, i] = min(s[S.integral, i], s[S.free_integral, i])


@inlined
def _watch_slips(g, s, i, error, speed, rests, dt):  # type: ignore[no-untyped-def]
    """Learn the error [rad] that friction leaves to joint i at rest: that after a slip past its reference.

    The integral of a joint that sticks grows until the joint breaks away, slips past its reference, sticks and returns
    in the same way, for ever. A smaller error than such a slip leaves is not worth another one. It is slowly forgotten.
    Less friction acts on a joint that slips: so that the slip ends near the reference, the integral loses a part of
    what it gained while the joint stood.
    """
    s[S.kept_error, i] -= s[S.kept_error, i] * dt / (dt + g[G.memory, i])
    if not rests:
        s[S.stood_error, i] = s[S.stood, i] = 0.0
        return
    stood = s[S.stood, i]
    s[S.stood, i] = stood + dt if abs(speed) < C.slip_speed else 0.0
    if s[S.stood, i] < C.stand_time:
        if stood >= C.stand_time and speed * error > 0.0 and s[S.contact, i] == 0.0:
            s[S.integral, i] -= C.given_back * (s[S.integral, i] - s[S.stood_integral, i])
        return
    if stood < C.stand_time:
        s[S.stood_integral, i] = s[S.integral, i]
    if stood < C.stand_time and s[S.stood_error, i] * error < 0.0:
        slip = abs(error - s[S.stood_error, i])
        s[S.kept_error, i] = max(s[S.kept_error, i], min(max(0.5 * slip, abs(error)), C.most_kept))
    s[S.stood_error, i] = error


@inlined
def _integrate(g, s, i, ki, error, beyond, here, k, rests, dt):  # type: ignore[no-untyped-def]
    """Advance the integral [N m] of joint i. beyond: wanted pressure outside its limits [Pa]; here: leverage."""
    if rests and g[G.deadband, i] > 0.0 and k > 0.0:
        if abs(error) <= max(g[G.deadband, i] * here / k, s[S.kept_error, i]) + C.noise:
            return
        stands = s[S.stood, i] >= C.stand_time and s[S.contact, i] == 0.0
        if stands and abs(error) > C.stuck_error:
            ki *= C.stuck_gain
    growth = ki * error
    if g[G.back_calculation, i] != 0.0:
        growth -= beyond * here / g[G.tracking_time, i]
    elif beyond * error > 0.0:
        growth = 0.0
    s[S.integral, i] = min(max(s[S.integral, i] + growth * dt, -g[G.i_max, i]), g[G.i_max, i])


@inlined
def _hold_command(s, i, out):  # type: ignore[no-untyped-def]
    """Repeat the last command of joint i."""
    out[OUT.pressure, i] = s[S.command, i]
    out[OUT.saturated, i] = 0.0


@inlined
def _are_finite(u, i):  # type: ignore[no-untyped-def]
    """Whether every input of joint i is finite."""
    for row in range(u.shape[0]):  # noqa: SIM110 - compiled code has no generators
        if not math.isfinite(u[row, i]):
            return False
    return True


def _joint(g, s, u, i, dt, integrate, drive, out):  # type: ignore[no-untyped-def]
    """One tick of joint i; see `Law.tick`."""
    phi, p = u[U.position, i], u[U.pressure, i]
    if not _are_finite(u, i):
        _hold_command(s, i, out)
        return
    _observe(g, s, i, phi, p, dt)
    a0, a1, a2, a3, d = _adapted_map(g, s, i)
    own = torque(p, phi, s[S.creep, i], a0, a1, a2, a3, g[G.phi_max, i]) + s[S.load, i]
    out[OUT.torque, i] = own * _torque_scale(s, i)
    filtered_speed = (s[S.phi_1, i] - s[S.phi_2, i]) / g[G.observer_filter, i]
    balance = _torque_balance(g, s, i, a0, a1, a2, a3, d, filtered_speed)
    variance = _balance_variance(g, s, i, filtered_speed)
    if g[G.detect, i] != 0.0:
        moves = follows(u[U.speed, i], s[S.speed, i])
        opens, lags = moves and u[U.speed, i] < 0.0, u[U.speed, i] > C.moving_speed and not moves
        detect(g, s, i, balance, variance, opens, lags, dt)
        if contradicted_by_motion(s, i, u[U.speed, i], s[S.speed, i], dt):
            reset_covariance(g, s, i)
    out[OUT.contact, i], out[OUT.contact_age, i] = s[S.contact, i], s[S.age, i]
    out[OUT.contact_torque, i] = balance
    if not drive:
        out[OUT.pressure, i] = out[OUT.saturated, i] = 0.0
        return
    beyond = _control(g, s, u, i, a0, a1, a2, a3, d, filtered_speed, dt, integrate, out)
    if g[G.adapt, i] != 0.0 and dt > 0.0 and integrate and math.isfinite(beyond):
        before = _steady_pressure(g, s, u, i)
        changed = adapt(g, s, i, balance, variance, filtered_speed, beyond != 0.0, dt)
        changed = changed or learn_at_rest(g, s, i, balance, dt)
        if changed and beyond == 0.0:  # at a limit of the pressure the command does not follow the map
            _take_over_map(g, s, u, i, before)


@inlined
def _control(g, s, u, i, a0, a1, a2, a3, d, speed, dt, integrate, out):  # type: ignore[no-untyped-def]
    """Command of joint i; returns by how much the wanted pressure exceeds its limits [Pa], NaN where it has none."""
    phi, k = min(u[U.position, i], g[G.high, i]), -stiffness(u[U.pressure, i], a1, a3)
    here = max(leverage(phi, a2, a3), C.min_leverage)
    kp, ki, kd = _pid_gains(g, s, i, d, k)
    most = u[U.limit, i]
    if g[G.torque_mode, i] == 0.0:
        most -= partner_impact(g, s, u, i)
    most = most / _torque_scale(s, i) - s[S.load, i]
    ceiling = pressure_for_torque(most, phi, s[S.creep, i], a0, a1, a2, a3, g[G.phi_max, i])
    error, wanted = 0.0, ceiling
    # In torque mode the limit is the wanted torque; the valve gives its pressure without an error to integrate.
    if g[G.torque_mode, i] == 0.0:
        error = u[U.reference, i] - u[U.position, i]
        _let_go(s, i, u[U.speed, i])
        wanted = _feed_forward(g, s, u, i, a0, a1, a2, a3, d) if g[G.feed_forward, i] != 0.0 else 0.0
        wanted += (kp * error + kd * (u[U.speed, i] - s[S.speed, i])) / here
        if s[S.take_over, i] != 0.0:
            s[S.take_over, i] = s[S.stood, i] = 0.0
            s[S.integral, i] = min(max((s[S.command, i] - wanted) * here, -g[G.i_max, i]), g[G.i_max, i])
        wanted += s[S.integral, i] / here
    ceiling = min(max(ceiling, 0.0), g[G.p_max, i])
    # At no wanted torque the pressure never rises: with an error of the map it would follow the joint that it moves.
    if g[G.torque_mode, i] != 0.0 and u[U.limit, i] <= 0.0:
        wanted = ceiling = min(ceiling, s[S.command, i])
    if not math.isfinite(wanted + ceiling):
        _hold_command(s, i, out)
        return math.nan
    beyond = wanted - min(max(wanted, 0.0), ceiling)
    rests = _rests(g, s, u, i)
    _watch_slips(g, s, i, error, speed, rests, dt)
    if g[G.schedule, i] != 0.0 and g[G.torque_mode, i] == 0.0:
        watch_swings(g, s, i, error, rests, dt)
    s[S.command, i] = _send(g, s, i, _filter_at_rest(g, s, i, wanted, error, rests, dt), ceiling, rests, dt)
    if integrate:
        _integrate(g, s, i, ki, error, beyond, here, k, rests, dt)
    out[OUT.pressure, i] = s[S.command, i]
    out[OUT.saturated, i] = 1.0 if beyond != 0.0 else 0.0
    return beyond


_inlined_joint = inlined(_joint)


def _compiled() -> Any:
    """The tick of all joints, compiled.

    Its cache is keyed by every equation it uses, since numba looks at changes of one file alone. Its closure may hold
    nothing but this key: a compiled function has another identity in every process, which no cache would find.
    """
    names = ("law", "adaptation", "contact", "swings", "declared")
    sources = [Path(__file__).with_name(f"{name}.py").read_bytes() for name in names]
    equations = {inspect.getfile(inspect.unwrap(function)) for function in (creep_rate, torque)}
    sources += [Path(file).read_bytes() for file in sorted(equations)]
    key = hashlib.sha256(b"".join(sources)).hexdigest()

    def tick(g, s, u, dt, integrate, drive, out):  # type: ignore[no-untyped-def]
        _ = key
        for i in range(g.shape[1]):
            _inlined_joint(g, s, u, i, dt, integrate, drive, out)

    return njit(cache=True, _nrt=False, error_model="numpy")(tick)


_tick = _compiled()


class Law:
    """The memory of the law between ticks: integrators, filters, creep, adapted map and detectors of n joints."""

    def __init__(self, g: Array) -> None:
        """Begin released, without creep, with gains (rows, n) of `tuning.gains`."""
        self.gains = g
        self.state = np.zeros((len(STATE), g.shape[1]))
        self.inputs = np.zeros((len(INPUTS), g.shape[1]))
        self.out = np.zeros((len(OUTPUTS), g.shape[1]))
        self._wanted: Array = self.out[OUT.pressure]
        self.reset_map()

    def release(self) -> None:
        """Set integrators and commands to 0; the observed state of the joints stays."""
        for row in RELEASED:
            self.state[row] = 0.0

    def restart(self, position: Array, pressure: Array) -> None:
        """Before driving begins at position (n,) [rad] and pressure (n,) [Pa]; the plain law has nothing to do."""

    def set_points(self) -> Array:
        """Set-points (n,) [Pa] of the valves for the wanted pressures in the outputs; of the plain law the same."""
        return self._wanted

    @property
    def watched(self) -> Array:
        """Set-points (n,) [Pa] from which the watch of the pressures expects them; of the plain law those sent."""
        return self._wanted

    def reset_map(self) -> None:
        """Return every joint to the map of the description."""
        for i in range(self.state.shape[1]):
            reset_map(self.gains, self.state, i)

    def change(self, g: Array) -> None:
        """Use new gains (rows, joints), SI, from the next tick on without a jump: the integrator changes, too."""
        for i in np.flatnonzero((g[G.adapt] == 0.0) & (self.gains[G.adapt] != 0.0)):
            reset_map(self.gains, self.state, i)
        if not np.array_equal(g, self.gains):
            self.state[S.take_over] = 1.0
        self.gains = g

    def tick(
        self, inputs: Array, dt: float, integrate: bool = True, drive: bool = True, frozen: Flags | None = None
    ) -> Array:
        """One tick of every joint after dt [s]; returns the outputs (rows, n), which the next tick overwrites.

        A dt below C.min_dt or not finite counts as 0, in which no command can rise; a huge one as C.max_dt.
        inputs: (rows, n), rows as in `declared.INPUTS`; `Law.inputs` is an array of this shape for the caller's use.
        integrate: False stops the integrators and the adaptation.  drive: False observes only, and commands 0 Pa.
        frozen: (n,) joints whose integrators stop and whose adaptation pauses.
        """
        stops = frozen is not None and frozen.any()
        kept = self.state[S.integral, frozen] if stops else None
        if stops:
            self.state[S.pause, frozen] = C.pause_time
            self.state[S.stood, frozen] = 0.0
        _tick(self.gains, self.state, inputs, bounded_dt(dt), integrate, drive, self.out)
        if stops:
            self.state[S.integral, frozen] = kept
        return self.out
