"""The law of a class that leads: textbook form or learned one, what the data know of it, and the law in plain words.

A learned law starts from the fit of the textbook form and frees the coefficients of the class (hand_model/effects). The
prior of each coefficient is centred on the textbook form, so the form remains where it suffices. The cost has several
minima; the fit therefore begins at many points: the textbook form itself, each coefficient alone, all of them together,
with the textbook parameters smaller and with the nominal numbers released. Surplus coefficients are then removed.

The evidence is that of the training data alone, by Laplace's approximation. The validation data decide whether the
learned form is preferred. The effective number of coefficients is the trace of the share of information that the data
have in them (MacKay, Neural Computation 4(3), 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hand_diagnosis.evidence import block_bootstrap, fitted_rmse, log_likelihood, validation_rmse
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import START_CREEP, FreeParameter, law_free_parameters, probe_values
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit
from hand_model.arrays import Array
from hand_model.effects.constitution import STATES
from hand_model.effects.effect import INFLOW, SPEED, Effect
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW, effect_rows
from hand_model.quantities import HAND, Wording, amount
from hand_recording.signals import white_noise


@dataclass(frozen=True, slots=True)
class LearnedLaw:
    """The learned law of an effect, compared with its textbook form.

    freed: keys of the coefficients that are left.  evidence: log evidence of the learned law over that of the textbook
    form, training data alone.  coefficients: effective number of them.  stage: signal whose validation error changes
    most, as its place in STAGES.  fall: 95 % interval of the relative fall of its validation mean square.
    preferred: whether evidence and validation data both prefer the learned form.
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
    ended = [map_fit(problem, fit.free, fit.z, SETTINGS.law_iterations[1]) for fit in begun[: SETTINGS.law_fits[2]]]
    fit = _thinned(problem, min(ended, key=lambda fit: fit.cost), rows)
    return _compared(problem, textbook, fit, effect, rows)


