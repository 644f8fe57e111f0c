"""A stop is softer or nearer than modelled."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.effects.force_curves import engaged, pressed, stop_law
from hand_model.kernel.inline import inline


@inline
def _pressed(q, phi, omega):  # type: ignore[no-untyped-def]
    """Push of the stop of flexion and of that of extension, their stiffness and their damping."""
    low, high = q[8:]
    up = pressed(phi - high, omega, q[5:8], high - low, q[:5])
    down = pressed(low - phi, -omega, q[5:8], high - low, q[:5])
    return up[0], down[0], up[1] + down[1], up[2] + down[2]


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """What the law adds to the springs and dampers of both stops, and its stiffness."""
    up, down, stiffness, _ = _pressed(q, phi, omega)
    return down - up, stiffness


@inline
def torque_damping(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Damping that is part of it."""
    return _pressed(q, phi, omega)[3]


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque of the stops [N m] at rest at the angle x [rad]; that towards extension is positive."""
    stiffness, _, engagement, low, high = q[5:]
    up, down = (engaged(depth, engagement, 1.0 / engagement)[0] for depth in (x - high, low - x))
    more_up, more_down, _, _ = _pressed(q, x, 0.0)
    return float(stiffness * (up - down) + (more_up - more_down))


_LAW = stop_law("end_stop")
EFFECT = Effect(
    name="end_stop",
    place="joint",
    parameters=_LAW,
    reads=(
        "end_stop.stiffness_nm_per_rad",
        "end_stop.damping_nm_s_per_rad",
        "end_stop.engagement_deg",
        "end_stop.low_deg",
        "end_stop.high_deg",
    ),
    hooks={"torque": torque, "torque_damping": torque_damping},
    keys=(
        "end_stop.high_deg",
        "end_stop.low_deg",
        "end_stop.stiffness_nm_per_rad",
        "end_stop.damping_nm_s_per_rad",
    ),
    probes=(
        (85.0, Times(1.0), 1.0, Times(1.0)),
        (70.0, Times(1.0), 1.0, Times(1.0)),
        (55.0, Times(1.0), 1.0, Times(1.0)),
        (Times(1.0), 0.0, 1.0, Times(1.0)),
        (Times(1.0), 10.0, 1.0, Times(1.0)),
    ),
    spread={"end_stop.stiffness_nm_per_rad": 1.5, "end_stop.damping_nm_s_per_rad": 1.5},
    lasting=True,
    alike=("contact",),
    shape=("end_stop.high_deg", "end_stop.low_deg"),
    says="the end stops begin at {low_deg} and {high_deg} with a stiffness of {stiffness_nm_per_rad}",
    experiments=("staircase", "slow_triangle"),
    doc="Range of motion of the joint, with an elastic stop at both ends, at a fixed angle and all the time.",
    source="one-sided spring and damper, Hunt and Crossley, J. Appl. Mech. 42, 1975",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="pushes back into the range",
        passive=True,
        monotone="rises with the depth, and by a factor with the speed into it; a stop never pulls",
        over=("angle", "speed"),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the {torque} of the stops",
        unit="nm",
        curve=curve,
        source="Hunt and Crossley, J. Appl. Mech. 42, 1975; the force rises with the depth, in proportion to a power of"
        " it: Johnson, Contact Mechanics, 1985, ch. 4",
    ),
)
