"""report.json, schema 2, and the patched model.yaml.

Every number stands in the units of the hand or machine (Diagnosis.wording).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import Diagnosis, JointDiagnosis, claimed_values, valid_changes
from hand_diagnosis.experiments import next_experiment, simulated_experiment, tie_separations
from hand_diagnosis.judgement import (
    Finding,
    Number,
    Onset,
    Region,
    Remainder,
    error_rows,
    errors_by_split,
    locate,
    withdrawn_rows,
)
from hand_diagnosis.search import Isolability, standard_errors
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.settings_table import numbers_in_force
from hand_identification.free_parameters import START_CREEP
from hand_identification.model_file import write_model
from hand_model.description import Hand
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.yaml_loader import DescriptionError

SCHEMA = 2


def schema() -> dict[str, Any]:
    """The JSON Schema of report.json."""
    text = files("hand_diagnosis").joinpath("report.schema.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text)
    return content


def document(diagnosis: Diagnosis, recordings: Sequence[str], model: str) -> dict[str, Any]:
    """The content of report.json. recordings, model: their names."""
    joints, ties = diagnosis.joints, tie_separations(diagnosis)
    return {
        "schema": SCHEMA,
        "recordings": list(recordings),
        "recorded": [None if start is None else _date(start) for start in diagnosis.starts_s],
        "model": model,
        "words": {"whole": diagnosis.wording.whole, "axis": diagnosis.wording.axis},
        "verdict": diagnosis.verdict,
        "findings": [
            _finding(diagnosis, rank, *each) for rank, each in enumerate(zip(diagnosis.findings, ties, strict=True), 1)
        ],
        "fit": fit_rows(diagnosis),
        "left_out": [row for joint in joints for row in error_rows(joint.joint, joint.left_out, joint.wording)],
        "withdrawn": [row for j in joints for row in withdrawn_rows(j.joint, j.left_out, j.withdrawn)],
        "remainder": [_remainder(left) for left in diagnosis.remainder],
        "certificates": [each.document(joint.wording) for joint in joints for each in joint.certificates],
        "not_judged": [{"joint": joint, "reason": reason} for joint, reason in diagnosis.not_judged],
        "located": [row for joint in joints for row in _located(joint)],
        "correlations": [_correlations(joint) for joint in joints if joint.search.accepted],
        "not_claimable": [row for joint in joints for row in _not_claimable(joint)],
        "parameter_changes": [row for joint in joints for row in _changes(joint)],
        "data_check": list(diagnosis.check),
        "sensor_curve": diagnosis.sensor_curve,
        "isolability": [_isolability(joint, joint.isolability) for joint in joints if joint.isolability],
        "next_experiment": next_experiment(diagnosis, ties),
        **numbers_in_force(),
    }


def _date(start_s: float) -> str:
    """A time since 1970 [s] as a date, UTC."""
    return datetime.fromtimestamp(start_s, UTC).isoformat(timespec="seconds")


def _finding(diagnosis: Diagnosis, rank: int, finding: Finding, tie: Mapping[str, str] | None) -> dict[str, Any]:
    """tie: what separates the effects that the finding ties with, see hand_diagnosis.experiments.tie_separations."""
    return {
        "rank": rank,
        "joint": finding.joint,
        "place": finding.place,
        "effect": finding.effect,
        "probability": round(finding.probability, 4),
        "alternatives": [
            {"effect": name, "probability": round(p, 4), "separate_by": _separating(diagnosis, finding, tie, name, by)}
            for name, p, by in finding.alternatives
        ],
        "when": [{"start": start, "end": end} for start, end in finding.when],
        "where": {"signal": finding.signal, "condition": finding.condition},
        "tied_with": list(finding.tied_with),
        "tie": None if tie is None else dict(tie),
        "explains": round(finding.explains, 4),
        "law": {"form": "textbook", "over": [], "points": []} if finding.law is None else finding.law.document(),
        "since": finding.onset.at_s if finding.onset is not None and finding.onset.begins else None,
        "onset": None if finding.onset is None else _onset(finding.onset),
        "parameters": _parameters(finding.numbers, finding.at_bound),
        "statement": finding.statement,
    }


def _onset(onset: Onset) -> dict[str, Any]:
    return {
        "kind": "begins" if onset.begins else "ends",
        "at": onset.at_s,
        "std": onset.std_s,
        "probability": round(onset.probability, 4),
    }


def _parameters(numbers: Sequence[Number], at_bound: Sequence[str] = ()) -> dict[str, Any]:
    return {
        number.key: {
            "value": number.value,
            "std": number.std,
            "unit": number.unit,
            "determined": number.determined,
            "at_bound": number.key in at_bound,
        }
        for number in numbers
    }


def _remainder(left: Remainder) -> dict[str, Any]:
    return {
        "joint": left.joint,
        "place": left.place,
        "signal": left.signal,
        "rms": left.rms,
        "unit": left.unit,
        "split": left.split,
        "share": round(left.share, 4),
        "probability": round(left.probability, 4),
        "family": left.family,
        "law": left.law_document(),
        "when": [{"start": start, "end": end} for start, end in left.when],
        "candidates": [{"effect": name, "parameters": _parameters(numbers)} for name, numbers in left.candidates],
        "statement": left.statement,
    }


def _separating(
    diagnosis: Diagnosis, finding: Finding, tie: Mapping[str, str] | None, rival: str, otherwise: str
) -> str:
    """The experiment that separates a finding from a rival: of a tie and of the first one by simulation."""
    if tie is not None and "name" in tie and rival in finding.tied_with:
        return tie["name"]
    if rival != finding.alternatives[0][0]:
        return otherwise
    simulated = simulated_experiment(diagnosis, finding, rival)
    return simulated[0] if simulated else otherwise


def fit_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Errors before and after, on training, validation and test data, per joint and signal in its unit.

    `after` is the error of model.yaml: with the law of a remainder where one is kept.  noise_floor: of the split.
    undetermined: what the fitted data leave open of the prediction, RMS; a test error of this size is no failure.
    """
    laws = {(left.joint, left.learned.stage): left.learned for left in diagnosis.remainder if left.learned}
    rows = []
    for joint, result in ((each, stage) for each in diagnosis.joints for stage in each.results):
        scale, unit = joint.wording.signal_units[result.stage]
        where = {"joint": joint.joint, "signal": joint.wording.signals[result.stage], "unit": unit}
        own = {each.split: each for each in result.elsewhere}
        for split, errors in errors_by_split(joint, result.stage, laws.get((joint.joint, result.stage))).items():
            before, after = (scale * error for error in errors)
            floor, left_open = (own[split].noise, own[split].undetermined) if split in own else (result.noise, 0.0)
            floors = {"noise_floor": scale * floor, "undetermined": scale * left_open}
            rows.append(where | {"split": split, "rmse_before": before, "rmse_after": after} | floors)
    return rows


