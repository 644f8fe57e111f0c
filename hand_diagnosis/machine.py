"""Any single-axis machine in the units of a hand: the same chain, search and report diagnose it.

A machine file says what moves, by what, and where the columns are:

    schema: 1
    name: seal_rig
    motion: linear                     # or rotary
    imposed: true                      # the rig moves the axis and measures force; false: the input moves it
    gain: 4.9087e-4                    # force [N] or torque [N m] per unit of input, in SI; leave out with the input
    stiffness: 0.0                     # [N/m] or [N m/rad]
    damping: 0.0                       # [N s/m] or [N m s/rad]
    inertia: 0.1                       # [kg] or [kg m^2]
    weight: 0.0                        # rotary: torque at 90 degrees of what hangs from the axis [N m]
    columns:
      time: {column: t_s}
      input: {column: p_bar, scale: 1.0e+5}
      position: {column: x_mm, scale: -1.0e-3}
      force: {column: F_N}

Signals are scaled so that force, travel and input have the size they have in a finger; the tolerances, floors and
typical sizes of effects then fit. Results are scaled back. Positive input drives towards positive position; a measured
force is what the axis exerts in that direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from hand_diagnosis.findings import Finding, unit_of, unknown_statement
from hand_diagnosis.report import small_statement
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import ROW
from hand_model.quantities import UnitMap, Wording
from hand_model.yaml_reader import Section, read_yaml
from hand_recording.hand_signals import SHORTEST_S
from hand_recording.installed import default_model
from hand_recording.interpolation import bridge
from hand_recording.recording_files import RecordingError
from hand_recording.signals import Signals, samples_on_grid
from hand_recording.table_file import read_table

AXIS = "axis"
TORQUE, TRAVEL, INPUT, FORCE = 0.5, 1.5, 4e5, 10.0
"""Sizes in a finger: torque [N m], travel [rad], input [Pa], force at the pad [N]."""
UNMODELLED = 0.1
"""Share of the torque of a finger that effects may have."""
SMOOTHED_S = 0.05
"""Half the window over which positions are differentiated, to see what force the nominal model lacks."""
LEVER_M = TORQUE / FORCE
DAMPING = 1e-4
"""Of a finger [N m s/rad], where none is given: too little to see, and enough for a fit to start from."""
_KEYS = ("schema", "name", "motion", "imposed", "gain", "stiffness", "damping", "inertia", "weight", "columns")


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine as a hand of one joint, its signals, and what one unit of the hand is there (torque, angle, input)."""

    name: str
    linear: bool
    hand: Hand
    signals: tuple[Signals, ...]
    per_torque: float
    per_angle: float
    per_input: float

    @property
    def units(self) -> dict[str, tuple[float, str]]:
        """Factor from the hand's SI and name of the unit of each signal, for figures."""
        angle, name = self.unit_factor("deg")
        force = (self.per_torque * LEVER_M, "N" if self.linear else "N m")
        return {"pressure": (self.per_input, "input"), "angle": (angle * 180.0 / np.pi, name), "force": force}

    def unit_factor(self, unit: str) -> tuple[float, str]:
        """Factor and name of a unit of a finding in the machine's own units."""
        torque, angle = ("N", "m") if self.linear else ("N m", "rad")
        turn = np.pi / 180.0
        t, a, p = self.per_torque, self.per_angle, self.per_input
        table = {
            "N m": (t, torque),
            "deg": (a * turn * (1e3 if self.linear else 1 / turn), "mm" if self.linear else "deg"),
            "Pa": (p, "input"),
            "N m/Pa": (t / p, f"{torque}/input"),
            "N m/rad": (t / a, f"{torque}/{angle}"),
            "N m/rad^3": (t / a**3, f"{torque}/{angle}^3"),
            "N m/(Pa rad^2)": (t / p / a**2, f"{torque}/(input {angle}^2)"),
            "N m/Pa^2": (t / p**2, f"{torque}/input^2"),
            "N m s/rad": (t / a, f"{torque} s/{angle}"),
            "N m s^2/rad^2": (t / a**2, f"{torque} s^2/{angle}^2"),
            "rad/s": (a, f"{angle}/s"),
            "kg m^2": (t / a, "kg" if self.linear else "kg m^2"),
            "Pa/s": (p, "input/s"),
            "1/Pa": (1 / p, "1/input"),
        }
        return table.get(unit, (1.0, unit))


