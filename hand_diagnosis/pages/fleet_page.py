"""index.html of many diagnoses: a row per recording, filtered and sorted in the browser, and the trend over dates."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, get_args

import numpy as np

from hand_diagnosis.pages.headline import Words, common_words, counted, title, words_of, worst_by_joint
from hand_pages.page import write_html
from hand_pages.plots import Curve, Kind, Panel, Plot, script_json
from hand_pages.results import made_rows

KINDS: tuple[Kind, ...] = get_args(Kind)
UNUSABLE = "unusable"


@dataclass(frozen=True, slots=True)
class Row:
    """What the page shows of a recording.

    link: folder of its report; "" for none.  answer: of the report, or why there is none.  date_s: of its first stamp
    since 1970 [s]; of_file: it is that of the file instead.  errors: by joint, the largest in multiples of the noise;
    None: not diagnosed.  words: None without a report.
    """

    name: str
    link: str = ""
    verdict: str = UNUSABLE
    answer: str = ""
    date_s: float | None = None
    of_file: bool = True
    errors: Mapping[str, float | None] = field(default_factory=dict)
    words: Words | None = None


def write_index(
    entries: Sequence[tuple[Path, Path]],
    errors: Mapping[str, str],
    out: Path,
    made: Mapping[str, object] | None = None,
    left: int = 0,
) -> None:
    """Write index.html into a folder that holds the folders of the reports.

    entries: of each recording its path and the folder of its report.  errors: by path, why it has none.  made: how, see
    hand_pages/results.  left: number of recordings that an interrupted run has not diagnosed.
    """
    above = _common_folder([recording for recording, _ in entries])
    rows = [_row(recording, folder, errors.get(str(recording), "")) for recording, folder in entries]
    if above:
        rows = [replace(row, name=str(Path(row.name).relative_to(above))) for row in rows]
    write_rows(rows, str(above) if above else "", out, made, left)


def write_rows(
    rows: Sequence[Row], folder: str, out: Path, made: Mapping[str, object] | None = None, left: int = 0
) -> None:
    """Write index.html into a folder.

    folder: that holds all recordings, "" where there is none.  made: how, see hand_pages/results.  left: as above.
    """
    words = common_words(row.words for row in rows if row.words)
    joints = sorted({joint for row in rows for joint in row.errors})
    found = sum(row.verdict not in {"agrees", UNUSABLE} for row in rows)
    bad = sum(row.verdict == UNUSABLE for row in rows)
    answers = [f"{found} of {len(rows)} recordings differ from the model"]
    answers += [f"{bad} could not be used"] if bad else []
    answers += [f"interrupted, {left} not diagnosed yet"] if left else []
    verdicts = sorted({row.verdict for row in rows})
    parts = {part: k for k, part in enumerate(dict.fromkeys(part for row in rows for part in row.answer.split("; ")))}
    table = [
        [
            row.name,
            row.link,
            verdicts.index(row.verdict),
            None if row.date_s is None else round(row.date_s),
            [parts[part] for part in row.answer.split("; ")],
            [row.errors.get(joint) for joint in joints],
            int(row.of_file),
        ]
        for row in rows
    ]
    write_html(
        out / "index.html",
        "hand_diagnosis",
        "fleet.html",
        title="; ".join(answers),
        verdicts=verdicts,
        joints=joints,
        axis=words.axis,
        content=script_json({"joints": joints, "verdicts": verdicts, "parts": list(parts), "rows": table}),
        of_file=sum(row.of_file and row.date_s is not None for row in rows),
        trend=_trend(rows, joints),
        folder=folder,
        made=made_rows(made or {}),
    )


def _common_folder(recordings: Sequence[Path]) -> Path | None:
    """The folder that holds all recordings, which their names on the page leave out; None where there is none."""
    if any(path.is_absolute() != recordings[0].is_absolute() for path in recordings) or not recordings:
        return None
    folder = Path(os.path.commonpath([path.parent for path in recordings]))
    return folder if folder.parts else None


def _row(recording: Path, folder: Path, error: str) -> Row:
    """A recording with its report. error: why it has none."""
    row = Row(str(recording), answer=error, date_s=_changed_s(recording))
    report = folder / "report.json"
    if error or not report.is_file():
        return row
    content = json.loads(report.read_text(encoding="utf-8"))
    words = words_of(content)
    recorded = next((date for date in content.get("recorded", []) if date), None)
    return replace(
        row,
        link=folder.name,
        verdict=content["verdict"],
        answer=title(content, *words),
        date_s=datetime.fromisoformat(recorded).timestamp() if recorded else row.date_s,
        of_file=recorded is None,
        errors={joint: None if r is None else float(f"{r:.3g}") for joint, r in worst_by_joint(content).items()},
        words=words,
    )


def _changed_s(recording: Path) -> float | None:
    """When a recording's file, or the last one in its folder, was changed [s]; None where there is no file."""
    files = [file for file in recording.rglob("*") if file.is_file()] if recording.is_dir() else [recording]
    return max((file.stat().st_mtime for file in files if file.exists()), default=None)


def _trend(rows: Sequence[Row], joints: Sequence[str]) -> Plot | None:
    """The error of the joints that are worst on average, over the dates; None for fewer than two dates."""
    dated = sorted((row for row in rows if row.date_s is not None and row.errors), key=lambda row: row.date_s or 0.0)
    if len({row.date_s for row in dated}) < 2:
        return None
    seconds: Any = np.array([row.date_s for row in dated], dtype=np.float64)
    days = (seconds - seconds[0]) / 86400.0
    known = {joint: np.array([row.errors.get(joint) for row in dated], dtype=np.float64) for joint in joints}
    errors = {joint: values for joint, values in known.items() if np.isfinite(values).any()}
    worst = sorted(errors, key=lambda joint: -float(np.nanmean(errors[joint])))[: len(KINDS)]
    if not worst:
        return None
    curves = [Curve(joint, kind, days, errors[joint]) for joint, kind in zip(worst, KINDS, strict=False)]
    ends = [errors[worst[0]][np.isfinite(errors[worst[0]])][k] for k in (0, -1)]
    begin = f"{datetime.fromtimestamp(seconds[0], UTC):%Y-%m-%d %H:%M:%S}"
    alt = f"Error of {worst[0]} from {ends[0]:.3g} to {ends[1]:.3g} times the noise, from {begin} on"
    panel = Panel("error of the nominal model, times the noise", curves, 4.0, zero=True)
    caption = f"The joints with the largest mean error. {alt}."
    files = sum(row.of_file for row in dated)
    if files:
        caption += f" The dates of {counted(files, 'recording')} are those of the files."
    return Plot(label=f"days since {begin}", panels=[panel], alt=alt, caption=caption)
