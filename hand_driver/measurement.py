"""From a frame's counts to SI units: ratiometric correction, calibration, velocity, estimated torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_driver.board import Counts, Frame, Status
from hand_model.description import Hand
from hand_model.statics import torque

Array = NDArray[np.float64]

RAIL_MARGIN = 0.002
"""A count within this share of full scale from either end sits at the rail."""
SUPPLY_SHARE = 0.8
"""Below this share of the nominal sensor supply nothing is measured: the sensors are out of their range."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One frame in SI units; NaN where a sensor gives no plausible value.

    position [rad], velocity [rad/s], effort (estimated actuator torque, Eq. 6) [N m], pressure [Pa gauge]:
    (joints,).  force [N]: (sites,).
    """

    position: Array
    velocity: Array
    effort: Array
    pressure: Array
    force: Array


class VelocityEstimator:
    """Difference quotient through a first-order low-pass whose lag its user sets.

    With a time constant of 0 it is the plain difference of neighbouring samples.
    """

    def __init__(self, joints: int, time_constant_s: float) -> None:
        """Start without a past: the first velocity is 0."""
        self._time_constant_s = time_constant_s
        self._position = np.full(joints, np.nan)
        self._velocity = np.zeros(joints)
        self._time_us = 0

    def update(self, position: Array, time_us: int) -> Array:
        """Velocity (joints,) [rad/s] at board time [us]; restarts from 0 after a joint was not measured."""
        dt = (time_us - self._time_us) * 1e-6
        if dt > 0.0:
            gain = dt / (self._time_constant_s + dt)
            velocity = self._velocity + gain * ((position - self._position) / dt - self._velocity)
            self._velocity = np.where(np.isnan(velocity), 0.0, velocity)
        else:  # the board's clock went back: it restarted
            self._velocity = np.zeros_like(self._velocity)
        self._position, self._time_us = position, time_us
        return self._velocity.copy()


class Converter:
    """Turns the frames of one connection into measurements."""

    def __init__(self, hand: Hand, velocity_time_constant_s: float) -> None:
        """Convert with the calibration of this hand."""
        self._hand = hand
        self._velocity = VelocityEstimator(len(hand.joints), velocity_time_constant_s)
        self._volts_per_count = hand.sensors.adc.reference_v / hand.sensors.adc.full_scale
        self._low, self._high = _rails(hand)
        self._names = channel_names(hand)
        statics = ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
        self._statics = [hand.row(f"statics.{key}") for key in statics]
        self.pressure_zero_ratio = hand.sensors.pressure.ratio_at_zero.copy()

    def convert(self, frame: Frame) -> Measurement:
        """Measure one frame."""
        sensors = self._hand.sensors
        ratio = frame.counts.astype(np.float64) * (self._volts_per_count / max(frame.supply_voltage_v, 1e-3))
        ratio[(frame.counts <= self._low) | (frame.counts >= self._high)] = np.nan
        if frame.supply_voltage_v < SUPPLY_SHARE * sensors.supply_voltage_v or Status.ADC_FAULT in frame.status:
            ratio[:] = np.nan
        position = sensors.angle_line.angle_rad(ratio[sensors.angle_channel])
        pressure = (ratio[sensors.pressure_channel] - self.pressure_zero_ratio) / sensors.pressure.ratio_per_pa
        # An open film reads 0 V, which is a value and no rail; a film at the upper rail is none.
        force = sensors.force_polynomial.force_n(ratio[sensors.force_channel])
        effort = torque(pressure, position, 0.0, *self._statics, 0.0)
        return Measurement(position, self._velocity.update(position, frame.board_time_us), effort, pressure, force)

    def at_rail(self, counts: Counts) -> list[str]:
        """Names of the sensors whose channel sits at a rail."""
        hit = np.flatnonzero((counts <= self._low) | (counts >= self._high))
        return [self._names[channel] for channel in hit.tolist()]


def channel_names(hand: Hand) -> dict[int, str]:
    """What each ADC channel measures, for people: "index_proximal angle"."""
    sensors = hand.sensors
    names = {int(c): f"{joint} angle" for joint, c in zip(hand.joints, sensors.angle_channel, strict=True)}
    names |= {int(c): f"{joint} pressure" for joint, c in zip(hand.joints, sensors.pressure_channel, strict=True)}
    names |= {int(c): f"{site} force" for site, c in zip(sensors.sites, sensors.force_channel, strict=True)}
    return dict(sorted(names.items()))


def _rails(hand: Hand) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Counts (channels,) at or beyond which a channel is at its lower and upper rail."""
    full = hand.sensors.adc.full_scale
    margin = round(RAIL_MARGIN * full)
    low = np.full(hand.channel_count, margin)
    low[hand.sensors.force_channel] = -1  # no force is 0 V
    return low, np.full(hand.channel_count, full - margin)
