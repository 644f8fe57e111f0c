"""The force reading depends on whether the load rises or falls."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of the change of force that turns the loop half around."""
    _, turn = q
    return (1.0 / turn,)


@inline
def force_sensor(q, m, force, h):  # type: ignore[no-untyped-def]
    """Stop operator: the side of the loop, -1 ... 1, follows the change of the force."""
    turned, last = m
    return min(max(turned + (force - last) * q[2], -1.0), 1.0), force


@inline
def force_reading(q, m, force):  # type: ignore[no-untyped-def]
    """The reading stays behind the force by a share of it, on the side of the loop."""
    share, _, _ = q
    side, _ = m
    return force * (1.0 - share * side)


EFFECT = Effect(
    name="fsr_hysteresis",
    place="force_sensor",
    needs=("force_sensing_resistor",),
    parameters=(
        Parameter("fsr_hysteresis.share", 0.0, 0.9, "half the loop over the force", 1.0, 0.0, 0.1),
        Parameter("fsr_hysteresis.turn_n", 0.02, 50.0, "change of force that turns the loop half around", 1.0, 0.5),
    ),
    prepared=("per_turn",),
    memory=("side", "last"),
    hooks={"prepare": prepare, "force_sensor": force_sensor, "force_reading": force_reading},
    keys=("fsr_hysteresis.share", "fsr_hysteresis.turn_n"),
    probes=((0.1, 0.5), (0.3, 0.5), (0.1, 3.0)),
    spread={"fsr_hysteresis.turn_n": 1.5},
    shape=("fsr_hysteresis.turn_n",),
    says="the force reading has a loop of {share} of the force on either side, crossed within {turn_n}",
    experiments=("taps", "slow_triangle"),
    doc="Loading and unloading curves of a force sensing resistor differ.",
    source="stop operator, Visintin, Differential Models of Hysteresis, 1994",
    constitution=Constitution(
        acts_on="reading of the force",
        sign="behind the force",
        passive=True,
        monotone="does not go back while the force goes on",
        memory="one state that changes with the force only",
        over=("force",),
        source="Visintin, Differential Models of Hysteresis, 1994",
    ),
)
