"""A load behind an elastic gear, shaft or belt: the measured side moves on, and the load swings after it."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.effects.operators import decay, sine_cosine
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Over a step h: by what the load's distance and its rate fall and turn into each other, and 1 / h."""
    natural, ratio = q[1], q[2]
    rate = natural * math.sqrt(1.0 - ratio * ratio)
    s, c = sine_cosine(rate * h)
    kept = decay(ratio * natural * h)
    return kept * c, kept * s / rate, ratio * natural, natural * natural, 1.0 / h


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Torque of the spring and damper between both sides on the measured one."""
    angle, speed = m
    load = q[0] * q[3]
    return load * (q[7] * (angle - phi) + 2.0 * q[6] * (speed - omega)), load * q[7]


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """The free swing of the load about a measured side that goes straight: exact for any step."""
    angle, speed = m
    pace = (after - before) * q[8]
    distance, rate = angle - before, speed - pace
    turned = rate + q[6] * distance
    apart = q[4] * distance + q[5] * turned
    return after + apart, pace + q[4] * turned - q[5] * (q[7] - q[6] * q[6]) * distance - q[6] * apart


EFFECT = Effect(
    name="gear_elasticity",
    place="joint",
    needs=("motor",),
    parameters=(
        Parameter("gear_elasticity.ratio", 0.0, 100.0, "inertia of the load over that in front of it", 1.0, 0.0, 0.5),
        Parameter("gear_elasticity.natural_per_s", 2.0, 1e3, "angular frequency of the load alone", 1.0, 60.0),
        Parameter("gear_elasticity.damping_ratio", 1e-3, 0.9, "damping of the load alone", 1.0, 0.05),
    ),
    reads=("dynamics.inertia_kg_m2",),
    prepared=("kept", "turned", "damped", "stiff", "per_h"),
    memory={"angle": "angle", "speed": 0.0},
    hooks={"prepare": prepare, "torque": torque, "moved": moved},
    keys=(
        "gear_elasticity.ratio",
        "gear_elasticity.natural_per_s",
        "gear_elasticity.damping_ratio",
        "dynamics.inertia_kg_m2",
    ),
    probes=tuple(
        (ratio, natural, 0.05, Times(1.0 / (1.0 + ratio)))
        for ratio in (0.5, 2.0)
        for natural in (10.0, 20.0, 40.0, 80.0, 160.0)
    ),
    spread={"gear_elasticity.natural_per_s": 1.0, "gear_elasticity.damping_ratio": 1.0},
    shape=("gear_elasticity.natural_per_s", "gear_elasticity.damping_ratio"),
    says="a load of {ratio} times the inertia before it ({inertia_kg_m2}) follows elastically; alone it swings with"
    " {natural_per_s} and a damping ratio of {damping_ratio}",
    experiments=("chirp", "multisine"),
    doc="Two masses: the load is behind the elasticity of a gear, shaft or belt, and the measured side is in front.",
    source="Spong, J. Dynamic Systems, Measurement, and Control 109(4), 1987, elastic joints",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="towards the load",
        passive=True,
        monotone="linear spring and damper",
        memory="position and speed of the load",
        over=("time",),
        source="kinetic and elastic energy of two masses, Spong, 1987",
    ),
)
