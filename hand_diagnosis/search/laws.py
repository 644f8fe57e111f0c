"""The law of a class that leads: textbook form or learned one, what the data know of it, and the law in plain words.

A learned law starts from the fit of the textbook form and frees the coefficients of the class (hand_model/effects). The
prior of each coefficient is centred on the textbook form, so the form remains where it suffices. The cost has several
minima; the fit therefore begins at many points: the textbook form itself, each coefficient alone, all of them together,
with the textbook parameters smaller and with the nominal numbers released, where the search tries the effect, and
random ones. The cheapest of each kind are fitted in turn. Surplus coefficients are then removed.

The evidence is that of the training data alone, by Laplace's approximation. The validation data decide whether the
learned form is preferred. The effective number of coefficients is the trace of the share of information that the data
have in them (MacKay, Neural Computation 4(3), 1992).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from hand_diagnosis.problem import block_bootstrap, fitted_rmse, log_likelihood, shrunk, validation_rmse
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import (
    START_CREEP,
    FreeParameter,
    law_free_parameters,
    law_probe_values,
    probe_values,
)
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit
from hand_identification.posterior import covariance_of, posterior_of
from hand_model.arrays import Array
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedLaw:
    """The learned law of an effect, compared with its textbook form.

    freed: keys of the coefficients that are left.  evidence: log evidence of the learned law over that of the textbook
    form, training data alone.  coefficients: effective number of them.  stage: signal whose validation error changes
    most, as its place in STAGES.  fall: 95 % interval of the relative fall of its validation mean square.
    preferred: whether training and validation data together prefer the learned form, and the latter confirm it.
    """

    effect: Effect
    textbook: MapFit
    fit: MapFit
    freed: tuple[str, ...]
    evidence: float
    coefficients: float
    stage: int
    fall: tuple[float, float]
    preferred: bool

    @property
    def chosen(self) -> MapFit:
        """The fit of the preferred form."""
        return self.fit if self.preferred else self.textbook


def learn_law(
    problem: JointProblem, textbook: MapFit, effect: Effect, rng: np.random.Generator, begun: Sequence[MapFit] = ()
) -> LearnedLaw:
    """Free the law of an effect that is part of a fitted model, on the training data.

    textbook: the fit of the model with the effect in its textbook form.  begun: coarse fits to continue
    (`begin_law`); without them the fit starts at more points. Raises ValueError for an effect without a learned law.
    """
    begun = begun or begin_law(problem, textbook, effect, rng, SETTINGS.law_fits[1])
    rows = {p.row for p in _added(problem, textbook, effect)}
    starts = [(fit.free, fit.z) for fit in begun[: SETTINGS.law_fits[2]]]
    ended = [map_fit(problem, *start, SETTINGS.law_iterations[1]).without_slopes() for start in starts]
    fit = thinned(problem, min(ended, key=lambda fit: fit.cost), rows)
    return _compared(problem, textbook, fit, effect, rows)


def begin_law(
    problem: JointProblem, textbook: MapFit, effect: Effect, rng: np.random.Generator, fits: int = SETTINGS.law_fits[0]
) -> list[MapFit]:
    """Short fits of the law from the textbook form and from `fits` other starts, the best one first.

    Raises ValueError for an effect without a learned law.
    """
    if not effect.coefficients:
        raise ValueError(f"the effect {effect.name} has no learned law")
    added = _added(problem, textbook, effect)
    free = [*textbook.free, *added]
    form, *others = distinct(_starts(problem, textbook, effect, added, rng))
    ranked = [_by_cost(problem, free, group) for group in others]
    rough = [
        map_fit(problem, free, start, SETTINGS.law_iterations[0], SETTINGS.law_coarse_tolerance).without_arrays()
        for start in (*form, *in_turn(ranked, fits))
    ]
    return sorted(rough, key=lambda fit: fit.cost)


def with_nominal_numbers_of(problem: JointProblem, fit: MapFit, other: MapFit) -> MapFit:
    """A short fit from a fit's own effects and the nominal numbers of another fit, or the fit itself if it is better.

    A large effect shifts the nominal numbers; a fit that compensated for it in another way may not find back.
    """
    theirs = {p.row: float(z) for p, z, plain in zip(other.free, other.z, _nominal(other), strict=True) if plain}
    own = _nominal(fit)
    start = np.array(
        [theirs.get(p.row, z) if own[k] else z for k, (p, z) in enumerate(zip(fit.free, fit.z, strict=True))]
    )
    again = map_fit(
        problem, fit.free, start, SETTINGS.law_iterations[0], SETTINGS.law_coarse_tolerance
    ).without_arrays()
    return again if again.cost < fit.cost else fit


def _added(problem: JointProblem, textbook: MapFit, effect: Effect) -> list[FreeParameter]:
    """The coefficients of an effect's law that a fit has not set free."""
    have = {parameter.row for parameter in textbook.free}
    return [p for p in law_free_parameters(effect, problem.nominal) if p.row not in have]


