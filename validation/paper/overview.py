"""Every figure, table, equation and recommendation of the paper in one table: paper, ours, deviation, verdict.

A row is computed from the quantities of the reproduced figures, or says where the tree has the thing and what tests it,
or why it is not reproduced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

Values = Mapping[str, float]
"""Results by the id of their quantity."""
Outcome = tuple[str, str, bool]
"""What this project has, its deviation, and whether that agrees."""
HEADER = ("of the paper", "paper", "this project", "deviation", "verdict")


@dataclass(frozen=True, slots=True)
class Item:
    """A row. needs: ids of quantities.  outcome: from their values.  kept: instead, where the tree has it.

    absent: instead, why it is not reproduced.
    """

    name: str
    paper: str
    needs: tuple[str, ...] = ()
    outcome: Callable[[Values], Outcome] | None = None
    kept: str = ""
    absent: str = ""

    def row(self, values: Values) -> tuple[str, str, str, str, str]:
        """The cells under HEADER."""
        if self.absent:
            return self.name, self.paper, "", "", f"not reproduced: {self.absent}"
        if self.outcome is None:
            return self.name, self.paper, self.kept, "", "in use, tested"
        if any(key not in values for key in self.needs):
            return self.name, self.paper, "", "", "not run"
        ours, deviation, agrees = self.outcome(values)
        return self.name, self.paper, ours, deviation, "agrees" if agrees else "differs"


def _numbers(name: str, unit: str, known: Mapping[str, float], tolerance: float, note: str = "") -> Item:
    """Numbers that the paper prints or plots, within a relative tolerance; note: how far that is by construction."""

    def outcome(values: Values) -> Outcome:
        off = [values[key] / paper - 1.0 for key, paper in known.items()]
        worst = max(off, key=abs)
        ours = " / ".join(f"{values[key]:.3g}" for key in known)
        return f"{ours} {unit}", f"{worst:+.1%} (read to {tolerance:.0%}){note}", abs(worst) <= tolerance

    paper = " / ".join(f"{value:.3g}" for value in known.values())
    return Item(name, f"{paper} {unit}", tuple(known), outcome)


def _statement(
    name: str, paper: str, needs: Sequence[str], text: str, deviation: str, holds: Callable[[Values], bool]
) -> Item:
    """A statement of the paper without numbers; text and deviation are formatted with the values."""
    return Item(
        name, paper, tuple(needs), lambda v: (text.format_map(dict(v)), deviation.format_map(dict(v)), holds(v))
    )


def _measured(name: str, paper: str, magnet: str) -> Item:
    """Table 1's measured column: inside the 5 to 95 % of drawn magnets or not."""
    keys = [f"table1_{magnet}_{what}_{span}" for span in ("narrow", "wide") for what in ("median", "rank")]

    def outcome(v: Values) -> Outcome:
        ranks = [v[keys[1]], v[keys[3]]]
        ours = f"median {v[keys[0]]:.3f} / {v[keys[2]]:.3f} %"
        inside = all(0.05 <= rank <= 0.95 for rank in ranks)
        return ours, f"the paper's are at {ranks[0]:.0%} / {ranks[1]:.0%} of the draws", inside

    return Item(name, paper, tuple(keys), outcome)


