"""Measured and modelled angle, pressure and force of one joint over time, as plots in the panel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from viser import uplot

from hand_model.arrays import Array

POINTS = 400
"""Points of a curve; more are not seen in a plot of this width."""
COLORS = ("#808080", "#0072b2", "#009e73")
"""Measured, model, another model: distinct for the colour blind (Okabe and Ito 2008), 3:1 on white and on dark."""

WIDTHS = (6, 2, 2)
"""Widths of their lines: the measured curve is seen also where a model lies on it."""
PADDING = (10, 24, 0, 0)
"""Around a plot [pixels]: a number at the top of its axis is drawn whole."""
OFF_EM = 3.0
"""Height of the line below, which may need two: its numbers do not move what is below it."""
KINDS = (("angle", "degrees", "deg", np.degrees(1.0)), ("pressure", "bar", "bar", 1e-5), ("force", "N", "N", 1.0))
"""Name, label of the axis, unit and factor from SI of each plot."""


class Curves:
    """One plot for each kind of signal, one below the other; that of the force only where the joint has a sensor."""

    def __init__(self, gui: viser.GuiApi, joints: Sequence[str], names: Sequence[str], first: int = 3) -> None:
        """Add the choice of the joint and the plots. names: of the curves.  first: index of the joint shown first."""
        self._joints, self._names = list(joints), list(names)
        self._choice = gui.add_dropdown("joint", tuple(joints), initial_value=joints[min(first, len(joints) - 1)])
        self._off = gui.add_html("")
        self._plots = [self._plot(gui, f"{name} {label}", 1.5 if name == "angle" else 2.2) for name, label, *_ in KINDS]
        self._plots[-1].visible = False

    def _plot(self, gui: viser.GuiApi, label: str, aspect: float) -> Any:
        series = [uplot.Series(label="time s")]
        drawn = zip(self._names, COLORS, WIDTHS, strict=False)
        series += [uplot.Series(label=name, stroke=color, width=width) for name, color, width in drawn]
        return gui.add_uplot(
            (np.array([0.0, 1.0]), *(np.zeros(2) for _ in self._names)),
            tuple(series),
            scales={"x": uplot.Scale(time=False)},
            axes=(uplot.Axis(label="s", size=44), uplot.Axis(label=label, size=56)),
            aspect=aspect,
            padding=PADDING,
        )

    @property
    def joint(self) -> int:
        """Index of the joint that is shown."""
        return self._joints.index(self._choice.value)

    def show(self, time_s: Array, *signals: Sequence[Array]) -> None:
        """Draw signals over times (T,) [s], and state how far the models are off.

        signals: in the order of KINDS, each with a curve (T,) in SI for every name, the measured one first; fewer than
        KINDS where there is no force.
        """
        if len(time_s) < 2:
            return
        rows = np.unique(np.linspace(0, len(time_s) - 1, POINTS).astype(int))
        lines = []
        for plot, (kind, _, unit, factor), curves in zip(self._plots, KINDS, signals, strict=False):
            plot.data = (time_s[rows], *(factor * curve[rows] for curve in curves))
            off = zip(self._names[1:], (_rms(factor * (curve - curves[0])) for curve in curves[1:]), strict=True)
            texts = ", ".join(f"{name}: {value:.2f} {unit}" for name, value in off)
            lines.append(texts if kind == "angle" else f"{kind}, {texts}")
        if self._plots[-1].visible != (len(signals) == len(KINDS)):
            self._plots[-1].visible = len(signals) == len(KINDS)
        text = "; ".join(lines)
        style = f"padding:0 0.8em;font-size:0.85em;min-height:{OFF_EM}em"
        self._off.content = f'<div style="{style}">RMS difference: {text}</div>'


def _rms(difference: Array) -> float:
    known = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else np.nan
