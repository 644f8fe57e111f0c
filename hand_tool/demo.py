"""`hand demo`: the whole stack on a simulated hand, recorded, replayed offline and shown on one page."""

from __future__ import annotations

import json
import os
import secrets
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hand_recording.installed import default_model
from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import fail, progress_bar, running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.origin import Origin
from hand_tool.paths import check_folder
from hand_tool.processes import ProcessError, Processes

if TYPE_CHECKING:
    from rich.progress import Progress

    from hand_control.grasps import Grasp
    from hand_model.description import Hand
    from hand_tool.demo_diagnosis import Outcome
    from hand_tool.demo_summary import Summary
    from hand_tool.machine_load import Load

PATTERNS = ("cylindrical", "tripod", "lateral")
CLOSE_S, HOLD_S, OPEN_S, REST_S = 2.0, 2.2, 1.6, 0.8
CONTACT_SHARE = 0.85
"""The soft object is met at this share of the closing angle of the cylindrical grasp."""
CONTACT_STIFFNESS_NM_PER_RAD = 0.3


@dataclass(frozen=True, slots=True)
class Files:
    """The files that the demo writes into its folder."""

    folder: Path

    @property
    def model(self) -> Path:
        """The description with the object in the hand."""
        return self.folder / "hand.yaml"

    @property
    def recording(self) -> Path:
        """Every message on the topics of the hand."""
        return self.folder / "recording.mcap"

    @property
    def replay(self) -> Path:
        """The recording's valve commands through the offline plant."""
        return self.folder / "replay.mcap"

    @property
    def concealed(self) -> Path:
        """The folder of the recording with a concealed effect, and of its diagnosis."""
        return self.folder / "concealed"

    @property
    def page(self) -> Path:
        """The result for people."""
        return self.folder / "index.html"

    @property
    def summary(self) -> Path:
        """The result for machines."""
        return self.folder / "summary.json"


