"""Fixtures of the tests with real nodes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from test.nodes.stack import Client, Stack


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Stack]:
    made = Stack(tmp_path)
    yield made
    made.stop_all()


@pytest.fixture
def client() -> Iterator[Client]:
    made = Client()
    yield made
    made.close()
