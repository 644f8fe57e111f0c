"""The pressure in the actuator lags behind the measured one."""

from __future__ import annotations

from itertools import pairwise

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import lag_constants, lagged, two_lag_constants
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

EDGES_PA = (0.0, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5)
"""Pressure differences between which each coefficient of the law raises the time constant linearly."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Constants of the second volume, the reciprocal of the supply pressure, and constants of the first volume."""
    tau, second = q[0], q[1]
    own_kept, own_slowness, kept, slowness = two_lag_constants(tau, second, h)
    return kept, slowness, 1.0 / q[9], own_kept, own_slowness


@inline
def _time_constant(q, gap, p):  # type: ignore[no-untyped-def]
    """Time constant of the first volume [s] at a pressure difference and a pressure [Pa].

    By the law it rises with the difference, from laminar to turbulent flow, and falls with the mean pressure p of the
    tube: the conductance of a gas rises linearly with its density.
    """
    tau, second, a, b, c, d, e, f, denser, _, _, _, per_supply, _, _ = q
    added = a * min(gap * 1e-3, 1.0)
    added += b * min(max(gap * 5e-4 - 0.5, 0.0), 1.0)
    added += c * min(max(gap * (1 / 7e3) - 3 / 7, 0.0), 1.0)
    added += d * min(max(gap * 5e-5 - 0.5, 0.0), 1.0)
    added += e * min(max(gap * (1 / 7e4) - 3 / 7, 0.0), 1.0)
    added += f * min(max(gap * 5e-6 - 0.5, 0.0), 1.0)
    own = tau - second * tau
    return (own + added) / (1.0 + denser * min(max(p * per_supply, 0.0), 1.0))


@inline
def actuator_pressure(q, m, p, h):  # type: ignore[no-untyped-def]
    """A line of one volume, or of two in series; the time constant is that of the middle of the step.

    Without a law it is constant, and so are the lag's prepared constants.
    """
    before, first, output = m
    constant = max(q[2], q[3], q[4], q[5], q[6], q[7], q[8]) <= 0.0  # none of them is negative
    entry = 0.5 * (before + p)
    kept, slowness = lag_constants(_time_constant(q, abs(entry - first), 0.5 * (entry + first)), h)
    kept, slowness = q[13] if constant else kept, q[14] if constant else slowness
    between = lagged(first, before, p, kept, slowness)
    output = lagged(output, first, between, q[10], q[11])
    return output, (p, between, output)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Time constant [s] at the pressure difference x [Pa] and the pressure y [Pa]."""
    return float(_time_constant(q, x, y))


_ADDED = tuple(
    Parameter(
        f"tube_lag.added_{k}_s",
        0.0,
        1.0,
        f"law: more of it from {a:g} to {b:g} Pa of difference",
        1.0,
        0.0,
        0.01,
        law=True,
    )
    for k, (a, b) in enumerate(pairwise(EDGES_PA), 1)
)
EFFECT = Effect(
    name="tube_lag",
    place="fluid",
    needs=("fluid",),
    parameters=(
        Parameter("tube_lag.time_constant_s", 0.0, 1.0, "from the sensor to the actuator", 1.0, 0.0, 0.03),
        Parameter("tube_lag.second", 0.0, 0.5, "share of a second volume in it", 1.0, 0.0, 0.1),
        *_ADDED,
        Parameter(
            "tube_lag.denser",
            0.0,
            20.0,
            "law: growth of the conductance up to supply pressure",
            1.0,
            0.0,
            1.0,
            law=True,
        ),
    ),
    reads=("supply.pressure_pa",),
    prepared=("kept_2", "slowness_2", "per_supply", "kept_1", "slowness_1"),
    memory={"input": "pressure", "first": "pressure", "output": "pressure"},
    hooks={"prepare": prepare, "actuator_pressure": actuator_pressure},
    keys=("tube_lag.time_constant_s", "tube_lag.second"),
    probes=((0.02, 0.25), (0.08, 0.25)),
    shape=("tube_lag.second",),
    says="the {pressure} in the actuator lags the measured {pressure} by {time_constant_s}",
    experiments=("steps", "multisine"),
    doc="Laminar resistance of the tube with the capacity of the actuator, as one volume or two.",
    source="Beater, Pneumatic Drives, 2007, tubes",
    constitution=Constitution(
        acts_on="pressure in the actuator",
        sign="follows the measured pressure, without an error at rest",
        passive=True,
        monotone="the resistance is positive, rises with the pressure difference and falls with the pressure",
        memory="one or two volumes",
        over=("pressure difference", "pressure"),
        coefficients=(*(parameter.key for parameter in _ADDED), "tube_lag.denser"),
        quantity="the time constant of the tube",
        unit="s",
        curve=curve,
        source="Hagen-Poiseuille and Darcy-Weisbach, White, Fluid Mechanics, 2016, ch. 6: the loss rises at least in"
        " proportion to the flow; the conductance of a gas rises with its density",
    ),
)
