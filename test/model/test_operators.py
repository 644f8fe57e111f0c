"""Operators that several effects share, against NumPy: sine and cosine, decay, lags, loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pytest import approx

from hand_model.effects import operators


def call(name: str, *arguments: float) -> Any:
    """An operator as plain Python."""
    function = getattr(operators, name)
    return getattr(function, "py_func", function)(*arguments)


def test_sine_and_cosine_are_exact_to_3e_7_and_finite() -> None:
    """Fails when a term of the series is wrong, an angle is not reduced to half a turn, or a huge one overflows."""
    for x in np.concatenate([np.linspace(-np.pi, np.pi, 101), np.linspace(-20.0, 20.0, 41), [1e3, -1e4]]):
        sine, cosine = call("sine_cosine", float(x))
        assert (sine, cosine) == (approx(np.sin(x), abs=3e-7), approx(np.cos(x), abs=3e-7)), x
    assert call("sine_cosine", 0.0) == (0.0, 1.0)
    for x in (1e18, -1e300):
        assert np.all(np.isfinite(call("sine_cosine", x)))


def test_decay_is_the_exponential_to_3e_6() -> None:
    """Fails when a term of the series, the eighth or the eighth power is wrong, or a long time does not end in 0."""
    x = np.concatenate([np.linspace(0.0, 8.0, 161), np.linspace(9.0, 60.0, 52)])
    np.testing.assert_allclose([call("decay", float(value)) for value in x], np.exp(-x), atol=3e-6)
    assert call("decay", 1e30) == 0.0


def test_lag_without_a_time_constant_keeps_nothing() -> None:
    """Fails when a lag of no time constant remembers, or one of a tiny time constant remembers more than nothing."""
    assert call("lag_constants", 0.0, 1e-3) == (0.0, 0.0)
    assert call("lag_constants", 0.5, 1e-3) == (approx(np.exp(-2e-3), abs=1e-9), approx(500.0))
    kept = [call("lag_constants", tau, 1e-3)[0] for tau in (1e-3, 1e-4, 1e-5, 1e-9)]
    assert kept == sorted(kept, reverse=True)
    assert kept[-1] < 1e-12
    assert call("two_lag_constants", 0.5, 0.25, 1e-3)[1::2] == (approx(375.0), approx(125.0))


@pytest.mark.parametrize("toward", [1.0, -1.0])
@pytest.mark.parametrize("a", [-0.9, -0.2, 0.0, 0.4, 1.0])
def test_loop_takes_its_growth_implicitly(a: float, toward: float) -> None:
    """Fails when a long motion overshoots, or the implicit step is not that of the linearised equation.

    a: loop state in the direction of motion. Dahl's equation is linear: z' = 1 - z has the implicit solution
    (z + s) / (1 + s). For Bouc's and Wen's the derivative of z^2 enters while loading.
    """
    for way in (1e-3, 0.3, 2.0, 50.0):
        for sharp, expected in (
            (0.0, (a + way) / (1.0 + way)),
            (1.0, a + way * (1.0 - max(a, 0.0) ** 2) / (1.0 + 2.0 * max(a, 0.0) * way)),
            (0.5, a + way * (1.0 - 0.5 * a - 0.5 * max(a, 0.0) ** 2) / (1.0 + way * (0.5 + max(a, 0.0)))),
        ):
            moved = call("loop_moved", a * toward, 0.2, 0.2 + 0.1 * way * toward, 10.0, sharp)
            assert moved * toward == approx(min(expected, 1.0), abs=1e-9), (way, sharp)
    assert call("loop_moved", a, 0.2, 0.2, 10.0, 0.0) == approx(a, abs=1e-15)


def test_direction_passes_through_standstill_without_a_jump() -> None:
    """Fails when the direction of motion jumps at standstill, or is not the sign of the speed beyond 1e-6 rad/s."""
    for omega, expected in ((0.0, 0.0), (5e-7, 0.5), (-5e-7, -0.5), (3.0, 1.0), (-3.0, -1.0)):
        assert call("direction", omega) == approx(expected)
