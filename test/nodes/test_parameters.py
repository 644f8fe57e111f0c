"""Parameters over their services, as `ros2 param` uses them: arrays, integers for floats, dump and load."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from hand_robot.node import FramePublisher
from hand_ros.parameters import ParameterError

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack


def set_one(client: Client, name: str, value: Any) -> Any:
    """The result of `ros2 param set` for one parameter."""
    parameters = [Parameter(name, value=value).to_parameter_msg()]
    answer = client.call(SetParameters, "/hand/controller/set_parameters", SetParameters.Request(parameters=parameters))
    return answer.results[0]


def get(client: Client, names: list[str]) -> list[Any]:
    """The values of parameters, as messages."""
    answer = client.call(GetParameters, "/hand/controller/get_parameters", GetParameters.Request(names=names))
    return list(answer.values)


def test_arrays_integers_and_a_dump_are_accepted(stack: Stack, client: Client) -> None:
    """Fails when a list cannot be set at run time, an integer is refused for a float, or a dump cannot be loaded."""
    stack.start("controller", "--ros-args", "-p", "deadband_pa:=250", "-p", "ki_nm_per_rad_s:=[2]")
    deadband, ki = get(client, ["deadband_pa", "ki_nm_per_rad_s"])
    assert deadband.double_value == 250.0 and list(ki.double_array_value) == [2.0]
    for name, value in (("kp_nm_per_rad", [0.2]), ("kp_nm_per_rad", [1] * 11), ("deadband_pa", 300)):
        assert set_one(client, name, value).successful, name
    kp, deadband = get(client, ["kp_nm_per_rad", "deadband_pa"])
    assert list(kp.double_array_value) == [1.0] * 11 and deadband.double_value == 300.0
    refused = set_one(client, "kp_nm_per_rad", [0.1, 0.2])
    assert not refused.successful and "has 2 values; it must have 1 or 11" in refused.reason
    assert not set_one(client, "frame_id", "elsewhere").successful
    listed = client.call(ListParameters, "/hand/controller/list_parameters", ListParameters.Request())
    names = list(listed.result.names)
    dump = [ParameterMessage(name=n, value=v) for n, v in zip(names, get(client, names), strict=True)]
    request = SetParameters.Request(parameters=dump)
    loaded = client.call(SetParameters, "/hand/controller/set_parameters", request)
    failed = {n: r.reason for n, r in zip(names, loaded.results, strict=True) if not r.successful}
    assert not failed and "kp_nm_per_rad" in names and "frame_id" in names


def test_torque_mode_without_a_command_gives_no_pressure(stack: Stack, client: Client) -> None:
    """Fails when setting the mode of an idle hand to torque drives it, or an effort alone is refused there."""
    stack.node("simulation")
    stack.node("controller")
    client.controlling()
    client.spin(1.0)
    before = list(client.joints[-1].position)
    client.valves.clear()
    assert set_one(client, "control_mode", "torque").successful
    client.spin(2.0)
    assert len(client.valves) > 100
    assert max(max(valve.pressure) for valve in client.valves) < 1e4
    assert max(abs(a - b) for a, b in zip(client.joints[-1].position, before, strict=True)) < math.radians(3.0)
    client.commands.publish(JointState(name=["index_proximal"], effort=[0.02]))
    client.until(lambda: client.angle("index_proximal") > 0.5)
    assert set_one(client, "control_mode", "position").successful
    client.spin(0.5)
    held = client.angle("index_proximal")
    client.spin(1.0)
    assert abs(client.angle("index_proximal") - held) < math.radians(3.0)
    client.commands.publish(JointState(name=["index_proximal"], effort=[0.02]))
    client.until_said("controller", "commands", "efforts without positions")


def test_a_node_that_must_be_configured_ends_with_code_2(stack: Stack) -> None:
    """Fails when a launch file cannot learn of a wrong description, or its reason is not one line."""
    node = stack.node("controller", hand_description="nowhere.yaml", exit_unconfigured="true")
    assert node.wait(timeout=60) == 2
    lines = [line for line in stack.log("controller").splitlines() if "nowhere.yaml" in line]
    assert len(lines) == 1 and "Traceback" not in stack.log("controller")


def test_the_recorder_answers_parameter_services(stack: Stack, client: Client) -> None:
    """Fails when the recorder does not answer `ros2 param get`."""
    stack.node("recorder", out=stack.folder / "here.mcap")
    request = GetParameters.Request(names=["out", "storage"])
    out, storage = client.call(GetParameters, "/recorder/get_parameters", request).values
    assert out.string_value == str(stack.folder / "here.mcap") and storage.string_value == "mcap"


def test_the_place_on_a_mount_is_three_numbers(client: Client) -> None:
    """Fails when frame_publisher leaves the place of the hand out, or goes on with one that is incomplete."""
    assert client.node  # ROS has been started
    node = FramePublisher()
    values = node.values | {"mount": "tool0"}
    node.configure(values | {"mount_xyz_m": [0.0, 0.0, 0.05]})
    assert 'xyz="0 0 0.05"' in node.description
    with pytest.raises(ParameterError, match=r"parameter mount_rpy_rad is \[0\.0\]; it must be three numbers"):
        node.configure(values | {"mount_rpy_rad": [0.0]})
    node.destroy_node()
