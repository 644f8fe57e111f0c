"""Several recordings of one machine: loads of their own, and each left out of the fit in turn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.found_machine import write_machine_model
from hand_diagnosis.judgement import leave_one_out, withdrawn_rows
from hand_diagnosis.report import document, schema
from hand_identification.joint_data import joint_problem
from hand_identification.map_fit import map_fit
from hand_machine.machine import load_machine
from hand_model.yaml_loader import DescriptionError
from test.machine.loaded import diagnosed, errors, load

SECONDS, PERIOD_S, NOISE_RAD = 10.0, 0.005, 2e-4
STIFFNESS, DAMPING, INERTIA = 3.0, 0.05, 0.01
ARM: dict[str, Any] = {
    "schema": 1,
    "name": "arm",
    "motion": "rotary",
    "gain": {"value": 1.0, "exact": True},
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "inertia": INERTIA,
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "q"}},
}


def save(
    path: Path,
    seed: int,
    *,
    inertia: float = 0.0,
    weight: float = 0.0,
    supply: float = 1.0,
    soft: float = 1.0,
    friction: float = 0.0,
    seconds: float = SECONDS,
) -> None:
    """A recording of an arm with a load, by scipy.integrate.solve_ivp. inertia, weight: of the load; soft: a factor."""
    rng = np.random.default_rng(seed)
    knots = np.arange(0.0, SECONDS + 1.0, 0.7)
    levels = rng.uniform(-2.0, 2.0, len(knots))
    times = np.arange(0.0, seconds, PERIOD_S)

    def slope(t: float, y: np.ndarray) -> list[float]:
        torque = (
            supply * np.interp(t, knots, levels) - soft * (STIFFNESS * y[0] + DAMPING * y[1]) - weight * np.sin(y[0])
        )
        return [y[1], (torque - friction * np.tanh(y[1] / 0.01)) / (INERTIA + inertia)]

    q = solve_ivp(slope, (0.0, seconds), [0.0, 0.0], "LSODA", times, rtol=1e-7, atol=1e-9, max_step=0.02).y[0]
    measured = q + NOISE_RAD * rng.standard_normal(len(times))
    np.savez(path, t=times, u=np.interp(times, knots, levels), q=measured)


def test_loads_and_supplies_belong_to_their_recordings(tmp_path: Path) -> None:
    """Fails when a number of a recording acts in another one, not at all, or in another unit."""
    own = {
        "heavy.npz": {"added_inertia": 0.03, "added_weight": 1.2},
        "weak.npz": {"supply": 0.6},
    }
    save(tmp_path / "plain.npz", 1)
    save(tmp_path / "heavy.npz", 2, inertia=0.03, weight=1.2)
    save(tmp_path / "weak.npz", 3, supply=0.6)
    names = ("plain.npz", "heavy.npz", "weak.npz")
    stated = errors(load(tmp_path, ARM | {"recordings": own}, *names))
    assert max(stated) < 2.0 * NOISE_RAD
    left_out = errors(load(tmp_path, ARM, *names))
    assert left_out[0] < 2.0 * NOISE_RAD
    assert min(left_out[1:]) > 50.0 * NOISE_RAD


@pytest.mark.parametrize("reference_c", [None, 10.0])
def test_numbers_follow_the_temperature_of_a_recording(tmp_path: Path, reference_c: float | None) -> None:
    """Fails when a temperature is ignored, or acts in another recording or from another reference."""
    cold = 20.0 if reference_c is None else reference_c
    per_kelvin = {"per_kelvin": -0.01}
    arm = ARM | {
        "stiffness": {"value": STIFFNESS, **per_kelvin},
        "damping": {"value": DAMPING, "tolerance": 0.1, **per_kelvin},
        "recordings": {"warm.npz": {"temperature": cold + 30.0}, "cold.npz": {"temperature": cold}},
    }
    arm |= {} if reference_c is None else {"reference_temperature": reference_c}
    save(tmp_path / "warm.npz", 1, soft=0.7)
    save(tmp_path / "cold.npz", 2)
    assert max(errors(load(tmp_path, arm, "warm.npz", "cold.npz"))) < 2.0 * NOISE_RAD
    unstated = errors(load(tmp_path, arm | {"recordings": {}}, "warm.npz", "cold.npz"))
    assert unstated[1] < 2.0 * NOISE_RAD
    assert unstated[0] > 50.0 * NOISE_RAD
    with pytest.raises(DescriptionError, match=r"stiffness.per_kelvin is -0.01.*the allowed range is above 0"):
        load(tmp_path, arm | {"recordings": {"warm.npz": {"temperature": cold + 200.0}}}, "warm.npz")


def test_an_input_follows_the_temperature_of_a_recording(tmp_path: Path) -> None:
    """Fails when the gain does not depend on the temperature as stated."""
    save(tmp_path / "warm.npz", 1, supply=0.8)
    gain = {"value": 1.0, "exact": True, "per_kelvin": -0.005}
    arm = ARM | {"gain": gain, "recordings": {"warm.npz": {"temperature": 60.0}}}
    assert errors(load(tmp_path, arm, "warm.npz"))[0] < 2.0 * NOISE_RAD


def test_an_effect_is_tested_on_each_recording_left_out(tmp_path: Path) -> None:
    """Fails when an effect that all loads share is withdrawn, or errors on recordings left out are not given."""
    loads = {"a.npz": (0.0, 0.0), "b.npz": (0.02, 0.4), "c.npz": (0.03, 0.8)}
    for seed, (name, (inertia, weight)) in enumerate(loads.items()):
        save(tmp_path / name, seed, inertia=inertia, weight=weight, friction=0.15)
    own = {name: {"added_inertia": inertia, "added_weight": weight} for name, (inertia, weight) in loads.items()}
    machine = load(tmp_path, ARM | {"recordings": own}, *loads)
    result = diagnosed(machine, "coulomb_friction", "viscous_friction")
    report = document(result, list(loads), "machine.yaml")
    jsonschema.validate(report, schema())
    assert [finding["effect"] for finding in report["findings"]] == ["coulomb_friction"]
    assert report["withdrawn"] == []
    assert {row["recording"] for row in report["left_out"]} == set(loads)
    assert {row["unit"] for row in report["left_out"]} == {"deg"}
    for row in report["left_out"]:
        assert row["rmse_after"] < 0.2 * row["rmse_before"]
    write_machine_model(result, machine.description, list(loads), tmp_path / "model.yaml")
    again = load_machine(tmp_path / "model.yaml", [tmp_path / name for name in loads])
    after = np.radians([row["rmse_after"] for row in report["left_out"]])
    assert np.allclose(sorted(errors(again)), sorted(after), rtol=0.5)


@pytest.mark.parametrize("friction", [0.15, 0.0])
def test_an_effect_of_one_recording_alone_is_withdrawn(tmp_path: Path, friction: float) -> None:
    """Fails when friction that one recording does not have is kept, or withdrawn where both have it.

    The search would not accept it here, so that its result for the first recording is handed over.
    """
    save(tmp_path / "a.npz", 1, friction=0.15)
    save(tmp_path / "b.npz", 2, friction=friction)
    search = diagnosed(load(tmp_path, ARM, "a.npz"), "coulomb_friction").joints[0].search
    both = load(tmp_path, ARM, "a.npz", "b.npz")
    whole = joint_problem(both.signals, both.model, "axis")
    nominal, final = (map_fit(whole, fit.free, fit.z) for fit in (search.nominal, search.final))
    joined = replace(search, problem=whole, nominal=nominal, accepted=[replace(search.accepted[0], fit=final)])
    found = leave_one_out(whole, joined)
    assert found is not None
    rows = withdrawn_rows("axis", found, ())
    if friction:
        assert rows == []
        assert len(joined.accepted) == 1
        return
    assert [row["effect"] for row in rows] == ["coulomb_friction"]
    assert "does not carry over to recordings left out" in rows[0]["reason"]
    assert joined.accepted == []
    assert np.allclose(found.before, found.after, equal_nan=True)


@pytest.mark.parametrize(("soft", "kept"), [((1.25, 0.75), True), ((0.93, 0.93), False)], ids=["differ", "alike"])
def test_numbers_that_do_not_carry_over_are_not_written(
    tmp_path: Path, soft: tuple[float, float], *, kept: bool
) -> None:
    """Fails when numbers drawn away by a machine that differs between recordings replace those of the machine file, or
    numbers that hold on all recordings do not.
    """
    for seed, (name, factor) in enumerate(zip(("a.npz", "b.npz"), soft, strict=True)):
        save(tmp_path / name, seed, soft=factor)
    machine = load(tmp_path, ARM, "a.npz", "b.npz")
    result = diagnosed(machine)
    assert not result.findings
    write_machine_model(result, machine.description, ["a.npz", "b.npz"], tmp_path / "model.yaml")
    found = load_machine(tmp_path / "model.yaml", [tmp_path / "a.npz", tmp_path / "b.npz"])
    same = np.array_equal(found.model.parameters, machine.model.parameters)
    assert same == kept
    assert any("model.yaml keeps the latter" in line for line in result.check) == kept
    assert max(errors(found)) <= max(errors(machine))


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ({"a.npz": {"mass": 1.0}}, "mass is not a known key"),
        ({"a.npz": {"added_inertia": -1.0}}, "added_inertia is -1.0; the allowed range is 0"),
        ({"a.npz": {"temperature": 900.0}}, "temperature is 900.0; the allowed range is -100 to 500"),
        ({"a.npz": {"supply": 0.0}}, "supply is 0.0; the allowed range is 0.001 to 1000"),
        (["a.npz"], "recordings must be a mapping of file names"),
        ({"a.npz": 3.0}, "it must be a mapping"),
    ],
)
def test_bad_numbers_of_a_recording_are_refused_in_one_line(tmp_path: Path, entry: object, line: str) -> None:
    """Fails when a wrong key or value of a recording is ignored."""
    np.savez(tmp_path / "a.npz", t=np.zeros(3))
    with pytest.raises(DescriptionError) as refused:
        load(tmp_path, ARM | {"recordings": entry}, "a.npz")
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)
