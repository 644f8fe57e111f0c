"""The chain with effects: it is the plain plant where none acts, and each effect does what its text says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_identification.free_parameters import probe_values
from hand_model.chain import open_chain
from hand_model.closed_chain import ClosedChain, has_effects
from hand_model.description import Hand, load_hand
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import EXOGENOUS, INFLOW
from hand_model.effects.operators import sine_cosine
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW
from hand_sim.plant import PHI, HandPlant, P, resting_state

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
PERIOD_S = 0.005
SMOOTH = ("supply", "valve", "fluid", "angle_sensor", "pressure_sensor")
"""Places whose effects neither stick nor strike."""


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(CONFIG)


def steps(seconds: float, joints: int = 11, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    count = round(seconds / PERIOD_S)
    return np.repeat(rng.uniform(0.0, 4e5, (count // 150 + 1, joints)), 150, axis=0)[:count]


def changed(hand: Hand, **values: float) -> Hand:
    parameters = hand.parameters.copy()
    for key, value in values.items():
        parameters[ROW[key.replace("__", ".")]] = value
    return replace(hand, parameters=parameters)


def test_closed_chain_is_the_plain_plant_without_effects(hand: Hand) -> None:
    """Fails when the chain's equations or integrators differ from the plain kernel's."""
    commands = steps(15.0)
    plain = HandPlant(hand, PERIOD_S).advance(commands)
    chain = ClosedChain(hand.parameters, hand.partner, resting_state(hand), PERIOD_S).advance(commands)
    difference = np.abs(plain - chain)
    assert difference[:, P].max() < 20.0
    assert np.degrees(difference[:, PHI].max()) < 0.4  # reached for a moment, where coupled joints start together
    assert np.degrees(np.sqrt((difference[:, PHI] ** 2).mean())) < 0.03


def test_open_chain_follows_the_plain_plant_on_its_own_signals(hand: Hand) -> None:
    """Fails when a stage opened at the measured signals does not predict what the plant did."""
    commands = steps(15.0)
    plant = HandPlant(hand, PERIOD_S)
    start = plant.state
    states = np.concatenate([start[None], plant.advance(commands[:-1])])
    j = 0  # the one joint without a partner
    around = np.zeros((len(commands), EXOGENOUS))
    columns, at = hand.parameters[:, j][None], start[:, j][None]
    pressure, angle, _ = open_chain(columns, at, commands[:, j], states[:, P, j], around, PERIOD_S)[0]
    assert np.abs(pressure - states[:, P, j])[120:].max() < 20.0
    assert np.degrees(np.abs(angle - states[:, PHI, j]).max()) < 0.05


def test_lanes_do_not_mix(hand: Hand) -> None:
    """Fails when a parameter set's prediction depends on those it is computed together with."""
    commands = steps(3.0)[:, 0]
    pressure = np.convolve(commands, np.ones(20) / 20.0)[: len(commands)]
    around = np.zeros((len(commands), EXOGENOUS))
    rng = np.random.default_rng(2)
    columns = np.repeat(hand.parameters[:, 0][None], 20, axis=0)
    columns[:, ROW["statics.a2_nm_per_pa"]] *= rng.uniform(0.7, 1.3, 20)
    start = np.zeros((20, 4))
    together = open_chain(columns, start, commands, pressure, around, PERIOD_S)
    alone = open_chain(columns[7:8], start[:1], commands, pressure, around, PERIOD_S)
    assert np.array_equal(together[7], alone[0])


def test_every_effect_changes_something_and_neutral_changes_nothing(hand: Hand) -> None:
    """Fails when an effect is not hooked in, or acts at its neutral value."""
    assert not has_effects(hand.parameters)
    plain = ClosedChain(hand.parameters, hand.partner, resting_state(hand), PERIOD_S).advance(steps(6.0))
    for effect in CATALOGUE:
        own = [key for key in effect.keys if ROW[key] >= len(PLANT_PARAMETERS)]
        if not own or effect.place in ("force_sensor", "timing"):
            continue
        largest, switched_on = 0.0, False
        for probe in probe_values(effect, hand.parameters[:, 0]):
            parameters = hand.parameters.copy()
            for row, value in probe.items():
                parameters[row] = value
            states = ClosedChain(parameters, hand.partner, resting_state(hand), PERIOD_S).advance(steps(6.0))
            assert np.all(np.isfinite(states)), effect.name
            moved = np.abs(states - plain)[:, [P, PHI]].max(axis=(0, 2)) / (500.0, np.radians(0.05))
            largest, switched_on = max(largest, moved.max()), switched_on or has_effects(parameters)
        assert switched_on, effect.name
        assert largest > 1.0, effect.name


