"""Figure 7: force characteristic of the FSR and its cubic calibration in log-log space."""

from __future__ import annotations

import numpy as np

from hand_identification.force_calibration import ForceCalibration, calibrate_force
from hand_model.arrays import Array
from hand_model.sensors import fsr_ratio
from validation.paper.drawing import BLUE, GREY, RED, panels
from validation.paper.result import Progress, Quantity, Reproduction

SUPPLY_V, DIVIDER_OHM = 5.0, 2.7e4
C0, C1 = 5.0, 0.67
BEND = 0.02
"""A slight bend of the real characteristic in log-log space, which a straight line (Eq. 5) would miss."""
NOISE = 0.02


def rig(seed: int, samples: int = 120) -> tuple[Array, Array, Array]:
    """A laboratory scale and a sensor over the range of the paper: force [N], resistance [ohm] and divider voltage [V],
    (samples,) each.
    """
    rng = np.random.default_rng(seed)
    force = np.geomspace(0.1, 100.0, samples)
    log_force = np.log10(force)
    resistance = 10.0 ** (C0 - C1 * log_force + BEND * log_force**2) * (1.0 + NOISE * rng.standard_normal(samples))
    return force, resistance, SUPPLY_V * DIVIDER_OHM / (resistance + DIVIDER_OHM)


def calibration(seed: int) -> ForceCalibration:
    """The cubic calibration of that rig."""
    force, _, voltage = rig(seed)
    return calibrate_force(force, voltage, SUPPLY_V, DIVIDER_OHM)


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The rig's samples, Eq. 5's line and the cubic."""
    force, resistance, voltage = rig(seed)
    found = calibration(seed)
    progress(1.0)
    figure, (left, right) = panels(1, 2, 9.0, 3.6)
    left.loglog(force, resistance, ".", color=GREY, ms=3, label="rig samples")
    left.loglog(force, 10.0 ** (found.c0 - found.c1 * np.log10(force)), color=RED, label="Eq. 5, straight line")
    left.loglog(found.force_n(voltage), resistance, color=BLUE, label="cubic in log-log")
    left.set(xlabel="force [N]", ylabel="resistance [ohm]")
    left.legend(frameon=False)
    line_force = 10.0 ** ((found.c0 - np.log10(resistance)) / found.c1)
    right.semilogx(force, 100 * (line_force / force - 1.0), color=RED)
    right.semilogx(force, 100 * (found.force_n(voltage) / force - 1.0), color=BLUE)
    right.set(xlabel="force [N]", ylabel="error of the force [%]")
    low, high = float(fsr_resistance(0.1)), float(fsr_resistance(100.0))
    return Reproduction(
        "fig07",
        "Figure 7: resistance of the force sensor over force",
        "The resistance falls from 10^6 to 10^4 ohm while the force rises from 0.1 to 100 N, nearly straight.",
        f"It falls from {low:.2g} to {high:.2g} ohm; the cubic leaves {found.relative_rms:.1%} of the force, the"
        f" straight line {float(np.sqrt(np.mean((line_force / force - 1.0) ** 2))):.1%}.",
        "The samples are simulated: the paper's are printed as a curve only. 2 % scatter of the resistance is assumed,"
        " which is 3 % of the force by Eq. 5's slope.",
        figure,
        (
            Quantity("fig07_low", "resistance at 0.1 N", "ohm", 1e6, low, "read from a log axis, within a factor"),
            Quantity("fig07_high", "resistance at 100 N", "ohm", 1e4, high, "read from a log axis, within a factor"),
            Quantity("fig07_cubic", "relative error of the cubic calibration", "%", None, 100 * found.relative_rms),
        ),
    )


def fsr_resistance(force_n: float) -> Array:
    """R_S (sites,) [ohm] of the sensors as the hand is described, Eq. 5."""
    ratio = fsr_ratio(force_n, C0, C1, DIVIDER_OHM, 0.0)
    return np.asarray(DIVIDER_OHM * (1.0 / ratio - 1.0))
