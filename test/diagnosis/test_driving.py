"""Inputs of a joint from a model and readings together are closer to the truth than readings alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_diagnosis.problem import Task
from hand_identification.driving import inflow, shape_driving
from hand_identification.free_parameters import FreeParameter, nominal_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import map_fit
from hand_model.description import Hand
from hand_model.effects.effect import INFLOW, PARTNER
from hand_recording.signals import Signals, derivatives, without_noise
from hand_sim.plant import PHI, HandPlant, P, resting_state

JOINT, FINE, PERIOD_S = "index_proximal", 4, 0.01
NOISE_PA, NOISE_RAD = 200.0, np.radians(0.03)


@pytest.fixture(scope="module")
def truth(hand: Hand) -> tuple[np.ndarray, np.ndarray]:
    """Set-points (T, J) at 100 Hz and true states (FINE T, STATES, J) of the nominal hand."""
    rng = np.random.default_rng(41)
    return simulated(hand, np.repeat(rng.uniform(0.0, 4e5, (24, len(hand.joints))), 80, axis=0))


def simulated(hand: Hand, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Set-points (T, J) at 100 Hz and true states (FINE T, STATES, J) of the nominal hand, which begins at rest."""
    plant = HandPlant(hand, PERIOD_S / FINE)
    fine = np.repeat(commands, FINE, axis=0)
    start = np.asarray(resting_state(hand))[None]
    return commands, np.concatenate([start, plant.advance(fine[:-1])])


def read(hand: Hand, truth: tuple[np.ndarray, np.ndarray], *, known: np.ndarray | None = None) -> Signals:
    """A noisy recording of these states."""
    commands, states = truth
    rng = np.random.default_rng(42)
    shape, yes = commands.shape, np.ones(commands.shape[1], dtype=bool)
    return Signals(
        name="made",
        joints=hand.joints,
        period_s=PERIOD_S,
        set_point_pa=commands,
        pressure_pa=states[::FINE, P] + NOISE_PA * rng.standard_normal(shape),
        angle_rad=states[::FINE, PHI] + NOISE_RAD * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool) if known is None else known,
        has_set_point=yes,
        has_pressure=yes,
    )


def fitted(signals: Signals, hand: Hand) -> tuple[JointProblem, list[FreeParameter], np.ndarray]:
    problem = joint_problem([signals], hand, JOINT)
    free = nominal_free_parameters(problem.nominal, 0.05, True)
    return problem, free, map_fit(problem, free, np.zeros(len(free)), 3).z


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_pressure_follows_the_valve_between_the_samples(hand: Hand, truth: tuple[np.ndarray, np.ndarray]) -> None:
    """Fails when the driving pressure is as far from the true one between the samples as a line through readings."""
    problem, free, z = fitted(read(hand, truth), hand)
    segment = problem.segments[0]
    true = truth[1][: -FINE + 1, P, hand.joints.index(JOINT)]
    line = np.interp(np.arange(len(true)) / FINE, np.arange(len(segment.pressure_pa)), segment.pressure_pa)
    shape_driving(problem, free, z)
    shaped = problem.segments[0].driving_pa
    assert len(shaped) == len(true)
    settled = FINE * 50  # before, the set-point that was in force is not known
    assert rms((shaped - true)[settled:]) < 0.25 * rms((line - true)[settled:])


def test_a_recording_that_begins_in_a_step_is_driven_by_the_model(hand: Hand) -> None:
    """Fails when the first samples, which the model cannot know, keep it from shaping all others."""
    triangle = 4e5 * np.abs(1.0 - 2.0 * (np.arange(1920) * PERIOD_S / 4.8 % 1.0))
    commands = np.repeat(triangle[:, None], len(hand.joints), axis=1)  # 4e5 Pa at once, and slow from there on
    signals = read(hand, simulated(hand, commands))
    problem, free, z = fitted(signals, hand)
    shape_driving(problem, free, z)
    true = simulated(hand, commands)[1][::FINE, P, hand.joints.index(JOINT)]
    finer = (len(problem.segments[0].driving_pa) - 1) // (len(true) - 1)
    alone = without_noise(problem.segments[0].pressure_pa, PERIOD_S, NOISE_PA)[0]
    shaped = problem.segments[0].driving_pa[::finer]
    assert rms((shaped - true)[50:]) < 0.5 * rms((alone - true)[50:])


def test_a_vented_partner_that_is_not_recorded_is_shaken(hand: Hand) -> None:
    """Fails when a vented finger joint without a sensor counts as still."""
    rng = np.random.default_rng(44)
    commands = np.repeat(rng.uniform(0.0, 4e5, (24, len(hand.joints))), 80, axis=0)
    partner = int(hand.partner[hand.joints.index(JOINT)])
    commands[:, partner] = 0.0
    made = simulated(hand, commands)
    whole = read(hand, made)
    names = [name for k, name in enumerate(hand.joints) if k != partner]
    keep = [hand.joints.index(name) for name in names]
    signals = replace(
        whole, joints=tuple(names), set_point_pa=whole.set_point_pa[:, keep], pressure_pa=whole.pressure_pa[:, keep],
        angle_rad=whole.angle_rad[:, keep], force_n=whole.force_n[:, keep], known=whole.known[:, keep],
        has_set_point=whole.has_set_point[keep], has_pressure=whole.has_pressure[keep],
    )  # fmt: skip
    beside = (
        Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        .prepare(JOINT)
        .problem.segments[0]
        .exogenous[:, PARTNER]
    )
    angle = made[1][::FINE, PHI, partner]
    true = np.zeros(len(angle))
    true[1:-1] = np.diff(angle, 2) / PERIOD_S**2
    assert rms((beside - true)[50:-50]) < 0.5 * rms(true[50:-50])


