"""The figure of a joint: measured, simulated before and after, residuals over time and over the state that matters."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hand_diagnosis.diagnosis import JointDiagnosis
from hand_diagnosis.laws import LawCurve
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.verdict import describe, states_of
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.quantities import Wording

INK, BLUE, RED, GREY, SHADE = "#1a1a1a", "#1f6f9f", "#c0392b", "#888888", "#f0f0f0"
BAND_ALPHA = 0.5


def joint_figure(joint: JointDiagnosis) -> Figure:
    """The signal that gained most, in the units of the hand or machine; validation data have a grey background."""
    stage = max(joint.results, key=lambda r: r.excess_before / (r.noise + 1e-12)).stage if joint.results else 1
    segment = joint.search.problem.segments[0]
    scale, unit = joint.wording.signal_units[stage]
    figure = Figure(figsize=(9.5, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 3, height_ratios=(3, 2))
    top, left, right = (figure.add_subplot(grid[where]) for where in (np.s_[0, :], np.s_[1, :2], np.s_[1, 2]))
    time_s = np.arange(len(segment.angle_rad)) * segment.period_s
    shade = joint.search.problem.held_out[segment.block]
    for axis in (top, left):
        axis.fill_between(time_s, 0, 1, where=shade, transform=axis.get_xaxis_transform(), color=SHADE, lw=0)
    for axis in (top, left, right):
        axis.spines[["top", "right"]].set_visible(False)
    measured = scale * segment.measured[stage]
    top.plot(time_s, measured, color=INK, lw=1.4, label="measured")
    fits = ((joint.search.nominal, RED, "nominal model"), (joint.search.final, BLUE, "with the findings"))
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


def law_figure(effect: str, law: LawCurve) -> Figure:
    """The law of a class over its first state with its band, and the textbook form fitted to the same data."""
    figure = Figure(figsize=(4.6, 2.8), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.add_subplot()
    axis.spines[["top", "right"]].set_visible(False)
    state, value, low, high, textbook = law.points.T
    axis.fill_between(state, low, high, color=BLUE, alpha=BAND_ALPHA, lw=0, label="95 % band")
    if law.form == "learned":
        axis.plot(state, textbook, "--", color=GREY, lw=1.2, label="textbook form")
    axis.plot(state, value, color=BLUE, lw=1.6, label=f"{law.form} law")
    axis.set(xlabel=f"{law.over[0]} [{law.over_unit}]", ylabel=f"[{law.unit}]", title=effect)
    axis.legend(frameon=False, fontsize="small")
    return figure


def _over_state(axis: Axes, joint: JointDiagnosis, stage: int) -> None:
    """Mean residuals over the state they depend on most, by direction of motion: effects switched off, and on."""
    problem, wording = joint.search.problem, joint.wording
    segment = problem.segments[0]
    use = segment.use[stage]
    if use.sum() <= SETTINGS.figure_bins:
        return
    off = joint.search.with_effects_off()
    name = describe(problem, off, stage).state
    values = states_of(segment, use)[name]
    per_state, unit = _state_unit(name, wording)
    _plot_means(axis, joint, stage, per_state * values, ((off, RED), (joint.search.final, BLUE)))
    axis.axhline(0.0, color=GREY, lw=0.5)
    axis.set(xlabel=f"{wording.state(name)} [{unit}]")
    axis.locator_params(axis="x", nbins=4)
    axis.legend(*(part[:2] for part in axis.get_legend_handles_labels()), frameon=False, fontsize="small")


def _plot_means(
    axis: Axes, joint: JointDiagnosis, stage: int, values: Array, fits: tuple[tuple[MapFit, str], ...]
) -> None:
    """Mean residuals of fits over a state (n,), by direction of motion."""
    wording, segment = joint.wording, joint.search.problem.segments[0]
    use, standing = segment.use[stage], SETTINGS.standing_rad_s
    speed = states_of(segment, use)["speed"]
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, SETTINGS.figure_bins + 1)))
    directions = ((speed > standing, "-", wording.positive), (speed < -standing, ":", wording.negative))
    for fit, colour in fits:
        residual = wording.signal_units[stage][0] * fit.residuals[0][stage][use]
        for moving, style, label in directions:
            at, mean = _binned(values[moving], residual[moving], edges)
            axis.plot(at, mean, style, color=colour, lw=1.2, label=label)


def _state_unit(name: str, wording: Wording) -> tuple[float, str]:
    """Factor from SI and unit in which a state is shown."""
    if name == "time":
        return 1.0, "s"
    scale, unit = wording.signal_units[0 if name in {"pressure", "set-point"} else 1]
    return scale, f"{unit}/s" if name == "speed" else unit


def _binned(values: Array, residual: Array, edges: Array) -> tuple[Array, Array]:
    """Centres of the bins that hold enough samples, and the means (bins,) of a residual (n,) there."""
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(index, minlength=len(edges) - 1)
    sums = np.bincount(index, residual, minlength=len(edges) - 1)
    enough = count >= SETTINGS.min_region_samples
    return 0.5 * (edges[1:] + edges[:-1])[enough], sums[enough] / count[enough]
