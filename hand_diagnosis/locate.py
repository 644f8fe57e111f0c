"""Where the nominal model misses by more than noise, and where it does not.

Each stage of a joint is looked at as a whole, by direction of motion, in thirds of each state, and by frequency. A
region counts as missed where its error beyond the noise is larger than the repeatability and significant: the squares
of blocks, not of samples, are compared with the noise, so that correlation within a block does not make one event many.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_diagnosis.verdict import StageResult, states_of
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags

SIGNIFICANT = 3.5
"""Standard errors; some thirty regions are looked at."""
STANDING_RAD_S = 0.05
FEWEST = 5
"""Samples of a block in a region, and blocks, that say something."""
BANDS_HZ = ((0.0, 0.2), (0.2, 2.0), (2.0, np.inf))
THIRDS = ("low", "middle", "high")


@dataclass(frozen=True, slots=True)
class Region:
    """A part of a stage's data, SI: RMS of the residual there, noise, standard errors above it, whether it is missed.

    state: "everywhere", "direction", "frequency" or a state; part: which part of it, in words.
    """

    stage: int
    state: str
    part: str
    rms: float
    noise: float
    sigma: float
    missed: bool

    @property
    def signal(self) -> str:
        """Of the stage."""
        return STAGES[self.stage]


def locate(problem: JointProblem, fit: MapFit, results: Sequence[StageResult]) -> list[Region]:
    """Every region of every stage that the recordings hold, for the residuals of a fit."""
    return [region for result in results for region in _stage(problem, fit, result)]


def _stage(problem: JointProblem, fit: MapFit, result: StageResult) -> Iterator[Region]:
    residual, block, states = _together(problem, fit, result.stage)
    if len(residual) < FEWEST:
        return
    parts = [(state, part, residual[inside], block[inside]) for state, part, inside in _parts(states)]
    parts += [("frequency", part, band, block) for part, band in _bands(problem, fit, result.stage)]
    for state, part, values, blocks in parts:
        region = _judged(state, part, values, blocks, result)
        if region is not None:
            yield region


def _together(problem: JointProblem, fit: MapFit, stage: int) -> tuple[Array, NDArray[np.int64], dict[str, Array]]:
    """Residuals, blocks and states of all segments, at the samples that count."""
    parts = [
        (r[stage][p.use[stage]], p.block[p.use[stage]], states_of(p, p.use[stage]))
        for p, r in zip(problem.segments, fit.residuals, strict=True)
    ]
    states = {name: np.concatenate([part[2][name] for part in parts]) for name in parts[0][2]}
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts]), states


def _parts(states: dict[str, Array]) -> Iterator[tuple[str, str, Flags]]:
    speed = states["speed"]
    yield "everywhere", "all", np.ones(len(speed), dtype=bool)
    yield "direction", "flexing", speed > STANDING_RAD_S
    yield "direction", "extending", speed < -STANDING_RAD_S
    yield "direction", "at rest", np.abs(speed) <= STANDING_RAD_S
    for name, values in states.items():
        values = np.abs(values) if name == "speed" else values
        edges = np.quantile(values, [1 / 3, 2 / 3])
        third = np.searchsorted(edges, values)
        for k, part in enumerate(THIRDS):
            yield name, part, third == k


def _bands(problem: JointProblem, fit: MapFit, stage: int) -> Iterator[tuple[str, Array]]:
    """The residuals of all segments within each band of frequencies, at the samples that count."""
    for low, high in BANDS_HZ:
        filtered = [
            _band(p.use[stage] * r[stage], p.period_s, low, high)[p.use[stage]]
            for p, r in zip(problem.segments, fit.residuals, strict=True)
        ]
        yield f"above {low:g} Hz" if np.isinf(high) else f"{low:g} to {high:g} Hz", np.concatenate(filtered)


def _judged(state: str, part: str, residual: Array, block: NDArray[np.int64], result: StageResult) -> Region | None:
    """The region of these residuals; None where too few blocks hold enough of them."""
    counts = np.bincount(block)
    full = counts >= FEWEST
    if full.sum() < FEWEST:
        return None
    squares = np.bincount(block, residual**2)[full] / counts[full]
    error = max(float(squares.std(ddof=1)) / np.sqrt(len(squares)), 1e-300)
    rms = float(np.sqrt(np.mean(residual**2)))
    sigma = (float(squares.mean()) - result.noise**2) / error
    missed = sigma > SIGNIFICANT and rms**2 - result.noise**2 > result.floor**2
    return Region(result.stage, state, part, rms, result.noise, sigma, bool(missed))


def _band(residual: Array, period_s: float, low_hz: float, high_hz: float) -> Array:
    """The part of a signal (T,) within a band of frequencies."""
    spectrum = np.fft.rfft(residual)
    frequency = np.fft.rfftfreq(len(residual), period_s)
    spectrum[(frequency < low_hz) | (frequency >= high_hz)] = 0.0
    inside: Array = np.fft.irfft(spectrum, len(residual))
    return inside
