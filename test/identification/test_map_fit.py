"""The fit in lanes against scipy.optimize.least_squares, and what it owes to prior, bounds and validation data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, least_squares

from hand_identification.common_scale import at_prior_scale
from hand_identification.free_parameters import FreeParameter, nominal_free_parameters
from hand_identification.idle_numbers import idle_at_prior
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit, multi_start
from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
JOINT = "index_distal"
PERIOD_S = 0.005
SEED = 3
IN_DEVIATIONS = 0.03
"""How far the optima of both methods may lie apart, in posterior standard deviations; the fit stops where its cost
falls by less than 0.02, which is the cost 0.14 deviations away from the optimum."""
IN_COVARIANCE = 0.02
"""How far the covariances may differ, relative to the largest element: both take finite differences of a simulation."""


def make_problem() -> JointProblem:
    """A joint whose valve, statics and dynamics differ from the description, 24 s of random steps with sensor noise."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    hand = load_hand(CONFIG)
    parameters = hand.parameters.copy()
    for key in ("valve.time_constant_s", "statics.a1_nm_per_rad", "dynamics.viscous_friction_nm_s_per_rad"):
        parameters[ROW[key]] *= rng.uniform(0.93, 1.1, len(hand.joints))
    count = round(24.0 / PERIOD_S)
    commands = np.repeat(rng.uniform(0, 4e5, (count // 150, len(hand.joints))), 150, axis=0)
    plant = HandPlant(replace(hand, parameters=parameters), PERIOD_S)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    shape, yes = commands.shape, np.ones(len(hand.joints), dtype=bool)
    pressure = states[:, P] + 150.0 * rng.standard_normal(shape)
    angle = states[:, PHI] + np.radians(0.03) * rng.standard_normal(shape)
    nothing, known = np.full(shape, np.nan), np.ones(shape, dtype=bool)
    signals = Signals(
        name="steps",
        joints=hand.joints,
        period_s=PERIOD_S,
        set_point_pa=commands,
        pressure_pa=pressure,
        angle_rad=angle,
        force_n=nothing,
        known=known,
        has_set_point=yes,
        has_pressure=yes,
    )
    return joint_problem([signals], hand, JOINT)


@pytest.fixture(scope="module")
def problem() -> JointProblem:
    return make_problem()


@pytest.fixture(scope="module")
def free(problem: JointProblem) -> list[FreeParameter]:
    """The nominal numbers with their priors; two of them by their logarithm.

    The creeping ratio at the start is left out: its slope has a kink at its bound, where finite differences of
    different steps differ.
    """
    linear = [p for p in nominal_free_parameters(problem.nominal, 0.05, True) if p.row < len(JOINT_PARAMETERS)]
    ratios = {ROW["valve.time_constant_s"], ROW["dynamics.viscous_friction_nm_s_per_rad"]}
    return [
        FreeParameter(p.row, p.centre, 0.2, True, 0.1 * p.centre, 10.0 * p.centre) if p.row in ratios else p
        for p in linear
    ]


def residual_vector(problem: JointProblem, free: list[FreeParameter], z: Array) -> Array:
    """Weighted residuals of the training blocks, then the prior's: half their squares is half the cost of map_fit."""
    residuals = problem.residuals(*problem.columns(free, z[None]))
    train = ~problem.validation
    root = np.sqrt(problem.weight)[:, None]
    parts = [(root * r[0] * train[s.block]).ravel() for r, s in zip(residuals, problem.segments, strict=True)]
    return np.concatenate([*parts, z])


def reference(problem: JointProblem, free: list[FreeParameter], start: Array) -> OptimizeResult:
    low = [max(p.coordinate(p.low), -8.0) - 1e-9 for p in free]
    high = [min(p.coordinate(p.high), 8.0) + 1e-9 for p in free]
    options = {"jac": "3-point", "xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-10}
    return least_squares(lambda z: residual_vector(problem, free, z), start, bounds=(low, high), **options)


def assert_same_optimum(fit: MapFit, found: OptimizeResult) -> None:
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    apart = np.abs(fit.z - found.x) / np.sqrt(np.diag(covariance))
    assert apart.max() < IN_DEVIATIONS, dict(zip([p.key for p in fit.free], apart.round(3), strict=True))
    assert fit.cost == pytest.approx(2.0 * found.cost, abs=0.02)
    assert np.abs(fit.covariance - covariance).max() < IN_COVARIANCE * np.abs(covariance).max()


def test_the_optimum_is_that_of_least_squares(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when optimum or covariance differ from scipy's: a wrong slope, a wrong prior, a wrong weight."""
    zero = np.zeros(len(free))
    assert_same_optimum(map_fit(problem, free, zero, 30), reference(problem, free, zero))


def test_the_prior_pulls_back_what_the_data_do_not_determine(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when the prior is dropped from the gradient or from the curvature, which the data then never replace.

    The rates of the valve limit nothing in this recording: from wherever the fit starts, their optimum is 0.
    """
    flat = [k for k, p in enumerate(free) if p.key in ("valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s")]
    assert len(flat) == 2
    start = np.zeros(len(free))
    start[flat] = 1.5, -1.2
    fit = map_fit(problem, free, start, 30)
    assert np.abs(fit.z[flat]).max() < 0.01
    assert np.sqrt(np.diag(fit.covariance))[flat] == pytest.approx(1.0, abs=0.01)
    assert_same_optimum(fit, reference(problem, free, np.zeros(len(free))))


def test_a_bound_holds_and_the_others_settle_next_to_it(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when a parameter leaves its bounds, or when the others stop short because one has reached its bound."""
    unbounded = map_fit(problem, free, np.zeros(len(free)), 30)
    k = next(k for k, p in enumerate(free) if p.key == "valve.time_constant_s")
    edge = free[k].value(np.asarray(0.4 * unbounded.z[k]))
    limited = replace(free[k], high=float(edge)) if unbounded.z[k] > 0 else replace(free[k], low=float(edge))
    bounded = [*free[:k], limited, *free[k + 1 :]]
    fit = map_fit(problem, bounded, np.zeros(len(free)), 30)
    found = reference(problem, bounded, np.zeros(len(free)))
    assert fit.z[k] == pytest.approx(0.4 * unbounded.z[k], abs=1e-9)
    assert fit.cost > unbounded.cost + 1.0
    others = np.delete(np.arange(len(free)), k)
    deviation = np.sqrt(np.diag(np.linalg.inv((found.jac.T @ found.jac)[np.ix_(others, others)])))
    assert (np.abs(fit.z - found.x)[others] / deviation).max() < IN_DEVIATIONS
    assert fit.cost == pytest.approx(2.0 * found.cost, abs=0.02)


def test_cost_is_weighted_squares_and_prior(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when cost, squares and residuals of a fit do not belong to its own point, or the cost did not fall."""
    start = 0.5 * np.random.default_rng(SEED).standard_normal(len(free))
    fit = map_fit(problem, free, start, 3)
    vector = residual_vector(problem, free, fit.z)
    assert fit.cost == pytest.approx(float(vector @ vector), rel=1e-9)
    assert fit.cost == pytest.approx(float(costs_at(problem, free, fit.z[None])[0]), rel=1e-9)
    assert fit.cost < costs_at(problem, free, start[None])[0]
    ours = problem.residuals(*problem.columns(free, fit.z[None]))
    assert all(np.array_equal(a, b[0]) for a, b in zip(fit.residuals, ours, strict=True))
    assert np.allclose(fit.squares, problem.block_squares(ours)[0])


def test_validation_data_are_not_fitted(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when a validation block has any influence on the fit."""
    segment = problem.segments[0]
    spoilt = segment.angle_rad + 0.1 * problem.validation[segment.block]
    other = replace(problem, segments=[replace(segment, angle_rad=spoilt)])
    zero = np.zeros(len(free))
    here, there = map_fit(problem, free, zero, 4), map_fit(other, free, zero, 4)
    assert np.array_equal(here.z, there.z)
    assert here.cost == there.cost
    assert np.array_equal(here.normal, there.normal)
    assert there.squares[1, problem.validation].sum() > 10.0 * here.squares[1, problem.validation].sum()


def test_a_start_that_does_not_simulate_is_moved_towards_the_prior(problem: JointProblem) -> None:
    """Fails when a start whose simulation is not finite ends the fit or is taken for its result."""
    row = ROW["dynamics.inertia_kg_m2"]
    wild = [FreeParameter(row, float(problem.nominal[row]), 1.0, True, 1e-300, 1.0)]
    start = np.array([-8.0])
    fit = map_fit(problem, wild, start, 12)
    assert np.isfinite(fit.cost)
    assert abs(fit.z[0]) < 2.0


def test_several_starts_give_the_best(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when multi_start returns anything but the cheapest of its fits."""
    rng = np.random.default_rng(SEED)
    starts = [np.zeros(len(free)), *(rng.standard_normal((2, len(free))))]
    best = multi_start(problem, free, starts)
    alone = [map_fit(problem, free, start, 25).cost for start in starts]
    assert best.cost <= min(alone) + 0.02


def test_resolutions_are_conditional_deviations(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when a rounding to a tenth of a resolution changes the cost noticeably."""
    fit = map_fit(problem, free, np.zeros(len(free)), 30)
    columns = problem.columns(free, fit.z[None])[0][0]
    resolutions = fit.resolutions(columns)
    moved = np.array([p.coordinate(float(columns[p.row]) + 0.05 * resolutions[p.key]) for p in free])
    inside = np.array([p.low < columns[p.row] + 0.05 * resolutions[p.key] < p.high for p in free])
    points = np.where(np.eye(len(free), dtype=bool), moved[None], fit.z[None])
    rise = costs_at(problem, free, points) - fit.cost
    assert np.abs(rise[inside]).max() < 0.05
    assert inside.sum() >= len(free) - 2


def test_torques_that_are_all_too_large_return_to_their_prior(problem: JointProblem, free: list[FreeParameter]) -> None:
    """Fails when a fit keeps a common factor of all torques, which no motion shows, or takes one that a force shows."""
    done = map_fit(problem, free, np.zeros(len(free)))
    torques = ["_nm" in p.key or p.key.endswith("_kg_m2") for p in free]
    factors = np.where(torques, 1.2, 1.0)
    values = [float(p.value(done.z[k : k + 1])[0]) for k, p in enumerate(free)]
    drifted = map_fit(
        problem, free, np.array([p.coordinate(f * v) for p, f, v in zip(free, factors, values, strict=True)]), 1
    )
    assert drifted.cost > done.cost + 5.0
    back = at_prior_scale(problem, drifted)
    assert back.cost < done.cost + 0.1
    measured = replace(problem, segments=[replace(s, use=np.ones_like(s.use)) for s in problem.segments])
    assert at_prior_scale(measured, drifted) is drifted
    assert at_prior_scale(problem, back) is back


def _with_stop(problem: JointProblem, free: list[FreeParameter], beyond_deg: float) -> tuple[FreeParameter, ...]:
    """The free parameters and the angle of a stop, expected beyond the largest angle that was read, give or take 5."""
    row = ROW["end_stop.high_deg"]
    expected = problem.motion_rad[1] + np.radians(beyond_deg)
    return (*free, FreeParameter(row, expected, float(np.radians(5.0)), False, -1.0, 3.0))


@pytest.mark.parametrize("beyond_deg", [2.0, -10.0], ids=["not reached", "in the way"])
def test_a_stop_that_is_not_reached_returns_to_its_expected_angle(
    problem: JointProblem, free: list[FreeParameter], beyond_deg: float
) -> None:
    """Fails when a fit keeps a stop where it stepped to and which the joint does not reach, or moves it into
    the way.
    """
    with_stop = _with_stop(problem, free, beyond_deg)
    fitted = map_fit(problem, free, np.zeros(len(free)))
    done = map_fit(problem, with_stop, np.array([*fitted.z, (12.0 - beyond_deg) / 5.0]), 1)
    assert done.normal[-1, -1] == 0.0 and done.z[-1] > 1.0
    back = idle_at_prior(problem, done)
    assert back.z[:-1] == pytest.approx(done.z[:-1])
    if beyond_deg > 0.0:
        assert back.z[-1] == 0.0 and back.cost < done.cost
    else:
        assert back is done
