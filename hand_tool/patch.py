"""`hand patch`: the changes that a diagnosis found, shown as a diff and written into a model's file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import note, running
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_file


def patch(
    *,
    model: Annotated[Path, typer.Argument(help="The file to change: hand.yaml or a machine file.")],
    changes: Annotated[Path, typer.Argument(metavar="PATCH", help="patch.yaml of hand diagnose.")],
    write: Annotated[
        bool, typer.Option("--write", help="Write the changes into MODEL. Default: only show them.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Write the changed model to this file instead.")] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show what a patch changes in a model, and with --write apply it. Comments and order of the file stay.

    The changed model must load; otherwise nothing is written.

    Example: hand patch config/hand.yaml out/diagnosis/patch.yaml --write

    Exit codes: 0 done, 2 bad usage, or a model or patch that cannot be used.
    """
    with running("patch"):
        if write and out is not None:
            raise ValueError("--write and --out cannot be used together: the first changes MODEL itself")
        chosen = choose_model(model)
        check_file(changes)
        from hand_model.yaml_patch import patched_text, read_patch, unified_diff

        content = read_patch(changes)
        before = model.read_text(encoding="utf-8")
        text = patched_text(model, content)
        target = out if out is not None else model
        written = _write_if_it_loads(text, model, target, keep=write or out is not None)
        chosen.print(as_json)
        if content.get("sha256") not in {None, chosen.sha256}:
            note(f"the patch was made for another version of {content.get('model', 'the model')}: check the diff")
        diff = unified_diff(model.name, before, text)
    if as_json:
        entries = {
            "model": str(model),
            "patch": str(changes),
            "diff": diff,
            "written": str(target) if written else None,
            "model_file": chosen.as_json(),
        }
        print(json.dumps(entries))
        return
    print(diff, end="")
    if not diff:
        print(f"the patch changes nothing in {model}")
    print(f"written: {target}" if written else "nothing is written; add --write to change the file")


def _write_if_it_loads(text: str, model: Path, target: Path, *, keep: bool) -> bool:
    """Write a model next to its target, load it, and put it in place. Raises ValueError where it does not load."""
    trial = target.with_name(f".{target.name}.patched")
    try:
        trial.write_text(text, encoding="utf-8")
        _load(trial)
        if keep:
            trial.replace(target)
    except ValueError as error:
        raise ValueError(
            f"{model} with this patch is no valid model: {str(error).replace(str(trial), target.name)}"
        ) from None
    finally:
        trial.unlink(missing_ok=True)
    return keep


def _load(path: Path) -> None:
    from hand_machine.description import is_machine_file, load_description

    if is_machine_file(path):
        load_description(path)
        return
    from hand_model.description import load_hand

    load_hand(path)
