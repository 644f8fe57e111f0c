"""The law term by term: against the same law in C on inputs that reach every branch, and against closed forms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_control.contact import partner_impact
from hand_control.declared import OUT, STATE, C, G, S, Settings, U
from hand_control.law import Law, _send, _steady_pressure, _take_over_map, _watch_slips
from hand_control.tuning import gains
from hand_model.arrays import Array
from hand_model.description import load_hand
from validation.c_law import CLaw

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
DT_S = 0.005
JOINTS, TICKS = 18, 450
SIZES = np.array([6e5, 0.6, 1.0, 1.0, 0.6, 1.0])[:, None]
BAD_DTS = (-1.0, math.nan, math.inf, -math.inf, 1e38, 1e300, -1e300, 5e-324)
FOUND = [S.load, S.drag, S.spread, S.ahead]
"""Rows that the caller fills before each tick."""
SWITCHES = ("schedule", "feed_forward", "creep", "back_calculation", "adapt", "detect")


def gains_of(values: dict[str, Any] | None = None, joints: int = 1) -> Array:
    """Gains of the first joint of the hand, repeated."""
    g = gains(HAND, Settings.of(HAND, values or {}))
    g = np.repeat(g[:, :1], joints, axis=1)
    g[G.partner] = -1.0
    return g


def different_joints(rng: np.random.Generator) -> Array:
    """Gains of joints that differ in their switches, dead-band, threshold, map and partner."""
    g = gains_of(joints=JOINTS)
    for bit, name in enumerate(SWITCHES):
        g[getattr(G, name)] = [float(i % 3 != 0 or (i >> (bit % 4)) & 1) for i in range(JOINTS)]
    g[G.torque_mode, [5, 11]] = 1.0
    g[G.deadband, ::4] = 0.0
    g[G.deadband, 3] = 0.8
    g[G.threshold] = rng.uniform(0.5, 6.0, JOINTS)
    g[G.i_max] = rng.uniform(0.01, 0.2, JOINTS)
    g[G.p_rate, ::5] = 2e6
    g[G.partner, [0, 1]] = 1.0, 0.0
    g[G.coupling] = 0.5 * g[G.inertia]
    g[G.b1, 8] *= 20.0  # creep reaches its upper bound
    g[G.extension_rate, 8] *= 1e3
    g[G.recovery_rate, 12] *= 1e3
    g[G.creep, [8, 12]] = 1.0
    g[[G.a0, G.a1, G.a2, G.a3, G.viscous]] *= rng.uniform(0.7, 1.3, (5, JOINTS))
    g[G.a3, [6, 7]] *= -0.5
    g[G.residual_std] *= rng.uniform(0.3, 1.0, JOINTS)
    return g


def driven_inputs(rng: np.random.Generator) -> Array:
    """Inputs (ticks, rows, joints): motion, rest, obstacles, saturation, ends of the range, and inputs not finite."""
    t = DT_S * np.arange(TICKS)[:, None]
    phase, rate = rng.uniform(0.0, 6.0, JOINTS), rng.uniform(1.0, 6.0, JOINTS)
    middle, swing = rng.uniform(0.4, 1.1, JOINTS), rng.uniform(0.2, 0.9, JOINTS)
    inputs = np.zeros((TICKS, 6, JOINTS))
    moving = np.where((t % 1.0) < 0.7, 1.0, 0.0)
    swung = swing * np.sin(rate * t * moving + phase)
    inputs[:, U.reference] = middle + swung
    inputs[:, U.speed] = moving * swing * rate * np.cos(rate * t + phase)
    inputs[:, U.acceleration] = -moving * swing * rate**2 * np.sin(rate * t + phase)
    lagging = middle + swing * np.sin(rate * np.maximum(t * moving - 0.02, 0.0) + phase)
    inputs[:, U.position] = lagging + 2e-4 * rng.standard_normal((TICKS, JOINTS))
    inputs[:, U.pressure] = np.maximum(1.3e5 * inputs[:, U.position] + 4e4 * np.sin(2.0 * t + phase), 0.0)
    inputs[:, U.limit] = np.where(np.sin(3.0 * t + phase) > 0.6, 0.01, 0.5)
    inputs[140:150, U.limit, ::4] = [[0.0], [-0.01]] * 5
    inputs[:40, U.pressure, 12] = -5e3  # noise of a vented sensor: creep stays at its lower bound
    inputs[200:260, U.pressure, ::2] += 1.5e5  # an obstacle: pressure without motion
    inputs[200:260, U.position, ::2] = inputs[200, U.position, ::2]
    inputs[60:100, U.pressure, 1::2] += 1.5e5  # pressure while the joint follows: motion contradicts a contact
    inputs[280:330, U.reference] = inputs[280:330, U.position] + 4e-3 * rng.standard_normal((50, JOINTS))
    inputs[280:330, U.speed : U.acceleration + 1] = 0.0
    # every third joint swings about its reference, more and more
    inputs[280:330, U.position, ::3] -= (3e-4 * np.arange(50.0) * np.sin(np.arange(50.0) * math.pi / 7))[:, None]
    inputs[330:450, U.reference], inputs[330:450, U.speed : U.acceleration + 1] = 0.8, 0.0
    inputs[330:450, U.position] = 0.785  # it sticks, slips past its reference, and sticks again
    inputs[380:450, U.position] = 0.785 + np.minimum(6e-3 * np.arange(70.0), 0.025)[:, None]
    inputs[120, U.position, 3], inputs[121, U.limit, 4] = math.nan, math.inf
    return inputs


def test_the_law_is_the_law_in_c_in_every_branch() -> None:
    """Fails when a term, sign, bound, order or state of either law changes and the other does not (seed 1)."""
    rng = np.random.default_rng(1)
    g, inputs = different_joints(rng), driven_inputs(rng)
    python, other = Law(g), CLaw("double", g)
    saturated = contact = contradicted = adapted = slipped = rested = kept = swung = 0
    bounds = set()
    # The rounding of a pressure of 6e5 Pa is 1e-10 Pa.
    smallest = np.array([[1.0 if row.unit == "Pa" else 1e-3] for row in STATE])
    for k in range(TICKS):
        dt = 0.0 if k % 97 == 96 else 0.012 if k % 41 == 40 else DT_S
        dt = BAD_DTS[k // 29 % len(BAD_DTS)] if k % 29 == 28 else dt
        integrate, drive = k % 53 < 48, k % 71 < 68
        if k == 150:
            python.release()
            other.release()
        if k in (90, 350):  # as Law.change does
            python.state[S.take_over] = other.state[S.take_over] = 1.0
        found = rng.uniform(-4e-3, 4e-3, (4, JOINTS))
        found[2] = abs(found[2])
        python.state[FOUND] = other.state[FOUND] = found if 160 < k < 400 else 0.0
        before, loads = python.state[S.contact].copy(), python.state[S.offset].copy()
        got, want = python.tick(inputs[k], dt, integrate, drive), other.tick(inputs[k], dt, integrate, drive)
        np.testing.assert_allclose(got / SIZES, want / SIZES, rtol=1e-9, atol=1e-9, err_msg=f"tick {k}")
        scale = np.abs(other.state) + smallest
        np.testing.assert_allclose(python.state / scale, other.state / scale, rtol=0, atol=1e-9, err_msg=f"tick {k}")
        saturated += int(got[OUT.saturated].sum())
        contact += int(got[OUT.contact].sum())
        contradicted += int(((before != 0.0) & (python.state[S.contact] == 0.0)).sum())
        adapted += int((python.state[S.offset] != 0.0).sum())
        slipped += int((python.state[S.kept_error] != 0.0).sum())
        swung += int((python.state[S.slower] > 0.0).sum())
        standing = python.state[S.stood] >= C.stand_time
        rested += int((standing & (python.state[S.offset] > loads)).sum())
        kept += sum(partner_impact(g, python.state, inputs[k], i) > 0.0 for i in range(JOINTS))
        bounds |= set(python.state[S.creep, [8, 12]].tolist())
    # The inputs reach what they are meant to reach.
    assert min(saturated, contact, contradicted, adapted, slipped, rested, kept, swung) > 20 and bounds >= {
        0.0,
        1.0,
    }


def at(reference: float, position: float, pressure: float, limit: float = 0.6) -> Array:
    inputs = np.zeros((6, 1))
    inputs[U.reference], inputs[U.position], inputs[U.pressure], inputs[U.limit] = reference, position, pressure, limit
    return inputs


def torque_at(g: Array, pressure: float, angle: float) -> float:
    return float((g[G.a0] + g[G.a1] * angle + (g[G.a2] + g[G.a3] * angle) * pressure)[0])


def test_feed_forward_alone_holds_the_reference() -> None:
    """Fails when the command at zero error gives a torque by Eq. 6 at the reference."""
    g = gains_of({"deadband_pa": 0.0, "creep_compensation": False})
    command = Law(g).tick(at(0.7, 0.7, 8e4), DT_S)[OUT.pressure, 0]
    assert torque_at(g, command, 0.7) == pytest.approx(0.0, abs=1e-12)


def test_scheduled_proportional_gain_is_that_of_internal_model_control() -> None:
    """Fails when Kp is not (d + k T) / R with the stiffness k at the measured pressure."""
    g = gains_of({"deadband_pa": 0.0, "creep_compensation": False, "feed_forward": False})
    error, pressure, angle = 0.02, 9e4, 0.6
    command = Law(g).tick(at(angle + error, angle, pressure), DT_S)[OUT.pressure, 0]
    stiffness = -(g[G.a1, 0] + g[G.a3, 0] * pressure)
    kp = (g[G.viscous, 0] + stiffness * g[G.valve_lag, 0]) / (g[G.response_time, 0] + g[G.dead_time, 0])
    assert command == pytest.approx(kp * error / (g[G.a2, 0] + g[G.a3, 0] * angle))


def test_the_integral_grows_by_ki_times_error() -> None:
    """Fails when Ki is not k / R, or the integral is not the integral of the error."""
    g = gains_of({"deadband_pa": 0.0, "creep_compensation": False})
    law = Law(g)
    law.tick(at(0.72, 0.7, 9e4), DT_S)
    stiffness = -(g[G.a1, 0] + g[G.a3, 0] * 9e4)
    assert law.state[S.integral, 0] == pytest.approx(
        stiffness / (g[G.response_time, 0] + g[G.dead_time, 0]) * 0.02 * DT_S
    )


def test_the_integral_stays_where_the_dead_band_causes_the_error() -> None:
    """Fails when the integrator reacts to an error that the dead-band itself leaves."""
    g = gains_of({"creep_compensation": False})
    stiffness = -(g[G.a1, 0] + g[G.a3, 0] * 9e4)
    resolved = g[G.deadband, 0] * (g[G.a2, 0] + g[G.a3, 0] * 0.7) / stiffness + C.noise
    for share, moves in ((0.98, False), (1.02, True)):
        law = Law(g)
        law.tick(at(0.7 + share * resolved, 0.7, 9e4), DT_S)
        assert (law.state[S.integral, 0] != 0.0) == moves


def grown(law: Law, error_rad: float, ticks: int, speed: float = 0.0) -> float:
    """How much the integral [N m] of a joint grows that stands for some ticks with an error."""
    before = law.state[S.integral, 0]
    inputs = at(0.7, 0.7 - error_rad, 9e4)
    inputs[U.speed] = speed
    for _ in range(ticks):
        law.tick(inputs, DT_S)
    return float(law.state[S.integral, 0] - before)


def test_a_slip_past_the_reference_teaches_which_error_to_keep() -> None:
    """Fails when a joint that sticks at rest slips to and fro for ever, or keeps an error that no slip has left."""
    law = Law(gains_of({"creep_compensation": False, "adaptation": False, "contact_detection": False}))
    slow, fast = grown(law, 0.01, 10), grown(law, 0.01, 100) / 10.0
    assert fast > 2.0 * slow > 0.0  # it has stood for 0.1 s: friction yields sooner
    grown(law, -0.016, 60)
    assert law.state[S.kept_error, 0] == pytest.approx(0.016, rel=0.01)
    assert grown(law, -0.015, 20) == grown(law, 0.015, 20) == 0.0
    assert grown(law, 0.019, 20) > 0.0 > grown(law, -0.019, 20)
    for _ in range(round(200.0 / DT_S)):
        law.tick(at(0.7, 0.7, 9e4), DT_S)
    assert grown(law, 0.01, 40) > 0.0  # forgotten


@pytest.mark.parametrize(
    ("slip", "touches", "given_back"), [(0.002, 0.0, True), (-0.002, 0.0, False), (0.002, 1.0, False)]
)
def test_a_slip_takes_a_part_of_what_the_integral_gained(slip: float, touches: float, given_back: bool) -> None:
    """Fails when a joint that breaks away keeps the torque that friction needed, or loses what it had before."""
    law = Law(gains_of({"creep_compensation": False, "adaptation": False, "contact_detection": False}))
    grown(law, 0.015, 22)
    began = law.state[S.stood_integral, 0]
    assert 0.0 < began < law.state[S.integral, 0]
    grown(law, 0.015, 100)
    law.state[S.contact, 0] = touches
    change, steps = 0.0, 0
    while law.state[S.stood, 0] > 0.0:
        held, steps = law.state[S.integral, 0], steps + 1
        change = grown(law, 0.015 - steps * slip, 1)
    usual = 2.0 * 0.03 * DT_S  # growth in a tick, Ki below 2 N m/(rad s), error below 0.03 rad
    assert 1 < steps < 5 and law.state[S.stood_integral, 0] == began
    assert change == pytest.approx(-C.given_back * (held - began) if given_back else 0.0, abs=usual)
    assert usual < 0.2 * C.given_back * (held - began)


@pytest.mark.parametrize(("speed", "given_back"), [(0.06, True), (-0.06, False)])
def test_a_slip_away_from_a_far_reference_takes_nothing(speed: float, given_back: bool) -> None:
    """Fails when the direction of a slip comes from the sum of speed and error instead of their signs."""
    state = np.zeros((len(STATE), 1))
    state[S.stood], state[S.integral] = 0.2, 0.1
    _watch_slips(gains_of(), state, 0, 0.2, speed, True, DT_S)
    assert (state[S.integral, 0] < 0.1) == given_back


@pytest.mark.parametrize(("between", "speed"), [(0.0, 0.0), (None, 0.5)])
def test_an_error_that_changes_without_a_slip_teaches_nothing(between: float | None, speed: float) -> None:
    """Fails when a slow approach, or a motion of the reference, is taken for a slip of friction."""
    law = Law(gains_of({"creep_compensation": False, "adaptation": False, "contact_detection": False}))
    grown(law, 0.01, 40)
    if between is not None:  # below the speed of a slip all the way
        for error in np.linspace(0.01, -0.01, 120):
            grown(law, float(error), 1)
    grown(law, -0.01, 1, speed)
    grown(law, -0.01, 40)
    assert law.state[S.kept_error, 0] == 0.0


@pytest.mark.parametrize("frozen", [False, True])
def test_a_joint_whose_pressure_is_short_learns_no_load_at_rest(frozen: bool) -> None:
    """Fails when a valve that gives too little pressure is taken for a load that holds the joint where it is."""
    law = Law(gains_of({"creep_compensation": False, "contact_detection": False}))
    for _ in range(100):
        law.tick(at(0.7, 0.7, 0.0), DT_S, frozen=np.array([frozen]))
    assert (law.state[S.offset, 0] > 0.02) == (not frozen)
    assert frozen == (law.state[S.offset, 0] == 0.0)


def test_a_changed_gain_does_not_move_the_command() -> None:
    """Fails when the integral does not take over the difference after a change of gains."""
    law = Law(gains_of({"deadband_pa": 0.0, "contact_detection": False}))
    for _ in range(40):
        before = law.tick(at(0.72, 0.7, 9e4), DT_S)[OUT.pressure, 0]
    law.change(gains_of({"deadband_pa": 0.0, "contact_detection": False, "feed_forward": False}))
    after = law.tick(at(0.72, 0.7, 9e4), DT_S)[OUT.pressure, 0]
    assert after == pytest.approx(before, rel=2e-3) and before > 1e4


def test_the_same_gains_are_no_change() -> None:
    """Fails when taking over identical gains disturbs the integral."""
    law = Law(gains_of())
    law.change(gains_of())
    assert law.state[S.take_over, 0] == 0.0


def test_the_arrays_of_the_law_have_their_rows_and_joints() -> None:
    """Fails when an array of the law is made for another number of rows or joints."""
    law = Law(gains_of(joints=3))
    assert [array.shape for array in (law.state, law.inputs, law.out)] == [(len(S), 3), (len(U), 3), (len(OUT), 3)]


def test_switching_adaptation_off_forgets_what_it_learnt() -> None:
    """Fails when a map that was adapted stays in use after adaptation is switched off, or is reset by other changes."""
    law = Law(gains_of(joints=2))
    law.state[S.offset] = 0.2
    law.change(gains_of({"deadband_pa": 100.0}, joints=2))
    assert (law.state[S.offset] == 0.2).all()
    law.change(gains_of({"adaptation": False}, joints=2))
    assert (law.state[S.offset] == 0.0).all() and (law.state[S.take_over] == 1.0).all()
    law.state[S.offset] = 0.1
    law.change(gains_of({"adaptation": False, "deadband_pa": 100.0}, joints=2))
    assert (law.state[S.offset] == 0.1).all()


def test_release_keeps_what_was_observed() -> None:
    """Fails when a vent keeps a command or an integral, or resets the creep and the filters of the joint."""
    law = Law(gains_of())
    for _ in range(20):
        law.tick(at(0.8, 0.7, 2e5), DT_S)
    creep, angle = law.state[S.creep, 0], law.state[S.phi_2, 0]
    law.release()
    assert not law.state[[S.integral, S.command, S.take_over, S.wanted, S.stood, S.stood_error]].any()
    assert law.state[S.creep, 0] == creep > 0.0 and law.state[S.phi_2, 0] == angle > 0.0


def test_an_observing_law_commands_nothing() -> None:
    """Fails when a vented hand is given a pressure, or its torque is not estimated."""
    g = gains_of({"creep_compensation": False})
    out = Law(g).tick(at(1.0, 0.5, 1e5), DT_S, False, False)
    assert out[OUT.pressure, 0] == 0.0 and out[OUT.saturated, 0] == 0.0
    assert out[OUT.torque, 0] == pytest.approx(torque_at(g, 1e5, 0.5))


@pytest.mark.parametrize("row", range(6))
def test_an_input_that_is_not_finite_repeats_the_command(row: int) -> None:
    """Fails when NaN or infinity in any input changes the command or the state."""
    law = Law(gains_of({"adaptation": False}))
    for _ in range(5):
        before = law.tick(at(0.8, 0.7, 9e4), DT_S).copy()
    state = law.state.copy()
    for bad in (math.nan, math.inf):
        inputs = at(0.8, 0.7, 9e4)
        inputs[row] = bad
        out = law.tick(inputs, DT_S)
        assert out[OUT.pressure, 0] == before[OUT.pressure, 0] > 0.0 and out[OUT.saturated, 0] == 0.0
        assert np.array_equal(law.state, state)


def test_the_torque_ceiling_bounds_the_command() -> None:
    """Fails when the command gives more than the limit at the measured angle, also where the limit falls at once."""
    g = gains_of({"creep_compensation": False})
    law = Law(g)
    for _ in range(5):
        law.tick(at(1.5, 0.3, 1e5), DT_S)
    out = law.tick(at(1.5, 0.3, 1e5, 0.02), DT_S)
    assert torque_at(g, out[OUT.pressure, 0], 0.3) == pytest.approx(0.02)
    assert out[OUT.saturated, 0] == 1.0


@pytest.mark.parametrize(
    ("change", "keeps"),
    [("", True), ("rests", False), ("retreats", False), ("in contact", False), ("follows", False), ("soft", False)],
)
def test_torque_is_kept_back_for_the_impact_of_the_partner(change: str, keeps: bool) -> None:
    """Fails when the ceiling does not leave c v sqrt(k / J) for a partner that moves, or leaves it for another one."""
    g = gains_of({"creep_compensation": False, "adaptation": False}, 2)
    g[G.partner] = 1.0, 0.0
    g[G.coupling], g[G.inertia], g[G.contact_stiffness] = 4e-5, (3e-5, 1.2e-4), 0.0 if change == "soft" else 30.0
    law = Law(g)
    inputs = np.repeat(at(1.5, 0.3, 1e5, 0.1), 2, axis=1)
    inputs[U.speed, 1] = {"rests": 0.0, "retreats": -2.0}.get(change, 2.0)
    law.state[S.contact, 1] = float(change == "in contact")
    law.state[S.sum, 1] = 100.0 * law.state[S.contact, 1]
    if change == "follows":
        inputs[U.speed, 0], law.state[S.speed, 0], law.state[S.started, 0] = 1.0, 1.0, 1.0
        law.state[S.last_angle, 0] = 0.3 - DT_S
    out = law.tick(inputs, DT_S)
    added = 4e-5 * 2.0 * math.sqrt(30.0 / 1.2e-4) if keeps else 0.0
    assert torque_at(g, out[OUT.pressure, 0], 0.3) == pytest.approx(0.1 - added)


def test_at_most_half_of_a_torque_limit_is_kept_back() -> None:
    """Fails when a fast partner takes the whole torque of a joint, or a limit of zero or less changes its sign."""
    g = gains_of(joints=2)
    g[G.partner], g[G.coupling] = (1.0, 0.0), 4e-5
    law, inputs = Law(g), np.repeat(at(1.5, 0.3, 1e5, 0.1), 2, axis=1)
    inputs[U.speed, 1] = 1e6
    assert partner_impact(g, law.state, inputs, 0) == pytest.approx(C.most_impact * 0.1)
    for limit in (0.0, -0.1):
        inputs[U.limit, 0] = limit
        assert partner_impact(g, law.state, inputs, 0) == 0.0


def test_torque_mode_commands_the_limit() -> None:
    """Fails when the command in torque mode is not the pressure of the wanted torque, or depends on the reference."""
    g = gains_of({"control_mode": "torque", "creep_compensation": False, "deadband_pa": 0.0})
    commands = [Law(g).tick(at(reference, 0.5, 5e4, 0.1), DT_S)[OUT.pressure, 0] for reference in (0.0, 1.2)]
    assert commands[0] == commands[1]
    assert torque_at(g, commands[0], 0.5) == pytest.approx(0.1)


@pytest.mark.parametrize("kind", ["python", "double"])
def test_no_wanted_torque_never_raises_the_pressure(kind: str) -> None:
    """Fails when the pressure of no torque follows a joint upwards, or does not fall with the joint."""
    g = gains_of({"control_mode": "torque", "creep_compensation": False, "deadband_pa": 0.0})
    law = Law(g) if kind == "python" else CLaw(kind, g)
    held = float(law.tick(at(0.0, 0.5, 5e4, 0.02), DT_S)[OUT.pressure, 0])
    upwards = [float(law.tick(at(0.0, angle, 5e4, 0.0), DT_S)[OUT.pressure, 0]) for angle in (1.2, 1.4, 1.6)]
    assert held > 4e4 and max(upwards) <= held
    assert float(law.tick(at(0.0, 0.2, 5e4, 0.0), DT_S)[OUT.pressure, 0]) < 0.6 * held


def test_the_rate_of_the_command_is_bounded() -> None:
    """Fails when a step of the reference moves the set-point faster than the configured rate."""
    law = Law(gains_of({"max_pressure_rate_pa_per_s": 1e6, "deadband_pa": 0.0}))
    commands = [law.tick(at(0.8, 0.2, 0.0), DT_S)[OUT.pressure, 0] for _ in range(5)]
    assert np.diff([0.0, *commands]) == pytest.approx(np.full(5, 1e6 * DT_S))
    commands = [law.tick(at(-2.0, 0.8, 0.0), DT_S)[OUT.pressure, 0] for _ in range(3)]
    assert np.diff(commands) == pytest.approx(np.full(2, -1e6 * DT_S))


@pytest.mark.parametrize("kind", ["python", "double", "float"])
@pytest.mark.parametrize("dt", [0.0, *BAD_DTS, 10.0])
def test_no_dt_widens_the_rate_of_the_command(kind: str, dt: float) -> None:
    """Fails when dt = 0, negative, NaN, infinite or huge lets the set-point pass its rate, or spoils the state."""
    g = gains_of({"max_pressure_rate_pa_per_s": 1e6, "deadband_pa": 0.0})
    law = Law(g) if kind == "python" else CLaw(kind, g)
    for _ in range(5):
        before = float(law.tick(at(1.2, 0.2, 0.0), DT_S)[OUT.pressure, 0])
    after = float(law.tick(at(1.2, 0.2, 0.0), dt)[OUT.pressure, 0])
    most = C.max_dt if 1e-3 < dt < math.inf else 0.0
    assert 0.0 <= after - before <= 1e6 * most * (1.0 + 1e-6)
    assert np.isfinite(law.state).all()
    later = float(law.tick(at(1.2, 0.2, 0.0), DT_S)[OUT.pressure, 0])
    assert later == pytest.approx(min(after + 1e6 * DT_S, 6e5), rel=1e-4)


@pytest.mark.parametrize(
    ("wanted", "sent"),
    [(100.0, 100.0), (399.0, 100.0), (401.0, 401.0), (0.5, 100.0), (0.0, 0.0), (-5.0, 0.0), (1e9, 1e5), (1e5, 1e5)],
)
def test_the_dead_band_holds_the_command_but_never_its_bounds(wanted: float, sent: float) -> None:
    """Fails when rest sends a change below the dead-band, or motion does not, or venting or the ceiling is delayed."""
    g, s = gains_of(), np.zeros((len(S), 1))
    s[S.command] = 100.0
    assert _send(g, s, 0, wanted, 1e5, True, DT_S) == sent
    moving = _send(g, s, 0, wanted, 1e5, False, DT_S)
    assert moving == min(max(wanted, 0.0), 1e5)


@pytest.mark.parametrize("kind", ["python", "double"])
def test_a_retreat_drops_what_the_integral_gained_in_contact(kind: str) -> None:
    """Fails when a joint keeps the torque of a contact while its reference retreats, or drops it before."""
    g = gains_of({"creep_compensation": False, "adaptation": False})
    law = Law(g) if kind == "python" else CLaw(kind, g)
    for _ in range(100):  # at rest, the pressure is that of the map
        law.tick(at(0.5, 0.5, 7e4), DT_S)
    free = law.state[S.integral, 0]
    for _ in range(100):
        law.tick(at(0.9, 0.52, 2.5e5), DT_S)
    pressed = law.state[S.integral, 0]
    assert law.state[S.contact, 0] == 1.0 and pressed > free + 0.02
    inputs = at(0.9, 0.52, 2.5e5)
    inputs[U.speed] = -0.5
    law.tick(inputs, DT_S)
    gained = law.state[S.integral, 0] - free
    assert gained < 0.15 * (pressed - free)  # one tick of growth and what came before the detector rose


def test_adaptation_keeps_the_pressure_of_a_slow_joint() -> None:
    """Fails when taking over a changed map leaves a difference of the steady pressure (seed 4)."""
    rng = np.random.default_rng(4)
    g = gains_of({"creep_compensation": False}, joints=20)
    law = Law(g)
    law.inputs[:] = at(0.6, 0.6, 8e4)
    law.state[S.integral] = rng.uniform(-0.02, 0.02, 20)
    before = np.array([_steady_pressure(g, law.state, law.inputs, i) for i in range(20)])
    law.state[[S.offset, S.d_a1, S.d_a3]] = rng.uniform(-0.2, 0.2, (3, 20))
    for i in range(20):
        _take_over_map(g, law.state, law.inputs, i, before[i])
    after = [_steady_pressure(g, law.state, law.inputs, i) for i in range(20)]
    np.testing.assert_allclose(after, before, rtol=1e-9)
