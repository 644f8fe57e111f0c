"""The description of a hand, config/hand.yaml: loaded and validated here and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.description_checks import (
    MAX_RATE_HZ,
    MIN_RATE_HZ,
    check_limits,
    check_motion,
    check_rates,
    check_stops,
)
from hand_model.effects.effect import OTHER_MACHINES
from hand_model.geometry import Geometry
from hand_model.geometry_description import read_geometry
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, STEP_S
from hand_model.sensor_description import SensorSet, read_adc, read_names, read_sensors, read_sites
from hand_model.statics import leverage, stiffness
from hand_model.yaml_reader import DescriptionError, Section, is_name, read_yaml

_HAND_WIDE = "supply"
_GROUPS: dict[str, list[str]] = {}
for _parameter in JOINT_PARAMETERS:
    _group, _, _key = _parameter.key.partition(".")
    if _group != _HAND_WIDE:
        _GROUPS.setdefault(_group, []).append(_key)
_TOP = (
    "schema",
    "name",
    "joint_prefix",
    "fluid",
    "valve_kind",
    "supply",
    "board",
    "joint_defaults",
    "joints",
    "force_site_defaults",
    "force_sites",
    "geometry",
)
_CHOICES = (
    ("fluid", ("pneumatic", "hydraulic"), "hydraulic.share"),
    ("valve_kind", ("analog", "switching"), "switching_valve.share"),
)
"""Keys of the whole hand: the usual and the other choice, and the parameter that is 1 for the other."""
_SUPPLY = ("pressure_pa", "sensor_voltage_v")
_BOARD = ("rate_hz", "watchdog_s", "adc_bits", "adc_reference_v")
_JOINT = ("name", "coupled_to", "limits", *_GROUPS, "angle_sensor", "pressure_sensor")
_LIMITS = ("low_deg", "high_deg", "max_pressure_pa", "max_torque_nm")
# |h lambda| up to which the integrator is stable wherever lambda lies in the left half plane.
_STABLE = 2.5


@dataclass(frozen=True, slots=True)
class Limits:
    """What a command may ask of each joint, (joints,): angles [rad], pressure [Pa], torque [N m]."""

    low_rad: Array
    high_rad: Array
    max_pressure_pa: Array
    max_torque_nm: Array


@dataclass(frozen=True, slots=True)
class Hand:
    """A whole hand.

    joints: names, prefix included; their order is the order of every array and of the valves.
    parameters: (rows of JOINT_PARAMETERS, joints) in SI.  partner: (joints,) index of the coupled joint or -1.
    rate_hz: the board's frame rate.  watchdog_s: lifetime of set-points.  sensors: every sensor and its channel.
    geometry: links and frames; None where the file has none.
    """

    path: Path
    name: str
    prefix: str
    joints: tuple[str, ...]
    parameters: Array
    partner: NDArray[np.int64]
    limits: Limits
    rate_hz: float
    watchdog_s: float
    supply_pressure_pa: float
    sensors: SensorSet
    geometry: Geometry | None = None

    @property
    def valve_count(self) -> int:
        """Number of valves: one per joint."""
        return len(self.joints)

    @property
    def channel_count(self) -> int:
        """Number of ADC channels."""
        return self.sensors.channel_count

    @property
    def lacks(self) -> frozenset[str]:
        """What effects may need and the hand does not have: what belongs to other machines."""
        return OTHER_MACHINES

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Tolerances of single parameters: none, all parameters of a hand have the same."""
        return {}

    def lever_arm_m(self, joint: int) -> float:
        """Lever arm [m] of the first force sensor of a joint; 1 where it has none."""
        sites = np.flatnonzero(self.sensors.site_joint == joint)
        return float(self.sensors.lever_arm_m[sites[0]]) if len(sites) else 1.0

    def row(self, key: str) -> Array:
        """One parameter of every joint, (joints,), SI."""
        row: Array = self.parameters[ROW[key]]
        return row


