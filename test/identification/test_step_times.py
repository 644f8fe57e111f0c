"""Steps of set-points between the rows of a slow table are placed by the pressures and the model of the valve."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.step_times import place_steps
from hand_model.arrays import Array, Flags
from hand_model.description import Hand, load_hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
JOINT, NOISE_PA, NOISE_RAD = "thumb_opposition", 400.0, 5e-4
FINE_S, SECONDS = 1e-3, 24.0


def recorded(
    hand: Hand, rows: int, seed: int, *, at_rows: bool = False, sine: bool = False
) -> tuple[Signals, Flags, Array]:
    """A joint driven by steps at any millisecond, or at a row, or by a sine, recorded every `rows` milliseconds.

    Also the samples within which a step came, and how long each was in force there, in samples.
    """
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    index, count = hand.joints.index(JOINT), round(SECONDS / FINE_S)
    at = np.cumsum(rng.integers(350, 900, 60))
    at = at[at < count - 400] // rows * rows if at_rows else at[at < count - 400]
    levels = rng.uniform(0.0, 4e5, len(at) + 1)
    sent = levels[np.searchsorted(at, np.arange(count), side="right")]
    shown = sent
    if sine:  # a millisecond has the set-point of its middle
        sent, shown = (2e5 - 1.5e5 * np.cos(8.0 * FINE_S * (np.arange(count) + late)) for late in (0.5, 0.0))
        at = at[:0]
    loop = ClosedLoop(hand.parameters[:, [index]][None], np.array([-1]), np.zeros((1, 4, 1)), FINE_S)
    states = np.concatenate([np.zeros((1, 4)), loop.advance(sent[None, :-1, None])[0][:, :, 0]])[::rows]
    shape, yes = (len(states), 1), np.ones(1, dtype=bool)
    loose = np.zeros((len(states) - 1, 1), dtype=bool)
    loose[(at - 1) // rows] = True  # at a row: at the end of the sample before it
    signals = Signals(
        name="rows",
        joints=(JOINT,),
        period_s=rows * FINE_S,
        set_point_pa=shown[::rows, None],
        pressure_pa=states[:, :1] + NOISE_PA * rng.standard_normal(shape),
        angle_rad=states[:, 1:2] + NOISE_RAD * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
        between_pa=np.repeat(shown[::rows, None], 8, axis=0)[: 8 * (len(states) - 1) + 1],
        loose=loose,
    )
    return signals, loose[:, 0], 1.0 - ((at - 1) % rows + 1) / rows


def in_force(problem: JointProblem, loose: Flags) -> Array:
    """Share of its sample for which each loose step is in force (n,)."""
    segment, at = problem.segments[0], np.flatnonzero(loose)
    parts = (len(segment.commanded_pa) - 1) // len(loose)
    means = segment.commanded_pa[:-1].reshape(-1, parts).mean(axis=1)[at]
    before, after = segment.set_point_pa[at], segment.set_point_pa[at + 1]
    return np.asarray((means - before) / (after - before))


def left_pa(problem: JointProblem) -> float:
    """RMS [Pa] of what the plain model leaves of the pressures that count."""
    columns, starts = problem.columns((), np.zeros((1, 0)))
    return float(np.std(problem.residuals(columns, starts)[0][0, 0][problem.segments[0].use[0]]))


@pytest.mark.parametrize("rows", [5, 20, 40])
def test_steps_are_placed_where_the_pressures_see_them(rows: int) -> None:
    """Fails when a step is off by more than noise explains, or pressures disagree although the model is right."""
    hand = load_hand(CONFIG)
    signals, loose, share = recorded(hand, rows, 31)
    problem = joint_problem([signals], hand, JOINT)
    assert np.median(np.abs(in_force(problem, loose) - share)) * rows * FINE_S < 1e-3
    assert left_pa(problem) < 1.2 * NOISE_PA
    assert left_pa(joint_problem([replace(signals, loose=None)], hand, JOINT)) > 1.5 * NOISE_PA


def test_readings_that_place_a_step_count_as_no_comparison() -> None:
    """Fails when the reading that says when a step came also shows that the model agrees with it."""
    hand = load_hand(CONFIG)
    signals, loose, _ = recorded(hand, 20, 32)
    use = joint_problem([signals], hand, JOINT).segments[0].use[0]
    assert not use[1:][loose].any()
    assert use[1:][~loose].mean() > 0.9


def test_another_model_of_the_valve_places_them_again() -> None:
    """Fails when steps stay where a wrong valve put them: the right one would leave errors."""
    hand = load_hand(CONFIG)
    signals, loose, share = recorded(hand, 20, 33)
    slower = hand.parameters.copy()
    slower[ROW["valve.time_constant_s"]] *= 1.3
    problem = joint_problem([signals], replace(hand, parameters=slower), JOINT)
    wrong = np.median(np.abs(in_force(problem, loose) - share))
    problem.nominal[:] = hand.parameters[:, hand.joints.index(JOINT)]
    place_steps(problem, (), np.zeros(0))
    assert np.median(np.abs(in_force(problem, loose) - share)) < 0.5 * wrong
    assert left_pa(problem) < 1.2 * NOISE_PA


def test_a_smooth_set_point_moves_between_the_rows() -> None:
    """Fails when a sine of a fast board is held from row to row, a half of a period late."""
    hand = load_hand(CONFIG)
    signals, _, _ = recorded(hand, 20, 36, sine=True)
    assert left_pa(joint_problem([signals], hand, JOINT)) < 1.2 * NOISE_PA
    assert left_pa(joint_problem([replace(signals, loose=None)], hand, JOINT)) > 3.0 * NOISE_PA


@pytest.mark.parametrize("rows", [5, 20])
def test_steps_at_the_rows_stay_there(rows: int) -> None:
    """Fails when who logs the commands that it sends loses a reading behind each, or has them moved by noise."""
    hand = load_hand(CONFIG)
    signals, _, _ = recorded(hand, rows, 35, at_rows=True)
    problem = joint_problem([signals], hand, JOINT)
    held, segment = joint_problem([replace(signals, loose=None)], hand, JOINT).segments[0], problem.segments[0]
    np.testing.assert_array_equal(segment.commanded_pa, held.commanded_pa)
    np.testing.assert_array_equal(segment.use, held.use)


def test_without_loose_steps_the_commands_stay() -> None:
    """Fails when set-points of a recording with times of its own are moved."""
    hand = load_hand(CONFIG)
    signals, _, _ = recorded(hand, 20, 34)
    problem = joint_problem([replace(signals, loose=None)], hand, JOINT)
    np.testing.assert_array_equal(problem.segments[0].commanded_pa, signals.commanded_pa[:, 0])
