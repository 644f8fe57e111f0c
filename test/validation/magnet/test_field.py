"""The magnetostatics against exact fields and another library, and the nonlinearity measure."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest

from validation.magnet.contour import GENES, METHODS, contour_m, magnet_of, optimise
from validation.magnet.field import Magnet, disc_field, radial_field
from validation.magnet.linearity import (
    AMPLITUDE_V,
    joint_nonlinearity,
    nonlinearity_percent,
    position_error_deg,
)


def test_a_ring_is_the_difference_of_two_discs() -> None:
    """Fails when stiffness, magnetisation, outer condition or the evaluation of B_n is wrong by more than 1e-6."""
    angle, field = radial_field(Magnet(np.array([2.5e-3]), 1e-3, 3.5e-3))
    exact = disc_field(2.5e-3, 1.0, 3.5e-3, angle) - disc_field(1e-3, 1.0, 3.5e-3, angle)
    assert np.abs(field - exact).max() < 1e-6 * exact.max()


@pytest.mark.parametrize("inner_mm", [0.8, 1.6])
def test_a_half_ring_agrees_with_magpylib(inner_mm: float) -> None:
    """Fails when a part of a ring is magnetised, cut or meshed wrongly: magpylib integrates charges instead."""
    magnet = Magnet(np.array([2.5e-3]), inner_mm * 1e-3, 3.4e-3, np.pi)
    angle, field = radial_field(magnet)
    at = np.radians(np.arange(10.0, 171.0, 20.0))
    segment = magpylib.magnet.CylinderSegment(dimension=(inner_mm * 1e-3, 2.5e-3, 1.0, -90, 90), polarization=(0, 1, 0))
    vectors = segment.getB(3.4e-3 * np.c_[np.cos(at), np.sin(at), 0 * at])
    theirs = vectors[:, 0] * np.cos(at) + vectors[:, 1] * np.sin(at)
    assert np.abs(np.interp(at, angle, field) - theirs).max() < 3e-4


def test_finer_elements_converge() -> None:
    """Fails when the error of a bent contour does not fall with the mesh."""
    magnet = magnet_of(np.full(GENES, 0.1e-3) * np.linspace(0.0, 1.0, GENES))
    fields = [radial_field(magnet, n) for n in (24, 48, 96)]
    at = np.radians([20.0, 50.0, 80.0])
    values = [np.interp(at, *field) for field in fields]
    assert np.abs(values[1] - values[2]).max() < 0.5 * np.abs(values[0] - values[2]).max()


def test_nonlinearity_is_table_1s_for_a_sine() -> None:
    """Fails when Eq. 2 is read in another way or the samples are not every degree."""
    found = []
    for low, high in ((-45, 45), (-55, 55)):
        found.append(nonlinearity_percent(AMPLITUDE_V * np.sin(np.radians(np.arange(low, high + 1.0)))))
    assert np.round(found, 3).tolist() == [0.014, 0.039]
    with pytest.raises(ValueError, match="span"):
        nonlinearity_percent(np.ones(5))


def test_a_straight_field_has_no_error() -> None:
    """Fails when the position error of a perfectly linear field is not 0."""
    angle = np.linspace(0.0, np.pi, 181)
    assert np.abs(position_error_deg(angle, 0.1 * angle)[1]).max() < 1e-9


def test_contours_stay_in_range_and_are_mirrored() -> None:
    """Fails when Eq. 4 leaves the magnet's range or its ends have a kink (a gene at 0 counted twice)."""
    rng = np.random.default_rng(3)
    contour = contour_m(rng.uniform(0.0, 0.45e-3, GENES))
    assert 2.2e-3 <= contour.min() <= contour.max() <= 2.9e-3
    flat = contour_m(np.full(GENES, 0.02e-3))
    assert np.ptp(flat) < 0.02e-3 * 0.2


@pytest.mark.parametrize("method", METHODS)
def test_a_search_improves_and_repeats(method: str) -> None:
    """Fails when a method ignores its budget or seed, or does not improve on its first point."""
    counted: list[int] = []
    first = optimise(method, 60, 5, counted.append)
    again = optimise(method, 60, 5, lambda _: None)
    used = len(first.history_deg)
    assert sum(counted) == used
    assert used <= 60 if method == "lsq" else used == 60
    assert first.cost_deg < 0.7 * first.history_deg[0]
    assert first.cost_deg == again.cost_deg


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_least_squares_reaches_the_bound_of_the_paper(seed: int) -> None:
    """Fails when the contour by least squares misses the +-0.5 degree of Fig. 6, checked on a finer mesh than its own.

    Also when a round ring meets the bound, so that it would need no optimisation.
    """
    found = optimise("lsq", 100, seed, lambda _: None)
    error = position_error_deg(*radial_field(magnet_of(found.genes_m), 60))[1]
    assert np.abs(error).max() <= 0.5
    assert np.abs(position_error_deg(*radial_field(magnet_of(np.zeros(GENES)), 60))[1]).max() > 5.0


def test_half_ring_is_less_linear_than_the_ring() -> None:
    """Fails when the order of Table 1 is lost."""
    ring = joint_nonlinearity(*radial_field(Magnet(np.array([2.5e-3]), 1e-3, 3.7e-3)))
    half = joint_nonlinearity(*radial_field(Magnet(np.array([2.5e-3]), 1e-3, 3.7e-3, np.pi)))
    assert half[0] > 2.0 * ring[0]
    assert half[1] > 2.0 * ring[1]


def test_impossible_radii_are_named() -> None:
    """Fails when a magnet that reaches the sensor is meshed all the same."""
    with pytest.raises(ValueError, match="must increase"):
        Magnet(np.array([3.6e-3]), 1e-3, 3.5e-3)
