"""Numbers of a machine that are exact stay what they are; the others move within their own tolerance."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.problem import Task, effects_without
from hand_identification.free_parameters import effect_free_parameters, nominal_free_parameters, probe_values
from hand_machine.description import load_description
from hand_machine.found_model import PARAMETER, WEIGHT, Found, write_found_model
from hand_machine.machine import Machine, load_machine
from hand_machine.wording import units_of
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import ROW
from hand_model.yaml_loader import DescriptionError

STIFFNESS, DAMPING, INERTIA, GAIN = 40.0, 0.8, 0.2, 2.0
SLIDE: dict[str, Any] = {
    "schema": 1,
    "name": "slide",
    "motion": "linear",
    "gain": GAIN,
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "inertia": INERTIA,
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}},
}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A driven mass on a spring, from an integrator of scipy."""
    time = np.arange(0.0, 12.0, 0.01)

    def drive(t: float) -> float:
        return float(np.sin(2.0 * t) + 0.5 * np.sin(5.3 * t) + 0.5 * np.sin(14.0 * t))

    def rates(t: float, state: np.ndarray) -> list[float]:
        return [state[1], (GAIN * drive(t) - STIFFNESS * state[0] - DAMPING * state[1]) / INERTIA]

    found = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10)
    path = tmp_path_factory.mktemp("slide") / "run.npz"
    np.savez(path, t=time, u=np.array([drive(t) for t in time]), x=found.y[0])
    return path


def machine(folder: Path, recording: Path, **keys: object) -> Machine:
    (folder / "machine.yaml").write_text(json.dumps(SLIDE | keys), encoding="utf-8")
    return load_machine(folder / "machine.yaml", [recording])


def test_small_numbers_are_used_as_stated(tmp_path: Path, recording: Path) -> None:
    """Fails when a small damping, stiffness or inertia is enlarged, or the ratio of two numbers changes by scaling."""
    small = {"stiffness": 1e-7, "damping": 1e-5, "inertia": 1e-3}
    model = machine(tmp_path, recording, **small).model
    values = {name: abs(float(model.parameters[ROW[key], 0])) for name, key in PARAMETER.items()}
    assert values["damping"] / values["inertia"] == pytest.approx(1e-2)
    assert values["stiffness"] / values["inertia"] == pytest.approx(1e-4)
    none = machine(tmp_path, recording, damping={"value": 0.0, "exact": True}).model
    assert none.parameters[ROW[PARAMETER["damping"]], 0] == 0.0


def test_exact_numbers_are_not_free_and_others_have_their_own_tolerance(tmp_path: Path, recording: Path) -> None:
    """Fails when an exact number is fitted, an effect changes it, or a number has the tolerance of another."""
    keys = {"gain": {"value": GAIN, "exact": True}, "inertia": {"value": INERTIA, "exact": True}}
    model = machine(tmp_path, recording, stiffness={"value": STIFFNESS, "tolerance": 0.2}, **keys).model
    free = {p.key: p for p in nominal_free_parameters(model.parameters[:, 0], 0.05, True, model.tolerances)}
    assert PARAMETER["gain"] not in free
    assert PARAMETER["inertia"] not in free
    shares = {
        name: free[PARAMETER[name]].scale / abs(free[PARAMETER[name]].centre) for name in ("stiffness", "damping")
    }
    assert shares == pytest.approx({"stiffness": 0.2, "damping": 0.05})
    names = {effect.name for effect in effects_without([], model)}
    assert "added_inertia" not in names
    assert {"coulomb_friction", "viscous_friction"} <= names


def test_a_wrong_number_is_found_next_to_exact_ones(tmp_path: Path, recording: Path) -> None:
    """Fails when the fit of a 10 % wrong stiffness misses the truth although gain and inertia are exact."""
    keys = {"gain": {"value": GAIN, "exact": True}, "inertia": {"value": INERTIA, "exact": True}}
    loaded = machine(tmp_path, recording, stiffness={"value": 1.1 * STIFFNESS, "tolerance": 0.2}, **keys)
    task = Task(
        signals=loaded.signals,
        model=loaded.model,
        joints=loaded.model.joints,
        effects=[],
        tolerance=0.05,
        seed=0,
        floors={},
    )
    problem, fit = task.nominal_fits()[0]
    columns, _ = problem.columns(fit.free, fit.z[None])
    nominal = loaded.model.parameters[:, 0]
    fitted = {name: columns[0, ROW[key]] / nominal[ROW[key]] for name, key in PARAMETER.items()}
    assert fitted["stiffness"] * 1.1 == pytest.approx(1.0, abs=0.01)
    assert (fitted["gain"], fitted["inertia"]) == (1.0, 1.0)


