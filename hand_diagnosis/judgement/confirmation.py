"""What a search found, confirmed or withdrawn: by the test data, and by a simpler description without a name.

The search is over; its accepted effects are changed in place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_diagnosis.judgement.remainder_law import repeating_torque
from hand_diagnosis.problem import ErrorsOnTest, evaluate_test, fitted_rmse, validation_rmse
from hand_diagnosis.search import Hypothesis, JointSearch, fit_without, training_evidence
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit
from hand_model.kernel.rows import ROW

CONTRADICTED = "it improves the validation error and makes the test error clearly larger"
Withdrawn = tuple[tuple[str, str], ...]
"""Names of effects, each with the reason why it is not claimed."""


def without_repeating(search: JointSearch) -> Withdrawn:
    """Withdraw effects over the angle in whose place one harmonic of the angle has more evidence.

    A law with a coefficient at every few degrees follows a torque that only repeats, as that of teeth does, and so
    would get its name. The harmonic has no name in a hand; it remains, and is described as what repeats.
    """
    places = [k for k, hypothesis in enumerate(search.accepted) if _over_the_angle(hypothesis)]
    if not any(search.accepted[k].freed for k in places):
        return ()
    without = fit_without(search, *places)[1]
    found = repeating_torque(search.problem, without)
    if found is None:
        return ()
    problem, placed, fit = found
    gain = training_evidence(problem, fit) - training_evidence(search.problem, search.final)
    if gain < SETTINGS.strong_log_evidence or not _leaves_as_little(search.problem, fit, search.final):
        return ()
    names = [search.accepted[k].effect.name for k in places]
    kept = [hypothesis for k, hypothesis in enumerate(search.accepted) if k not in places]
    if kept:
        kept[-1] = replace(kept[-1], fit=without)
    search.accepted[:] = kept
    turn = 1.0 / problem.columns(fit.free, fit.z[None])[0][0, ROW[placed.key]]
    reason = f"a torque that repeats every {np.degrees(turn):.3g} deg of the joint explains the same more simply"
    return tuple((name, reason) for name in names)


def _leaves_as_little(problem: JointProblem, fit: MapFit, other: MapFit) -> bool:
    """Whether a fit leaves no more than another one, but for what is not claimed, of fitted and of validation data."""
    errors = ((rmse(problem, fit.squares), rmse(problem, other.squares)) for rmse in (fitted_rmse, validation_rmse))
    return all(bool(np.all(np.nan_to_num(own) <= np.hypot(np.nan_to_num(rest), problem.floor))) for own, rest in errors)


def _over_the_angle(hypothesis: Hypothesis) -> bool:
    known = hypothesis.effect.constitution
    return STAGES[hypothesis.stage] == "angle" and known is not None and known.over[:1] == ("angle",)


def confirm_laws(whole: JointProblem, search: JointSearch, *, free_axis: bool) -> None:
    """Put back the textbook forms of all laws where the learned ones do not reduce the test error.

    whole: the problem with its test data.  free_axis: see splits.evaluate_test.
    A law that is learned over a time or a travel may not hold beyond the fitted data.
    """
    if not any(hypothesis.freed and not hypothesis.given for hypothesis in search.accepted):
        return
    textbook = search.with_textbook_laws()
    test = evaluate_test(whole, [textbook.final, search.final], free_axis=free_axis)
    if test is None:
        return
    before, after = (np.nansum(test.rmse(k) ** 2 / whole.floor**2) for k in (0, 1))
    if after >= before:
        search.accepted[:] = textbook.accepted


def tested(
    whole: JointProblem, search: JointSearch, last: JointSearch, rng: np.random.Generator, *, free_axis: bool
) -> tuple[ErrorsOnTest | None, Withdrawn]:
    """Errors of the nominal and the final model on the test data; the effects that these data contradict.

    last: the same models as they are tested, fitted to more data. Findings are withdrawn only where the test error of
    all signals together gets clearly larger by them: the right effect in too narrow a form gains less on test data than
    on validation data. A cause of the whole hand, which other joints show, is withdrawn only where it stands alone.
    """
    test = evaluate_test(whole, [last.nominal, last.final], free_axis=free_axis)
    if test is None or not search.accepted:
        return test, ()
    if not test.clearly_worse(0, 1, whole.floor, rng):
        return test, ()
    own = [place for place, hypothesis in enumerate(search.accepted) if not hypothesis.given]
    gone = own or range(len(search.accepted))
    names = tuple((search.accepted[place].effect.name, CONTRADICTED) for place in gone)
    kept = [hypothesis for place, hypothesis in enumerate(search.accepted) if place not in gone]
    if kept:
        evidence, fit = fit_without(search, *gone)
        kept[-1] = replace(kept[-1], fit=fit, log_evidence=evidence)
    search.accepted[:] = kept
    return evaluate_test(whole, [search.nominal, search.final], free_axis=free_axis), names
