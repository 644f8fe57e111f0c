"""Dry friction: Stribeck breakaway, a part proportional to the pressure, contacts that yield and may relax at rest."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import loop_moved, loop_torque
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter

TRAVEL_RAD = 1.5
"""Angle at which the coefficients of the law over the travel count; beyond it, either way, the level stays."""
RIGID_RAD, YIELDING_RAD = 0.02 * DEGREE, 0.05 * DEGREE
"""Presliding up to which contacts count as rigid, and from which on they yield; between, a share of them yields."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocals, the share of the friction whose contacts yield, and what of it is kept and builds up in a step."""
    stribeck, presliding, steps = q[2], q[4], q[13] * h
    yielding = min(max((presliding - RIGID_RAD) * (1.0 / (YIELDING_RAD - RIGID_RAD)), 0.0), 1.0)
    kept = math.exp(-steps)
    return 1.0 / stribeck, 1.0 / presliding, yielding, 1.0 / q[14], kept, (1.0 - kept) / max(steps, 1e-9)


@inline
def _over_travel(q, phi):  # type: ignore[no-untyped-def]
    """Relative level [-] at the angle phi [rad]: 1 at 0, and never negative, because it is a square."""
    x = min(max(phi * (1.0 / TRAVEL_RAD), -1.0), 1.0)
    root = 1.0 + 0.5 * ((q[11] + q[12] * x) * x)
    return root * root


@inline
def _level(q, phi, omega, p):  # type: ignore[no-untyped-def]
    """Magnitude of the friction torque of a sliding joint [N m].

    By the law it also falls from rest to four speeds, linearly to each, and its growth with the pressure is curved: a
    part of it is quadratic up to the supply pressure, and linear again beyond. All of it may change over the travel.
    """
    torque_nm, breakaway, per_pa, per_stribeck = q[0], q[1], q[3], q[15]
    x = omega * per_stribeck
    speed, load = abs(omega), abs(p)
    bend = 1.0 + q[9] * (min(load * q[18], 1.0) - 1.0)
    level = torque_nm + breakaway / (1.0 + x * x) + per_pa * load * bend
    level += q[5] * max(1.0 - 20.0 * speed, 0.0) + q[6] * max(1.0 - 5.0 * speed, 0.0)
    level += q[7] * max(1.0 - 1.25 * speed, 0.0) + q[8] * max(1.0 - 0.3125 * speed, 0.0)
    return level * _over_travel(q, phi)


@inline
def dry(q, m, phi, omega, p):  # type: ignore[no-untyped-def]
    """Magnitude of the friction torque of rigid contacts, in which the joint sticks."""
    return _level(q, phi, omega, p) * (1.0 - q[17])


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Torque of contacts that yield, against the motion so far."""
    whole = _level(q, phi, omega, p) * q[17]
    (bristle,) = m
    share, stiffness = loop_torque(bristle, omega, q[16], q[10])
    return whole * share, whole * stiffness


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """Dahl's loop over the presliding motion; by the law, one with a knee, or one whose contacts relax.

    A loop z relaxes at the rate r where it would forget more slowly by the motion x, dz/dt = x'/s - z max(|x'|/s, r),
    so that slow motion is viscous and sliding has the whole level. That is solved for a constant speed over the step.
    """
    (bristle,) = m
    slip = (after - before) * q[16]
    relaxed = bristle * q[19] + slip * q[20]
    return (relaxed if abs(slip) < h * q[13] else loop_moved(bristle, before, after, q[16], q[10]),)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Level [N m] at the speed x [rad/s] and the pressure y [Pa], at the angle 0, in steady motion."""
    slip, relaxing = abs(x) * q[16], q[13]
    relaxed = 1.0 - slip / relaxing if slip < relaxing else 0.0
    return float(_level(q, 0.0, x, y) * (1.0 - q[17] * relaxed))


def travel(q, angle):  # type: ignore[no-untyped-def]
    """Level [-] at an angle [rad], relative to that at the angle 0."""
    return float(_over_travel(q, angle))