def _located(joint: JointDiagnosis) -> list[dict[str, Any]]:
    """Where the model misses without the findings; of a signal that it does not miss anywhere, only the whole."""
    regions = locate(joint.search.problem, joint.search.with_effects_off(), joint.results)
    missed = {region.stage for region in regions if region.missed}
    return [_region(joint, region) for region in regions if region.state == "everywhere" or region.stage in missed]


def _region(joint: JointDiagnosis, region: Region) -> dict[str, Any]:
    wording = joint.wording
    factor, unit = wording.signal_units[region.stage]
    parts = {"forward": wording.positive, "back": wording.negative} if region.state == "direction" else {}
    return {
        "joint": joint.joint,
        "signal": wording.signals[region.stage],
        "unit": unit,
        "state": wording.state(region.state),
        "part": parts.get(region.part, region.part),
        "rms": factor * region.rms,
        "noise": factor * region.noise,
        "sigma": round(region.sigma, 1),
        "missed": region.missed,
    }


def _correlations(joint: JointDiagnosis) -> dict[str, Any]:
    """Of the final fit's parameters on a joint with findings; an undetermined parameter follows its prior."""
    fit = joint.reported.final
    covariance = fit.covariance
    deviation = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(deviation, deviation)
    return {
        "joint": joint.joint,
        "parameters": [joint.wording.units.quantity(parameter.key).key for parameter in fit.free],
        "matrix": [[round(float(value), 3) for value in row] for row in matrix],
    }


def _not_claimable(joint: JointDiagnosis) -> list[dict[str, Any]]:
    """Improvements that validation data confirm and that are below the repeatability or the scatter of the fit."""
    rows = []
    for small in joint.search.not_claimable:
        factor, unit = joint.wording.signal_units[small.stage]
        signal, taken, floor = joint.wording.signals[small.stage], factor * small.taken, factor * small.floor
        statement = (
            f"{joint.joint}: {small.effect.name} would reduce the error of the {signal} by {taken:.2g} {unit}, less"
            f" than {small.below} ({floor:.2g} {unit})"
        )
        rows.append(
            {
                "joint": joint.joint,
                "effect": small.effect.name,
                "signal": signal,
                "unit": unit,
                "taken": taken,
                "floor": floor,
                "below": small.below,
                "statement": statement,
            }
        )
    return rows


