"""Figure 14: steps between 30 and 80 degrees over 30 s, with and without adaptation to the nonlinear plant."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_control.law import PRESSURE, Law, gains
from hand_control.settings import Settings
from hand_control.shaping import Shaper
from hand_model.description import Hand
from hand_model.statics import pressure_for_torque
from hand_paper.creep_rig import description
from hand_paper.drawing import BLUE, GREY, RED, panels
from hand_paper.result import Progress, Quantity, Reproduction
from hand_sim.plant import OMEGA, PHI, HandPlant, P

Array = NDArray[np.float64]
RATE_HZ, DURATION_S, HOLD_S = 200.0, 30.0, 3.0
LOW_RAD, HIGH_RAD = np.radians([30.0, 80.0])
NOISE_RAD = np.radians(0.05)
KP_PA, KI_PA, KD_PA = 1.6e5, 1.1e6, 1.2e4
"""A fixed-gain PID in pressure, tuned for a brisk step at 30 degrees, where the joint is stiffest against pressure."""


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The same plant, steps and noise under both controllers."""
    hand = description()
    reference = _steps()
    adapted = _run_model_based(hand, reference, seed)
    progress(0.5)
    fixed = _run_fixed(hand, reference, seed)
    progress(1.0)
    runs = {"without": fixed, "with": adapted}
    quality = {name: _quality(reference, angle) for name, angle in runs.items()}
    figure, axes = panels(2, 1, 9.0, 5.0, sharex=True)
    time_s = np.arange(len(reference)) / RATE_HZ
    for axis, (name, angle), colour in zip(axes, runs.items(), (RED, BLUE), strict=True):
        axis.plot(time_s, np.degrees(reference), color=GREY, lw=1.0, label="reference")
        axis.plot(time_s, np.degrees(angle), color=colour, lw=1.0, label=f"{name} adaptation")
        axis.set_ylabel("angle [deg]")
        axis.legend(frameon=False, loc="upper right")
    axes[1].set_xlabel("time [s]")
    return Reproduction(
        "fig14",
        "Figure 14: position steps without and with adaptation",
        "Steps between 30 and 80 degrees over 30 s are clearly better damped with adaptation than without.",
        f"Overshoot falls from {quality['without'][0]:.0%} to {quality['with'][0]:.0%} of the step, the RMS error from"
        f" {quality['without'][1]:.1f} to {quality['with'][1]:.1f} degrees.",
        "The paper prints neither gains nor numbers. Without adaptation: a fixed-gain PID in pressure. With: the"
        " controller of this stack, whose gains and feed-forward follow the model over angle and pressure.",
        figure,
        tuple(
            Quantity(f"fig14_{key}_{name}", f"{label}, {name} adaptation", unit, None, float(scale * quality[name][k]))
            for k, (key, label, unit, scale) in enumerate(
                (("overshoot", "largest overshoot", "%", 100.0), ("rms", "RMS error", "deg", 1.0))
            )
            for name in runs
        ),
    )


def _steps() -> Array:
    count = round(DURATION_S * RATE_HZ)
    return np.asarray(np.where((np.arange(count) / (HOLD_S * RATE_HZ)).astype(int) % 2 == 1, HIGH_RAD, LOW_RAD))


def _start(hand: Hand) -> HandPlant:
    plant = HandPlant(hand, 1.0 / RATE_HZ)
    hold = np.array([pressure_for_torque(0.0, LOW_RAD, 0.0, *row, 0.0) for row in hand.parameters[4:8].T])
    plant.advance(np.repeat(hold[None], round(3.0 * RATE_HZ), axis=0))
    return plant


def _run_model_based(hand: Hand, reference: Array, seed: int) -> Array:
    rng = np.random.default_rng([seed, 14])
    settings = Settings.of(hand, {})
    law = Law(gains(hand, settings.kp, settings.ki, settings.kd, settings.integral_limit))
    shaper = Shaper(len(hand.joints))
    plant = _start(hand)
    shaper.latch(plant.state[PHI])
    angles = np.empty(len(reference))
    for k, target in enumerate(reference):
        state = plant.state
        shaper.step(
            np.full(len(hand.joints), target), np.zeros(len(hand.joints)), settings.bandwidth_rad_s,
            settings.max_speed_rad_s, 1.0 / RATE_HZ,
        )  # fmt: skip
        measured = state[PHI] + NOISE_RAD * rng.standard_normal(len(hand.joints))
        limit = hand.limits.max_torque_nm
        out: Any = law.tick(shaper.r, shaper.v, limit, measured, state[OMEGA], state[P], 1.0 / RATE_HZ)
        plant.advance(out[PRESSURE][None].copy())
        angles[k] = state[PHI, 0]
    return angles


def _run_fixed(hand: Hand, reference: Array, seed: int) -> Array:
    rng = np.random.default_rng([seed, 14])
    plant = _start(hand)
    hold = plant.state[P].copy()
    integral = np.zeros(len(hand.joints))
    angles = np.empty(len(reference))
    for k, target in enumerate(reference):
        state = plant.state
        error = target - state[PHI] - NOISE_RAD * rng.standard_normal(len(hand.joints))
        wanted = hold + KP_PA * error + integral - KD_PA * state[OMEGA]
        command = np.clip(wanted, 0.0, hand.limits.max_pressure_pa)
        integral += np.where(command == wanted, KI_PA * error / RATE_HZ, 0.0)
        plant.advance(command[None])
        angles[k] = state[PHI, 0]
    return angles


def _quality(reference: Array, angle: Array) -> tuple[float, float]:
    """Largest overshoot as a share of the step, and the RMS error [deg]."""
    over = 0.0
    step = HIGH_RAD - LOW_RAD
    edges = [*np.flatnonzero(np.diff(reference) != 0.0), len(reference) - 1]
    for begin, end in itertools.pairwise(edges):
        rising = reference[begin + 1] > reference[begin]
        part = angle[begin + 1 : end]
        peak = part.max() - HIGH_RAD if rising else LOW_RAD - part.min()
        over = max(over, float(peak / step))
    return over, float(np.degrees(np.sqrt(np.mean((reference - angle) ** 2))))
