"""The algorithm of the fit on small analytic problems: no simulation, so that a mutation run can use these tests.

Fails when a step, a bound, the prior, a weight or the split into training and validation blocks is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from hand_identification import map_fit as module
from hand_identification.free_parameters import START_CREEP, FreeParameter, fixed
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import costs_at, map_fit, multi_start
from hand_identification.shared_fit import Part as SharedPart
from hand_identification.shared_fit import shared_fit
from hand_model.arrays import Array, Flags

OUTPUTS, SAMPLES, BLOCKS = 3, 60, 6
Model = Callable[[Array, Array], Array]


@dataclass
class Part:
    """A recording of the problem: its block numbers (T,) and used samples (OUTPUTS, T)."""

    block: Any
    use: Flags
    trust: float = 1.0


@dataclass
class Curve:
    """Least squares of a model f(values, t) in two parts, whose second stage has other units and weight."""

    model: Model
    data: list[Array]
    weight: Array = field(default_factory=lambda: np.array([4.0, 0.25, 1.0]))
    held: tuple[int, ...] = (2, 5)
    calls: list[Array] = field(default_factory=list)

    @property
    def segments(self) -> list[Part]:
        use = np.zeros((OUTPUTS, SAMPLES), dtype=bool)
        use[:2] = True
        per = SAMPLES * 2 // BLOCKS
        blocks = np.arange(2 * SAMPLES) // per
        return [Part(blocks[:SAMPLES], use), Part(blocks[SAMPLES:], use)]

    @property
    def block_weights(self) -> Array:
        return np.repeat(self.weight[:, None], BLOCKS, axis=1)

    @property
    def validation(self) -> Flags:
        return np.isin(np.arange(BLOCKS), self.held)

    def columns(self, free: Sequence[FreeParameter], z: Array) -> tuple[Array, Array]:
        self.calls.append(z)
        return np.array([parameter.value(z[:, i]) for i, parameter in enumerate(free)]).T, np.zeros(len(z))

    def residuals(self, columns: Array, _: Array) -> list[Array]:
        out = []
        for part, measured in enumerate(self.data):
            t = TIMES[part * SAMPLES : (part + 1) * SAMPLES]
            residual = np.zeros((len(columns), OUTPUTS, SAMPLES))
            for k, values in enumerate(columns):
                residual[k, :2] = measured - np.array([self.model(values, t), 3.0 * self.model(values, t)])
            out.append(residual)
        return out

    def block_squares(self, residuals: Sequence[Array]) -> Array:
        total = np.zeros((len(residuals[0]), OUTPUTS, BLOCKS))
        for part, residual in zip(self.segments, residuals, strict=True):
            for block in range(BLOCKS):
                total[..., block] += (residual[..., part.block == block] ** 2).sum(axis=-1)
        return total

    def weighted(self, free: Sequence[FreeParameter], z: Array) -> Array:
        """Weighted residuals of the training blocks, then the prior's, computed independently."""
        columns = np.array([[parameter.value(z[i : i + 1])[0] for i, parameter in enumerate(free)]])
        parts = []
        for part, residual in zip(self.segments, self.residuals(columns, np.zeros(1)), strict=True):
            train = ~np.isin(part.block, self.held)
            parts += [np.sqrt(self.weight[stage]) * residual[0, stage][train] for stage in (0, 1)]
        return np.concatenate([*parts, z])


TIMES = np.linspace(0.0, 3.0, 2 * SAMPLES)


def decay(values: Array, t: Array) -> Array:
    offset, size, rate = values
    return np.asarray(offset + size * np.exp(-rate * t))


def problem(model: Model, truth: Sequence[float], noise: float = 0.02, seed: int = 5) -> Any:
    rng = np.random.default_rng(seed)
    data = []
    for part in range(2):
        clean = model(np.array(truth), TIMES[part * SAMPLES : (part + 1) * SAMPLES])
        data.append(
            np.array([clean, 3.0 * clean]) + noise * rng.standard_normal((2, SAMPLES)) * np.array([[1.0], [4.0]])
        )
    return Curve(model, data)


def joint(curve: Any) -> JointProblem:
    return cast(JointProblem, curve)


OFFSET = FreeParameter(2, 0.0, 0.5, False, -10.0, 10.0)
SIZE = FreeParameter(3, 1.0, 0.4, False, -10.0, 10.0)
RATE = FreeParameter(1, 1.0, 0.5, True, 0.01, 50.0)
FREE = (OFFSET, SIZE, RATE)


