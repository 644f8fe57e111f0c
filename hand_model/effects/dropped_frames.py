"""Frames are missing from the recording. The check of the data reports it; no equation is needed."""

from __future__ import annotations

from hand_model.effects.effect import Effect

EFFECT = Effect(
    name="dropped_frames",
    place="timing",
    says="frames are missing",
    doc="Seen in the stamps themselves; the data check reports it.",
    source="definition",
    everywhere=True,
)
