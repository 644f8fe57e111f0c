"""report.html: the diagnosis for a reader who has two minutes, in one file; and the figures as PNGs."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hand_diagnosis import patch
from hand_diagnosis.detection import limit_table
from hand_diagnosis.diagnosis import Diagnosis, JointDiagnosis
from hand_diagnosis.pages.drawing import hand_drawing
from hand_diagnosis.pages.figures import joint_figure
from hand_diagnosis.pages.headline import (
    counted,
    effect_words,
    heat_map,
    in_words,
    likelihood,
    ties,
    tiles,
    title,
    worst_by_joint,
)
from hand_diagnosis.pages.page_plots import every_nth, law_plot, leading_stage, state_plot, time_plots
from hand_diagnosis.settings import SETTINGS
from hand_model.description import Hand
from hand_model.quantities import unit_words
from hand_pages.page import png, write_html
from hand_pages.plots import Plot
from hand_pages.results import made_rows

SPLITS = {"train": "training", "validation": "validation", "test": "test"}
Rows = list[list[str]]


def write_page(diagnosis: Diagnosis, report: Mapping[str, Any], out: Path, hand: Hand | None = None) -> None:
    """Write report.html, and a PNG of every joint with a finding (of the first joint where there is none).

    report: the content of report.json.  hand: the nominal hand, drawn where it has a geometry.
    """
    shown = _shown(diagnosis)
    nth = every_nth(shown)
    for joint in shown:
        (out / f"{joint.joint}.png").write_bytes(png(joint_figure(joint)))
    count, axis = len(diagnosis.joints), diagnosis.wording.axis
    write_html(
        out / "report.html",
        "hand_diagnosis",
        "report.html",
        report=report,
        title=title(report, diagnosis.wording.whole, axis),
        tiles=tiles(report, axis),
        ties=ties(report),
        heat=heat_map(report),
        drawing=_drawing(report, hand, [joint.joint for joint in shown]),
        words=effect_words,
        likelihood=likelihood,
        in_words=functools.partial(in_words, report=report),
        axis=axis,
        diagnosed=f"{counted(count, axis)} diagnosed",
        made=made_rows({**report.get("made", {}), "model": report["model"]}),
        patch=patch.shown(report, out),
        limits=limit_table(report.get("detection_limits", [])),
        joints=[_joint(diagnosis, joint, report, nth) for joint in shown],
        fit=_fit(report),
        changes=_changes(report),
        located=_located(report),
        correlated=_correlated(report),
        strong=f"{SETTINGS.strong_correlation:g}",
        separable=[(row["joint"], _separable(row)) for row in report["isolability"]],
    )


def _shown(diagnosis: Diagnosis) -> list[JointDiagnosis]:
    found = [finding.joint for finding in diagnosis.findings] + [left.joint for left in diagnosis.remainder]
    shown = [joint for joint in diagnosis.joints if joint.joint in found or joint.search.accepted]
    return shown or list(diagnosis.joints[:1])


def _drawing(report: Mapping[str, Any], hand: Hand | None, shown: Sequence[str]) -> str:
    """The hand as SVG; "" for another machine or a hand without geometry."""
    if hand is None or hand.geometry is None:
        return ""
    return hand_drawing(hand, worst_by_joint(report), {joint: f"#{joint}" for joint in shown})


def _joint(diagnosis: Diagnosis, joint: JointDiagnosis, report: Mapping[str, Any], nth: int) -> dict[str, Any]:
    """What the template shows of a joint."""
    numbers = [
        (
            key,
            f"{number['value']:.4g}",
            f"{number['std']:.2g}",
            unit_words(number["unit"]),
            _remark(number, claimed=claimed),
        )
        for parameters, claimed in _parameters(joint.joint, report)
        for key, number in parameters.items()
    ]
    hypotheses = []
    for hypothesis in joint.search.rounds[0] if joint.search.rounds else []:
        stage = hypothesis.stage
        errors = [f"{joint.rmse(fit, stage):.3g}" for fit in (joint.search.nominal, hypothesis.fit)]
        gain = hypothesis.log_evidence - joint.search.nominal_evidence
        fall = f"{errors[0]} → {errors[1]} {joint.wording.signal_units[stage][1]}"
        shown = f"{gain:+.0f}" if math.isfinite(gain) else "diverges"
        hypotheses.append((effect_words(hypothesis.effect.name), shown, fall))
    stage = leading_stage(joint)
    return {
        "name": joint.joint,
        "over_time": time_plots(joint, stage, nth),
        "over_state": [plot for plot in [state_plot(joint, stage), *_laws(diagnosis, joint)] if plot is not None],
        "numbers": numbers,
        "hypotheses": hypotheses,
    }


def _laws(diagnosis: Diagnosis, joint: JointDiagnosis) -> list[Plot]:
    """The laws of a joint's findings, and those without a name of what remains."""
    found = [(effect_words(finding.effect), finding.law, finding.joint) for finding in diagnosis.findings]
    found += [("what remains", left.law, left.joint) for left in diagnosis.remainder]
    here = [(name, law) for name, law, where in found if law is not None and where in {joint.joint, None}]
    plots = [(name, each) for name, law in here for each in (law, law.travel) if each is not None]
    return [law_plot(name, law) for name, law in plots]


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
