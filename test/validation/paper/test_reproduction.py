"""The paper's figures: the statements it makes hold in our code, and the command writes a whole page."""

from __future__ import annotations

import inspect
import json
import re
import shutil
import subprocess
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hand_model.compliance import hydraulic_pressure_pa, pneumatic_pressure_pa
from hand_tool.cli import app
from validation.paper.fig09 import TRUTH
from validation.paper.fig10 import STARTS, SUPPLY_PA, reach, trajectory
from validation.paper.result import IDS, reproduce
from validation.paper.retardation import Prony, fit_prony

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def test_pneumatic_trajectories_mostly_reach_zero() -> None:
    """Fails when Fig. 10's first statement does not hold: moderately raised pressure at 0 degrees."""
    share, rise = reach("isothermal")
    assert share > 0.8
    assert 0.1 < rise < 1.0


def test_most_hydraulic_trajectories_meet_the_supply_pressure() -> None:
    """Fails when Fig. 10's second statement does not hold."""
    assert reach("hydraulic")[0] < 0.4


def test_fluid_mass_is_constant_along_trajectories() -> None:
    """Fails when gauge pressure is used in Boyle's law, or the hydraulic volume changes."""
    for start_pa, start_rad in STARTS:
        phi, pressure = trajectory("isothermal", start_pa, start_rad)
        mass = (pressure + 101325.0) * TRUTH.volume_m3(pressure, phi)
        assert np.ptp(mass) < 1e-6 * mass[0]
        phi, pressure = trajectory("hydraulic", start_pa, start_rad)
        assert np.ptp(TRUTH.volume_m3(pressure, phi)) < 1e-15
    adiabatic, isothermal = (pneumatic_pressure_pa(TRUTH, 1e5, 1.0, np.array([0.5]), n)[0] for n in (1.4, 1.0))
    assert adiabatic > isothermal
    assert hydraulic_pressure_pa(TRUTH, 1e5, 1.0, np.array([1.0]))[0] == pytest.approx(1e5)
    with pytest.raises(ValueError, match=r"1 to 1\.67"):
        pneumatic_pressure_pa(TRUTH, 1e5, 1.0, np.array([0.5]), 2.0)
    assert SUPPLY_PA == 6e5


def test_prony_recovers_a_spectrum() -> None:
    """Fails when the lags or the non-negative fit of Eq. 10 are wrong."""
    rng = np.random.default_rng(9)
    driver = np.repeat(rng.uniform(0, 1, 20), 500)
    truth = Prony(0.2, np.array([0.5, 0.0, 0.3]), np.array([2.0, 10.0, 40.0]))
    noisy = truth.response(driver, 0.02) + 1e-3 * rng.standard_normal(len(driver))
    found = fit_prony(driver, noisy, truth.times_s, 0.02, np.ones(len(driver), dtype=bool))
    assert np.allclose([found.d0, *found.strengths], [0.2, 0.5, 0.0, 0.3], atol=0.01)
    assert truth.creep_compliance(np.array([0.0, 1e6])) == pytest.approx([0.2, 1.0])


@pytest.mark.parametrize("name", ["table1", "fig08", "fig09", "fig13"])
def test_numbers_agree_with_the_paper(name: str) -> None:
    """Fails when a number that the paper prints is missed by more than its figure can be read."""
    seed = 20
    tolerance = {"table1": 0.06, "fig08": 0.1, "fig09": 0.08, "fig13": 0.0}[name]
    result = reproduce(name, seed, lambda _: None)
    for quantity in result.quantities:
        if quantity.paper is not None and "_median_" not in quantity.id:
            assert quantity.ours == pytest.approx(quantity.paper, rel=tolerance), quantity.id
    values = {quantity.id: quantity.ours for quantity in result.quantities}
    if name == "fig13":
        assert values["fig13_with"] < 0.5 * values["fig13_without"]
        assert values["fig13_test_with"] < 0.5 * values["fig13_test_without"]
        assert values["fig13_loop"] > 2.0
        assert abs(values["fig13_loop_without"]) < 0.2 * values["fig13_loop"]
    if name == "table1":
        ranks = [values[key] for key in values if "_rank_" in key]
        assert len(ranks) == 4
        assert all(0.0 < rank < 1.0 for rank in ranks)


def test_the_command_writes_pictures_numbers_and_one_page(tmp_path: Path) -> None:
    """Fails when a picture is missing, the page needs the network, or results.json lacks a key."""
    out = tmp_path / "paper"
    arguments = ["reproduce", "--out", str(out), "--only", "fig10", "--only", "fig08"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    rows = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert all(set(row) == {"id", "quantity", "unit", "paper", "ours", "note"} for row in rows)
    page = (out / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=\"(https?:|//)", page)
    for name in ("fig10", "fig08"):
        assert f'id="{name}"' in page
        assert (out / f"{name}.png").read_bytes()[:4] == b"\x89PNG"
    assert BROWSER, "no browser: install chromium"
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--dump-dom"]
    dom = subprocess.run(
        [BROWSER, *flags, f"file://{out}/index.html"], capture_output=True, text=True, timeout=60, check=False
    )
    assert dom.stdout.count("<img") == 2


def test_a_typo_lists_the_names(tmp_path: Path) -> None:
    """Fails when an unknown figure is silently left out."""
    result = CliRunner().invoke(app, ["reproduce", "--out", str(tmp_path), "--only", "fig99"])
    assert result.exit_code == 2
    assert all(name in result.output for name in IDS)


@pytest.mark.parametrize(
    ("arguments", "line"), [(("--method", "annealing"), "ga, cmaes, lsq, all"), (("--budget", "3"), "30 to 100000")]
)
def test_bad_magnet_input_is_one_line(arguments: tuple[str, ...], line: str, tmp_path: Path) -> None:
    """Fails when `hand magnet` takes a method or budget it cannot use."""
    result = CliRunner().invoke(app, ["magnet", "--out", str(tmp_path), *arguments])
    assert result.exit_code == 2
    assert line in result.output


def test_every_public_function_of_the_model_names_its_source() -> None:
    """Fails when a public function or class of the physics says neither an equation nor where it comes from."""
    physics = ("statics", "material", "sensors", "compliance")
    known = r"Eqs?\.|ideal|definition|Boyle|ISO|IEC|first-order|Hunt|ratiometric|Sec\."
    assert re.search(known, import_module("hand_model.kernel.terms").__doc__ or "")
    for name in physics:
        module = import_module(f"hand_model.{name}")
        for label, thing in vars(module).items():
            function = getattr(thing, "py_func", thing)
            if label.startswith("_") or getattr(function, "__module__", "") != module.__name__:
                continue
            if callable(function):
                text = inspect.getdoc(function) or ""
                text += (module.__doc__ or "") if inspect.isclass(function) else ""
                assert re.search(known, text), f"hand_model.{name}.{label}: {text}"
