"""The free parameters of a fit: which number of the model, its prior and its bounds.

A free parameter is a coordinate z of the fit with the prior N(0, 1). Its value is centre + scale z, or
centre exp(scale z) where only ratios make sense. The prior of a nominal number is its relative tolerance; the prior of
an effect's parameter is wide, and its bounds are those of the parameter table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hand_identification.settings import FITS
from hand_model.arrays import Array
from hand_model.effects.effect import Effect, Times
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

START_CREEP = len(JOINT_PARAMETERS)
"""Row of the creeping ratio at the start, after those of the parameters; the first speed of each recording follows."""

NOMINAL_KEYS = (
    "valve.dead_time_s",
    "valve.time_constant_s",
    "statics.a0_nm",
    "statics.a1_nm_per_rad",
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "material.phi_max_deg",
    "material.p_min_pa",
    "material.b1_per_pa",
    "material.extension_time_s",
    "material.b0_per_pa",
    "material.recovery_time_s",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
    "dynamics.coupling_inertia_kg_m2",
    "valve.fill_rate_pa_per_s",
    "valve.vent_rate_pa_per_s",
)
STOP_KEYS = (
    "end_stop.low_deg",
    "end_stop.high_deg",
    "end_stop.stiffness_nm_per_rad",
    "end_stop.damping_nm_s_per_rad",
)
"""Parameters that are free only where the joint comes near a stop."""
STATED_KEYS = ("gravity.sine_nm",)
"""Parameters that are free only where a machine states their own tolerance."""


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """One coordinate z of a fit.

    row: in the parameter array, or START_CREEP and above.  centre, low, high: prior mode and bounds of the value, SI.
    log: whether the value is centre exp(scale z) instead of centre + scale z.
    """

    row: int
    centre: float
    scale: float
    log: bool
    low: float
    high: float

    def value(self, z: Array) -> Array:
        """Values at coordinates z (k,), within the bounds, (k,)."""
        return values_of([self], z[..., None])[..., 0]

    def coordinate(self, value: float) -> float:
        """The coordinate of a value [SI], which is clipped to the bounds first."""
        value = min(max(value, self.low), self.high)
        if self.log:
            return math.log(max(value, 1e-300) / self.centre) / self.scale
        return (value - self.centre) / self.scale if value != self.centre else 0.0

    def deviation(self, value: float, of_coordinate: float) -> float:
        """Standard deviation of the value [SI] where that of the coordinate is `of_coordinate` (to first order)."""
        return (abs(value) if self.log else 1.0) * self.scale * of_coordinate

    @property
    def is_fixed(self) -> bool:
        """Whether only one value is allowed."""
        return self.low == self.high

    @property
    def key(self) -> str:
        """Its key in hand.yaml, or start.creep and start.speed."""
        if self.row >= START_CREEP:
            return "start.creep" if self.row == START_CREEP else "start.speed"
        return JOINT_PARAMETERS[self.row].key


def values_of(free: Sequence[FreeParameter], z: Array) -> Array:
    """Values (..., free) [SI] at coordinates z (..., free) [-] of several parameters, within their bounds."""
    numbers = np.array([(p.centre, p.scale, p.low, p.high) for p in free]).reshape(len(free), 4)
    centre, scale, low, high = numbers.T
    values = centre + scale * z
    log = np.array([p.log for p in free], dtype=bool)
    values[..., log] = centre[log] * np.exp(scale[log] * z[..., log])
    return np.asarray(np.clip(values, low, high))


def fixed(parameter: FreeParameter, value: float, error: float = 0.0) -> FreeParameter:
    """The parameter at a value [SI] that a fit keeps; error: its standard deviation [SI], which the report states."""
    return FreeParameter(parameter.row, value, error, False, value, value)


def nominal_free_parameters(
    nominal: Array,
    tolerance: float,
    rested: bool,
    own: Mapping[str, float] | None = None,
    motion_rad: tuple[float, float] | None = None,
) -> list[FreeParameter]:
    """Free parameters of the plain plant around its nominal parameters (rows,), each by a relative tolerance [-].

    own: tolerances of single parameters, by key; one with the tolerance 0 is exact and not free. The tolerance of a
    parameter of 0 is absolute [SI], and that of the angle of a stop is relative to half the range between the stops, or
    to the angle where that is larger.

    The bounds are FITS.max_tolerances away: a larger difference indicates missing physics, not a wrong number.
    rested: whether the joint was at rest without pressure before the recording, so that its creep has decayed.
    motion_rad: least and largest angle of the recordings; without them it is far from the stops.
    """
    free, own = [], own or {}
    at_stops = _stop_tolerances(nominal, tolerance)
    stops = _stops_near(nominal, at_stops, motion_rad) if motion_rad else ()
    for key in (*NOMINAL_KEYS, *stops, *(key for key in STATED_KEYS if key in own)):
        row = ROW[key]
        size = max(abs(nominal[row]), FITS.least_sizes.get(key, 0.0)) or float(key in own)
        creepless = key.startswith("material.") and nominal[ROW["material.phi_max_deg"]] == 0.0
        if size == 0.0 or creepless or own.get(key) == 0.0:
            continue
        bound = JOINT_PARAMETERS[row]
        if key in STOP_KEYS[2:] and key not in own:
            free.append(_by_ratio(row, nominal[row]))
            continue
        angle_of_stop = key in at_stops and key not in own
        scale = at_stops[key] if angle_of_stop else size * own.get(key, max(tolerance, FITS.wide.get(key, 0.0)))
        reach = FITS.max_tolerances * scale
        low = max(bound.low * bound.scale, nominal[row] - reach)
        high = min(bound.high * bound.scale, nominal[row] + reach)
        free.append(FreeParameter(row, nominal[row], scale, False, low, high))
    if nominal[ROW["material.phi_max_deg"]] != 0.0:
        creep = FITS.rested_creep if rested else FITS.unrested_creep
        free.append(FreeParameter(START_CREEP, 0.0, creep, False, 0.0, 1.0))
    return free


def _by_ratio(row: int, centre: float) -> FreeParameter:
    """A number of which a model states the order of magnitude only."""
    bound, reach = JOINT_PARAMETERS[row], math.exp(FITS.max_tolerances * FITS.log_spread)
    low, high = max(bound.low * bound.scale, centre / reach), min(bound.high * bound.scale, centre * reach)
    return FreeParameter(row, centre, FITS.log_spread, True, low, high)


def _stop_tolerances(nominal: Array, tolerance: float) -> dict[str, float]:
    """Standard deviation [rad] of the angle of each stop, by key. A wrong number is off by a share of itself."""
    angles = {key: float(nominal[ROW[key]]) for key in STOP_KEYS[:2]}
    half_range = abs(angles[STOP_KEYS[1]] - angles[STOP_KEYS[0]]) / 2.0
    return {key: min(tolerance, FITS.stop_tolerance) * max(half_range, abs(a)) for key, a in angles.items()}


def _stops_near(nominal: Array, at_stops: Mapping[str, float], motion_rad: tuple[float, float]) -> tuple[str, ...]:
    """Those of STOP_KEYS that matter where a joint moves between these angles; at_stops: see `_stop_tolerances`."""
    low, high, *how = STOP_KEYS
    near = [low] if motion_rad[0] < nominal[ROW[low]] + FITS.max_tolerances * at_stops[low] else []
    near += [high] if motion_rad[1] > nominal[ROW[high]] - FITS.max_tolerances * at_stops[high] else []
    return (*near, *how) if near else ()


def with_stops_where_turned(
    free: Sequence[FreeParameter], z: Array, nominal: Array, motion_rad: tuple[float, float]
) -> Array | None:
    """Coordinates z (free,) [-] with free stops at the angles at which the joint turned; None where none is free.

    A model that does not reach a stop gives no information on its angle.  motion_rad: as for `nominal_free_parameters`.
    """
    low, high = (ROW[key] for key in STOP_KEYS[:2])
    depth = nominal[ROW["end_stop.engagement_deg"]]
    turned = {low: motion_rad[0] + depth, high: motion_rad[1] - depth}
    if not any(parameter.row in turned for parameter in free):
        return None
    return np.array([p.coordinate(turned[p.row]) if p.row in turned else at for p, at in zip(free, z, strict=True)])


def speed_free_parameters(speeds: Sequence[float]) -> list[FreeParameter]:
    """First speeds of recordings that begin in motion. speeds: estimates [rad/s]; 0: the recording begins at rest."""
    free = []
    for row, speed in enumerate(speeds, START_CREEP + 1):
        if speed != 0.0:
            scale = FITS.first_speed_rad_s + FITS.first_speed_share * abs(speed)
            reach = FITS.max_tolerances * scale
            free.append(FreeParameter(row, speed, scale, False, speed - reach, speed + reach))
    return free


def effect_free_parameters(effect: Effect, nominal: Array) -> list[FreeParameter]:
    """Free parameters of an effect's own parameters and of the nominal numbers (rows,), SI, that it sets free."""
    return _free_parameters(effect, effect.keys, nominal)


