"""Time and memory of the diagnosis: one joint for a minute, the whole hand for ten, a Jacobian and one rollout."""

from __future__ import annotations

import multiprocessing
import resource
import statistics
import time
from collections.abc import Callable
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
PARAMETERS = 8
QUICK_S = 15.0


def run(quick: bool) -> list[dict[str, Any]]:
    """Medians; quick: one joint of a shorter recording, once, compilation included."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    duration_s = QUICK_S if quick else 60.0
    signals = _record(_with_friction(hand), duration_s)
    if not quick:
        _one_joint(signals, hand)  # compiles
    seconds = statistics.median(_seconds(lambda: _one_joint(signals, hand)) for _ in range(1 if quick else 3))
    results = [figure(f"diagnosis of one joint, {duration_s:g} s at 200 Hz, full catalogue", seconds, 8.0, "s")]
    results.append(_jacobian(signals, hand, 5 if quick else 25))
    if not quick:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            took_s, megabytes = pool.apply(_whole_hand)
        results.append(figure("diagnosis of eleven joints, 10 minutes at 200 Hz", took_s, 180.0, "s"))
        results.append(figure("peak memory of that process", megabytes * 1e-3, 1.5, "GB"))
    return results


def _one_joint(signals: Signals, hand: Hand) -> None:
    result = diagnose([signals], hand, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=False)
    assert [finding.effect for finding in result.findings] == ["coulomb_friction"], result.findings


def _whole_hand() -> tuple[float, float]:
    """Seconds and peak memory [MB] in a process of its own."""
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    signals = _record(_with_friction(hand), 600.0)
    seconds = _seconds(lambda: diagnose([signals], hand, tolerance=0.05, seed=0, sensor_curve=False))
    return seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


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


def _record(hand: Hand, seconds: float) -> Signals:
    """Random steps and slow ramps of every joint in turn, with sensor noise."""
    rng = np.random.default_rng(SEED)
    count, joints = round(seconds / PERIOD_S), len(hand.joints)
    steps = np.repeat(rng.uniform(0, 4e5, (count // 300 + 1, joints)), 300, axis=0)[:count]
    ramps = np.array([np.interp(np.arange(count), np.arange(0, count + 1500, 1500), level) for level in
                      rng.uniform(0, 4e5, (joints, count // 1500 + 1 + (count % 1500 > 0)))]).T  # fmt: skip
    commands = np.where((np.arange(count) // 6000 % 2 == 0)[:, None], steps, ramps)
    plant = HandPlant(hand, PERIOD_S)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    shape, all_joints = commands.shape, np.ones(joints, dtype=bool)
    return Signals(
        name="bench",
        joints=hand.joints,
        period_s=PERIOD_S,
        set_point_pa=commands,
        pressure_pa=states[:, P] + 150.0 * rng.standard_normal(shape),
        angle_rad=states[:, PHI] + 5e-4 * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool),
        has_set_point=all_joints,
        has_pressure=all_joints,
    )
