"""A stretch of measured signals, and what a model of the hand makes of its set-points. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.hooks import HAND_EFFECTS
from hand_model.kernel.rows import ROW
from hand_sim.offline import Measured, initial_state


@dataclass(frozen=True, slots=True)
class Window:
    """Samples at period_s [s]: angle_rad and pressure_pa (T, joints) as measured, in the order of the hand.

    set_point_pa (T, joints): in force from each sample to the next.  force_n (T, joints): of the sensor on the joint,
    NaN where there is none; None where forces were not received.
    """

    period_s: float
    angle_rad: Array
    pressure_pa: Array
    set_point_pa: Array
    force_n: Array | None = None

    @property
    def time_s(self) -> Array:
        """Times of the samples (T,) [s], from 0."""
        return np.asarray(np.arange(len(self.angle_rad)) * self.period_s, dtype=np.float64)

    def part(self, first: int, last: int) -> Window:
        """The samples from `first` up to `last`, which is left out."""
        cut = slice(first, last)
        force = None if self.force_n is None else self.force_n[cut]
        return Window(self.period_s, self.angle_rad[cut], self.pressure_pa[cut], self.set_point_pa[cut], force)


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
    loop = ClosedLoop(
        on_angle_clock(parameters)[None], hand.partner, state[None], window.period_s, effects=HAND_EFFECTS
    )
    loop.hold_history(window.set_point_pa[:1])
    return loop


def simulate(hand: Hand, parameters: Array, window: Window, state: Array | None = None) -> tuple[ClosedLoop, Array]:
    """The plant at the first sample after a window, and the readings (T + 1, STATES, joints) up to this sample.

    parameters: (rows, joints) SI.  state: see `begin`.  The readings are those of ideal converters, without noise.
    """
    loop = begin(hand, parameters, window, state)
    first = loop.state
    return loop, np.concatenate([first, loop.advance(window.set_point_pa[None])[0]])


def on_angle_clock(parameters: Array) -> Array:
    """The parameters (rows, joints), SI, of a plant whose set-points are stamped by another clock.

    Where the pressures are stamped late and the set-points share their clock, a set-point acts earlier than its stamp
    says; at the earliest, at its stamp.
    """
    moved = parameters.copy()
    early_s = parameters[ROW["clock_offset.offset_s"]] * (1.0 - parameters[ROW["clock_offset.share"]])
    moved[ROW["valve.dead_time_s"]] = np.maximum(parameters[ROW["valve.dead_time_s"]] - early_s, 0.0)
    return moved


def stamped(pressure_pa: Array, parameters: Array, joint: int, period_s: float) -> Array:
    """Pressures (T,) [Pa] of a joint of a model as they are stamped, late by its clock_offset."""
    late_s = float(parameters[ROW["clock_offset.offset_s"], joint])
    if late_s == 0.0:
        return pressure_pa
    at = np.arange(len(pressure_pa), dtype=np.float64)
    return np.asarray(np.interp(at - late_s / period_s, at, pressure_pa))


def read_angle(hand: Hand, angle_rad: Array) -> Array:
    """What the driver measures (..., joints) [rad] at true angles (..., joints) [rad], by the calibration line."""
    read: Array = hand.sensors.angle_line.angle_rad(hand.sensors.hall.ratio(angle_rad))
    return read
