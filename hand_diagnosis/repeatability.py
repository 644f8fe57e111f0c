"""Repeatability from re-runs: what differs between two recordings of the same commands, no model can explain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_identification.joint_problem import FLOOR, SETTLING_S
from hand_model.arrays import Array
from hand_model.chain import OUTPUTS
from hand_recording.signals import Signals, white_noise

SAME_COMMANDS = 0.02
"""RMS difference of the set-points of two runs, relative to their own standard deviation, up to which they are one."""
LATEST_S = 2.0
"""Re-runs may begin this much earlier or later."""


def floors(signals: Sequence[Signals], reruns: Sequence[Signals]) -> dict[str, Array]:
    """Repeatability (OUTPUTS,) SI of each joint: the largest of its re-runs, and never below the practical one.

    Raises ValueError, one line, for a re-run whose commands are those of no recording.
    """
    found: dict[str, Array] = {}
    for rerun in reruns:
        first = next((one for one in signals if _lag(one, rerun) is not None), None)
        if first is None:
            names = ", ".join(one.name for one in signals)
            raise ValueError(f"{rerun.name} is no re-run: its set-points are those of none of {names}")
        lag = _lag(first, rerun) or 0
        for joint in first.joints:
            if joint in rerun.joints:
                differing = _difference(first, rerun, joint, lag)
                found[joint] = np.maximum(found.get(joint, np.array(FLOOR)), differing)
    return found


def _lag(first: Signals, rerun: Signals) -> int | None:
    """Samples by which the commands of a re-run come later; None where they are others."""
    if not np.isclose(first.period_s, rerun.period_s, rtol=0.01) or first.joints != rerun.joints:
        return None
    most = round(LATEST_S / first.period_s)
    errors = {}
    for lag in range(-most, most + 1):
        a, b = _overlap(first.set_point_pa, rerun.set_point_pa, lag)
        if len(a) > most:
            errors[lag] = float(np.sqrt(np.mean((a - b) ** 2)))
    if not errors:
        return None
    best = min(errors, key=lambda lag: errors[lag])
    return best if errors[best] <= SAME_COMMANDS * float(first.set_point_pa.std()) else None


def _overlap(first: NDArray[Any], second: NDArray[Any], lag: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """The parts of two signals that belong together where the second comes lag samples later."""
    a, b = (first, second[lag:]) if lag >= 0 else (first[-lag:], second)
    count = min(len(a), len(b))
    return a[:count], b[:count]


def _difference(first: Signals, rerun: Signals, joint: str, lag: int) -> Array:
    """Scatter (OUTPUTS,) of one run: RMS difference of two over the root of two, white noise taken off."""
    i, j = first.joints.index(joint), rerun.joints.index(joint)
    scatter = np.zeros(OUTPUTS)
    known = _overlap(first.known[:, i], rerun.known[:, j], lag)
    for stage, (a, b) in enumerate(
        (
            (first.pressure_pa[:, i], rerun.pressure_pa[:, j]),
            (first.angle_rad[:, i], rerun.angle_rad[:, j]),
            (first.force_n[:, i], rerun.force_n[:, j]),
        )
    ):
        one, other = _overlap(a, b, lag)
        change = np.where(known[0] & known[1], one - other, np.nan)[round(SETTLING_S / first.period_s) :]
        change = change[np.isfinite(change)]
        if len(change) > 3:
            scatter[stage] = np.sqrt(max(float(np.mean(change**2)) - white_noise(change) ** 2, 0.0) / 2.0)
    return scatter
