"""Eq. 8 in the kernel: integrator, energy, stops, equilibrium, coupling, output rates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hand_model.kernel.rows import ROW, STEP_S
from hand_model.lanes import LANES, idle_parameters, map_lanes
from hand_model.plant import CREEP, HISTORY, OMEGA, PHI, STATES, P, advance, steps_per_sample
from hand_model.statics import equilibrium_angle
from hand_sim.plant import HandPlant

# No stop, no creep, no dead time, no rate limit: every right-hand side is smooth.
SMOOTH = {
    "valve__dead_time_s": 0.0,
    "valve__fill_rate_pa_per_s": 1e9,
    "valve__vent_rate_pa_per_s": 1e9,
    "material__phi_max_deg": 0.0,
    "end_stop__low_deg": -100.0,
    "end_stop__high_deg": 100.0,
}


def run_at_step(joint: Any, h: float, seconds: float, **changes: Any) -> Any:
    """State (STATES, joints) after `seconds` at a step of h [s], freely chosen, going from 1e5 to 3e5 Pa."""
    lanes = map_lanes(np.array([1, 0]))
    par = lanes.scatter(joint.parameters(2, **changes), idle_parameters())
    x, out = np.zeros((1, STATES, LANES)), np.empty((1, 1, STATES, LANES))
    x[:, P] = 1e5  # clear of the kink at p_min, where creep begins
    history, heads = np.zeros((1, HISTORY, LANES)), np.zeros(1, dtype=np.int64)
    advance(x, par, history, heads, np.full((1, 1, LANES), 3e5), round(seconds / h), h, out)
    return lanes.gather(out[:, 0])


def test_integrator_is_of_fourth_order(joint: Any) -> None:
    """Broken by any wrong coefficient of the Runge-Kutta step; creep and coupling are in, and stay smooth."""
    changes = SMOOTH | {
        "material__phi_max_deg": np.radians(60),
        "material__p_min_pa": 1.0,
        "material__b1_per_pa": 1e-6,
        "material__extension_time_s": 0.05,
        "dynamics__inertia_kg_m2": np.array([1.2e-4, 3e-5]),
        "dynamics__coupling_inertia_kg_m2": 4e-5,
    }
    seconds = 0.064
    fine = run_at_step(joint, 0.0625e-3, seconds, **changes)
    scale = np.abs(fine).max(axis=1)
    errors = [
        (np.abs(run_at_step(joint, h, seconds, **changes) - fine).max(axis=1) / scale) for h in (4e-3, 2e-3, 1e-3)
    ]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    for state in (P, PHI, OMEGA, CREEP):
        assert 3.6 < orders[-1, state] < 4.5, f"state {state}: orders {orders[:, state]}, errors {np.array(errors)}"


def test_free_joint_is_the_damped_oscillator(joint: Any) -> None:
    """Broken by a wrong inertia, friction or stiffness: J phi'' + d phi' + |a1| phi = 0, closed form."""
    inertia, friction, spring, start, period_s = 3e-5, 1e-4, 0.0573, 0.8, 0.005
    changes = SMOOTH | {
        "statics__a0_nm": 0.0,
        "dynamics__inertia_kg_m2": inertia,
        "dynamics__viscous_friction_nm_s_per_rad": friction,
    }
    state = np.array([[0.0], [start], [0.0], [0.0]])
    states = joint.run(np.zeros((200, 1)), period_s, state, **changes)
    time = np.arange(201) * period_s
    decay = friction / (2 * inertia)
    omega = np.sqrt(spring / inertia - decay**2)
    expected = start * np.exp(-decay * time) * (np.cos(omega * time) + decay / omega * np.sin(omega * time))
    np.testing.assert_allclose(states[:, PHI, 0], expected, atol=1e-6)


