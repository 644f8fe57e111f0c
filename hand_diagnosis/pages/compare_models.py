"""Two models side by side: the numbers that differ, of two hands or of two machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hand_diagnosis.pages.compare import Cell, Comparison
from hand_diagnosis.pages.headline import counted, unit_words
from hand_machine.description import NUMBERS, MachineDescription
from hand_machine.found_model import PARAMETER, WEIGHT
from hand_machine.wording import AXIS, units_of
from hand_model.description import Hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import HAND

SAME_RELATIVE = 1e-9
"""Relative difference below which two numbers of a model are equal."""


class Difference(NamedTuple):
    """A number that differs: of which joint or axis, its key, values [unit] (None: the model has none) and unit."""

    joint: str
    parameter: str
    a: float | None
    b: float | None
    unit: str

    @property
    def relative_change(self) -> float | None:
        """From A to B, relative to A; None where A is 0 or one of them has no value."""
        return float((self.b - self.a) / self.a) if self.a and self.b is not None else None

    def differs(self) -> bool:
        """Whether the values are two numbers, or one is missing."""
        if self.a is None or self.b is None:
            return self.a is not self.b
        return abs(self.a - self.b) > SAME_RELATIVE * max(abs(self.a), abs(self.b))


def compare_hands(first: Hand, second: Hand) -> Comparison:
    """The numbers of the joints that differ, the largest relative difference first."""
    found = []
    for joint in (joint for joint in first.joints if joint in second.joints):
        columns = (first.parameters[:, first.joints.index(joint)], second.parameters[:, second.joints.index(joint)])
        for parameter, a, b in zip(JOINT_PARAMETERS, *columns, strict=False):
            quantity = HAND.units.quantity(parameter.key)
            factor = quantity.factor / parameter.scale
            found.append(Difference(joint, quantity.key, factor * float(a), factor * float(b), quantity.unit))
    alone = sorted(set(first.joints) ^ set(second.joints))
    remarks = [f"In one model only: {', '.join(alone)}"] if alone else []
    compared = _comparison(found, HAND.axis, "The models of the joints are equal", remarks)
    compared.document["alone"] = alone
    return compared


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
    rows = [
        (
            Cell(each.joint),
            Cell(each.parameter),
            Cell(_text(each.a)),
            Cell(_text(each.b)),
            Cell(unit_words(each.unit)),
            Cell(_change(each)),
        )
        for each in different
    ]
    numbers = [each._asdict() | {"relative_change": each.relative_change} for each in different]
    return Comparison(
        _answer(different, axis) if different else equal,
        tuple(remarks),
        (axis, "parameter", "A", "B", "unit", "change"),
        tuple(rows),
        {"kind": "model", "differences": numbers},
    )


def _order(difference: Difference) -> float:
    change = difference.relative_change
    return -np.inf if change is None else -abs(change)


def _answer(different: Sequence[Difference], axis: str) -> str:
    """How many numbers differ, and the one that differs most."""
    names = list(dict.fromkeys(each.joint for each in different))
    where = names[0] if len(names) == 1 else counted(len(names), axis)
    where = f"the {axis}" if where == axis else where
    most = different[0]
    of = "" if len(names) == 1 else f" of {most.joint}"
    values = f"{_text(most.a, '.3g')} → {_text(most.b, '.3g')} {unit_words(most.unit)}".rstrip()
    count = f"1 number of {where} differs" if len(different) == 1 else f"{len(different)} numbers of {where} differ"
    return f"{count}, {'most ' if len(different) > 1 else ''}{most.parameter}{of}: {values}"


def _text(value: float | None, form: str = ".5g") -> str:
    return "none" if value is None else format(value, form)


def _change(difference: Difference) -> str:
    if difference.relative_change is not None:
        return f"{difference.relative_change:+.1%}"
    return "removed" if difference.b is None else "new"
