"""Control modes on a simulated hand in virtual time: switching without a jump, torques without and with a command."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_control.declared import Settings
from hand_control.grasps import load_grasps
from hand_control.supervisor import Phase
from hand_messages.health import Level
from hand_model.kernel.rows import ROW
from hand_sim.plant import PHI, HandPlant
from test.control.mode_rig import CONFIG, COUNT, HAND, INDEX, RATE, STEP_S, Rig


@pytest.mark.parametrize("seed", range(3))
def test_torque_mode_without_a_command_moves_nothing(seed: int) -> None:
    """Fails when a hand that nobody commands gets pressure because its mode is set to torque."""
    print(f"seed {seed}")
    rig = Rig(seed)
    before = rig.degrees()
    rig.mode("torque")
    rig.run(10.0)
    assert rig.controller.safety.phase is Phase.ACTIVE
    assert np.max(rig.pressures) < 1e4
    assert np.abs(rig.degrees() - before).max() < 3.0
    assert rig.tick.torque_limit.max() == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_zero_torque_moves_no_joint_whose_map_is_wrong(seed: int) -> None:
    """Fails when an error of the model by 30 % inflates a joint that is to have no torque."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    parameters = HAND.parameters.copy()
    for key in (key for key in ROW if key.startswith("statics.")):
        parameters[ROW[key]] *= rng.uniform(0.7, 1.3, COUNT)
    rig = Rig(seed)
    rig.plant = HandPlant(replace(HAND, parameters=parameters), STEP_S)
    rig.run(3.0)
    before, pressure = rig.degrees(), rig.pressures[-1]
    rig.mode("torque")
    rig.run(10.0)
    assert np.abs(rig.degrees() - before).max() < 3.0
    assert np.all(rig.pressures[-1] <= pressure + 300.0)  # the dead-band


def test_switching_at_rest_moves_neither_pressure_nor_joint() -> None:
    """Fails when a change of the mode in either direction makes a set-point or a joint jump."""
    rig = Rig()
    rig.command(list(HAND.joints), [0.9] * COUNT)
    rig.run(4.0)
    for mode in ("torque", "position", "torque", "position"):
        held, pressure = rig.degrees(), rig.pressures[-1]
        rig.pressures.clear()
        rig.mode(mode)
        rig.run(1.0)
        assert np.abs(np.diff([pressure, *rig.pressures], axis=0)).max() < 3e3, mode
        assert np.abs(rig.degrees() - held).max() < 2.0, mode


def test_switching_in_motion_starts_from_the_present_torque_and_pose() -> None:
    """Fails when a change of the mode in mid-motion jumps from the measured pressure, or to an old reference."""
    rig = Rig()
    rig.command(["index_proximal"], [1.5])
    rig.run(0.25)  # the first rise after enabling is slow
    torque, pressure = rig.tick.torque_estimate[INDEX], rig.pressures[-1][INDEX]
    rig.mode("torque")
    rig.run(STEP_S)
    assert torque > 0.02 and rig.tick.torque_limit[INDEX] == pytest.approx(torque - RATE * STEP_S, abs=1e-6)
    assert rig.pressures[-1][INDEX] < pressure
    rig.run(0.1)
    pressure, angle = rig.pressures[-1][INDEX], rig.plant.state[PHI][INDEX]
    rig.mode("position")
    rig.run(STEP_S)
    assert rig.tick.reference[INDEX] == pytest.approx(angle, abs=0.02)
    assert rig.pressures[-1][INDEX] == pytest.approx(pressure, abs=5e3)
    rig.run(2.0)
    assert rig.plant.state[PHI][INDEX] == pytest.approx(angle, abs=math.radians(5.0))


def test_a_torque_commanded_with_the_switch_is_approached_at_the_rate() -> None:
    """Fails when a command right after the switch is lost, or its torque is reached faster than the rate."""
    rig = Rig()
    rig.command(["index_proximal"], [0.8])
    rig.run(2.0)
    rig.mode("torque")
    rig.command(["index_proximal"], [], [0.3])
    torques = []
    for _ in range(100):
        rig.run(STEP_S)
        torques.append(rig.tick.torque_limit[INDEX])
    steps = np.abs(np.diff(torques))
    assert steps.max() <= RATE * STEP_S * (1.0 + 1e-9)
    assert torques[0] < 0.05 and torques[-1] == pytest.approx(0.3)


def test_efforts_alone_are_torques() -> None:
    """Fails when torque mode refuses an effort without a position, or takes a missing effort for the limit."""
    rig = Rig(control_mode="torque")
    rig.command(["index_proximal", "ring_distal"], [], [0.02, math.nan])
    rig.run(0.5)
    assert rig.tick.torque_limit[INDEX] == pytest.approx(0.02)
    assert rig.tick.torque_limit.sum() == pytest.approx(0.02)
    assert rig.degrees()[INDEX] > 20.0
    rig.command(["index_proximal"], [], [])
    rig.run(0.5)
    assert rig.tick.torque_limit.max() == 0.0
    with pytest.raises(ValueError, match=r"torque is 9 N m; the allowed range is 0 to 0\.6 N m, or NaN for no torque"):
        rig.command(["index_proximal"], [], [9.0])


