"""The drive gives more or less torque than its input asks for: a scale of its gain that is not known."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import drive_torque
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """A share of the torque that the input or the controller asks for."""
    asked, slope = drive_torque(phi, omega, p, (q[0], q[1], q[2], q[3], q[4]))
    return asked, -slope


EFFECT = Effect(
    name="drive_gain",
    place="joint",
    needs=("drive", "inexact_gain"),
    parameters=(Parameter("drive_gain.error", -0.9, 9.0, "relative; all of a controller's torque", 1.0, 0.0, 0.3),),
    reads=(
        "statics.a2_nm_per_pa",
        "statics.a3_nm_per_pa_rad",
        "drive_saturation.stiffness_nm_per_rad",
        "drive_saturation.damping_nm_s_per_rad",
    ),
    hooks={"torque": torque},
    keys=("drive_gain.error",),
    probes=((0.2,), (-0.2,), (0.6,), (-0.5,), (1.5,)),
    says="the drive gives {error} (relative) more {torque} than its gain states",
    experiments=("staircase", "steps"),
    doc="The gain of the drive or of its controller is another one than stated, as of a scale that its maker hides.",
    source="Isermann, Mechatronic Systems, 2005, electrical drives",
    constitution=Constitution(
        acts_on="torque of the drive",
        sign="that of the input",
        monotone="in proportion to what is asked",
        over=("pressure", "angle", "speed"),
        source="Isermann, Mechatronic Systems, 2005, electrical drives",
    ),
)
