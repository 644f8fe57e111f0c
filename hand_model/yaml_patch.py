"""Changes of a YAML file as a file of their own, which a person reviews and `hand patch` applies to the file.

A patch names only what changes, at the place where the file has it; entries of a list go by their `name`. The file that
it is applied to keeps its comments, its order and the numbers that are not named.
"""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Any

from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from hand_model.yaml_document import FLOW_KEYS, YamlDocument, yaml_text
from hand_model.yaml_loader import DescriptionError

SCHEMA = 1
CHANGES = "changes"
KeyPath = tuple[str, ...]


def changes_between(before: Path, after: Path) -> CommentedMap:
    """What differs in `after`, in nested mappings; None stands for a key that it no longer has.

    Each value has a comment with what stood there. Raises OSError where a file cannot be read.
    """
    return _difference(YamlDocument(before).data, YamlDocument(after).data)


def _difference(old: Any, new: Any) -> CommentedMap:
    """Of two mappings."""
    found = CommentedMap()
    for key, value in new.items():
        if key not in old:
            found[key] = _in_block_style(value)
            if not isinstance(value, dict | list):
                found.yaml_add_eol_comment("new", key, column=0)
        elif value != old[key]:
            _put_difference(found, key, old[key], value)
    for key in old:
        if key not in new:
            found[key] = None
            found.yaml_add_eol_comment("removed", key, column=0)
    return found


def _put_difference(found: CommentedMap, key: str, old: Any, new: Any) -> None:
    if isinstance(old, dict) and isinstance(new, dict):
        found[key] = _difference(old, new)
    elif _named(old) and _named(new):
        found[key] = _difference({e["name"]: e for e in old}, {e["name"]: e for e in new})
    else:
        found[key] = _in_block_style(new)
        if not isinstance(new, dict | list):
            found.yaml_add_eol_comment(f"was {getattr(old, 'text', old)}", key, column=0)


def _named(value: Any) -> bool:
    """Whether a value is a list of mappings that have names."""
    return isinstance(value, list) and all(isinstance(entry, dict) and "name" in entry for entry in value)


def _in_block_style(value: Any) -> Any:
    """A value without the comments and the flow style of its file; the text of its numbers stays."""
    if not isinstance(value, dict):
        return value
    plain = CommentedMap()
    for key, inner in value.items():
        plain[key] = _in_block_style(inner)
        if not isinstance(inner, dict | list):
            plain.yaml_add_eol_comment("new", key, column=0)
    return plain


def leaves(changes: Mapping[str, Any], at: KeyPath = ()) -> list[KeyPath]:
    """Keys from the top to each changed value."""
    found: list[KeyPath] = []
    for key, value in changes.items():
        found += leaves(value, (*at, key)) if isinstance(value, dict) else [(*at, key)]
    return found


def add_note(changes: CommentedMap, path: KeyPath, note: str) -> None:
    """Add a note to the comment behind the value at a path."""
    inner: Any = changes
    for key in path[:-1]:
        inner = inner[key]
    attached = inner.ca.items.get(path[-1])
    before = attached[2].value.strip().removeprefix("# ") if attached else ""
    inner.yaml_add_eol_comment("; ".join(part for part in (before, note) if part), path[-1], column=0)


def patch_text(changes: CommentedMap, model: Path, comment: str) -> str:
    """The patch as a file. model: the file that it changes, named with its hash.  comment: lines at the top."""
    digest = hashlib.sha256(model.read_bytes()).hexdigest()
    top = CommentedMap(schema=SCHEMA, model=model.name, sha256=digest)
    top[CHANGES] = changes
    return "".join(f"# {line}\n" for line in comment.splitlines()) + yaml_text(top)


def read_patch(path: Path) -> Any:
    """The content of a patch. Raises DescriptionError for another file, OSError where it cannot be read."""
    try:
        data = YamlDocument(path).data
    except (YAMLError, UnicodeDecodeError) as error:
        raise DescriptionError(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA or not isinstance(data.get(CHANGES), dict):
        raise DescriptionError(f"{path} is no patch: it needs schema: {SCHEMA} and a mapping `{CHANGES}`")
    return data


def patched_text(model: Path, patch: Mapping[str, Any]) -> str:
    """The text of the model's file with the changes of a patch.

    Raises DescriptionError for an entry that the model does not have, OSError where it cannot be read.
    """
    try:
        document = YamlDocument(model)
    except (YAMLError, UnicodeDecodeError) as error:
        raise DescriptionError(f"{model} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(document.data, dict):
        raise DescriptionError(f"{model} is no mapping of keys, so a patch cannot change it")
    _put(document, document.data, patch[CHANGES], f"{model}: ", inside=False)
    return document.text()


def _put(
    document: YamlDocument, section: MutableMapping[str, Any], changes: Mapping[str, Any], where: str, *, inside: bool
) -> None:
    """Put changes into a section. inside: it is an entry of a list, where a new group stands before the last key."""
    for key, value in changes.items():
        if value is None:
            section.pop(key, None)
        elif not isinstance(value, dict):
            section[key] = value
        elif _named(section.get(key)):
            entries = {entry["name"]: entry for entry in section[key]}
            for name, inner in value.items():
                if name not in entries or not isinstance(inner, dict):
                    raise DescriptionError(f"{where}{key} has no {name!r}; it has: {', '.join(map(str, entries))}")
                _put(document, entries[name], inner, f"{where}{key}.{name}: ", inside=True)
        elif key in section and not isinstance(section[key], dict):
            raise DescriptionError(f"{where}{key} is a single value; the patch has a mapping there")
        elif key in section:
            _put(document, section[key], value, f"{where}{key}.", inside=inside)
        else:
            new = document.group(section, key, len(value)) if inside else _new(section, key, value)
            _put(document, new, value, f"{where}{key}.", inside=False)


def _new(section: MutableMapping[str, Any], key: str, value: Mapping[str, Any]) -> CommentedMap:
    """An empty mapping at the end of a section, for what a patch has there."""
    new = CommentedMap()
    if len(value) <= FLOW_KEYS and not any(isinstance(inner, dict) for inner in value.values()):
        new.fa.set_flow_style()
    section[key] = new
    return new


def unified_diff(name: str, before: str, after: str) -> str:
    """The difference of two texts of the file `name`, as `diff -u` writes it; "" where they are equal."""
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    # difflib.unified_diff passes over lines that occur often, and then shows equal lines as changed.
    matcher = difflib.SequenceMatcher(None, old, new, autojunk=False)
    lines = [f"--- {name}\n", f"+++ {name}\n"] if old != new else []
    for group in matcher.get_grouped_opcodes():
        (_, a0, _, b0, _), (_, _, a1, _, b1) = group[0], group[-1]
        lines.append(f"@@ -{_span(a0, a1)} +{_span(b0, b1)} @@\n")
        for kind, i, k, m, n in group:
            if kind == "equal":
                lines += [f" {line}" for line in old[i:k]]
            else:
                lines += [f"-{line}" for line in old[i:k]] + [f"+{line}" for line in new[m:n]]
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)


def _span(begin: int, end: int) -> str:
    """Lines [begin, end), counted from 0, as the head of a hunk names them."""
    count = end - begin
    first = begin + 1 if count else begin
    return str(first) if count == 1 else f"{first},{count}"
