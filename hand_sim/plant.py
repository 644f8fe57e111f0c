"""The simulated hand as a board sees it: set-points in, ADC counts out, one frame period at a time."""

from __future__ import annotations

import numpy as np

from hand_driver.board import Counts, Status
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P, resting_states
from hand_model.kernel.rows import ROW, STATES
from hand_sim.channels import Channels


def resting_state(hand: Hand) -> Array:
    """State (STATES, joints), SI, of a vented hand that has rested for long: no pressure, no creep."""
    return resting_states(hand.parameters)


class HandPlants:
    """Many hands of one build in the closed loop, each with parameters of its own, in the hand's joint order.

    Blocks of joints run in parallel. Every hand moves exactly as it would alone.
    """

    def __init__(self, hand: Hand, parameters: Array, period_s: float, state: Array | None = None) -> None:
        """Begin at state (hands, STATES, joints), by default at rest, sampling every period_s [s].

        parameters: (hands, rows of JOINT_PARAMETERS, joints) in SI.  Raises ValueError for other shapes.
        """
        hands, joints = len(parameters), len(hand.joints)
        start = np.repeat(resting_state(hand)[None], hands, axis=0) if state is None else state
        _check_shape("parameters", parameters, (hands, len(ROW), joints))
        _check_shape("state", start, (hands, STATES, joints))
        self._loop = ClosedLoop(parameters, hand.partner, start, period_s)

    @property
    def state(self) -> Array:
        """State now, (hands, STATES, joints), SI."""
        return self._loop.state

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (hands, joints) had been commanded for long."""
        self._loop.hold_history(pressure_pa)

    def advance(self, pressure_pa: Array) -> Array:
        """Apply set-points (hands, samples, joints) [Pa]; return readings (hands, samples, STATES, joints)."""
        return self._loop.advance(pressure_pa)

    def change(self, key: str, values: Array) -> None:
        """Give a parameter of an effect that acts already, or of the plain plant, other values (hands, joints), SI."""
        self._loop.change(key, values)


class HandPlant:
    """The joints of one hand, in the hand's own joint order."""

    def __init__(self, hand: Hand, period_s: float, state: Array | None = None) -> None:
        """Begin at state (STATES, joints), by default at rest, sampling every period_s [s]."""
        self._plants = HandPlants(hand, hand.parameters[None], period_s, None if state is None else state[None])

    @property
    def state(self) -> Array:
        """True state now, (STATES, joints), SI."""
        state: Array = self._plants.state[0]
        return state

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (joints,) had been commanded for long."""
        self._plants.hold_history(pressure_pa[None])

    def advance(self, pressure_pa: Array) -> Array:
        """Apply set-points (samples, joints) [Pa]; return states as the sensors read them (samples, STATES, joints)."""
        readings: Array = self._plants.advance(pressure_pa[None])[0]
        return readings

    def change(self, key: str, values: Array) -> None:
        """Give a parameter of an effect that acts already, or of the plain plant, other values (joints,), SI."""
        self._plants.change(key, values[None])


class SimulatedPlant:
    """Plant and sensors: what the ADC of a board on this hand converts."""

    def __init__(self, hand: Hand, rate_hz: float, seed: int = 0, state: Array | None = None) -> None:
        """Begin at rest (or at state) with sensor noise from seed; one step is 1 / rate_hz [s]."""
        self.hand = hand
        self.plant = HandPlant(hand, 1.0 / rate_hz, state)
        self._rng = np.random.default_rng(seed)
        self._channels = Channels(hand)

    def scale_noise(self, factor: float) -> None:
        """Multiply the noise of every channel by a factor [-]."""
        self._channels.noise_v = factor * self._channels.noise_v

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


def _check_shape(name: str, values: Array, shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise ValueError(f"{name} has the shape {values.shape}; it must be {shape}")


__all__ = ["CREEP", "OMEGA", "PHI", "STATES", "HandPlant", "HandPlants", "P", "SimulatedPlant"]
__all__ += ["resting_state"]
