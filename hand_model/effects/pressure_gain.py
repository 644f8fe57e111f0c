"""The pressure sensor has a span error; its curve may be bent."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """True pressure per reading, and the reciprocal of the supply pressure."""
    error, _, _, supply = q
    return 1.0 / (1.0 + error), 1.0 / supply


@inline
def bow(q, p):  # type: ignore[no-untyped-def]
    """What a bent curve adds to the reading at the true pressure p [Pa], and its slope; nothing at 0 and at supply.

    The reading rises with the pressure for all values within their bounds.
    """
    bend, skew, supply, per_supply = q[1], q[2], q[3], q[5]
    x = min(max(p * per_supply, 0.0), 1.0)
    share = x * (1.0 - x)
    inside = 1.0 if 0.0 < x < 1.0 else 0.0
    slope = inside * (bend * (1.0 - 2.0 * x) + skew * (1.0 - 6.0 * share))
    return supply * share * (bend + skew * (1.0 - 2.0 * x)), slope


@inline
def pressure_reading(q, p):  # type: ignore[no-untyped-def]
    """Reading of the true pressure p."""
    return p * (1.0 + q[0]) + bow(q, p)[0]


@inline
def pressure_true(q, reading):  # type: ignore[no-untyped-def]
    """The true pressure behind a reading, by three steps of Newton's method where the curve is bent."""
    straight = reading * q[4]
    p = straight
    for _ in range(3):
        added, slope = bow(q, p)
        p -= (added + (1.0 + q[0]) * (p - straight)) / (1.0 + q[0] + slope)
    return p


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Error of the reading [Pa] at the true pressure x [Pa]."""
    return float(pressure_reading(q, x) - x)


EFFECT = Effect(
    name="pressure_gain",
    place="pressure_sensor",
    needs=("input_sensor",),
    parameters=(
        Parameter("pressure_gain.error", -0.5, 0.5, "relative error of the span", 1.0, 0.0, 0.005),
        Parameter("pressure_gain.bend", -0.3, 0.3, "law: slope that a bent curve adds at 0", 1.0, 0.0, 0.02, law=True),
        Parameter("pressure_gain.skew", -0.15, 0.15, "law: the same, of a curve like an S", 1.0, 0.0, 0.02, law=True),
    ),
    reads=("supply.pressure_pa",),
    prepared=("per_span", "per_supply"),
    hooks={"prepare": prepare, "pressure_reading": pressure_reading, "pressure_true": pressure_true},
    keys=("pressure_gain.error",),
    probes=((0.04,), (-0.04,)),
    says="the {pressure} sensor reads {error} (relative) too much",
    experiments=("staircase",),
    doc="Span error of a piezoresistive sensor, and its non-linearity.",
    source="IEC 61298-2, span error",
    constitution=Constitution(
        acts_on="reading of the pressure",
        sign="either",
        monotone="rises with the pressure",
        over=("pressure",),
        coefficients=("pressure_gain.bend", "pressure_gain.skew"),
        quantity="the error of the {pressure} reading",
        unit="pa",
        curve=curve,
        source="non-linearity of a sensor between its end points, IEC 61298-2; ratiometric sensor, Martin et al. 2004",
    ),
)
