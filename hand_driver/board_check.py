"""The evaluation of a board from its frames: link, clock, channels, and how it follows set-points. No I/O.

The frames of the first phase are read without any set-points, those of the second with harmless ones, those of the
third after the last lifetime has ended.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hand_driver.board import Frame, LinkCounters, Pressures, Status
from hand_driver.board_clock import BoardClock
from hand_driver.board_health import RATE_ERROR
from hand_driver.channel_watch import QUIET
from hand_driver.driver_health import RATE_SHARE, SUPPLY_TOLERANCE
from hand_driver.measurement import Converter, channel_names, rails
from hand_driver.set_point_watch import SetPointWatch
from hand_model.arrays import Array
from hand_model.description import Hand

LOST_SHARE = 0.01
"""Larger shares of lost or corrupt frames are a fault; smaller ones are named."""
NOISE_FACTOR, NOISE_FLOOR_V = 10.0, 2e-3
"""A channel is noisy above this multiple of the described noise, and above this standard deviation [V]."""
FEWEST_FRAMES = 20
VENT_S = 0.2
"""Time after the end of the last lifetime within which a board must report VENTED."""
ANSWER_SHARE = 0.5
"""A test pressure counts as measured from this share of it on."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One ADC channel: number, what it measures, mean [V], standard deviation [V], and "ok" or what is wrong."""

    number: int
    measures: str
    volts: float
    noise_v: float
    verdict: str


@dataclass(slots=True)
class BoardResult:
    """The outcome. faults decide the verdict, remarks do not. NaN where nothing was measured."""

    frames: int = 0
    seconds: float = 0.0
    rate_hz: float = float("nan")
    jitter_ms: float = float("nan")
    dropped: int = 0
    corrupt: int = 0
    replayed: int = 0
    protocol: int = 0
    supply_v: float = float("nan")
    clock_rate: float = float("nan")
    set_points: str = "not tried"
    channels: list[Channel] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def faults_of_link(self) -> bool:
        """Whether so few frames arrived that set-points need not be tried."""
        return self.frames < FEWEST_FRAMES

    def summary(self) -> dict[str, str]:
        """The figures of the link as text, by name."""
        if self.faults_of_link:
            return {"frames": f"{self.frames} in {self.seconds:.1f} s"}
        clock = "not measured" if math.isnan(self.clock_rate) else f"{self.clock_rate:.5f} of the host's"
        return {
            "frames": f"{self.frames}: {self.rate_hz:.1f} per second, jitter {self.jitter_ms:.2f} ms (95 %)",
            "errors": f"{self.corrupt} corrupt, {self.dropped} lost, {self.replayed} repeated or old",
            "protocol": f"version {self.protocol}",
            "clock": clock,
            "supply": f"{self.supply_v:.3f} V",
            "set-points": self.set_points,
        }

    def as_json(self) -> dict[str, Any]:
        """For json.dumps; null where nothing was measured."""
        values = asdict(self)
        values["verdict"] = "faults" if self.faults else "ok"
        return {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in values.items()}


