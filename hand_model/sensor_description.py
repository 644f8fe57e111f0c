"""The sensor part of the description: characteristics, channels and calibration of every sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.sensors import Adc, AngleLine, ForcePolynomial, ForceSensors, HallSensors, PressureSensors
from hand_model.yaml_reader import Section

Array = NDArray[np.float64]


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
    top: Section, joints: list[Section], names: list[str], prefix: str, adc: tuple[Adc, float]
) -> SensorSet:
    """Read the sensors of all joints and the force sites; channels must be 0 ... n - 1, each once."""
    hall = [joint.section("angle_sensor") for joint in joints]
    pressure = [joint.section("pressure_sensor") for joint in joints]
    defaults = top.section("force_site_defaults", required=False)
    sites = [site.merged(defaults) for site in top.sections("force_sites")]
    channels = [section.integer("channel", 0, 254) for section in (*hall, *pressure, *sites)]
    for section, channel in zip((*hall, *pressure, *sites), channels, strict=True):
        if channels.count(channel) > 1:
            raise section.error("channel", f"is {channel}, which another sensor uses too")
        if channel >= len(channels):
            raise section.error(
                "channel", f"is {channel}; {len(channels)} sensors use channels 0 to {len(channels) - 1}"
            )
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
    forces = ForceSensors(
        _column(sites, "c0", 1.0, 9.0),
        _column(sites, "c1", 0.1, 5.0),
        _column(sites, "divider_ohm", 10.0, 1e7),
        _column(sites, "threshold_n", 1e-3, 10.0),
        _column(sites, "noise_v", 0.0, 0.5, 0.0),
    )
    site_names = [site.text("name") for site in sites]
    for site, name in zip(sites, site_names, strict=True):
        if site_names.count(name) > 1:
            raise site.error("name", "is there twice")
    result = SensorSet(
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
    for section in (*hall, *pressure, *sites):
        section.done()
    return result


def _column(sections: list[Section], key: str, low: float, high: float, default: float | None = None) -> Array:
    return np.array([section.number(key, low, high, default) for section in sections])


def _angle_line(sections: list[Section], hall: HallSensors) -> AngleLine:
    """The two-point line as written, or, where the file has none, as this sensor would be calibrated."""
    nominal = [hall.ratio(np.full(len(sections), angle)) for angle in (0.0, np.pi / 2.0)]
    points = []
    for index, section in enumerate(sections):
        line = section.section("calibration", required=False)
        low = line.number("ratio_at_0_deg", 0.0, 1.0, float(nominal[0][index]))
        high = line.number("ratio_at_90_deg", 0.0, 1.0, float(nominal[1][index]))
        if abs(high - low) < 0.01:
            raise line.error("ratio_at_90_deg", "is too near ratio_at_0_deg; they must differ by 0.01 or more")
        line.done()
        points.append((low, high))
    columns = np.array(points)
    return AngleLine(columns[:, 0].copy(), columns[:, 1].copy())


def _force_polynomial(sections: list[Section], force: ForceSensors) -> ForcePolynomial:
    """The polynomial as written, or, where the file has none, Eq. 5 solved for log F."""
    rows = []
    for index, section in enumerate(sections):
        c0, c1 = float(force.c0[index]), float(force.c1[index])
        default = [c0 / c1, -1.0 / c1, 0.0, 0.0]
        value = section.raw("calibration_log_polynomial", default)
        good = isinstance(value, list) and len(value) == len(default)
        if not good or not all(isinstance(k, int | float) and np.isfinite(k) for k in value):
            raise section.error("calibration_log_polynomial", "must be 4 finite numbers, k0 first")
        rows.append([float(k) for k in value])
    # Half of the ratio at the threshold force: clear of the noise on an open film, below any real contact.
    ratio_min = 0.5 * force.ratio(force.threshold_n)
    return ForcePolynomial(np.array(rows), force.divider_ohm, ratio_min)


def _site_joint(site: Section, names: list[str]) -> int:
    name = site.text("joint", "")
    if name and name not in names:
        raise site.error("joint", f"is {name!r}; it must be one of {', '.join(names)}, or left out")
    return names.index(name) if name else -1
