"""Compile, or load from the cache, all that the controller calls, so that its first frames are not late."""

from __future__ import annotations

import numpy as np

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_model.description import Hand


def warm_up(hand: Hand, settings: Settings) -> None:
    """Three frames of a controller that nobody else sees; takes half a minute where nothing is in the cache."""
    zero = np.zeros(len(hand.joints))
    rehearsal = Controller(hand, settings)
    rehearsal.enable(True)
    for stamp_ns in (1, 2, 3):
        rehearsal.frame(Times(stamp_ns, stamp_ns, stamp_ns), zero, zero, zero)
