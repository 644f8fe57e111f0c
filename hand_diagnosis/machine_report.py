"""The diagnosis of another machine than a hand: its report, page, model.yaml and patch, in its units and words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hand_diagnosis.detection import detection_limits
from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.found_machine import write_machine_model
from hand_diagnosis.pages.page import write_page
from hand_diagnosis.patch import write_patch
from hand_diagnosis.problem import effects_without
from hand_diagnosis.report import document, write_json
from hand_machine.machine import Machine


def write_machine_report(
    machine: Machine,
    recordings: Sequence[str],
    out: Path,
    *,
    tolerance: float,
    seed: int,
    without: Sequence[str],
    made: Callable[[], Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """Diagnose a machine and write all files into a folder; the content of report.json.

    recordings: their names.  tolerance: relative standard deviation of the nominal numbers [-].  without: effects to
    leave out.  made: gives the entry `made` when the diagnosis is done.
    Raises ValueError for an effect that does not exist, OSError where a file cannot be written.
    """
    result = diagnose(
        machine.signals, machine.model, tolerance=tolerance, seed=seed, without=without, wording=machine.wording
    )
    described = machine.description
    content = document(result, recordings, str(described.path))
    if made is not None:
        content["made"] = dict(made())
    content["detection_limits"] = detection_limits(result, effects_without(without, machine.model))
    write_json(content, out)
    notes = write_machine_model(result, described, recordings, out / "model.yaml")
    write_patch(content, described.path, out, notes)
    write_page(result, content, out)
    return content