def test_efforts_alone_are_refused_in_position_mode() -> None:
    """Fails when position mode takes a command without positions, or its message does not say what would."""
    rig = Rig()
    with pytest.raises(ValueError, match="efforts without positions; set control_mode to torque"):
        rig.command(["index_proximal"], [], [0.1])


def test_an_enabled_hand_in_torque_mode_starts_from_no_command() -> None:
    """Fails when enabling in torque mode drives a joint with the limit, or with the torque of an older command."""
    rig = Rig(control_mode="torque")
    rig.command(["index_proximal"], [], [0.05])
    rig.run(0.3)
    rig.controller.vent("test")
    rig.run(2.0)
    rig.controller.enable(True)
    rig.pressures.clear()
    rig.run(2.0)
    assert np.max(rig.pressures) < 1e4 and rig.tick.torque_limit.max() == 0.0


def test_a_torque_that_is_not_renewed_fades() -> None:
    """Fails when the time-out of commands leaves a torque, or replaces it by the limit."""
    rig = Rig(control_mode="torque", command_timeout_s=0.3)
    rig.command(["index_proximal"], [], [0.03])
    rig.run(0.25)
    assert rig.tick.torque_limit[INDEX] == pytest.approx(0.03)
    rig.run(0.15)
    assert rig.tick.torque_limit.max() == 0.0 and rig.controller.safety.phase is Phase.ACTIVE


def test_a_position_command_that_is_held_keeps_its_torque_limit() -> None:
    """Fails when the time-out of commands raises the torque limit of the command that it holds."""
    rig = Rig(command_timeout_s=0.3)
    rig.command(["index_proximal"], [0.5], [0.05])
    rig.run(0.4)
    assert rig.tick.torque_limit[INDEX] == pytest.approx(0.05)


def test_what_torque_mode_cannot_do_is_refused_and_what_ran_is_ended() -> None:
    """Fails when a grasp or a trajectory is driven as a torque, or continues after a change of the mode."""
    grasp = load_grasps(CONFIG / "grasps.yaml", HAND)["hook"]
    rig = Rig()
    rig.controller.grasp(grasp, 1.0, 0.1, rig.now_ns)
    rig.controller.trajectory(rig.now(), ["thumb_opposition"], [(1.0, [0.5], [])])
    rig.run(0.1)
    rig.mode("torque")
    rig.run(0.1)
    assert rig.controller.grasping is None
    with pytest.raises(ValueError, match="control_mode is torque"):
        rig.controller.grasp(grasp, 1.0, 0.1, rig.now_ns)
    with pytest.raises(ValueError, match="control_mode is torque"):
        rig.controller.trajectory(rig.now(), ["index_proximal"], [(1.0, [0.5], [])])
    rig.mode("position")
    rig.run(0.05)
    pose = rig.degrees()
    rig.run(2.0)
    assert np.abs(rig.degrees() - pose).max() < 3.0


def test_a_rising_torque_limit_is_followed_at_the_rate_and_a_falling_one_at_once() -> None:
    """Fails when a joint that presses on an object with a small limit jumps to the configured one."""
    rig = Rig()
    rig.command(["index_proximal"], [0.5], [0.05])
    rig.run(STEP_S)
    assert rig.tick.torque_limit[INDEX] == 0.05
    rig.command(["index_proximal"], [0.5])
    rig.run(STEP_S)
    assert rig.tick.torque_limit[INDEX] == pytest.approx(0.05 + RATE * STEP_S)


@pytest.mark.parametrize(
    "points",
    [
        [(0.5, [1.745], [])],
        [(0.5, [1.745], [100.0])],
        [(0.0, [0.0], [-100.0]), (0.3, [1.745], [100.0])],
        [(0.2, [1.7], [60.0]), (0.4, [-0.17], [-60.0]), (0.6, [1.7], [60.0])],
    ],
)
def test_absurd_trajectories_keep_the_reference_in_the_joint(
    points: list[tuple[float, list[float], list[float]]],
) -> None:
    """Fails when a fast trajectory or its velocities carry the reference beyond the limits of the joint."""
    rig = Rig()
    rig.references.clear()
    rig.controller.trajectory(rig.now(), ["index_proximal"], points)
    rig.run(2.0)
    reference = np.array(rig.references)
    limits = HAND.limits
    assert np.all((reference >= limits.low_rad) & (reference <= limits.high_rad))
    chosen = Settings.of(HAND, {})
    speed = np.diff(reference, axis=0) / STEP_S
    assert np.abs(speed).max() <= math.radians(chosen.max_speed_deg_per_s) * (1.0 + 1e-6)
    assert reference[:, INDEX].max() > 1.2  # it moved