def test_steps_of_integration_say_nothing_of_an_effect(hand: Hand) -> None:
    """Fails when what an effect does depends on the step of integration: a lag half a step early is another lag."""
    commands, rng = steps(12.0)[:, 3], np.random.default_rng(4)
    pressure = np.convolve(commands, np.exp(-np.arange(60) / 9.0) / 9.5)[: len(commands)]
    around = np.zeros((len(commands), EXOGENOUS))
    around[:, INFLOW] = 5e5 * np.repeat(rng.random(len(commands) // 40), 40)
    for effect in CATALOGUE:
        probes = probe_values(effect, hand.parameters[:, 0]) if effect.place in SMOOTH else []
        columns = np.repeat(hand.parameters[:, 0][None], 1 + len(probes), axis=0)
        for column, probe in zip(columns[1:], probes, strict=True):
            column[list(probe)] = list(probe.values())
        start = np.zeros((len(columns), 4))
        fine, coarse = (
            open_chain(columns, start, commands, pressure, around, PERIOD_S, step_s=step_s)[:, :2]
            for step_s in (0.4e-3, 2.6e-3)
        )
        changes, errors = fine[1:] - fine[:1], (coarse[1:] - coarse[:1]) - (fine[1:] - fine[:1])
        for change, error in zip(changes, errors, strict=True):
            stage = int(np.abs(change[0]).max() < 10.0)
            assert np.sqrt((error[stage] ** 2).mean()) <= 0.02 * np.sqrt((change[stage] ** 2).mean()), effect.name


def test_coulomb_friction_sticks(hand: Hand) -> None:
    """Fails when a joint held by dry friction creeps, or slides although the torque is below the friction."""
    stuck = changed(hand, coulomb_friction__torque_nm=0.05, material__phi_max_deg=0.0)
    chain = ClosedChain(stuck.parameters, stuck.partner, resting_state(stuck), PERIOD_S)
    before = chain.state[PHI].copy()
    chain.advance(np.full((400, 11), 2e4))  # about 0.02 N m
    assert np.abs(chain.state[PHI] - before).max() < 1e-9
    chain.advance(np.full((400, 11), 3e5))
    assert np.degrees(chain.state[PHI] - before).min() > 30.0


def test_backlash_is_the_gap_at_reversal(hand: Hand) -> None:
    """Fails when the measured angle does not stay behind by the gap between rising and falling at one pressure."""
    loose = changed(hand, backlash__gap_deg=np.radians(3.0), material__phi_max_deg=0.0)
    triangle = np.concatenate([np.linspace(0, 4e5, 3000), np.linspace(4e5, 0, 3000)])
    commands = np.repeat(triangle[:, None], 11, axis=1)
    loops = []
    for one in (loose, changed(loose, backlash__gap_deg=0.0)):
        states = ClosedChain(one.parameters, one.partner, resting_state(one), PERIOD_S).advance(commands)
        up = np.interp(2e5, states[:3000, P, 0], states[:3000, PHI, 0])
        down = np.interp(2e5, states[3000:, P, 0][::-1], states[3000:, PHI, 0][::-1])
        loops.append(np.degrees(down - up))
    assert loops[0] - loops[1] == pytest.approx(3.0, abs=0.02)


def test_hydraulic_joint_resists_and_still_holds(hand: Hand) -> None:
    """Fails when `fluid: hydraulic` does not slow the motion down, or settles at another angle."""
    liquid = changed(hand, hydraulic__share=1.0)
    assert has_effects(liquid.parameters)
    ends = []
    for one in (hand, liquid):
        plant = HandPlant(one, PERIOD_S)
        ends.append(plant.advance(np.full((1200, 11), 2e5))[:, PHI, 0])
    assert ends[0][-1] == pytest.approx(ends[1][-1], abs=np.radians(0.2))
    assert np.argmax(ends[1] > 0.5) > np.argmax(ends[0] > 0.5)  # the valve must deliver the volume


def test_fluid_is_chosen_in_the_description(tmp_path: Path) -> None:
    """Fails when the key `fluid` is not read, or anything but its two words is taken."""
    text = CONFIG.read_text(encoding="utf-8")
    path = tmp_path / "hand.yaml"
    path.write_text(text.replace("fluid: pneumatic", "fluid: hydraulic"), encoding="utf-8")
    assert np.all(load_hand(path).row("hydraulic.share") == 1.0)
    path.write_text(text.replace("fluid: pneumatic", "fluid: oil"), encoding="utf-8")
    with pytest.raises(ValueError, match="one of pneumatic, hydraulic"):
        load_hand(path)


def test_an_effect_in_the_description_runs_in_the_simulation(tmp_path: Path) -> None:
    """Fails when a model file with an effect loads but moves like the one without."""
    text = CONFIG.read_text(encoding="utf-8")
    path = tmp_path / "hand.yaml"
    path.write_text(
        text.replace("joint_defaults:\n", "joint_defaults:\n  coulomb_friction: {torque_nm: 0.02}\n"), "utf-8"
    )
    rough = load_hand(path)
    commands = np.repeat(np.linspace(0, 3e5, 1000)[:, None], 11, axis=1)
    plain = HandPlant(load_hand(CONFIG), PERIOD_S).advance(commands)[-1, PHI]
    slow = HandPlant(rough, PERIOD_S).advance(commands)[-1, PHI]
    assert np.degrees(plain - slow).min() > 2.0


def test_catalogue_is_whole() -> None:
    """Fails when an effect lacks a text, a probe has another length than its keys, or a key is unknown."""
    assert len(EFFECTS) == len(CATALOGUE)
    for effect in CATALOGUE:
        assert effect.doc and effect.source and effect.says, effect.name
        assert all(key in ROW for key in effect.keys), effect.name
        assert all(len(probe) == len(effect.keys) for probe in effect.probes), effect.name


def test_polynomial_sine_and_cosine() -> None:
    """Fails when the vectorised sine is off by more than a tenth of a milliradian of slope over the range used."""
    for x in np.linspace(-2.2, 2.2, 89):
        assert np.allclose(sine_cosine(x), (np.sin(x), np.cos(x)), atol=1e-4)
