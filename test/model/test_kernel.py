"""The kernel as a whole: its two loops agree, effects leave the plain plant continuously, frame rates do not matter.

Fails when the equations or the integrator of one loop differ from those of the other.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_identification.excitation import EXPERIMENTS, set_points
from hand_identification.free_parameters import probe_values
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import ANGLE, EXOGENOUS, INFLOW, NEIGHBOUR, PARTNER, SPEED, TIME, Effect
from hand_model.kernel import closed_loop
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.hooks import HAND_EFFECTS, OPEN_EFFECTS, active_effects, compose
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_model.kernel.narrow_loops import MOST_COMPILED, NarrowLoops
from hand_model.kernel.open_loop import MeasuredInputs, open_loop
from hand_model.kernel.open_stages import JOINT, VALVE, Stage
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, STATES, STEP_S
from hand_sim.plant import HandPlant, resting_state

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
PERIOD_S = 0.005
SMOOTH = ("supply", "valve", "fluid", "angle_sensor", "pressure_sensor")
"""Places whose effects neither stick nor strike."""
ALL_BUT_SWITCHING = tuple(effect for effect in CATALOGUE if "valve" not in effect.hooks)


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(CONFIG)


def steps(seconds: float, joints: int = 11, seed: int = 1) -> Array:
    """Random set-points (samples, joints) [Pa] that change every 0.75 s, the first of them after 0.1 s of 0."""
    rng = np.random.default_rng(seed)
    count = round(seconds / PERIOD_S)
    commands = np.repeat(rng.uniform(0.0, 4e5, (count // 150 + 1, joints)), 150, axis=0)[:count]
    commands[:20] = 0.0
    return commands


def changed(hand: Hand, **values: float) -> Hand:
    parameters = hand.parameters.copy()
    for key, value in values.items():
        parameters[ROW[key.replace("__", ".")]] = value
    return replace(hand, parameters=parameters)


def closed(hand: Hand, commands: Array, effects: tuple[Effect, ...] | None = None, period_s: float = PERIOD_S) -> Array:
    """States (samples + 1, STATES, joints) with a set of effects compiled in, the one at the start included."""
    start = resting_state(hand)[None]
    loop = ClosedLoop(hand.parameters[None], hand.partner, start, period_s, effects=effects)
    return np.concatenate([start, loop.advance(commands[None])[0]])


def measured(states: Array, joint: int, partner: int, commands: Array, period_s: float) -> MeasuredInputs:
    """What was measured around a joint: states (samples, STATES, joints), as inputs of the open loop."""
    around = np.zeros((len(states), EXOGENOUS))
    around[:, TIME] = np.arange(len(states)) * period_s
    around[:, ANGLE], around[:, SPEED] = states[:, PHI, joint], states[:, OMEGA, joint]
    if partner >= 0:
        around[:, PARTNER] = np.gradient(states[:, OMEGA, partner], period_s)
        around[:, NEIGHBOUR] = states[:, PHI, partner]
    return MeasuredInputs(commands[:, joint], np.ascontiguousarray(states[:, P, joint]), around, period_s)


@pytest.mark.parametrize("effects", [ALL_BUT_SWITCHING, CATALOGUE])
def test_effects_compiled_in_but_neutral_change_no_bit(hand: Hand, effects: tuple[Effect, ...]) -> None:
    """Fails when a neutral effect rounds, or changes how the compiler rounds the equations of the plain plant."""
    commands = np.random.default_rng(5).uniform(-5e4, 6.5e5, (40, 11)).repeat(20, axis=0)
    np.testing.assert_array_equal(closed(hand, commands, effects), closed(hand, commands, ()))


def test_the_open_loop_with_neutral_effects_changes_no_bit(hand: Hand) -> None:
    """Fails when the open loop for fits with every effect compiled in differs from the plain one."""
    commands = steps(4.0)
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 4, 3, commands, PERIOD_S)
    columns, start = hand.parameters[:, [4]].T, states[0][:, [4]].T
    whole, plain = (open_loop(columns, start, inputs, effects=effects) for effects in (OPEN_EFFECTS, ()))
    np.testing.assert_array_equal(whole, plain)


def test_the_closed_loop_of_all_effects_of_a_hand_changes_no_bit(hand: Hand) -> None:
    """Fails when a hand moves otherwise by the loop that the build compiled than by one of its own effects."""
    commands = np.random.default_rng(7).uniform(0.0, 5e5, (30, 11)).repeat(20, axis=0)
    rubbing = changed(hand, coulomb_friction__torque_nm=0.01, contact__angle_deg=0.6, contact__stiffness_nm_per_rad=0.4)
    own = closed(rubbing, commands, active_effects(rubbing.parameters))
    np.testing.assert_array_equal(closed(rubbing, commands, HAND_EFFECTS), own)


def test_a_hand_takes_the_loop_that_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a loop is compiled although that of all effects is there, or that one cannot compute what acts."""
    friction, switching = (EFFECTS["coulomb_friction"],), (EFFECTS["switching_valve"],)
    kept = {HAND_EFFECTS}
    monkeypatch.setattr(closed_loop, "_uncompiled", lambda effects, laws: effects)
    monkeypatch.setattr(closed_loop, "is_kept", lambda effects, _: effects in kept)
    choose = closed_loop._compiled_in.__wrapped__
    assert choose(friction, False, True) == HAND_EFFECTS
    assert choose(friction, True, True) == choose(friction, False, False) == friction
    assert choose(switching, False, True) == switching
    kept.add(friction)
    assert choose(friction, False, True) == friction
    kept.clear()
    assert choose(friction, False, True) == friction


