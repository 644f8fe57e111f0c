"""Simulation and controller over DDS: following, refusing, venting, re-arming."""

from __future__ import annotations

import math
import os
import re
import resource
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from hand_msgs.msg import ValveCommand
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_model.description import load_hand
from hand_recording.loader import load_recording
from hand_recording.replay import replay_recording
from hand_tool.replay_difference import replayed_angle_rad

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

HAND = "config/hand.yaml"


def started(stack: Stack, client: Client) -> None:
    stack.node("simulation")
    stack.node("controller")
    client.controlling()


def test_follows_partial_commands_and_trajectories(stack: Stack, client: Client) -> None:
    """Fails when a commanded joint does not arrive, or one that was not named moves."""
    started(stack, client)
    client.command(index_proximal=0.8, thumb_opposition=0.5)
    client.until(lambda: abs(client.angle("index_proximal") - 0.8) < 0.02)
    client.until(lambda: abs(client.angle("thumb_opposition") - 0.5) < 0.02)
    assert client.angle("ring_distal") < 0.0
    point = JointTrajectoryPoint(positions=[0.4], time_from_start=Duration(sec=1))
    client.trajectories.publish(JointTrajectory(joint_names=["ring_distal"], points=[point]))
    client.until(lambda: abs(client.angle("ring_distal") - 0.4) < 0.02)
    assert abs(client.angle("index_proximal") - 0.8) < 0.02


BAD = {
    "NaN": (JointState(name=["index_proximal"], position=[math.nan]), "index_proximal position is nan"),
    "infinity": (JointState(name=["index_proximal"], position=[math.inf]), "position is inf"),
    "lengths": (JointState(name=["index_proximal"], position=[0.1, 0.2]), "2 positions for 1 joints"),
    "unknown": (JointState(name=["index_middle"], position=[0.1]), "unknown joint 'index_middle'"),
    "range": (JointState(name=["index_proximal"], position=[3.0]), "the allowed range is"),
}


def test_bad_commands_are_refused_and_the_rest_goes_on(stack: Stack, client: Client) -> None:
    """Fails when a bad command moves a valve, is not named on diagnostics, or stops the loop."""
    started(stack, client)
    client.command(index_proximal=0.5)
    client.until(lambda: abs(client.angle("index_proximal") - 0.5) < 0.02)
    old = JointState(name=["index_proximal"], position=[0.9])
    now_ns = client.node.get_clock().now().nanoseconds - 2_000_000_000
    old.header.stamp.sec, old.header.stamp.nanosec = divmod(now_ns, 1_000_000_000)
    for message, line in (*BAD.values(), (old, "s old")):
        client.commands.publish(message)
        client.until_said("controller", "commands", line)
        assert client.level("controller", "commands") == 2
    client.states.clear()
    client.until(lambda: len(client.states) > 100)
    assert abs(client.angle("index_proximal") - 0.5) < 0.02
    assert all(np.isfinite(state.pressure_command).all() for state in client.states)


