"""One joint of one or more recordings as a least-squares problem: from parameters to the residuals of each stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from hand_identification.free_parameters import START_CREEP, FreeParameter, values_of
from hand_identification.settings import FITS
from hand_model.arrays import Array, Flags
from hand_model.compile_cache import without_arrays
from hand_model.kernel.layout import CREEP, OMEGA
from hand_model.kernel.open_loop import OUTPUTS, READINGS, MeasuredInputs, open_loop
from hand_recording.local_smoothing import Windows
from hand_recording.own_readings import OwnReadings
from hand_recording.settings import READING
from hand_recording.signals import in_band, shown_noise, white_noise

STAGES = READINGS
"""The signal that each stage predicts, in the order of the model's outputs."""
FORCE = STAGES.index("force")


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One recording of the joint. Signals (T,), exogenous (T, EXOGENOUS).

    commanded_pa: (parts (T - 1) + 1,) set-points in force, `parts` evenly over each sample, as commands have times of
    their own; set_point_pa are those at the samples.
    driving_pa: the measured pressure as the joint's input, its noise reduced, (finer (T - 1) + 1,) evenly over the
    samples.  windows: (T,) of the smoothing, see local_smoothing.Windows.  known: (T,) where readings were.
    late_s: by how much the pressures were read after the other signals.  jitter_s: standard deviation of the times at
    which the samples were taken.  own: the readings at their own times, see Signals.own.
    added: (rows,) what the load of this recording adds to the parameters; None: nothing.
    derivative_s: window of the derivatives of the angle.  band_s: window of the force, see Signals.band_s.
    kept_noise_n: white noise of the force that this window keeps [N]; 0: nothing is smoothed.
    acts: (T,) samples at which JointProblem.switched act; None: at all.
    trust: factor of its residuals in the cost, below 1 where the recording is noisier than another.
    loose: (T - 1,) samples within which a set-point stepped at an unknown time, see step_times.py; None: nowhere.
    use: (OUTPUTS, T) samples that count.  block: (T,) number of the block of each sample, over all recordings.
    starts: (blocks of the segment,) first sample of each.  counts: (OUTPUTS, blocks of the segment) samples that count.
    """

    name: str
    period_s: float
    set_point_pa: Array
    commanded_pa: Array
    pressure_pa: Array
    driving_pa: Array
    windows: Windows
    angle_rad: Array
    force_n: Array
    exogenous: Array
    known: Flags
    use: Flags
    block: NDArray[np.int64]
    start: Array
    late_s: float = 0.0
    jitter_s: float = 0.0
    own: OwnReadings | None = None
    acts: Flags | None = None
    loose: Flags | None = None
    added: Array | None = None
    derivative_s: float = READING.smoothing_s
    band_s: float = 0.0
    kept_noise_n: float = 0.0
    trust: float = 1.0
    starts: NDArray[np.intp] = field(init=False)
    counts: Array = field(init=False)

    def __post_init__(self) -> None:
        """Find where blocks begin, which fits ask for thousands of times."""
        starts = np.searchsorted(self.block, np.arange(self.block[0], self.block[-1] + 1))
        object.__setattr__(self, "starts", starts)
        object.__setattr__(self, "counts", np.add.reduceat(self.use.astype(float), starts, axis=1))

    @property
    def blocks(self) -> slice:
        """Its blocks among those of all recordings."""
        return slice(int(self.block[0]), int(self.block[-1]) + 1)

    @property
    def measured(self) -> Array:
        """(OUTPUTS, T), SI."""
        return np.array([self.pressure_pa, self.angle_rad, np.where(np.isnan(self.force_n), 0.0, self.force_n)])

    @property
    def parts(self) -> int:
        """Number of set-points of each sample."""
        return max(1, (len(self.commanded_pa) - 1) // max(len(self.angle_rad) - 1, 1))

    def white_noise(self, stage: int, values: Array) -> float:
        """White noise [SI] of samples (n,) of a reading or of what a model leaves, no less than a window keeps."""
        return max(white_noise(values) / self.shown(stage), self.kept_noise_n if stage == FORCE else 0.0)

    def shown(self, stage: int) -> float:
        """Share, 0 ... 1 [-], that third differences show of the noise of a reading; see `shown_noise`."""
        return 1.0 if self.own is None or stage == FORCE else shown_noise(self.own, self.period_s)


@dataclass(slots=True)
class JointProblem:
    """A joint: its segments, nominal parameters (rows,), weights (OUTPUTS,) of squared residuals, validation blocks.

    floor: (OUTPUTS,) SI, repeatability of each signal; what is below it is not claimed.
    switched: rows that have their nominal values while Segment.acts is False; the plant changes there and moves on.
    holds_out: whether there are validation blocks; without, every block is fitted.  draw: number of their drawing.
    spared: first sample and the one behind the last of the test data of the only recording; None: the usual ones.
    correlation_s: distance of samples that count as independent.  machine: whether it is another one than a hand.
    white: (OUTPUTS, blocks) SI, white noise of the readings, which is no evidence against a model; None: it counts, as
    where the weights are those of the white noise.
    """

    joint: str
    segments: list[Segment]
    nominal: Array
    weight: Array
    lever_m: float = 1.0
    step_s: float = FITS.integration_step_s
    driven: bool = False
    floor: Array = field(default_factory=lambda: np.array(FITS.floor))
    switched: tuple[int, ...] = ()
    holds_out: bool = True
    draw: int = 0
    spared: tuple[int, int] | None = None
    correlation_s: float = FITS.correlation_s
    machine: bool = False
    white: Array | None = None

    @property
    def claimable(self) -> Array:
        """(OUTPUTS,) SI: the error that an effect must remove; the whole repeatability where that is larger."""
        practical = np.array(FITS.floor)
        return np.where(self.floor > practical, self.floor, FITS.min_floors_taken * practical)

    @property
    def motion_rad(self) -> tuple[float, float]:
        """Least and largest angle that was read; of a joint without readings, that of no motion."""
        read = np.concatenate([segment.angle_rad[segment.known] for segment in self.segments])
        return (float(read.min()), float(read.max())) if len(read) else (0.0, 0.0)

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return int(self.segments[-1].block[-1]) + 1

    @property
    def validation(self) -> Flags:
        """(blocks,): which blocks are validation data and not fitted, see `validation_blocks`."""
        return validation_blocks(self.blocks, self.draw) if self.holds_out else np.zeros(self.blocks, dtype=bool)

    def columns(self, free: Sequence[FreeParameter], z: Array) -> tuple[Array, Array]:
        """Parameter sets (k, rows) and starts (k, 1 + segments) of coordinates z (k, free)."""
        columns, starts = np.repeat(self.nominal[None], len(z), axis=0), self.starts(len(z))
        values, rows = values_of(free, z), np.array([parameter.row for parameter in free], dtype=np.intp)
        later = rows >= START_CREEP
        columns[:, rows[~later]], starts[:, rows[later] - START_CREEP] = values[:, ~later], values[:, later]
        return columns, starts

    def starts(self, count: int) -> Array:
        """(count, 1 + segments): creeping ratio at the start, 0, and each segment's first speed, as estimated."""
        return np.tile([0.0, *(segment.start[OMEGA] for segment in self.segments)], (count, 1))

    def predict(self, columns: Array, starts: Array) -> list[Array]:
        """Predicted readings (k, OUTPUTS, T), SI, of every segment, for parameter sets (k, rows) and starts."""
        out = []
        for index, segment in enumerate(self.segments):
            start = np.tile(segment.start, (len(columns), 1))
            start[:, CREEP], start[:, OMEGA] = starts[:, 0], starts[:, 1 + index]
            inputs = MeasuredInputs(
                segment.commanded_pa, segment.driving_pa, segment.exogenous, segment.period_s, segment.late_s
            )
            own = columns if segment.added is None else columns + segment.added
            predicted = self._predicted(segment, own, start, inputs)
            predicted[:, FORCE] = in_band(predicted[:, FORCE], segment.period_s, segment.band_s)
            out.append(predicted)
        return out

    def _predicted(self, segment: Segment, columns: Array, start: Array, inputs: MeasuredInputs) -> Array:
        """Readings (k, OUTPUTS, T) of a segment, in a part of which what is switched has its nominal values."""
        changed = None
        if segment.acts is not None and not segment.acts.all():
            without = columns.copy()
            without[:, list(self.switched)] = self.nominal[list(self.switched)]
            first, second = (columns, without) if segment.acts[0] else (without, columns)
            # Readings of the first sample of the second part are already its own.
            switches = max(int(np.argmax(segment.acts != segment.acts[0])) - 1, 0)
            columns, changed = first, (switches, second) if segment.acts.any() else None
        return open_loop(
            columns, start, inputs, lever_m=self.lever_m, step_s=self.step_s, driven=self.driven, changed=changed
        )

    def residuals(self, columns: Array, starts: Array) -> list[Array]:
        """Measured minus predicted (k, OUTPUTS, T), SI, of every segment; 0 at samples that do not count."""
        residuals = self.predict(columns, starts)
        for segment, predicted in zip(self.segments, residuals, strict=True):
            _leave(predicted, segment.measured, segment.use, FITS.diverged)
        return residuals

    def block_squares(self, residuals: Sequence[Array]) -> Array:
        """Sums of squared residuals (k, OUTPUTS, blocks) of residuals (k, OUTPUTS, T) by segment."""
        total = np.zeros((len(residuals[0]), OUTPUTS, self.blocks))
        for segment, residual in zip(self.segments, residuals, strict=True):
            for column, values in zip(total, residual, strict=True):
                with np.errstate(over="ignore"):  # a trial that diverges costs infinity
                    column[:, segment.blocks] += np.add.reduceat(values * values, segment.starts, axis=1)
        return total

    @property
    def block_weights(self) -> Array:
        """Weights of squared residuals (OUTPUTS, blocks), with the trust in each recording."""
        weights = np.repeat(self.weight[:, None], self.blocks, axis=1)
        for segment in self.segments:
            weights[:, segment.blocks] *= segment.trust**2
        return weights

    @property
    def block_counts(self) -> Array:
        """Number of samples that count, (OUTPUTS, blocks)."""
        counts = np.zeros((OUTPUTS, self.blocks))
        for segment in self.segments:
            counts[:, segment.blocks] += segment.counts
        return counts

    def effective_counts(self, blocks: Flags) -> Array:
        """Number of independent samples of each stage (OUTPUTS,) in the chosen blocks (blocks,), see correlation_s."""
        per_sample = self.segments[0].period_s / self.correlation_s
        counts: Array = self.block_counts[:, blocks].sum(axis=1) * min(per_sample, 1.0)
        return counts


