"""Where in time, frequency and state the residual of a signal lies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hand_diagnosis.judgement.stage_errors import StageResult
from hand_diagnosis.problem import residuals_on_test
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import SPEED

THIRDS = ("low", "middle", "high")
BOTH_WAYS = {"angle", "pressure", "set-point"}
"""States on which a residual may depend differently in the two directions of motion."""


def _long_segments(problem: JointProblem, fit: MapFit, stage: int) -> list[tuple[Segment, Array]]:
    """Segments that hold enough samples of a signal, with their residuals (OUTPUTS, T)."""
    pairs = zip(problem.segments, fit.residuals, strict=True)
    return [(segment, r) for segment, r in pairs if segment.use[stage].sum() > SETTINGS.min_stage_samples]


@dataclass(frozen=True, slots=True)
class Structure:
    """An unexplained residual in numbers, SI.

    state: on which it depends most.  share: of its variance that this state explains [-].
    direction: mean residual while the joint moves forward minus while it moves back.
    frequency_hz: centroid of its spectrum.  tone: share of the variance in the strongest line of the spectrum, which is
    at tone_hz.
    """

    state: str
    share: float
    direction: float
    frequency_hz: float
    tone: float
    tone_hz: float


def describe(problem: JointProblem, fit: MapFit, stage: int) -> Structure:
    """Where in state space the residual of a signal lives, by means over bins of each candidate state."""
    return _structure(_long_segments(problem, fit, stage), stage)


def describe_test(whole: JointProblem, fit: MapFit, stage: int, *, free_axis: bool) -> Structure:
    """The same for the residual on test data. whole: the problem with these.  free_axis: see splits.evaluate_test."""
    found = residuals_on_test(whole, fit, free_axis=free_axis)
    return _structure([(replace(whole.segments[k], use=np.isfinite(left)), left) for k, left in found], stage)


def _structure(parts: Sequence[tuple[Segment, Array]], stage: int) -> Structure:
    """Of the longest of some segments with their residuals (OUTPUTS, T)."""
    segment, residual = max(parts, key=lambda pair: pair[0].use[stage].sum())
    use = segment.use[stage]
    r = residual[stage][use]
    states = states_of(segment, use)
    speed = states["speed"]
    forward = speed > 0.0
    shares = {name: _explained(r, values, forward & (name in BOTH_WAYS)) for name, values in states.items()}
    # Any lasting residual correlates with time; time must explain clearly more than the states do.
    state = max(shares, key=lambda name: shares[name] - (SETTINGS.time_margin if name == "time" else 0.0))
    moving = np.abs(speed) > SETTINGS.moving_rad_s
    direction = 0.0
    if (moving & (speed > 0)).any() and (moving & (speed < 0)).any():
        direction = float(r[moving & (speed > 0)].mean() - r[moving & (speed < 0)].mean())
    spectrum = np.abs(np.fft.rfft(r - r.mean())) ** 2
    frequency = np.fft.rfftfreq(len(r), segment.period_s)
    centroid = float((spectrum * frequency).sum() / max(float(spectrum.sum()), 1e-300))
    # A line is three bins wide; a frequency whose period is long against the recording is a drift.
    total = max(float(spectrum.sum()), 1e-300)
    often = frequency * len(r) * segment.period_s > SETTINGS.min_tone_periods
    lines = np.convolve(spectrum, np.ones(3), "same") * often
    peak = int(np.argmax(lines))
    return Structure(state, shares[state], direction, centroid, float(lines[peak]) / total, float(frequency[peak]))


def states_of(segment: Segment, use: Flags) -> dict[str, Array]:
    """The states [rad, Pa, rad/s, Pa, s] on which a residual may depend, at the samples that count, use (T,)."""
    time = np.asarray(np.arange(len(use)) * segment.period_s, dtype=np.float64)
    return {
        "angle": segment.angle_rad[use],
        "pressure": segment.pressure_pa[use],
        "speed": segment.exogenous[:, SPEED][use],
        "set-point": segment.set_point_pa[use],
        "time": time[use],
    }


def _explained(residual: Array, values: Array, forward: Flags) -> float:
    """Share [-] of the residual's variance that its mean over bins of a state, and over direction, explains."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, SETTINGS.state_bins + 1)))
    if len(edges) < 3:
        return 0.0
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    index = 2 * index + forward
    counts = np.bincount(index, minlength=2 * len(edges))
    means = np.bincount(index, residual, minlength=2 * len(edges)) / np.maximum(counts, 1)
    return float(1.0 - np.var(residual - means[index]) / max(float(np.var(residual)), 1e-300))


def turn_of_angle(problem: JointProblem, fit: MapFit, stage: int) -> float:
    """The period [rad] of the harmonic of the angle that explains most of a residual; 0 where none is fast enough."""
    uses: list[Flags] = [segment.use[stage] for segment in problem.segments]
    angle = np.concatenate([s.angle_rad[use] for s, use in zip(problem.segments, uses, strict=True)])
    left = np.concatenate([r[stage][use] for r, use in zip(fit.residuals, uses, strict=True)])
    span = float(np.ptp(angle))
    if span <= 0.0 or len(left) < SETTINGS.min_stage_samples:
        return 0.0
    slow = np.column_stack([np.ones_like(angle), angle, angle**2, angle**3])
    left = left - slow @ np.linalg.lstsq(slow, left, rcond=None)[0]
    counts = np.arange(*SETTINGS.remainder_turns, SETTINGS.remainder_turn_step)
    shares = [_share(left, 2.0 * np.pi * count / span * angle) for count in counts]
    return span / float(counts[int(np.argmax(shares))])


