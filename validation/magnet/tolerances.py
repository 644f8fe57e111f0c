"""What manufacturing does to the magnet's linearity: offset, tilt, zero, gap and shape drawn within tolerances.

Outside the magnet its potential is a series of plane multipoles, psi = sum w_k (R/r)^k sin(k angle), whose weights
follow from the field on the sensor's circle. So the field at a sensor that is off its place is exact, and a draw costs
no finite elements. Tilts out of the plane act as a gain in two dimensions and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array
from validation.magnet.field import Magnet, radial_field
from validation.magnet.linearity import nonlinearity_percent, output_v

HARMONICS = 15
RANGES_DEG = ((0, 90), (-10, 100))
"""Of the joint (Table 1)."""
ZERO_DEG = 45.0


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Half widths of uniform distributions: the magnet's centre off the joint's axis in x and y, the sensor's distance
    [m], tilt of the sensor in the plane, error of phi_0 [deg], radius of the hole [m] and ends of the magnet [deg].
    """

    offset_m: float = 0.2e-3
    distance_m: float = 0.1e-3
    tilt_deg: float = 5.0
    zero_deg: float = 5.0
    hole_m: float = 0.05e-3
    end_deg: float = 3.0


def multipoles(magnet: Magnet, elements: int = 40) -> Array:
    """Weights (HARMONICS,) [T] of B_n on the sensor's circle: B_n = sum b_k sin(k angle)."""
    angle, field = radial_field(magnet, elements)
    table = np.sin(np.outer(angle, np.arange(1, HARMONICS + 1)))
    return np.asarray(np.linalg.lstsq(table, field, rcond=None)[0])


def component_t(weights: Array, sensor_m: float, place_m: Array, normal_rad: Array) -> Array:
    """Flux density (n,) [T] along normals (n,) at places (2, n) [m] in the frame of the magnet's centre."""
    order = np.arange(1, len(weights) + 1)[:, None]
    radius, angle = np.hypot(*place_m), np.arctan2(place_m[1], place_m[0])
    size = weights[:, None] * (sensor_m / radius) ** (order + 1)
    radial, across = (size * np.sin(order * angle)).sum(axis=0), -(size * np.cos(order * angle)).sum(axis=0)
    return np.asarray(radial * np.cos(normal_rad - angle) + across * np.sin(normal_rad - angle))


def drawn_percent(magnet: Magnet, tolerances: Tolerances, shapes: int, draws: int, rng: np.random.Generator) -> Array:
    """Nonlinearity (shapes * draws, 2) [%] over both ranges of Table 1; each of the shapes is assembled `draws` times.

    Each output is scaled to its own peak over a turn of the nominal magnet, as in Table 1's simulated column.
    """
    peak = float(np.abs(multipoles(magnet) @ np.sin(np.outer(np.arange(1, HARMONICS + 1), _TURN))).max())
    found = []
    for _ in range(shapes):
        weights = multipoles(_shape(magnet, tolerances, rng))
        found += [_assembled_percent(weights, magnet.sensor_m, peak, tolerances, rng) for _ in range(draws)]
    return np.array(found)


_TURN = np.linspace(0.0, np.pi, 181)


def _shape(magnet: Magnet, tolerances: Tolerances, rng: np.random.Generator) -> Magnet:
    hole = magnet.inner_m + tolerances.hole_m * rng.uniform(-1.0, 1.0)
    turned = 2.0 * np.radians(tolerances.end_deg) * rng.uniform(-1.0, 1.0)
    whole = magnet.span_rad >= 2.0 * np.pi
    return Magnet(
        magnet.outer_m,
        hole,
        magnet.sensor_m,
        magnet.span_rad if whole else magnet.span_rad + turned,
        magnet.remanence_t,
    )


def _assembled_percent(
    weights: Array, sensor_m: float, peak_t: float, tolerances: Tolerances, rng: np.random.Generator
) -> tuple[float, float]:
    offset = tolerances.offset_m * rng.uniform(-1.0, 1.0, 2)
    distance = sensor_m + tolerances.distance_m * rng.uniform(-1.0, 1.0)
    tilt, zero = np.radians([tolerances.tilt_deg, tolerances.zero_deg]) * rng.uniform(-1.0, 1.0, 2)
    values = []
    for low, high in RANGES_DEG:
        turn = np.radians(np.arange(low, high + 0.5) - ZERO_DEG) + zero
        place = distance * np.array([np.cos(turn), np.sin(turn)]) - offset[:, None]
        field = component_t(weights, sensor_m, place, turn + tilt)
        values.append(nonlinearity_percent(output_v(field, peak_t)))
    return values[0], values[1]