def begin_law(
    problem: JointProblem, textbook: MapFit, effect: Effect, rng: np.random.Generator, fits: int = SETTINGS.law_fits[0]
) -> list[MapFit]:
    """Short fits of the law from the textbook form and from the `fits` cheapest other starts, the best one first."""
    if not effect.coefficients:
        raise ValueError(f"the effect {effect.name} has no learned law")
    added = _added(problem, textbook, effect)
    free = [*textbook.free, *added]
    starts = _starts(problem, textbook, effect, added, rng)
    costs = costs_at(problem, free, np.array(starts))
    cheapest = sorted(range(1, len(starts)), key=lambda k: float(costs[k]))[:fits]
    rough = [
        map_fit(problem, free, starts[k], SETTINGS.law_iterations[0], 0.5).without_arrays() for k in (0, *cheapest)
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
    again = map_fit(problem, fit.free, start, SETTINGS.law_iterations[0], 0.5).without_arrays()
    return again if again.cost < fit.cost else fit


def _added(problem: JointProblem, textbook: MapFit, effect: Effect) -> list[FreeParameter]:
    """The coefficients of an effect's law that a fit has not set free."""
    have = {parameter.row for parameter in textbook.free}
    return [p for p in law_free_parameters(effect, problem.nominal) if p.row not in have]


def training_evidence(problem: JointProblem, fit: MapFit) -> float:
    """Log evidence of a fit by Laplace's approximation, training data alone."""
    train = ~problem.held_out
    _, logdet = np.linalg.slogdet(np.eye(len(fit.z)) + _shrink(problem, fit) * fit.normal)
    return log_likelihood(problem, fit.squares, train) - 0.5 * float(fit.z @ fit.z) - 0.5 * float(logdet)


def white_part(problem: JointProblem, fit: MapFit, stage: int) -> float:
    """The white part of the residual of a signal [SI]; 0 where there is none."""
    read = [r[stage][s.use[stage]] for s, r in zip(problem.segments, fit.residuals, strict=True)]
    return max((white_noise(r) for r in read if len(r) > SETTINGS.min_stage_samples), default=0.0)


def weighted_by_noise(problem: JointProblem, fit: MapFit) -> JointProblem:
    """The problem with the weights of the white noise that a fit leaves, up to SETTINGS.refit_weight times its own."""
    weight = SETTINGS.refit_weight * problem.weight
    for stage in range(len(weight)):
        noise = white_part(problem, fit, stage)
        if noise > 0.0:
            weight[stage] = max(min(weight[stage], 1.0 / noise**2), problem.weight[stage])
    return replace(problem, weight=weight)


def posterior_covariance(problem: JointProblem, fit: MapFit) -> Array:
    """Covariance of the coordinates (free, free); where the error is above the floor, its scale is the error's."""
    precision = np.eye(len(fit.z)) + _shrink(problem, fit) * fit.normal
    return np.asarray(np.linalg.inv(precision), dtype=np.float64)


def _shrink(problem: JointProblem, fit: MapFit) -> float:
    """Ratio of the floor's variance to that of the error."""
    train = ~problem.held_out
    counts = np.maximum(problem.effective_counts(train), 1.0)
    chi2 = (problem.block_weights * fit.squares)[:, train].sum(axis=1)
    return float(counts.sum() / (counts.sum() + chi2.sum()))


def _starts(
    problem: JointProblem,
    textbook: MapFit,
    effect: Effect,
    added: Sequence[FreeParameter],
    rng: np.random.Generator,
) -> list[Array]:
    """Points to start from (free,), the textbook form first."""
    low = np.array([p.coordinate(p.low) for p in added])
    high = np.array([p.coordinate(p.high) for p in added])

    def at(coefficients: Array, base: Array) -> Array:
        return np.concatenate([base, np.clip(coefficients, low, high)])

    count, here = len(added), textbook.z
    smaller, own = _scaled(textbook, effect, 0.3), _own(textbook, effect)
    released = np.where(_nominal(textbook), 0.0, here)
    starts = [at(np.zeros(count), here)]
    for base in (here, smaller):
        starts += [
            at(sign * SETTINGS.law_start_of_one * np.eye(count)[k], base) for k in range(count) for sign in (1.0, -1.0)
        ]
        starts += [at(np.full(count, size), base) for size in (SETTINGS.law_start_of_all, -SETTINGS.law_start_of_all)]
    starts += [at(np.full(count, size), released) for size in (0.0, SETTINGS.law_start_of_all)]
    for probe in probe_values(effect, problem.nominal):
        there = np.array([p.coordinate(probe.get(p.row, 0.0)) for p in textbook.free])
        bases = [np.where(own, there, base) for base in (here, released)]
        starts += [at(np.full(count, size), base) for size in (0.0, SETTINGS.law_start_of_one) for base in bases]
    for k in range(SETTINGS.law_random_starts):
        base = here + 0.7 * np.where(own, rng.standard_normal(len(here)), 0.0) if k % 2 else here
        starts.append(at(0.7 * rng.standard_normal(count), base))
    return starts


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


def _thinned(problem: JointProblem, fit: MapFit, rows: set[int]) -> MapFit:
    """The fit without the coefficients (rows) that the training data do not need, by their evidence."""
    for _ in range(2):
        deviation = np.sqrt(np.diag(posterior_covariance(problem, fit)))
        surplus = [
            p.row in rows and abs(z) < SETTINGS.law_surplus_errors * sigma
            for p, z, sigma in zip(fit.free, fit.z, deviation, strict=True)
        ]
        if not any(surplus):
            return fit
        kept = ~np.array(surplus)
        free = [p for p, keep in zip(fit.free, kept, strict=True) if keep]
        less = map_fit(problem, free, fit.z[kept], SETTINGS.law_iterations[1])
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
    better = better or (evidence > SETTINGS.strong_log_evidence and fall[1] >= 0.0 and _falls(problem, textbook, fit))
    return LearnedLaw(
        effect,
        textbook,
        fit,
        tuple(fit.free[k].key for k in own),
        evidence,
        float(sum(1.0 - covariance[k, k] for k in own)),
        stage,
        fall,
        bool(own and better and evidence > 0.0),
    )


def _falls(problem: JointProblem, textbook: MapFit, fit: MapFit) -> bool:
    """Whether the error of a signal falls by more than may be claimed where validation data cannot show it as well."""
    before, after = (np.nan_to_num(fitted_rmse(problem, either.squares)) for either in (textbook, fit))
    return bool(np.any(before**2 - after**2 > problem.claimable**2))


# The law as a curve and in words.


@dataclass(frozen=True, slots=True)
class LawCurve:
    """A law over its states, in the units of the machine.

    form: "textbook" or "learned".  over: names of the states.  unit, over_unit: of the law and of its first state.
    points: (settings.law_points, 5) state, law, lower and upper end of its band, textbook form fitted to the same data.
    statement: the law in a sentence.
    """

    form: str
    over: tuple[str, ...]
    quantity: str
    unit: str
    over_unit: str
    points: Array
    statement: str

    def document(self) -> dict[str, Any]:
        """The entry `law` of a finding in report.json."""
        return {
            "form": self.form,
            "over": list(self.over),
            "quantity": self.quantity,
            "unit": self.unit,
            "over_unit": self.over_unit,
            "columns": ["state", "law", "low", "high", "textbook"],
            "points": [[float(f"{value:.4g}") for value in row] for row in self.points],
            "statement": self.statement,
        }


def describe(
    problem: JointProblem, effect: Effect, chosen: MapFit, textbook: MapFit | None = None, wording: Wording = HAND
) -> LawCurve:
    """The law of an effect over the states that occurred, with its band, and in words.

    chosen: the fit with the law.  textbook: the fit of the textbook form to the same data; None where `chosen` has this
    form. Raises ValueError for an effect without a learned law.
    """
    known = effect.constitution
    if known is None or known.curve is None:
        raise ValueError(f"the effect {effect.name} has no learned law")
    first = _grid(problem, known.over[0], effect, chosen)
    second = _grid(problem, known.over[1], effect, chosen)[[0, -1]] if len(known.over) > 1 else np.zeros(2)
    here = _curves(problem, effect, chosen, chosen.z[None], first, second)[0]
    draws = np.random.default_rng(SETTINGS.noise_seed).multivariate_normal(
        chosen.z, posterior_covariance(problem, chosen), SETTINGS.law_draws, method="cholesky"
    )
    ends = np.quantile(_curves(problem, effect, chosen, draws, first, second)[:, 0], SETTINGS.law_band, axis=0)
    low, high = np.minimum(ends[0], here[0]), np.maximum(ends[1], here[0])  # a coefficient may stand at its bound
    plain = here[0] if textbook is None else _curves(problem, effect, textbook, textbook.z[None], first, second)[0, 0]
    unit, over_unit = (wording.units.quantity(f"law.x_{ending}") for ending in (known.unit, STATES[known.over[0]]))
    points = np.column_stack([first * over_unit.factor, *(y * unit.factor for y in (here[0], low, high, plain))])
    quantity, over = wording.sentence(known.quantity, ()), tuple(wording.state(name) for name in known.over)
    sentence = in_words(quantity, over, points[:, 0], here * unit.factor, unit.unit, over_unit.unit)
    form = "textbook" if textbook is None else "learned"
    return LawCurve(form, over, quantity, unit.unit, over_unit.unit, points, sentence)


def _curves(problem: JointProblem, effect: Effect, fit: MapFit, z: Array, first: Array, second: Array) -> Array:
    """Values (k, len(second), len(first)) of the law [SI] at coordinates z (k, free) and at both states."""
    curve = _curve_of(effect)
    columns, _ = problem.columns(fit.free, z)
    out = np.empty((len(z), len(second), len(first)))
    for k, column in enumerate(columns):
        q = tuple(float(value) for value in column[list(effect_rows(effect, prepared=False))])
        if effect.prepared:
            q = (*q, *effect.hooks["prepare"](q, problem.segments[0].period_s))
        out[k] = [[curve(q, float(x), float(y)) for x in first] for y in second]
    return out


def _curve_of(effect: Effect) -> Callable[[tuple[float, ...], float, float], float]:
    if effect.constitution is None or effect.constitution.curve is None:
        raise ValueError(f"the effect {effect.name} has no learned law")
    return effect.constitution.curve


def _grid(problem: JointProblem, state: str, effect: Effect, fit: MapFit) -> Array:
    """Values (law_points,) [SI] of a state over the range that occurred."""
    segments = problem.segments

    def largest(values: Iterable[Array], share: float = SETTINGS.law_range_share) -> float:
        return max(float(np.quantile(np.abs(value), share)) for value in values)

    if state == "angle":
        angles = np.concatenate([segment.angle_rad for segment in segments])
        if effect.name == "backlash":  # way after a reversal
            return np.linspace(0.0, float(np.ptp(angles)) / 4.0, SETTINGS.law_points)
        low, high = (
            float(end) for end in np.quantile(angles, (1.0 - SETTINGS.law_range_share, SETTINGS.law_range_share))
        )
        return np.linspace(low, high, SETTINGS.law_points)
    if state == "state of the loop":
        return np.linspace(-1.0, 1.0, SETTINGS.law_points)
    if state == "direction":
        return np.linspace(0.0, 1.0, SETTINGS.law_points)
    if state == "time" and effect.place == "valve":
        return np.linspace(0.0, SETTINGS.law_settled * _time_constant(problem, fit), SETTINGS.law_points)
    top = {
        "speed": lambda: largest(segment.exogenous[:, SPEED] for segment in segments),
        "set-point": lambda: max(float(np.ptp(segment.set_point_pa)) for segment in segments),
        "pressure": lambda: largest(segment.pressure_pa for segment in segments),
        "pressure error": lambda: largest(segment.set_point_pa - segment.pressure_pa for segment in segments),
        "pressure difference": lambda: (
            largest(np.diff(segment.pressure_pa) for segment in segments) * SETTINGS.law_tube_differences
        ),
        "time": lambda: max(len(segment.angle_rad) * segment.period_s for segment in segments),
        "travel": lambda: max(float(np.abs(np.diff(segment.angle_rad)).sum()) for segment in segments),
        "inflow": lambda: largest((segment.exogenous[:, INFLOW] for segment in segments), 1.0),
    }[state]()
    return np.linspace(0.0, max(top, 1e-12), SETTINGS.law_points)


def _time_constant(problem: JointProblem, fit: MapFit) -> float:
    """Time constant [s] of the valve and its lag in a fit."""
    columns, _ = problem.columns(fit.free, fit.z[None])
    return sum(float(columns[0, ROW[key]]) for key in ("valve.time_constant_s", "valve_lag.time_constant_s"))


def in_words(quantity: str, over: tuple[str, ...], x: Array, y: Array, unit: str, over_unit: str) -> str:
    """A law in words. x (points,), y (values of the second state, points), in units and words of the machine."""
    main, size = y[0], float(np.abs(y).max())
    change = main - main[0]
    if size == 0.0:
        return f"{quantity} is 0"
    if np.ptp(main) < SETTINGS.law_constant_share * float(np.abs(main).max()):
        text = f"{quantity} stays at {amount(float(main.mean()), unit)}"
    elif np.all(np.diff(main) >= -1e-9 * size) or np.all(np.diff(main) <= 1e-9 * size):
        at = float(x[int(np.argmax(np.abs(change) >= SETTINGS.law_most_share * abs(change[-1])))])
        verb = "rises" if change[-1] > 0.0 else "falls"
        ends = f"from {amount(float(main[0]), unit)} to {amount(float(main[-1]), unit)}"
        early = at < SETTINGS.law_most_share * x[-1]
        by = f", most of it by a {over[0]} of {amount(at, over_unit)}" if early else ""
        text = f"{quantity} {verb} {ends} over the {over[0]}{by}"
    else:
        ends = f"between {amount(float(main.min()), unit)} and {amount(float(main.max()), unit)}"
        at = float(x[int(np.argmax(main))])
        text = f"{quantity} lies {ends}; it is largest at a {over[0]} of {amount(at, over_unit)}"
    grows = float(y[1].mean() / main.mean() - 1.0) if len(over) > 1 and main.mean() != 0.0 else 0.0
    if abs(grows) >= SETTINGS.law_constant_share and over[1] != "direction":
        text += f", and {'grows' if grows > 0.0 else 'falls'} {abs(100.0 * grows):.0f} % with the {over[1]}"
    return text
