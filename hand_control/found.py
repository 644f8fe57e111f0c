"""The physics that a description of the hand has beyond Eqs. 6 to 12, for the law: torques, friction, valves, fluid.

`hand diagnose` and `hand identify` write effects into the description. The kernel's equations of these effects give

    load    torque of the effects at the measured state without friction; torque estimate and torque ceiling use it
    drag    torque of the effects' friction and damping at the measured speed; with the load it completes the balance of
            contact detection and adaptation
    spread  part of that friction that is uncertain at low speed; it widens the threshold of contact detection
    ahead   torque of all effects at the reference, a valve's lag ahead; feed-forward overcomes it

and the pressure in the actuator instead of the measured one. Behind the law, the set-point is the one with which the
described valve and fluid give the wanted pressure: against a leak, displaced fluid, a dead band and hysteresis.

What depends on the time of a recording (turning attitude, ageing) acts as at its start. Effects of the angle sensor are
left to its calibration. Positive torques flex.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_control.declared import G, S, Settings, U, bounded_dt
from hand_control.law import Law
from hand_control.tuning import gains
from hand_model.arrays import Array, Flags
from hand_model.compile_cache import njit
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.effects.effect import EXOGENOUS, Effect
from hand_model.kernel.compiled import specialise
from hand_model.kernel.hooks import Hooks, active_effects, compose, equations_key, has_laws
from hand_model.kernel.layout import WORK, prepare_rows
from hand_model.kernel.rows import MEMORY_ROW, PREPARED_ROW, ROW, STARTS, STATE_ROW
from hand_model.kernel.terms import actuator_torque, terms
from hand_model.statics import pressure_for_torque

TORQUES = (
    "creep",
    "hysteresis",
    "stiffening",
    "thermal_drift",
    "viscous_friction",
    "gravity",
    "joint_coupling",
    "unnamed_torque",
)
"""Effects whose torques are added; friction has a part of its own."""
FRICTION = "coulomb_friction"
READINGS = ("pressure_gain", "pressure_offset", "tube_lag")
"""Effects between the measured pressure and that of the actuator."""
SOURCES = ("leak", "gas_compression", "hydraulic", "valve_lag", "valve_deadband", "unnamed_pressure")
"""Effects of the rate of the pressure and of the error to which the valve reacts."""
DISPLACING = ("gas_compression", "hydraulic")
"""Those of them that the watch of the pressures expects by itself."""
LOOP = "valve_hysteresis"
USED = (*TORQUES, FRICTION, *READINGS, *SOURCES, LOOP)
"""Names of the effects that the law uses in addition to the numbers of the plain plant."""
PLAY_RAD = float(np.radians(0.1))
"""The memory of loops follows the measured angle with this play, so that noise does not move it."""
SLIDING_RAD_S, MOVING_RAD_S = 0.05, 0.01
"""Speeds from which friction has its full size: of the joint, whose measured speed is noisy, and of the reference."""
AT_REST, AT_SPEED = 0.5, 0.15
"""Uncertain share of the friction at rest, where it may have either sign, and at speed."""
EDGE_PA = 1e3
"""Pressure error from which the dead band is crossed as a whole; below, in proportion, because a sensor has noise."""
MOST, MOST_PA = 0.5, 3e4
"""A set-point is at most this share and this pressure above the wanted pressure."""
ROUNDS, LEAST = 12, 0.2
"""Halvings by which a valve's reaction is inverted, and the least error over that reaction: venting may be faster."""
_LOAD, _SUPPLY, _TAU = ROW["constant_load.torque_nm"], ROW["supply.pressure_pa"], ROW["valve.time_constant_s"]
_D = ROW["dynamics.viscous_friction_nm_s_per_rad"]
_DEAD, _PHI_MAX = ROW["valve.dead_time_s"], ROW["material.phi_max_deg"]
_A0, _A1, _A2, _A3 = (ROW[f"statics.{key}"] for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad"))
_LAG, _TUBE = ROW["valve_lag.time_constant_s"], ROW["tube_lag.time_constant_s"]
_BRISTLE = MEMORY_ROW["coulomb_friction.bristle"]
_MEMORY = len(ROW) + len(PREPARED_ROW)
assert EXOGENOUS == 7

# Global names of the loops below, given by `specialise` for a set of effects.
prepare: Any = None
pressure_true: Any = None
actuator_pressure: Any = None
moved: Any = None
free_torque: Any = None
rub_dry: Any = None
rub_torque: Any = None
source: Any = None
displaced: Any = None
valve_error: Any = None
loop_set_point: Any = None
torque_ahead: Any = None
remembers = rubs = bends = loops_ = False


@njit(error_model="numpy")
def _smooth(speed, full):  # type: ignore[no-untyped-def]
    """Direction of a motion, -1 to 1, with its full size from the speed `full` on."""
    return min(max(speed / full, -1.0), 1.0)


def _before(key: str) -> Callable[..., Any]:
    """The loop ahead of the law, to be specialised."""

    def before(w, neighbour, track, s, u, dt):  # type: ignore[no-untyped-def]
        _ = key
        joints = w.shape[1]
        if dt > 0.0:
            for i in range(joints):
                prepare(w, i, dt)
                u[U.pressure, i] = actuator_pressure(w, i, pressure_true(w, i, u[U.pressure, i]), dt)
                if remembers:
                    last = track[i]
                    track[i] = min(max(last, u[U.position, i] - PLAY_RAD), u[U.position, i] + PLAY_RAD)
                    moved(w, i, last, track[i], dt)
        else:
            for i in range(joints):
                u[U.pressure, i] = pressure_true(w, i, u[U.pressure, i])
        for i in range(joints):
            phi, p, creep, speed = u[U.position, i], u[U.pressure, i], s[S.creep, i], s[S.speed, i]
            around = (0.0, u[U.position, neighbour[i]], 0.0, 0.0, phi, speed, 0.0)
            still = free_torque(w, i, phi, 0.0, p, creep, around)
            load = still - actuator_torque(w, i, p, phi, creep)
            drag = free_torque(w, i, phi, speed, p, creep, around) - still + w[_D, i] * speed
            spread = 0.0
            if rubs:
                w[_BRISTLE, i] = 1.0
                level = rub_dry(w, i, phi, speed, p) - rub_torque(w, i, phi, speed, p, 0.0, around)[0]
                sliding = _smooth(speed, SLIDING_RAD_S)
                drag -= level * sliding
                spread = level * (AT_REST + (AT_SPEED - AT_REST) * abs(sliding))
            s[S.load, i] = load if np.isfinite(load) else 0.0
            s[S.drag, i] = drag if np.isfinite(drag) else 0.0
            s[S.spread, i] = spread if np.isfinite(spread) else 0.0
            ahead = torque_ahead(w, neighbour, track, s, u, i)
            s[S.ahead, i] = ahead if np.isfinite(ahead) else 0.0

    return before


def _ahead(key: str) -> Callable[..., Any]:
    """Torque of all effects at the reference, to be specialised."""

    def torque_ahead(w, neighbour, track, s, u, i):  # type: ignore[no-untyped-def]
        _ = key
        lead = w[_TAU, i] + w[_DEAD, i] + w[_LAG, i] + w[_TUBE, i]
        j = neighbour[i]
        at = u[U.reference, i] + lead * u[U.speed, i]
        speed = u[U.speed, i] + lead * u[U.acceleration, i]
        creep = s[S.creep, i]
        around = (0.0, u[U.reference, j] + lead * u[U.speed, j], 0.0, 0.0, at, speed, 0.0)
        kept = w[_MEMORY:STATE_ROW, i].copy()
        if remembers:
            moved(w, i, track[i], at, lead)
        added, p = 0.0, 0.0
        for _ in range(2):
            p = pressure_for_torque(
                -added, u[U.reference, i], creep, w[_A0, i], w[_A1, i], w[_A2, i], w[_A3, i], w[_PHI_MAX, i]
            )
            p = min(max(p, 0.0), w[_SUPPLY, i])
            added = free_torque(w, i, at, speed, p, creep, around) - actuator_torque(w, i, p, at, creep)
            added += w[_D, i] * speed
        if rubs:
            w[_BRISTLE, i] = 1.0
            level = rub_dry(w, i, at, speed, p) - rub_torque(w, i, at, speed, p, 0.0, around)[0]
            added -= level * _smooth(speed, MOVING_RAD_S)
        if remembers:
            w[_MEMORY:STATE_ROW, i] = kept
        return added

    return torque_ahead


def _after(key: str) -> Callable[..., Any]:
    """The loop behind the law, to be specialised."""

    def after(w, u, wanted, sent, watched):  # type: ignore[no-untyped-def]
        _ = key
        for i in range(w.shape[1]):
            around = (0.0, 0.0, 0.0, 0.0, u[U.reference, i], u[U.speed, i], 0.0)
            p, lost = u[U.pressure, i], w[_TAU, i] * source(w, i, wanted[i], around)
            most = MOST * wanted[i] + MOST_PA
            target = wanted[i] + min(max(-lost, -most), most)
            watched[i] = wanted[i]
            if wanted[i] > 0.0:
                moved_pa = -w[_TAU, i] * displaced(w, i, wanted[i], around)
                watched[i] = max(wanted[i] + min(max(moved_pa, -most), most), 0.0)
            if bends:
                error = target - p
                size = max(abs(error), EDGE_PA)
                sign = 1.0 if error >= 0.0 else -1.0
                low, high = LEAST * size, size + most
                for _ in range(ROUNDS):
                    middle = 0.5 * (low + high)
                    if sign * valve_error(w, i, sign * middle) < size:
                        low = middle
                    else:
                        high = middle
                target += sign * (high - size) * min(abs(error) / EDGE_PA, 1.0)
            if loops_:
                kept = w[_MEMORY:STATE_ROW, i].copy()
                asked = target
                for _ in range(3):
                    w[_MEMORY:STATE_ROW, i] = kept
                    asked += target - loop_set_point(w, i, asked, p, around, 0.0)
                    asked = min(max(asked, 0.0), w[_SUPPLY, i])
                w[_MEMORY:STATE_ROW, i] = kept
                loop_set_point(w, i, asked if wanted[i] > 0.0 else 0.0, p, around, 0.0)
                target = asked
            target = min(max(target, 0.0), wanted[i] + most, w[_SUPPLY, i])
            sent[i] = target if wanted[i] > 0.0 and np.isfinite(target) else wanted[i]

    return after


@dataclass(frozen=True, slots=True)
class _Loops:
    """Compiled loops for a set of effects, and whether the second one changes anything."""

    before: Any
    after: Any
    shapes: bool


@cache
def _compiled(names: tuple[str, ...], laws: bool) -> _Loops:
    """The loops for effects in the order of the catalogue."""

    def hooks(wanted: tuple[str, ...]) -> Hooks:
        return compose(tuple(EFFECTS[name] for name in names if name in wanted), laws)

    pushes, rub, valve = hooks((*TORQUES, *READINGS)), hooks((FRICTION,)), hooks(SOURCES)
    key = equations_key("found with laws" if laws else "found", *names)
    used = {
        "prepare": hooks(USED).prepare,
        "pressure_true": pushes.pressure_true,
        "actuator_pressure": pushes.actuator_pressure,
        "moved": pushes.moved,
        "free_torque": terms(pushes).free_torque,
        "rub_dry": rub.dry,
        "rub_torque": rub.torque,
        "source": valve.pressure_source,
        "displaced": hooks(DISPLACING).pressure_source,
        "valve_error": valve.valve_error,
        "loop_set_point": hooks((LOOP,)).set_point,
        "remembers": pushes.uses("moved"),
        "rubs": rub.uses("dry"),
        "bends": valve.uses("valve_error"),
        "loops_": LOOP in names,
    }
    used["torque_ahead"] = njit(error_model="numpy")(specialise(_ahead(key), used))
    before, after = (njit(cache=True, error_model="numpy")(specialise(loop(key), used)) for loop in (_before, _after))
    return _Loops(before, after, valve.uses("pressure_source") or valve.uses("valve_error") or LOOP in names)


def used_effects(parameters: Array) -> tuple[Effect, ...]:
    """Effects in parameters (rows, joints), SI, that the law uses, in the order of the catalogue."""
    return tuple(effect for effect in active_effects(parameters) if effect.name in USED)


def neighbours(partner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index (n,) of the joint that each joint's coupling means: its partner, or else the joint before it."""
    return np.where(partner >= 0, partner, np.maximum(np.arange(len(partner)) - 1, 0))


class FoundPhysics:
    """What the effects of a description add to the law, tick by tick, for n joints.

    shapes: whether set-points differ from wanted pressures.  watched: set-points (n,) [Pa] as `Law.watched` has them.
    """

    def __init__(self, parameters: Array, neighbour: NDArray[np.int64], period_s: float) -> None:
        """Begin vented for long. parameters: (rows of JOINT_PARAMETERS, n) SI; neighbour: (n,); period_s: of a tick."""
        names = tuple(effect.name for effect in used_effects(parameters))
        self._loops = _compiled(names, has_laws(parameters.T))
        self.shapes: bool = self._loops.shapes
        self._w = np.zeros((WORK, parameters.shape[1]))
        self._w[: len(parameters)] = parameters
        prepare_rows(self._w, period_s)
        self._neighbour = np.ascontiguousarray(neighbour)
        self._track = np.zeros(parameters.shape[1])
        self._begun = False
        self.sent, self.watched = np.zeros(parameters.shape[1]), np.zeros(parameters.shape[1])

    def start(self, position: Array, pressure: Array) -> None:
        """Begin with the memory of a hand that has long been at position (n,) [rad] and pressure (n,) [Pa]."""
        self._w[_MEMORY:STATE_ROW] = 0.0
        for row, kind in STARTS:
            self._w[row] = position if kind == "angle" else pressure
        self._track[:] = position
        self.watched[:] = 0.0
        self._begun = True

    def before(self, state: Array, inputs: Array, dt: float) -> None:
        """Fill the rows of the law's state from its inputs; the pressure among them becomes that of the actuator."""
        if not np.isfinite(inputs).all():
            return
        if not self._begun:
            self.start(inputs[U.position], inputs[U.pressure])
        self._loops.before(self._w, self._neighbour, self._track, state, inputs, dt)

    def set_points(self, inputs: Array, wanted: Array) -> Array:
        """Set-points (n,) [Pa] with which valve and fluid give the wanted pressures (n,) [Pa]; 0 stays 0."""
        self._loops.after(self._w, inputs, wanted, self.sent, self.watched)
        return self.sent


class FoundLaw(Law):
    """The law with the found physics of a description."""

    def __init__(self, g: Array, found: FoundPhysics) -> None:
        """Begin released, with gains (rows, n) of `tuning.gains`."""
        super().__init__(g)
        self.found = found
        self._given = self.inputs

    def tick(
        self, inputs: Array, dt: float, integrate: bool = True, drive: bool = True, frozen: Flags | None = None
    ) -> Array:
        """As `Law.tick`: outputs (rows, n) of inputs (rows, n), whose pressure becomes the actuator's, after dt [s]."""
        self.found.before(self.state, inputs, bounded_dt(dt))
        self._given = inputs
        return super().tick(inputs, dt, integrate, drive, frozen)

    def restart(self, position: Array, pressure: Array) -> None:
        """Restart the memory of the effects at position (n,) [rad] and pressure (n,) [Pa]."""
        self.found.start(position, pressure)

    def set_points(self) -> Array:
        """Set-points (n,) [Pa] against leak, displaced fluid, dead band and hysteresis, within limits; 0 stays 0."""
        wanted = super().set_points()
        if not self.found.shapes:
            return wanted
        sent = self.found.set_points(self._given, wanted)
        np.minimum(sent, self.gains[G.p_max], out=sent)
        return sent

    @property
    def watched(self) -> Array:
        """As `Law.watched`, (n,) [Pa]: wanted pressures and what displaced fluid needs."""
        return self.found.watched if self.found.shapes else super().watched


def law_of(hand: Hand, settings: Settings) -> Law:
    """The law of a hand, with what its description has beyond the plain plant."""
    g = gains(hand, settings)
    if not used_effects(hand.parameters) and not hand.row("constant_load.torque_nm").any():
        return Law(g)
    return FoundLaw(g, FoundPhysics(hand.parameters, neighbours(hand.partner), 1.0 / hand.rate_hz))