@without_arrays
def _leave(predicted, measured, use, diverged):  # type: ignore[no-untyped-def]
    """Predictions (k, OUTPUTS, T) in place by what they leave of the measured (OUTPUTS, T); 0 where use is False."""
    for k in range(predicted.shape[0]):
        for stage in range(predicted.shape[1]):
            for n in range(predicted.shape[2]):
                left = measured[stage, n] - predicted[k, stage, n]
                left = min(max(left, -diverged), diverged)
                predicted[k, stage, n] = left if use[stage, n] else 0.0


@cache
def validation_blocks(blocks: int, draw: int = 0) -> Flags:
    """Flags (blocks,) of the validation blocks: one of FITS.validation_every_block each, drawn by a fixed seed.

    With a regular pattern, a periodic motion could show only one of its phases in the blocks that are fitted. Blocks
    of one drawing are fitted in the next one.
    """
    every = FITS.validation_every_block
    drawn = (np.random.default_rng(every).integers(every, size=-(-blocks // every)) + draw) % every
    held = np.zeros(every * len(drawn), dtype=bool)
    held[every * np.arange(len(drawn)) + drawn] = True
    return held[:blocks]


def initial_weights(period_s: float, noise: Array) -> Array:
    """Weights (OUTPUTS,) of squared residuals, SI: white noise (OUTPUTS,) and the practical floor, correlated."""
    samples = max(FITS.correlation_s / period_s, 1.0)
    weights: Array = 1.0 / (noise**2 + np.array(FITS.floor) ** 2 * samples)
    return weights


def block_numbers(samples: int, period_s: float, first: int) -> NDArray[np.int64]:
    """Block of each sample (samples,) of a recording, numbered from `first`; at least FITS.min_blocks per recording."""
    length = max(1, min(round(FITS.block_s / period_s), samples // FITS.min_blocks))
    numbers: NDArray[np.int64] = first + np.minimum(np.arange(samples) // length, max(samples // length - 1, 0))
    return numbers
