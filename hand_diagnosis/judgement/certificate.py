"""Certificates: whether free-form models still predict what the named effects leave of a signal.

Two regressions without physics attack the remainder of a joint that is explained. A Gaussian process over a few states
finds any smooth dependence on them (Rasmussen and Williams 2006, Ch. 2; inducing points: Quinonero-Candela and
Rasmussen 2005, subset of regressors). A ridge regression on lagged inputs finds memory: low-passed inputs, plays and
products of inputs, a NARX model in simulation form (Billings 2013), so that it never sees a measured output. Training
data fit both. Whole validation blocks choose states, lengths and regularisation, because the samples of a block are
correlated and no likelihood of independent samples holds. Test data decide.

No input holds the noise of the signal that is predicted: own signals are those of the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.signal import lfilter

from hand_diagnosis.judgement.stage_errors import StageResult
from hand_diagnosis.problem import predict_test
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.effects.effect import NEIGHBOUR, SPEED
from hand_model.quantities import Wording

GAUSSIAN_PROCESS, LAGGED_INPUTS = "gaussian_process", "lagged_inputs"
States = dict[str, Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """The strongest attack on a signal of a joint: its model, the states it is over, test errors before, after [SI].

    sure: whether validation and test error fall in nearly all draws of their blocks.  floor: repeatability [SI];
    smaller differences are not attributed to any cause.
    """

    joint: str
    stage: int
    model: str
    over: tuple[str, ...]
    before: float
    after: float
    sure: bool
    floor: float

    @property
    def share(self) -> float:
        """Part of the test error that the attack takes away; below 0 where it adds to it."""
        return 1.0 - self.after / self.before if self.before > 0.0 else 0.0

    @property
    def broken(self) -> bool:
        """Whether the attack succeeds, so that something of practical size is not explained."""
        taken = float(np.sqrt(max(self.before**2 - self.after**2, 0.0)))
        return self.sure and self.share > SETTINGS.certificate_share and taken > self.floor

    def document(self, wording: Wording) -> dict[str, Any]:
        """The entry in report.json."""
        factor, unit = wording.signal_units[self.stage]
        return {
            "joint": self.joint,
            "signal": wording.signals[self.stage],
            "unit": unit,
            "model": self.model,
            "over": [wording.state(name) for name in self.over],
            "rmse_before": factor * self.before,
            "rmse_after": factor * self.after,
            "share": self.share,
            "holds": not self.broken,
        }

    def statement(self, wording: Wording) -> str:
        """The sentence about an attack that succeeds."""
        factor, unit = wording.signal_units[self.stage]
        words = " and ".join(wording.state(name) for name in self.over)
        return (
            f"{self.joint}: a model without physics ({' '.join(self.model.split('_'))}) over {words} reduces the test"
            f" error of the {wording.signals[self.stage]} by {self.share:.0%}, from {factor * self.before:.3g} to"
            f" {factor * self.after:.3g} {unit}: the findings explain a part"
        )


@dataclass(frozen=True, slots=True)
class Samples:
    """What an attack learns from: residual (n,) [SI], block (n,) of each sample, states (n,) and features (n, k)."""

    residual: Array
    block: NDArray[np.int64]
    states: States
    features: Array

    def taken(self, chosen: NDArray[Any]) -> Samples:
        """A part of the samples: indices or flags (n,)."""
        states = {name: values[chosen] for name, values in self.states.items()}
        return Samples(self.residual[chosen], self.block[chosen], states, self.features[chosen])


@dataclass(frozen=True, slots=True)
class Attack:
    """A fitted regression: predicted residuals (n,) [SI] of the validation and the test data. over: names of states."""

    model: str
    over: tuple[str, ...]
    validation: Array
    test: Array


def certify(
    problem: JointProblem, whole: JointProblem, fit: MapFit, results: Sequence[StageResult], *, free_axis: bool
) -> tuple[Certificate, ...]:
    """The strongest attack on each signal of a joint; empty where there are no test data.

    problem: without the test data.  whole: with them.  fit: of the final model.  free_axis: see splits.evaluate_test.
    """
    tested = predict_test(whole, fit, free_axis=free_axis)
    columns, starts = problem.columns(fit.free, fit.z[None])
    fitted = [(s, p[0]) for s, p in zip(problem.segments, problem.predict(columns, starts), strict=True)]
    found = []
    for result in results:
        stage = result.stage
        known, test = (_samples(parts, stage) for parts in (fitted, tested))
        if known is None or test is None or len(np.unique(test.block)) < SETTINGS.min_test_blocks:
            continue
        held = problem.validation[known.block]
        training, validation = (_thinned(known.taken(np.flatnonzero(held == kind))) for kind in (False, True))
        if min(len(training.residual), len(validation.residual)) < SETTINGS.certificate_least_samples:
            continue
        attacks = [_lagged_inputs(training, validation, test), *_gaussian_process(training, validation, test)]
        judged = [_judged(problem, stage, attack, validation, test) for attack in attacks]
        found.append(max(judged, key=lambda each: (each.broken, each.share)))
    return tuple(found)


def _judged(problem: JointProblem, stage: int, attack: Attack, validation: Samples, test: Samples) -> Certificate:
    """What an attack takes away from the test error. An attack that validation data do not confirm is not sure."""
    before, after = (float(np.sqrt(np.mean(r**2))) for r in (test.residual, test.residual - attack.test))
    sure = all(_falls(data, said) for data, said in ((validation, attack.validation), (test, attack.test)))
    return Certificate(
        joint=problem.joint,
        stage=stage,
        model=attack.model,
        over=attack.over,
        before=before,
        after=after,
        sure=sure,
        floor=float(problem.floor[stage]),
    )


def _falls(data: Samples, predicted: Array) -> bool:
    """Whether the squared error falls in nearly all draws of the blocks."""
    _, block = np.unique(data.block, return_inverse=True)
    fall = np.bincount(block, data.residual**2 - (data.residual - predicted) ** 2)
    rng = np.random.default_rng(SETTINGS.noise_seed)
    drawn = fall[rng.integers(len(fall), size=(SETTINGS.bootstrap_draws, len(fall)))].sum(axis=1)
    return bool(np.quantile(drawn, SETTINGS.bootstrap_tail) > 0.0)


# Samples, states and features.


def _samples(parts: Sequence[tuple[Segment, Array]], stage: int) -> Samples | None:
    """The samples that count of a signal; None where there are none. parts: segments and predictions (OUTPUTS, T)."""
    each = []
    for segment, predicted in parts:
        use = segment.use[stage]
        if use.any():
            states = _states(segment, predicted, stage)
            own = Samples(
                segment.measured[stage] - predicted[stage], segment.block, states, _features(states, segment.period_s)
            )
            each.append(own.taken(np.flatnonzero(use)))
    if not each:
        return None
    states = {name: np.concatenate([part.states[name] for part in each]) for name in each[0].states}
    features = np.concatenate([part.features for part in each])
    return Samples(
        np.concatenate([p.residual for p in each]), np.concatenate([p.block for p in each]), states, features
    )


def _states(segment: Segment, predicted: Array, stage: int) -> States:
    """The states (T,) over which an attack may go; of the signal that is attacked, the model's.

    Pressure [Pa], angle [rad], time [s]; the set-point by its distance from the pressure, and the speed, both as the
    inverse hyperbolic sine of a ratio [-].
    """
    finer = (len(segment.driving_pa) - 1) // (len(segment.angle_rad) - 1)
    own = STAGES[stage]
    pressure = predicted[0] if own == "pressure" else segment.driving_pa[::finer]
    angle = predicted[1] if own == "angle" else segment.angle_rad
    speed = np.gradient(angle, segment.period_s) if own == "angle" else segment.exogenous[:, SPEED]
    # What changes with a direction of flow or motion needs resolution around zero.
    ahead = np.arcsinh((segment.set_point_pa - pressure) / SETTINGS.certificate_ahead_pa)
    return {
        "set-point": np.asarray(ahead, dtype=np.float64),
        "pressure": pressure,
        "angle": angle,
        "speed": np.asarray(np.arcsinh(speed / SETTINGS.moving_rad_s), dtype=np.float64),
        "neighbour": segment.exogenous[:, NEIGHBOUR],
        "time": segment.period_s * np.arange(len(angle), dtype=np.float64),
    }


def _features(states: States, period_s: float) -> Array:
    """Inputs with memory (T, k): each state but time, low-passed and through plays of several widths."""
    columns: list[Array] = []
    for name, values in states.items():
        columns.append(values)
        if name == "time":
            continue
        for tau in SETTINGS.certificate_lags_s:
            share = 1.0 - float(np.exp(-period_s / tau))
            columns.append(lfilter([share], [1.0, share - 1.0], values, zi=[(1.0 - share) * values[0]])[0])
        width = float(np.ptp(values))
        columns += [_play(values, share * width) for share in SETTINGS.certificate_plays]
    return np.column_stack(columns)


@njit(cache=True)
def _play(values, half):  # type: ignore[no-untyped-def]
    out = np.empty(len(values))
    at = values[0]
    for k in range(len(values)):
        at = min(max(at, values[k] - half), values[k] + half)
        out[k] = at
    return out


def _thinned(samples: Samples) -> Samples:
    """At most SETTINGS.certificate_samples of them, evenly over the recording."""
    count = len(samples.residual)
    if count <= SETTINGS.certificate_samples:
        return samples
    return samples.taken(np.linspace(0, count - 1, SETTINGS.certificate_samples).astype(int))


def _scaled(training: Array, *others: Array) -> list[Array]:
    """Columns with mean 0 and deviation 1 on the training data (n, k); constant columns become 0."""
    mean, deviation = training.mean(axis=0), training.std(axis=0)
    large = deviation > SETTINGS.certificate_least_deviation * np.maximum(np.abs(mean), 1e-300)
    factor = np.where(large, 1.0 / np.where(large, deviation, 1.0), 0.0)
    return [np.clip((x - mean) * factor, *SETTINGS.certificate_range) for x in (training, *others)]


# The two attacks.


def _lagged_inputs(training: Samples, validation: Samples, test: Samples) -> Attack:
    """A ridge regression on the features, the states themselves and their products."""
    raw = [np.column_stack(list(s.states.values())) for s in (training, validation, test)]
    scaled = _scaled(*raw)
    pairs = list(combinations_with_replacement(range(raw[0].shape[1]), 2))
    products = [np.column_stack([x[:, i] * x[:, j] for i, j in pairs]) for x in scaled]
    tables = [np.column_stack([s.features, p]) for s, p in zip((training, validation, test), products, strict=True)]
    bases = [np.column_stack([np.ones(len(x)), x]) for x in _scaled(*tables)]
    _, said = min(_ridge(bases, training, validation), key=lambda pair: pair[0])
    names = tuple(name for name, values in training.states.items() if np.ptp(values) > 0.0)
    return Attack(LAGGED_INPUTS, names, *said)


def _gaussian_process(training: Samples, validation: Samples, test: Samples) -> Iterator[Attack]:
    """The posterior mean over the states and with the length that validation data prefer; nothing without a state."""
    rng = np.random.default_rng(SETTINGS.noise_seed)
    count = min(SETTINGS.certificate_inducing, len(training.residual))
    inducing = rng.choice(len(training.residual), count, replace=False)
    best: tuple[float, tuple[str, ...], float] | None = None
    tables = (training, validation, test)

    def bases(over: tuple[str, ...], length: float, parts: Sequence[Samples]) -> list[Array]:
        raw = [np.column_stack([part.states[name] for name in over]) for part in parts]
        scaled = _scaled(*raw)
        points = scaled[0][inducing]
        square = _kernel(points, points, length)
        factor = cholesky(square + SETTINGS.certificate_jitter * np.eye(len(points)), lower=True)
        return [solve_triangular(factor, _kernel(points, x, length), lower=True).T for x in scaled]

    for over in _sets(training):
        for length in SETTINGS.certificate_lengths:
            error, _ = min(_ridge(bases(over, length, tables[:2]), training, validation), key=lambda pair: pair[0])
            if best is None or error < best[0]:
                best = error, over, length
    if best is not None:
        _, over, length = best
        _, said = min(_ridge(bases(over, length, tables), training, validation), key=lambda pair: pair[0])
        yield Attack(GAUSSIAN_PROCESS, over, *said)


def _sets(training: Samples) -> Iterator[tuple[str, ...]]:
    """Sets of states: each one alone, those of a static map, those of motion, and all of them together."""
    varies = [name for name, values in training.states.items() if np.ptp(values) > 0.0]
    for name in varies:
        yield (name,)
    for several in (("pressure", "angle"), ("angle", "speed"), ("set-point", "pressure")):
        if set(several) <= set(varies):
            yield several
    together = tuple(name for name in varies if name not in {"time", "neighbour"})
    if len(together) > 2:
        yield together


def _kernel(points: Array, x: Array, length: float) -> Array:
    """Squared exponential (m, n) of points (m, k) and x (n, k), of unit variance."""
    square = (points**2).sum(axis=1)[:, None] + (x**2).sum(axis=1)[None] - 2.0 * points @ x.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0) / length**2), dtype=np.float64)


def _ridge(bases: Sequence[Array], training: Samples, validation: Samples) -> Iterator[tuple[float, list[Array]]]:
    """For each regularisation, the validation mean square and the predictions of all but the training data.

    bases: (n, k) of training, validation and further data. With a Gaussian process's basis this is its posterior mean.
    """
    basis = bases[0]
    values, vectors = np.linalg.eigh(basis.T @ basis / len(basis))
    target = vectors.T @ (basis.T @ training.residual / len(basis))
    for noise in SETTINGS.certificate_ridges:
        weights = vectors @ (target / (np.maximum(values, 0.0) + noise))
        said = [x @ weights for x in bases[1:]]
        yield float(np.mean((validation.residual - said[0]) ** 2)), said
