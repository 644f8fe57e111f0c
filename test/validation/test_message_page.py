"""docs/messages.md: every field of hand_msgs with its unit and its meaning."""

from __future__ import annotations

import re

import pytest

from validation.message_page import DEFINITIONS, Field, actions, fields, messages
from validation.results import ROOT


def test_every_definition_has_its_fields_in_the_page() -> None:
    """Fails when a message, an action or a field lacks in the page, has no meaning there, or its unit stays in it."""
    page = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
    for path in (*(DEFINITIONS / "msg").glob("*"), *(DEFINITIONS / "action").glob("*")):
        section = page.partition(f"### hand_msgs/{path.parent.name}/{path.stem}\n")[2].partition("\n###")[0]
        declared = re.findall(r"^[\w/]+(?:\[\])? +(\w+)", path.read_text(encoding="utf-8"), flags=re.M)
        shown = re.findall(r"^\| `(\w+)` \| [^|]+ \| ([^|]*) \| ([^|]*) \|$", section, flags=re.M)
        assert declared and declared == [name for name, _, _ in shown], path.name
        for name, _, meaning in shown:
            assert meaning.strip() and "[" not in meaning, f"{path.name}: {name}"


def test_the_page_shows_what_the_definitions_say() -> None:
    """Fails when units or parts of an action are exchanged; figures.check compares the page with these texts."""
    assert "| `pressure` | float64[] | Pa | gauge, one per name |" in messages()
    assert "| `max_torque` | float64 | N m | per joint; 0 or NaN: the configured limit |" in actions()
    goal, result = actions().partition("Result:\n")[::2]
    assert "`closure`" in goal and "`closure`" not in result and "`progress`" in result.partition("Feedback:\n")[2]


def test_a_field_without_a_unit_keeps_its_comment_whole() -> None:
    """Fails when a bracket inside a comment is taken for a unit, or a line that is no field is passed over."""
    assert list(fields("# purpose\n\nuint8 mode  # one of [1, 2]\n")) == [Field("mode", "uint8", "", "one of [1, 2]")]
    with pytest.raises(ValueError, match="no field"):
        list(fields("float64\n"))
