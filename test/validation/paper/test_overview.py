"""The overview of the paper: every item has a row, and its verdict follows from the numbers."""

from __future__ import annotations

import re

import numpy as np

from validation.magnet.field import Magnet, disc_field
from validation.magnet.geometry_search import half_ring
from validation.magnet.linearity import joint_nonlinearity
from validation.magnet.tolerances import Tolerances, component_t, drawn_percent, multipoles
from validation.paper.fig09 import TRUTH, rig_torque_nm
from validation.paper.overview import HEADER, ITEMS, rows
from validation.results import load


def stored() -> dict[str, float]:
    return {row["id"]: row["ours"] for row in load()["paper"]["results"]}


def test_every_figure_table_and_equation_has_a_row() -> None:
    """Fails when a figure 1 to 14, an equation 1 to 13 or Table 1 has no row, or a row lacks a verdict."""
    text = " ".join(item.name for item in ITEMS)
    figures = {int(n) for found in re.findall(r"Figs?\. ([\d, ]+)", text) for n in found.split(",") if n.strip()}
    equations = {int(n) for found in re.findall(r"Eqs?\. ([\d, ]+)", text) for n in found.split(",") if n.strip()}
    assert figures == set(range(1, 15))
    assert equations == set(range(1, 14))
    assert "Table 1" in text
    assert all(len(row) == len(HEADER) and row[-1] for row in rows(stored()))


def test_stored_results_fill_every_row() -> None:
    """Fails when a figure's quantities are renamed, so that a row has no number any more."""
    assert [row[0] for row in rows(stored()) if row[-1] == "not run"] == []


def test_a_verdict_follows_from_the_numbers() -> None:
    """Fails when a result that misses the paper still counts as agreement, or a missing one as run."""
    good, bad = {"fig06_error_lsq": 0.1, "fig06_error_ga": 1.0}, {"fig06_error_lsq": 0.6, "fig06_error_ga": 1.0}
    place = next(k for k, item in enumerate(ITEMS) if item.name.startswith("Fig. 6"))
    assert [rows(v)[place][-1] for v in (good, bad, {})] == ["agrees", "differs", "not run"]
    place = next(k for k, item in enumerate(ITEMS) if item.name.startswith("Fig. 9, Eq. 6: torque"))
    assert rows({"fig09_low": -0.1, "fig09_high": 0.4})[place][-1] == "differs"


def test_tolerances_of_zero_give_the_nominal_magnet() -> None:
    """Fails when the multipoles, the sensor's place or the normal are wrong: then no offset gives another result."""
    none = Tolerances(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    magnet = half_ring(0.5e-3, 1.2e-3)
    found = drawn_percent(magnet, none, 1, 1, np.random.default_rng(0))[0]
    from validation.magnet.field import radial_field  # noqa: PLC0415 - next to its use

    assert np.allclose(found, joint_nonlinearity(*radial_field(magnet, 60)), rtol=0.03)
    some = drawn_percent(magnet, Tolerances(), 2, 20, np.random.default_rng(1))
    assert np.std(some[:, 1]) > 0.1 * found[1]


def test_a_ring_off_its_axis_is_a_shifted_dipole() -> None:
    """Fails when the field off the sensor's circle is not that of a dipole, which a ring has exactly."""
    ring = Magnet(np.array([2.5e-3]), 1e-3, 3.5e-3)
    weights, turn = multipoles(ring), np.linspace(-1.0, 1.0, 9)
    place = 4.1e-3 * np.array([np.cos(turn), np.sin(turn)])
    exact = disc_field(2.5e-3, 1.0, 4.1e-3, turn) - disc_field(1e-3, 1.0, 4.1e-3, turn)
    assert np.abs(component_t(weights, ring.sensor_m, place, turn) - exact).max() < 1e-6


def test_the_rig_of_figure_9_is_no_instance_of_equation_6() -> None:
    """Fails when the rig lacks hysteresis or the hardening spring, so that Eq. 6 would be fitted to itself."""
    path = np.radians(np.concatenate([np.linspace(0, 90, 46), np.linspace(90, 0, 46)]))
    torque = rig_torque_nm(2e5, path)
    assert np.abs(torque[:46] - torque[:45:-1]).max() > 1e-3
    own = TRUTH.torque_nm(np.full(46, 2e5), path[:46])
    assert np.ptp(torque[:46] - own - np.polyval(np.polyfit(path[:46], torque[:46] - own, 1), path[:46])) > 2e-3
