"""The kernel's terms and steps as plain functions of one working array, against formulas written again.

These tests run the equations without the loops, compiled or not, so that a mutation run can use them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_model.arrays import Array
from hand_model.effects import EFFECTS
from hand_model.effects.effect import EXOGENOUS
from hand_model.kernel import layout as rows
from hand_model.kernel import step as steps
from hand_model.kernel.dry_friction import goes_on_pair, rub_pair
from hand_model.kernel.hooks import compose
from hand_model.kernel.inline import inline
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P, X, prepare_rows
from hand_model.kernel.rows import JOINT_PARAMETERS, MEMORY_ROW, ROW
from hand_model.kernel.terms import one_sided, terms

H = 5e-4
E = (0.0,) * EXOGENOUS
PLAIN = compose(())
EQUATIONS, STEP = terms(PLAIN), steps.assemble(PLAIN)
RUBBING = steps.assemble(compose((EFFECTS["coulomb_friction"],)))


FINGER = {
    "valve.dead_time_s": 0.005,
    "valve.time_constant_s": 0.05,
    "valve.fill_rate_pa_per_s": 1e7,
    "valve.vent_rate_pa_per_s": 8e6,
    "statics.a0_nm": -0.01,
    "statics.a1_nm_per_rad": -0.0573,
    "statics.a2_nm_per_pa": 1.12e-6,
    "statics.a3_nm_per_pa_rad": -5.6e-7,
    "material.phi_max_deg": 1.047,
    "dynamics.inertia_kg_m2": (1.2e-4, 3e-5),
    "dynamics.viscous_friction_nm_s_per_rad": (8e-3, 4e-3),
    "dynamics.coupling_inertia_kg_m2": 4e-5,
    "end_stop.low_deg": -0.1745,
    "end_stop.high_deg": 1.745,
    "end_stop.stiffness_nm_per_rad": 5.0,
    "end_stop.damping_nm_s_per_rad": 0.02,
    "end_stop.engagement_deg": 0.01745,
    "supply.pressure_pa": 6e5,
}
"""Two coupled phalanges in SI, whatever the unit in the key; all else is neutral."""


def working_array(**changes: float) -> Array:
    """Two coupled joints, lanes 0 and 1, in a working array prepared for steps of H."""
    w = np.zeros((rows.WORK, 2))
    w[: len(ROW)] = np.array([parameter.neutral_si for parameter in JOINT_PARAMETERS])[:, None]
    numbers: dict[str, Any] = {**FINGER, **{key.replace("__", "."): number for key, number in changes.items()}}
    for key, number in numbers.items():
        w[ROW[key]] = number
    prepare_rows(w, H)
    return w


def value(w: Array, key: str, lane: int = 0) -> float:
    return float(w[ROW[key], lane])


def stop_torque(depth: float, speed: float, k: float, d: float, width: float) -> float:
    """Torque of a stop [N m], from the text: stiffness and damping grow linearly over the engagement depth."""
    if depth <= 0.0:
        return 0.0
    spring = 0.5 * k * depth**2 / width if depth < width else k * (depth - 0.5 * width)
    return max(spring + d * min(depth / width, 1.0) * speed, 0.0)


def whole_torque(w: Array, phi: float, omega: float, p: float, creep: float) -> float:
    """Torque on lane 0 [N m] of Eqs. 6, 8 and 11 with stops, obstacle and load."""
    a0, a1, a2, a3 = w[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1, 0]
    stop = [value(w, f"end_stop.{key}") for key in ("stiffness_nm_per_rad", "damping_nm_s_per_rad", "engagement_deg")]
    touch = [value(w, f"contact.{key}") for key in ("stiffness_nm_per_rad", "damping_nm_s_per_rad", "engagement_deg")]
    torque = a0 + a1 * (phi - creep * value(w, "material.phi_max_deg")) + (a2 + a3 * phi) * p
    torque -= value(w, "dynamics.viscous_friction_nm_s_per_rad") * omega + value(w, "constant_load.torque_nm")
    torque -= stop_torque(phi - value(w, "end_stop.high_deg"), omega, *stop)
    torque += stop_torque(value(w, "end_stop.low_deg") - phi, -omega, *stop)
    return float(torque - stop_torque(phi - value(w, "contact.angle_deg"), omega, *touch))


@pytest.mark.parametrize("speed", [-30.0, -1.0, 0.0, 2.0])
@pytest.mark.parametrize("depth", [-0.1, 0.0, 0.004, 0.01, 0.02, 0.3])
def test_one_sided_is_a_stop_that_never_pulls(depth: float, speed: float) -> None:
    """Broken by another stiffness, damping or engagement, or by a stop that pulls."""
    k, d, width = 5.0, 0.02, 0.0175
    expected = stop_torque(depth, speed, k, d, width)
    assert float(one_sided(depth, speed, k, d, width)) == pytest.approx(expected, rel=1e-12, abs=1e-15)


ANGLES = (-0.25, -0.19, -0.18, 0.0, 0.7, 0.905, 0.95, 1.2, 1.75, 1.76, 1.9)
"""Angles [rad] beyond, in and between both stops and the obstacle, engaged in part and fully."""


def test_joint_torque_is_equation_8() -> None:
    """Broken by any sign, factor or term of the torque at rest or in motion; an obstacle at 0.9 rad, a load."""
    w = working_array(
        contact__angle_deg=0.9, contact__stiffness_nm_per_rad=0.7, contact__damping_nm_s_per_rad=0.003,
        contact__engagement_deg=0.02, constant_load__torque_nm=0.013,
    )  # fmt: skip
    for phi in ANGLES:
        for omega, p, creep in ((0.0, 0.0, 0.0), (2.0, 3e5, 0.4), (-3.0, 1e5, 0.9)):
            found = EQUATIONS.joint_torque(w, 0, phi, phi, omega, 0.0, p, creep, E)
            assert found[0] == pytest.approx(whole_torque(w, phi, omega, p, creep), rel=1e-12, abs=1e-15), (phi, omega)
            small = 1e-7
            if omega == 0.0:
                ahead, behind = (whole_torque(w, phi + sign * small, omega, p, creep) for sign in (1, -1))
                assert found[1] == pytest.approx((behind - ahead) / (2 * small), rel=1e-4, abs=1e-6), phi
            faster, slower = (whole_torque(w, phi, omega + sign * small, p, creep) for sign in (1, -1))
            assert found[2] + found[3] == pytest.approx((slower - faster) / (2 * small), rel=1e-5, abs=1e-8), phi
    assert found[2] == value(w, "dynamics.viscous_friction_nm_s_per_rad")


def test_stiffness_is_never_negative() -> None:
    """Broken by a negative stiffness, which would make the implicit step unstable."""
    w = working_array(statics__a3_nm_per_pa_rad=5.6e-7)
    assert EQUATIONS.joint_torque(w, 0, 0.5, 0.5, 0.0, 0.0, 5e5, 0.0, E)[1] == 0.0


def test_effects_torque_is_carried_to_the_predicted_angle() -> None:
    """Broken by an effect's torque that is used at the start of the step as if it acted at its middle."""
    w = working_array(stiffening__quadratic_nm_per_rad2=0.05)
    bent = terms(compose((EFFECTS["stiffening"],)))
    phi, ahead = 0.6, 0.61
    plain = EQUATIONS.joint_torque(w, 0, phi, ahead, 0.0, 0.0, 0.0, 0.0, E)[0]
    found, stiffness, _, _ = bent.joint_torque(w, 0, phi, ahead, 0.0, 0.0, 0.0, 0.0, E)
    assert found - plain == pytest.approx(-0.05 * (phi**2 + 2 * phi * (ahead - phi)), rel=1e-9)
    assert stiffness == pytest.approx(-value(w, "statics.a1_nm_per_rad") + 2 * 0.05 * phi, rel=1e-9)


