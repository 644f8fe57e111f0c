"""Eq. 8 in the kernel: integrator, energy, stops, equilibrium, coupling, output rates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_model.description import load_hand
from hand_model.effects import EFFECTS
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P
from hand_model.kernel.rows import ROW, STATES, STEP_S
from hand_model.kernel.step import steps_per_sample
from hand_model.statics import equilibrium_angle
from hand_sim.plant import HandPlant, resting_state

# No stop, no creep, no dead time, no rate limit: every right-hand side is smooth.
SMOOTH = {
    "valve__dead_time_s": 0.0,
    "valve__fill_rate_pa_per_s": 1e9,
    "valve__vent_rate_pa_per_s": 1e9,
    "material__phi_max_deg": 0.0,
    "end_stop__low_deg": -100.0,
    "end_stop__high_deg": 100.0,
}


PAIR = {
    "material__p_min_pa": 1.0,
    "material__b1_per_pa": 1e-6,
    "material__extension_time_s": 0.05,
    "material__phi_max_deg": np.radians(60),
    "dynamics__inertia_kg_m2": np.array([1.2e-4, 3e-5]),
    "dynamics__coupling_inertia_kg_m2": 4e-5,
}
"""A coupled pair whose material creeps fast."""


def reference(joint: Any, start: Any, set_point_pa: float, times_s: Any, **changes: Any) -> Any:
    """States (times, STATES, 2) of a coupled pair by solve_ivp, with the equations of the paper written again."""
    par = joint.parameters(2, **changes)
    rows = {key: par[row] for key, row in ROW.items()}
    inertia, shared = rows["dynamics.inertia_kg_m2"], rows["dynamics.coupling_inertia_kg_m2"][0]
    inverse = np.linalg.inv([[inertia[0], shared], [shared, inertia[1]]])
    width, stiffness, damping = (
        rows[f"end_stop.{key}"] for key in ("engagement_deg", "stiffness_nm_per_rad", "damping_nm_s_per_rad")
    )

    def stop(depth: Any, speed: Any) -> Any:
        spring = np.where(depth < width, stiffness * depth**2 / (2 * width), stiffness * (depth - width / 2))
        pressed = spring + damping * np.clip(depth / width, 0, 1) * speed
        return np.where(depth > 0, np.maximum(pressed, 0), 0)

    def slope(_: float, flat: Any) -> Any:
        p, phi, omega, creep = flat.reshape(4, 2)
        rate = np.clip(
            (set_point_pa - p) / rows["valve.time_constant_s"],
            -rows["valve.vent_rate_pa_per_s"],
            rows["valve.fill_rate_pa_per_s"],
        )
        b1, b0 = rows["material.b1_per_pa"], rows["material.b0_per_pa"]
        extension = np.maximum(b1 * (p - rows["material.p_min_pa"]) - creep, 0) / rows["material.extension_time_s"]
        recovery = np.minimum(b0 * p - creep, 0) / rows["material.recovery_time_s"]
        elastic = rows["statics.a1_nm_per_rad"] * (phi - creep * rows["material.phi_max_deg"])
        actuator = rows["statics.a0_nm"] + elastic
        actuator += (rows["statics.a2_nm_per_pa"] + rows["statics.a3_nm_per_pa_rad"] * phi) * p
        torque = actuator - rows["dynamics.viscous_friction_nm_s_per_rad"] * omega
        torque += stop(rows["end_stop.low_deg"] - phi, -omega) - stop(phi - rows["end_stop.high_deg"], omega)
        return np.concatenate([rate, omega, inverse @ torque, extension + recovery])

    span, options = (0.0, times_s[-1]), {"rtol": 1e-10, "atol": 1e-13, "max_step": 1e-3}
    found = solve_ivp(slope, span, np.ravel(start), "DOP853", times_s, **options)
    return found.y.T.reshape(-1, STATES, 2)


def orders(joint: Any, start: Any, **changes: Any) -> tuple[Any, Any]:
    """Errors (steps, STATES) against solve_ivp, relative to each state's largest value, and orders of convergence."""
    times = np.arange(33) * 4e-3
    exact = reference(joint, start, 3e5, times, **changes)
    scale = np.abs(exact).max(axis=(0, 2))
    errors = []
    for step_s in (1e-3, 0.5e-3, 0.25e-3, 0.125e-3):
        states = joint.run(np.full((32, 2), 3e5), 4e-3, start, (1, 0), step_s=step_s, **changes)
        errors.append(np.abs(states - exact).max(axis=(0, 2)) / scale)
    return np.array(errors), np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_integrator_is_of_second_order(joint: Any) -> None:
    """Broken by any wrong coefficient of the step: pressure, creep, torque and coupling, against scipy's solve_ivp."""
    start = np.array([[1e5, 1e5], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])  # clear of the kink at p_min
    errors, order = orders(joint, start, **(SMOOTH | PAIR))
    for state in (PHI, OMEGA, CREEP):
        assert 1.8 < order[-1, state] < 2.2, f"state {state}: orders {order[:, state]}, errors {errors[:, state]}"
    assert errors[:, P].max() < 1e-7  # exact to fourth order where the valve is linear
    assert errors[1, PHI] < 1e-4