class BoardCheck:
    """Collects the frames of one board."""

    def __init__(self, hand: Hand) -> None:
        """Compare with the description of this hand."""
        self._hand = hand
        self._frames: list[Frame] = []
        self._clock = BoardClock()
        self._watch = SetPointWatch(hand.joints)
        self._converter = Converter(hand, 0.0)
        warm_up = Frame(0, 0, hand.sensors.supply_voltage_v, Status(0), np.zeros(hand.channel_count, np.uint16), 0)
        self._converter.convert(warm_up)  # compiles, which must not delay the frames
        self._following = ""
        self._first_pa: Array | None = None
        self._last_pa: Array | None = None
        self._followed = False
        self._expired_ns = 0
        self._vented = False
        self.result = BoardResult()

    def read(self, frame: Frame) -> None:
        """A frame of the first phase."""
        self._frames.append(frame)
        self._clock.map(frame.board_time_us, frame.received_ns)
        pressure_pa = self._converter.convert(frame).pressure
        self._first_pa = pressure_pa if self._first_pa is None else 0.9 * self._first_pa + 0.1 * pressure_pa

    def sent(self, sequence: int, pressure_pa: Pressures, lifetime_s: float, now_ns: int) -> None:
        """Set-points were sent."""
        self._watch.sent(sequence, pressure_pa, lifetime_s, now_ns)
        self._expired_ns = now_ns + round(lifetime_s * 1e9)

    def driven(self, frame: Frame) -> None:
        """A frame of the second phase."""
        self._following = self._following or self._watch.frame(frame, frame.received_ns)
        self._followed = self._followed or Status.VENTED not in frame.status
        pressure_pa = self._converter.convert(frame).pressure
        self._last_pa = pressure_pa if self._last_pa is None else 0.8 * self._last_pa + 0.2 * pressure_pa

    def released(self, frame: Frame) -> None:
        """A frame of the third phase."""
        if frame.received_ns > self._expired_ns + VENT_S * 1e9:
            self._vented = Status.VENTED in frame.status

    def finish_reading(self, counters: LinkCounters, protocol: int, seconds: float) -> BoardResult:
        """Evaluate the first phase, which lasted for seconds [s]."""
        result, frames = self.result, self._frames
        result.frames, result.seconds, result.protocol = len(frames), seconds, protocol
        result.dropped, result.corrupt, result.replayed = counters.dropped, counters.corrupt, counters.replayed
        if len(frames) < FEWEST_FRAMES:
            hint = (
                "the line carries data, but no valid frames: check the bit rate, ground and shield"
                if counters.corrupt
                else "check the power of the board, the cable and the port"
            )
            result.faults.append(f"{len(frames)} frames arrived in {seconds:.1f} s; {hint}")
            return result
        self._link(result, frames)
        self._status(result, frames)
        self._channels(result, frames)
        return result

    def finish(self, test: tuple[int, float] | None) -> BoardResult:
        """Evaluate how the board followed. test: number of the joint that had pressure, and that pressure [Pa]."""
        result = self.result
        if result.protocol == 1:
            result.remarks.append(
                "protocol version 1: the board does not echo its set-points; single deaf valves are not found"
            )
        result.set_points = "followed, and vented after their lifetime"
        if self._following or not self._followed:
            line = self._following or "the board takes no set-points although they are sent; check the line to it"
            result.set_points = "not followed"
            result.faults.append(line)
        elif not self._vented:
            result.set_points = "followed, but not vented after their lifetime"
            result.faults.append(
                "the board did not vent after the lifetime of its set-points: its watchdog does not work; do not use it"
            )
        if test is not None and self._followed:
            self._check_answer(result, *test)
        return result

    def _check_answer(self, result: BoardResult, joint: int, wanted_pa: float) -> None:
        """Whether the pressure sensor of a joint has seen its test pressure."""
        if self._first_pa is None or self._last_pa is None:
            return
        rise_pa = self._last_pa - self._first_pa
        name = self._hand.joints[joint]
        line = f"{name}: {rise_pa[joint] * 1e-3:.1f} kPa measured for {wanted_pa * 1e-3:.1f} kPa"
        result.remarks.append(line)
        if not rise_pa[joint] >= ANSWER_SHARE * wanted_pa:
            other = int(np.nanargmax(rise_pa)) if np.isfinite(rise_pa).any() else joint
            hint = "check supply pressure, tube and pressure sensor"
            if other != joint and rise_pa[other] >= ANSWER_SHARE * wanted_pa:
                hint = f"instead {self._hand.joints[other]} rose: valves, tubes or sensors are swapped"
            result.faults.append(f"{line}; {hint}")

    def _link(self, result: BoardResult, frames: list[Frame]) -> None:
        received_s = np.array([frame.received_ns for frame in frames]) * 1e-9
        result.rate_hz = (len(frames) - 1) / max(received_s[-1] - received_s[0], 1e-9)
        gaps_ms = np.diff(received_s) * 1e3
        result.jitter_ms = float(np.percentile(np.abs(gaps_ms - 1e3 / self._hand.rate_hz), 95))
        expected = self._hand.rate_hz
        if not RATE_SHARE * expected <= result.rate_hz <= expected / RATE_SHARE:
            result.faults.append(f"{result.rate_hz:.1f} frames/s arrive; the description expects {expected:g}")
        for count, what, hint in (
            (result.dropped, "lost", "link too slow, or host too busy"),
            (result.corrupt, "corrupt", "check cable shielding and bit rate"),
            (result.replayed, "repeated or old", "check the adapter, and other senders on the bus"),
        ):
            if count:
                line = f"{count} of {len(frames) + count} frames are {what}: {hint}"
                (result.faults if count > LOST_SHARE * len(frames) else result.remarks).append(line)
        error = self._clock.rate_error
        if error is not None:
            result.clock_rate = 1.0 + error
            if abs(error) > RATE_ERROR:
                pace = "fast" if error > 0.0 else "slow"
                rate = f"{100.0 * abs(error):.2f} % {pace} (rate {1.0 + error:.5f})"
                result.faults.append(f"the board's clock is {rate}; check its oscillator")

    def _status(self, result: BoardResult, frames: list[Frame]) -> None:
        result.supply_v = float(np.mean([frame.supply_voltage_v for frame in frames]))
        nominal = self._hand.sensors.supply_voltage_v
        if abs(result.supply_v / nominal - 1.0) > SUPPLY_TOLERANCE:
            result.faults.append(f"the sensor supply is {result.supply_v:.2f} V; {nominal:g} V is nominal")
        shown = Status(0)
        for frame in frames:
            shown |= frame.status
        for bit, line in (
            (Status.ADC_FAULT, "the converter reports a fault"),
            (Status.OVER_PRESSURE, "the board reports an actuator above its pressure limit"),
            (Status.SUPPLY_LOW, "the board reports too little supply pressure"),
        ):
            if bit in shown:
                result.faults.append(line)
        if Status.VENTED not in frames[-1].status:
            result.remarks.append("the board was driven by somebody else, or has not vented, while it was read")

    def _channels(self, result: BoardResult, frames: list[Frame]) -> None:
        counts = np.array([frame.counts for frame in frames], dtype=np.float64)
        adc = self._hand.sensors.adc
        volts = counts * adc.reference_v / adc.full_scale
        low, high = rails(self._hand)
        described = described_noise_v(self._hand)
        lsb_v = adc.reference_v / adc.full_scale
        names = channel_names(self._hand)
        for c in range(self._hand.channel_count):
            mean, noise = float(volts[:, c].mean()), float(volts[:, c].std())
            verdict = "ok"
            if ((counts[:, c] <= low[c]) | (counts[:, c] >= high[c])).mean() > 0.5:
                verdict = "at the rail: broken wire or short"
            elif (
                np.ptp(counts[:, c]) == 0.0
                and described[c] > QUIET * lsb_v
                and not (c in self._hand.sensors.force_channel and mean == 0)
            ):
                verdict = "dead: never changes"
            elif noise > max(NOISE_FACTOR * described[c], NOISE_FLOOR_V):
                verdict = "noisy: check shield and connector"
            result.channels.append(Channel(c, names.get(c, "unused"), mean, noise, verdict))
            if verdict != "ok" and c in names:
                result.faults.append(f"channel {c} ({names[c]}) is {verdict}")


def described_noise_v(hand: Hand) -> Array:
    """Standard deviation [V] of each ADC channel (channels,) according to the description; 0 for unused channels."""
    sensors = hand.sensors
    noise_v: Array = np.zeros(hand.channel_count)
    noise_v[sensors.angle_channel] = sensors.hall.noise_v
    noise_v[sensors.pressure_channel] = sensors.pressure.noise_v
    noise_v[sensors.force_channel] = sensors.force.noise_v
    return noise_v
