"""What the controller watches of the board: whether it holds the pressure asked for, and what the driver says of it.

    board_state                                              reaction
    an actuator above its pressure limit                     vent, latched
    vented for VENTED_S while pressure is asked for          vent, latched
    a latched fault of the driver                            vent, latched; `reset_driver` first
    none for LOST_S, after it was received before            vent, latched
    never received                                           warning: the board is not watched
Times are nanoseconds of the host's monotonic clock and are arguments.
"""

from __future__ import annotations

from collections.abc import Sequence

from hand_messages.health import Health, Level

VENTED, OVER_PRESSURE = 1, 4
"""Bits of `status`, as in hand_msgs/BoardState."""
VENTED_S = 0.3
"""Time after which a board has taken over set-points; the driver itself finds a deaf board earlier."""
LOST_S = 0.3
"""Six reports of the driver."""
SHOWN = 3
"""Most channels that the status names."""


class BoardWatch:
    """Remembers the newest board_state, and for how long the board has been vented against the set-points."""

    def __init__(self) -> None:
        """Begin without a report."""
        self._received_ns: int | None = None
        self._vented_ns: int | None = None
        self._status = 0
        self._protocol = 0
        self.fault = ""
        self.channels: tuple[str, ...] = ()

    def state(self, status: int, protocol: int, fault: str, host_ns: int, channels: Sequence[str] = ()) -> None:
        """Take a report: status bits, protocol version, and the latched fault of the driver, empty for none.

        channels: what measures nothing, one line each, as the driver names it.
        """
        self._received_ns, self._status, self._protocol, self.fault = host_ns, status, protocol, fault
        self.channels = tuple(channels)

    def evidence(self, joint: str) -> str:
        """Why the angle or the pressure of a joint is not measured, one line; empty where the driver names no cause."""
        sensors = ("every channel:", f"{joint} angle (", f"{joint} pressure (")
        return "; ".join(line for line in self.channels if line.startswith(sensors))

    @property
    def vented(self) -> bool:
        """Whether the newest report says that the board holds the hand vented; False before the first one."""
        return bool(self._status & VENTED)

    def start(self, host_ns: int) -> None:
        """The hand is driven from now on: earlier silence does not count."""
        self._vented_ns = None
        if self._received_ns is not None:
            self._received_ns = max(self._received_ns, host_ns)

    def check(self, asking: bool, host_ns: int) -> str:
        """The fault, one line, or empty. asking: whether any set-point is above 0 Pa. Call it while driving."""
        if self._received_ns is None:
            return ""
        if self.fault:
            return f"the driver holds the hand vented: {self.fault}; call reset_driver"
        if self._status & OVER_PRESSURE:
            return (
                "the board reports an actuator above its pressure limit and has vented it;"
                " check the pressure regulator and the valves"
            )
        if host_ns - self._received_ns > LOST_S * 1e9:
            return f"no board_state for {LOST_S:g} s; check the driver"
        if not (asking and self._status & VENTED):
            self._vented_ns = None
        elif self._vented_ns is None:
            self._vented_ns = host_ns
        elif host_ns - self._vented_ns > VENTED_S * 1e9:
            return (
                f"the board reports that it is vented, although pressure was asked for {VENTED_S:g} s;"
                " check the driver, the line to the board and its supply"
            )
        return ""

    def health(self) -> Health:
        """How well the board is watched, as a status of diagnostics."""
        if self._received_ns is None:
            return Health("board", Level.WARN, "no board_state is published: the board is not watched")
        if self.fault:
            return Health("board", Level.ERROR, f"the driver holds the hand vented: {self.fault}; call reset_driver")
        if self.channels:
            return Health("board", Level.WARN, f"not measured: {'; '.join(self.channels[:SHOWN])}")
        if self._protocol == 1:
            return Health("board", Level.OK, "watched less: it does not echo its set-points (protocol version 1)")
        return Health("board", Level.OK, "watched")
