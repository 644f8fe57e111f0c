"""report.html: the diagnosis for a reader who has two minutes, in one file; and the figures as PNGs."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hand_diagnosis.diagnosis import Diagnosis, JointDiagnosis
from hand_diagnosis.figures import joint_figure, law_figure
from hand_diagnosis.settings import SETTINGS
from hand_pages.page import png, write_html

VERDICTS = {
    "agrees": "Model and recording agree.",
    "explained": "The missing physics is found and explains the difference.",
    "partly_explained": "A part of the difference is explained.",
    "unknown_physics": "Physics is missing that no known effect explains.",
}
TIED = "Effects that these data cannot separate explain the difference."
SPLITS = {"train": "training", "validation": "validation", "test": "test"}
Rows = list[list[str]]


def write_page(diagnosis: Diagnosis, report: Mapping[str, Any], out: Path) -> None:
    """Write report.html, and a PNG of every joint with a finding (of the first joint where there is none).

    report: the content of report.json.
    """
    joints = []
    for joint in _shown(diagnosis):
        picture = png(joint_figure(joint))
        (out / f"{joint.joint}.png").write_bytes(picture)
        joints.append(_joint(joint, picture, report) | {"laws": _laws(diagnosis, joint)})
    count, axis = len(diagnosis.joints), diagnosis.wording.axis
    write_html(
        out / "report.html",
        "hand_diagnosis",
        "report.html",
        report=report,
        verdict=headline(report),
        model=Path(report["model"]).name,
        axis=axis,
        diagnosed=f"{count} {axis}{'' if count == 1 else 's'} diagnosed{_left_out(report)}",
        joints=joints,
        fit=_fit(report),
        changes=_changes(report),
        located=_located(report),
        correlated=_correlated(report),
        strong=f"{SETTINGS.strong_correlation:g}",
        separable=[(row["joint"], _separable(row)) for row in report["isolability"]],
    )


def headline(report: Mapping[str, Any]) -> str:
    """The sentence over the page. Where a finding is a tie, it does not say that the physics is found."""
    tied = any(finding["tied_with"] for finding in report["findings"])
    return TIED if tied and report["verdict"] == "explained" else VERDICTS[report["verdict"]]


def _left_out(report: Mapping[str, Any]) -> str:
    missing = report["not_judged"]
    return f", {len(missing)} not diagnosed" if missing else ""


def _shown(diagnosis: Diagnosis) -> list[JointDiagnosis]:
    found = [finding.joint for finding in diagnosis.findings] + [left.joint for left in diagnosis.remainder]
    shown = [joint for joint in diagnosis.joints if joint.joint in found or joint.search.accepted]
    return shown or list(diagnosis.joints[:1])


def _joint(joint: JointDiagnosis, picture: bytes, report: Mapping[str, Any]) -> dict[str, Any]:
    """What the template shows of a joint."""
    numbers = [
        (key, f"{number['value']:.4g}", f"{number['std']:.2g}", number["unit"], _remark(number, claimed=claimed))
        for parameters, claimed in _parameters(joint.joint, report)
        for key, number in parameters.items()
    ]
    hypotheses = []
    for hypothesis in joint.search.rounds[0] if joint.search.rounds else []:
        stage = hypothesis.stage
        errors = [f"{joint.rmse(fit, stage):.3g}" for fit in (joint.search.nominal, hypothesis.fit)]
        gain = hypothesis.log_evidence - joint.search.nominal_evidence
        fall = f"{errors[0]} → {errors[1]} {joint.wording.signal_units[stage][1]}"
        hypotheses.append((hypothesis.effect.name, f"{gain:+.0f}", fall))
    return {"name": joint.joint, "picture": picture, "numbers": numbers, "hypotheses": hypotheses}


def _laws(diagnosis: Diagnosis, joint: JointDiagnosis) -> list[tuple[str, bytes]]:
    """The laws of a joint's findings: each in words, and its figure."""
    return [
        (finding.law.statement, png(law_figure(finding.effect, finding.law)))
        for finding in diagnosis.findings
        if finding.law is not None and finding.joint == joint.joint
    ]


def _parameters(joint: str, report: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], bool]]:
    """Parameters of the joint's findings, and those of effects that are not claimed."""
    found = [(finding["parameters"], True) for finding in report["findings"] if finding["joint"] == joint]
    left = [entry for entry in report["remainder"] if entry["joint"] == joint]
    return found + [(each["parameters"], False) for entry in left for each in entry["candidates"]]


def _remark(number: Mapping[str, Any], *, claimed: bool) -> str:
    if not claimed:
        return "explains a part, not claimed"
    if number["at_bound"]:
        return "at the limit of its allowed range"
    return "" if number["determined"] else "not determined by these data"


def _fit(report: Mapping[str, Any]) -> Rows:
    return [
        [
            row["joint"],
            row["signal"],
            SPLITS[row["split"]],
            f"{row['rmse_before']:.4g}",
            f"{row['rmse_after']:.4g}",
            f"{row['noise_floor']:.3g}",
            row["unit"],
        ]
        for row in report["fit"]
    ]


def _changes(report: Mapping[str, Any]) -> Rows:
    rows = []
    for row in report["parameter_changes"]:
        change = "" if row["relative_change"] is None else f"{row['relative_change']:+.1%}"
        values = [f"{row['nominal']:.4g}", f"{row['value']:.4g}", row["unit"]]
        rows.append([row["joint"], row["parameter"], *values, change])
    return rows


def _located(report: Mapping[str, Any]) -> Rows:
    return [
        [
            row["joint"],
            row["signal"],
            f"{row['state']}: {row['part']}",
            f"{row['rms']:.3g}",
            f"{row['noise']:.3g}",
            row["unit"],
            f"{row['sigma']:.1f}",
            "missed" if row["missed"] else "as noise",
        ]
        for row in report["located"]
    ]


def _correlated(report: Mapping[str, Any]) -> Rows:
    """Pairs of parameters whose estimates depend on each other."""
    rows = []
    for row in report["correlations"]:
        names, matrix = row["parameters"], row["matrix"]
        for i, k in itertools.combinations(range(len(names)), 2):
            if abs(matrix[i][k]) > SETTINGS.strong_correlation:
                rows.append([row["joint"], names[i], names[k], f"{matrix[i][k]:+.2f}"])
    return rows


def _separable(row: Mapping[str, Any]) -> Rows:
    """How visible each effect is on a joint with findings, and which effects look like it."""
    rows = []
    for k, name in enumerate(row["effects"]):
        cosines = row["alike"][k]
        alike = [other for i, other in enumerate(row["effects"]) if i != k and cosines[i] > SETTINGS.alike_cosine]
        absorbed = f"{row['absorbed_by_nominal'][k]:.0%}"
        rows.append([name, f"{row['visible_sigma'][k]:.1f}", absorbed, ", ".join(alike)])
    return rows
