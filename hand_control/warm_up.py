"""Compile, or load from the cache, all that the controller calls, so that its first frames are not late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_model.description import Hand


def warm_up(hand: Hand, settings: Settings) -> None:
    """Three frames of a controller that nobody else sees; takes half a minute where nothing is in the cache.

    Force sensors and tolerances are on, because a parameter may switch them on while the hand moves.
    """
    zero = np.zeros(len(hand.joints))
    rehearsal = Controller(hand, replace(settings, force_sensors=True, path_tolerance_deg=1.0))
    rehearsal.enable(True)
    for stamp_ns in (1, 2, 3):
        rehearsal.forces(stamp_ns, np.zeros(len(hand.sensors.sites)))
        rehearsal.frame(Times(stamp_ns, stamp_ns, stamp_ns), zero, zero, zero)
