"""The evidence of a hypothesis, and the penalty of its free parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_diagnosis.problem import Task, log_evidence, log_likelihood, most_to_gain, weighted_by_rest
from hand_diagnosis.search import search_joint, training_evidence
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import effect_free_parameters, merged
from hand_identification.map_fit import MapFit, map_fit
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import ROW
from test.diagnosis.recordings import ANGLE_NOISE_RAD, changed, record

JOINT = "index_distal"


def _fit(hand: Hand, *, extra: bool) -> tuple[MapFit, Task, list[int]]:
    """A fit of a joint with plain Coulomb friction; extra: breakaway and load dependence are fitted, too."""
    signals = record(changed(hand, JOINT, coulomb_friction__torque_nm=0.006), np.random.default_rng(81), 20.0)
    task = Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
    ready = task.prepare(JOINT)
    keys = EFFECTS["coulomb_friction"].keys if extra else ("coulomb_friction.torque_nm",)
    added = [m for m in effect_free_parameters(EFFECTS["coulomb_friction"], ready.problem.nominal) if m.key in keys]
    free = merged(ready.free, [m for m in added if m.key != "coulomb_friction.presliding_deg"])
    start = np.zeros(len(free))
    rows = [parameter.row for parameter in free]
    start[rows.index(ROW["coulomb_friction.torque_nm"])] = 0.4
    fit = map_fit(ready.problem, free, start, 12)
    return fit, task, [k for k, parameter in enumerate(free) if parameter.key.startswith("coulomb_friction")]


def test_numbers_that_data_do_not_ask_for_cost_little(hand: Hand) -> None:
    """Fails when an effect loses evidence by having terms that this joint does not need."""
    plain, task, _ = _fit(hand, extra=False)
    full, _, amounts = _fit(hand, extra=True)
    problem = task.prepare(JOINT).problem
    alone = log_evidence(problem, plain)
    assert log_evidence(problem, full) < alone - 4.0  # what they would cost
    assert abs(log_evidence(problem, full, [amounts]) - alone) < 3.0


def test_no_model_gains_more_than_what_is_above_the_white_noise(hand: Hand) -> None:
    """Fails when a fit that leaves friction may gain less than the right model does, or the right one much."""
    right, task, _ = _fit(hand, extra=False)
    ready = task.prepare(JOINT)
    problem = ready.problem
    plain = map_fit(problem, ready.free, np.zeros(len(ready.free)), 12)

    def likelihood(fit: MapFit) -> float:
        parts = (~problem.validation, problem.validation)
        return sum(log_likelihood(problem, fit.squares, part) for part in parts)

    gained = likelihood(right) - likelihood(plain)
    assert gained > 20.0
    assert gained <= most_to_gain(problem, plain) < gained + 5.0
    assert 0.0 <= most_to_gain(problem, right) < 2.0


def test_white_noise_is_no_evidence_against_a_model(hand: Hand) -> None:
    """Fails when sensors of four times the noise hide an effect that their mean over half a second shows as well."""
    gains, moved = [], changed(hand, JOINT, coulomb_friction__torque_nm=5e-4)
    quiet = record(moved, np.random.default_rng(83), 20.0)
    noise = 3.0 * np.random.default_rng(84).standard_normal(quiet.angle_rad.shape)
    loud = replace(quiet, angle_rad=quiet.angle_rad + ANGLE_NOISE_RAD * noise)
    keys = ("coulomb_friction.torque_nm",)
    for signals in (quiet, loud):
        task = Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        ready = task.prepare(JOINT)
        plain = map_fit(ready.problem, ready.free, np.zeros(len(ready.free)), 12)
        own = effect_free_parameters(EFFECTS["coulomb_friction"], ready.problem.nominal)
        free = merged(ready.free, [parameter for parameter in own if parameter.key in keys])
        start = np.where([parameter.key in keys for parameter in free], 0.05, 0.0)
        found = map_fit(ready.problem, free, start, 12)
        gains.append(log_evidence(ready.problem, found) - log_evidence(ready.problem, plain))
    print("gains", gains)
    assert gains[0] > 20.0
    assert gains[1] > 0.7 * gains[0]


def test_validation_blocks_are_evidence(hand: Hand) -> None:
    """Fails when a fit with a large validation error has the same evidence as one with a small validation error."""
    fit, task, _ = _fit(hand, extra=False)
    problem = task.prepare(JOINT).problem
    worse = fit.squares.copy()
    worse[:, problem.validation] *= 4.0
    assert log_evidence(problem, replace(fit, squares=worse)) < log_evidence(problem, fit) - 4.0


def test_a_fit_that_diverges_nearby_has_no_evidence(hand: Hand) -> None:
    """Fails when NaN stands where evidence is compared: every comparison with it is false, and the order is lost."""
    fit, task, amounts = _fit(hand, extra=True)
    normal = fit.normal.copy()
    normal[3] = normal[:, 3] = np.nan
    problem, diverged = task.prepare(JOINT).problem, replace(fit, normal=normal)
    assert log_evidence(problem, diverged, [amounts]) == training_evidence(problem, diverged) == -np.inf


def test_nominal_numbers_stay_within_three_tolerances(hand: Hand) -> None:
    """Fails when a parameter that is far off is absorbed by its tolerance instead of named as an effect."""
    signals = record(changed(hand, JOINT, valve__dead_time_s=0.03), np.random.default_rng(82), 20.0)
    task = Task(
        signals=[signals], model=hand, joints=[JOINT], effects=list(EFFECTS.values()), tolerance=0.05, seed=0, floors={}
    )
    ready = task.prepare(JOINT)
    effects = [EFFECTS["valve_delay"], EFFECTS["valve_lag"]]
    found = search_joint(ready.problem, effects, ready.free, np.random.default_rng(0), ready.start)
    assert np.abs(found.nominal.z).max() <= 3.0 + 1e-9
    assert [hypothesis.effect.name for hypothesis in found.accepted] == ["valve_delay"]
    assert SETTINGS.passes[0].step_s > SETTINGS.passes[-1].step_s


def test_what_a_model_cannot_describe_weighs_as_noise(hand: Hand) -> None:
    """Fails when the last fit of a machine takes an error of its model for information, or noise for more."""
    fit, task, _ = _fit(hand, extra=False)
    problem = task.prepare(JOINT).problem
    sharp = replace(problem, weight=1e4 * problem.weight)
    settled = weighted_by_rest(sharp, fit)
    cost = (settled.weight[:, None] * fit.squares).sum(axis=1)
    counts = problem.block_counts.sum(axis=1)
    assert cost[:2] == pytest.approx(counts[:2])
    assert (weighted_by_rest(replace(problem, weight=1e-4 * problem.weight), fit).weight == 1e-4 * problem.weight).all()