def _changes(joint: JointDiagnosis) -> list[dict[str, Any]]:
    """Nominal numbers that moved by more than two standard errors and a tenth of their tolerance, in their units."""
    fit, problem = joint.reported.final, joint.reported.problem
    deviation = standard_errors(problem, fit)
    columns, _ = problem.columns(fit.free, fit.z[None])
    own = joint.reported.effect_keys
    rows = []
    for parameter, z, std in zip(fit.free, fit.z, deviation, strict=True):
        least = max(SETTINGS.min_change_sigma * std, SETTINGS.min_change_tolerances)
        if parameter.row >= START_CREEP or parameter.key in own or abs(z) < least:
            continue
        nominal, value = float(problem.nominal[parameter.row]), float(columns[0, parameter.row])
        quantity = joint.wording.units.quantity(parameter.key)
        factor = quantity.factor / JOINT_PARAMETERS[parameter.row].scale
        rows.append(
            {
                "joint": joint.joint,
                "parameter": quantity.key,
                "unit": quantity.unit,
                "nominal": factor * nominal,
                "value": factor * value,
                "std": factor * float(parameter.scale * std),
                "relative_change": (value - nominal) / nominal if nominal else None,
            }
        )
    return rows


def _isolability(joint: JointDiagnosis, found: Isolability) -> dict[str, Any]:
    """What these data can separate on a joint with findings, at the nominal model."""
    accepted = [hypothesis.effect.name for hypothesis in joint.search.accepted]
    return {
        "joint": joint.joint,
        "effects": list(found.names),
        "visible_sigma": [round(float(v), 2) for v in found.visible],
        "absorbed_by_nominal": [round(float(v), 3) for v in found.absorbed],
        "alike": [[round(float(v), 3) for v in row] for row in found.alike],
        "groups": {name: found.group_of(name) for name in accepted if name in found.names},
    }


def write_json(content: Mapping[str, Any], out: Path) -> None:
    """Write report.json into a folder, made where it is missing."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "report.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def write_report(
    diagnosis: Diagnosis, hand: Hand, recordings: Sequence[str], out: Path, made: Mapping[str, Any] | None = None
) -> tuple[dict[str, Any], Mapping[str, Mapping[str, float]]]:
    """Write report.json and model.yaml of a hand; returns the report and the changed parameters by joint, SI.

    model.yaml always loads: where the numbers of a joint give no valid description, only those of its effects are
    written, or none, and the data check of the report says so.  made: the content of the report, where it exists.
    """
    content = document(diagnosis, recordings, str(hand.path)) if made is None else dict(made)
    comment = f"Diagnosed from {', '.join(recordings)}: {diagnosis.verdict}. Nominal: {hand.path.name}."
    comment = "\n".join([comment, *_law_lines(diagnosis)])
    resolutions = {joint.joint: _resolutions(joint) for joint in diagnosis.joints}
    wanted = {joint.joint: claimed_values(joint) for joint in diagnosis.joints}
    for left in diagnosis.remainder:
        if left.learned:
            wanted[left.joint] |= left.learned.values()
            resolutions[left.joint] |= left.learned.resolutions()
    out.mkdir(parents=True, exist_ok=True)

    def write(changes: Mapping[str, Mapping[str, float]]) -> None:
        write_model(hand, changes, out / "model.yaml", comment, resolutions=resolutions)

    kept: dict[str, Mapping[str, float]] = {joint: values for joint, values in wanted.items() if values}
    try:
        write(kept)
    except DescriptionError:
        effects = {joint.joint: joint.search.effect_keys for joint in diagnosis.joints}
        kept, lines = valid_changes(wanted, effects, write)
        content["data_check"] = [*content["data_check"], *lines]
        write(kept)
    write_json(content, out)
    return content, kept


def _law_lines(diagnosis: Diagnosis) -> list[str]:
    """The learned laws as points with units, for a reader of model.yaml; their coefficients stand at the joints."""
    lines = []
    for finding in diagnosis.findings:
        if finding.law is None or finding.law.form != "learned":
            continue
        for law in (finding.law, finding.law.travel):
            if law is None:
                continue
            points = ", ".join(f"{x:.3g}: {y:.3g}" for x, y in law.points[::3, :2])
            lines.append(
                f"Learned law of {finding.effect} of {finding.joint or 'the hand'}: {law.quantity} [{law.unit}] over"
                f" {law.over[0]} [{law.over_unit}]: {points}"
            )
    return lines


def _resolutions(joint: JointDiagnosis) -> dict[str, float]:
    """Resolution of every free parameter (SI) by key, see MapFit.resolutions."""
    fit = joint.search.final
    return fit.resolutions(joint.search.problem.columns(fit.free, fit.z[None])[0][0])
