"""Sensors that contradict the motion: found with their line, and no false vent under pushes, contacts and gaps."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hand_control import sensor_rows as row
from hand_control.frame_watch import FrameWatch
from hand_control.sensor_watch import SensorWatch
from hand_control.step_watch import ACTIVE, ANGLES_SWAPPED, JUMPED, SIGN
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from validation.faults.operation import World
from validation.faults.sensors import CONFIG, EXCESS_PA, Case, Outcome, study

HAND = load_hand(CONFIG / "hand.yaml")


def found(error: float, motion: str, joint: int, name: str, from_start: bool, seed: int) -> Outcome:
    print(f"seed {seed}")
    return study(HAND, [Case(error, motion, joint, name, from_start)], seed)[0]


@pytest.mark.parametrize("error", [0.0, 0.1, 0.3])
@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("angle frozen", ""),
        ("angle mirrored", "polarity"),
        ("angle negated", ""),
        ("angles exchanged", "exchanged"),
        ("converter stuck", ""),
        ("supply 6.5 V", "not a number"),
        ("pressures exchanged", "exchanged"),
    ],
)
def test_a_fault_in_motion_is_found(error: float, name: str, part: str) -> None:
    """Fails when a fault is found later than 0.3 s, moves a joint out of its way by 10 degrees, or is misnamed."""
    outcome = found(error, "step", 4, name, False, 300 + round(100 * error))
    assert outcome.detected_s is not None
    assert outcome.detected_s <= 0.3
    assert outcome.error_deg <= 10.0
    assert part in outcome.line


@pytest.mark.parametrize("name", ["angle frozen", "converter stuck"])
def test_no_set_point_rises_on_a_reading_that_repeats_in_fast_motion(name: str) -> None:
    """Fails when set-points rise further on readings of a fast joint that are equal to the last bit."""
    outcome = found(0.1, "step", 4, name, False, 340)
    assert outcome.detected_s is not None
    assert outcome.excess_pa <= EXCESS_PA


def test_pressures_that_are_exchanged_where_they_are_alike_are_found() -> None:
    """Fails when an exchange without a step is not found before the motion that it causes can explain its errors."""
    outcome = found(0.1, "sine", 9, "pressures exchanged", False, 2629)
    assert outcome.detected_s is not None
    assert outcome.detected_s <= 0.3
    assert outcome.error_deg <= 10.0
    assert "exchanged" in outcome.line


@pytest.mark.parametrize("joint", [1, 6])
@pytest.mark.parametrize(("name", "part"), [("angle mirrored", "polarity"), ("angle negated", "")])
def test_wrong_wiring_is_found_in_the_first_motion(joint: int, name: str, part: str) -> None:
    """Fails when a sensor with the wrong sign or place is not found, or is not named with what to check."""
    outcome = found(0.1, "step", joint, name, True, 320 + joint)
    assert outcome.detected_s is not None
    assert outcome.error_deg <= 15.0
    assert HAND.joints[joint] in outcome.line
    assert part in outcome.line


@pytest.mark.parametrize("seed", [101, 102])
def test_operation_without_a_fault_vents_nothing(seed: int) -> None:
    """Fails when pushes, contacts, gaps, noise or a wrong model vent the hand."""
    print(f"seed {seed}")
    world = World(HAND, seed)
    for _ in range(3000):
        assert world.frame(), world.loop.controller.safety.fault


@pytest.mark.parametrize(
    ("seed", "frames"),
    [
        (2028095741057, 1_200),
        (3300101, 3_300),
        (713221416, 10_900),
        pytest.param(713621426, 11_620, marks=pytest.mark.long),
    ],
)
def test_joints_that_cross_while_they_are_pushed_are_not_exchanged(seed: int, frames: int) -> None:
    """Fails when speeds that change all the time, or by new set-points, are taken for exchanged where angles cross."""
    world = World(HAND, seed)
    assert all(world.frame() for _ in range(frames)), world.loop.controller.safety.fault


@pytest.mark.parametrize(
    ("seed", "frames"),
    [
        (731721953, 4_170),
        pytest.param(731321964, 6_220, marks=pytest.mark.long),
        pytest.param(732321991, 11_680, marks=pytest.mark.long),
        pytest.param(733822020, 5_070, marks=pytest.mark.long),
    ],
)
def test_what_a_neighbour_throws_is_no_fault(seed: int, frames: int) -> None:
    """Fails when a joint that its neighbour turns back, drives into an obstacle or lets follow a released one vents."""
    world = World(HAND, seed)
    assert all(world.frame() for _ in range(frames)), world.loop.controller.safety.fault


def test_a_push_that_ends_at_a_question_is_forgotten() -> None:
    """Fails when two pushes that end just when a joint is asked, seconds apart, prove an exchange."""
    world = World(HAND, 742922312)
    assert all(world.frame() for _ in range(900)), world.loop.controller.safety.fault


def test_the_set_points_do_not_rise_under_suspicion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the hold under suspicion no longer halves the rise of the pressure while an angle is frozen."""
    outcome = found(0.3, "step", 6, "angle frozen", False, 340)
    assert np.isfinite(outcome.error_deg)
    monkeypatch.setattr(FrameWatch, "hold", lambda watch, command: None)
    assert outcome.excess_pa < 0.5 * found(0.3, "step", 6, "angle frozen", False, 340).excess_pa


