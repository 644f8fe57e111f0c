"""What remains after the best model: nothing but noise, a part, or physics that the catalogue does not hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_diagnosis.evidence import held_out_rmse
from hand_diagnosis.noise import noise_of_inputs, noise_of_reading
from hand_identification.joint_problem import STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import SPEED

UNEXPLAINED, PART = 1.3, 0.55
"""Held-out error beyond the noise, in practical floors, from which something is left to explain; and from which it is
where effects took a part of it away: there was something, and this is more of it."""
MOSTLY, HARDLY, UNTOUCHED = 0.15, 0.3, 0.9
"""Share of the first model's excess that may remain for one effect to count as the explanation, where much is left and
where little is (for several effects less, by the square of their number: many terms come near anything); and the share
from which they have no part in this stage."""
TIME_SAYS_MORE = 0.25
"""Share of variance by which time must explain more than any state."""


@dataclass(frozen=True, slots=True)
class StageResult:
    """A stage on held-out data, SI: error before and after, noise, excess over the noise before and after.

    floor: repeatability.  effects: how many were found on the joint.
    noise: the white noise of the reading, and what the noise of the stage's measured inputs
    makes of its prediction.
    """

    stage: int
    before: float
    after: float
    noise: float
    excess_before: float
    excess_after: float
    floor: float
    effects: int

    @property
    def name(self) -> str:
        """Of the signal."""
        return STAGES[self.stage]

    @property
    def unexplained(self) -> bool:
        """Whether structure is left that is worth a word."""
        left = self.excess_after / max(self.excess_before, 1e-300)
        share = (MOSTLY if self.leftover else HARDLY) / max(self.effects, 1) ** 2
        enough = UNEXPLAINED if left > UNTOUCHED else PART
        return left > share and self.excess_after > enough * self.floor

    @property
    def leftover(self) -> bool:
        """Whether anything beyond the floor is left, explained mostly or not."""
        return self.excess_after > UNEXPLAINED * self.floor


def stage_results(problem: JointProblem, nominal: MapFit, final: MapFit, effects: int) -> list[StageResult]:
    """Pressure, angle and force, those that the recording holds. effects: how many the final model has."""
    before, after = held_out_rmse(problem, nominal.squares), held_out_rmse(problem, final.squares)
    inputs = noise_of_inputs(problem, final)
    results = []
    for stage in range(len(STAGES)):
        if not np.isfinite(before[stage]):
            continue
        white = max(
            noise_of_reading(r[stage][p.use[stage]], (p.measured[stage] - r[stage])[p.use[stage]])
            for p, r in _pairs(problem, final, stage)
        )
        noise = float(np.hypot(white, inputs[stage]))
        excess = [float(np.sqrt(max(rmse[stage] ** 2 - noise**2, 0.0))) for rmse in (before, after)]
        errors = float(before[stage]), float(after[stage])
        floor = float(problem.floor[stage])
        results.append(StageResult(stage, errors[0], errors[1], noise, excess[0], excess[1], floor, effects))
    return results


def _pairs(problem: JointProblem, fit: MapFit, stage: int):  # type: ignore[no-untyped-def]
    return [(p, r) for p, r in zip(problem.segments, fit.residuals, strict=True) if p.use[stage].sum() > 10]


@dataclass(frozen=True, slots=True)
class Structure:
    """An unexplained residual in words and numbers: signal, state it depends on most, share of variance, memory, size.

    direction: mean residual while the joint flexes minus while it extends, SI.  frequency_hz: centroid of its spectrum.
    """

    signal: str
    state: str
    share: float
    direction: float
    memory_s: float
    frequency_hz: float
    size: float


def describe(problem: JointProblem, fit: MapFit, stage: int) -> Structure:
    """Where in state space a residual lives, by binned means over each candidate state."""
    segment, residual = max(_pairs(problem, fit, stage), key=lambda pair: pair[0].use[stage].sum())
    use = segment.use[stage]
    r = residual[stage][use]
    states = states_of(segment, use)
    flexing = states["speed"] > 0.0
    both = {"angle", "pressure", "set-point"}  # of these a residual may depend in one way or the other by direction
    shares = {name: _explained(r, values, flexing & (name in both)) for name, values in states.items()}
    # Any residual that lasts a while goes with time somewhat; it must clearly say more than the states do.
    state = max(shares, key=lambda name: shares[name] - (TIME_SAYS_MORE if name == "time" else 0.0))
    speed = states["speed"]
    moving = np.abs(speed) > 0.1
    direction = 0.0
    if (moving & (speed > 0)).any() and (moving & (speed < 0)).any():
        direction = float(r[moving & (speed > 0)].mean() - r[moving & (speed < 0)].mean())
    spectrum = np.abs(np.fft.rfft(r - r.mean())) ** 2
    frequency = np.fft.rfftfreq(len(r), segment.period_s)
    centroid = float((spectrum * frequency).sum() / max(float(spectrum.sum()), 1e-300))
    memory = 0.5 / max(centroid, 1e-3)
    return Structure(STAGES[stage], state, shares[state], direction, memory, centroid, float(np.sqrt(np.mean(r**2))))


def states_of(segment: Segment, use: Flags) -> dict[str, Array]:
    """What a residual may depend on, at the samples that count."""
    time = np.asarray(np.arange(len(use)) * segment.period_s, dtype=np.float64)
    speed = segment.exogenous[:, SPEED]
    return {
        "angle": segment.angle_rad[use],
        "pressure": segment.pressure_pa[use],
        "speed": speed[use],
        "set-point": segment.set_point_pa[use],
        "time": time[use],
    }


def _explained(residual: Array, values: Array, flexing: Flags, bins: int = 20) -> float:
    """Share of the residual's variance that its mean over bins of a state, and over direction, takes away."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)))
    if len(edges) < 3:
        return 0.0
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    index = 2 * index + flexing
    counts = np.bincount(index, minlength=2 * len(edges))
    means = np.bincount(index, residual, minlength=2 * len(edges)) / np.maximum(counts, 1)
    return float(1.0 - np.var(residual - means[index]) / max(float(np.var(residual)), 1e-300))
