"""Which effects, with which laws, explain a joint: hypotheses, their evidence, learned laws, the search."""

from hand_diagnosis.search.causes import Cause, whole_hand_cause, with_cause
from hand_diagnosis.search.completion import (
    ELSEWHERE,
    at_floor,
    on_everything,
    refit_below_floor,
    standard_errors,
    with_validation,
)
from hand_diagnosis.search.found import JointSearch, fit_without
from hand_diagnosis.search.hypotheses import Hypothesis, Probes, amounts, probes_at
from hand_diagnosis.search.isolability import Isolability, isolability
from hand_diagnosis.search.joint_search import rough_evidence, search_joint
from hand_diagnosis.search.law_curves import LawCurve, describe, in_words
from hand_diagnosis.search.laws import LearnedLaw, learn_law, posterior_covariance, posterior_draws, training_evidence
from hand_diagnosis.search.second_look import second_look
from hand_diagnosis.search.tolerance import is_explained, moved, tolerant
from hand_diagnosis.search.turns import period_of_torque

__all__ = [
    "ELSEWHERE",
    "Cause",
    "Hypothesis",
    "Isolability",
    "JointSearch",
    "LawCurve",
    "LearnedLaw",
    "Probes",
    "amounts",
    "at_floor",
    "describe",
    "fit_without",
    "in_words",
    "is_explained",
    "isolability",
    "learn_law",
    "moved",
    "on_everything",
    "period_of_torque",
    "posterior_covariance",
    "posterior_draws",
    "probes_at",
    "refit_below_floor",
    "rough_evidence",
    "search_joint",
    "second_look",
    "standard_errors",
    "tolerant",
    "training_evidence",
    "whole_hand_cause",
    "with_cause",
    "with_validation",
]
