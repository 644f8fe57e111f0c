"""Every sensor fault on every joint in every motion, and hours of operation without a fault, in virtual time.

    python -m validation.faults.sensors [--hours H] [--quick] [--seed N] [--json FILE] [--processes P]

A fault begins in the middle of a motion, or, where it is one of wiring, before the hand is enabled. The same run
without the fault is its reference: `error` is how far a joint has left the range that it has passed through in the
reference when the hand vents or a warning names it, `excess` by how much a set-point was above the largest one of the
reference until then. A fault that is not found is *bounded* where they stay below BOUNDED_DEG and BOUNDED_PA: it lies
within what friction, valve and model allow, and moves the joint no further than these do.
`--hours` adds operation without a fault: motions, grasps, contacts, pushes, friction, slow valves, noise, a liquid,
gaps and stalls; every vent in it is a false one. No constant was chosen with the default seed.

Examples: python -m validation.faults.sensors --quick
          python -m validation.faults.sensors --hours 20 --json out/sensors.json
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hand_driver.board import Counts
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from validation.faults.result import FaultResult, Size, Tally
from validation.faults.sensor_loop import Fault, Loop, Plant

CONFIG = Path(__file__).resolve().parents[2] / "config"
SEED = 20270314
BEFORE_S, AFTER_S, WIRED_S = 1.0, 1.0, 2.0
"""Time to reach the first pose, and time after the fault within which it must be found; WIRED_S: from the start."""
BOUNDED_DEG, BOUNDED_PA = 10.0, 5.0e4
"""Largest error, and excess of a set-point, of a bounded fault: the band of the valve at 3 bar."""
MOVING_RAD = float(np.radians(2.0))
ERRORS = (0.0, 0.1, 0.3)


def _pose(joints: int, from_start: bool) -> Array:
    """First pose of a run (joints,) [rad]: neighbours differ; from_start: the vented hand, so that nothing moves."""
    pose: Array = np.radians(np.full(joints, -8.0) if from_start else 20.0 + 7.0 * (np.arange(joints) % 3))
    return pose


def _step(joint: int, t: float, pose: Array, rng: Array) -> Array:
    pose[joint] = np.radians(65.0)
    return pose


def _back(joint: int, t: float, pose: Array, rng: Array) -> Array:
    pose[joint] = np.radians(65.0 if t < 0.8 else 15.0)
    return pose


def _sine(joint: int, t: float, pose: Array, rng: Array) -> Array:
    pose[joint] += np.radians(25.0) * (1.0 - np.cos(2.0 * np.pi * t))
    return pose


def _ramp(joint: int, t: float, pose: Array, rng: Array) -> Array:
    pose[joint] += np.radians(40.0) * t
    return pose


def _finger(joint: int, t: float, pose: Array, rng: Array) -> Array:
    """The joint and the one of the next channel move against each other."""
    pose[joint] = np.radians(60.0)
    pose[(joint + 1) % len(pose)] = np.radians(0.0)
    return pose


def _all(joint: int, t: float, pose: Array, rng: Array) -> Array:
    """Every joint to a pose of its own."""
    return rng


MOTIONS: dict[str, tuple[Callable[[int, float, Array, Array], Array], float]] = {
    "step": (_step, 0.1),
    "step back": (_back, 0.9),
    "sine": (_sine, 0.2),
    "ramp": (_ramp, 0.3),
    "opposed": (_finger, 0.1),
    "all joints": (_all, 0.1),
}
"""Target of every joint over time, and the time [s] at which the fault begins."""


def _stuck(channels: list[int], begin: int) -> Fault:
    held: dict[int, int] = {}

    def apply(number: int, counts: Counts, supply_v: float) -> tuple[Counts, float]:
        if number >= begin:
            counts = counts.copy()
            for channel in channels:
                counts[channel] = held.setdefault(channel, int(counts[channel]))
        return counts, supply_v

    return apply


def _mapped(begin: int, change: Callable[[Array], Array]) -> Fault:
    """A change of the counts (channels,) as floats."""

    def apply(number: int, counts: Counts, supply_v: float) -> tuple[Counts, float]:
        if number < begin:
            return counts, supply_v
        return np.clip(np.rint(change(counts.astype(np.float64))), 0, 65535).astype(np.uint16), supply_v

    return apply


def _exchange(a: int, b: int) -> Callable[[Array], Array]:
    def change(counts: Array) -> Array:
        counts[[a, b]] = counts[[b, a]]
        return counts

    return change


def _about(channel: int, centre: float, factor: float) -> Callable[[Array], Array]:
    """Counts of a channel scaled about a centre [counts]."""

    def change(counts: Array) -> Array:
        counts[channel] = centre + factor * (counts[channel] - centre)
        return counts

    return change


def fault(hand: Hand, name: str, joint: int, begin: int) -> Fault:
    """The fault of a joint from frame number `begin` on."""
    sensors = hand.sensors
    angle, pressure = int(sensors.angle_channel[joint]), int(sensors.pressure_channel[joint])
    count = len(hand.joints)
    volts = sensors.adc.full_scale / sensors.adc.reference_v * sensors.supply_voltage_v
    zero_angle = float(sensors.angle_line.ratio(np.zeros(count))[joint]) * volts
    zero_pressure = float(sensors.pressure.ratio_at_zero[joint]) * volts
    if name == "angle frozen":
        return _stuck([angle], begin)
    if name == "pressure frozen":
        return _stuck([pressure], begin)
    if name == "converter stuck":
        return _stuck(list(range(hand.channel_count)), begin)
    if name == "supply 6.5 V":
        return lambda number, counts, supply_v: (counts, 6.5 if number >= begin else supply_v)
    changes = {
        "angle mirrored": _about(angle, 0.5 * volts, -1.0),
        "angle negated": _about(angle, zero_angle, -1.0),
        "angles exchanged": _exchange(angle, int(sensors.angle_channel[beside(joint, count)])),
        "pressures exchanged": _exchange(pressure, int(sensors.pressure_channel[beside(joint, count)])),
        "pressure x 0.5": _about(pressure, zero_pressure, 0.5),
        "pressure x 2": _about(pressure, zero_pressure, 2.0),
        "pressure at 0": _about(pressure, zero_pressure, 0.05),
    }
    return _mapped(begin, changes[name])


FAULTS = (
    "angle frozen", "angle mirrored", "angle negated", "angles exchanged", "pressure frozen", "pressures exchanged",
    "pressure x 0.5", "pressure x 2", "pressure at 0", "converter stuck", "supply 6.5 V", "valve stuck",
)  # fmt: skip
WIRING = (
    "angle mirrored", "angle negated", "angles exchanged", "pressures exchanged", "pressure x 0.5", "pressure x 2",
    "pressure at 0",
)  # fmt: skip
"""Faults that are there before the hand is enabled."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run: error of the model, motion, joint, fault, and whether it is there from the start.

    every: the controller receives one frame of so many.
    """

    error: float
    motion: str
    joint: int
    fault: str
    from_start: bool
    every: int = 1


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a case gave; times since the fault, or since the first motion under it.

    detected_s: until the hand, or the joint, was vented; None: not within AFTER_S.  warned_s: until a warning.
    error_deg: see the module.  excess_pa: likewise.  line: the latched line.  moved: whether the joint moved.
    """

    case: Case
    detected_s: float | None
    warned_s: float | None
    error_deg: float
    excess_pa: float
    line: str
    moved: bool

    @property
    def found(self) -> bool:
        """Whether the hand vented, or warned."""
        return self.detected_s is not None or self.warned_s is not None

    @property
    def bounded(self) -> bool:
        """Whether the fault was not found, and did little."""
        return not self.found and self.error_deg <= BOUNDED_DEG and self.excess_pa <= BOUNDED_PA