def test_parameters_that_change_on_the_way_leave_the_state(hand: Hand) -> None:
    """Fails when the state or the memory of effects is lost at a change, or the change comes at another sample."""
    commands = steps(4.0)
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 4, -1, commands, PERIOD_S)
    creeping = changed(hand, constant_load__torque_nm=-0.02, hysteresis__torque_nm=0.01)
    plain, loaded = hand.parameters[:, [4]].T, creeping.parameters[:, [4]].T
    start = states[0][:, [4]].T
    at = len(commands) // 2
    always = open_loop(loaded, start, inputs)
    np.testing.assert_array_equal(open_loop(loaded, start, inputs, changed=(at, loaded)), always)
    late = open_loop(plain, start, inputs, changed=(at, loaded))[0]
    before = open_loop(plain, start, inputs)[0]
    np.testing.assert_array_equal(late[:, : at + 1], before[:, : at + 1])
    step_deg = np.degrees(np.diff(late[1]))
    assert abs(step_deg[at]) < 2.0 < np.degrees(np.abs(late[1] - before[1]).max())
    np.testing.assert_allclose(late[1, -50:], always[0, 1, -50:], atol=np.radians(0.5))


BEGINNING = {
    "ageing.strength_per_h": 0.01,
    "thermal_drift.torque_nm": 0.05,
}
"""Effects with time or memory, and values (SI) that move the joint within seconds."""


@pytest.mark.parametrize("key", BEGINNING)
def test_an_effect_that_begins_has_no_past(hand: Hand, key: str) -> None:
    """Fails when an effect that begins has aged or warmed before, so that the joint jumps at that time."""
    commands = np.full((1600, 11), 2e5)
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 4, -1, commands, PERIOD_S)
    plain = hand.parameters[:, [4]].T
    begun, start, at = plain.copy(), states[0][:, [4]].T, 800
    begun[:, ROW[key]] = BEGINNING[key]
    before = open_loop(plain, start, inputs)[0, 1]
    away = np.degrees(open_loop(plain, start, inputs, changed=(at, begun))[0, 1] - before)
    always = np.degrees(open_loop(begun, start, inputs)[0, 1] - before)
    assert np.all(away[: at + 1] == 0.0)
    assert np.abs(away[at : at + 10]).max() < 0.05 < 0.2 < max(np.abs(always[at]), np.abs(away[-1]))


def drawn_sets(count: int) -> list[tuple[Effect, ...]]:
    """Sets of one or two effects of a hand, drawn at random."""
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    drawn = [sorted(rng.choice(len(HAND_EFFECTS), 1 + k % 2, replace=False)) for k in range(count)]
    return [tuple(HAND_EFFECTS[int(k)] for k in each) for each in drawn]


