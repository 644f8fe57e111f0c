"""Everything that hand.yaml states of a hand, by part and key, in the units of the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import Geometry, Link
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.quantities import HAND

WHOLE, PALM = HAND.whole, "palm"
OF_WHOLE = ("supply.pressure_pa", "hydraulic.share", "switching_valve.share")
"""Parameters that all joints share, because the file states them once."""
MIRROR = np.diag([1.0, -1.0, 1.0])


class Entry(NamedTuple):
    """A value [unit], or a text, whose unit is "1"."""

    value: float | str
    unit: str


def entries(hand: Hand) -> dict[tuple[str, str], Entry]:
    """Values by part and key. A part is the whole hand, the palm, or a joint or force site without the prefix.

    What the file leaves out has the value in force: that of a default, or what follows from other entries.
    """
    found = {(WHOLE, key): value for key, value in _of_hand(hand)}
    for j, name in enumerate(_plain(hand, hand.joints)):
        found |= {(name, key): value for key, value in _of_joint(hand, j)}
    for s, name in enumerate(_plain(hand, hand.sensors.sites)):
        found |= {(name, key): value for key, value in _of_site(hand, s)}
    if hand.geometry is not None:
        found |= {(part, key): value for part, key, value in _of_geometry(hand, hand.geometry)}
    return found


def _plain(hand: Hand, names: tuple[str, ...]) -> list[str]:
    return [name.removeprefix(hand.prefix) for name in names]


def _of_hand(hand: Hand) -> Iterator[tuple[str, Entry]]:
    sensors = hand.sensors
    yield "name", Entry(hand.name, "1")
    yield "joint_prefix", Entry(hand.prefix, "1")
    yield "order of the joints", Entry(", ".join(_plain(hand, hand.joints)), "1")
    yield "fluid", Entry("hydraulic" if hand.row("hydraulic.share").any() else "pneumatic", "1")
    yield "valve_kind", Entry("switching" if hand.row("switching_valve.share").any() else "analog", "1")
    yield "supply.pressure_pa", Entry(hand.supply_pressure_pa, "Pa")
    yield "supply.sensor_voltage_v", Entry(sensors.supply_voltage_v, "V")
    yield "board.rate_hz", Entry(hand.rate_hz, "Hz")
    yield "board.watchdog_s", Entry(hand.watchdog_s, "s")
    yield "board.adc_bits", Entry(float(sensors.adc.bits), "bit")
    yield "board.adc_reference_v", Entry(sensors.adc.reference_v, "V")
    yield "geometry.side", Entry(hand.geometry.side if hand.geometry else "no geometry", "1")


def _of_joint(hand: Hand, j: int) -> Iterator[tuple[str, Entry]]:
    partner, limits, sensors = int(hand.partner[j]), hand.limits, hand.sensors
    yield "coupled_to", Entry(hand.joints[partner].removeprefix(hand.prefix) if partner >= 0 else "none", "1")
    yield "limits.low_deg", _degrees(limits.low_rad[j])
    yield "limits.high_deg", _degrees(limits.high_rad[j])
    yield "limits.max_pressure_pa", Entry(float(limits.max_pressure_pa[j]), "Pa")
    yield "limits.max_torque_nm", Entry(float(limits.max_torque_nm[j]), "N m")
    for parameter, value in zip(JOINT_PARAMETERS, hand.parameters[:, j], strict=True):
        if parameter.key not in OF_WHOLE:
            quantity = HAND.units.quantity(parameter.key)
            yield quantity.key, Entry(quantity.factor / parameter.scale * float(value), quantity.unit)
    hall, line, pressure = sensors.hall, sensors.angle_line, sensors.pressure
    yield "angle_sensor.channel", Entry(float(sensors.angle_channel[j]), "1")
    yield "angle_sensor.field_t", Entry(float(hall.field_t[j]), "T")
    yield "angle_sensor.field_max_t", Entry(float(hall.field_max_t[j]), "T")
    yield "angle_sensor.zero_deg", _degrees(hall.zero_rad[j])
    yield "angle_sensor.third_harmonic", Entry(float(hall.third_harmonic[j]), "1")
    yield "angle_sensor.noise_v", Entry(float(hall.noise_v[j]), "V")
    yield "angle_sensor.calibration.ratio_at_0_deg", Entry(float(line.ratio_at_0_deg[j]), "1")
    yield "angle_sensor.calibration.ratio_at_90_deg", Entry(float(line.ratio_at_90_deg[j]), "1")
    yield "pressure_sensor.channel", Entry(float(sensors.pressure_channel[j]), "1")
    yield "pressure_sensor.ratio_at_zero", Entry(float(pressure.ratio_at_zero[j]), "1")
    yield "pressure_sensor.span_pa", Entry(1.0 / float(pressure.ratio_per_pa[j]), "Pa")
    yield "pressure_sensor.noise_v", Entry(float(pressure.noise_v[j]), "V")


def _of_site(hand: Hand, s: int) -> Iterator[tuple[str, Entry]]:
    sensors, force = hand.sensors, hand.sensors.force
    joint = int(sensors.site_joint[s])
    yield "joint", Entry(hand.joints[joint].removeprefix(hand.prefix) if joint >= 0 else PALM, "1")
    yield "channel", Entry(float(sensors.force_channel[s]), "1")
    yield "lever_arm_m", Entry(float(sensors.lever_arm_m[s]), "m")
    yield "c0", Entry(float(force.c0[s]), "1")
    yield "c1", Entry(float(force.c1[s]), "1")
    yield "divider_ohm", Entry(float(force.divider_ohm[s]), "ohm")
    yield "threshold_n", Entry(float(force.threshold_n[s]), "N")
    yield "noise_v", Entry(float(force.noise_v[s]), "V")
    for k, coefficient in enumerate(sensors.force_polynomial.coefficients[s]):
        yield f"calibration_log_polynomial[{k}]", Entry(float(coefficient), "1")


def _of_geometry(hand: Hand, geometry: Geometry) -> Iterator[tuple[str, str, Entry]]:
    """Of a left hand as the file states it, which is written for a right one."""
    turn = MIRROR if geometry.side == "left" else np.eye(3)
    parts = {
        link.name: _plain(hand, (hand.joints[link.joint],))[0] if link.joint >= 0 else PALM for link in geometry.links
    }
    for link in geometry.links:
        for key, value in _of_link(link, parts, turn):
            yield parts[link.name], f"geometry.{key}", value
    for frame in geometry.frames:
        name = frame.name.removeprefix(hand.prefix)
        if frame.kind == "fingertip":
            yield parts[frame.link], "geometry.tip_frame", Entry(name, "1")
        else:
            for key, value in _vector("position_m", turn @ frame.pose[:3, 3], "m"):
                yield name, key, value


def _of_link(link: Link, parts: Mapping[str, str], turn: Array) -> Iterator[tuple[str, Entry]]:
    for key, size in zip(("length_m", "width_m", "thickness_m"), link.size_m, strict=True):
        yield key, Entry(size, "m")
    yield "mass_kg", Entry(link.mass_kg, "kg")
    if link.joint < 0:
        return
    yield "parent", Entry(parts[link.parent], "1")
    yield from _vector("origin_m", turn @ link.origin[:3, 3], "m")
    rotation = Rotation.from_matrix(turn @ link.origin[:3, :3] @ turn)
    yield from _vector("rpy_deg", rotation.as_euler("xyz", degrees=True), "deg")
    yield from _vector("axis", np.linalg.det(turn) * turn @ link.axis, "1")


def _vector(key: str, values: Array, unit: str) -> Iterator[tuple[str, Entry]]:
    """The three numbers of a vector; what is rounding of a turn is 0."""
    for name, value in zip("xyz", values, strict=True):
        yield f"{key}.{name}", Entry(round(float(value), 12) + 0.0, unit)


def _degrees(angle_rad: float) -> Entry:
    return Entry(float(np.degrees(angle_rad)), "deg")
