"""Set-points of the recordings of a trial: experiments and ordinary working motions."""

from __future__ import annotations

import numpy as np

from validation.trial.arrays import Array

EXPERIMENTS = ("staircase", "triangle", "steps", "multisine", "mixed", "grasps")
HIGHEST_PA = 2.2e5


def set_points(kind: str, frames: int, frame_s: float, joints: int, rng: np.random.Generator) -> Array:
    """Set-points (frames, joints) [Pa] of a motion of EXPERIMENTS; every joint has its own random parameters."""
    return np.column_stack([_of_one_joint(kind, frames, frame_s, rng) for _ in range(joints)])


def _of_one_joint(kind: str, frames: int, frame_s: float, rng: np.random.Generator) -> Array:
    t: Array = np.arange(frames, dtype=np.float64) * frame_s
    low, high = rng.uniform(1e4, 3e4), rng.uniform(0.8, 1.0) * HIGHEST_PA
    if kind == "staircase":
        rungs = np.concatenate([np.linspace(low, high, 6), np.linspace(high, low, 6)[1:]])
        return _held(rungs, t, rng.uniform(1.2, 2.0))
    if kind == "triangle":
        period = rng.uniform(7.0, 12.0)
        return np.asarray(low + (high - low) * np.abs(2.0 * ((t / period + rng.uniform()) % 1.0) - 1.0))
    if kind == "steps":
        return _held(rng.uniform(low, high, 400), t, rng.uniform(0.6, 1.5))
    if kind == "multisine":
        wave = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) / np.sqrt(f) for f in (0.11, 0.27, 0.61, 1.3, 2.9))
        return np.asarray(low + (high - low) * np.clip(0.5 + 0.28 * np.asarray(wave), 0.0, 1.0))
    if kind == "grasps":
        return _grasps(t, low, high, rng)
    parts = ("triangle", "steps", "multisine", "staircase")
    segments = [_of_one_joint(part, -(-frames // 4), frame_s, rng) for part in rng.permutation(parts)]
    return np.concatenate(segments)[:frames]


def _held(values: Array, t: Array, hold_s: float) -> Array:
    """Each value for a time, and all of them again until the end of a long recording."""
    return np.asarray(values[(t / hold_s).astype(int) % len(values)])


def _grasps(t: Array, low: float, high: float, rng: np.random.Generator) -> Array:
    """Smooth closing, holding, opening and pausing, with new parameters each time."""
    out = np.full(len(t), low)
    start = rng.uniform(0.5, 1.5)
    while start < t[-1]:
        rise, hold, top = rng.uniform(0.5, 1.2), rng.uniform(1.0, 3.0), rng.uniform(0.5, 1.0) * high
        ramp = np.clip((t - start) / rise, 0.0, 1.0) - np.clip((t - start - rise - hold) / rise, 0.0, 1.0)
        out += (top - low) * ramp * ramp * (3.0 - 2.0 * ramp)
        start += 2.0 * rise + hold + rng.uniform(0.5, 2.0)
    return out
