"""A machine of one axis as a model for diagnosis, with its recordings and its wording.

The equations of a joint are those of any single axis. Force, travel and input are scaled to the size they have in a
finger, so that tolerances, floors and typical sizes of effects fit; the wording scales every result back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_machine.balance import balance, motion, smoothed
from hand_machine.derivative_window import derivative_window_s, fitting_window_s
from hand_machine.description import MachineDescription, load_description
from hand_machine.found_model import PARAMETER, WEIGHT, put_effects
from hand_machine.plausible import check_loads, check_plausible
from hand_machine.reading import Readings, read_machine
from hand_machine.settings import MACHINE
from hand_machine.thinning import thinned
from hand_machine.wording import AXIS, VOLUME, wording_of, wording_of_volume
from hand_model.arrays import Array
from hand_model.effects import EFFECTS
from hand_model.effects.effect import MOTION, NEEDS
from hand_model.kernel.rows import DEGREE, JOINT_PARAMETERS, ROW
from hand_model.quantities import UnitMap, Wording
from hand_recording.signals import Signals, on_calendar

TORQUE, TRAVEL, INPUT, FORCE = 0.5, 1.5, 4e5, 10.0
"""Sizes in a finger: torque [N m], travel [rad], input [Pa], force at the pad [N]."""
LEVER_M = TORQUE / FORCE
FLUID = ("supply", "valve", "chamber")
"""Parts of a machine with a fluid: its input is a pressure, and the lag between both is that of a tube."""
CONTROLLED = {
    "stiffness": ROW["drive_saturation.stiffness_nm_per_rad"],
    "damping": ROW["drive_saturation.damping_nm_s_per_rad"],
}
"""Rows of the numbers of a position controller, whose torque is limited with that of the input."""
WITHOUT_PART = {
    "valve.dead_time_s": 0.005,
    "valve.time_constant_s": 0.05,
    "valve.fill_rate_pa_per_s": 1e7,
    "valve.vent_rate_pa_per_s": 8e6,
    "statics.a0_nm": 0.0,
    "statics.a3_nm_per_pa_rad": 0.0,
    "end_stop.low_deg": -np.pi,
    "end_stop.high_deg": 2.0 * np.pi,
    "end_stop.stiffness_nm_per_rad": 5.0,
    "end_stop.damping_nm_s_per_rad": 0.02,
    "end_stop.engagement_deg": DEGREE,
    "supply.pressure_pa": INPUT,
}
"""Parameters (SI) of a joint that have no part in a machine: a valve that is not diagnosed, stops out of reach. Laws
over the input are bent up to the supply, which is the largest input."""


CLOSED = {
    "valve.fill_rate_pa_per_s": 0.0,
    "valve.vent_rate_pa_per_s": 0.0,
    "statics.a1_nm_per_rad": -1.0,
    "dynamics.inertia_kg_m2": 1e-3,
    "dynamics.viscous_friction_nm_s_per_rad": 0.01,
}
"""Parameters (SI) of a volume whose valve is closed, with an axis at rest that no pressure moves."""


@dataclass(frozen=True, slots=True)
class Scales:
    """The machine's SI units in one N m, rad and Pa of its model [-]."""

    torque: float
    angle: float
    input: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisModel:
    """The nominal model of the axis. parameters: (rows of JOINT_PARAMETERS, 1), scaled to the size of a finger.

    lacks: what it does not have of what effects may need, keys of NEEDS.  tolerances: relative standard deviations [-]
    of parameters that have their own, by key; 0 where a number is exact.
    """

    path: Path
    name: str
    joints: tuple[str, ...]
    parameters: Array
    partner: NDArray[np.int64]
    lacks: frozenset[str]
    tolerances: Mapping[str, float]

    def lever_arm_m(self, joint: int) -> float:
        """Lever arm [m] that makes the scaled torque of a finger its scaled force."""
        del joint
        return LEVER_M


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine: its description, its model, its scaled recordings, and the wording of its report."""

    description: MachineDescription
    model: AxisModel
    signals: tuple[Signals, ...]
    wording: Wording


def load_machine(path: Path, recordings: Sequence[Path], *, to_fit: bool = False) -> Machine:
    """Read a machine's description and recordings (CSV, Parquet, NPZ or MAT).

    to_fit: whether a model is fitted to the recordings. Means of groups of samples then may stand for them, the
    measured force may choose the window of derivatives, and it is evaluated in the band of the motion.
    Raises DescriptionError or RecordingError, one line, for what cannot be used.
    """
    described = load_description(path)
    tables = [read_machine(described, recording) for recording in recordings]
    if described.still:
        return _volume(described, recordings, tables)
    for recording, table in zip(recordings, tables, strict=True):
        check_plausible(described.with_load_of(recording), recording, table)
    check_loads(described, recordings, tables)
    if to_fit:
        tables = thinned(tables)
    if to_fit and described.imposed and described.derivative_window_s is None:
        described = replace(described, derivative_window_s=fitting_window_s(described, tables))
    scales = _scales(described, recordings, tables)
    wording = wording_of(
        described.linear,
        per_torque=scales.torque,
        per_angle=scales.angle,
        per_input=scales.input,
        per_force=scales.torque * LEVER_M,
    )
    named = zip(recordings, tables, strict=True)
    signals = tuple(_signals(recording, table, described, scales, to_fit=to_fit) for recording, table in named)
    longest = max(float(np.ptp(table.time_s)) for table in tables)
    model = _model(described, scales, longest, wording.units)
    if not any(np.ptp(table.signals["input"]) > 0.0 for table in tables):
        model = replace(model, lacks=model.lacks | {"drive"})
    if not described.linear and described.stiffness == described.weight == 0.0 and _turns_on(signals):
        model = replace(model, lacks=model.lacks | {"elastic_part"})
    if not _is_between_stops(signals):
        model = _without_stops(described, model)
    return Machine(described, model, signals, wording)


def _volume(described: MachineDescription, recordings: Sequence[Path], tables: Sequence[Readings]) -> Machine:
    """A closed volume: a valve without flow, from the first pressure of each recording on, and no motion."""
    wording = wording_of_volume()
    parameters = np.array([(p.neutral or 0.0) * p.scale for p in JOINT_PARAMETERS])
    for key, value in (WITHOUT_PART | CLOSED).items():
        parameters[ROW[key]] = value
    put_effects(described, wording.units, parameters)
    longest = max(float(np.ptp(table.time_s)) for table in tables)
    model = AxisModel(
        path=described.path,
        name=described.name,
        joints=(VOLUME,),
        parameters=parameters[:, None],
        partner=np.array([-1]),
        lacks=_lacks(described, longest) | {MOTION},
        tolerances={key: 0.0 for key in CLOSED if key != PARAMETER["inertia"]},
    )
    signals = tuple(_pressures(path, table) for path, table in zip(recordings, tables, strict=True))
    return Machine(described, model, signals, wording)


def _pressures(recording: Path, table: Readings) -> Signals:
    """The signals of a closed volume."""
    still, yes = np.zeros((len(table.time_s), 1)), np.ones(1, dtype=bool)
    return Signals(
        name=recording.name,
        joints=(VOLUME,),
        period_s=table.period_s,
        set_point_pa=still,
        pressure_pa=table.signals["position"][:, None],
        angle_rad=still,
        force_n=np.full_like(still, np.nan),
        known=table.known[:, None],
        has_set_point=yes,
        has_pressure=yes,
        notes=table.notes,
        machine=True,
        still=True,
        start_s=on_calendar(float(table.time_s[0])),
    )


def _is_between_stops(signals: Sequence[Signals]) -> bool:
    """Whether all positions are between the stops that are out of a finger's reach; a wheel turns further."""
    low, high = WITHOUT_PART["end_stop.low_deg"], WITHOUT_PART["end_stop.high_deg"]
    return all(low < each.angle_rad.min() and each.angle_rad.max() < high for each in signals)


