"""What the warm-up of a controller loads is what its frames call."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent

CODE = """
import sys
from dataclasses import replace
import numpy as np
from numba.core.registry import CPUDispatcher
from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_control.warm_up import warm_up
from hand_model.description import load_hand

def loaded():
    functions = {}
    for name, module in list(sys.modules.items()):
        if name.startswith(("hand_control", "hand_model")):
            for key, value in vars(module).items():
                if isinstance(value, CPUDispatcher):
                    functions[f"{value.py_func.__module__}.{key}"] = len(value.signatures)
    return functions

hand = load_hand("config/hand.yaml")
settings = Settings.of(hand, {})
warm_up(hand, settings)
before = loaded()
assert before["hand_control.law._tick"] == 1, before
controller = Controller(hand, replace(settings, path_tolerance_deg=170.0, goal_tolerance_deg=170.0))
controller.enable(True)
noise, count = np.random.default_rng(3), len(hand.joints)
angle, pressure = np.zeros(count), np.zeros(count)
for k in range(1, 401):
    now = Times(*3 * [k * 5_000_000])
    if k == 100:
        controller.command(now, list(hand.joints), [0.5] * count, [])
    if k == 250:
        controller.trajectory(now, list(hand.joints), [(0.5, [0.7] * count, [])])
    read = angle + 1e-3 * noise.standard_normal(count), pressure + 200.0 * noise.standard_normal(count)
    controller.forces(now.stamp_ns, np.abs(noise.standard_normal(len(hand.sensors.sites))))
    tick = controller.frame(now, read[0], np.zeros(count), read[1])
    pressure += 0.2 * (tick.pressure_command - pressure)
    angle += 0.02 * (pressure / 4e5 - angle)
assert pressure.max() > 1e3, "the hand was not driven"
print({name: count for name, count in loaded().items() if count != before.get(name, 0)})
"""


def test_no_frame_compiles_what_the_warm_up_has_not() -> None:
    """Fails when a function is compiled or loaded in the middle of a motion, where the frame would be late.

    The controller vents a hand whose sensor data wait for 100 ms: the first readings of force sensors did that.
    """
    done = subprocess.run([sys.executable, "-c", CODE], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "{}"
