"""Valve and dead time in the kernel: lag, rates, supply, delay, against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hand_model.kernel.closed_loop import HISTORY, ClosedLoop
from hand_model.kernel.layout import P
from hand_model.kernel.rows import ROW, STATES, STEP_S

TAU, PERIOD_S = 0.05, 0.005
UNLIMITED = {"valve__fill_rate_pa_per_s": 1e9, "valve__vent_rate_pa_per_s": 1e9}


def lag(time: Any, begin_s: Any) -> Any:
    """First-order answer at `time` to a unit step at begin_s."""
    return 1.0 - np.exp(-np.maximum(time - begin_s, 0.0) / TAU)


@pytest.mark.parametrize("dead_steps", [0.0, 1.0, 7.0, 10.0, 23.0, 100.0, 0.3, 4.5, 9.99, 24.7])
def test_dead_time_is_exact(joint: Any, dead_steps: float) -> None:
    """Broken by a delay off by a step or a sample, or rounded to either; longer than a sample too.

    A dead time that ends inside a step is exact in area, so that only (h / tau)^2 / 8 is left.
    """
    samples, u = 60, 3e5
    states = joint.run(np.full((samples, 1), u), PERIOD_S, valve__dead_time_s=dead_steps * STEP_S, **UNLIMITED)
    time = np.arange(samples + 1) * PERIOD_S
    expected = u * lag(time, dead_steps * STEP_S)
    whole = dead_steps == int(dead_steps)
    np.testing.assert_allclose(states[:, P, 0], expected, atol=u * (1e-9 if whole else 1.3e-5))
    assert np.all(states[time <= dead_steps * STEP_S - STEP_S, P] == 0.0)


@pytest.mark.parametrize("rate_hz", [30.0, 200.0, 333.0, 1000.0, 1999.0])
def test_changing_set_points_arrive_in_order(joint: Any, rate_hz: float) -> None:
    """Broken by a dead-time memory that mixes up samples: the answer is the sum of its delayed steps."""
    rng = np.random.default_rng(11)
    dead_s, period_s, samples = 0.0123, 1.0 / rate_hz, 200
    u = rng.uniform(0.0, 6e5, samples)
    states = joint.run(u[:, None], period_s, valve__dead_time_s=dead_s, **UNLIMITED)
    time = np.arange(samples + 1) * period_s
    expected = lag(time[:, None], time[:-1] + dead_s) @ np.diff(u, prepend=0.0)
    np.testing.assert_allclose(states[:, P, 0], expected, atol=6e5 * 4e-5)


def test_supply_is_the_limit(joint: Any) -> None:
    """Broken by a valve that gives more than the supply, or less than nothing."""
    commands = np.repeat([9e5, -3e5], 400)[:, None]
    pressure = joint.run(commands, PERIOD_S)[:, P, 0]
    assert pressure.max() == pytest.approx(6e5, rel=1e-6)
    assert pressure.max() <= 6e5
    assert pressure.min() >= 0.0
    assert pressure[-1] < 1.0


def test_rates_limit_filling_and_venting_apart(joint: Any) -> None:
    """Broken by a swapped or missing rate limit."""
    fill, vent = 1e6, 4e5
    limits = {"valve__fill_rate_pa_per_s": fill, "valve__vent_rate_pa_per_s": vent, "valve__dead_time_s": 0.0}
    pressure = joint.run(np.repeat([6e5, 0.0], 400)[:, None], PERIOD_S, **limits)[:, P, 0]
    slope = np.diff(pressure) / PERIOD_S
    assert slope.max() == pytest.approx(fill, rel=1e-9)
    assert slope.min() == pytest.approx(-vent, rel=1e-9)


def test_dead_time_beyond_the_memory_is_refused(joint: Any) -> None:
    """Broken by a delay that wraps around the ring of set-points, or a period that is not a positive number."""
    parameters, alone, state = joint.parameters()[None], np.array([-1]), np.zeros((1, STATES, 1))
    parameters[:, ROW["valve.dead_time_s"]] = 0.05
    with pytest.raises(ValueError, match=r"valve\.dead_time_s is 0\.05; .* allowed range is 0 to 0\.0126"):
        ClosedLoop(parameters, alone, state, 1e-4)
    assert HISTORY * STEP_S > 0.05
    for period_s in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="period_s"):
            ClosedLoop(parameters, alone, state, period_s)
