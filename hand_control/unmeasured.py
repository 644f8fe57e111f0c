"""The latch of a value that is not a number: the joint, and what the driver says of its channel.

The driver publishes the cause before the frame, but DDS keeps no order between two topics: a cause that is known
within LATE_S completes the line of the latch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from hand_control.board_watch import BoardWatch
from hand_control.supervisor import Supervisor
from hand_model.arrays import Array
from hand_model.description import Hand

LATE_S = 0.3
"""Six reports of the driver."""
QUANTITIES = ("angle", "speed", "pressure")


class Unmeasured:
    """Trips on such a value, and completes the line."""

    def __init__(self, hand: Hand, board: BoardWatch) -> None:
        """For the joints of a hand, with what the driver reports of the board."""
        self._joints, self._board = hand.joints, board
        angle, pressure = hand.sensors.angle_channel, hand.sensors.pressure_channel
        self._channels = dict(zip(QUANTITIES, (angle, angle, pressure), strict=True))
        self._open: tuple[str, str, int] | None = None  # joint, line and time of a latch whose cause is not known

    def trip(self, safety: Supervisor, joint: int, measured: Sequence[Array], host_ns: int) -> None:
        """Latch. measured: angle [rad], speed [rad/s] and pressure [Pa], (joints,) each."""
        name, line, cause = self._named(joint, measured)
        fault = _with_cause(line, cause)
        self._open = None if cause else (name, fault, host_ns)
        safety.trip(fault)

    def line(self, joint: int, measured: Sequence[Array]) -> str:
        """The line of such a latch, where nothing is latched; measured: as in `trip`, SI, (joints,) each."""
        _, line, cause = self._named(joint, measured)
        return _with_cause(line, cause)

    def _named(self, joint: int, measured: Sequence[Array]) -> tuple[str, str, str]:
        """The joint, what of it is not a number, and the cause, empty where the driver has named none."""
        name = self._joints[joint]
        what = next(q for q, values in zip(QUANTITIES, measured, strict=True) if not math.isfinite(values[joint]))
        line = f"{name}: its {what} (channel {self._channels[what][joint]}) is not a number"
        return name, line, self._board.evidence(name)

    def complete(self, safety: Supervisor, host_ns: int) -> None:
        """Add a cause that was not known yet; call it with each report of the driver."""
        if self._open is None:
            return
        name, line, since_ns = self._open
        cause = self._board.evidence(name)
        if cause and host_ns - since_ns <= LATE_S * 1e9:
            safety.reword(line, f"{line.partition(';')[0]}; {cause}")
            self._open = None


def _with_cause(line: str, cause: str) -> str:
    return f"{line}; {cause or 'the driver has named no cause; check its status `channels`, sensor and cable'}"
