"""Declarations of node parameters: name, default, description, range; and the check of values against them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


class ParameterError(ValueError):
    """A parameter has a value outside its declaration; the message is one line."""


@dataclass(frozen=True, slots=True)
class NodeParameter:
    """One parameter of a node.

    name: with its unit at the end, where it has one.  default: determines the type too.
    low, high: allowed range of a number, both included.  choices: allowed texts.
    read_only: whether it can be set at the start only.
    """

    name: str
    default: bool | int | float | str | list[str] | list[float]
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = True

    def check(self, value: Any) -> None:
        """Raises ParameterError where the value has another type or is outside the allowed range or choices."""
        if isinstance(self.default, bool | str | list):
            if not isinstance(value, type(self.default)):
                raise ParameterError(f"parameter {self.name} is {value!r}; it must be a {type(self.default).__name__}")
            if self.choices and value not in self.choices:
                raise ParameterError(f"parameter {self.name} is {value!r}; it must be one of {', '.join(self.choices)}")
            return
        self._check_number(value)

    def _check_number(self, value: Any) -> None:
        allowed = f"{'any number' if self.low is None else f'{self.low:g} to {self.high:g}'}"
        whole = isinstance(self.default, int)
        number = isinstance(value, int) or (isinstance(value, float) and not whole)
        if isinstance(value, bool) or not number or not math.isfinite(value):
            kind = "whole number" if whole else "number"
            raise ParameterError(f"parameter {self.name} is {value!r}; it must be a {kind}, {allowed}")
        low, high = self.low, self.high
        if (low is not None and value < low) or (high is not None and value > high):
            raise ParameterError(f"parameter {self.name} is {value:g}; the allowed range is {allowed}")


def check_all(table: tuple[NodeParameter, ...], values: Mapping[str, Any]) -> None:
    """Check every value against its declaration. Raises ParameterError at the first value that is not allowed."""
    for parameter in table:
        if parameter.name in values:
            parameter.check(values[parameter.name])