def verdict(rate_hz: float, angle: Array, pressure: Array, hand: Hand = HAND) -> int | None:
    """Verdict on joint 4 with its angle [rad] and pressure [Pa] (samples,); the others stand still at 0.1 rad."""
    watch, count, rng = SensorWatch(hand), len(HAND.joints), np.random.default_rng(5)
    rest = np.full(count, 0.1)
    first, speed, filled = rest.copy(), np.zeros(count), np.full(count, 1.5e4)
    first[4], speed[4], filled[4] = angle[0], (angle[1] - angle[0]) * rate_hz, pressure[0]
    watch.start(first, speed, filled)
    for phi, p in zip(angle, pressure, strict=True):
        position, measured = rest + rng.normal(0.0, 1.5e-4, count), np.full(count, 1.5e4)
        position[4], measured[4] = position[4] - 0.1 + phi, p
        found = watch.check(position, measured, measured, measured, 1.0 / rate_hz)
        if found is not None:
            assert found.joint == 4
            return found.verdict
    return None


@pytest.mark.parametrize("rate_hz", [200.0, 500.0, 1000.0])
@pytest.mark.parametrize("speed", [0.7, 3.0])
def test_a_step_of_the_sensor_differs_from_a_blow(rate_hz: float, speed: float) -> None:
    """Fails at any rate when a mirrored angle is believed, or when a blow, a stop or a soft bounce is not."""
    print("seed 5")
    t = np.arange(round(0.3 * rate_hz)) / rate_hz
    moving = 0.1 + speed * np.maximum(t - 0.05, 0.0)
    pressure = 1.5e4 + 8e4 * (moving - 0.1)
    after = t > 0.15
    mirrored = np.where(after, 2.0 * HAND.sensors.hall.zero_rad[4] - moving, moving)
    assert verdict(rate_hz, mirrored, pressure) == SIGN
    lag_s = 7.5e-3  # J / d
    blow = np.where(after, 6.0 * lag_s * (1.0 - np.exp(-np.maximum(t - 0.15, 0.0) / lag_s)), 0.0)
    at_s = 0.05 + (HAND.sensors.hall.zero_rad[4] - 0.1) / speed if speed > 1.0 else 0.15
    for bounce in (0.0, 0.4):
        back = -(1.0 + bounce) * speed * np.maximum(t - at_s, 0.0)
        assert verdict(rate_hz, moving + back, pressure) is None
    assert verdict(rate_hz, moving + blow, pressure) is None


