"""A machine's report is in its own units and words: no rad, deg or N m for a linear axis, no hand for a rotary one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.pages.page import write_page
from hand_diagnosis.report import document
from hand_machine.description import load_description
from hand_machine.machine import LEVER_M, Machine, load_machine
from hand_machine.wording import wording_of
from hand_model.description import load_hand
from hand_model.effects import CATALOGUE
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.quantities import HAND
from hand_model.yaml_loader import DescriptionError
from hand_recording.installed import default_model

ROOT = Path(__file__).resolve().parents[2]
LINEAR = {
    "schema": 1,
    "name": "slide",
    "motion": "linear",
    "gain": 2.0,
    "stiffness": 40.0,
    "damping": 1.0,
    "inertia": 0.2,
    "columns": {
        "time": {"column": "t"},
        "input": {"column": "u"},
        "position": {"column": "x", "scale": 1e-3},
    },
}
PER_RADIAN = {"stiffness": 4.0, "damping": 0.1, "inertia": 0.02}
"""The same axis where 0.1 m are 1 rad: the table's positions are ten times as large."""
NOT_LINEAR = re.compile(
    r"(?<![a-z])(rad|deg|degrees?|N m|nm|torque|angle|joint|hand|finger|flex\w*|extend\w*)(?![a-z])"
)
NOT_ROTARY = re.compile(r"(?<![a-z])(Pa|pa|bar|pressure|joint|hand|finger|flex\w*|extend\w*|mm|index|thumb)(?![a-z])")
OF_THE_FORMAT = {
    "place",
    "family",
    "effect",
    "effects",
    "groups",
    "next_experiment",
    "settings",
    "fit_settings",
    "reading_settings",
    "machine_settings",
    "schema",
}
"""Keys whose values are names of the catalogue or of the format, the same for every machine."""


def slide(shaken_n: float) -> np.ndarray:
    """Time, input and position [mm] of a slide on a spring with friction of 0.5 N, shaken at 1.7 Hz."""
    rng = np.random.default_rng(6)
    period, steps = 0.005, 10
    time = np.arange(0.0, 14.0, period)
    drive = np.interp(time, np.arange(0, 35, 1.2), rng.uniform(-2.0, 2.0, 30))
    x, v, positions = 0.0, 0.0, []
    for now, u in zip(time, drive, strict=True):
        positions.append(1e3 * x)
        for _ in range(steps):
            force = 2.0 * u - 40.0 * x - 1.0 * v - 0.5 * np.tanh(v / 1e-3) + shaken_n * np.sin(10.7 * now)
            v += period / steps * force / 0.2
            x += period / steps * v
    return np.column_stack([time, drive, np.array(positions) + 0.02 * rng.standard_normal(len(time))])


def loaded(folder: Path, description: dict[str, Any], table: np.ndarray) -> Machine:
    (folder / "machine.yaml").write_text(json.dumps(description), encoding="utf-8")  # JSON is YAML
    np.savetxt(folder / "table.csv", table, delimiter=",", header="t,u,x", comments="", fmt="%.8g")
    return load_machine(folder / "machine.yaml", [folder / "table.csv"])


def diagnosed(machine: Machine) -> Diagnosis:
    return diagnose(machine.signals, machine.model, tolerance=0.05, seed=0, wording=machine.wording)


def texts(content: Any, key: str = "") -> Iterator[str]:
    """Every text of a report that is not a name of the format: values, and keys of parameters."""
    if key in OF_THE_FORMAT:
        return
    if isinstance(content, dict):
        for name, value in content.items():
            yield from [name] if key == "parameters" else []
            yield from texts(value, name)
    elif isinstance(content, list):
        for value in content:
            yield from texts(value, key)
    elif isinstance(content, str):
        yield content


def without_effect_names(text: str) -> str:
    """A text without the names of the catalogue's effects and places, which no machine renames."""
    for name in sorted({effect.name for effect in CATALOGUE}, key=len, reverse=True):
        text = text.replace(name, "")
    return text


