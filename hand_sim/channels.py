"""What the ADC of a board on the simulated hand converts: the state through every sensor, compiled."""

from __future__ import annotations

import numpy as np

from hand_driver.board import Counts
from hand_model.arrays import Array
from hand_model.compile_cache import njit, without_arrays
from hand_model.description import Hand
from hand_model.kernel.inline import inline_exact
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_model.kernel.terms import one_sided
from hand_model.sensors import adc_code, fsr_ratio, hall_ratio


@inline_exact
def _contact_force(state, j, contact, lever_arm):  # type: ignore[no-untyped-def]
    """Normal force [N] on a pad of joint j: the obstacle's torque over the pad's lever arm."""
    depth = state[PHI, j] - contact[0, j]
    return one_sided(depth, state[OMEGA, j], contact[1, j], contact[2, j], contact[3, j]) / lever_arm


@njit(cache=True)
def _contact_forces(states, contact, site_joint, lever_arm, out):  # type: ignore[no-untyped-def]
    for n in range(states.shape[0]):
        for i in range(len(site_joint)):
            j = site_joint[i]
            out[n, i] = 0.0 if j < 0 else _contact_force(states[n], j, contact, lever_arm[i])


@without_arrays
def _counts(state, supply, noise, joint, contact, site, site_joint, channel, reference, full_scale, out):  # type: ignore[no-untyped-def]
    """Codes of every channel; rows of joint and site as in Channels."""
    joints, sites = state.shape[1], len(site_joint)
    for j in range(joints):
        hall = hall_ratio(state[PHI, j], joint[0, j], joint[1, j], joint[2, j], joint[3, j])
        pressure = joint[4, j] + joint[5, j] * state[P, j]
        for ratio, c in ((hall, channel[j]), (pressure, channel[joints + j])):
            out[c] = adc_code(ratio * supply + noise[c], reference, full_scale)
    for i in range(sites):
        j, c = site_joint[i], channel[2 * joints + i]
        force = 0.0 if j < 0 else _contact_force(state, j, contact, site[4, i])
        ratio = fsr_ratio(force, site[0, i], site[1, i], site[2, i], site[3, i])
        out[c] = adc_code(ratio * supply + noise[c], reference, full_scale)


class Channels:
    """Every ADC channel of one hand, as functions of its state."""

    def __init__(self, hand: Hand) -> None:
        """Gather the characteristics of this hand's sensors."""
        sensors = hand.sensors
        hall, pressure, force = sensors.hall, sensors.pressure, sensors.force
        columns = (hall.field_t, hall.field_max_t, hall.zero_rad, hall.third_harmonic)
        self._joint = np.array([*columns, pressure.ratio_at_zero, pressure.ratio_per_pa])
        self._contact = contact_rows(hand)
        self._site = np.array([force.c0, force.c1, force.divider_ohm, force.threshold_n, sensors.lever_arm_m])
        self._channel = np.concatenate([sensors.angle_channel, sensors.pressure_channel, sensors.force_channel])
        self._site_joint, self._adc = sensors.site_joint, sensors.adc
        self.noise_v = np.empty(sensors.channel_count)
        self.noise_v[self._channel] = np.concatenate([hall.noise_v, pressure.noise_v, force.noise_v])

    def counts(self, state: Array, supply_v: float, noise_v: Array) -> Counts:
        """Counts (channels,) of a state (STATES, joints) at a sensor supply [V] with noise (channels,) [V] added."""
        out = np.empty(len(noise_v), np.uint16)
        constants = (self._joint, self._contact, self._site, self._site_joint, self._channel)
        _counts(state, supply_v, noise_v, *constants, self._adc.reference_v, self._adc.full_scale, out)
        return out


def contact_rows(hand: Hand) -> Array:
    """The obstacles' angle, stiffness, damping and engagement, (4, joints), SI."""
    keys = ("angle_deg", "stiffness_nm_per_rad", "damping_nm_s_per_rad", "engagement_deg")
    return np.array([hand.row(f"contact.{key}") for key in keys])


def contact_force_n(hand: Hand, state: Array) -> Array:
    """Normal force [N] (T, sites) on the pads from states (T, STATES, joints), or of one state; 0 off joints."""
    states = np.ascontiguousarray(state).reshape(-1, *state.shape[-2:])
    force = np.empty((len(states), len(hand.sensors.sites)))
    _contact_forces(states, contact_rows(hand), hand.sensors.site_joint, hand.sensors.lever_arm_m, force)
    return force.reshape(*state.shape[:-2], -1)