ITEMS: tuple[Item, ...] = (
    Item("Figs. 1, 2: the hand, a joint", "drawings", kept="config/hand.yaml; `hand urdf`"),
    _numbers(
        "Fig. 3, Table 1: ring, simulated", "%", {"table1_0": 0.014, "table1_1": 0.039}, 0.05
    ),
    _numbers("Fig. 4, Table 1: half-ring, simulated", "%", {"table1_2": 0.039, "table1_3": 0.117}, 0.05),
    _measured("Table 1: ring, measured", "0.058 / 0.280 %", "ring"),
    _measured("Table 1: half-ring, measured", "0.098 / 0.317 %", "half"),
    Item("Table 1: slider mechanism", "3.8 to 5.3 %", absent="its geometry is in the paper's Ref. 7 only"),
    Item("Eq. 1: sine of the ring", "B = B0 sin(phi - phi0)", kept="`hand_model/sensors.py`"),
    Item("Eq. 2: nonlinearity", "formula", kept="`validation/magnet/linearity.py`, as a mean square"),
    Item("Eq. 3: output of the sensor", "formula", kept="`hand_model/sensors.py`"),
    Item("Eq. 4: contour by a genetic algorithm", "25 contours", kept="`validation/magnet/contour.py`"),
    Item("Fig. 5: contour", "2.2 to 2.9 mm", kept="bounds of the search; drawn with Fig. 6"),
    _statement(
        "Fig. 6: error of the two-point line", "within 0.5 degree", ["fig06_error_lsq", "fig06_error_ga"],
        "{fig06_error_lsq:.2f} degree (least squares), {fig06_error_ga:.2f} (genetic algorithm)",
        "{fig06_error_lsq:.2f} of 0.5 allowed", lambda v: v["fig06_error_lsq"] <= 0.5,
    ),
    _numbers("Fig. 7, Eq. 5: resistance at 0.1 / 100 N", "ohm",
        {"fig07_low": 1e6, "fig07_high": 1e4}, 0.15, "; drawn so",
    ),
    _statement(
        "Fig. 7: cubic in log-log is better", "best approximation", ["fig07_cubic", "fig07_line"],
        "{fig07_cubic:.1f} % of the force; the line {fig07_line:.1f} %", "none",
        lambda v: v["fig07_cubic"] < v["fig07_line"],
    ),
    _statement(
        "Fig. 8: voltage", "0 to 3 V over 15 N, steep up to 5 N", ["fig08_full", "fig08_steep"],
        "{fig08_full:.2f} V, {fig08_steep:.0%} of the rise below 5 N", "none: the resistor is chosen so",
        lambda v: v["fig08_steep"] > 0.5,
    ),
    _numbers("Fig. 9, Eq. 6: torque at the corners", "N m",
        {"fig09_low": -0.1, "fig09_high": 0.58}, 0.08, "; chosen so",
    ),
    Item("Fig. 9, Eq. 6: coefficients", "none printed", absent="there is nothing to compare; ours are below"),
    _statement(
        "Fig. 10, Eq. 7: pneumatic", "most trajectories reach 0 degrees", ["fig10_isothermal"],
        "{fig10_isothermal:.0%} of the starts", "none", lambda v: v["fig10_isothermal"] > 0.5,
    ),
    _statement(
        "Fig. 10: hydraulic", "most meet 6 bar before", ["fig10_hydraulic"],
        "{fig10_hydraulic:.0%} of the starts reach 0 degrees", "none", lambda v: v["fig10_hydraulic"] < 0.5,
    ),
    Item("Fig. 11, Eq. 8: structure of the joint", "diagram", kept="`hand_model/kernel/terms.py`"),
    Item("Eq. 9: creep compliance", "formula", kept="`validation/paper/retardation.py`, one term"),
    _statement(
        "Eq. 10: continuous spectrum", "general form, not used", ["prony_zones", "prony_1"],
        "three zones {prony_zones:.2f} degree, one term {prony_1:.2f} on test data", "the plant has zones",
        lambda v: v["prony_zones"] < v["prony_1"],
    ),
    Item(
        "Eq. 11: creep in the torque", "phi + A phi_max",
        kept="`hand_model/material.py`: phi - A phi_max, as the text says and the sign of the printed term does not",
    ),
    _statement(
        "Fig. 12, Eqs. 12, 13: three zones", "a suitable set is found",
        ["fig13_with", "fig13_test_with", "fig13_test_without", "fig13_p_min_pa", "fig13_b0_per_pa"],
        "on a material without zones: {fig13_with:.2f} % of the range, new steps {fig13_test_with:.2f} %",
        "p0(A) = A / {fig13_b0_per_pa:.2g}, p1(A) = {fig13_p_min_pa:.2g} + A / b1: zones overlap where p0 > p1",
        lambda v: v["fig13_test_with"] < v["fig13_test_without"] / 2.0,
    ),
    _statement(
        "Fig. 13: without the material law", "hysteresis and drift are missing", ["fig13_loop", "fig13_loop_without"],
        "loop {fig13_loop:.1f} degrees measured, {fig13_loop_without:.2f} simulated", "none",
        lambda v: abs(v["fig13_loop_without"]) < 0.2 * v["fig13_loop"],
    ),
    _statement(
        "Fig. 13: with it", "both agree", ["fig13_without", "fig13_with"],
        "error {fig13_without:.1f} to {fig13_with:.2f} % of the range", "none",
        lambda v: v["fig13_with"] < v["fig13_without"] / 2.0,
    ),
    _statement(
        "Fig. 14: adaptation", "clearly better damped with it",
        ["fig14_overshoot_all", "fig14_overshoot_no_adaptation"],
        "overshoot {fig14_overshoot_all:.1f} % with, {fig14_overshoot_no_adaptation:.1f} % without, all else equal",
        "none", lambda v: v["fig14_overshoot_all"] < 0.5 * v["fig14_overshoot_no_adaptation"],
    ),
    Item("Sec. 3.4: anti-windup, output limits", "recommended", kept="`hand_control/law.py`; docs/control.md"),
    _statement(
        "Sec. 3.4: feed-forward", "speeds up", ["fig14_rms_all", "fig14_rms_no_feed_forward"],
        "RMS error {fig14_rms_all:.2f} degree with, {fig14_rms_no_feed_forward:.2f} without", "none",
        lambda v: v["fig14_rms_all"] < v["fig14_rms_no_feed_forward"],
    ),
    Item("Sec. 3.4: dead-band", "reduces valve activity", kept="`deadband_pa`; docs/control.md"),
    Item("Sec. 3.4: torque-limited position control", "recommended", kept="`hand_control/law.py`; bench `motion`"),
    Item("Sec. 3.4: contact detection by the model", "recommended (Ref. 21)", kept="`hand_control/contact.py`"),
    Item("Sec. 4: detection against force sensors", "future work", kept="bench `control`, rows contact"),
    Item("Sec. 4: controller on a microcontroller", "future work", kept="`firmware/`; firmware/README.md"),
    Item("Sec. 4: pressure loop on switching valves", "future work", kept="`hand_model/pressure_loop.py`, simulated"),
    Item("Sec. 4: hydraulic position and torque control", "future work", kept="docs/control.md, liquid"),
    Item("Sec. 4: grasp patterns", "cylindrical, tripod, lateral", kept="`config/grasps.yaml`"),
)  # fmt: skip


def rows(values: Values) -> list[tuple[str, str, str, str, str]]:
    """All rows under HEADER from results by the id of their quantity; a figure that was not run says so."""
    return [item.row(values) for item in ITEMS]
