"""Table 1, simulated column: nonlinearity of ring and half-ring magnet."""

from __future__ import annotations

import numpy as np

from validation.magnet.field import Magnet, radial_field
from validation.magnet.geometry_search import HALF_RING_PERCENT, INNER_M, OUTER_M, half_ring, search
from validation.magnet.linearity import joint_nonlinearity, output_v, sampled
from validation.paper.drawing import BLUE, GREY, RED, panels
from validation.paper.result import Progress, Quantity, Reproduction

RING_PERCENT = (0.014, 0.039)
RANGES = ("0 to 90 degrees", "-10 to 100 degrees")


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """Fields by finite elements, Eq. 2 over both ranges; the half-ring's geometry is searched."""
    del seed  # nothing here is random
    ring = radial_field(Magnet(np.array([OUTER_M]), 1.0e-3, 3.5e-3))
    done = [0]

    def step(count: int) -> None:
        done[0] += count
        progress(done[0] / (len(INNER_M) + 1.0))

    fits = search(step)
    best = fits[0]
    half = radial_field(half_ring(best.inner_m, best.gap_m))
    ours = (*joint_nonlinearity(*ring), *joint_nonlinearity(*half))
    progress(1.0)
    names = [f"{magnet}, {span}" for magnet in ("ring", "half-ring") for span in RANGES]
    papers = (*RING_PERCENT, *HALF_RING_PERCENT)
    geometry = f"hole {best.inner_m * 1e3:g} mm, outer radius {OUTER_M * 1e3:g} mm, gap {best.gap_m * 1e3:.2f} mm"
    quantities = [
        Quantity(f"table1_{k}", f"nonlinearity, {name}", "%", paper, value, geometry if k > 1 else "any ring: a sine")
        for k, (name, paper, value) in enumerate(zip(names, papers, ours, strict=True))
    ]
    figure, (left, right) = panels(1, 2, 9.0, 3.6)
    for (angle, field), label, colour in ((ring, "ring", BLUE), (half, "half-ring", RED)):
        degrees, values = sampled(angle, field, -90.0, 90.0)
        volts = output_v(values, float(np.abs(field).max()))
        left.plot(degrees, volts, color=colour, label=label)
        inside = np.abs(degrees) <= 55.0
        line = np.polyval(np.polyfit(degrees[inside], volts[inside], 1), degrees[inside])
        right.plot(degrees[inside], 1e3 * (volts[inside] - line), color=colour, label=label)
    left.set(xlabel="magnet angle [deg]", ylabel="output about mid supply [V]")
    right.set(xlabel="magnet angle [deg]", ylabel="deviation from the line [mV]")
    right.axhline(0.0, color=GREY, lw=0.8)
    left.legend(frameon=False)
    others = "; ".join(f"hole {f.inner_m * 1e3:g} mm: {f.narrow_percent:.3f} / {f.wide_percent:.3f}" for f in fits[1:])
    return Reproduction(
        "table1",
        "Table 1: nonlinearity of ring and half-ring magnets, simulated",
        "The simulated ring magnet has 0.014 and 0.039 % nonlinearity, the half-ring 0.039 and 0.117 %.",
        f"The ring gives {ours[0]:.3f} and {ours[1]:.3f} %, the best half-ring {ours[2]:.3f} and {ours[3]:.3f} %"
        f" ({geometry}).",
        "The paper prints no geometry. Every ring gives a sine and so the same figure; among half-rings the gap was"
        f" searched for each hole: {others}. Eq. 2 read as a mean square at 1.35 V amplitude.",
        figure,
        tuple(quantities),
    )
