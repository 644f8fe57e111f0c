"""Nominal numbers that are further off than their tolerance says: a larger one is found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.problem import (
    Task,
    log_evidence,
    most_to_gain,
    shrunk,
    validation_rmse,
    white_parts,
)
from hand_diagnosis.search.hypotheses import amounts
from hand_diagnosis.search.joint_search import rough_evidence
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_identification.posterior import posterior_of
from hand_model.arrays import Flags
from hand_model.description import Hand

Fits = Sequence[tuple[JointProblem, MapFit]]


@dataclass(frozen=True, slots=True)
class BestModel:
    """The plain model of a joint, or the one with the one effect that explains most.

    evidence: log evidence [nats].  explained: the signals (OUTPUTS,) of which it leaves no more than noise and what is
    tolerated without an effect.  to_gain: what a larger tolerance adds to the evidence of this model at most.
    """

    problem: JointProblem
    fit: MapFit
    evidence: float
    explained: Flags
    to_gain: float = np.inf


def tolerant(task: Task) -> tuple[Task, list[str]]:
    """The task with a larger tolerance where its joints ask for larger changes of their numbers, and a line about it.

    Empirical Bayes: a larger tolerance replaces a smaller one where the models of all joints together have clearly more
    evidence with it; afterwards a joint of a hand may ask for one alone. Numbers of a machine have tolerances of their
    own, so one or two axes keep them.
    """
    few, is_hand = len(task.joints) < SETTINGS.min_tolerance_joints, isinstance(task.model, Hand)
    if not task.joints or (few and not is_hand):
        return task, []
    best, known = task, task.nominal_fits()
    if np.median([moved(fit) for _, fit in known]) >= SETTINGS.tolerance_moved:
        best = _of_few_joints(task, known) if few else _of_most_joints(task, known)
    lines = [_line("the recordings ask" if few else "most joints ask", task, best)] if best is not task else []
    if few or not is_hand:
        return best, lines
    alone = _alone(best, known if best is task else best.nominal_fits())
    lines += [_line(f"{joint} asks", best, tried) for joint, tried in alone.items()]
    factors = {joint: tried.tolerance / best.tolerance for joint, tried in alone.items()}
    return replace(best.with_tolerance(1.0), looser=factors) if factors else best, lines


def _line(who: str, given: Task, used: Task) -> str:
    """The line of the data check about a larger tolerance."""
    return (
        f"{who} for larger changes of the nominal numbers than the tolerance of {100.0 * given.tolerance:.3g} %;"
        f" {100.0 * used.tolerance:.3g} % is used, so that small effects may go unnoticed: identify the numbers of the"
        " hand first"
    )


def _alone(task: Task, known: Fits) -> dict[str, Task]:
    """Of a hand whose joints have a tolerance, the joints with the one that they ask for alone.

    Some numbers are further off than most. The other joints are evidence against that, so it must be strong, and the
    model must then fit.
    """
    found = {}
    for joint, (problem, fit) in zip(task.joints, known, strict=True):
        if moved(fit) >= SETTINGS.tolerance_moved:
            single = replace(task, joints=[joint])
            tried = _of_few_joints(single, [(problem, fit)], SETTINGS.strong_log_evidence, np.inf)
            if tried is not single:
                found[joint] = tried
    return found


def _of_most_joints(task: Task, known: Fits) -> Task:
    """The task with the tolerance that most joints ask for.

    Wrong numbers are all that a joint lacks whose plain model then fits. Where the plain models of most joints never
    fit, as with friction in every joint, some joints are asked with one effect each.
    """
    plain = [(task, _plain(known)), *((tried, _plain(tried.nominal_fits())) for tried in _more_tolerant(task))]
    best = _asked_for(plain)
    fitting = [np.median([model.explained.all() for model in models]) > 0.0 for _, models in plain]
    if best is not task or any(fitting):
        return best
    some = np.linspace(0, len(task.joints) - 1, SETTINGS.min_tolerance_joints).round().astype(int)
    chosen = [(tried, replace(tried, joints=[task.joints[k] for k in some])) for tried, _ in plain]
    return _asked_for([(tried, _best_models(few, few.nominal_fits())) for tried, few in chosen])


def _asked_for(models: Sequence[tuple[Task, Sequence[BestModel]]]) -> Task:
    """Of tasks with rising tolerance, and models of joints, the one that most joints ask for; else the first."""
    (best, before), *larger = models
    most = SETTINGS.strong_log_evidence
    for tried, found in larger:
        gain = np.array([_gain(new, old) for new, old in zip(found, before, strict=True)])
        if np.median(gain) > 0.0 and float(np.clip(gain, -most, most).sum()) > SETTINGS.min_log_evidence:
            best, before = tried, found
    return best


def _gain(new: BestModel, old: BestModel) -> float:
    """Log evidence [nats] of a larger tolerance, from the signals of which the new model leaves no more than noise.

    What another signal gains may come from an effect.
    """
    if new.explained.all():
        return new.evidence - old.evidence
    with_new, with_old = (_evidence_of(model, new.explained) for model in (new, old))
    return with_new - with_old


def _evidence_of(model: BestModel, signals: Flags) -> float:
    """Log evidence [nats] of a model from some signals (OUTPUTS,) alone."""
    problem = replace(model.problem, weight=np.where(signals, model.problem.weight, 0.0))
    fit = map_fit(problem, model.fit.free, model.fit.z, SETTINGS.rough_iterations)
    return log_evidence(problem, fit)


def _of_few_joints(
    task: Task,
    known: Fits,
    least: float = SETTINGS.tolerance_log_evidence,
    strong: float = SETTINGS.strong_log_evidence,
) -> Task:
    """The task with the tolerance with which one or two joints have more evidence, each with one effect.

    Here no other joint separates wrong numbers from an effect. But one effect explains more than numbers that are a
    little more free, and several wrong numbers are no one effect. Where the models leave much, the evidence must be
    strong: numbers that may change more always explain a part of other physics.

    least: log evidence [nats] from which a larger tolerance is used if the models then fit.  strong: otherwise.
    """
    given = _best_models(task, known, little=least / len(known))
    before = sum(model.evidence for model in given)
    larger = [(tried, tried.nominal_fits()) for tried in _more_tolerant(task)]
    needless = any(sum(log_evidence(*each) for each in plain) > before for _, plain in larger)
    if not needless and sum(model.to_gain for model in given) <= least:
        return task
    if len(known) > 1:  # one of them may have been left early
        given = _best_models(task, known)
        before = sum(model.evidence for model in given)
    best, most = task, before
    for tried, plain in larger:
        models = _best_models(tried, plain)
        evidence = sum(model.evidence for model in models)
        explained = all(model.explained.all() for model in models)
        if evidence <= max(most, before + (least if explained else strong)):
            continue
        # A fit that a minimum holds with the given tolerance may have been freed by a larger one.
        before = max(before, sum(_within(*each) for each in zip(known, plain, models, strict=True)))
        if evidence > before + (least if explained else strong):
            best, most = tried, evidence
    return best


def _within(given: tuple[JointProblem, MapFit], larger: tuple[JointProblem, MapFit], found: BestModel) -> float:
    """Log evidence [nats] with the given tolerance of a model that was found with a larger one, fitted from there.

    given, larger: the plain models with both.
    """
    problem, plain = given
    known = {parameter.row: parameter for parameter in plain.free}
    freer = {parameter.row: parameter for parameter in larger[1].free}
    free = [known[p.row] if p.row in known and p == freer.get(p.row) else p for p in found.fit.free]
    fit = map_fit(problem, free, found.fit.in_terms_of(free), SETTINGS.nominal_iterations)
    return log_evidence(problem, fit, amounts(fit))


def _more_tolerant(task: Task) -> list[Task]:
    return [task.with_tolerance(factor) for factor in SETTINGS.tolerance_factors]


def _plain(fits: Fits) -> list[BestModel]:
    return [
        BestModel(problem, fit, log_evidence(problem, fit), explained_signals(problem, fit)) for problem, fit in fits
    ]


def _best_models(task: Task, fits: Fits, little: float = -np.inf) -> list[BestModel]:
    """Of each joint the model with the one effect that explains most, or none.

    little: gain [nats] of a joint from which its model is not sought any further.
    """
    rng = np.random.default_rng(task.seed)
    return [_with_one_effect(task, problem, plain, rng, little) for problem, plain in fits]


def _with_one_effect(
    task: Task, problem: JointProblem, plain: MapFit, rng: np.random.Generator, little: float
) -> BestModel:
    """The best model of a joint; little: as in `_best_models`.

    A larger tolerance takes away the penalty of the numbers at most, and the fit then leaves white noise at best.
    """

    def may_gain(known: MapFit, best: MapFit) -> float:
        numbers = np.isin([parameter.row for parameter in best.free], [parameter.row for parameter in plain.free])
        penalty = float(np.sum(best.z[numbers] ** 2)) / 2.0 - _cost_of_tolerance(problem, best, numbers)
        return most_to_gain(problem, best, best if best.residuals else known) + penalty

    def enough(known: MapFit, best: MapFit) -> bool:
        return may_gain(known, best) <= little

    found, best = rough_evidence(problem, task.effects, plain.free, rng, enough)
    known = best if best.residuals else plain
    return BestModel(problem, best, found, explained_signals(problem, best, known), may_gain(plain, best))


def _cost_of_tolerance(problem: JointProblem, fit: MapFit, numbers: Flags) -> float:
    """Log evidence [nats] that the smallest of the larger tolerances costs the numbers chosen (free,) of a fit.

    By Occam's factor: what the data determine was less expected where more is allowed.
    """
    factor = min(SETTINGS.tolerance_factors)
    information = shrunk(problem, fit) * fit.normal
    looser = np.diag(np.where(numbers, factor**-2, 1.0))
    given, larger = (posterior_of(prior + information)[1] for prior in (np.eye(len(looser)), looser))
    return float(np.sum(numbers) * np.log(factor)) - (given - larger) / 2.0


def is_explained(problem: JointProblem, fit: MapFit) -> bool:
    """Whether a plain model leaves no more of any signal than noise and what is tolerated without an effect."""
    return bool(explained_signals(problem, fit).all())


def explained_signals(problem: JointProblem, fit: MapFit, known: MapFit | None = None) -> Flags:
    """The signals (OUTPUTS,) of which a model leaves no more than noise and what is tolerated without an effect.

    known: a fit with residuals, which show the noise; by default the fit itself.
    """
    rmse, noise = np.nan_to_num(validation_rmse(problem, fit.squares)), white_parts(problem, known or fit)
    return np.asarray(rmse <= np.hypot(noise, SETTINGS.unexplained_floors * problem.floor))


def moved(fit: MapFit) -> float:
    """RMS change [tolerances] of the numbers of a plain model, over as many of them as its data determine.

    A number of which the data know nothing stays where it is, whatever the tolerance.
    """
    known = float(np.sum(1.0 - np.diag(fit.covariance)))
    return float(np.sqrt(np.sum(fit.z**2) / max(known, 1.0)))
