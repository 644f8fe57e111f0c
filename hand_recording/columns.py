"""The messages of one topic as arrays with a column for each name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from hand_messages.cdr import NS, Layout, LayoutError, RowDecoder
from hand_messages.layouts import MessageSpec
from hand_recording.batches import Batch
from hand_recording.message_types import typestore_of
from hand_recording.recording_files import RecordingError

Columns = dict[str, NDArray[Any]]
BLOCK = 4096  # rows decoded at once, so that they stay in the processor's cache
MAX_LAYOUTS = 4  # layouts of a topic; messages with other layouts are decoded one by one


@dataclass(frozen=True, kw_only=True)
class TopicData:
    """A topic of N messages in order of their log times.

    stamp_ns, log_ns, publish_ns: int64 (N,), header stamp (of /clock: its time), time of receipt, time of sending.
    names: J joints, sensor sites or ADC channel numbers.  fields: by name, in the message's units, (N, J) where the
    message has a list and (N,) where it has a number; NaN (flags: False) where a message does not list the name.
    malformed: number of messages left out because they do not decode, or their lists do not fit their names.
    """

    name: str
    type: str
    names: tuple[str, ...]
    stamp_ns: NDArray[np.int64]
    log_ns: NDArray[np.int64]
    publish_ns: NDArray[np.int64]
    fields: Columns
    malformed: int

    def __getitem__(self, field: str) -> NDArray[Any]:
        """The values of a field."""
        return self.fields[field]

    def __len__(self) -> int:
        """Number of messages."""
        return len(self.stamp_ns)


@dataclass(frozen=True)
class _Block:
    """Decoded messages with the same names."""

    names: tuple[str, ...]
    values: Columns
    log_ns: NDArray[np.int64]
    publish_ns: NDArray[np.int64]


class TopicDecoder:
    """Decodes the batches of a topic into one TopicData."""

    def __init__(self, name: str, spec: MessageSpec) -> None:
        self._name = name
        self._spec = spec
        self._decoders: list[RowDecoder] = []
        self._blocks: list[_Block] = []
        self._malformed = 0
        self._lists = [f for f, kind in spec.fields if kind.endswith("[]") and kind != "string[]"]
        self._named_by = "name" if any(f == "name" for f, _ in spec.fields) else "channel"

    def add(self, batch: Batch) -> None:
        """Decode a batch: by the known layouts, by layouts read from its own messages, and the others one by one."""
        others = np.arange(len(batch.starts))
        for decoder in self._decoders:
            others = self._fixed(decoder, batch, others)
        while others.size and len(self._decoders) < MAX_LAYOUTS:
            try:
                decoder = RowDecoder(Layout.like(self._spec, batch.message(int(others[0]))))
            except LayoutError:
                break
            self._decoders.append(decoder)
            others = self._fixed(decoder, batch, others)
        for index in others:
            self._ordinary(batch, int(index))

    def _fixed(self, decoder: RowDecoder, batch: Batch, indices: NDArray[np.intp]) -> NDArray[np.intp]:
        """Decode the messages that have the layout; returns the indices of the others."""
        fits = decoder.fits(batch.sizes[indices])
        if not fits.any():
            return indices
        windows = sliding_window_view(batch.buffer, decoder.row_size)
        left = [indices[~fits]]
        indices = indices[fits]
        for first in range(0, len(indices), BLOCK):
            some = indices[first : first + BLOCK]
            rows = windows[batch.starts[some]]
            good = decoder.matching(rows)
            if not good.all():
                left.append(some[~good])
                rows, some = rows[good], some[good]
            if len(some):
                self._append(decoder.layout.names, decoder.extract(rows), batch, some)
        return np.sort(np.concatenate(left))

    def _ordinary(self, batch: Batch, index: int) -> None:
        """Decode one message by rosbags."""
        try:
            message: Any = typestore_of(self._spec.type).deserialize_cdr(batch.message(index), self._spec.type)
        except SerdeError:
            self._malformed += 1
            return
        values: Columns = {}
        for field, kind in self._spec.fields:
            value = getattr(message, field)
            if kind in ("header", "time", "duration"):
                time = value.stamp if kind == "header" else value
                values["stamp_ns" if kind == "header" else f"{field}_ns"] = np.array([time.sec * NS + time.nanosec])
            elif kind != "string[]":
                array = np.asarray(value)[np.newaxis]
                values[field] = array.astype(array.dtype.newbyteorder("="), copy=False)
        self._append(tuple(getattr(message, "name", ())), values, batch, np.array([index]))

    def _append(self, names: tuple[str, ...], values: Columns, batch: Batch, indices: NDArray[np.intp]) -> None:
        """Keep decoded messages whose lists fit their names. Raises RecordingError where the ADC channels change."""
        if self._named_by == "channel" and "channel" in values:
            channels = values.pop("channel")
            if (channels != channels[0]).any():
                raise RecordingError(f"{self._name}: the list of ADC channels changes within the recording")
            names = tuple(map(str, channels[0].tolist()))
        lengths = {values[field].shape[1] for field in self._lists if field in values}
        if len(set(names)) < len(names) or not lengths <= {len(names), 0}:
            self._malformed += len(indices)
            return
        self._blocks.append(_Block(names, values, batch.log_ns[indices], batch.publish_ns[indices]))

    def finish(self) -> TopicData:
        """All messages in the order of their log times. Raises RecordingError where none could be decoded."""
        if self._malformed and not self._blocks:
            raise RecordingError(f"{self._name}: none of its {self._malformed} messages decodes as {self._spec.type}")
        names = tuple(dict.fromkeys(name for block in self._blocks for name in block.names))
        log_ns = _joined([block.log_ns for block in self._blocks])
        order = None if (np.diff(log_ns) >= 0).all() else np.argsort(log_ns, kind="stable")

        def arranged(parts: list[NDArray[Any]]) -> NDArray[Any]:
            return _joined(parts) if order is None else _joined(parts)[order]

        keys = list(self._blocks[0].values) if self._blocks else []
        fields = {key: arranged([self._spread(block, key, names) for block in self._blocks]) for key in keys}
        stamp_ns = fields.pop("stamp_ns", None)
        stamp_ns = fields.pop("clock_ns", np.empty(0, np.int64)) if stamp_ns is None else stamp_ns
        publish_ns = arranged([block.publish_ns for block in self._blocks])
        return TopicData(
            name=self._name,
            type=self._spec.type,
            names=names,
            stamp_ns=stamp_ns,
            log_ns=arranged([log_ns]),
            publish_ns=publish_ns,
            fields=fields,
            malformed=self._malformed,
        )

    def _spread(self, block: _Block, key: str, names: tuple[str, ...]) -> NDArray[Any]:
        """The values of a block with a column for each of `names`."""
        values = block.values[key]
        if key not in self._lists or (block.names == names and values.shape[1] == len(names)):
            return values
        if values.dtype.kind == "u":
            raise RecordingError(f"{self._name}: the list of ADC channels changes within the recording")
        blank: Any = False if values.dtype == np.bool_ else np.nan
        full = np.full((len(values), len(names)), blank, values.dtype)
        if values.shape[1]:
            full[:, [names.index(name) for name in block.names]] = values
        return full


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """The concatenated parts."""
    if not parts:
        return np.empty(0, np.int64)
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
