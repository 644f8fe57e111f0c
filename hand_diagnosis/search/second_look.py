"""A second look at the search of a machine, whose errors may correlate less than they seemed to.

How far apart samples are independent is first known from what the nominal model leaves, and an effect that this model
lacks lengthens that. So the best model that was found says it again, and the search is repeated where its errors
correlate clearly less.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hand_diagnosis.search.found import JointSearch
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import correlation_s, map_fit


def second_look(search: JointSearch, again: Callable[[JointProblem], JointSearch]) -> JointSearch:
    """The search of a machine, repeated with the correlation of its own errors where this is clearly shorter.

    again: searches a problem.
    """
    shorter = _left_correlation_s(search)
    if shorter >= SETTINGS.shorter_correlation * search.problem.correlation_s:
        return search
    return again(replace(search.problem, correlation_s=shorter))


def _left_correlation_s(search: JointSearch) -> float:
    """Distance [s] of independent samples of what the best model leaves, whether or not it was accepted."""
    problem, best = search.problem, search.final
    if not search.accepted:
        tried = search.rounds[-1] if search.rounds else []
        if not tried:
            return problem.correlation_s
        best = map_fit(problem, tried[0].fit.free, tried[0].fit.z, 1)
    return correlation_s(problem, best)
