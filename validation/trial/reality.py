"""Published recordings of real machines, diagnosed from a model without friction or gravity, and baselines for them.

The known effects are left out of the nominal model, and the ordinary command has to find them. The baselines are those
of `validation/trial/baselines.py`.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from validation.trial.arrays import Array
from validation.trial.baselines import imposed_baselines, moved_baselines

BAR_PA = 1e5
GRAVITY_M_S2 = 9.80665
TORQUE_NM_PER_V, BACK_EMF_V_S, ARMATURE_KG_M2 = 0.3867 / 4.017, 0.3867, 0.0018
"""Constants of the servo's motor, as the authors of the data publish them (Rhoban/bam, bam/params/xl330/m1.json)."""
DUTY_PER_RAD = 4096.0 / (2.0 * np.pi) / (256.0 * 885.0)
"""Duty of the servo's controller per rad and unit of its gain (Rhoban/bam, bam/dynamixel/actuator.py)."""
SWITCHED_OFF_S = 0.45
"""Time left out after the motor is switched off: the first half swing loses more energy than later ones."""
DRIVEN_KP = 100
"""Gain of the recordings with a driven motor: the authors call the controller's law uncertain at higher gains."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine and its recordings.

    known: effects that it has.  decoys: effects that it is not known to have.  description: the machine file.
    recordings: columns time [s], position, force, input of each.  published: value and source of published parameters.
    tolerance: relative error of the nominal parameters.
    """

    name: str
    known: tuple[str, ...]
    decoys: tuple[str, ...]
    description: dict[str, Any]
    recordings: dict[str, dict[str, Array]]
    published: dict[str, tuple[float, str]]
    tolerance: float


def machines(data: Path) -> list[Machine]:
    """The machines whose recordings are in a folder. FileNotFoundError: none are."""
    found = []
    cylinder, servo = data / "pneumatic_cylinder", data / "servo_pendulum"
    if cylinder.is_dir():
        found += [_seal(cylinder, "NAPN", 4.9087e-4), _seal(cylinder, "O-ring257", 5.1875e-4)]
    if servo.is_dir():
        found += _servo(servo)
    if not found:
        raise FileNotFoundError(f"{data}: neither pneumatic_cylinder nor servo_pendulum is there")
    return found


def _seal(folder: Path, seal: str, area_m2: float) -> Machine:
    recordings = {}
    for path in sorted(folder.glob(f"friction__{seal}_*bar.npz")):
        with np.load(path) as file:
            recordings[path.stem] = {
                "time": file["t_s"][15:],  # the author of the data leaves these samples out, too
                "position": -1e-3 * file["x_mm"][15:],
                "force": file["F_N"][15:],
                "input": BAR_PA * file["p_bar"][15:],
            }
    description = _description(f"seal_{seal}", "linear", {"gain": area_m2, "inertia": 0.1}, has_input=True)
    known = ("coulomb_friction", "hysteresis")
    return Machine(
        name=f"seal {seal}",
        known=known,
        decoys=("viscous_friction", "stiffening"),
        description=description,
        recordings=recordings,
        published={},
        tolerance=0.3,
    )


