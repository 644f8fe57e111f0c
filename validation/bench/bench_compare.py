"""The diagnosis and other methods on the same recordings: re-identification, sparse regression, friction models.

Each recording hides one effect at one joint of the simulated hand; the nominal model is 3 % off. Errors are RMS errors
of the angle on the validation data beyond the sensor noise, in degrees. (a) The nominal parameters are identified
again. (b) A sparse regression (PySINDy) of the residual that (a) leaves corrects that residual. (c) The best of a fixed
list of frictions on the validation data (Coulomb with Stribeck, viscous and quadratic, a hysteresis loop, backlash).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import JointDiagnosis, diagnose
from hand_diagnosis.problem import validation_rmse
from hand_diagnosis.search import search_joint
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.effects import EFFECTS
from hand_model.effects.effect import SPEED
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.signals import Signals, white_noise
from hand_sim.plant import PHI, HandPlant, P
from validation.bench.result import figure

SEED = 11
PERIOD_S, DURATION_S, QUICK_S = 0.01, 60.0, 20.0
JOINT = "index_distal"
STANDING_RAD_S = 0.02
"""Speed over which the direction of motion is smoothed."""
FRICTIONS = ("coulomb_friction", "viscous_friction", "hysteresis", "backlash")
HIDDEN = {
    "coulomb_friction": {"coulomb_friction.torque_nm": 0.004},
    "backlash": {"backlash.gap_deg": 2.0},
    "hysteresis": {"hysteresis.torque_nm": 0.005},
    "gravity": {"gravity.sine_nm": 0.02},
    "contact": {"contact.angle_deg": 50.0, "contact.stiffness_nm_per_rad": 0.5},
    "tube_lag": {"tube_lag.time_constant_s": 0.05},
    "hall_misalignment": {"hall_misalignment.sine_2_deg": 1.5},
    "stiffening": {"stiffening.cubic_nm_per_rad3": 0.02},
}


@dataclass(frozen=True, slots=True)
class Row:
    """One recording: the hidden effect, the first finding, whether its joint is right; validation errors [deg]."""

    hidden: str
    named: str
    joint: bool
    nominal: float
    ours: float
    reidentified: float
    sparse: float
    friction: float
    best_friction: str


def run(quick: bool) -> list[dict[str, Any]]:
    """The comparison; quick: one short recording, of which only the joint with the effect is diagnosed."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    if quick:
        rows = [compare(hand, "coulomb_friction", QUICK_S, (JOINT,))]
    else:
        rows = [compare(hand, name, DURATION_S, ()) for name in HIDDEN]
    named = sum(row.hidden == row.named and row.joint for row in rows)
    worst = max(row.ours / max(row.reidentified, 1e-9) for row in rows)
    missed = figure("recordings whose effect and joint are not named", float(len(rows) - named), 0.0, "")
    return [
        missed | {"rows": [asdict(row) for row in rows]},
        figure("worst validation error of the diagnosis over that of re-identification", worst, 1.0, ""),
    ]


def compare(hand: Hand, hidden: str, seconds: float, joints: tuple[str, ...]) -> Row:
    """Apply every method to one recording of `seconds` [s]; joints: the ones to diagnose, empty for all."""
    signals = record(hand, hidden, seconds)
    nominal = _off(hand)
    result = diagnose([signals], nominal, tolerance=0.05, seed=0, joints=joints, sensor_curve=False)
    first = result.findings[0] if result.findings else None
    judged = next(joint for joint in result.joints if joint.joint == JOINT)
    problem = judged.search.problem
    frictions = {name: _friction(problem, judged, name) for name in FRICTIONS}
    best = min(frictions, key=lambda name: frictions[name])
    before = beyond_noise(problem, judged.search.nominal)
    share = _sparse_share(problem, judged.search.nominal)
    return Row(
        hidden=hidden,
        named=first.effect if first else "agrees",
        joint=first is not None and first.joint == JOINT,
        nominal=_unfitted(problem),
        ours=beyond_noise(problem, judged.search.final),
        reidentified=before,
        sparse=before * float(np.sqrt(max(1.0 - share, 0.0))),
        friction=frictions[best],
        best_friction=best,
    )


def _friction(problem: JointProblem, judged: JointDiagnosis, name: str) -> float:
    """Validation error with one friction of the list added."""
    nominal = judged.search.nominal
    search = search_joint(problem, [EFFECTS[name]], nominal.free, np.random.default_rng(0), nominal.z)
    return beyond_noise(problem, search.final)


