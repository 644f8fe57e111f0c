"""The driver node: frames of a board to topics, valve commands to the board. The only rclpy module here."""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from hand_msgs.msg import AdcFrame, BoardState, ContactForces, JointPressures, ValveCommand
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from hand_driver.board import Board, Frame, Status
from hand_driver.board_clock import BoardClock, WallClock
from hand_driver.board_health import clock_health, protocol_health
from hand_driver.board_report import BoardReport, Reporter
from hand_driver.can_board import CanBoard
from hand_driver.channel_faults import ChannelFaults
from hand_driver.channel_watch import ChannelWatch
from hand_driver.driver_health import DriverHealth, LinkState
from hand_driver.guard import Guard
from hand_driver.link import Link
from hand_driver.measurement import Converter
from hand_driver.pressure_ramp import PressureRamp
from hand_driver.serial_board import SerialBoard
from hand_driver.set_point_watch import SetPointWatch
from hand_driver.set_points import CommandReader, RefusedError, SetPoints
from hand_driver.silence import Silence
from hand_driver.topics import FrameTopics
from hand_driver.zero import PressureZero
from hand_messages.health import Health, Level
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.geometry import palm_frame
from hand_ros.heartbeat import TIMEOUT, Heartbeat
from hand_ros.node import (
    COMMAND_QOS,
    LATCHED_STATE_QOS,
    LIVE_QOS,
    RARELY_S,
    RELIABLE_SENSOR_QOS,
    STATE_FILE,
    HandNode,
    default_config,
    end,
    one_line,
    run,
)
from hand_ros.parameters import NodeParameter
from hand_ros.publishers import Verdict