def law_free_parameters(effect: Effect, nominal: Array) -> list[FreeParameter]:
    """Free parameters of what a learned law sets free; their prior is centred on the textbook form (rows,), SI."""
    return _free_parameters(effect, effect.coefficients, nominal)


def law_scales(effect: Effect) -> tuple[str, ...]:
    """Coefficients of a law that are scales, such as a period: no amounts, so no value means that it is absent."""
    return tuple(
        key for key in effect.coefficients if key in effect.spread or not JOINT_PARAMETERS[ROW[key]].typical > 0.0
    )


def _free_parameters(effect: Effect, keys: Sequence[str], nominal: Array) -> list[FreeParameter]:
    free = []
    for key in keys:
        row = ROW[key]
        bound = JOINT_PARAMETERS[row]
        low, high = bound.low * bound.scale, bound.high * bound.scale
        own = row >= len(PLANT_PARAMETERS)
        centre = (bound.neutral or 0.0) * bound.scale if own else nominal[row]
        if key in effect.expected and bound.neutral is not None and nominal[row] == bound.neutral * bound.scale:
            centre = effect.expected[key] * bound.scale
        if key == effect.scanned:
            centre = nominal[row]
        missing = _size_if_absent(effect, key, nominal)
        if missing:
            free.append(FreeParameter(row, nominal[row], missing, False, low, high))
        elif bound.typical > 0.0 and key not in effect.spread:
            scale = bound.typical * bound.scale * (FITS.effect_spread if own else 1.0)
            free.append(FreeParameter(row, centre, scale, False, low, high))
        else:
            middle = centre if centre > 0.0 else bound.typical * bound.scale
            ratio = FreeParameter(row, middle, effect.spread.get(key, FITS.log_spread), True, low, high)
            free.append(ratio if middle > 0.0 else fixed(ratio, centre))  # no ratio changes a zero
    return free


