"""A small page of every kind that the tool writes, from stored results and drawn numbers; seconds in all."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, get_args

import numpy as np
from matplotlib.figure import Figure

from hand_diagnosis.pages.compare import compare_reports, write_comparison
from hand_diagnosis.pages.compare_recordings import compare_recordings
from hand_diagnosis.pages.drawing import hand_drawing
from hand_diagnosis.pages.fleet_page import write_index
from hand_diagnosis.pages.headline import (
    effect_words,
    heat_map,
    in_words,
    likelihood,
    ties,
    tiles,
    title,
    worst_by_joint,
)
from hand_diagnosis.report import write_json
from hand_model.description import load_hand
from hand_pages.page import png, write_html
from hand_pages.plots import Curve, Kind, Panel, Plot
from hand_pages.results import made_rows
from hand_recording.installed import default_model
from hand_recording.signals import Signals
from hand_tool.demo_diagnosis import Outcome
from hand_tool.demo_page import write_plots
from hand_tool.demo_summary import JointSummary, LoopSummary, Summary
from hand_tool.machine_load import Load
from test.validation.result_documents import faults, scores
from validation import trial_page
from validation.faults import results_page as faults_page
from validation.machines import page as machines_page
from validation.paper import page as paper_page
from validation.paper.result import Quantity, Reproduction
from validation.results import load

MADE: dict[str, Any] = {
    "date": "2026-01-02T03:04:05+00:00",
    "version": "0.2.0",
    "command": "hand something with_a_very_long_name_of_a_file_that_goes_on_and_on_without_any_space.mcap --out out",
    "seed": 4,
    "duration_s": 12.5,
    "model": "/a/folder/with/a/long/name/that/does/not/fit/a/telephone/at/all/hand.yaml",
    "model_sha256": 64 * "a",
}
JOINTS = ("index_proximal", "index_distal")


def plot() -> Plot:
    """A plot with every kind of curve, noise, spans and a switch."""
    axis, values = (0.0, 0.01), np.sin(np.arange(400.0) / 30.0)
    curves = [Curve(kind, kind, axis, (1.0 + 0.1 * k) * values) for k, kind in enumerate(get_args(Kind))]
    below = Curve("after", "after", axis, 0.1 * values, variants=[0.2 * values])
    panels = [Panel("angle [deg]", curves), Panel("measured - model [deg]", [below], noise=0.05)]
    spans = [(0.5, 1.0, "validation"), (3.0, 4.0, "test")]
    return Plot(
        label="time [s]",
        panels=panels,
        alt="The angle is a sine",
        caption="A caption.",
        spans=spans,
        group="time",
        switches=["friction"],
        notes=["with", "off"],
    )


def report() -> dict[str, Any]:
    """A report with a tie, a remainder, a clear finding and joints that were not diagnosed."""
    number = {"value": 0.0119, "std": 3e-4, "unit": "N m", "determined": True, "at_bound": False}
    finding = {
        "joint": "index_distal",
        "effect": "coulomb_friction",
        "probability": 0.96,
        "alternatives": [],
        "tied_with": [],
        "tie": None,
        "explains": 0.98,
        "where": {"signal": "angle"},
        "parameters": {"coulomb_friction.torque_nm": number},
        "statement": "index_distal: a friction of 0.0119 ± 0.0003 N m opposes every motion.",
    }
    command = "hand excite slow_triangle --joints index_proximal --live --out slow_triangle.mcap"
    tie = {"name": "slow_triangle", "why": "separates leak from pressure_gain on index_proximal", "command": command}
    tied = finding | {"joint": "index_proximal", "effect": "leak", "probability": 0.55, "tie": tie}
    tied |= {"alternatives": [{"effect": "pressure_gain", "probability": 0.4}], "tied_with": ["pressure_gain"]}
    remainder = {"joint": "index_distal", "signal": "angle", "rms": 0.83, "unit": "deg", "statement": "A part remains."}
    errors = {"rmse_before": 2.8, "rmse_after": 0.03, "noise_floor": 0.01, "unit": "deg", "split": "test"}
    fit = [{"joint": joint, "signal": signal} | errors for joint in JOINTS for signal in ("pressure", "angle", "force")]
    return {
        "recordings": [MADE["command"]],
        "model": MADE["model"],
        "verdict": "partly_explained",
        "findings": [finding, tied],
        "remainder": [remainder],
        "fit": fit,
        "not_judged": [{"joint": "thumb_distal", "reason": "it moves by less than 3 degrees"}],
        "not_claimable": [],
        "data_check": ["a gap of 0.1 s is bridged"],
        "settings": {"page_samples": 1000},
        "next_experiment": tie,
    }


def diagnosis(path: Path) -> None:
    """The page of a diagnosis."""
    content = report()
    rows = [["index_distal", "coulomb_friction.torque_nm", "0.0119", "0.0003", "N m", ""]]
    drawing = hand_drawing(load_hand(default_model()), worst_by_joint(content), {"index_distal": "#index_distal"})
    joint = {"name": "index_distal", "over_time": [plot(), plot()], "over_state": [plot(), plot()]}
    lines = ("--- hand.yaml", "+++ hand.yaml", "@@ -1 +1 @@", "-    friction: {torque_nm: 0.0}", "+    friction: {}")
    write_html(
        path,
        "hand_diagnosis",
        "report.html",
        report=content,
        title=title(content),
        tiles=tiles(content),
        ties=ties(content),
        heat=heat_map(content),
        drawing=drawing,
        words=effect_words,
        likelihood=likelihood,
        in_words=functools.partial(in_words, report=content),
        axis="joint",
        diagnosed="2 joints diagnosed",
        made=made_rows(MADE),
        patch={
            "diff": "\n".join([*lines, " the same"]),
            "command": "hand patch config/hand.yaml out/diagnosis/patch.yaml --write",
        },
        limits=(list(JOINTS), [["backlash", "gap_deg", "deg", "0.3", "not shown"]]),
        joints=[joint | {"numbers": [row[1:] for row in rows], "hypotheses": [("leak", "+900", "2.8 → 0.03 deg")]}],
        fit=[[*row, "deg"] for row in rows],
        changes=rows,
        located=[[*rows[0], "12", "missed"]],
        correlated=[row[:4] for row in rows],
        strong="0.9",
        separable=[("index_distal", [["backlash", "9.1", "12%", "leak"]])],
    )


def demo(path: Path) -> None:
    """The page of the demo, on a busy machine."""
    joints = {name: JointSummary(0.4, 0.01, 60.0) for name in JOINTS}
    summary = Summary(joints, LoopSummary(199.8, 0.03, 1.2, 4.5), Load(2, 0.3, 0.5))
    found = [{"effect": "tube_lag", "joint": "index_distal", "probability": 0.97}]
    errors = [{"signal": "pressure", "rmse_before": 1.0, "rmse_after": 0.1, "noise_floor": 0.1, "unit": "kPa"}]
    key = "tube_lag.time_constant_s"
    outcome = Outcome(
        seed=5,
        joint="index_distal",
        effect="tube_lag",
        key=key,
        value=0.05,
        verdict="explained",
        found=found,
        right=True,
        errors=errors,
        seconds=11.0,
    )
    write_plots(path, dict.fromkeys(JOINTS, plot()), plot(), summary, outcome, MADE)


def compare(path: Path) -> None:
    """Two recordings side by side."""
    shape, yes = (300, 2), np.ones(2, dtype=bool)
    rng = np.random.default_rng(1)
    print("seed 1")
    known = np.ones(shape, dtype=bool)

    def recording(name: str) -> Signals:
        drawn = rng.standard_normal((4, *shape))
        return Signals(
            name=name,
            joints=JOINTS,
            period_s=0.01,
            set_point_pa=drawn[0],
            pressure_pa=drawn[1],
            angle_rad=drawn[2],
            force_n=drawn[3],
            known=known,
            has_set_point=yes,
            has_pressure=yes,
        )

    first, second = recording("a"), recording("b")
    write_comparison(compare_recordings(first, second), (str(MADE["command"]), "b.mcap"), path.parent, MADE)


def compare_two_reports(path: Path) -> None:
    """Two reports side by side, the second without one of the errors."""
    first = report()
    second = {**first, "fit": first["fit"][1:]}
    write_comparison(compare_reports(first, second), (str(MADE["command"]), "after"), path.parent, MADE)


def fleet(path: Path) -> None:
    """The table of two recordings, one of which could not be used."""
    folder = path.parent
    write_json(report(), folder / "one")
    recordings = [folder / "one.mcap", folder / "another_recording_with_a_long_name_without_any_space.mcap"]
    for recording in recordings:
        recording.write_bytes(b"x")
    entries = [(recordings[0], folder / "one"), (recordings[1], folder / "none")]
    write_index(entries, {str(recordings[1]): "it is empty"}, folder, MADE)


def predict(path: Path) -> None:
    """The page of a prediction."""
    content = {"recordings": [MADE["command"]], "data_check": ["nothing"]}
    row = ["run.mcap", "index_distal", "angle", "0.03", "0.01", "deg", "3", "99.9%"]
    values: dict[str, Any] = {
        "headline": "The model predicts every signal to within 3 times the noise",
        "model": "hand.yaml",
    }
    values |= {"content": content, "axis": "joint", "joints": [("index_distal", [plot()])], "rows": [row]}
    write_html(path, "hand_diagnosis", "prediction.html", **values, missing=["thumb: rests"], made=[("date", "now")])


def picture() -> bytes:
    """A figure on white."""
    figure = Figure(figsize=(4.0, 2.0))
    figure.add_subplot().plot([0.0, 1.0], [0.0, 1.0])
    return png(figure, 60)


def reproduce(path: Path) -> None:
    """The page of the paper, with a figure as a picture and one as a plot."""
    quantity = Quantity(
        "fig13_rms", "RMS of the force", "N", 0.1, 0.11, "a note that is longer than its column is wide"
    )
    parts = ("a hysteresis", "`0.11 N`", "", Figure(), (quantity,))
    results = [Reproduction("fig13", "Fig. 13", *parts), Reproduction("fig14", "Fig. 14", *parts, (plot(),))]
    paper_page.write_page([(result, picture()) for result in results], path, MADE)


def trial(path: Path) -> None:
    """Scores of a trial."""
    (path.parent / "confusion.png").write_bytes(picture())
    trial_page.write_page(path.parent, scores())


def fault(path: Path) -> None:
    """Injected faults."""
    faults_page.write_page(path, faults())


def machines(path: Path) -> None:
    """Machines of other people."""
    machines_page.write_page(path, {**MADE, **load()["machines"]["results"], "failed": []})


PAGES = {
    "diagnosis": (diagnosis, "report.html"),
    "demo": (demo, "index.html"),
    "compare": (compare, "compare.html"),
    "compare reports": (compare_two_reports, "compare.html"),
    "fleet": (fleet, "index.html"),
    "predict": (predict, "prediction.html"),
    "reproduce": (reproduce, "index.html"),
    "scores": (trial, "scores.html"),
    "faults": (fault, "faults.html"),
    "machines": (machines, "machines.html"),
}
"""What writes a page, and its name."""


def write(kind: str, folder: Path) -> Path:
    """Write the page of a kind into a folder; its path."""
    function, name = PAGES[kind]
    function(folder / name)
    return folder / name
