"""The law in C against the law in Python, on the same recorded inputs; and what a microcontroller needs for it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_control.declared import OUT, OUTPUTS, S, Settings
from hand_control.law import Law
from hand_control.safety_numbers import joint_limits
from hand_control.safety_rules import limits_of
from hand_control.tuning import gains
from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_sim.plant import PHI, HandPlants, P
from validation import cortex_m4
from validation.c_law import CLaw
from validation.paper.step_rig import draw, reference

ROOT = Path(__file__).parents[2]
HAND = load_hand(ROOT / "config" / "hand.yaml")
DT_S = 0.005


def recorded(values: dict[str, Any], ticks: int = 2400) -> tuple[Array, list[Array]]:
    """Gains, and the inputs of the law in a closed loop of steps on plants off by 20 %."""
    settings = Settings.of(HAND, values)
    g = gains(HAND, settings)
    rng = np.random.default_rng(3)
    plants = HandPlants(HAND, draw(HAND, 1, 0.2, rng), DT_S)
    law, target = Law(g), reference(settings)
    inputs: list[Array] = []
    for k in range(ticks):
        state = plants.state[0]
        limit = np.where(np.arange(11) % 3 == 0, 0.04, 0.6)
        angle = state[PHI] + 3e-4 * rng.standard_normal(11)
        pressure = state[P] + 100.0 * rng.standard_normal(11)
        r, v, a = (np.full(11, target[row, k]) for row in range(3))
        given = np.array([r, v, a, limit, angle, pressure])
        inputs.append(given)
        out = law.tick(given, DT_S)
        plants.advance(out[OUT.pressure][None, None].copy())
    return g, inputs


CASES: dict[str, dict[str, Any]] = {
    "everything on": {},
    "fixed gains, back-calculation": {"gain_schedule": False, "adaptation": False, "anti_windup": "back_calculation"},
    "bare PID": {"feed_forward": False, "creep_compensation": False, "deadband_pa": 0.0, "contact_detection": False},
    "torque": {"control_mode": "torque"},
}
FOUND = [S.load, S.drag, S.spread, S.ahead]
"""Rows of the state that the caller fills."""


@pytest.mark.parametrize("name", CASES)
def test_both_laws_agree_on_recorded_inputs(name: str) -> None:
    """Fails when the C law differs from the Python one by more than 1e-6 of full scale, or single precision by 1 %."""
    g, inputs = recorded(CASES[name])
    python, double, single = Law(g), CLaw("double", g), CLaw("float", g)
    worst = {"double": 0.0, "float": 0.0}
    sizes = np.array([6e5, 0.6, 1.0, 1.0, 0.6, 10.0])[:, None]
    for k, given in enumerate(inputs):
        drive, integrate = k % 400 > 5, k % 50 != 0
        want = python.tick(given, DT_S, integrate=integrate, drive=drive)
        for kind, law in (("double", double), ("float", single)):
            got = law.tick(given, DT_S, integrate=integrate, drive=drive)
            rows = range(len(OUTPUTS)) if kind == "double" else (OUT.pressure, OUT.torque, OUT.contact_torque)
            worst[kind] = max(worst[kind], float(np.max(np.abs(got - want)[list(rows)] / sizes[list(rows)])))
    print(f"{name}: largest difference, double {worst['double']:.1e}, single {worst['float']:.1e} of full scale")
    assert worst["double"] < 1e-6
    assert worst["float"] < 1e-2
    assert float(np.max(np.abs(double.state - python.state) / (np.abs(python.state) + 1e-3))) < 1e-6


def test_both_laws_agree_with_found_physics() -> None:
    """Fails when the C law uses a torque, friction or uncertainty from its caller otherwise than the Python law."""
    g, inputs = recorded({}, 800)
    python, plain, double = Law(g), Law(g), CLaw("double", g)
    rng = np.random.default_rng(6)
    worst, changed = 0.0, np.zeros(len(OUTPUTS))
    sizes = np.array([6e5, 0.6, 1.0, 1.0, 0.6, 10.0])[:, None]
    for k, given in enumerate(inputs):
        if k % 10 == 0:
            python.state[FOUND] = double.state[FOUND] = rng.uniform(0.0, 0.03, (4, 11))
        want = python.tick(given, DT_S, drive=k % 400 > 5)
        worst = max(worst, float(np.max(np.abs(double.tick(given, DT_S, drive=k % 400 > 5) - want) / sizes)))
        changed = np.maximum(changed, np.abs(plain.tick(given, DT_S, drive=k % 400 > 5) - want).max(axis=1))
    assert worst < 1e-6
    assert (changed[[OUT.pressure, OUT.torque, OUT.contact_torque]] > [1e3, 1e-2, 1e-2]).all()


def test_not_a_number_keeps_the_last_command() -> None:
    """Fails when a NaN or infinite measurement gets through the C law."""
    g, inputs = recorded({}, 50)
    law = CLaw("float", g)
    for given in inputs:
        before = law.tick(given, DT_S, integrate=True, drive=True)[OUT.pressure].copy()
    broken = inputs[-1].copy()
    broken[4] = np.where(np.arange(11) == 3, np.nan, broken[4])
    out = law.tick(broken, DT_S, integrate=True, drive=True)
    assert np.isfinite(out).all() and out[OUT.pressure][3] == before[3]


def test_the_law_is_not_limited_by_the_layer() -> None:
    """Fails when the torque bound cuts what the law commands within its own torque limit."""
    law = Law(gains(HAND, Settings.of(HAND, {})))
    rng = np.random.default_rng(5)
    ones = np.ones(11)
    for _ in range(200):
        angle = rng.uniform(HAND.limits.low_rad, HAND.limits.high_rad)
        given = np.array([HAND.limits.high_rad, 0 * ones, 0 * ones, HAND.limits.max_torque_nm, angle, 3e5 * ones])
        command = law.tick(given, 0.005)[0]
        for joint, at, pressure in zip(limits_of(joint_limits(HAND)), angle, command, strict=True):
            assert pressure <= joint.torque_ceiling(round(at * 1e6)) + 1


@pytest.mark.skipif(shutil.which(cortex_m4.COMPILER) is None, reason="needs arm-none-eabi-gcc")
@pytest.mark.skipif(shutil.which(cortex_m4.EMULATOR) is None, reason="needs qemu-system-arm")
def test_the_law_fits_a_cortex_m4() -> None:
    """Fails when the law no longer builds for the target, or takes more than half the time of a 1 kHz tick."""
    figures = cortex_m4.measure()
    print(figures)
    assert figures["flash"] < 16e3 and figures["ram"] < 8e3
    assert figures[cortex_m4.SHARE] < 50.0