@pytest.mark.parametrize(
    ("number", "line"),
    [
        ({"value": 1.0, "exact": True, "tolerance": 0.1}, "stiffness.tolerance contradicts exact: true"),
        ({"value": 0.0, "tolerance": 0.1}, "stiffness.tolerance is relative and has no meaning for a value of 0"),
        ({"value": 1.0, "tolerance": 2.0}, "stiffness.tolerance is 2.0; the allowed range is 1e-06 to 1"),
        ({"value": 1.0, "exact": "yes"}, "stiffness.exact is 'yes'; it must be true or false"),
        ({"value": -1.0}, "stiffness.value is -1.0; the allowed range is 0 to 1e"),
        ({"tolerance": 0.1}, "stiffness.value is missing"),
        ({"value": 1.0, "error": 0.1}, "stiffness.error is not a known key"),
        ({"value": 1.0, "per_kelvin": 3.0}, "stiffness.per_kelvin is 3.0; the allowed range is -1 to 1"),
        ({"value": 0.0, "per_kelvin": 0.1}, "stiffness.per_kelvin is relative and has no meaning for a value of 0"),
    ],
)
def test_contradictory_numbers_are_refused(tmp_path: Path, number: dict[str, object], line: str) -> None:
    """Fails when a contradiction in the machine file is accepted or not named."""
    (tmp_path / "machine.yaml").write_text(json.dumps(SLIDE | {"stiffness": number}), encoding="utf-8")
    with pytest.raises(DescriptionError, match=line):
        load_description(tmp_path / "machine.yaml")


def test_a_damping_that_is_absent_has_a_linear_prior(tmp_path: Path, recording: Path) -> None:
    """Fails when viscous friction of a machine without damping can only be reached over many powers of ten.

    A logarithmic prior around a number that stands for none leaves a common damping seven standard deviations away.
    """
    key, effect = "dynamics.viscous_friction_nm_s_per_rad", EFFECTS["viscous_friction"]
    nominal = machine(tmp_path, recording, damping=0.0).model.parameters[:, 0]
    absent = next(p for p in effect_free_parameters(effect, nominal) if p.key == key)
    assert not absent.log
    assert abs(absent.coordinate(0.02)) < 3.0
    assert max(values[ROW[key]] for values in probe_values(effect, nominal)) > 0.01
    stated = machine(tmp_path, recording).model.parameters[:, 0]
    assert next(p for p in effect_free_parameters(effect, stated) if p.key == key).log


def test_a_gain_that_is_not_exact_may_change_over_the_travel(tmp_path: Path, recording: Path) -> None:
    """Fails when the gain is taken as constant over the travel, or an exact one as variable."""
    key = "statics.a3_nm_per_pa_rad"

    def free(**keys: object) -> set[str]:
        model = machine(tmp_path, recording, **keys).model
        return {p.key for p in nominal_free_parameters(model.parameters[:, 0], 0.1, True, model.tolerances)}

    assert key in free()
    assert key not in free(gain={"value": GAIN, "exact": True})


def test_a_weight_with_its_own_tolerance_is_free(tmp_path: Path, recording: Path) -> None:
    """Fails when a stated tolerance of the weight is ignored, or the weight moves though it has none or is exact."""
    key = WEIGHT

    def free(weight: object) -> dict[str, float]:
        model = machine(tmp_path, recording, motion="rotary", weight=weight).model
        found = nominal_free_parameters(model.parameters[:, 0], 0.1, True, model.tolerances)
        return {each.key: each.scale / abs(each.centre or 1.0) for each in found}

    assert free({"value": 5.0, "tolerance": 0.03})[key] == pytest.approx(0.03)
    assert key not in free(5.0)
    assert key not in free({"value": 5.0, "exact": True})
    with pytest.raises(DescriptionError, match=r"weight.value is 5.0; the allowed range is 0 to 0"):
        machine(tmp_path, recording, weight={"value": 5.0, "tolerance": 0.03})


def test_a_position_command_with_its_controller(tmp_path: Path) -> None:
    """Fails when the controller's law is not that of the model, its numbers are fitted, or model.yaml repeats them."""
    servo = {
        "schema": 1,
        "name": "servo",
        "motion": "rotary",
        "controller": {"stiffness": 12.0, "damping": 0.4},
        "stiffness": {"value": 3.0, "tolerance": 0.2},
        "inertia": 0.05,
        "columns": {"time": {"column": "t"}, "input": {"column": "goal"}, "position": {"column": "q"}},
    }
    (tmp_path / "servo.yaml").write_text(json.dumps(servo), encoding="utf-8")
    described = load_description(tmp_path / "servo.yaml")
    assert (described.gain, described.stiffness, described.damping) == (12.0, 15.0, 0.4)
    assert described.tolerances["gain"] == 0.0
    assert "damping" not in described.tolerances
    assert described.tolerances["stiffness"] == pytest.approx(0.2 * 3.0 / 15.0)
    units = units_of(False, per_torque=1.0, per_angle=1.0, per_input=1.0)
    found = Found({"statics.a1_nm_per_rad": -15.5}, {}, {"statics.a1_nm_per_rad": 0.01}, frozenset())
    write_found_model(described, units, found, tmp_path / "model.yaml", "found")
    again = load_description(tmp_path / "model.yaml")
    assert again.stiffness == pytest.approx(15.5, abs=0.01)
    assert again.gain == 12.0
    for part, key in (({"gain": 2.0}, "gain"), ({"imposed": True}, "controller")):
        (tmp_path / "servo.yaml").write_text(json.dumps(servo | part), encoding="utf-8")
        with pytest.raises(DescriptionError, match=f": {key} "):
            load_description(tmp_path / "servo.yaml")
