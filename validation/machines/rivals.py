"""Rivals of the diagnosis on the recordings of a machine, each fitted to the training recordings alone.

Every rival fits the first part of each training recording and is chosen (threshold, friction model, lags) on its last
part; the chosen one is then fitted to all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from hand_machine.description import MachineDescription
from hand_machine.reading import Readings
from validation.machines.parts import (
    STANDSTILL,
    STEPS_PER_OSCILLATION,
    Law,
    Part,
    friction_positions,
    parts_of,
    simulate,
    split,
)
from validation.machines.regressors import gaussian_law, networks, sparse_laws
from validation.trial.arrays import Array

CHOSEN_SHARE = 0.3
"""Share of each training recording on which a rival is chosen."""
FRICTIONS: dict[str, tuple[str, ...]] = {
    "viscous": (),
    "Coulomb": ("coulomb",),
    "Coulomb, Stribeck": ("coulomb", "stribeck"),
    "Coulomb, load": ("coulomb", "load"),
    "Coulomb, quadratic": ("coulomb", "quadratic"),
    "Coulomb, Stribeck, load, quadratic": ("coulomb", "stribeck", "load", "quadratic"),
}
"""Six friction models, each with viscous friction and a constant force (Duclusaud et al. 2025 compare such a list)."""
NUMBERS = ("gain", "stiffness", "damping", "inertia")
EVALUATIONS, LONGEST, MOST_STEPS = 25, 4000, 12
"""Most evaluations of a simulated fit, most samples in it, and most integration steps for each of them."""
Predictor = Callable[[Part], Array]
"""Predicts the signal (n,) of a part."""


@dataclass(frozen=True, slots=True)
class Rig:
    """A machine, the speed around which friction changes its sign, and the size of its forces."""

    described: MachineDescription
    still: float
    size: float

    def with_law(self, law: Law, described: MachineDescription | None = None) -> Predictor:
        """Predicts the signal of the machine, or of one with other numbers, with a law of the lacking force."""
        machine = described or self.described

        def predict(part: Part) -> Array:
            if self.described.imposed:
                return np.asarray(part.target - part.lacking + law(part.states))
            return simulate(machine, part, self.still, law)

        return predict


def rival_errors(
    described: MachineDescription, train: Sequence[Readings], test: Sequence[Readings]
) -> dict[str, float]:
    """RMS error [SI] of each rival over the known samples of the test recordings."""
    rig, fitted, tested = rig_of(described, train, test)
    return {name: error(make(rig, fitted), tested) for name, make in RIVALS.items()}


def rig_of(
    described: MachineDescription, train: Sequence[Readings], test: Sequence[Readings]
) -> tuple[Rig, list[Part], list[Part]]:
    """The machine, its training and its test recordings. Its sizes are those of the training recordings."""
    parts = parts_of(described, train, test)
    fitted, tested = parts[: len(train)], parts[len(train) :]
    speed = float(np.std(np.concatenate([part.states[:, 1] for part in fitted])))
    driving = np.concatenate([described.gain * part.states[:, 2] for part in fitted])
    size = float(np.std(driving)) or float(np.std(np.concatenate([part.lacking for part in fitted]))) or 1.0
    return Rig(described, STANDSTILL * speed, size), fitted, tested


def error(predict: Predictor, parts: Sequence[Part]) -> float:
    """RMS error [unit of the output] over the known samples; infinite where a model is not finite."""
    left = np.concatenate([(predict(part) - part.target)[part.known] for part in parts])
    return float(np.sqrt(np.mean(left**2))) if np.isfinite(left).all() else np.inf


def _best(makers: Sequence[Callable[[Sequence[Part]], Predictor]], parts: Sequence[Part]) -> Predictor:
    """The predictor that is best on the last part of the recordings, fitted to all of them."""
    if len(makers) == 1:
        return makers[0](parts)
    first, rest = split(parts, CHOSEN_SHARE)
    errors = [error(make(first), rest) for make in makers]
    return makers[int(np.argmin(errors))](parts)


def _nth(laws: Callable[[Sequence[Part]], Sequence[Law]], k: int, rig: Rig) -> Callable[[Sequence[Part]], Predictor]:
    return lambda parts: rig.with_law(laws(parts)[k])


def _reidentified(rig: Rig, parts: Sequence[Part]) -> Predictor:
    """The nominal model with its numbers fitted again."""
    return friction_model(rig, parts, None)


def _frictions(rig: Rig, parts: Sequence[Part]) -> Predictor:
    def maker(terms: tuple[str, ...]) -> Callable[[Sequence[Part]], Predictor]:
        return lambda some: friction_model(rig, some, terms)

    return _best([maker(terms) for terms in FRICTIONS.values()], parts)


def _sindy(rig: Rig, parts: Sequence[Part]) -> Predictor:
    count = len(sparse_laws(parts))
    return _best([_nth(sparse_laws, k, rig) for k in range(count)], parts)


def _gaussian(rig: Rig, parts: Sequence[Part]) -> Predictor:
    return rig.with_law(gaussian_law(parts))


def _narx(rig: Rig, parts: Sequence[Part]) -> Predictor:
    first, rest = split(parts, CHOSEN_SHARE)
    imposed = rig.described.imposed
    errors = [error(network.predict, rest) for network in networks(first, imposed)]
    return networks(parts, imposed)[int(np.argmin(errors))].predict


RIVALS: dict[str, Callable[[Rig, Sequence[Part]], Predictor]] = {
    "re-identified": _reidentified,
    "best of six": _frictions,
    "SINDy": _sindy,
    "Gaussian process": _gaussian,
    "NARX": _narx,
}


def friction_model(rig: Rig, parts: Sequence[Part], terms: tuple[str, ...] | None) -> Predictor:
    """The nominal model with its numbers fitted again and, where terms are given, friction of these terms."""
    if rig.described.imposed:
        return _regressed(rig, parts, terms)
    return _simulated(rig, parts, terms)


def _regressed(rig: Rig, parts: Sequence[Part], terms: tuple[str, ...] | None) -> Predictor:
    """Least squares on the force."""

    def columns(part: Part) -> Array:
        return _columns(rig, part, terms)

    known = [part.known for part in parts]
    features = np.concatenate([columns(part)[use] for part, use in zip(parts, known, strict=True)])
    lacking = np.concatenate([part.lacking[use] for part, use in zip(parts, known, strict=True)])
    scale = np.where(features.std(axis=0) > 0.0, features.std(axis=0), 1.0)
    weights = np.linalg.lstsq(features / scale, lacking, rcond=None)[0] / scale
    return lambda part: np.asarray(part.target - part.lacking + columns(part) @ weights)


def _columns(rig: Rig, part: Part, terms: tuple[str, ...] | None) -> Array:
    """What the lacking force may consist of (n, k): numbers that are not exact, and terms of friction."""
    x, v, given, sign = part.states.T
    free = [name for name in NUMBERS if rig.described.tolerances.get(name) != 0.0]
    own = {"gain": given, "stiffness": x, "damping": v, "inertia": part.acceleration}
    found = [own[name] for name in free if np.ptp(own[name]) > 0.0]
    if rig.described.weight > 0.0:
        found.append(np.sin(x))
    if terms is None:
        return np.column_stack(found or [np.zeros(len(x))])
    friction = {
        "coulomb": sign,
        "stribeck": sign * np.exp(-((v / (5.0 * rig.still)) ** 2)),
        "load": sign * np.abs(part.target),
        "quadratic": v * np.abs(v),
    }
    if not rig.described.linear:
        found += [np.sin(x), np.cos(x)]
    return np.column_stack([*found, v, np.ones(len(x)), *(friction[name] for name in terms)])


def _simulated(rig: Rig, parts: Sequence[Part], terms: tuple[str, ...] | None) -> Predictor:
    """Least squares on the simulated position, from the nominal numbers and two sizes of friction."""
    starts = (0.0,) if not terms else (0.01, 0.1)
    short = [part.cut(0, LONGEST // len(parts)) for part in parts]
    spread = float(np.std(np.concatenate([part.target for part in short]))) or 1.0

    def left(z: Array) -> Array:
        numbers = _numbers(rig, z, terms)
        errors = [(_positions(rig, part, numbers) - part.target)[part.known] / spread for part in short]
        return np.clip(np.concatenate(errors), -1e3, 1e3)

    fits = [
        least_squares(left, _start(rig, terms, size), x_scale=0.1, max_nfev=EVALUATIONS, loss="linear")
        for size in starts
    ]
    numbers = _numbers(rig, min(fits, key=lambda fit: fit.cost).x, terms)
    return lambda part: _positions(rig, part, numbers)


def _start(rig: Rig, terms: tuple[str, ...] | None, size: float) -> Array:
    count = 5 + (0 if terms is None else 2 + len(terms))
    z = np.zeros(count)
    if terms:
        z[7] = size
    return z


def _numbers(rig: Rig, z: Array, terms: tuple[str, ...] | None) -> Array:
    """Numbers of `friction_positions` from coordinates: changes of the nominal ones, then offset, tilt and friction."""
    one, p = rig.described, np.zeros(12)
    free = np.array([one.tolerances.get(name) != 0.0 for name in NUMBERS])
    speed = rig.still / STANDSTILL
    p[:4] = np.array([one.gain, one.stiffness, one.damping, one.inertia]) * np.exp(np.where(free, z[:4], 0.0))
    if one.damping == 0.0 and free[2]:
        p[2] = abs(z[2]) * rig.size / speed
    p[4], p[11] = one.weight * np.exp(z[4]), rig.still
    if terms is not None:
        p[6] = z[5] * rig.size
        p[5] = z[6] * one.weight
        for name, value in zip(terms, z[7:], strict=True):
            unit = {"load": 1.0, "quadratic": rig.size / speed**2}.get(name, rig.size)
            p[{"coulomb": 7, "load": 8, "stribeck": 9, "quadratic": 10}[name]] = abs(value) * unit
    return p


def _positions(rig: Rig, part: Part, numbers: Array) -> Array:
    x, v = part.states[0, :2]
    rate = float(np.sqrt(max(numbers[1], 1e-12) / numbers[3]))
    friction = (numbers[7] + numbers[9]) / (numbers[3] * rig.still)
    fastest = max(rate * STEPS_PER_OSCILLATION / (2.0 * np.pi), friction, numbers[2] / numbers[3])
    steps = int(np.clip(np.ceil(part.period_s * fastest), 1, MOST_STEPS))
    found: Array = friction_positions(x, v, np.ascontiguousarray(part.states[:, 2]), part.period_s, steps, numbers)
    return found