def test_effects_of_the_material_follow_its_creep() -> None:
    """Broken by an effect that acts on the whole angle: an aged elasticity pulls towards the crept rest angle."""
    w = working_array(ageing__stiffness_per_h=0.5)
    aged, e = terms(compose((EFFECTS["ageing"],))), (2.0, *E[1:])
    added = 0.5 * 2.0 * value(w, "statics.a1_nm_per_rad") * (0.8 - 0.3 * value(w, "material.phi_max_deg"))
    plain = EQUATIONS.joint_torque(w, 0, 0.8, 0.8, 0.0, 0.0, 0.0, 0.3, e)[0]
    assert aged.joint_torque(w, 0, 0.8, 0.8, 0.0, 0.0, 0.0, 0.3, e)[0] - plain == pytest.approx(added, rel=1e-9)
    plain = EQUATIONS.free_torque(w, 0, 0.8, 0.0, 0.0, 0.3, e)
    assert aged.free_torque(w, 0, 0.8, 0.0, 0.0, 0.3, e) - plain == pytest.approx(added, rel=1e-9)


def test_damping_of_effects_adds_up() -> None:
    """Broken by drag that is left out, or that uses the speed at the start of the step."""
    w = working_array(viscous_friction__quadratic_nm_s2_per_rad2=1e-3)
    d = value(w, "dynamics.viscous_friction_nm_s_per_rad")
    drag = terms(compose((EFFECTS["viscous_friction"],)))
    torque, _, damping, _ = drag.joint_torque(w, 0, 0.5, 0.5, 2.0, 3.0, 0.0, 0.0, E)
    assert damping == pytest.approx(d + 3e-3, rel=1e-12)
    assert torque == pytest.approx(whole_torque(w, 0.5, 2.0, 0.0, 0.0) - 3e-3 * 2.0, rel=1e-12)
    free = drag.free_torque(w, 0, 0.5, 2.0, 0.0, 0.0, E)
    assert free == pytest.approx(whole_torque(w, 0.5, 2.0, 0.0, 0.0) - 2e-3 * 2.0, rel=1e-12)


