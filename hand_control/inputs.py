"""Messages of joints as arrays in the hand's own order, whatever order the sender has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hand_messages.bounds import MAX_NAMES, check_bytes, listed, shown
from hand_messages.cdr import Layout
from hand_messages.layouts import MessageSpec
from hand_model.arrays import Array


class JointInput:
    """Reads one topic; the sender's layout is learnt from its first message and whenever it changes."""

    def __init__(self, spec: MessageSpec, joints: Sequence[str], fields: Sequence[str]) -> None:
        """Take these fields of messages of type spec for these joints."""
        self._spec = spec
        self._joints = tuple(joints)
        self._fields = tuple(fields)
        self._layout: Layout | None = None
        self._order: NDArray[np.int64] = np.arange(len(joints))

    def read(self, raw: bytes) -> tuple[int, list[Array]]:
        """Stamp [ns] and the fields, (joints,) each, of a serialized message. ValueError: one line."""
        if self._layout is None or not self._layout.matches(raw):
            check_bytes(len(raw))
            self._layout = self._learn(Layout.like(self._spec, raw, MAX_NAMES))
        values = self._layout.decode(raw)
        return values["stamp_ns"], [values[field][self._order] for field in self._fields]

    def _learn(self, layout: Layout) -> Layout:
        names = layout.names
        index = {name: column for column, name in enumerate(names)}
        missing = [joint for joint in self._joints if joint not in index]
        if missing:
            raise ValueError(f"joint {missing[0]!r} is missing; the message has {listed(names) or 'no joints'}")
        if len(index) < len(names):
            twice = next(name for column, name in enumerate(names) if index[name] != column)
            raise ValueError(f"joint {shown(twice)} appears twice")
        for field in self._fields:
            if layout.shape.lengths[field] != len(names):
                raise ValueError(f"{layout.shape.lengths[field]} values of {field} for {len(names)} joints")
        self._order = np.array([index[joint] for joint in self._joints], dtype=np.int64)
        return layout
