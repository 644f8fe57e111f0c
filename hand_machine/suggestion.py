"""A machine file's columns proposed from a table: by the names of its columns, their units and their values."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hand_machine.message_suggestion import suggest_messages
from hand_machine.time_unit import AS_YAML, SECONDS, named_time_unit
from hand_model.arrays import Array
from hand_recording.message_numbers import is_recording
from hand_recording.recording_files import RecordingError
from hand_recording.table_file import read_table

WORDS = {
    "force": ("force", "load", "f", "fz", "fx", "reaction"),
    "position": ("position", "pos", "x", "angle", "theta", "phi", "q", "displacement", "disp", "stroke", "travel", "y"),
    "input": (
        *("input", "u", "command", "cmd", "goal", "target", "setpoint", "reference"),
        *("voltage", "current", "pressure", "p", "torque", "tau", "duty", "pwm", "i", "v"),
    ),
}
"""Words in the names of columns, the surest first, by what they name."""
TIME_WORDS = ("time", "t", "timestamp", "stamp", "seconds", "sec", "clock")
UNITS = {
    "m": ("1.0", "m"),
    "cm": ("1.0e-2", "cm"),
    "mm": ("1.0e-3", "mm"),
    "um": ("1.0e-6", "um"),
    "rad": ("1.0", "rad"),
    "deg": ("1.745329e-2", "degrees"),
    "n": ("1.0", "N"),
    "kn": ("1.0e+3", "kN"),
    "mn": ("1.0e-3", "mN"),
    "nm": ("1.0", "N m"),
    "mnm": ("1.0e-3", "mN m"),
    "pa": ("1.0", "Pa"),
    "kpa": ("1.0e+3", "kPa"),
    "bar": ("1.0e+5", "bar"),
    "mbar": ("1.0e+2", "mbar"),
    "mpa": ("1.0e+6", "MPa"),
    "psi": ("6.894757e+3", "psi"),
}
"""Factor to SI and name of a unit, by the last word of a column's name."""
PLAUSIBLE_PERIOD_S = (1e-5, 0.2)
"""Usual distance of the samples of a motion, by which the unit of times without one is proposed."""


@dataclass(frozen=True, slots=True)
class Suggested:
    """A column for a quantity: name, factor to SI as YAML, and the reason in words."""

    quantity: str
    column: str
    scale: str
    why: str


def suggest_map(path: Path) -> str:
    """The section `columns` of a machine file for a table or a recording of topics, with the reasons as comments.

    Raises RecordingError, one line, for what cannot be read and for a table without a column of times.
    """
    if is_recording(path):
        return suggest_messages(path)
    columns = {name: values for name, values in read_table(path).numbers.items() if np.isfinite(values).any()}
    time = _time(path, columns)
    moving = {name: values for name, values in columns.items() if name != time.column and np.nanstd(values) > 0.0}
    constant = [name for name in columns if name not in moving and name != time.column]
    found, left = [time], dict(moving)
    for quantity, words in WORDS.items():
        chosen = _named(quantity, words, left)
        if chosen is not None:
            found.append(chosen)
            del left[chosen.column]
    return "\n".join(_lines(path, found, list(left), constant)) + "\n"


def _time(path: Path, columns: dict[str, Array]) -> Suggested:
    """The column of times: one that rises, named as a time if possible."""
    rising = [name for name, values in columns.items() if _rises(values)]
    named = [name for name in columns if _rank(name, TIME_WORDS) is not None]
    best = [name for name in named if name in rising] or named or rising
    if not best:
        raise RecordingError(
            f"{path} has no column of times: none rises, and none is named time; it has: {', '.join(columns)}"
        )
    name = best[0]
    finite = columns[name][np.isfinite(columns[name])]
    interval = float(np.median(np.abs(np.diff(finite)))) if len(finite) > 1 else 0.0
    reason = "it rises" if name in rising else "its name; it does not rise throughout"
    unit = named_time_unit(name)
    if unit is not None:
        why = f"{reason}; its name ends in {unit}"
        return Suggested(
            "time", name, AS_YAML[SECONDS[unit]], f"{why}, and samples are {interval * SECONDS[unit]:.3g} s apart"
        )
    for unit in ("s", "ms", "us", "ns"):
        if PLAUSIBLE_PERIOD_S[0] <= interval * SECONDS[unit] <= PLAUSIBLE_PERIOD_S[1]:
            why = f"{reason}; its values are {interval:.4g} apart, which is a usual sample period in {unit}"
            return Suggested("time", name, AS_YAML[SECONDS[unit]], f"{why} (check it)")
    return Suggested("time", name, "1.0", f"{reason}; its values are {interval:.4g} apart: state the unit yourself")


def _rises(values: Array) -> bool:
    finite = values[np.isfinite(values)]
    return len(finite) > 1 and bool(np.all(np.diff(finite) > 0.0))


def _words(name: str) -> list[str]:
    """Words of a column's name in lower case: those between signs, digits and capitals."""
    apart = re.sub(r"([a-z])([A-Z])", r"\1 \2", name.rsplit(".", 1)[-1])
    return [word for word in re.split(r"[^a-z]+", apart.lower()) if word]


def _rank(name: str, words: tuple[str, ...]) -> int | None:
    """Place of the first of the words that a name has; a unit at its end is none of them."""
    own = _words(name)
    own = own[:-1] if len(own) > 1 and own[-1] in {*UNITS, *SECONDS} else own
    ranks = [words.index(word) for word in own if word in words]
    return min(ranks) if ranks else None


def _named(quantity: str, words: tuple[str, ...], columns: dict[str, Array]) -> Suggested | None:
    """The column whose name has the surest word for a quantity."""
    ranked = [(rank, name) for name in columns if (rank := _rank(name, words)) is not None]
    if not ranked:
        return None
    rank, name = min(ranked, key=lambda each: each[0])
    unit = _words(name)[-1]
    scale, unit_name = UNITS.get(unit, ("1.0", "")) if len(_words(name)) > 1 else ("1.0", "")
    why = f"its name has the word '{words[rank]}'"
    why += f" and ends in {unit}" if unit_name else "; its name has no unit, so SI is assumed (check it)"
    others = [other for _, other in ranked if other != name]
    why += f"; also possible: {', '.join(others)}" if others else ""
    return Suggested(quantity, name, scale, why)


def _lines(path: Path, found: list[Suggested], unused: list[str], constant: list[str]) -> list[str]:
    lines = [f"# Proposed for {path.name}; check units and signs before you use it.", "columns:"]
    for each in found:
        lines += [
            f"  # {each.column}: {each.why}",
            f"  {each.quantity}: {{column: {_quoted(each.column)}, scale: {each.scale}}}",
        ]
    missing = [name for name in ("position", "input") if name not in {each.quantity for each in found}]
    if missing:
        lines.append(f"# No name fits {' or '.join(missing)}; choose from: {', '.join(unused) or 'no column is left'}.")
    elif unused:
        lines.append(f"# Not used: {', '.join(unused)}.")
    if constant:
        lines.append(f"# Constant, of no use as a signal: {', '.join(constant)}.")
    if "force" in {each.quantity for each in found}:
        lines.append("# The force is used only where a rig imposes the motion (imposed: true).")
    return lines


def _quoted(name: str) -> str:
    """A column's name as YAML: in quotes, in which only the quote itself must be doubled."""
    return "'" + "''".join(name.split("'")) + "'"
