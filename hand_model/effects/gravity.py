"""The weight of the phalanx, which Eq. 8 leaves out."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import TIME, Effect
from hand_model.effects.operators import sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """-m g l sin(phi + attitude), in a part with the sine and one with the cosine of phi; by the law, both turn."""
    sine, cosine, turning = q
    s, c = sine_cosine(phi + turning * e[TIME])
    return -(sine * s + cosine * c), sine * c - cosine * s


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque [N m] at the angle x [rad] after the time y [s]."""
    return float(torque(q, x, 0.0, 0.0, 0.0, (y,))[0])


EFFECT = Effect(
    name="gravity",
    place="joint",
    needs=("rotation",),
    parameters=(
        Parameter("gravity.sine_nm", -5.0, 5.0, "torque against flexion at 90 degrees", 1.0, 0.0, 0.01),
        Parameter("gravity.cosine_nm", -5.0, 5.0, "torque against flexion at 0 degrees", 1.0, 0.0, 0.01),
        Parameter("gravity.turning_rad_per_s", -0.5, 0.5, "law: turning of the attitude", 1.0, 0.0, 0.01, law=True),
    ),
    hooks={"torque": torque},
    keys=("gravity.sine_nm", "gravity.cosine_nm"),
    probes=((0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)),
    says="gravity acts with {sine_nm} times the sine and {cosine_nm} times the cosine of the {angle}",
    experiments=("staircase", "second_attitude"),
    doc="Weight of the phalanx at a fixed attitude of the hand.",
    source="rigid pendulum",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="towards the lowest point",
        passive=True,
        monotone="one harmonic of the angle, of constant size",
        over=("angle", "time"),
        coefficients=("gravity.turning_rad_per_s",),
        quantity="the {torque} of gravity",
        unit="nm",
        curve=curve,
        source="weight of a rigid body about an axis, Goldstein, Classical Mechanics, 2002",
    ),
)
