"""Recordings of real machines that others made, diagnosed from a model without friction and gravity, beside baselines.

The known effects are left out of the nominal model; the ordinary command has to find them. The same recordings are
given to six fixed friction models by least squares, the best on held-out data taken (as BAM compares its models;
Duclusaud et al. 2025), and to a sparse regression of the discrepancy (SINDy; Brunton, Proctor, Kutz 2016).
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Array = NDArray[np.float64]
BLOCK_S, HELD_OUT_EVERY = 1.25, 3
BAR_PA = 1e5
LOAD_WRAP, LOAD_MOST = 65536.0, 1500.0
"""The servo's log holds its load as unsigned 16 bits, interpolated across the wrap: such samples are dropped."""


@dataclass(frozen=True, slots=True)
class Machine:
    """name, effects known and not there, the machine file, columns of each recording: time, position, force, input."""

    name: str
    known: tuple[str, ...]
    decoys: tuple[str, ...]
    description: dict[str, Any]
    recordings: dict[str, dict[str, Array]]


def machines(data: Path) -> list[Machine]:
    """Those whose recordings lie in a folder. FileNotFoundError where there are none."""
    found = []
    cylinder, servo = data / "pneumatic_cylinder", data / "servo_pendulum"
    if cylinder.is_dir():
        found += [_seal(cylinder, "NAPN", 4.9087e-4), _seal(cylinder, "O-ring257", 5.1875e-4)]
    if servo.is_dir():
        found.append(_servo(servo))
    if not found:
        raise FileNotFoundError(f"{data}: neither pneumatic_cylinder nor servo_pendulum lies there")
    return found


def _seal(folder: Path, seal: str, area_m2: float) -> Machine:
    recordings = {}
    for path in sorted(folder.glob(f"friction__{seal}_*bar.npz")):
        with np.load(path) as file:
            recordings[path.stem] = {
                "time": file["t_s"][15:],  # as the author does
                "position": -1e-3 * file["x_mm"][15:],
                "force": file["F_N"][15:],
                "input": BAR_PA * file["p_bar"][15:],
            }
    description = _description(f"seal_{seal}", "linear", {"gain": area_m2, "inertia": 0.1}, has_input=True)
    known = ("coulomb_friction", "hysteresis")
    return Machine(f"seal {seal}", known, ("viscous_friction", "stiffening"), description, recordings)


def _servo(folder: Path) -> Machine:
    recordings = {}
    for path in sorted(folder.glob("*.json")):
        log = json.loads(path.read_text(encoding="utf-8"))
        if log["kp"] != 100 or log["trajectory"] == "lift_and_drop":
            continue
        rows = log["entries"]
        time, load = (np.array([row[key] for row in rows], dtype=np.float64) for key in ("timestamp", "load"))
        load = np.where(load > LOAD_WRAP / 2, load - LOAD_WRAP, load)
        good = np.abs(load) <= LOAD_MOST
        recordings[f"servo_{log['trajectory']}"] = {
            "time": time,
            "position": np.array([row["position"] for row in rows]),
            "force": -1e-3 * np.interp(time, time[good], load[good]),
            "input": np.zeros(len(time)),
        }
    description = _description("servo_pendulum", "rotary", {"inertia": 5e-3}, has_input=False)
    return Machine("servo pendulum", ("gravity", "coulomb_friction"), ("stiffening",), description, recordings)


def _description(name: str, motion: str, numbers: dict[str, float], *, has_input: bool) -> dict[str, Any]:
    columns = {key: {"column": key} for key in ("time", "position", "force", *(("input",) if has_input else ()))}
    base = {"schema": 1, "name": name.replace("-", "_").lower(), "motion": motion, "imposed": True}
    return base | {"stiffness": 0.0, "damping": 0.0, **numbers, "columns": columns}


