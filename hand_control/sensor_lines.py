"""What a fault of a measurement says to a user: joints, channels, evidence and what to check."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hand_control.frame_checks import OVER_PRESSURE, STEEP_RISE, STEPPED, STUCK_HIGH, STUCK_LOW
from hand_control.step_watch import (
    ACTIVE,
    ANGLES_SWAPPED,
    BEYOND,
    FROZEN,
    JUMPED,
    MAX_OUTSIDE_NM,
    PRESSURES_SWAPPED,
    SIGN,
    UNCHECKED,
)


class Contradiction(NamedTuple):
    """What was found: a verdict, its joint, and the other joint of an exchange or -1.  size: of a step [rad]."""

    verdict: int
    joint: int
    other: int
    size: float


def angle_jumped(joint: str, channel: int, size_rad: float) -> str:
    """One line on an angle that has changed by size_rad [rad] between two frames, more than max_jump_deg allows."""
    return (
        f"{joint}: its angle (channel {channel}) jumped by {math.degrees(abs(size_rad)):.0f} degrees between two"
        " frames; check the sensor, its magnet and its cable"
    )


def pressure_off(verdict: int, joint: str, channel: int, pressure_pa: float, limit_pa: float) -> str:
    """One line on a pressure [Pa] that differs from what is asked for; limit_pa: the largest one of the joint [Pa]."""
    its, bar = f"{joint}: its pressure (channel {channel})", f"{pressure_pa * 1e-5:.2f} bar"
    return {
        OVER_PRESSURE: f"{its} is {bar}, over-pressure beyond the limit of {limit_pa * 1e-5:.2f} bar; check the"
        " pressure regulator, the valve and the sensor",
        STEPPED: f"{its} jumped to {bar}, which no valve gives; check the sensor and its cable, whether it is exchanged"
        " with another, and the tube",
        STEEP_RISE: f"{its} rises to {bar}, far more than the valve gives; check the scale of the sensor, its channel"
        " and the valve",
        STUCK_HIGH: f"{its} stays at {bar}, the valve does not follow; check the valve, its exhaust and the sensor",
        STUCK_LOW: f"{its} is only {bar}, the valve does not follow; check for a leak, the supply and a closed valve",
    }[verdict]


def describe(
    found: Contradiction, joints: Sequence[str], channels: tuple[NDArray[np.int64], NDArray[np.int64]], unchecked: str
) -> str:
    """One line. channels: (joints,) of the angles and of the pressures.  unchecked: for how long, and why."""
    joint, other = joints[found.joint], joints[found.other]
    angle, pressure = (int(channel[found.joint]) for channel in channels)
    angles = f"{angle} and {int(channels[0][found.other])}"
    pressures = f"{pressure} and {int(channels[1][found.other])}"
    size_deg = math.degrees(abs(found.size))
    return {
        JUMPED: f"{joint}: its angle (channel {angle}) jumped by {size_deg:.1f} degrees, which no torque explains;"
        " check the sensor, its cable and its polarity",
        BEYOND: f"{joint}: its angle (channel {angle}) is beyond the end stop; check the polarity of the sensor and"
        " the calibration of the channel",
        FROZEN: f"{joint}: its angle (channel {angle}) stands still to the last bit while the joint moves; check"
        " the sensor, its cable and the converter",
        ACTIVE: f"{joint}: its angle (channel {angle}) moves without the pressure for it, as no outside torque of"
        f" {MAX_OUTSIDE_NM:g} N m explains; check the angle sensor, the pressure sensor (channel {pressure}) and"
        " the model",
        SIGN: f"{joint}: its angle (channel {angle}) falls where the pressure bends the joint; check the polarity"
        " of the sensor and the calibration of the channel",
        ANGLES_SWAPPED: f"{joint} and {other}: each angle (channels {angles}) is that of the other joint; check"
        " whether the sensors are exchanged",
        UNCHECKED: f"sensors not checked for {unchecked}; check the link, and the rate of the board",
        PRESSURES_SWAPPED: f"{joint} and {other}: each pressure (channels {pressures}) follows the set-point of"
        " the other joint; check whether sensors or tubes are exchanged",
    }[found.verdict]
