"""report.json, schema 1, and the patched model.yaml."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnose import Diagnosis, JointDiagnosis
from hand_diagnosis.findings import Finding
from hand_diagnosis.isolability import Isolability
from hand_diagnosis.locate import locate
from hand_diagnosis.separation import best_experiment
from hand_identification.free_parameters import START_CREEP
from hand_identification.joint_problem import SHOWN, STAGES, UNITS
from hand_identification.model_file import write_model
from hand_model.description import Hand

SCHEMA = 1


def schema() -> dict[str, Any]:
    """The JSON Schema of report.json."""
    text = files("hand_diagnosis").joinpath("report.schema.json").read_text(encoding="utf-8")
    document: dict[str, Any] = json.loads(text)
    return document


def document(diagnosis: Diagnosis, recordings: Sequence[str], model: str) -> dict[str, Any]:
    """report.json's content."""
    return {
        "schema": SCHEMA,
        "recordings": list(recordings),
        "model": model,
        "verdict": diagnosis.verdict,
        "findings": [_finding(rank + 1, one) for rank, one in enumerate(diagnosis.findings)],
        "fit": [row for one in diagnosis.joints for row in _fit(one)],
        "located": [row for one in diagnosis.joints for row in _located(one)],
        "correlations": [_correlations(one) for one in diagnosis.joints if one.search.accepted],
        "not_claimable": [row for one in diagnosis.joints for row in _not_claimable(one)],
        "parameter_changes": [row for one in diagnosis.joints for row in _changes(one)],
        "data_check": list(diagnosis.check),
        "sensor_curve": diagnosis.sensor_curve,
        "isolability": [_isolability(one, one.isolability) for one in diagnosis.joints if one.isolability],
        "next_experiment": next_experiment(diagnosis),
    }


def _finding(rank: int, one: Finding) -> dict[str, Any]:
    return {
        "rank": rank,
        "joint": one.joint,
        "place": one.place,
        "effect": one.effect,
        "probability": round(one.probability, 4),
        "alternatives": [
            {"effect": name, "probability": round(p, 4), "separate_by": experiment}
            for name, p, experiment in one.alternatives
        ],
        "when": [{"start": start, "end": end} for start, end in one.when],
        "where": {"signal": one.signal, "condition": one.condition},
        "parameters": {
            number.key: {
                "value": number.value,
                "std": number.std,
                "unit": number.unit,
                "determined": number.determined,
            }
            for number in one.numbers
        },
        "statement": one.statement,
    }


def _fit(one: JointDiagnosis) -> list[dict[str, Any]]:
    """Errors before and after, on fitted and held-out blocks, per stage in its unit."""
    rows = []
    problem = one.search.problem
    counts = problem.block_counts
    for result in one.results:
        scale = SHOWN[result.stage]
        for split, blocks in (("train", ~problem.held_out), ("held_out", problem.held_out)):
            total = max(float(counts[result.stage, blocks].sum()), 1.0)
            before, after = (
                scale * float(np.sqrt(fit.squares[result.stage, blocks].sum() / total))
                for fit in (one.search.nominal, one.search.final)
            )
            rows.append(
                {
                    "joint": one.joint,
                    "signal": result.name,
                    "unit": UNITS[result.stage],
                    "split": split,
                    "rmse_before": before,
                    "rmse_after": after,
                    "noise_floor": scale * result.noise,
                }
            )
    return rows


def _located(one: JointDiagnosis) -> list[dict[str, Any]]:
    """Where the model misses without the findings; of a stage that it misses nowhere as a whole, only that."""
    regions = locate(one.search.problem, one.search.with_effects_off(), one.results)
    missed = {region.signal for region in regions if region.missed}
    return [
        {
            "joint": one.joint,
            "signal": region.signal,
            "unit": UNITS[region.stage],
            "state": region.state,
            "part": region.part,
            "rms": SHOWN[region.stage] * region.rms,
            "noise": SHOWN[region.stage] * region.noise,
            "sigma": round(region.sigma, 1),
            "missed": region.missed,
        }
        for region in regions
        if region.state == "everywhere" or region.signal in missed
    ]


def _correlations(one: JointDiagnosis) -> dict[str, Any]:
    """Of the final fit's parameters on a joint with findings; what is undetermined leans on the prior."""
    fit = one.search.final
    covariance = fit.covariance
    deviation = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(deviation, deviation)
    return {
        "joint": one.joint,
        "parameters": [parameter.key for parameter in fit.free],
        "matrix": [[round(float(value), 3) for value in row] for row in matrix],
    }


def _not_claimable(one: JointDiagnosis) -> list[dict[str, Any]]:
    """Improvements that held-out data confirm and that are below the repeatability or the scatter of the fit."""
    rows = [
        {
            "joint": one.joint,
            "effect": small.effect.name,
            "signal": STAGES[small.stage],
            "unit": UNITS[small.stage],
            "taken": SHOWN[small.stage] * small.taken,
            "floor": SHOWN[small.stage] * small.floor,
            "below": small.below,
        }
        for small in one.search.not_claimable
    ]
    return [row | {"statement": small_statement(row)} for row in rows]