def training_evidence(problem: JointProblem, fit: MapFit) -> float:
    """Log evidence [nats] of a fit by Laplace's approximation, training data alone; -inf as `log_evidence`."""
    train = ~problem.validation
    _, logdet = posterior_of(np.eye(len(fit.z)) + shrunk(problem, fit) * fit.normal)
    return log_likelihood(problem, fit.squares, train) - 0.5 * float(fit.z @ fit.z) - 0.5 * float(logdet)


def posterior_covariance(problem: JointProblem, fit: MapFit) -> Array:
    """Covariance of the coordinates (free, free) [-]; where the error is above the floor, its scale is the error's."""
    return covariance_of(fit.normal, shrunk(problem, fit))


def posterior_draws(problem: JointProblem, fit: MapFit) -> Array:
    """Coordinates (draws, free) [-] as the data leave them open, also where they leave some to the prior.

    By eigenvalues: rounding can make a covariance that is nearly singular indefinite.
    """
    rng = np.random.default_rng(SETTINGS.noise_seed)
    covariance = posterior_covariance(problem, fit)
    return rng.multivariate_normal(fit.z, covariance, SETTINGS.law_draws, method="eigh")


def distinct(groups: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """The groups without the points (free,) [-] that an earlier one equals: at a bound many do.

    groups, returns: lists of points (free,) [-], which may be empty.
    """
    seen: set[bytes] = set()
    found = []
    for group in groups:
        new = {(start + 0.0).tobytes(): start for start in group}  # the sum has no negative zeros
        found.append([start for key, start in new.items() if key not in seen])
        seen |= new.keys()
    return found


def _by_cost(problem: JointProblem, free: Sequence[FreeParameter], starts: Sequence[Array]) -> list[Array]:
    """Points (free,), the cheapest first."""
    costs = costs_at(problem, free, np.array(starts)) if starts else np.zeros(0)
    return [starts[k] for k in np.argsort(costs, kind="stable")]


def in_turn(groups: Sequence[Sequence[Array]], count: int) -> list[Array]:
    """The first `count` [-] points (free,) [-] where groups take turns: the cheapest ones of all lie in one valley.

    groups: lists of points (free,) [-]. Fewer where the groups hold fewer.
    """
    return [start for row in zip_longest(*groups) for start in row if start is not None][:count]


def _starts(
    problem: JointProblem,
    textbook: MapFit,
    effect: Effect,
    added: Sequence[FreeParameter],
    rng: np.random.Generator,
) -> tuple[list[Array], ...]:
    """Points to start from (free,): the textbook form, ones next to it, ones at the probes, and random ones."""
    low = np.array([p.coordinate(p.low) for p in added])
    high = np.array([p.coordinate(p.high) for p in added])

    def at(coefficients: Array, base: Array) -> Array:
        return np.concatenate([base, np.clip(coefficients, low, high)])

    def bases(probe: Mapping[int, float]) -> list[Array]:
        there = np.array([p.coordinate(probe.get(p.row, 0.0)) for p in textbook.free])
        return [np.where(own, there, base) for base in (here, released)]

    count, here = len(added), textbook.z
    smaller, own = _scaled(textbook, effect, SETTINGS.law_smaller_start), _own(textbook, effect)
    released = np.where(_nominal(textbook), 0.0, here)
    sizes = (SETTINGS.law_start_of_all, -SETTINGS.law_start_of_all)
    near = [at(np.full(count, size), base) for base in (here, smaller) for size in sizes]
    near += [at(np.full(count, size), released) for size in (0.0, SETTINGS.law_start_of_all)]
    ones = SETTINGS.law_start_of_one * np.eye(count)
    near += [at(sign * single, base) for base in (here, smaller) for single in ones for sign in (1.0, -1.0)]
    probed = []
    for probe in probe_values(effect, problem.nominal):
        probed += [at(np.full(count, size), base) for size in (0.0, SETTINGS.law_start_of_one) for base in bases(probe)]
    for probe in law_probe_values(effect, problem.nominal):
        single = np.array([p.coordinate(probe[p.row]) if p.row in probe else 0.0 for p in added])
        probed += [at(single, base) for base in bases(probe)]
    drawn, spread = [], SETTINGS.law_random_spread
    for k in range(SETTINGS.law_random_starts):
        base = here + spread * np.where(own, rng.standard_normal(len(here)), 0.0) if k % 2 else here
        drawn.append(at(spread * rng.standard_normal(count), base))
    return [at(np.zeros(count), here)], near, probed, drawn


def _own(fit: MapFit, effect: Effect) -> Array:
    """Which free parameters (free,) of a fit are parameters of an effect."""
    rows = {ROW[key] for key in effect.keys}
    return np.array([p.row in rows for p in fit.free])


def _scaled(fit: MapFit, effect: Effect, share: float) -> Array:
    """Coordinates of a fit with the sizes of an effect reduced to a share; its shapes and all else as they are."""
    own = {ROW[key] for key in effect.keys if key not in effect.shape}
    reduced = [
        z * share if p.row in own and p.row >= len(PLANT_PARAMETERS) and not p.log else z
        for p, z in zip(fit.free, fit.z, strict=True)
    ]
    return np.array(reduced)


def _nominal(fit: MapFit) -> Array:
    """Which free parameters (free,) are numbers of the plain plant."""
    return np.array([(p.row < len(PLANT_PARAMETERS) and not p.log) or p.row >= START_CREEP for p in fit.free])


def thinned(problem: JointProblem, fit: MapFit, rows: set[int]) -> MapFit:
    """The fit without the coefficients (rows) that the training data do not need, by their evidence.

    A scale, such as a period, stays: its expected value is no absence.
    """
    for _ in range(2):
        deviation = np.sqrt(np.diag(posterior_covariance(problem, fit)))
        surplus = [
            p.row in rows and not p.log and abs(z) < SETTINGS.law_surplus_errors * sigma
            for p, z, sigma in zip(fit.free, fit.z, deviation, strict=True)
        ]
        if not any(surplus):
            return fit
        kept = ~np.array(surplus)
        free = [p for p, keep in zip(fit.free, kept, strict=True) if keep]
        less = map_fit(problem, free, fit.z[kept], SETTINGS.law_iterations[1]).without_slopes()
        if training_evidence(problem, less) < training_evidence(problem, fit):
            return fit
        fit = less
    return fit


def _compared(problem: JointProblem, textbook: MapFit, fit: MapFit, effect: Effect, rows: set[int]) -> LearnedLaw:
    covariance = posterior_covariance(problem, fit)
    own = [k for k, p in enumerate(fit.free) if p.row in rows]
    evidence = training_evidence(problem, fit) - training_evidence(problem, textbook)
    before, after = (validation_rmse(problem, either.squares) for either in (textbook, fit))
    with np.errstate(invalid="ignore"):
        stage = int(np.argmax(np.nan_to_num(np.abs(before - after) / problem.floor)))
    rng = np.random.default_rng(SETTINGS.noise_seed)
    fall = block_bootstrap(problem, textbook.squares, fit.squares, stage, rng)
    better = fall[0] > 0.0 and after[stage] < (1.0 - SETTINGS.min_relative_improvement) * before[stage]
    # Where the validation data confirm the law, what they gain counts next to the evidence of the training data.
    confirmed = better and evidence + _validation_gain(problem, textbook, fit) > 0.0
    strong = evidence > SETTINGS.strong_log_evidence and fall[1] >= 0.0 and _falls(problem, textbook, fit)
    return LearnedLaw(
        effect=effect,
        textbook=textbook,
        fit=fit,
        freed=tuple(fit.free[k].key for k in own),
        evidence=evidence,
        coefficients=float(sum(1.0 - covariance[k, k] for k in own)),
        stage=stage,
        fall=fall,
        preferred=bool(own and (confirmed or strong)),
    )


def _validation_gain(problem: JointProblem, before: MapFit, after: MapFit) -> float:
    """By how much the log likelihood of the validation data rises."""
    old, new = (log_likelihood(problem, fit.squares, problem.validation) for fit in (before, after))
    return new - old


def _falls(problem: JointProblem, textbook: MapFit, fit: MapFit) -> bool:
    """Whether the error of a signal falls by more than may be claimed where validation data cannot show it as well."""
    before, after = (np.nan_to_num(fitted_rmse(problem, either.squares)) for either in (textbook, fit))
    return bool(np.any(before**2 - after**2 > problem.claimable**2))


# The law as a curve and in words.
