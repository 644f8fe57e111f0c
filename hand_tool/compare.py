"""`hand compare`: two reports, two models or two recordings side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.origin import made
from hand_tool.paths import check_exists, check_folder

if TYPE_CHECKING:
    from hand_diagnosis.pages.compare import Comparison

LINES = 12


def compare(
    *,
    first: Annotated[Path, typer.Argument(metavar="A", help="A folder of hand diagnose, a hand.yaml or a recording.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another one of the same kind.")],
    out: Annotated[Path, typer.Option(help="Folder for compare.html and compare.json.")],
    model: Model = None,
    mapping: Annotated[
        Path | None, typer.Option("--map", help="YAML that names the columns, where recordings are tables.")
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
        if kinds[0] != "recording" and (model or mapping):
            raise ValueError("--model and --map are for recordings")
        compared = _compared(kinds[0], first, second, model, mapping)
        content = write_comparison(compared, (str(first), str(second)), out, made())
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


def _compared(kind: str, first: Path, second: Path, model: Path | None, mapping: Path | None) -> Comparison:
    from hand_diagnosis.pages.compare import compare_models, compare_recordings, compare_reports, load_report
    from hand_model.description import load_hand

    if kind == "report":
        return compare_reports(load_report(first), load_report(second))
    if kind == "model":
        return compare_models(load_hand(first), load_hand(second))
    from hand_diagnosis import read_recording

    hand = load_hand(choose_model(model).path)
    return compare_recordings(*(read_recording(path, hand, mapping=mapping) for path in (first, second)))
