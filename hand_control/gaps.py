"""What the law may conclude from the first frames after a gap: nothing about contact.

The filters of the torque balance know the motion up to the gap. What was not measured within it appears to them as a
torque, and so as contact. After a gap they start again on the straight line through the gap. Until they have settled,
no contact begins or ends, the bias of the detector is kept, and neither integrators nor the map change.
"""

from __future__ import annotations

import numpy as np

from hand_control.declared import OUT, G, S
from hand_control.law import Law
from hand_model.arrays import Array

GAP_S = 0.02
"""A longer time between two frames is a gap: the filters of the torque balance, 20 ms, do not bridge it."""
SETTLED = 5.0
"""Time constants of the observer filters until they have forgotten how they were started."""
_KEPT = [S.contact, S.sum, S.age, S.bias, S.moving, S.released]
"""Rows of the contact detector."""


class Gap:
    """Restarts the observers of one law after each gap, and keeps its contacts until they have settled."""

    def __init__(self, law: Law) -> None:
        """Begin settled."""
        self._law = law
        self._left_s = 0.0
        self._kept = law.state[_KEPT].copy()

    def before(self, elapsed_s: float, period_s: float, position: Array, pressure: Array) -> bool:
        """Before a tick: whether the observers settle, elapsed_s [s] after the frame before.

        period_s: of the frames [s]; position (n,) [rad], pressure (n,) [Pa]: of this frame.
        """
        if elapsed_s > GAP_S and elapsed_s > 3.0 * period_s:
            self._restart(elapsed_s, position, pressure)
            self._left_s = SETTLED * float(np.max(self._law.gains[G.observer_filter]))
        elif self._left_s > 0.0:
            self._left_s -= elapsed_s
        if self._left_s <= 0.0:
            return False
        self._kept = self._law.state[_KEPT].copy()
        return True

    def after(self) -> None:
        """After a tick while the observers settle: the detector stays as it was."""
        state, out = self._law.state, self._law.out
        state[_KEPT] = self._kept
        out[OUT.contact], out[OUT.contact_age] = state[S.contact], state[S.age]

    def _restart(self, elapsed_s: float, position: Array, pressure: Array) -> None:
        """Start the filters at a constant speed over the gap; joints never observed start by themselves."""
        s, lag = self._law.state, self._law.gains[G.observer_filter]
        speed = np.where(np.isfinite(position), (position - s[S.last_angle]) / elapsed_s, 0.0)
        known = (s[S.started] != 0.0) & np.isfinite(position + pressure)
        for row, value in (
            (S.speed, speed),
            (S.last_angle, position),
            (S.phi_1, position - lag * speed),
            (S.phi_2, position - 2.0 * lag * speed),
            (S.p_1, pressure),
            (S.p_2, pressure),
            (S.q_1, pressure * (position - lag * speed)),
            (S.q_2, pressure * (position - 2.0 * lag * speed)),
            (S.found_1, s[S.load] + s[S.drag]),
            (S.found_2, s[S.load] + s[S.drag]),
        ):
            s[row] = np.where(known, value, s[row])
