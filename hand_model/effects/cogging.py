"""A torque that repeats over the travel: cogging of magnets, teeth of a gear, a screw or bearing out of round."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.effects.operators import sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Angular frequency over the angle [rad/rad]."""
    return (2.0 * math.pi / q[2],)


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """One harmonic of the angle, in a part with the sine and one with the cosine."""
    s, c = sine_cosine(q[3] * phi)
    return q[0] * s + q[1] * c, -q[3] * (q[0] * c - q[1] * s)


EFFECT = Effect(
    name="cogging",
    place="joint",
    needs=("motor",),
    parameters=(
        Parameter("cogging.sine_nm", -5.0, 5.0, "torque times the sine", 1.0, 0.0, 0.005),
        Parameter("cogging.cosine_nm", -5.0, 5.0, "torque times the cosine", 1.0, 0.0, 0.005),
        Parameter("cogging.period_deg", 0.01, 720.0, "motion over which it repeats", DEGREE, 360.0),
    ),
    prepared=("per_turn",),
    hooks={"prepare": prepare, "torque": torque},
    keys=("cogging.sine_nm", "cogging.cosine_nm", "cogging.period_deg"),
    probes=tuple(
        (share * size * part[0], share * size * part[1], Times(1.0))
        for size in (0.004, 0.03)
        for share in (1.0, -1.0)
        for part in ((1.0, 0.0), (0.0, 1.0))
    ),
    spread={"cogging.period_deg": 0.02},
    shape=("cogging.period_deg",),
    scanned="cogging.period_deg",
    says="a {torque} repeats every {period_deg} of the {angle}: {sine_nm} times the sine and {cosine_nm} times the"
    " cosine",
    experiments=("slow_triangle", "staircase"),
    doc="Torque between magnets and slots, or of teeth and parts out of round; it repeats over the travel.",
    source="Hendershot and Miller, Design of Brushless Permanent-Magnet Machines, 2010, cogging torque",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="either, without a mean",
        passive=True,
        monotone="periodic in the angle, of constant size",
        over=("angle",),
        source="energy of a magnetic field that is periodic in the angle, Hendershot and Miller, 2010",
    ),
)
