"""The simulated hand in motion for hours, as processes: python -m validation.faults.soak --hours H [--out FILE].

Simulation, controller and recorder run; a user sends random commands, trajectories and grasps. Memory, CPU, frames,
answers, latches and the size of the recording are sampled. The exit code is 1 after a latch, if memory grows by more
than 10 MB after the warm-up, or if more than 1 % of the periods have no frame or no command.

Example: python -m validation.faults.soak --hours 1 --out out/soak.json
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median

import numpy as np
from hand_msgs.action import Grasp
from rich.console import Console
from rich.table import Table
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_control.grasps import load_grasps
from hand_ros.node import QUEUED_QOS
from validation.faults.closed_loop import CONFIG, description
from validation.faults.live import Nodes, TooLateError, User, cpu_s, rss_mb
from validation.results import provenance

NAMES = ("simulation", "controller", "recorder")
SEED = 7
MOST_GROWTH_MB = 10.0
"""Of the resident memory of a process, from the first to the last tenth of the time after the warm-up."""
MOST_MISSED = 0.01
"""Share of the periods without a frame, or without a command for it."""
WARM_UP_S = 60.0
"""Time for buffers to fill; a tenth of the whole where that is shorter."""
SAMPLES = 400
"""Number of samples of a run; they are at least a second apart."""


@dataclass(slots=True)
class Sample:
    """State at one time: seconds since the start, memory [MB] and CPU [cores] by process, and counts since the last.

    frames, commands: different frames, and different frames that a valve command answers.  passed_s: since the last.
    """

    time_s: float
    rss_mb: dict[str, float]
    cpu: dict[str, float]
    passed_s: float
    frames: int
    commands: int
    file_mb: float


@dataclass(slots=True)
class Soak:
    """The result. missed shares are those of all periods, 0 to 1; growth [MB] by process."""

    hours: float
    seed: int
    motions: int = 0
    frames: int = 0
    missed_frames: float = 0.0
    missed_commands: float = 0.0
    latches: list[str] = field(default_factory=list)
    growth_mb: dict[str, float] = field(default_factory=dict)
    rss_mb: dict[str, float] = field(default_factory=dict)
    cpu: dict[str, float] = field(default_factory=dict)
    file_mb_per_hour: float = 0.0
    file_growth_ratio: float = 1.0
    faults: list[str] = field(default_factory=list)
    samples: list[Sample] = field(default_factory=list)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; exit code 0 nothing found, 1 a fault was found, 2 bad usage, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.faults.soak",
        description="Run the simulated hand in motion for hours and watch memory, CPU, missed periods and latches.",
        epilog="Example: python -m validation.faults.soak --hours 1 --out out/soak.json",
    )
    parser.add_argument("--hours", type=float, default=1.0, help="how long; 0.005 is 18 s, a smoke test")
    parser.add_argument("--seed", type=int, default=SEED, help="seed of the motions")
    parser.add_argument("--out", type=Path, default=Path("out/soak.json"), help="file of results")
    options = parser.parse_args(arguments)
    if not 0.0 < options.hours <= 1000.0:
        parser.error(f"hours is {options.hours:g}; the allowed range is above 0 to 1000")
    command = " ".join(["python -m validation.faults.soak", *(arguments if arguments is not None else sys.argv[1:])])
    options.out.parent.mkdir(parents=True, exist_ok=True)
    try:
        result = run(options.hours, options.seed)
    except KeyboardInterrupt:
        print("python -m validation.faults.soak: interrupted; nothing was written", file=sys.stderr)
        return 130
    document = {**provenance(command), "soak": asdict(result)}
    options.out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    console = Console()
    console.print(table(result))
    console.print(f"seed {options.seed}; written: {options.out}")
    for fault in result.faults:
        print(f"not passed: {fault}", file=sys.stderr)
    return 1 if result.faults else 0


def run(hours: float, seed: int) -> Soak:
    """Start everything, move the hand for some hours [h], and evaluate."""
    result = Soak(hours, seed)
    with tempfile.TemporaryDirectory() as folder, Nodes(Path(folder)) as nodes:
        user = User(depth=1000)
        try:
            for name in NAMES:
                parameters = {"out": Path(folder) / "recording"} if name == "recorder" else {}
                nodes.node(name, **parameters)
            user.drive()
            Mover(user, nodes, result, np.random.default_rng(seed)).run(hours * 3600.0)
        except TooLateError as error:
            result.faults.append(str(error))
        finally:
            user.close()
    return evaluate(result)


class Mover:
    """Sends random motions and samples the processes."""

    def __init__(self, user: User, nodes: Nodes, result: Soak, rng: np.random.Generator) -> None:
        """Prepare the publishers of the motions."""
        self._user, self._nodes, self._result, self._rng = user, nodes, result, rng
        self._trajectories = user.node.create_publisher(JointTrajectory, "joint_trajectory", QUEUED_QOS)
        self._grasps = user.action(Grasp, "grasp")
        self._patterns = list(load_grasps(CONFIG / "grasps.yaml", description()))
        self._cpu: dict[str, float] = {}
        self._at_s = 0.0

    def run(self, seconds: float) -> None:
        """Move for some seconds [s]."""
        begun_s = time.monotonic()
        period_s = max(1.0, seconds / SAMPLES)
        self._mark()
        next_sample_s, next_motion_s = begun_s + period_s, begun_s
        while (now_s := time.monotonic()) < begun_s + seconds:
            if now_s >= next_motion_s:
                self.motion()
                next_motion_s = now_s + float(self._rng.uniform(0.3, 3.0))
            if now_s >= next_sample_s:
                self._sample(now_s - begun_s)
                next_sample_s += period_s
            self._user.spin(min(next_sample_s, next_motion_s) - now_s)

    def motion(self) -> None:
        """One random command, trajectory or grasp; after a latch the hand is driven again."""
        if self._user.latched:
            self._result.latches.append(self._user.status("controller", "safety")[1])
            self._user.drive()
        self._result.motions += 1
        way = self._rng.random()
        if way < 0.5:
            self._user.command(float(self._rng.uniform(0.0, 80.0)))
        elif way < 0.8:
            self._trajectories.publish(self._trajectory())
        else:
            pattern = str(self._rng.choice(self._patterns))
            goal = Grasp.Goal(pattern=pattern, closure=float(self._rng.uniform(0.2, 1.0)), max_torque=0.2)
            self._grasps.send_goal_async(goal)

    def _trajectory(self) -> JointTrajectory:
        names = [str(name) for name in self._rng.permutation(list(description().joints))[:4]]
        message = JointTrajectory(joint_names=names)
        for number in range(1, 4):
            point = JointTrajectoryPoint(positions=self._rng.uniform(0.0, 1.4, len(names)).tolist())
            nanoseconds = int(number * self._rng.uniform(0.9, 1.1) * 6e8)
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(nanoseconds, 1_000_000_000)
            message.points.append(point)
        return message

    def _mark(self) -> None:
        self._cpu = {name: cpu_s(process) for name, process in self._nodes.running.items()}
        self._at_s = time.monotonic()
        self._user.stamps_ns.clear()
        self._user.answered_ns.clear()

    def _sample(self, time_s: float) -> None:
        for name, process in self._nodes.running.items():
            if process.poll() is not None:
                raise TooLateError(f"{name} ended with code {process.returncode}; it must run")
        passed_s = time.monotonic() - self._at_s
        used = {name: (cpu_s(p) - self._cpu[name]) / passed_s for name, p in self._nodes.running.items()}
        memory = {name: rss_mb(process) for name, process in self._nodes.running.items()}
        frames, commands = len(set(self._user.stamps_ns)), len(set(self._user.answered_ns))
        files = [path for path in self._nodes.folder.glob("recording*/*") if path.is_file()]
        size_mb = sum(path.stat().st_size for path in files) * 1e-6
        self._result.frames += frames
        self._result.samples.append(
            Sample(
                time_s=time_s,
                rss_mb=memory,
                cpu=used,
                passed_s=passed_s,
                frames=frames,
                commands=commands,
                file_mb=size_mb,
            )
        )
        self._mark()


def evaluate(result: Soak) -> Soak:
    """Fill the summary and the faults of a result from its samples."""
    if len(result.samples) < 4:
        result.faults.append(f"only {len(result.samples)} samples; let it run longer")
        return result
    end_s = result.samples[-1].time_s
    after = [sample for sample in result.samples if sample.time_s > min(WARM_UP_S, 0.1 * end_s)]
    tenth = max(1, len(after) // 10)
    periods = sum(sample.passed_s for sample in result.samples) * description().rate_hz
    # Sums over all intervals: the frame at the border of two intervals counts in one of them.
    result.missed_frames = max(0.0, 1.0 - sum(sample.frames for sample in result.samples) / periods)
    result.missed_commands = max(0.0, 1.0 - sum(sample.commands for sample in result.samples) / periods)
    for name in NAMES:
        first, last = (median(s.rss_mb[name] for s in part) for part in (after[:tenth], after[-tenth:]))
        result.growth_mb[name], result.rss_mb[name] = last - first, max(s.rss_mb[name] for s in after)
        result.cpu[name] = median(s.cpu[name] for s in after)
    half = len(after) // 2
    rates = [_slope(part) for part in (after[:half], after[half:])]
    result.file_mb_per_hour = 3600.0 * _slope(after)
    result.file_growth_ratio = rates[1] / rates[0] if rates[0] > 0.0 else float("inf")
    result.faults += [f"latched: {line}" for line in result.latches]
    for name, growth in result.growth_mb.items():
        if growth > MOST_GROWTH_MB:
            result.faults.append(f"{name} grew by {growth:.1f} MB; at most {MOST_GROWTH_MB:g} MB is allowed")
    for what, share in (("frame", result.missed_frames), ("command", result.missed_commands)):
        if share > MOST_MISSED:
            result.faults.append(f"{share:.2%} of the periods have no {what}; at most {MOST_MISSED:.0%} is allowed")
    return result


def _slope(samples: list[Sample]) -> float:
    """Growth of the recording [MB/s]."""
    span_s = samples[-1].time_s - samples[0].time_s
    return (samples[-1].file_mb - samples[0].file_mb) / span_s if span_s > 0.0 else 0.0


def table(result: Soak) -> Table:
    """The result on one screen."""
    view = Table("soak", *NAMES, title=f"{result.hours:g} h, {result.motions} motions, {result.frames:,} frames")

    def row(what: str, values: dict[str, float], form: str) -> None:
        view.add_row(what, *(format(values[name], form) if name in values else "" for name in NAMES))

    row("largest memory, MB", result.rss_mb, ".1f")
    row("growth, MB", result.growth_mb, "+.1f")
    row("CPU, cores", result.cpu, ".2f")
    view.add_row("periods without a frame", f"{result.missed_frames:.3%}", "", "")
    view.add_row("periods without a command", "", f"{result.missed_commands:.3%}", "")
    view.add_row("latches", "", str(len(result.latches)), "")
    view.add_row("recording, MB per hour", "", "", f"{result.file_mb_per_hour:.0f}")
    return view


if __name__ == "__main__":
    sys.exit(main())
