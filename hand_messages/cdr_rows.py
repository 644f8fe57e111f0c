"""Many messages of one fixed layout at once: bytes of a recording to arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_messages.cdr import NS, SPARE_BYTES, Columns, Layout, record_type

Bytes = NDArray[np.uint8]


class RowDecoder:
    """Decodes messages given as rows: contiguous bytes (N, row_size), one message each from its first byte.

    row_size is the layout's size rounded up to 8; the bytes behind the message are not looked at.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.row_size = -(-layout.size // 8) * 8
        self._dtype = record_type(layout.slots, self.row_size)
        mask = np.zeros(self.row_size, np.uint8)
        for start, stop in layout.segments:
            mask[start:stop] = 0xFF
        used = np.flatnonzero(mask.view(np.uint64))
        self._span = slice(int(used[0]), int(used[-1]) + 1)
        self._mask = mask.view(np.uint64)[self._span]
        template = np.frombuffer(layout.template.ljust(self.row_size, b"\x00"), np.uint64)
        self._constants = template[self._span] & self._mask

    def fits(self, sizes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which messages (N,) of these sizes [bytes] can have the layout at all."""
        spare = sizes - self.layout.size
        return (spare >= 0) & (spare <= SPARE_BYTES)

    def matching(self, rows: Bytes) -> NDArray[np.bool_]:
        """Which rows have the layout, as bool (N,)."""
        differing = (rows.view(np.uint64)[:, self._span] ^ self._constants) & self._mask
        good: NDArray[np.bool_] = np.bitwise_or.reduce(differing, axis=1) == 0
        return good

    def extract(self, rows: Bytes) -> Columns:
        """Values by key of rows that match: times int64 ns (N,), numbers (N,), lists (N, length)."""
        records = rows.view(self._dtype)[:, 0]
        return {slot.key: _column(records[slot.key]) for slot in self.layout.slots}


def decode_many(layout: Layout, messages: Sequence[bytes]) -> tuple[Columns, NDArray[np.bool_]]:
    """Decode messages in one pass.

    Returns the values by key (see RowDecoder.extract) of those that have the layout, and which ones they
    are, as bool (N,).
    """
    decoder = RowDecoder(layout)
    fits = decoder.fits(np.fromiter(map(len, messages), np.int64, len(messages)))
    filler = bytes(decoder.row_size - layout.size)
    packed = b"".join(raw[: layout.size] + filler for raw, fit in zip(messages, fits, strict=True) if fit)
    rows = np.frombuffer(packed, np.uint8).reshape(-1, decoder.row_size)
    good = decoder.matching(rows)
    fits[fits] = good
    return decoder.extract(rows[good]), fits


def _column(field: NDArray[Any]) -> NDArray[Any]:
    """A field of a record array as values of their own: times joined to ns, flags as bool."""
    if field.dtype.names:
        times: NDArray[np.int64] = field["sec"].astype(np.int64) * NS + field["nanosec"]
        return times
    if field.dtype == np.bool_:
        flags: NDArray[np.bool_] = field.view(np.uint8) != 0
        return flags
    return np.ascontiguousarray(field)