@pytest.mark.parametrize("shaken_n", [0.0, pytest.param(0.15, marks=pytest.mark.long)])
def test_a_linear_machine_speaks_of_metres_and_newtons(shaken_n: float, tmp_path: Path) -> None:
    """Fails when any sentence, table, parameter or unit of a linear axis is one of a rotary axis or of a hand."""
    machine = loaded(tmp_path, LINEAR, slide(shaken_n))
    result = diagnosed(machine)
    report = document(result, ["table.csv"], "machine.yaml")
    said = [without_effect_names(text) for text in texts(report)]
    first = report["remainder"][0] if shaken_n else report["findings"][0]
    assert shaken_n or first["effect"] == "coulomb_friction"
    assert (" mm RMS of the position" if shaken_n else "N is missing") in first["statement"]
    wrong = {
        text: NOT_LINEAR.findall(text.replace("_", " ")) for text in said if NOT_LINEAR.search(text.replace("_", " "))
    }
    assert not wrong
    if not shaken_n:
        friction = first["parameters"]["coulomb_friction.force_n"]
        assert friction["unit"] == "N"
        assert friction["value"] == pytest.approx(0.5, rel=0.15)
    assert {row["unit"] for row in report["fit"]} == {"mm"}
    write_page(result, report, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    hidden = r"<style>.*?</style>|<script>.*?</script>|\"int16\":\"[^\"]*\"|<summary>Settings.*?</details>|<[^>]*>"
    shown = re.sub(hidden, " ", page.replace("<wbr>", ""), flags=re.DOTALL)
    names = without_effect_names(shown.replace("_", " ").replace("coulomb friction", ""))
    for effect in CATALOGUE:
        names = names.replace(effect.name.replace("_", " "), "")
    assert not NOT_LINEAR.search(names), NOT_LINEAR.findall(names)


def test_a_rotary_machine_is_not_a_hand(tmp_path: Path) -> None:
    """Fails when the report of a rotary axis names pascal, a joint of the hand, or millimetres."""
    rotary = LINEAR | {"motion": "rotary", "name": "arm"} | PER_RADIAN
    machine = loaded(tmp_path, rotary, slide(0.0) * [1.0, 1.0, 10.0])
    report = document(diagnosed(machine), ["table.csv"], "machine.yaml")
    said = [without_effect_names(text) for text in texts(report)]
    assert {row["joint"] for row in report["fit"]} == {"axis"}
    assert {row["unit"] for row in report["fit"]} == {"deg"}
    wrong = {
        text: NOT_ROTARY.findall(text.replace("_", " ")) for text in said if NOT_ROTARY.search(text.replace("_", " "))
    }
    assert not wrong
    assert not set(machine.model.joints) & set(load_hand(default_model()).joints)


@pytest.mark.parametrize("linear", [True, False])
def test_every_parameter_has_the_machines_unit(linear: bool) -> None:
    """Fails when a parameter's key, factor or unit on a machine is not that of its dimension."""
    wording = wording_of(linear, per_torque=8.0, per_angle=0.2, per_input=5.0, per_force=8.0 * LEVER_M)
    units = {"m", "mm", "N", "kg"} if linear else {"rad", "deg", "N m", "kg m^2"}
    other = {"rad", "deg", "m2"} if linear else {"mm", "kg/s"}
    for parameter in JOINT_PARAMETERS:
        quantity = wording.units.quantity(parameter.key)
        words = set(re.split(r"[^a-zA-Z]+", quantity.unit))
        assert not words & {"Pa", "bar"} | words & other, (parameter.key, quantity)
        assert HAND.units.quantity(parameter.key).factor == 1.0
        assert HAND.units.quantity(parameter.key).key == parameter.key
    assert wording.units.quantity("coulomb_friction.torque_nm").unit in units
    damping = wording.units.quantity("dynamics.viscous_friction_nm_s_per_rad")
    assert damping.factor == pytest.approx(8.0 / 0.2)
    assert damping.unit == ("N s/m" if linear else "N m s/rad")
    mixed = wording.units.quantity("stiffening.mixed_nm_per_pa_rad2")
    assert mixed.factor == pytest.approx(8.0 / 5.0 / 0.2**2)
    assert mixed.unit == ("N/(input m^2)" if linear else "N m/(input rad^2)")
    gap = wording.units.quantity("backlash.gap_deg")  # one degree of the model, shown
    assert gap.factor == pytest.approx(0.2 * np.pi / 180.0 * 1e3 if linear else 0.2)
    assert gap.key == ("backlash.gap_mm" if linear else "backlash.gap_deg")


def test_no_sentence_is_edited_after_it_is_written() -> None:
    """Fails when a module of the diagnosis or of the machines replaces words in a text again."""
    for package in ("hand_diagnosis", "hand_machine"):
        for path in (ROOT / package).glob("*.py"):
            assert ".replace(" not in path.read_text(encoding="utf-8"), path


def test_the_documented_keys_are_the_accepted_ones(tmp_path: Path) -> None:
    """Fails when docs/machines.md lacks a key, documents one that is refused, or its example is not accepted."""
    text = (ROOT / "docs" / "machines.md").read_text(encoding="utf-8")
    begin = text.index("    schema: 1")
    example = "\n".join(line[4:] for line in text[begin : text.index("\n\n", begin)].splitlines())
    (tmp_path / "machine.yaml").write_text(example + "\n", encoding="utf-8")
    described = load_description(tmp_path / "machine.yaml")
    assert (described.name, described.linear, described.imposed) == ("seal_rig", True, True)
    documented = set(re.findall(r"^\| `([a-z_]+)[.a-z_]*` \|", text, re.MULTILINE))
    (tmp_path / "machine.yaml").write_text("wrong: 1\n", encoding="utf-8")
    with pytest.raises(DescriptionError, match="known here") as refused:
        load_description(tmp_path / "machine.yaml")
    assert set(str(refused.value).rpartition("known here: ")[2].split(", ")) <= documented
