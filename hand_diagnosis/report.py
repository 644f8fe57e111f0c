"""report.json, schema 1, the patched model.yaml, and what to record next.

Every number stands in the units of the hand or machine (Diagnosis.wording).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis import settings
from hand_diagnosis.diagnose import Diagnosis, JointDiagnosis
from hand_diagnosis.findings import Finding
from hand_diagnosis.hypotheses import Hypothesis, Isolability
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.verdict import Region, locate
from hand_identification.excitation import EXPERIMENTS
from hand_identification.free_parameters import FARTHEST, START_CREEP
from hand_identification.joint_problem import (
    BLOCK_S,
    CORRELATION_S,
    FLOOR,
    HELD_OUT_EVERY,
    MIN_FLOORS_TAKEN,
    SETTLING_S,
    JointProblem,
)
from hand_identification.map_fit import MapFit
from hand_identification.model_file import write_model
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import Wording
from hand_model.statics import equilibrium_angle
from hand_sim.plant import PHI, STATES, P

SCHEMA = 1
BY_HAND = {"closed_valve_push"}
"""Experiments whose outcome depends on what a person does; they cannot be simulated."""


def schema() -> dict[str, Any]:
    """The JSON Schema of report.json."""
    text = files("hand_diagnosis").joinpath("report.schema.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text)
    return content


def document(diagnosis: Diagnosis, recordings: Sequence[str], model: str) -> dict[str, Any]:
    """The content of report.json. recordings, model: their names."""
    joints = diagnosis.joints
    return {
        "schema": SCHEMA,
        "recordings": list(recordings),
        "model": model,
        "verdict": diagnosis.verdict,
        "findings": [_finding(rank + 1, finding) for rank, finding in enumerate(diagnosis.findings)],
        "fit": [row for joint in joints for row in _fit(joint)],
        "located": [row for joint in joints for row in _located(joint)],
        "correlations": [_correlations(joint) for joint in joints if joint.search.accepted],
        "not_claimable": [row for joint in joints for row in _not_claimable(joint)],
        "parameter_changes": [row for joint in joints for row in _changes(joint)],
        "data_check": list(diagnosis.check),
        "sensor_curve": diagnosis.sensor_curve,
        "isolability": [_isolability(joint, joint.isolability) for joint in joints if joint.isolability],
        "next_experiment": next_experiment(diagnosis),
        "settings": settings.document(),
        "fit_settings": _fit_settings(),
    }


def _fit_settings() -> dict[str, Any]:
    """Numbers of the identification that act in a diagnosis, by name with units."""
    return {
        "floor_pa": FLOOR[0],
        "floor_rad": float(FLOOR[1]),
        "floor_n": FLOOR[2],
        "min_floors_taken": MIN_FLOORS_TAKEN,
        "correlation_s": CORRELATION_S,
        "settling_s": SETTLING_S,
        "block_s": BLOCK_S,
        "validation_every_block": HELD_OUT_EVERY,
        "max_tolerances": FARTHEST,
    }


def _finding(rank: int, finding: Finding) -> dict[str, Any]:
    return {
        "rank": rank,
        "joint": finding.joint,
        "place": finding.place,
        "effect": finding.effect,
        "probability": round(finding.probability, 4),
        "alternatives": [
            {"effect": name, "probability": round(p, 4), "separate_by": experiment}
            for name, p, experiment in finding.alternatives
        ],
        "when": [{"start": start, "end": end} for start, end in finding.when],
        "where": {"signal": finding.signal, "condition": finding.condition},
        "parameters": {
            number.key: {
                "value": number.value,
                "std": number.std,
                "unit": number.unit,
                "determined": number.determined,
            }
            for number in finding.numbers
        },
        "statement": finding.statement,
    }


def _fit(joint: JointDiagnosis) -> list[dict[str, Any]]:
    """Errors before and after, on training and validation blocks (in schema 1: held_out), per signal in its unit."""
    rows = []
    problem = joint.search.problem
    counts = problem.block_counts
    for result in joint.results:
        scale, unit = joint.wording.signal_units[result.stage]
        for split, blocks in (("train", ~problem.held_out), ("held_out", problem.held_out)):
            total = max(float(counts[result.stage, blocks].sum()), 1.0)
            before, after = (
                scale * float(np.sqrt(fit.squares[result.stage, blocks].sum() / total))
                for fit in (joint.search.nominal, joint.search.final)
            )
            rows.append(
                {
                    "joint": joint.joint,
                    "signal": joint.wording.signals[result.stage],
                    "unit": unit,
                    "split": split,
                    "rmse_before": before,
                    "rmse_after": after,
                    "noise_floor": scale * result.noise,
                }
            )
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
    fit = joint.search.final
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
    fit, problem = joint.search.final, joint.search.problem
    deviation = np.sqrt(np.diag(fit.covariance))
    columns, _ = problem.columns(fit.free, fit.z[None])
    own = joint.search.effect_keys
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


def next_experiment(diagnosis: Diagnosis) -> dict[str, str] | None:
    """The experiment that separates the least certain finding from its strongest rival."""
    unsure = [finding for finding in diagnosis.findings if finding.alternatives and finding.effect != "unknown"]
    if unsure:
        finding = min(unsure, key=lambda finding: finding.probability)
        rival, share, experiment = finding.alternatives[0]
        name, sigma = _simulated(diagnosis, finding, rival) or (experiment, None)
        why = f"separates {finding.effect} ({finding.probability:.0%}) from {rival} ({share:.0%})"
        why += f" on {finding.joint or diagnosis.wording.whole}"
        why += "" if sigma is None else f"; in simulation the two differ by {sigma:.0f} sigma"
        return _experiment(name, why, finding.joint, diagnosis.wording)
    unknown = next((finding for finding in diagnosis.findings if finding.effect == "unknown"), None)
    if unknown is not None:
        why = f"shows whether the residual of {unknown.joint} depends on the direction or on the speed"
        return _experiment("slow_triangle", why, unknown.joint, diagnosis.wording)
    return None


def _experiment(name: str, why: str, joint: str | None, wording: Wording) -> dict[str, str]:
    """With the command that records it on the running hand; no command drives another machine."""
    joints = f"--joints {joint} " if joint else ""
    command = {"command": f"hand excite {name} {joints}--live --out {name}.mcap"} if wording.excitable else {}
    return {"name": name, "why": why} | command


def _simulated(diagnosis: Diagnosis, finding: Finding, rival: str) -> tuple[str, float] | None:
    """The best experiment by simulation of both fitted hypotheses, where both were fitted on the finding's joint."""
    for joint in diagnosis.joints:
        if finding.joint not in {None, joint.joint}:
            continue
        for hypotheses in joint.search.rounds:
            named = {hypothesis.effect.name: hypothesis for hypothesis in hypotheses}
            if finding.effect in named and rival in named:
                return best_experiment(joint.search.problem, named[finding.effect], named[rival])
    return None


