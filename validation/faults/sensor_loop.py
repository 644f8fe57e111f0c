"""A hand under its real controller in virtual time: plant, converter, channel watch and controller, frame by frame.

    set-points -> watchdog of the board -> plant -> sensors and ADC -> fault -> channel watch -> converter -> controller

Time runs as fast as the computer allows, and every run is repeated exactly by its seed. The plant differs from the
controller's model, rubs, and meets loads and obstacles that change while it moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hand_control.controller import Controller, Tick, Times
from hand_control.declared import Settings
from hand_driver.board import Counts, Frame, SetPointsInForce, Status
from hand_driver.channel_watch import BLOCK, ChannelWatch
from hand_driver.measurement import Converter
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.statics import leverage, pressure_for_torque
from hand_sim.plant import PHI, SimulatedPlant

VELOCITY_TIME_CONSTANT_S = 0.01
DRAWN = (
    "statics.a0_nm",
    "statics.a1_nm_per_rad",
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
)
NEEDED_PA = 5.2e5
"""A plant that needs more pressure to hold its highest angle of a run at rest is drawn again."""
HIGHEST_RAD = float(np.radians(75.0))

Fault = Callable[[int, Counts, float], tuple[Counts, float]]
"""(frame number, counts, sensor supply [V]) -> what the converter sends instead."""


@dataclass(frozen=True, slots=True)
class Plant:
    """How the plant differs from the controller's model.

    error: largest relative error of each constant.  friction_nm: Coulomb friction.  valve_lag: factor on the time
    constant.  noise: factor on the noise of every sensor.  liquid: filled with an incompressible fluid.
    """

    error: float = 0.0
    friction_nm: float = 0.003
    valve_lag: float = 1.0
    noise: float = 1.0
    liquid: bool = False


def described(hand: Hand, plant: Plant) -> Hand:
    """The description the controller is given: it knows the fluid."""
    if not plant.liquid:
        return hand
    parameters = hand.parameters.copy()
    parameters[ROW["hydraulic.share"]] = 1.0
    return replace(hand, parameters=parameters)


def built(hand: Hand, plant: Plant, rng: np.random.Generator) -> Hand:
    """The hand as it really is: constants drawn, friction, slower valves, more noise."""
    model = described(hand, plant)
    parameters = model.parameters.copy()
    todo = np.ones(len(hand.joints), dtype=np.bool_)
    while todo.any():
        factor = {key: rng.uniform(1.0 - plant.error, 1.0 + plant.error, len(todo)) for key in DRAWN}
        for key in DRAWN:
            parameters[ROW[key]] = np.where(todo, model.row(key) * factor[key], parameters[ROW[key]])
        a0, a1, a2, a3 = (parameters[ROW[key]] for key in DRAWN[:4])
        needed = pressure_for_torque(0.0, HIGHEST_RAD, 0.0, a0, a1, a2, a3, 0.0)
        todo = (leverage(HIGHEST_RAD, a2, a3) < 2e-8) | (needed > NEEDED_PA)
    inertia = parameters[ROW["dynamics.inertia_kg_m2"]] / model.row("dynamics.inertia_kg_m2")
    partner = hand.partner
    paired = np.where(partner >= 0, np.sqrt(inertia * inertia[partner]), 1.0)
    parameters[ROW["dynamics.coupling_inertia_kg_m2"]] = model.row("dynamics.coupling_inertia_kg_m2") * paired
    parameters[ROW["valve.time_constant_s"]] *= plant.valve_lag
    parameters[ROW["coulomb_friction.torque_nm"]] = plant.friction_nm
    return replace(model, parameters=parameters)


class Loop:
    """One hand in the closed loop. `run` advances it frame by frame.

    now_ns: virtual time.  angle: true angles (joints,) [rad].  tick: the last result of the controller.
    """

    def __init__(
        self, hand: Hand, plant: Plant, seed: int, fault: Fault | None = None, settings: Settings | None = None
    ) -> None:
        """Build plant and controller, and let the channel watch learn the noise of the vented hand."""
        rng = np.random.default_rng(seed)
        self.real = built(hand, plant, rng)
        self.hand = described(hand, plant)
        self.rate_hz = hand.rate_hz
        self._plant = SimulatedPlant(self.real, self.rate_hz, seed)
        self._plant.scale_noise(plant.noise)
        self.controller = Controller(self.hand, settings or Settings.of(self.hand, {}))
        self.watch = ChannelWatch(self.hand)
        self._converter = Converter(self.hand, VELOCITY_TIME_CONSTANT_S)
        self._in_force = SetPointsInForce(self.hand.valve_count, 1.0 / self.rate_hz)
        self._lifetime_s = self.controller.settings.command_lifetime_s
        self.fault = fault
        self.set_point_fault: Callable[[int, Array], Array] | None = None
        self.number, self.now_ns = 0, 10**9
        self.angle: Array = self._plant.plant.state[PHI]
        self.set_point: Array = np.zeros(self.hand.valve_count)
        self.tick: Tick | None = None
        for _ in range(BLOCK):
            self._frame(heard=False)

    def change(self, key: str, values: Array | float) -> None:
        """Give a parameter of the plant another value (joints,) in SI from now on."""
        self._plant.plant.change(key, np.broadcast_to(np.asarray(values, dtype=np.float64), (len(self.hand.joints),)))

    def step(self, heard: bool = True) -> bool:
        """Advance by one frame, which the controller receives unless heard is False; whether the hand is driven."""
        self._frame(heard)
        return self.controller.safety.phase.value == "controlling"

    def _frame(self, heard: bool) -> None:
        self.number += 1
        self.now_ns += round(1e9 / self.rate_hz)
        force = self._in_force.pressure_pa
        if self.set_point_fault is not None:
            force = self.set_point_fault(self.number, force)
        counts, supply_v, status = self._plant.step(force)
        self.angle = self._plant.plant.state[PHI]
        if self.fault is not None:
            counts, supply_v = self.fault(self.number, counts, supply_v)
        frame = Frame(self.number, self.now_ns // 1000, supply_v, status & ~Status.SUPPLY_LOW, counts, self.now_ns)
        measured = self._converter.convert(frame, self.watch.check(counts))
        sent: Array | None = None
        if heard:
            times = Times(self.now_ns, self.now_ns, self.now_ns)
            tick = self.controller.frame(times, measured.position, measured.velocity, measured.pressure)
            self.controller.forces(self.now_ns, measured.force)
            if tick is not None:
                self.tick, sent = tick, tick.pressure_command.copy()
                self.set_point = sent
        if sent is None:
            self._in_force.take_over(self.number)
        else:
            self._in_force.take_over(self.number, sent, self._lifetime_s)

    def command(self, target_rad: Array) -> None:
        """Command every joint."""
        times = Times(0, self.now_ns, self.now_ns)
        self.controller.command(times, self.hand.joints, target_rad.tolist(), [])
