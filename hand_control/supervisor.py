"""Whether the hand may be driven: age of the measurements, age of the command, and latched faults.

    age of the newest frame      reaction
    <= WARN_S    20 ms           none
    >  WARN_S    20 ms           warning on diagnostics
    >  FREEZE_S  50 ms           the integrators stop in the next tick
    >  VENT_S   100 ms           vent, latched

After `enable`, a first complete measurement must come within ARMING_S, or the hand is vented again: who has enabled a
hand must not be surprised by it minutes later. A hand that is enabled at the start of the nodes waits for the first
frame of its driver without a limit.

By default a command needs no renewal. With a command time-out, an older command is held (the reference stands still),
and after twice the time-out the hand is vented and the fault latched.

A latched fault stays until `reset`; then `enable` drives the hand again, from its present pose. Times are nanoseconds
of one monotonic clock and are arguments.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from hand_messages.health import DATA_LATE, Health, Level

WARN_S = 0.020
FREEZE_S = 0.050
VENT_S = 0.100
_FREEZE_NS, _VENT_NS = round(FREEZE_S * 1e9), round(VENT_S * 1e9)
ARMING_S = 2.0
"""Longest time from `enable`, or from the first frame after the start, to a complete measurement."""
_SILENCE = f"no usable sensor data for {VENT_S * 1e3:.0f} ms"
_UNEXPLAINED = f"{_SILENCE}; check the driver and the line to the board"
EXPLAINED_S = 1.0
"""What is found within this time of a silence may be its cause: DDS shows a new publisher after half a second."""


class Phase(Enum):
    """State of the controller."""

    VENTED = "vented"
    ARMING = "waiting for a first complete measurement"
    ACTIVE = "controlling"


@dataclass(slots=True)
class Supervisor:
    """The state machine. phase: its state.  reason: of the last vent.  fault: the latched fault, or empty.

    lacks: while it waits for a complete measurement, what the last one lacked, one line; empty where none came.
    """

    phase: Phase = Phase.VENTED
    reason: str = "not enabled"
    fault: str = ""
    frame_ns: int | None = None
    command_ns: int | None = None
    lacks: str = ""
    _arming_ns: int | None = None
    _patient: bool = False
    _silent_ns: int | None = None

    def enable(self, patient: bool = False) -> None:
        """Drive the hand from the next plausible measurement on. ValueError while a fault is latched.

        patient: wait for a first frame without a limit, as at the start of the nodes.
        """
        if self.fault:
            raise ValueError(f"not enabled: a fault is latched ({self.fault}); call reset first")
        if self.phase is Phase.VENTED:
            self.phase, self.frame_ns, self.command_ns = Phase.ARMING, None, None
            self.lacks, self._arming_ns, self._patient = "", None, patient

    def arm(self, now_ns: int) -> None:
        """Drive the hand from now on: a first complete measurement has arrived."""
        self.phase, self.reason, self.command_ns = Phase.ACTIVE, "", now_ns

    def vent(self, reason: str) -> None:
        """Vent on request, without a fault."""
        if self.phase is not Phase.VENTED or not self.fault:
            self.phase, self.reason = Phase.VENTED, reason

    def trip(self, fault: str) -> None:
        """Vent because of a fault, and latch it; the first fault is kept."""
        if not self.fault:
            self.fault = self.reason = fault
        self.phase = Phase.VENTED

    def reword(self, fault: str, better: str) -> None:
        """Name a latched fault by another line, where it is still the one that is latched."""
        if self.fault == fault:
            self.fault = self.reason = better

    def explain_silence(self, now_ns: int, cause: str) -> None:
        """Name what was found, one line, in the latch of a silence that began within EXPLAINED_S."""
        if self._silent_ns is not None and now_ns - self._silent_ns <= EXPLAINED_S * 1e9:
            self.reword(_UNEXPLAINED, f"{_SILENCE}; {cause}")

    def reset(self) -> str:
        """Clear a latched fault and return it; the hand stays vented until enabled."""
        fault, self.fault = self.fault, ""
        if fault:
            self.reason = "not enabled since the reset"
        return fault

    def frame(self, now_ns: int) -> bool:
        """Count a usable frame. Returns whether the integrators may run in its tick."""
        before, self.frame_ns = self.frame_ns, now_ns
        return before is not None and now_ns - before <= _FREEZE_NS

    def command(self, now_ns: int) -> None:
        """Count an accepted command."""
        self.command_ns = now_ns

    def check(self, now_ns: int, command_timeout_s: float) -> None:
        """Trip on silence, and give up waiting for a measurement. Call it often, also while nothing arrives."""
        if self.phase is not Phase.ACTIVE:
            if self.phase is Phase.ARMING:
                self._check_arming(now_ns)
        elif self.frame_ns is not None and now_ns - self.frame_ns > _VENT_NS:
            self._silent_ns = now_ns
            self.trip(_UNEXPLAINED)
        elif command_timeout_s > 0.0 and self._command_age_s(now_ns) > 2.0 * command_timeout_s:
            self.trip(f"no command for {2.0 * command_timeout_s:g} s; check the node that sends the commands")

    def _check_arming(self, now_ns: int) -> None:
        if self._patient and self.frame_ns is None:
            return
        if self._arming_ns is None:
            self._arming_ns = now_ns
        elif now_ns - self._arming_ns > ARMING_S * 1e9:
            why = self.lacks or "no frame arrives; check the driver and the line to the board"
            self.vent(f"no complete measurement within {ARMING_S:g} s; {why}; then call enable")

    def command_held(self, now_ns: int, command_timeout_s: float) -> bool:
        """Whether the last command is older than the time-out."""
        return command_timeout_s > 0.0 and self._command_age_s(now_ns) > command_timeout_s

    def frame_age_s(self, now_ns: int) -> float:
        """Age [s] of the newest usable frame; 0 before the first."""
        return 0.0 if self.frame_ns is None else (now_ns - self.frame_ns) * 1e-9

    def _command_age_s(self, now_ns: int) -> float:
        return 0.0 if self.command_ns is None else (now_ns - self.command_ns) * 1e-9

    def health(self, now_ns: int) -> Health:
        """The state as a status of diagnostics."""
        if self.fault:
            return Health("safety", Level.ERROR, f"vented: {self.fault}; call reset, then enable")
        if self.phase is Phase.VENTED:
            return Health("safety", Level.OK, f"vented: {self.reason}")
        if self.phase is Phase.ARMING:
            return Health("safety", Level.WARN, self.phase.value)
        if self.frame_age_s(now_ns) > WARN_S:
            return Health("safety", Level.WARN, DATA_LATE)
        return Health("safety", Level.OK, self.phase.value)