def load_hand(path: str | Path, joint_prefix: str = "") -> Hand:
    """Read a hand from YAML. joint_prefix: replaces that of the file, where one is given.

    Raises DescriptionError, one line with file, key, value and allowed range, for anything that is not right.
    """
    path = Path(path)
    top = read_yaml(path, _TOP)
    top.integer("schema", 1, 1)
    prefix = joint_prefix or top.name("joint_prefix", "")
    if not is_name(prefix or "none"):
        raise DescriptionError(f"joint_prefix is {prefix!r}; it must be a name of letters, digits and underscores")
    supply, board = top.section("supply", _SUPPLY), top.section("board", _BOARD)
    supply_pressure_pa = supply.number("pressure_pa", 1e3, 2e6)
    defaults = top.section("joint_defaults", _JOINT, required=False)
    joints = [joint.over(defaults) for joint in top.sections("joints", _JOINT)]
    names = read_names(joints)
    parameters = np.array([_joint_parameters(joint, supply_pressure_pa) for joint in joints]).T
    for key, choices, parameter in _CHOICES:
        parameters[ROW[parameter]] = top.choice(key, list(choices), choices[0]) == choices[1]
    partner = np.array([_partner(joint, names) for joint in joints], dtype=np.int64)
    for index, joint in enumerate(joints):
        _check_coupling(index, joints, partner, parameters)
        _check_speed(joint, parameters[:, index], parameters[:, partner[index]] if partner[index] >= 0 else None)
        check_motion(joint.section("dynamics", _GROUPS["dynamics"]), parameters[:, index])
    rate_hz, watchdog_s = board.number("rate_hz", MIN_RATE_HZ, MAX_RATE_HZ), board.number("watchdog_s", 0.005, 1.0)
    check_rates(board, rate_hz, watchdog_s)
    return Hand(
        path=path,
        name=top.name("name"),
        prefix=prefix,
        joints=tuple(prefix + name for name in names),
        parameters=parameters,
        partner=partner,
        limits=_limits(names, [joint.section("limits", _LIMITS) for joint in joints], parameters, supply_pressure_pa),
        rate_hz=rate_hz,
        watchdog_s=watchdog_s,
        supply_pressure_pa=supply_pressure_pa,
        sensors=read_sensors(top, joints, names, prefix, read_adc(board, supply), supply_pressure_pa),
        geometry=read_geometry(top, names, prefix, read_sites(top)),
    )


def _joint_parameters(joint: Section, supply_pressure_pa: float) -> list[float]:
    """One joint's values in the order of JOINT_PARAMETERS, SI."""
    groups = {group: joint.section(group, keys, required=False) for group, keys in _GROUPS.items()}
    values = []
    for parameter in JOINT_PARAMETERS:
        group, _, key = parameter.key.partition(".")
        if group == _HAND_WIDE:
            values.append(supply_pressure_pa)
            continue
        values.append(parameter.scale * groups[group].number(key, parameter.low, parameter.high, parameter.neutral))
    _check_joint(groups, dict(zip(ROW, values, strict=True)))
    return values


def _check_joint(groups: dict[str, Section], value: dict[str, float]) -> None:
    """Relations between parameters that no single range can state."""
    if value["end_stop.low_deg"] >= value["end_stop.high_deg"]:
        low, high = np.degrees([value["end_stop.low_deg"], value["end_stop.high_deg"]])
        raise groups["end_stop"].error("low_deg", f"is {low:g}; it must be below high_deg, which is {high:g}")
    supply, b0, b1 = value["supply.pressure_pa"], value["material.b0_per_pa"], value["material.b1_per_pa"]
    if b0 < b1:
        raise groups["material"].error("b0_per_pa", f"is {b0:g}; it must be at least b1_per_pa, {b1:g} (Eq. 12)")
    span = supply - value["material.p_min_pa"]
    if b1 * span > 1.0 + 1e-9:
        problem = f"is {b1:g}; it must be at most {1.0 / span:g}, else the creeping ratio passes 1 at supply pressure"
        raise groups["material"].error("b1_per_pa", problem)
    a1, a3 = value["statics.a1_nm_per_rad"], value["statics.a3_nm_per_pa_rad"]
    if stiffness.py_func(supply, a1, a3) >= 0.0:
        problem = f"is {a3:g}; it must be below {-a1 / supply:g}, else the joint is unstable at supply pressure"
        raise groups["statics"].error("a3_nm_per_pa_rad", problem)


