"""Processor time and memory of the diagnosis: few joints, one for a minute, the whole hand for ten; how both grow.

Loops are compiled before anything is measured: they stay on disk for later processes.
"""

from __future__ import annotations

import multiprocessing
import resource
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import diagnose
from hand_identification.joint_data import joint_problem
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P
from validation.bench.result import figure

SEED = 5
PERIOD_S = 0.005
JOINT = "index_distal"
FOUR = ("index_proximal", JOINT, "middle_proximal", "middle_distal")
EIGHT = (*FOUR, "ring_proximal", "ring_distal", "little_proximal", "little_distal")
PARAMETERS = 8
QUICK_S = 15.0
LINEAR = 2.2
"""Most that twice as many joints, recordings or seconds may take, as a multiple."""


def run(quick: bool) -> list[dict[str, Any]]:
    """Medians; quick: two joints and one joint of a shorter recording, once, compilation included."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    duration_s = QUICK_S if quick else 60.0
    signals = _record(_with_friction(hand), duration_s)
    repeat = 1 if quick else 3
    if not quick:
        _diagnosed([signals], hand, [JOINT])  # compiles
    seconds = _median(repeat, lambda: _diagnosed([signals], hand, [JOINT]))
    results = [figure(f"diagnosis of one joint, {duration_s:g} s at 200 Hz, full catalogue", seconds, 6.0, "s CPU")]
    results += _few_joints(hand, FOUR[:2] if quick else FOUR, QUICK_S if quick else 30.0, repeat)
    results.append(_jacobian(signals, hand, 5 if quick else 25))
    if not quick:
        results += _growth(hand)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            took_s, megabytes = pool.apply(_whole_hand)
        results.append(figure("diagnosis of eleven joints, 10 minutes at 200 Hz", took_s, 180.0, "s CPU"))
        results.append(figure("peak memory of that process", megabytes * 1e-3, 1.0, "GB"))
    return results


def _few_joints(hand: Hand, joints: Sequence[str], duration_s: float, repeat: int) -> list[dict[str, Any]]:
    """Processor time with nothing missing, and with friction in one joint, at 100 Hz."""
    results = []
    rubbing = _with_friction(hand)
    for name, recorded, found, goal in (
        ("nothing missing", hand, (), 3.0),
        ("one effect", rubbing, ("coulomb_friction",), 12.0),
    ):
        signals = _record(recorded, duration_s, 0.01)
        seconds = _median(repeat, lambda: _diagnosed([signals], hand, joints, found))  # noqa: B023 - called at once
        what = f"diagnosis of {len(joints)} joints, {name}, {duration_s:g} s at 100 Hz"
        results.append(figure(what, seconds, goal, "s CPU"))
    return results


def _growth(hand: Hand) -> list[dict[str, Any]]:
    """Twice as many seconds, joints and recordings, each next to one times as many."""
    rubbing = _with_friction(hand)
    short, long = _record(rubbing, 30.0), _record(rubbing, 60.0)
    other = replace(_record(rubbing, 30.0, seed=SEED + 1), name="other")
    pairs = {
        "seconds": (([short], FOUR), ([long], FOUR)),
        "joints": (([short], FOUR), ([short], EIGHT)),
        "recordings": (([short], FOUR), ([short, other], FOUR)),
    }
    results = []
    for what, (once, twice) in pairs.items():
        reference, ours = (
            _median(3, lambda: _diagnosed(signals, hand, joints))  # noqa: B023 - called at once
            for signals, joints in (once, twice)
        )
        results.append(figure(f"diagnosis of twice as many {what} (reference: 1 x)", ours, LINEAR, "s CPU", reference))
    return results


def _diagnosed(
    signals: Sequence[Signals], hand: Hand, joints: Sequence[str], expected: Sequence[str] = ("coulomb_friction",)
) -> None:
    result = diagnose(list(signals), hand, tolerance=0.05, seed=0, joints=list(joints), sensor_curve=False)
    assert [finding.effect for finding in result.findings] == list(expected), result.findings


def _whole_hand() -> tuple[float, float]:
    """Processor time [s] and peak memory [MB] in a process of its own."""
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    signals = _record(_with_friction(hand), 600.0)
    seconds = _cpu_s(lambda: _diagnosed([signals], hand, hand.joints))
    return seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _median(repeat: int, action: Callable[[], Any]) -> float:
    return statistics.median(_cpu_s(action) for _ in range(repeat))


def _cpu_s(action: Callable[[], Any]) -> float:
    begun = time.process_time()
    action()
    return time.process_time() - begun


def _jacobian(signals: Signals, hand: Hand, rounds: int) -> dict[str, Any]:
    """All columns of a finite-difference Jacobian are lanes of one rollout."""
    problem = joint_problem([signals], hand, JOINT)
    point = problem.nominal[None]
    all_columns = np.repeat(point, PARAMETERS, axis=0)  # the fit has simulated the point itself before
    all_columns[:, ROW["statics.a2_nm_per_pa"]] *= 1.0 + 1e-3 * np.arange(1, PARAMETERS + 1)
    single, jacobian = [], []
    for _ in range(rounds):
        single.append(_seconds(lambda: problem.predict(point, problem.starts(1))))
        jacobian.append(_seconds(lambda: problem.predict(all_columns, problem.starts(PARAMETERS))))
    ours, reference = statistics.median(jacobian), statistics.median(single)
    return figure(
        f"Jacobian of {PARAMETERS} parameters (reference: one rollout)", 1e3 * ours, 2.0, "ms", 1e3 * reference
    )


def _seconds(action: Callable[[], Any]) -> float:
    begun = time.perf_counter()
    action()
    return time.perf_counter() - begun


def _with_friction(hand: Hand) -> Hand:
    parameters = hand.parameters.copy()
    parameters[ROW["coulomb_friction.torque_nm"], hand.joints.index(JOINT)] = 0.01
    return replace(hand, parameters=parameters)


def _record(hand: Hand, seconds: float, period_s: float = PERIOD_S, seed: int = SEED) -> Signals:
    """Random steps and slow ramps of every joint in turn, with sensor noise."""
    rng = np.random.default_rng(seed)
    count, joints = round(seconds / period_s), len(hand.joints)
    held, ramp, turn = (round(t / period_s) for t in (1.5, 7.5, 30.0))
    steps = np.repeat(rng.uniform(0, 4e5, (count // held + 1, joints)), held, axis=0)[:count]
    ramps = np.array([np.interp(np.arange(count), np.arange(0, count + ramp, ramp), level) for level in
                      rng.uniform(0, 4e5, (joints, count // ramp + 1 + (count % ramp > 0)))]).T  # fmt: skip
    commands = np.where((np.arange(count) // turn % 2 == 0)[:, None], steps, ramps)
    plant = HandPlant(hand, period_s)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    shape, all_joints = commands.shape, np.ones(joints, dtype=bool)
    return Signals(
        name="bench",
        joints=hand.joints,
        period_s=period_s,
        set_point_pa=commands,
        pressure_pa=states[:, P] + 150.0 * rng.standard_normal(shape),
        angle_rad=states[:, PHI] + 5e-4 * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool),
        has_set_point=all_joints,
        has_pressure=all_joints,
    )
