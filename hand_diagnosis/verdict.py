"""What remains after the best model: noise, a part, or physics outside the catalogue; and where the model misses.

No model can fit better than the noise of the reading and the noise of the measured inputs on which a stage runs. A
second draw of the same input noise moves the predictions by as much as the first one has moved them already.

Each signal of a joint is tested as a whole, by direction of motion, in thirds of each state and by frequency. A region
is missed where its error beyond the noise is larger than the repeatability and significant. Squares of blocks, not of
samples, are compared with the noise, so that correlation within a block does not count one event many times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hand_diagnosis.hypotheses import validation_rmse
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ACCELERATION, ANGLE, SPEED
from hand_model.kernel.open_loop import OUTPUTS
from hand_recording.local_smoothing import smoothed_by
from hand_recording.signals import derivatives, white_noise

THIRDS = ("low", "middle", "high")
BOTH_WAYS = {"angle", "pressure", "set-point"}
"""States on which a residual may depend differently in the two directions of motion."""


@dataclass(frozen=True, slots=True)
class StageResult:
    """One signal on the validation data, SI: error before and after, noise, excess over the noise before and after.

    noise: white noise of the reading, and what the noise of the measured inputs makes of the prediction.
    floor: repeatability.  effects: how many were found on the joint.  independent: samples of the validation data that
    count as independent (joint_problem.CORRELATION_S).
    """

    stage: int
    before: float
    after: float
    noise: float
    excess_before: float
    excess_after: float
    floor: float
    effects: int
    independent: float

    @property
    def name(self) -> str:
        """Of the signal: pressure, angle or force."""
        return STAGES[self.stage]

    @property
    def left(self) -> float:
        """Share of the excess error (RMS) that is left, 0 ... 1."""
        return min(self.excess_after / max(self.excess_before, 1e-300), 1.0)

    @property
    def explained(self) -> float:
        """Share of the mean square beyond the noise that the effects explain, 0 ... 1."""
        return 1.0 - self.left**2

    def right_name(self, test_before: float, test_after: float) -> float:
        """Probability, 0 ... 1, that no other effect stands behind the names, by what they leave of this signal.

        test_before, test_after: errors [SI] of the nominal and the final model on test data; NaN without such data. The
        worse of validation and test data counts: a wrong class with a flexible law fits what it saw and fails
        elsewhere. Logistic in the logarithm of 1 + x^2 / floor^2, the quantity of hypotheses.log_likelihood.
        """
        on_test = [float(np.sqrt(max(np.nan_to_num(x) ** 2 - self.noise**2, 0.0))) for x in (test_before, test_after)]
        ratio = max(
            (self.floor**2 + after**2) / (self.floor**2 + self._tolerated(before) ** 2)
            for before, after in ((self.excess_before, self.excess_after), (on_test[0], on_test[1]))
        )
        return float(1.0 / (1.0 + ratio**SETTINGS.name_sharpness))

    def _tolerated(self, before: float) -> float:
        """Excess error [SI] that a right name may leave of an excess `before` [SI]."""
        return float(np.hypot(SETTINGS.name_excess_floors * self.floor, SETTINGS.tolerated_share * before))

    @property
    def tolerated(self) -> float:
        """Excess error [SI] that needs no other physics: of repeatability, and of the form of the effects' laws."""
        return self._tolerated(self.excess_before) if self.effects else SETTINGS.unexplained_floors * self.floor

    @property
    def other_physics(self) -> float:
        """Probability, 0 ... 1, that what is left on data that were not fitted is other physics than that named.

        The likelihood of n independent samples of correlated noise of unknown scale above the floor,
        -n/2 log(1 + x^2 / floor^2) (hypotheses.log_likelihood), of the error that is left against the largest that is
        tolerated; even odds where the two are equal.
        """
        left, limit = (1.0 + (x / self.floor) ** 2 for x in (self.excess_after, self.tolerated))
        log_odds = 0.5 * self.independent * float(np.log(left / limit)) / SETTINGS.evidence_temperature
        low = SETTINGS.min_probability
        return float(np.clip(0.5 * (1.0 + np.tanh(0.5 * log_odds)), low, 1.0 - low))

    @property
    def remains(self) -> bool:
        """Whether what is left is more probably other physics than not."""
        return self.excess_after > self.tolerated

    @property
    def claimed(self) -> bool:
        """Whether the effects remove enough of this signal's error to be findings, and not only parts of an unknown."""
        return not self.remains or self.left <= SETTINGS.max_claim_share


def stage_results(problem: JointProblem, nominal: MapFit, final: MapFit, effects: int) -> list[StageResult]:
    """Pressure, angle and force, those that the recording holds. effects: how many the final model has."""
    before, after = validation_rmse(problem, nominal.squares), validation_rmse(problem, final.squares)
    inputs = noise_of_inputs(problem, final)
    independent = problem.effective_counts(problem.held_out)
    results = []
    for stage in range(len(STAGES)):
        if not np.isfinite(before[stage]):
            continue
        white = max(
            noise_of_reading(r[stage][p.use[stage]], (p.measured[stage] - r[stage])[p.use[stage]])
            for p, r in _long_segments(problem, final, stage)
        )
        noise = float(np.hypot(white, inputs[stage]))
        excess = [float(np.sqrt(max(rmse[stage] ** 2 - noise**2, 0.0))) for rmse in (before, after)]
        results.append(
            StageResult(
                stage,
                float(before[stage]),
                float(after[stage]),
                noise,
                excess[0],
                excess[1],
                float(problem.floor[stage]),
                effects,
                float(independent[stage]),
            )
        )
    return results