def test_free_torque_leaves_stops_out() -> None:
    """Broken by a stop or an obstacle that counts twice in the force stage."""
    w = working_array(contact__angle_deg=0.1, contact__stiffness_nm_per_rad=5.0, constant_load__torque_nm=0.01)
    free = EQUATIONS.free_torque(w, 0, 2.5, 1.0, 3e5, 0.2, E)
    w[ROW["end_stop.stiffness_nm_per_rad"]], w[ROW["end_stop.damping_nm_s_per_rad"]] = 0.0, 0.0
    w[ROW["contact.stiffness_nm_per_rad"]] = 0.0
    assert free == pytest.approx(whole_torque(w, 2.5, 1.0, 3e5, 0.2), rel=1e-12)


def test_valve_rate_is_limited_on_both_sides() -> None:
    """Broken by a wrong time constant, a swapped or a missing limit."""
    w = working_array(valve__time_constant_s=0.04, valve__fill_rate_pa_per_s=1e6, valve__vent_rate_pa_per_s=4e5)
    for u, p, rate in ((1.5e5, 1.4e5, 2.5e5), (1.4e5, 1.5e5, -2.5e5), (5e5, 1e5, 1e6), (1e5, 5e5, -4e5)):
        limits = EQUATIONS.valve_limits(w, 0, p, u, p)
        assert limits == (4e5, 1e6)
        assert EQUATIONS.valve_rate(w, 0, u - p, *limits) == pytest.approx(rate, rel=1e-12)


def test_prepared_rows() -> None:
    """Broken by a reciprocal of another parameter, or creep rates that a step does not integrate exactly."""
    w = working_array(material__extension_time_s=0.01, material__recovery_time_s=0.02)
    assert w[rows.PER_TAU, 0] == 1.0 / value(w, "valve.time_constant_s")
    assert w[rows.PER_STOP, 0] == 1.0 / value(w, "end_stop.engagement_deg")
    assert w[rows.PER_CONTACT, 0] == 1.0 / value(w, "contact.engagement_deg")
    assert w[rows.PER_12_INERTIA, 1] == pytest.approx(1.0 / (12.0 * value(w, "dynamics.inertia_kg_m2", 1)), rel=1e-15)
    assert w[rows.EXTENSION, 0] * H == pytest.approx(1.0 - np.exp(-H / 0.01), rel=1e-12)
    assert w[rows.RECOVERY, 0] * H == pytest.approx(1.0 - np.exp(-H / 0.02), rel=1e-12)


def test_creep_step_is_exact_at_constant_pressure() -> None:
    """Broken by a step of creep that is not equation 13."""
    w = working_array(material__extension_time_s=0.01)
    b1, p_min = value(w, "material.b1_per_pa"), value(w, "material.p_min_pa")
    w[X + CREEP, 0] = 0.1
    target = b1 * (3e5 - p_min)
    assert STEP.creep(w, 0, 3e5, H) == pytest.approx(target + (0.1 - target) * np.exp(-H / 0.01), rel=1e-12)


@pytest.mark.parametrize("z", [-3.0, -1.0, -0.2, -0.01, -1e-6, 0.0, 0.05, 0.5])
def test_exponential_mean(z: float) -> None:
    """Broken by any coefficient of the Pade approximation: (e^z - 1) / z to its error of z^4 / 720."""
    first = -2.5e6
    exact = first * (np.expm1(z) / z if z else 1.0)
    found = steps.exponential_mean(first, first * (1.0 + z))
    assert found == pytest.approx(exact, rel=1.6 * z**4 / 720 + 1e-12)
    assert steps.exponential_mean(0.0, 0.0) == 0.0


@pytest.mark.parametrize("x", [-2.0, -1.5, -1e-9, 0.0, 0.3, 2.0, 7.9])
def test_whole_below(x: float) -> None:
    """Broken by rounding towards 0: a clock that is ahead gives a negative lag."""
    assert steps.whole_below(x) == np.floor(x)


@pytest.mark.parametrize(("lag", "at", "within"), [(0.0, 0.0, -1), (2.25, 2.5, 2), (1.3, 3.0, -1), (-0.25, 7.5, 7)])
def test_deliver_notes_the_change_of_a_sample(lag: float, at: float, within: int) -> None:
    """Broken by a dead time that is rounded to samples or steps, or a change reported for another step."""
    w = working_array()
    assert steps.deliver(w, 0, 1e5, 2e5, lag, 10) == within
    assert w[rows.BEFORE, 0] == 1e5
    assert w[rows.AFTER, 0] == 2e5
    assert w[rows.ARRIVAL, 0] == pytest.approx(at, abs=1e-9)
    if within < 0:
        assert w[rows.ARRIVAL, 0] == round(at)


def test_a_set_point_that_stays_splits_no_step() -> None:
    """Broken by a step that is split, and takes twice the time, although the set-point is the same in both parts."""
    w = working_array()
    assert steps.deliver(w, 0, 3e5, 3e5, 2.27, 10) == -1
    assert w[rows.ARRIVAL, 0] == round(w[rows.ARRIVAL, 0])  # no step counts as one within which it changes
    assert w[rows.BEFORE, 0] == w[rows.AFTER, 0] == 3e5


