"""The weight of the phalanx, which Eq. 8 leaves out."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import TIME, Effect
from hand_model.effects.operators import sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Angular frequency [rad/s] of the period."""
    return (2.0 * math.pi / q[7],)


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """-m g l sin(phi + attitude), in a part with the sine and one with the cosine of phi; by the law, both turn.

    The attitude turns at a constant rate and to and fro, with two harmonics of a slow period.
    """
    sine, cosine, turning, sway, nod, sway_2, nod_2, _, rate = q
    swing, back = sine_cosine(rate * e[TIME])
    lean = sway * swing + nod * (1.0 - back) + 2.0 * swing * (sway_2 * back + nod_2 * swing)
    s, c = sine_cosine(phi + turning * e[TIME] + lean)
    return -(sine * s + cosine * c), sine * c - cosine * s


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque [N m] at the angle x [rad] after the time y [s]."""
    return float(torque(q, x, 0.0, 0.0, 0.0, (y,))[0])


_SWAY = tuple(
    Parameter(f"gravity.{name}_deg", -60.0, 60.0, f"law: {doc} of the attitude", DEGREE, 0.0, 8.0, law=True)
    for name, doc in (
        ("sway", "sine over a period"),
        ("nod", "one less the cosine over a period"),
        ("sway_2", "sine over half a period"),
        ("nod_2", "one less the cosine over half a period"),
    )
)
EFFECT = Effect(
    name="gravity",
    place="joint",
    needs=("rotation",),
    parameters=(
        Parameter("gravity.sine_nm", -5.0, 5.0, "torque against flexion at 90 degrees", 1.0, 0.0, 0.01),
        Parameter("gravity.cosine_nm", -5.0, 5.0, "torque against flexion at 0 degrees", 1.0, 0.0, 0.01),
        Parameter("gravity.turning_rad_per_s", -0.5, 0.5, "law: turning of the attitude", 1.0, 0.0, 0.01, law=True),
        *_SWAY,
        Parameter("gravity.period_s", 5.0, 1e3, "period of the turning to and fro", 1.0, 40.0),
    ),
    prepared=("rate",),
    hooks={"prepare": prepare, "torque": torque},
    keys=("gravity.sine_nm", "gravity.cosine_nm"),
    probes=((0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)),
    spread={"gravity.period_s": 0.7},
    says="gravity acts with {sine_nm} times the sine and {cosine_nm} times the cosine of the {angle}",
    shared=(
        "gravity.turning_rad_per_s",
        *(each.key for each in _SWAY),
        "gravity.period_s",
    ),
    experiments=("staircase", "second_attitude"),
    doc="Weight of the phalanx at a fixed attitude of the hand.",
    source="rigid pendulum",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="towards the lowest point",
        passive=True,
        monotone="one harmonic of the angle, of constant size",
        over=("angle", "time"),
        coefficients=("gravity.turning_rad_per_s", *(each.key for each in _SWAY), "gravity.period_s"),
        quantity="the {torque} of gravity",
        unit="nm",
        curve=curve,
        source="weight of a rigid body about an axis, Goldstein, Classical Mechanics, 2002",
    ),
)
