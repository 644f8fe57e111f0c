"""Statuses of the driver from its counters and ages: the likely fault in words, and the figures."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from hand_driver.board import Frame, LinkCounters, Status
from hand_driver.channel_watch import ChannelWatch
from hand_driver.measurement import within_supply
from hand_messages.bounds import Budget
from hand_messages.health import Health, Level
from hand_model.description import Hand

RATE_WINDOW_S = 2.0
"""Window over which rates and losses are computed."""
RATE_SHARE = 0.9
"""Below this share of the expected rate the rate is a warning."""
SILENCE_S = 0.1
"""Time without a frame that is an error; after the same time the controller vents."""
REFUSAL_S = 5.0
"""Time for which a refused command is shown."""
REPEATED_SHARE = 0.01
"""A share of repeated frames above this is a warning."""
SUPPLY_TOLERANCE = 0.1
"""A relative deviation of the sensor supply above this is a warning."""


@dataclass(slots=True)
class LinkState:
    """State of the link, for `statuses`."""

    up: bool = False
    reconnects: int = 0
    error: str = ""
    counters: LinkCounters = field(default_factory=LinkCounters)


class DriverHealth:
    """Collects events; `statuses` evaluates them. Times are those of the host's monotonic clock [s]."""

    def __init__(self, hand: Hand, started_s: float) -> None:
        """Begin at started_s [s] with nothing received."""
        self._hand = hand
        self._last_frame_s = started_s
        self._frame: Frame | None = None
        self._rails: Sequence[str] = ()
        self._watch: ChannelWatch | None = None
        self._marks: deque[tuple[float, LinkCounters]] = deque()
        self._refusal = (-REFUSAL_S, "")
        self._refused = 0
        self.budget = Budget()
        self._asked_s: float | None = None

    def asked(self, pressure: bool, now_s: float) -> None:
        """Set-points were written: whether any of them was above 0 Pa."""
        self._asked_s = now_s if pressure else None

    def frame(self, frame: Frame, rails: Sequence[str], now_s: float, watch: ChannelWatch | None = None) -> None:
        """A frame was published; watch: what is known of its channels."""
        self._frame, self._rails, self._last_frame_s, self._watch = frame, rails, now_s, watch

    def refused(self, line: str, now_s: float) -> None:
        """A command was refused."""
        self._refusal = (now_s, line)
        self._refused += 1

    def statuses(self, link: LinkState, now_s: float) -> list[Health]:
        """One status for the link, frames, supply, channels, board and commands."""
        counters = link.counters
        self._marks.append((now_s, replace(counters)))
        while now_s - self._marks[0][0] > RATE_WINDOW_S:
            self._marks.popleft()
        return [
            self._link(link, now_s),
            self._frames(counters, now_s),
            self._supply(),
            self._channels(),
            self._board(now_s),
            self._commands(counters, now_s),
        ]

    def _link(self, link: LinkState, now_s: float) -> Health:
        values = {"reconnects": str(link.reconnects), "last error": link.error}
        silence_s = now_s - self._last_frame_s
        if not link.up and not link.error:
            return Health("link", Level.WARN, "connecting", values)
        if not link.up:
            return Health("link", Level.ERROR, link.error, values)
        if silence_s > SILENCE_S:
            return Health("link", Level.ERROR, "connected, but no frame arrives: check board power and wiring", values)
        return Health("link", Level.OK, "connected", values)

    def _frames(self, counters: LinkCounters, now_s: float) -> Health:
        begun_s, past = self._marks[0]
        span_s = now_s - begun_s
        rate = (counters.frames - past.frames) / span_s if span_s > 0.0 else 0.0
        dropped, corrupt = counters.dropped - past.dropped, counters.corrupt - past.corrupt
        values = {
            "rate_hz": f"{rate:.1f}",
            "expected_hz": f"{self._hand.rate_hz:g}",
            "frames": str(counters.frames),
            "dropped": str(counters.dropped),
            "corrupt": str(counters.corrupt),
            "replayed": str(counters.replayed),
            "restarts": str(counters.restarts),
        }
        if span_s >= 0.9 * RATE_WINDOW_S and rate < RATE_SHARE * self._hand.rate_hz:
            return Health("frames", Level.WARN, "frame rate is below what the description expects", values)
        if corrupt:
            return Health("frames", Level.WARN, "corrupt frames: check cable shielding and baud rate", values)
        if counters.replayed > past.replayed:
            line = "old frames are repeated and dropped: check the adapter and other senders on the bus"
            return Health("frames", Level.WARN, line, values)
        if dropped:
            return Health("frames", Level.WARN, "frames are missing: link too slow or host too busy", values)
        return Health("frames", Level.OK, "arriving", values)

    def _supply(self) -> Health:
        if self._frame is None:
            return Health("supply", Level.STALE, "not measured yet")
        volts, nominal = self._frame.supply_voltage_v, self._hand.sensors.supply_voltage_v
        values = {"supply_voltage_v": f"{volts:.3f}", "nominal_v": f"{nominal:g}"}
        off = abs(volts / nominal - 1.0)
        if not within_supply(volts, nominal):
            return Health("supply", Level.ERROR, "sensor supply is out of range: no measurements", values)
        if off > SUPPLY_TOLERANCE:
            return Health("supply", Level.WARN, "sensor supply is off nominal", values)
        return Health("supply", Level.OK, "sensor supply is nominal", values)

    def _channels(self) -> Health:
        if self._frame is None:
            return Health("channels", Level.STALE, "not measured yet")
        if self._rails:
            line = f"at the rail (broken wire or short): {', '.join(self._rails)}"
            return Health("channels", Level.ERROR, line, dict.fromkeys(self._rails, "at the rail"))
        return self._readings() if self._watch is not None else _CHANNELS_FINE

    def _readings(self) -> Health:
        """Channels that repeat their readings."""
        assert self._watch is not None
        lines, share, unwatched = self._watch.lines, self._watch.repeated_share, self._watch.unwatched
        values = {"repeated frames": f"{100.0 * share:.1f} %", "not watched (no noise)": ", ".join(unwatched)}
        if lines:
            return Health("channels", Level.ERROR, "; ".join(lines), values)
        if share > REPEATED_SHARE:
            line = f"the converter repeats {100.0 * share:.0f} % of the frames: it converts more slowly than it is read"
            return Health("channels", Level.WARN, line, values)
        return Health("channels", Level.OK, _CHANNELS_FINE.message, values)

    def _board(self, now_s: float) -> Health:
        if self._frame is None:
            return Health("board", Level.STALE, "no frame yet")
        status = self._frame.status
        values = {"status": f"0x{int(status):04x}", "sequence": str(self._frame.sequence)}
        faults = [text for bit, text in _FAULTS.items() if bit in status]
        if faults:
            return Health("board", Level.ERROR, "; ".join(faults), values)
        if Status.VENTED in status and self._asked_s is not None and now_s - self._asked_s > SILENCE_S:
            line = "vented by its watchdog: the set-points outlived their lifetime; check the node that commands"
            return Health("board", Level.WARN, line, values)
        if Status.VENTED in status:
            return Health("board", Level.OK, "vented: no set-points in force", values)
        return Health("board", Level.OK, "driving the valves", values)

    def _commands(self, counters: LinkCounters, now_s: float) -> Health:
        dropped = str(self.budget.dropped)
        values = {"written": str(counters.written), "refused": str(self._refused), "dropped unread": dropped}
        when_s, line = self._refusal
        if now_s - when_s < REFUSAL_S:
            return Health("commands", Level.ERROR, line, values)
        if flood := self.budget.problem(now_s):
            return Health("commands", Level.WARN, flood, values)
        return Health("commands", Level.OK, "accepted", values)


_CHANNELS_FINE = Health("channels", Level.OK, "every channel is within its range")
_FAULTS = {
    Status.SUPPLY_LOW: "pressure supply is below the set-points",
    Status.OVER_PRESSURE: "an actuator is over its pressure limit and was vented",
    Status.ADC_FAULT: "the converter reports a fault",
}
