"""The measured signals of every joint on one uniform clock without gaps, and estimates of their noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np
from scipy.ndimage import correlate1d, uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter

from hand_model.arrays import Array, Flags
from hand_recording.own_readings import OwnReadings
from hand_recording.recording_files import RecordingError
from hand_recording.settings import READING

LEAST_WINDOW = 5
"""Samples through which a cubic or a quadratic leaves any noise to average."""


def on_calendar(stamp_s: float) -> float | None:
    """A stamp [s] where it counts from 1970; None where it counts from the start of a program or a test."""
    first, last = READING.calendar_s
    return stamp_s if first <= stamp_s < last else None


def samples_on_grid(name: object, first_s: float, last_s: float, period_s: float) -> int:
    """Number of samples from the first time to the last [s]. Raises RecordingError for more than max_samples."""
    count = int((last_s - first_s) / period_s + 0.5) + 1
    if count > READING.max_samples:
        raise RecordingError(
            f"{name} has {count} samples on a uniform clock; the allowed range is up to {READING.max_samples};"
            " cut it into several recordings and diagnose them with --each"
        )
    return count


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """One recording. T samples, J joints; every array (T, J).

    set_point_pa: in force from its sample to the next.  pressure_pa, angle_rad: measured, gaps bridged.
    force_n: NaN where there is no sensor.  known: False where a reading was bridged.  has_*: (J,) whether the signal
    was recorded at all.  notes: findings of the data check.  dropped: share of frames that are missing, 0 ... 1.
    driven: the motion was imposed from outside, and force_n is the machine's reaction.
    still: nothing moves, and the pressure is all that is measured.
    machine: the signals are those of another machine than a hand, to which the ranges of a hand do not apply.
    pressure_late_s: time from the reading of the angles of a sample to that of its pressures, by their stamps.
    between_pa: (parts (T - 1) + 1, J) set-points in force, `parts` evenly over each sample; None where they change at
    samples only.  loose: (T - 1, J) samples within which a set-point may have stepped at any time; None: nowhere.
    jitter_s: standard deviation of the error of the samples' times that is left.
    own: the readings at their own times, where these are no steady clock; pressure_pa and angle_rad lie on lines
    between them.
    added: what the load of this recording adds to parameters of the model, by key, SI.
    derivative_s: window over which speeds and accelerations are computed.
    band_s: window over which a measured force and its prediction are smoothed alike, because the motion shows nothing
    faster; 0: neither is.
    start_s: the first stamp since 1970 [s]; None where stamps count from another time, see on_calendar.
    refused: joints whose readings cannot be compared with a model, and why.
    """

    name: str
    joints: tuple[str, ...]
    period_s: float
    set_point_pa: Array
    pressure_pa: Array
    angle_rad: Array
    force_n: Array
    known: Flags
    has_set_point: Flags
    has_pressure: Flags
    notes: tuple[str, ...] = field(default=())
    dropped: float = 0.0
    driven: bool = False
    machine: bool = False
    still: bool = False
    pressure_late_s: float = 0.0
    between_pa: Array | None = None
    loose: Flags | None = None
    jitter_s: float = 0.0
    own: OwnReadings | None = None
    added: Mapping[str, float] = field(default_factory=dict)
    derivative_s: float = READING.smoothing_s
    band_s: float = 0.0
    start_s: float | None = None
    refused: tuple[tuple[str, str], ...] = ()

    @property
    def commanded_pa(self) -> Array:
        """Set-points in force (parts (T - 1) + 1, J), `parts` evenly over each sample."""
        return self.set_point_pa if self.between_pa is None else self.between_pa

    @property
    def samples(self) -> int:
        """Number of samples, T."""
        return len(self.angle_rad)

    @property
    def time_s(self) -> Array:
        """Times of the samples (T,) [s], from 0."""
        return np.asarray(np.arange(self.samples) * self.period_s, dtype=np.float64)


def half_window(period_s: float, window_s: float) -> int:
    """Half of the window of derivatives, in samples."""
    return max(2, round(window_s / period_s / 2.0))


def derivatives(angle_rad: Array, period_s: float, window_s: float = READING.smoothing_s) -> tuple[Array, Array]:
    """Speed [rad/s] and acceleration [rad/s^2], (T, J) each, from angles (T, J) by a cubic over a moving window."""
    window = min(2 * half_window(period_s, window_s) + 1, (len(angle_rad) - 1) // 2 * 2 + 1)
    if window < LEAST_WINDOW:
        return np.zeros_like(angle_rad), np.zeros_like(angle_rad)
    speed: Array = savgol_filter(angle_rad, window, 3, deriv=1, delta=period_s, axis=0)
    acceleration: Array = savgol_filter(angle_rad, window, 3, deriv=2, delta=period_s, axis=0)
    return speed, acceleration


def in_band(force: Array, period_s: float, window_s: float) -> Array:
    """Forces (..., T) [N] by a cubic over a moving window, as accelerations are computed; as they are for no window."""
    window = _band_samples(force.shape[-1], period_s, window_s)
    return np.asarray(savgol_filter(force, window, 3, axis=-1), dtype=np.float64) if window else force


def noise_in_band(force: Array, period_s: float, window_s: float) -> float:
    """White noise [N] of a force (T,) that `in_band` keeps; 0 where it changes nothing.

    What it keeps is not white any more, and its third differences show a part of it only.
    """
    window = _band_samples(len(force), period_s, window_s)
    return white_noise(force) * float(np.linalg.norm(savgol_coeffs(window, 3))) if window else 0.0


def _band_samples(samples: int, period_s: float, window_s: float) -> int:
    """Samples of the window of `in_band`; 0 where nothing is smoothed."""
    window = min(2 * half_window(period_s, window_s) + 1, (samples - 1) // 2 * 2 + 1)
    return 0 if window_s == 0.0 or window < LEAST_WINDOW else window


def white_noise(values: Array, known: Flags | None = None) -> float:
    """Standard deviation of the white noise of a signal (T,) [its unit], from its third differences, which motion
    hardly affects.

    known: (T,) the samples to use.
    """
    difference = np.diff(values, 3)
    if known is not None:
        inside = known[3:] & known[2:-1] & known[1:-2] & known[:-3]
        difference = difference[inside]
    if not len(difference):
        return 0.0
    quiet = np.abs(difference)
    # Third differences of unit white noise have variance 1 + 9 + 9 + 1. Of quantised or quiet signals most are 0.
    trimmed = float(np.sqrt(np.mean(np.minimum(quiet, np.quantile(quiet, READING.noise_quantile)) ** 2)))
    return max(float(np.median(quiet)) / 0.6745, READING.quiet_noise_share * trimmed) / float(np.sqrt(20.0))


@lru_cache(maxsize=64)
def shown_noise(own: OwnReadings, period_s: float) -> float:
    """Share, 0 ... 1 [-], that third differences show of noise on samples to which lines lead from their own readings.

    Neighbouring samples then share a reading, so that their noise is smoother than white noise of its size.
    """
    read, number = np.isfinite(own.late_s), np.arange(len(own.late_s))
    noise = np.random.default_rng(READING.noise_seed).standard_normal(int(read.sum()))
    samples = np.interp(number, number[read] + own.late_s[read] / period_s, noise)
    return white_noise(samples) / float(np.std(samples))


def smoothed_over(values: Array, span: int) -> Array:
    """A signal (T,) [any unit] smoothed by quadratics over an odd number of samples; fewer than 5 change nothing."""
    if span < LEAST_WINDOW or len(values) <= span:
        return values
    (powers, inverse), half = _quadratic(span), span // 2
    smooth = np.asarray(correlate1d(values, middle_weights(span), mode="constant"), dtype=np.float64)
    smooth[:half] = powers[:half] @ (inverse @ values[:span])
    smooth[-half:] = powers[half + 1 :] @ (inverse @ values[-span:])
    return smooth


@cache
def middle_weights(span: int) -> Array:
    """Weights (span,) [-] of the samples of an odd window in the quadratic fitted to them, at its middle.

    Those of savgol_coeffs (Savitzky and Golay 1964).
    """
    powers, inverse = _quadratic(span)
    return np.asarray(powers[span // 2] @ inverse, dtype=np.float64)


@cache
def _quadratic(span: int) -> tuple[Array, Array]:
    """Powers (span, 3) of the places in a window, and their pseudo-inverse (3, span): from samples to a quadratic."""
    powers = np.vander(np.linspace(-1.0, 1.0, span), 3)
    return powers, np.asarray(np.linalg.pinv(powers), dtype=np.float64)


def slopes_over(values: Array, span: int, order: int, period_s: float) -> Array:
    """A derivative (T,) [unit/s] of a signal by quadratics over an odd number of samples; 0 for a signal too short."""
    span = max(span, LEAST_WINDOW)
    return savgol_filter(values, span, 2, order, period_s) if len(values) > span else np.zeros(len(values))


def without_noise(values: Array, period_s: float, noise: float) -> tuple[Array, int]:
    """A signal (T,) with its white noise reduced and its edges kept, and the window in samples (1: not smoothed).

    The noise of a model's input would otherwise appear as an error of the model. The filter fits quadratics by least
    squares (Savitzky and Golay 1964), without lag, over the window with the lowest cross-validation error.
    noise: standard deviation of the white noise [unit of the values], see white_noise.
    """
    span = smoothing_span(values, period_s, noise)
    if span == 1:
        return values, 1
    smooth = smoothed_over(values, span)
    around = smoothing_spans(values, period_s)[0]
    edge = (
        uniform_filter1d((np.abs(values - smooth) > READING.kept_edge_deviations * noise).astype(float), around) > 0.0
    )
    return np.where(edge, values, smooth), span


def smoothing_span(values: Array, period_s: float, noise: float) -> int:
    """Window [samples] with the lowest cross-validation error of a signal (T,); 1 where smoothing does not apply."""
    spans = smoothing_spans(values, period_s)
    return min(spans, key=lambda span: _left_out_error(values, span)) if spans and noise > 0.0 else 1


def smoothing_spans(values: Array, period_s: float) -> list[int]:
    """The windows of inputs in samples, odd, from LEAST_WINDOW to the length of the signal (T,) [any unit]."""
    spans = [2 * round(0.5 * seconds / period_s) + 1 for seconds in READING.input_windows_s]
    return [span for span in spans if LEAST_WINDOW <= span < len(values)]


def _left_out_error(values: Array, span: int) -> float:
    """Mean square error of each sample as predicted from its neighbours alone; the largest tenth is clipped."""
    own = float(middle_weights(span)[span // 2])
    error = np.abs(values - smoothed_over(values, span)) / (1.0 - own)
    return float(np.mean(np.minimum(error, np.quantile(error, READING.noise_quantile)) ** 2))
