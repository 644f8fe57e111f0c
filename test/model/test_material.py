"""The three-zone material law, Eq. 12 and 13, alone and in the kernel."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from hand_model.kernel.layout import CREEP, PHI, P
from hand_model.material import creep_course, creep_rate

P_MIN, B1, T_EXT, B0, T_REC = 0.5e5, 1 / 5.5e5, 25.0, 1 / 4.5e5, 40.0
SUPPLY = 6e5


def rate(p: float, creep: float) -> float:
    return float(creep_rate(p, creep, P_MIN, B1, 1 / T_EXT, B0, 1 / T_REC))


def settled(joint: Any, pressure_pa: float, seconds: float, creep: float) -> Any:
    """Creep and time of a joint whose pressure is, and stays, pressure_pa."""
    state = np.array([[pressure_pa], [0.5], [0.0], [creep]])
    commands = np.full((int(seconds / 0.1), 1), pressure_pa)
    states = joint.run(commands, 0.1, state, valve__dead_time_s=0.0)
    np.testing.assert_allclose(states[:, P, 0], pressure_pa, rtol=1e-12)
    return np.arange(len(states)) * 0.1, states[:, CREEP, 0]


def test_extension_step_is_equation_13(joint: Any) -> None:
    """Broken by a wrong zone, target or time constant of extension."""
    p = 3e5
    time, creep = settled(joint, p, 100.0, 0.0)
    np.testing.assert_allclose(creep, B1 * (p - P_MIN) * (1 - np.exp(-time / T_EXT)), atol=1e-9)


def test_recovery_step_is_equation_13(joint: Any) -> None:
    """Broken by a wrong zone, target or time constant of recovery."""
    p = 0.9e5
    time, creep = settled(joint, p, 100.0, 0.8)
    np.testing.assert_allclose(creep, B0 * p + (0.8 - B0 * p) * np.exp(-time / T_REC), atol=1e-9)


def test_hold_zone_holds(joint: Any) -> None:
    """Broken by creep between p_0(A) = A / b_0 and p_1(A) = p_min + A / b_1."""
    creep = 0.4
    low, high = creep / B0, P_MIN + creep / B1
    for p in np.linspace(low, high, 5):
        assert rate(p, creep) == approx(0.0, abs=1e-15)
        assert settled(joint, p, 20.0, creep)[1] == approx(creep, abs=1e-12)
    assert rate(high + 100.0, creep) > 0.0
    assert rate(low - 100.0, creep) < 0.0


def test_rate_is_continuous_at_the_boundaries() -> None:
    """Broken by zones that do not join: a jump of A' would make the limit cycle of Eq. 12 chatter."""
    creep = 0.3
    for boundary in (creep / B0, P_MIN + creep / B1):
        assert rate(boundary - 1e-3, creep) == approx(rate(boundary + 1e-3, creep), abs=1e-9)


valid_material = st.tuples(
    st.floats(1.0, 5.9e5),  # p_min
    st.floats(0.01, 1.0),  # b1 as a share of its largest allowed value
    st.floats(1.0, 10.0),  # b0 / b1
    st.floats(0.01, 300.0),
    st.floats(0.01, 300.0),
)


@settings(max_examples=60, deadline=None)
@given(valid_material, st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.sampled_from([0.005, 0.05, 1.0]))
def test_ratio_stays_in_0_to_1(joint: Any, material: Any, seed: int, start: float, period_s: float) -> None:
    """Broken by parameters the loader accepts for which A leaves [0, 1]; pressures jump at random within supply."""
    p_min, share, b0_over_b1, extension_s, recovery_s = material
    b1 = share / (SUPPLY - p_min)
    rng = np.random.default_rng(seed)
    commands = rng.uniform(0.0, SUPPLY, 100) * (rng.random(100) < 0.7)
    states = joint.run(
        commands[:, None],
        period_s,
        np.array([[0.0], [0.0], [0.0], [start]]),
        material__p_min_pa=p_min,
        material__b1_per_pa=b1,
        material__b0_per_pa=min(b0_over_b1 * b1, 1e-3),
        material__extension_time_s=extension_s,
        material__recovery_time_s=recovery_s,
    )
    assert states[:, CREEP].min() >= 0.0
    assert states[:, CREEP].max() <= 1.0 + 1e-12


def test_staircase_drifts_and_has_hysteresis_like_figure_13(joint: Any) -> None:
    """Broken by a model without the memory of Fig. 13: drift over tens of seconds, another angle on the way down."""
    stairs = np.concatenate([np.arange(0.5, 4.0, 0.5), np.arange(3.0, 0.0, -0.5)]) * 1e5
    hold_s, period_s = 15.0, 0.1
    states = joint.run(np.repeat(stairs, round(hold_s / period_s))[:, None], period_s)
    angle = np.degrees(states[1:, PHI, 0]).reshape(len(stairs), -1)
    after_1_s, at_the_end = angle[:, 10], angle[:, -1]
    assert 60.0 < angle.max() < 100.0
    assert (at_the_end - after_1_s)[1:7].min() > 1.0  # drifts up while pressure rises
    assert (at_the_end - after_1_s)[10:].max() < -0.2  # drifts down when it has fallen
    up, down = at_the_end[:6], at_the_end[12:6:-1]
    assert (down - up).min() > 1.0
    assert (down - up).max() > 5.0

    time = np.arange(2.0, 75.0, period_s)
    creeping = np.degrees(joint.run(np.full((2000, 1), 3e5), period_s)[:, PHI, 0])
    left = creeping[-1] - creeping[np.rint(time / period_s).astype(int)]
    slope = np.polyfit(time, np.log(left + 1e-12), 1)[0]
    assert -1.0 / slope == approx(T_EXT, rel=0.1)


def test_the_course_of_creep_is_exact_whatever_the_period() -> None:
    """Broken by explicit steps, which err by 10 % at a fifth of a time constant, or a ratio that is one step off."""
    law, period_s, start = (P_MIN, B1, T_EXT, B0, T_REC), 5.0, 0.1
    course = creep_course(np.repeat([3e5, 0.9e5], 20), law, period_s, start)
    assert course.shape == (41,)
    steps = period_s * np.arange(21)
    high, low = B1 * (3e5 - P_MIN), B0 * 0.9e5
    np.testing.assert_allclose(course[:21], high + (start - high) * np.exp(-steps / T_EXT), atol=1e-12)
    np.testing.assert_allclose(course[20:], low + (course[20] - low) * np.exp(-steps / T_REC), atol=1e-12)