def test_a_loop_of_the_acting_effects_alone_changes_no_bit(hand: Hand) -> None:
    """Fails when a fit computes something else by the loop of its own effects than by that of all of them."""
    rng, commands = np.random.default_rng(6), steps(4.0)
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 4, 3, commands, PERIOD_S)
    for number, effects in enumerate(drawn_sets(2)):
        columns = np.repeat(hand.parameters[:, [4]].T, 8, axis=0)
        for own in (own for effect in effects for own in effect.parameters if number > 0 or not own.law):
            low, high = own.low * own.scale, own.high * own.scale
            moved = columns[:, ROW[own.key]] + rng.uniform(-0.3, 0.5, 8) * own.typical * own.scale
            columns[:, ROW[own.key]] = np.clip(moved, low, high)
        start = np.repeat(states[0][:, [4]].T, 8, axis=0)
        acting = active_effects(columns.T)
        narrow, wide = (open_loop(columns, start, inputs, effects=each) for each in (acting, HAND_EFFECTS))
        names = [effect.name for effect in acting]
        np.testing.assert_array_equal(narrow, wide, err_msg=f"{names}, laws {number > 0}")


def test_a_set_of_effects_gets_a_loop_of_its_own_when_it_is_worth_compiling() -> None:
    """Fails when a loop is compiled for a few steps, never for many, or not taken from the disk at once."""
    friction, leak = (EFFECTS["coulomb_friction"],), (EFFECTS["leak"],)
    loops = NarrowLoops(lambda effects, laws: (effects, laws), lambda effects, laws: effects == leak, worth_steps=100)
    assert loops.loop(leak, HAND_EFFECTS, False, 1) == (leak, False)
    assert [loops.loop(friction, HAND_EFFECTS, False, 40)[0] for _ in range(3)] == [HAND_EFFECTS] * 2 + [friction]
    assert [loops.loop(friction, HAND_EFFECTS, True, 8) for _ in range(2)] == [(HAND_EFFECTS, True), (friction, True)]
    assert loops.loop((), OPEN_EFFECTS, False, 100) == (OPEN_EFFECTS, False)
    both = (*friction, *leak)
    assert [loops.loop(both, HAND_EFFECTS, False, 101)[0] for _ in range(2)] == [HAND_EFFECTS, both]
    many = [(effect,) for effect in HAND_EFFECTS]
    own = sum(loops.loop(each, HAND_EFFECTS, False, 1_000)[0] == each for each in many)
    assert own == MOST_COMPILED - 3 + 2  # three were compiled before; two are there already


def test_the_disk_is_asked_for_a_loop_once_and_not_for_a_few_steps() -> None:
    """Fails when sets of effects that are simulated once cost a look at the disk, or one on the disk is not used."""
    leak, asked = (EFFECTS["leak"],), []

    def is_kept(effects: tuple[Effect, ...], laws: bool) -> bool:
        asked.append((effects, laws))
        return True

    loops = NarrowLoops(lambda effects, laws: effects, is_kept, worth_steps=1_000)
    given = [loops.loop(leak, HAND_EFFECTS, False, 4) for _ in range(5)]
    assert given == [HAND_EFFECTS] * 2 + [leak] * 3
    assert asked == [(leak, False)]


def test_a_description_without_effects_is_the_plain_plant(hand: Hand) -> None:
    """Fails when neutral parameters count as an effect, or an effect is not seen."""
    assert active_effects(hand.parameters) == ()
    rough = changed(hand, coulomb_friction__torque_nm=0.01)
    assert active_effects(rough.parameters) == (EFFECTS["coulomb_friction"],)


@pytest.mark.parametrize("late_s", [0.0, 0.0013])
def test_set_points_between_the_samples_act_at_their_own_times(late_s: float, hand: Hand) -> None:
    """Fails when a set-point that changes between two samples acts at a sample instead, or a part is skipped."""
    every, commands = 8, steps(3.0, seed=3)
    commands[300:] = np.roll(commands[300:], 3, axis=0)  # changes between the samples that are kept
    states = closed(hand, commands, ())[:-1]
    fine = measured(states, 4, -1, commands, PERIOD_S)
    count = (len(commands) - 1) // every
    last = every * count + 1
    coarse = MeasuredInputs(
        fine.set_point_pa[:last], fine.pressure_pa[:last], fine.surroundings[:last:every], every * PERIOD_S, late_s
    )
    fine = replace(fine, late_s=late_s)
    columns, start = hand.parameters[:, [4]].T, states[0][:, [4]].T
    slow, fast = (open_loop(columns, start, inputs)[0, :2] for inputs in (coarse, fine))
    np.testing.assert_allclose(slow, fast[:, :last:every], rtol=0.0, atol=1e-6)


