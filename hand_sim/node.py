"""The simulation node: the driver node on a simulated board. The only rclpy module here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from rosgraph_msgs.msg import Clock

from hand_driver.board import Board, Frame
from hand_driver.node import COMMON_PARAMETERS, DriverNode
from hand_messages.cdr import Layout
from hand_messages.layouts import CLOCK
from hand_model.description import Hand
from hand_ros.node import QUEUED_QOS, end, run
from hand_ros.parameters import NodeParameter
from hand_sim.board import SimulatedBoard
from hand_sim.plant import SimulatedPlant

PARAMETERS = (
    *COMMON_PARAMETERS,
    NodeParameter("seed", 0, "seed of the sensor noise", 0, 2**31 - 1),
    NodeParameter("speed", 1.0, "simulated seconds per second; any value other than 1 publishes /clock", 0.01, 20.0),
    NodeParameter("publish_clock", False, "publish /clock at speed 1, too; other nodes then need use_sim_time"),
)


class SimulationNode(DriverNode):
    """The driver node on a simulated board: the same topics, types, QoS and rates."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("simulation", PARAMETERS)
        self._time_ns: int | None = None

    def configure(self, values: dict[str, Any]) -> None:
        """Configure as the driver does; publish /clock where simulated time is not real time."""
        self._time_ns = None
        if values["publish_clock"] or values["speed"] != 1.0:
            self._time_ns = 0
            self._clock_publisher = self.create_publisher(Clock, "/clock", QUEUED_QOS)
            self._clock_layout = Layout(CLOCK)
        super().configure(values)

    def board_factory(self, values: dict[str, Any], hand: Hand) -> Callable[[], Board]:
        """A simulated board of this hand."""
        # Load the compiled functions before the clock starts.
        SimulatedPlant(hand, hand.rate_hz).step(np.zeros(hand.valve_count))
        plant = SimulatedPlant(hand, hand.rate_hz, values["seed"])
        return lambda: SimulatedBoard(plant, hand.rate_hz, values["speed"])

    def frame_rate_hz(self, values: dict[str, Any], hand: Hand) -> float:
        """Frames in a second of the host [1/s], where simulated time is not real time."""
        return hand.rate_hz * float(values["speed"])

    def acquired_ns(self, frame: Frame) -> int:
        """The board shares the clock of the host, so that nothing is to be mapped where its time is scaled."""
        return super().acquired_ns(frame) if self._time_ns is None else frame.received_ns

    def stamp_ns(self, frame: Frame, acquired_ns: int) -> int:
        """Simulated time where /clock is published, otherwise the time of the driver."""
        if self._time_ns is None:
            return super().stamp_ns(frame, acquired_ns)
        self._time_ns = frame.board_time_us * 1000
        self._clock_publisher.publish(self._clock_layout.encode(clock_ns=self._time_ns))
        return self._time_ns

    def now_ns(self) -> int:
        """Simulated time where /clock is published."""
        return super().now_ns() if self._time_ns is None else self._time_ns


def main() -> None:
    """Entry point of the executable `simulation`."""
    end(run(SimulationNode))
