"""An obstacle stands in the way of flexion."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.force_curves import engaged, pressed, stop_law
from hand_model.kernel.inline import inline


@inline
def _pressed(q, phi, omega):  # type: ignore[no-untyped-def]
    begins, stiffness, damping, engagement, low, high = q[5:]
    return pressed(phi - begins, omega, (stiffness, damping, engagement), high - low, q[:5])


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """What the law adds to the spring and damper of the obstacle, and its stiffness."""
    push, stiffness, _ = _pressed(q, phi, omega)
    return -push, stiffness


@inline
def torque_damping(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Damping that is part of it."""
    return _pressed(q, phi, omega)[2]


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque of the obstacle [N m] at rest at the angle x [rad]."""
    begins, stiffness, _, engagement, _, _ = q[5:]
    return float(stiffness * engaged(x - begins, engagement, 1.0 / engagement)[0] + _pressed(q, x, 0.0)[0])


_LAW = stop_law("contact")
EFFECT = Effect(
    name="contact",
    place="environment",
    parameters=_LAW,
    reads=(
        "contact.angle_deg",
        "contact.stiffness_nm_per_rad",
        "contact.damping_nm_s_per_rad",
        "contact.engagement_deg",
        "end_stop.low_deg",
        "end_stop.high_deg",
    ),
    hooks={"torque": torque, "torque_damping": torque_damping},
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
        monotone="rises with the depth, and by a factor with the speed into it; an obstacle never pulls",
        over=("angle", "speed"),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the {torque} of the obstacle",
        unit="nm",
        curve=curve,
        source="Hunt and Crossley, J. Appl. Mech. 42, 1975; the force rises with the depth, in proportion to a power of"
        " it: Johnson, Contact Mechanics, 1985, ch. 4",
    ),
)
