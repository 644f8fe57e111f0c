"""Frames are missing from the recording."""

from __future__ import annotations

from hand_model.effects.effect import Effect

EFFECT = Effect(
    "dropped_frames",
    "timing",
    (),
    (),
    "frames are missing",
    (),
    "Seen in the stamps themselves; the data check reports it.",
    "definition",
    everywhere=True,
)