def small_statement(row: Mapping[str, Any]) -> str:
    """An improvement that is too small to be claimed, in words."""
    return (
        f"{row['joint']}: {row['effect']} would take {row['taken']:.2g} {row['unit']} off the {row['signal']}'s error,"
        f" less than {row['below']} ({row['floor']:.2g} {row['unit']})"
    )


def _changes(one: JointDiagnosis) -> list[dict[str, Any]]:
    """Nominal numbers that moved by more than two standard errors and a tenth of their tolerance."""
    fit, problem = one.search.final, one.search.problem
    deviation = np.sqrt(np.diag(fit.covariance))
    columns, _ = problem.columns(fit.free, fit.z[None])
    own = one.search.effect_keys
    rows = []
    for parameter, z, std in zip(fit.free, fit.z, deviation, strict=True):
        if parameter.row >= START_CREEP or parameter.key in own or abs(z) < max(2.0 * std, 0.1):
            continue
        nominal, value = float(problem.nominal[parameter.row]), float(columns[0, parameter.row])
        change = (value - nominal) / nominal if nominal else None
        rows.append(
            {
                "joint": one.joint,
                "parameter": parameter.key,
                "nominal": nominal,
                "value": value,
                "std": float(parameter.scale * std),
                "relative_change": change,
            }
        )
    return rows


def _isolability(one: JointDiagnosis, found: Isolability) -> dict[str, Any]:
    """What these data can tell apart on a joint with findings, at the nominal model."""
    groups = {h.effect.name: found.group_of(h.effect.name) for h in one.search.accepted if h.effect.name in found.names}
    return {
        "joint": one.joint,
        "effects": list(found.names),
        "visible_sigma": [round(float(v), 2) for v in found.visible],
        "absorbed_by_nominal": [round(float(v), 3) for v in found.absorbed],
        "alike": [[round(float(v), 3) for v in row] for row in found.alike],
        "groups": groups,
    }


def next_experiment(diagnosis: Diagnosis) -> dict[str, str] | None:
    """The experiment that separates the least certain finding from its strongest rival."""
    unsure = [one for one in diagnosis.findings if one.alternatives and one.effect != "unknown"]
    if unsure:
        one = min(unsure, key=lambda finding: finding.probability)
        rival, share, experiment = one.alternatives[0]
        name, sigma = _predicted(diagnosis, one, rival) or (experiment, None)
        why = f"tells {one.effect} ({one.probability:.0%}) from {rival} ({share:.0%}) on {one.joint or 'the hand'}"
        why += "" if sigma is None else f", by {sigma:.0f} sigma as simulated"
        return {"name": name, "why": why, "command": _command(name, one.joint)}
    strange = next((one for one in diagnosis.findings if one.effect == "unknown"), None)
    if strange is not None:
        why = f"shows whether {strange.joint} depends on direction or on speed"
        return {"name": "slow_triangle", "why": why, "command": _command("slow_triangle", strange.joint)}
    return None


def _command(name: str, joint: str | None) -> str:
    """What records an experiment on the running hand."""
    return f"hand excite {name} {f'--joints {joint} ' if joint else ''}--live --out {name}.mcap"


def _predicted(diagnosis: Diagnosis, finding: Finding, rival: str) -> tuple[str, float] | None:
    """The best experiment by simulation of both fitted hypotheses, where both were fitted on the finding's joint."""
    effect = finding.effect
    for one in diagnosis.joints:
        if finding.joint not in {None, one.joint}:
            continue
        for hypotheses in one.search.rounds:
            named = {h.effect.name: h for h in hypotheses}
            if effect in named and rival in named:
                return best_experiment(one.search.problem, named[effect], named[rival])
    return None


def write_report(
    diagnosis: Diagnosis, hand: Hand, recordings: Sequence[str], out: Path
) -> tuple[dict[str, Any], Mapping[str, Mapping[str, float]]]:
    """Write report.json and model.yaml; returns the document and the changes by joint, SI."""
    out.mkdir(parents=True, exist_ok=True)
    content = document(diagnosis, recordings, str(hand.path))
    (out / "report.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    changes = {one.joint: _values(one) for one in diagnosis.joints}
    comment = f"Diagnosed from {', '.join(recordings)}: {diagnosis.verdict}. Nominal: {hand.path.name}."
    kept = {joint: values for joint, values in changes.items() if values}
    resolutions = {one.joint: _resolutions(one) for one in diagnosis.joints if changes[one.joint]}
    write_model(hand, kept, out / "model.yaml", comment, resolutions=resolutions)
    return content, changes


def _resolutions(one: JointDiagnosis) -> dict[str, float]:
    """By key, SI: see MapFit.resolutions."""
    fit = one.search.final
    return fit.resolutions(one.search.problem.columns(fit.free, fit.z[None])[0][0])


def _values(one: JointDiagnosis) -> dict[str, float]:
    """Every number of the final model that differs from the nominal one for sure; none of an unexplained joint."""
    if any(result.unexplained for result in one.results):
        return {}
    fit, problem = one.search.final, one.search.problem
    columns, _ = problem.columns(fit.free, fit.z[None])
    moved = {m.key for m, z in zip(fit.free, fit.z, strict=True) if m.row < START_CREEP and abs(z) > 1e-6}
    return {key: float(columns[0, parameter.row]) for parameter in fit.free for key in [parameter.key] if key in moved}
