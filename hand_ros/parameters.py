"""Declarations of node parameters: name, default, description, range; and the check of values against them."""

from __future__ import annotations

import array
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hand_messages.bounds import shown

MAX_LENGTH = 4096
"""Longest text or list that a parameter may be set to."""


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

    def check_size(self, value: Any) -> None:
        """Raises ParameterError for a text or a list that is too long to be converted and shown."""
        if isinstance(value, str | list | array.array | bytes) and len(value) > MAX_LENGTH:
            raise ParameterError(
                f"parameter {self.name} has {len(value)} elements or letters; at most {MAX_LENGTH} are allowed"
            )

    def converted(self, value: Any) -> Any:
        """The value in the declared type where it has an equivalent one, otherwise the value itself.

        An integer stands for a float, also in a list; rclpy gives lists of numbers as array.array.
        """
        if isinstance(value, array.array):
            value = value.tolist()
        if isinstance(self.default, float) and type(value) is int:
            return float(value)
        if isinstance(self.default, list) and isinstance(value, list):
            numbers = any(isinstance(element, float) for element in self.default)
            return [float(element) if numbers and type(element) is int else element for element in value]
        return value

    def check(self, value: Any) -> None:
        """Raises ParameterError where the value has another type or is outside the allowed range or choices."""
        if isinstance(self.default, bool | str | list):
            if not isinstance(value, type(self.default)):
                raise ParameterError(
                    f"parameter {self.name} is {shown(value)}; it must be a {type(self.default).__name__}"
                )
            if self.choices and value not in self.choices:
                raise ParameterError(
                    f"parameter {self.name} is {shown(value)}; it must be one of {', '.join(self.choices)}"
                )
            return
        self._check_number(value)

    def _check_number(self, value: Any) -> None:
        allowed = f"{'any number' if self.low is None else f'{self.low:g} to {self.high:g}'}"
        whole = isinstance(self.default, int)
        number = isinstance(value, int) or (isinstance(value, float) and not whole)
        if isinstance(value, bool) or not number or not math.isfinite(value):
            kind = "whole number" if whole else "number"
            raise ParameterError(f"parameter {self.name} is {shown(value)}; it must be a {kind}, {allowed}")
        low, high = self.low, self.high
        if (low is not None and value < low) or (high is not None and value > high):
            raise ParameterError(f"parameter {self.name} is {value:g}; the allowed range is {allowed}")


def check_all(table: tuple[NodeParameter, ...], values: Mapping[str, Any]) -> None:
    """Check every value against its declaration. Raises ParameterError at the first value that is not allowed."""
    for parameter in table:
        if parameter.name in values:
            parameter.check(values[parameter.name])