def relaxed(p: float, u: float, seconds: float, tau: float) -> float:
    return float(u + (p - u) * np.exp(-seconds / tau))


def test_pressure_follows_the_set_point_in_force() -> None:
    """Broken by a step that takes the other set-point, more than the supply, or a mean that is not the step's."""
    w = working_array()
    tau, supply = value(w, "valve.time_constant_s"), value(w, "supply.pressure_pa")
    w[X + P, 0] = 3.5e5
    steps.deliver(w, 0, 3e5, 4e5, 0.5, 10)
    for n, u in ((0, 3e5), (4, 3e5), (5, 4e5), (9, 4e5)):
        after, mean = STEP.pressure(w, 0, n, E, H)
        assert after == pytest.approx(relaxed(3.5e5, u, H, tau), rel=1e-9)
        assert mean == pytest.approx(0.5 * (3.5e5 + after), rel=1e-12)
    for wanted, given in ((-1e5, 0.0), (9e5, supply)):
        w[X + P, 0] = abs(given - 1e3)
        steps.deliver(w, 0, wanted, wanted, 0.0, 10)
        assert STEP.pressure(w, 0, 3, E, H)[0] == pytest.approx(relaxed(abs(given - 1e3), given, H, tau), rel=1e-9)


def test_the_expected_pressure_is_that_of_the_plain_valve() -> None:
    """Broken by another lag or another limit in what the controller expects of a valve."""
    tau, vent, fill = 0.06, 8e5, 1e6
    assert steps.valve_pressure(1e5, 1.2e5, tau, vent, fill, 5e-3) == pytest.approx(
        relaxed(1e5, 1.2e5, 5e-3, tau), rel=1e-7
    )
    assert steps.valve_pressure(1e5, 5e5, tau, vent, fill, 5e-3) == pytest.approx(1.05e5, rel=1e-12)
    assert steps.valve_pressure(5e5, 1e5, tau, vent, fill, 5e-3) == pytest.approx(4.96e5, rel=1e-12)


def test_a_split_step_is_exact() -> None:
    """Broken by set-points that are averaged over a step: with rate limits that gives another pressure."""
    w = working_array(valve__vent_rate_pa_per_s=1e6)
    tau = value(w, "valve.time_constant_s")
    w[X + P, 0] = 4e5
    steps.deliver(w, 0, 4.2e5, 0.0, 0.27, 10)  # the change is in force for 0.3 of step 2
    middle = relaxed(4e5, 4.2e5, 0.7 * H, tau)
    after, mean = STEP.split_pressure(w, 0, 2, E, H)
    assert after == pytest.approx(middle - 1e6 * 0.3 * H, rel=1e-9)
    expected = 0.7 * 0.5 * (4e5 + middle) + 0.3 * 0.5 * (middle + after)
    assert mean == pytest.approx(expected, rel=1e-12)
    for n in (0, 1, 3, 9):  # before and after, it is an ordinary step
        assert STEP.split_pressure(w, 0, n, E, H) == pytest.approx(STEP.pressure(w, 0, n, E, H), rel=1e-12)


@inline
def noted(w: Any, i: int, u: float, p: float, e: Any, h: float) -> float:
    """A hook that keeps the set-point that it gets and passes on 2e4 Pa less."""
    w[rows.RISE, i] = u
    return u - 2e4


@inline
def lowered(w: Any, i: int, u: float, p: float, e: Any, h: float) -> float:
    """The same hook without memory."""
    return u - 2e4


def test_effects_remember_the_mean_set_point_of_a_split_step() -> None:
    """Broken by an effect on the set-point that keeps another value than the mean, or whose change of it is lost."""
    w = working_array()
    tau = value(w, "valve.time_constant_s")
    noting = steps.assemble(PLAIN._replace(set_point=noted, set_point_trial=lowered))
    w[X + P, 0] = 2.5e5
    steps.deliver(w, 0, 2e5, 3e5, 0.27, 10)
    after, _ = noting.split_pressure(w, 0, 2, E, H)
    assert w[rows.RISE, 0] == pytest.approx(2e5 + 0.3 * 1e5, rel=1e-12)
    assert after == pytest.approx(relaxed(relaxed(2.5e5, 1.8e5, 0.7 * H, tau), 2.8e5, 0.3 * H, tau), rel=1e-9)
    after, _ = noting.pressure(w, 0, 5, E, H)
    assert w[rows.RISE, 0] == 3e5
    assert after == pytest.approx(relaxed(2.5e5, 2.8e5, H, tau), rel=1e-9)


def test_a_play_follows_a_set_point_within_a_split_step() -> None:
    """Broken by an effect that gets the mean set-point alone: within its play, it holds the valve where it is."""
    w = working_array(valve_hysteresis__width_pa=1e4)
    tau, hooks = value(w, "valve.time_constant_s"), compose((EFFECTS["valve_hysteresis"],))
    hooks.prepare(w, 0, H)
    memory = {name: MEMORY_ROW[f"valve_hysteresis.{name}"] for name in ("behind", "last")}
    w[memory["behind"], 0], w[memory["last"], 0], w[X + P, 0] = -1e4, 2e5, 1e5
    steps.deliver(w, 0, 2e5, 2.7e5, 0.27, 10)
    after, _ = steps.assemble(hooks).split_pressure(w, 0, 2, E, H)
    assert after == pytest.approx(relaxed(relaxed(1e5, 2.1e5, 0.7 * H, tau), 2.6e5, 0.3 * H, tau), rel=1e-9)
    assert w[memory["last"], 0] == pytest.approx(2e5 + 0.3 * 7e4, rel=1e-12)


