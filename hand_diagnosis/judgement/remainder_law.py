"""The law of a remainder: a curve over one state, or a harmonic of time or angle, without a name.

The training data fit every family, their evidence chooses one, and it is kept where it reduces the error on validation
and on test data. Its effects are hand_model/effects/unnamed_torque.py and unnamed_pressure.py. It describes; it does
not explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.judgement.residual_structure import Structure, turn_of_angle
from hand_diagnosis.problem import block_bootstrap, evaluate_test, swings_freely, validation_rmse, weighted_by_noise
from hand_diagnosis.search import (
    LawCurve,
    at_floor,
    in_words,
    period_of_torque,
    posterior_draws,
    training_evidence,
)
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import FreeParameter, law_free_parameters
from hand_identification.joint_problem import STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.effects import EFFECTS
from hand_model.effects.constitution import STATES
from hand_model.effects.effect import NEIGHBOUR, SPEED, Effect
from hand_model.kernel.rows import ROW, effect_rows
from hand_model.quantities import Wording, amount

ACTS = {"pressure": "unnamed_pressure", "angle": "unnamed_torque"}
"""The effect whose law explains a remainder of a signal."""
KEYS = {
    "angle": "angle_per_rad",
    "speed": "speed_s_per_rad",
    "pressure": "pressure_per_pa",
    "set-point": "set_point_per_pa",
    "time": "time_per_s",
    "neighbour": "neighbour_per_rad",
}
"""The key by which an effect's law depends on a state."""
FAMILIES = {
    "angle": "depends_on_angle",
    "speed": "depends_on_speed",
    "pressure": "depends_on_pressure",
    "set-point": "depends_on_set_point",
    "time": "drifts_with_time",
    "neighbour": "depends_on_another_joint",
}
"""Name of the family of a curve over a state."""
PERIODIC = {"time": "periodic_in_time", "angle": "periodic_in_angle"}


