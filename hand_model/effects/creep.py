"""The silicone creeps: the rest angle follows the pressure over tens of seconds. Its law is part of the plain plant."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter

_KEYS = ("phi_max_deg", "extension_time_s", "recovery_time_s", "p_min_pa", "b1_per_pa", "b0_per_pa")
TIMES_S = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Retardation times of the law."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Share of each retarded deviation that passes in a step, by the midpoint rule; 1 over supply pressure."""
    return (
        h / (0.3 + 0.5 * h), h / (1.0 + 0.5 * h), h / (3.0 + 0.5 * h),
        h / (10.0 + 0.5 * h), h / (30.0 + 0.5 * h), h / (100.0 + 0.5 * h), 1.0 / q[7],
    )  # fmt: skip


@inline
def actuator_pressure(q, m, p, h):  # type: ignore[no-untyped-def]
    """The pressure, unchanged; the memory follows it with each retardation time."""
    a, b, c, d, e, f = m
    after = (
        a + (p - a) * q[12], b + (p - b) * q[13], c + (p - c) * q[14],
        d + (p - d) * q[15], e + (p - e) * q[16], f + (p - f) * q[17],
    )  # fmt: skip
    return p, after


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Elastic torque of the shifted rest angle, as Eq. 11: the sum of Eq. 10, which is added to the zones of Eq. 12."""
    shift = q[0] * m[0] + q[1] * m[1] + q[2] * m[2] + q[3] * m[3] + q[4] * m[4] + q[5] * m[5]
    return -q[6] * shift * q[18], 0.0


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Shift of the rest angle [rad] at the time x [s] after a step to supply pressure; y is not used."""
    phi_max, p_min, b1, extension = q[8:12]
    nominal = phi_max * b1 * (q[7] - p_min) * -math.expm1(-x / extension)
    return float(nominal + sum(w * -math.expm1(-x / tau) for w, tau in zip(q, TIMES_S, strict=False)))


_SHIFTS = tuple(
    Parameter(
        f"creep.shift_{k}_deg", 0.0, 180.0, f"law: rest angle at supply pressure, after {t:g} s", DEGREE, 0.0, 3.0,
        law=True,
    )
    for k, t in enumerate(TIMES_S, 1)
)  # fmt: skip
EFFECT = Effect(
    name="creep",
    place="material",
    needs=("soft_material",),
    parameters=_SHIFTS,
    reads=(
        "statics.a1_nm_per_rad",
        "supply.pressure_pa",
        "material.phi_max_deg",
        "material.p_min_pa",
        "material.b1_per_pa",
        "material.extension_time_s",
    ),
    prepared=("step_1", "step_2", "step_3", "step_4", "step_5", "step_6", "per_supply"),
    memory=dict.fromkeys(("slow_1", "slow_2", "slow_3", "slow_4", "slow_5", "slow_6"), "pressure"),
    hooks={"prepare": prepare, "actuator_pressure": actuator_pressure, "torque": torque},
    keys=tuple(f"material.{key}" for key in _KEYS),
    probes=(
        (60.0, 25.0, 40.0, Times(1.0), Times(1.0), Times(1.0)),
        (30.0, 8.0, 12.0, Times(1.0), Times(1.0), Times(1.0)),
        (40.0, 80.0, 100.0, Times(1.0), Times(1.0), Times(1.0)),
        (Times(1.5), Times(1.0), Times(1.0), Times(1.0), Times(1.0), Times(1.0)),
        (Times(0.5), Times(1.0), Times(1.0), Times(1.0), Times(1.0), Times(1.0)),
    ),
    spread={"material.p_min_pa": 0.3, "material.b1_per_pa": 0.2, "material.b0_per_pa": 0.2},
    shape=("material.extension_time_s", "material.recovery_time_s"),
    says="the material creeps by up to {phi_max_deg}, with time constants of {extension_time_s} under"
    " {pressure} and {recovery_time_s} in recovery",
    lasting=True,
    experiments=("staircase", "hold"),
    doc="Viscoelastic shift of the rest angle in three zones: extension, hold, recovery.",
    source="Eqs. 11-13, Martin et al. 2004",
    constitution=Constitution(
        acts_on="rest angle of the actuator",
        sign="flexes under pressure",
        passive=True,
        monotone="rises after a step of pressure, ever more slowly",
        memory="the zones of Eq. 12 and fading memory of the pressure with six retardation times",
        over=("time", "pressure"),
        coefficients=tuple(parameter.key for parameter in _SHIFTS),
        quantity="the shift of the {angle} at rest after a step to full {pressure}",
        unit="rad",
        curve=curve,
        source="Eq. 10, Martin et al. 2004; Ferry, Viscoelastic Properties of Polymers, 1980: a retardation spectrum is"
        " not negative; Christensen, Theory of Viscoelasticity, 1982",
    ),
)