@dataclass(slots=True)
class Trace:
    """A run: angles [rad] and set-points [Pa] (frames, joints) from enabling on; index of the vent and the warning."""

    angle: Array
    set_point: Array
    vented: int | None
    warned: int | None
    line: str
    rate_hz: float


def _run(hand: Hand, case: Case, seed: int, broken: bool) -> Trace:
    loop = Loop(hand, Plant(case.error), seed)
    target, at_s = MOTIONS[case.motion]
    rng = np.radians(np.random.default_rng(seed).uniform(5.0, 75.0, len(hand.joints)))
    begin = loop.number + 1 + (0 if case.from_start else round((BEFORE_S + at_s) * loop.rate_hz))
    if broken and case.fault == "valve stuck":
        _stick_valve(loop, case.joint, begin)
    elif broken:
        loop.fault = fault(hand, case.fault, case.joint, begin)
    loop.controller.enable(True)
    angles, set_points, vented, warned, line = [], [], None, None, ""
    after_s = WIRED_S if case.from_start else AFTER_S
    for frame in range(round((BEFORE_S + at_s + after_s) * loop.rate_hz)):
        driven = loop.step(frame % case.every == 0)
        angles.append(loop.angle)
        set_points.append(loop.set_point)
        if warned is None and any("does not follow" in h.message for h in loop.controller.health(loop.now_ns)):
            warned = frame
        if not driven:
            vented, line = frame, loop.controller.safety.fault
            break
        t, pose = frame / loop.rate_hz - BEFORE_S, _pose(len(hand.joints), case.from_start)
        if t >= 0.0 or not case.from_start:
            loop.command(target(case.joint, t, pose, rng) if t >= 0.0 else pose)
    return Trace(np.array(angles), np.array(set_points), vented, warned, line, loop.rate_hz)