def best_experiment(problem: JointProblem, first: Hypothesis, second: Hypothesis) -> tuple[str, float]:
    """The experiment with the largest simulated separation of two hypotheses, and the separation [sigma]."""
    names = [name for name in EXPERIMENTS if name not in BY_HAND]
    sigmas = {name: separation_sigma(problem, first.fit, second.fit, name) for name in names}
    name = max(sigmas, key=lambda key: sigmas[key])
    return name, sigmas[name]


def separation_sigma(problem: JointProblem, first: MapFit, second: MapFit, name: str) -> float:
    """Difference [sigma] of two fitted models on an experiment; the practical noise is correlated over a while."""
    period = problem.segments[0].period_s
    time_s = np.asarray(np.arange(round(SETTINGS.experiment_s / period)) * period, dtype=np.float64)
    top = max(float(problem.segments[0].pressure_pa.max()), SETTINGS.min_experiment_pressure_pa)
    commands = top * np.clip(EXPERIMENTS[name](time_s, np.random.default_rng(0)), 0.0, 1.0)
    one, other = (_readings(problem, fit, commands, period) for fit in (first, second))
    squares = float((((one - other) / problem.floor[:2, None]) ** 2).sum())
    return float(np.sqrt(squares * period / CORRELATION_S))


def _readings(problem: JointProblem, fit: MapFit, commands_pa: Array, period_s: float) -> Array:
    """Pressure [Pa] and angle [rad] (2, T) of the joint alone under set-points (T,)."""
    columns, _ = problem.columns(fit.free, fit.z[None])
    a0, a1, a2, a3 = columns[0][ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    load = columns[0][ROW["constant_load.torque_nm"]]
    start = np.zeros((STATES, 1))
    rest_angle = equilibrium_angle(0.0, 0.0, load, a0, a1, a2, a3, 0.0)
    start[PHI] = np.clip(rest_angle, columns[0][ROW["end_stop.low_deg"]], columns[0][ROW["end_stop.high_deg"]])
    loop = ClosedLoop(columns[0][None, :, None], np.array([-1]), start[None], period_s)
    states = loop.advance(commands_pa[None, :, None])[0]
    return np.array([states[:, P, 0], states[:, PHI, 0]])


def write_json(content: Mapping[str, Any], out: Path) -> None:
    """Write report.json into a folder, made where it is missing."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "report.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def write_report(
    diagnosis: Diagnosis, hand: Hand, recordings: Sequence[str], out: Path
) -> tuple[dict[str, Any], Mapping[str, Mapping[str, float]]]:
    """Write report.json and model.yaml of a hand; returns the report and the changed parameters by joint, SI."""
    content = document(diagnosis, recordings, str(hand.path))
    write_json(content, out)
    changes = {joint.joint: _changed_values(joint) for joint in diagnosis.joints}
    comment = f"Diagnosed from {', '.join(recordings)}: {diagnosis.verdict}. Nominal: {hand.path.name}."
    kept = {joint: values for joint, values in changes.items() if values}
    resolutions = {joint.joint: _resolutions(joint) for joint in diagnosis.joints if changes[joint.joint]}
    write_model(hand, kept, out / "model.yaml", comment, resolutions=resolutions)
    return content, changes


def _resolutions(joint: JointDiagnosis) -> dict[str, float]:
    """Resolution of every free parameter (SI) by key, see MapFit.resolutions."""
    fit = joint.search.final
    return fit.resolutions(joint.search.problem.columns(fit.free, fit.z[None])[0][0])


def _changed_values(joint: JointDiagnosis) -> dict[str, float]:
    """Every parameter (SI) of the final model that differs from the nominal one; none of an unexplained joint."""
    if any(result.unexplained for result in joint.results):
        return {}
    fit, problem = joint.search.final, joint.search.problem
    columns, _ = problem.columns(fit.free, fit.z[None])
    return {
        parameter.key: float(columns[0, parameter.row])
        for parameter, z in zip(fit.free, fit.z, strict=True)
        if parameter.row < START_CREEP and abs(z) > 1e-6
    }
