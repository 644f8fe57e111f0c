"""patch.yaml and patch.diff: what a diagnosis changes in the model's file, for a person to review and to apply."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hand_model.yaml_patch import add_note, changes_between, leaves, patch_text, patched_text, read_patch, unified_diff

PATCH, DIFF, MODEL = "patch.yaml", "patch.diff", "model.yaml"


def write_patch(report: Mapping[str, Any], model: Path, out: Path, numbers: Mapping[str, str] | None = None) -> None:
    """Write both files next to model.yaml, which has the changes. model: the file that was diagnosed.

    report: the content of report.json, which knows the standard errors.  numbers: standard error and unit of other
    numbers of the file, by name.  A diagnosis without changes gives a patch
    without changes and an empty diff.  Raises OSError where they cannot be written.
    """
    changes = changes_between(model, out / MODEL)
    known = _standard_errors(report)
    for path in leaves(changes):
        own = next((part for part in reversed(path) if part != "value"), "")
        other = "" if "effects" in path else (numbers or {}).get(own, "")
        note = next((known[key] for key in _names(path, report) if key in known), other)
        if note:
            add_note(changes, path, note)
    comment = [
        f"What the diagnosis of {', '.join(report['recordings'])} changes in {model.name}: {report['verdict']}.",
        "Numbers are rounded to a tenth of the standard deviation that each has while the others keep theirs.",
        f"Apply it with: {command(str(model), out)}",
    ]
    (out / PATCH).write_text(patch_text(changes, model, "\n".join(comment)), encoding="utf-8")
    after = patched_text(model, read_patch(out / PATCH)) if changes else model.read_text(encoding="utf-8")
    diff = unified_diff(model.name, model.read_text(encoding="utf-8"), after)
    (out / DIFF).write_text(diff, encoding="utf-8")


def command(model: str, out: Path) -> str:
    """The command that applies the patch of an output folder to its model."""
    return shlex.join(["hand", "patch", model, str(out / PATCH), "--write"])


def shown(report: Mapping[str, Any], out: Path) -> dict[str, str]:
    """What the page says of the patch next to it: its diff and its command; empty where there is none."""
    path = out / DIFF
    if not path.is_file():
        return {}
    return {"diff": path.read_text(encoding="utf-8"), "command": command(str(report["model"]), out)}


def _standard_errors(report: Mapping[str, Any]) -> dict[tuple[str, str], str]:
    """By joint and parameter of the report, its standard error with its unit and the effect that needs it."""
    found = {
        (row["joint"], row["parameter"]): _error(row["std"], row["unit"]) + ", within its tolerance"
        for row in report["parameter_changes"]
    }
    for finding in report["findings"]:
        share = f"{finding['effect']} ({finding['probability']:.0%})"
        for name, number in finding["parameters"].items():
            found[finding["joint"] or "", name] = f"{_error(number['std'], number['unit'])}, {share}"
    return found


def _error(std: float, unit: str) -> str:
    return f"± {std:.1g}" + ("" if unit == "1" else f" {unit}")


def _names(path: tuple[str, ...], report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Joint and parameter, as the report may name them, of a changed value of the model's file."""
    joints = ["", *dict.fromkeys(row["joint"] for row in report["fit"])]
    own = [name for name in path if name in joints] or joints
    last = path[-2] if path[-1] == "value" else ".".join(path[-2:])
    prefixed = [joint for joint in joints for name in own if joint.endswith(name)]
    return [(joint, last) for joint in (*prefixed, "")]
