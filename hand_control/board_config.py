"""The constants of `firmware/board` for one hand: `python -m hand_control.board_config > board_config.h`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_control.safety_numbers import joint_limits
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.yaml_loader import DescriptionError

RAIL_MARGIN = 0.002
SUPPLY_SHARES = (0.8, 1.2)
"""As in the conversions of the driver."""
INSTALLED = Path(__file__).resolve().parents[1] / "config" / "hand.yaml"


@dataclass(frozen=True, slots=True)
class Sensor:
    """One ratiometric sensor: (counts' ratio to the supply - zero) * per_ratio is the value in Pa or urad."""

    channel: int
    zero_ppm: int
    per_ratio: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardConfig:
    """The fields of hand_board_config in C. limits: rows of `joint_limits`.  angle, pressure: a Sensor per joint."""

    joints: int
    channels: int
    lowest_supply_mv: int
    highest_supply_mv: int
    reference_mv: int
    full_scale: int
    lowest_count: int
    highest_count: int
    limits: tuple[tuple[int, ...], ...]
    angle: tuple[Sensor, ...]
    pressure: tuple[Sensor, ...]


def board_config(hand: Hand) -> BoardConfig:
    """The constants of a hand, in the integer units of the firmware."""
    sensors = hand.sensors
    line, valve = sensors.angle_line, sensors.pressure
    full = sensors.adc.full_scale
    margin = round(RAIL_MARGIN * full)
    slope = np.pi / 2.0 / (line.ratio_at_90_deg - line.ratio_at_0_deg)
    low, high = (round(share * sensors.supply_voltage_v * 1e3) for share in SUPPLY_SHARES)
    return BoardConfig(
        joints=len(hand.joints),
        channels=hand.channel_count,
        lowest_supply_mv=low,
        highest_supply_mv=high,
        reference_mv=round(sensors.adc.reference_v * 1e3),
        full_scale=full,
        lowest_count=margin,
        highest_count=full - margin,
        limits=tuple(tuple(int(value) for value in row) for row in joint_limits(hand)),
        angle=_sensors(sensors.angle_channel, line.ratio_at_0_deg, slope * 1e6),
        pressure=_sensors(sensors.pressure_channel, valve.ratio_at_zero, 1.0 / valve.ratio_per_pa),
    )


def _sensors(channel: NDArray[np.int64], zero: Array, per_ratio: Array) -> tuple[Sensor, ...]:
    rows = zip(channel, zero, per_ratio, strict=True)
    return tuple(Sensor(int(c), round(float(z) * 1e6), round(float(per))) for c, z, per in rows)


def header(config: BoardConfig) -> str:
    """The constants as a C header that defines `board_config`."""
    limits = ",\n".join("    {" + ", ".join(map(str, row)) + "}" for row in config.limits)
    numbers = (
        config.joints, config.channels, config.lowest_supply_mv, config.highest_supply_mv, config.reference_mv,
        config.full_scale, config.lowest_count, config.highest_count,
    )  # fmt: skip
    return "\n".join(
        [
            "/* Made by python -m hand_control.board_config. */",
            '#include "hand_board.h"',
            "",
            f"static const hand_safety_joint board_limits[] = {{\n{limits}}};",
            _array("angle", config.angle),
            _array("pressure", config.pressure),
            "static const hand_board_config board_config = {",
            f"    {', '.join(map(str, numbers))}, board_limits, board_angle, board_pressure}};",
            "",
        ]
    )


def _array(name: str, sensors: Sequence[Sensor]) -> str:
    rows = ",\n".join(f"    {{{s.channel}, {s.zero_ppm}, {s.per_ratio}}}" for s in sensors)
    return f"static const hand_board_sensor board_{name}[] = {{\n{rows}}};"


def main() -> int:
    """Entry point; 2 for a description that cannot be read."""
    parser = argparse.ArgumentParser(
        prog="python -m hand_control.board_config",
        description="Write the constants of firmware/board for one hand as a C header.",
        epilog="Example: python -m hand_control.board_config config/hand.yaml > board_config.h",
    )
    parser.add_argument("description", nargs="?", type=Path, default=INSTALLED, help="path of hand.yaml")
    try:
        print(header(board_config(load_hand(parser.parse_args().description))), end="")
    except (DescriptionError, ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
