"""A model on recordings that it was not fitted to: the prediction of every signal, its error, and the noise floor.

No number of the model is fitted. Only the state at the start of a recording is estimated from it: the creeping ratio,
and the first speed of an axis that begins in motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hand_diagnosis.problem import Task, bent, check, moving_joints, noise_on, not_judged
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import START_CREEP
from hand_identification.joint_problem import STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.joint_model import JointModel
from hand_model.quantities import HAND, Wording
from hand_recording.hand_signals import without_sensor_curve
from hand_recording.signals import Signals

SCHEMA = 1
STATE_ONLY = 1e-6
"""Relative tolerance [-] of the model's numbers while the state at the start is estimated: they do not move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """The error of one signal of one recording, SI of the model; noise: noise of the readings and of the inputs.

    spread: standard deviation of the measured signal.
    """

    recording: str
    joint: str
    stage: int
    rmse: float
    noise: float
    spread: float
    samples: int


@dataclass(frozen=True, slots=True)
class JointPrediction:
    """Measured and predicted readings (OUTPUTS, T) [SI of the model] of one joint by recording, and their scores."""

    joint: str
    segments: tuple[Segment, ...]
    predicted: tuple[Array, ...]
    scores: tuple[Score, ...]


@dataclass(frozen=True, slots=True)
class Prediction:
    """All joints. check: lines of the data check.  not_judged: joints without a prediction, and why."""

    joints: tuple[JointPrediction, ...]
    check: tuple[str, ...]
    not_judged: tuple[tuple[str, str], ...]
    sensor_curve: bool
    wording: Wording


def predict(
    signals: Sequence[Signals],
    model: JointModel,
    *,
    wording: Wording = HAND,
    joints: Sequence[str] = (),
    sensor_curve: bool | None = None,
) -> Prediction:
    """Predict recordings with the model as it is.

    joints: those to predict, all that move where none is given.  sensor_curve: whether the angles of a hand are
    readings of the described Hall sensors; None: what fits better.  Raises ValueError for joints that do not exist.
    """
    checked = [check(recording, model) for recording in signals]
    usable = [each.without_unusable() for each in checked]
    wanted = moving_joints(usable, model, joints, frozenset().union(*(each.unusable for each in checked)))
    (found, more), curve = _predicted(usable, model, wanted), False
    if isinstance(model, Hand) and sensor_curve is not False:
        straight, of_straight = _predicted([without_sensor_curve(each, model) for each in usable], model, wanted)
        if sensor_curve or _angle_error(straight) < _angle_error(found):
            found, more, curve = straight, of_straight, True
    lines = [line for each in checked for line in (*each.signals.notes, *each.lines)] + more
    reasons = not_judged(checked, [each.joint for each in found], joints)
    return Prediction(tuple(found), tuple(lines), tuple(reasons.items()), curve, wording)


def _angle_error(found: Sequence[JointPrediction]) -> float:
    """Median logarithm of the angle errors of all joints; infinite without any."""
    errors = [
        np.log(max(score.rmse, 1e-12)) for each in found for score in each.scores if STAGES[score.stage] == "angle"
    ]
    return float(np.median(errors)) if errors else np.inf


def _predicted(
    signals: Sequence[Signals], model: JointModel, joints: Sequence[str]
) -> tuple[list[JointPrediction], list[str]]:
    """Every joint, and a line for the data check where the inertia of the fingers changes with their bend."""
    task = Task(signals=signals, model=model, joints=joints, effects=[], tolerance=STATE_ONLY, seed=0, floors={})
    task, lines = bent(task)
    return [_joint(task, joint) for joint in joints], lines


def _joint(task: Task, joint: str) -> JointPrediction:
    ready = task.prepare(joint)
    problem = ready.problem
    state = [(p, z) for p, z in zip(ready.free, ready.start, strict=True) if p.row >= START_CREEP]
    free, z = tuple(p for p, _ in state), np.array([z for _, z in state])
    columns, starts = problem.columns(free, z[None])
    predicted = [values[0] for values in problem.predict(columns, starts)]
    residuals = tuple(
        np.where(segment.use, segment.measured - values, 0.0)
        for segment, values in zip(problem.segments, predicted, strict=True)
    )
    squares = problem.block_squares([r[None] for r in residuals])[0]
    fit = MapFit(
        free=free,
        z=z,
        cost=0.0,
        squares=squares,
        residuals=residuals,
        normal=np.zeros((len(z), len(z))),
        sensitivity=(),
        iterations=0,
    )
    scores = [
        _score(problem, segment, residual, stage, float(noise[stage]))
        for segment, residual in zip(problem.segments, residuals, strict=True)
        for noise in (noise_on(problem, fit, _blocks_of(problem, segment)),)
        for stage in range(len(STAGES))
        if segment.use[stage].sum() >= SETTINGS.min_stage_samples
    ]
    return JointPrediction(joint, tuple(problem.segments), tuple(predicted), tuple(scores))


def _blocks_of(problem: JointProblem, segment: Segment) -> Flags:
    """The blocks (blocks,) of one recording."""
    return np.isin(np.arange(problem.blocks), segment.block)


def _score(problem: JointProblem, segment: Segment, residual: Array, stage: int, noise: float) -> Score:
    use = segment.use[stage]
    left, measured = residual[stage][use], segment.measured[stage][use]
    rmse, spread = float(np.sqrt(np.mean(left**2))), float(np.std(measured))
    return Score(
        recording=segment.name,
        joint=problem.joint,
        stage=stage,
        rmse=rmse,
        noise=noise,
        spread=spread,
        samples=int(use.sum()),
    )


def document(prediction: Prediction, recordings: Sequence[str], model: str) -> dict[str, Any]:
    """The content of prediction.json, in the units of the hand or machine. recordings, model: their names."""
    return {
        "schema": SCHEMA,
        "recordings": list(recordings),
        "model": model,
        "scores": [_row(prediction.wording, score) for each in prediction.joints for score in each.scores],
        "not_judged": [{"joint": joint, "reason": reason} for joint, reason in prediction.not_judged],
        "data_check": list(prediction.check),
        "sensor_curve": prediction.sensor_curve,
    }


def _row(wording: Wording, score: Score) -> dict[str, Any]:
    factor, unit = wording.signal_units[score.stage]
    return {
        "recording": score.recording,
        "joint": score.joint,
        "signal": wording.signals[score.stage],
        "unit": unit,
        "rmse": factor * score.rmse,
        "noise_floor": factor * score.noise,
        "noise_floors": score.rmse / score.noise if score.noise > 0.0 else None,
        "explained": 1.0 - (score.rmse / score.spread) ** 2 if score.spread > 0.0 else None,
        "samples": score.samples,
    }
