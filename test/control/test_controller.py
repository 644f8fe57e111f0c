"""Law and controller: limits, anti-windup, safe states, re-arming, step tracking."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_control.controller import Controller, Times
from hand_control.declared import OUT, S, Settings
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_control.tuning import gains
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_ros.parameters import ParameterError
from hand_sim.plant import SimulatedPlant
from validation.step_response import figures, step_response

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
MS = 1_000_000
DT_S = 0.005
anything = st.floats(allow_nan=True, allow_infinity=True)


def law() -> Law:
    chosen = Settings.of(HAND, {})
    return Law(gains(HAND, chosen))


def inputs(
    reference: float, position: float, limit: float = 0.6, pressure: float = 0.0, speed: float = 0.0, rate: float = 0.0
) -> np.ndarray:
    return np.array([full(value) for value in (reference, speed, rate, limit, position, pressure)])


def full(value: float) -> np.ndarray:
    return np.full(COUNT, value)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(anything, anything, anything, anything, anything, anything), min_size=1, max_size=5))
def test_whatever_comes_in_a_finite_pressure_within_limits_goes_out(ticks: list[tuple[float, ...]]) -> None:
    """Fails when any input makes the law send a NaN or infinite value, or one outside 0 ... the limit."""
    made = law()
    for reference, speed, limit, position, velocity, pressure in ticks:
        with np.errstate(all="ignore"):
            out = made.tick(inputs(reference, position, limit, pressure, speed, velocity), DT_S)
        assert np.all((out[OUT.pressure] >= 0.0) & (out[OUT.pressure] <= HAND.limits.max_pressure_pa))


@given(st.floats(0.0, 1.7), st.floats(0.0, 1.7), st.floats(0.0, 0.6))
def test_the_ceiling_follows_the_torque_limit(reference: float, position: float, limit: float) -> None:
    """Fails when a command could, at rest at this angle, give more torque than the limit."""
    out = law().tick(inputs(reference, position, limit), DT_S)
    a0, a1, a2, a3 = (
        HAND.row(f"statics.{key}") for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
    )
    torque = a0 + a1 * position + (a2 + a3 * position) * out[OUT.pressure]
    assert np.all((torque <= limit + 1e-9) | (out[OUT.pressure] == 0.0))


def test_torque_estimate_is_equation_6() -> None:
    """Fails when the published torque is not Eq. 6 at the measured pressure and angle."""
    out = law().tick(inputs(0.5, 0.5, 0.6, 1e5), DT_S)
    assert out[OUT.torque] == pytest.approx(-0.010 - 0.0573 * 0.5 + (1.12e-6 - 5.6e-7 * 0.5) * 1e5)


def test_a_saturated_integrator_stands_still_and_lets_go() -> None:
    """Fails when the integral winds up at the limit, or does not recover from it."""
    made = law()
    for _ in range(2000):
        out = made.tick(inputs(1.2, 0.2, 0.02), DT_S)
    assert out[OUT.saturated].all()
    assert np.abs(made.state[S.integral]).max() < 0.01
    out = made.tick(inputs(0.0, 0.2), DT_S)
    assert out[OUT.pressure].max() < 1.2e5


def test_freezing_keeps_the_integral() -> None:
    """Fails when a stopped integrator changes."""
    made = law()
    made.tick(inputs(0.6, 0.5), DT_S)
    before = made.state[S.integral].copy()
    made.tick(inputs(0.6, 0.5), DT_S, False)
    assert np.array_equal(made.state[S.integral], before)
    assert before.min() > 0.0


@pytest.mark.parametrize("dt", [0.001, 0.005, 0.05])
def test_shaping_has_no_overshoot_and_bounded_speed(dt: float) -> None:
    """Fails when a step of the target overshoots, exceeds the greatest speed, or depends on the rate."""
    slow, fast = (Settings.of(HAND, {"max_speed_deg_per_s": math.degrees(speed)}) for speed in (3.0, 30.0))
    shaper = Shaper(1)
    path = []
    for _ in range(round(2.0 / dt)):
        shaper.step(np.array([1.0]), np.array([0.0]), slow, dt)
        path.append(shaper.r[0])
        assert abs(shaper.v[0]) <= 3.0
    assert max(path) < 1.0 + 5e-3
    assert path[-1] == pytest.approx(1.0, abs=1e-6)
    free = Shaper(1)
    for _ in range(round(0.3 / dt)):
        free.step(np.array([1.0]), np.array([0.0]), fast, dt)
    closed_form = 1.0 - (1.0 + 13.0 * 0.3) * math.exp(-13.0 * 0.3)
    assert free.r[0] == pytest.approx(closed_form, abs=0.02)


class Driven:
    """A controller fed with a hand that stands still."""

    def __init__(self, **values: object) -> None:
        self.controller = Controller(HAND, Settings.of(HAND, values))
        self.controller.enable(True)
        self.ns = 10**9
        self.pose = full(0.3)

    def frame(self, position: np.ndarray | None = None, pressure: np.ndarray | None = None, age_ns: int = 0):  # type: ignore[no-untyped-def]
        self.ns += 5 * MS
        pose = self.pose if position is None else position
        pressure = full(5e4) if pressure is None else pressure
        return self.controller.frame(Times(self.ns - age_ns, self.ns, self.ns), pose, full(0.0), pressure)

    def command(self, angle: float) -> None:
        self.controller.command(Times(0, self.ns, self.ns), HAND.joints[:1], [angle], [])


def test_arming_holds_the_measured_pose() -> None:
    """Fails when the hand would jump when it is enabled."""
    driven = Driven()
    assert driven.frame().pressure_command.max() == 0.0  # no time has passed since the frame before: no rise
    tick = driven.frame()
    assert tick.reference == pytest.approx(driven.pose)
    hold = (0.010 + 0.0573 * 0.3) / (1.12e-6 - 5.6e-7 * 0.3)
    assert tick.pressure_command == pytest.approx(hold, rel=0.05)


@pytest.mark.parametrize("where", ["position", "pressure"])
def test_a_measurement_that_is_not_finite_vents_and_latches(where: str) -> None:
    """Fails when a NaN leaves pressure on the valves."""
    driven = Driven()
    driven.frame()
    driven.command(0.8)
    bad = full(0.3 if where == "position" else 5e4)
    bad[4] = np.nan
    tick = driven.frame(position=bad) if where == "position" else driven.frame(pressure=bad)
    assert tick.pressure_command.max() == 0.0
    assert HAND.joints[4] in driven.controller.safety.fault
    assert driven.frame().pressure_command.max() == 0.0
    with pytest.raises(ValueError, match="not being controlled"):
        driven.command(0.8)
    driven.controller.reset()
    driven.controller.enable(True)
    assert driven.frame().reference == pytest.approx(driven.pose)


def test_an_angle_that_jumps_vents() -> None:
    """Fails when an implausible jump is followed."""
    driven = Driven()
    driven.frame()
    tick = driven.frame(position=full(0.3) + np.eye(COUNT)[2] * 1.2)
    assert tick.pressure_command.max() == 0.0
    jumped = f"{HAND.joints[2]}: its angle (channel 2) jumped by 69 degrees between two frames; check the sensor"
    assert driven.controller.safety.fault.startswith(jumped)


def test_stale_repeated_and_future_frames_are_no_frames() -> None:
    """Fails when an old, repeated or future stamp is answered."""
    driven = Driven()
    assert driven.frame() is not None
    assert driven.frame(age_ns=150 * MS) is None
    assert driven.frame(age_ns=-150 * MS) is None
    assert driven.frame(age_ns=15 * MS) is None  # the stamp that came first, again
    assert driven.frame() is not None


def test_gains_change_without_a_jump() -> None:
    """Fails when new settings reset integrators or references, or bad ones are half taken."""
    driven = Driven()
    for _ in range(200):
        tick = driven.frame()
    before = tick.pressure_command.copy()
    driven.controller.configure(Settings.of(HAND, {"max_speed_deg_per_s": 100.0}))
    assert driven.frame().pressure_command == pytest.approx(before, rel=1e-2)
    for bad in ({"kp_nm_per_rad": [0.1, 0.2]}, {"ki_nm_per_rad_s": [math.nan]}, {"max_speed_deg_per_s": -1.0}):
        with pytest.raises(ParameterError, match=next(iter(bad))):
            Settings.of(HAND, bad)


@pytest.mark.parametrize("rate_hz", [200, 500, 1000])
def test_step_tracking(rate_hz: int) -> None:
    """Fails when a step of 50 degrees settles later than 1.5 s or overshoots by more than 5 %."""
    settle_s, overshoot = figures(step_response(HAND, rate_hz, seed=3), rate_hz)
    assert settle_s < 1.5
    assert overshoot < 5.0


def test_plants_thirty_percent_off_stay_stable() -> None:
    """Fails when a wrong model makes the loop oscillate."""
    seed = 8
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    keys = [key for key in ROW if key.startswith(("statics.", "dynamics.viscous"))]
    for trial in range(6):
        parameters = HAND.parameters.copy()
        for key in keys:
            parameters[ROW[key]] *= rng.uniform(0.7, 1.3)
        parameters[ROW["dynamics.inertia_kg_m2"]] *= (scale := rng.uniform(0.7, 1.3))
        parameters[ROW["dynamics.coupling_inertia_kg_m2"]] *= scale
        plant = SimulatedPlant(replace(HAND, parameters=parameters), 200.0, trial)
        angles = step_response(HAND, 200.0, trial, plant)
        assert np.ptp(angles[-200:], axis=0).max() < 1.5, (seed, trial)
