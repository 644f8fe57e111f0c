"""Two results side by side: two reports, two models of a hand, or two recordings; as sentences, tables and plots."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hand_diagnosis.pages.drawing import tint
from hand_diagnosis.pages.headline import effect_words, errors, multiple, title, unit_words
from hand_diagnosis.pages.page_plots import in_thousands, nth_shown
from hand_diagnosis.settings import SETTINGS
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.quantities import HAND
from hand_pages.page import write_html
from hand_pages.plots import Curve, Panel, Plot
from hand_pages.results import made_rows
from hand_recording.interpolation import in_force, interpolate
from hand_recording.signals import Signals

Kind = Literal["report", "model", "recording"]
SAME_RELATIVE = 1e-9
"""Relative difference below which two numbers of a model are equal."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a table. tint: opacity of its colour, 0 to 1 [-]."""

    text: str
    tint: float = 0.0


@dataclass(frozen=True, slots=True)
class Comparison:
    """title: the answer.  sentences: one for each side, and remarks.  head, rows: of the table.  plots: may be none.

    document: the same for programs.
    """

    title: str
    sentences: tuple[str, ...]
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    document: dict[str, Any]
    plots: tuple[Plot, ...] = ()


def kind_of(path: Path) -> Kind:
    """What a path holds, by its name: a report.json or its folder, a hand.yaml, else a recording."""
    if path.suffix == ".json" or (path / "report.json").is_file():
        return "report"
    return "model" if path.suffix in {".yaml", ".yml"} else "recording"


def load_report(path: Path) -> dict[str, Any]:
    """A report.json, or that of a folder. ValueError, one line, for another file."""
    file = path / "report.json" if path.is_dir() else path
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file} is not JSON: {error}") from None
    if not isinstance(content, dict) or content.get("schema") != 2 or "findings" not in content:
        raise ValueError(f"{file} is not a report of hand diagnose with schema 2")
    return content


def compare_reports(first: Mapping[str, Any], second: Mapping[str, Any]) -> Comparison:
    """Findings that only one has, and the errors of every joint and signal in both."""
    found = [{(each["joint"] or "hand", each["effect"]) for each in report["findings"]} for report in (first, second)]
    groups = {"Only in A": found[0] - found[1], "Only in B": found[1] - found[0], "In both": found[0] & found[1]}
    named = {
        where: [f"{effect_words(effect)} of {joint}" for joint, effect in sorted(group)]
        for where, group in groups.items()
    }
    parts = [f"{where}: {', '.join(names)}" for where, names in named.items() if names]
    known = [errors(report) for report in (first, second)]
    rows, numbers = [], []
    for key in sorted(set(known[0]) | set(known[1])):
        cells = [_error_cell(errors_of.get(key)) for errors_of in known]
        rows.append((Cell(key[0]), Cell(key[1]), *cells))
        numbers.append({"joint": key[0], "signal": key[1], "a": known[0].get(key), "b": known[1].get(key)})
    return Comparison(
        "; ".join(parts) or "Neither report has a finding",
        (f"A: {title(first)}", f"B: {title(second)}"),
        ("joint", "signal", "A: error before → after", "B: error before → after"),
        tuple(rows),
        {"kind": "report", "findings": named, "errors": numbers},
    )


def _error_cell(row: Mapping[str, Any] | None) -> Cell:
    if row is None:
        return Cell("-")
    text = f"{row['rmse_before']:.3g} → {row['rmse_after']:.3g} {row['unit']} (noise {row['noise_floor']:.2g})"
    return Cell(text, tint(multiple(row, "rmse_before")))


def compare_models(first: Hand, second: Hand) -> Comparison:
    """The numbers that differ, the largest relative difference first."""
    common = [joint for joint in first.joints if joint in second.joints]
    found = []
    for joint in common:
        columns = (first.parameters[:, first.joints.index(joint)], second.parameters[:, second.joints.index(joint)])
        for parameter, a, b in zip(JOINT_PARAMETERS, *columns, strict=False):
            if abs(a - b) > SAME_RELATIVE * max(abs(a), abs(b)):
                quantity = HAND.units.quantity(parameter.key)
                factor = quantity.factor / parameter.scale
                change = float((b - a) / a) if a else None
                found.append((joint, quantity.key, factor * float(a), factor * float(b), quantity.unit, change))
    found.sort(key=lambda row: -abs(row[-1]) if row[-1] is not None else -np.inf)
    rows = tuple(
        (Cell(joint), Cell(key), Cell(f"{a:.5g}"), Cell(f"{b:.5g}"), Cell(unit_words(unit)), Cell(_change(change)))
        for joint, key, a, b, unit, change in found
    )
    alone = sorted(set(first.joints) ^ set(second.joints))
    remarks = [f"In one model only: {', '.join(alone)}"] if alone else []
    names = list(dict.fromkeys(row[0] for row in found))
    where = names[0] if len(names) == 1 else f"{len(names)} joints"
    answer = f"1 number of {where} differs" if len(found) == 1 else f"{len(found)} numbers of {where} differ"
    if found:
        of = "" if len(names) == 1 else f" of {found[0][0]}"
        worst = f"{found[0][2]:.3g} → {found[0][3]:.3g} {unit_words(found[0][4])}".rstrip()
        answer += f", {'most ' if len(found) > 1 else ''}{found[0][1]}{of}: {worst}"
    fields = ("joint", "parameter", "a", "b", "unit", "relative_change")
    return Comparison(
        answer if found else "The models of the joints are equal",
        tuple(remarks),
        ("joint", "parameter", "A", "B", "unit", "change"),
        rows,
        {"kind": "model", "differences": [dict(zip(fields, row, strict=True)) for row in found], "alone": alone},
    )