def test_the_inflow_of_a_step_is_that_of_filling() -> None:
    """Broken by an inflow that venting lowers, that is not the mean of the step, or that changes memory."""
    w = working_array(supply_droop__resistance_s=0.1, supply_droop__share=1.0)
    hooks = compose((EFFECTS["supply_droop"],))
    hooks.prepare(w, 0, H)
    drawing, tau = steps.assemble(hooks), value(w, "valve.time_constant_s")
    memory = MEMORY_ROW["supply_droop.sag"]
    w[memory, 0], w[X + P, 0] = 2e4, 1e5
    before = w.copy()
    steps.deliver(w, 0, 5e4, 3e5, 0.27, 10)  # it vents until the change, for 0.7 of step 2, and fills after it
    vented = relaxed(1e5, 3e4, 0.7 * H, tau)
    filled = relaxed(vented, 2.8e5, 0.3 * H, tau)
    assert drawing.split_inflow(w, 0, 2, E, H) == pytest.approx((filled - vented) / H, rel=2e-3)  # the sag recovers
    assert drawing.inflow(w, 0, 1, E, H) == 0.0
    assert drawing.inflow(w, 0, 3, E, H) == pytest.approx((relaxed(1e5, 2.8e5, H, tau) - 1e5) / H, rel=2e-3)
    w[rows.BEFORE], w[rows.AFTER], w[rows.ARRIVAL] = before[rows.BEFORE], before[rows.AFTER], before[rows.ARRIVAL]
    np.testing.assert_array_equal(w, before)


def test_the_inflow_of_a_switching_valve_is_that_of_the_step_before() -> None:
    """Broken by a trial of a step that moves the pulses of a switching valve."""
    w = working_array(switching_valve__share=1.0)
    w[rows.RISE, 0] = 2e5
    drawing = steps.assemble(compose((EFFECTS["switching_valve"],)))
    steps.deliver(w, 0, 3e5, 3e5, 0.0, 10)
    assert drawing.inflow(w, 0, 5, E, H) == drawing.split_inflow(w, 0, 5, E, H) == 2e5


@pytest.mark.parametrize("wanted_pa", [5.9e5, 0.0])
def test_choked_flow_leak_and_compression_converge_to_solve_ivp(wanted_pa: float) -> None:
    """Broken by the limit of the other direction, a source with another sign, or limits and sources that are not those
    of the middle of the step: then halving the step would halve the error and not quarter it."""
    chosen = compose(tuple(EFFECTS[name] for name in ("valve_flow_limit", "leak", "gas_compression")))
    effects = {"valve_flow_limit__choking": 0.9, "leak__rate_per_s": 3.0, "leak__turbulent": 0.4}
    w = working_array(valve__fill_rate_pa_per_s=4e6, valve__vent_rate_pa_per_s=3e6, gas_compression__exponent=1.2,
                      **effects)  # fmt: skip
    e = (0.0, 0.0, 0.0, 0.0, 0.4, 3.0, 0.0)
    choked, equations, until_s = steps.assemble(chosen), terms(chosen), 0.08

    def rate(_: float, state: Array) -> list[float]:
        p = float(state[0])
        vent, fill = equations.valve_limits(w, 0, p, wanted_pa, p)
        through = equations.valve_rate(w, 0, wanted_pa - p, vent, fill)
        return [through + chosen.pressure_source(w, 0, p, e)]

    errors = []
    chosen.prepare(w, 0, H)
    exact = solve_ivp(rate, (0.0, until_s), [3e5], rtol=1e-9, atol=1e-3, max_step=1e-3).y[0, -1]
    for h in (2e-3, 1e-3, 5e-4):
        w[X + P, 0], w[rows.RISE, 0] = 3e5, rate(0.0, np.array([3e5]))[0]
        steps.deliver(w, 0, wanted_pa, wanted_pa, 0.0, 10)
        for _ in range(round(until_s / h)):
            before = w[X + P, 0]
            w[X + P, 0], _mean = choked.pressure(w, 0, 5, e, h)
            w[rows.RISE, 0] = (w[X + P, 0] - before) / h
        errors.append(abs(w[X + P, 0] - exact))
    assert errors[2] < 20.0
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2], errors


def test_a_switching_valve_takes_the_place_of_the_linear_one() -> None:
    """Broken by a replaced valve whose pressure is not used."""
    w = working_array(switching_valve__share=1.0)
    switching = steps.assemble(compose((EFFECTS["switching_valve"],)))
    steps.deliver(w, 0, 3e5, 3e5, 0.0, 10)
    for step in (switching.pressure, switching.split_pressure):
        w[X + P, 0] = 1e5
        after, mean = step(w, 0, 5, E, H)
        assert after > 1e5
        assert after != pytest.approx(STEP.pressure(w, 0, 5, E, H)[0], rel=1e-6)
        assert mean == pytest.approx(0.5 * (1e5 + after), rel=1e-12)


