"""The stiffness drifts steadily."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import TIME, Effect
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.plant_rows import Parameter
from hand_model.statics import leverage

_leverage = inlined(leverage)


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Eq. 11 with coefficients that change in proportion to time; by the law also with the travel of the joint.

    Of time and of travel, one part is in proportion, and two end after some 10 and 100 s or rad.
    """
    stiffness_per_s, strength_per_s, stiffness, strength, early, later, soon, late, a1, a2, a3 = q
    (travel,) = m
    time = e[TIME]
    elastic, strong = stiffness_per_s * time, strength_per_s * time
    elastic += stiffness * travel + early * (travel / (10.0 + travel)) + later * (travel / (100.0 + travel))
    elastic += soon * (time / (10.0 + time)) + late * (time / (100.0 + time))
    strong += strength * travel
    added = elastic * a1 * (phi - creep_angle) + strong * _leverage(phi, a2, a3) * p
    return added, -elastic * a1 - strong * a3 * p


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """Travel of the joint so far."""
    return (m[0] + abs(after - before),)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Relative change of the stiffness after the time x [s] and the travel y [rad]."""
    by_use = q[2] * y + q[4] * (y / (10.0 + y)) + q[5] * (y / (100.0 + y))
    return float(q[0] * x + q[6] * (x / (10.0 + x)) + q[7] * (x / (100.0 + x)) + by_use)


_CHANGES = (
    Parameter("ageing.stiffness_per_rad", -0.1, 0.1, "law: change of elasticity with travel", 1.0, 0.0, 5e-4, law=True),
    Parameter(
        "ageing.strength_per_rad", -0.1, 0.1, "law: change of pressure torque with travel", 1.0, 0.0, 5e-4, law=True
    ),
    Parameter(
        "ageing.early", -0.9, 5.0, "law: change of elasticity, half of it after 10 rad", 1.0, 0.0, 0.05, law=True
    ),
    Parameter(
        "ageing.later", -0.9, 5.0, "law: change of elasticity, half of it after 100 rad", 1.0, 0.0, 0.05, law=True
    ),
    Parameter("ageing.soon", -0.9, 5.0, "law: change of elasticity, half of it after 10 s", 1.0, 0.0, 0.05, law=True),
    Parameter(
        "ageing.slowly", -0.9, 5.0, "law: change of elasticity, half of it after 100 s", 1.0, 0.0, 0.05, law=True
    ),
)
EFFECT = Effect(
    name="ageing",
    place="material",
    needs=("long_recording",),
    parameters=(
        Parameter("ageing.stiffness_per_h", -60.0, 60.0, "relative change of elasticity per hour", 1 / 3600, 0.0, 3.0),
        Parameter(
            "ageing.strength_per_h", -60.0, 60.0, "relative change of pressure torque per hour", 1 / 3600, 0.0, 5.0
        ),
        *_CHANGES,
    ),
    reads=("statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"),
    memory=("travel",),
    law_memory=("travel",),
    hooks={"torque": torque, "moved": moved},
    keys=("ageing.stiffness_per_h", "ageing.strength_per_h"),
    probes=((6.0, 0.0), (-6.0, 0.0), (0.0, -3.0), (0.0, 3.0)),
    says="the stiffness changes by {stiffness_per_h} and the strength by {strength_per_h}, both relative",
    experiments=("staircase", "hold"),
    doc="Softening or hardening of the silicone in use.",
    source="Mullins, Softening of Rubber by Deformation, 1969, far from its beginning",
    constitution=Constitution(
        acts_on="elasticity and pressure torque",
        sign="either",
        monotone="each part of the change goes one way, in time or in travel",
        memory="the time and the travel since the start",
        over=("time", "travel"),
        coefficients=tuple(parameter.key for parameter in _CHANGES),
        quantity="the relative change of the stiffness",
        curve=curve,
        source="Mullins, Rubber Chem. Technol. 42(1), 1969: softening by deformation, most of it early",
    ),
)
