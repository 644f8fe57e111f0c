"""Figure 14: steps between 30 and 80 degrees over 30 s, with and without adaptation to the nonlinear plant."""

from __future__ import annotations

import numpy as np

from hand_control.declared import Settings
from validation.paper.creep_rig import description
from validation.paper.drawing import BLUE, GREY, RED, panels
from validation.paper.result import Progress, Quantity, Reproduction
from validation.paper.step_rig import RATE_HZ, draw, run_law, run_pid

PID = (9.94e5, 2.82e7, 2.41e4, 1.6e-3)
"""Kp [Pa/rad], Ki [Pa/(rad s)], Kd [Pa s/rad], filter [s]: the best fixed gains on the nominal plant, found by
differential evolution (`python -m validation.bench --only control` finds them again)."""
HANDS, ERROR = 10, 0.3


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The same plants, steps and noise under both controllers."""
    hand = description()
    settings = Settings.of(hand, {})
    plants = draw(hand, HANDS, ERROR, np.random.default_rng([seed, 1]))
    fixed = run_pid(hand, plants, settings, np.repeat(np.array(PID)[:, None], HANDS * len(hand.joints), axis=1), seed)
    progress(0.5)
    adapted = run_law(hand, plants, settings, seed)
    progress(1.0)
    runs = {"without": fixed, "with": adapted}
    shown = int(np.argsort(fixed.overshoot)[int(0.9 * len(fixed.overshoot))])
    figure, axes = panels(2, 1, 9.0, 5.0, sharex=True)
    time_s = np.arange(len(fixed.angle)) / RATE_HZ
    for axis, (name, run), colour in zip(axes, runs.items(), (RED, BLUE), strict=True):
        axis.plot(time_s, np.degrees(run.reference[0]), color=GREY, lw=1.0, label="reference")
        axis.plot(time_s, np.degrees(run.angle[:, shown]), color=colour, lw=1.0, label=f"{name} adaptation")
        axis.set_ylabel("angle [deg]")
        axis.set_ylim(20.0, 100.0)
        axis.legend(frameon=False, loc="upper center", ncol=2)
    axes[1].set_xlabel("time [s]")
    over = {name: float(100.0 * run.overshoot.max()) for name, run in runs.items()}
    rms = {name: float(run.rms_deg.mean()) for name, run in runs.items()}
    return Reproduction(
        "fig14",
        "Figure 14: position steps without and with adaptation",
        "Steps between 30 and 80 degrees over 30 s are clearly better damped with adaptation than without.",
        f"On {len(fixed.overshoot)} joints whose constants are off by up to {ERROR:.0%} each, the largest overshoot"
        f" falls from {over['without']:.1f} to {over['with']:.1f} % of the step, the mean RMS error from"
        f" {rms['without']:.2f} to {rms['with']:.2f} degrees.",
        "The paper prints neither gains nor numbers. Without adaptation: the best fixed-gain PID in pressure that an"
        " optimiser finds on the nominal plant. With: the controller of this stack. Shown is the joint at the 90th"
        " percentile of overshoot without adaptation.",
        figure,
        tuple(
            Quantity(f"fig14_{key}_{name}", f"{label}, {name} adaptation", unit, None, values[name])
            for key, label, unit, values in (
                ("overshoot", "largest overshoot", "%", over),
                ("rms", "mean RMS error", "deg", rms),
            )
            for name in runs
        ),
    )
