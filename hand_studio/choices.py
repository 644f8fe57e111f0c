"""The effects that What if offers, why it leaves out others, and the ranges and labels of its sliders."""

from __future__ import annotations

from hand_model.effects import EFFECTS
from hand_model.effects.effect import OTHER_MACHINES, Effect
from hand_model.kernel.hooks import HAND_EFFECTS
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.quantities import HAND, unit_words

PARAMETERS = {parameter.key: parameter for parameter in JOINT_PARAMETERS}
CHOICES = tuple(effect.name for effect in HAND_EFFECTS if effect.keys)
"""Effects that can be tried."""
MACHINES = "effects of other machines, which a hand cannot have"
KINDS = "the kind of fluid or of valve, which is part of the model's file (`fluid`, `valve_kind`) and has no size"
CURVES = "curves that the diagnosis fits where no effect has a name for them; none of their numbers acts by itself"
FRAMES = "lost frames, which have no number in the model"


def slider_range(key: str, base: float) -> tuple[float, float]:
    """From where to where a slider of a parameter goes, in the unit of its key; base: the value that was found [same].

    Up to five typical sizes from the base; a number without a typical size, from a third to three times the base.
    """
    parameter = PARAMETERS[key]
    span = 5.0 * parameter.typical if parameter.typical else 2.0 * abs(base) or 0.1 * (parameter.high - parameter.low)
    low = base - span if parameter.typical or not base else base - 2.0 / 3.0 * abs(base)
    return max(parameter.low, low), min(parameter.high, base + span)


def slider_label(effect: str, key: str) -> str:
    """A parameter in words, with its unit; a number of the plain plant with its group, as "valve time constant [s]"."""
    group, unit = key.partition(".")[0], unit_words(HAND.units.quantity(key).unit)
    words = HAND.units.words(key) if group == effect else f"{group} {HAND.units.words(key)}"
    return f"{words} [{unit}]" if unit else words


def markdown_list() -> str:
    """The effects of the catalogue that are not offered, with the reason, as a list for the documents."""
    left = [effect for effect in EFFECTS.values() if effect.name not in CHOICES]
    rows = []
    for reason in (MACHINES, KINDS, CURVES, FRAMES):
        names = sorted(f"`{effect.name}`" for effect in left if reason_of(effect) == reason)
        rows.append(f"- {', '.join(names)}: {reason}.")
    return "\n".join(rows) + "\n"


def reason_of(effect: Effect) -> str:
    """Why an effect is not offered."""
    if not OTHER_MACHINES.isdisjoint(effect.needs):
        return MACHINES
    if not effect.parameters:
        return FRAMES
    law = effect.constitution
    return CURVES if law is not None and law.coefficients else KINDS
