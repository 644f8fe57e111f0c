"""Table 1: nonlinearity of ring and half-ring magnet, simulated, and with manufacturing tolerances as measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hand_model.arrays import Array
from hand_pages.plots import Curve, Kind, Panel, Plot
from validation.magnet.field import Magnet, radial_field
from validation.magnet.geometry_search import HALF_RING_PERCENT, INNER_M, OUTER_M, half_ring, search
from validation.magnet.linearity import joint_nonlinearity, output_v, sampled
from validation.magnet.tolerances import Tolerances, drawn_percent
from validation.paper.drawing import BLUE, GREY, RED, panels
from validation.paper.result import Progress, Quantity, Reproduction

RING_PERCENT = (0.014, 0.039)
MEASURED_PERCENT = {"ring": (0.058, 0.280), "half": (0.098, 0.317)}
"""Table 1, measured: ring and half-ring over both ranges."""
TOLERANCES = Tolerances()
SHAPES, DRAWS = 12, 50
RANGES = ("0 to 90 degrees", "-10 to 100 degrees")


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """Fields by finite elements, Eq. 2 over both ranges; the half-ring's geometry is searched."""
    whole = Magnet(np.array([OUTER_M]), 1.0e-3, 3.5e-3)
    ring = radial_field(whole)
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
    drawn = {
        name: drawn_percent(magnet, TOLERANCES, SHAPES, DRAWS, np.random.default_rng([seed, k]))
        for k, (name, magnet) in enumerate((("ring", whole), ("half", half_ring(best.inner_m, best.gap_m))))
    }
    quantities += _measured(drawn)
    figure, (left, right, spread) = panels(1, 3, 12.0, 3.6)
    _draw_spread(spread, drawn)
    kinds: tuple[Kind, Kind] = ("after", "before")
    outputs, deviations = [], []
    for (angle, field), label, colour, kind in zip(
        (ring, half), ("ring", "half-ring"), (BLUE, RED), kinds, strict=True
    ):
        degrees, values = sampled(angle, field, -90.0, 90.0)
        volts = output_v(values, float(np.abs(field).max()))
        left.plot(degrees, volts, color=colour, label=label)
        inside = np.abs(degrees) <= 55.0
        line = np.polyval(np.polyfit(degrees[inside], volts[inside], 1), degrees[inside])
        deviation_mv = 1e3 * (volts[inside] - line)
        right.plot(degrees[inside], deviation_mv, color=colour, label=label)
        outputs.append(Curve(label, kind, degrees, volts))
        deviations.append(Curve(label, kind, degrees[inside], deviation_mv))
    left.set(xlabel="magnet angle [deg]", ylabel="output about mid supply [V]")
    right.set(xlabel="magnet angle [deg]", ylabel="deviation from the line [mV]")
    right.axhline(0.0, color=GREY, lw=0.8)
    left.legend(frameon=False)
    others = "; ".join(f"hole {f.inner_m * 1e3:g} mm: {f.narrow_percent:.3f} / {f.wide_percent:.3f}" for f in fits[1:])
    return Reproduction(
        "table1",
        "Table 1: nonlinearity of ring and half-ring magnets, simulated and measured",
        "The simulated ring magnet has 0.014 and 0.039 % nonlinearity, the half-ring 0.039 and 0.117 %;"
        " measured were 0.058 and 0.280 %, and 0.098 and 0.317 %.",
        f"The ring gives {ours[0]:.3f} and {ours[1]:.3f} %, the best half-ring {ours[2]:.3f} and {ours[3]:.3f} %"
        f" ({geometry}). With tolerances of {_words(TOLERANCES)} the medians are"
        f" {_medians(drawn['ring'])} and {_medians(drawn['half'])} %.",
        "The paper prints no geometry. Every ring gives a sine and so the same figure; among half-rings the gap was"
        f" searched for each hole: {others}. Eq. 2 read as a mean square, each magnet at 1.35 V of its"
        " own peak: the value is proportional to that amplitude. The tolerances are assumed; the paper prints none.",
        figure,
        tuple(quantities),
        (
            Plot(
                label="magnet angle [deg]",
                panels=[
                    Panel("output about mid supply [V]", outputs),
                    Panel("deviation from the line [mV]", deviations),
                ],
                alt=f"Nonlinearity of the ring {ours[1]:.3f} %, of the half-ring {ours[3]:.3f} %"
                " from -10 to 100 degrees",
            ),
        ),
    )


def _words(t: Tolerances) -> str:
    return (
        f"{t.offset_m * 1e3:g} mm (offset), {t.distance_m * 1e3:g} mm (gap), {t.tilt_deg:g} degrees (tilt),"
        f" {t.zero_deg:g} (phi_0), {t.hole_m * 1e3:g} mm (hole) and {t.end_deg:g} degrees (ends of a half-ring)"
    )


def _medians(percent: Array) -> str:
    narrow, wide = np.median(percent, axis=0)
    return f"{narrow:.3f} / {wide:.3f}"


def _measured(drawn: Mapping[str, Array]) -> list[Quantity]:
    """Median of the draws next to the measured value, and the share of draws below that value."""
    found = []
    for name, percent in drawn.items():
        for k, span in enumerate(("narrow", "wide")):
            paper, values = MEASURED_PERCENT[name][k], percent[:, k]
            low, high = np.quantile(values, [0.05, 0.95])
            label = f"{'ring' if name == 'ring' else 'half-ring'} with tolerances, {RANGES[k]}"
            found += [
                Quantity(
                    f"table1_{name}_median_{span}", f"nonlinearity, {label}", "%", paper, float(np.median(values)),
                    f"5 to 95 %: {low:.3f} to {high:.3f} of {len(values)} draws",
                ),
                Quantity(
                    f"table1_{name}_rank_{span}", f"share of draws below the measured value, {label}", "1", None,
                    float(np.mean(values < paper)),
                ),
            ]  # fmt: skip
    return found


def _draw_spread(axis, drawn: Mapping[str, Array]) -> None:  # type: ignore[no-untyped-def]
    boxes: list[Array] = []
    papers: list[float] = []
    for name, percent in drawn.items():
        boxes += [percent[:, 0], percent[:, 1]]
        papers += MEASURED_PERCENT[name]
    names = ["ring\n0 to 90", "ring\n-10 to 100", "half\n0 to 90", "half\n-10 to 100"]
    axis.boxplot(boxes, whis=(5, 95), showfliers=False, tick_labels=names)
    axis.plot(range(1, 5), papers, "o", color=RED, label="measured in the paper")
    axis.set(yscale="log", ylabel="nonlinearity [%]", title="with tolerances; whiskers 5 to 95 %")
    axis.legend(frameon=False, fontsize=7)