def test_the_fit_is_that_of_scipy() -> None:
    """Broken by a wrong gradient, prior, weight, split or damping: optimum, cost and covariance of least_squares."""
    curve = problem(decay, (0.3, 1.6, 2.2))
    found = map_fit(joint(curve), FREE, np.zeros(3), 30, 1e-9)
    expected = least_squares(lambda z: curve.weighted(FREE, z), np.zeros(3), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(found.z, expected.x, atol=2e-3)
    assert found.cost == pytest.approx(2.0 * expected.cost, rel=1e-5)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(expected.jac.T @ expected.jac), rtol=0.02, atol=1e-7)
    columns, starts = curve.columns(FREE, found.z[None])
    residuals = curve.residuals(columns, starts)
    for own, again in zip(found.residuals, residuals, strict=True):
        np.testing.assert_allclose(own, again[0], atol=1e-12)
    np.testing.assert_allclose(found.squares, curve.block_squares(residuals)[0], rtol=1e-12)
    assert found.free == FREE
    assert found.iterations < 30


def test_validation_blocks_do_not_count() -> None:
    """Broken by a fit that sees the validation blocks."""
    curve = problem(decay, (0.3, 1.6, 2.2))
    spoilt = problem(decay, (0.3, 1.6, 2.2))
    for part, data in zip(spoilt.segments, spoilt.data, strict=True):
        data[:, np.isin(part.block, spoilt.held)] += 100.0
    fits = [map_fit(joint(each), FREE, np.zeros(3), 20, 1e-9) for each in (curve, spoilt)]
    np.testing.assert_array_equal(fits[0].z, fits[1].z)
    assert fits[0].cost == fits[1].cost


def test_the_prior_counts_once() -> None:
    """Broken by a prior that is missing or doubled in cost, gradient or covariance: data without information."""
    flat = problem(lambda values, t: 0.0 * t + 0.0 * values[0], (0.0,), noise=0.0)
    found = map_fit(joint(flat), (OFFSET,), np.array([2.0]), 20, 1e-9)
    assert found.z == pytest.approx(0.0, abs=1e-6)
    assert found.covariance[0, 0] == pytest.approx(1.0, rel=1e-9)
    assert costs_at(joint(flat), (OFFSET,), np.array([[2.0], [-3.0]])) == pytest.approx([4.0, 9.0], rel=1e-12)


