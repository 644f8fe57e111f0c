"""What the diagnosis finds, used by the controller: tracking error on a mismatched plant before and after, by effect.

One joint of a hand has physics that its description lacks, in equations of another form than the catalogue's
(`rough_plant`). `python -m validation.bench.found_models` records random motion of that plant, diagnoses it and stores
the patch that the diagnosis writes. The controller then drives the same plant once with the nominal description and
once with that patch. Steps and sines of all joints; the error is that of the joint with the effect against the
controller's reference, with sensor noise in recording and control.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.yaml_patch import patched_text, read_patch
from hand_recording.signals import Signals
from validation.bench.result import figure
from validation.bench.rough_plant import PHI, SPEED, P, Q, RoughPlants, nominal, partners

SEED, JOINT = 20261125, "index_distal"
NOISE_RAD, NOISE_PA = float(np.radians(0.03)), 150.0
PERIOD_S, RECORDED_S = 0.01, 30.0
MODELS = Path(__file__).with_name("found")
"""Patches of config/hand.yaml by diagnoses."""
HIDDEN: dict[str, dict[str, float]] = {
    "friction": {"friction": 0.006},
    "weight": {"weight": 0.025, "attitude": float(np.radians(-20.0))},
    "load": {"load": 0.02},
    "creep": {"yielding": float(np.radians(60.0))},
    "leak": {"hole": 1.5},
    "stiffening": {"rubber": 0.003},
    "valve delay": {"delay": 0.03},
    "valve dead band": {"overlap": 1.0e4},
    "liquid": {"liquid": 2.0e-12},
    "coupling": {"skin": 0.02},
}
"""Rows of the plant and their values, by what they are."""
QUICK = ("friction",)
STEPS_DEG, EACH_S = (30.0, 60.0, 45.0, 20.0, 55.0), 1.5
SINE_S, SETTLE_S, BEGUN_S = 8.0, 3.0, 0.5
"""Duration of the sines, time before the steps, and time after which the sines have begun [s]."""


def run(quick: bool) -> list[dict[str, Any]]:
    """RMS errors with the found model, before and after; quick: of one effect."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    results = []
    for name in QUICK if quick else HIDDEN:
        q = plant_of(hand, name)
        before, after = tracking(hand, q), tracking(found_model(hand, name), q)
        for part, what in enumerate(("smooth motion", "steps")):
            goal = 1.0 if part == 0 else None  # the first moments of a step are those of dead time and valve
            line = f"{name}: RMS error of {what} (reference: nominal description)"
            results.append(figure(line, after[part], goal, "deg", before[part]))
    exact = tracking(hand, nominal(hand, 1))
    return [
        *results,
        figure("nothing hidden: RMS error of smooth motion", exact[0], None, "deg"),
        figure("nothing hidden: RMS error of steps", exact[1], None, "deg"),
    ]


def plant_of(hand: Hand, name: str) -> Array:
    """The plants (ROWS, joints), SI, of one hand whose joint JOINT has the physics `name` of HIDDEN."""
    q = nominal(hand, 1)
    for row, value in HIDDEN[name].items():
        q[Q[row], hand.joints.index(JOINT)] = value
    return q


def record(hand: Hand, q: Array) -> Signals:
    """A recording of RECORDED_S of plants q (ROWS, joints), SI: stairs, triangles and random steps of pressure."""
    rng = np.random.default_rng([SEED, 1])
    joints, count = len(hand.joints), round(RECORDED_S / PERIOD_S)
    t = np.arange(count) * PERIOD_S
    command = np.empty((count, joints))
    for joint in range(joints):
        phase = rng.uniform(0.0, 9.0)
        stairs = 2e4 + 2.0e5 * np.abs((((t + phase) // 2.0) % 10) / 5.0 - 1.0)
        triangle = 2e4 + 2.0e5 * np.abs((((t + phase) / 9.0) % 2.0) - 1.0)
        steps = rng.uniform(2e4, 2.2e5, count)[((t + phase) / 1.1).astype(int)]
        third = RECORDED_S / 3
        command[:, joint] = np.where(t < third, stairs, np.where(t < 2 * third, triangle, steps))
    plants, states = RoughPlants(q, partners(hand, 1), PERIOD_S), []
    for set_points in command:
        states.append(plants.state[[P, PHI]].copy())
        plants.advance(set_points)
    pressure, angle = np.array(states).transpose(1, 0, 2)
    all_joints, shape = np.ones(joints, dtype=np.bool_), command.shape
    return Signals(
        name="recording",
        joints=hand.joints,
        period_s=PERIOD_S,
        set_point_pa=command,
        pressure_pa=pressure + NOISE_PA * rng.standard_normal(shape),
        angle_rad=angle + NOISE_RAD * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=np.bool_),
        has_set_point=all_joints,
        has_pressure=all_joints,
    )


def found_model(hand: Hand, name: str) -> Hand:
    """The description with the stored patch of the diagnosis of `name`."""
    text = patched_text(hand.path, read_patch(MODELS / f"{name.replace(' ', '_')}.yaml"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.yaml"
        path.write_text(text, encoding="utf-8")
        return load_hand(path)


def tracking(model: Hand, q: Array) -> tuple[float, float]:
    """RMS errors [deg] of JOINT in sines and in steps, on plants q (ROWS, joints); inf where the hand is vented."""
    rng = np.random.default_rng([SEED, 2])
    settings = Settings.of(model, {})
    controller, plants = Controller(model, settings), RoughPlants(q, partners(model, 1), 1.0 / model.rate_hz)
    joint, joints = model.joints.index(JOINT), len(model.joints)
    period_ns, now_ns = round(1e9 / model.rate_hz), 10**9
    controller.enable(True)
    stepped = SETTLE_S + len(STEPS_DEG) * EACH_S
    steps: list[float] = []
    sines: list[float] = []
    for k in range(round((stepped + SINE_S) * model.rate_hz)):
        t, now_ns = k / model.rate_hz, now_ns + period_ns
        times = Times(now_ns, now_ns, now_ns)
        shape = plants.state[PHI].shape
        angle = plants.state[PHI] + NOISE_RAD * rng.standard_normal(shape)
        pressure = np.maximum(plants.state[P] + NOISE_PA * rng.standard_normal(shape), 0.0)
        tick = controller.frame(times, angle, plants.state[SPEED].copy(), pressure)
        if tick is None or (k > 0 and controller.safety.phase.value != "controlling"):
            print(f"vented: {controller.safety.fault}")
            return float("inf"), float("inf")
        error = float(np.degrees(tick.reference[joint] - plants.state[PHI, joint]))
        if SETTLE_S < t <= stepped:
            steps.append(error)
        elif t > stepped + BEGUN_S:
            sines.append(error)
        controller.command(times, model.joints, target(t, joints).tolist(), [])
        plants.advance(tick.pressure_command)
    return float(np.sqrt(np.mean(np.square(sines)))), float(np.sqrt(np.mean(np.square(steps))))


def target(t: float, joints: int) -> Array:
    """Angles (joints,) [rad] at the time t [s]: steps, then sines of 0.4 Hz; neighbours move differently."""
    if t < SETTLE_S + len(STEPS_DEG) * EACH_S:
        step = int(max(t - SETTLE_S, 0.0) / EACH_S)
        return np.radians([STEPS_DEG[(step + joint) % len(STEPS_DEG)] for joint in range(joints)])
    phase = 2.0 * np.pi * (0.4 * t + np.arange(joints) / joints)
    return np.asarray(np.radians(40.0 + 20.0 * np.sin(phase)), dtype=np.float64)