def examine(machine: Machine, out: Path, command: list[str]) -> dict[str, Any]:
    """Diagnose one machine and fit the baselines; errors in N or N m."""
    folder = out / machine.name.replace(" ", "_")
    folder.mkdir(parents=True, exist_ok=True)
    description = folder / "machine.yaml"
    description.write_text(yaml.safe_dump(machine.description, sort_keys=False), encoding="utf-8")
    paths = []
    for name, columns in machine.recordings.items():
        paths.append(folder / f"{name}.npz")
        np.savez(paths[-1], **columns)  # type: ignore[arg-type]
    options = ["--machine", str(description), "--out", str(folder), "--tolerance", "0.3", "--json"]
    done = subprocess.run(
        [*command, "diagnose", *map(str, paths), *options], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"{machine.name}: {done.stderr.strip().splitlines()[-1]}")
    report = json.loads(done.stdout)
    held = next(f for f in report["fit"] if f["split"] == "held_out" and f["signal"] == "force")
    names = [finding["effect"] for finding in report["findings"]]
    return {
        "machine": machine.name,
        "recordings": len(paths),
        "verdict": report["verdict"],
        "findings": [
            {key: f[key] for key in ("effect", "probability", "parameters", "statement")} for f in report["findings"]
        ],
        "rivals": sorted({a["effect"] for f in report["findings"] for a in f["alternatives"]}),
        "known": list(machine.known),
        "found": [name for name in machine.known if name in names],
        "decoys_taken": [name for name in machine.decoys if name in names],
        "unit": held["unit"],
        "before": held["rmse_before"],
        "after": held["rmse_after"],
        "baselines": baselines(machine),
    }


def baselines(machine: Machine) -> dict[str, dict[str, float]]:
    """Train and held-out RMSE of six friction models and of a sparse regression, on the same blocks."""
    parts = [_features(machine, columns) for columns in machine.recordings.values()]
    rest, v, p, x, train = (np.concatenate([part[k] for part in parts]) for k in range(5))
    keep = train > 0.5
    speed = float(np.std(v))
    sign, one = np.tanh(v / (0.02 * speed)), np.ones(len(v))
    stribeck = sign * np.exp(-((v / (0.1 * speed)) ** 2))
    gravity = [np.sin(x), np.cos(x)] if machine.description["motion"] == "rotary" else []
    models = {
        "viscous": [v],
        "Coulomb": [sign],
        "Coulomb, viscous": [sign, v],
        "Coulomb, viscous, Stribeck": [sign, v, stribeck],
        "Coulomb, viscous, load": [sign, v, sign * p],
        "Coulomb, viscous, Stribeck, load, quadratic": [sign, v, stribeck, sign * p, stribeck * p, v * np.abs(v)],
    }
    errors = {}
    for name, columns in models.items():
        a = np.column_stack([one, *gravity, *columns])
        left = rest - a @ np.linalg.lstsq(a[keep], rest[keep], rcond=None)[0]
        errors[name] = _errors(left, keep)
    errors["SINDy discrepancy"] = _errors(rest - _sparse(np.column_stack([x, v, p, sign]), rest, keep), keep)
    return errors


def _errors(left: Array, keep: NDArray[np.bool_]) -> dict[str, float]:
    train, held = (float(np.sqrt(np.mean(left[part] ** 2))) for part in (keep, ~keep))
    return {"train": train, "held_out": held}


def _features(machine: Machine, columns: dict[str, Array]) -> tuple[Array, Array, Array, Array, Array]:
    """What the nominal model leaves of the force, speed, input [bar], position, and 1 for training samples."""
    t, x = columns["time"], columns["position"]
    period = float(np.median(np.diff(t)))
    span = max(2 * round(0.06 / period) + 1, 5)
    v, a = (savgol_filter(x, span, 3, deriv=k, delta=period) for k in (1, 2))
    gain = machine.description.get("gain", 0.0)
    rest = columns["force"] - gain * columns["input"] + machine.description["inertia"] * a
    block = ((t - t[0]) / BLOCK_S).astype(int)
    # The tool's own choice: one of every three, drawn alike.
    drawn = np.random.default_rng(HELD_OUT_EVERY).integers(HELD_OUT_EVERY, size=block[-1] // HELD_OUT_EVERY + 1)
    train = block % HELD_OUT_EVERY != drawn[block // HELD_OUT_EVERY]
    return rest, v, columns["input"] / BAR_PA, x, train.astype(float)


def _sparse(states: Array, rest: Array, keep: NDArray[np.bool_]) -> Array:
    """Sparse regression of the discrepancy over cubic monomials of the states, by PySINDy."""
    import pysindy  # noqa: PLC0415 - slow to load, and only here

    scale = np.maximum(states[keep].std(axis=0), 1e-12)
    library = pysindy.PolynomialLibrary(degree=3)
    features = np.asarray(library.fit_transform(states / scale), dtype=np.float64)
    optimizer = pysindy.STLSQ(threshold=0.05 * float(np.std(rest[keep])), alpha=1e-3, normalize_columns=False)
    optimizer.fit(features[keep], rest[keep][:, None])
    predicted: Array = (features @ np.asarray(optimizer.coef_, dtype=np.float64).T)[:, 0]
    return predicted
