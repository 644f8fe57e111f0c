"""The window over which a recorded motion is differentiated, from its noise and its bandwidth, or from the force.

A short window amplifies the noise of the readings, and a long one flattens what the motion really does. Of the windows,
the one with the lowest sum of both is taken, as in Goldenshluger and Lepski (2011): the error of a window by flattening
is how far its acceleration is from those of all shorter windows, beyond what their noise explains.

Where the force is measured too, and a model is fitted to it, the force decides: the shortest window is taken from
whose motion a regression explains it nearly best. Noise of the position that is not white, as steps of an encoder or
irregular times, shows there and not in the position alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from hand_machine.description import MachineDescription
from hand_machine.reading import Readings
from hand_machine.settings import MACHINE
from hand_model.arrays import Array
from hand_recording.settings import READING

ORDER, HALF_SAMPLES = 3, 2
"""Order of the polynomials, and half of the shortest window [samples]."""
DIFFERENCES = 6
"""Order of the differences that show the noise: a motion up to a tenth of the sample rate hardly affects them."""


def derivative_window_s(position: Array, period_s: float) -> float:
    """Window [s], from its first sample to its last, for speeds and accelerations of positions (T,) in any unit."""
    spans = _spans(len(position), period_s)
    noise = _noise(position)
    kernels = [savgol_coeffs(span, ORDER, deriv=2, delta=period_s) for span in spans]
    inside = slice(spans[-1] // 2, len(position) - spans[-1] // 2)
    estimates = [savgol_filter(position, span, ORDER, deriv=2, delta=period_s)[inside] for span in spans]
    risks = []
    for index, (kernel, estimate) in enumerate(zip(kernels, estimates, strict=True)):
        bias = 0.0
        for shorter, other in zip(kernels[:index], estimates[:index], strict=True):
            expected = noise**2 * float(np.sum((kernel - _padded(shorter, len(kernel))) ** 2))
            expected *= 1.0 + MACHINE.window_doubt * float(np.sqrt(2.0 * len(shorter) / len(estimate)))
            bias = max(bias, float(np.mean((estimate - other) ** 2)) - expected)
        risks.append(bias + noise**2 * float(np.sum(kernel**2)))
    return (spans[int(np.argmin(risks))] - 1) * period_s


def _noise(position: Array) -> float:
    """Standard deviation of the white noise of positions (T,), at rest that of the readings that change."""
    different = np.abs(np.diff(position, DIFFERENCES))
    if not len(different):
        return 0.0
    # The median is that of a normal distribution; of quantised readings at rest it is 0.
    trimmed = float(np.sqrt(np.mean(np.minimum(different, np.quantile(different, READING.noise_quantile)) ** 2)))
    return max(float(np.median(different)) / 0.6745, READING.quiet_noise_share * trimmed) / math.sqrt(
        math.comb(2 * DIFFERENCES, DIFFERENCES)
    )


def _spans(samples: int, period_s: float) -> list[int]:
    """Odd windows [samples] from the shortest up to the longest one, as far as the recording has samples for it."""
    longest = max(min(MACHINE.longest_window_s / period_s, samples - MACHINE.min_window_samples), 2 * HALF_SAMPLES + 1)
    halves = [HALF_SAMPLES]
    while 2 * (after := max(halves[-1] + 1, round(MACHINE.window_growth * halves[-1]))) + 1 <= longest:
        halves.append(after)
    halves.append(max(halves[-1], int(longest - 1.0) // 2))
    return [2 * half + 1 for half in dict.fromkeys(halves)]


def _padded(kernel: Array, span: int) -> Array:
    around = (span - len(kernel)) // 2
    return np.pad(kernel, around)


def fitting_window_s(described: MachineDescription, tables: Sequence[Readings]) -> float:
    """Window [s] for all recordings of an imposed motion: the shortest whose motion explains the measured force well.

    The measured force is smoothed over it, too, and a long one would blur what it does at a turn.
    """
    shortest = 2 * HALF_SAMPLES * max(table.period_s for table in tables)
    longest = max(MACHINE.longest_window_s, shortest)
    windows = shortest * MACHINE.window_growth ** np.arange(
        math.floor(math.log(longest / shortest) / math.log(MACHINE.window_growth)) + 1
    )
    left = [_unexplained(described, tables, float(window_s)) for window_s in windows]
    return float(windows[int(np.argmax(np.array(left) <= MACHINE.window_as_good**2 * min(left)))])


def _unexplained(described: MachineDescription, tables: Sequence[Readings], window_s: float) -> float:
    """Mean square of the force that a regression on the motion leaves, over all recordings.

    Everything is compared in the band of the longest window: a ripple that no window shows must not decide. The
    direction of the motion is that over the longest window throughout, so that only derivatives differ.
    """
    features, forces = [], []
    for table in tables:
        longest = _span(table, MACHINE.longest_window_s)
        if 2 * longest + MACHINE.min_window_samples > len(table.time_s):
            longest = _span(table, window_s)
        position = table.signals["position"]
        x, v, a = (
            savgol_filter(position, _span(table, window_s), ORDER, deriv=k, delta=table.period_s) for k in range(3)
        )
        slow = savgol_filter(position, longest, ORDER, deriv=1, delta=table.period_s)
        sign = np.tanh(slow / max(MACHINE.turning_speed * float(np.std(slow)), 1e-300))
        given = table.signals["input"]
        columns = [x, v, a, sign, np.ones(len(x)), given, given * sign, given * x]
        columns += [] if described.linear else [np.sin(x), np.cos(x)]
        inside = table.known.copy()
        inside[: longest // 2], inside[len(inside) - longest // 2 :] = False, False
        features.append(savgol_filter(np.column_stack(columns), longest, ORDER, axis=0)[inside])
        forces.append(savgol_filter(table.signals["force"], longest, ORDER)[inside])
    stacked, force = np.concatenate(features), np.concatenate(forces)
    stacked = stacked / np.maximum(np.sqrt(np.mean(stacked**2, axis=0)), 1e-300)
    left = force - stacked @ np.linalg.lstsq(stacked, force, rcond=1e-9)[0]
    return float(np.mean(left**2)) if len(left) else 0.0


def _span(table: Readings, window_s: float) -> int:
    """Odd number of samples of a window, five at least."""
    return min(2 * max(round(window_s / table.period_s / 2.0), HALF_SAMPLES) + 1, (len(table.time_s) - 1) // 2 * 2 + 1)
