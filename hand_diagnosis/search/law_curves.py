"""Learned laws as curves over their states, with a band, and in words."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hand_diagnosis.search.laws import posterior_draws
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.constitution import STATES
from hand_model.effects.effect import INFLOW, NEIGHBOUR, SPEED, Effect
from hand_model.kernel.rows import ROW, effect_rows
from hand_model.quantities import HAND, Wording, amount


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCurve:
    """A law over its states, in the units of the machine.

    form: "textbook" or "learned".  over: names of the states.  unit, over_unit: of the law and of its first state.
    points: (settings.law_points, 5) state, law, lower and upper end of its band, textbook form fitted to the same data.
    statement: the law in a sentence.  travel: size of the law over the angle, in percent of that at 0; None where the
    law does not change over it.
    """

    form: str
    over: tuple[str, ...]
    quantity: str
    unit: str
    over_unit: str
    points: Array
    statement: str
    travel: LawCurve | None = None

    def document(self) -> dict[str, Any]:
        """The entry `law` of a finding in report.json."""
        document = {
            "form": self.form,
            "over": list(self.over),
            "quantity": self.quantity,
            "unit": self.unit,
            "over_unit": self.over_unit,
            "columns": ["state", "law", "low", "high", "textbook"],
            "points": [[float(f"{value:.4g}") for value in row] for row in self.points],
            "statement": self.statement,
        }
        return document if self.travel is None else {**document, "travel": self.travel.document()}


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
    draws = posterior_draws(problem, chosen)

    def values(fit: MapFit, z: Array) -> Array:
        return _curves(problem, effect, fit, z, first, second)

    here, columns = _banded(values, chosen, textbook, draws)
    unit, over_unit = (wording.units.quantity(f"law.x_{ending}") for ending in (known.unit, STATES[known.over[0]]))
    points = np.column_stack([first * over_unit.factor, unit.factor * columns])
    quantity, over = wording.sentence(known.quantity, ()), tuple(wording.state(name) for name in known.over)
    sentence = in_words(quantity, over, points[:, 0], here * unit.factor, unit.unit, over_unit.unit)
    form = "textbook" if textbook is None else "learned"
    travel = _over_travel(problem, effect, chosen, draws, wording) if form == "learned" else None
    return LawCurve(
        form=form,
        over=over,
        quantity=quantity,
        unit=unit.unit,
        over_unit=over_unit.unit,
        points=points,
        statement=sentence if travel is None else f"{sentence}; {travel.statement}",
        travel=travel,
    )


def _banded(
    values: Callable[[MapFit, Array], Array], chosen: MapFit, textbook: MapFit | None, draws: Array
) -> tuple[Array, Array]:
    """Law over both states (len(second), len(first)), and law, ends of its band and textbook form (len(first), 4).

    values: (fit, coordinates (k, free)) -> laws (k, len(second), len(first)) [SI].  draws: coordinates of `chosen`.
    """
    here = values(chosen, chosen.z[None])[0]
    ends = np.quantile(values(chosen, draws)[:, 0], SETTINGS.law_band, axis=0)
    low, high = np.minimum(ends[0], here[0]), np.maximum(ends[1], here[0])  # a coefficient may stand at its bound
    plain = here[0] if textbook is None else values(textbook, textbook.z[None])[0, 0]
    return here, np.column_stack([here[0], low, high, plain])


def _over_travel(
    problem: JointProblem, effect: Effect, chosen: MapFit, draws: Array, wording: Wording
) -> LawCurve | None:
    """Size of a law over the angle, in percent of that at 0, or None where it does not change over the travel."""
    travel = effect.constitution.travel if effect.constitution else None
    if travel is None:
        return None
    angles = _grid(problem, "angle", effect, chosen)

    def values(fit: MapFit, z: Array) -> Array:
        sizes = [[travel(q, float(angle)) for angle in angles] for q in _arguments(problem, effect, fit, z)]
        return 100.0 * np.array(sizes)[:, None]

    _, columns = _banded(values, chosen, None, draws)
    if np.ptp(columns[:, 0]) < SETTINGS.law_constant_share * float(columns[:, 0].max()):
        return None
    columns[:, 3] = 100.0
    over, over_unit = wording.state("angle"), wording.units.quantity(f"law.x_{STATES['angle']}")
    x = angles * over_unit.factor
    return LawCurve(
        form="learned",
        over=(over,),
        quantity=f"size relative to that at {over} 0",
        unit="%",
        over_unit=over_unit.unit,
        points=np.column_stack([x, columns]),
        statement=in_words("its size", (over,), x, columns[:, :1].T, "%", over_unit.unit),
    )


def _curves(problem: JointProblem, effect: Effect, fit: MapFit, z: Array, first: Array, second: Array) -> Array:
    """Values (k, len(second), len(first)) of the law [SI] at coordinates z (k, free) and at both states."""
    curve = _curve_of(effect)
    given = _arguments(problem, effect, fit, z)
    return np.array([[[curve(q, float(x), float(y)) for x in first] for y in second] for q in given])


def _arguments(problem: JointProblem, effect: Effect, fit: MapFit, z: Array) -> list[tuple[float, ...]]:
    """What the equations of an effect get as q at each of the coordinates z (k, free)."""
    columns, _ = problem.columns(fit.free, z)
    given = [tuple(float(value) for value in column[list(effect_rows(effect, prepared=False))]) for column in columns]
    if effect.prepared:
        return [(*q, *effect.hooks["prepare"](q, problem.segments[0].period_s)) for q in given]
    return given


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
            return np.linspace(0.0, float(np.ptp(angles)) * SETTINGS.law_reversal_share, SETTINGS.law_points)
        low, high = (
            float(end) for end in np.quantile(angles, (1.0 - SETTINGS.law_range_share, SETTINGS.law_range_share))
        )
        return np.linspace(low, high, SETTINGS.law_points)
    if state == "angle difference":
        own = problem.columns(fit.free, fit.z[None])[0][0, ROW["joint_coupling.ratio"]]
        apart = np.concatenate([segment.exogenous[:, NEIGHBOUR] - own * segment.angle_rad for segment in segments])
        return np.linspace(float(apart.min()), float(apart.max()), SETTINGS.law_points)
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
    """A law in words. x (points,), y (values of the second state, points), in [units] and words of the machine."""
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
        early = at - x[0] < SETTINGS.law_most_share * (x[-1] - x[0])
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
