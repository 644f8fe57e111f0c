"""The joint warms up: rest torque and stiffness move towards new values."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

PER_STRAIN = 4.0
"""Reciprocal of the angle [rad] away from rest at which work against the elasticity heats as much as the rest."""
PER_LOAD = 4.0
"""Reciprocal of the share of the supply pressure at which friction under load heats as much as the rest."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Shares of the remaining warming of both capacities that happen within a step, midpoint rule, and the rest angle.

    It is minus the angle at which the elasticity of the plain plant has no torque, 0 where there is none.
    """
    tau, faster, a0, a1, supply = q[2], q[2] * q[5], q[10], q[11], q[12]
    return h / (tau + 0.5 * h), h / (faster + 0.5 * h), 1.0 / h, a0 * a1 / (a1 * a1 + 1e-12), PER_LOAD / supply


@inline
def heat(speed, strain, load, shares):  # type: ignore[no-untyped-def]
    """Heat at a speed over 1 rad/s: a constant, parts in proportion to it and to its square; 1 at 1 rad/s.

    And two in proportion to a power: against the elasticity, of which soft material loses a share as heat, and against
    friction that rises with the pressure.  strain: angle from rest [rad].  load: PER_LOAD times the pressure over that
    of the supply.
    """
    by_use, by_square, by_strain, by_load = shares
    constant = 1.0 + by_use * (speed - 1.0)
    moving = constant + by_square * (speed * speed - constant)
    straining = moving + by_strain * (PER_STRAIN * strain * speed - moving)
    return straining + by_load * (load * speed - straining)


@inline
def bent(warmth, bend):  # type: ignore[no-untyped-def]
    """What a warmth changes: in proportion, or ever less (bend -1) or more (1); it never falls, and 1 stays 1."""
    return warmth * (1.0 + bend * ((warmth - 1.0) / (warmth + 1.0)))


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """A rest torque and a loss of elasticity in proportion to the warmth; by the law, of two capacities, and bent."""
    shift, softening, second, a1 = q[0], q[1], q[4], q[11]
    slow, fast, _ = m
    warmth = bent(slow + second * (fast - slow), q[7])
    elastic = softening * warmth * a1
    return shift * warmth - elastic * (phi - creep_angle), elastic


@inline
def actuator_pressure(q, m, p, h):  # type: ignore[no-untyped-def]
    """The pressure as it is, kept as the load under which the joint moves."""
    slow, fast, _ = m
    return p, (slow, fast, abs(p) * q[17])


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """Warmth goes from 0 to 1 as a first-order lag; by the law it follows speed, its square or work in part."""
    slow, fast, load = m
    speed, strain = abs(after - before) * q[15], abs(0.5 * (after + before) + q[16])
    heated = heat(speed, strain, load, (q[3], q[6], q[8], q[9]))
    return slow + (heated - slow) * q[13], fast + (heated - fast) * q[14], load


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque gained [N m] after the time x [s] at the speed y [rad/s]."""
    slow, fast = -math.expm1(-x / q[2]), -math.expm1(-x / (q[2] * q[5]))
    heated = heat(y, 1.0 / PER_STRAIN, 1.0, (q[3], q[6], q[8], q[9]))
    return float(q[0] * bent(heated * (slow + q[4] * (fast - slow)), q[7]))


EFFECT = Effect(
    name="thermal_drift",
    place="material",
    needs=("long_recording",),
    parameters=(
        Parameter("thermal_drift.torque_nm", -1.0, 1.0, "torque gained once warm", 1.0, 0.0, 0.01),
        Parameter("thermal_drift.softening", -1.0, 1.0, "share of the elasticity lost once warm", 1.0, 0.0, 0.1),
        Parameter("thermal_drift.time_constant_s", 5.0, 1e4, "of the warming", 1.0, 100.0),
        Parameter(
            "thermal_drift.by_use", 0.0, 1.0, "law: share of the heat that motion gives", 1.0, 0.0, 0.3, law=True
        ),
        Parameter("thermal_drift.second", 0.0, 1.0, "law: share of a faster capacity", 1.0, 0.0, 0.2, law=True),
        Parameter("thermal_drift.faster", 0.01, 1.0, "its time constant over the other one", 1.0, 0.15),
        Parameter(
            "thermal_drift.by_square", 0.0, 1.0, "law: share of the square of the speed", 1.0, 0.0, 0.3, law=True
        ),
        Parameter("thermal_drift.bend", -1.0, 1.0, "law: growth beyond proportion", 1.0, 0.0, 0.3, law=True),
        Parameter(
            "thermal_drift.by_strain",
            0.0,
            1.0,
            "law: share of the work against the elasticity",
            1.0,
            0.0,
            0.3,
            law=True,
        ),
        Parameter(
            "thermal_drift.by_load", 0.0, 1.0, "law: share of the work against friction", 1.0, 0.0, 0.3, law=True
        ),
    ),
    reads=("statics.a0_nm", "statics.a1_nm_per_rad", "supply.pressure_pa"),
    prepared=("approach", "fast_approach", "per_h", "rest", "per_supply"),
    memory=("slow", "fast", "load"),
    law_memory=("fast", "load"),
    hooks={"prepare": prepare, "actuator_pressure": actuator_pressure, "torque": torque, "moved": moved},
    law_hooks=("actuator_pressure",),
    keys=("thermal_drift.torque_nm", "thermal_drift.softening", "thermal_drift.time_constant_s"),
    probes=((0.01, 0.0, 20.0), (-0.01, 0.0, 20.0), (0.0, 0.1, 20.0), (0.01, 0.0, 150.0), (0.0, -0.1, 60.0)),
    spread={"thermal_drift.time_constant_s": 1.0, "thermal_drift.faster": 0.7},
    shape=("thermal_drift.time_constant_s",),
    says="warming shifts the {torque} at rest by {torque_nm} and reduces the stiffness by {softening}"
    " (relative), with a time constant of {time_constant_s}",
    shared=("thermal_drift.time_constant_s",),
    experiments=("hold", "staircase"),
    doc="First-order warming that shifts the static map.",
    source="lumped thermal model of one capacity, or by the law of two",
    constitution=Constitution(
        acts_on="rest torque and elasticity",
        sign="either",
        monotone="rises with the warmth, which follows the heat without overshoot",
        memory="the warmth of one or two capacities",
        over=("time", "speed", "pressure"),
        coefficients=(
            "thermal_drift.by_use",
            "thermal_drift.second",
            "thermal_drift.faster",
            "thermal_drift.by_square",
            "thermal_drift.bend",
            "thermal_drift.by_strain",
            "thermal_drift.by_load",
        ),
        quantity="the {torque} gained by warming",
        unit="nm",
        curve=curve,
        source="heat balance of lumped capacities, Incropera and DeWitt, Fundamentals of Heat Transfer, 2002, ch. 5;"
        " heat of cyclic strain: Gent, Engineering with Rubber, 3rd ed. 2012, ch. 4; friction rises with the load:"
        " Bowden and Tabor, The Friction and Lubrication of Solids, 1950",
    ),
)
