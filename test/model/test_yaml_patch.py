"""Patches of YAML files: what differs, put back into a file that keeps its comments."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from hand_model.yaml_loader import DescriptionError
from hand_model.yaml_patch import add_note, changes_between, leaves, patch_text, patched_text, read_patch, unified_diff

BEFORE = """# a hand
supply: {pressure_bar: 6.0}  # regulator
joints:
  - name: a          # first
    limits: {low: 0.0, high: 1.50}
    sensor: {channel: 1}

  # the second one
  - name: b
    sensor: {channel: 2}
old: 3
"""
AFTER = """joints:
  - name: b
    friction: {torque: 1.0e-3, speed: 2.0}
    sensor: {channel: 2}
  - name: a
    limits: {low: 0.1, high: 1.50}
    sensor: {channel: 1}
supply: {pressure_bar: 6.0}
effects: {gap: {value: 1.0, unit: mm}}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    """The file before and after, and the patch between them."""
    before, after, patch = (tmp_path / name for name in ("before.yaml", "after.yaml", "patch.yaml"))
    before.write_text(BEFORE, encoding="utf-8")
    after.write_text(AFTER, encoding="utf-8")
    changes = changes_between(before, after)
    add_note(changes, ("joints", "a", "limits", "low"), "± 0.01")
    patch.write_text(patch_text(changes, before, "why"), encoding="utf-8")
    return before, after, patch


def by_name(path: Path | str) -> object:
    """The content with the entries of the list by their names."""
    data = yaml.safe_load(path.read_text(encoding="utf-8") if isinstance(path, Path) else path)
    return data | {"joints": {entry["name"]: entry for entry in data["joints"]}}


def test_a_patch_gives_the_file_that_it_was_made_from(files: tuple[Path, Path, Path]) -> None:
    """Fails when a change, a new group or a removed key is lost, or something is changed that does not differ."""
    before, after, patch = files
    content = read_patch(patch)
    assert leaves(content["changes"]) == [
        ("joints", "b", "friction", "torque"),
        ("joints", "b", "friction", "speed"),
        ("joints", "a", "limits", "low"),
        ("effects", "gap", "value"),
        ("effects", "gap", "unit"),
        ("old",),
    ]
    assert by_name(patched_text(before, content)) == by_name(after)


def test_comments_order_and_numbers_stay(files: tuple[Path, Path, Path]) -> None:
    """Fails when the file loses a comment or another line than those that change is changed."""
    before, _, patch = files
    diff = unified_diff("x.yaml", BEFORE, patched_text(before, read_patch(patch)))
    changed = [line for line in diff.splitlines()[2:] if line[0] in "+-"]
    assert changed == [
        "-    limits: {low: 0.0, high: 1.50}",
        "+    limits: {low: 0.1, high: 1.50}",
        "+    friction: {torque: 1.0e-3, speed: 2.0}",
        "-old: 3",
        "+effects:",
        "+  gap: {value: 1.0, unit: mm}",
    ]


def test_a_reader_sees_what_stood_there(files: tuple[Path, Path, Path]) -> None:
    """Fails when the patch does not name its model, the earlier value or the note of a change."""
    text = files[2].read_text(encoding="utf-8")
    assert text.startswith("# why\nschema: 1\nmodel: before.yaml\nsha256: ")
    assert "        low: 0.1 # was 0.0; ± 0.01\n" in text
    assert "old: # removed" in text or "old: null # removed" in text or "old:  # removed" in text


@pytest.mark.parametrize(
    ("patch", "line"),
    [
        ("joints: {c: {limits: {low: 1.0}}}", "joints has no 'c'; it has: a, b"),
        ("old: {deep: 1.0}", "old is a single value"),
    ],
)
def test_a_patch_of_another_model_is_refused(tmp_path: Path, patch: str, line: str) -> None:
    """Fails when a change of an entry that the model does not have is dropped or invented."""
    model, changes = tmp_path / "model.yaml", tmp_path / "patch.yaml"
    model.write_text(BEFORE, encoding="utf-8")
    changes.write_text(f"schema: 1\nchanges: {{{patch}}}\n", encoding="utf-8")
    with pytest.raises(DescriptionError, match=line):
        patched_text(model, read_patch(changes))


@pytest.mark.parametrize("text", ["a: [1", "- 1\n", "schema: 2\nchanges: {}\n", "schema: 1\n"])
def test_a_file_that_is_no_patch_is_refused(tmp_path: Path, text: str) -> None:
    """Fails when another file passes for a patch."""
    path = tmp_path / "patch.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DescriptionError, match="patch"):
        read_patch(path)


def test_lines_that_occur_often_stay_out_of_the_difference() -> None:
    """Fails when equal lines of a long file are shown as removed and added again, or a hunk has wrong line numbers."""
    before = "".join(f"- name: {name}\n  lag: 0.05\n  fill: 1.0e+7\n  vent: 8.0e+6\n" for name in range(80))
    place = before.index("- name: 40")
    after = before[:place] + before[place:].replace("0.05", "0.06", 1)
    lines = unified_diff("x.yaml", before, after).splitlines()
    assert lines[2] == "@@ -159,7 +159,7 @@"
    assert [line for line in lines[3:] if line[0] != " "] == ["-  lag: 0.05", "+  lag: 0.06"]
    assert unified_diff("x.yaml", "", "a\n").splitlines()[2:] == ["@@ -0,0 +1 @@", "+a"]
    assert unified_diff("x.yaml", before, before) == ""
