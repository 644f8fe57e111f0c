"""A machine file's columns proposed from a recording of topics: by message types, names and what moves."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hand_recording.message_numbers import list_numbers, read_series, topic_of
from hand_recording.recording_files import RecordingError

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/Wrench"
COMMANDS = (
    *("command", "commands", "cmd", "reference", "references", "setpoint", "target", "goal", "input"),
    *("effort", "torque", "current", "voltage", "pressure", "duty", "pwm", "data"),
)
POSITIONS = ("position", "angle", "joint", "encoder", "displacement", "travel", "stroke")
FORCES = ("force", "torque", "load", "wrench")
"""Words in paths of numbers, the surest first, by what they name."""
MOST_NUMBERS = 500
"""Numbers of a recording that are read for a proposal at most."""
SHOWN = 6


@dataclass(frozen=True, slots=True)
class Number:
    """A number of messages. path: see message_numbers.  kind: of its messages.  spread: standard deviation [-]."""

    path: str
    kind: str
    spread: float

    @property
    def words(self) -> list[str]:
        """Words of its topic and field in lower case, without the names of elements."""
        return [word for word in re.split(r"[^a-z]+", re.sub(r"\[[^\]]*\]", " ", self.path).lower()) if word]

    @property
    def element(self) -> str:
        """The last name or number in brackets; "" without one."""
        found = re.findall(r"\[([^\]]*)\]", self.path)
        return found[-1] if found else ""


def suggest_messages(path: Path) -> str:
    """The section `columns` for a recording of topics, with the reasons as comments.

    Raises RecordingError, one line, for what cannot be read and where no number changes.
    """
    kinds = dict(list(list_numbers(path).items())[:MOST_NUMBERS])
    if not kinds:
        raise RecordingError(f"{path} holds no messages with numbers")
    values = {name: each.values for name, each in read_series(path, kinds).items()}
    spreads = {name: float(np.nanstd(own)) if np.isfinite(own).any() else 0.0 for name, own in values.items()}
    moving = [Number(name, kinds[name], spread) for name, spread in spreads.items() if spread > 0.0]
    if not moving:
        raise RecordingError(f"{path}: none of its {len(kinds)} numbers changes: {_listing(list(kinds))}")
    position = _position(moving)
    left = [each for each in moving if position is None or each is not position[0]]
    found = {"input": _input(left, position[0] if position else None), "position": position, "force": _force(left)}
    lines = [f"# Proposed for {path.name}; check units and signs before you use it.", "columns:"]
    for quantity, chosen in found.items():
        if chosen is not None:
            lines += [f"  # {quantity}: {chosen[1]}", f"  {quantity}: {{column: '{chosen[0].path}', scale: 1.0}}"]
    missing = [quantity for quantity in ("input", "position") if found[quantity] is None]
    used = {chosen[0].path for chosen in found.values() if chosen is not None}
    rest = [each.path for each in moving if each.path not in used]
    if missing:
        lines.append(f"# No number fits {' or '.join(missing)}; choose from: {_listing(rest) or 'no number is left'}.")
    elif rest:
        lines.append(f"# Not used: {_listing(rest)}.")
    if found["force"] is not None:
        lines.append("# The force is used only where a rig imposes the motion (imposed: true).")
    return "\n".join(lines) + "\n"


def _position(moving: list[Number]) -> tuple[Number, str] | None:
    """The joint that moves most; without joint states, a number that is named as a position."""
    joints = [each for each in moving if each.kind == JOINT_STATE and ".position[" in each.path]
    states = [each for each in joints if not _is_command(each)] or joints
    if states:
        best = max(states, key=lambda each: each.spread)
        why = "a JointState has rad, or m where the axis is linear"
        others = [each.element for each in states if each is not best]
        return best, why + (f"; it moves most; also possible: {_listing(others)}" if others else "")
    return _named(moving, POSITIONS)


def _is_command(number: Number) -> bool:
    return any(word in COMMANDS[:9] for word in number.words)


def _input(left: list[Number], position: Number | None) -> tuple[Number, str] | None:
    """A number of a topic of commands; without one, the effort or another number that is named as an input."""
    own = topic_of(position.path) if position else ""
    elsewhere = [each for each in left if topic_of(each.path) != own and not each.kind.startswith(WRENCH)]
    element = position.element if position else ""
    chosen = _named(elsewhere, COMMANDS, element) or _named(left, COMMANDS, element)
    if chosen is None:
        return None
    held = topic_of(chosen[0].path) != own
    return chosen[0], chosen[1] + ("; each command holds until the next one" if held else "")


def _force(left: list[Number]) -> tuple[Number, str] | None:
    """The component of a wrench that changes most, or a number that is named as a force and is no command."""
    wrenches = [each for each in left if each.kind.startswith(WRENCH)]
    if wrenches:
        best = max(wrenches, key=lambda each: each.spread)
        return best, "of the wrench, the component that changes most"
    return _named([each for each in left if "force" in each.words and not _is_command(each)], FORCES)


def _named(numbers: list[Number], words: tuple[str, ...], element: str = "") -> tuple[Number, str] | None:
    """The number whose path has the surest word, of the same element if possible."""
    ranked = [
        (min(words.index(word) for word in own), each.element != element, -each.spread, each)
        for each in numbers
        if (own := [word for word in each.words if word in words])
    ]
    if not ranked:
        return None
    rank, _, _, best = min(ranked, key=lambda each: each[:3])
    others = [each.path for *_, each in ranked if each is not best]
    why = f"its path has the word '{words[rank]}'; messages state no unit, so SI is assumed (check it)"
    return best, why + (f"; also possible: {_listing(others)}" if others else "")


def _listing(names: list[str]) -> str:
    return ", ".join(names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")
