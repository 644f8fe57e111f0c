"""Measured and modelled angle of one joint over time, as a plot in the panel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser
from viser import uplot

from hand_model.arrays import Array

POINTS = 400
"""Points of a curve; more are not seen in a plot of this width."""
COLORS = ("#808080", "#0072b2", "#009e73")
"""Measured, model, another model: distinct for the colour blind (Okabe and Ito 2008), 3:1 on white and on dark."""


class Curves:
    """One plot in degrees."""

    def __init__(self, gui: viser.GuiApi, joints: Sequence[str], names: Sequence[str], first: int = 3) -> None:
        """Add the choice of the joint and the plot. names: of the curves.  first: index of the joint shown first."""
        self._joints = list(joints)
        self._choice = gui.add_dropdown("joint", tuple(joints), initial_value=joints[min(first, len(joints) - 1)])
        series = [uplot.Series(label="time s")]
        series += [uplot.Series(label=name, stroke=color, width=2) for name, color in zip(names, COLORS, strict=False)]
        self._names, self._off = list(names), gui.add_html("")
        empty = np.zeros(2)
        self._plot = gui.add_uplot(
            (np.array([0.0, 1.0]), *(empty for _ in names)),
            tuple(series),
            scales={"x": uplot.Scale(time=False)},
            axes=(uplot.Axis(label="s", size=44), uplot.Axis(label="degrees", size=56)),
            aspect=1.5,
        )

    @property
    def joint(self) -> int:
        """Index of the joint that is shown."""
        return self._joints.index(self._choice.value)

    def show(self, time_s: Array, *angles_rad: Array) -> None:
        """Draw curves (T,) [rad] over times (T,) [s], the measured one first, and state how far the others are off."""
        if len(time_s) < 2:
            return
        rows = np.unique(np.linspace(0, len(time_s) - 1, POINTS).astype(int))
        self._plot.data = (time_s[rows], *(np.degrees(angle[rows]) for angle in angles_rad))
        off = [_rms_deg(angle - angles_rad[0]) for angle in angles_rad[1:]]
        texts = [f"{name}: {value:.2f} deg" for name, value in zip(self._names[1:], off, strict=True)]
        self._off.content = f'<div style="padding:0 0.8em;font-size:0.85em">RMS difference: {", ".join(texts)}</div>'


def _rms_deg(difference_rad: Array) -> float:
    known = difference_rad[np.isfinite(difference_rad)]
    return float(np.degrees(np.sqrt(np.mean(known**2)))) if len(known) else np.nan
