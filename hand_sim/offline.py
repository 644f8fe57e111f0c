"""The offline plant: a recording's set-points through the very kernel and board rules of the live simulation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hand_driver.board import lifetime_ticks
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.sensors import without_curve
from hand_model.statics import torque
from hand_sim.plant import CREEP, OMEGA, PHI, STATES, HandPlant, HandPlants, P, resting_state
from hand_sim.sample_ticks import Stamps, Ticks, rebuild_ticks

REST_S = 0.25
"""The beginning of a recording over which its initial state is averaged."""
REST_SPEED_RAD_S = 0.05
"""A joint faster than this at the beginning is not at rest: its first sample counts alone."""
CREEP_FIT_S = 2.0
"""The beginning of a recording from whose motion the initial creep is refined."""
CREEP_TRIAL = 0.02
"""Change of the creeping ratio by which its effect is found."""
CREEP_GAIN_RAD = 0.2
"""A joint whose angle answers the creeping ratio by less (RMS, rad for a ratio of 1) has no information on it."""
VENTED_PA = 200.0
"""Mean pressures below this are those of a vented hand: sensor noise and offset."""


@dataclass(frozen=True, slots=True)
class Commands:
    """Set-points as sent: sent_ns (M,) ascending [ns], pressure_pa (M, joints), lifetime_s (M,)."""

    sent_ns: Stamps
    pressure_pa: Array
    lifetime_s: Array


@dataclass(frozen=True, slots=True)
class Measured:
    """What was recorded: stamp_ns (N,) ascending; position_rad, velocity_rad_s and pressure_pa (N, joints)."""

    stamp_ns: Stamps
    position_rad: Array
    velocity_rad_s: Array
    pressure_pa: Array

    def since(self, index: int) -> Measured:
        """The part from a frame on."""
        return Measured(
            self.stamp_ns[index:], self.position_rad[index:], self.velocity_rad_s[index:], self.pressure_pa[index:]
        )


def set_points_in_force(commands: Commands, ticks: Ticks) -> Array:
    """Set-points (ticks, joints) [Pa] that the board holds from each tick to the next.

    The rules are those of `hand_driver.board.SetPointsInForce`: a tick takes over the set-points sent before it, and
    vents those that have outlived their lifetime. Before the first command the valves are vented.
    """
    stamps = ticks.stamp_ns
    if not len(commands.sent_ns):
        return np.zeros((len(stamps), commands.pressure_pa.shape[1]))
    newest = np.searchsorted(commands.sent_ns, stamps, side="right") - 1
    held = np.zeros((len(stamps), commands.pressure_pa.shape[1]))
    given = newest >= 0
    latched_at = np.searchsorted(stamps, commands.sent_ns, side="left")
    age = np.arange(len(stamps)) - latched_at[np.maximum(newest, 0)]
    alive = given & (age < lifetime_ticks(commands.lifetime_s[np.maximum(newest, 0)], ticks.period_s))
    held[alive] = commands.pressure_pa[newest[alive]]
    return held


def initial_state(hand: Hand, measured: Measured) -> Array:
    """State (STATES, joints), SI, at the first frame, from what was measured around it.

    Angles are taken back through the calibration to the angle that the sensor measured. The creeping ratio is the one
    that balances Eq. 11 at that angle, speed and pressure; joints close to an end stop or not measured count as rested.
    """
    start = (measured.stamp_ns - measured.stamp_ns[0]) * 1e-9 <= REST_S
    position, pressure = _average(measured.position_rad[start]), _average(measured.pressure_pa[start])
    moving = np.abs(np.ptp(measured.position_rad[start], axis=0)) > REST_SPEED_RAD_S * REST_S
    position[moving], pressure[moving] = measured.position_rad[0, moving], measured.pressure_pa[0, moving]
    state = resting_state(hand)
    known = np.isfinite(position) & np.isfinite(pressure)
    state[PHI, known] = true_angle(hand, position)[known]
    speed = measured.velocity_rad_s[0]
    state[OMEGA] = np.where(known & moving & np.isfinite(speed), speed, 0.0)
    state[P, known] = np.clip(pressure, 0.0, hand.supply_pressure_pa)[known]
    engaged = hand.row("end_stop.engagement_deg")  # a stop that is as close may carry any part of the load
    low, high = hand.row("end_stop.low_deg") + engaged, hand.row("end_stop.high_deg") - engaged
    free = known & (state[PHI] > low) & (state[PHI] < high)
    state[CREEP] = np.where(free, _balancing_creep(hand, state), 0.0)
    return state


def true_angle(hand: Hand, measured_rad: Array) -> Array:
    """Angle [rad] (joints,) at which the Hall sensor gives what the calibration line read as measured_rad."""
    true: Array = without_curve(hand.sensors.hall, hand.sensors.angle_line, measured_rad[None])[0]
    return true


def replay(hand: Hand, measured: Measured, commands: Commands) -> tuple[Ticks, Array]:
    """States (N, STATES, joints) of the plant at each recorded frame, driven by the recorded commands.

    Where the hand was under pressure before the first recorded command, or this is not to vent, others came before it:
    the replay then begins at that command, and so do the ticks.
    """
    measured = measured.since(_first_known(measured, commands))
    ticks = rebuild_ticks(measured.stamp_ns, hand.rate_hz)
    held = set_points_in_force(commands, ticks)
    state = initial_state(hand, measured)
    for _ in range(2):  # the answer to creep is not quite linear
        state[CREEP] = _refined_creep(hand, measured, ticks, held, state)
    plant = HandPlant(hand, ticks.period_s, state)
    plant.hold_history(held[0])
    states = np.empty((len(held), STATES, len(hand.joints)))
    states[0] = plant.state
    states[1:] = plant.advance(held[:-1])
    return ticks, states[ticks.number]


def _refined_creep(hand: Hand, measured: Measured, ticks: Ticks, held: Array, state: Array) -> Array:
    """Initial creeping ratio (joints,) that brings the replay of the first seconds closest to what was measured.

    One Gauss-Newton step from state: creep decays within minutes, so an error of the static balance, which a
    moving or noisy beginning spoils, would stay for the whole replay.
    """
    count = int(np.searchsorted(ticks.number * ticks.period_s, CREEP_FIT_S))
    trial = state.copy()
    trial[CREEP] += np.where(state[CREEP] < 0.5, CREEP_TRIAL, -CREEP_TRIAL)
    both = HandPlants(hand, np.repeat(hand.parameters[None], 2, axis=0), ticks.period_s, np.array([state, trial]))
    both.hold_history(np.repeat(held[:1], 2, axis=0))
    last = int(ticks.number[count - 1])
    states = np.concatenate([np.array([state, trial])[:, None], both.advance(np.array([held[:last]] * 2))], axis=1)
    sensors = hand.sensors
    seen = sensors.angle_line.angle_rad(sensors.hall.ratio(states[:, ticks.number[:count], PHI]))
    gain = (seen[1] - seen[0]) / (trial[CREEP] - state[CREEP])
    error = measured.position_rad[:count] - seen[0]
    error[: int(np.searchsorted(ticks.number * ticks.period_s, REST_S))] = (
        np.nan
    )  # before the angle's own start is gone
    known = np.isfinite(error)
    power = np.where(known, gain * gain, 0.0).sum(axis=0)
    step = np.where(known, gain * error, 0.0).sum(axis=0) / np.maximum(power, 1e-12)
    clear = power > CREEP_GAIN_RAD**2 * np.maximum(known.sum(axis=0), 1)
    refined: Array = np.where(clear, np.clip(state[CREEP] + step, 0.0, 1.0), state[CREEP])
    return refined


def _first_known(measured: Measured, commands: Commands) -> int:
    """Index of the first frame at which the set-points in force are known."""
    if not len(commands.sent_ns):
        return 0
    first = min(int(np.searchsorted(measured.stamp_ns, commands.sent_ns[0])), len(measured.stamp_ns) - 2)
    before = measured.stamp_ns[first] - measured.stamp_ns[: first + 1] <= REST_S * 1e9
    mean = _average(measured.pressure_pa[: first + 1][before])
    late = (commands.sent_ns[0] - measured.stamp_ns[0]) * 1e-9 > REST_S
    missed = late and commands.pressure_pa[0].max() > 0.0  # a controller begins with 0
    return first if missed or np.nanmax(mean, initial=0.0) > VENTED_PA else 0


def without_noise(hand: Hand) -> Hand:
    """The same hand with sensors that do not scatter; quantisation stays."""
    sensors = hand.sensors
    quiet = replace(
        sensors,
        hall=replace(sensors.hall, noise_v=np.zeros_like(sensors.hall.noise_v)),
        pressure=replace(sensors.pressure, noise_v=np.zeros_like(sensors.pressure.noise_v)),
        force=replace(sensors.force, noise_v=np.zeros_like(sensors.force.noise_v)),
    )
    return replace(hand, sensors=quiet)


def _average(samples: Array) -> Array:
    """Mean of (N, joints) over finite samples; NaN where there is none."""
    finite = np.isfinite(samples)
    count = finite.sum(axis=0)
    total = np.where(finite, samples, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _balancing_creep(hand: Hand, state: Array) -> Array:
    """Creeping ratio (joints,) at which Eq. 11 balances load and friction of a state; 0 where nothing creeps."""
    a0, a1, a2, a3 = hand.parameters[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    load = hand.row("constant_load.torque_nm") + hand.row("dynamics.viscous_friction_nm_s_per_rad") * state[OMEGA]
    free_torque = torque(state[P], state[PHI], 0.0, a0, a1, a2, a3, 0.0) - load
    reach = a1 * hand.row("material.phi_max_deg")
    creep: Array = np.clip(np.divide(free_torque, reach, out=np.zeros_like(reach), where=reach != 0.0), 0.0, 1.0)
    return creep
