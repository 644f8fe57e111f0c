"""The newest that is known of a running hand, from the messages of its nodes. Pure: times are arguments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from hand_messages.health import DATA_LATE

ERROR = 2
"""Level of an error in diagnostic_msgs/DiagnosticStatus."""
PER_JOINT = {
    "angle_rad": "position",
    "reference_rad": "reference",
    "pressure_pa": "pressure",
    "set_point_pa": "pressure_command",
    "torque_nm": "torque_estimate",
}
"""Keys of a joint in `as_json`, and the fields of the messages that give them."""


@dataclass
class LiveState:
    """Values by field and joint; statuses by "NODE: PART"; frames and the newest stamp [ns] of joint_states."""

    values: dict[str, dict[str, float]] = field(default_factory=dict)
    statuses: dict[str, tuple[int, str]] = field(default_factory=dict)
    joints: tuple[str, ...] = ()
    frames: int = 0
    latency_s: float = math.nan
    rate_hz: float = math.nan
    _first_ns: int = 0

    def frame(self, joints: Sequence[str], position_rad: Sequence[float], stamp_ns: int, now_ns: int) -> None:
        """Take a message of joint_states: names, angles [rad], stamp and the present time [ns]."""
        self.joints = tuple(joints)
        self.take("position", joints, position_rad)
        if self.frames == 0 or stamp_ns <= self._first_ns:
            self.frames, self._first_ns = 0, stamp_ns
        elif stamp_ns - self._first_ns > 1_000_000_000:
            self.rate_hz = self.frames / ((stamp_ns - self._first_ns) * 1e-9)
            self.frames, self._first_ns = 0, stamp_ns
        self.frames += 1
        self.latency_s = (now_ns - stamp_ns) * 1e-9

    def take(self, name: str, joints: Sequence[str], values: Sequence[float]) -> None:
        """Take one field of a message, in SI, one value for each joint."""
        self.values[name] = dict(zip(joints, values, strict=False))

    @property
    def safety(self) -> str:
        """What the controller says of its safety; empty before its first diagnostics."""
        return self.statuses.get("controller: safety", (0, ""))[1]

    @property
    def controlling(self) -> bool:
        """Whether the controller drives the hand."""
        return self.safety == "controlling"

    @property
    def driven(self) -> bool:
        """Whether the hand is driven, also while a frame of its sensors is late."""
        return self.controlling or self.safety == DATA_LATE

    @property
    def vented(self) -> bool:
        """Whether the controller says that it has vented the hand."""
        return self.safety.startswith("vented")

    @property
    def problems(self) -> list[str]:
        """Every error that a node reports now, one line each."""
        return [f"{name}: {text}" for name, (level, text) in self.statuses.items() if level == ERROR]

    def as_json(self) -> dict[str, Any]:
        """The state for machines, in SI; null where it is not known."""
        joints = {}
        for joint in self.joints:
            known = {key: _number(self.values.get(source, {}).get(joint)) for key, source in PER_JOINT.items()}
            joints[joint] = known | {"contact": bool(self.values.get("contact", {}).get(joint, False))}
        return {
            "safety": self.safety,
            "problems": self.problems,
            "rate_hz": _number(self.rate_hz),
            "latency_s": _number(self.latency_s),
            "joints": joints,
        }


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value
