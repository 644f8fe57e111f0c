"""A model's residual drives the next stage by what is more than noise, and by nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from hand_recording.local_smoothing import NOISE, local_windows, smoothed_by
from hand_recording.signals import middle_weights, smoothed_over

PERIOD_S, SIGMA, SAMPLES, SEED = 0.01, 178.0, 3000, 17


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.fixture
def noise() -> np.ndarray:
    print(f"seed {SEED}")
    return SIGMA * np.random.default_rng(SEED).standard_normal(SAMPLES)


def quiet(residual: np.ndarray, sigma: np.ndarray | float = SIGMA) -> np.ndarray:
    return smoothed_by(residual, local_windows(residual, PERIOD_S, sigma * np.ones(SAMPLES)))


def test_white_noise_leaves_no_wander(noise: np.ndarray) -> None:
    """Fails when the noise of a right model is smoothed into a slow wander instead of taken away."""
    left = quiet(noise)
    slow = np.convolve(left, np.ones(100) / 100.0, "valid")
    assert float(np.mean(left == 0.0)) > 0.9
    assert rms(slow) < 0.05 * SIGMA


def test_an_edge_stays_where_it_is(noise: np.ndarray) -> None:
    """Fails when the step of a wrong model is spread over a window, or not believed: the readings are nearer then."""
    step = np.where(np.arange(SAMPLES) < 1500, 0.0, 20.0 * SIGMA)
    error = quiet(step + noise) - step
    assert rms(error[1400:1600]) < SIGMA
    assert rms(error[200:1300]) < 0.3 * SIGMA


def test_a_slow_error_of_a_model_is_kept(noise: np.ndarray) -> None:
    """Fails when an error of a few standard deviations that lasts is taken for noise."""
    drift = 3.0 * SIGMA * np.sin(2.0 * np.pi * np.arange(SAMPLES) * PERIOD_S / 6.0)
    assert rms(quiet(drift + noise) - drift) < 0.35 * SIGMA


def test_noise_that_grows_in_motion_is_still_noise(noise: np.ndarray) -> None:
    """Fails when the errors of jittering stamps in fast motion pass, because at rest the noise is smaller."""
    sigma = np.where(np.arange(SAMPLES) % 400 < 60, 8.0 * SIGMA, SIGMA)
    rough = noise * sigma / SIGMA
    known = smoothed_by(rough, local_windows(rough, PERIOD_S, sigma))
    alike = smoothed_by(rough, local_windows(rough, PERIOD_S, np.full(SAMPLES, SIGMA)))
    assert rms(known) < 0.5 * rms(alike)


def test_a_window_of_no_samples_is_zero_and_of_one_the_sample() -> None:
    """Fails when the two ends of the range of windows do not mean what they say."""
    values = np.arange(40.0)
    windows = np.where(np.arange(40) < 20, NOISE, 1)
    assert np.array_equal(smoothed_by(values, windows), np.where(np.arange(40) < 20, 0.0, values))


@pytest.mark.parametrize("span", [5, 21, 1001])
def test_quadratics_are_those_of_savitzky_and_golay(noise: np.ndarray, span: int) -> None:
    """Fails when a window or an end of a signal is smoothed otherwise than by SciPy."""
    np.testing.assert_allclose(middle_weights(span), savgol_coeffs(span, 2), atol=1e-12)
    np.testing.assert_allclose(smoothed_over(noise, span), savgol_filter(noise, span, 2), atol=1e-9 * SIGMA)
