"""Operators that several effects share, against NumPy: sine and cosine, decay, lags, loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pytest import approx
from scipy.linalg import expm

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


@pytest.mark.parametrize("inertia", [0.0, 1e-6, 0.1, 0.2493, 0.25, 0.2507, 0.5, 3.0])
def test_a_lag_with_inertia_is_the_exponential_of_its_matrix(inertia: float) -> None:
    """Fails when a constant of mu d'' + d' + d = 0 is wrong for real, equal or complex poles, or without inertia."""
    tau, h = 0.03, 5e-3
    even, odd, slowness = call("second_order_constants", tau, inertia, h)
    assert slowness == tau * (1.0 / h)
    got = np.array([[even + odd, 2.0 * inertia * odd], [-2.0 * odd, even - odd]])
    mu = max(inertia, 1e-9)
    exact = expm(h / tau * np.array([[0.0, 1.0], [-1.0 / mu, -1.0 / mu]]))
    assert got == approx(exact, abs=3e-4)
    if inertia == 0.0:
        assert even + odd == call("lag_constants", tau, h)[0]
        assert call("second_order_constants", 0.0, inertia, h) == (0.0, 0.0, 0.0)


def loop_after(a: float, way: float, sharp: float) -> float:
    """Exact loop state after a way in the direction of motion: Dahl's, or Bouc's and Wen's of the second power."""
    if sharp == 0.0:
        return 1.0 - (1.0 - a) * float(np.exp(-way))
    straight = min(max(-a, 0.0), way)  # unloading, z' = 1
    loading = a + straight
    return loading if loading < 0.0 else float(np.tanh(np.arctanh(loading) + way - straight))


@pytest.mark.parametrize("sharp", [0.0, 1.0])
@pytest.mark.parametrize("toward", [1.0, -1.0])
@pytest.mark.parametrize("a", [-0.9, -0.2, 0.0, 0.4, 0.99])
def test_loop_follows_its_equation_to_second_order(a: float, toward: float, sharp: float) -> None:
    """Fails when a step of the loop errs by more than the cube of its length, or stands still where it must not."""
    for way in (1e-3, 0.01, 0.1):
        moved = call("loop_moved", a * toward, 0.2, 0.2 + 0.1 * way * toward, 10.0, sharp) * toward
        assert moved == approx(loop_after(a, way, sharp), abs=0.5 * way**3 + 1e-12), way
    assert call("loop_moved", a, 0.2, 0.2, 10.0, sharp) == approx(a, abs=1e-15)


@pytest.mark.parametrize("sharp", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("a", [-0.9, 0.0, 0.6, 1.0])
def test_loop_closes_after_a_long_motion_and_never_overshoots(a: float, sharp: float) -> None:
    """Fails when a motion of many loop lengths in one step leaves the loop open, or takes it beyond 1."""
    for way in (1.0, 10.0, 1e4):
        states = [a]
        for _ in range(3):
            states.append(call("loop_moved", states[-1], 0.2, 0.2 + 0.1 * way, 10.0, sharp))
        assert states == sorted(states)
        assert states[-1] <= 1.0
        if way > 5.0:
            assert states[-1] > 0.99


def test_direction_passes_through_standstill_without_a_jump() -> None:
    """Fails when the direction of motion jumps at standstill, or is not the sign of the speed beyond 1e-6 rad/s."""
    for omega, expected in ((0.0, 0.0), (5e-7, 0.5), (-5e-7, -0.5), (3.0, 1.0), (-3.0, -1.0)):
        assert call("direction", omega) == approx(expected)