@pytest.mark.parametrize("rate_hz", [200.0, 500.0, 1000.0])
@pytest.mark.parametrize(("speed", "other"), [(2.5, 0.0), (1.5, -1.5), (0.2, -3.0)])
@pytest.mark.parametrize("apart_deg", [-0.4, 0.0, 0.4])
def test_an_exchange_where_two_angles_cross_is_found(
    rate_hz: float, speed: float, other: float, apart_deg: float
) -> None:
    """Fails when sensors exchanged where they read the same are believed, or obstacles there are taken for it."""
    print("seed 6")
    t = np.arange(round(0.3 * rate_hz)) / rate_hz - 0.1503
    first, second = 0.4 + speed * t, 0.4 + np.radians(apart_deg) + other * t

    def found(angles: tuple[Array, Array]) -> tuple[int, int, int] | None:
        watch, count, rng = SensorWatch(HAND), len(HAND.joints), np.random.default_rng(6)
        rest, pressure = np.full(count, 0.1), np.full(count, 1.5e4)
        position = rest + rng.normal(0.0, 1.5e-4, (len(t), count))
        position[:, 4] += angles[0] - 0.1
        position[:, 5] += angles[1] - 0.1
        watch.start(position[0], (position[1] - position[0]) * rate_hz, pressure)
        for now in position:
            seen = watch.check(now, pressure, pressure, pressure, 1.0 / rate_hz)
            if seen is not None:
                return seen[:3]
        return None

    after = t > 0.0
    assert found((np.where(after, second, first), np.where(after, first, second))) == (ANGLES_SWAPPED, 4, 5)
    assert found((first, second)) is None
    for left in (0.0, -0.4):
        stopped = (
            np.where(after, 0.4 + left * speed * t, first),
            np.where(after, second - (1 - left) * other * t, second),
        )
        assert found(stopped) is None
        assert found((first, stopped[1])) is None and found((stopped[0], second)) is None


@pytest.mark.parametrize("driven", ["both", "one", "none"])
@pytest.mark.parametrize(("i", "k"), [(4, 5), (1, 8)])
def test_pressures_that_exchange_two_speeds_are_no_proof_of_exchanged_sensors(driven: str, i: int, k: int) -> None:
    """Fails when speeds that new set-points exchange vent the hand, or their set-points then rise as if all were well.

    Also when a change of one pressure, or of none, excuses an exchange of both speeds.
    """
    print("seed 11")
    rng, t = np.random.default_rng(11), np.arange(60) * 0.005 - 0.1503
    watch, count, speed = SensorWatch(HAND), len(HAND.joints), 2.5
    pressure = np.full((len(t), count), 1.2e5)
    rise = 4e6 * np.clip(t + 0.01, 0.0, 0.02)  # before the speeds, which lag by the inertia
    pressure[:, i] -= rise if driven != "none" else 0.0
    pressure[:, k] += rise if driven == "both" else 0.0
    position = 0.1 + rng.normal(0.0, 1.5e-4, (len(t), count))
    position[:, i] += 0.4 + speed * np.minimum(t, 0.0)
    position[:, k] += 0.4 + speed * np.maximum(t, 0.0)
    watch.start(position[0], (position[1] - position[0]) * 200.0, pressure[0])
    watch._places.state[:] = watch._state[row.DOUBTED] = 0.0  # all have long been seen to move as asked
    asked, held = 2e5, np.zeros(count, dtype=np.bool_)
    for phi, p in zip(position, pressure, strict=True):
        seen = watch.check(phi, p, p, p, 0.005)
        if seen is not None:
            break
        command, asked = np.full(count, asked), asked + 2e3
        watch.hold(command)
        held |= command < asked - 5e3
    if driven == "both":
        assert seen is None
        assert held[[i, k]].all() and held.sum() == 2, held
    else:
        assert seen is not None and seen[:3] == (ANGLES_SWAPPED, i, k)


