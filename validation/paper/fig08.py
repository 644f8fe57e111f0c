"""Figure 8: voltage and sensitivity of the force sensor's divider."""

from __future__ import annotations

import numpy as np

from validation.paper.drawing import BLUE, RED, panels
from validation.paper.fig07 import DIVIDER_OHM, SUPPLY_V, calibration, fsr_resistance
from validation.paper.result import Progress, Quantity, Reproduction


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The divider's voltage over 0 ... 15 N and its slope."""
    force = np.linspace(0.1, 15.0, 300)
    voltage = np.array([SUPPLY_V * DIVIDER_OHM / (float(fsr_resistance(f)) + DIVIDER_OHM) for f in force])
    slope = calibration(seed).sensitivity_v_per_n(force)
    progress(1.0)
    figure, (left, right) = panels(1, 2, 9.0, 3.4)
    left.plot(force, voltage, color=BLUE)
    left.set(xlabel="force [N]", ylabel="divider voltage [V]", ylim=(0, None))
    right.plot(force, slope, color=RED)
    right.set(xlabel="force [N]", ylabel="sensitivity [V/N]", ylim=(0, None))
    share = float((np.interp(5.0, force, voltage) - voltage[0]) / (voltage[-1] - voltage[0]))
    return Reproduction(
        "fig08",
        "Figure 8: the divider's voltage over force",
        "The voltage rises from 0 to 3 V between 0 and 15 N, steeply up to 5 N.",
        f"Ours reaches {voltage[-1]:.2f} V at 15 N and does {share:.0%} of its rise up to 5 N.",
        "",
        figure,
        (
            Quantity("fig08_full", "voltage at 15 N", "V", 3.0, float(voltage[-1]), "read from the figure"),
            Quantity("fig08_steep", "share of the rise below 5 N", "1", None, share, "the paper says: steep"),
        ),
    )
