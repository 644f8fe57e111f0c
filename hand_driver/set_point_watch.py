"""Whether the board follows what it is sent: from its status, and from the echo of the set-points in force.

    what the frames show                                                reaction of the driver
    VENTED, or the echo of older set-points, DEAF_S after newer ones,
    for SHOWN_S                                                         vent, latched: the board is deaf
    the echo of set-points that this driver did not send, as long, or
    pressure by such ones for longer than a lifetime may be             vent, latched: it obeys another sender
    other values in force than were sent with that sequence             vent, latched: valves are deaf
    fewer packets accepted than sent, by more than LOST_SHARE           vent, latched: packets are lost
    pressure in force beyond its lifetime                               vent, latched: the watchdog does not work
Each must be shown by FRAMES frames in a row. A board of version 1 sends no echo: only VENTED is watched. Times are
nanoseconds of one monotonic clock and are arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hand_driver.board import Echo, Frame, Pressures, Status
from hand_driver.set_points import MAX_LIFETIME_S

DEAF_S = 0.1
"""Time for which set-points must have been sent; a board takes them over within one period."""
SHOWN_S = 0.1
"""Time of receipt over which frames must show a deaf board; frames that had waited somewhere arrive all at once."""
FRAMES = 3
"""Number of frames in a row that must show a fault; a slow simulated board sends few frames in DEAF_S."""
TOLERANCE_PA = 20.0
"""Largest difference of a set-point and its echo; both are rounded to 10 Pa."""
OVERDUE_S = 0.05
"""Pressure may be in force for so long after its lifetime: the age in a frame is rounded, and a period passes."""
LOST_SHARE = 0.2
"""Largest share of packets that may be lost, over WINDOW packets."""
WINDOW = 40
KEPT = 1024
"""Number of packets whose content is remembered, 1 s at 1 kHz."""
_SEQUENCES = 1 << 32


class SetPointWatch:
    """Compares the frames of one hand with the set-points sent. `sent` may run in another thread than `frame`."""

    def __init__(self, joints: Sequence[str]) -> None:
        """Begin with nothing sent. joints: names of the valves, in their order."""
        self._joints = tuple(joints)
        self.forget()

    def forget(self) -> None:
        """Begin again: with a new connection, and after the reset of a fault."""
        valves = len(self._joints)
        self._number = np.full(KEPT, -1, dtype=np.int64)
        self._at_ns = np.zeros(KEPT, dtype=np.int64)
        self._lifetime_s = np.zeros(KEPT)
        self._pressure_pa = np.zeros((KEPT, valves))
        self._row_ns = self._last_ns = 0
        self._until_ns = -1
        self._counts = {"deaf": 0, "foreign": 0, "valves": 0, "watchdog": 0}
        self._deaf_since_ns = 0  # receipt of the first frame of those that show it
        self._foreign_since_ns = 0
        self._window: tuple[int, int] | None = None  # packets sent and accepted
        self._previous: Echo | None = None
        self.lost_share = 0.0

    def sent(self, sequence: int, pressure_pa: Pressures, lifetime_s: float, now_ns: int) -> None:
        """Set-points (valves,) [Pa] were written with a sequence and a lifetime [s]."""
        at = sequence % KEPT
        self._number[at] = -1
        self._pressure_pa[at], self._lifetime_s[at], self._at_ns[at] = pressure_pa, lifetime_s, now_ns
        self._number[at] = sequence
        if now_ns >= self._until_ns:  # the former ones had expired: the board had vented by itself
            self._row_ns = now_ns
        self._last_ns, self._until_ns = now_ns, now_ns + round(lifetime_s * 1e9)

    def frame(self, frame: Frame, now_ns: int) -> str:
        """The fault that a frame, with those before it, shows; empty for none."""
        echo = frame.echo
        vented = Status.VENTED in frame.status
        silent = vented or (echo is not None and math.isnan(echo.age_s))
        foreign = echo is not None and not silent and self._number[echo.sequence % KEPT] != echo.sequence
        if not (silent or foreign):
            self._row_ns = now_ns
        deaf = (silent or foreign) and now_ns < self._until_ns and now_ns - self._row_ns > DEAF_S * 1e9
        if self._lasting_deaf(deaf or (echo is not None and self._stale(echo, now_ns)), frame.received_ns):
            return self._foreign(echo) if foreign and echo is not None else self._deaf()
        if echo is None:
            return ""
        if self._outlasts(foreign and bool(echo.pressure_pa.any()), frame.received_ns):
            return self._foreign(echo)
        differing = self._differing(echo, frame.status)
        if self._lasting("valves", differing is not None) and differing is not None:
            return self._wrong_valve(echo, differing)
        if self._lasting("watchdog", self._overdue(echo)):
            return (
                "the board holds pressure beyond the lifetime of its set-points: its watchdog does not work;"
                " cut the supply and check the firmware of the board"
            )
        return self._lost(echo)

    def _lasting(self, what: str, shown: bool) -> bool:
        self._counts[what] = self._counts[what] + 1 if shown else 0
        return self._counts[what] >= FRAMES

    def _lasting_deaf(self, shown: bool, received_ns: int) -> bool:
        if not self._counts["deaf"]:
            self._deaf_since_ns = received_ns
        return self._lasting("deaf", shown) and received_ns - self._deaf_since_ns >= SHOWN_S * 1e9

    def _outlasts(self, shown: bool, received_ns: int) -> bool:
        """Whether pressure that this driver did not ask for is in force beyond the longest lifetime there is."""
        if not self._counts["foreign"]:
            self._foreign_since_ns = received_ns
        longest_s = MAX_LIFETIME_S + OVERDUE_S
        return self._lasting("foreign", shown) and received_ns - self._foreign_since_ns > longest_s * 1e9

    def _stale(self, echo: Echo, now_ns: int) -> bool:
        """Whether set-points newer than those of the echo were sent long ago, and others since."""
        if math.isnan(echo.age_s):
            return False
        following = (echo.sequence + 1) % _SEQUENCES
        at = following % KEPT
        known = self._number[at] == following
        return bool(known and now_ns - self._at_ns[at] > DEAF_S * 1e9 and now_ns < self._until_ns)

    def _differing(self, echo: Echo, status: Status) -> int | None:
        """The valve whose value in force differs most from what was sent; None where all agree or it is not known."""
        at = echo.sequence % KEPT
        if self._number[at] != echo.sequence or math.isnan(echo.age_s) or Status.VENTED in status:
            return None
        sent = self._pressure_pa[at]
        if len(echo.pressure_pa) != len(sent):
            return 0
        off = np.abs(echo.pressure_pa - sent)
        if Status.OVER_PRESSURE in status:  # the board itself vents an actuator
            off[echo.pressure_pa == 0.0] = 0.0
        worst = int(np.argmax(off))
        return worst if off[worst] > TOLERANCE_PA else None

    def _overdue(self, echo: Echo) -> bool:
        at = echo.sequence % KEPT
        known = self._number[at] == echo.sequence and not math.isnan(echo.age_s)
        return bool(known and echo.pressure_pa.any() and echo.age_s > self._lifetime_s[at] + OVERDUE_S)

    def _lost(self, echo: Echo) -> str:
        before, self._previous = self._previous, echo
        if before is None or math.isnan(before.age_s) or math.isnan(echo.age_s):
            self._window = None
            return ""
        sent = (echo.sequence - before.sequence) % _SEQUENCES
        if sent >= 128:  # more than the counter of accepted packets can show
            self._window = None
            return ""
        packets, accepted = self._window or (0, 0)
        packets, accepted = packets + sent, accepted + (echo.accepted - before.accepted) % 256
        self._window = (packets, accepted)
        if packets < WINDOW:
            return ""
        self._window, self.lost_share = None, max(0.0, 1.0 - accepted / packets)
        if self.lost_share <= LOST_SHARE:
            return ""
        return (
            f"the board takes over only {100.0 * (1.0 - self.lost_share):.0f} % of the set-points;"
            " check the line to the board, its baud rate and the load of the bus"
        )

    def _deaf(self) -> str:
        return (
            "the board takes no set-points although they are sent: it has latched a fault of its own, or does not hear;"
            " check the line from host to board, and the board's supply and firmware"
        )

    def _foreign(self, echo: Echo) -> str:
        return (
            f"the board reports set-points in force that this driver did not send (sequence {echo.sequence},"
            f" up to {float(np.max(echo.pressure_pa, initial=0.0)) * 1e-5:.2f} bar);"
            " check that no other host drives the board, and the board's firmware"
        )

    def _wrong_valve(self, echo: Echo, valve: int) -> str:
        if len(echo.pressure_pa) != len(self._joints):
            return (
                f"the board drives {len(echo.pressure_pa)} valves, the description has {len(self._joints)};"
                " check the description and the board"
            )
        sent_bar = self._pressure_pa[echo.sequence % KEPT, valve] * 1e-5
        return (
            f"{self._joints[valve]}: the board holds {echo.pressure_pa[valve] * 1e-5:.2f} bar at valve {valve}, where"
            f" {sent_bar:.2f} bar was sent; check this valve's driver and the board's firmware"
        )
