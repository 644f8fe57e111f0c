"""Two models side by side: what differs, of two hands or of two machines, and how both hands move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hand_diagnosis.pages.compare import Cell, Comparison
from hand_diagnosis.pages.compare_motions import (
    MOTION,
    compare_motions,
    motion_sentence,
)
from hand_diagnosis.pages.hand_entries import entries
from hand_diagnosis.pages.headline import counted
from hand_diagnosis.settings import SETTINGS
from hand_machine.description import NUMBERS, MachineDescription
from hand_machine.found_model import PARAMETER, WEIGHT
from hand_machine.wording import AXIS, units_of
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.quantities import HAND, unit_words

SAME_RELATIVE = 1e-9
"""Relative difference below which two numbers of a model are equal."""


class Difference(NamedTuple):
    """What differs: of which part, its key, values [unit] or texts (None: the model has none) and unit.

    joint: the part: a joint or axis, a force site, the palm or the whole hand.
    """

    joint: str
    parameter: str
    a: float | str | None
    b: float | str | None
    unit: str

    @property
    def relative_change(self) -> float | None:
        """From A to B, relative to A; None where A is 0 or one of them has no value."""
        if isinstance(self.a, str) or isinstance(self.b, str) or not self.a or self.b is None:
            return None
        return (self.b - self.a) / self.a

    def differs(self) -> bool:
        """Whether the values are two different numbers or texts, or one is missing."""
        if self.a is None or self.b is None or isinstance(self.a, str) or isinstance(self.b, str):
            return self.a != self.b
        return abs(self.a - self.b) > SAME_RELATIVE * max(abs(self.a), abs(self.b))


def compare_hands(first: Hand, second: Hand) -> Comparison:
    """All that the descriptions state and that differs, the largest relative difference first, and both motions.

    Joints and force sites are compared by their names without the prefix. Those that only one hand has are named once.
    """
    both = [entries(hand) for hand in (first, second)]
    parts = [{part for part, _ in each} for each in both]
    found = []
    for key in dict.fromkeys([*both[0], *both[1]]):
        if key[0] in parts[0] & parts[1]:
            a, b = (each.get(key) for each in both)
            known = a or b
            found.append(Difference(*key, a and a.value, b and b.value, known.unit if known else ""))
    alone = sorted(parts[0] ^ parts[1])
    remarks = [f"In one model only: {', '.join(alone)}"] if alone else []
    compared = _comparison(found, HAND.axis, "The models are equal", remarks)
    compared.document["alone"] = alone
    common = {joint.removeprefix(first.prefix) for joint in first.joints} & parts[1]
    if not common or not (compared.rows or alone):
        return compared
    motion = compare_motions(first, second)
    least_deg, least_kpa = SETTINGS.compared_least
    shown = tuple(
        plot
        for plot, row in zip(motion.plots, motion.document["joints"], strict=True)
        if row["angle_rms"] >= least_deg or row["pressure_rms"] >= least_kpa
    )
    made = {"motion": MOTION, "duration_s": SETTINGS.compared_motion_s}
    compared.document["simulated"] = made | {"joints": motion.document["joints"]}
    sentences = (*remarks, motion_sentence(motion.document["joints"], len(shown)))
    return replace(compared, sentences=sentences, plots=shown)


def compare_machines(first: MachineDescription, second: MachineDescription) -> Comparison:
    """The numbers of two machine files that differ, in the machine's units. ValueError where only one axis turns."""
    if first.linear != second.linear:
        moves = ["moves along a line" if each.linear else "turns" for each in (first, second)]
        raise ValueError(f"{first.path} {moves[0]} and {second.path} {moves[1]}; both must have the same `motion`")
    units = units_of(first.linear, per_torque=1.0, per_angle=1.0, per_input=1.0)
    numbers = [(name, units.quantity(key).unit) for name, key in (PARAMETER | {"weight": WEIGHT}).items()]
    found = [Difference(AXIS, name, _own(name, first), _own(name, second), unit) for name, unit in numbers]
    for key in ROW:
        name, _, unit = units.quantity(key)
        found.append(Difference(AXIS, name, first.effects.get(name), second.effects.get(name), unit))
    names = [first.name, second.name]
    remarks = [f"A describes {names[0]} and B {names[1]}."] if names[0] != names[1] else []
    return _comparison(found, AXIS, "The models of the machine are equal", remarks)


def _own(name: str, machine: MachineDescription) -> float:
    """A number of the axis alone, as the file states it; a controller's gain is its stiffness."""
    controlled = name in NUMBERS and name != "gain"
    return float(getattr(machine, name)) - (machine.controller.get(name, 0.0) if controlled else 0.0)


def _comparison(found: Sequence[Difference], axis: str, equal: str, remarks: Sequence[str]) -> Comparison:
    """equal: the answer where nothing differs."""
    different = sorted((each for each in found if each.differs()), key=_order)
    alike: dict[Difference, list[str]] = {}
    for each in different:
        alike.setdefault(each._replace(joint=""), []).append(each.joint)
    rows = [
        (
            Cell(_parts(names, [other.joint for other in found if other.parameter == each.parameter])),
            Cell(each.parameter),
            Cell(_text(each.a)),
            Cell(_text(each.b)),
            Cell(unit_words(each.unit)),
            Cell(_change(each)),
        )
        for each, names in alike.items()
    ]
    numbers = [each._asdict() | {"relative_change": each.relative_change} for each in different]
    return Comparison(
        _answer(different, axis) if different else equal,
        tuple(remarks),
        ("part" if axis == HAND.axis else axis, "parameter", "A", "B", "unit", "change"),
        tuple(rows),
        {"kind": "model", "differences": numbers},
    )


def _parts(names: Sequence[str], every: Sequence[str]) -> str:
    """The parts that differ alike. every: those that have the entry."""
    return f"all {len(every)}" if len(names) == len(every) > 1 else ", ".join(names)


def _order(difference: Difference) -> float:
    change = difference.relative_change
    return -np.inf if change is None else -abs(change)


def _answer(different: Sequence[Difference], axis: str) -> str:
    """How many numbers, or also other entries, differ, and the one that differs most."""
    names = list(dict.fromkeys(each.joint for each in different))
    noun = "number" if all(not isinstance(value, str) for each in different for value in (each.a, each.b)) else "entry"
    where = names[0] if len(names) == 1 else counted(len(names), "part" if axis == HAND.axis else axis)
    where = f"the {axis}" if where == axis else where
    most = different[0]
    of = "" if len(names) == 1 else f" of {most.joint}"
    values = f"{_text(most.a, '.3g')} → {_text(most.b, '.3g')} {unit_words(most.unit)}".rstrip()
    count = f"{counted(len(different), noun)} of {where} differ{'s' if len(different) == 1 else ''}"
    lead = "" if len(different) == 1 else "among them " if isinstance(most.a or most.b, str) else "most "
    return f"{count}, {lead}{most.parameter}{of}: {values}"


def _text(value: float | str | None, form: str = ".5g") -> str:
    return "none" if value is None else value or "empty" if isinstance(value, str) else format(value, form)


def _change(difference: Difference) -> str:
    if difference.relative_change is not None:
        return f"{difference.relative_change:+.1%}"
    if isinstance(difference.a, str) and isinstance(difference.b, str):
        return "other"
    return "removed" if difference.b is None else "new"
