"""The heartbeat option: whoever supervises the hand publishes `heartbeat`; its absence vents the hand."""

from __future__ import annotations

from hand_ros.parameters import NodeParameter

TIMEOUT = NodeParameter(
    "heartbeat_timeout_s",
    0.0,
    "age of the last message on `heartbeat` that vents the hand [s]; 0: not needed",
    0.0,
    60.0,
)


class Heartbeat:
    """Age of the newest message on `heartbeat`."""

    def __init__(self, timeout_s: float) -> None:
        """timeout_s: oldest age [s] that is allowed; 0: no heartbeat is needed."""
        self._timeout_s = timeout_s
        self._newest_ns: int | None = None

    def beat(self, now_ns: int) -> None:
        """A message arrived at now_ns [ns] of the host's monotonic clock."""
        self._newest_ns = now_ns

    def missing(self, now_ns: int) -> str:
        """One line where a heartbeat is needed and the newest is too old; empty otherwise."""
        if self._timeout_s == 0.0:
            return ""
        if self._newest_ns is not None and now_ns - self._newest_ns <= self._timeout_s * 1e9:
            return ""
        return f"no heartbeat for {self._timeout_s:g} s: check the node that publishes heartbeat"