SPEEDS_RAD_S = (0.05, 0.2, 0.8, 3.2)
"""Speeds to which the coefficients of the law fall."""
_FALLS = tuple(
    Parameter(
        f"coulomb_friction.fall_{k}_nm", 0.0, 5.0, f"law: more at rest, gone at {s:g} rad/s", 1.0, 0.0, 0.003, law=True
    )
    for k, s in enumerate(SPEEDS_RAD_S, 1)
)
_BEND = Parameter(
    "coulomb_friction.bend", -1.0, 1.0, "law: growth with pressure, 1 quadratic, -1 levels off", 1.0, 0.0, 0.3, law=True
)
_TRAVEL = (
    Parameter("coulomb_friction.travel_slope", -1.0, 1.0, "law: change towards 1.5 rad", 1.0, 0.0, 0.3, law=True),
    Parameter(
        "coulomb_friction.travel_bow", -1.0, 1.0, "law: change towards 1.5 rad on either side", 1.0, 0.0, 0.3, law=True
    ),
)
_RELAXING = Parameter(
    "coulomb_friction.relaxing_per_s",
    0.0,
    300.0,
    "law: rate at which contacts at rest relax",
    1.0,
    0.0,
    100.0,
    law=True,
)
EFFECT = Effect(
    name="coulomb_friction",
    place="joint",
    parameters=(
        Parameter("coulomb_friction.torque_nm", 0.0, 5.0, "at speed", 1.0, 0.0, 0.005),
        Parameter("coulomb_friction.breakaway_nm", 0.0, 5.0, "more of it at rest", 1.0, 0.0, 0.003),
        Parameter("coulomb_friction.stribeck_rad_per_s", 1e-3, 10.0, "speed at which half of that is gone", 1.0, 0.1),
        Parameter("coulomb_friction.torque_nm_per_pa", 0.0, 1e-5, "more of it with pressure", 1.0, 0.0, 1e-8),
        Parameter(
            "coulomb_friction.presliding_deg",
            0.01,
            10.0,
            "motion that builds it up to 1 - 1/e; rigid at 0.02",
            DEGREE,
            0.01,
        ),
        *_FALLS,
        _BEND,
        Parameter("coulomb_friction.knee", 0.0, 1.0, "law: 1 builds up with a knee", 1.0, 0.0, 0.3, law=True),
        *_TRAVEL,
        _RELAXING,
    ),
    reads=("supply.pressure_pa",),
    prepared=("per_stribeck", "per_presliding", "yielding", "per_supply", "relaxed", "building"),
    memory=("bristle",),
    hooks={"prepare": prepare, "dry": dry, "torque": torque, "moved": moved},
    keys=(
        "coulomb_friction.torque_nm",
        "coulomb_friction.breakaway_nm",
        "coulomb_friction.torque_nm_per_pa",
        "coulomb_friction.presliding_deg",
    ),
    probes=(
        (0.004, 0.0, 0.0, 0.1),
        (0.004, 0.0, 0.0, 0.01),
        (0.015, 0.0, 0.0, 0.01),
        (0.003, 0.006, 0.0, 0.05),
        (0.0, 0.0, 3e-8, 0.01),
    ),
    spread={"coulomb_friction.presliding_deg": 1.0},
    expected={"coulomb_friction.presliding_deg": 0.05},
    shape=("coulomb_friction.presliding_deg",),
    says="Coulomb friction of {torque_nm} is missing (plus {breakaway_nm} at breakaway and {torque_nm_per_pa}"
    " times the {pressure}, built up over {presliding_deg})",
    experiments=("slow_triangle", "reversals"),
    doc="Dry friction lets the joint stick and lag after reversals by the same torque at any speed. Before it slides,"
    " its contacts give.",
    source="Coulomb 1785; Stribeck 1902; Dahl 1968 before it slides; Armstrong-Helouvry et al., Automatica 30(7), 1994",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="against the motion",
        passive=True,
        monotone="the level falls with the speed to that of sliding, and rises with the pressure; where contacts relax,"
        " it rises from 0 at creeping speeds",
        memory="the motion since a reversal, while contacts yield",
        over=("speed", "pressure", "angle"),
        coefficients=(
            "coulomb_friction.stribeck_rad_per_s",
            *(parameter.key for parameter in (*_FALLS, _BEND)),
            "coulomb_friction.knee",
            *(parameter.key for parameter in (*_TRAVEL, _RELAXING)),
        ),
        needs={_RELAXING.key: "soft_material"},
        quantity="friction",
        unit="nm",
        curve=curve,
        travel=travel,
        source="Armstrong-Helouvry et al., Automatica 30(7), 1994: Stribeck curve; Bowden and Tabor, The Friction and"
        " Lubrication of Solids, 1950: friction rises with the load; Bliman, Eur. J. Mech. A 11(6), 1992: passive;"
        " Dieterich, J. Geophys. Res. 84(B5), 1979: contacts that creep;"
        " Flitney, Seals and Sealing Handbook, 2014: friction of a seal by its squeeze, which varies with the bore",
    ),
)