def demo(
    out: Annotated[Path, typer.Option(help="Folder of the results; earlier results in it are replaced.")] = Path(
        "out/demo"
    ),
    model: Model = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the concealed effect. Default: a new one each time.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Eleven simulated joints follow three grasps over ROS 2; recorded, replayed offline and shown on a page.

    At the end an effect is drawn, concealed in a recording of one finger, and looked for by `hand diagnose`.

    Example: hand demo --out out/demo

    Exit codes: 0 every joint followed, 1 a joint did not follow or a process failed, 2 bad usage or bad input.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    files = Files(out)
    with running("demo", files.model, files.recording, files.replay, files.page, files.summary) as outputs:
        check_folder(out)
        chosen = choose_model(model)
        origin = Origin(chosen)
        hand, grasps = _prepare(files, chosen.path)
        outputs.complete(files.model)
        from hand_tool import live_node  # noqa: F401 - a missing ROS is reported before anything is started

        chosen.print(as_json)
    interrupts.release()  # Ctrl-C must end the nodes in order
    try:
        with progress_bar(as_json) as progress:
            load = _play(files, hand, grasps, progress)
            outputs.complete(files.recording)
            outcome = _conceal(files, chosen.path, seed, progress)
            content, summary = _evaluate(files, hand, outcome, load, origin, progress)
    except (ProcessError, ValueError, OSError) as error:
        fail("demo", f"{error}; logs are in {files.folder / 'logs'}", 1)
    print(
        json.dumps(content | {"model_file": chosen.as_json()}, indent=2) if as_json else _text(files, summary, outcome)
    )
    if summary.not_followed:
        raise typer.Exit(1)


def _prepare(files: Files, model: Path) -> tuple[Hand, dict[str, Grasp]]:
    """Clear the folder and write the model of the hand with a soft object in it."""
    import numpy as np

    from hand_control.grasps import load_grasps
    from hand_model.description import load_hand
    from hand_model.yaml_document import YamlDocument, number_text

    hand = load_hand(model)
    grasps = load_grasps(model.with_name("grasps.yaml"), hand)
    files.folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(files.folder / "logs", ignore_errors=True)
    shutil.rmtree(files.concealed, ignore_errors=True)
    for path in (files.model, files.recording, files.replay, files.page, files.summary):
        path.unlink(missing_ok=True)
    description = YamlDocument(model)
    closed = np.degrees(grasps["cylindrical"].shape(1.0))
    for joint, angle_deg in zip(description.data["joints"], closed, strict=True):
        contact = description.group(joint, "contact", 2)
        description.set_number(contact, "angle_deg", number_text(float(CONTACT_SHARE * angle_deg)))
        description.set_number(contact, "stiffness_nm_per_rad", number_text(CONTACT_STIFFNESS_NM_PER_RAD))
    heading = "The installed description with a soft object in the hand, as the demo simulated it."
    files.model.write_text(description.text(heading), encoding="utf-8")
    return load_hand(files.model), grasps


def _play(files: Files, hand: Hand, grasps: dict[str, Grasp], progress: Progress) -> Load | None:
    """Record simulation and controller while they perform the grasps; the load of the machine meanwhile."""
    from hand_robot.urdf import description_text
    from hand_tool.live_node import NotReadyError, Pose, perform
    from hand_tool.machine_load import LoadMeter

    poses = []
    for name in PATTERNS:
        poses.append(Pose(f"{name} grasp", grasps[name].shape(1.0), CLOSE_S, HOLD_S))
        poses.append(Pose(f"open after {name}", grasps["open"].shape(0.0), OPEN_S, REST_S))
    total = sum(pose.move_s + pose.stay_s for pose in poses)
    logs = files.folder / "logs"
    use = {
        node: ["-p", f"hand_description:={files.model}", "-p", f"state_file:={logs / node}.json"]
        for node in ("simulation", "controller")
    }
    bar = progress.add_task("starting", total=total)
    meter = LoadMeter()
    with Processes(logs) as processes:
        processes.start("recorder", ["recorder", "--ros-args", "-p", f"out:={files.recording}"])
        processes.start("simulation", ["simulation", "--ros-args", *use["simulation"]])
        settings = default_model().with_name("controller.yaml")
        drive = ["--params-file", str(settings), *use["controller"], "-p", "enabled_at_start:=true"]
        processes.start("controller", ["controller", "--ros-args", *drive])

        def show(label: str, seconds: float) -> None:
            moving = not label.startswith("waiting")
            progress.update(bar, description=label, advance=seconds if moving else 0.0)

        try:
            perform(hand.joints, poses, description_text(hand), show, processes.check)
        except NotReadyError as error:
            raise ProcessError(str(error)) from None
        progress.update(bar, description="grasps performed and recorded", completed=total)
        for name in ("recorder", "controller", "simulation"):
            if (code := processes.stop(name)) != 0:
                raise ProcessError(f"{name} ended with code {code}")
    return meter.load()


def _conceal(files: Files, model: Path, seed: int | None, progress: Progress) -> Outcome:
    """Conceal an effect in a recording of the hand without an object, and diagnose it."""
    from hand_model.description import load_hand
    from hand_tool.demo_diagnosis import conceal_and_diagnose

    bar = progress.add_task("diagnosing a concealed effect", total=None)
    outcome = conceal_and_diagnose(
        load_hand(model), model, files.concealed, secrets.randbelow(2**31) if seed is None else seed
    )
    progress.update(bar, total=1.0, completed=1.0)
    return outcome


def _evaluate(
    files: Files, hand: Hand, outcome: Outcome, load: Load | None, origin: Origin, progress: Progress
) -> tuple[dict[str, Any], Summary]:
    """Replay offline, compare, write page and summary; returns what is in summary.json, and the figures."""
    from hand_recording.loader import load_recording
    from hand_recording.replay import replay_recording, write_replay
    from hand_robot.urdf import description_text
    from hand_tool.demo_page import write_page
    from hand_tool.demo_summary import summarise

    recording = load_recording(files.recording)
    result = replay_recording(recording, hand)
    bar = progress.add_task("replaying the recording offline", total=1.0)
    for share in write_replay(result, files.replay, "mcap", None, description_text(hand)):
        progress.update(bar, completed=share)
    bar = progress.add_task("drawing the page", total=None)
    summary = summarise(recording, result, load)
    content = summary.as_json() | {"concealed": outcome.as_json()}
    files.summary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    write_page(files.page, recording, result, summary, outcome, origin.of_page() | {"seed": outcome.seed})
    progress.update(bar, total=1.0, completed=1.0)
    return content, summary


def _text(files: Files, summary: Summary, outcome: Outcome) -> str:
    worst = max(summary.joints.values(), key=lambda joint: joint.tracking_rms_deg)
    loop, replay_deg = summary.loop, max(joint.replay_rms_deg for joint in summary.joints.values())
    lines = [
        f"{len(summary.joints)} joints followed {len(PATTERNS)} grasps, "
        f"the worst within {worst.tracking_rms_deg:.2f} degree RMS",
        f"loop {loop.rate_hz:.0f} Hz, missed {100 * loop.missed_fraction:.2f} %, "
        f"latency p50 {loop.latency_p50_ms:.2f} ms, p99 {loop.latency_p99_ms:.2f} ms",
        f"machine {summary.load or 'of unknown load'}",
        f"offline replay of the same commands: within {replay_deg:.3f} degree RMS",
        f"concealed:  {outcome.concealed} (seed {outcome.seed}), drawn at random, unknown to hand diagnose",
        f"found:      {outcome.answer}",
        *(
            f"            test error of the {row['signal']}: {row['rmse_before']:.3g} -> {row['rmse_after']:.3g}"
            f" {row['unit']}, noise {row['noise_floor']:.3g}"
            for row in outcome.errors
        ),
        f"page:       {files.page}",
        f"recording:  {files.recording}   replay: {files.replay}",
        "next:       source env.bash, then",
        f"            hand simulate {files.recording} --model {files.model} --out sim.mcap",
        "            hand studio --sim   (the hand in the browser)",
        "            hand --help",
    ]
    if summary.not_followed:
        lines[0] = f"joints that did not follow: {', '.join(summary.not_followed)}"
        if summary.load is not None and summary.load.disturbs:
            lines[0] += "; other programs kept the machine busy, run it again when they have ended"
    return "\n".join(lines)
