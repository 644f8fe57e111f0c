"""How well stated probabilities fit what happened: calibration error, Brier score and log score of claims."""

from __future__ import annotations

import itertools
import math

import numpy as np

Claims = list[tuple[float, bool]]
"""Stated probability of an answer, and whether it was right."""
BINS = (0.0, 0.5, 0.7, 0.85, 0.95, 1.0001)
LEAST = 1e-3
"""A probability counts as at least this and at most 1 - LEAST in the log score, which would be infinite else."""


def reliability(claims: Claims) -> list[dict[str, float]]:
    """Bins of the claimed probability: its mean, the share of right findings, and their number."""
    out = []
    for low, high in itertools.pairwise(BINS):
        part = [(p, right) for p, right in claims if low <= p < high]
        if part:
            claimed, right = np.mean([p for p, _ in part]), np.mean([r for _, r in part])
            out.append({"claimed": float(claimed), "right": float(right), "count": len(part)})
    return out


def calibration_error(claims: Claims) -> float | None:
    """Expected calibration error [0 to 1] (Naeini, Cooper, Hauskrecht 2015)."""
    if not claims:
        return None
    return sum(group["count"] * abs(group["claimed"] - group["right"]) for group in reliability(claims)) / len(claims)


def brier(claims: Claims) -> float | None:
    """Mean squared difference [-] of probability and outcome (Brier 1950); 0 is best, 0.25 gives no information."""
    return float(np.mean([(p - right) ** 2 for p, right in claims])) if claims else None


def log_score(claims: Claims) -> float | None:
    """Mean natural logarithm [nats] of the probability given to what happened (Good 1952); 0 is best."""
    if not claims:
        return None
    clipped = [(min(max(p, LEAST), 1.0 - LEAST), right) for p, right in claims]
    return float(np.mean([math.log(p if right else 1.0 - p) for p, right in clipped]))
