"""Which numbers a diagnosis writes into model.yaml: those that it claims, as far as they are a valid description."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from hand_diagnosis.diagnosis.joint import JointDiagnosis
from hand_diagnosis.problem import weighted_by_noise
from hand_diagnosis.search import at_floor
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import START_CREEP
from hand_identification.map_fit import map_fit
from hand_model.yaml_loader import DescriptionError


def claimed_values(joint: JointDiagnosis) -> dict[str, float]:
    """Numbers (SI) by key that the report claims for a joint: of its findings, and nominal ones that moved.

    The others are put back to their nominal values, and those that stay are fitted again without them. Where this
    costs evidence, the numbers that are farthest from their nominal values in standard errors stay as well.
    """
    claimed, search = joint.claimed(), joint.search
    if len(claimed) < len(search.accepted):
        return {}
    final, problem = search.final, search.problem
    deviation = np.sqrt(np.diag(final.covariance))
    least = np.maximum(SETTINGS.min_change_sigma * deviation, SETTINGS.min_change_tolerances)
    stays = np.array(
        [p.row >= START_CREEP or p.key in search.effect_keys or abs(z) >= limit
         for p, z, limit in zip(final.free, final.z, least, strict=True)]
    )  # fmt: skip
    if not search.accepted and not stays.any():
        return {}
    order = np.argsort(-np.abs(final.z) / deviation, kind="stable")
    sharp = weighted_by_noise(problem, final)  # the weights of the fit that is reported
    while True:
        free = [p for p, kept in zip(final.free, stays, strict=True) if kept]
        fit = final
        if free:
            fit = at_floor(problem, map_fit(sharp, free, final.z[stays], SETTINGS.rough_iterations))
        further = [k for k in order if not stays[k]]
        if not further or fit.cost < final.cost + SETTINGS.min_log_evidence:
            break
        stays[further[: 1 + len(further) // SETTINGS.stated_parts]] = True
    columns, _ = problem.columns(fit.free, fit.z[None])
    return {
        p.key: float(columns[0, p.row])
        for p, z in zip(fit.free, fit.z, strict=True)
        if p.row < START_CREEP and abs(z) > 1e-6
    }


def valid_changes(
    wanted: Mapping[str, Mapping[str, float]],
    effects: Mapping[str, Collection[str]],
    write: Callable[[Mapping[str, Mapping[str, float]]], None],
) -> tuple[dict[str, Mapping[str, float]], list[str]]:
    """Of the numbers of every joint, those that give a valid description, and a line about those that do not.

    effects: keys of the effects of every joint.  write: raises DescriptionError for numbers that are not valid.
    """
    kept: dict[str, Mapping[str, float]] = {}
    lines = []
    for joint, values in wanted.items():
        own = {key: value for key, value in values.items() if key in effects[joint]}
        reason = ""
        for tried, left_out in ((values, ""), (own, "the changed nominal numbers"), ({}, "what was found")):
            try:
                write(kept | {joint: tried} if tried else kept)
            except DescriptionError as error:
                reason = " ".join(str(error).split())
                continue
            if left_out:
                lines.append(f"{joint}: model.yaml is without {left_out}: {reason}")
            if tried:
                kept[joint] = tried
            break
    return kept, lines
