"""The simulated hand as a board sees it: set-points in, ADC counts out, one frame period at a time."""

from __future__ import annotations

import numpy as np

from hand_driver.board import Counts, Status
from hand_model.arrays import Array
from hand_model.closed_chain import ClosedChain, has_effects
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.lanes import LANES, LaneMap, idle_parameters, map_lanes
from hand_model.plant import CREEP, OMEGA, PHI, STATES, P, Plant
from hand_model.statics import equilibrium_angle
from hand_sim.channels import Channels


def resting_state(hand: Hand) -> Array:
    """State (STATES, joints) of a vented hand that has rested for long: no pressure, no creep."""
    state = np.zeros((STATES, len(hand.joints)))
    a0, a1, a2, a3 = hand.parameters[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    rest = equilibrium_angle(0.0, 0.0, hand.row("constant_load.torque_nm"), a0, a1, a2, a3, 0.0)
    state[PHI] = np.clip(rest, hand.row("end_stop.low_deg"), hand.row("end_stop.high_deg"))
    return state


class HandPlants:
    """Many hands of one build in the plant kernel, each with parameters of its own, in the hand's joint order.

    Their joints share blocks of lanes, and blocks run in parallel. Every hand moves exactly as it would alone.
    """

    def __init__(self, hand: Hand, parameters: Array, period_s: float, state: Array | None = None) -> None:
        """Begin at state (hands, STATES, joints), hand's rest by default, sampling every period_s [s].

        parameters: (hands, rows of JOINT_PARAMETERS, joints) in SI.  Raises ValueError for other shapes.
        """
        self.hands, self.joints = len(parameters), len(hand.joints)
        start = np.repeat(resting_state(hand)[None], self.hands, axis=0) if state is None else state
        _check_shape("parameters", parameters, (self.hands, len(ROW), self.joints))
        _check_shape("state", start, (self.hands, STATES, self.joints))
        offset = np.arange(self.hands)[:, None] * self.joints
        self._map: LaneMap = map_lanes(np.where(hand.partner < 0, -1, hand.partner + offset).ravel())
        par = self._map.scatter(_side_by_side(parameters), idle_parameters())
        self._plant = Plant(par, self._map.scatter(_side_by_side(start), np.zeros(STATES)), period_s)

    @property
    def state(self) -> Array:
        """State now, (hands, STATES, joints)."""
        rows = self._map.gather(self._plant.x)
        return np.ascontiguousarray(rows.reshape(STATES, self.hands, self.joints).transpose(1, 0, 2))

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (hands, joints) had been commanded for long."""
        self._plant.history[:] = self._lanes(pressure_pa[:, None])[:, :1]

    def advance(self, pressure_pa: Array) -> Array:
        """Apply set-points (hands, samples, joints) [Pa]; return states (hands, samples, STATES, joints)."""
        _check_shape("pressure_pa", pressure_pa, (self.hands, pressure_pa.shape[1], self.joints))
        out = self._plant.advance(self._lanes(pressure_pa))[self._map.block, :, :, self._map.lane]
        split = out.reshape(self.hands, self.joints, *out.shape[1:])
        return np.ascontiguousarray(split.transpose(0, 2, 3, 1))

    def _lanes(self, pressure_pa: Array) -> Array:
        lanes = np.zeros((self._map.blocks, pressure_pa.shape[1], LANES))
        lanes[self._map.block, :, self._map.lane] = pressure_pa.transpose(0, 2, 1).reshape(-1, pressure_pa.shape[1])
        return lanes


class HandPlant:
    """The joints of one hand, in the hand's own joint order: the plain kernel, or the chain where effects act."""

    def __init__(self, hand: Hand, period_s: float, state: Array | None = None) -> None:
        """Begin at state (STATES, joints), resting by default, sampling every period_s [s]."""
        self.hand = hand
        self._chain: ClosedChain | None = None
        if has_effects(hand.parameters):
            start = resting_state(hand) if state is None else state
            self._chain = ClosedChain(hand.parameters, hand.partner, start, period_s)
        else:
            self._alone = HandPlants(hand, hand.parameters[None], period_s, None if state is None else state[None])

    @property
    def state(self) -> Array:
        """State now, (STATES, joints)."""
        state: Array = self._alone.state[0] if self._chain is None else self._chain.state
        return state

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (joints,) had been commanded for long."""
        if self._chain is None:
            self._alone.hold_history(pressure_pa[None])
        else:
            self._chain.hold_history(pressure_pa)

    def advance(self, pressure_pa: Array) -> Array:
        """Apply set-points (samples, joints) [Pa]; return states (samples, STATES, joints), as sensors see them."""
        if self._chain is not None:
            return self._chain.advance(pressure_pa)
        states: Array = self._alone.advance(pressure_pa[None])[0]
        return states


class SimulatedPlant:
    """Plant and sensors: what the ADC of a board on this hand converts."""

    def __init__(self, hand: Hand, rate_hz: float, seed: int = 0, state: Array | None = None) -> None:
        """Begin at rest (or at state) with sensor noise from seed; one step is 1 / rate_hz [s]."""
        self.hand = hand
        self.plant = HandPlant(hand, 1.0 / rate_hz, state)
        self._rng = np.random.default_rng(seed)
        self._channels = Channels(hand)

    def step(self, pressure_pa: Array) -> tuple[Counts, float, Status]:
        """Hold set-points (valves,) [Pa] for one period; return counts (channels,), sensor supply [V], status."""
        state = self.plant.advance(pressure_pa[None])[0]
        supply_v = self.hand.sensors.supply_voltage_v
        starved = bool(pressure_pa.max() > self.hand.supply_pressure_pa)
        return self.convert(state, supply_v), supply_v, Status.SUPPLY_LOW if starved else Status(0)

    def convert(self, state: Array, supply_v: float) -> Counts:
        """Counts (channels,) of a state (STATES, joints) at a sensor supply [V], noise included."""
        noise_v = self._channels.noise_v * self._rng.standard_normal(self.hand.channel_count)
        return self._channels.counts(state, supply_v, noise_v)


def _side_by_side(values: Array) -> Array:
    """(hands, rows, joints) to (rows, hands * joints)."""
    return values.transpose(1, 0, 2).reshape(values.shape[1], -1)


def _check_shape(name: str, values: Array, shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise ValueError(f"{name} has the shape {values.shape}; it must be {shape}")


__all__ = ["CREEP", "OMEGA", "PHI", "STATES", "HandPlant", "HandPlants", "P", "SimulatedPlant"]
__all__ += ["resting_state"]
