"""Plots that a page draws itself (plots.js): curves in panels over one axis, with their data inside the page."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
Kind = Literal["measured", "before", "after", "third", "quiet"]
"""Colour and dash of a curve: both differ, so that colours are not needed."""
STEPS = 65533
"""Steps between the least and the largest value of a packed curve; -32768 stands for a missing value."""
MISSING = -32768


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve. x: (n,) rising, or (start, step) of a uniform axis.  y: (n,), NaN where there is none.

    low, high: (n,) ends of a band around it.  name: the same name in several panels is one switch.
    variants: (n,) each, in place of y where switches of the plot are off, see Plot.
    """

    name: str
    kind: Kind
    x: Values | tuple[float, float]
    y: Values
    low: Values | None = None
    high: Values | None = None
    dots: bool = False
    variants: Sequence[Values] = ()

    def document(self, axis: int) -> dict[str, Any]:
        """For plots.js. axis: number of its axis among those of the plot."""
        ends = {"low": self.low, "high": self.high}
        kind = f"{self.kind} dots" if self.dots else self.kind
        content: dict[str, Any] = {"name": self.name, "kind": kind, "axis": axis, "y": packed(self.y)}
        if self.variants:
            content["variants"] = [packed(variant) for variant in self.variants]
        return content | {name: _rounded(end) for name, end in ends.items() if end is not None}


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves over one axis. label: what is drawn, with its unit.  height: relative to other panels, 1 is low.

    noise: half the width of a band around 0 that noise fills, in the panel's unit.  zero: the axis contains 0.
    """

    label: str
    curves: Sequence[Curve]
    height: float = 3.0
    noise: float = 0.0
    zero: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """Panels over one axis. label: of this axis, with its unit.  alt: the result in a sentence, for who sees no plot.

    spans: (from, to, kind) shaded parts of the axis, kind "validation" or "test".  group: plots of one group are zoomed
    together.  switches: what can be switched off; variant m - 1 of a curve is shown for m, the sum of 2^k over the
    switches k that are off. A curve of the same name without variants is the first curve of all minus the one with
    them.  notes: a sentence for each m.
    """

    label: str
    panels: Sequence[Panel]
    alt: str
    caption: str = ""
    spans: Sequence[tuple[float, float, str]] = ()
    group: str = ""
    switches: Sequence[str] = ()
    notes: Sequence[str] = ()

    def json(self) -> str:
        """The content for plots.js; it cannot end the script element that contains it."""
        axes = _Axes()
        panels = [
            {
                "label": panel.label,
                "height": panel.height,
                "noise": panel.noise,
                "zero": panel.zero,
                "series": [curve.document(axes.number(curve.x)) for curve in panel.curves],
            }
            for panel in self.panels
        ]
        spans = [[round(begin, 4), round(end, 4), kind] for begin, end, kind in self.spans]
        content = {"label": self.label, "group": self.group, "spans": spans, "axes": axes.documents, "panels": panels}
        content |= {"switches": list(self.switches), "notes": list(self.notes)}
        return script_json(content)


def script_json(content: Any) -> str:
    """JSON that cannot end the script element that contains it. ValueError for NaN and infinite numbers."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return text.replace("<", "\\u003c")


class _Axes:
    """The different axes of a plot's curves, each stored once."""

    def __init__(self) -> None:
        self._numbers: dict[bytes | tuple[float, float], int] = {}
        self.documents: list[Any] = []

    def number(self, x: Values | tuple[float, float]) -> int:
        """Number of an axis among those stored; one that is not yet there is added."""
        key = x if isinstance(x, tuple) else x.tobytes()
        if key not in self._numbers:
            self._numbers[key] = len(self.documents)
            self.documents.append({"start": x[0], "step": x[1]} if isinstance(x, tuple) else _rounded(x))
        return self._numbers[key]


def packed(values: Values) -> list[float | None] | dict[str, Any]:
    """Values (n,) for plots.js: short ones as a list, long ones as 16-bit integers in base 64; NaN is a gap."""
    known = np.isfinite(values)
    if len(values) < 64 or not known.any():
        return [float(f"{y:.6g}") if ok else None for y, ok in zip(values, known, strict=True)]
    low, high = float(values[known].min()), float(values[known].max())
    scale = (high - low) / STEPS or 1.0
    offset = low + 32767 * scale
    counts = np.full(len(values), MISSING, dtype="<i2")
    counts[known] = np.clip(np.round((values[known] - offset) / scale), -32767, 32767)
    return {"scale": scale, "offset": offset, "int16": base64.b64encode(counts.tobytes()).decode("ascii")}


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last index of each run of True in flags (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def _rounded(values: Values) -> list[float]:
    return [float(f"{value:.6g}") for value in values]
