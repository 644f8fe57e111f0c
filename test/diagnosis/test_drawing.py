"""The drawing of the hand in a report."""

from __future__ import annotations

import re
from pathlib import Path

import hand_diagnosis
from hand_diagnosis.pages.drawing import hand_drawing
from hand_diagnosis.settings import SETTINGS
from hand_model.description import load_hand
from test.diagnosis.recordings import CONFIG


def test_a_joint_that_was_not_diagnosed_is_grey_up_to_its_tip() -> None:
    """Fails when it is tinted like an error, or drawn with dashes, which end before the tip of a thick line."""
    hand = load_hand(CONFIG)
    drawn = hand_drawing(hand, dict.fromkeys(hand.joints), {})
    lines = re.findall(r'<line class="unknown"[^>]*stroke-opacity="([\d.]+)"', drawn)
    assert lines == [f"{SETTINGS.unjudged_tint:.2f}"] * len(hand.joints)
    template = (Path(hand_diagnosis.__file__).parent / "report.html").read_text(encoding="utf-8")
    (rule,) = re.findall(r"\.drawing \.unknown{([^}]*)}", template)
    assert "dasharray" not in rule and "opacity" not in rule
