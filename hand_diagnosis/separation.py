"""Which experiment tells two models apart best: both are simulated on each, and the difference is counted in sigma."""

from __future__ import annotations

import numpy as np

from hand_diagnosis.excitation import EXPERIMENTS
from hand_diagnosis.search import Hypothesis
from hand_identification.joint_problem import CORRELATION_S, JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.closed_chain import ClosedChain
from hand_model.kernel.rows import ROW
from hand_model.statics import equilibrium_angle
from hand_sim.plant import PHI, STATES, P

DURATION_S = 40.0
BY_HAND = {"closed_valve_push"}
"""Experiments whose outcome depends on what a person does; they cannot be predicted."""


def separation_sigma(problem: JointProblem, one: MapFit, other: MapFit, name: str) -> float:
    """How many sigma apart two fitted models are on an experiment, with practical noise correlated over a while."""
    period = problem.segments[0].period_s
    time_s = np.asarray(np.arange(round(DURATION_S / period)) * period, dtype=np.float64)
    top = max(float(problem.segments[0].pressure_pa.max()), 5e4)
    commands = top * np.clip(EXPERIMENTS[name](time_s, np.random.default_rng(0)), 0.0, 1.0)
    first, second = (_simulate(problem, fit, commands, period) for fit in (one, other))
    scale = problem.floor[:2, None]
    squares = float((((first - second) / scale) ** 2).sum())
    return float(np.sqrt(squares * period / CORRELATION_S))


def best_experiment(problem: JointProblem, one: Hypothesis, other: Hypothesis) -> tuple[str, float]:
    """The experiment with the largest predicted separation of two hypotheses, and how many sigma that is."""
    sigmas = {name: separation_sigma(problem, one.fit, other.fit, name) for name in EXPERIMENTS if name not in BY_HAND}
    name = max(sigmas, key=lambda key: sigmas[key])
    return name, sigmas[name]


def _simulate(problem: JointProblem, fit: MapFit, commands: Array, period_s: float) -> Array:
    """Pressure and angle readings (2, T) of the joint alone."""
    columns, _ = problem.columns(fit.free, fit.z[None])
    parameters = columns[0][:, None]
    a0, a1, a2, a3 = columns[0][ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    load = columns[0][ROW["constant_load.torque_nm"]]
    start = np.zeros((STATES, 1))
    rest = equilibrium_angle(0.0, 0.0, load, a0, a1, a2, a3, 0.0)
    start[PHI] = np.clip(rest, columns[0][ROW["end_stop.low_deg"]], columns[0][ROW["end_stop.high_deg"]])
    states = ClosedChain(parameters, np.array([-1]), start, period_s).advance(commands[:, None])
    return np.array([states[:, P, 0], states[:, PHI, 0]])