def _limits(joints: Sequence[str], sections: list[Section], parameters: Array, supply_pressure_pa: float) -> Limits:
    """What a command may ask, checked against the statics: pressure must flex the joint at every angle allowed."""
    rows = []
    a2, a3 = parameters[ROW["statics.a2_nm_per_pa"]], parameters[ROW["statics.a3_nm_per_pa_rad"]]
    for joint, section, slope, change, values in zip(joints, sections, a2, a3, parameters.T, strict=True):
        low, high = section.number("low_deg", -180.0, 180.0), section.number("high_deg", -180.0, 360.0)
        if low >= high:
            raise section.error("low_deg", f"is {low:g}; it must be below high_deg, which is {high:g}")
        check_limits(section, low, high)
        check_stops(section, low, high, values)
        for key, angle in (("low_deg", low), ("high_deg", high)):
            if leverage.py_func(np.radians(angle), slope, change) <= 0.0:
                bound = np.degrees(-slope / change)
                problem = f"is {angle:g}; pressure flexes {joint} only on the near side of {bound:.4g} (-a2/a3)"
                raise section.error(key, problem)
        pressure = section.number("max_pressure_pa", 1e3, supply_pressure_pa)
        rows.append((np.radians(low), np.radians(high), pressure, section.number("max_torque_nm", 1e-3, 10.0)))
    return Limits(*np.array(rows).T.copy())


def _partner(joint: Section, names: list[str]) -> int:
    """Index of the joint that shares inertia with this one, or -1."""
    name = joint.choice("coupled_to", [other for other in names if other != joint.name("name")], "")
    return names.index(name) if name else -1


def _check_coupling(index: int, joints: list[Section], partner: NDArray[np.int64], parameters: Array) -> None:
    """Partners name each other and share one inertia, small enough for a positive mass matrix."""
    key = "coupling_inertia_kg_m2"
    dynamics = joints[index].section("dynamics", _GROUPS["dynamics"])
    shared, inertia = parameters[ROW[f"dynamics.{key}"]], parameters[ROW["dynamics.inertia_kg_m2"]]
    other = int(partner[index])
    if other < 0:
        if shared[index] != 0.0:
            raise dynamics.error(key, f"is {shared[index]:g}; it must be 0 for a joint without coupled_to")
        return
    name = joints[other].name("name")
    if partner[other] != index:
        raise joints[index].error("coupled_to", f"is '{name}'; {name} must name this joint as its coupled_to")
    if shared[other] != shared[index]:
        raise dynamics.error(key, f"is {shared[index]:g}; it must be that of {name}, which is {shared[other]:g}")
    limit = float(np.sqrt(inertia[index] * inertia[other]))
    if shared[index] >= limit:
        problem = f"is {shared[index]:g}; it must be below {limit:g}, the root of the product of both inertias"
        raise dynamics.error(key, problem)


def _check_speed(joint: Section, own: Array, partner: Array | None) -> None:
    """The joint, pressed into its stop and the obstacle at once, is slow enough for the integrator's step."""
    inertia = own[ROW["dynamics.inertia_kg_m2"]]
    free = inertia
    if partner is not None:
        free -= own[ROW["dynamics.coupling_inertia_kg_m2"]] ** 2 / partner[ROW["dynamics.inertia_kg_m2"]]
    spring = own[ROW["end_stop.stiffness_nm_per_rad"]] + own[ROW["contact.stiffness_nm_per_rad"]]
    spring += abs(own[ROW["statics.a1_nm_per_rad"]])
    damper = own[ROW["end_stop.damping_nm_s_per_rad"]] + own[ROW["contact.damping_nm_s_per_rad"]]
    damper += own[ROW["dynamics.viscous_friction_nm_s_per_rad"]]
    # |lambda| is at most sqrt(k / J) where the joint rings and at most d / J where it does not.
    enough = max(spring * (STEP_S / _STABLE) ** 2, damper * STEP_S / _STABLE)
    if free < enough:
        problem = f"is {inertia:g}; it must be at least {enough + inertia - free:.3g} for its stiffness and friction"
        raise joint.section("dynamics", _GROUPS["dynamics"]).error("inertia_kg_m2", problem)


__all__ = ["DescriptionError", "Hand", "Limits", "load_hand"]