def test_bounds_hold_and_the_others_move_on() -> None:
    """Broken by a step over a bound, or one that stops all coordinates because one of them is at its bound."""
    tight = (FreeParameter(2, 0.0, 0.5, False, -0.1, 0.1), SIZE, FreeParameter(1, 1.0, 0.5, True, 0.01, 1.5))
    curve = problem(decay, (0.3, 1.6, 2.2))
    found = map_fit(joint(curve), tight, np.zeros(3), 40, 1e-9)
    low, high = np.array([-0.2, -8.0, -8.0]), np.array([0.2, 8.0, np.log(1.5) / 0.5])
    limits = (np.maximum(low, [-0.2, -27.5, np.log(0.01) / 0.5]), high)
    expected = least_squares(lambda z: curve.weighted(tight, z), np.zeros(3), bounds=limits, xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(found.z, expected.x, atol=5e-3)
    assert found.cost == pytest.approx(2.0 * expected.cost, rel=1e-4)
    assert all(np.all((z >= limits[0] - 1e-12) & (z <= limits[1] + 1e-12)) for z in curve.calls[2:])


def test_coordinates_stay_within_eight_deviations() -> None:
    """Broken by a search without a limit, or one whose start is not brought into it; a value 0 has no logarithm."""
    from_zero = FreeParameter(1, 1.0, 0.5, True, 0.0, 1e9)
    low, high = module.bounds_of((OFFSET, from_zero, FreeParameter(2, 0.0, 0.5, False, -1.0, 2.0)))
    np.testing.assert_allclose(low, [-8.0, -8.0, -2.0])
    np.testing.assert_allclose(high, [8.0, 8.0, 4.0])
    small = FreeParameter(1, 1.0, 0.5, True, 0.5, 1e9)
    assert module.bounds_of((small,))[0][0] == pytest.approx(np.log(0.5) / 0.5, rel=1e-12)
    curve = problem(decay, (0.3, 1.6, 2.2))
    map_fit(joint(curve), FREE, np.array([50.0, -50.0, 50.0]), 1)
    np.testing.assert_array_equal(curve.calls[0][:1], [[8.0, -8.0, np.log(50.0) / 0.5]])


def test_an_unusable_start_moves_towards_the_prior() -> None:
    """Broken by a fit that begins where the simulation is not finite, or farther from its start than needed."""

    def explodes(values: Array, t: Array) -> Array:
        return decay(values, t) + (np.nan if values[0] > 0.9 else 0.0)

    curve = problem(explodes, (0.3, 1.6, 2.2))
    map_fit(joint(curve), FREE, np.array([4.0, 0.0, 0.0]), 1)
    tried = [float(z[0, 0]) for z in curve.calls if len(z) == 1]
    assert tried == pytest.approx([4.0, 3.6, 2.8, 2.0, 1.2], rel=1e-12)
    assert np.isinf(costs_at(joint(curve), FREE, np.array([[2.0, 0.0, 0.0]]))[0])
    for limit, last in ((0.3, 0.4), (0.05, 0.0)):
        curve.model = lambda values, t, limit=limit: decay(values, t) + (np.nan if values[0] > limit else 0.0)
        curve.calls.clear()
        map_fit(joint(curve), FREE, np.array([4.0, 0.0, 0.0]), 1)
        assert [float(z[0, 0]) for z in curve.calls if len(z) == 1][-1] == pytest.approx(last, rel=1e-12)


def test_slopes_at_an_upper_bound_look_back() -> None:
    """Broken by a difference beyond the bound, where a value does not change and the slope would be 0."""
    curve = problem(decay, (0.9, 1.6, 2.2))
    capped = (FreeParameter(2, 0.0, 0.5, False, -1.0, 0.2), SIZE, RATE)
    found = map_fit(joint(curve), capped, np.array([0.4, 0.0, 0.0]), 8, 1e-9)
    assert found.z[0] == pytest.approx(0.4)
    assert found.normal[0, 0] == pytest.approx(80 * 0.25 * (4.0 + 9.0 * 0.25), rel=1e-6)
    np.testing.assert_allclose(found.sensitivity[0][0, 0], -0.5, rtol=1e-9)
    np.testing.assert_allclose(found.sensitivity[1][0, 1], -1.5, rtol=1e-9)


def test_steps_are_limited_and_damped() -> None:
    """Broken by another damping, a step out of its box or not the best one in it, or by fewer trials than lanes."""
    normal, slope = np.diag([3.0, 0.0]), np.array([-400.0, 1.0])
    z = np.array([0.5, -0.25])
    wide = (np.full(2, -1e9), np.full(2, 1e9))
    trials = module._trial_steps(z, normal, slope, wide)
    gradient, hessian = slope + z, normal + np.eye(2)
    limits = [(d, 0.7) for d in (0.0, 1e-3, 1e-2, 0.1, 1.0, 30.0)] + [(0.0, 4.0), (0.0, 0.15)]
    assert len(trials) == len(limits) == 8
    for trial, (damping, longest) in zip(trials, limits, strict=True):
        step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), -gradient)
        np.testing.assert_allclose(trial - z, np.clip(step, -longest, longest), rtol=1e-12)  # nothing couples the two
    for slope in (np.array([-1.5, 0.4]), np.array([-9.0, 2.5])):  # short enough for all, and for the bold steps
        normal = np.array([[3.0, 0.8], [0.8, 1.2]])
        hessian = normal + np.eye(2)
        trials = module._trial_steps(z, normal, slope, wide)
        for trial, (damping, longest) in zip(trials, limits, strict=True):
            root = np.linalg.cholesky(hessian + damping * np.diag(np.diag(hessian)))
            best = lsq_linear(root.T, -np.linalg.solve(root, slope + z), (-longest, longest), tol=1e-14).x
            np.testing.assert_allclose(trial - z, best, rtol=1e-6, atol=1e-9)
    bounds = np.array([0.3, -0.3]), np.array([0.9, 0.1])
    for push, reached in ((50.0, bounds[0]), (-50.0, bounds[1])):
        trials = module._trial_steps(z, np.diag([3.0, 0.0]), np.full(2, push), bounds)
        np.testing.assert_allclose(trials[0], reached, rtol=1e-12)
        assert np.all((trials >= bounds[0] - 1e-12) & (trials <= bounds[1] + 1e-12))
    normal, hessian = np.diag([3.0, 0.0]), np.diag([4.0, 1.0])
    short = module._trial_steps(np.zeros(2), normal, np.array([0.1, 0.1]), wide)
    np.testing.assert_allclose(short[0], -np.linalg.solve(hessian, [0.1, 0.1]), rtol=1e-12)
    np.testing.assert_array_equal(module._trial_steps(np.zeros(2), normal, np.zeros(2), wide), 0.0)


