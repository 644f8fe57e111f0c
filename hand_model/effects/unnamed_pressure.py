"""A pressure by which the valve misses its set-point, of physics without a name: a curve or a harmonic of one state."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import ANGLE, TIME, Effect
from hand_model.effects.operators import knot, sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

_TURN = 2.0 * math.pi


@inline
def set_point(q, u, p, e, h):  # type: ignore[no-untyped-def]
    """The set-point plus the curve at x, as of `unnamed_torque`."""
    x = q[0] + q[1] * u + q[2] * p + q[3] * e[TIME] + q[4] * e[ANGLE]
    at = 7.0 * min(max(x, 0.0), 1.0)
    value, rise = knot(q[5], at, 0.0, 0.0)
    value, rise = knot(q[6], at - 1.0, value, rise)
    value, rise = knot(q[7], at - 2.0, value, rise)
    value, rise = knot(q[8], at - 3.0, value, rise)
    value, rise = knot(q[9], at - 4.0, value, rise)
    value, rise = knot(q[10], at - 5.0, value, rise)
    value, rise = knot(q[11], at - 6.0, value, rise)
    value, rise = knot(q[12], at - 7.0, value, rise)
    s, c = sine_cosine(_TURN * x)
    return u + (value + q[13] * s + q[14] * c)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Pressure [Pa] where the chosen state is at x, its place between the ends of the curve [-]; y is not used."""
    return float(set_point((x, 0.0, 0.0, 0.0, 0.0, *q[5:]), 0.0, 0.0, (0.0,) * 5, 0.0))


_STATES = (
    Parameter("unnamed_pressure.offset", -1e3, 1e3, "x where every state is 0", 1.0, 0.0),
    Parameter("unnamed_pressure.set_point_per_pa", -1.0, 1.0, "growth of x with the set-point", 1.0, 0.0),
    Parameter("unnamed_pressure.pressure_per_pa", -1.0, 1.0, "growth of x with the pressure", 1.0, 0.0),
    Parameter("unnamed_pressure.time_per_s", -1e3, 1e3, "growth of x with the time", 1.0, 0.0),
    Parameter("unnamed_pressure.angle_per_rad", -1e3, 1e3, "growth of x with the angle", 1.0, 0.0),
)
_LAW = (
    *(
        Parameter(f"unnamed_pressure.knot_{k}_pa", -5e5, 5e5, f"law: pressure at x = {k}/7", 1.0, 0.0, 3000.0, law=True)
        for k in range(8)
    ),
    Parameter(
        "unnamed_pressure.sine_pa", -5e5, 5e5, "law: pressure times the sine of x turns", 1.0, 0.0, 3000.0, law=True
    ),
    Parameter("unnamed_pressure.cosine_pa", -5e5, 5e5, "law: pressure times their cosine", 1.0, 0.0, 3000.0, law=True),
)
EFFECT = Effect(
    name="unnamed_pressure",
    place="valve",
    parameters=(*_STATES, *_LAW),
    hooks={"set_point": set_point},
    says="the valve misses its set-point in a way that no effect of the catalogue names",
    doc="A deviation of the set-point over one state, learned from what all named effects leave.",
    source="linear splines, de Boor, A Practical Guide to Splines, 2001; Fourier series",
    constitution=Constitution(
        acts_on="set-point of the valve",
        sign="either",
        monotone="linear between knots, or one harmonic",
        over=("set-point", "pressure", "time", "angle"),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the {pressure} without a name",
        unit="pa",
        curve=curve,
        source="none: it describes and does not explain",
    ),
)