def test_integrator_is_of_second_order_in_a_stiff_stop(joint: Any) -> None:
    """Broken by a stop whose stiffness or damping enters the implicit step wrongly; impact at 8 rad/s."""
    changes = PAIR | {"valve__dead_time_s": 0.0, "end_stop__high_deg": 0.3, "end_stop__stiffness_nm_per_rad": 20.0}
    start = np.array([[1e5, 1e5], [0.0, 0.0], [8.0, 8.0], [0.0, 0.0]])
    errors, order = orders(joint, start, **changes)
    assert errors[1, PHI] < 4e-3
    assert np.log2(errors[0, PHI] / errors[-1, PHI]) / 3 > 1.7, f"errors {errors[:, PHI]}, orders {order[:, PHI]}"


def test_very_stiff_obstacle_stays_stable(joint: Any) -> None:
    """Broken by an explicit step: 100 N m/rad on 3e-5 kg m^2 rings 70 times faster than the integration step."""
    changes = SMOOTH | {
        "contact__angle_deg": 0.2,
        "contact__stiffness_nm_per_rad": 100.0,
        "contact__damping_nm_s_per_rad": 1.0,
        "contact__engagement_deg": np.radians(0.01),
    }
    states = joint.run(np.full((400, 1), 3e5), **changes)
    assert np.abs(states[100:, PHI] - 0.2).max() < np.radians(0.5)
    assert np.abs(states[300:, OMEGA]).max() < 1e-3


def dry_swing(time_s: Any, start: float, omega: float, shift: float) -> Any:
    """Angle of an undamped spring with dry friction released at `start`: half swings about +-shift until it sticks."""
    angle, half, at = np.empty_like(time_s), np.pi / omega, start
    for n, _ in enumerate(time_s):
        swings = int(time_s[n] / half)
        at = start
        for _ in range(swings):
            if abs(at) <= shift:
                break
            at = -(at - np.sign(at) * 2 * shift)
        middle = np.sign(at) * shift
        stuck = abs(at) <= shift
        angle[n] = at if stuck else middle + (at - middle) * np.cos(omega * (time_s[n] - swings * half))
    return angle


def test_friction_converges_to_its_closed_form(joint: Any) -> None:
    """Broken by friction that acts too early, too late or in part: half swings shrink by 2 F / k, then it sticks."""
    inertia, spring, friction = 3e-5, 0.0573, 0.004
    changes = SMOOTH | {
        "statics__a0_nm": 0.0,
        "dynamics__viscous_friction_nm_s_per_rad": 0.0,
        "coulomb_friction__torque_nm": friction,
    }
    start = np.array([[0.0], [0.8], [0.0], [0.0]])
    time_s = np.arange(101) * 5e-3
    expected = dry_swing(time_s, 0.8, np.sqrt(spring / inertia), friction / spring)
    errors = []
    for step_s in (1e-3, 0.5e-3, 0.25e-3):
        states = joint.run(np.zeros((100, 1)), 5e-3, start, step_s=step_s, **changes)
        errors.append(np.abs(states[:, PHI, 0] - expected).max())
        assert states[-1, OMEGA, 0] == 0.0
    assert errors[1] < np.radians(0.2)
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.6, errors


