"""Identified numbers written into a description: its comments stay, and the difference is shown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hand_tool.chosen_model import ChosenModel, choose_model

if TYPE_CHECKING:
    from hand_identification.model_file import Changes


def check_target(model: Path | None, name: str, option: str, what: str) -> ChosenModel | None:
    """The description that --write changes, as it is before; None without --write.

    Raises ValueError for --write into no file, or without the name of what changes. option: that gives it.
    """
    if model is None:
        return None
    chosen = choose_model(model)
    if not name:
        raise ValueError(f"--write needs {option}: {what}")
    return chosen


def write_into(model: Path, changes: Changes, comment: str, resolutions: Changes) -> str:
    """Replace numbers of the description `model` and return the difference as a diff; empty where nothing changes.

    changes, resolutions: by joint and key, SI (hand_identification/model_file.py).  ValueError, and nothing written,
    where a joint is not in the description or the result would not load.
    """
    from hand_identification.model_file import write_model
    from hand_model.description import load_hand

    hand = load_hand(model)
    for joint in changes:
        if joint not in hand.joints:
            raise ValueError(f"{model}: --joint is {joint!r}; the description has: {', '.join(hand.joints)}")
    return replaced(model, lambda trial: write_model(hand, changes, trial, comment, resolutions=resolutions))


def replaced(model: Path, write: Callable[[Path], object]) -> str:
    """Replace the description `model` by what `write` writes to the path that it is given; return the difference.

    write: raises DescriptionError where the result would not load. ValueError, and nothing written, in this case.
    """
    from hand_model.description import DescriptionError
    from hand_model.yaml_patch import unified_diff

    before = model.read_text(encoding="utf-8")
    trial = model.with_name(f".{model.name}.identified")
    try:
        write(trial)
        after = trial.read_text(encoding="utf-8")
        trial.replace(model)
    except DescriptionError as error:
        raise ValueError(
            f"{model} with the identified numbers is no valid description: {str(error).replace(str(trial), model.name)}"
        ) from None
    finally:
        trial.unlink(missing_ok=True)
    return unified_diff(model.name, before, after)


def written_entries(chosen: ChosenModel | None, diff: str) -> dict[str, object]:
    """What --json adds: the file before the change with its hash, where it is written, and the difference."""
    return {} if chosen is None else {"model_file": chosen.as_json(), "written": str(chosen.path), "diff": diff}


def print_written(chosen: ChosenModel | None, diff: str) -> None:
    """Print which file is changed, the difference and where it is written; nothing without --write."""
    if chosen is None:
        return
    chosen.print()
    print(diff, end="")
    print(f"written: {chosen.path}" if diff else f"nothing changes in {chosen.path}")
