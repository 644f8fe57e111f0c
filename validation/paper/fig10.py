"""Figure 10: torque while the finger is opened with the valve closed, pneumatic and hydraulic."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array
from hand_model.compliance import hydraulic_pressure_pa, pneumatic_pressure_pa, stiffness_nm_per_rad
from validation.paper.drawing import BLUE, PURPLE, RED, panels
from validation.paper.fig09 import TRUTH
from validation.paper.result import Progress, Quantity, Reproduction

SUPPLY_PA = 6e5
STARTS = [(p, np.radians(a)) for p in (0.5e5, 1e5, 1.5e5, 2e5, 3e5, 4e5) for a in (30.0, 60.0, 90.0)]
KINDS = (("isothermal", BLUE), ("adiabatic", PURPLE), ("hydraulic", RED))


def trajectory(kind: str, start_pa: float, start_rad: float) -> tuple[Array, Array]:
    """Angles from the start down to 0 [rad] and gauge pressures [Pa], (n,) each, of a closed valve."""
    phi = np.linspace(start_rad, 0.0, 60)
    if kind == "hydraulic":
        return phi, hydraulic_pressure_pa(TRUTH, start_pa, start_rad, phi)
    return phi, pneumatic_pressure_pa(TRUTH, start_pa, start_rad, phi, 1.0 if kind == "isothermal" else 1.4)


def reach(kind: str) -> tuple[float, float]:
    """Share of the starts that open to 0 degrees below supply pressure, and the mean rise of pressure of those."""
    ends = [(start, trajectory(kind, *start)[1].max()) for start in STARTS]
    inside = [(peak - start[0]) / start[0] for start, peak in ends if peak <= SUPPLY_PA]
    return len(inside) / len(STARTS), float(np.mean(inside)) if inside else float("nan")


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """Trajectories from a grid of starts, and the stiffness along some."""
    del seed  # nothing here is random
    figure, (left, right) = panels(1, 2, 9.0, 3.8)
    for kind, colour in KINDS:
        for number, start in enumerate(STARTS):
            phi, pressure = trajectory(kind, *start)
            shown = np.where(pressure <= SUPPLY_PA, pressure, np.nan)
            label = kind if number == 0 else None
            left.plot(np.degrees(phi), TRUTH.torque_nm(shown, phi), color=colour, lw=0.9, alpha=0.7, label=label)
        phi, pressure = trajectory(kind, 2e5, np.radians(90.0))
        right.plot(np.degrees(phi), -stiffness_nm_per_rad(phi, TRUTH.torque_nm(pressure, phi)), color=colour)
    left.set(xlabel="angle [deg]", ylabel="torque [N m]", title="opened from 18 starts, up to 6 bar")
    left.legend(frameon=False)
    right.set(xlabel="angle [deg]", ylabel="stiffness [N m/rad]", title="from 2 bar, 90 degrees", yscale="log")
    shares = {kind: reach(kind) for kind, _ in KINDS}
    progress(1.0)
    return Reproduction(
        "fig10",
        "Figure 10: compliance at constant fluid mass",
        "Pneumatic trajectories mostly reach 0 degrees with moderately raised pressure; most hydraulic ones meet 6 bar"
        " before.",
        f"{shares['isothermal'][0]:.0%} of the isothermal starts reach 0 degrees (pressure"
        f" {shares['isothermal'][1]:+.0%} on average), {shares['adiabatic'][0]:.0%} of the adiabatic ones,"
        f" {shares['hydraulic'][0]:.0%} of the hydraulic.",
        "The starts are ours; the paper's are not listed. Boyle-Mariotte with absolute pressure.",
        figure,
        tuple(
            Quantity(f"fig10_{kind}", f"share that opens to 0 degrees below 6 bar, {kind}", "1", None, shares[kind][0])
            for kind, _ in KINDS
        ),
    )
