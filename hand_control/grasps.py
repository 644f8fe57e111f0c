"""Grasps: shapes from config/grasps.yaml, and the motion of one grasp.

The joints close together until each meets an obstacle or reaches its shape, and then hold a torque. A closing joint
moves with a small torque limit, so that a soft object is touched softly. Where a joint meets an obstacle, its target
moves on into the obstacle and its torque limit rises to the wanted one: the pressure ceiling then holds that torque,
independent of the obstacle's stiffness. Joints that meet nothing stop at the shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.yaml_loader import load_yaml
from hand_model.yaml_reader import Section

PRESS_RAD = math.radians(25.0)
"""How far into an obstacle the target of a joint moves, so that the torque limit determines what is held."""
RISE_S = 0.3
"""Time in which the torque limit of a joint in contact rises to the wanted one."""
SETTLED_RAD = math.radians(3.0)
SETTLED_S = 0.3
PATIENCE_S = 4.0
"""Time after the motion within which a grasp must settle."""


@dataclass(frozen=True, slots=True)
class Grasp:
    """A shape: open_rad and closed_rad (n,) in the hand's order."""

    name: str
    open_rad: Array
    closed_rad: Array

    def shape(self, closure: float) -> Array:
        """Angles (n,) [rad] at a closure from 0 (open) to 1 (closed). ValueError outside that range."""
        if not 0.0 <= closure <= 1.0:
            raise ValueError(f"closure is {closure!r}; the allowed range is 0 to 1")
        return self.open_rad + closure * (self.closed_rad - self.open_rad)

    def closure(self, position_rad: Array) -> float:
        """The closure [-] whose shape is nearest to angles (n,) [rad], by least squares; 0 for the open pattern."""
        span = self.closed_rad - self.open_rad
        size = float(span @ span)
        return float(span @ (position_rad - self.open_rad)) / size if size > 0.0 else 0.0


def load_grasps(path: Path, hand: Hand) -> dict[str, Grasp]:
    """Shapes by name. Raises DescriptionError, one line, for an unknown joint or an angle that it cannot reach."""
    low, high = np.degrees(hand.limits.low_rad), np.degrees(hand.limits.high_rad)
    data = load_yaml(path)
    top = Section(data, path, "", ("open_deg", "patterns"))
    open_deg = top.number("open_deg", float(low.max()), float(high.min()))
    raw = top.raw("patterns", "a mapping of pattern names")
    names = [str(name) for name in raw] if isinstance(raw, dict) else []
    patterns = top.section("patterns", names)
    bare = [joint.removeprefix(hand.prefix) for joint in hand.joints]
    return {name: _grasp(name, patterns.section(name, bare), hand, open_deg) for name in names}


def _grasp(name: str, section: Section, hand: Hand, open_deg: float) -> Grasp:
    low, high = np.degrees(hand.limits.low_rad), np.degrees(hand.limits.high_rad)
    bare = [joint.removeprefix(hand.prefix) for joint in hand.joints]
    closed = np.array([section.number(joint, low[i], high[i], open_deg) for i, joint in enumerate(bare)])
    return Grasp(name, np.radians(np.full(len(bare), open_deg)), np.radians(closed))


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
    """A running grasp. contact (n,): joints that hold an obstacle; progress 0 ... 1 of the motion."""

    def __init__(
        self, hand: Hand, shape_rad: Array, max_torque_nm: float, start_rad: Array, approach: Approach
    ) -> None:
        """Move from start_rad (n,) to shape_rad (n,); max_torque_nm 0 or NaN: the configured limits.

        Raises ValueError, one line, for a torque outside its range.
        """
        limits = hand.limits
        largest = float(limits.max_torque_nm.min())
        if not (math.isnan(max_torque_nm) or 0.0 <= max_torque_nm <= largest):
            raise ValueError(f"max_torque is {max_torque_nm:g} N m; the allowed range is 0 to {largest:g} N m")
        given = max_torque_nm > 0.0
        count = len(shape_rad)
        self._hold_nm = np.full(count, max_torque_nm) if given else limits.max_torque_nm.copy()
        self._approach_nm = np.minimum(approach.torque_nm, self._hold_nm)
        self._high = limits.high_rad
        self._start, self._shape = start_rad.copy(), shape_rad
        # An obstacle in the way of an opening joint is not grasped.
        self._closes = shape_rad > start_rad + SETTLED_RAD
        self._duration_s = max(float(np.max(np.abs(shape_rad - start_rad))) / approach.speed_rad_s, 0.05)
        self._elapsed_s = self._settled_s = 0.0
        self._since_s = np.zeros(count)
        self._met_rad = np.full(count, np.nan)
        self.contact: Flags = np.zeros(count, dtype=np.bool_)
        self.outcome = Outcome.RUNNING

    @property
    def progress(self) -> float:
        """Completed share of the motion, 0 ... 1 [-]."""
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
        self._check_end(dt, position)
        return target, limit

    def _check_end(self, dt: float, position: Array) -> None:
        at_shape = np.abs(position - self._shape) < SETTLED_RAD
        held = self.contact & (self._since_s > 2.0 * RISE_S)
        settled = self.progress >= 1.0 or bool(self.contact[self._closes].all())
        # A joint that met something near its shape has to hold its torque, too, before the grasp is done.
        resting = np.where(self.contact, held, at_shape)
        self._settled_s = self._settled_s + dt if settled and bool(np.all(resting)) else 0.0
        if self._settled_s > SETTLED_S:
            self.outcome = Outcome.DONE
        elif self._elapsed_s > self._duration_s + PATIENCE_S:
            self.outcome = Outcome.TIMED_OUT
