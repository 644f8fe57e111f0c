"""Impacts on end stops. How one passes depends on the material of the stop, which no description of a hand states."""

from __future__ import annotations

import numpy as np

from hand_identification.settings import FITS
from hand_model.arrays import Array, Flags
from hand_model.joint_model import JointModel
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals, derivatives


def impacts(signals: Signals, model: JointModel, joint: str) -> Flags:
    """Samples (T,) of a recording at which a joint, or the one that it shares inertia with, has just hit a stop.

    Of another machine, none: its stops are out of reach unless its description has them.
    """
    if signals.machine:
        return np.zeros(signals.samples, dtype=bool)
    index = model.joints.index(joint)
    partner = int(model.partner[index])
    pair = [each for each in (index, partner) if each >= 0 and model.joints[each] in signals.joints]
    hits = np.zeros(signals.samples, dtype=bool)
    for each in pair:
        low, high = (float(model.parameters[ROW[f"end_stop.{end}_deg"], each]) for end in ("low", "high"))
        column = signals.joints.index(model.joints[each])
        hits |= hitting(signals.angle_rad[:, column], signals.period_s, low, high)
    return lasting(hits, round(FITS.impact_s / signals.period_s))


def hitting(angle_rad: Array, period_s: float, low_rad: float, high_rad: float) -> Flags:
    """Samples (T,) at which angles (T,) [rad] are close to one of two stops and approach it fast."""
    speed = derivatives(angle_rad[:, None], period_s)[0][:, 0]
    margin = FITS.impact_margin * (high_rad - low_rad)
    up = (angle_rad > high_rad - margin) & (speed > FITS.impact_rad_s)
    down = (angle_rad < low_rad + margin) & (speed < -FITS.impact_rad_s)
    return np.asarray(up | down, dtype=bool)


def lasting(hits: Flags, samples: int) -> Flags:
    """Samples (T,) that are flagged or follow a flagged one by at most this number of samples."""
    latest = np.maximum.accumulate(np.where(hits, np.arange(len(hits)), -len(hits) - samples))
    return np.asarray(np.arange(len(hits)) - latest <= samples, dtype=bool)
