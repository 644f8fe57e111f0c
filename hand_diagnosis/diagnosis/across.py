"""What several joints show together: partners, effects that few joints share, causes of the whole hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hand_diagnosis.diagnosis.joint import JointDiagnosis, diagnose_joint
from hand_diagnosis.problem import Task, fit_part, likelihood_below_floor, model_accelerations, put_partner
from hand_diagnosis.search import Cause, refit_below_floor, whole_hand_cause
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.effects.effect import PARTNER


def next_to_models(task: Task, done: Sequence[JointDiagnosis]) -> list[JointDiagnosis]:
    """Joints of pairs in which one differs, diagnosed again where the partner's model explains more than its sensor."""
    at = {result.joint: result for result in done}
    renewed = list(done)
    for k, result in enumerate(done):
        other = at.get(task.partner(result.joint))
        if other is None or not any(_differs(each) for each in (result, other)):
            continue
        problem, own = other.whole, result.whole
        if problem is None or own is None or [p.name for p in problem.segments] != [p.name for p in own.segments]:
            continue
        partner = task.with_bending(result.joint, model_accelerations(problem, other.search.final))
        if _fits_better(own, result.search.final, partner):
            renewed[k] = diagnose_joint(task, result.wording, result.joint, k, 2, partner=partner)
    return renewed


def _differs(result: JointDiagnosis) -> bool:
    """Whether a joint has an effect, or more than its noise is left."""
    return bool(result.search.accepted) or any(stage.remains for stage in result.results)


def _fits_better(whole: JointProblem, fit: MapFit, partner: Sequence[Array]) -> bool:
    """Whether the model of a joint fits clearly better with these accelerations of its partner.

    What the joint lacks itself may be large, and the push of its partner small, so that only errors below the practical
    floor show it.
    """
    measured = [segment.exogenous[:, PARTNER].copy() for segment in whole.segments]
    problem = fit_part(whole)  # its arrays are those of the whole problem
    fits = []
    for accelerations in (measured, partner):
        put_partner(whole, accelerations)
        fits.append(refit_below_floor(problem, map_fit(problem, fit.free, fit.z, SETTINGS.rough_iterations)))
    put_partner(whole, measured)
    before, after = (likelihood_below_floor(problem, fits[0], each) for each in fits)
    return after > before + SETTINGS.min_partner_gain


def without_unshared(task: Task, done: list[JointDiagnosis]) -> list[JointDiagnosis]:
    """Effects of the whole hand that few of at least three joints show are none: diagnose these joints again."""
    if len(done) < 3:
        return done
    for name in [effect.name for effect in task.effects if effect.everywhere]:
        having = [k for k, each in enumerate(done) if any(h.effect.name == name for h in each.search.accepted)]
        if having and len(having) < SETTINGS.min_sharing_joints * len(done):
            for k in having:
                done[k] = diagnose_joint(task, done[k].wording, done[k].joint, k, 1, without=name)
    return done


def with_causes(task: Task, done: list[JointDiagnosis]) -> list[JointDiagnosis]:
    """Joints diagnosed again with causes of the whole hand, where one explains all of them better than each alone."""
    for number in range(SETTINGS.max_causes):
        if sum(_differs(each) for each in done) < 2:
            break
        have = {cause.effect for each in done for cause in each.causes}
        effects = [effect for effect in task.effects if effect not in have]
        rng = np.random.default_rng([task.seed, number])
        cause = whole_hand_cause([each.search for each in done], effects, rng)
        if cause is None:
            break
        done = [
            _again_with(task, each, k, cause) if each.joint in cause.starts else each for k, each in enumerate(done)
        ]
    return done


def _again_with(task: Task, result: JointDiagnosis, number: int, cause: Cause) -> JointDiagnosis:
    """A joint diagnosed again with a further cause, next to the same model of its partner."""
    whole = result.whole
    partner = () if whole is None else [segment.exogenous[:, PARTNER].copy() for segment in whole.segments]
    causes = (*result.causes, cause)
    return diagnose_joint(task, result.wording, result.joint, number, 3, partner=partner, causes=causes)