def _turns_on(signals: Sequence[Signals]) -> bool:
    """Whether an axis, which no weight returns, turns further than a full turn in a recording: nothing elastic does."""
    return any(float(np.ptp(each.angle_rad[each.known])) > math.tau for each in signals if each.known.any())


def _without_stops(described: MachineDescription, model: AxisModel) -> AxisModel:
    """The model without stops, unless the file has them; `end_stop` is not offered then."""
    if any(key.startswith("end_stop") for key in described.effects):
        return model
    parameters = model.parameters.copy()
    for key in ("end_stop.stiffness_nm_per_rad", "end_stop.damping_nm_s_per_rad"):
        parameters[ROW[key]] = 0.0
    exact = dict.fromkeys(EFFECTS["end_stop"].keys, 0.0)
    return replace(model, parameters=parameters, tolerances={**model.tolerances, **exact})


def _scales(described: MachineDescription, recordings: Sequence[Path], tables: Sequence[Readings]) -> Scales:
    if described.sizes is not None:
        return Scales(*described.sizes)
    travel = max(float(np.ptp(np.concatenate([table.signals["position"] for table in tables]))), 1e-12)
    # An angle stays an angle: gravity and harmonic errors are sines of it.
    per_angle = travel / TRAVEL if described.linear else 1.0
    loaded = [described.with_load_of(recording) for recording in recordings]
    largest = max(
        each.gain / described.gain * float(np.abs(table.signals["input"]).max())
        for each, table in zip(loaded, tables, strict=True)
    )
    lacking = max(_lacking(each, table) for each, table in zip(loaded, tables, strict=True))
    acting = described.gain * largest or max(_at_rest(each, table) for each, table in zip(loaded, tables, strict=True))
    per_torque = max(acting / TORQUE, lacking / (MACHINE.effect_share * TORQUE), 1e-12)
    # An input at rest still has a usual gain.
    per_input = (largest or TORQUE * per_torque / described.gain) / INPUT
    return Scales(per_torque, per_angle, per_input)


