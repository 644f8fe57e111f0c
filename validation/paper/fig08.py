"""Figure 8: voltage and sensitivity of the force sensor's divider."""

from __future__ import annotations

import numpy as np

from hand_model.sensors import fsr_ratio
from hand_pages.plots import Curve, Panel, Plot
from validation.paper.drawing import BLUE, RED, panels
from validation.paper.fig07 import C0, C1, DIVIDER_OHM, SUPPLY_V, calibration
from validation.paper.result import Progress, Quantity, Reproduction


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The divider's voltage over 0 ... 15 N and its slope."""
    force = np.linspace(0.1, 15.0, 300)
    voltage = np.array([SUPPLY_V * float(fsr_ratio(f, C0, C1, DIVIDER_OHM, 0.0)) for f in force])
    slope = calibration(seed).sensitivity_v_per_n(force)
    progress(1.0)
    figure, (left, right) = panels(1, 2, 9.0, 3.4)
    left.plot(force, voltage, color=BLUE)
    left.set(xlabel="force [N]", ylabel="divider voltage [V]", ylim=(0, None))
    right.plot(force, slope, color=RED)
    right.set(xlabel="force [N]", ylabel="sensitivity [V/N]", ylim=(0, None))
    share = float((np.interp(5.0, force, voltage) - voltage[0]) / (voltage[-1] - voltage[0]))
    gets = f"This code reaches {voltage[-1]:.2f} V at 15 N and {share:.0%} of its rise up to 5 N."
    shown = [
        Panel("divider voltage [V]", [Curve("voltage", "after", force, voltage)], zero=True),
        Panel("sensitivity [V/N]", [Curve("sensitivity", "before", force, slope)], zero=True),
    ]
    return Reproduction(
        "fig08",
        "Figure 8: the divider's voltage over force",
        "The voltage rises from 0 to 3 V between 0 and 15 N, steeply up to 5 N.",
        gets,
        "The resistor of the divider is chosen for 3 V at 15 N, so only the shape is a result.",
        figure,
        (
            Quantity(
                "fig08_full", "voltage at 15 N", "V", 3.0, float(voltage[-1]), "the divider's resistor is chosen so"
            ),
            Quantity("fig08_steep", "share of the rise below 5 N", "1", None, share, "the paper says: steep"),
        ),
        (Plot(label="force [N]", panels=shown, alt=gets),),
    )
