"""Effects are offered only where what they need exists."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.problem import effects_not_offered, effects_without
from hand_machine.description import PARTS
from hand_machine.machine import AxisModel, load_machine
from hand_model.description import load_hand
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import NEEDS, OTHER_MACHINES
from hand_model.kernel.rows import ROW
from hand_model.yaml_loader import DescriptionError
from hand_recording.installed import default_model

SLIDE = {"schema": 1, "name": "slide", "motion": "linear", "gain": 1.0, "inertia": 0.2, "damping": 1.0}
COLUMNS = {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}}
ALWAYS = {"coulomb_friction", "viscous_friction", "stiffening", "hysteresis", "backlash", "end_stop", "constant_load"}


def model(folder: Path, seconds: float, **keys: object) -> AxisModel:
    """The model of a machine whose recording lasts for so long."""
    time = np.arange(0.0, seconds + 0.05, 0.1)
    np.savez(folder / "run.npz", t=time, u=np.sin(time), x=0.1 * np.sin(0.3 * time))
    content = SLIDE | {"columns": COLUMNS} | keys
    (folder / "machine.yaml").write_text(json.dumps(content), encoding="utf-8")
    return load_machine(folder / "machine.yaml", [folder / "run.npz"]).model


def offered(axis: AxisModel) -> set[str]:
    return {effect.name for effect in effects_without([], axis)}


def test_an_axis_that_turns_on_has_no_elastic_part(tmp_path: Path) -> None:
    """Fails when a loop or a spring of soft material stands for the friction of a wheel, or an arm has none."""
    elastic = {"hysteresis", "stiffening", "spring"}
    time = np.arange(0.0, 30.0, 0.1)
    for turned, motion, more, expected in (
        (6.2, "rotary", {}, elastic),
        (6.4, "rotary", {}, set()),
        (6.4, "rotary", {"stiffness": 0.5}, elastic),  # a spring of several turns is described
        (6.4, "rotary", {"weight": 0.5}, elastic),
        (6.4, "linear", {}, elastic),
    ):
        np.savez(tmp_path / "run.npz", t=time, u=np.ones_like(time), x=turned / 29.9 * time)
        keys = {"motion": motion, "columns": COLUMNS} | more
        (tmp_path / "machine.yaml").write_text(json.dumps(SLIDE | keys), encoding="utf-8")
        axis = load_machine(tmp_path / "machine.yaml", [tmp_path / "run.npz"]).model
        assert offered(axis) & elastic == expected, (turned, motion, more)


def test_a_wheel_that_turns_further_than_a_finger_has_no_stops(tmp_path: Path) -> None:
    """Fails when the stops of a finger hold a wheel back, or are offered to explain where it turns."""
    time = np.arange(0.0, 30.0, 0.1)
    np.savez(tmp_path / "run.npz", t=time, u=np.ones_like(time), x=2.0 * time)
    keys = {"motion": "rotary", "columns": COLUMNS}
    (tmp_path / "machine.yaml").write_text(json.dumps(SLIDE | keys), encoding="utf-8")
    wheel = load_machine(tmp_path / "machine.yaml", [tmp_path / "run.npz"]).model
    assert wheel.parameters[ROW["end_stop.stiffness_nm_per_rad"], 0] == 0.0
    assert "end_stop" not in offered(wheel)
    assert "coulomb_friction" in offered(wheel)


def test_a_plain_axis_is_offered_no_impossible_effect(tmp_path: Path) -> None:
    """Fails when a linear axis gets a magnet, a valve, warming within 30 s, or loses friction; or no line says so."""
    axis = model(tmp_path, 30.0)
    names = offered(axis)
    assert names >= ALWAYS
    impossible = {
        "hall_misalignment",
        "valve_lag",
        "valve_delay",
        "thermal_drift",
        "ageing",
        "gravity",
        "creep",
        "leak",
    }
    assert not names & (impossible | {"supply_droop", "joint_coupling", "fsr_drift", "pressure_offset"})
    line = effects_not_offered(axis)[0]
    assert all(effect.name in line for effect in CATALOGUE if effect.keys and effect.name not in names)


def test_each_need_offers_its_effects(tmp_path: Path) -> None:
    """Fails when a part, the kind of motion, a measured force or the duration does not offer what it makes possible."""
    assert "gravity" in offered(model(tmp_path, 30.0, motion="rotary"))
    assert {"thermal_drift", "ageing"} <= offered(model(tmp_path, 600.0))
    assert not {"thermal_drift", "ageing"} & offered(model(tmp_path, 599.0))
    for part in PARTS:
        found = offered(model(tmp_path, 30.0, motion="rotary", has=[part]))
        assert found >= {effect.name for effect in CATALOGUE if effect.keys and effect.needs == (part,)}, part
    fluid = {"tube_lag", "leak"}
    drive = {"drive_lag", "drive_saturation", "command_delay", "drive_gain"}
    assert offered(model(tmp_path, 30.0)) & (fluid | drive) == drive
    assert offered(model(tmp_path, 30.0, has=["chamber"])) & (fluid | drive) == fluid
    assert "clock_offset" in offered(model(tmp_path, 30.0, has=["input_sensor"]))
    assert not {"clock_offset", "cogging"} & offered(model(tmp_path, 30.0))
    forced = COLUMNS | {"force": {"column": "u"}}
    assert "fsr_gain" in offered(model(tmp_path, 30.0, imposed=True, inertia=0.0, columns=forced))
    everything = replace(model(tmp_path, 30.0), lacks=frozenset())
    assert offered(everything) == {effect.name for effect in CATALOGUE if effect.keys}


def test_exact_numbers_and_loads_withhold_effects(tmp_path: Path) -> None:
    """Fails when an exact gain or stiffness may change, or a shaft is elastic with loads on an unknown side."""
    exact = {"value": 2.0, "exact": True}
    names = {"spring", "drive_gain", "drive_elasticity", "gear_friction"}
    assert offered(model(tmp_path, 30.0, has=["motor"])) >= names
    assert names - offered(model(tmp_path, 30.0, has=["motor"], stiffness=exact)) == {"spring"}
    assert names - offered(model(tmp_path, 30.0, has=["motor"], gain=exact)) == {"drive_gain"}
    loads = {"run.npz": {"added_inertia": 0.1}}
    assert names - offered(model(tmp_path, 30.0, has=["motor"], recordings=loads)) == {"drive_elasticity"}
    assert names & offered(model(tmp_path, 30.0)) == {"spring", "drive_gain"}
    keys = {key: value for key, value in SLIDE.items() if key != "gain"} | {"controller": {"stiffness": 3.0}}
    (tmp_path / "servo.yaml").write_text(json.dumps(keys | {"columns": COLUMNS}), encoding="utf-8")
    assert "drive_gain" in offered(load_machine(tmp_path / "servo.yaml", [tmp_path / "run.npz"]).model)
    with np.load(tmp_path / "run.npz") as run:
        np.savez(tmp_path / "run.npz", **{**run, "u": 0.0 * run["u"]})  # released, by no drive
    assert "drive_gain" not in offered(load_machine(tmp_path / "servo.yaml", [tmp_path / "run.npz"]).model)


def test_a_hand_has_every_effect() -> None:
    """Fails when an effect of the hand is no longer offered, one of other machines is, or nothing can state a need."""
    hand = load_hand(default_model())
    own = {name for name, e in EFFECTS.items() if e.keys and OTHER_MACHINES.isdisjoint(e.needs)}
    assert {effect.name for effect in effects_without([], hand)} == own
    assert len(own) == len([e for e in CATALOGUE if e.keys]) - 9
    assert effects_not_offered(hand) == []
    assert {need for effect in CATALOGUE for need in effect.needs} == set(NEEDS)


@pytest.mark.parametrize(
    ("has", "line"),
    [
        ("valve", "has must be a list of supply, valve"),
        (["pump"], "has contains 'pump'; it must be a list of"),
        ([["valve"]], "has contains .*; it must be a list of"),
        (["magnetic_sensor"], "has contains magnetic_sensor, which only an axis with motion: rotary can have"),
    ],
)
def test_parts_that_are_wrong_are_refused(tmp_path: Path, has: object, line: str) -> None:
    """Fails when an unknown or impossible part is accepted."""
    with pytest.raises(DescriptionError, match=line):
        model(tmp_path, 30.0, has=has)


def test_damping_differs_by_direction_only_in_soft_material(tmp_path: Path) -> None:
    """Fails when an axis gets the law of silicone walls next to directional_friction, or a hand lacks it."""
    models = (model(tmp_path, 30.0), load_hand(default_model()))
    axis, hand = (next(each for each in effects_without([], of) if each.name == "viscous_friction") for of in models)
    assert set(hand.coefficients) - set(axis.coefficients) == {"viscous_friction.asymmetry"}