def test_a_bounded_step_is_the_minimum_within_the_bounds() -> None:
    """Broken by a clipped step whose other coordinates do not follow; against a search on random problems."""
    rng = np.random.default_rng(9)
    for _ in range(40):
        root = rng.normal(size=(3, 3))
        hessian, gradient = root @ root.T + 0.3 * np.eye(3), 3.0 * rng.normal(size=3)
        low, high = -rng.uniform(0.05, 1.5, 3), rng.uniform(0.05, 1.5, 3)
        step = module.bounded_step(hessian, gradient, low, high)
        assert np.all((step >= low) & (step <= high))
        inside = (step > low) & (step < high)
        slope = hessian @ step + gradient
        np.testing.assert_allclose(slope[inside], 0.0, atol=1e-9)
    one = module.bounded_step(np.array([[2.0]]), np.array([8.0]), np.array([-1.0]), np.array([1.0]))
    np.testing.assert_array_equal(one, [-1.0])


def test_the_fit_stops_where_little_is_gained() -> None:
    """Broken by a limit of iterations or a tolerance that is not kept."""
    curve = problem(decay, (0.3, 1.6, 2.2))
    exact = map_fit(joint(curve), FREE, np.zeros(3), 40, 1e-12)
    short = map_fit(joint(curve), FREE, np.zeros(3), 3, 1e-12)
    assert short.iterations == 3
    assert exact.iterations > 3
    assert short.cost > exact.cost
    assert map_fit(joint(curve), FREE, np.zeros(3), 40, 1e9).iterations == 1
    near = map_fit(joint(curve), FREE, exact.z, 40, 0.0)  # a ten-thousandth of the cost is too little as well
    assert near.iterations == 1
    stated, usual = map_fit(joint(curve), FREE, np.zeros(3), 12, 0.02), map_fit(joint(curve), FREE, np.zeros(3))
    assert usual.iterations == stated.iterations < map_fit(joint(curve), FREE, np.zeros(3), 12, 0.0).iterations + 1
    np.testing.assert_array_equal(usual.z, stated.z)
    assert usual.cost < exact.cost + 0.05
    assert usual.iterations <= 12


def test_several_starts_leave_a_local_minimum() -> None:
    """Broken by starts that are not refined, or by a worse end that is returned."""

    def wave(values: Array, t: Array) -> Array:
        return np.asarray(np.sin(values[0] * t))

    frequency = (FreeParameter(2, 5.0, 1.0, False, 0.0, 20.0),)
    curve = problem(wave, (7.0,))
    starts = [np.array([z]) for z in (-4.0, -3.0, 1.7, 6.0)]
    alone = map_fit(joint(curve), frequency, starts[0], 25)
    assert alone.cost > 100.0
    found = multi_start(joint(curve), frequency, starts)
    best = least_squares(lambda z: curve.weighted(frequency, z), [2.0])
    assert found.cost == pytest.approx(2.0 * best.cost, rel=1e-3)
    assert found.z == pytest.approx(best.x, abs=0.01)
    again = multi_start(joint(curve), frequency, starts[::-1])
    assert again.cost == found.cost