numbers = st.one_of(st.floats(-2.0, 2.0), st.sampled_from([math.nan, math.inf, 0.0, 1e300]))
joint_names = st.lists(st.sampled_from(HAND.joints), min_size=1, max_size=4, unique=True)
modes = st.sampled_from(["position", "torque"])
events = st.one_of(
    st.tuples(st.just("command"), joint_names, st.lists(numbers, max_size=4), st.lists(numbers, max_size=4)),
    st.tuples(st.just("trajectory"), joint_names, st.lists(st.floats(0.0, 1.0), max_size=3), numbers),
    st.tuples(st.just("mode"), modes),
    st.tuples(st.just("wait"), st.floats(0.005, 0.3)),
)


@settings(max_examples=200, print_blob=True)
@given(st.lists(events, min_size=1, max_size=12), st.integers(0, 2**16))
def test_whatever_comes_in_the_references_stay_within_their_limits(happenings: list[Any], seed: int) -> None:
    """Fails when any order of commands, trajectories, modes and pauses takes a reference out of its limits."""
    rig = Rig(seed)
    limits, chosen = HAND.limits, Settings.of(HAND, {})
    fastest, most = math.radians(chosen.max_speed_deg_per_s), math.radians(chosen.max_acceleration_deg_per_s2)
    for kind, *what in happenings:
        try:
            if kind == "command":
                rig.command(what[0], what[1], what[2])
            elif kind == "trajectory":
                times = np.unique(what[1])
                points = [(float(t), [1.0] * len(what[0]), [what[2]] * len(what[0])) for t in times]
                rig.controller.trajectory(rig.now(), what[0], points)
            elif kind == "mode":
                rig.mode(what[0])
        except ValueError:
            pass  # a refused command changes nothing
        before, torque = rig.tick.torque_limit.copy(), rig.controller._shaper.v.copy()
        for _ in range(max(round(what[0] / STEP_S), 1) if kind == "wait" else 3):
            torque_mode = rig.values.get("control_mode") == "torque"
            speed = rig.controller._shaper.v.copy()
            rig.run(STEP_S)
            shaper, torque = rig.controller._shaper, rig.tick.torque_limit
            assert np.all((rig.tick.reference >= limits.low_rad) & (rig.tick.reference <= limits.high_rad))
            assert np.all(np.abs(shaper.v) <= fastest * (1.0 + 1e-9))
            if not torque_mode and kind != "mode":
                assert np.all(np.abs(shaper.v - speed) <= most * STEP_S * (1.0 + 1e-6))
            assert np.all(torque <= limits.max_torque_nm)
            if kind != "mode":
                assert np.all(torque - before <= RATE * STEP_S * (1.0 + 1e-9))
            before = torque.copy()


def test_a_trajectory_without_points_stops_the_joints() -> None:
    """Fails when an empty trajectory is refused, does not stop in mid-motion, or stops joints it does not name."""
    for names, others in (([], False), (["index_proximal"], True)):
        rig = Rig()
        rig.controller.trajectory(rig.now(), ["index_proximal", "ring_distal"], [(1.0, [1.4, 1.4], [])])
        rig.run(0.5)
        at = rig.tick.reference[INDEX]
        rig.controller.trajectory(rig.now(), names, [])
        rig.references.clear()
        rig.run(2.0)
        reference = np.array(rig.references)
        assert at < reference[-1, INDEX] < at + math.radians(25.0)
        assert np.diff(reference[:, INDEX]).min() > -1e-4
        assert (reference[-1, HAND.joints.index("ring_distal")] > 1.39) == others


def test_fields_without_effect_are_named_and_broken_ones_refused() -> None:
    """Fails when accelerations, efforts or velocities are dropped in silence, or NaN in them is accepted."""
    rig = Rig()
    points: list[tuple[float, list[float], list[float]]] = [(1.0, [0.5], [])]
    unused: dict[str, Any] = {"accelerations": [[1.0]], "effort": [[0.1]]}
    rig.controller.trajectory(rig.now(), ["index_proximal"], points, unused)
    status = rig.commands()
    assert status.level == Level.WARN
    assert status.message == "joint_trajectory: fields without effect: accelerations, effort"
    for values, line in (([[math.nan]], "index_proximal has nan in accelerations"), ([[1.0, 2.0]], "2 accelerations")):
        with pytest.raises(ValueError, match=line):
            rig.controller.trajectory(rig.now(), ["index_proximal"], points, {"accelerations": values})
    rig.run(5.5)
    assert rig.commands().level == Level.OK
    rig.controller.command(rig.now(), ["index_proximal"], [0.5], [], {"velocity": [[1.0]]})
    assert rig.commands().message == "joint_commands: fields without effect: velocity"