@dataclass(frozen=True, slots=True)
class Placed:
    """A family with the state that it depends on: x runs from 0 to 1 between low and high [SI], or through turns."""

    effect: Effect
    state: str
    low: float
    high: float
    turns: bool

    @property
    def key(self) -> str:
        """The key of the growth of x with the state."""
        return f"{self.effect.name}.{KEYS[self.state]}"

    @property
    def family(self) -> str:
        """Its name in report.json."""
        return PERIODIC[self.state] if self.turns else FAMILIES[self.state]

    def put(self, problem: JointProblem) -> JointProblem:
        """The problem in which the law would depend on this state; it is still zero."""
        nominal = problem.nominal.copy()
        nominal[ROW[self.key]] = 1.0 / (self.high - self.low)
        if not self.turns:
            nominal[ROW[f"{self.effect.name}.offset"]] = -self.low / (self.high - self.low)
        return replace(problem, nominal=nominal)

    def free(self, nominal: Array, span: float) -> list[FreeParameter]:
        """The law's free parameters: knots, or both parts of a harmonic and its frequency over a span [SI].

        nominal: (rows,) of the problem in which the law is placed.
        """
        own = law_free_parameters(self.effect, nominal)
        if not self.turns:
            return [p for p in own if ".knot_" in p.key]
        row, each = ROW[self.key], SETTINGS.remainder_turn / span
        rate = float(nominal[row])
        pair, most = [p for p in own if ".knot_" not in p.key], SETTINGS.remainder_turn_bound * each
        return [*pair, FreeParameter(row, rate, each, False, rate - most, rate + most)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RemainderLaw:
    """The law of a remainder. problem: with the law's state placed.  validation, test: errors before and after, SI.

    before, fit: of the model without and with the law.  test: None where there are no test data.
    """

    placed: Placed
    stage: int
    problem: JointProblem
    before: MapFit
    fit: MapFit
    validation: tuple[float, float]
    test: tuple[float, float] | None

    def values(self) -> dict[str, float]:
        """Numbers (SI) by key with which a model has the law: those of its effect, and all that were fitted with it."""
        column = self.problem.columns(self.fit.free, self.fit.z[None])[0][0]
        rows = {parameter.key: ROW[parameter.key] for parameter in self.placed.effect.parameters}
        rows = {key: row for key, row in rows.items() if column[row] != 0.0}
        rows |= {p.key: p.row for p, z in zip(self.fit.free, self.fit.z, strict=True) if p.row < len(ROW) and z != 0.0}
        return {key: float(column[row]) for key, row in rows.items()}

    def resolutions(self) -> dict[str, float]:
        """Resolution (SI) of the fitted numbers by key, see MapFit.resolutions."""
        return self.fit.resolutions(self.problem.columns(self.fit.free, self.fit.z[None])[0][0])


def learn_remainder(
    problem: JointProblem, whole: JointProblem, fit: MapFit, stage: int, structure: Structure
) -> RemainderLaw | None:
    """The law that explains most of what a fit leaves of a signal; None where none is confirmed.

    problem: without the test data.  whole: with them.  structure: of what is left, for the frequency of a tone.
    """
    name = ACTS.get(STAGES[stage])
    if name is None or problem.driven or swings_freely(problem):  # a free axis keeps every error of a law for good
        return None
    coarse = replace(problem, step_s=SETTINGS.passes[0].step_s)
    tried = [
        (placed, _fitted(coarse, fit, placed, SETTINGS.law_iterations[0]))
        for placed in _families(problem, fit, EFFECTS[name], stage, structure)
    ]
    if not tried:
        return None
    placed, begun = max(tried, key=lambda pair: training_evidence(pair[0].put(coarse), pair[1]))
    ready = placed.put(problem)
    ended = map_fit(weighted_by_noise(ready, fit), begun.free, begun.z, SETTINGS.law_iterations[1])
    ended = at_floor(ready, ended)
    before, after = (float(validation_rmse(ready, each.squares)[stage]) for each in (fit, ended))
    rng = np.random.default_rng(SETTINGS.noise_seed)
    fall = block_bootstrap(ready, fit.squares, ended.squares, stage, rng)
    if fall[0] <= 0.0 or after > (1.0 - SETTINGS.min_relative_improvement) * before:
        return None
    test = evaluate_test(placed.put(whole), [fit, ended], free_axis=False)
    errors = None
    if test is not None and np.isfinite(test.rmse(0)[stage]):
        errors = (float(test.rmse(0)[stage]), float(test.rmse(1)[stage]))
        if errors[1] > (1.0 - SETTINGS.min_relative_improvement) * errors[0]:
            return None
    return RemainderLaw(
        placed=placed, stage=stage, problem=ready, before=fit, fit=ended, validation=(before, after), test=errors
    )


def repeating_torque(problem: JointProblem, fit: MapFit) -> tuple[JointProblem, Placed, MapFit] | None:
    """The fit of a model with one harmonic of the angle as its torque besides, from the period that the torque shows.

    Returns the problem with the harmonic placed, where it is placed, and the fit; None where no period shows.
    """
    turn = 0.0 if problem.driven or swings_freely(problem) else period_of_torque(problem, fit)
    if turn <= 0.0:
        return None
    placed = Placed(EFFECTS[ACTS["angle"]], "angle", 0.0, turn, turns=True)
    coarse = replace(problem, step_s=SETTINGS.passes[0].step_s)
    begun = [_fitted(coarse, fit, placed, SETTINGS.law_iterations[0], start) for start in _PHASES]
    best = min(begun, key=lambda each: each.cost)
    ready = placed.put(problem)
    return ready, placed, map_fit(ready, best.free, best.z, SETTINGS.law_iterations[1])


_PHASES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
"""Coordinates of a harmonic to start from: none, and one of the prior's size in each phase."""


def _fitted(problem: JointProblem, fit: MapFit, placed: Placed, iterations: int, begin: Sequence[float] = ()) -> MapFit:
    """A short fit of a family together with all that the model has. begin: coordinates of the law, none by default."""
    ready = placed.put(problem)
    span = max(float(np.ptp(values)) for values in _values(problem, placed.state))
    added = placed.free(ready.nominal, span)
    start = np.concatenate([fit.z, begin or np.zeros(len(added))])
    return map_fit(ready, [*fit.free, *added], start, iterations).without_arrays()


def _families(problem: JointProblem, fit: MapFit, effect: Effect, stage: int, structure: Structure) -> Iterator[Placed]:
    """Every family that the data can determine: curves over states that vary, and harmonics that repeat often."""
    own = {parameter.key for parameter in effect.parameters}
    for state, key in KEYS.items():
        if f"{effect.name}.{key}" not in own:
            continue
        values = np.concatenate(_values(problem, state))
        low, high = (float(end) for end in np.quantile(values, (0.0, 1.0)))
        if high - low > _least_range(state):
            yield Placed(effect, state, low, high, turns=False)
    if structure.tone > SETTINGS.remainder_tone_share:
        yield Placed(effect, "time", 0.0, 1.0 / structure.tone_hz, turns=True)
    turns = {turn_of_angle(problem, fit, stage)}
    if STAGES[stage] == "angle":
        turns.add(period_of_torque(problem, fit))
    yield from (Placed(effect, "angle", 0.0, turn, turns=True) for turn in sorted(turns) if turn > 0.0)


def _least_range(state: str) -> float:
    """Range [SI] of a state over which a curve has a meaning."""
    least = {"angle": SETTINGS.remainder_least_angle_rad, "pressure": SETTINGS.remainder_least_pressure_pa}
    kind = {"neighbour": "angle", "set-point": "pressure"}.get(state, state)
    return least.get(kind, 0.0)


STATES_OF = {"neighbour": "angle"} | {state: state for state in KEYS if state != "neighbour"}
"""The state (constitution.STATES) whose unit a state of KEYS has."""


def _values(problem: JointProblem, state: str) -> list[Array]:
    """A state (T,) [SI] in every segment."""

    def of(segment: Segment) -> Array:
        if state == "time":
            return np.asarray(np.arange(len(segment.angle_rad)) * segment.period_s, dtype=np.float64)
        known = {"angle": segment.angle_rad, "pressure": segment.pressure_pa, "set-point": segment.set_point_pa}
        if state in known:
            return known[state]
        return np.asarray(segment.exogenous[:, NEIGHBOUR if state == "neighbour" else SPEED])

    return [of(segment) for segment in problem.segments]


def described(law: RemainderLaw, wording: Wording) -> LawCurve:
    """The law over its state with its 95 % band, in the units of the machine and in words."""
    placed, fit = law.placed, law.fit
    known = placed.effect.constitution
    assert known is not None
    x = np.linspace(0.0, 1.0, SETTINGS.law_points)
    turn = 1.0 / law.values()[placed.key] if placed.turns else placed.high - placed.low
    state = turn * x if placed.turns else placed.low + turn * x
    draws = posterior_draws(law.problem, fit)
    here, drawn = _curves(law, fit.z[None], x)[0], _curves(law, draws, x)
    ends = np.quantile(drawn, SETTINGS.law_band, axis=0)
    unit, over_unit = (
        wording.units.quantity(f"law.x_{ending}") for ending in (known.unit, STATES[STATES_OF[placed.state]])
    )
    columns = (here, np.minimum(ends[0], here), np.maximum(ends[1], here), np.zeros_like(here))
    points = np.column_stack([over_unit.factor * state, *(unit.factor * y for y in columns)])
    over = "angle of another joint" if placed.state == "neighbour" else wording.state(placed.state)
    quantity = wording.sentence(known.quantity, ())
    if placed.turns:
        size = amount(unit.factor * float(np.ptp(here)) / 2.0, unit.unit)
        every = amount(abs(over_unit.factor * turn), over_unit.unit)
        sentence = f"{quantity} repeats every {every} of the {over} with an amplitude of {size}"
    else:
        sentence = in_words(quantity, (over,), points[:, 0], points[None, :, 1], unit.unit, over_unit.unit)
    return LawCurve(
        form="learned",
        over=(over,),
        quantity=quantity,
        unit=unit.unit,
        over_unit=over_unit.unit,
        points=points,
        statement=sentence,
    )


def _curves(law: RemainderLaw, z: Array, x: Sequence[float] | Array) -> Array:
    """Values (k, len(x)) of the law [SI] at coordinates z (k, free)."""
    effect = law.placed.effect
    assert effect.constitution is not None
    curve = effect.constitution.curve
    assert curve is not None
    columns, _ = law.problem.columns(law.fit.free, z)
    rows = list(effect_rows(effect, prepared=False))
    return np.array([[curve(tuple(map(float, column[rows])), float(at), 0.0) for at in x] for column in columns])
