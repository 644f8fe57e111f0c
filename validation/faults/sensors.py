"""Every sensor fault on every joint in every motion, and hours of operation without a fault, in virtual time.

    python -m validation.faults.sensors [--hours H] [--quick] [--seed N] [--json FILE] [--processes P]

A fault begins in the middle of a motion, or, where it is one of wiring, before the hand is enabled. The same run
without the fault is its reference: `error` is how far a joint has left the range that it has passed through in the
reference when the hand vents or a warning names it, `excess` by how much a set-point was above the largest one of the
reference until then. A case is handled where

    the hand has vented within WITHIN_S, or within the run for a fault that is not listed there; a pressure that reads
    too low and a valve that sticks may be answered by a warning that names the joint (docs/safety.md says why),
    the error is at most LARGEST_DEG, and
    the excess is at most EXCESS_PA, which is a little more than what the noise of the sensors moves a set-point by
    between two frames; where a valve sticks every sensor is right, and its joint may be asked for as any that lags.

A fault that is not found is *bounded* where error and excess stay below LARGEST_DEG and BOUNDED_PA: it lies within
what friction, valve and model allow, and moves the joint no further than these do.
`--hours` adds operation without a fault: motions, grasps, contacts, pushes, friction, slow valves, noise, a liquid,
gaps and stalls; every vent in it is a false one. No constant was chosen with the default seed.

Examples: python -m validation.faults.sensors --quick
          python -m validation.faults.sensors --hours 20 --json out/sensors.json
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
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
WITHIN_S = {
    **dict.fromkeys(("angle frozen", "angle mirrored", "angle negated", "angles exchanged"), 0.3),
    **dict.fromkeys(("pressure frozen", "pressures exchanged", "converter stuck"), 0.3),
    "converter stuck, at rest": 2.0,
}
"""Latest vent [s] after the fault, or after the first motion under it, by the kind of fault, wherever it began."""
LARGEST_DEG, EXCESS_PA, BOUNDED_PA = 10.0, 8.0e2, 5.0e4
"""Largest error, and excess of a set-point, of a fault that is found; and of a bounded fault, the band of the valve at
3 bar."""
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


def _rest(joint: int, t: float, pose: Array, rng: Array) -> Array:
    return pose


REST = "rest"
TARGETS = {**MOTIONS, REST: (_rest, 0.1)}


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


MISSES = ("not found", "late", "too far", "excess")
"""What a case may lack: a reaction, its time, an error of at most LARGEST_DEG, an excess of at most EXCESS_PA."""


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

    @property
    def hazard(self) -> str:
        """The fault with its circumstances, as the tables name it."""
        return self.fault + (", from the start" if self.from_start else ", at rest" if self.motion == REST else "")

    @property
    def within_s(self) -> float | None:
        """Latest vent [s]; None where a vent or a warning at any time of the run will do."""
        return WITHIN_S.get(self.hazard, WITHIN_S.get(self.fault))

    @property
    def after_s(self) -> float:
        """Time from the fault to the end of the run [s]."""
        return WIRED_S if self.from_start or self.motion == REST else AFTER_S


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
    def found_s(self) -> float | None:
        """Time [s] until the reaction that the fault asks for; None: not within the run."""
        if self.case.within_s is not None or self.warned_s is None:
            return self.detected_s
        return self.warned_s if self.detected_s is None else min(self.warned_s, self.detected_s)

    @property
    def misses(self) -> tuple[str, ...]:
        """What the case lacks of its contract, of MISSES; empty: it is handled."""
        latest_s, found_s = self.case.within_s, self.found_s
        late = found_s is not None and latest_s is not None and found_s > latest_s
        excess = self.excess_pa > EXCESS_PA and self.case.fault != "valve stuck"
        kinds = (found_s is None, late, self.error_deg > LARGEST_DEG, excess)
        return tuple(name for name, missed in zip(MISSES, kinds, strict=True) if missed)

    @property
    def bounded(self) -> bool:
        """Whether the fault was not found, and did little."""
        quiet = self.detected_s is None and self.warned_s is None
        return quiet and self.error_deg <= LARGEST_DEG and self.excess_pa <= BOUNDED_PA

    def label(self, joints: Sequence[str]) -> str:
        """Joint, motion, model and what is missed."""
        case = self.case
        where = f"{joints[case.joint]}, {case.motion}, model {100 * case.error:.0f} % off"
        return ": ".join(filter(None, (where, ", ".join(self.misses))))


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
    target, at_s = TARGETS[case.motion]
    rng = np.radians(np.random.default_rng(seed).uniform(5.0, 75.0, len(hand.joints)))
    begin = loop.number + 1 + (0 if case.from_start else round((BEFORE_S + at_s) * loop.rate_hz))
    if broken and case.fault == "valve stuck":
        _stick_valve(loop, case.joint, begin)
    elif broken:
        loop.fault = fault(hand, case.fault, case.joint, begin)
    loop.controller.enable(True)
    angles, set_points, vented, warned, line = [], [], None, None, ""
    named = [hand.joints[k] for k in (case.joint, beside(case.joint, len(hand.joints)))]
    for frame in range(round((BEFORE_S + at_s + case.after_s) * loop.rate_hz)):
        driven = loop.step(frame % case.every == 0)
        angles.append(loop.angle)
        set_points.append(loop.set_point)
        if warned is None and loop.number >= begin:
            valves = next(h.message for h in loop.controller.health(loop.now_ns) if h.name == "valves")
            warned = frame if any(valves.startswith(joint) for joint in named) else None
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
    """Run cases that share error, motion, joint and start against one reference. Raises RuntimeError if it vents."""
    first = cases[0]
    reference = _run(hand, first, seed, broken=False)
    if reference.vented is not None:
        raise RuntimeError(f"the hand vented without a fault: {first}, seed {seed}: {reference.line}")
    return [_outcome(case, _run(hand, case, seed, broken=True), reference) for case in cases]


def _outcome(case: Case, trace: Trace, reference: Trace) -> Outcome:
    rate = trace.rate_hz
    begin = round((BEFORE_S + (0.0 if case.from_start else TARGETS[case.motion][1])) * rate)
    begin = min(begin, len(trace.angle) - 1)  # a fault that is found before the motion
    warned = trace.warned if reference.warned is None else None  # else the plant is warned of, not the fault
    answered = warned if case.within_s is None and warned is not None else len(trace.angle)
    mine = [case.joint, beside(case.joint, trace.angle.shape[1])]
    moved = np.abs(trace.angle[begin:, mine] - trace.angle[begin, mine]).max(axis=1) > MOVING_RAD
    since = begin + (int(np.argmax(moved)) if case.from_start and moved.any() else 0)
    highest = np.maximum.accumulate(reference.set_point, axis=0)
    excess = trace.set_point[begin:answered] - highest[begin:answered]
    return Outcome(
        case=case,
        detected_s=None if trace.vented is None else (trace.vented - since) / rate,
        warned_s=None if warned is None else (warned - since) / rate,
        error_deg=_error(trace.angle[begin:answered], reference.angle[begin:answered]),
        excess_pa=max(float(excess.max(initial=0.0)), 0.0),
        line=trace.line,
        moved=bool(moved.any()),
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
            if motion == next(iter(MOTIONS)):
                yield [Case(error, REST, joint, "converter stuck", False)]
            yield [Case(error, motion, joint, name, True) for name in WIRING]


def _study(job: tuple[list[Case], int]) -> list[Outcome]:
    return study(load_hand(CONFIG / "hand.yaml"), *job)


def summary(outcomes: list[Outcome]) -> dict[str, dict[str, float]]:
    """By fault: cases, handled, bounded, each kind of MISSES, times [s] and the largest error [deg] and excess [Pa]."""
    table = {}
    for hazard in sorted({o.case.hazard for o in outcomes}):
        mine = [o for o in outcomes if o.case.hazard == hazard]
        times = [o.found_s for o in mine if o.found_s is not None]
        table[hazard] = {
            "cases": len(mine),
            "handled": sum(not o.misses for o in mine),
            "bounded": sum(o.bounded for o in mine),
            "vented": sum(o.detected_s is not None for o in mine),
            **{kind: sum(kind in o.misses for o in mine) for kind in MISSES},
            "time, median": float(np.median(times)) if times else float("nan"),
            "time, largest": max(times, default=float("nan")),
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
    missed = [asdict(o) for o in outcomes if o.misses and o.moved]
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
        hazard = outcome.case.hazard
        tally = tallies.setdefault(hazard, Tally("sensors", hazard, seed, "deg"))
        tally.case(outcome.label(hand.joints), not outcome.misses, outcome.found_s, outcome.error_deg, outcome.bounded)
        tally.missed(outcome.misses)
    for hazard, row in summary(outcomes).items():
        tallies[hazard].note = f"excess at most {1e-3 * row['excess, largest']:.1f} kPa"
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
    print(f"not handled in motion: {len(result['missed'])}; operation: {result['operation']}")
    if chosen.json:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
