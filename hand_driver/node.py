"""The driver node: frames of a board to topics, valve commands to the board. The only rclpy module here."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from hand_msgs.msg import AdcFrame, ContactForces, JointPressures, ValveCommand
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from hand_driver.board import Board, Frame, Status
from hand_driver.board_clock import BoardClock
from hand_driver.can_board import CanBoard
from hand_driver.driver_health import DriverHealth, LinkState
from hand_driver.link import Link
from hand_driver.measurement import Converter
from hand_driver.serial_board import SerialBoard
from hand_driver.set_points import CommandReader, RefusedError
from hand_driver.topics import FrameTopics
from hand_driver.zero import PressureZero
from hand_messages.health import Health, Level
from hand_model.description import Hand, load_hand
from hand_ros.node import COMMAND_QOS, SENSOR_QOS, STATE_QOS, HandNode, default_config, run
from hand_ros.parameters import NodeParameter

READ_TIMEOUT_S = 0.1
COMMON_PARAMETERS = (
    NodeParameter("hand_description", "", "path of hand.yaml; empty: the installed one"),
    NodeParameter("velocity_time_constant_s", 0.01, "lag of the velocity estimate; 0: plain difference", 0.0, 1.0),
    NodeParameter("frame_id", "hand", "frame_id of every message"),
)
PARAMETERS = (
    *COMMON_PARAMETERS,
    NodeParameter("transport", "serial", "how the board is connected", choices=("serial", "can")),
    NodeParameter("serial_port", "/dev/ttyUSB0", "port of a serial board"),
    NodeParameter("serial_baud", 1_000_000, "bit rate of a serial board [1/s]", 9600, 12_000_000),
    NodeParameter("can_interface", "socketcan", "python-can interface of a CAN board"),
    NodeParameter("can_channel", "can0", "channel of the CAN interface"),
    NodeParameter("can_bitrate", 1_000_000, "bit rate of the CAN bus [1/s]", 10_000, 1_000_000),
)


class DriverNode(HandNode):
    """Reads the board in its own thread and publishes from it; the executor delivers the commands."""

    def __init__(self, name: str = "driver", table: tuple[NodeParameter, ...] = PARAMETERS) -> None:
        """Declare parameters; the board is opened on activation."""
        super().__init__(name, table)
        self._hand: Hand | None = None
        self._thread: threading.Thread | None = None

    def board_factory(self, values: dict[str, Any], hand: Hand) -> Callable[[], Board]:
        """A function that opens the board named by the parameters."""
        if values["transport"] == "can":
            return lambda: CanBoard(
                values["can_interface"], values["can_channel"], hand.channel_count, values["can_bitrate"]
            )
        return lambda: SerialBoard(values["serial_port"], hand.channel_count, values["serial_baud"])

    def configure(self, values: dict[str, Any]) -> None:
        """Load the description and create publishers, subscription and service."""
        hand = load_hand(values["hand_description"] or default_config("hand.yaml"))
        self._hand = hand
        self._open = self.board_factory(values, hand)
        _warm_up(hand)
        self._velocity_time_constant_s = values["velocity_time_constant_s"]
        self._reader = CommandReader(hand)
        self._zero = PressureZero(hand)
        self._topics = FrameTopics(hand, values["frame_id"])
        self._frame_publishers = (  # in the order of TOPICS
            self.create_publisher(JointPressures, "pressures", SENSOR_QOS),
            self.create_publisher(JointState, "joint_states", STATE_QOS),
            self.create_publisher(ContactForces, "contact_forces", SENSOR_QOS),
            self.create_publisher(AdcFrame, "adc", SENSOR_QOS),
        )
        self._subscription = self.create_subscription(
            ValveCommand, "valve_command", self._on_command, COMMAND_QOS, raw=True
        )
        self._service = self.create_service(Trigger, "calibrate", self._on_calibrate)

    def start(self) -> None:
        """Open the board and read it until stop."""
        assert self._hand is not None
        self._board_clock = BoardClock()
        self._converter = Converter(self._hand, self._velocity_time_constant_s)
        self._health = DriverHealth(self._hand, time.monotonic())
        self._link = Link(self._open)
        self._reading = True
        self._thread = threading.Thread(target=self._read_loop, name="acquisition", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Vent, then close the board; its watchdog also vents."""
        self._reading = False
        if self._thread is not None:
            self._thread.join(timeout=2.0)
            self._thread = None
        self._link.close()

    def release(self) -> None:
        """Destroy publishers, subscription and service."""
        if self._hand is None:
            return
        self._hand = None
        for publisher in self._frame_publishers:
            self.destroy_publisher(publisher)
        self.destroy_subscription(self._subscription)
        self.destroy_service(self._service)

    def _read_loop(self) -> None:
        while self._reading:
            frame = self._link.read(READ_TIMEOUT_S)
            if frame is not None:
                self._publish(frame)
        assert self._hand is not None
        self._link.write(np.zeros(self._hand.valve_count), self._hand.watchdog_s)

    def stamp_ns(self, frame: Frame) -> int:
        """ROS time [ns] of a frame's acquisition."""
        return self._board_clock.map(frame.board_time_us, frame.received_ns) + time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """ROS time [ns] now, on the clock that stamps frames."""
        return time.time_ns()

    def _publish(self, frame: Frame) -> None:
        stamp_ns = self.stamp_ns(frame)
        measured = self._converter.convert(frame)
        for publisher, raw in zip(self._frame_publishers, self._topics.encode(stamp_ns, frame, measured), strict=True):
            publisher.publish(raw)
        self._zero.frame(frame)
        self._health.frame(frame, measured.at_rail, time.monotonic())

    def _on_command(self, raw: bytes) -> None:
        if not self.active:
            return
        try:
            set_points = self._reader.read(raw, self.now_ns())
        except RefusedError as error:
            self._health.refused(str(error), time.monotonic())
            self.log_throttled(Level.ERROR, "refused", str(error))
            return
        self._link.write(set_points.pressure_pa, set_points.lifetime_s)

    def _on_calibrate(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Use the pressure readings of the vented hand as zero."""
        try:
            if not self.active:
                raise ValueError("the driver is not active")
            self._converter.pressure_zero_ratio, response.message = self._zero.result()
            response.success = True
        except ValueError as error:
            response.message = f"not calibrated: {error}"
        self.get_logger().info(response.message)
        return response

    def health(self) -> list[Health]:
        """Link, frames, supply, channels, board and commands."""
        if not self.active:
            return [Health("link", Level.OK, "not active; the hand is vented by the board's watchdog")]
        link = self._link
        state = LinkState(link.up, link.reconnects, link.error, link.counters)
        statuses = self._health.statuses(state, time.monotonic())
        for status in statuses:
            if status.level == Level.ERROR and status.name != "commands":
                self.log_throttled(status.level, status.name, f"{status.name}: {status.message}")
        return statuses


def _warm_up(hand: Hand) -> None:
    """Load the compiled conversions before the first frame, which otherwise would be late."""
    frame = Frame(0, 0, hand.sensors.supply_voltage_v, Status(0), np.zeros(hand.channel_count, np.uint16), 0)
    Converter(hand, 0.0).convert(frame)


def main() -> None:
    """Entry point of the executable `driver`."""
    sys.exit(run(DriverNode))


__all__ = ["COMMON_PARAMETERS", "DriverNode", "main"]
