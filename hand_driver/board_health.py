"""Statuses of the protocol version and of the clocks, from what the driver measures."""

from __future__ import annotations

from hand_messages.health import Health, Level

RATE_ERROR = 2e-3
"""A larger relative error of the board's rate is a warning. A crystal is within 1e-4, an RC oscillator within 1e-2."""
LAG_S = 0.02
"""A larger smallest delay from stamp to receipt is a warning."""
NEGOTIATED_S = 2.0
"""Time after which a board of version 2 has answered."""
LOST = 0.02
"""A larger share of lost set-points is a warning; above SetPointWatch's limit the driver vents."""


def protocol_health(version: int, connected_s: float, lost_share: float) -> Health:
    """Status of the link's protocol version (0: no board), connected_s [s] after the connection began.

    lost_share: share of the set-points that the board missed.
    """
    values = {"version": str(version), "lost_set_points": f"{lost_share:.3f}"}
    if version == 0:
        return Health("protocol", Level.STALE, "no board", values)
    if version == 1 and connected_s < NEGOTIATED_S:
        return Health("protocol", Level.OK, "the version is being negotiated", values)
    if version == 1:
        line = "version 1: the board does not echo its set-points and is watched less: single deaf valves are not found"
        return Health("protocol", Level.WARN, line, values)
    if lost_share > LOST:
        line = f"the board missed {100.0 * lost_share:.0f} % of the set-points: check line, baud rate and bus load"
        return Health("protocol", Level.WARN, line, values)
    return Health("protocol", Level.OK, f"version {version}: the board echoes its set-points", values)


def clock_health(rate_error: float | None, lag_s: float, set_back_s: float) -> Health:
    """Status of the board's clock and of the host's time of day.

    rate_error: relative, positive where the board is fast, None if unknown.  lag_s: smallest delay from stamp to
    receipt [s].  set_back_s: a step back of the time of day [s] that the stamps do not follow.
    """
    rate = "" if rate_error is None else f"{1.0 + rate_error:.5f}"
    values = {"board_rate": rate, "lag_ms": f"{lag_s * 1e3:.2f}"}
    if set_back_s > 0.0:
        line = (
            f"the host's clock was set back by {set_back_s:.1f} s; stamps continue on the former time:"
            " deactivate and activate the driver"
        )
        return Health("clock", Level.ERROR, line, values)
    if rate_error is not None and abs(rate_error) > RATE_ERROR:
        pace = "fast" if rate_error > 0.0 else "slow"
        line = (
            f"the board's clock is {100.0 * abs(rate_error):.2f} % {pace} (rate {rate}); check its oscillator:"
            " measured speeds are wrong by as much"
        )
        return Health("clock", Level.WARN, line, values)
    if lag_s > LAG_S:
        line = (
            f"frames arrive {lag_s * 1e3:.0f} ms after their stamps: the board's clock has stepped, or the link is full"
        )
        return Health("clock", Level.WARN, line, values)
    if rate_error is None:
        return Health("clock", Level.OK, "the rate of the board's clock is being measured", values)
    return Health("clock", Level.OK, "the clocks of board and host agree", values)
