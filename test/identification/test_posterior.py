"""The covariance of a fit's coordinates, also where a matrix rounds to a singular one."""

from __future__ import annotations

import numpy as np
import pytest

from hand_identification.posterior import covariance_of, posterior_of


@pytest.mark.parametrize("grade", [1.0, 1e4, 1e10])
def test_a_precision_is_inverted(grade: float) -> None:
    """Fails when covariance or determinant are wrong, or lose the digits of a matrix whose rows differ in size."""
    rng = np.random.default_rng(3)
    print("seed 3")
    size = np.geomspace(1.0, grade, 6)
    slopes = rng.standard_normal((40, 6))
    precision = (np.eye(6) + slopes.T @ slopes) * np.outer(size, size)
    covariance, logdet = posterior_of(precision)
    exact = np.linalg.inv(np.eye(6) + slopes.T @ slopes) / np.outer(size, size)
    np.testing.assert_allclose(covariance, exact, rtol=1e-10)
    assert logdet == pytest.approx(np.linalg.slogdet(precision)[1], abs=1e-9)


def test_nothing_is_known_of_no_coordinate() -> None:
    """Fails when a model without free numbers has no covariance."""
    covariance, logdet = posterior_of(np.zeros((0, 0)))
    assert covariance.shape == (0, 0)
    assert logdet == 0.0


@pytest.mark.parametrize("size", [1e20, 1e40, 1e120])
def test_a_simulation_that_almost_diverges_has_a_covariance(size: float) -> None:
    """Fails when slopes so large that the prior is lost in rounding end a diagnosis, or count as evidence."""
    slope = np.array([1.0, 2.0, 3.0])
    normal = size * np.outer(slope, slope)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.inv(np.eye(3) + normal)
    covariance = covariance_of(normal)
    assert np.isfinite(covariance).all()
    values = np.linalg.eigvalsh(covariance)
    assert values.min() >= -1e-12 * values.max()  # rounded
    assert posterior_of(np.eye(3) + normal)[1] >= np.log1p(size * slope @ slope)


def test_an_indefinite_precision_gives_no_information() -> None:
    """Fails when a number whose information is lost in rounding ends the fit of a cause, or counts as known."""
    precision = np.array([[1e20, 0.0], [0.0, -1e3]])
    covariance, logdet = posterior_of(precision)
    assert covariance[0, 0] == pytest.approx(1e-20, rel=0.1)  # the diagonal is raised
    assert covariance[1, 1] > 1e-6
    assert np.isfinite(logdet)


def test_a_precision_without_a_scale_ends_at_once() -> None:
    """Fails when the diagonal of a matrix that cannot be scaled is raised for ever."""
    with np.errstate(divide="ignore", invalid="ignore"), pytest.raises(np.linalg.LinAlgError, match="no finite scale"):
        posterior_of(np.zeros((2, 2)))


def test_a_simulation_that_diverges_has_no_evidence() -> None:
    """Fails when slopes that are not finite end a diagnosis, or count as evidence."""
    for broken in (np.inf, np.nan):
        covariance, logdet = posterior_of(np.array([[2.0, 0.0], [0.0, broken]]))
        assert not covariance.any()
        assert logdet == np.inf
