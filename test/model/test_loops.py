"""The loops of the kernel over a few steps: against closed forms, against each other, and lane by lane.

Few enough steps to run without compilation, so that a mutation run can use these tests.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.description import Hand, load_hand
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import ACCELERATION, ANGLE, EXOGENOUS, NEIGHBOUR, PARTNER, SPEED, TIME, Effect
from hand_model.kernel import closed_loop
from hand_model.kernel.closed_loop import HISTORY, ClosedLoop
from hand_model.kernel.hooks import OPEN_EFFECTS, active_effects, compose, equations_key, has_laws
from hand_model.kernel.lanes import HALF, LANES, idle_parameters, map_hands, neighbour_lanes
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P, resting_states
from hand_model.kernel.open_loop import MeasuredInputs, open_loop, surroundings_of
from hand_model.kernel.rows import ROW, STATES, STEP_S

HAND = load_hand(Path(__file__).resolve().parents[2] / "config" / "hand.yaml")
PROXIMAL, DISTAL = (HAND.joints.index(joint) for joint in ("index_proximal", "index_distal"))
EVERY_CLOSED = tuple(effect for effect in CATALOGUE if "valve" not in effect.hooks)
"""Sets of effects whose loops other tests compile as well."""
FAST = {"valve.fill_rate_pa_per_s": 1e9, "valve.vent_rate_pa_per_s": 1e9}
"""A valve without a limit of its flow: its pressure follows one time constant."""
SETS = {
    "plain": {},
    "friction": {"coulomb_friction.torque_nm": 0.01, "leak.rate_per_s": 0.3, "hall_misalignment.sine_deg": 0.02},
    "others": {"joint_coupling.stiffness_nm_per_rad": 0.02, "pressure_gain.error": 0.05},
}


def varied(changes: dict[str, float], hand: Hand = HAND) -> Array:
    """Parameters (rows, joints) with these values in SI at every joint."""
    parameters = hand.parameters.copy()
    for key, value in changes.items():
        parameters[ROW[key]] = value
    return parameters


def closed(parameters: Array, commands: Array, period_s: float, effects: tuple[Effect, ...] | None = None) -> Array:
    """States (samples + 1, STATES, joints) from rest, that at the start included."""
    start = resting_states(parameters)[None]
    chosen = EVERY_CLOSED if effects is None and active_effects(parameters) else effects or ()
    loop = ClosedLoop(parameters[None], HAND.partner, start, period_s, effects=chosen)
    return np.concatenate([start, loop.advance(commands[None])[0]])


def test_a_set_point_acts_after_the_dead_time() -> None:
    """Fails when a set-point reaches the valve at another time, or the memory of set-points mixes samples or lanes."""
    period_s, tau = 0.002, 0.02
    for dead_s in (0.0, 0.003, 0.0071):
        parameters = varied(FAST | {"valve.dead_time_s": dead_s, "valve.time_constant_s": tau})
        commands = np.zeros((14, 11))
        commands[3:] = np.linspace(1e5, 3e5, 11)
        states = closed(parameters, commands, period_s)
        since = np.arange(15) * period_s - 3 * period_s - dead_s
        expected = commands[-1] * -np.expm1(-np.maximum(since, 0.0) / tau)[:, None]
        np.testing.assert_allclose(states[:, P], expected, atol=150.0)
        inputs = MeasuredInputs(commands[:, DISTAL], states[:-1, P, DISTAL], np.zeros((14, EXOGENOUS)), period_s)
        predicted = open_loop(parameters[:, [DISTAL]].T, states[:1, :, DISTAL], inputs, effects=())[0, 0]
        np.testing.assert_allclose(predicted, expected[:-1, DISTAL], atol=150.0)


@pytest.mark.parametrize("name", SETS)
def test_both_loops_agree(name: str) -> None:
    """Fails when the loops differ by more than their inputs explain: 0.002 degrees and 20 Pa after 80 steps."""
    parameters = varied(SETS[name])
    commands = np.repeat(np.random.default_rng(3).uniform(1e5, 4e5, (8, 11)), 10, axis=0)
    commands[:20] = 0.0  # both loops begin as if the first set-point had been in force for long
    states = closed(parameters, commands, STEP_S)[:-1]
    motion = states[:, PHI, DISTAL], states[:, OMEGA, DISTAL], np.gradient(states[:, OMEGA, DISTAL], STEP_S)
    partner = np.gradient(states[:, OMEGA, PROXIMAL], STEP_S)
    time_s = np.asarray(np.arange(80) * STEP_S, dtype=np.float64)
    around = surroundings_of(time_s, motion, states[:, PHI, PROXIMAL], partner)
    inputs = MeasuredInputs(commands[:, DISTAL], states[:, P, DISTAL].copy(), around, STEP_S)
    sets = np.repeat(parameters[:, [DISTAL]].T, 9, axis=0)
    sets[4, ROW["statics.a0_nm"]] += 0.05  # another set in the same block
    start = np.repeat(states[:1, :, DISTAL], 9, axis=0)
    predicted = open_loop(sets, start, inputs, effects=OPEN_EFFECTS if active_effects(parameters) else ())
    assert np.abs(predicted[0, 0] - states[:, P, DISTAL]).max() < 20.0 < np.ptp(states[:, P, DISTAL])
    reading = states[:, PHI, DISTAL]
    assert np.degrees(np.abs(predicted[0, 1] - reading)).max() < 0.005 < np.degrees(np.ptp(reading))
    np.testing.assert_array_equal(predicted[0], predicted[8])
    assert np.degrees(np.abs(predicted[4, 1] - predicted[0, 1]).max()) > 0.05


def test_imposed_motion_gives_the_force_of_the_equations() -> None:
    """Fails when the force of an imposed motion lacks a term of Eq. 8, or friction has the wrong side."""
    keys = ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
    column = varied({"coulomb_friction.torque_nm": 0.01, "coulomb_friction.presliding_deg": 1e-3})[:, [DISTAL]]
    column[ROW["material.phi_max_deg"]] = 0.0
    time_s = np.asarray(np.arange(12) * 0.005, dtype=np.float64)
    phi: Array = 0.5 + 0.4 * time_s
    omega: Array = np.full(12, 0.4)
    alpha: Array = np.full(12, 2.0)
    around = surroundings_of(time_s, (phi, omega, alpha), partner_rad_s2=3.0)
    inputs = MeasuredInputs(np.full(12, 2e5), np.full(12, 2e5), around, 0.005)
    start = np.array([[2e5, phi[0], 0.4, 0.0]])
    force = open_loop(column.T, start, inputs, lever_m=0.03, driven=True, effects=OPEN_EFFECTS)[0, 2]
    a0, a1, a2, a3 = (column[ROW[f"statics.{key}"], 0] for key in keys)
    inertia, coupling = (column[ROW[f"dynamics.{key}"], 0] for key in ("inertia_kg_m2", "coupling_inertia_kg_m2"))
    damping = column[ROW["dynamics.viscous_friction_nm_s_per_rad"], 0]
    torque = a0 + a1 * phi + (a2 + a3 * phi) * 2e5 - damping * omega - inertia * alpha - coupling * 3.0
    np.testing.assert_allclose(force[2:], ((torque - 0.01) / 0.03)[2:], rtol=3e-3)
    free = open_loop(column.T, start, inputs, lever_m=0.03, effects=OPEN_EFFECTS)[0, 2]
    np.testing.assert_allclose(free[2:], ((torque - 0.01) / 0.03)[2:], rtol=1e-3)


def test_parameters_change_at_their_sample() -> None:
    """Fails when a second parameter set acts earlier or later, or the state is lost at the change."""
    inputs = MeasuredInputs(np.full(12, 2e5), np.full(12, 2e5), np.zeros((12, EXOGENOUS)), 0.005)
    nominal = HAND.parameters[:, [DISTAL]].T
    loaded = nominal.copy()
    loaded[:, ROW["statics.a0_nm"]] += 0.05
    start = resting_states(HAND.parameters)[None, :, DISTAL]
    before, after = (open_loop(each, start, inputs, effects=())[0, 1] for each in (nominal, loaded))
    changed = open_loop(nominal, start, inputs, effects=(), changed=(5, loaded))[0, 1]
    np.testing.assert_array_equal(changed[:6], before[:6])
    assert abs(changed[6] - before[6]) > 1e-4
    assert 0.0 < changed[-1] - before[-1] < after[-1] - before[-1]


def test_a_loop_can_be_moved_and_changed() -> None:
    """Fails when a shift, a held history or a changed parameter reaches another row, lane or joint."""
    loop = ClosedLoop(HAND.parameters[None], HAND.partner, resting_states(HAND.parameters)[None], 0.005)
    change = np.zeros((1, STATES, 11))
    change[0, PHI] = np.arange(11) * 0.01
    rest = loop.state
    loop.shift(change)
    np.testing.assert_allclose(loop.state - rest, change, atol=1e-12)
    loop.hold_history(np.full((1, 11), 2e5))
    first = loop.advance(np.full((1, 1, 11), 2e5))[0, 0]
    assert (first[P] > 1e3).all()  # the dead time is over
    limp = np.full((1, 11), HAND.row("statics.a0_nm"))
    limp[0, 4] += 0.2
    loop.change("statics.a0_nm", limp)
    moved = loop.advance(np.full((1, 4, 11), 2e5))[0]
    slow = np.delete(moved[-1, OMEGA], [3, 4])
    assert moved[-1, OMEGA, 4] > 2.0 * slow.max()
    with pytest.raises(ValueError, match=r"valve.dead_time_s is 1; .* 0 to 0.63"):
        ClosedLoop(varied({"valve.dead_time_s": 1.0})[None], HAND.partner, rest, 0.005)
    assert pytest.approx(0.63) == (HISTORY - 2) * 0.005
    for bad in (0.0, -1.0, np.inf):
        with pytest.raises(ValueError, match="period_s"):
            ClosedLoop(HAND.parameters[None], HAND.partner, rest, bad)
    with pytest.raises(ValueError, match="pressure_pa has the shape"):
        loop.advance(np.zeros((1, 11)))


def test_effects_between_joints_use_the_neighbour() -> None:
    """Fails when a coupling pulls the wrong joint, or the inflow of the hand is not the sum over its joints."""
    coupled = varied({"joint_coupling.stiffness_nm_per_rad": 0.05})
    still, commands = np.zeros((8, 11)), np.zeros((8, 11))
    commands[:, PROXIMAL] = 4e5
    drawn = closed(coupled, commands, 0.005)[-1, OMEGA] - closed(coupled, still, 0.005)[-1, OMEGA]
    alone = closed(varied({}), commands, 0.005)[-1, OMEGA] - closed(varied({}), still, 0.005)[-1, OMEGA]
    pulled = np.abs(drawn - alone)
    assert pulled[DISTAL] > 1e-3 and np.delete(pulled, [PROXIMAL, DISTAL]).max() < 1e-9
    drooping = varied({"supply_droop.resistance_s": 0.02, "supply_droop.share": 1.0})
    one, every = np.zeros((8, 11)), np.full((8, 11), 5.9e5)
    one[:, 0] = 5.9e5
    assert closed(drooping, every, 0.005)[-1, P, 0] < closed(drooping, one, 0.005)[-1, P, 0] - 100.0
    lanes = map_hands(HAND.partner, 2)
    neighbours = neighbour_lanes(lanes, HAND.partner, 2)
    assert lanes.lane[DISTAL] == lanes.lane[PROXIMAL] + HALF or lanes.lane[PROXIMAL] == lanes.lane[DISTAL] + HALF
    assert neighbours[lanes.block[DISTAL], lanes.lane[DISTAL]] == lanes.lane[PROXIMAL]
    assert idle_parameters().shape == (len(ROW),) and lanes.blocks == -(-22 // LANES)


def test_a_set_of_effects_is_refused_out_of_order() -> None:
    """Fails when a set out of order, twice the same effect, or one that the catalogue lacks is composed."""
    leak, lag = EFFECTS["leak"], EFFECTS["valve_lag"]
    for wrong in ((leak, lag), (leak, leak)):
        with pytest.raises(ValueError, match="order of the catalogue"):
            compose(wrong)
    assert compose((lag, leak)).uses("pressure_source") and not compose((lag,)).uses("angle_reading")
    assert active_effects(varied({"leak.rate_per_s": 0.1})) == (leak,)
    assert active_effects(HAND.parameters) == () and not has_laws(HAND.parameters.T)
    law = next(own for effect in CATALOGUE for own in effect.parameters if own.law)
    assert has_laws(varied({law.key: law.neutral_si + 1.0}).T)
    assert equations_key("open", "leak") != equations_key("open") and CREEP == STATES - 1
    assert {TIME, NEIGHBOUR, PARTNER, ANGLE, SPEED, ACCELERATION} < set(range(EXOGENOUS))


def test_lanes_are_read_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the compiler unrolls a loop over lanes before it looks for vectors: it then gathers every other lane,
    and one lag of a sensor takes as much time as the whole plant.
    """
    monkeypatch.setattr(closed_loop, "njit", lambda **options: njit(**(options | {"cache": False})))
    block = closed_loop.loops.__wrapped__((EFFECTS["angle_lag"],)).block
    if not hasattr(block, "inspect_llvm"):
        pytest.skip("nothing is compiled")
    code = block.inspect_llvm(block.signatures[0])
    assert re.search(r"<\d+ x double>", code)
    assert "masked.scatter" not in code
