"""The demo's page: what the hand did, how well it followed, how busy the machine was, and the concealed effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hand_diagnosis.pages.headline import effect_words
from hand_model.arrays import Array
from hand_pages.page import write_html
from hand_pages.plots import Curve, Panel, Plot
from hand_pages.results import made_rows
from hand_recording.loader import Recording
from hand_recording.replay import Replay
from hand_tool.demo_diagnosis import Outcome
from hand_tool.demo_summary import JointSummary, Summary
from hand_tool.replay_difference import replayed_angle_rad

BEFORE_S = 1.0
"""Time at rest shown before the first motion."""
STIRRED_DEG = 1.0
"""Change of a reference by which the motion begins."""
PRESSED_N = 0.1
"""Force above which the object has pressed a sensor."""
SAMPLES = 1200
"""Samples of a curve on the page; the recording has all of them."""
NAMED = 3
"""Joints that the headline names."""
MISSED_MUCH = 0.01
"""Share of missed periods above which the page says what it means."""


def write_page(
    path: Path, recording: Recording, result: Replay, summary: Summary, outcome: Outcome, made: Mapping[str, object]
) -> None:
    """Write the page as one file. made: how, see hand_pages/results."""
    joints = sorted(summary.joints, key=lambda name: -_badness(summary.joints[name]))
    plots = dict(zip(joints, _joint_plots(recording, result, joints), strict=True))
    write_plots(path, plots, _forces(recording), summary, outcome, made)


def write_plots(
    path: Path,
    plots: Mapping[str, Plot],
    forces: Plot | None,
    summary: Summary,
    outcome: Outcome,
    made: Mapping[str, object],
) -> None:
    """Write the page from its plots: of each joint, the largest error first, and of the forces; None without any."""
    values = {
        "headline": _headline(summary),
        "remark": _remark(summary),
        "summary": summary,
        "plots": plots,
        "forces": forces,
        "outcome": outcome,
        "found": effect_words(outcome.found[0]["effect"]) if outcome.found else "nothing that has a name",
        "made": made_rows(made),
    }
    write_html(path, "hand_tool", "demo_page.html", **values)


def _badness(joint: JointSummary) -> float:
    return joint.tracking_rms_deg if np.isfinite(joint.tracking_rms_deg) else np.inf


def _headline(summary: Summary) -> str:
    count, missing = len(summary.joints), summary.not_followed
    if not missing:
        worst = max(joint.tracking_rms_deg for joint in summary.joints.values())
        return f"{count} joints followed three grasps, each within {worst:.2f}° RMS of its reference"
    more = f" and {len(missing) - NAMED} more" if len(missing) > NAMED else ""
    return f"{len(missing)} of {count} joints did not follow: {', '.join(missing[:NAMED])}{more}"


def _remark(summary: Summary) -> str:
    """What missed periods and the load of the machine mean for the result; "" where there is nothing to say."""
    missed, load = summary.loop.missed_fraction, summary.load
    parts = []
    if missed > MISSED_MUCH:
        parts.append(
            f"In {100 * missed:.1f} % of the periods no command answered in time, and the board went on with the last"
            " one; after 0.1 s without a command it vents the hand."
        )
    if load is not None and load.disturbs:
        parts.append(
            f"Other programs used {100 * load.others:.0f} % of the {load.cores} cores meanwhile: rate, latency and"
            " tracking say more about them than about the hand. Run the demo again when they have ended."
        )
    elif parts and load is not None:
        parts.append(f"The processor was {100 * (load.own + load.others):.0f} % busy on average.")
    return " ".join(parts)


def _start_s(time_s: Array, reference_rad: Array) -> float:
    """When the first reference moves, less a rest; the first sample where none does."""
    known = np.where(np.isfinite(reference_rad), reference_rad, 0.0)
    begun = np.flatnonzero(np.any(np.abs(known - known[0]) > np.radians(STIRRED_DEG), axis=1))
    return float(max(time_s[begun[0]] - BEFORE_S, time_s[0])) if len(begun) else float(time_s[0])


def _joint_plots(recording: Recording, result: Replay, joints: Sequence[str]) -> list[Plot]:
    """For each joint its angles, their errors, and its pressures, over one axis of time."""
    base = recording.on_time_base(joints=joints)
    start_s = _start_s(base.time_s, base.reference)
    shown = np.flatnonzero(base.time_s >= start_s)
    shown = shown[:: max(1, -(-len(shown) // SAMPLES))]
    time_s = base.time_s[shown] - start_s
    replay_s = (result.stamp_ns - base.time_ns[0]) * 1e-9
    columns = [result.hand.joints.index(joint) for joint in joints]
    replayed_deg = np.degrees(replayed_angle_rad(result)[:, columns])
    plots = []
    for k, joint in enumerate(joints):
        reference, measured = (np.degrees(each[shown, k]) for each in (base.reference, base.position))
        replayed = np.interp(base.time_s[shown], replay_s, replayed_deg[:, k])
        angle = [
            Curve("reference", "quiet", time_s, reference),
            Curve("measured", "measured", time_s, measured),
            Curve("offline replay", "after", time_s, replayed),
        ]
        error = [
            Curve("reference - measured", "before", time_s, reference - measured),
            Curve("measured - replay", "after", time_s, measured - replayed, dots=True),
        ]
        pressure = [
            Curve("reference", "quiet", time_s, base.valve_command[shown, k] * 1e-3),
            Curve("measured", "measured", time_s, base.pressure[shown, k] * 1e-3),
        ]
        panels = [Panel("angle [deg]", angle, 3.0), Panel("error [deg]", error, 2.0, zero=True)]
        panels.append(Panel("pressure, set-point and measured [kPa]", pressure, 2.0))
        rms = float(np.sqrt(np.nanmean((reference - measured) ** 2)))
        alt = f"{joint}: the measured angle follows its reference within {rms:.2f} degrees RMS while the hand moves"
        plots.append(Plot(label="time [s]", panels=panels, alt=alt, caption=f"{alt}.", group="time"))
    return plots


def _forces(recording: Recording) -> Plot | None:
    """The forces on the sensors that the object pressed; None where it pressed none."""
    base = recording.on_time_base()
    start_s = _start_s(base.time_s, base.reference)
    shown = np.flatnonzero(base.time_s >= start_s)
    shown = shown[:: max(1, -(-len(shown) // SAMPLES))]
    most = np.nan_to_num(base.force[shown]).max(axis=0)
    pressed = [k for k in np.argsort(-most) if most[k] > PRESSED_N]
    if not pressed:
        return None
    time_s = base.time_s[shown] - start_s
    panels = [
        Panel(f"{base.sites[k]} [N]", [Curve("force", "measured", time_s, base.force[shown, k])], 1.3, zero=True)
        for k in pressed
    ]
    alt = f"The object pressed {len(pressed)} of {len(base.sites)} sensors, most of all {base.sites[pressed[0]]}"
    return Plot(label="time [s]", panels=panels, alt=alt, caption=f"{alt} with {most[pressed[0]]:.2g} N.", group="time")