def test_lanes_do_not_mix(hand: Hand) -> None:
    """Fails when a parameter set's prediction depends on those it is computed together with."""
    commands = steps(3.0)
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 0, -1, commands, PERIOD_S)
    columns = np.repeat(hand.parameters[:, 0][None], 20, axis=0)
    columns[:, ROW["statics.a2_nm_per_pa"]] *= np.random.default_rng(2).uniform(0.7, 1.3, 20)
    start = np.zeros((20, STATES))
    together = open_loop(columns, start, inputs)
    np.testing.assert_array_equal(together[7], open_loop(columns[7:8], start[:1], inputs)[0])


def test_no_stage_takes_two_sets_for_one(hand: Hand) -> None:
    """Fails when a stage depends on a number that is not among its rows: it would get the readings of another set."""
    commands = steps(2.0)
    states = closed(hand, commands, ())[:-1]
    inputs = replace(measured(states, 4, 3, commands, PERIOD_S), late_s=0.3 * PERIOD_S)
    nominal = hand.parameters[:, 4]
    for row, own in enumerate(JOINT_PARAMETERS):
        columns = np.repeat(nominal[None], 3, axis=0)
        moved = columns[1, row] + (0.1 * own.typical * own.scale or 0.1 * abs(columns[1, row]) or 0.01 * own.scale)
        columns[1:, row] = np.clip(moved, own.low * own.scale, own.high * own.scale)
        start = np.tile(states[0, :, 4], (3, 1))
        start[2] += [1e3, 0.01, 0.01, 0.01]
        driven = row % 2 == 0
        together = open_loop(columns, start, inputs, lever_m=0.03, driven=driven, effects=OPEN_EFFECTS)
        for k in (1, 2):
            alone = open_loop(
                columns[k : k + 1], start[k : k + 1], inputs, lever_m=0.03, driven=driven, effects=OPEN_EFFECTS
            )
            np.testing.assert_array_equal(together[k], alone[0], err_msg=own.key)


def test_equal_sets_of_a_stage_are_computed_once(hand: Hand, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a fit simulates the valve again for each number of the joint."""
    commands = steps(2.0)
    inputs = measured(closed(hand, commands, ())[:-1], 4, 3, commands, PERIOD_S)
    columns = np.repeat(hand.parameters[:, 4][None], 30, axis=0)
    columns[:20, ROW["statics.a2_nm_per_pa"]] *= np.linspace(1.01, 1.2, 20)
    columns[20:, ROW["valve.time_constant_s"]] *= np.linspace(1.01, 1.2, 10)
    blocks, run = {}, Stage.run

    def counted(stage: Stage, loop: Any, work: Array, *rest: Any) -> None:
        blocks[stage] = len(work)
        run(stage, loop, work, *rest)

    monkeypatch.setattr(Stage, "run", counted)
    open_loop(columns, np.zeros((30, STATES)), inputs, effects=())
    assert blocks == {VALVE: 2, JOINT: 3}  # 11 and 21 different sets in blocks of 8


def scaled(effect: Effect, nominal: Array, probe: dict[int, float], size: float) -> Array:
    """Parameters (rows,) of an effect between nominal (0) and a probe (1); what only shapes it is the probe's."""
    column = nominal.copy()
    for row, value in probe.items():
        shapes = JOINT_PARAMETERS[row].key in effect.shape and JOINT_PARAMETERS[row].key not in hand_numbers()
        column[row] = value if shapes else nominal[row] + size * (value - nominal[row])
    return column


def hand_numbers() -> set[str]:
    """Keys of the plain plant: they have no neutral value from which an effect grows, so they scale as well."""
    own = {parameter.key for effect in CATALOGUE for parameter in effect.parameters}
    return {parameter.key for parameter in JOINT_PARAMETERS} - own


@pytest.fixture(scope="module")
def recorded(hand: Hand) -> Any:
    """Inputs of the open loop over 8 s with moving neighbours, inflow and touching force, and the first state."""
    commands = steps(8.0)
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 4, 3, commands, PERIOD_S)
    inputs.surroundings[:, INFLOW] = np.maximum(np.gradient(states[:, P], PERIOD_S, axis=0), 0.0).sum(axis=1)
    return inputs, states[0][:, 4], hand.parameters[:, 4].copy()