def load_machine(path: Path, recordings: Sequence[Path]) -> Machine:
    """Read a machine file and its recordings. Raises DescriptionError or RecordingError, one line."""
    top = read_yaml(path, _KEYS)
    top.integer("schema", 1, 1)
    linear = top.choice("motion", ["linear", "rotary"]) == "linear"
    imposed = bool(top.raw("imposed", "true or false", False))
    tables = [_read(top, recording, imposed) for recording in recordings]
    gain = top.number("gain", 1e-12, 1e12, 1.0 if imposed else None)
    travel = max(float(np.ptp(np.concatenate([t["position"] for t in tables]))), 1e-12)
    # An angle stays an angle: gravity and harmonic errors are sines of it.
    per_angle = travel / TRAVEL if linear else 1.0
    largest = float(np.abs(np.concatenate([t["input"] for t in tables])).max())
    missing = max(_unmodelled(top, table, gain) for table in tables)
    per_torque = max(gain * largest / TORQUE, missing / (UNMODELLED * TORQUE), 1e-12)
    per_input = (largest or TORQUE * per_torque / gain) / INPUT  # an input at rest still has a usual gain
    hand = _hand(path, top, gain * per_input / per_torque, per_angle, per_torque)
    signals = tuple(
        _signals(recording, table, imposed, (per_torque, per_angle, per_input))
        for recording, table in zip(recordings, tables, strict=True)
    )
    return Machine(top.name("name"), linear, hand, signals, per_torque, per_angle, per_input)