def _at_rest(described: MachineDescription, table: Readings) -> float:
    """Largest force [N] or torque [N m] of spring and weight of the nominal model over the recorded positions."""
    x = table.signals["position"]
    force = described.stiffness * x + described.weight * np.sin(x)
    return float(np.quantile(np.abs(force[table.known]), MACHINE.lacking_quantile)) if table.known.any() else 0.0


def _lacking(described: MachineDescription, table: Readings) -> float:
    """Largest force [N] or torque [N m] that the nominal model lacks, by its balance over the recorded motion.

    Of that force the part counts that depends on position, speed and input, or half of all; the rest may be noise of
    the acceleration.
    """
    forces, moved = balance(described, table), motion(table)
    if forces is None or moved is None or not table.known.any():
        return 0.0
    driving, passive = forces
    lacking = driving - passive
    if "force" in table.signals:
        lacking = lacking - smoothed(table, table.signals["force"])
    x, v, a = (part / max(float(np.std(part)), 1e-300) for part in moved)
    given = table.signals["input"] / max(float(np.std(table.signals["input"])), 1e-300)
    columns = np.column_stack(
        [np.ones(len(x)), x, x * x, x**3, v, v * np.abs(v), np.tanh(v / MACHINE.turning_speed), given, a]
    )
    known = table.known
    found = np.linalg.lstsq(columns[known], lacking[known], rcond=1e-9)[0]
    found[-1] = 0.0
    by_state = np.quantile(np.abs(columns[known] @ found), MACHINE.lacking_quantile)
    half, most = np.quantile(np.abs(lacking[known]), (0.5, MACHINE.lacking_quantile))
    # Of a swing, position and acceleration are alike: a fit may set large parts of both against each other.
    return float(max(min(by_state, most), half))


def _model(described: MachineDescription, scales: Scales, longest_s: float, units: UnitMap) -> AxisModel:
    scale = scales.angle / scales.torque
    no_damping = 0.0 if described.tolerances.get("damping") == 0.0 else _least_damping(described, scale, longest_s)
    own = {
        "statics.a1_nm_per_rad": -(described.stiffness * scale or MACHINE.least_stiffness),
        "statics.a2_nm_per_pa": described.gain * scales.input / scales.torque,
        "dynamics.inertia_kg_m2": described.inertia * scale or MACHINE.least_inertia,
        "dynamics.viscous_friction_nm_s_per_rad": described.damping * scale or no_damping,
        "gravity.sine_nm": described.weight / scales.torque,
    }
    parameters = np.array([(p.neutral or 0.0) * p.scale for p in JOINT_PARAMETERS])
    for key, value in (WITHOUT_PART | own).items():
        parameters[ROW[key]] = value
    for name in described.controller:
        parameters[CONTROLLED[name]] = described.controller[name] * scale
    put_effects(described, units, parameters)
    return AxisModel(
        path=described.path,
        name=described.name,
        joints=(AXIS,),
        parameters=parameters[:, None],
        partner=np.array([-1]),
        lacks=_lacks(described, longest_s),
        tolerances={
            (PARAMETER | {"weight": WEIGHT})[name]: tolerance for name, tolerance in described.tolerances.items()
        }
        | _over_travel(described),
    )