READ_TIMEOUT_S = 0.05
WATCH_PERIOD_S = 0.02
COMMON_PARAMETERS = (
    NodeParameter("hand_description", "", "path of hand.yaml; empty: the installed one"),
    NodeParameter("velocity_time_constant_s", 0.01, "lag of the velocity estimate; 0: plain difference", 0.0, 1.0),
    NodeParameter("joint_prefix", "", "beginning of the names of joints and frames; empty: joint_prefix of hand.yaml"),
    NodeParameter("frame_id", "", "frame_id of every message; empty: the palm, or the namespace without geometry"),
    STATE_FILE,
    TIMEOUT,
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
        self._writing = threading.RLock()  # of the guard's set-points and of what is written to the board

    def board_factory(self, values: dict[str, Any], hand: Hand) -> Callable[[], Board]:
        """A function that opens the board named by the parameters."""
        if values["transport"] == "can":
            return lambda: CanBoard(
                values["can_interface"], values["can_channel"], hand.channel_count, values["can_bitrate"]
            )
        return lambda: SerialBoard(values["serial_port"], hand.channel_count, values["serial_baud"])

    def frame_rate_hz(self, _values: dict[str, Any], hand: Hand) -> float:
        """Frames in a second of the host [1/s]."""
        return hand.rate_hz

    def configure(self, values: dict[str, Any]) -> None:
        """Load the description and create publishers, subscription and service."""
        hand = load_hand(values["hand_description"] or default_config("hand.yaml"), values["joint_prefix"])
        self._hand = hand
        self._joints = list(hand.joints)
        self._open = self.board_factory(values, hand)
        self._frame_rate_hz = self.frame_rate_hz(values, hand)
        _warm_up(hand)
        self._velocity_time_constant_s = values["velocity_time_constant_s"]
        self._reader = CommandReader(hand)
        self._guard = Guard(self.load_fault(values["state_file"]))
        self._heartbeat = Heartbeat(values["heartbeat_timeout_s"])
        self._commander, self._contested = b"", False
        self._zero = PressureZero(hand)
        self._frame_id = self.frame_id(values, palm_frame(hand, self.get_namespace()))
        self._topics = FrameTopics(hand, self._frame_id)
        self._frame_publishers = (  # in the order of TOPICS
            self.sole_publisher(JointPressures, "pressures", RELIABLE_SENSOR_QOS),
            self.sole_publisher(JointState, "joint_states", LATCHED_STATE_QOS),
            self.create_publisher(ContactForces, "contact_forces", RELIABLE_SENSOR_QOS),
            self.create_publisher(AdcFrame, "adc", RELIABLE_SENSOR_QOS),
        )
        self._board_publisher = self.sole_publisher(BoardState, "board_state", LATCHED_STATE_QOS)
        self._inputs = (
            self.sole_source(ValveCommand, "valve_command", self._on_command, COMMAND_QOS, self._on_publishers),
            self.create_subscription(Empty, "heartbeat", self._on_heartbeat, LIVE_QOS, raw=True),
        )
        self._end_stop = self.listen_to_stop(self._on_stop, lambda: bool(self._guard.fault))
        self._own_services = (
            self.create_service(Trigger, "calibrate", self._on_calibrate),
            self.create_service(Trigger, "reset_driver", self._on_reset),
        )

    def latched_fault(self) -> str:
        """The latched fault of the driver; empty for none."""
        return self._guard.fault

    def described(self) -> str:
        """The node and how many joints it has."""
        return f"{self.get_name()} of {len(self._joints)} joints"

    def start(self) -> None:
        """Open the board and read it until stop."""
        self.cycles = 0
        assert self._hand is not None
        self._board_clock = BoardClock()
        self._wall_clock = WallClock()
        self._converter = Converter(self._hand, self._velocity_time_constant_s)
        self._channel_watch = ChannelWatch(self._hand)
        self._channel_faults = ChannelFaults(self._hand)
        self._health = DriverHealth(self._hand, time.monotonic())
        self._silence = Silence(self._frame_rate_hz)
        self._guard.forget()
        self._link = Link(self._open)
        self._reporter = Reporter()
        self._set_point_watch = SetPointWatch(self._hand.joints)
        self._ramp = PressureRamp(self._hand.valve_count)
        self._connections = self._restarts = 0
        self._connected_s = time.monotonic()
        self._stamp_ns = 0
        self._watch = self.create_timer(WATCH_PERIOD_S, self._on_watch)
        self._reading = True
        self._thread = threading.Thread(target=self._read_loop, name="acquisition", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Vent, then close the board; its watchdog also vents."""
        self._reading = False
        self.destroy_timer(self._watch)
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
        self.destroy_publisher(self._board_publisher)
        self._end_stop()
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for service in self._own_services:
            self.destroy_service(service)

    def _read_loop(self) -> None:
        while self._reading:
            try:
                frame = self._link.read(READ_TIMEOUT_S)
                if frame is not None:
                    self._publish(frame)
                self._report()
            except Exception as error:  # a defect of this program, which would end the thread and leave the hand driven
                self._on_defect(error)
        assert self._hand is not None
        self._link.write(np.zeros(self._hand.valve_count), self._hand.watchdog_s)

    def _on_defect(self, error: Exception) -> None:
        """Vent and latch, log where the error comes from, and go on after a pause: the next frame may be good."""
        self.log_throttled(Level.ERROR, "defect", traceback.format_exc(), RARELY_S)
        with suppress(Exception):  # where writing fails, too, it is latched all the same and the board vents by itself
            self._trip(f"internal error: {type(error).__name__}: {one_line(error)}; see the log of the driver")
        time.sleep(READ_TIMEOUT_S)

    def acquired_ns(self, frame: Frame) -> int:
        """Time of the host's monotonic clock [ns] of a frame's acquisition."""
        return self._board_clock.map(frame.board_time_us, frame.received_ns)

    def stamp_ns(self, frame: Frame, acquired_ns: int) -> int:
        """ROS time [ns] of a frame's acquisition."""
        stamp_ns = acquired_ns + self._wall_clock.offset_ns(time.time_ns(), time.monotonic_ns())
        return max(stamp_ns, self._stamp_ns + 1)

    def now_ns(self) -> int:
        """ROS time [ns] now, on the clock that stamps frames."""
        return time.time_ns()

    def _publish(self, frame: Frame) -> None:
        acquired_ns = self.acquired_ns(frame)
        stamp_ns = self.stamp_ns(frame, acquired_ns)
        disbelieved = self._channel_watch.check(frame.counts)
        measured = self._converter.convert(frame, disbelieved)
        watch = None if disbelieved is None else self._channel_watch
        channels = self._channel_faults.lines(frame, measured.at_rail, watch)
        now_s = time.monotonic()
        self._reporter.frame(frame, now_s, channels)
        if channels:
            self._report()  # the cause before the values that are not numbers
        for publisher, raw in zip(self._frame_publishers, self._topics.encode(stamp_ns, frame, measured), strict=True):
            publisher.publish(raw)
        if np.isfinite(measured.position).any() or np.isfinite(measured.pressure).any():
            self._silence.measured(time.monotonic_ns())
        self._watch_board(frame, acquired_ns, measured.pressure)
        self._zero.frame(frame)
        self._health.frame(frame, measured.at_rail, now_s, self._channel_watch)
        self._stamp_ns = stamp_ns
        self.cycles = (self.cycles or 0) + 1

    def _watch_board(self, frame: Frame, acquired_ns: int, pressure_pa: Array) -> None:
        """Vent and latch where the board was restarted or does not follow; the ramp starts from what is measured."""
        self._follow_connection()
        self._ramp.frame(Status.VENTED in frame.status, pressure_pa, acquired_ns)
        fault = self._set_point_watch.frame(frame, acquired_ns)
        restarts = self._link.counters.restarts
        if restarts != self._restarts:
            self._restarts = restarts
            self._ramp.begin()
            fault = "the board was restarted (its frames begin again); check its power supply"
        if fault and not self._guard.fault:
            self._trip(fault)
        elif self._ramp.active:
            self._go_on_with_the_ramp(time.monotonic_ns())

    def _go_on_with_the_ramp(self, now_ns: int) -> None:
        """Let the pressure rise also where one command with a long lifetime is all that comes."""
        with self._writing:  # nothing older may follow a vent or a newer command
            in_force = self._guard.in_force(now_ns)
            if in_force is not None and not self._guard.fault:
                self._write(in_force.pressure_pa, in_force.lifetime_s)

    def _follow_connection(self) -> None:
        """Begin the watch and the ramp again where the board was opened since the last call."""
        if self._link.connections != self._connections:
            self._connections = self._link.connections
            self._connected_s = time.monotonic()
            self._set_point_watch.forget()
            self._ramp.begin()

    def _write(self, pressure_pa: Array, lifetime_s: float) -> None:
        """Write set-points, limited by the ramp after an outage."""
        self._follow_connection()
        now_ns = time.monotonic_ns()
        allowed_pa = self._ramp.limit(pressure_pa, now_ns)
        with self._writing:
            if self._link.write(allowed_pa, lifetime_s):
                self._set_point_watch.sent(self._link.sequence, allowed_pa, lifetime_s, now_ns)

    def _report(self) -> None:
        """Publish the state of the board on change and at REPORT_HZ."""
        report = self._reporter.due(self._link.protocol, self._link.up, self._guard.fault, time.monotonic())
        if report is not None:
            stamp_ns = self._stamp_ns or self.now_ns()
            self._board_publisher.publish(_board_state(report, stamp_ns, self._frame_id, self._joints))

    def _on_command(self, raw: bytes) -> None:
        if not self.active or not self._health.budget.take(time.monotonic()):
            return
        try:
            self._obey(self._reader.read(raw, self.now_ns()))
        except RefusedError as error:
            self._health.refused(str(error), time.monotonic())
            self.log_throttled(Level.ERROR, "refused", str(error))

    def _obey(self, set_points: SetPoints) -> None:
        """Write set-points. RefusedError where they must not reach the board."""
        conflict = self.conflict.line
        with self._writing:  # the acquisition thread must not trip between the checks and what is written
            now_ns = time.monotonic_ns()
            if conflict and self._guard.driving(now_ns):
                raise RefusedError(f"valve_command refused, the pressures are held: {conflict}")
            objection = conflict or self._heartbeat.missing(now_ns) or self._silence.objection(now_ns)
            if refusal := self._guard.refusal(set_points, objection):
                raise RefusedError(refusal)
            self._guard.written(set_points, now_ns)
            self._write(set_points.pressure_pa, set_points.lifetime_s)
        self._health.asked(bool(set_points.pressure_pa.any()), now_ns * 1e-9)

    def trip(self, fault: str) -> None:
        """Vent the hand now and latch a fault of the driver; from then on only 0 Pa passes until `reset_driver`."""
        self._trip(fault)
        self.keep_fault(self._guard.fault)

    def _trip(self, fault: str) -> None:
        """The same for the acquisition thread, which must not wait for a disk: _on_watch stores the fault."""
        with self._writing:
            self._guard.trip(fault)
            self._vent()

    def _vent(self) -> None:
        if self.active and self._hand is not None:
            self._write(np.zeros(self._hand.valve_count), self._hand.watchdog_s)

    def _on_watch(self) -> None:
        now_ns = time.monotonic_ns()
        self._follow_publishers(now_ns, self.second_publishers())
        missing = self._heartbeat.missing(now_ns)
        if missing and self._guard.driving(now_ns):
            self.trip(missing)
        if unmeasured := self._silence.fault(self._guard.driving(now_ns), now_ns):
            self.trip(unmeasured)
        if self._guard.fault:
            self._vent()  # again and again: a board may have missed it
            self.keep_fault(self._guard.fault)
            line = f"vented: {self._guard.fault}; call reset_driver"
            self.log_throttled(Level.ERROR, "fault", line, RARELY_S)

    def _on_publishers(self, came: int) -> None:
        """Publishers of valve_command came or left. Called before any message of a new one is."""
        if not self.active:
            return
        line, now_ns = self.second_publishers(), time.monotonic_ns()
        same = self.accepted_publisher("valve_command") == self._commander
        if came and same and not line and self._guard.driving(now_ns):
            line = "second publisher: one of valve_command came and left at once; it can no longer be named"
        self._follow_publishers(now_ns, line)

    def _follow_publishers(self, now_ns: int, line: str) -> None:
        """Hold, then vent, while there is a second publisher; the middleware does not mark whose a message is."""
        verdict = self.conflict.update(now_ns, line)
        commander = self.accepted_publisher("valve_command")
        if verdict is Verdict.ALONE:
            self._commander, self._contested = commander, False
            return
        self.log_throttled(Level.ERROR, "authority", self.conflict.line, RARELY_S)
        if self._hold(now_ns, verdict is Verdict.VENT or commander != self._commander):
            self.trip(self.conflict.line)
            self._contested = False

    def _hold(self, now_ns: int, ended: bool) -> bool:
        """Write the held pressures again; whether the hand is to be vented instead, because the hold has ended."""
        with self._writing:  # nothing that was held may follow a vent
            held = self._guard.held(now_ns)
            self._contested = self._contested or held is not None
            vents = self._contested and ended
            if held is not None and not vents:
                self._guard.written(held, now_ns)
                self._write(held.pressure_pa, held.lifetime_s)
        return vents

    def _on_stop(self) -> None:
        self.trip("emergency stop: a message arrived on emergency_stop")

    def _on_heartbeat(self, _raw: bytes) -> None:
        self._heartbeat.beat(time.monotonic_ns())

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Clear a latched fault of the driver."""
        if not self._guard.fault:
            response.message = "no fault of the driver is latched"
            return response
        try:
            self.clear_fault()
        except ValueError as error:
            response.message = str(error)
            return response
        if self.active:
            self._link.renew()
            self._set_point_watch.forget()
            self._ramp.begin()
        response.success, response.message = True, f"cleared: {self._guard.reset()}"
        return response

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
                self.log_throttled(status.level, status.name, f"{status.name}: {status.message}", RARELY_S)
        fault = self._guard.fault
        level, line = (
            (Level.ERROR, f"vented: {fault}; call reset_driver") if fault else (Level.OK, "no fault is latched")
        )
        protocol = protocol_health(
            link.protocol, time.monotonic() - self._connected_s, self._set_point_watch.lost_share
        )
        clock = clock_health(self._board_clock.rate_error, self._board_clock.lag_s, self._wall_clock.set_back_s)
        safety = Health("safety", level, line)
        return [*statuses, protocol, clock, safety, self.authority_health(), *self.stop_health()]


def _warm_up(hand: Hand) -> None:
    """Load the compiled conversions before the first frame, which otherwise would be late."""
    frame = Frame(0, 0, hand.sensors.supply_voltage_v, Status(0), np.zeros(hand.channel_count, np.uint16), 0)
    Converter(hand, 0.0).convert(frame, ChannelWatch(hand).check(frame.counts))


def _board_state(report: BoardReport, stamp_ns: int, frame_id: str, joints: list[str]) -> BoardState:
    message = BoardState(
        protocol=report.protocol,
        link_up=report.link_up,
        status=int(report.status),
        supply_voltage=report.supply_voltage_v,
        set_point_age=math.nan,
        fault=report.fault,
        channel_fault=report.channels,
    )
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    echo = report.echo
    if echo is not None:
        message.set_point_sequence, message.set_point_age = echo.sequence, echo.age_s
        message.name, message.set_point = joints, echo.pressure_pa
    return message


def main() -> None:
    """Entry point of the executable `driver`."""
    end(run(DriverNode))


__all__ = ["COMMON_PARAMETERS", "DriverNode", "main"]
