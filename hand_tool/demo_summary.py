"""The demo in numbers: tracking, replay difference, and how the loop kept time."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_recording.loader import Recording
from hand_recording.replay import Replay
from hand_recording.time_base import published_on_stamp_clock
from hand_tool.machine_load import Load
from hand_tool.replay_difference import difference_deg

FOLLOWED_DEG = 3.0
"""A joint followed when its tracking error is below this, RMS over the whole sequence."""
MOVED_DEG = 5.0
"""A joint followed only when it moved at least this far."""


@dataclass(frozen=True, slots=True)
class JointSummary:
    """RMS of reference minus measured angle, of measured minus replayed angle, and the range moved [degree]."""

    tracking_rms_deg: float
    replay_rms_deg: float
    moved_deg: float


@dataclass(frozen=True, slots=True)
class LoopSummary:
    """Rate of answered frames [Hz], share of missed periods, latency from acquisition to publication [ms].

    A period is missed when no command answered its frame before the next frame was due.
    """

    rate_hz: float
    missed_fraction: float
    latency_p50_ms: float
    latency_p99_ms: float


@dataclass(frozen=True, slots=True)
class Summary:
    """Everything summary.json holds. load: of the machine while the hand moved; None where it is unknown."""

    joints: dict[str, JointSummary]
    loop: LoopSummary
    load: Load | None = None

    @property
    def not_followed(self) -> list[str]:
        """Joints that did not follow their commands; NaN counts as not followed."""
        return [
            name
            for name, joint in self.joints.items()
            if not (joint.tracking_rms_deg <= FOLLOWED_DEG and joint.moved_deg >= MOVED_DEG)
        ]

    def as_json(self) -> dict[str, Any]:
        """Plain mapping; figures that do not exist are null."""
        joints = {name: _plain(asdict(joint)) for name, joint in self.joints.items()}
        load = None if self.load is None else self.load.as_json()
        return {"joints": joints, "loop": _plain(asdict(self.loop)), "machine": load}


def summarise(recording: Recording, result: Replay, load: Load | None = None) -> Summary:
    """Figures of a demo's recording and its replay. load: of the machine meanwhile."""
    state = recording["controller_state"]
    columns = [state.names.index(joint) for joint in result.hand.joints]
    error = np.degrees(state["error"][:, columns])
    moved = np.degrees(np.ptp(state["position"][:, columns], axis=0))
    replay = difference_deg(recording, result)
    tracking = np.sqrt(np.mean(error**2, axis=0))
    joints = {
        name: JointSummary(float(tracking[i]), replay[name], float(moved[i]))
        for i, name in enumerate(result.hand.joints)
    }
    return Summary(joints, loop_summary(recording, result.hand.rate_hz), load)


def loop_summary(recording: Recording, rate_hz: float) -> LoopSummary:
    """How the loop kept time between the first and the last command that answered a frame."""
    command = recording["valve_command"]
    frames = np.unique(recording["joint_states"].stamp_ns)
    latency_s = (published_on_stamp_clock(recording.topics) - command.stamp_ns).astype(np.float64) * 1e-9
    answers = np.isin(command.stamp_ns, frames)
    stamps, latency_s = command.stamp_ns[answers], latency_s[answers]
    return LoopSummary(*_timing(stamps, latency_s, rate_hz))


def _timing(stamps: NDArray[np.int64], latency_s: Array, rate_hz: float) -> tuple[float, float, float, float]:
    if len(stamps) < 2:
        return math.nan, 1.0, math.nan, math.nan
    span_s = (int(stamps.max()) - int(stamps.min())) * 1e-9
    periods = round(span_s * rate_hz) + 1
    in_time = len(np.unique(stamps[latency_s <= 1.0 / rate_hz]))
    p50, p99 = np.percentile(latency_s, (50, 99)) * 1e3
    return (len(np.unique(stamps)) - 1) / span_s, max(0.0, 1.0 - in_time / periods), float(p50), float(p99)


def _plain(figures: dict[str, float]) -> dict[str, float | None]:
    return {key: value if math.isfinite(value) else None for key, value in figures.items()}
