"""Whether the inertia of the fingers of a hand changes with their bend: a question to its recordings.

Both models have the same free numbers, so the likelihood of validation data decides, of all joints together: a joint
with an effect of its own must not decide for the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hand_diagnosis.problem.evidence import likelihood_below_floor, weighted_by_noise
from hand_diagnosis.problem.splits import fit_part
from hand_diagnosis.problem.task import Task, put_partner
from hand_diagnosis.settings import SETTINGS
from hand_identification.map_fit import map_fit
from hand_identification.two_links import linked
from hand_model.effects.effect import PARTNER


def bent(task: Task) -> tuple[Task, list[str]]:
    """The task with an inertia that changes with the bend of the fingers where that fits clearly better, and a line."""
    alone = task.with_tolerance(1.0)  # problems that no partner has moved yet stay so
    # Numbers that are further off than the tolerance must not decide.
    for tried in (alone, task.with_tolerance(max(SETTINGS.tolerance_factors))):
        line = bending_line({joint: gain for joint in task.joints if (gain := _gain(tried, joint)) is not None})
        if line:
            return replace(alone, bends=True), [line]
    return task, []


def bending_line(gains: Mapping[str, float]) -> str:
    """What is said of joints whose inertia changes, from what each gains in log likelihood [nats]; empty: too little.

    Most joints must gain; the gain of one counts up to SETTINGS.strong_log_evidence, either way.
    """
    most = SETTINGS.strong_log_evidence
    total = float(np.clip(list(gains.values()), -most, most).sum())
    if not gains or total <= SETTINGS.min_partner_gain or np.median(list(gains.values())) <= 0.0:
        return ""
    return (
        f"the inertia of {', '.join(gains)} changes with the angle of the distal joint, as the masses and lengths in"
        f" `geometry` say (log likelihood of validation data {total:+.3g}, one joint counting up to"
        f" {SETTINGS.strong_log_evidence:g}); the diagnosis includes that, simulation and controller have the inertia"
        " of the middle angle"
    )


def _gain(task: Task, joint: str) -> float | None:
    """What the validation data of a joint gain in log likelihood [nats]; None where no links are known."""
    if linked(task.model, task.model.joints.index(joint))[0] == 0.0:
        return None
    try:
        ready = task.prepare(joint)
    except Exception:  # the diagnosis of the joint will fail for the same reason, and says it
        return None
    added = task.added_by_bending(joint)
    if not added:
        return None
    problem = ready.problem
    without = [segment.exogenous[:, PARTNER].copy() for segment in problem.segments]
    fitted = fit_part(problem)  # its arrays are those of the whole problem
    still = map_fit(fitted, ready.free, ready.start, SETTINGS.rough_iterations)
    sharp = weighted_by_noise(fitted, still)
    fits = []
    for partner in (without, [a + b for a, b in zip(without, added, strict=True)]):
        put_partner(problem, partner)
        fits.append(map_fit(sharp, still.free, still.z, SETTINGS.rough_iterations))
    put_partner(problem, without)
    before, after = (likelihood_below_floor(sharp, fits[0], each) for each in fits)
    return after - before
