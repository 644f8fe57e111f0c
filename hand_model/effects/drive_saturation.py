"""The torque of the drive is limited, as by current and voltage of a motor: what is asked beyond it is lost."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import drive_torque
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

OFF_NM = 1e3
"""A limit beyond any torque of the model."""


@inline
def _limits(q, omega):  # type: ignore[no-untyped-def]
    """Least and largest torque [N m] of the drive at a speed.

    The limit falls with the speed at which the drive moves, to 0 at its fastest one. It does not fall where it brakes.
    """
    limit, fall = q[0], q[3]
    return -max(limit + fall * min(omega, 0.0), 0.0), max(limit - fall * max(omega, 0.0), 0.0)


@inline
def _asked(q, phi, omega, p):  # type: ignore[no-untyped-def]
    return drive_torque(phi, omega, p, (1.0 + q[4], q[5], q[6], q[1], q[2]))


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """What the limit takes off the torque of the drive: that of the input, less that of a position controller."""
    asked, slope = _asked(q, phi, omega, p)
    low, high = _limits(q, omega)
    kept = min(max(asked, low), high)
    return kept - asked, 0.0 if kept == asked else slope


@inline
def torque_damping(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """The fall of the limit, where the torque is at a limit that falls."""
    asked, _ = _asked(q, phi, omega, p)
    low, high = _limits(q, omega)
    falls = (omega > 0.0 and asked >= high and high > 0.0) or (omega < 0.0 and asked <= low and low < 0.0)
    return q[3] if falls else 0.0


EFFECT = Effect(
    name="drive_saturation",
    place="joint",
    needs=("drive",),
    parameters=(
        Parameter("drive_saturation.limit_nm", 1e-5, OFF_NM, "largest torque of the drive", 1.0, OFF_NM),
        Parameter("drive_saturation.stiffness_nm_per_rad", 0.0, 1e6, "of a position controller", 1.0, 0.0),
        Parameter("drive_saturation.damping_nm_s_per_rad", 0.0, 1e6, "of a position controller", 1.0, 0.0),
        Parameter("drive_saturation.fall_nm_s_per_rad", 0.0, 10.0, "fall of the limit with the speed", 1.0, 0.0, 0.02),
    ),
    reads=("drive_gain.error", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"),
    hooks={"torque": torque, "torque_damping": torque_damping},
    keys=("drive_saturation.limit_nm", "drive_saturation.fall_nm_s_per_rad"),
    probes=(
        *((limit, 0.0) for limit in (0.43, 0.35, 0.25, 0.15, 0.08, 0.04, 0.02, 0.01)),
        *((limit, limit / speed) for limit, speed in ((0.5, 6.0), (0.5, 20.0), (0.25, 3.0), (0.25, 6.0), (0.25, 20.0))),
    ),
    spread={"drive_saturation.limit_nm": 1.5},
    expected={"drive_saturation.limit_nm": 0.2},
    shape=("drive_saturation.limit_nm", "drive_saturation.fall_nm_s_per_rad"),
    says="the drive gives no more {torque} than {limit_nm}, less {fall_nm_s_per_rad} times its speed",
    experiments=("steps", "chirp"),
    doc="The drive is limited in torque, and in speed where the limit falls with it; what the input asks beyond the"
    " limit has no effect.",
    source="Kiam Heong Ang et al., IEEE Trans. Control Systems Technology 13(4), 2005, actuator saturation",
    constitution=Constitution(
        acts_on="torque of the drive",
        sign="as asked, up to a limit",
        passive=True,
        monotone="rises with what is asked and then stays",
        over=("pressure", "angle", "speed"),
        source="Khalil, Nonlinear Systems, 2002, sector nonlinearities",
    ),
)
