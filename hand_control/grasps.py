"""Grasps: shapes from config/grasps.yaml, and the motion of one grasp.

The hand takes the pattern's preshape first, for instance the thumb opposite to the fingers. Then the joints close until
each meets an obstacle or reaches its shape, and hold a torque; a pattern may let some of them begin later than others.
A closing joint moves with a small torque limit, so that a soft object is touched softly. Where a joint meets an
obstacle, its target moves on into the obstacle and its torque limit rises to the wanted one: the pressure ceiling then
holds that torque, independent of the obstacle's stiffness. Joints that meet nothing stop at the shape.
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
PRESHAPE, BEGINS = "preshape", "begins"
"""Keys of a pattern other than joints."""
MOST_LATE = 0.9
PATIENCE_S = 4.0
"""Time after the motion within which a grasp must settle."""


@dataclass(frozen=True, slots=True)
class Grasp:
    """A shape: open_rad and closed_rad (n,) in the hand's order.

    ready_rad: (n,) angles of the preshape, NaN for joints without one; None: no joint has one.
    begins: (n,) share of the closing time after which a joint begins to move, 0 to MOST_LATE; None: all at once.
    """

    name: str
    open_rad: Array
    closed_rad: Array
    ready_rad: Array | None = None
    begins: Array | None = None

    def shape(self, closure: float) -> Array:
        """Angles (n,) [rad] at a closure from 0 (open) to 1 (closed). ValueError outside that range."""
        if not 0.0 <= closure <= 1.0:
            raise ValueError(f"closure is {closure!r}; the allowed range is 0 to 1")
        return self.open_rad + closure * (self.closed_rad - self.open_rad)

    def preshape(self, closure: float) -> Array:
        """Angles (n,) [rad] of the preshape at a closure from 0 to 1 [-]; NaN for joints without one."""
        if self.ready_rad is None:
            return np.full(len(self.open_rad), np.nan)
        return self.open_rad + closure * (self.ready_rad - self.open_rad)

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
    keys = [*(joint.removeprefix(hand.prefix) for joint in hand.joints), PRESHAPE, BEGINS]
    return {name: _grasp(name, patterns.section(name, keys), hand, open_deg) for name in names}


def _grasp(name: str, section: Section, hand: Hand, open_deg: float) -> Grasp:
    low, high = np.degrees(hand.limits.low_rad), np.degrees(hand.limits.high_rad)
    bare = [joint.removeprefix(hand.prefix) for joint in hand.joints]
    closed = np.array([section.number(joint, low[i], high[i], open_deg) for i, joint in enumerate(bare)])
    preshape = section.section(PRESHAPE, bare, required=False)
    least, most = np.minimum(open_deg, closed), np.maximum(open_deg, closed)
    ready = [
        preshape.number(joint, least[i], most[i]) if joint in preshape else math.nan for i, joint in enumerate(bare)
    ]
    late = section.section(BEGINS, bare, required=False)
    begins = np.array([late.number(joint, 0.0, MOST_LATE, 0.0) for joint in bare])
    return Grasp(name, np.radians(np.full(len(bare), open_deg)), np.radians(closed), np.radians(ready), begins)


class Outcome(Enum):
    """How a grasp ended."""

    RUNNING = "running"
    DONE = "done"
    TIMED_OUT = "timed out"


@dataclass(frozen=True, slots=True)
class Approach:
    """How a hand closes: speed [rad/s] of the fastest joint, torque [N m] until contact.

    preshape_rad, begins: as Grasp.preshape gives them and as Grasp.begins; None: none, all at once.
    """

    speed_rad_s: float
    torque_nm: float
    preshape_rad: Array | None = None
    begins: Array | None = None


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
        ready = np.full(count, np.nan) if approach.preshape_rad is None else approach.preshape_rad
        # A joint that is closer to its shape already does not go back.
        ready = np.clip(ready, np.minimum(start_rad, shape_rad), np.maximum(start_rad, shape_rad))
        self._ready = np.where(np.isnan(ready), start_rad, ready)
        self._begins = np.zeros(count) if approach.begins is None else approach.begins
        ways = np.abs(self._ready - start_rad), np.abs(shape_rad - self._ready) / (1.0 - self._begins)
        self._preshape_s, closing_s = (float(way.max()) / approach.speed_rad_s for way in ways)
        self._duration_s = self._preshape_s + max(closing_s, 0.05)
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
        target = self._on_the_way()
        into = np.minimum(self._met_rad + PRESS_RAD, self._high)
        target = np.where(self.contact, into, target)
        rising = np.minimum(self._since_s / RISE_S, 1.0)
        arrived = self.progress >= 1.0
        free_limit = self._hold_nm if arrived else np.where(self._closes, self._approach_nm, self._hold_nm)
        limit = np.where(self.contact, self._approach_nm + rising * (self._hold_nm - self._approach_nm), free_limit)
        self._check_end(dt, position)
        return target, limit

    def _on_the_way(self) -> Array:
        """Angles (n,) [rad] of joints without contact now: to the preshape, and from there to the shape."""
        if self._elapsed_s < self._preshape_s:
            return self._start + self._elapsed_s / self._preshape_s * (self._ready - self._start)
        closing = min((self._elapsed_s - self._preshape_s) / (self._duration_s - self._preshape_s), 1.0)
        share = np.clip((closing - self._begins) / (1.0 - self._begins), 0.0, 1.0)
        return self._ready + share * (self._shape - self._ready)

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
