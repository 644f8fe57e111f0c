"""A watch for swings of a joint whose reference rests: the valve or the joint lags more than the law's model knows.

A gain that is too high for the lag of the loop makes the joint swing about its reference: the error changes its sign
again and again, and its peaks do not shrink. The scheduled gains are those of one closed-loop time constant (see
`law.py`), which bounds how much unknown lag the loop bears: the gain margin of internal model control grows with it
(Rivera, Morari, Skogestad 1986). So each such swing lengthens this time constant by a share, until the swings shrink.
It stays longer until the law is released. Stick and slip is no swing: a joint that sticks takes longer from one side to
the other, and its peaks are below `swing_error`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hand_control.declared import C, G, S, inlined
from hand_model.arrays import Array


@inlined
def watch_swings(g, s, i, error, rests, dt):  # type: ignore[no-untyped-def]
    """Lengthen the response time of joint i [s] where its error [rad] at rest swings without shrinking.

    rests: whether the reference rests.  dt: [s].
    """
    if not rests or s[S.contact, i] != 0.0:
        s[S.peak, i] = s[S.last_peak, i] = s[S.swing_time, i] = 0.0
        return
    s[S.swing_time, i] += dt
    if s[S.peak, i] * error >= 0.0:
        if abs(error) > abs(s[S.peak, i]):
            s[S.peak, i] = error
        return
    before, peak = abs(s[S.last_peak, i]), abs(s[S.peak, i])
    if peak > C.swing_error and s[S.swing_time, i] < C.swing_half:
        if before > 0.0 and peak > C.swing_decay * before:
            most = C.most_slower * g[G.response_time, i]
            step = C.swing_step * (g[G.response_time, i] + g[G.dead_time, i] + s[S.slower, i])
            s[S.slower, i] = min(s[S.slower, i] + step, most)
        s[S.last_peak, i] = peak
    elif peak > C.noise:
        s[S.last_peak, i] = 0.0
    s[S.peak, i], s[S.swing_time, i] = error, 0.0


def slowed(joints: Sequence[str], state: Array) -> str:
    """One line that names the joint with the longest added response time and what to check; empty where none has one.

    joints: their names (n,).  state: of the law (rows, n), SI.
    """
    worst = int(np.argmax(state[S.slower]))
    added_s = float(state[S.slower, worst])
    if added_s <= 0.0:
        return ""
    others = int(np.count_nonzero(state[S.slower])) - 1
    more = f", and {others} more joints" if others > 1 else ", and another joint" if others else ""
    return (
        f"{joints[worst]}{more}: swung at rest, its response time is {1e3 * added_s:.0f} ms longer until the hand is"
        " enabled again; check valve.dead_time_s and valve.time_constant_s, the length of the tube and the valve"
    )
