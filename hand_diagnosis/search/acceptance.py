"""Which hypotheses are accepted: enough evidence, a validation error that falls, and more than what may be claimed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hand_diagnosis.problem import fitted_rmse, validation_rmse, white_parts
from hand_diagnosis.search.found import NotClaimable
from hand_diagnosis.search.hypotheses import Hypothesis
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array

REPEATABILITY = "the repeatability"
Errors = Callable[[JointProblem, Array], Array]
"""RMS errors (OUTPUTS,) from squares (OUTPUTS, blocks)."""


def is_accepted(problem: JointProblem, current: MapFit, hypothesis: Hypothesis, evidence: float) -> bool:
    """Whether the evidence for an effect over the model without it, of log evidence `evidence` [nats], is enough.

    Either the validation error falls significantly as well, or the evidence is strong; then the error may fall where
    only training blocks show the effect. In both cases the error that the effect removes is larger than what may be
    claimed. The evidence counts effective coefficients: in Laplace's determinant a coefficient that the data do not
    determine has the factor 1.
    """
    gain = hypothesis.log_evidence - evidence
    if gain < SETTINGS.min_log_evidence or hypothesis.fall[1] < 0.0:
        return False
    if hypothesis.fall[0] > 0.0 and _large(problem, current, hypothesis, validation_rmse):
        return True
    strong = gain >= SETTINGS.strong_log_evidence
    return strong and any(_large(problem, current, hypothesis, rmse) for rmse in (validation_rmse, fitted_rmse))


def _large(problem: JointProblem, current: MapFit, hypothesis: Hypothesis, rmse: Errors) -> bool:
    """Whether an error falls by a share of itself that counts, and by more than may be claimed."""
    stage = hypothesis.stage
    before, after = (float(rmse(problem, fit.squares)[stage]) for fit in (current, hypothesis.fit))
    large = error_taken(problem, current, hypothesis, rmse) > float(problem.claimable[stage])
    return large and before - after > SETTINGS.min_relative_improvement * before


def error_taken(
    problem: JointProblem, current: MapFit, hypothesis: Hypothesis, rmse: Errors = validation_rmse
) -> float:
    """Error that an effect removes, SI: the root of the fall of the mean square, by default on validation data."""
    before, after = (rmse(problem, fit.squares)[hypothesis.stage] for fit in (current, hypothesis.fit))
    return float(np.sqrt(max(before**2 - after**2, 0.0)))


def too_small(problem: JointProblem, current: MapFit, hypotheses: Sequence[Hypothesis]) -> list[NotClaimable]:
    """Improvements that the validation data confirm and that are below the repeatability."""
    small = []
    for h in hypotheses:
        taken, claimable = error_taken(problem, current, h), float(problem.claimable[h.stage])
        if h.fall[0] > 0.0 and SETTINGS.min_listed_floors * problem.floor[h.stage] < taken <= claimable:
            small.append(NotClaimable(h.effect, h.stage, taken, claimable, REPEATABILITY))
    return small[: SETTINGS.listed_improvements]


def leaves_much(problem: JointProblem, current: MapFit, fit: MapFit) -> bool:
    """Whether a fit leaves an error clearly above the noise, the white part of the current residuals, of any signal."""
    rmse = np.fmax(validation_rmse(problem, fit.squares), fitted_rmse(problem, fit.squares))
    left = np.nan_to_num(rmse**2 - white_parts(problem, current) ** 2)
    return bool(np.any(left > (SETTINGS.law_min_excess * problem.floor) ** 2))
