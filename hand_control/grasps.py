"""Grasp shapes from config/grasps.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.yaml_loader import load_yaml
from hand_model.yaml_reader import Section


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


def load_grasps(path: Path, hand: Hand) -> dict[str, Grasp]:
    """Shapes by name. Raises DescriptionError, one line, for an unknown joint or an angle it cannot reach."""
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
