"""Sparse regression of what no effect explains, against an independent implementation."""

from __future__ import annotations

import numpy as np
import pytest
from pysindy import STLSQ

from hand_diagnosis.remainders import thresholded_least_squares


@pytest.mark.filterwarnings("ignore:Sparsity parameter is too big:UserWarning")
@pytest.mark.parametrize("seed", range(20))
def test_thresholded_least_squares_is_that_of_pysindy(seed: int) -> None:
    """Fails when the penalty, the order of removal or the last unbiased fit differs from the published algorithm."""
    rng = np.random.default_rng(seed)
    table = rng.standard_normal((300, 11))
    table[:, 3] = table[:, 2] + 0.3 * table[:, 3]  # correlated terms, as powers of one state are
    truth = rng.standard_normal(11) * (rng.random(11) < 0.4)
    target = table @ truth + 0.1 * rng.standard_normal(300)
    reference = STLSQ(threshold=0.05, alpha=1e-3, normalize_columns=False, max_iter=10).fit(table, target[:, None])
    found = thresholded_least_squares(table, target, 0.05)
    np.testing.assert_allclose(found, np.ravel(reference.coef_), atol=1e-9)
    assert np.count_nonzero(found) < 11


def test_nothing_is_found_in_noise_below_the_threshold() -> None:
    """Fails when a coefficient below the threshold is kept."""
    rng = np.random.default_rng(0)
    table = rng.standard_normal((400, 5))
    assert not thresholded_least_squares(table, 1e-3 * rng.standard_normal(400), 0.05).any()