def test_a_model_that_is_wrong_does_no_harm(hand: Hand, truth: tuple[np.ndarray, np.ndarray]) -> None:
    """Fails when a valve model that does not fit the readings still shapes the pressure."""
    problem, free, _ = fitted(read(hand, truth), hand)
    slow = [
        replace(parameter, low=0.0, high=1.0) if parameter.key == "valve.time_constant_s" else parameter
        for parameter in free
    ]
    z = np.array([parameter.coordinate(0.6) if parameter.key == "valve.time_constant_s" else 0.0 for parameter in slow])
    before = problem.segments[0].driving_pa
    true = truth[1][::FINE, P, hand.joints.index(JOINT)]
    shape_driving(problem, slow, z)
    shaped = problem.segments[0].driving_pa
    finer = (len(shaped) - 1) // (len(true) - 1)
    assert rms(shaped[::finer] - true) < 1.2 * rms(before - true) + NOISE_PA


def test_gaps_are_bridged_along_the_model(hand: Hand, truth: tuple[np.ndarray, np.ndarray]) -> None:
    """Fails when a gap in the readings is a straight line in the driving pressure."""
    known = np.ones(truth[0].shape, dtype=bool)
    known[84:96] = False  # begins 40 ms after a step
    signals = read(hand, truth, known=known)
    j = hand.joints.index(JOINT)
    bridged = signals.pressure_pa.copy()
    bridged[84:96, j] = np.linspace(bridged[83, j], bridged[96, j], 14)[1:-1]
    problem, free, z = fitted(replace(signals, pressure_pa=bridged), hand)
    shape_driving(problem, free, z)
    true = truth[1][::FINE, P, j]
    shaped = problem.segments[0].driving_pa[::FINE]
    assert rms((shaped - true)[84:96]) < 0.2 * rms((bridged[:, j] - true)[84:96])


def test_acceleration_has_less_noise_along_the_model(hand: Hand, truth: tuple[np.ndarray, np.ndarray]) -> None:
    """Fails when a partner's acceleration is as noisy as one taken from angles alone."""
    signals = read(hand, truth)
    problem = (
        Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        .prepare(JOINT)
        .problem
    )
    partner = int(hand.partner[hand.joints.index(JOINT)])
    angle = truth[1][::FINE, PHI, partner]
    true = np.zeros(len(angle))
    true[1:-1] = np.diff(angle, 2) / PERIOD_S**2
    beside = problem.segments[0].exogenous[:, PARTNER]
    alone = derivatives(signals.angle_rad, PERIOD_S)[1][:, partner]
    noise = [float(np.median(np.abs(used - true))) for used in (beside, alone)]
    assert noise[0] < 0.3 * noise[1]
    assert rms((beside - true)[50:-50]) < 0.7 * rms((alone - true)[50:-50])


def test_noise_of_a_pressure_at_rest_is_no_inflow(hand: Hand, truth: tuple[np.ndarray, np.ndarray]) -> None:
    """Fails when noise of the pressure is taken for flow."""
    problem, free, z = fitted(read(hand, truth), hand)
    shape_driving(problem, free, z)
    segment = problem.segments[0]
    flow = inflow(segment.driving_pa, len(segment.pressure_pa), segment.period_s)
    true = np.maximum(np.diff(truth[1][:, P, hand.joints.index(JOINT)]), 0.0).sum()
    assert flow.sum() * PERIOD_S == pytest.approx(true, rel=0.1)


def test_recordings_of_one_name_and_another_length_are_kept_apart(
    hand: Hand, truth: tuple[np.ndarray, np.ndarray]
) -> None:
    """Fails when two recordings are merged because their files have the same name."""
    long = read(hand, truth)
    short = read(hand, (truth[0][:600], truth[1][: 600 * FINE]))
    segments = (
        Task(signals=[long, short], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        .prepare(JOINT)
        .problem.segments
    )
    assert [len(segment.exogenous) for segment in segments] == [len(truth[0]), 600]
    assert segments[0].exogenous[:590, INFLOW] == pytest.approx(segments[1].exogenous[:590, INFLOW], rel=0.2, abs=5e5)


def test_smoothing_takes_the_span_that_predicts_best() -> None:
    """Fails when a slow signal is smoothed as briefly as a fast one, or a fast one over its own motion."""
    rng = np.random.default_rng(43)
    time = np.arange(3000) * 0.01
    noise = rng.standard_normal(3000)
    slow, span_slow = without_noise(30.0 * np.sin(0.5 * time) + noise, 0.01, 1.0)
    fast, span_fast = without_noise(30.0 * np.sin(20.0 * time) + noise, 0.01, 1.0)
    assert span_slow > 3 * span_fast
    assert rms(slow - 30.0 * np.sin(0.5 * time)) < 0.25
    assert rms(fast - 30.0 * np.sin(20.0 * time)) < 0.9
