"""From a frame's counts to SI units: ratiometric correction, calibration, velocity, estimated torque."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_driver.board import Counts, Frame, Status
from hand_model.arrays import Array, Flags
from hand_model.compile_cache import njit
from hand_model.description import Hand
from hand_model.sensors import fsr_force, line_angle
from hand_model.statics import torque

RAIL_MARGIN = 0.002
"""A count within this share of full scale from either end is at the rail."""
SUPPLY_SHARES = (0.8, 1.2)
"""Outside these shares of the nominal supply the sensors are outside their range and nothing is measured."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One frame in SI units; NaN where a sensor has no plausible value.

    position [rad], velocity [rad/s], effort (estimated actuator torque, Eq. 6) [N m], pressure [Pa gauge]:
    (joints,).  force [N]: (sites,).  at_rail: names of the sensors whose channel is at a rail.
    """

    position: Array
    velocity: Array
    effort: Array
    pressure: Array
    force: Array
    at_rail: tuple[str, ...] = ()


class VelocityEstimator:
    """Difference quotient through a first-order low-pass with a given time constant.

    With a time constant of 0 it is the plain difference of neighbouring samples.
    """

    def __init__(self, joints: int, time_constant_s: float) -> None:
        """Begin without a position: the first velocity is 0."""
        self._time_constant_s = time_constant_s
        self._position = np.full(joints, np.nan)
        self._velocity = np.zeros(joints)
        self._time_us = 0

    def update(self, position: Array, time_us: int) -> Array:
        """Velocity (joints,) [rad/s] at board time [us]; restarts from 0 after a joint was not measured."""
        dt = (time_us - self._time_us) * 1e-6
        _velocity(position, dt, self._time_constant_s, self._position, self._velocity)
        self._time_us = time_us
        return self._velocity.copy()


@njit(cache=True)
def _velocity(position, dt, time_constant, last, velocity):  # type: ignore[no-untyped-def]
    """Update velocity (joints,) and last position in place. dt <= 0: the clock of the board was restarted."""
    for j in range(len(position)):
        v = 0.0
        if dt > 0.0:
            v = velocity[j] + dt / (time_constant + dt) * ((position[j] - last[j]) / dt - velocity[j])
        velocity[j] = 0.0 if math.isnan(v) else v
        last[j] = position[j]


@njit(cache=True)
def _measure(counts, per_count, low, high, channel, joint, zero, k, site, joints_out, force):  # type: ignore[no-untyped-def]
    """Position, pressure and effort into joints_out (3, joints), force (sites,); returns channels at a rail.

    per_count: ratio of a count, NaN where nothing is measured.  joint: rows of Converter.  zero: (joints,)
    pressure ratios at 0 Pa.  k: (sites, 4).  site: divider [ohm] and least ratio, (2, sites).
    """
    railed = 0
    ratio = np.empty(len(counts))
    for c in range(len(counts)):
        out = counts[c] <= low[c] or counts[c] >= high[c]
        railed += out
        ratio[c] = np.nan if out else counts[c] * per_count
    n = joint.shape[1]
    for j in range(n):
        phi = line_angle(ratio[channel[j]], joint[0, j], joint[1, j])
        p = (ratio[channel[n + j]] - zero[j]) / joint[2, j]
        effort = torque(p, phi, 0.0, joint[3, j], joint[4, j], joint[5, j], joint[6, j], 0.0)
        joints_out[0, j], joints_out[1, j], joints_out[2, j] = phi, p, effort
    for i in range(len(force)):
        force[i] = fsr_force(ratio[channel[2 * n + i]], k[i], site[0, i], site[1, i])
    return railed


class Converter:
    """Converts the frames of one connection to measurements."""

    def __init__(self, hand: Hand, velocity_time_constant_s: float) -> None:
        """Convert with the calibration of this hand."""
        sensors = hand.sensors
        self._sensors = sensors
        self._velocity = VelocityEstimator(len(hand.joints), velocity_time_constant_s)
        self._volts_per_count = sensors.adc.reference_v / sensors.adc.full_scale
        self._low, self._high = rails(hand)
        self._channel = np.concatenate([sensors.angle_channel, sensors.pressure_channel, sensors.force_channel])
        line, statics = sensors.angle_line, ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
        columns = (line.ratio_at_0_deg, line.ratio_at_90_deg, sensors.pressure.ratio_per_pa)
        self._joint = np.array([*columns, *(hand.row(f"statics.{key}") for key in statics)])
        self._site = np.array([sensors.force_polynomial.divider_ohm, sensors.force_polynomial.ratio_min])
        self._names = channel_names(hand)
        self.pressure_zero_ratio = sensors.pressure.ratio_at_zero.copy()

    def convert(self, frame: Frame, faulty: Flags | None = None) -> Measurement:
        """Measure one frame. faulty (channels,): channels that are not believed and give NaN; None: none of them."""
        sensors = self._sensors
        supplied = within_supply(frame.supply_voltage_v, sensors.supply_voltage_v)
        per_count = self._volts_per_count / frame.supply_voltage_v if supplied else np.nan
        if frame.status & Status.ADC_FAULT:
            per_count = np.nan
        low = self._low if faulty is None else np.where(faulty, sensors.adc.full_scale, self._low)
        rails = (low, self._high, self._channel)
        joints, force = np.empty((3, self._joint.shape[1])), np.empty(len(sensors.sites))
        k = sensors.force_polynomial.coefficients
        railed = _measure(
            frame.counts, per_count, *rails, self._joint, self.pressure_zero_ratio, k, self._site, joints, force
        )
        position, pressure, effort = joints
        velocity = self._velocity.update(position, frame.board_time_us)
        at_rail = self._at_rail(frame.counts) if railed else ()
        return Measurement(position, velocity, effort, pressure, force, at_rail)

    def _at_rail(self, counts: Counts) -> tuple[str, ...]:
        hit = np.flatnonzero((counts <= self._low) | (counts >= self._high))
        return tuple(self._names[channel] for channel in hit.tolist())


def within_supply(supply_v: float, nominal_v: float) -> bool:
    """Whether the sensors measure at a supply [V]; NaN is not within."""
    low, high = SUPPLY_SHARES
    return low * nominal_v <= supply_v <= high * nominal_v


def channel_names(hand: Hand) -> dict[int, str]:
    """What each ADC channel measures, for people: "index_proximal angle"."""
    sensors = hand.sensors
    names = {int(c): f"{joint} angle" for joint, c in zip(hand.joints, sensors.angle_channel, strict=True)}
    names |= {int(c): f"{joint} pressure" for joint, c in zip(hand.joints, sensors.pressure_channel, strict=True)}
    names |= {int(c): f"{site} force" for site, c in zip(sensors.sites, sensors.force_channel, strict=True)}
    return dict(sorted(names.items()))


def rails(hand: Hand) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Counts (channels,) at or beyond which a channel is at its lower and upper rail."""
    full = hand.sensors.adc.full_scale
    margin = round(RAIL_MARGIN * full)
    low = np.full(hand.channel_count, margin)
    low[hand.sensors.force_channel] = -1  # no force is 0 V
    return low, np.full(hand.channel_count, full - margin)
