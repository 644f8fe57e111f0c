"""The columns that a machine file names: of a table, or numbers of messages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hand_model.yaml_reader import Section

COLUMNS = ("time", "input", "position", "force")
PRESSURES = ("gauge", "absolute")
HEADER, SENT = "header", "sent"
"""What columns.time may name where the columns are numbers of messages: times of headers, or of sending."""
COLUMN, OF_INPUT = ("column", "scale", "offset"), ("pressure", "delay", "limits")
"""Keys of a column, and those that only the input has."""
MAX_DELAY_S = 10.0
LARGEST = 1e12
"""Bound of every number of the file, in SI."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the recordings and the factor that turns it into SI. scale_given: whether the file states it.

    pressure: of PRESSURES, whether a pressure is gauge or absolute; "" where the file does not say so.
    offset: added after the scale [SI].  delay_s: time from a command to its action.  low, high: limits of the input.
    """

    name: str
    scale: float
    scale_given: bool = True
    pressure: str = ""
    offset: float = 0.0
    delay_s: float = 0.0
    low: float = -math.inf
    high: float = math.inf

    @property
    def is_of_messages(self) -> bool:
        """Whether it is a number of the messages of a topic, and not a column of a table."""
        return self.name.startswith("/")


def columns_of(top: Section, imposed: bool) -> dict[str, Column]:
    """The columns that the recordings must have: no force where the input moves the axis; the input may be absent."""
    section = top.section("columns", COLUMNS)
    wanted = [name for name in COLUMNS if name != "force" or imposed]
    if imposed and "input" not in section:
        wanted.remove("input")
    columns = {}
    for name in wanted:
        if name == "time" and name not in section and _names_topic(section):
            continue  # messages have times of their own
        columns[name] = _column(section.section(name, COLUMN + (OF_INPUT if name == "input" else ())))
    _check_sources(section, columns)
    return columns


def pressure_columns(top: Section) -> dict[str, Column]:
    """The columns of a closed volume: its pressure stands where others have their position."""
    section = top.section("columns", ("time", "pressure"))
    columns = {"position": _column(section.section("pressure", (*COLUMN, "pressure")))}
    if "time" in section or not columns["position"].is_of_messages:
        columns["time"] = _column(section.section("time", COLUMN))
    _check_sources(section, columns)
    return columns


def _names_topic(section: Section) -> bool:
    return str(section.section("position", COLUMN).raw("column", "the name of a column")).startswith("/")


def _check_sources(section: Section, columns: Mapping[str, Column]) -> None:
    """Refuse columns of a table together with numbers of messages, and times that are neither."""
    of_messages = columns["position"].is_of_messages
    for name, column in columns.items():
        if name == "time":
            continue
        if column.is_of_messages != of_messages:
            raise section.error(
                name,
                f"is {column.name!r} and position is {columns['position'].name!r}; either all of them begin with / and"
                " name numbers of messages, or none does",
            )
    if of_messages and "time" in columns and columns["time"].name not in (HEADER, SENT):
        raise section.error(
            "time", f"is {columns['time'].name!r}; for messages it must be {HEADER} or {SENT}, or be left out"
        )


def _column(part: Section) -> Column:
    own = part.raw("column", "the name of a column")
    low, high = part.numbers("limits", 2, [-LARGEST, LARGEST])
    if low >= high:
        raise part.error("limits", f"is [{low:g}, {high:g}]; the first number must be below the second")
    return Column(
        name=str(own),
        scale=part.number("scale", -LARGEST, LARGEST, 1.0),
        scale_given="scale" in part,
        pressure=part.choice("pressure", list(PRESSURES)) if "pressure" in part else "",
        offset=part.number("offset", -LARGEST, LARGEST, 0.0),
        delay_s=part.number("delay", 0.0, MAX_DELAY_S, 0.0),
        low=low,
        high=high,
    )
