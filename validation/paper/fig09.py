"""Figure 9: the static torque map from a rig, by regression of Eq. 6."""

from __future__ import annotations

import numpy as np

from hand_identification.static_map import TERMS, StaticMap, identify_statics, identify_volume
from hand_model.arrays import Array
from hand_model.compliance import Actuator
from hand_model.statics import chamber_volume
from validation.paper.drawing import panels
from validation.paper.result import Progress, Quantity, Reproduction

TRUTH = Actuator(-0.010, -0.0573, 1.12e-6, -5.6e-7)
"""A set that agrees with what Figs. 9, 10 and 13 show; the paper prints no coefficients."""
TORQUE_NOISE_NM, PRESSURE_NOISE_PA, VOLUME_NOISE_M3 = 3e-3, 500.0, 2e-9


def rig(seed: int) -> tuple[Array, Array, Array, Array]:
    """Angle stepped over 0 ... 90 degrees at pressures 0 ... 5e5 Pa: p [Pa], phi [rad], torque [N m] and volume [m^3],
    (n,) each.
    """
    rng = np.random.default_rng(seed)
    pressure, phi = (x.ravel() for x in np.meshgrid(np.linspace(0, 5e5, 11), np.radians(np.linspace(0, 90, 46))))
    torque = TRUTH.torque_nm(pressure, phi) + TORQUE_NOISE_NM * rng.standard_normal(phi.size)
    volume = TRUTH.volume_m3(pressure, phi) + VOLUME_NOISE_M3 * rng.standard_normal(phi.size)
    return pressure + PRESSURE_NOISE_PA * rng.standard_normal(phi.size), phi, torque, volume


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The regression, its map and its corners."""
    pressure, phi, torque, volume = rig(seed)
    found = identify_statics(pressure, phi, torque)
    work = identify_volume(pressure, phi, volume, found)
    progress(1.0)
    figure, (left, right) = panels(1, 2, 9.0, 3.8)
    for level in np.linspace(0, 5e5, 6):
        near = np.abs(pressure - level) < 2.5e3
        line = np.radians(np.linspace(0, 90, 50))
        (curve,) = left.plot(
            np.degrees(line), found.torque_nm(np.full(50, level), line), label=f"{level * 1e-5:.0f} bar"
        )
        left.plot(np.degrees(phi[near]), torque[near], ".", ms=2, color=curve.get_color())
        v = work.values
        right.plot(
            np.degrees(line), 1e6 * chamber_volume(level, line, v[0], v[1], v[2], 2.0 * v[3]), color=curve.get_color()
        )
    left.set(xlabel="angle [deg]", ylabel="torque [N m]")
    left.legend(frameon=False, fontsize=7, ncols=2)
    right.set(xlabel="angle [deg]", ylabel="volume [cm^3]")
    corners = _corners(found)
    quantities = [
        Quantity("fig09_low", "torque at 0 Pa and 90 degrees", "N m", -0.1, corners[0], "read from the figure"),
        Quantity(
            "fig09_high", "torque at 5e5 Pa and 0 degrees", "N m", 0.58, corners[1], "just under 0.6 in the figure"
        ),
        Quantity("fig09_r2", "R^2 of Eq. 6", "1", None, found.r2),
    ]
    quantities += [
        Quantity(f"fig09_{term}", term, "SI", None, float(value), f"standard error {error:.1g}")
        for term, value, error in zip(TERMS, found.values, found.errors, strict=True)
    ]
    return Reproduction(
        "fig09",
        "Figure 9: static torque over angle and pressure",
        "Torque falls with the angle at every pressure, from just under 0.6 N m at 5 bar and 0 degrees to -0.1 N m at"
        " 0 bar and 90 degrees.",
        f"The regression of Eq. 6 gives {corners[1]:.3f} and {corners[0]:.3f} N m there with R^2 {found.r2:.4f}; the"
        f" volume map agrees with it by virtual work to {abs(work.displacement_over_a2 - 1):.1%}.",
        "The rig is simulated with noise: the paper prints the surface, not the samples.",
        figure,
        tuple(quantities),
    )


def _corners(found: StaticMap) -> tuple[float, float]:
    low, high = found.torque_nm(np.array([0.0, 5e5]), np.array([np.pi / 2, 0.0]))
    return float(low), float(high)
