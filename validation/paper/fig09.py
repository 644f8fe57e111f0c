"""Figure 9: the static torque map by regression of Eq. 6, on a rig whose actuator has another form than Eq. 6."""

from __future__ import annotations

import numpy as np

from hand_identification.static_map import TERMS, StaticMap, VolumeMap, identify_statics, identify_volume
from hand_model.arrays import Array
from hand_model.compliance import Actuator
from hand_model.statics import chamber_volume
from validation.paper.drawing import BLUE, GREY, panels
from validation.paper.other_plants import play_torque_nm, spring_torque_nm
from validation.paper.result import Progress, Quantity, Reproduction

TRUTH = Actuator(-0.010, -0.0573, 1.12e-6, -5.6e-7)
"""A set that agrees with what Figs. 9, 10 and 13 show; the paper prints no coefficients."""
TORQUE_NOISE_NM, PRESSURE_NOISE_PA, VOLUME_NOISE_M3 = 3e-3, 500.0, 2e-9
LEVELS_PA = np.linspace(0, 5e5, 11)
PATH_RAD = np.radians(np.concatenate([np.linspace(0, 90, 46), np.linspace(90, 0, 46)]))
END_RAD = np.pi / 2.0


def rig_torque_nm(pressure_pa: float, path_rad: Array) -> Array:
    """Torque (n,) [N m] along a path of angles (n,) at a pressure: Eq. 6, a hardening spring and plays.

    The elasticity of Eq. 6 is smaller by what the spring has at 90 degrees, so that the corners of Fig. 9 stay.
    """
    spring = spring_torque_nm(path_rad) - spring_torque_nm(np.array([END_RAD]))[0] * path_rad / END_RAD
    return np.asarray(
        TRUTH.torque_nm(np.full(len(path_rad), pressure_pa), path_rad) - spring - play_torque_nm(path_rad)
    )


def rig(seed: int) -> tuple[Array, Array, Array, Array]:
    """Angle to 90 degrees and back at pressures 0 ... 5e5 Pa: p [Pa], phi [rad], torque [N m] and V [m^3], (n,)."""
    rng = np.random.default_rng(seed)
    pressure, phi = np.repeat(LEVELS_PA, len(PATH_RAD)), np.tile(PATH_RAD, len(LEVELS_PA))
    torque = np.concatenate([rig_torque_nm(level, PATH_RAD) for level in LEVELS_PA])
    torque = torque + TORQUE_NOISE_NM * rng.standard_normal(phi.size)
    volume = TRUTH.volume_m3(pressure, phi) + VOLUME_NOISE_M3 * rng.standard_normal(phi.size)
    return pressure + PRESSURE_NOISE_PA * rng.standard_normal(phi.size), phi, torque, volume


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The regression, its map, its residual and its corners."""
    pressure, phi, torque, volume = rig(seed)
    found = identify_statics(pressure, phi, torque)
    work = identify_volume(pressure, phi, volume, found)
    progress(1.0)
    corners = _corners(found)
    high, low = (float(TRUTH.torque_nm(np.array([p]), np.array([a]))[0]) for p, a in ((5e5, 0.0), (0.0, END_RAD)))
    quantities = [
        Quantity("fig09_low", "torque at 0 Pa and 90 degrees", "N m", -0.1, corners[0], f"plant {low:.3f}"),
        Quantity(
            "fig09_high", "torque at 5e5 Pa and 0 degrees", "N m", 0.58, corners[1],
            f"plant {high:.3f}; the figure: just under 0.6",
        ),
        Quantity("fig09_r2", "R^2 of Eq. 6", "1", None, found.r2),
        Quantity("fig09_rms", "residual of Eq. 6", "mN m", None, 1e3 * found.rms_nm, "noise 3; the rest is the form"),
        Quantity("fig09_work", "dV/dphi over a2", "1", None, work.displacement_over_a2, "1 by virtual work"),
    ]  # fmt: skip
    truth = (TRUTH.a0, TRUTH.a1, TRUTH.a2, TRUTH.a3)
    quantities += [
        Quantity(
            f"fig09_{term}", term, "SI", None, float(value),
            f"standard error {error:.1g}; the plant's part of Eq. 6, spring aside: {true:.4g}; the paper prints none",
        )
        for term, value, error, true in zip(TERMS, found.values, found.errors, truth, strict=True)
    ]  # fmt: skip
    return Reproduction(
        "fig09",
        "Figure 9: static torque over angle and pressure",
        "Torque falls with the angle at every pressure, from just under 0.6 N m at 5 bar and 0 degrees to -0.1 N m at"
        " 0 bar and 90 degrees.",
        f"The regression of Eq. 6 gives {corners[1]:.3f} and {corners[0]:.3f} N m there with R^2 {found.r2:.4f} and a"
        f" residual of {1e3 * found.rms_nm:.1f} mN m; dV/dphi is {work.displacement_over_a2:.3f} of a2.",
        "The paper prints the surface, not the samples, and no coefficients. The rig is simulated with a spring that"
        " hardens and with hysteresis, which Eq. 6 does not have, and with noise; grey bars are the standard deviation"
        " of the samples at an angle, bands twice the standard error of the map.",
        _draw(found, work, (pressure, phi, torque)),
        tuple(quantities),
    )


def _draw(found: StaticMap, work: VolumeMap, samples: tuple[Array, Array, Array]):  # type: ignore[no-untyped-def]
    pressure, phi, torque = samples
    line = np.radians(np.linspace(0, 90, 50))
    figure, (left, middle, right) = panels(1, 3, 11.5, 3.8)
    for level in LEVELS_PA[::2]:
        near = np.abs(pressure - level) < 2.5e3
        at = np.unique(phi[near].round(9))[::5]
        groups = [torque[near][np.abs(phi[near] - angle) < 1e-6] for angle in at]
        p = np.full(50, level)
        (curve,) = left.plot(np.degrees(line), found.torque_nm(p, line), lw=1.0, label=f"{level * 1e-5:.0f} bar")
        colour, mean = curve.get_color(), [group.mean() for group in groups]
        left.errorbar(np.degrees(at), mean, [g.std() for g in groups], fmt=".", ms=3, color=colour, ecolor=GREY)
        band = 2.0 * found.torque_std_nm(p, line, pressure_std_pa=0.0, angle_std_rad=0.0)
        left.fill_between(
            np.degrees(line), found.torque_nm(p, line) - band, found.torque_nm(p, line) + band, color=colour, alpha=0.3
        )
        v = work.values
        middle.plot(np.degrees(line), 1e6 * chamber_volume(level, line, v[0], v[1], v[2], 2.0 * v[3]), color=colour)
    left.set(xlabel="angle [deg]", ylabel="torque [N m]", title="samples and Eq. 6")
    left.legend(frameon=False, fontsize=7, ncols=2)
    middle.set(xlabel="angle [deg]", ylabel="volume [cm^3]", title="volume map")
    residual = 1e3 * (torque - found.torque_nm(pressure, phi))
    right.plot(np.degrees(phi), residual, ".", ms=2, color=GREY)
    mean = [residual[np.abs(phi - angle) < 1e-6].mean() for angle in PATH_RAD[:46]]
    right.plot(np.degrees(PATH_RAD[:46]), mean, color=BLUE, label="mean")
    right.set(xlabel="angle [deg]", ylabel="torque less Eq. 6 [mN m]", title="what Eq. 6 leaves")
    right.legend(frameon=False)
    return figure


def _corners(found: StaticMap) -> tuple[float, float]:
    low, high = found.torque_nm(np.array([0.0, 5e5]), np.array([np.pi / 2, 0.0]))
    return float(low), float(high)
