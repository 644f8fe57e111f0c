"""Friction of a gear, a screw or a bearing that grows with the torques that pass through it."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import direction, drive_torque, sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

SIZE_NM = 0.5
"""Torque at which the growth of the law counts: the largest one of a machine, scaled to a finger."""


@inline
def load_torque(q, phi):  # type: ignore[no-untyped-def]
    """Torque [N m] of weight, spring and constant load on the gear at the angle phi [rad]."""
    sine, cosine, spring, elasticity, load, held = q[6], q[7], q[8], q[9], q[10], q[15]
    s, c = sine_cosine(phi)
    return (elasticity + held - spring) * phi - load - (sine * s + cosine * c)


@inline
def motor_torque(q, phi, omega, p):  # type: ignore[no-untyped-def]
    """Torque [N m] of the drive within its limit."""
    asked, _ = drive_torque(phi, omega, p, (1.0 + q[11], q[12], q[13], q[15], q[16]))
    return min(max(asked, -q[14]), q[14])


@inline
def _level(q, drive, load, omega):  # type: ignore[no-untyped-def]
    """Magnitude of the friction torque [N m].

    By the law it falls with the speed, is another one where the load moves the drive, and rises more than in proportion
    with the torques.
    """
    per_drive, per_load, at_rest, stribeck, back, growth = q[:6]
    x = omega / stribeck
    moved_by_load = 0.5 * (1.0 + direction(omega * load))
    level = (per_drive * abs(drive) + per_load * abs(load)) * (1.0 + growth * (abs(drive) + abs(load)) / SIZE_NM)
    return level * (1.0 + at_rest / (1.0 + x * x)) * (1.0 + back * moved_by_load)


@inline
def dry(q, m, phi, omega, p):  # type: ignore[no-untyped-def]
    """Share of the torques on both sides of the gear."""
    (middle,) = m
    return _level(q, motor_torque(q, middle, omega, p), load_torque(q, middle), omega)


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """The angle expected in the middle of the next step, at which the load acts: friction of second order."""
    return (after + 0.5 * (after - before),)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Friction [N m] of SIZE_NM on either side at the speed x [rad/s]; the load opposes it (y 0) or drives (y 1)."""
    return float(_level(q, SIZE_NM, SIZE_NM * (2.0 * y - 1.0), x))


EFFECT = Effect(
    name="gear_friction",
    place="joint",
    needs=("one_axis", "motor"),
    parameters=(
        Parameter("gear_friction.per_drive", 0.0, 0.9, "friction over the torque of the drive", 1.0, 0.0, 0.1),
        Parameter("gear_friction.per_load", 0.0, 0.9, "friction over the torque of the load", 1.0, 0.0, 0.1),
        Parameter("gear_friction.at_rest", 0.0, 5.0, "law: share of it that is more at rest", 1.0, 0.0, 0.5, law=True),
        Parameter("gear_friction.stribeck_rad_per_s", 1e-3, 10.0, "speed at which half of that is gone", 1.0, 0.1),
        Parameter(
            "gear_friction.back", -0.95, 5.0, "law: share that is more where the load drives", 1.0, 0.0, 0.3, law=True
        ),
        Parameter("gear_friction.growth", 0.0, 5.0, "law: share that is more at 0.5 N m", 1.0, 0.0, 0.3, law=True),
    ),
    reads=(
        "gravity.sine_nm",
        "gravity.cosine_nm",
        "spring.stiffness_nm_per_rad",
        "statics.a1_nm_per_rad",
        "constant_load.torque_nm",
        "drive_gain.error",
        "statics.a2_nm_per_pa",
        "statics.a3_nm_per_pa_rad",
        "drive_saturation.limit_nm",
        "drive_saturation.stiffness_nm_per_rad",
        "drive_saturation.damping_nm_s_per_rad",
    ),
    memory={"middle": "angle"},
    hooks={"dry": dry, "moved": moved},
    keys=("gear_friction.per_drive", "gear_friction.per_load"),
    probes=((0.1, 0.0), (0.0, 0.1), (0.1, 0.1), (0.3, 0.3)),
    says="friction grows with the {torque} through the gear: {per_drive} of that of the drive and {per_load} of that of"
    " the load",
    experiments=("slow_triangle", "free_decay"),
    doc="Friction of gears, screws and bearings that grows with the torques of drive and load, at any speed.",
    source="Linderoth et al., IEEE ICRA 2013; Duclusaud et al., Extended friction models for servo actuators, 2024",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="against the motion",
        passive=True,
        monotone="rises with the torques, at least in proportion; falls with the speed to that of sliding",
        memory="the angle",
        over=("speed", "direction", "pressure", "angle"),
        coefficients=(
            "gear_friction.at_rest",
            "gear_friction.stribeck_rad_per_s",
            "gear_friction.back",
            "gear_friction.growth",
        ),
        quantity="the friction under load",
        unit="nm",
        curve=curve,
        source="Bowden and Tabor, The Friction and Lubrication of Solids, 1950: friction rises with the load; Dresig"
        " and Holzweissig, Dynamics of Machinery, 2010: efficiencies of a gear driven from either side",
    ),
)
