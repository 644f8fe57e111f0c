"""The controller, the best fixed-gain PID and simple-pid on the steps of Fig. 14; torque limits and contact.

Plants differ from the model by up to 30 % in a0 ... a3, J and d, each constant independently, with creep on. Every
controller gets the same plants, noise, seeds and reference. The fixed gains are the best that differential evolution
finds on the nominal plant. In the obstacle runs the controller's model is each plant's own within 2 %.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from simple_pid import PID

from hand_control.declared import Settings
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from validation.bench.result import figure
from validation.paper.obstacle_rig import Trial, close_on_obstacles
from validation.paper.step_rig import RATE_HZ, Run, closed_loop, draw, reference, run_law, run_pid, tune_pid

ERROR, IDENTIFIED = 0.3, 0.02
SEED = 20261121


def run(quick: bool) -> list[dict[str, Any]]:
    """Steps, stability and obstacles; quick: few plants, a short search for the PID's gains."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    settings = Settings.of(hand, {})
    pid = tune_pid(hand, settings, SEED, 1 if quick else 40)
    print(f"best fixed gains Kp {pid[0]:.3g} Pa/rad, Ki {pid[1]:.3g}, Kd {pid[2]:.3g}, filter {pid[3]:.2g} s")
    compared = draw(hand, 2 if quick else 100, ERROR, np.random.default_rng([SEED, 1]))
    joints = compared.shape[0] * compared.shape[2]
    fixed = run_pid(hand, compared, settings, np.repeat(pid[:, None], joints, axis=1), SEED)
    ours = run_law(hand, compared, settings, SEED)
    simple = run_simple_pid(hand, compared[:1], settings, pid, SEED)
    results = [
        figure(
            "steps: mean RMS error to the target (reference: fixed PID)",
            _mean(ours.rms_deg), 0.5, "deg", _mean(fixed.rms_deg),
        ),
        figure(
            "steps: mean RMS error to the unfiltered steps (reference: fixed PID)",
            _mean(ours.rms_step_deg), None, "deg", _mean(fixed.rms_step_deg),
        ),
        figure(
            "steps: mean RMS error of one hand (reference: simple-pid)",
            _mean(ours.rms_deg[:11]), 0.5, "deg", _mean(simple.rms_deg),
        ),
        figure("steps: valve travel (reference: fixed PID)", _mean(ours.travel_pa), 1.0, "Pa", _mean(fixed.travel_pa)),
        figure("steps: largest overshoot of this controller", 100 * ours.overshoot.max(), 5.0, "%"),
        figure("steps: largest overshoot of the fixed PID", 100 * fixed.overshoot.max(), None, "%"),
    ]  # fmt: skip
    hands = 2 if quick else 1000
    return results + monte_carlo(hand, settings, hands) + obstacles(hand, settings, hands)


def _mean(values: Array) -> float:
    return float(values.mean())


def monte_carlo(hand: Hand, settings: Settings, hands: int) -> list[dict[str, Any]]:
    """Stability on plants 30 % off: a joint counts as unstable that still swings in the last second of a step."""
    overshoot, swing = [], []
    for begin in range(0, hands, 100):
        count = min(100, hands - begin)
        plants = draw(hand, count, ERROR, np.random.default_rng([SEED, 2, begin]))
        done = run_law(hand, plants, settings, SEED + begin)
        tail = done.angle.reshape(10, -1, done.angle.shape[1])[:, -round(RATE_HZ) :]
        swing.append(np.degrees(np.ptp(tail, axis=1).max(axis=0)))
        overshoot.append(done.overshoot)
    all_over, all_swing = np.concatenate(overshoot), np.concatenate(swing)
    return [
        figure("many plants: joints that swing by more than 3 degrees at rest", (all_swing > 3.0).sum(), 0.0, ""),
        figure("many plants: number of joints", len(all_swing), None, ""),
        figure("many plants: 99.9th percentile of the overshoot", 100 * np.quantile(all_over, 0.999), 5.0, "%"),
        figure("many plants: largest overshoot", 100 * all_over.max(), 5.0, "%"),
    ]


def obstacles(hand: Hand, settings: Settings, hands: int) -> list[dict[str, Any]]:
    """Torque held against a rigid obstacle; contact found by the model, and by force sensors."""
    trials = [
        close_on_obstacles(hand, min(100, hands - begin), settings, SEED + begin, IDENTIFIED)
        for begin in range(0, hands, 100)
    ]
    free = close_on_obstacles(hand, min(hands, 300), settings, SEED + 7, IDENTIFIED, obstacle=False)
    configured = settings.contact_false_alarms_per_hour

    def of(name: str) -> Array:
        return np.concatenate([np.asarray(getattr(trial, name)) for trial in trials])

    able = ~np.isnan(of("met")) & of("able")
    off = np.abs(of("held") / of("limit") - 1.0)[able]
    above = (of("peak") / of("limit"))[able] - 1.0
    delay, late = (of("by_model") - of("met"))[able], (of("by_force") - of("met"))[able]
    early = [100 * of(name)[able].mean() for name in ("false_model", "false_force")]
    return [
        figure("obstacle: joints whose torque is off its limit by over 10 %", 100 * (off > 0.1).mean(), 0.5, "%"),
        figure("obstacle: 99th percentile of that difference", 100 * np.quantile(off, 0.99), 10.0, "%"),
        figure("obstacle: largest torque above the limit", 100 * above.max(), 15.0, "%"),
        figure(
            "contact: median delay (reference: force sensor)",
            1e3 * np.nanmedian(delay),
            None,
            "ms",
            1e3 * np.nanmedian(late),
        ),
        figure(
            "contact: missed (reference: force sensor)",
            100 * np.isnan(delay).mean(),
            None,
            "%",
            100 * np.isnan(late).mean(),
        ),
        figure("contact: reported too early (reference: force sensor)", early[0], None, "%", early[1]),
        figure(f"contact: false alarms per joint, {configured:g} per hour configured", _alarms(free), None, "1/h"),
    ]


def _alarms(trial: Trial) -> float:
    return float((~np.isnan(trial.by_model)).sum() / trial.hours)


def run_simple_pid(hand: Hand, parameters: Array, settings: Settings, pid: Array, seed: int) -> Run:
    """simple-pid with fixed gains, SI, one object per joint; its derivative has no filter.

    parameters: (rows, joints).  pid: (gains, joints).
    """
    objects = [
        PID(*pid[:3], sample_time=None, output_limits=(0.0, 6e5), differential_on_measurement=True)
        for _ in range(parameters.shape[2])
    ]

    def control(target: Array, angle: Array, _pressure: Array) -> Array:
        for pid_object in objects:
            pid_object.setpoint = float(target[0])
        pairs = zip(objects, angle, strict=True)
        return np.array([pid_object(float(measured), 1.0 / RATE_HZ) for pid_object, measured in pairs])

    return closed_loop(hand, parameters, reference(settings), control, seed)
