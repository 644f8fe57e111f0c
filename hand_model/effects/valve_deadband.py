"""Small errors of pressure do not open the valve."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

LEAST_PA = 1e-9
"""Keeps the reciprocal of the width finite."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocals of the widths of filling and venting."""
    width, asymmetry = q[0], q[4]
    return 1.0 / (width * (1.0 + asymmetry) + LEAST_PA), 1.0 / (width * (1.0 - asymmetry) + LEAST_PA)


@inline
def valve_error(q, error):  # type: ignore[no-untyped-def]
    """The valve reacts to the part of the error beyond the dead band, with a sharp edge or a gradual one.

    A gradual edge opens with the square of the error up to twice the width, as a rounded notch of a spool does.
    The law leaves a share of the slope within the band, which is the leakage of the closed edge, and lets the loss
    fall again beyond the band, as for edges that a larger opening clears. By the law, the edges of filling and venting
    may overlap by different widths.
    """
    middle, soft, left, clearing, asymmetry, per_filling, per_venting = q
    filling = 1.0 if error > 0.0 else 0.0
    width = middle * (1.0 + asymmetry * (2.0 * filling - 1.0))
    per_width = per_venting + filling * (per_filling - per_venting)
    sharp = min(max(error, -width), width)
    x = min(max(error * per_width, -2.0), 2.0)
    gradual = width * x * (1.0 - 0.25 * abs(x))
    beyond = min(abs(error) * per_width, 8.0)
    closed = (1.0 - left) / (1.0 + clearing * beyond * beyond)
    return error - closed * sharp - closed * soft * (gradual - sharp)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Part of the pressure error x [Pa] to which the valve reacts [Pa]."""
    return float(valve_error(q, x))


EFFECT = Effect(
    name="valve_deadband",
    place="valve",
    needs=("valve",),
    parameters=(
        Parameter("valve_deadband.width_pa", 0.0, 2e5, "error that opens nothing", 1.0, 0.0, 5e3),
        Parameter("valve_deadband.softness", 0.0, 1.0, "0 a sharp edge, 1 a gradual opening", 1.0, 0.0, 0.17),
        Parameter("valve_deadband.slope_left", 0.0, 1.0, "law: share of the slope within", 1.0, 0.0, 0.1, law=True),
        Parameter(
            "valve_deadband.clearing", 0.0, 5.0, "law: how soon the loss falls beyond it", 1.0, 0.0, 0.3, law=True
        ),
        Parameter(
            "valve_deadband.asymmetry",
            -0.9,
            0.9,
            "law: share wider when filling, narrower when venting",
            1.0,
            0.0,
            0.3,
            law=True,
        ),
    ),
    prepared=("per_filling", "per_venting"),
    hooks={"prepare": prepare, "valve_error": valve_error},
    keys=("valve_deadband.width_pa", "valve_deadband.softness"),
    probes=((3e3, 0.0), (1.5e4, 0.0), (3e3, 1.0), (1.5e4, 1.0)),
    shape=("valve_deadband.softness",),
    says="the valve does not react to pressure errors below {width_pa} (softness of the edge {softness})",
    experiments=("slow_triangle", "staircase"),
    doc="Overlap of a spool or a regulator's tolerance: little or no flow while the error is small.",
    source="ISO 6358 valves with overlap, Beater, Pneumatic Drives, 2007",
    constitution=Constitution(
        acts_on="error to which the valve reacts",
        sign="that of the error, and never more than it",
        monotone="rises with the error, and stays between 0 and the error",
        over=("pressure error",),
        coefficients=("valve_deadband.slope_left", "valve_deadband.clearing", "valve_deadband.asymmetry"),
        quantity="the error to which the valve reacts when it fills",
        unit="pa",
        curve=curve,
        source="sector condition of a memoryless nonlinearity, Khalil, Nonlinear Systems, 2002, sec. 6.1",
    ),
)
