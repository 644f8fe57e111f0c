"""index.html of many diagnoses: a row per recording, filtered and sorted in the browser, and the trend over dates."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, get_args

import numpy as np

from hand_diagnosis.pages.headline import common_words, title, words_of, worst_by_joint
from hand_pages.page import write_html
from hand_pages.plots import Curve, Kind, Panel, Plot, script_json
from hand_pages.results import made_rows

KINDS: tuple[Kind, ...] = get_args(Kind)
UNUSABLE = "unusable"


def write_index(
    entries: Sequence[tuple[Path, Path]], errors: Mapping[str, str], out: Path, made: Mapping[str, object] | None = None
) -> None:
    """Write index.html into a folder that holds the folders of the reports.

    entries: of each recording its path and the folder of its report.  errors: by path, why it has none.  made: how, see
    hand_pages/results.
    """
    rows = [_row(recording, folder, errors.get(str(recording), "")) for recording, folder in entries]
    words = common_words(row["words"] for row in rows if row["words"])
    joints = sorted({joint for row in rows for joint in row["errors"]})
    found = sum(row["verdict"] not in {"agrees", UNUSABLE} for row in rows)
    bad = sum(row["verdict"] == UNUSABLE for row in rows)
    answer = f"{found} of {len(rows)} recordings differ from the model"
    above = _common_folder([recording for recording, _ in entries])
    table = [
        [
            str(Path(row["name"]).relative_to(above)) if above else row["name"],
            row["link"],
            row["verdict"],
            row["date"],
            row["answer"],
            [row["errors"].get(j) for j in joints],
        ]
        for row in rows
    ]
    write_html(
        out / "index.html",
        "hand_diagnosis",
        "fleet.html",
        title=f"{answer}; {bad} could not be used" if bad else answer,
        verdicts=sorted({row["verdict"] for row in rows}),
        joints=joints,
        axis=words.axis,
        content=script_json({"joints": joints, "rows": table}),
        trend=_trend(rows, joints),
        folder=str(above) if above else "",
        made=made_rows(made or {}),
    )


def _common_folder(recordings: Sequence[Path]) -> Path | None:
    """The folder that holds all recordings, which their names on the page leave out; None where there is none."""
    if any(path.is_absolute() != recordings[0].is_absolute() for path in recordings) or not recordings:
        return None
    folder = Path(os.path.commonpath([path.parent for path in recordings]))
    return folder if folder.parts else None


def _row(recording: Path, folder: Path, error: str) -> dict[str, Any]:
    """What the page shows of a recording. errors: by joint, the largest in multiples of the noise; None: unknown."""
    row: dict[str, Any] = {
        "name": str(recording),
        "link": "",
        "verdict": UNUSABLE,
        "date": "",
        "answer": error,
        "errors": {},
        "words": None,
    }
    if recording.exists():
        files = [file for file in recording.rglob("*") if file.is_file()] if recording.is_dir() else [recording]
        changed_s = max((file.stat().st_mtime for file in files), default=0.0)
        row["date"] = datetime.fromtimestamp(changed_s, UTC).strftime("%Y-%m-%d %H:%M:%S")
    report = folder / "report.json"
    if error or not report.is_file():
        return row
    content = json.loads(report.read_text(encoding="utf-8"))
    worst = {
        joint: None if ratio is None else float(f"{ratio:.3g}") for joint, ratio in worst_by_joint(content).items()
    }
    words = words_of(content)
    found = {"link": f"{folder.name}/report.html", "verdict": content["verdict"], "answer": title(content, *words)}
    found["words"] = words
    return row | found | {"errors": worst}


def _trend(rows: Sequence[Mapping[str, Any]], joints: Sequence[str]) -> Plot | None:
    """The error of the joints that are worst on average, over the dates; None for fewer than two dates."""
    dated = sorted((row for row in rows if row["date"] and row["errors"]), key=lambda row: str(row["date"]))
    if len({row["date"] for row in dated}) < 2:
        return None
    seconds = [datetime.strptime(f"{row['date']} +0000", "%Y-%m-%d %H:%M:%S %z").timestamp() for row in dated]
    days = (np.array(seconds) - seconds[0]) / 86400.0
    errors = {
        joint: np.array([np.nan if row["errors"].get(joint) is None else row["errors"][joint] for row in dated])
        for joint in joints
    }
    known = [joint for joint in joints if np.isfinite(errors[joint]).any()]
    worst = sorted(known, key=lambda joint: -float(np.nanmean(errors[joint])))[: len(KINDS)]
    if not worst:
        return None
    curves = [Curve(joint, kind, days, errors[joint]) for joint, kind in zip(worst, KINDS, strict=False)]
    ends = [errors[worst[0]][np.isfinite(errors[worst[0]])][k] for k in (0, -1)]
    alt = f"Error of {worst[0]} from {ends[0]:.3g} to {ends[1]:.3g} times the noise, from {dated[0]['date']} on"
    label = f"days since {dated[0]['date']}"
    panel = Panel("error of the nominal model, times the noise", curves, 4.0, zero=True)
    return Plot(label, [panel], alt, f"The joints with the largest mean error. {alt}.")