@pytest.mark.parametrize(("speed", "other"), [(2.1, 4.8), (-1.0, 0.9), (3.0, -2.6)])
def test_two_angles_of_a_finger_that_are_exchanged_where_they_cross_are_found(speed: float, other: float) -> None:
    """Fails when two joints that share inertia hide an exchange, or when what one has hit is taken for it."""
    print("seed 9")
    i, k, hit_s = 3, 4, 0.1503
    t: Array = np.arange(60, dtype=np.float64) * 0.005 - hit_s
    after = t > 0.0
    first: Array = 0.5 + speed * t
    second: Array = 0.5 + other * t
    share = {
        j: float((HAND.row("dynamics.coupling_inertia_kg_m2") / HAND.row("dynamics.inertia_kg_m2"))[j]) for j in (i, k)
    }

    def found(angles: tuple[Array, Array]) -> tuple[int, int, int] | None:
        watch, rng = SensorWatch(HAND), np.random.default_rng(9)
        pressure, position = np.full(len(HAND.joints), 1.5e4), rng.normal(0.1, 1.5e-4, (len(t), len(HAND.joints)))
        position[:, i] += angles[0] - 0.1
        position[:, k] += angles[1] - 0.1
        watch.start(position[0], (position[1] - position[0]) * 200.0, pressure)
        seen = (watch.check(now, pressure, pressure, pressure, 0.005) for now in position)
        return next((each[:3] for each in seen if each is not None), None)

    assert found((first, second)) is None
    assert found((np.where(after, second, first), np.where(after, first, second))) == (ANGLES_SWAPPED, i, k)
    for back in (0.0, 0.25, 0.5):  # each of the two meets an obstacle, and its impulse changes the other
        change = -(1.0 + back) * speed * t
        assert (
            found((np.where(after, first + change, first), np.where(after, second - share[k] * change, second))) is None
        )
        change = -(1.0 + back) * other * t
        assert (
            found((np.where(after, first - share[i] * change, first), np.where(after, second + change, second))) is None
        )


def test_a_joint_that_only_dry_friction_damps_is_watched(tmp_path: Path) -> None:
    """Fails when the watch divides by a drag of zero, which dry friction allows, and then believes every step."""
    text = (CONFIG / "hand.yaml").read_text(encoding="utf-8")
    text = re.sub(r"viscous_friction_nm_s_per_rad: [0-9.e-]+", "viscous_friction_nm_s_per_rad: 0.0", text)
    text = text.replace("joint_defaults:\n", "joint_defaults:\n  coulomb_friction: {torque_nm: 0.004}\n")
    (tmp_path / "hand.yaml").write_text(text, encoding="utf-8")
    hand = load_hand(tmp_path / "hand.yaml")
    assert not hand.row("dynamics.viscous_friction_nm_s_per_rad").any()
    t = np.arange(60) * 0.005
    still, pressure = np.full(60, 0.4), np.full(60, 3.0e4)
    assert verdict(200.0, still, pressure, hand) is None
    assert verdict(200.0, still + 1.2 * (t > 0.15), pressure, hand) == JUMPED


def test_a_joint_that_moves_against_its_pressure_is_found() -> None:
    """Fails when an angle may fall for long under a rising pressure that no push of MAX_OUTSIDE_NM holds back."""
    t = np.arange(90) * 0.005
    falling = np.asarray(0.9 - 2.0 * np.maximum(t - 0.05, 0.0), dtype=np.float64)
    assert verdict(200.0, falling, np.asarray(3.0e5 + 4e5 * t, dtype=np.float64)) == ACTIVE
    assert verdict(200.0, falling, np.full(90, 5.0e4)) is None  # a push of 0.1 N m


@pytest.mark.parametrize("start_deg", [10.0, 17.0, 30.0, 60.0, 85.0])
@pytest.mark.parametrize("wrong", [False, True])
def test_a_hand_may_be_armed_while_its_joints_fall(start_deg: float, wrong: bool) -> None:
    """Fails when a joint that still falls after a fault vents the hand again, or hides a sensor of the wrong sign."""
    t, rest = np.arange(400) * 0.005, 0.1
    again = np.clip(8e4 * (t - 1.0), 0.0, 6e4)  # the joint bends again from one second on
    keys = ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
    row = {key: float(HAND.row(f"statics.{key}")[4]) for key in keys}
    angle = np.full_like(t, np.deg2rad(start_deg))
    d = float(HAND.row("dynamics.viscous_friction_nm_s_per_rad")[4])
    pressure = 1.5e4 + again
    for i in range(len(t) - 1):
        stiff = row["a1_nm_per_rad"] + row["a3_nm_per_pa_rad"] * pressure[i]
        balance = row["a0_nm"] + row["a2_nm_per_pa"] * pressure[i]
        target = -balance / stiff
        angle[i + 1] = target + (angle[i] - target) * np.exp(stiff / d * 0.005)
    assert angle[-1] > angle[190] + np.deg2rad(20.0)
    assert abs(angle[190] - rest) < 0.1
    measured = 2.0 * HAND.sensors.hall.zero_rad[4] - angle if wrong else angle
    assert verdict(200.0, measured, pressure) == (SIGN if wrong else None)
