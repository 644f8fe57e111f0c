"""Magnet and sensor are not centred: the reading has harmonic errors."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def angle_reading(q, phi):  # type: ignore[no-untyped-def]
    """The angle plus the first two harmonics of the error; by the law also the third and the fourth."""
    sine, cosine, sine_2, cosine_2, sine_3, cosine_3, sine_4, cosine_4 = q
    s, c = sine_cosine(phi)
    s_2, c_2 = 2.0 * s * c, c * c - s * s
    low = phi + sine * s + cosine * c + sine_2 * s_2 + cosine_2 * c_2
    third = sine_3 * (s * c_2 + c * s_2) + cosine_3 * (c * c_2 - s * s_2)
    return low + third + sine_4 * 2.0 * s_2 * c_2 + cosine_4 * (c_2 * c_2 - s_2 * s_2)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Error of the reading [rad] at the true angle x [rad]."""
    return float(angle_reading(q, x) - x)


_LAW = tuple(
    Parameter(f"hall_misalignment.{name}_{k}_deg", -10.0, 10.0, f"law: {order} harmonic", DEGREE, 0.0, 0.5, law=True)
    for k, order in ((3, "third"), (4, "fourth"))
    for name in ("sine", "cosine")
)
EFFECT = Effect(
    name="hall_misalignment",
    place="angle_sensor",
    needs=("rotation", "magnetic_sensor"),
    parameters=(
        Parameter("hall_misalignment.sine_deg", -20.0, 20.0, "first harmonic of the error", DEGREE, 0.0, 1.0),
        Parameter("hall_misalignment.cosine_deg", -20.0, 20.0, "first harmonic of the error", DEGREE, 0.0, 1.0),
        Parameter("hall_misalignment.sine_2_deg", -20.0, 20.0, "second harmonic of the error", DEGREE, 0.0, 1.0),
        Parameter("hall_misalignment.cosine_2_deg", -20.0, 20.0, "second harmonic of the error", DEGREE, 0.0, 1.0),
        *_LAW,
    ),
    hooks={"angle_reading": angle_reading},
    keys=tuple(f"hall_misalignment.{key}_deg" for key in ("sine", "cosine", "sine_2", "cosine_2")),
    probes=((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    says="the {angle} reading has harmonic errors: {sine_deg} sin + {cosine_deg} cos of the {angle},"
    " {sine_2_deg} sin + {cosine_2_deg} cos of twice the {angle}",
    experiments=("stops", "staircase"),
    doc="Eccentric or tilted magnet: harmonics of the angle in its reading.",
    source="Eq. 1 with harmonics; harmonic error of magnetic encoders",
    constitution=Constitution(
        acts_on="reading of the angle",
        sign="either",
        monotone="periodic in the angle, continuous",
        over=("angle",),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the error of the {angle} reading",
        unit="rad",
        curve=curve,
        source="Fourier series of a magnetic field, Popovic, Hall Effect Devices, 2004",
    ),
)