def test_steps_per_sample() -> None:
    """Broken by a step longer than allowed, or one step more than needed."""
    assert steps.steps_per_sample(5e-3, 5e-4) == 10
    assert steps.steps_per_sample(5.1e-3, 5e-4) == 11
    assert steps.steps_per_sample(1e-4, 5e-4) == 1


def set_state(w: Array, lane: int, phi: float, omega: float, p: float, creep: float, acceleration: float = 0.0) -> None:
    w[X + PHI, lane], w[X + OMEGA, lane] = phi, omega
    w[rows.ACTUATOR, lane], w[rows.MEAN_CREEP, lane], w[rows.ACCELERATION, lane] = p, creep, acceleration


def test_single_step_follows_solve_ivp() -> None:
    """Broken by any term of the implicit step of one joint: 60 steps in a stop with a torque from outside."""
    w = working_array(end_stop__low_deg=-0.3, end_stop__high_deg=0.5)
    inertia, outside = value(w, "dynamics.inertia_kg_m2"), -0.004
    set_state(w, 0, 0.45, 4.0, 2e5, 0.3)
    for _ in range(60):
        STEP.move(w, 0, STEP.single(w, 0, outside, E, H), H, 1.0 / H)
    exact = solve_ivp(
        lambda _, y: [y[1], (whole_torque(w, y[0], y[1], 2e5, 0.3) + outside) / inertia],
        (0.0, 60 * H), [0.45, 4.0], rtol=1e-10, atol=1e-12, max_step=1e-3,
    )  # fmt: skip
    assert w[X + PHI, 0] == pytest.approx(exact.y[0, -1], abs=2e-5)
    assert w[X + OMEGA, 0] == pytest.approx(exact.y[1, -1], abs=1e-2)


def test_move_keeps_angle_speed_and_acceleration() -> None:
    """Broken by a motion that does not use the mean speed of the step."""
    w = working_array()
    set_state(w, 0, 0.3, 2.0, 0.0, 0.0)
    STEP.move(w, 0, 3.0, H, 1.0 / H)
    assert w[X + PHI, 0] == pytest.approx(0.3 + 2.5 * H, rel=1e-14)
    assert w[rows.PHI_BEFORE, 0] == 0.3
    assert w[X + OMEGA, 0] == 3.0
    assert w[rows.ACCELERATION, 0] == pytest.approx(1.0 / H, rel=1e-14)


def test_pair_step_solves_the_mass_matrix() -> None:
    """Broken by a wrong inverse or a missing coupling: two joints at once against solve_ivp."""
    w = working_array()
    inverse = np.linalg.inv(
        [[value(w, "dynamics.inertia_kg_m2", 0), value(w, "dynamics.coupling_inertia_kg_m2")],
         [value(w, "dynamics.coupling_inertia_kg_m2"), value(w, "dynamics.inertia_kg_m2", 1)]]
    )  # fmt: skip
    first, second = w[:, [0]], w[:, [1]]
    for lane, state in enumerate(((0.4, 3.0, 3e5, 0.1), (0.8, -6.0, 1e5, 0.2))):
        set_state(w, lane, *state)
    for _ in range(40):
        a, b = STEP.pair(w, 0, 1, E, E, H)
        STEP.move(w, 0, a, H, 1.0 / H)
        STEP.move(w, 1, b, H, 1.0 / H)

    def slope(_: float, y: Array) -> Array:
        torque = [whole_torque(first, y[0], y[2], 3e5, 0.1), whole_torque(second, y[1], y[3], 1e5, 0.2)]
        return np.array([y[2], y[3], *(inverse @ torque)])

    exact = solve_ivp(slope, (0.0, 40 * H), [0.4, 0.8, 3.0, -6.0], rtol=1e-10, atol=1e-12, max_step=1e-3).y[:, -1]
    np.testing.assert_allclose(w[X + PHI], exact[:2], atol=3e-5)
    np.testing.assert_allclose(w[X + OMEGA], exact[2:], atol=5e-3)


def test_speed_in_the_middle_of_a_step_is_predicted() -> None:
    """Broken by drag that uses the speed at the start: with it the step would be of first order only."""
    w = working_array(viscous_friction__quadratic_nm_s2_per_rad2=1e-3)
    drag = steps.assemble(compose((EFFECTS["viscous_friction"],)))
    set_state(w, 0, 0.5, 4.0, 1e5, 0.0, acceleration=800.0)
    found = drag.single(w, 0, 0.0, E, H)
    d = value(w, "dynamics.viscous_friction_nm_s_per_rad") + 1e-3 * (4.0 + 0.5 * H * 800.0)
    stiffness = -value(w, "statics.a1_nm_per_rad") - value(w, "statics.a3_nm_per_pa_rad") * 1e5
    middle = 0.5 + 0.5 * H * 4.0
    torque = whole_torque(w, middle, 0.0, 1e5, 0.0) - d * 4.0
    mass = value(w, "dynamics.inertia_kg_m2") + 0.5 * H * d + 0.25 * H * H * stiffness
    assert found == pytest.approx(4.0 + H * torque / mass, rel=1e-12)