def _size_if_absent(effect: Effect, key: str, nominal: Array) -> float:
    """Typical size [SI] of a number that the nominal numbers (rows,) lack; 0 where they have it."""
    size = effect.absent.get(key, 0.0) * JOINT_PARAMETERS[ROW[key]].scale
    return size if nominal[ROW[key]] < FITS.absent_share * size else 0.0


def probe_values(effect: Effect, nominal: Array) -> list[dict[int, float]]:
    """Starting points of an effect: values by row, SI; those that equal the nominal values (rows,) are left out."""
    probes = []
    for probe in effect.probes:
        values = {}
        for key, number in zip(effect.keys, probe, strict=True):
            row = ROW[key]
            bound = JOINT_PARAMETERS[row]
            value = number * bound.scale
            if isinstance(number, Times):
                missing = 0.0 if number == 1.0 else _size_if_absent(effect, key, nominal)
                value = (missing or nominal[row]) * float(number)
            values[row] = float(np.clip(value, bound.low * bound.scale, bound.high * bound.scale))
        if any(values[row] != nominal[row] for row in values):
            probes.append(values)
    return probes


def law_probe_values(effect: Effect, nominal: Array) -> list[dict[int, float]]:
    """The starting points of an effect, each with one coefficient of its law a prior deviation from the textbook form.

    nominal: (rows,) SI.  Values by row, SI, as `probe_values` gives them; a coefficient at its bound is left out.
    """
    coefficients = []
    for parameter in law_free_parameters(effect, nominal):
        both = np.clip(parameter.value(np.array([1.0, -1.0])), parameter.low, parameter.high)
        coefficients += [(parameter.row, float(value)) for value in both if value != nominal[parameter.row]]
    return [probe | {row: value} for probe in probe_values(effect, nominal) for row, value in coefficients]


def merged(base: Sequence[FreeParameter], added: Sequence[FreeParameter]) -> list[FreeParameter]:
    """The base parameters, those of the same row replaced by the added ones."""
    rows = {parameter.row for parameter in added}
    return [parameter for parameter in base if parameter.row not in rows] + list(added)
