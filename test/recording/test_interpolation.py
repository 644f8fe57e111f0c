"""Interpolation, holding and bridging: closed forms and limit cases."""

from __future__ import annotations

import numpy as np
import pytest

from hand_recording.interpolation import bridge, in_force, interpolate, refine


@pytest.mark.parametrize("unit", [1.0, 1_000_000_000])
def test_a_straight_line_stays_one_except_in_gaps(unit: float) -> None:
    """Fails when interpolation is off the line, reaches into a gap or beyond the ends, or depends on the unit."""
    stamps = np.array([0, 1, 2, 5, 6]) * unit
    stamps = stamps.astype(np.int64) if unit > 1 else stamps
    times = (np.array([-0.5, 0.0, 0.25, 2.0, 3.5, 5.0, 5.5, 6.5]) * unit).astype(stamps.dtype)
    found = interpolate(times, stamps, np.column_stack([stamps / unit, -2 * stamps / unit]), 1.5 * unit)
    expected = np.array([np.nan, 0.0, 0.25, 2.0, np.nan, 5.0, 5.5, np.nan])
    assert np.allclose(found[:, 0], expected, equal_nan=True)
    assert np.allclose(found[:, 1], -2 * expected, equal_nan=True)
    assert np.allclose(interpolate(times, stamps, stamps / unit, 1.5 * unit), expected, equal_nan=True)


def test_a_sample_next_to_nan_is_that_sample() -> None:
    """Fails when a NaN neighbour spoils a time that equals a stamp."""
    found = interpolate(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0]), np.array([3.0, np.nan]), 2.0)
    assert found[0] == 3.0
    assert np.isnan(found[1:]).all()


def test_one_sample_and_none() -> None:
    """Fails when a topic of one message, or of none, raises or gives numbers at other times."""
    times = np.array([0.0, 1.0, 2.0])
    assert np.array_equal(
        interpolate(times, np.array([1.0]), np.array([7.0]), 9.0), [np.nan, 7.0, np.nan], equal_nan=True
    )
    assert np.isnan(interpolate(times, np.empty(0), np.empty((0, 2)), 9.0)).all()
    assert in_force(times, np.array([0.5, 2.0])).tolist() == [-1, 0, 1]


def test_bridge_joins_the_known_samples() -> None:
    """Fails when a gap is not bridged linearly, ends do not hold, or an unknown column is not 0."""
    values = np.array([[np.nan, np.nan], [1.0, np.nan], [np.nan, np.nan], [3.0, np.nan], [np.nan, np.nan]])
    filled, known = bridge(values)
    assert filled[:, 0].tolist() == [1.0, 1.0, 2.0, 3.0, 3.0]
    assert filled[:, 1].tolist() == [0.0] * 5
    assert known.tolist() == np.isfinite(values).tolist()
    assert bridge(values[:, 0])[0].tolist() == filled[:, 0].tolist()


def test_refine_keeps_the_samples() -> None:
    """Fails when a finer grid does not pass through the samples, or is not linear between them."""
    values = np.random.default_rng(0).normal(size=(6, 2))
    fine = refine(values, 4)
    assert fine.shape == (21, 2)
    assert np.array_equal(fine[::4], values)
    assert np.allclose(np.diff(fine[4:9], 2, axis=0), 0.0, atol=1e-15)
    assert np.array_equal(refine(values[:, 0], 4), fine[:, 0])
