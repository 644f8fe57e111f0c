"""The residual of a model with its noise reduced over windows that fit each sample: none of it where it is only noise.

Where a model is right, its residual is white noise, and any smoothing of it leaves a slow wander; where the model is
wrong, the residual has edges that a long window would spread. The window of a sample is the longest one whose estimate
agrees with those of all shorter ones, which is the rule of intersecting confidence intervals (Goldenshluger and
Nemirovski 1997; Katkovnik 1999). The longest of all is the estimate zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from hand_model.arrays import Array
from hand_recording.settings import READING
from hand_recording.signals import middle_weights, smoothed_over, smoothing_spans

Windows = NDArray[np.int64]
"""(T,) window of each sample [samples]: 1 keeps the sample as it is, NOISE takes it away."""
NOISE = 0


def local_windows(residual: Array, period_s: float, noise: Array) -> Windows:
    """Window [samples] of each sample of a residual (T,) with white noise, standard deviations `noise` (T,)."""
    windows = np.ones(len(residual), dtype=np.int64)
    low, high = residual - READING.window_confidence * noise, residual + READING.window_confidence * noise
    agree = np.ones(len(residual), dtype=bool)
    for span in smoothing_spans(residual, period_s):
        estimate = smoothed_over(residual, span)
        own = float(middle_weights(span)[span // 2])
        reach = READING.window_confidence * np.sqrt(own * uniform_filter1d(noise**2, span))
        low, high = np.maximum(low, estimate - reach), np.minimum(high, estimate + reach)
        agree &= low <= high
        windows[agree] = span
    windows[agree & (low <= 0.0) & (high >= 0.0)] = NOISE
    return windows


def smoothed_by(values: Array, windows: Windows) -> Array:
    """Values (T,) [any unit] smoothed by quadratics, each over its own window."""
    smooth = np.where(windows == NOISE, 0.0, values)
    for span in np.unique(windows[windows > 1]):
        chosen = windows == span
        smooth[chosen] = smoothed_over(values, int(span))[chosen]
    return smooth
