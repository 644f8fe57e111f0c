"""Dynamics and material of a joint by simulation error: valve, J and d of Eq. 8, creep of Eqs. 11 to 13.

The valve is fitted from set-point to pressure, the joint from measured pressure to angle. Each stage has a measured
input, so that the errors of one stage do not bias the other. One scale of the creep cannot be identified: multiplying
A, b0 and b1 by c and dividing phi_max by c gives the same motion. By convention b1 keeps its nominal value, with which
the creeping ratio is 1 at supply pressure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hand_identification.free_parameters import START_CREEP, FreeParameter
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit, multi_start
from hand_identification.static_map import correlation_time
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.signals import Signals

DYNAMIC_KEYS = (
    "valve.dead_time_s",
    "valve.time_constant_s",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
)
MATERIAL_KEYS = (
    "material.phi_max_deg",
    "material.p_min_pa",
    "material.extension_time_s",
    "material.b0_per_pa",
    "material.recovery_time_s",
)
STATIC_KEYS = ("statics.a0_nm", "statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad")
SPREAD = 1.0
"""Standard deviation of the prior of a number's logarithm: a factor of e, up or down, costs one unit."""
STARTS = 4
START_SPREAD = 0.5
"""Standard deviation of the random starts, in units of SPREAD."""
DETERMINED, WEAK = 0.05, 0.3
"""Relative standard errors up to which a number counts as determined, and as weakly determined."""
SHOWS = {
    "valve.dead_time_s": "steps of the set-point",
    "valve.time_constant_s": "steps of the set-point",
    "dynamics.inertia_kg_m2": "fast steps or a multisine up to several Hz",
    "dynamics.viscous_friction_nm_s_per_rad": "steps or a multisine",
    "material.phi_max_deg": "a staircase with minutes under pressure",
    "material.p_min_pa": "holds at low pressures, near p_min",
    "material.extension_time_s": "a hold under pressure of a few time constants",
    "material.b0_per_pa": "recovery from high to middle pressures",
    "material.recovery_time_s": "a hold at low pressure after a long load",
}


@dataclass(frozen=True, slots=True)
class Estimate:
    """One number: key, value and standard error (SI), verdict, and what to record where it is not well determined."""

    key: str
    value: float
    std: float
    verdict: str
    record: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDynamics:
    """The result of a joint.

    rmse_before, rmse_after: RMS error by stage (SI) on training data, with nominal and identified numbers.
    validation_after: the same on validation data with identified numbers.
    """

    joint: str
    estimates: tuple[Estimate, ...]
    rmse_before: dict[str, float]
    rmse_after: dict[str, float]
    validation_after: dict[str, float]
    fit: MapFit
    problem: JointProblem

    def values(self) -> dict[str, float]:
        """Values by key, SI, of the numbers that the data determine at least weakly."""
        return {estimate.key: estimate.value for estimate in self.estimates if estimate.verdict != "not determined"}

    def resolutions(self) -> dict[str, float]:
        """See MapFit.resolutions."""
        return self.fit.resolutions(self.problem.columns(self.fit.free, self.fit.z[None])[0][0])


def identify_joint(
    signals: Sequence[Signals], hand: Hand, joint: str, keys: Sequence[str], rng: np.random.Generator
) -> JointDynamics:
    """Fit the numbers `keys` of one joint from several random starts and keep the best fit.

    Raises ValueError where the recordings have neither set-points nor pressures of the joint.
    """
    problem = joint_problem(signals, hand, joint)
    if not any(segment.use.any() for segment in problem.segments):
        raise ValueError(f"{joint}: the recording has neither set-points nor pressures for it")
    free = [*(_free_parameter(problem, key) for key in keys), FreeParameter(START_CREEP, 0.0, 0.3, False, 0.0, 1.0)]
    zero = np.zeros(len(free))
    nominal = problem.residuals(problem.nominal[None], problem.starts(1))
    starts = [zero, *(START_SPREAD * rng.standard_normal((STARTS - 1, len(free))))]
    best = multi_start(problem, free, starts)
    return JointDynamics(
        joint=joint,
        estimates=tuple(_estimates(problem, best)),
        rmse_before=_rmse(problem, [r[0] for r in nominal], validation=False),
        rmse_after=_rmse(problem, best.residuals, validation=False),
        validation_after=_rmse(problem, best.residuals, validation=True),
        fit=best,
        problem=problem,
    )