def test_friction_that_changes_over_the_travel_stops_a_swing_where_an_integrator_does(joint: Any) -> None:
    """Broken by friction of another size at the angle where the joint is: half swings of scipy, each to its stop."""
    inertia, spring, level, slope, bow = 3e-5, 0.0573, 0.004, 0.8, 0.6

    def friction(angle: float) -> float:
        x = angle / 1.5
        return float(level * (1.0 + 0.5 * slope * x + 0.5 * bow * x * x) ** 2)

    changes = SMOOTH | {
        "statics__a0_nm": 0.0,
        "dynamics__viscous_friction_nm_s_per_rad": 0.0,
        "coulomb_friction__torque_nm": level,
        "coulomb_friction__travel_slope": slope,
        "coulomb_friction__travel_bow": bow,
    }
    time_s = np.arange(101) * 5e-3
    expected, now, at = np.full(101, np.nan), 0.0, 0.8
    while spring * abs(at) > friction(at) and now < time_s[-1]:
        way = -np.sign(at)

        def rates(_: float, y: Any, way: float = way) -> list[float]:
            return [y[1], (-spring * y[0] - way * friction(y[0])) / inertia]

        def stops(_: float, y: Any, way: float = way) -> float:
            return float(way * y[1] + 1e-9)

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        swing = solve_ivp(
            rates, (now, 1.0), [at, 1e-8 * way], events=stops, dense_output=True, rtol=1e-10, atol=1e-12, max_step=1e-3
        )
        within = (time_s >= now) & (time_s <= swing.t[-1])
        expected[within] = swing.sol(time_s[within])[0]
        now, at = float(swing.t[-1]), float(swing.y[0, -1])
    expected[time_s > now] = at
    states = joint.run(np.zeros((100, 1)), 5e-3, np.array([[0.0], [0.8], [0.0], [0.0]]), step_s=0.25e-3, **changes)
    assert np.abs(states[:, PHI, 0] - expected).max() < np.radians(0.2)
    constant = joint.run(
        np.zeros((100, 1)), 5e-3, np.array([[0.0], [0.8], [0.0], [0.0]]), step_s=0.25e-3,
        **(changes | {"coulomb_friction__travel_slope": 0.0, "coulomb_friction__travel_bow": 0.0}),
    )  # fmt: skip
    assert np.abs(constant[:, PHI, 0] - expected).max() > np.radians(2.0)


@pytest.mark.parametrize("step_s", [1e-3, 0.25e-3])
def test_contacts_that_relax_let_a_loaded_joint_creep(joint: Any, step_s: float) -> None:
    """Broken by another rate of relaxing: contacts that hold a share z of the level F creep at v = r s z.

    With the load T and a drag b, F z + b v = T.
    """
    level, load, drag, relaxing, presliding = 0.005, 0.003, 1e-3, 20.0, np.radians(0.05)
    changes = SMOOTH | {
        "statics__a0_nm": load,
        "statics__a1_nm_per_rad": -1e-6,
        "dynamics__viscous_friction_nm_s_per_rad": drag,
        "coulomb_friction__torque_nm": level,
        "coulomb_friction__presliding_deg": presliding,
    }
    for rate in (relaxing, 0.0):
        share = load / (level + drag * rate * presliding)
        states = joint.run(
            np.zeros((200, 1)), 5e-3, np.zeros((4, 1)), step_s=step_s,
            **(changes | {"coulomb_friction__relaxing_per_s": rate}),
        )  # fmt: skip
        speed = (states[-1, PHI, 0] - states[100, PHI, 0]) / 0.5
        assert speed == pytest.approx(rate * presliding * share, rel=0.01, abs=1e-6)


