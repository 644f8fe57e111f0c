"""What the recorder logs: one line when messages arrive, and one when none do. Pure: times are arguments."""

from __future__ import annotations

from collections.abc import Sequence

from hand_recording.record_options import RecordSummary

WINDOW_S = 1.0
"""Time over which the rate is counted, from the first message on."""
SILENT_S = 5.0
"""Time without a message after which a warning is logged; a hand that starts with the recorder needs less."""


class RecorderHealth:
    """The lines of one recording."""

    def __init__(self, namespaces: Sequence[str]) -> None:
        """namespaces: whose topics are recorded."""
        self._where = ", ".join(namespaces)
        self._begun: tuple[float, int] | None = None
        self._logged = {"healthy": False, "silent": False}

    def healthy(self, summary: RecordSummary) -> str:
        """The line of a recording that works, the first time that its rate is known; else "". Call it regularly."""
        if self._begun is None and summary.messages:
            self._begun = (summary.duration_s, summary.messages)
        if self._begun is None or self._logged["healthy"]:
            return ""
        seconds, messages = summary.duration_s - self._begun[0], summary.messages - self._begun[1]
        if seconds < WINDOW_S or not messages:
            return ""
        self._logged["healthy"] = True
        topics, rate = len(summary.topics), messages / seconds
        return (
            f"healthy: recorder of {topics} topics runs in {self._where} at {rate:.0f} messages/s, into {summary.path}"
        )

    def silent(self, summary: RecordSummary) -> str:
        """The line of a recording that has no message yet, the first time that this has lasted; else ""."""
        if summary.messages or summary.duration_s < SILENT_S or self._logged["silent"]:
            return ""
        self._logged["silent"] = True
        return f"not healthy: recorder in {self._where} receives no messages, for {summary.path}"