def energy(states: Any, parameters: Any) -> Any:
    """Kinetic energy of the coupled pair plus the elastic energy of both chambers [J], no pressure."""
    (j_a, j_b), j_c = parameters[ROW["dynamics.inertia_kg_m2"]], parameters[ROW["dynamics.coupling_inertia_kg_m2"], 0]
    w_a, w_b = states[:, OMEGA].T
    springs = -parameters[ROW["statics.a1_nm_per_rad"]]
    return 0.5 * (j_a * w_a**2 + 2 * j_c * w_a * w_b + j_b * w_b**2) + 0.5 * (states[:, PHI] ** 2 @ springs)


def test_coupled_pair_conserves_energy(joint: Any) -> None:
    """Broken by a wrong inverse of the mass matrix: its energy, unforced and undamped, would not stay."""
    changes = SMOOTH | {
        "statics__a0_nm": 0.0,
        "dynamics__viscous_friction_nm_s_per_rad": 0.0,
        "dynamics__inertia_kg_m2": np.array([1.2e-4, 3e-5]),
        "dynamics__coupling_inertia_kg_m2": 4e-5,
    }
    state = np.array([[0.0, 0.0], [0.6, -0.4], [3.0, 5.0], [0.0, 0.0]])
    states = joint.run(np.zeros((400, 2)), 0.005, state, (1, 0), **changes)
    course = energy(states, joint.parameters(2, **changes))
    np.testing.assert_allclose(course, course[0], rtol=1e-6)
    # The energy does move from one joint to the other, so this is no statement about two joints alone.
    alone = joint.run(np.zeros((400, 2)), 0.005, state, **(changes | {"dynamics__coupling_inertia_kg_m2": 0.0}))
    assert np.abs(states[:, PHI] - alone[:, PHI]).max() > 0.1


def test_coupling_throws_the_partner_back(joint: Any) -> None:
    """Broken by the sign of the reaction: torque that flexes the distal joint throws the proximal one back."""
    changes = SMOOTH | {
        "statics__a0_nm": np.array([0.0, 0.1]),
        "dynamics__viscous_friction_nm_s_per_rad": 0.0,
        "dynamics__inertia_kg_m2": np.array([1.2e-4, 3e-5]),
        "dynamics__coupling_inertia_kg_m2": 4e-5,
    }
    after = joint.run(np.zeros((1, 2)), 1e-4, None, (1, 0), **changes)[-1]
    determinant = 1.2e-4 * 3e-5 - 4e-5**2
    np.testing.assert_allclose(after[OMEGA], np.array([-4e-5, 1.2e-4]) / determinant * 0.1 * 1e-4, rtol=1e-3)


@pytest.mark.parametrize("damping", [0.0, 0.005, 0.02])
def test_stop_gives_back_no_more_than_it_got(joint: Any, damping: float) -> None:
    """Broken by a stop that feeds energy in; without a damper it returns all, with one it returns less."""
    changes = SMOOTH | {
        "statics__a0_nm": 0.0,
        "statics__a1_nm_per_rad": -1e-6,
        "dynamics__viscous_friction_nm_s_per_rad": 0.0,
        "end_stop__high_deg": 0.05,
        "end_stop__low_deg": -0.05,
        "end_stop__stiffness_nm_per_rad": 5.0,
        "end_stop__damping_nm_s_per_rad": damping,
    }
    state = np.array([[0.0], [0.0], [10.0], [0.0]])
    states = joint.run(np.zeros((2000, 1)), 1e-3, state, **changes)
    free = np.abs(states[:, PHI, 0]) < 0.05
    speed = np.abs(states[free, OMEGA, 0])
    assert np.count_nonzero(np.diff(np.sign(states[:, OMEGA, 0]))) > (3 if damping else 30)
    if damping:
        assert np.diff(speed).max() < 1e-3
        assert speed[-1] < 0.8 * speed[0]
    else:
        np.testing.assert_allclose(speed, 10.0, rtol=2e-3)
    assert np.abs(states[:, PHI]).max() < 0.05 + np.radians(3.0)


