"""The shipped hand, and files made from its text with one thing changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.rows import ROW, STATES, STEP_S

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
        step_s: float = STEP_S,
        **changes: ArrayLike,
    ) -> Array:
        """States (samples + 1, STATES, joints), the first one included, under commands (samples, joints) [Pa]."""
        joints = commands.shape[1]
        start = np.zeros((STATES, joints)) if state is None else state
        parameters = self.parameters(joints, **changes)[None]
        coupled = np.array(partner or [-1] * joints)
        loop = ClosedLoop(parameters, coupled, start[None], period_s, step_s=step_s)
        return np.concatenate([start[None], loop.advance(commands[None])[0]])


@pytest.fixture(scope="session")
def joint(hand: Hand) -> OneJoint:
    return OneJoint(hand)