def test_two_coupled_joints_with_friction_stick_and_slide(joint: Any) -> None:
    """Broken by a pair solved joint by joint: a stuck partner adds its locked inertia, a sliding one takes momentum."""
    for torque, stuck in ((0.05, (False, True)), (0.001, (True, True))):
        changes = (
            SMOOTH
            | PAIR
            | {
                "statics__a0_nm": np.array([torque, 0.0]),
                "statics__a1_nm_per_rad": -1e-6,
                "dynamics__viscous_friction_nm_s_per_rad": 0.0,
                "coulomb_friction__torque_nm": np.array([0.002, 0.1]),
            }
        )
        after = joint.run(np.zeros((4, 2)), 1e-3, None, (1, 0), **changes)[-1]
        expected = 0.0 if stuck[0] else (torque - 0.002) / 1.2e-4 * 4e-3
        assert after[OMEGA, 0] == pytest.approx(expected, rel=1e-3, abs=1e-12)
        assert after[OMEGA, 1] == 0.0
    free = (
        SMOOTH
        | PAIR
        | {
            "statics__a0_nm": np.array([0.05, 0.0]),
            "statics__a1_nm_per_rad": -1e-6,
            "dynamics__viscous_friction_nm_s_per_rad": 0.0,
            "coulomb_friction__torque_nm": np.array([0.002, 0.001]),
        }
    )
    after = joint.run(np.zeros((4, 2)), 1e-3, None, (1, 0), **free)[-1]
    inverse = np.linalg.inv([[1.2e-4, 4e-5], [4e-5, 3e-5]])  # the partner is thrown back, its friction acts forward
    np.testing.assert_allclose(after[OMEGA], inverse @ [0.048, 0.001] * 4e-3, rtol=1e-3)


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
    period_error = (omega * STEP_S) ** 2 / 12.0  # of the implicit midpoint rule
    assert np.abs(states[:, PHI, 0] - expected).max() < 1.1 * start * period_error / (np.e * decay / omega)


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
    gained = []
    for step_s in (STEP_S, STEP_S / 4):
        states = joint.run(np.zeros((2000, 1)), 1e-3, state, step_s=step_s, **changes)
        free = np.abs(states[:, PHI, 0]) < 0.05
        speed = np.abs(states[free, OMEGA, 0])
        assert np.count_nonzero(np.diff(np.sign(states[:, OMEGA, 0]))) > (3 if damping else 30)
        assert np.abs(states[:, PHI]).max() < 0.05 + np.radians(3.0)
        gained.append(np.abs(speed - 10.0).max() if damping == 0.0 else np.diff(speed).max())
    if damping:
        assert max(gained) < 1e-3
        assert speed[-1] < 0.8 * speed[0]
    else:  # a hundred bounces
        assert gained[0] < 0.1
        assert gained[1] < 0.2 * gained[0]


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


@pytest.mark.parametrize(
    ("resistance_s", "allowed_pa", "allowed_deg"), [(0.05, 32.0, 0.006), (0.1, 66.0, 0.0125), (0.3, 100.0, 0.03)]
)
def test_a_supply_that_sags_at_once_is_computed_well(
    resistance_s: float, allowed_pa: float, allowed_deg: float
) -> None:
    """Fails when the inflow of a step is off: the pressures then differ from those of steps a sixteenth as long.

    With 0.3 s, two trials of each step that do not use the slope leave 319 Pa and 0.23 degrees.
    """
    hand = load_hand(Path(__file__).resolve().parents[2] / "config" / "hand.yaml")
    parameters = hand.parameters[None].copy()
    for key, number in (("resistance_s", resistance_s), ("time_constant_s", 0.05)):
        parameters[:, ROW[f"supply_droop.{key}"]] = number
    parameters[:, ROW["valve.dead_time_s"]] = 0.0071
    levels = np.repeat(np.random.default_rng(6).choice([0.0, 2e5, 3e5, 5e5, 6e5], (20, 11)), 10, axis=0)
    coarse, fine = (
        ClosedLoop(
            parameters, hand.partner, resting_state(hand)[None], 0.005,
            effects=(EFFECTS["supply_droop"],), step_s=step_s,
        ).advance(levels[None])[0]
        for step_s in (STEP_S, STEP_S / 16)
    )  # fmt: skip
    difference = np.abs(coarse - fine).max(axis=(0, 2))
    assert difference[P] < allowed_pa
    assert np.degrees(difference[PHI]) < allowed_deg
