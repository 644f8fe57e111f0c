"""`hand compare`: two reports, two models or two recordings side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.origin import Origin
from hand_tool.paths import check_exists, check_folder

if TYPE_CHECKING:
    from hand_diagnosis.pages.compare import Comparison

LINES = 12


def compare(
    *,
    first: Annotated[
        Path,
        typer.Argument(metavar="A", help="A folder of hand diagnose, a hand.yaml or machine file, or a recording."),
    ],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another one of the same kind.")],
    out: Annotated[Path, typer.Option(help="Folder for compare.html and compare.json.")],
    model: Model = None,
    mapping: Annotated[
        Path | None, typer.Option("--map", help="YAML that names the columns, where recordings are tables.")
    ] = None,
    machine: Annotated[
        Path | None, typer.Option(help="The file of another machine, where recordings are of one.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show two reports, two models or two recordings side by side: where they differ, and by how much.

    Example: hand compare config/hand.yaml out/diagnosis/model.yaml --out out/compared

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    with running("compare", out / "compare.json", out / "compare.html") as outputs:
        for path in (first, second):
            check_exists(path)
        check_folder(out)
        from hand_diagnosis.pages.compare import kind_of, write_comparison

        kinds = [kind_of(path) for path in (first, second)]
        if kinds[0] != kinds[1]:
            raise ValueError(f"{first} is a {kinds[0]} and {second} a {kinds[1]}; both must be of one kind")
        if kinds[0] != "recording" and (model or mapping or machine):
            raise ValueError("--model, --map and --machine are for recordings")
        if machine and (model or mapping):
            raise ValueError("--model and --map cannot be used with --machine")
        origin = Origin(choose_model(machine or model) if kinds[0] == "recording" else None)
        models = ""
        if origin.model is not None:
            origin.model.print(as_json)
            compared = _recordings(first, second, origin.model.path, mapping, of_machine=machine is not None)
        else:
            compared, models = _models(first, second, as_json) if kinds[0] == "model" else _reports(first, second)
        content = write_comparison(compared, (str(first), str(second)), out, {"model": models} | origin.of_page())
        outputs.complete(out / "compare.json", out / "compare.html")
    if as_json:
        print(json.dumps(content))
        return
    print(compared.title)
    for row in compared.rows[:LINES]:
        print("  " + "  ".join(cell.text for cell in row))
    if len(compared.rows) > LINES:
        print(f"  and {len(compared.rows) - LINES} more on the page")
    print(f"written: {out / 'compare.html'}, {out / 'compare.json'}")


def _reports(first: Path, second: Path) -> tuple[Comparison, str]:
    """Two reports compared, and the models that they are about."""
    from hand_diagnosis.pages.compare import compare_reports, load_report
    from hand_pages.results import with_hash

    reports = [load_report(path) for path in (first, second)]
    hashes = [report.get("made", {}).get("model_sha256") for report in reports]
    models = [
        with_hash(report["model"], sha256) if sha256 else report["model"]
        for report, sha256 in zip(reports, hashes, strict=True)
    ]
    return compare_reports(*reports), "; ".join(dict.fromkeys(models))


def _models(first: Path, second: Path, as_json: bool) -> tuple[Comparison, str]:
    """Two models compared, and their names with hashes."""
    from hand_diagnosis.pages.compare_models import compare_hands, compare_machines
    from hand_machine.description import is_machine_file, load_description
    from hand_model.description import load_hand
    from hand_pages.results import with_hash

    chosen = [choose_model(path) for path in (first, second)]
    of_machine = [is_machine_file(path) for path in (first, second)]
    if any(of_machine) and not all(of_machine):
        kinds = ["a machine" if each else "a hand" for each in of_machine]
        raise ValueError(f"{first} describes {kinds[0]} and {second} {kinds[1]}; both must be of one kind")
    if all(of_machine):
        compared = compare_machines(load_description(first), load_description(second))
    else:
        compared = compare_hands(load_hand(first), load_hand(second))
    for model in chosen:
        model.print(as_json)
    return compared, "; ".join(with_hash(model.path, model.sha256) for model in chosen)


def _recordings(first: Path, second: Path, model: Path, mapping: Path | None, *, of_machine: bool) -> Comparison:
    from hand_diagnosis.pages.compare_recordings import compare_recordings

    if of_machine:
        from hand_machine.machine import load_machine

        loaded = load_machine(model, [first, second])
        a, b = loaded.signals
        return compare_recordings(a, b, loaded.wording)
    from hand_diagnosis import read_recording
    from hand_model.description import load_hand

    hand = load_hand(model)
    a, b = (read_recording(path, hand, mapping=mapping) for path in (first, second))
    return compare_recordings(a, b)
