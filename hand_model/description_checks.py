"""Relations between values of a description that are each within their own range, but not those of one hand.

Each check raises DescriptionError, one line with file, key, value and the allowed range. Angles of the file are in
degrees, everything else is in SI.
"""

from __future__ import annotations

import math

from hand_model.arrays import Array
from hand_model.kernel.plant_rows import DEGREE
from hand_model.kernel.rows import ROW
from hand_model.yaml_reader import Section

MIN_RATE_HZ = 20.0
"""The controller vents after 0.1 s without a frame, so that a slower board can never be driven."""
MAX_RATE_HZ = 2000.0
LIFETIME_FRAMES = 3.0
"""Least lifetime of set-points in frames; with less, one late frame vents the hand."""
MIN_TRAVEL_DEG = 10.0
"""Least distance of a joint's limits. The whole range of a finger in radians is less than 4."""
STOP_MARGIN_DEG = 5.0
"""How far an end stop may lie inside the joint's limits: the accuracy with which it is identified."""
MAX_INERTIA_KG_M2 = 0.05
"""Several times that of a whole human hand about the wrist."""
MIN_DAMPING_RATIO = 1e-3
"""Least damping of a joint without dry friction, relative to critical damping."""


def check_rates(board: Section, rate_hz: float, watchdog_s: float) -> None:
    """A set-point outlives the distance of several frames. Raises DescriptionError."""
    least = LIFETIME_FRAMES / rate_hz
    if watchdog_s < least * (1.0 - 1e-9):
        problem = (
            f"is {watchdog_s:g} s; it must be at least {least:.3g} s, {LIFETIME_FRAMES:g} frames at the rate_hz of "
            f"{rate_hz:g}"
        )
        raise board.error("watchdog_s", problem)


def check_limits(section: Section, low_deg: float, high_deg: float) -> None:
    """The limits of a joint enclose a range of motion in degrees. Raises DescriptionError."""
    if high_deg - low_deg < MIN_TRAVEL_DEG:
        problem = f"is {high_deg:g}; it must be at least {MIN_TRAVEL_DEG:g} degrees above low_deg, {low_deg:g}"
        meant = "; are these limits in radians?" if high_deg - low_deg < 2.0 * math.pi else ""
        raise section.error("high_deg", problem + meant)


def check_stops(section: Section, low_deg: float, high_deg: float, values: Array) -> None:
    """The joint reaches its limits before its end stops. Raises DescriptionError.

    values: parameters of the joint (rows,), SI.
    """
    low, high = values[ROW["end_stop.low_deg"]] / DEGREE, values[ROW["end_stop.high_deg"]] / DEGREE
    if low > low_deg + STOP_MARGIN_DEG:
        problem = f"is {low_deg:g}; it must be at least {low - STOP_MARGIN_DEG:g}: the end stop begins at {low:g}"
        raise section.error("low_deg", problem)
    if high < high_deg - STOP_MARGIN_DEG:
        problem = f"is {high_deg:g}; it must be at most {high + STOP_MARGIN_DEG:g}: the end stop begins at {high:g}"
        raise section.error("high_deg", problem)


def least_friction(inertia_kg_m2: float, elasticity_nm_per_rad: float, dry_nm: float) -> float:
    """Least viscous friction [N m s/rad] of a joint: 0 where dry friction damps it, else MIN_DAMPING_RATIO."""
    if dry_nm > 0.0:
        return 0.0
    return MIN_DAMPING_RATIO * 2.0 * math.sqrt(inertia_kg_m2 * abs(elasticity_nm_per_rad))


def check_motion(dynamics: Section, values: Array) -> None:
    """A joint is as heavy as part of a hand, and friction ends its oscillation. Raises DescriptionError.

    values: parameters of the joint (rows,), SI.
    """
    inertia = values[ROW["dynamics.inertia_kg_m2"]]
    if inertia > MAX_INERTIA_KG_M2:
        problem = f"is {inertia:g}; the allowed range is 1e-07 to {MAX_INERTIA_KG_M2:g}, that of a joint of a hand"
        raise dynamics.error("inertia_kg_m2", problem)
    least = least_friction(inertia, values[ROW["statics.a1_nm_per_rad"]], values[ROW["coulomb_friction.torque_nm"]])
    viscous = values[ROW["dynamics.viscous_friction_nm_s_per_rad"]]
    if viscous < least:
        problem = f"is {viscous:g}; it must be at least {least:.2g}, else the joint oscillates without end"
        raise dynamics.error("viscous_friction_nm_s_per_rad", problem)


def check_span(sensor: Section, ratio_at_zero: float, span_pa: float, full_ratio: float, supply_pa: float) -> None:
    """The pressure sensor and its converter read every pressure up to that of the supply [Pa].

    full_ratio: largest ratio of the sensor's supply that the converter reads, at most 1 [-].  Raises DescriptionError.
    """
    share = full_ratio - ratio_at_zero
    if share * span_pa < supply_pa:
        least = f"at least {supply_pa / share:.4g}" if share > 0.0 else "read from a lower ratio_at_zero"
        reach = max(share, 0.0) * span_pa
        problem = (
            f"is {span_pa:g}; it must be {least}: the sensor ends at {reach:.4g} Pa, the supply is {supply_pa:g} Pa"
        )
        raise sensor.error("span_pa", problem)
