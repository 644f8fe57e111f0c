"""The demo's page: one self-contained HTML file, its pictures next to it as PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from hand_pages.page import png, write_html
from hand_recording.loader import Recording
from hand_recording.replay import Replay
from hand_tool.demo_diagnosis import Outcome
from hand_tool.demo_summary import Summary
from hand_tool.replay_difference import replayed_angle_rad

COLUMNS = 3
REFERENCE, MEASURED, REPLAYED = "#b0b0b0", "#0b5394", "#cc4125"
mpl.use("Agg")


def write_page(path: Path, recording: Recording, result: Replay, summary: Summary, outcome: Outcome) -> None:
    """Write the page, and angles.png, pressures.png and forces.png next to it."""
    figures = {
        "angles": _angles(recording, result),
        "pressures": _pressures(recording, result),
        "forces": _forces(recording),
    }
    pictures = {name: png(figure) for name, figure in figures.items()}
    for name, picture in pictures.items():
        path.with_name(f"{name}.png").write_bytes(picture)
    values = {
        "headline": _headline(summary),
        "loop": summary.loop,
        "joints": summary.joints,
        "pictures": pictures,
        "outcome": outcome,
    }
    write_html(path, "hand_tool", "demo_page.html", **values)


def _headline(summary: Summary) -> str:
    if summary.not_followed:
        return f"These joints did not follow: {', '.join(summary.not_followed)}"
    worst = max(joint.tracking_rms_deg for joint in summary.joints.values())
    return f"{len(summary.joints)} joints followed three grasps, each within {worst:.2f}° RMS of its reference"


def _grid(titles: Sequence[str], unit: str) -> tuple[Figure, list[mpl.axes.Axes]]:
    rows = -(-len(titles) // COLUMNS)
    figure = Figure(figsize=(12.0, 1.9 * rows + 0.6), layout="constrained")
    axes = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axis, title in zip(axes, titles, strict=False):
        axis.set_title(title, fontsize=10, loc="left")
        axis.grid(True, linewidth=0.4, color="#dddddd")
        axis.tick_params(labelsize=8)
    for axis in axes[len(titles) :]:
        axis.set_axis_off()
    figure.supxlabel("time [s]", fontsize=10)
    figure.supylabel(unit, fontsize=10)
    return figure, list(axes)


def _legend(figure: Figure, axis: mpl.axes.Axes) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), fontsize=9, frameon=False)


def _angles(recording: Recording, result: Replay) -> Figure:
    base = recording.on_time_base(joints=result.hand.joints)
    seconds = base.time_s
    replay_s = (result.stamp_ns - base.time_ns[0]) * 1e-9
    replayed = np.degrees(replayed_angle_rad(result))
    figure, axes = _grid(result.hand.joints, "angle [°]")
    for i, axis in zip(range(len(result.hand.joints)), axes, strict=False):
        axis.plot(seconds, np.degrees(base.reference[:, i]), color=REFERENCE, linewidth=2.5, label="reference")
        axis.plot(seconds, np.degrees(base.position[:, i]), color=MEASURED, linewidth=1.0, label="measured")
        axis.plot(replay_s, replayed[:, i], color=REPLAYED, linewidth=1.0, linestyle="--", label="offline replay")
    _legend(figure, axes[0])
    return figure


def _pressures(recording: Recording, result: Replay) -> Figure:
    base = recording.on_time_base(joints=result.hand.joints)
    figure, axes = _grid(result.hand.joints, "pressure [kPa]")
    for i, axis in zip(range(len(result.hand.joints)), axes, strict=False):
        axis.plot(base.time_s, base.valve_command[:, i] * 1e-3, color=REFERENCE, linewidth=2.5, label="valve command")
        axis.plot(base.time_s, base.pressure[:, i] * 1e-3, color=MEASURED, linewidth=1.0, label="measured")
    _legend(figure, axes[0])
    return figure


def _forces(recording: Recording) -> Figure:
    base = recording.on_time_base()
    figure, axes = _grid(base.sites, "force [N]")
    for i, axis in zip(range(len(base.sites)), axes, strict=False):
        axis.plot(base.time_s, base.force[:, i], color=MEASURED, linewidth=1.0)
    return figure
