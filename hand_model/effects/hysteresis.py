"""The static curve depends on the direction from which it is reached, at any speed."""

from __future__ import annotations

from hand_model.effects.effect import Effect
from hand_model.effects.operators import loop_moved, loop_torque
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of the motion over which the loop builds up."""
    return (1.0 / q[1],)


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Dahl's loop, or Bouc's and Wen's: a torque against the motion that needs an angle to build up."""
    height, sharp, per_scale = q[0], q[2], q[3]
    (loop,) = m
    share, stiffness = loop_torque(loop, omega, per_scale, sharp)
    return height * share, height * stiffness


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """The loop follows the motion."""
    (loop,) = m
    return (loop_moved(loop, before, after, q[3], q[2]),)


EFFECT = Effect(
    name="hysteresis",
    place="material",
    parameters=(
        Parameter("hysteresis.torque_nm", 0.0, 1.0, "half the height of the loop", 1.0, 0.0, 0.01),
        Parameter("hysteresis.scale_deg", 2.0, 60.0, "motion after which the loop is closed to 1/e", DEGREE, 8.0, 6.0),
        Parameter("hysteresis.sharpness", 0.0, 1.0, "0 a rounded loop, 1 one with a knee", 1.0, 0.0, 0.17),
    ),
    prepared=("per_scale",),
    memory=("loop",),
    hooks={"prepare": prepare, "torque": torque, "moved": moved},
    keys=("hysteresis.torque_nm", "hysteresis.scale_deg", "hysteresis.sharpness"),
    probes=((0.01, 4.0, 0.0), (0.01, 12.0, 0.0), (0.01, 30.0, 0.0), (0.01, 8.0, 1.0)),
    shape=("hysteresis.scale_deg", "hysteresis.sharpness"),
    says="the static curve has a hysteresis loop of {torque_nm} on either side, built up over {scale_deg}",
    experiments=("slow_triangle", "reversals"),
    doc="Rate-independent hysteresis of elastomer and fabric.",
    source="Dahl, A Solid Friction Model, 1968; Wen, J. Eng. Mech. 102(2), 1976, of the second power where sharp",
)
