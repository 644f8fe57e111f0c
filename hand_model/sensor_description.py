"""The sensor part of the description: characteristics, channels and calibration of every sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.description_checks import check_span
from hand_model.sensors import Adc, AngleLine, ForcePolynomial, ForceSensors, HallSensors, PressureSensors
from hand_model.yaml_reader import Section

MAX_CHANNELS = 255
"""Most ADC channels a board may have: a frame counts them in one byte."""
_HALL = ("channel", "field_t", "field_max_t", "zero_deg", "third_harmonic", "noise_v", "calibration")
_CALIBRATION = ("ratio_at_0_deg", "ratio_at_90_deg")
_PRESSURE = ("channel", "ratio_at_zero", "span_pa", "noise_v")
_FSR = ("c0", "c1", "divider_ohm", "threshold_n", "noise_v", "calibration_log_polynomial")
_SITE = ("name", "joint", "channel", "lever_arm_m", "position_m", *_FSR)


@dataclass(frozen=True, slots=True)
class SensorSet:
    """Every sensor of the hand.

    Channels are ADC inputs, int64: angle_channel and pressure_channel (joints,), force_channel (sites,).
    site_joint: (sites,) index of the joint whose obstacle torque presses the site, or -1 (palm).
    lever_arm_m: (sites,) from that joint's axis to the pad.  supply_voltage_v: nominal U_0.
    """

    adc: Adc
    supply_voltage_v: float
    channel_count: int
    hall: HallSensors
    angle_line: AngleLine
    angle_channel: NDArray[np.int64]
    pressure: PressureSensors
    pressure_channel: NDArray[np.int64]
    sites: tuple[str, ...]
    site_joint: NDArray[np.int64]
    lever_arm_m: Array
    force: ForceSensors
    force_polynomial: ForcePolynomial
    force_channel: NDArray[np.int64]


def read_adc(board: Section, supply: Section) -> tuple[Adc, float]:
    """The converter and the nominal sensor supply [V]."""
    adc = Adc(board.integer("adc_bits", 8, 16), board.number("adc_reference_v", 1.0, 10.0))
    return adc, supply.number("sensor_voltage_v", 1.0, 10.0)


def read_sensors(
    top: Section, joints: list[Section], names: list[str], prefix: str, adc: tuple[Adc, float], supply_pa: float
) -> SensorSet:
    """Read the sensors of all joints and the force sites; channels must be 0 ... n - 1, each once.

    supply_pa: pressure of the supply [Pa gauge], which the pressure sensors must be able to read.
    """
    hall = [joint.section("angle_sensor", _HALL) for joint in joints]
    pressure = [joint.section("pressure_sensor", _PRESSURE) for joint in joints]
    sites = read_sites(top)
    site_names = read_names(sites)
    channels = _channels([*hall, *pressure, *sites])
    halls = HallSensors(
        _column(hall, "field_t", 1e-3, 2.0),
        _column(hall, "field_max_t", 1e-3, 2.0),
        np.radians(_column(hall, "zero_deg", -180.0, 180.0)),
        _column(hall, "third_harmonic", -0.1, 0.1, 0.0),
        _column(hall, "noise_v", 0.0, 0.5, 0.0),
    )
    pressures = PressureSensors(
        _column(pressure, "ratio_at_zero", 0.0, 0.9),
        1.0 / _column(pressure, "span_pa", 1e4, 1e8),
        _column(pressure, "noise_v", 0.0, 0.5, 0.0),
    )
    full_ratio = min(1.0, adc[0].reference_v / adc[1])
    for section, zero, per_pa in zip(pressure, pressures.ratio_at_zero, pressures.ratio_per_pa, strict=True):
        check_span(section, float(zero), 1.0 / float(per_pa), full_ratio, supply_pa)
    forces = ForceSensors(
        _column(sites, "c0", 1.0, 9.0),
        _column(sites, "c1", 0.1, 5.0),
        _column(sites, "divider_ohm", 10.0, 1e7),
        _column(sites, "threshold_n", 1e-3, 10.0),
        _column(sites, "noise_v", 0.0, 0.5, 0.0),
    )
    return SensorSet(
        adc=adc[0],
        supply_voltage_v=adc[1],
        channel_count=len(channels),
        hall=halls,
        angle_line=_angle_line(hall, halls),
        angle_channel=np.array(channels[: len(hall)], dtype=np.int64),
        pressure=pressures,
        pressure_channel=np.array(channels[len(hall) : 2 * len(hall)], dtype=np.int64),
        sites=tuple(prefix + name for name in site_names),
        site_joint=np.array([_site_joint(site, names) for site in sites], dtype=np.int64),
        lever_arm_m=_column(sites, "lever_arm_m", 1e-3, 0.5),
        force=forces,
        force_polynomial=_force_polynomial(sites, forces),
        force_channel=np.array(channels[2 * len(hall) :], dtype=np.int64),
    )


def read_sites(top: Section) -> list[Section]:
    """The entries of the force sites, laid over their defaults."""
    defaults = top.section("force_site_defaults", _SITE, required=False)
    return [site.over(defaults) for site in top.sections("force_sites", _SITE)]


def read_names(sections: list[Section]) -> list[str]:
    """The names of joints or sites, each once. Raises DescriptionError for a name that is there twice."""
    names = [section.name("name") for section in sections]
    for section, name in zip(sections, names, strict=True):
        if names.count(name) > 1:
            raise section.error("name", f"is '{name}', which is there twice")
    return names


def _channels(sections: list[Section]) -> list[int]:
    """The ADC channel of every sensor: 0 ... n - 1, each once."""
    last = min(len(sections), MAX_CHANNELS) - 1
    channels = [section.integer("channel", 0, last) for section in sections]
    for section, channel in zip(sections, channels, strict=True):
        if channels.count(channel) > 1:
            raise section.error(
                "channel", f"is {channel}, which another sensor has too; each of 0 to {last} is for one"
            )
    return channels


def _column(sections: list[Section], key: str, low: float, high: float, default: float | None = None) -> Array:
    return np.array([section.number(key, low, high, default) for section in sections])


def _angle_line(sections: list[Section], hall: HallSensors) -> AngleLine:
    """The two-point line as written, or, where the file has none, as this sensor would be calibrated."""
    nominal = [hall.ratio(np.full(len(sections), angle)) for angle in (0.0, np.pi / 2.0)]
    points = []
    for index, section in enumerate(sections):
        line = section.section("calibration", _CALIBRATION, required=False)
        low = line.number("ratio_at_0_deg", 0.0, 1.0, float(nominal[0][index]))
        high = line.number("ratio_at_90_deg", 0.0, 1.0, float(nominal[1][index]))
        if abs(high - low) < 0.01:
            problem = f"is {high:g}; it must differ from ratio_at_0_deg, {low:g}, by 0.01 or more"
            raise line.error("ratio_at_90_deg", problem)
        points.append((low, high))
    columns = np.array(points)
    return AngleLine(columns[:, 0].copy(), columns[:, 1].copy())


def _force_polynomial(sections: list[Section], force: ForceSensors) -> ForcePolynomial:
    """The polynomial as written, or, where the file has none, Eq. 5 solved for log F."""
    rows = []
    for index, section in enumerate(sections):
        c0, c1 = float(force.c0[index]), float(force.c1[index])
        default = [c0 / c1, -1.0 / c1, 0.0, 0.0]
        rows.append(section.numbers("calibration_log_polynomial", 4, default))
    # Half of the ratio at the threshold force: clear of the noise on an open film, below any real contact.
    ratio_min = 0.5 * force.ratio(force.threshold_n)
    return ForcePolynomial(np.array(rows), force.divider_ohm, ratio_min)


def _site_joint(site: Section, names: list[str]) -> int:
    name = site.choice("joint", names, "")
    return names.index(name) if name else -1
