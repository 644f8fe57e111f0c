"""The whole chain in virtual time: plant, sensors, board rules, conversion, controller, and back to the valves.

One step is one frame of the board. Every signal can be changed on its way by a function that a fault sets.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hand_control.controller import Controller, Tick, Times
from hand_control.declared import Settings
from hand_control.supervisor import Phase
from hand_driver.board import Frame, SetPointsInForce, Status
from hand_driver.measurement import Converter, Measurement
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_sim.plant import PHI, P, SimulatedPlant

CONFIG = Path(__file__).resolve().parents[2] / "config"
START_NS = 1_000_000_000_000
SETTLE_S = 0.3
WATCH_S = 0.02
"""Period of the controller's watch for silence."""


@cache
def description() -> Hand:
    """The hand of config/hand.yaml."""
    return load_hand(CONFIG / "hand.yaml")


class VirtualHand:
    """A hand with its controller, enabled and at rest after construction.

    measured: changes a Measurement.  valve: changes set-points on the way to the valves, (n,) [Pa].  delivered: whether
    a frame arrives.  stamp_ns: the stamp of a frame by its time [ns].
    """

    def __init__(self, seed: int, **values: Any) -> None:
        """Enable and settle; values: parameters of the controller."""
        self.hand = description()
        self.controller = Controller(self.hand, Settings.of(self.hand, values))
        self.plant = SimulatedPlant(self.hand, self.hand.rate_hz, seed)
        self.converter = Converter(self.hand, 0.01)
        self.period_ns = round(1e9 / self.hand.rate_hz)
        self.now_ns = START_NS
        self.measured: Callable[[Measurement], Measurement] = lambda measurement: measurement
        self.valve: Callable[[Array], Array] = lambda pressure: pressure
        self.delivered: Callable[[], bool] = lambda: True
        self.stamp_ns: Callable[[int], int] = lambda now_ns: now_ns
        self.tick: Tick | None = None
        self.worst_excess_pa = 0.0
        self._count = 0
        self._in_force = SetPointsInForce(self.hand.valve_count, 1.0 / self.hand.rate_hz)
        self._limit = np.asarray(self.hand.limits.max_pressure_pa)
        self.controller.enable(True)
        self.run(SETTLE_S)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """Run for some seconds or until a condition holds; returns the time that passed [s]."""
        begun = self.now_ns
        for _ in range(round(seconds * 1e9 / self.period_ns)):
            self.step()
            if until():
                break
        return (self.now_ns - begun) * 1e-9

    def step(self) -> None:
        """One frame."""
        self.now_ns += self.period_ns
        self._count += 1
        counts, supply_v, status = self.plant.step(self.valve(self._in_force.pressure_pa.copy()))
        vented = Status.VENTED if self._in_force.vented(self._count) else Status(0)
        frame = Frame(self._count, self.now_ns // 1000, supply_v, status | vented, counts, self.now_ns)
        command = self._controlled(self.measured(self.converter.convert(frame))) if self.delivered() else None
        if command is None and self._count % round(WATCH_S * self.hand.rate_hz) == 0:
            command = np.zeros(self.hand.valve_count) if self.controller.check(self.now_ns) else None
        if command is None:
            self._in_force.take_over(self._count)
            return
        excess = float(np.max(np.where(np.isfinite(command), np.maximum(command - self._limit, -command), np.inf)))
        self.worst_excess_pa = max(self.worst_excess_pa, excess)
        self._in_force.take_over(self._count, command, self.controller.settings.command_lifetime_s)

    def _controlled(self, measured: Measurement) -> Array | None:
        times = Times(self.stamp_ns(self.now_ns), self.now_ns, self.now_ns)
        tick = self.controller.frame(times, measured.position, measured.velocity, measured.pressure)
        if tick is None:
            return None
        self.tick = tick
        return np.array(tick.pressure_command)

    @property
    def times(self) -> Times:
        """The times of a command that arrives now, without a stamp."""
        return Times(0, self.now_ns, self.now_ns)

    @property
    def angle_rad(self) -> Array:
        """True angles (n,) [rad]."""
        return np.array(self.plant.plant.state[PHI])

    @property
    def pressure_pa(self) -> Array:
        """True pressures (n,) [Pa]."""
        return np.array(self.plant.plant.state[P])

    @property
    def set_points_pa(self) -> Array:
        """Set-points (n,) [Pa] that the board holds."""
        return self._in_force.pressure_pa.copy()

    @property
    def vented(self) -> bool:
        """Whether a fault is latched and the hand vented."""
        return self.controller.safety.phase is Phase.VENTED and bool(self.controller.safety.fault)

    def move(self, degrees: float) -> None:
        """Command all joints to an angle [deg]."""
        target = np.clip(np.radians(degrees), self.hand.limits.low_rad, self.hand.limits.high_rad)
        self.controller.command(self.times, self.hand.joints, target.tolist(), [])
