"""Creep as a sum of retardation terms, Eqs. 9 and 10: the continuous spectrum f(tau) >= 0 on a grid of times.

D(t) = D0 + sum_i c_i (1 - exp(-t / tau_i)) with c_i >= 0. Under a varying input each term is a first-order lag of it,
so that a recording determines the c_i by non-negative least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.signal import lfilter

from hand_model.arrays import Array, Flags


@dataclass(frozen=True, slots=True)
class Prony:
    """Eq. 10 on a grid: instantaneous compliance d0, strengths (n,), retardation times (n,) [s]."""

    d0: float
    strengths: Array
    times_s: Array

    def creep_compliance(self, time_s: Array) -> Array:
        """D(t), Eq. 9 (one term) and Eq. 10 (many), for a unit step at 0."""
        terms = 1.0 - np.exp(-np.asarray(time_s)[:, None] / self.times_s)
        compliance: Array = self.d0 + terms @ self.strengths
        return compliance

    def response(self, driver: Array, period_s: float) -> Array:
        """Response (T,) to a driver (T,) sampled every period_s [s], from rest: Eq. 10 by superposition."""
        response: Array = self.d0 * driver + lagged(driver, self.times_s, period_s) @ self.strengths
        return response


def lagged(driver: Array, times_s: Array, period_s: float) -> Array:
    """The driver (T,) [any unit] through first-order lags (T, n) of Eq. 9, exact for a driver held between samples."""
    columns = []
    for tau in times_s:
        keep = np.exp(-period_s / tau)
        columns.append(lfilter([0.0, 1.0 - keep], [1.0, -keep], driver))
    return np.array(columns).T


def fit_prony(driver: Array, response: Array, times_s: Array, period_s: float, use: Flags) -> Prony:
    """Strengths [response/driver] of Eq. 10 by non-negative least squares over the samples in use (T,)."""
    table = np.column_stack([driver, lagged(driver, times_s, period_s)])
    weights, _ = nnls(table[use], response[use])
    return Prony(float(weights[0]), weights[1:], np.asarray(times_s))