WITHOUT_KEYS: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "hydraulic": ({}, {"share": 1.0}),
    "unnamed_pressure": ({"offset": 0.2, "set_point_per_pa": 1e-6}, {"knot_2_pa": 2e4, "sine_pa": -8e3}),
    "unnamed_torque": ({"offset": 0.2, "angle_per_rad": 0.5}, {"knot_3_nm": 0.02, "cosine_nm": 0.008}),
}
"""Effects that no search tries, but that have a size all the same: what shapes each, and what scales with its size."""
SWITCHES = {
    "switching_valve": "it replaces the valve by another one, wholly or not at all",
    "dropped_frames": "it has no equation: frames are there or not",
}
"""Effects without a size, and why."""
DECADE = 0.15
"""Largest share of a difference that a tenth of the size may leave; in proportion it is 0.1."""
STEEPER = {"pressure_offset": 0.17}
"""A thousandth lifts the joint off its stop one step earlier than none does: 8e-5 rad, a tenth of it at the next."""


def sizes_of(effect: Effect, nominal: Array, sizes: tuple[float, ...]) -> list[Array]:
    """Parameters (sizes, rows) at sizes of the effect, for each of its probes."""
    if effect.keys:
        probes = probe_values(effect, nominal)
        return [np.array([scaled(effect, nominal, probe, size) for size in sizes]) for probe in probes]
    shape, scale = WITHOUT_KEYS[effect.name]
    columns = np.tile(nominal, (len(sizes), 1))
    for key, value in shape.items():
        columns[:, ROW[f"{effect.name}.{key}"]] = value
    for key, value in scale.items():
        columns[:, ROW[f"{effect.name}.{key}"]] = value * np.array(sizes)
    return [columns]


def test_every_effect_has_a_size_or_a_reason_for_none() -> None:
    """Fails when a new effect is left out of the test of small effects."""
    without_keys = {effect.name for effect in CATALOGUE if not effect.keys}
    assert without_keys == WITHOUT_KEYS.keys() | SWITCHES.keys()


@pytest.mark.parametrize(
    "effect", [e for e in CATALOGUE if e.name not in SWITCHES], ids=lambda effect: str(effect.name)
)
def test_a_small_effect_is_a_small_difference(effect: Effect, recorded: Any) -> None:
    """Fails when an effect jumps as it is switched on, or grows like a root: a tenth of it differs by a tenth."""
    inputs, start, nominal = recorded
    chosen = (effect,) if effect.name in WITHOUT_KEYS else None
    plain = open_loop(nominal[None], start[None], inputs, effects=())[0]
    for columns in sizes_of(effect, nominal, (0.0, 1.0, 1e-1, 1e-2, 1e-3)):
        readings = open_loop(columns, np.tile(start, (5, 1)), inputs, effects=chosen)
        scale = np.array([1e5, 1.0, 1.0])[:, None]
        whole, *less = (float(np.abs((out - readings[0]) / scale).max()) for out in readings[1:])
        if not effect.shape:
            np.testing.assert_array_equal(readings[0], plain)
        assert np.isfinite(whole)
        assert effect.name not in WITHOUT_KEYS or whole > 1e-3
        assert less[1] <= 0.05 * whole + 1e-12, f"{effect.name}: {less[1]:.2g} at a hundredth, {whole:.2g} whole"
        bound = STEEPER.get(effect.name, DECADE)
        for before, after in pairwise(less):
            assert after <= bound * before + 1e-9, f"{effect.name}: {after:.2g} at a tenth of {before:.2g}"


def test_every_effect_acts_in_the_closed_loop(hand: Hand) -> None:
    """Fails when an effect of the plant is not hooked in, or its readings are not finite."""
    commands = steps(6.0)
    plain = closed(hand, commands, ())
    for effect in CATALOGUE:
        own = [parameter.key for parameter in effect.parameters]
        if not own or not effect.probes or effect.place in ("force_sensor", "timing"):
            continue
        largest = 0.0
        for probe in probe_values(effect, hand.parameters[:, 0]):
            parameters = hand.parameters.copy()
            parameters[list(probe)] = np.array(list(probe.values()))[:, None]
            states = closed(replace(hand, parameters=parameters), commands, CATALOGUE)
            assert np.all(np.isfinite(states)), effect.name
            moved = np.abs(states - plain)[:, [P, PHI]].max(axis=(0, 2)) / (500.0, np.radians(0.05))
            largest = max(largest, float(moved.max()))
        assert largest > 1.0, effect.name