def identify(
    signals: Sequence[Signals],
    hand: Hand,
    joints: Sequence[str],
    keys: Sequence[str],
    seed: int,
    progress: Callable[[str], None],
) -> list[JointDynamics]:
    """identify_joint for every joint in turn; reproducible for a seed. progress: called with each finished joint."""
    found = []
    for number, joint in enumerate(joints):
        found.append(identify_joint(signals, hand, joint, keys, np.random.default_rng([seed, number])))
        progress(joint)
    return found


def _free_parameter(problem: JointProblem, key: str) -> FreeParameter:
    row = ROW[key]
    bound = JOINT_PARAMETERS[row]
    low, high, nominal = bound.low * bound.scale, bound.high * bound.scale, float(problem.nominal[row])
    if key in STATIC_KEYS:
        size = max(abs(nominal), 0.01 if key == "statics.a0_nm" else 0.0)
        return FreeParameter(row, nominal, 0.2 * size, False, low, min(high, 0.0) if nominal < 0.0 else high)
    centre = nominal if nominal > 0.0 else (bound.typical or bound.neutral or 1.0) * bound.scale
    return FreeParameter(row, max(centre, 1e-3 if key == "valve.dead_time_s" else 0.0), SPREAD, True, low, high)


def _estimates(problem: JointProblem, fit: MapFit) -> list[Estimate]:
    """Values and the errors that follow from the data alone, the correlation of the residuals included."""
    covariance = _data_covariance(problem, fit)
    columns, _ = problem.columns(fit.free, fit.z[None])
    estimates = []
    for index, parameter in enumerate(fit.free):
        if parameter.row == START_CREEP:
            continue
        value = float(columns[0, parameter.row])
        deviation = float(np.sqrt(covariance[index, index]))
        std = parameter.deviation(value, deviation)
        share = std / max(abs(value), 1e-300)
        verdict = "determined" if share < DETERMINED else "weakly" if share < WEAK else "not determined"
        hint = "" if verdict == "determined" else SHOWS.get(parameter.key, "a staircase over pressure")
        estimates.append(Estimate(parameter.key, value, std, verdict, hint))
    return estimates


def _data_covariance(problem: JointProblem, fit: MapFit) -> Array:
    """Covariance of z from the size and the correlation of the residuals instead of the weights and the prior."""
    train = ~problem.validation
    count = len(fit.z)
    information = np.zeros((count, count))
    for segment, residual, slopes in zip(problem.segments, fit.residuals, fit.sensitivity, strict=True):
        inside = train[segment.block]
        for stage in range(len(STAGES)):
            use = segment.use[stage] & inside
            if use.sum() < 10 or not np.any(slopes[:, stage]):
                continue
            noise = residual[stage, use]
            variance = max(float(np.var(noise)), 1e-30) * correlation_time(noise)
            j = slopes[:, stage][:, use]
            information += j @ j.T / variance
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-9)) @ vectors.T
    return np.asarray(inverse / np.outer(scale, scale))


def _rmse(problem: JointProblem, residuals: Sequence[Array], *, validation: bool) -> dict[str, float]:
    squares = problem.block_squares([r[None] for r in residuals])[0]
    chosen = problem.validation if validation else ~problem.validation
    counts = problem.block_counts
    return {
        stage: float(np.sqrt(squares[k, chosen].sum() / counts[k, chosen].sum()))
        for k, stage in enumerate(STAGES[:2])
        if counts[k, chosen].sum() > 0
    }