def _unmodelled(top: Section, table: dict[str, Array], gain: float) -> float:
    """Largest force or torque that the nominal model lacks, by its balance over the recorded motion."""
    period = float(np.median(np.diff(table["time"])))
    window = min(2 * round(SMOOTHED_S / period) + 1, (len(table["time"]) - 1) // 2 * 2 + 1)
    if window < 5:
        return 0.0
    x, v, a = (savgol_filter(table["position"], window, 3, deriv=k, delta=period) for k in range(3))
    numbers = (top.number(name, 0.0, 1e12, 0.0) for name in ("stiffness", "damping", "inertia"))
    passive = sum(number * motion for number, motion in zip(numbers, (x, v, a), strict=True))
    rest = gain * table["input"] - passive - _weight(top) * np.sin(x) - table.get("force", 0.0)
    return float(np.quantile(np.abs(rest), 0.99))


def _weight(top: Section) -> float:
    return top.number("weight", 0.0, 0.0 if top.raw("motion", "linear or rotary") == "linear" else 1e12, 0.0)


def _read(top: Section, recording: Path, imposed: bool) -> dict[str, Array]:
    """Columns on a uniform clock, SI: time, input, position, force (where the motion is imposed)."""
    section = top.section("columns", ("time", "input", "position", "force"))
    with_input = not imposed or "input" in section
    wanted = ("time", *(("input",) if with_input else ()), "position", *(("force",) if imposed else ()))
    columns = read_table(recording).numbers
    data = {}
    for name in wanted:
        part = section.section(name, ("column", "scale"))
        column = part.raw("column", "the name of a column")
        if column not in columns:
            raise RecordingError(f"{recording} has no column {column!r}; it has: {', '.join(columns)}")
        data[name] = part.number("scale", -1e12, 1e12, 1.0) * columns[column]
    order = np.argsort(data["time"], kind="stable")
    kept = order[np.concatenate([[True], np.diff(data["time"][order]) > 0.0])]
    time_s = data["time"][kept]
    if len(time_s) < 3 or not np.isfinite(time_s).all() or time_s[-1] - time_s[0] < SHORTEST_S:
        raise RecordingError(f"{recording} has {len(time_s)} different times; {SHORTEST_S:g} s of samples are needed")
    period = float(np.median(np.diff(time_s)))
    grid = time_s[0] + period * np.arange(samples_on_grid(recording, time_s[0], time_s[-1], period))
    known = {name: _known(recording, name, grid, time_s, data[name][kept]) for name in wanted[1:]}
    return {"time": grid, "input": np.zeros(len(grid))} | known


def _known(recording: Path, name: str, grid: Array, time_s: Array, values: Array) -> Array:
    finite = np.isfinite(values)
    if not finite.any():
        raise RecordingError(f"{recording}: {name} holds no finite number")
    if name == "position" and np.ptp(values[finite]) == 0.0:
        raise RecordingError(f"{recording}: position is constant at {values[finite][0]:g}; the axis must move")
    return np.asarray(np.interp(grid, time_s[finite], values[finite]), dtype=np.float64)


def _hand(path: Path, top: Section, a2: float, per_angle: float, per_torque: float) -> Hand:
    """The axis as the only joint; no stops, no creep, nothing coupled."""
    base = load_hand(default_model())
    scale = per_angle / per_torque
    row = base.parameters[:, 0].copy()
    changes = {
        "statics.a0_nm": 0.0,
        "statics.a1_nm_per_rad": -max(top.number("stiffness", 0.0, 1e12, 0.0) * scale, 1e-6),
        "statics.a2_nm_per_pa": a2,
        "statics.a3_nm_per_pa_rad": 0.0,
        "material.phi_max_deg": 0.0,
        "dynamics.inertia_kg_m2": max(top.number("inertia", 0.0, 1e12, 0.0) * scale, 1e-9),
        "dynamics.viscous_friction_nm_s_per_rad": max(top.number("damping", 0.0, 1e12, 0.0) * scale, DAMPING),
        "dynamics.coupling_inertia_kg_m2": 0.0,
        "gravity.sine_nm": _weight(top) / per_torque,
        "end_stop.low_deg": -np.pi,
        "end_stop.high_deg": 2.0 * np.pi,
        "supply.pressure_pa": 2e6,
    }
    for key, value in changes.items():
        row[ROW[key]] = value
    sensors = replace(base.sensors, site_joint=np.zeros(1, dtype=np.int64), lever_arm_m=np.array([LEVER_M]))
    return replace(
        base,
        path=path,
        name=top.name("name"),
        joints=(AXIS,),
        parameters=row[:, None],
        partner=np.array([-1]),
        sensors=sensors,
    )


def _signals(recording: Path, table: dict[str, Array], imposed: bool, units: tuple[float, float, float]) -> Signals:
    per_torque, per_angle, per_input = units
    drive, known = bridge(table["input"][:, None] / per_input)
    force = np.full_like(drive, np.nan)
    if imposed:
        force = table["force"][:, None] / per_torque / LEVER_M
    yes = np.ones(1, dtype=bool)
    period = float(np.median(np.diff(table["time"])))
    return Signals(
        recording.name, (AXIS,), period, drive, drive, table["position"][:, None] / per_angle, force, known, ~yes, yes,
        driven=imposed, machine=True,
    )  # fmt: skip


def in_own_units(content: dict[str, Any], findings: Sequence[Finding], machine: Machine) -> dict[str, Any]:
    """report.json's content with parameters, errors and sentences in the machine's units. findings: its findings."""
    torque = "N" if machine.linear else "N m"
    for finding in content["findings"]:
        for number in finding["parameters"].values():
            factor, unit = machine.unit_factor(number["unit"])
            number["value"], number["std"], number["unit"] = number["value"] * factor, number["std"] * factor, unit
    for row in [*content["fit"], *content["located"], *content["not_claimable"]]:
        factor, row["unit"] = _unit_of_signal(machine, row["signal"], torque)
        for key in {"rmse_before", "rmse_after", "noise_floor", "taken", "floor", "rms", "noise"} & row.keys():
            row[key] *= factor
    for row in content["parameter_changes"]:
        factor, _ = machine.unit_factor(unit_of(row["parameter"]))
        for key in ("nominal", "value", "std"):
            row[key] *= factor
    if content["next_experiment"]:
        del content["next_experiment"]["command"]  # nothing here drives another machine
    for row in content["not_claimable"]:
        row["statement"] = small_statement(row)
    for finding, own in zip(content["findings"], findings, strict=True):
        finding["statement"] = _statement(finding, own, content, machine)
    return content


def _unit_of_signal(machine: Machine, signal: str, torque: str) -> tuple[float, str]:
    units = {"force": (machine.per_torque * LEVER_M, torque), "angle": machine.unit_factor("deg")}
    return units.get(signal, (machine.per_input, "input"))


def _statement(finding: dict[str, Any], own: Finding, content: dict[str, Any], machine: Machine) -> str:
    """The finding said again with the machine's numbers and units."""
    signal = finding["where"]["signal"]
    row = next((r for r in content["fit"] if r["split"] == "held_out" and r["signal"] == signal), None)
    if row is None:
        return str(finding["statement"])
    errors = f"{row['rmse_before']:.3g} to {row['rmse_after']:.3g} {row['unit']}"
    parts = [_says(name, finding, machine) for name in _effects_of(finding)]
    if own.unexplained is None:
        return f"{AXIS}: {parts[0]}. With all findings the held-out error of the {signal} falls from {errors}."
    rest = own.unexplained
    factor, unit = _unit_of_signal(machine, signal, row["unit"])
    correction = rest.correction.scaled(unit, factor, machine.per_angle, 1e5 * machine.per_input)
    rest = replace(rest, size=factor * rest.size, direction=factor * rest.direction, unit=unit, correction=correction)
    return unknown_statement(AXIS, rest, parts, errors).replace("pressure", "input")


def _effects_of(finding: dict[str, Any]) -> list[str]:
    """The effects whose numbers a finding has."""
    names = [key.partition(".")[0] for key in finding["parameters"]]
    return [name for name in EFFECTS if name == finding["effect"] or (finding["effect"] == "unknown" and name in names)]


def _says(name: str, finding: dict[str, Any], machine: Machine) -> str:
    effect = EFFECTS[name]
    numbers = {key: finding["parameters"][key] for key in effect.keys if key in finding["parameters"]}
    values = [(key, number["value"], number["std"]) for key, number in numbers.items()]
    return _wording(machine).sentence(effect.says, values)


def _wording(machine: Machine) -> Wording:
    units = UnitMap(pressure="input")
    if machine.linear:
        units = UnitMap(torque="N", angle="m", pressure="input", shown_angle="mm", inertia="kg")
    words = {"angle": "position" if machine.linear else "angle", "pressure": "input", "flexion": "motion forward"}
    return Wording(units=units, words=words | {"torque": "force" if machine.linear else "torque"})
