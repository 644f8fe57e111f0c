"""One grasp: the joints close together until each meets something or its shape, then hold a torque.

A joint that closes moves with little torque, so that a soft thing is met softly. Where it meets something, its target
moves on into the thing and its torque limit rises to the one asked for: the pressure ceiling then holds that torque,
however hard or soft the thing is. Joints that meet nothing stop at the shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from hand_control.grasps import Grasp
from hand_model.arrays import Array, Flags
from hand_model.description import Hand

PRESS_RAD = math.radians(25.0)
"""How far into a thing the target of a joint moves, so that the torque limit is what holds it."""
RISE_S = 0.3
"""Time in which the torque of a joint in contact rises to the limit."""
SETTLED_RAD = math.radians(3.0)
SETTLED_S = 0.3
PATIENCE_S = 4.0
"""After the motion, before a grasp that does not settle is given up."""


class Outcome(Enum):
    """How a grasp ended."""

    RUNNING = "running"
    DONE = "done"
    TIMED_OUT = "timed out"


@dataclass(frozen=True, slots=True)
class Approach:
    """How a hand closes: speed [rad/s] of the joint with the longest way, torque [N m] until contact."""

    speed_rad_s: float
    torque_nm: float


class Grasping:
    """A running grasp. contact (n,): joints that hold something; progress 0 ... 1 of the motion."""

    def __init__(
        self, hand: Hand, grasp: Grasp, closure: float, max_torque_nm: float, start_rad: Array, approach: Approach
    ) -> None:
        """From start_rad (n,) to a closure 0 ... 1; max_torque_nm 0 or NaN: the configured limits.

        Raises ValueError, one line, for a closure or torque outside its range.
        """
        limits = hand.limits
        shape = grasp.shape(closure)
        most = float(limits.max_torque_nm.min())
        if not (math.isnan(max_torque_nm) or 0.0 <= max_torque_nm <= most):
            raise ValueError(f"max_torque is {max_torque_nm:g} N m; the allowed range is 0 to {most:g} N m")
        given = max_torque_nm > 0.0
        self._hold_nm = np.full(len(shape), max_torque_nm) if given else limits.max_torque_nm.copy()
        self._approach_nm = np.minimum(approach.torque_nm, self._hold_nm)
        self._high = limits.high_rad
        self._start, self._shape = start_rad.copy(), shape
        # What stands in the way of opening is not grasped.
        self._closes = shape > start_rad + SETTLED_RAD
        self._duration_s = max(float(np.max(np.abs(shape - start_rad))) / approach.speed_rad_s, 0.05)
        self._elapsed_s = self._settled_s = 0.0
        self._since_s = np.zeros(len(shape))
        self._met_rad = np.full(len(shape), np.nan)
        self.contact: Flags = np.zeros(len(shape), dtype=np.bool_)
        self.outcome = Outcome.RUNNING

    @property
    def progress(self) -> float:
        """Share of the motion done, 0 ... 1."""
        return min(self._elapsed_s / self._duration_s, 1.0)

    def step(self, dt: float, position: Array, contact: Flags) -> tuple[Array, Array]:
        """Targets [rad] and torque limits [N m], (n,) each, after dt [s] at position (n,) [rad]."""
        self._elapsed_s += dt
        new = contact & self._closes & np.isnan(self._met_rad)
        self._met_rad[new] = position[new]
        self.contact = ~np.isnan(self._met_rad)
        self._since_s = np.where(self.contact, self._since_s + dt, 0.0)
        target = self._start + self.progress * (self._shape - self._start)
        into = np.minimum(self._met_rad + PRESS_RAD, self._high)
        target = np.where(self.contact, into, target)
        rising = np.minimum(self._since_s / RISE_S, 1.0)
        arrived = self.progress >= 1.0
        free_limit = self._hold_nm if arrived else np.where(self._closes, self._approach_nm, self._hold_nm)
        limit = np.where(self.contact, self._approach_nm + rising * (self._hold_nm - self._approach_nm), free_limit)
        self._judge(dt, position)
        return target, limit

    def _judge(self, dt: float, position: Array) -> None:
        at_shape = np.abs(position - self._shape) < SETTLED_RAD
        held = self.contact & (self._since_s > 2.0 * RISE_S)
        settled = self.progress >= 1.0 or bool(self.contact[self._closes].all())
        self._settled_s = self._settled_s + dt if settled and bool(np.all(at_shape | held)) else 0.0
        if self._settled_s > SETTLED_S:
            self.outcome = Outcome.DONE
        elif self._elapsed_s > self._duration_s + PATIENCE_S:
            self.outcome = Outcome.TIMED_OUT
