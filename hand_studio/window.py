"""A stretch of measured signals, and what a model of the hand makes of its set-points. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.layout import PHI
from hand_model.kernel.open_loop import HAND_EFFECTS
from hand_sim.offline import Measured, initial_state


@dataclass(frozen=True, slots=True)
class Window:
    """Samples at period_s [s]: angle_rad and pressure_pa (T, joints) as measured, in the order of the hand.

    set_point_pa (T, joints): in force from each sample to the next.
    """

    period_s: float
    angle_rad: Array
    pressure_pa: Array
    set_point_pa: Array

    @property
    def time_s(self) -> Array:
        """Times of the samples (T,) [s], from 0."""
        return np.asarray(np.arange(len(self.angle_rad)) * self.period_s, dtype=np.float64)

    def part(self, first: int, last: int) -> Window:
        """The samples from `first` up to `last`, which is left out."""
        cut = slice(first, last)
        return Window(self.period_s, self.angle_rad[cut], self.pressure_pa[cut], self.set_point_pa[cut])


def begin(hand: Hand, parameters: Array, window: Window, state: Array | None = None) -> ClosedLoop:
    """The plant with parameters (rows, joints), SI, in a state (STATES, joints) at the start of a window.

    Without a state, in the one that was measured there; its creep is known only where the joints rest or move slowly.
    All effects of the catalogue are compiled in, so that each can be changed, except those that replace the valve.
    """
    if state is None:
        stamps = np.round(window.time_s * 1e9).astype(np.int64)
        velocity = np.gradient(window.angle_rad, window.period_s, axis=0)
        measured = Measured(stamps, window.angle_rad, velocity, window.pressure_pa)
        state = initial_state(replace(hand, parameters=parameters), measured)
    loop = ClosedLoop(parameters[None], hand.partner, state[None], window.period_s, effects=HAND_EFFECTS)
    loop.hold_history(window.set_point_pa[:1])
    return loop


def simulate(hand: Hand, parameters: Array, window: Window, state: Array | None = None) -> tuple[ClosedLoop, Array]:
    """The plant at the first sample after a window, and the angles (T, joints) [rad] that it gives in the window.

    parameters: (rows, joints) SI.  state: see `begin`.  The angles are those of a driver without noise.
    """
    loop = begin(hand, parameters, window, state)
    first = loop.state[:, PHI]
    return loop, read_angle(hand, np.concatenate([first, loop.advance(window.set_point_pa[None])[0, :-1, PHI]]))


def read_angle(hand: Hand, angle_rad: Array) -> Array:
    """What the driver measures (..., joints) [rad] at true angles (..., joints) [rad], by the calibration line."""
    read: Array = hand.sensors.angle_line.angle_rad(hand.sensors.hall.ratio(angle_rad))
    return read
