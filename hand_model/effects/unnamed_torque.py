"""A torque on the joint of physics without a name: a curve over one state, or a harmonic of it."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import NEIGHBOUR, TIME, Effect
from hand_model.effects.operators import knot, sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

_TURN = 2.0 * math.pi


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """The curve at x, linear between eight knots from x = 0 to 1 and constant beyond, plus one harmonic of x turns."""
    x = q[0] + q[1] * phi + q[2] * omega + q[3] * p + q[4] * e[TIME] + q[5] * e[NEIGHBOUR]
    at = 7.0 * min(max(x, 0.0), 1.0)
    value, rise = knot(q[6], at, 0.0, 0.0)
    value, rise = knot(q[7], at - 1.0, value, rise)
    value, rise = knot(q[8], at - 2.0, value, rise)
    value, rise = knot(q[9], at - 3.0, value, rise)
    value, rise = knot(q[10], at - 4.0, value, rise)
    value, rise = knot(q[11], at - 5.0, value, rise)
    value, rise = knot(q[12], at - 6.0, value, rise)
    value, rise = knot(q[13], at - 7.0, value, rise)
    s, c = sine_cosine(_TURN * x)
    inside = 7.0 if 0.0 < x < 1.0 else 0.0
    per_x = inside * rise + _TURN * (q[14] * c - q[15] * s)
    return value + q[14] * s + q[15] * c, -per_x * q[1]


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque [N m] where the chosen state is at x, its place between the ends of the curve [-]; y is not used."""
    return float(torque((x, 0.0, 0.0, 0.0, 0.0, 0.0, *q[6:]), 0.0, 0.0, 0.0, 0.0, (0.0, 0.0))[0])


_STATES = (
    Parameter("unnamed_torque.offset", -1e3, 1e3, "x where every state is 0", 1.0, 0.0),
    Parameter("unnamed_torque.angle_per_rad", -1e3, 1e3, "growth of x with the angle", 1.0, 0.0),
    Parameter("unnamed_torque.speed_s_per_rad", -1e3, 1e3, "growth of x with the speed", 1.0, 0.0),
    Parameter("unnamed_torque.pressure_per_pa", -1.0, 1.0, "growth of x with the pressure", 1.0, 0.0),
    Parameter("unnamed_torque.time_per_s", -1e3, 1e3, "growth of x with the time", 1.0, 0.0),
    Parameter("unnamed_torque.neighbour_per_rad", -1e3, 1e3, "growth of x with a neighbour's angle", 1.0, 0.0),
)
_LAW = (
    *(
        Parameter(f"unnamed_torque.knot_{k}_nm", -5.0, 5.0, f"law: torque at x = {k}/7", 1.0, 0.0, 0.005, law=True)
        for k in range(8)
    ),
    Parameter("unnamed_torque.sine_nm", -5.0, 5.0, "law: torque times the sine of x turns", 1.0, 0.0, 0.005, law=True),
    Parameter("unnamed_torque.cosine_nm", -5.0, 5.0, "law: torque times their cosine", 1.0, 0.0, 0.005, law=True),
)
EFFECT = Effect(
    name="unnamed_torque",
    place="joint",
    parameters=(*_STATES, *_LAW),
    hooks={"torque": torque},
    says="a {torque} that no effect of the catalogue names acts on the joint",
    meets_others=True,
    doc="A torque over one state, learned from what all named effects leave.",
    source="linear splines, de Boor, A Practical Guide to Splines, 2001; Fourier series",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="either",
        monotone="linear between knots, or one harmonic",
        over=("angle", "speed", "pressure", "time"),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the {torque} without a name",
        unit="nm",
        curve=curve,
        source="none: it describes and does not explain",
    ),
)