def _change(change: float | None) -> str:
    return "new" if change is None else f"{change:+.1%}"


def compare_recordings(first: Signals, second: Signals) -> Comparison:
    """Pressure and angle of both over one axis of time, each from its own start, and their RMS difference.

    The joint whose angles differ most is the first. Raises ValueError, one line, for recordings without a joint or a
    stretch in common.
    """
    joints = [joint for joint in first.joints if joint in second.joints]
    count = min(first.samples, int((second.samples - 1) * second.period_s / first.period_s) + 1)
    if not joints:
        raise ValueError(f"{first.name} and {second.name} have no joint in common")
    nth = nth_shown(count * len(joints))
    pairs = sorted(
        (_pair(first, second, joint, count, nth) for joint in joints), key=lambda pair: -pair[0]["angle_rms"]
    )
    numbers = [pair[0] for pair in pairs]
    worst = numbers[0]
    remarks = [
        f"Compared over the {(count - 1) * first.period_s:.3g} s that both have, each from its own first sample."
    ]
    if not all(row["same_commands"] for row in numbers):
        remarks.append("Where the set-points differ, the motions do too, whatever the hand is.")
    rows = [
        (
            Cell(row["joint"]),
            Cell(f"{row['angle_rms']:.3g} {row['angle_unit']}"),
            Cell(f"{row['pressure_rms']:.3g} {row['pressure_unit']}"),
            Cell("equal" if row["same_commands"] else "different"),
        )
        for row in numbers
    ]
    return Comparison(
        f"{worst['joint']} differs most: {worst['angle_rms']:.3g} {worst['angle_unit']} RMS of the angle",
        tuple(remarks),
        ("joint", "angle, RMS difference", "pressure, RMS difference", "set-points"),
        tuple(rows),
        {"kind": "recording", "joints": numbers},
        tuple(pair[1] for pair in pairs),
    )


def _pair(first: Signals, second: Signals, joint: str, count: int, nth: int) -> tuple[dict[str, Any], Plot]:
    """The RMS differences of a joint over `count` samples of the first recording, and its plot of every nth one."""
    i, k, time_s = first.joints.index(joint), second.joints.index(joint), first.time_s[:count]

    def both(name: str, scale: float) -> list[Array]:
        """The signal of both recordings (count,), at the times of the first."""
        ours, theirs = getattr(first, name)[:count, i], getattr(second, name)[:, k]
        return [scale * ours, scale * interpolate(time_s, second.time_s, theirs, np.inf)]

    units = (HAND.signal_units[1], in_thousands(*HAND.signal_units[0]))
    shown = [both("angle_rad", units[0][0]), both("pressure_pa", units[1][0])]
    held = second.set_point_pa[in_force(time_s, second.time_s), k]
    pairs = (*shown, (first.set_point_pa[:count, i], held))
    angle, pressure, commanded = (float(np.sqrt(np.mean((a - b) ** 2))) for a, b in pairs)
    panels = []
    for (a, b), name, (_, unit), height in zip(shown, ("angle", "pressure"), units, (3.0, 2.0), strict=True):
        axis = (0.0, nth * first.period_s)
        curves = [Curve("A", "before", axis, a[::nth]), Curve("B", "after", axis, b[::nth])]
        panels.append(Panel(f"{joint}: {name} [{unit}]", curves, height))
    numbers = {
        "joint": joint,
        "angle_rms": angle,
        "angle_unit": units[0][1],
        "pressure_rms": pressure,
        "pressure_unit": units[1][1],
        "same_commands": commanded <= SETTINGS.same_commands_pa,
    }
    alt = f"{joint}: angles differ by {angle:.3g} {units[0][1]} RMS, pressures by {pressure:.3g} {units[1][1]}"
    return numbers, Plot("time [s]", panels, alt, f"{alt}.", group="time")


def write_comparison(
    comparison: Comparison, names: tuple[str, str], out: Path, made: Mapping[str, object] | None = None
) -> dict[str, Any]:
    """Write compare.json and compare.html into a folder, made where it is missing; the content of the first.

    names: what A and B are.  made: how, see hand_pages/results.
    """
    out.mkdir(parents=True, exist_ok=True)
    content = {"a": names[0], "b": names[1], "answer": comparison.title, **comparison.document}
    (out / "compare.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    values = {"comparison": comparison, "names": names, "made": made_rows(made or {})}
    write_html(out / "compare.html", "hand_diagnosis", "compare.html", **values)
    return content
