"""The simulated hand as a board sees it: set-points in, ADC counts out, one frame period at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hand_driver.board import Counts, Status
from hand_model.description import Hand
from hand_model.joint import one_sided
from hand_model.lanes import LaneMap, idle_parameters, map_lanes
from hand_model.parameters import ROW
from hand_model.plant import CREEP, LANES, OMEGA, PHI, STATES, P, Plant
from hand_model.statics import equilibrium_angle

Array = NDArray[np.float64]


def resting_state(hand: Hand) -> Array:
    """State (STATES, joints) of a vented hand that has rested for long: no pressure, no creep."""
    state = np.zeros((STATES, len(hand.joints)))
    a0, a1, a2, a3 = hand.parameters[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    rest = equilibrium_angle(0.0, 0.0, hand.row("constant_load.torque_nm"), a0, a1, a2, a3, 0.0)
    state[PHI] = np.clip(rest, hand.row("end_stop.low_deg"), hand.row("end_stop.high_deg"))
    return state


class HandPlant:
    """The joints of one hand in the plant kernel, in the hand's own joint order."""

    def __init__(self, hand: Hand, period_s: float, state: Array | None = None) -> None:
        """Begin at state (STATES, joints), resting by default, sampling every period_s [s]."""
        self.hand = hand
        self._map: LaneMap = map_lanes(hand.partner)
        par = self._map.scatter(hand.parameters, idle_parameters())
        start = resting_state(hand) if state is None else state
        self._plant = Plant(par, self._map.scatter(start, np.zeros(STATES)), period_s)

    @property
    def state(self) -> Array:
        """State now, (STATES, joints)."""
        return self._map.gather(self._plant.x)

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (joints,) had been commanded for long."""
        self._plant.history[:] = self._lanes(pressure_pa[None])[:, :1]

    def advance(self, pressure_pa: Array) -> Array:
        """Apply set-points (samples, joints) [Pa]; return states (samples, STATES, joints)."""
        out = self._plant.advance(self._lanes(pressure_pa))
        return np.ascontiguousarray(out[self._map.block, :, :, self._map.lane].transpose(1, 2, 0))

    def _lanes(self, pressure_pa: Array) -> Array:
        lanes = np.zeros((self._map.blocks, len(pressure_pa), LANES))
        lanes[self._map.block, :, self._map.lane] = pressure_pa.T
        return lanes


def contact_force_n(hand: Hand, state: Array) -> Array:
    """Normal force [N] (..., sites) on the pads from states (..., STATES, joints).

    The obstacle's torque over the pad's lever arm; sites on no joint feel nothing.
    """
    torque = np.vectorize(one_sided.py_func)(
        state[..., PHI, :] - hand.row("contact.angle_deg"),
        state[..., OMEGA, :],
        hand.row("contact.stiffness_nm_per_rad"),
        hand.row("contact.damping_nm_s_per_rad"),
        hand.row("contact.engagement_deg"),
    )
    sensors = hand.sensors
    pressed = sensors.site_joint >= 0
    force = np.zeros((*torque.shape[:-1], len(sensors.sites)))
    force[..., pressed] = torque[..., sensors.site_joint[pressed]] / sensors.lever_arm_m[pressed]
    return force


class SimulatedPlant:
    """Plant and sensors: what the ADC of a board on this hand converts."""

    def __init__(self, hand: Hand, rate_hz: float, seed: int = 0, state: Array | None = None) -> None:
        """Begin at rest (or at state) with sensor noise from seed; one step is 1 / rate_hz [s]."""
        self.hand = hand
        self.plant = HandPlant(hand, 1.0 / rate_hz, state)
        self._rng = np.random.default_rng(seed)

    def step(self, pressure_pa: Array) -> tuple[Counts, float, Status]:
        """Hold set-points (valves,) [Pa] for one period; return counts (channels,), sensor supply [V], status."""
        state = self.plant.advance(pressure_pa[None])[0]
        supply_v = self.hand.sensors.supply_voltage_v
        starved = bool(np.any(pressure_pa > self.hand.supply_pressure_pa))
        return self.convert(state, supply_v), supply_v, Status.SUPPLY_LOW if starved else Status(0)

    def convert(self, state: Array, supply_v: float) -> Counts:
        """Counts (channels,) of a state (STATES, joints) at a sensor supply [V], noise included."""
        sensors = self.hand.sensors
        ratio = np.empty(sensors.channel_count)
        noise = np.empty(sensors.channel_count)
        ratio[sensors.angle_channel] = sensors.hall.ratio(state[PHI])
        noise[sensors.angle_channel] = sensors.hall.noise_v
        ratio[sensors.pressure_channel] = sensors.pressure.ratio(state[P])
        noise[sensors.pressure_channel] = sensors.pressure.noise_v
        ratio[sensors.force_channel] = sensors.force.ratio(contact_force_n(self.hand, state))
        noise[sensors.force_channel] = sensors.force.noise_v
        volts = ratio * supply_v + noise * self._rng.standard_normal(sensors.channel_count)
        return sensors.adc.counts(volts)


__all__ = ["CREEP", "OMEGA", "PHI", "HandPlant", "P", "SimulatedPlant", "contact_force_n", "resting_state"]
