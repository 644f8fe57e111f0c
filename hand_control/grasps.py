"""Grasps: named patterns of joint angles between open and closed, config/grasps.yaml.

A closure of 0 gives a pattern's open angles, 1 its closed ones, between them in proportion, joint by joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_model.description import Hand
from hand_model.yaml_reader import Section, read_yaml

Array = NDArray[np.float64]

_TOP = ("schema", "open_deg", "patterns")
_PATTERN = ("open_deg", "closed_deg")


@dataclass(frozen=True, slots=True)
class Grasp:
    """A pattern: open and closed angles, (n,) each, in the hand's order [rad]."""

    name: str
    open_rad: Array
    closed_rad: Array

    def shape(self, closure: float) -> Array:
        """Angles (n,) [rad] at a closure of 0 (open) ... 1 (closed); ValueError for any other."""
        if not 0.0 <= closure <= 1.0:
            raise ValueError(f"grasp {self.name}: closure is {closure:g}; the allowed range is 0 to 1")
        return (1.0 - closure) * self.open_rad + closure * self.closed_rad


def load_grasps(path: str | Path, hand: Hand) -> dict[str, Grasp]:
    """Read the patterns for a hand; joints are named without the hand's prefix.

    Raises DescriptionError, one line with file, key, value and allowed range.
    """
    joints = [joint.removeprefix(hand.prefix) for joint in hand.joints]
    top = read_yaml(Path(path), _TOP)
    top.integer("schema", 1, 1)
    everywhere = top.section("open_deg", joints)
    _angles(everywhere, hand, joints)
    allowed = "a mapping with at least one pattern"
    names = top.raw("patterns", allowed)
    if not isinstance(names, dict) or not names:
        raise top.error("patterns", f"is {'empty' if names == {} else 'no mapping'}; it must be {allowed}")
    patterns = top.section("patterns", list(names))
    return {name: _grasp(name, patterns.section(name, _PATTERN), everywhere, hand, joints) for name in names}


def _grasp(name: str, pattern: Section, everywhere: Section, hand: Hand, joints: list[str]) -> Grasp:
    """One pattern: its own open angles lie over those of all, its closed angles over the open ones."""
    opened = pattern.section("open_deg", joints, required=False).over(everywhere)
    closed = pattern.section("closed_deg", joints).over(opened)
    return Grasp(name, _angles(opened, hand, joints), _angles(closed, hand, joints))


def _angles(section: Section, hand: Hand, joints: list[str]) -> Array:
    """One angle a joint, (n,) [rad], inside the hand's limits."""
    low, high = hand.limits.low_rad, hand.limits.high_rad
    # Degrees of a limit that was converted to radians carry rounding.
    bounds = np.round(np.degrees([low, high]), 9).T
    angles = [section.number(joint, *bound) for joint, bound in zip(joints, bounds.tolist(), strict=True)]
    inside: Array = np.clip(np.radians(angles), low, high)
    return inside
