"""The style of the figures: size and colours; no window is opened."""

from __future__ import annotations

from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

INK, BLUE, RED, PURPLE, GREY = "#1a1a1a", "#1f6f9f", "#c0392b", "#9933ee", "#888888"


SHOWN = 2000
"""Most samples of a curve on the page."""


def nth_shown(samples: int) -> int:
    """Distance of the samples that the page shows."""
    return max(1, -(-samples // SHOWN))


def panels(
    rows: int = 1, columns: int = 1, width: float = 8.0, height: float = 3.6, **options: Any
) -> tuple[Figure, Any]:
    """A figure of width and height [inch] without a window, and its axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, **options)
    for axis in axes.flat if hasattr(axes, "flat") else [axes]:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(alpha=0.25, lw=0.6)
    return figure, axes
