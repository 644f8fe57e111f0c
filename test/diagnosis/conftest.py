"""The shipped hand, for all tests of this folder."""

from __future__ import annotations

import pytest

from hand_model.description import Hand, load_hand
from test.diagnosis.recordings import CONFIG


@pytest.fixture(scope="session")
def hand() -> Hand:
    return load_hand(CONFIG)
