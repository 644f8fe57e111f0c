"""Where effects hook into the chain: of every place, the functions of all effects as one.

What comes first in the catalogue acts first; a reading's fault is taken back in the opposite order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hand_model.effects import CATALOGUE
from hand_model.effects.effect import inline


def _composed(hook: str, pair: Callable[[Any, Any], Any], nothing: Any) -> Any:
    """The functions that effects hook in at one place, as one function."""
    functions: list[Any] = [effect.hooks[hook] for effect in CATALOGUE if hook in effect.hooks]
    whole = functions[0] if functions else inline(nothing)
    for function in functions[1:]:
        whole = inline(pair(whole, function))
    return whole


def _then_set_point(a: Any, b: Any) -> Any:
    return lambda w, i, u, p, e, h: b(w, i, a(w, i, u, p, e, h), p, e, h)


def _then_rate(a: Any, b: Any) -> Any:
    return lambda w, i, rate, p, u, e: b(w, i, a(w, i, rate, p, u, e), p, u, e)


def _then(a: Any, b: Any) -> Any:
    return lambda w, i, x: b(w, i, a(w, i, x))


def _then_undo(a: Any, b: Any) -> Any:
    return lambda w, i, x: a(w, i, b(w, i, x))


def _then_timed(a: Any, b: Any) -> Any:
    return lambda w, i, x, h: b(w, i, a(w, i, x, h), h)


def _plus_torque(a: Any, b: Any) -> Any:
    def both(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
        torque_a, stiffness_a = a(w, i, phi, omega, p, e)
        torque_b, stiffness_b = b(w, i, phi, omega, p, e)
        return torque_a + torque_b, stiffness_a + stiffness_b

    return both


def _plus_speed(a: Any, b: Any) -> Any:
    return lambda w, i, omega: a(w, i, omega) + b(w, i, omega)


def _plus_dry(a: Any, b: Any) -> Any:
    return lambda w, i, omega, p: a(w, i, omega, p) + b(w, i, omega, p)


def _both_moved(a: Any, b: Any) -> Any:
    return lambda w, i, before, after, h: a(w, i, before, after, h) + b(w, i, before, after, h)


shaped_set_point = _composed("set_point", _then_set_point, lambda w, i, u, p, e, h: u)
felt_error = _composed("valve_error", _then, lambda w, i, error: error)
changed_rate = _composed("pressure_rate", _then_rate, lambda w, i, rate, p, u, e: rate)
read_pressure = _composed("pressure_reading", _then, lambda w, i, p: p)
true_pressure = _composed("pressure_true", _then_undo, lambda w, i, p: p)
at_actuator = _composed("actuator_pressure", _then_timed, lambda w, i, p, h: p)
added_torque = _composed("torque", _plus_torque, lambda w, i, phi, omega, p, e: (0.0, 0.0))
added_damping = _composed("damping", _plus_speed, lambda w, i, omega: 0.0)
dry_friction = _composed("dry", _plus_dry, lambda w, i, omega, p: 0.0)
keep_motion = _composed("moved", _both_moved, lambda w, i, before, after, h: 0.0)
read_angle = _composed("angle_reading", _then_timed, lambda w, i, phi, h: phi)
read_force = _composed("force_reading", _then_timed, lambda w, i, force, h: force)