def _share(left: Array, phase: Array) -> float:
    """Share [-] of the square of a residual that one harmonic explains."""
    parts = np.column_stack([np.sin(phase), np.cos(phase)])
    gone = parts @ np.linalg.lstsq(parts, left, rcond=None)[0]
    return float(gone @ left) / max(float(left @ left), 1e-300)


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """A part of a signal's data, SI: RMS of the residual there, noise, standard errors above it, whether it is missed.

    state: "everywhere", "direction", "frequency" or a state; part: which part of it.
    """

    stage: int
    state: str
    part: str
    rms: float
    noise: float
    sigma: float
    missed: bool

    @property
    def signal(self) -> str:
        """Pressure, angle or force."""
        return STAGES[self.stage]


def locate(problem: JointProblem, fit: MapFit, results: Sequence[StageResult]) -> list[Region]:
    """Every region of every signal that the recordings hold, for the residuals of a fit."""
    return [region for result in results for region in _regions(problem, fit, result)]


def _regions(problem: JointProblem, fit: MapFit, result: StageResult) -> Iterator[Region]:
    residual, block, states = _joined(problem, fit, result.stage)
    if len(residual) < SETTINGS.min_region_samples:
        return
    parts = [(state, part, residual[inside], block[inside]) for state, part, inside in _parts(states)]
    parts += [("frequency", part, band, block) for part, band in _bands(problem, fit, result.stage)]
    for state, part, values, blocks in parts:
        region = _tested(state, part, values, blocks, result)
        if region is not None:
            yield region


def _joined(problem: JointProblem, fit: MapFit, stage: int) -> tuple[Array, NDArray[np.int64], dict[str, Array]]:
    """Residuals, blocks and states of all segments, at the samples that count."""
    parts = [
        (r[stage][p.use[stage]], p.block[p.use[stage]], states_of(p, p.use[stage]))
        for p, r in zip(problem.segments, fit.residuals, strict=True)
    ]
    states = {name: np.concatenate([part[2][name] for part in parts]) for name in parts[0][2]}
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts]), states


def _parts(states: dict[str, Array]) -> Iterator[tuple[str, str, Flags]]:
    speed, standing = states["speed"], SETTINGS.standing_rad_s
    yield "everywhere", "all", np.ones(len(speed), dtype=bool)
    yield "direction", "forward", speed > standing
    yield "direction", "back", speed < -standing
    yield "direction", "at rest", np.abs(speed) <= standing
    for name, values in states.items():
        values = np.abs(values) if name == "speed" else values
        edges = np.quantile(values, np.arange(1, len(THIRDS)) / len(THIRDS))
        third = np.searchsorted(edges, values)
        for k, part in enumerate(THIRDS):
            yield name, part, third == k


def _bands(problem: JointProblem, fit: MapFit, stage: int) -> Iterator[tuple[str, Array]]:
    """The residuals of all segments within each band of frequencies, at the samples that count."""
    edges = SETTINGS.band_edges_hz
    for low, high in pairwise(edges):
        filtered = [
            _band(p.use[stage] * r[stage], p.period_s, low, high)[p.use[stage]]
            for p, r in zip(problem.segments, fit.residuals, strict=True)
        ]
        yield f"above {low:g} Hz" if np.isinf(high) else f"{low:g} to {high:g} Hz", np.concatenate(filtered)


def _tested(state: str, part: str, residual: Array, block: NDArray[np.int64], result: StageResult) -> Region | None:
    """The region of these residuals; None where too few blocks hold enough of them."""
    counts = np.bincount(block)
    full = counts >= SETTINGS.min_region_samples
    if full.sum() < SETTINGS.min_region_samples:
        return None
    squares = np.bincount(block, residual**2)[full] / counts[full]
    error = max(float(squares.std(ddof=1)) / np.sqrt(len(squares)), 1e-300)
    rms = float(np.sqrt(np.mean(residual**2)))
    sigma = (float(squares.mean()) - result.noise**2) / error
    missed = sigma > SETTINGS.min_missed_sigma and rms**2 - result.noise**2 > result.floor**2
    return Region(
        stage=result.stage, state=state, part=part, rms=rms, noise=result.noise, sigma=sigma, missed=bool(missed)
    )


def _band(residual: Array, period_s: float, low_hz: float, high_hz: float) -> Array:
    """The part of a signal (T,) within a band of frequencies."""
    spectrum = np.fft.rfft(residual)
    frequency = np.fft.rfftfreq(len(residual), period_s)
    spectrum[(frequency < low_hz) | (frequency >= high_hz)] = 0.0
    inside: Array = np.fft.irfft(spectrum, len(residual))
    return inside
