"""The shipped hand, and files made from its text with one thing changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_model.lanes import LANES, idle_parameters, map_lanes
from hand_model.plant import STATES, Plant

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
Variant = Callable[..., Path]


@pytest.fixture(scope="session")
def hand() -> Hand:
    return load_hand(CONFIG)


@pytest.fixture
def variant(tmp_path: Path) -> Variant:
    """A file like hand.yaml with the first occurrence of each `old` replaced by its `new`."""

    def write(*changes: tuple[str, str]) -> Path:
        text = CONFIG.read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text, f"{old!r} is not in {CONFIG.name}"
            text = text.replace(old, new, 1)
        path = tmp_path / "hand.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


class OneJoint:
    """One joint (or a coupled pair) alone in the kernel, described by what differs from the shipped distal joint."""

    def __init__(self, hand: Hand) -> None:
        self._base = hand.parameters[:, [hand.joints.index("index_distal")]].copy()
        self._base[ROW["dynamics.coupling_inertia_kg_m2"]] = 0.0

    def parameters(self, joints: int = 1, **changes: ArrayLike) -> Array:
        """(rows, joints) in SI; a change is named by its key with a double underscore for the dot."""
        values = np.repeat(self._base, joints, axis=1)
        for name, value in changes.items():
            values[ROW[name.replace("__", ".")]] = value
        return values

    def run(
        self,
        commands: Array,
        period_s: float = 0.005,
        state: Array | None = None,
        partner: tuple[int, ...] | None = None,
        **changes: ArrayLike,
    ) -> Array:
        """States (samples + 1, STATES, joints), the first one included, under commands (samples, joints) [Pa]."""
        joints = commands.shape[1]
        lanes = map_lanes(np.array(partner or [-1] * joints))
        start = np.zeros((STATES, joints)) if state is None else state
        par = lanes.scatter(self.parameters(joints, **changes), idle_parameters())
        plant = Plant(par, lanes.scatter(start, np.zeros(STATES)), period_s)
        spread = np.zeros((lanes.blocks, len(commands), LANES))
        spread[lanes.block, :, lanes.lane] = commands.T
        states = plant.advance(spread)[lanes.block, :, :, lanes.lane].transpose(1, 2, 0)
        return np.concatenate([start[None], states])


@pytest.fixture(scope="session")
def joint(hand: Hand) -> OneJoint:
    return OneJoint(hand)
