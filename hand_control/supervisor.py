"""Whether the hand may be driven: ages of what the controller knows, plausibility, and latched faults.

    age of the newest frame      reaction
    <= WARN_S    20 ms           none
    >  WARN_S    20 ms           warning on diagnostics
    >  FREEZE_S  50 ms           the integrators stand still at the next tick
    >  VENT_S   100 ms           vent, latched

A command needs no renewal by default; with a command time-out, commands older than it are held (the reference
stands still) and after twice the time-out the hand is vented and the fault latched.

A latched fault stays until `reset`; then `enable` drives the hand again, from the pose it has at that moment.
Times are nanoseconds of one monotonic clock passed in; nothing here reads a clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from hand_messages.health import Health, Level

WARN_S = 0.020
FREEZE_S = 0.050
VENT_S = 0.100


class Phase(Enum):
    """What the controller does with the valves."""

    VENTED = "vented"
    ARMING = "waiting for a first complete measurement"
    ACTIVE = "controlling"


@dataclass(slots=True)
class Supervisor:
    """The state machine. phase: what happens now.  fault: why it is latched, empty where it is not."""

    phase: Phase = Phase.VENTED
    reason: str = "not enabled"
    fault: str = ""
    frame_ns: int | None = None
    command_ns: int | None = None

    def enable(self) -> None:
        """Ask to drive the hand. ValueError while a fault is latched."""
        if self.fault:
            raise ValueError(f"not enabled: a fault is latched ({self.fault}); call reset first")
        if self.phase is Phase.VENTED:
            self.phase, self.frame_ns, self.command_ns = Phase.ARMING, None, None

    def arm(self, now_ns: int) -> None:
        """A first complete measurement is there: the hand is driven from now on."""
        self.phase, self.reason, self.command_ns = Phase.ACTIVE, "", now_ns

    def vent(self, reason: str) -> None:
        """Vent on request; enable drives again."""
        if self.phase is not Phase.VENTED or not self.fault:
            self.phase, self.reason = Phase.VENTED, reason

    def trip(self, fault: str) -> None:
        """Vent because of a fault, and latch it; the first fault is the one that is kept."""
        if not self.fault:
            self.fault = self.reason = fault
        self.phase = Phase.VENTED

    def reset(self) -> str:
        """Forget a latched fault; the hand stays vented until enabled. Returns what was forgotten."""
        fault, self.fault = self.fault, ""
        if fault:
            self.reason = "not enabled since the reset"
        return fault

    def frame(self, now_ns: int) -> bool:
        """A usable frame arrived. Returns whether the integrators may run in its tick."""
        before, self.frame_ns = self.frame_ns, now_ns
        return before is not None and now_ns - before <= FREEZE_S * 1e9

    def command(self, now_ns: int) -> None:
        """A command was accepted."""
        self.command_ns = now_ns

    def check(self, now_ns: int, command_timeout_s: float) -> None:
        """Trip on silence. To be called often, also while nothing arrives."""
        if self.phase is not Phase.ACTIVE:
            return
        age_s = self.frame_age_s(now_ns)
        if age_s > VENT_S:
            self.trip(f"no usable sensor data for {VENT_S * 1e3:.0f} ms")
        elif self._command_age_s(now_ns) > 2.0 * command_timeout_s > 0.0:
            self.trip(f"no command for {2.0 * command_timeout_s:g} s")

    def command_held(self, now_ns: int, command_timeout_s: float) -> bool:
        """Whether the last command is too old to be followed further."""
        return self._command_age_s(now_ns) > command_timeout_s > 0.0

    def frame_age_s(self, now_ns: int) -> float:
        """Age [s] of the newest usable frame; 0 before the first."""
        return 0.0 if self.frame_ns is None else (now_ns - self.frame_ns) * 1e-9

    def _command_age_s(self, now_ns: int) -> float:
        return 0.0 if self.command_ns is None else (now_ns - self.command_ns) * 1e-9

    def health(self, now_ns: int) -> Health:
        """The state in words."""
        if self.fault:
            return Health("safety", Level.ERROR, f"vented: {self.fault}; call reset, then enable")
        if self.phase is Phase.VENTED:
            return Health("safety", Level.OK, f"vented: {self.reason}")
        if self.phase is Phase.ARMING:
            return Health("safety", Level.WARN, self.phase.value)
        if self.frame_age_s(now_ns) > WARN_S:
            return Health("safety", Level.WARN, "sensor data is late")
        return Health("safety", Level.OK, self.phase.value)
