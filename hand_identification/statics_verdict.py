"""What a static rig's data say about themselves: wrong pressure reference, sign or unit, and virtual work that fails.

Each check uses a property that every flexible fluidic actuator of Martin et al. 2004 has: its torque rises with
pressure and falls with the angle (Fig. 9), it is about zero at 0 Pa gauge and 0 degrees, and dV/dphi = dM/dp.
"""

from __future__ import annotations

import numpy as np

from hand_identification.static_map import StaticMap, VolumeMap
from hand_model.arrays import Array
from hand_model.statics import leverage, stiffness

ATMOSPHERE_PA = 101325.0
LARGEST_TORQUE_NM = 5.0
"""Ten times the largest torque of Fig. 9: more is a wrong unit."""
STANDARD_ERRORS, AGREEMENT = 3.0, 0.05
"""Virtual work fails beyond these standard errors, and beyond this relative difference, which sensors' gains cause."""
UNITS_M3 = ((1e6, "cm^3"), (1e3, "litre"), (1e9, "mm^3"))
UNIT_MARGIN = 0.3
"""Relative difference up to which a ratio counts as that of a unit."""


def verdicts(
    found: StaticMap, volume: VolumeMap | None, pressure_pa: Array, angle_rad: Array, torque_nm: Array
) -> tuple[str, ...]:
    """A line for each fault of a rig's samples (n,) that the fitted maps reveal; empty where all of it is plausible."""
    lines = [*_sign(found, pressure_pa, angle_rad), *_torque_unit(torque_nm)]
    if not lines:
        lines += _absolute(found, pressure_pa)
    if volume is not None:
        lines += _virtual_work(found, volume)
    return tuple(lines)


def _sign(found: StaticMap, pressure_pa: Array, angle_rad: Array) -> list[str]:
    _, a1, a2, a3 = found.values
    lines = []
    if leverage.py_func(float(np.mean(angle_rad)), a2, a3) < 0.0:
        lines.append(
            "wrong sign: the torque falls with the pressure; is the torque positive where it flexes the joint?"
        )
    elif stiffness.py_func(float(np.mean(pressure_pa)), a1, a3) > 0.0:
        lines.append("wrong sign: the torque rises with the angle; is the angle positive in flexion?")
    return lines


def _torque_unit(torque_nm: Array) -> list[str]:
    largest = float(np.abs(torque_nm).max())
    if largest <= LARGEST_TORQUE_NM:
        return []
    return [f"wrong unit: the torque reaches {largest:.3g} N m, over {LARGEST_TORQUE_NM:g}; is it in mN m or N cm?"]


def _absolute(found: StaticMap, pressure_pa: Array) -> list[str]:
    """At 0 degrees a gauge pressure of about 0 gives no torque; an absolute one is an atmosphere there."""
    balance_pa = -found.values[0] / found.values[2]
    least = float(pressure_pa.min())
    if min(balance_pa, least) < 0.5 * ATMOSPHERE_PA:
        return []
    return [
        f"absolute pressure: no sample is below {least:.4g} Pa, and the torque at 0 degrees vanishes at"
        f" {balance_pa:.4g} Pa instead of about 0; subtract the atmosphere (about {ATMOSPHERE_PA:.0f} Pa)"
    ]


def _virtual_work(found: StaticMap, volume: VolumeMap) -> list[str]:
    """dV/dphi = dM/dp at 0 degrees: v_phi = a2, within the standard errors of both."""
    ratio = volume.displacement_over_a2
    error = abs(ratio) * float(np.hypot(volume.errors[2] / volume.values[2], found.errors[2] / found.values[2]))
    if abs(ratio - 1.0) <= max(STANDARD_ERRORS * error, AGREEMENT):
        return []
    for factor, unit in UNITS_M3:
        if abs(ratio / factor - 1.0) < UNIT_MARGIN:
            return [f"wrong unit: dV/dphi is {ratio:.3g} of a2, which is the ratio of {unit} to m^3; convert volume_m3"]
    return [
        f"virtual work fails: dV/dphi is {ratio:.3f} +- {error:.3f} of a2 and should be 1; check the gains of the"
        " pressure, torque and volume sensors"
    ]