def test_the_integration_step_does_not_change_an_effect(hand: Hand) -> None:
    """Fails when what an effect does depends on the integration step: a lag half a step early is another lag."""
    commands, nominal = steps(12.0), hand.parameters[:, 0]
    states = closed(hand, commands, ())[:-1]
    inputs = measured(states, 0, -1, commands, PERIOD_S)
    inputs.surroundings[:, INFLOW] = 5e5 * np.repeat(np.random.default_rng(4).random(len(commands) // 40), 40)
    for effect in OPEN_EFFECTS:
        probes = probe_values(effect, nominal) if effect.place in SMOOTH else []
        columns = np.repeat(nominal[None], 1 + len(probes), axis=0)
        for column, probe in zip(columns[1:], probes, strict=True):
            column[list(probe)] = list(probe.values())
        start = np.tile(states[0][:, 0], (len(columns), 1))
        fine, coarse = (open_loop(columns, start, inputs, step_s=step)[:, :2] for step in (0.4e-3, 2.6e-3))
        changes, errors = fine[1:] - fine[:1], (coarse[1:] - coarse[:1]) - (fine[1:] - fine[:1])
        for change, error in zip(changes, errors, strict=True):
            stage = int(np.abs(change[0]).max() < 10.0)
            assert np.sqrt((error[stage] ** 2).mean()) <= 0.02 * np.sqrt((change[stage] ** 2).mean()), effect.name


@pytest.mark.parametrize("rate_hz", [20, 40, 60, 100, 140, 500, 700, 980, 1000])
def test_the_frame_rate_does_not_change_the_motion(hand: Hand, rate_hz: int) -> None:
    """Fails when a trajectory depends on the frame rate by more than 0.005 degrees or 20 Pa.

    The dead time is no whole number of integration steps, and the set-points drive the valve into its rate limits.
    """
    late = changed(hand, valve__dead_time_s=0.0071)
    levels = np.random.default_rng(6).choice([0.0, 3e5, 6e5], (60, 11))
    reference, found = (
        closed(late, np.repeat(levels, rate // 20, axis=0), (), 1.0 / rate)[:: rate // 20] for rate in (200, rate_hz)
    )
    difference = np.abs(reference - found).max(axis=(0, 2))
    assert np.degrees(difference[PHI]) < 0.005
    assert difference[P] < 20.0


EXCEPTIONS = {("supply_droop", 2): (0.01, 20.0), ("coulomb_friction", 3): (0.12, 20.0), ("end_stop", 2): (0.01, 20.0)}
"""Probes with another bound than 0.005 degrees and 20 Pa: a supply that answers within 2 ms, 4 steps; friction that
falls with the speed, where two motions part when one just stops; a stop that is hit at full speed. docs/model.md."""


@pytest.mark.parametrize("rate_hz", [140, 700, 980])
def test_the_frame_rate_does_not_change_an_effect(hand: Hand, rate_hz: int) -> None:
    """Fails when the trajectory with any effect at any probe differs from that at 20 Hz by more than 0.005 degrees or
    20 Pa: an equation that runs once per frame, one of first order in the step, a step that a change divides wrongly.

    None of these rates divides into steps of 0.5 ms, and the dead time is no whole number of the steps that they give.
    """
    levels = np.random.default_rng(7).uniform(0.0, 4e5, (60, 11))
    beyond = {}
    for effect in (effect for effect in ALL_BUT_SWITCHING if effect.probes):
        for number, probe in enumerate(probe_values(effect, hand.parameters[:, 0])):
            parameters = hand.parameters.copy()
            parameters[list(probe)] = np.array(list(probe.values()))[:, None]
            other = replace(hand, parameters=parameters)
            slow, fast = (
                closed(other, np.repeat(levels, rate // 20, axis=0), ALL_BUT_SWITCHING, 1.0 / rate)[:: rate // 20]
                for rate in (20, rate_hz)
            )
            difference = np.abs(slow - fast).max(axis=(0, 2))
            found, bounds = (
                (np.degrees(difference[PHI]), difference[P]),
                EXCEPTIONS.get((effect.name, number), (0.005, 20.0)),
            )
            if any(value >= bound for value, bound in zip(found, bounds, strict=True)):
                beyond[effect.name, number] = found
    assert not beyond


def test_hooks_refuse_a_set_out_of_order() -> None:
    """Fails when a set of effects in another order is compiled as if the order did not matter."""
    with pytest.raises(ValueError, match="order of the catalogue"):
        compose((EFFECTS["leak"], EFFECTS["valve_lag"]))


def test_coulomb_friction_sticks(hand: Hand) -> None:
    """Fails when a joint held by dry friction creeps, or slides although the torque is below the friction."""
    stuck = changed(hand, coulomb_friction__torque_nm=0.05, material__phi_max_deg=0.0)
    plant = HandPlant(stuck, PERIOD_S)
    before = plant.state[PHI].copy()
    plant.advance(np.full((400, 11), 2e4))  # about 0.02 N m
    assert np.abs(plant.state[PHI] - before).max() < 1e-9
    plant.advance(np.full((400, 11), 3e5))
    assert np.degrees(plant.state[PHI] - before).min() > 30.0


def test_backlash_is_the_gap_at_reversal(hand: Hand) -> None:
    """Fails when the measured angle does not stay behind by the gap between rising and falling at one pressure."""
    loose = changed(hand, backlash__gap_deg=np.radians(3.0), material__phi_max_deg=0.0)
    triangle = np.concatenate([np.linspace(0, 4e5, 3000), np.linspace(4e5, 0, 3000)])
    commands = np.repeat(triangle[:, None], 11, axis=1)
    widths = []
    for plant in (loose, changed(loose, backlash__gap_deg=0.0)):
        states = HandPlant(plant, PERIOD_S).advance(commands)
        up = np.interp(2e5, states[:3000, P, 0], states[:3000, PHI, 0])
        down = np.interp(2e5, states[3000:, P, 0][::-1], states[3000:, PHI, 0][::-1])
        widths.append(np.degrees(down - up))
    assert widths[0] - widths[1] == pytest.approx(3.0, abs=0.02)


def test_hydraulic_joint_resists_and_still_holds(hand: Hand) -> None:
    """Fails when `fluid: hydraulic` does not slow the motion down, or settles at another angle."""
    liquid = changed(hand, hydraulic__share=1.0)
    assert active_effects(liquid.parameters) == (EFFECTS["hydraulic"],)
    ends = [HandPlant(plant, PERIOD_S).advance(np.full((1200, 11), 2e5))[:, PHI, 0] for plant in (hand, liquid)]
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
    commands = np.repeat(np.linspace(0, 3e5, 1000)[:, None], 11, axis=1)
    plain = HandPlant(load_hand(CONFIG), PERIOD_S).advance(commands)[-1, PHI]
    slow = HandPlant(load_hand(path), PERIOD_S).advance(commands)[-1, PHI]
    assert np.degrees(plain - slow).min() > 2.0


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_open_and_closed_loop_agree(hand: Hand, name: str) -> None:
    """Fails when the two loops differ by more than 0.005 degrees or 20 Pa on a motion of `hand excite`.

    The open loop gets pressures and the partner's acceleration at every integration step: only the loops differ.
    """
    finger = ("index_proximal", "index_distal")
    proximal, distal = (hand.joints.index(joint) for joint in finger)
    at_frames = set_points(name, hand, finger, 20.0, 6e5, seed=1)
    commands = np.repeat(at_frames, round(1.0 / hand.rate_hz / STEP_S), axis=0)
    commands[:40] = 0.0
    states = closed(hand, commands, (), STEP_S)[:-1]
    inputs = measured(states, distal, proximal, commands, STEP_S)
    predicted = open_loop(hand.parameters[:, [distal]].T, states[0][:, [distal]].T, inputs, effects=())[0]
    assert np.degrees(np.abs(predicted[1] - states[:, PHI, distal]).max()) < 0.005
    assert np.abs(predicted[0] - states[:, P, distal]).max() < 20.0