def _least_damping(described: MachineDescription, scale: float, longest_s: float) -> float:
    """Damping that nobody sees [N m s/rad of the model]: of a free axis, by what it loses in its longest recording."""
    if described.imposed or described.inertia == 0.0:
        return MACHINE.least_damping
    return min(MACHINE.least_damping, MACHINE.least_speed_loss * described.inertia * scale / longest_s)


def _over_travel(described: MachineDescription) -> dict[str, float]:
    """Tolerance [SI of the model] of the gain's change over the travel, where an input has a gain that is not exact."""
    if "input" not in described.columns or described.tolerances.get("gain") == 0.0:
        return {}
    return {"statics.a3_nm_per_pa_rad": MACHINE.gain_over_travel * TORQUE / (INPUT * TRAVEL)}


def _lacks(described: MachineDescription, longest_s: float) -> frozenset[str]:
    """What the axis does not have of what effects may need. longest_s: duration of its longest recording."""
    has = set(described.has)
    has |= set() if described.linear else {"rotation"}
    has |= {"force_sensor"} if described.imposed else set()
    has |= {"long_recording"} if longest_s >= MACHINE.warming_s else set()
    has |= {"two_clocks"} if "input_sensor" in has else set()
    has |= {"fluid"} if not has.isdisjoint(FLUID) else {"drive"} if "input" in described.columns else set()
    has |= {"one_axis", "elastic_part"}
    has |= set() if any("added_inertia" in own for own in described.recordings.values()) else {"one_load"}
    has |= {"inexact_stiffness"} if described.tolerances.get("stiffness") != 0.0 else set()
    has |= {"inexact_gain"} if described.controller or described.tolerances.get("gain") != 0.0 else set()
    return frozenset(NEEDS) - has


def _signals(
    recording: Path, table: Readings, described: MachineDescription, scales: Scales, *, to_fit: bool
) -> Signals:
    own = described.recordings.get(recording.name, {})
    drive = own.get("supply", 1.0) * table.signals["input"][:, None] / scales.input
    force = np.full_like(drive, np.nan)
    if described.imposed:
        force = table.signals["force"][:, None] / scales.torque / LEVER_M
    yes = np.ones(1, dtype=bool)
    return Signals(
        name=recording.name,
        joints=(AXIS,),
        period_s=table.period_s,
        set_point_pa=drive,
        pressure_pa=drive,
        angle_rad=table.signals["position"][:, None] / scales.angle,
        force_n=force,
        known=table.known[:, None],
        has_set_point=~yes,
        has_pressure=yes,
        notes=table.notes,
        driven=described.imposed,
        machine=True,
        added=_added(recording, described, scales),
        derivative_s=described.derivative_window_s or derivative_window_s(table.signals["position"], table.period_s),
        band_s=(described.derivative_window_s or 0.0) if to_fit and described.imposed else 0.0,
        start_s=on_calendar(float(table.time_s[0])),
    )


def _added(recording: Path, described: MachineDescription, scales: Scales) -> dict[str, float]:
    """What load and temperature of a recording add to parameters of the model, by key, SI of the model."""
    own = described.recordings.get(recording.name, {})
    scale = scales.angle / scales.torque
    size = {
        "gain": described.gain * scales.input / scales.torque,
        "stiffness": -described.stiffness * scale,
        "damping": described.damping * scale,
    }
    added = {
        PARAMETER["inertia"]: own.get("added_inertia", 0.0) * scale,
        WEIGHT: own.get("added_weight", 0.0) / scales.torque,
    }
    added |= {PARAMETER[name]: size[name] * (factor - 1.0) for name, factor in described.warmth(recording).items()}
    return {key: value for key, value in added.items() if value != 0.0}
