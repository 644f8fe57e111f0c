"""An obstacle stands in the way of flexion."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.force_curves import engaged, pressed, stop_law
from hand_model.kernel.inline import inline


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """What the law adds to the spring of the obstacle, and its stiffness."""
    begins, stiffness, engagement, low, high = q[4:]
    added, slope = pressed(phi - begins, engagement, high - low, q[:4])
    return -stiffness * added, stiffness * slope


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque of the obstacle [N m] at rest at the angle x [rad]."""
    plain, _ = engaged(x - q[4], q[6], 1.0 / q[6])
    return float(q[5] * plain - torque(q, x, 0.0, 0.0, 0.0, ())[0])


_STEEPER = stop_law("contact")
EFFECT = Effect(
    name="contact",
    place="environment",
    parameters=_STEEPER,
    reads=(
        "contact.angle_deg",
        "contact.stiffness_nm_per_rad",
        "contact.engagement_deg",
        "end_stop.low_deg",
        "end_stop.high_deg",
    ),
    hooks={"torque": torque},
    keys=("contact.angle_deg", "contact.stiffness_nm_per_rad", "contact.damping_nm_s_per_rad"),
    probes=tuple((float(angle), 0.4, 3e-4) for angle in range(5, 100, 10)),
    spread={"contact.stiffness_nm_per_rad": 2.3, "contact.damping_nm_s_per_rad": 1.5},
    expected={"contact.angle_deg": 60.0, "contact.damping_nm_s_per_rad": 0.02},
    shape=("contact.angle_deg",),
    alike=("end_stop",),
    says="an obstacle begins at {angle_deg} with a stiffness of {stiffness_nm_per_rad}",
    experiments=("slow_triangle", "staircase", "free_space"),
    doc="A one-sided elastic obstacle in the direction of flexion, soft or hard, at any angle; it may come and go.",
    source="one-sided spring and damper, Hunt and Crossley, J. Appl. Mech. 42, 1975",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="pushes away from the obstacle",
        passive=True,
        monotone="rises with the depth; an obstacle never pulls",
        over=("angle", "speed"),
        coefficients=tuple(parameter.key for parameter in _STEEPER),
        quantity="the {torque} of the obstacle",
        unit="nm",
        curve=curve,
        source="Hunt and Crossley, J. Appl. Mech. 42, 1975; the force rises with the depth, in proportion to a power of"
        " it: Johnson, Contact Mechanics, 1985, ch. 4",
    ),
)
