"""Units and words of machines: m, mm and N where the axis is linear; rad, deg and N m where it turns."""

from __future__ import annotations

import math

from hand_model.quantities import UnitMap, Wording

AXIS, VOLUME = "axis", "volume"
INPUT = "input"
"""The unit of the input is that of the file's column times its scale; reports call it by this name."""


def wording_of(linear: bool, *, per_torque: float, per_angle: float, per_input: float, per_force: float) -> Wording:
    """The wording of a machine.

    per_torque, per_angle, per_input, per_force: the machine's SI units in one N m, rad, Pa and N of its model [-].
    """
    units = units_of(linear, per_torque=per_torque, per_angle=per_angle, per_input=per_input)
    position, force = ("position", "force") if linear else ("angle", "torque")
    shown = per_angle * units.per_shown_angle
    return Wording(
        units=units,
        axis=AXIS,
        whole="the machine",
        excitable=False,
        signals=(INPUT, position, force),
        signal_units=((per_input, INPUT), (shown, units.shown_angle), (per_force, units.torque)),
        states={
            "pressure": INPUT,
            "angle": position,
            "set-point": INPUT,
            "pressure error": f"error of the {INPUT}",
            "pressure difference": f"difference of the {INPUT}",
        },
        symbols=("x", "u", "v") if linear else ("phi", "u", "omega"),
        symbol_units=((per_angle, units.angle), (per_input, INPUT)),
        positive="moving forward",
        negative="moving back",
        words={"angle": position, "pressure": INPUT, "torque": force, "flexion": "forward motion", "joint": AXIS},
    )


def wording_of_volume() -> Wording:
    """The wording of a closed volume, whose pressure is in Pa."""
    return Wording(
        axis=VOLUME,
        whole="the machine",
        excitable=False,
        words={"angle": "position", "pressure": "pressure", "torque": "force", "flexion": "motion", "joint": VOLUME},
    )


def units_of(linear: bool, *, per_torque: float, per_angle: float, per_input: float) -> UnitMap:
    """Units and names of the parameters of a machine; per_torque, per_angle, per_input as in wording_of [-]."""
    if not linear:
        return UnitMap(
            pressure=INPUT,
            suffixes=("nm", "rad", INPUT, "deg", "kg_m2"),
            per_shown_angle=180.0 / math.pi,
            per_torque=per_torque,
            per_angle=per_angle,
            per_pressure=per_input,
        )
    return UnitMap(
        torque="N",
        angle="m",
        pressure=INPUT,
        shown_angle="mm",
        inertia="kg",
        suffixes=("n", "m", INPUT, "mm", "kg"),
        names={"torque": "force", "angle": "position"},
        per_shown_angle=1e3,
        per_torque=per_torque,
        per_angle=per_angle,
        per_pressure=per_input,
    )
