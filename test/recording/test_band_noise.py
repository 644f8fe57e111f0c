"""The noise of a force that is smoothed over a window: by drawing it, for every window of a machine."""

from __future__ import annotations

import numpy as np
import pytest

from hand_recording.signals import in_band, noise_in_band, white_noise


@pytest.mark.parametrize("samples", [5, 9, 21, 61])
def test_the_noise_that_a_window_keeps_is_that_of_a_draw(samples: int) -> None:
    """Fails when the noise of a smoothed force is taken from the smoothed force, which shows a part of it, or wrong."""
    seed = 7
    print(f"seed {seed}")
    force = 2.0 * np.random.default_rng(seed).standard_normal(20_000)
    smooth = in_band(force, 0.01, 0.01 * (samples - 1))
    kept = noise_in_band(force, 0.01, 0.01 * (samples - 1))
    assert kept == pytest.approx(float(np.std(smooth)), rel=0.04)
    assert white_noise(smooth) < 0.6 * kept


def test_no_window_keeps_every_force() -> None:
    """Fails when a force that is not smoothed is said to have noise of a band."""
    force = np.random.default_rng(8).standard_normal(100)
    assert noise_in_band(force, 0.01, 0.0) == 0.0
    assert in_band(force, 0.01, 0.0) is force
