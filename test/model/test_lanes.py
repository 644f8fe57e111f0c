"""Joints to lanes and back, and many hands at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest

from hand_model.kernel import closed_loop
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.lanes import HALF, LANES, idle_parameters, map_hands, neighbour_lanes
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, STATES
from hand_sim.plant import HandPlants, resting_state


def paired(joints: int, pairs: int) -> Any:
    """partner (joints,) with `pairs` coupled pairs spread over the joints in shuffled order."""
    partner = np.full(joints, -1)
    order = np.random.default_rng(joints * 100 + pairs).permutation(joints)
    for a, b in order[: 2 * pairs].reshape(-1, 2):
        partner[a], partner[b] = b, a
    return partner


COUNTS = [(1, 0), (3, 1), (3, 0), (11, 5), (11, 0), (16, 8), (16, 0), (24, 12), (24, 5), (24, 0), (40, 17)]


@pytest.mark.parametrize(("joints", "pairs"), COUNTS)
def test_round_trip(joints: int, pairs: int) -> None:
    """Broken by two joints in one lane, a pair that is not at l and l + 8 of one block, or a wasted block."""
    partner = paired(joints, pairs)
    lanes = map_hands(partner, 1)
    assert len(set(zip(lanes.block.tolist(), lanes.lane.tolist(), strict=True))) == joints
    assert lanes.blocks == -(-joints // LANES)
    for a in np.flatnonzero(partner > np.arange(joints)):
        assert lanes.block[a] == lanes.block[partner[a]]
        assert lanes.lane[partner[a]] == lanes.lane[a] + HALF
    values = np.random.default_rng(1).normal(size=(5, joints))
    scattered = lanes.scatter(values, np.full(5, np.nan))
    assert scattered.shape == (lanes.blocks, 5, LANES)
    assert np.isnan(scattered).sum() == 5 * (lanes.blocks * LANES - joints)
    np.testing.assert_array_equal(lanes.gather(scattered), values)


@pytest.mark.parametrize("partner", [[1, -1], [1, 2, 0], [0], [1, 0, 0], [2, -1, -1]])
def test_partners_must_be_mutual(partner: list[int]) -> None:
    """Broken by a one-sided coupling that is laid out as if it were none."""
    with pytest.raises(ValueError, match="each other"):
        map_hands(np.array(partner), 1)


def test_idle_lanes_are_harmless() -> None:
    """Broken by an unused lane that is no valid joint: it must stay at rest."""
    par = np.repeat(idle_parameters()[None, :, None], LANES, axis=2)
    for parameter in JOINT_PARAMETERS:
        value = par[0, ROW[parameter.key], 0] / parameter.scale
        assert parameter.low <= value <= parameter.high * (1 + 1e-9), parameter.key
    loop = ClosedLoop(par, np.full(LANES, -1), np.zeros((1, STATES, LANES)), 0.005)
    np.testing.assert_array_equal(loop.advance(np.zeros((1, 1000, LANES))), 0.0)


def test_hands_apart_have_a_block_each(hand: Any) -> None:
    """Broken by a hand that shares its block with another where effects act between its joints, or is cut in two."""
    lanes = map_hands(hand.partner, 3, apart=True)
    assert lanes.blocks == 3
    np.testing.assert_array_equal(lanes.block, np.repeat([0, 1, 2], 11))
    neighbours = neighbour_lanes(lanes, hand.partner, 3)
    for joint, partner in enumerate(hand.partner):
        other = partner if partner >= 0 else max(joint - 1, 0)
        for k in range(3):
            assert neighbours[k, lanes.lane[11 * k + joint]] == lanes.lane[11 * k + other]
    with pytest.raises(ValueError, match="17 joints have effects between them; the allowed range is 1 to 16 joints"):
        map_hands(np.full(17, -1), 1, apart=True)


def varied(hand: Any, hands: int) -> Any:
    """parameters (hands, rows, joints), every hand another one."""
    scatter = np.random.default_rng(8).uniform(0.97, 1.0, (hands, len(JOINT_PARAMETERS), 1))
    return hand.parameters * scatter


def test_many_hands_equal_each_alone(hand: Any) -> None:
    """Broken by lanes that influence each other, or by hands mixed up: bit for bit what each does alone."""
    hands, samples = 7, 150
    parameters = varied(hand, hands)
    commands = np.random.default_rng(9).uniform(-1e5, 7e5, (hands, samples, 11))
    state = np.repeat(resting_state(hand)[None], hands, axis=0)
    state[:, 1] += np.arange(hands)[:, None] * 0.05
    together = HandPlants(hand, parameters, 0.005, state)
    together.hold_history(commands[:, 0])
    states = together.advance(commands)
    assert states.shape == (hands, samples, STATES, 11)
    for k in range(hands):
        alone = HandPlants(hand, parameters[k : k + 1], 0.005, state[k : k + 1])
        alone.hold_history(commands[k : k + 1, 0])
        np.testing.assert_array_equal(alone.advance(commands[k : k + 1])[0], states[k])
        np.testing.assert_array_equal(together.state[k], states[k, -1])
    assert np.abs(np.diff(states[:, -1, 1], axis=0)).max() > 1e-3


def test_one_hand_is_the_hand_of_the_description(hand: Any) -> None:
    """Broken by parameters that reach other joints than the description's."""
    limp = replace(hand, parameters=hand.parameters.copy())
    limp.parameters[ROW["statics.a0_nm"], 4] = 0.3
    both = HandPlants(hand, np.stack([hand.parameters, limp.parameters]), 0.005)
    states = both.advance(np.zeros((2, 100, 11)))[:, -1, 1]
    assert states[1, 4] > states[0, 4] + 0.3
    others = np.array([0, 1, 2, 5, 6, 7, 8, 9, 10])
    np.testing.assert_array_equal(states[0, others], states[1, others])


def test_shapes_are_checked(hand: Any) -> None:
    """Broken by arrays of another hand that are broadcast or cut silently."""
    with pytest.raises(ValueError, match=r"parameters has the shape \(2, \d+, 10\); it must be \(2, \d+, 11\)"):
        HandPlants(hand, np.stack([hand.parameters] * 2)[..., :10], 0.005)
    with pytest.raises(ValueError, match="state has the shape"):
        HandPlants(hand, hand.parameters[None], 0.005, np.zeros((2, STATES, 11)))
    with pytest.raises(ValueError, match="pressure_pa has the shape"):
        HandPlants(hand, hand.parameters[None], 0.005).advance(np.zeros((1, 5, 10)))


def run_blocks(hand: Any, hands: int = 12) -> Any:
    """Readings of `hands` hands in several blocks, and their state at the end."""
    state = np.repeat(resting_state(hand)[None], hands, axis=0)
    loop = ClosedLoop(varied(hand, hands), hand.partner, state, 0.005)
    out = loop.advance(np.random.default_rng(2).uniform(0, 6e5, (hands, 60, 11)))
    return out, loop.state


def test_any_number_of_threads_gives_the_same(hand: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Broken by a result that depends on threads, or on whether a call uses a parallel region."""
    threads = numba.get_num_threads()
    with monkeypatch.context() as serial:
        serial.setattr(closed_loop, "PARALLEL_STEPS", 10**12)
        expected = run_blocks(hand)
    try:
        for count in range(1, threads + 1):
            numba.set_num_threads(count)
            for limit in (0, 10**12):
                monkeypatch.setattr(closed_loop, "PARALLEL_STEPS", limit)
                for one_thread, found in zip(expected, run_blocks(hand), strict=True):
                    np.testing.assert_array_equal(one_thread, found)
    finally:
        numba.set_num_threads(threads)
