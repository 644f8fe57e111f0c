"""The shipped hand, and files made from its text with one thing changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from hand_model.description import Hand, load_hand

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