def test_starts_are_tried_briefly_and_two_are_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Broken by other numbers of iterations, or by more or fewer starts that are fitted to the end."""
    curve, asked = problem(decay, (0.3, 1.6, 2.2)), []

    def noted(problem: JointProblem, free: Sequence[FreeParameter], start: Array, iterations: int) -> Any:
        asked.append((iterations, float(start[0])))
        return map_fit(problem, free, start, iterations)

    monkeypatch.setattr(module, "map_fit", noted)
    multi_start(joint(curve), FREE, [np.full(3, z) for z in (-3.0, 0.3, 3.0)])
    assert [iterations for iterations, _ in asked] == [4, 4, 4, 25, 25]


def test_what_a_fit_reports_of_its_parameters() -> None:
    """Broken by a resolution of another size, or one for what is no parameter; arrays are left out on request."""
    curve = problem(decay, (0.3, 1.6, 2.2))
    start_creep = FreeParameter(START_CREEP, 0.0, 0.1, False, 0.0, 1.0)
    curve.model = lambda values, t: decay(values[:3], t) + 0.1 * values[3] * t
    free = (*FREE, start_creep)
    found = map_fit(joint(curve), free, np.zeros(4), 20, 1e-9)
    columns = np.zeros(200)
    columns[1] = RATE.value(found.z[2:3])[0]
    resolutions = found.resolutions(columns)
    deviation = 1.0 / np.sqrt(np.diag(found.normal) + 1.0)
    assert resolutions == pytest.approx(
        {OFFSET.key: 0.5 * deviation[0], SIZE.key: 0.4 * deviation[1], RATE.key: columns[1] * 0.5 * deviation[2]},
        rel=1e-9,
    )
    bare = found.without_arrays()
    assert bare.residuals == bare.sensitivity == ()
    assert bare.cost == found.cost
    np.testing.assert_array_equal(bare.normal, found.normal)


def two_curves() -> list[Any]:
    """Decays of one rate and other offsets and sizes."""
    return [problem(decay, (0.3, 1.6, 2.2), seed=5), problem(decay, (-0.4, 0.7, 2.2), seed=6)]


def parts_of(curves: Sequence[Any]) -> list[SharedPart]:
    return [SharedPart(joint(curve), FREE[:2], np.zeros(2)) for curve in curves]


def test_a_shared_fit_is_that_of_scipy_to_all_data() -> None:
    """Broken by a wrong Schur complement, or a prior of the shared coordinate that counts once for each joint."""
    curves = two_curves()
    found = shared_fit(parts_of(curves), FREE[2:], np.zeros(1), 30, 1e-9)

    def stacked(z: Array) -> Array:
        own = (z[[0, 1, 4]], z[[2, 3, 4]])
        rows = [curve.weighted(FREE, each)[: -len(each)] for curve, each in zip(curves, own, strict=True)]
        return np.concatenate([*rows, z])

    expected = least_squares(stacked, np.zeros(5), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(np.r_[found.fits[0].z[:2], found.fits[1].z[:2], found.z], expected.x, atol=2e-3)
    assert found.cost == pytest.approx(2.0 * expected.cost, rel=1e-5)
    covariance = np.linalg.inv(expected.jac.T @ expected.jac)
    assert float(np.linalg.inv(found.precision())[0, 0]) == pytest.approx(covariance[4, 4], rel=0.02)
    halved = sum(0.5 * (1.0 / np.linalg.inv(fit.normal + np.diag([2.0, 2.0, 0.0]))[2, 2]) for fit in found.fits)
    assert float(found.precision([0.5, 0.5])[0, 0]) == pytest.approx(1.0 + halved, rel=1e-6)


def test_a_shared_fit_of_one_joint_is_its_fit() -> None:
    """Broken by other steps, bounds or an end than those of the fit of one joint."""
    curve = two_curves()[0]
    alone = map_fit(joint(curve), FREE, np.zeros(3), 30, 1e-9)
    found = shared_fit(parts_of([curve]), FREE[2:], np.zeros(1), 30, 1e-9)
    np.testing.assert_allclose(np.r_[found.fits[0].z[:2], found.z], alone.z, atol=1e-6)
    assert found.cost == pytest.approx(alone.cost, rel=1e-9)


def test_a_shared_coordinate_stays_within_its_bounds() -> None:
    """Broken by a bound that is not kept, or private coordinates that do not follow it."""
    bounded = FreeParameter(RATE.row, 1.0, 0.5, True, 0.01, 1.5)
    found = shared_fit(parts_of(two_curves()), [bounded], np.zeros(1), 30, 1e-9)
    assert float(bounded.value(found.z)[0]) == pytest.approx(1.5)
    for curve, fit in zip(two_curves(), found.fits, strict=True):
        alone = map_fit(joint(curve), (*FREE[:2], fixed(bounded, 1.5)), np.zeros(3), 30, 1e-9)
        np.testing.assert_allclose(fit.z[:2], alone.z[:2], atol=2e-3)


def test_a_shared_fit_stops_where_little_is_gained() -> None:
    """Broken by a limit of iterations or a tolerance that is not kept."""
    curves = two_curves()
    assert shared_fit(parts_of(curves), FREE[2:], np.zeros(1), 2, 1e-9).fits[0].iterations == 2
    assert shared_fit(parts_of(curves), FREE[2:], np.zeros(1), 30, 1e12).fits[0].iterations == 1