def _stick_valve(loop: Loop, joint: int, begin: int) -> None:
    held: list[float] = []

    def stick(number: int, set_point: Array) -> Array:
        if number < begin:
            return set_point
        held.append(float(set_point[joint]))
        set_point = set_point.copy()
        set_point[joint] = held[0]
        return set_point

    loop.set_point_fault = stick


def study(hand: Hand, cases: list[Case], seed: int) -> list[Outcome]:
    """Run cases that share error, motion, joint and start against one reference."""
    first = cases[0]
    reference = _run(hand, first, seed, broken=False)
    if reference.vented is not None:
        raise RuntimeError(f"the hand vented without a fault: {first}, seed {seed}: {reference.line}")
    return [_outcome(case, _run(hand, case, seed, broken=True), reference) for case in cases]


def _outcome(case: Case, trace: Trace, reference: Trace) -> Outcome:
    rate = trace.rate_hz
    begin = round((BEFORE_S + (0.0 if case.from_start else MOTIONS[case.motion][1])) * rate)
    begin = min(begin, len(trace.angle) - 1)  # a fault that is found before the motion
    end, mine = (
        min(trace.warned or len(trace.angle), len(trace.angle)),
        [case.joint, beside(case.joint, trace.angle.shape[1])],
    )
    moved = np.abs(trace.angle[begin:, mine] - trace.angle[begin, mine]).max(axis=1) > MOVING_RAD
    since = begin + (int(np.argmax(moved)) if case.from_start and moved.any() else 0)
    error = _error(trace.angle[begin:end], reference.angle[begin:end])
    highest = np.maximum.accumulate(reference.set_point, axis=0)[max(begin - 10, 0) :]
    excess = max(float((trace.set_point[begin:end] - highest[: end - begin]).max()), 0.0)
    return Outcome(
        case,
        None if trace.vented is None else (trace.vented - since) / rate,
        None if trace.warned is None else (trace.warned - since) / rate,
        error,
        excess,
        trace.line,
        bool(moved.any()),
    )


def _error(angle: Array, reference: Array) -> float:
    """Largest angle [deg] outside the range that the reference run has passed through: a joint held back is safe."""
    if not len(angle):
        return 0.0
    low, high = np.minimum.accumulate(reference), np.maximum.accumulate(reference)
    return float(np.degrees(np.maximum(angle - high, low - angle).max()))


def beside(joint: int, joints: int) -> int:
    """The joint of the next channel; of the last one, the one before."""
    return joint + 1 if joint + 1 < joints else joint - 1


def groups(joints: int, quick: bool) -> Iterator[list[Case]]:
    """Cases that share a reference; quick: a part of them that covers every fault, motion and error."""
    for number, (error, motion) in enumerate((e, m) for e in ERRORS for m in MOTIONS):
        for joint in range(joints):
            if quick and joint != (5 * number + 2) % joints:
                continue
            yield [Case(error, motion, joint, name, False) for name in FAULTS]
            yield [Case(error, motion, joint, name, True) for name in WIRING]


def _study(job: tuple[list[Case], int]) -> list[Outcome]:
    return study(load_hand(CONFIG / "hand.yaml"), *job)


def summary(outcomes: list[Outcome]) -> dict[str, dict[str, float]]:
    """By fault: cases, found by a vent, found by a warning, times [s] and the largest error [deg] and excess [Pa]."""
    table = {}
    for from_start, name in sorted({(o.case.from_start, o.case.fault) for o in outcomes}):
        mine = [o for o in outcomes if (o.case.from_start, o.case.fault) == (from_start, name)]
        times = [o.detected_s for o in mine if o.detected_s is not None]
        table[name + (", from the start" if from_start else "")] = {
            "cases": len(mine),
            "vented": len(times),
            "only warned": sum(o.detected_s is None and o.warned_s is not None for o in mine),
            "time, median": float(np.median(times)) if times else float("nan"),
            "time, largest": max(times, default=float("nan")),
            "bounded": sum(o.bounded for o in mine),
            "within 0.3 s": sum(t <= 0.3 for t in times),
            "error, 95 %": float(np.quantile([o.error_deg for o in mine], 0.95)),
            "error, largest": max(o.error_deg for o in mine),
            "excess, largest": max(o.excess_pa for o in mine),
        }
    return table


