"""A spring between drive and load, with or without play: two inertias where the model has one."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Stiffness [1/s^2] and damping [1/s] per inertia of the load, half the gap [rad], half the step [s], 1 over that,
    and the inertia of the load.
    """
    share, frequency, damping, gap, _, inertia = q
    rate = 2.0 * math.pi * frequency
    return rate * rate, 2.0 * damping * rate, 0.5 * gap, 0.5 * h, 2.0 / h, inertia * share / (1.0 - share)


@inline
def _wound(q, first, last):  # type: ignore[no-untyped-def]
    """Mean deflection [rad] of the spring, and the share of a step in which it is in contact, by Simpson's rule.

    first, last: angles [rad] by which the load is ahead at both ends of the step; within the gap nothing is wound.
    """
    half, middle = q[8], 0.5 * (first + last)
    touches_1 = 1.0 if abs(first) >= half else 0.0
    touches_2 = 1.0 if abs(middle) >= half else 0.0
    touches_3 = 1.0 if abs(last) >= half else 0.0
    wound = first - min(max(first, -half), half) + (last - min(max(last, -half), half))
    wound += 4.0 * (middle - min(max(middle, -half), half))
    return wound * (1 / 6), (touches_1 + 4.0 * touches_2 + touches_3) * (1 / 6)


@inline
def _middle(q, m, before, driving):  # type: ignore[no-untyped-def]
    """Speed of the load in the middle of a step [rad/s], by the implicit midpoint rule, and the share of the inertia,
    times the share of the step in contact, that follows the drive in it.

    before: angle of the drive at the start of the step [rad].  driving: its mean speed [rad/s].
    """
    stiffness, damping, half_h = q[6], q[7], q[9]
    load, speed = m
    ahead = load - before
    wound, touches = _wound(q, ahead, ahead + 2.0 * half_h * (speed - driving))
    pull = damping * touches * (driving - speed) - stiffness * wound
    less = 1.0 / (1.0 + half_h * touches * (damping + half_h * stiffness))
    return speed + half_h * pull * less, touches * less


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """What changes the speed of the load in a step acts back on the drive; it is put back to the start of the step by
    the motion of the drive alone.
    """
    stiffness, half_h, per_half_h, inertia = q[6], q[9], q[10], q[11]
    middle, follows = _middle(q, m, phi, omega)
    slope = inertia * stiffness * follows
    return inertia * (m[1] - middle) * per_half_h + slope * half_h * omega, slope


@inline
def torque_damping(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """The damper of the spring, less what the load follows within the step."""
    _, follows = _middle(q, m, phi, omega)
    return q[11] * q[7] * follows


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """The load follows the motion of the drive."""
    half_h, per_half_h = q[9], q[10]
    load, speed = m
    middle, _ = _middle(q, m, before, 0.5 * (after - before) * per_half_h)
    return load + 2.0 * half_h * middle, 2.0 * middle - speed


@inline
def angle_reading(q, m, phi):  # type: ignore[no-untyped-def]
    """Angle of the drive, or of the load where the sensor sits there."""
    load, _ = m
    return phi + q[4] * (load - phi)


_BEGINNINGS = tuple(
    (Times(1.0 - share), share, frequency, 0.05, 0.0, side)
    for share, frequency in ((0.5, 3.0), (0.5, 7.0), (0.3, 12.0), (0.6, 20.0))
    for side in (0.0, 1.0)
)
EFFECT = Effect(
    name="drive_elasticity",
    place="joint",
    needs=("drive", "motor", "one_load"),
    parameters=(
        Parameter("drive_elasticity.share", 0.0, 0.98, "of the whole inertia that is behind the spring", 1.0, 0.0, 0.5),
        Parameter("drive_elasticity.frequency_hz", 0.3, 150.0, "of the load while the drive is held", 1.0, 10.0),
        Parameter("drive_elasticity.damping", 0.0, 1.0, "damping ratio of the same", 1.0, 0.05),
        Parameter("drive_elasticity.gap_deg", 0.0, 30.0, "play of the spring", DEGREE, 0.0, 0.5),
        Parameter(
            "drive_elasticity.at_load", 0.0, 1.0, "1 where the sensor sits at the load, 0 at the drive", 1.0, 0.0, 0.5
        ),
    ),
    reads=("dynamics.inertia_kg_m2",),
    prepared=("stiffness", "damping_rate", "half_gap", "half_step", "per_half_step", "load_inertia"),
    memory={"load": "angle", "speed": 0.0},
    hooks={
        "prepare": prepare,
        "torque": torque,
        "torque_damping": torque_damping,
        "moved": moved,
        "angle_reading": angle_reading,
    },
    keys=(
        "dynamics.inertia_kg_m2",
        "drive_elasticity.share",
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
    says="a spring with a play of {gap_deg} couples a load, {share} of the whole inertia, to a drive of {inertia_kg_m2}"
    " at {frequency_hz} (damping ratio {damping}); the sensor sees {at_load} of its deflection",
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