def _sparse_share(problem: JointProblem, fit: MapFit) -> float:
    """Share [-] of the square of the angle's residual on validation data that PySINDy's regression removes."""
    from pysindy import STLSQ  # noqa: PLC0415 - slow to import

    (segment,), (residual,) = problem.segments, fit.residuals
    use = segment.use[1]
    angle, pressure, speed = segment.angle_rad[use], 1e-5 * segment.pressure_pa[use], segment.exogenous[use, SPEED]
    direction, one = np.tanh(speed / STANDING_RAD_S), np.ones_like(angle)
    static = (one, angle, pressure, angle**2, angle * pressure, pressure**2, angle**3)
    table = np.column_stack([*static, speed, direction, pressure * direction, speed * np.abs(speed)])
    target, held = residual[1][use], problem.validation[segment.block[use]]
    scale, rms = np.abs(table).max(axis=0), float(np.sqrt(np.mean(target**2)))
    fitted = STLSQ(threshold=0.05, alpha=1e-3).fit((table / scale)[~held], (target / rms)[~held, None])
    left = target[held] - rms * (table / scale)[held] @ np.ravel(fitted.coef_)
    return max(1.0 - float(np.mean(left**2) / np.mean(target[held] ** 2)), 0.0)


def beyond_noise(problem: JointProblem, fit: MapFit) -> float:
    """RMS error of the angle on the validation data beyond its white noise [deg]."""
    return _beyond(problem, validation_rmse(problem, fit.squares)[1])


def _unfitted(problem: JointProblem) -> float:
    """The same for the nominal model without any fit."""
    squares = problem.block_squares(problem.residuals(problem.nominal[None], problem.starts(1)))[0]
    return _beyond(problem, validation_rmse(problem, squares)[1])


def _beyond(problem: JointProblem, rmse: float) -> float:
    noise = white_noise(problem.segments[0].angle_rad)
    return float(np.degrees(np.sqrt(max(rmse**2 - noise**2, 0.0))))


def record(hand: Hand, hidden: str, seconds: float) -> Signals:
    """A staircase, a triangle and steps of every joint in `seconds` [s], with sensor noise and the hidden effect at
    JOINT.
    """
    rng = np.random.default_rng([SEED, len(hidden)])
    parameters = hand.parameters.copy()
    column = hand.joints.index(JOINT)
    for key, value in HIDDEN[hidden].items():
        row = ROW[key]
        parameters[row, column] = value * JOINT_PARAMETERS[row].scale
    samples = round(seconds / PERIOD_S)
    set_point = np.column_stack([_motion(samples, rng) for _ in hand.joints])
    plant = HandPlant(replace(hand, parameters=parameters), PERIOD_S)
    states = np.concatenate([plant.state[None], plant.advance(set_point[:-1])])
    shape = set_point.shape
    joints, all_joints = len(hand.joints), np.ones(len(hand.joints), dtype=np.bool_)
    return Signals(
        name=hidden,
        joints=hand.joints,
        period_s=PERIOD_S,
        set_point_pa=set_point,
        pressure_pa=states[:, P] + 100.0 * rng.standard_normal(shape),
        angle_rad=states[:, PHI] + np.radians(0.03) * rng.standard_normal(shape),
        force_n=np.full((samples, joints), np.nan),
        known=np.ones(shape, dtype=np.bool_),
        has_set_point=all_joints,
        has_pressure=all_joints,
    )


def _motion(samples: int, rng: np.random.Generator) -> Array:
    t = np.arange(samples) * PERIOD_S
    third = samples // 3
    stairs = 2e4 + 2.0e5 * np.abs(((t // 2.0) % 10) / 5.0 - 1.0)
    triangle = 2e4 + 2.0e5 * np.abs(((t / 9.0) % 2.0) - 1.0)
    steps = rng.uniform(2e4, 2.2e5, samples)[(t / 1.1).astype(int)]
    return np.asarray(np.concatenate([stairs[:third], triangle[:third], steps[: samples - 2 * third]]))


def _off(hand: Hand) -> Hand:
    """The nominal model: each constant of Eq. 6 is 3 % off (standard deviation)."""
    rng = np.random.default_rng([SEED, 0])
    parameters = hand.parameters.copy()
    for key in ("statics.a0_nm", "statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"):
        parameters[ROW[key]] *= 1.0 + 0.03 * np.clip(rng.standard_normal(len(hand.joints)), -2.0, 2.0)
    return replace(hand, parameters=parameters)
