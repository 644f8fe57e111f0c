"""Signals from a recording of a hand: stamps become ticks, set-points follow the board's rules, forces go to joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.sensors import without_curve
from hand_recording.interpolation import bridge, longest_gap_s
from hand_recording.loader import Recording, RecordingError
from hand_recording.own_readings import OwnReadings, between_samples, readings_of_samples
from hand_recording.sample_clock import on_steady_clock
from hand_recording.settings import READING
from hand_recording.signals import Signals, on_calendar, samples_on_grid
from hand_recording.time_base import TimeBase, nearest, published_on_stamp_clock
from hand_sim.offline import Commands, set_points_in_force
from hand_sim.sample_ticks import Ticks, rebuild_ticks, usual_period


def hand_signals(recording: Recording, hand: Hand) -> Signals:
    """The signals of every joint of the hand in the recording. Raises RecordingError where it cannot be used."""
    states = recording["joint_states"]
    joints = tuple(joint for joint in hand.joints if joint in states.names)
    if not joints:
        raise RecordingError(
            f"{recording.path}: joint_states has {', '.join(states.names)}; none is a joint of {hand.path}"
        )
    stamps = np.unique(states.stamp_ns)
    if len(stamps) < 2 or (stamps[-1] - stamps[0]) * 1e-9 < READING.min_recording_s:
        span = (stamps[-1] - stamps[0]) * 1e-9 if len(stamps) else 0.0
        raise RecordingError(
            f"{recording.path}: joint_states has {len(stamps)} samples over {span:.3g} s;"
            f" {READING.min_recording_s:g} s are needed"
        )
    rate_hz = _rate_hz(stamps, hand.rate_hz)
    samples_on_grid(recording.path, stamps[0] * 1e-9, stamps[-1] * 1e-9, 1.0 / rate_hz)
    ticks = rebuild_ticks(stamps, rate_hz)
    grid = ticks.stamp_ns
    read = np.zeros(len(grid), dtype=bool)
    read[ticks.number] = True  # a sample that was lost is bridged over a short distance, but it is no reading
    sent = _commands(recording, joints)
    recording, jitter_s, scatter = on_steady_clock(recording, ticks, rate_hz)
    base = recording.on_time_base(stamps_ns=grid, joints=joints, max_gap_s=longest_gap_s(1.0 / rate_hz))
    angle, known = bridge(base.position)
    pressure_pa, late_s = _pressures(recording, base, joints)
    pressure, pressure_known = bridge(pressure_pa)
    seen_hz = 1.0 / ticks.period_s
    parts = _parts(seen_hz, hand, recording, stamps)
    between, commanded = _set_points(sent, _commanded(recording, joints), joints, _board_ticks(ticks, parts))
    notes = (*_notes(recording), *scatter, *_other_rate(rate_hz if rate_hz == hand.rate_hz else seen_hz, hand, parts))
    return Signals(
        name=recording.path.name,
        joints=joints,
        period_s=ticks.period_s,
        set_point_pa=between[::parts],
        pressure_pa=pressure,
        angle_rad=angle,
        force_n=_forces(base, hand, joints),
        known=known & (pressure_known | ~pressure_known.any(axis=0)) & read[:, None],
        has_set_point=commanded,
        has_pressure=np.asarray(pressure_known.any(axis=0)),
        notes=notes,
        dropped=1.0 - len(stamps) / len(grid),
        pressure_late_s=late_s,
        between_pa=between if parts > 1 else None,
        jitter_s=jitter_s,
        own=_own(recording, joints, ticks),
        start_s=on_calendar(float(stamps[0]) * 1e-9),
    )


def _pressures(recording: Recording, base: TimeBase, joints: tuple[str, ...]) -> tuple[Array, float]:
    """Pressures (T, J), and by how much they are later than the ticks [s].

    Where their stamps have a steady distance from those of the angles, each tick gets its nearest reading, because a
    straight line between two readings would smooth steps.
    """
    if "pressures" not in recording or len(recording["pressures"]) < 2:
        return base.pressure, 0.0
    period = float(np.median(np.diff(base.time_ns)))
    steady = READING.steady_pressure_periods * period
    pressure, late = nearest(base.time_ns, recording["pressures"], "pressure", joints, steady)
    low, middle, high = np.quantile(late, READING.delay_quantiles)
    if abs(middle) < READING.pressure_on_grid_periods * period or high - low > steady:
        return base.pressure, 0.0
    return pressure, float(middle) * 1e-9


def _own(recording: Recording, joints: tuple[str, ...], ticks: Ticks) -> OwnReadings | None:
    """The readings at their stamps, where these still scatter; pressures of other stamps have none."""
    states = recording["joint_states"]
    stamps = np.unique(states.stamp_ns)
    grid_s, time_s = ((times - stamps[0]) * 1e-9 for times in (ticks.stamp_ns, stamps))
    if not between_samples(grid_s, time_s):
        return None
    own = recording.on_time_base(stamps_ns=stamps, joints=joints, max_gap_s=longest_gap_s(ticks.period_s))
    pressure = own.pressure.copy()
    if "pressures" in recording:
        pressure[~np.isin(stamps, recording["pressures"].stamp_ns)] = np.nan
    return readings_of_samples(grid_s, time_s, pressure, own.position, ticks.number)


def _rate_hz(stamps: NDArray[np.int64], nominal_hz: float) -> float:
    """The nominal rate, unless the stamps clearly have another one."""
    seen = 1e9 / usual_period((stamps - stamps[0]).astype(float))
    low, high = READING.nominal_rate_range
    return nominal_hz if low < seen / nominal_hz < high else seen


def _parts(rate_hz: float, hand: Hand, recording: Recording, stamps: NDArray[np.int64]) -> int:
    """Number of ticks of the board in a sample of joint_states, of which a recorder may keep only some.

    Commands that come clearly faster than the samples show that the board is faster. Its rate is the described one, or
    that of the commands where they are faster still. Where it is no multiple of the rate of the samples, the time of
    its ticks is unknown, and a set-point acts in the next READING.part_s.
    """
    if "valve_command" not in recording or len(recording["valve_command"]) < 2:
        return 1
    sent = np.unique(recording["valve_command"].stamp_ns)
    sent_hz = (len(sent) - 1) * 1e9 / max(float(sent[-1] - sent[0]), 1.0)
    if sent_hz < READING.faster_rate * len(stamps) * 1e9 / float(stamps[-1] - stamps[0]):
        return 1
    board_hz = sent_hz if sent_hz > READING.faster_rate * hand.rate_hz else hand.rate_hz
    parts = max(round(board_hz / rate_hz), 1)
    if abs(board_hz / rate_hz - parts) < READING.multiple_tolerance * parts:
        return parts
    return max(math.ceil(1.0 / rate_hz / READING.part_s), 1)


def _board_ticks(ticks: Ticks, parts: int) -> Ticks:
    """Ticks of a board that is faster than the samples."""
    return replace(ticks, number=ticks.number * parts, period_s=ticks.period_s / parts)


def _commanded(recording: Recording, joints: tuple[str, ...]) -> list[str]:
    """Those of the joints that valve_command names."""
    return [joint for joint in joints if "valve_command" in recording and joint in recording["valve_command"].names]


def _commands(recording: Recording, joints: tuple[str, ...]) -> Commands | None:
    """Set-points as sent (M, commanded joints); None where none were recorded."""
    if "valve_command" not in recording or not len(recording["valve_command"]):
        return None
    data = recording["valve_command"]
    columns = [data.names.index(joint) for joint in joints if joint in data.names]
    pressure = data["pressure"][:, columns]
    sent_ns = published_on_stamp_clock(recording.topics)
    usable = np.isfinite(pressure).all(axis=1) & (data["lifetime_ns"] > 0)
    order = np.argsort(sent_ns[usable], kind="stable")
    return Commands(sent_ns[usable][order], pressure[usable][order], data["lifetime_ns"][usable][order] * 1e-9)


def _set_points(
    commands: Commands | None, names: Sequence[str], joints: tuple[str, ...], ticks: Ticks
) -> tuple[Array, Flags]:
    """Set-points in force at each tick (T, J), and which joints were commanded. names: of the commanded joints."""
    held = np.zeros((len(ticks.stamp_ns), len(joints)))
    present = np.array([joint in names for joint in joints], dtype=bool)
    if commands is not None:
        held[:, present] = set_points_in_force(commands, ticks)
    return held, present


def _forces(base: TimeBase, hand: Hand, joints: tuple[str, ...]) -> Array:
    """Forces (T, J) [N] of the sensor site on each joint; NaN where there is none."""
    forces = np.full((len(base.time_ns), len(joints)), np.nan)
    for column, site in enumerate(base.sites):
        if site in hand.sensors.sites:
            joint = int(hand.sensors.site_joint[hand.sensors.sites.index(site)])
            if joint >= 0 and hand.joints[joint] in joints:
                forces[:, joints.index(hand.joints[joint])] = base.force[:, column]
    return forces


def _notes(recording: Recording) -> tuple[str, ...]:
    notes = []
    for topic in ("pressures", "valve_command"):
        if topic not in recording or not len(recording[topic]):
            notes.append(f"no {topic}: the stages that need them are not evaluated")
    return (*notes, *_clocks(recording), *_late(recording))


def _late(recording: Recording) -> list[str]:
    """Set-points that were sent long after the frames that they answer."""
    if "valve_command" not in recording or not len(recording["valve_command"]):
        return []
    late_s = (published_on_stamp_clock(recording.topics) - recording["valve_command"].stamp_ns) * 1e-9
    usual, worst = np.quantile(late_s, [0.5, READING.late_quantile])
    if worst <= READING.late_commands_s:
        return []
    return [
        f"valve_command: sent {usual * 1e3:.3g} ms after the stamps, {100.0 * (1.0 - READING.late_quantile):.0f} % of"
        f" them later than {worst * 1e3:.3g} ms;"
        " the controller's host was too busy, and findings about timing are uncertain"
    ]


def _other_rate(rate_hz: float, hand: Hand, parts: int) -> list[str]:
    """A hint that the recording was made with another description than the one in use, or kept some frames only."""
    if rate_hz == hand.rate_hz:
        return []
    if parts > 1:
        return [
            f"joint_states comes at {rate_hz:.3g} Hz, and board.rate_hz of {hand.path} is {hand.rate_hz:g};"
            " valve_command is faster, so the recorder kept some frames only;"
            f" set-points keep their times, in {parts} parts of a sample"
        ]
    return [
        f"joint_states comes at {rate_hz:.3g} Hz, and board.rate_hz of {hand.path} is {hand.rate_hz:g};"
        " was the recording made with another description?"
    ]


def _clocks(recording: Recording) -> list[str]:
    """Topics stamped by another clock than joint_states, seen by the delay to their receipt by the one recorder."""
    delays = {}
    for topic in ("joint_states", "pressures", "contact_forces", "valve_command"):
        if topic in recording and len(recording[topic]):
            behind = (recording[topic].log_ns - recording[topic].stamp_ns).astype(np.float64)
            low, middle, high = np.quantile(behind, READING.clock_quartiles)
            if abs(middle) < READING.foreign_clock_ns:  # else stamps and receipt times have different clocks
                delays[topic] = middle, high - low
    common, scatter = delays.pop("joint_states", (0.0, np.inf))
    return [
        f"{topic}: stamped {abs(own - common) * 1e-6:.3g} ms {'behind' if own > common else 'ahead of'} joint_states,"
        " by when they were received; clocks differ?"
        for topic, (own, spread) in delays.items()
        if abs(own - common) > READING.clock_offset_ns + spread + scatter
    ]


def without_sensor_curve(signals: Signals, hand: Hand) -> Signals:
    """The same signals with the true angles: the error of the sensor's calibration line (Eq. 1, 3) is inverted."""
    columns = [hand.joints.index(joint) for joint in signals.joints]

    def true(angle_rad: Array) -> Array:
        read = np.zeros((len(angle_rad), len(hand.joints)))
        read[:, columns] = angle_rad
        return without_curve(hand.sensors.hall, hand.sensors.angle_line, read)[:, columns]

    own = None if signals.own is None else replace(signals.own, angle_rad=true(signals.own.angle_rad))
    return replace(signals, angle_rad=true(signals.angle_rad), own=own)