def _servo(folder: Path) -> list[Machine]:
    """The pendulum on the servo: driven, with its weight to be found; falling with the motor off, with its friction."""
    driven, falling, weight_nm = {}, {}, 0.0
    for path in sorted(folder.glob("*.json")):
        log = json.loads(path.read_text(encoding="utf-8"))
        rows = log["entries"]
        t, x, v, goal, on = (
            np.array([row[key] for row in rows], dtype=np.float64)
            for key in ("timestamp", "position", "speed", "goal_position", "torque_enable")
        )
        inertia, weight_nm = log["mass"] * log["length"] ** 2, log["mass"] * GRAVITY_M_S2 * log["length"]
        volts = log["vin"] * np.clip(log["kp"] * DUTY_PER_RAD * (goal - x), -1.0, 1.0)
        off = int(np.argmin(on)) if on.min() < 0.5 else len(t)
        name = f"servo_{log['kp']}_{log['trajectory']}"
        if log["kp"] == DRIVEN_KP:
            force = -TORQUE_NM_PER_V * (volts - BACK_EMF_V_S * v)
            driven[name] = {key: value[:off] for key, value in {"time": t, "position": x, "force": force}.items()}
        if off < len(t):
            part = slice(off + round(SWITCHED_OFF_S / log["dt"]), None)
            falling[name] = {"time": t[part], "position": x[part], "input": np.zeros(len(t[part]))}
    hanging_rad = float(np.mean([columns["position"][-1] for columns in falling.values()]))
    for columns in falling.values():
        columns["position"] = (
            columns["position"] - hanging_rad
        )  # the pendulum hangs down at the end of each fall; the sensor has another zero
    by_mass = {"gravity.sine_nm": (weight_nm, "mass and length of the rig, without the arm")}
    friction = {
        "coulomb_friction.torque_nm": (0.0128, "Rhoban/bam, xl330, model m1"),
        "dynamics.viscous_friction_nm_s_per_rad": (0.0037, "Rhoban/bam, xl330, model m1"),
    }
    rigid = _description("servo_driven", "rotary", {"inertia": inertia}, has_input=False)
    hanging = {"inertia": inertia + ARMATURE_KG_M2, "weight": weight_nm, "gain": 1.0}
    free = _description("servo_falling", "rotary", hanging, has_input=True, imposed=False)
    dry_and_wet, decoys = ("coulomb_friction", "viscous_friction"), ("stiffening", "hysteresis", "contact")
    return [
        Machine(
            name="servo, driven",
            known=("gravity",),
            decoys=("stiffening", "contact"),
            description=rigid,
            recordings=driven,
            published=by_mass,
            tolerance=0.1,
        ),
        Machine(
            name="servo, falling",
            known=dry_and_wet,
            decoys=decoys,
            description=free,
            recordings=falling,
            published=friction,
            tolerance=0.1,
        ),
    ]


def _description(
    name: str, motion: str, numbers: dict[str, float], *, has_input: bool, imposed: bool = True
) -> dict[str, Any]:
    names = ("time", "position", *(("force",) if imposed else ()), *(("input",) if has_input else ()))
    columns = {key: {"column": key} for key in names}
    base = {"schema": 1, "name": name.replace("-", "_").lower(), "motion": motion, "imposed": imposed}
    return base | {"stiffness": 0.0, "damping": 0.0, **numbers, "columns": columns}


def write_recordings(machine: Machine, folder: Path) -> list[Path]:
    """Write the machine file and the recordings of a machine into a folder; the paths of the recordings."""
    folder.mkdir(parents=True, exist_ok=True)
    description = folder / "machine.yaml"
    description.write_text(yaml.safe_dump(machine.description, sort_keys=False), encoding="utf-8")
    paths = []
    for name, columns in machine.recordings.items():
        paths.append(folder / f"{name}.npz")
        np.savez(paths[-1], **columns)  # type: ignore[arg-type]
    return paths


def examine(machine: Machine, out: Path, command: list[str]) -> dict[str, Any]:
    """Diagnose one machine and fit the baselines; the entry of reality.json.

    command: how to call the tool.  Errors are those of the force (N, N m) or of the position (deg).  RuntimeError: the
    diagnosis failed.
    """
    folder = out / machine.name.replace(",", "").replace(" ", "_")
    paths, description = write_recordings(machine, folder), folder / "machine.yaml"
    options = ["--machine", str(description), "--out", str(folder), "--tolerance", str(machine.tolerance), "--json"]
    done = subprocess.run(
        [*command, "diagnose", *map(str, paths), *options], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"{machine.name}: {done.stderr.strip().splitlines()[-1]}")
    report = json.loads(done.stdout)
    imposed = machine.description["imposed"]
    fit = next(row for row in report["fit"] if row["split"] == "test")  # an axis has one predicted signal
    numbers = {key: number for finding in report["findings"] for key, number in finding["parameters"].items()}
    found = [finding["effect"] for finding in report["findings"]]
    parts = [each["effect"] for left in report["remainder"] for each in left["candidates"]]
    return {
        "machine": machine.name,
        "recordings": len(paths),
        "verdict": report["verdict"],
        "findings": [
            {key: f[key] for key in ("effect", "probability", "parameters", "statement")} for f in report["findings"]
        ],
        "rivals": sorted({a["effect"] for f in report["findings"] for a in f["alternatives"]}),
        "known": list(machine.known),
        "found": [name for name in machine.known if name in found],
        "found_in_part": [name for name in machine.known if name in parts],
        "decoys_taken": [name for name in machine.decoys if name in (*found, *parts)],
        "published": [
            {"key": key, "published": value, "source": source, "ours": numbers.get(key)}
            for key, (value, source) in machine.published.items()
        ],
        "unit": fit["unit"],
        "before": fit["rmse_before"],
        "after": fit["rmse_after"],
        "baselines": (imposed_baselines if imposed else moved_baselines)(machine.description, machine.recordings),
    }
