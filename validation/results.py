"""Results of long runs, kept in docs/figures/results.json: what README and docs print comes from there.

The file maps a source ("bench/control", "faults", "trial", "referees", "reality", "paper") to its results, with the
command that gave them, the date, the commit and the machine.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
STORE = ROOT / "docs" / "figures" / "results.json"
LEAST_SOAK_H = 1.0
LIVE_FAMILIES = ("processes", "floods", "disk")
"""Families of faults that start processes: their times are those of the machine, and they are stored apart."""


def provenance(command: str) -> dict[str, str]:
    """Command, date, commit and machine of a run that ends now; a commit with local changes ends in `+`."""
    return {
        "command": command,
        "date": datetime.now(UTC).date().isoformat(),
        "commit": _commit(),
        "machine": f"{os.cpu_count()} cores, {_processor()}",
    }


def _commit() -> str:
    found = _git("rev-parse", "--short=7", "HEAD").strip()
    changed = _git("status", "--porcelain", "--untracked-files=no").strip()
    return (found or "unknown") + ("+" if changed else "")


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return done.stdout if done.returncode == 0 else ""


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def load() -> dict[str, Any]:
    """The stored results, a source each."""
    stored: dict[str, Any] = json.loads(STORE.read_text(encoding="utf-8"))
    return stored


def store(new: dict[str, Any]) -> None:
    """Replace these sources in the file and keep the others."""
    text = json.dumps(load() | new, indent=1, sort_keys=True, ensure_ascii=False)
    STORE.write_text(text + "\n", encoding="utf-8")


def _with_run(scores: dict[str, Any]) -> list[dict[str, Any]]:
    """The runs against plants of others in the order in which they were made, with this one; none is ever replaced."""
    kept: list[dict[str, Any]] = load().get("referees", {}).get("results", [])
    if any(run["commitment"] == scores["commitment"] for run in kept):
        raise ValueError(f"the run with the commitment {scores['commitment']} is stored already")
    made = scores["made"] | {"command": f"hand trial make OUT --plant {scores['plant']}"}
    kept_keys = ("commitment", "plant", "seed", "recordings", "kinds", "scores")
    groups = {name: group for name, group in scores["by_group"].items() if name.startswith("family: ")}
    by_family = {name: {score: group[score] for score in ("joint", "first", "clean")} for name, group in groups.items()}
    return [*kept, {"made": made, "by_group": by_family} | {key: scores[key] for key in kept_keys}]


def read_run(path: Path) -> dict[str, Any]:
    """Sources of a run's output: of benches, of faults, of a soak, of mutants, of a trial, of machines or of reality.

    Raises ValueError for anything else, and for a quick bench, campaign or soak, whose numbers are no measurement.
    """
    if path.is_dir():
        path = path / "scores.json"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise ValueError(f"{path}: cannot be read as JSON ({error})") from None
    if isinstance(data, dict) and "benches" in data:
        if data["quick"]:
            raise ValueError(f"{path} holds quick benches, which are no measurement; run them without --quick")
        about = {key: data[key] for key in ("date", "commit", "machine")}
        return {
            f"bench/{name}": {**about, "command": f"python -m validation.bench --only {name}", "results": results}
            for name, results in data["benches"].items()
        }
    if isinstance(data, dict) and "faults" in data:
        if data["size"] == "quick":
            raise ValueError(f"{path} holds the quick form of the campaign of faults; run make faults")
        return _campaign(data)
    if isinstance(data, dict) and "soak" in data:
        hours = data["soak"]["hours"]
        if hours < LEAST_SOAK_H:
            raise ValueError(f"{path} holds {hours:g} h of motion; run make soak HOURS={LEAST_SOAK_H:g} or more")
        about = {key: data[key] for key in ("date", "commit", "machine")}
        kept = {key: value for key, value in data["soak"].items() if key != "samples"}
        return {"soak": {**about, "command": f"make soak HOURS={hours:g}", "results": kept}}
    if isinstance(data, dict) and "scores" in data and data.get("plant", "trial") != "trial":
        return {"referees": {**provenance("hand trial make OUT --plant PLANT"), "results": _with_run(data)}}
    if isinstance(data, dict) and "scores" in data:
        return {"trial": {**data["made"], "command": "make proof", "results": data}}
    if isinstance(data, dict) and "mutation" in data:
        about = {key: data[key] for key in ("command", "date", "commit", "machine")}
        return {"mutation": {**about, "results": _with_groups(data["mutation"], about)}}
    if isinstance(data, dict) and "machines" in data:
        about = {key: data[key] for key in ("command", "date", "commit", "machine")}
        results = {key: data[key] for key in ("machines", "failed")}
        return {"machines": {**about, "results": results}, "machines/first": _first_runs(data)}
    if isinstance(data, dict) and "trial_rivals" in data:
        about = {key: data[key] for key in ("command", "date", "commit", "machine")}
        return {"trial_rivals": {**about, "results": data["trial_rivals"]}}
    for source in ("ablations", "proof"):
        if isinstance(data, dict) and source in data:
            about = {key: data[key] for key in ("command", "date", "commit", "machine")}
            return {source: {**about, "results": data[source]}}
    if isinstance(data, list) and data and "baselines" in data[0]:
        return {"reality": {**provenance("make proof DATA=folder"), "results": data}}
    if isinstance(data, list) and data and "quantity" in data[0]:
        return {"paper": {**provenance("hand reproduce --out out/paper"), "results": data}}
    raise ValueError(f"{path}: no results of benches, faults, a soak, a trial, mutants, machines or hand reproduce")


def _campaign(data: dict[str, Any]) -> dict[str, Any]:
    """The families of a campaign, those in virtual time and those that start processes as sources of their own.

    A family that was not run keeps its stored results, with the run that gave them in `made`.
    """
    about = {key: data[key] for key in ("date", "commit", "machine")}
    found = {}
    for source, command, live in (("faults", "make faults", False), ("faults/live", "make faults FULL=1", True)):
        new = [result for result in data["faults"] if (result["family"] in LIVE_FAMILIES) == live]
        if not new:
            continue
        stored, families = load().get(source, {"results": []}), {result["family"] for result in new}
        before = {key: stored[key] for key in ("command", *about) if key in stored}
        kept = [{"made": before} | result for result in stored["results"] if result["family"] not in families]
        found[source] = {**about, "command": command, "results": [*kept, *new]}
    return found


def _with_groups(groups: dict[str, Any], about: dict[str, str]) -> dict[str, Any]:
    """The stored groups of mutants, each with its own command, date and commit, and those of a run in their places."""
    if failed := [name for name, group in groups.items() if "error" in group]:
        raise ValueError(f"the mutation run of {', '.join(failed)} failed; it is no measurement")
    kept: dict[str, Any] = load().get("mutation", {}).get("results", {})
    return kept | {name: {**group, **about} for name, group in groups.items()}


def _first_runs(data: dict[str, Any]) -> dict[str, Any]:
    """The first stored run of each machine: the stored ones, and the new machines of a run with its date and commit.

    Only machines with a source of their own; the others accompanied the development of the tool.
    """
    stored = load().get("machines/first", {"results": []})
    known = {each["machine"] for each in stored["results"]}
    about = {key: data[key] for key in ("date", "commit")}
    new = [{**each, "first_run": about} for each in data["machines"] if _is_new(each, known)]
    return {
        **{key: data[key] for key in ("command", "date", "commit", "machine")},
        "results": [*stored["results"], *new],
    }


def _is_new(machine: dict[str, Any], known: set[str]) -> bool:
    return "repository" in machine["source"] and machine["machine"] not in known
