"""The description of a hand, config/hand.yaml: loaded and validated here and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_model.parameters import JOINT_PARAMETERS, ROW
from hand_model.sensor_description import SensorSet, read_adc, read_sensors
from hand_model.yaml_reader import DescriptionError, Section, read_yaml

Array = NDArray[np.float64]
_GROUPS = tuple(dict.fromkeys(parameter.key.split(".")[0] for parameter in JOINT_PARAMETERS))
_HAND_WIDE = ("supply",)


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

    @property
    def valve_count(self) -> int:
        """Number of valves: one a joint."""
        return len(self.joints)

    @property
    def channel_count(self) -> int:
        """Number of ADC channels."""
        return self.sensors.channel_count

    def row(self, key: str) -> Array:
        """One parameter of every joint, (joints,), SI."""
        row: Array = self.parameters[ROW[key]]
        return row


def load_hand(path: str | Path) -> Hand:
    """Read a hand from YAML.

    Raises DescriptionError, one line with file, key, value and allowed range, for anything that is not right.
    """
    path = Path(path)
    top = read_yaml(path)
    top.integer("schema", 1, 1)
    prefix = top.text("joint_prefix", "")
    supply = top.section("supply")
    supply_pressure_pa = supply.number("pressure_pa", 1e3, 2e6)
    board = top.section("board")
    rate_hz = board.number("rate_hz", 1.0, 2000.0)
    watchdog_s = board.number("watchdog_s", 0.005, 1.0)
    adc = read_adc(board, supply)
    board.done()
    supply.done()

    joints = [joint.merged(top.section("joint_defaults", required=False)) for joint in top.sections("joints")]
    names = [joint.text("name") for joint in joints]
    _check_unique(top, "joints", names)
    partner = np.array([_partner(joint, names) for joint in joints], dtype=np.int64)
    parameters = np.array([_joint_parameters(joint, supply_pressure_pa) for joint in joints]).T
    limits = _limits([joint.section("limits") for joint in joints], parameters, supply_pressure_pa)
    sensors = read_sensors(top, joints, names, prefix, adc)
    hand = Hand(
        path=path,
        name=top.text("name"),
        prefix=prefix,
        joints=tuple(prefix + name for name in names),
        parameters=parameters,
        partner=partner,
        limits=limits,
        rate_hz=rate_hz,
        watchdog_s=watchdog_s,
        supply_pressure_pa=supply_pressure_pa,
        sensors=sensors,
    )
    for joint in joints:
        joint.done()
    top.done()
    _check_coupling(hand, top)
    return hand


def _joint_parameters(joint: Section, supply_pressure_pa: float) -> list[float]:
    """One joint's values in the order of JOINT_PARAMETERS, SI."""
    groups = {group: joint.section(group, required=False) for group in _GROUPS if group not in _HAND_WIDE}
    values = []
    for parameter in JOINT_PARAMETERS:
        group, _, key = parameter.key.partition(".")
        if group in _HAND_WIDE:
            values.append(supply_pressure_pa)
            continue
        values.append(parameter.scale * groups[group].number(key, parameter.low, parameter.high, parameter.neutral))
    for section in groups.values():
        section.done()
    return _check_joint(joint, values)


def _check_joint(joint: Section, values: list[float]) -> list[float]:
    """Relations between parameters that no single range can state."""
    get = {key: values[row] for key, row in ROW.items()}
    if get["end_stop.low_deg"] >= get["end_stop.high_deg"]:
        raise joint.error("end_stop.low_deg", "must be below end_stop.high_deg")
    if get["material.b0_per_pa"] < get["material.b1_per_pa"]:
        raise joint.error("material.b0_per_pa", "must be at least material.b1_per_pa (Eq. 12 is ill-posed else)")
    reach = get["material.b1_per_pa"] * (get["supply.pressure_pa"] - get["material.p_min_pa"])
    if reach > 1.0 + 1e-9:
        raise joint.error(
            "material.b1_per_pa",
            f"lets the creeping ratio reach {reach:.3g}; b1 (p_supply - p_min) is at most 1",
        )
    return values


def _limits(sections: list[Section], parameters: Array, supply_pressure_pa: float) -> Limits:
    low, high, pressure, torque = [], [], [], []
    for section in sections:
        low.append(np.radians(section.number("low_deg", -180.0, 180.0)))
        high.append(np.radians(section.number("high_deg", -180.0, 360.0)))
        if low[-1] >= high[-1]:
            raise section.error("low_deg", "must be below high_deg")
        pressure.append(section.number("max_pressure_pa", 1e3, supply_pressure_pa))
        torque.append(section.number("max_torque_nm", 1e-3, 10.0))
        section.done()
    high_rad = np.array(high)
    leverage = parameters[ROW["statics.a2_nm_per_pa"]] + parameters[ROW["statics.a3_nm_per_pa_rad"]] * high_rad
    for section, value in zip(sections, leverage, strict=True):
        if value <= 0.0:
            raise section.error("high_deg", "is an angle where pressure no longer flexes the joint (a2 + a3 phi <= 0)")
    return Limits(np.array(low), high_rad, np.array(pressure), np.array(torque))


def _partner(joint: Section, names: list[str]) -> int:
    name = joint.text("coupled_to", "")
    if not name:
        return -1
    if name not in names or name == joint.text("name"):
        raise joint.error("coupled_to", f"is {name!r}; it must be another joint: {', '.join(names)}")
    return names.index(name)


def _check_coupling(hand: Hand, top: Section) -> None:
    inertia, shared = hand.row("dynamics.inertia_kg_m2"), hand.row("dynamics.coupling_inertia_kg_m2")
    for joint, partner in enumerate(hand.partner):
        if partner < 0:
            if shared[joint] != 0.0:
                raise top.error(f"joints[{hand.joints[joint]}].dynamics", "has coupling inertia but no coupled_to")
            continue
        if hand.partner[partner] != joint or shared[partner] != shared[joint]:
            raise top.error(
                f"joints[{hand.joints[joint]}].coupled_to",
                "and its partner must name each other and one inertia",
            )
        if inertia[joint] * inertia[partner] <= shared[joint] ** 2:
            raise top.error(
                f"joints[{hand.joints[joint]}].dynamics.coupling_inertia_kg_m2",
                "squared must be below the product of both joints' inertias",
            )


def _check_unique(top: Section, key: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise top.error(key, f"name {name!r} twice")


__all__ = ["DescriptionError", "Hand", "Limits", "load_hand"]