def test_a_hard_stop_does_not_reverse_the_speed() -> None:
    """Broken by a damper of a stop in the midpoint rule alone: it would throw the joint back each step."""
    w = working_array(end_stop__high_deg=0.5, end_stop__damping_nm_s_per_rad=1.0, end_stop__engagement_deg=1e-4)
    set_state(w, 0, 0.51, 2.0, 0.0, 0.0)
    after = STEP.single(w, 0, 0.0, E, H)
    inertia, rate = value(w, "dynamics.inertia_kg_m2"), H * 1.0
    d, k = value(w, "dynamics.viscous_friction_nm_s_per_rad"), value(w, "end_stop.stiffness_nm_per_rad")
    mass = inertia + 0.5 * (H * d + rate) + 0.25 * H * H * (k - value(w, "statics.a1_nm_per_rad"))
    mass += rate**2 / (12.0 * inertia)
    assert after == pytest.approx(2.0 + H * whole_torque(w, 0.51 + H, 2.0, 0.0, 0.0) / mass, rel=1e-12)
    assert after > -0.5


def test_friction_stops_slows_and_turns_one_joint() -> None:
    """Broken by friction of another size or sign, a joint that does not stick, or one that turns wrongly."""
    w = working_array(coulomb_friction__torque_nm=0.02, coulomb_friction__presliding_deg=1e-4)
    frictionless = w.copy()
    for omega, outside in ((5.0, 0.0), (-5.0, 0.0), (0.0, 0.015), (0.0, 0.05), (0.1, -0.05), (-0.1, 0.05)):
        for array in (w, frictionless):
            set_state(array, 0, 0.5, omega, 1e5, 0.0)
        rest = -whole_torque(w, 0.5 + 0.5 * H * omega, omega, 1e5, 0.0)
        push = outside + rest
        found, free = RUBBING.single(w, 0, push, E, H), STEP.single(frictionless, 0, push, E, H)
        mass = (H * outside) / (free - omega) if outside else 0.0
        if outside == 0.0:
            step_mass = (STEP.single(frictionless, 0, push + 0.01, E, H) - omega) / (0.01 * H)
            assert found == pytest.approx(omega - np.sign(omega) * 0.02 * H * step_mass, rel=1e-9)
        elif abs(outside) < 0.02:
            assert found == 0.0
        elif omega == 0.0:
            assert found == pytest.approx(free - 0.02 * H / mass, rel=1e-9)
        else:  # it stops within the step, then it moves the other way against friction
            direction = np.sign(omega)
            until = abs(omega) * mass / (0.05 + 0.02)
            assert 0.0 < until < H
            assert found == pytest.approx(-direction * (0.05 - 0.02) * (H - until) / mass, rel=1e-9)


MASSES = (1.3e-4, 3.2e-5, 4e-5)


def settled_pair(a: float, b: float, rub_a: float, rub_b: float) -> tuple[float, float]:
    """Speeds by projected Gauss-Seidel iterations on the impulses, until they do not change."""
    matrix = np.array([[MASSES[0], MASSES[2]], [MASSES[2], MASSES[1]]])
    inverse, impulse = np.linalg.inv(matrix), np.zeros(2)
    for _ in range(300):
        for i, limit in enumerate((rub_a, rub_b)):
            speed = np.array([a, b]) + inverse @ impulse
            impulse[i] = np.clip(impulse[i] - speed[i] / inverse[i, i], -limit, limit)
    speed = np.array([a, b]) + inverse @ impulse
    return float(speed[0]), float(speed[1])


def test_two_coupled_joints_stick_and_slide() -> None:
    """Broken by any of the four cases of two rubbing joints, in each direction; against an iterative solution."""
    rng = np.random.default_rng(12)
    kinds = set()
    for _ in range(200):
        a, b = rng.uniform(-2.0, 2.0, 2)
        rub_a, rub_b = rng.uniform(0.0, 1.5e-4, 2)
        *found, over_a, over_b = rub_pair(0.0, 0.0, a, b, *MASSES, rub_a, rub_b)
        assert over_a == over_b == 0.0
        expected = settled_pair(a, b, rub_a, rub_b)
        assert tuple(found) == pytest.approx(expected, rel=1e-6, abs=1e-9), (a, b, rub_a, rub_b)
        kinds.add(tuple(int(np.sign(round(speed, 9))) for speed in expected))
    assert len(kinds) == 9, f"seed 12 shows only {sorted(kinds)}"
    assert rub_pair(0.0, 0.0, 1.0, -2.0, *MASSES, 0.0, 0.0)[:2] == pytest.approx((1.0, -2.0), rel=1e-12)


