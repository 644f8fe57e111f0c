"""Recordings of either kind as signals: rosbag2, or CSV, Parquet and NPZ through a mapping file (docs/machines.md).

A mapping names, per joint, the columns of a table with their units and signs:

    time: {column: t_ms, unit: ms}
    joints:
      index_proximal:
        set_point: {column: u_bar, unit: bar}
        pressure: {column: p_bar, unit: bar}
        angle: {column: phi_deg, unit: deg, sign: -1}
        force: {column: f_n, unit: n}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.yaml_reader import Section, read_yaml
from hand_recording.hand_signals import hand_signals
from hand_recording.interpolation import bridge, interpolate, longest_gap_s
from hand_recording.loader import load_recording
from hand_recording.own_readings import between_samples, readings_of_samples
from hand_recording.recording_files import RecordingError
from hand_recording.sample_clock import has_reading, steady_times
from hand_recording.settings import READING
from hand_recording.signals import Signals, on_calendar, samples_on_grid
from hand_recording.table_commands import set_points_between
from hand_recording.table_file import TABLES, UNITS, read_table
from hand_sim.sample_ticks import usual_period

PERIOD_S = (1e-6, 1.0)
"""Least and largest median distance of the samples of a table; no motion of a machine is seen at a lower rate."""
LATEST_S = 1e12
"""Largest time of a table: beyond any epoch, and small enough for differences of a microsecond."""
COLUMN = ("column", "unit", "sign")
TOO_FEW_ROWS = (
    "its pressure changes before the set-points of the rows do, because these stepped between the rows; record every"
    " set-point, as a rosbag2 does, or more rows a second"
)
QUANTITIES = {"set_point": "pa", "pressure": "pa", "angle": "deg", "force": "n"}


def read_signals(paths: Sequence[Path], hand: Hand, mapping: Path | None) -> list[Signals]:
    """Every recording. Raises RecordingError or DescriptionError, one line, for what cannot be used."""
    signals = []
    for path in paths:
        if path.suffix in TABLES:
            if mapping is None:
                raise RecordingError(f"{path} is a table; name its columns in a file and give it with --map")
            signals.append(_table(path, hand, mapping))
        else:
            signals.append(hand_signals(load_recording(path), hand))
    return signals


def _table(path: Path, hand: Hand, mapping: Path) -> Signals:
    top = read_yaml(mapping, ("time", "joints"))
    columns = read_table(path).numbers
    time_s = _column(top.section("time", ("column", "unit")), path, columns, "s", signed=False)
    kept, grid = uniform_clock(path, time_s)
    time_s = time_s[kept]
    joints = _joints(top, hand, mapping)
    angles = [_column(s.section("angle", COLUMN), path, columns, "deg", signed=True) for _, s in joints]
    read_rad = np.radians(np.column_stack(angles)[kept])
    clock = steady_times(time_s, grid, read_rad)
    grid, rows = clock.grid_s, len(clock.time_s)
    data = {name: np.full((len(grid), len(joints)), np.nan) for name in QUANTITIES}
    sent, read_pa = (np.full((rows, len(joints)), np.nan) for _ in range(2))
    for j, (_, section) in enumerate(joints):
        for name, unit in QUANTITIES.items():
            if name in section:
                part = section.section(name, COLUMN)
                values = _column(part, path, columns, unit, signed=True)[kept]
                if name == "set_point":
                    sent[:, j] = values
                else:
                    data[name][:, j] = _on_grid(grid, clock.time_s, values)
                if name == "pressure":
                    read_pa[:, j] = values
    commands = set_points_between(clock, sent, read_pa)
    data["set_point"] = commands.set_point_pa
    names, share = tuple(name for name, _ in joints), rows / len(grid)
    signals = _signals(path, names, float(grid[1] - grid[0]), data, share)
    return replace(
        signals,
        known=signals.known & has_reading(grid, clock.tick_s)[:, None] & ~commands.unknown,
        notes=clock.notes,
        jitter_s=clock.jitter_s,
        own=readings_of_samples(grid, clock.time_s, read_pa, read_rad) if between_samples(grid, clock.time_s) else None,
        start_s=on_calendar(float(clock.time_s[0])),
        between_pa=np.nan_to_num(commands.between_pa) if commands.parts > 1 else None,
        loose=commands.loose,
        refused=tuple((name, TOO_FEW_ROWS) for name, at_fault in zip(names, commands.refused, strict=True) if at_fault),
    )


def uniform_clock(path: Path, time_s: Array) -> tuple[NDArray[np.intp], Array]:
    """Indices (n,) of the rows with increasing times among all, and the uniform grid (T,) [s] of their usual period.

    Raises RecordingError where too few different times are left, one is not finite, or their distance is absurd.
    """
    order = np.argsort(time_s, kind="stable")
    kept = order[np.concatenate([[True], np.diff(time_s[order]) > 0.0])]
    times = time_s[kept]
    if np.isfinite(times).all() and len(times) and np.abs(times).max() > LATEST_S:
        worst = times[np.argmax(np.abs(times))]
        raise RecordingError(f"{path}: a time is {worst:g} s; the allowed range is {-LATEST_S:g} to {LATEST_S:g} s")
    if len(times) < 3 or not np.isfinite(times).all() or times[-1] - times[0] < READING.min_recording_s:
        raise RecordingError(
            f"{path} has {len(times)} different times; {READING.min_recording_s:g} s of samples are needed"
        )
    period_s = usual_period(times)
    if not PERIOD_S[0] <= period_s <= PERIOD_S[1]:
        raise RecordingError(
            f"{path}: its times are {period_s:.4g} s apart; the allowed range is {PERIOD_S[0]:g} to {PERIOD_S[1]:g} s;"
            " check the unit of the time column"
        )
    count = samples_on_grid(path, times[0], times[-1], period_s)
    return kept, times[0] + period_s * np.arange(count)


def _joints(top: Section, hand: Hand, mapping: Path) -> list[tuple[str, Section]]:
    section = top.section("joints", hand.joints)
    joints = [(name, section.section(name, tuple(QUANTITIES))) for name in hand.joints if name in section]
    if not joints:
        raise RecordingError(f"{mapping}: joints names no joint; known here: {', '.join(hand.joints)}")
    for name, named in joints:
        if "angle" not in named or "pressure" not in named:
            raise RecordingError(f"{mapping}: joints.{name} must name angle and pressure")
    return joints


def _column(section: Section, path: Path, columns: dict[str, Array], unit: str, *, signed: bool) -> Array:
    name = section.raw("column", "the name of a column")
    given = section.choice("unit", list(UNITS[unit]), unit)
    if name not in columns:
        raise RecordingError(f"{path} has no column {name!r}; its columns of numbers: {', '.join(columns)}")
    values = columns[name]
    if not np.isfinite(values).any():
        raise RecordingError(f"{path}: column {name!r} holds no finite number")
    sign = section.integer("sign", -1, 1, 1) if signed else 1
    scaled: Array = sign * UNITS[unit][given] * values
    return scaled


def _on_grid(grid: Array, time_s: Array, values: Array) -> Array:
    """At the times of a grid: interpolated where the samples are close enough."""
    known = np.isfinite(values)
    # The last time of a grid may lie a rounding error behind the last sample.
    within = np.clip(grid, time_s[known][0], time_s[known][-1]) if len(grid) else grid
    close = np.where(np.abs(within - grid) < grid[1] - grid[0], within, grid)
    return interpolate(close, time_s[known], values[known], longest_gap_s(float(grid[1] - grid[0])))


def _signals(path: Path, joints: tuple[str, ...], period_s: float, data: dict[str, Array], share: float) -> Signals:
    angle, known = bridge(np.radians(data["angle"]))
    pressure, pressure_known = bridge(data["pressure"])
    commanded = np.isfinite(data["set_point"]).any(axis=0)
    return Signals(
        name=path.name,
        joints=joints,
        period_s=period_s,
        set_point_pa=np.nan_to_num(data["set_point"]),
        pressure_pa=pressure,
        angle_rad=angle,
        force_n=data["force"],
        known=known & pressure_known,
        has_set_point=np.asarray(commanded),
        has_pressure=np.asarray(pressure_known.any(axis=0)),
        notes=(),
        dropped=max(0.0, 1.0 - share),
    )