def _long_segments(problem: JointProblem, fit: MapFit, stage: int) -> list[tuple[Segment, Array]]:
    """Segments that hold enough samples of a signal, with their residuals (OUTPUTS, T)."""
    pairs = zip(problem.segments, fit.residuals, strict=True)
    return [(segment, r) for segment, r in pairs if segment.use[stage].sum() > SETTINGS.min_stage_samples]


def noise_of_inputs(problem: JointProblem, fit: MapFit) -> Array:
    """RMS (OUTPUTS,) [Pa, rad, N] by which input noise moves the predictions of a fit on the validation blocks."""
    rng = np.random.default_rng(SETTINGS.noise_seed)
    columns, starts = problem.columns(fit.free, fit.z[None])
    plain = problem.predict(columns, starts)
    noisy = replace(problem, segments=[_disturbed(segment, rng, problem.driven) for segment in problem.segments])
    squares, count = np.zeros(OUTPUTS), np.zeros(OUTPUTS)
    for segment, first, second in zip(problem.segments, plain, noisy.predict(columns, starts), strict=True):
        counts = segment.use & problem.held_out[segment.block]
        squares += (((second[0] - first[0]) * counts) ** 2).sum(axis=1)
        count += counts.sum(axis=1)
    return np.asarray(np.sqrt(squares / np.maximum(count, 1.0)), dtype=np.float64)


def noise_of_reading(residual: Array, predicted: Array) -> float:
    """RMS [SI] of the white part of a residual (T,), which may grow with the speed of the signal, as jitter makes it.

    Samples are parted by the slope of the prediction (T,); in a part, third differences separate noise from structure.
    """
    if len(residual) < SETTINGS.noise_part_samples * SETTINGS.noise_parts[-1]:
        return white_noise(residual)
    slope = np.abs(np.gradient(predicted))
    slope = np.maximum(slope[1:-2], slope[2:-1])
    rough = np.abs(np.diff(residual, 3)) / np.sqrt(SETTINGS.third_difference_variance)
    order = np.argsort(slope, kind="stable")
    parts = [order[len(order) * (k - 1) // k :] for k in SETTINGS.noise_parts[1:]]
    square = 0.0
    for part, smaller in zip([order, *parts], [*parts, order[:0]], strict=True):
        inside = np.setdiff1d(part, smaller, assume_unique=True)
        square += len(inside) * (float(np.median(rough[inside])) / SETTINGS.median_of_noise) ** 2
    return max(float(np.sqrt(square / len(order))), white_noise(residual))


def _disturbed(segment: Segment, rng: np.random.Generator, driven: bool) -> Segment:
    """The segment with a second draw of the noise on its inputs, smoothed as the first one was."""
    white = white_noise(segment.pressure_pa) * rng.standard_normal(len(segment.pressure_pa))
    kept = white if driven else smoothed_by(white, segment.windows)
    samples = np.arange(len(kept))
    kept = kept + _moved(segment.pressure_pa, segment, rng)
    kept = np.interp(np.linspace(0.0, samples[-1], len(segment.driving_pa)), samples, kept)
    angle = white_noise(segment.angle_rad) * rng.standard_normal(len(white)) + _moved(segment.angle_rad, segment, rng)
    speed, acceleration = derivatives(angle[:, None], segment.period_s, segment.derivative_s)
    exogenous = segment.exogenous.copy()
    exogenous[:, ANGLE] += angle
    exogenous[:, SPEED] += speed[:, 0]
    exogenous[:, ACCELERATION] += acceleration[:, 0]
    return replace(segment, driving_pa=segment.driving_pa + kept, exogenous=exogenous)


def _moved(values: Array, segment: Segment, rng: np.random.Generator) -> Array:
    """Errors (T,) of a signal whose samples were taken at slightly wrong times: its speed times the jitter."""
    if segment.jitter_s == 0.0:
        return np.zeros(len(values))
    return np.gradient(values, segment.period_s) * segment.jitter_s * rng.standard_normal(len(values))


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
    segment, residual = max(_long_segments(problem, fit, stage), key=lambda pair: pair[0].use[stage].sum())
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


@dataclass(frozen=True, slots=True)
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
        edges = np.quantile(values, [1 / 3, 2 / 3])
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
    return Region(result.stage, state, part, rms, result.noise, sigma, bool(missed))


def _band(residual: Array, period_s: float, low_hz: float, high_hz: float) -> Array:
    """The part of a signal (T,) within a band of frequencies."""
    spectrum = np.fft.rfft(residual)
    frequency = np.fft.rfftfreq(len(residual), period_s)
    spectrum[(frequency < low_hz) | (frequency >= high_hz)] = 0.0
    inside: Array = np.fft.irfft(spectrum, len(residual))
    return inside