def in_small_parts(before: Array, free: Array, rub: Array, parts: int = 1000) -> tuple[Array, Array, int]:
    """Speeds after a step of a pair with friction, sums of mean speeds (twice the way), and how often one stops."""
    speed, way, stops = before.copy(), np.zeros(2), 0
    for _ in range(parts):
        after = np.array(rub_pair(0.0, 0.0, *(speed + (free - before) / parts), *MASSES, *(rub / parts))[:2])
        stops += int(np.sum((speed != 0.0) & (speed * after <= 0.0)))
        way, speed = way + (speed + after) / parts, after
    return speed, way, stops


def test_a_pair_stops_and_turns_where_small_steps_do() -> None:
    """Broken by friction that acts too long against the old speed, a partner that does not share what happens then, or
    a way that goes on after a stop; up to two stops within a step, of joints that move or rest before."""
    rng, kinds = np.random.default_rng(5), set()
    for trial in range(120):
        before, free, rub = rng.uniform(-1.0, 1.0, 2), rng.uniform(-2.0, 2.0, 2), rng.uniform(0.0, 1.5e-4, 2)
        if trial % 3 == 0:
            before[trial % 2] = 0.0
        expected, way, stops = in_small_parts(before, free, rub)
        *found, over_a, over_b = rub_pair(*before, *free, *MASSES, *rub)
        if stops < 2:
            np.testing.assert_allclose(found, expected, atol=2e-3)
            np.testing.assert_allclose(before + found - (over_a, over_b), way, atol=4e-3)
        kinds.add(stops)
    assert kinds >= {0, 1, 2}, "seed 5"


def test_joints_that_go_on_are_those_of_the_whole_solution() -> None:
    """Broken by a short cut that differs from the solution of all cases, or that is taken where a joint stops."""
    rng, kinds = np.random.default_rng(8), set()
    for _ in range(400):
        before = rng.uniform(-1.0, 1.0, 2) * rng.choice([0.0, 1.0], 2)
        free, rub = before + rng.uniform(-0.6, 0.6, 2), rng.uniform(0.0, 1.5e-4, 2) * rng.choice([0.0, 1.0], 2)
        *found, goes_on = goes_on_pair(*before, *free, *MASSES, *rub)
        *expected, over_a, over_b = rub_pair(*before, *free, *MASSES, *rub)
        if goes_on:
            assert tuple(found) == pytest.approx(tuple(expected), rel=1e-9, abs=1e-12)
            assert over_a == pytest.approx(0.0, abs=1e-12)
            assert over_b == pytest.approx(0.0, abs=1e-12)
        kinds.add((goes_on, *(bool(each) for each in (before == 0.0) & (np.array(expected) == 0.0))))
    assert len(kinds) >= 6, f"seed 8 shows only {sorted(kinds)}"


def test_pair_with_friction_uses_each_joints_own() -> None:
    """Broken by friction that is exchanged between the joints of a pair, or left out."""
    w = working_array(coulomb_friction__presliding_deg=1e-4)
    w[ROW["coulomb_friction.torque_nm"]] = (0.002, 0.03)
    for lane, state in enumerate(((0.4, 3.0, 3e5, 0.1), (0.8, -6.0, 1e5, 0.2))):
        set_state(w, lane, *state)
    free = np.array(STEP.pair(w, 0, 1, E, E, H))
    found = np.array(RUBBING.pair(w, 0, 1, E, E, H))
    shared = value(w, "dynamics.coupling_inertia_kg_m2")
    mass = [value(w, "dynamics.inertia_kg_m2", lane) + 0.5 * H * value(w, key, lane) for lane in (0, 1)
            for key in ("dynamics.viscous_friction_nm_s_per_rad",)]  # fmt: skip
    lost = np.linalg.solve([[mass[0], shared], [shared, mass[1]]], [-0.002 * H, 0.03 * H])
    np.testing.assert_allclose(found - free, lost, rtol=2e-3)
    w[ROW["coulomb_friction.torque_nm"]] = 0.0
    assert RUBBING.pair(w, 0, 1, E, E, H) == pytest.approx(tuple(free), rel=1e-15)


def test_memory_gets_the_motion_of_the_step() -> None:
    """Broken by a memory of motion that misses a step, or gets another angle than the one moved to."""
    w = working_array(backlash__gap_deg=0.02, hysteresis__torque_nm=0.01)
    chosen = tuple(EFFECTS[name] for name in ("hysteresis", "backlash"))
    hooks = compose(chosen)
    hooks.prepare(w, 0, H)
    remembering = steps.assemble(hooks)
    for row in range(len(ROW), X):
        assert np.isfinite(w[row, 0])
    before = w[:, 0].copy()
    set_state(w, 0, 0.3, 100.0, 0.0, 0.0)
    remembering.move(w, 0, 100.0, H, 1.0 / H)
    remembering.remember(w, 0, H)
    changed = [row for row in range(len(ROW), X) if w[row, 0] != before[row]]
    assert len(changed) >= 2
    assert float(hooks.angle_reading(w, 0, w[X + PHI, 0])) == pytest.approx(0.35 - 0.01, abs=1e-9)
