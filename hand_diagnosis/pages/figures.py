"""The figure of a joint: measured, simulated before and after, residuals over time and over the state that matters."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hand_diagnosis.diagnosis import JointDiagnosis
from hand_diagnosis.pages.page_plots import leading_stage, state_means

INK, BLUE, ORANGE, GREY, SHADE = "#1a1a1a", "#0067a5", "#b54708", "#888888", "#f0f0f0"


def joint_figure(joint: JointDiagnosis) -> Figure:
    """The signal that gained most, in the units of the hand or machine; validation data have a grey background."""
    stage = leading_stage(joint)
    segment = joint.search.problem.segments[0]
    scale, unit = joint.wording.signal_units[stage]
    figure = Figure(figsize=(9.5, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 3, height_ratios=(3, 2))
    top, left, right = (figure.add_subplot(grid[where]) for where in (np.s_[0, :], np.s_[1, :2], np.s_[1, 2]))
    time_s = np.arange(len(segment.angle_rad)) * segment.period_s
    shade = joint.search.problem.validation[segment.block]
    for axis in (top, left):
        axis.fill_between(time_s, 0, 1, where=shade, transform=axis.get_xaxis_transform(), color=SHADE, lw=0)
    for axis in (top, left, right):
        axis.spines[["top", "right"]].set_visible(False)
    measured = scale * segment.measured[stage]
    top.plot(time_s, measured, color=INK, lw=1.4, label="measured")
    fits = ((joint.search.nominal, ORANGE, "nominal model"), (joint.search.final, BLUE, "with the findings"))
    for fit, colour, label in fits:
        residual = np.where(segment.use[stage], scale * fit.residuals[0][stage], np.nan)
        top.plot(time_s, measured - residual, color=colour, lw=0.9, label=label)
        left.plot(time_s, residual, color=colour, lw=0.7)
    top.set(ylabel=f"{joint.wording.signals[stage]} [{unit}]", title=f"{joint.joint} (grey: validation data)")
    top.margins(y=0.15)
    top.legend(frameon=False, ncols=3, loc="upper right")
    left.set(xlabel="time [s]", ylabel=f"measured - model [{unit}]")
    _over_state(right, joint, stage)
    return figure


def _over_state(axis: Axes, joint: JointDiagnosis, stage: int) -> None:
    """Mean residuals over the state they depend on most, by direction of motion: effects switched off, and on."""
    means = state_means(joint, stage)
    if means is None:
        return
    for label, way, at, mean in means.rows:
        style = ":" if way == joint.wording.negative else "-"
        axis.plot(at, mean, style, color=ORANGE if label == "off" else BLUE, lw=1.2, label=way)
    axis.axhline(0.0, color=GREY, lw=0.5)
    axis.set(xlabel=means.label)
    axis.locator_params(axis="x", nbins=4)
    axis.legend(*(part[:2] for part in axis.get_legend_handles_labels()), frameon=False, fontsize="small")
