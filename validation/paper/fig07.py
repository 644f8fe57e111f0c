"""Figure 7: force characteristic of the FSR and its cubic calibration in log-log space."""

from __future__ import annotations

import numpy as np

from hand_identification.force_calibration import ForceCalibration, calibrate_force
from hand_model.arrays import Array
from validation.paper.drawing import BLUE, GREY, RED, panels
from validation.paper.result import Progress, Quantity, Reproduction

SPAN_N, SPAN_OHM = (0.1, 100.0), (1e6, 1e4)
"""Ends of the line in Fig. 7."""
C1 = float(np.log10(SPAN_OHM[0] / SPAN_OHM[1]) / np.log10(SPAN_N[1] / SPAN_N[0]))
C0 = float(np.log10(SPAN_OHM[0]) + C1 * np.log10(SPAN_N[0]))
"""Eq. 5 through both ends."""
SUPPLY_V, FULL_N, FULL_V = 5.0, 15.0, 3.0
DIVIDER_OHM = float(10.0 ** (C0 - C1 * np.log10(FULL_N)) * FULL_V / (SUPPLY_V - FULL_V))
"""The resistor that gives Fig. 8's 3 V at 15 N; the paper does not print it."""
BEND = 0.02
"""A slight bend between the ends of the span in log-log space, which a straight line (Eq. 5) would miss."""
NOISE = 0.02


def rig(seed: int, samples: int = 120) -> tuple[Array, Array, Array]:
    """A laboratory scale and a sensor over the range of the paper: force [N], resistance [ohm] and divider voltage [V],
    (samples,) each.
    """
    rng = np.random.default_rng(seed)
    force = np.geomspace(0.1, 100.0, samples)
    log_force = np.log10(force)
    resistance = 10.0 ** (C0 - C1 * log_force + BEND * (log_force + 1.0) * (log_force - 2.0)) * (
        1.0 + NOISE * rng.standard_normal(samples)
    )
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
    low, high = (float(10.0 ** (found.c0 - found.c1 * np.log10(force_n))) for force_n in SPAN_N)
    return Reproduction(
        "fig07",
        "Figure 7: resistance of the force sensor over force",
        "The resistance falls from 10^6 to 10^4 ohm while the force rises from 0.1 to 100 N, nearly straight.",
        f"It falls from {low:.2g} to {high:.2g} ohm; the cubic leaves {found.relative_rms:.1%} of the force, the"
        f" straight line {float(np.sqrt(np.mean((line_force / force - 1.0) ** 2))):.1%}.",
        "The samples are simulated: the paper's are printed as a curve only. 2 % scatter of the resistance is assumed,"
        " which is 3 % of the force by Eq. 5's slope. The rig's line goes through the ends of the paper's span.",
        figure,
        (
            Quantity("fig07_low", "resistance at 0.1 N, Eq. 5 as identified", "ohm", 1e6, low, "read from a log axis"),
            Quantity(
                "fig07_high", "resistance at 100 N, Eq. 5 as identified", "ohm", 1e4, high, "read from a log axis"
            ),
            Quantity("fig07_c0", "c0 of Eq. 5, log10 of ohm", "1", C0, found.c0, "the line between the ends"),
            Quantity("fig07_c1", "c1 of Eq. 5", "1", C1, found.c1, "the line between the ends"),
            Quantity("fig07_cubic", "relative error of the cubic calibration", "%", None, 100 * found.relative_rms),
            Quantity("fig07_line", "relative error of the line", "%", None, 100 * _rms(line_force / force - 1.0)),
        ),
    )


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))
