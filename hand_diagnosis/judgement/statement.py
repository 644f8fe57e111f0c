"""The sentence of an effect with its numbers, in the units and words of a hand or machine (hand_model/quantities)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hand_diagnosis.settings import SETTINGS
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import HAND, Wording


@dataclass(frozen=True, slots=True)
class Number:
    """One parameter of a finding, with its key, value, standard error and unit on the hand or machine."""

    key: str
    value: float
    std: float
    unit: str
    determined: bool


def said(effect: Effect, numbers: Sequence[Number], wording: Wording) -> str:
    """The catalogue's sentence about an effect, with its numbers and their units.

    A number within SETTINGS.min_change_sigma standard errors of its neutral value is only named by its bound, and a
    clause of a parenthesis with nothing but such numbers is left out.
    """
    keys = {wording.units.quantity(key).key: key for key in effect.keys}
    shown = [(keys[n.key], n.value, n.std) for n in numbers if n.key in keys]
    small = {keys[n.key].rpartition(".")[2]: n for n in numbers if n.key in keys and _is_neutral(keys[n.key], n)}
    template = re.sub(r"\s*\(([^()]*)\)", lambda part: _kept(part, small), effect.says)
    template = re.sub(r"{(\w+)}", lambda field: _bounded(field, small), template)
    return wording.sentence(template, shown)


def _bounded(field: re.Match[str], small: Mapping[str, Number]) -> str:
    """A field of a template; of a number that is not significant, its upper limit."""
    number = small.get(field.group(1))
    if number is None:
        return field.group(0)
    most = abs(number.value) + SETTINGS.min_change_sigma * number.std
    return f"at most {most:.2g}" + ("" if number.unit == "1" else f" {number.unit}")


def _kept(part: re.Match[str], small: Mapping[str, Number]) -> str:
    """A parenthesis of a template without the clauses of which every number is small; nothing where none is left."""
    groups = []
    for group in part.group(1).split(", "):
        first = "plus " if group.startswith("plus ") else ""
        clauses = [each for each in group.removeprefix(first).split(" and ") if not _is_small(each, small)]
        groups += [first + " and ".join(clauses)] if clauses else []
    return f" ({', '.join(groups)})" if groups else ""


def _is_small(clause: str, small: Mapping[str, Number]) -> bool:
    names = re.findall(r"{(\w+)}", clause)
    numbers = [name for name in names if name not in HAND.words]
    return bool(numbers) and all(name in small for name in numbers)


def _is_neutral(key: str, number: Number) -> bool:
    """Whether a number whose neutral value is 0 is not significantly different from it."""
    return JOINT_PARAMETERS[ROW[key]].neutral == 0.0 and abs(number.value) < SETTINGS.min_change_sigma * number.std
