"""Frames are missing from the recording. The check of the data reports it; no equation is needed."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect

EFFECT = Effect(
    name="dropped_frames",
    place="timing",
    says="frames are missing",
    doc="Seen in the stamps themselves; the data check reports it.",
    source="definition",
    everywhere=True,
    constitution=Constitution(
        acts_on="samples that arrive",
        sign="fewer than sent",
        monotone="a count",
        over=("time",),
        source="sequence numbers of the frames",
    ),
)