def test_bad_valve_commands_never_reach_a_valve(stack: Stack, client: Client) -> None:
    """Fails when the driver takes a set-point that is NaN or infinite, out of range, stale, partial or without end."""
    stack.node("simulation")
    client.until(lambda: client.joints and client.valve_publisher.get_subscription_count() > 0)
    names = list(client.joints[-1].name)

    def send(pressure: list[float], lifetime_ms: int = 500, age_s: float = 0.0, joints: list[str] = names) -> None:
        message = ValveCommand(name=joints, pressure=pressure, lifetime=Duration(nanosec=lifetime_ms * 1_000_000))
        stamp_ns = client.node.get_clock().now().nanoseconds - int(age_s * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        client.valve_publisher.publish(message)

    full = [3e5] * len(names)
    cases = [
        ([math.nan, *full[1:]], {}, "pressure is nan"),
        ([1e7, *full[1:]], {}, "pressure is 1e+07"),
        (full, {"lifetime_ms": 0}, "lifetime is 0"),
        (full, {"age_s": 2.0}, "s old"),
        (full, {"age_s": -2.0}, "in the future"),
        (full[1:], {"joints": names[1:]}, "is missing"),
        (full[1:], {}, "pressures"),
    ]
    for pressure, options, line in cases:
        send(pressure, **options)  # type: ignore[arg-type]
        client.until_said("simulation", "commands", line)
    assert max(client.joints[-1].position) < math.radians(-5.0)
    send(full)  # a good one is taken all the same
    client.until(lambda: max(client.joints[-1].position) > 0.2)


def test_lost_sensors_vent_and_only_a_request_re_arms(stack: Stack, client: Client) -> None:
    """Fails when the controller drives the hand without sensor data, re-enables itself, or jumps when enabled."""
    simulation = stack.node("simulation")
    stack.node("controller")
    client.controlling()
    client.command(index_proximal=0.8)
    client.until(lambda: abs(client.angle("index_proximal") - 0.8) < 0.02)
    simulation.send_signal(signal.SIGSTOP)
    client.until(lambda: client.said("controller", "safety", "no usable sensor data for 100 ms"))
    assert max(client.valves[-1].pressure) == 0.0
    simulation.send_signal(signal.SIGCONT)
    client.spin(1.0)
    assert client.said("controller", "safety", "call reset")
    assert max(client.valves[-1].pressure) == 0.0
    assert not client.enable(True).success
    assert client.trigger("reset").success
    client.spin(0.3)
    assert max(client.valves[-1].pressure) == 0.0
    pose = client.angle("index_proximal")
    assert client.enable(True).success
    client.until(lambda: client.said("controller", "safety", "controlling"))
    client.spin(1.0)
    assert abs(client.angle("index_proximal") - pose) < math.radians(2.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_controller_vents_when_it_ends(stack: Stack, client: Client, number: signal.Signals) -> None:
    """Fails when a controller that ends leaves pressure in the hand, logs nothing, ends with an error, or stays in the
    graph, as one that was killed does for 20 s.
    """
    stack.node("simulation")
    controller = stack.node("controller")
    client.controlling()
    client.command(index_proximal=0.8)
    client.until(lambda: abs(client.angle("index_proximal") - 0.8) < 0.02)
    assert stack.stop(controller, number) == 0
    client.until(lambda: "controller" not in client.node.get_node_names(), 3.0)
    assert client.last_pressure_pa() == 0.0
    assert "vented" in stack.log("controller")
    client.until(lambda: client.angle("index_proximal") < 0.2)


def test_a_missing_description_is_one_line_and_the_node_lives(stack: Stack, client: Client) -> None:
    """Fails when a bad file kills the node or is not named on diagnostics."""
    simulation = stack.node("simulation", hand_description="nowhere.yaml")
    client.until(lambda: client.said("simulation", "setup", "nowhere.yaml"))
    assert client.level("simulation", "setup") == 2
    assert simulation.poll() is None
    assert "Traceback" not in stack.log("simulation")


def test_live_equals_offline(stack: Stack, client: Client) -> None:
    """Fails when the offline plant, given the logged valve commands, moves otherwise than the live simulation."""
    recorder = stack.node("recorder", out=stack.folder / "live.mcap")
    client.until(lambda: client.commands.get_subscription_count() > 0)
    started(stack, client)
    client.until(lambda: client.node.count_subscribers("valve_command") >= 3)
    client.until(lambda: client.commands.get_subscription_count() >= 2)
    client.heard()  # the recorder, too: from the first motion on
    for angle in (0.9, 0.3, 1.2):
        client.command(index_proximal=angle, index_distal=angle / 2, thumb_opposition=angle)
        client.spin(1.5)
    stack.stop(recorder)
    recording = load_recording(stack.folder / "live.mcap")
    result = replay_recording(recording, load_hand(HAND))
    measured = recording["joint_states"]["position"][-len(result.states) :]
    error_deg = np.degrees(measured - replayed_angle_rad(result))
    assert np.ptp(np.degrees(measured), axis=0).max() > 40.0
    assert np.sqrt(np.mean(error_deg**2, axis=0)).max() < 0.05


@pytest.mark.skipif(resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] < 2**31 and os.geteuid() != 0, reason="ulimit -l")
def test_the_system_takes_no_memory_from_a_node(stack: Stack, client: Client) -> None:
    """Fails when code or data of a node that runs may have to be read from a disk again: that stops it for 0.1 s."""
    process = stack.node("simulation")
    client.until(lambda: client.joints)
    status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
    assert int(re.findall(r"VmLck:\s+(\d+) kB", status)[0]) > 10_000


def test_faster_than_real_time_with_clock(stack: Stack, client: Client) -> None:
    """Fails when /clock is missing, does not run faster, or the controller does not live on it."""
    stack.node("simulation", speed=3.0)
    stack.node("controller", use_sim_time="true")
    client.controlling()
    client.command(middle_proximal=0.6)
    client.until(lambda: abs(client.angle("middle_proximal") - 0.6) < 0.02)

    def stamp_s() -> float:
        stamp = client.joints[-1].header.stamp
        return float(stamp.sec + stamp.nanosec * 1e-9)

    begun, simulated = time.monotonic(), stamp_s()
    client.spin(2.0)
    assert (stamp_s() - simulated) / (time.monotonic() - begun) > 2.0
