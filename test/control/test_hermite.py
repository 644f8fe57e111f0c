"""Curves of trajectories are those of scipy.interpolate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from hand_control.hermite import HermiteCurve, monotone_slopes


@pytest.mark.parametrize("points", [2, 3, 40])
@pytest.mark.parametrize("seed", range(5))
def test_curves_are_those_of_scipy(points: int, seed: int) -> None:
    """Fails when a cubic, its slope, a monotone slope or an interval is wrong, also beyond the ends."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(1e-3, 0.5, points))
    position = np.round(rng.uniform(-0.2, 1.7, (points, 4)), 1)  # some are equal, and many turn
    slopes = monotone_slopes(times, position)
    expected = PchipInterpolator(times, position).derivative()(times)
    expected[[0, -1]] = 0.0
    np.testing.assert_allclose(slopes, expected, rtol=1e-9, atol=1e-9)
    for given in (slopes, rng.uniform(-5.0, 5.0, (points, 4))):
        curve, spline = HermiteCurve(times, position, given), CubicHermiteSpline(times, position, given)
        for at in (*times, *rng.uniform(times[0], times[-1], 50), times[0] - 0.01, times[-1] + 0.01):
            found, speed = curve.at(float(at))
            np.testing.assert_allclose(found, spline(at), rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(speed, spline.derivative()(at), rtol=1e-9, atol=1e-8)


def test_slopes_of_absurd_steps_are_finite() -> None:
    """Fails when a step near the smallest number gives NaN, or a warning."""
    times = np.array([0.0, 1.0, 2.0, 3.0])
    position = np.array([[0.0, 1e300], [5e-324, -1e300], [1e-323, 1e300], [1.0, 1e300]])
    assert np.isfinite(monotone_slopes(times, position)).all()