@dataclass(frozen=True, slots=True)
class Operation:
    """Operation without a fault: hours, and each false vent with its time [h], plant and line."""

    hours: float
    vents: list[dict[str, Any]]
    frames: int
    gaps: int
    stalls: int
    pushes: int
    contacts: int


def operate(hand: Hand, hours: float, seed: int) -> Operation:
    """Operate hands without a fault for some hours [h], a new plant every minute and after every vent."""
    from validation.faults.operation import minutes  # noqa: PLC0415 - it needs this module's constants

    return minutes(hand, hours, seed)


def _operate(job: tuple[float, int]) -> Operation:
    return operate(load_hand(CONFIG / "hand.yaml"), *job)


def document(
    quick: bool, hours: float, seed: int, processes: int, progress: Callable[[str], None] = print
) -> dict[str, Any]:
    """Both parts as a document; hours [h]: duration of the second one."""
    hand = load_hand(CONFIG / "hand.yaml")
    jobs = [(cases, seed + k) for k, cases in enumerate(groups(len(hand.joints), quick))]
    outcomes: list[Outcome] = []
    operations: list[Operation] = []
    with ProcessPoolExecutor(processes) as pool:
        for k, done in enumerate(pool.map(_study, jobs)):
            outcomes += done
            if k % 50 == 49:
                progress(f"{k + 1} of {len(jobs)} groups of cases")
        if hours > 0.0:
            parts = max(1, round(hours * 4))
            for part in pool.map(_operate, [(hours / parts, seed + 10_000 + k) for k in range(parts)]):
                operations.append(part)
                progress(
                    f"{sum(o.hours for o in operations):.2f} h, {sum(len(o.vents) for o in operations)} false vents"
                )
    table = summary(outcomes)
    missed = [asdict(o) for o in outcomes if not o.found and o.moved]
    return {
        "seed": seed,
        "faults": table,
        "missed": missed,
        "operation": {
            "hours": sum(o.hours for o in operations),
            "vents": [vent for o in operations for vent in o.vents],
            **{key: sum(getattr(o, key) for o in operations) for key in ("gaps", "stalls", "pushes", "contacts")},
        },
    }


def run(size: Size, seed: int) -> list[FaultResult]:
    """Every fault of a sensor; quick: on one joint of each motion and model error, with a minute of operation."""
    quick = size is Size.QUICK
    hand = load_hand(CONFIG / "hand.yaml")
    outcomes: list[Outcome] = []
    for number, cases in enumerate(groups(len(hand.joints), size is not Size.FULL)):
        if quick and number % 5:
            continue
        outcomes += study(hand, cases, seed + number)
    tallies: dict[str, Tally] = {}
    for outcome in outcomes:
        case = outcome.case
        name = f"{case.fault}, from the start" if case.from_start else case.fault
        tally = tallies.setdefault(name, Tally("sensors", name, seed, "deg"))
        found = outcome.detected_s if outcome.detected_s is not None else outcome.warned_s
        label = f"{hand.joints[case.joint]}, {case.motion}, model {100 * case.error:.0f} % off"
        tally.case(label, found is not None, found, outcome.error_deg, outcome.bounded)
    done = operate(hand, 1.0 / 60.0 if quick else 0.25, seed)
    operation = Tally(
        "sensors", "operation without a fault", seed, note=f"{done.hours:.3f} h; each vent is a false one"
    )
    operation.many(done.frames, done.frames - len(done.vents))
    return [*(tally.result() for tally in tallies.values()), operation.result()]


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.faults.sensors",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="one joint of each motion and model error")
    parser.add_argument("--hours", type=float, default=0.0, help="hours of operation without a fault")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, help="write the document here")
    chosen = parser.parse_args()
    print(f"seed {chosen.seed}")
    result = document(chosen.quick, chosen.hours, chosen.seed, chosen.processes)
    for name, row in result["faults"].items():
        print(f"{name:38s}", "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
    missed = result["missed"]
    beyond = [m for m in missed if m["error_deg"] > BOUNDED_DEG or m["excess_pa"] > BOUNDED_PA]
    print(f"not found in motion: {len(missed)}, not bounded: {len(beyond)}; operation: {result['operation']}")
    if chosen.json:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
