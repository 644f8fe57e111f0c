"""A pneumatic valve whose equations NASA wrote: progpy's PneumaticValveBase, with wear at random sizes, as a machine.

A spring holds a heavy piston; gas flows through orifices into the chambers below and above it, and leaks from both.
Commands open one chamber to the supply and the other to the air, so that the piston follows random levels between its
stops. Recorded are its position and the difference of the pressures of the chambers. Concealed are the wear of the seal
(more friction in proportion to the speed) and of the spring. The leaks of the model act before the measured pressures,
where a machine of one axis has no stage, and are left as they are.
Source: Daigle and Goebel, Int. J. Prognostics and Health Management 2(2), 2011; progpy 1.7.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from validation.referees.conditions import Conditions
from validation.referees.make import Case, kinds_in_order, planned_and_sealed
from validation.referees.shapes import Rng
from validation.trial.arrays import Array
from validation.trial.make import all_made

KINDS = {"single": 0.75, "null": 0.25}
STEP_S, FRAME_STEPS = 0.00025, 40
"""Step of progpy's explicit integration, and steps a sample: 100 Hz."""
FILLING_S, RECORDED_S = 1.0, 20.0
"""The first second, in which the empty chamber fills, is not recorded."""
LEVELS_M, HELD_S, BAND_M = (0.011, 0.027), (0.6, 1.6), 0.0005
"""Levels that the commands follow, for how long each, and how far the piston goes beyond them before they change."""
FLUID_PA = (3.5e5, 2.0e5)
"""Pressure of the fluid on both sides of the plug, which pushes the piston down."""
NOISE_PA, NOISE_M = 2e3, 2e-5
OFF = {"gain": 0.005, "stiffness": 0.02, "damping": 0.03, "inertia": 0.03}
"""Standard deviations of the numbers of the machine file, relative."""
WEAR = {"friction": (1.5, 4.0), "spring": (0.72, 0.9)}
"""Factors on friction and stiffness."""
EFFECTS = {"friction": "viscous_friction", "spring": "spring"}
STATES = {"friction": "r", "spring": "k"}
AXIS = "axis"
"""Name of the joint in reports on machines."""


def valve(changes: dict[str, float]) -> Any:
    """progpy's valve with changed initial states: r [N s/m], k [N/m]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the many packages that progpy imports
        from progpy.models.pneumatic_valve import PneumaticValveBase  # noqa: PLC0415 - slow to load, and only here

        model = PneumaticValveBase()
    model.parameters["x0"] = {**model.parameters["x0"], **changes}
    return model


def simulate(model: Any, rng: Rng) -> tuple[Array, Array]:
    """Difference of the pressures of both chambers (T,) [Pa] and position (T,) [m], after the chamber has filled."""
    inputs = [
        model.InputContainer({"pL": FLUID_PA[0], "pR": FLUID_PA[1], "uBot": up, "uTop": not up}) for up in (False, True)
    ]
    state, up, level, until_s = model.initialize(inputs[0]), True, LEVELS_M[0], 0.0
    rows = []
    for k in range(round((FILLING_S + RECORDED_S) / STEP_S)):
        position = float(state["x"])
        if k * STEP_S >= until_s:
            level, until_s = float(rng.uniform(*LEVELS_M)), until_s + float(rng.uniform(*HELD_S))
        if abs(position - level) > BAND_M:
            up = position < level
        if k % FRAME_STEPS == 0:
            out = model.output(state)
            rows.append((1e6 * (float(out["pB"]) - float(out["pT"])), float(out["x"])))
        state = model.next_state(state, inputs[up], STEP_S)
    pressure, position = np.array(rows[round(FILLING_S / STEP_S / FRAME_STEPS) :]).T
    return pressure, position


def machine_file(parameters: dict[str, Any], off: dict[str, float]) -> str:
    """The machine file of the valve. off: factors on its numbers."""
    area, initial = parameters["Ap"], parameters["x0"]
    down_n = parameters["m"] * parameters["g"] + (FLUID_PA[0] - FLUID_PA[1]) * parameters["Av"]
    return (
        "schema: 1\nname: pneumatic_valve\nmotion: linear\n"
        f"gain: {{value: {area * off['gain']:.8g}, tolerance: 0.01}}\n"
        f"stiffness: {initial['k'] * off['stiffness']:.8g}\n"
        f"damping: {initial['r'] * off['damping']:.8g}\n"
        f"inertia: {parameters['m'] * off['inertia']:.8g}\n"
        "columns:\n"
        "  time: {column: time_s}\n"
        f"  input: {{column: pressure_pa, offset: {-down_n / area:.8g}}}\n"
        f"  position: {{column: position_m, offset: {parameters['offsetX']:.8g}}}\n"
    )


def make_case(work: tuple[Case, str]) -> Case:
    """Simulate and record a case and fill in its truth; work: case, folder."""
    case, out = work
    rng = np.random.default_rng(case.seed)
    case.conditions, case.labels = asdict(Conditions()) | {"onset_s": None}, Conditions().labels()
    changes = dict[str, float]()
    if case.kind == "single":
        worn = str(rng.choice(list(WEAR)))
        factor = float(rng.uniform(*WEAR[worn]))
        changes[STATES[worn]] = factor * valve({}).parameters["x0"][STATES[worn]]
        case.families.append(f"worn {worn}")
        case.truth.append(
            {
                "effect": EFFECTS[worn], "place": "joint", "joint": AXIS, "multiple": 5.0, "size": factor,
                "group": [EFFECTS[worn]], "number": None,
            }
        )  # fmt: skip
    plain, model = valve({}), valve(changes)
    pressure, position = simulate(model, rng)
    folder = Path(out)
    case.model = f"models/case_{case.number:04d}/machine.yaml"
    (folder / case.model).parent.mkdir(parents=True)
    off = {name: float(np.clip(1.0 + share * rng.standard_normal(), 0.5, 1.5)) for name, share in OFF.items()}
    (folder / case.model).write_text(machine_file(plain.parameters, off), encoding="utf-8")
    np.savez(
        folder / "recordings" / f"case_{case.number:04d}.npz",
        time_s=np.arange(len(position)) * FRAME_STEPS * STEP_S,
        pressure_pa=pressure + NOISE_PA * rng.standard_normal(len(position)),
        position_m=position + NOISE_M * rng.standard_normal(len(position)),
    )
    return case


def make(
    out: Path,
    count: int,
    seed: int,
    key: bytes,
    *,
    jobs: int,
    progress: Callable[[float], None],
    tool: dict[str, Any] | None = None,
) -> str:
    """Write the folder of a trial on this valve; returns the commitment. Arguments: validation/referees/make.make."""
    (out / "recordings").mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    cases = [
        Case(k, int(rng.integers(2**31)), kind, "development", referee="progpy", motion="levels")
        for k, kind in enumerate(kinds_in_order(KINDS, count, rng))
    ]
    made = all_made(make_case, [(case, str(out)) for case in cases], jobs, progress)
    return planned_and_sealed(made, seed, tool, out, key)
