"""Stored mutation runs as the tables of docs/testing.md; survivors.toml holds why survivors are kept."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from validation.tables import markdown, source_line

REASONS = Path(__file__).with_name("survivors.toml")
NOT_EXAMINED = "not examined yet"


class Kind(NamedTuple):
    """A kind of survivors: what they are, why no test can or should detect them, and which they are.

    survivors: for each module the changes, as `before -> after` of the changed line, without the rest of it where this
    is enough.
    """

    kind: str
    reason: str
    survivors: dict[str, list[str]]


def kinds() -> list[Kind]:
    """The kinds of survivors.toml."""
    return [Kind(**each) for each in tomllib.loads(REASONS.read_text(encoding="utf-8"))["kind"]]


def kind_of(survivor: Mapping[str, Any], known: list[Kind]) -> Kind | None:
    """The kind of a survivor of a run; None where survivors.toml does not have it."""
    for kind in known:
        for change in kind.survivors.get(survivor["module"], []):
            before, after = change.split(" -> ")
            if before in survivor["before"] and survivor["before"].replace(before, after, 1) == survivor["after"]:
                return kind
    return None


def survivors(entry: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Every survivor of the stored runs."""
    for group in entry["results"].values():
        yield from group["survivors"] or ()  # of the first runs, only numbers are kept


def groups_table(entry: Mapping[str, Any]) -> str:
    """A row for each group: modules, mutants, sample, share killed, and which run this was."""
    rows = []
    for name, group in sorted(entry["results"].items()):
        everything = group["mutants"] == group["total"]
        tested = "all" if everything else f"{group['mutants']} (seed {group['seed']})"
        share = f"{100.0 * group['killed'] / max(group['mutants'], 1):.1f} %"
        modules = ", ".join(f"`{module}`" for module in _shortened(group["modules"]))
        rows.append((name, modules, group["total"], tested, share, f"{group['date']}, {group['commit']}"))
    header = ("group", "modules", "mutants", "tested", "killed", "date and commit")
    table = markdown(header, rows)
    return f"{table}\n\nThe newest of these runs: {source_line(entry).removeprefix('Made by ')}"


def _shortened(modules: list[str]) -> list[str]:
    """The modules, those of a folder of effects as one pattern."""
    effects = [module for module in modules if module.startswith("hand_model/effects/")]
    return ["hand_model/effects/*.py", *(m for m in modules if m not in effects)] if effects else modules


def survivors_table(entry: Mapping[str, Any]) -> str:
    """A row for each kind of survivors, with an example and their number; those not examined last."""
    known = kinds()
    found: dict[str, list[str]] = {}
    for survivor in survivors(entry):
        kind = kind_of(survivor, known)
        name = kind.kind if kind else NOT_EXAMINED
        found.setdefault(name, []).append(_shown(survivor["module"], survivor["before"], survivor["after"]))
    rows = []
    for kind in known:
        module, changes = next(iter(kind.survivors.items()))
        example = _shown(module, *changes[0].split(" -> "))
        rows.append((kind.kind, example, kind.reason, len(found.get(kind.kind, ()))))
    rows += [(NOT_EXAMINED, example, "", 1) for example in found.get(NOT_EXAMINED, ())]
    return markdown(("kind", "example", "why it is kept", "in the stored lists"), rows)


def _shown(module: str, before: str, after: str) -> str:
    return f"`{before}` as `{after}` in `{module}`".replace("|", "\\|")
