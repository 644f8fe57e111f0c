"""What the topic `board_state` says of the board, and when: on every change, and at REPORT_HZ."""

from __future__ import annotations

from dataclasses import dataclass

from hand_driver.board import Echo, Frame, Status
from hand_driver.driver_health import SILENCE_S

REPORT_HZ = 20.0
"""Rate without a change. The controller vents where it misses several reports."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardReport:
    """State of the board.

    protocol: version in use.  link_up: the link is open and frames arrive.  status, supply_voltage_v [V]: of the newest
    frame.  echo: the same, while the link is up.  fault: the latched fault of the driver, empty if there is none.
    channels: what measures nothing, a line each, see `ChannelFaults`.
    """

    protocol: int
    link_up: bool
    status: Status
    supply_voltage_v: float
    echo: Echo | None
    fault: str
    channels: tuple[str, ...] = ()

    @property
    def verdict(self) -> tuple[int, bool, Status, str, tuple[str, ...]]:
        """The part whose change is published at once; of a channel that is the sensor, not the evidence."""
        sensors = tuple(line.partition(":")[0] for line in self.channels)
        return self.protocol, self.link_up, self.status, self.fault, sensors


class Reporter:
    """Decides when a report is published. Times are those of the host's monotonic clock [s]."""

    def __init__(self) -> None:
        """Begin without a report."""
        self._shown: tuple[int, bool, Status, str, tuple[str, ...]] | None = None
        self._shown_at_s = 0.0
        self._frame: Frame | None = None
        self._frame_at_s = 0.0
        self._channels: tuple[str, ...] = ()

    def frame(self, frame: Frame, now_s: float, channels: tuple[str, ...] = ()) -> None:
        """A frame has arrived, with lines about the channels that measure nothing."""
        self._frame, self._frame_at_s, self._channels = frame, now_s, channels

    def due(self, protocol: int, link_up: bool, fault: str, now_s: float) -> BoardReport | None:
        """The report to publish now, or None where nothing has changed since the last one, a short time ago."""
        frame = self._frame
        up = link_up and frame is not None and now_s - self._frame_at_s <= SILENCE_S
        status = Status(0) if frame is None else frame.status
        supply_v, echo = (0.0, None) if frame is None else (frame.supply_voltage_v, frame.echo if up else None)
        report = BoardReport(
            protocol=protocol,
            link_up=up,
            status=status,
            supply_voltage_v=supply_v,
            echo=echo,
            fault=fault,
            channels=self._channels if up else (),
        )
        verdict = report.verdict
        if verdict == self._shown and now_s - self._shown_at_s < 1.0 / REPORT_HZ - 1e-9:
            return None
        self._shown, self._shown_at_s = verdict, now_s
        return report
