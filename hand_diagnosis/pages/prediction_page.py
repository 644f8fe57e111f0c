"""prediction.html: how well a model predicts recordings, in one file with plots."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.pages.headline import by_reason, short
from hand_diagnosis.pages.page_plots import NOISE_BAND, nth_shown
from hand_diagnosis.prediction import JointPrediction, Prediction, Score
from hand_diagnosis.settings import SETTINGS
from hand_model.quantities import Wording
from hand_pages.page import write_html
from hand_pages.plots import Curve, Panel, Plot
from hand_pages.results import made_rows


def write_page(
    prediction: Prediction, content: Mapping[str, Any], out: Path, made: Mapping[str, object] | None = None
) -> None:
    """Write prediction.html. content: that of prediction.json.  made: how, see hand_pages/results."""
    shown = [joint for joint in prediction.joints if joint.scores]
    total = sum(len(segment.angle_rad) for joint in shown for segment in joint.segments)
    nth = nth_shown(total)
    write_html(
        out / "prediction.html",
        "hand_diagnosis",
        "prediction.html",
        content=content,
        model=Path(content["model"]).name,
        headline=headline(content),
        axis=prediction.wording.axis,
        joints=[(joint.joint, prediction_plots(joint, prediction.wording, nth)) for joint in shown],
        rows=[_cells(row) for row in content["scores"]],
        missing=[f"{reason}: {', '.join(names)}" for reason, names in by_reason(content["not_judged"])],
        made=made_rows({**(made or {}), "model": content["model"]}),
    )


def headline(content: Mapping[str, Any]) -> str:
    """The result in one sentence: the largest error in multiples of the noise."""
    rows = [row for row in content["scores"] if row["noise_floors"] is not None]
    if not rows:
        return "No signal could be predicted"
    worst = max(rows, key=lambda row: row["noise_floors"])
    most = short(worst["noise_floors"])
    if worst["noise_floors"] <= SETTINGS.page_noise:
        return f"The model predicts every signal to within {most} times the noise"
    error = f"{worst['rmse']:.3g} {worst['unit']} RMS, {most} times the noise"
    where = f" in {worst['recording']}" if len(content["recordings"]) > 1 else ""
    return f"The model misses the {worst['signal']} of {worst['joint']} by {error}{where}"


def _cells(row: Mapping[str, Any]) -> list[str]:
    floors, explained = row["noise_floors"], row["explained"]
    return [
        row["recording"],
        row["joint"],
        row["signal"],
        f"{row['rmse']:.4g}",
        f"{row['noise_floor']:.3g}",
        row["unit"],
        "" if floors is None else short(floors),
        "" if explained is None else f"{explained:.2%}",
    ]


def prediction_plots(joint: JointPrediction, wording: Wording, nth: int) -> list[Plot]:
    """Of each recording, the signal with the largest error against its noise, measured and predicted.

    nth: distance of the samples to show [-].
    """
    stage = max(joint.scores, key=_floors).stage
    scale, unit = wording.signal_units[stage]
    signal = wording.signals[stage]
    plots = []
    for k, (segment, values) in enumerate(zip(joint.segments, joint.predicted, strict=True)):
        own = [score for score in joint.scores if (score.recording, score.stage) == (segment.name, stage)]
        if not own:
            continue
        axis = (0.0, nth * segment.period_s)
        measured, model = (
            np.where(segment.use[stage], scale * each[stage], np.nan)[::nth] for each in (segment.measured, values)
        )
        panels = [
            Panel(
                f"{signal} [{unit}]",
                [Curve("measured", "measured", axis, measured), Curve("predicted", "after", axis, model)],
                height=4.0,
            ),
            Panel(
                f"measured - model [{unit}]",
                [Curve("predicted", "after", axis, measured - model)],
                height=2.6,
                noise=NOISE_BAND * scale * own[0].noise,
            ),
        ]
        alt = f"{signal} of {joint.joint} over time: error {scale * own[0].rmse:.3g} {unit}"
        alt += f", noise floor {scale * own[0].noise:.3g} {unit}"
        caption = f"{segment.name}. Band: ±2 standard deviations of the noise."
        caption += f" Every {nth}th sample is shown." if nth > 1 else ""
        plots.append(Plot(label="time [s]", panels=panels, alt=alt, caption=caption, group=f"time {k}"))
    return plots


def _floors(score: Score) -> float:
    return score.rmse / max(score.noise, 1e-300)
