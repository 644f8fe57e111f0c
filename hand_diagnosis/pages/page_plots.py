"""The plots of a joint on the page: its signal and residual over time, its residual over a state, and its laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.diagnosis import JointDiagnosis
from hand_diagnosis.judgement import describe, states_of
from hand_diagnosis.pages.headline import effect_words
from hand_diagnosis.problem import residuals_on_test, spans_of_test, swings_freely
from hand_diagnosis.search import LawCurve
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.quantities import Wording
from hand_pages.plots import Curve, Kind, Panel, Plot, runs

NOISE_BAND = 2.0
"""Half the height of the noise band, in standard deviations."""


def models_of(joint: JointDiagnosis) -> tuple[tuple[Kind, str], tuple[Kind, str]]:
    """Kind and name of the curves of both models: the nominal one, and the final one."""
    return ("before", "nominal model"), ("after", "with the findings" if joint.search.accepted else "numbers fitted")


def leading_stage(joint: JointDiagnosis) -> int:
    """The signal whose nominal error is largest, relative to its noise."""
    return max(joint.results, key=lambda r: r.excess_before / (r.noise + 1e-12)).stage if joint.results else 1


def nth_shown(total: int) -> int:
    """Distance of the samples to show of `total` ones in each of SETTINGS.page_curves curves: 1 for all."""
    return max(1, -(-SETTINGS.page_curves * total // SETTINGS.page_samples))


def every_nth(joints: Sequence[JointDiagnosis]) -> int:
    """Distance of the samples to show, so that the page stays small: 1 for all."""
    curves = [
        len(segment.angle_rad) * (SETTINGS.page_curves + 2 ** len(joint.search.accepted) - 1)
        for joint in joints
        for segment in (joint.whole or joint.search.problem).segments
    ]
    return nth_shown(-(-sum(curves) // SETTINGS.page_curves))


def time_plots(joint: JointDiagnosis, stage: int, nth: int) -> list[Plot]:
    """A plot of each recording: the signal above, measured minus model below, over one axis of time.

    nth: distance of the samples to show, see every_nth.
    """
    whole = joint.whole or joint.search.problem
    scale, unit = joint.wording.signal_units[stage]
    signal = joint.wording.signals[stage]
    noise = NOISE_BAND * scale * joint.result(stage).noise if joint.results else 0.0
    residuals = [_residuals(joint, fit, stage) for fit in (joint.search.nominal, joint.search.final)]
    switched = [_residuals(joint, fit, stage) for fit in _with_some_off(joint)]
    names = [effect_words(found.effect.name) for found in joint.search.accepted]
    plots = []
    for k, segment in enumerate(whole.segments):
        axis = (0.0, nth * segment.period_s)
        measured = scale * segment.measured[stage]
        above = [Curve("measured", "measured", axis, measured[::nth])]
        below = []
        for (kind, name), each in zip(models_of(joint), residuals, strict=True):
            residual = scale * each[k]
            above.append(Curve(name, kind, axis, (measured - residual)[::nth]))
            variants = [scale * other[k][::nth] for other in switched] if kind == "after" else ()
            below.append(Curve(name, kind, axis, residual[::nth], variants=variants))
        errors = [scale * _rms(each[k]) for each in (residuals[1], *switched)]
        panels = [
            Panel(f"{signal} [{unit}]", above, height=4.0),
            Panel(f"measured - model [{unit}]", below, height=2.6, noise=noise),
        ]
        alt = f"{signal} of {joint.joint} over time: {_errors(joint, stage)}"
        caption = (
            f"{segment.name}. Shaded: validation data; yellow: test data; band: ±2 standard deviations of the noise."
        )
        caption += f" Every {nth}th sample is shown." if nth > 1 else ""
        notes = _notes(names, errors, unit)
        plots.append(
            Plot(
                label="time [s]",
                panels=panels,
                alt=alt,
                caption=caption,
                spans=_spans(joint, k),
                group=f"time {k}",
                switches=names,
                notes=notes,
            )
        )
    return plots


def _with_some_off(joint: JointDiagnosis) -> list[MapFit]:
    """The final model without some of its effects: entry m - 1 lacks effect k where bit k of m is set.

    The other numbers stay as they were found with all effects, so that each curve shows what an effect does.
    """
    search = joint.search
    found = []
    for mask in range(1, 2 ** len(search.accepted)):
        off = [hypothesis for k, hypothesis in enumerate(search.accepted) if mask >> k & 1]
        fit, keys = search.with_effects_off(*(h.effect.name for h in off)), {key for h in off for key in h.keys}
        kept = np.array([parameter.key not in keys for parameter in fit.free])
        free = tuple(parameter for parameter, stays in zip(fit.free, kept, strict=True) if stays)
        found.append(replace(fit, free=free, z=fit.z[kept]))
    return found


def _notes(names: Sequence[str], errors: Sequence[float], unit: str) -> list[str]:
    """For each set of effects that is off, the RMS error of the recording in a sentence."""
    notes = []
    for mask, error in enumerate(errors):
        off = [name for k, name in enumerate(names) if mask >> k & 1]
        without = f"Without {' and '.join(off)}" if off else "With all effects found"
        notes.append(f"{without}: RMS of measured - model {error:.3g} {unit}.")
    return notes


def _rms(residual: Array) -> float:
    """Over the samples that count."""
    known = residual[np.isfinite(residual)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def state_plot(joint: JointDiagnosis, stage: int) -> Plot | None:
    """Mean residual over the state on which it depends most, by direction of motion; None for too few samples."""
    means = state_means(joint, stage)
    if means is None or not means.rows:
        return None
    unit = joint.wording.signal_units[stage][1]
    kinds: dict[str, tuple[Kind, str]] = dict(zip(("off", "on"), models_of(joint), strict=True))
    curves = [
        Curve(f"{kinds[fit][1]}, {way}", kinds[fit][0], at, mean, dots=way == joint.wording.negative)
        for fit, way, at, mean in means.rows
    ]
    signal = joint.wording.signals[stage]
    caption = f"Mean of measured minus model over the {means.state}, by direction of motion."
    alt = f"Mean error of the {signal} of {joint.joint} over the {means.state}: {_largest(means, unit)}"
    return Plot(
        label=means.label, panels=[Panel(f"measured - model [{unit}]", curves, zero=True)], alt=alt, caption=caption
    )


def law_plot(effect: str, law: LawCurve) -> Plot:
    """The law of a class over its first state with its band, and the textbook form fitted to the same data."""
    state, value, low, high, textbook = law.points.T
    curves = [Curve(f"{law.form} law, 95 % band", "after", state, value, low, high)]
    if law.form == "learned":
        curves.append(Curve("textbook form", "quiet", state, textbook))
    panel = Panel(f"{law.quantity} [{law.unit}]", curves, zero=True)
    alt = f"law of {effect}: {law.statement}"
    return Plot(label=f"{law.over[0]} [{law.over_unit}]", panels=[panel], alt=alt, caption=law.statement)


@dataclass(frozen=True, slots=True)
class StateMeans:
    """Mean residuals over a state, in the units in which they are shown.

    rows: "off" or "on" (effects), direction of motion, state (bins,), mean (bins,).
    """

    state: str
    unit: str
    rows: tuple[tuple[str, str, Array, Array], ...]

    @property
    def label(self) -> str:
        """The state with its unit, where this is another word."""
        return self.state if self.state == self.unit else f"{self.state} [{self.unit}]"


def state_means(joint: JointDiagnosis, stage: int) -> StateMeans | None:
    """Mean residuals over the state on which they depend most; None where it is constant, or the recording short."""
    wording, segment = joint.wording, joint.search.problem.segments[0]
    use, standing = segment.use[stage], SETTINGS.standing_rad_s
    if use.sum() <= SETTINGS.figure_bins:
        return None
    off = joint.search.with_effects_off()
    name = describe(joint.search.problem, off, stage).state
    states = states_of(segment, use)
    factor, unit = _state_unit(name, wording)
    values, speed = factor * states[name], states["speed"]
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, SETTINGS.figure_bins + 1)))
    if len(edges) < 2:
        return None
    rows = []
    for label, fit in (("off", off), ("on", joint.search.final)):
        residual = wording.signal_units[stage][0] * fit.residuals[0][stage][use]
        for moving, way in ((speed > standing, wording.positive), (speed < -standing, wording.negative)):
            at, mean = _binned(values[moving], residual[moving], edges)
            if len(at) > 1:
                rows.append((label, way, at, mean))
    return StateMeans(wording.state(name), unit, tuple(rows))


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


def _residuals(joint: JointDiagnosis, fit: MapFit, stage: int) -> list[Array]:
    """Measured minus predicted (T,), SI, of each recording, test data included; NaN where a sample does not count."""
    whole, fitted = joint.whole or joint.search.problem, joint.search.problem.segments
    out = [np.full(len(segment.angle_rad), np.nan) for segment in whole.segments]
    for k, part, residual in zip(_fitted(joint), fitted, fit.residuals, strict=True):
        out[k][: len(part.angle_rad)] = np.where(part.use[stage], residual[stage], np.nan)
    if joint.whole is not None:
        for k, test in residuals_on_test(joint.whole, fit, free_axis=swings_freely(joint.whole)):
            out[k] = np.where(np.isfinite(test[stage]), test[stage], out[k])
    return out


def _fitted(joint: JointDiagnosis) -> list[int]:
    """Numbers of the recordings that hold training and validation data."""
    return [k for k, (begin, _) in enumerate(_tested(joint)) if begin > 0]


def _tested(joint: JointDiagnosis) -> list[tuple[int, int]]:
    """Span of samples of the test data of each recording; empty where it holds none."""
    if joint.whole is not None:
        return spans_of_test(joint.whole)
    lengths = [len(s.angle_rad) for s in joint.search.problem.segments]
    return [(count, count) for count in lengths]


def _spans(joint: JointDiagnosis, k: int) -> list[tuple[float, float, str]]:
    """Validation and test data of a recording [s]."""
    segment: Segment = (joint.whole or joint.search.problem).segments[k]
    (begin, end), period = _tested(joint)[k], segment.period_s
    held: Flags = np.zeros(len(segment.angle_rad), dtype=bool)
    if k in _fitted(joint):
        part = joint.search.problem.segments[_fitted(joint).index(k)]
        held[: len(part.block)] = joint.search.problem.validation[part.block]
        held[begin:end] = False
    spans = [(period * first, period * last, "validation") for first, last in runs(held)]
    return [*spans, (period * begin, period * end, "test")] if begin < end else spans


def _errors(joint: JointDiagnosis, stage: int) -> str:
    """The result in a sentence: the error before and after, and the noise."""
    scale, unit = joint.wording.signal_units[stage]
    if not joint.results:
        return "it has no signal to compare"
    result = joint.result(stage)
    before, after, noise = (scale * value for value in (result.before, result.after, result.noise))
    fall = f"stays at {before:.3g} {unit}" if before == after else f"falls from {before:.3g} to {after:.3g} {unit}"
    return f"the validation error {fall}, the noise is {noise:.2g} {unit}"


def _largest(means: StateMeans, unit: str) -> str:
    """The largest mean residual without and with the findings."""
    sizes = {"off": 0.0, "on": 0.0}
    for label, _, _, mean in means.rows:
        sizes[label] = max(sizes[label], float(np.abs(mean).max()))
    return f"at most {sizes['off']:.2g} {unit} without the findings and {sizes['on']:.2g} {unit} with them"
