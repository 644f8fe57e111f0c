"""One machine: the ordinary commands on it, the rivals on the same recordings, and what is published.

`hand diagnose` gets the training recordings, `hand predict` the test recordings with the model.yaml that it wrote. No
number and no choice of either comes from the test recordings; nor for the rivals.
"""

from __future__ import annotations

import json
import resource
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hand_machine.description import load_description
from hand_machine.reading import read_machine
from validation.machines.cases import Case, files
from validation.machines.rivals import rival_errors

SIGMAS = 2.0
"""Standard errors within which a number agrees with the published one."""
ACCEPTED = 0.5
"""Probability above which a decoy counts as accepted."""
IN_THE_STAMPS = frozenset({"dropped_frames"})
"""Findings that are read off the time stamps; they explain no mismatch and are not ranked."""


def examine(case: Case, data: Path, out: Path, command: Sequence[str]) -> dict[str, Any]:
    """The entry of machines.json. command: how to call the tool.

    Errors are RMS values over the test recordings, in the unit of the report. RuntimeError: a command failed.
    FileNotFoundError: a recording is not there.
    """
    train, test = files(case, data, case.train), files(case, data, case.test)
    folder = out / case.name
    before = _cpu_s()
    options = ["--machine", str(case.machine), "--out", str(folder), "--tolerance", str(case.tolerance), "--json"]
    report = _run([*command, "diagnose", *map(str, train), *options], case.name)
    cpu_s = _cpu_s() - before
    model = folder / "model.yaml"
    nominal, found = (_predicted(command, case, test, path) for path in (case.machine, model))
    described = load_description(case.machine)
    rivals = rival_errors(
        described, [read_machine(described, path) for path in train], [read_machine(described, path) for path in test]
    )
    scale = {"mm": 1e3, "deg": 180.0 / np.pi}.get(found["unit"], 1.0)
    return {
        "machine": case.name,
        "title": case.title,
        "source": dict(case.source),
        "train": list(case.train),
        "test": list(case.test),
        "verdict": report["verdict"],
        **judged(case, report),
        "statements": [finding["statement"] for finding in report["findings"]],
        "published": published(case, report, yaml.safe_load(model.read_text(encoding="utf-8"))),
        "unit": found["unit"],
        "nominal": nominal["rmse"],
        "ours": found["rmse"],
        "noise_floor": found["noise_floor"],
        "rivals": {name: scale * error for name, error in rivals.items()},
        "cpu_s": cpu_s,
    }


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _run(arguments: Sequence[str], name: str) -> dict[str, Any]:
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{name}: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    content: dict[str, Any] = json.loads(done.stdout)
    return content


def _predicted(command: Sequence[str], case: Case, test: Sequence[Path], model: Path) -> dict[str, Any]:
    """RMS error and noise floor over the test recordings, each with its unit; one predicted signal an axis."""
    rows = _run([*command, "predict", *map(str, test), "--model", str(model), "--json"], case.name)["scores"]
    counts = np.array([row["samples"] for row in rows], dtype=np.float64)
    pooled = {
        key: float(np.sqrt(np.average([row[key] ** 2 for row in rows], weights=counts)))
        for key in ("rmse", "noise_floor")
    }
    return {**pooled, "unit": rows[0]["unit"]}


def judged(case: Case, report: Mapping[str, Any]) -> dict[str, Any]:
    """Which known effects and decoys the report has. first: its first finding, else the first part of a remainder.

    right: the first named effect is a known one.  partly: it is only a part of an unknown remainder.  in_class: it is
    not, and the report says that the data do not separate it from a known one.
    """
    ranked = [finding for finding in report["findings"] if finding["effect"] not in IN_THE_STAMPS]
    named = {finding["effect"]: float(finding["probability"]) for finding in ranked}
    parts = {
        each["effect"]: float(each.get("probability") or 0.0)
        for left in report["remainder"]
        for each in left.get("candidates", [])
    }
    first = next(iter(named or parts), None)
    every = frozenset().union(*case.known)
    tied = ranked[0].get("tied_with", ()) if ranked else ()
    return {
        "known": [" | ".join(sorted(group)) for group in case.known],
        "found": [" | ".join(sorted(group)) for group in case.known if group & set(named)],
        "in_part": [" | ".join(sorted(group)) for group in case.known if group & set(parts) - set(named)],
        "first": first,
        "right": first in every,
        "partly": first is not None and not named,
        "in_class": first not in every and bool(every & set(tied)),
        "effects": [{"effect": name, "probability": chance} for name, chance in named.items()],
        "decoys_taken": [name for name in case.decoys if max(named.get(name, 0.0), parts.get(name, 0.0)) > ACCEPTED],
    }


def published(case: Case, report: Mapping[str, Any], model: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Each published number and ours, of a finding or of the fitted machine; agrees: within SIGMAS of our errors."""
    ours = {key: number for finding in report["findings"] for key, number in finding["parameters"].items()}
    ours |= {key: value for key, value in model.get("effects", {}).items() if key not in ours}
    rows = []
    for key, entry in case.published.items():
        own = ours.get(key)
        std = own.get("std") if own else None
        agrees = None if own is None or std is None else abs(own["value"] - entry["value"]) <= SIGMAS * std
        rows.append({"key": key, "published": entry["value"], "source": entry["source"], "ours": own, "agrees": agrees})
    return rows
