"""A spring between drive and load, with or without play: two inertias where the model has one."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Angular frequency of the load [rad/s], its damping rate [1/s], half the gap [rad], half the step [s], inertia."""
    ratio, frequency, damping, gap, _, inertia = q
    rate = 2.0 * math.pi * frequency
    return rate, 2.0 * damping * rate, 0.5 * gap, 0.5 * h, ratio * inertia


@inline
def _wound(q, first, last):  # type: ignore[no-untyped-def]
    """Mean deflection [rad] of the spring, and the share of a step in which it is in contact, by Simpson's rule.

    first, last: angles [rad] by which the load is ahead at both ends of the step; within the gap nothing is wound.
    """
    half, middle = q[8], 0.5 * (first + last)
    touches_1 = 1.0 if abs(first) >= half else 0.0
    touches_2 = 1.0 if abs(middle) >= half else 0.0
    touches_3 = 1.0 if abs(last) >= half else 0.0
    wound = first + 4.0 * middle + last - min(max(first, -half), half) - min(max(last, -half), half)
    return (wound - 4.0 * min(max(middle, -half), half)) / 6.0, (touches_1 + 4.0 * touches_2 + touches_3) / 6.0


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Mean torque of the spring on the drive in a step, put back to its start by the motion of the drive alone."""
    rate, damping, half_h, inertia = q[6], q[7], q[9], q[10]
    load, speed = m
    ahead = load - phi
    wound, touches = _wound(q, ahead, ahead + 2.0 * half_h * (speed - omega))
    back = wound + touches * half_h * omega
    return inertia * (rate * rate * back + damping * touches * (speed - omega)), inertia * rate * rate * touches


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """The load follows the motion of the drive, by the implicit midpoint rule."""
    rate, damping, half_h = q[6], q[7], q[9]
    load, speed = m
    wound, touches = _wound(q, load - before, load + h * speed - after)
    pull = damping * touches * (after - before) / h - rate * rate * (wound - half_h * speed * touches)
    middle = (speed + half_h * pull) / (1.0 + half_h * touches * (damping + half_h * rate * rate))
    return load + h * middle, 2.0 * middle - speed


@inline
def angle_reading(q, m, phi):  # type: ignore[no-untyped-def]
    """Angle of the drive, or of the load where the sensor sits there."""
    load, _ = m
    return phi + q[4] * (load - phi)


_BEGINNINGS = tuple(
    (Times(1.0 / (1.0 + ratio)), ratio, frequency, damping, 0.0, side)
    for ratio, frequency, damping in ((1.0, 3.0, 0.05), (1.0, 7.0, 0.05), (0.4, 12.0, 0.05), (1.5, 20.0, 0.05))
    for side in (0.0, 1.0)
)
EFFECT = Effect(
    name="drive_elasticity",
    place="joint",
    needs=("drive", "motor", "one_load"),
    parameters=(
        Parameter("drive_elasticity.ratio", 0.0, 50.0, "inertia behind the spring over that before it", 1.0, 0.0, 1.0),
        Parameter("drive_elasticity.frequency_hz", 0.3, 150.0, "of the load while the drive is held", 1.0, 10.0),
        Parameter("drive_elasticity.damping", 0.0, 1.0, "damping ratio of the same", 1.0, 0.05),
        Parameter("drive_elasticity.gap_deg", 0.0, 30.0, "play of the spring", DEGREE, 0.0, 0.5),
        Parameter(
            "drive_elasticity.at_load", 0.0, 1.0, "1 where the sensor sits at the load, 0 at the drive", 1.0, 0.0, 0.5
        ),
    ),
    reads=("dynamics.inertia_kg_m2",),
    prepared=("rate", "damping_rate", "half_gap", "half_step", "load_inertia"),
    memory={"load": "angle", "speed": 0.0},
    hooks={"prepare": prepare, "torque": torque, "moved": moved, "angle_reading": angle_reading},
    keys=(
        "dynamics.inertia_kg_m2",
        "drive_elasticity.ratio",
        "drive_elasticity.frequency_hz",
        "drive_elasticity.damping",
        "drive_elasticity.gap_deg",
        "drive_elasticity.at_load",
    ),
    probes=_BEGINNINGS,
    spread={"drive_elasticity.frequency_hz": 1.0, "drive_elasticity.damping": 1.0},
    shape=(
        "drive_elasticity.frequency_hz",
        "drive_elasticity.damping",
        "drive_elasticity.gap_deg",
    ),
    says="a spring with a play of {gap_deg} couples {ratio} of the inertia before it, {inertia_kg_m2}, at"
    " {frequency_hz} (damping ratio {damping}); the sensor sees {at_load} of its deflection",
    experiments=("multisine", "chirp"),
    doc="An elastic gear, shaft or belt, with or without play: drive and load swing against each other.",
    source="Spong, J. Dyn. Sys. Meas. Control 109(4), 1987, elastic joints; Nordin and Gutman, Automatica 38(10), 2002",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="towards the load",
        passive=True,
        monotone="rises with the deflection beyond the play",
        memory="angle and speed of the load",
        over=("angle", "speed"),
        source="two inertias and a spring, Spong, J. Dyn. Sys. Meas. Control 109(4), 1987",
    ),
)