@pytest.mark.parametrize("pressure_pa", [0.0, 0.4e5, 1e5, 2e5, 4e5])
def test_rest_is_the_static_equilibrium(joint: Any, pressure_pa: float) -> None:
    """Broken by dynamics and statics that disagree: Eq. 8 at rest is Eq. 6, Eq. 11 with creep."""
    load = 0.02
    changes: dict[str, Any] = {"end_stop__low_deg": -2.0, "end_stop__high_deg": 4.0, "constant_load__torque_nm": load}
    a0, a1, a2, a3 = joint.parameters()[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1, 0]
    commands = np.full((3000, 1), pressure_pa)
    stiff = joint.run(commands, 0.1, material__phi_max_deg=0.0, **changes)[-1]
    assert stiff[PHI, 0] == pytest.approx(equilibrium_angle(pressure_pa, 0.0, load, a0, a1, a2, a3, 0.0), abs=1e-6)
    soft = joint.run(commands, 0.1, **changes)[-1]
    creep, phi_max = soft[CREEP, 0], np.radians(60)
    assert soft[PHI, 0] == pytest.approx(equilibrium_angle(pressure_pa, creep, load, a0, a1, a2, a3, phi_max), abs=1e-5)


def test_obstacle_stops_the_joint(joint: Any) -> None:
    """Broken by a contact that does not act, or pulls the joint in before it is touched."""
    changes = {"contact__angle_deg": 0.5, "contact__stiffness_nm_per_rad": 10.0, "contact__damping_nm_s_per_rad": 0.01}
    free = joint.run(np.full((400, 1), 3e5))[:, PHI, 0]
    blocked = joint.run(np.full((400, 1), 3e5), **changes)[:, PHI, 0]
    assert free[-1] > 1.0
    assert 0.5 < blocked[-1] < 0.5 + np.radians(5.0)
    before = free < 0.45
    np.testing.assert_array_equal(free[: before.argmin()], blocked[: before.argmin()])


RATES_HZ = (1.0, 30.0, 200.0, 333.0, 1000.0)


def test_output_rate_does_not_change_the_motion(joint: Any) -> None:
    """Broken by a step that depends on the sample rate: same trajectory at whole seconds to 1e-4 degree and 3 Pa.

    What is left is the dead time's fraction of a step, and the stop's kink.
    """
    levels = np.array([2e5, 5e5, 0.5e5, 3e5])
    runs = {rate: joint.run(np.repeat(levels, int(rate))[:, None], 1.0 / rate)[:: int(rate)] for rate in RATES_HZ}
    for rate in RATES_HZ[1:]:
        difference = np.abs(runs[rate] - runs[200.0]).max(axis=(0, 2))
        assert np.degrees(difference[PHI]) < 1e-4, rate
        assert difference[P] < 3.0, rate
        assert difference[CREEP] < 1e-5, rate


def test_steps_divide_the_sample_and_are_short() -> None:
    """Broken by a step longer than STEP_S, or one more step than needed."""
    for rate in (*RATES_HZ, 1999.0, 2000.0, 2001.0, 12345.0):
        steps = steps_per_sample(1.0 / rate)
        assert 1.0 / rate / steps <= STEP_S * (1 + 1e-8)
        assert steps == 1 or 1.0 / rate / (steps - 1) > STEP_S
    assert steps_per_sample(1 / 200) == 10
    assert steps_per_sample(1 / 2000) == 1


def test_same_input_same_output(joint: Any) -> None:
    """Broken by uninitialised memory or an order of summation that varies."""
    commands = np.random.default_rng(3).uniform(-1e5, 7e5, (300, 5))
    first = joint.run(commands)
    for _ in range(3):
        np.testing.assert_array_equal(joint.run(commands), first)


def test_samples_in_one_call_or_one_by_one(hand: Any) -> None:
    """Broken by state lost between calls: the live board steps sample by sample, the offline plant in one call."""
    commands = np.random.default_rng(4).uniform(0, 6e5, (200, 11))
    at_once, stepped = HandPlant(hand, 0.005), HandPlant(hand, 0.005)
    states = at_once.advance(commands)
    for n in range(200):
        np.testing.assert_array_equal(stepped.advance(commands[n : n + 1])[0], states[n])
    np.testing.assert_array_equal(stepped.state, states[-1])
