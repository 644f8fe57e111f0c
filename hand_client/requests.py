"""What a user asks of a running hand, checked before anything is sent. Errors are one line."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence

from hand_model.description import Hand


def parse_moves(words: Sequence[str], hand: Hand) -> dict[str, float]:
    """Angles [rad] by joint from words JOINT=ANGLE; the angle is in rad, or in degrees with the ending deg.

    Raises ValueError for a word of another form, an unknown or repeated joint, or an angle outside its limits.
    """
    angles: dict[str, float] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            raise ValueError(f"{word!r} is not of the form JOINT=ANGLE, such as {hand.joints[0]}=0.8 or =45deg")
        joint = known_joint(name.strip(), hand)
        if joint in angles:
            raise ValueError(f"joint {joint} is given twice")
        angles[joint] = _angle(joint, text.strip(), hand)
    return angles


def known_joint(name: str, hand: Hand) -> str:
    """The full name of a joint of the hand, also from a name without its prefix. Raises ValueError."""
    full = name if name in hand.joints else hand.prefix + name
    if full in hand.joints:
        return full
    near = difflib.get_close_matches(name, hand.joints, 1)
    meant = f"; did you mean {near[0]}?" if near else ";"
    raise ValueError(f"joint {name!r} is unknown{meant} the joints are {', '.join(hand.joints)}")


def _angle(joint: str, text: str, hand: Hand) -> float:
    degrees = text.endswith("deg")
    try:
        value = float(text.removesuffix("deg"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{joint} is {text!r}; it must be a number in rad, or in degrees such as 45deg")
    angle = math.radians(value) if degrees else value
    index = hand.joints.index(joint)
    low, high = float(hand.limits.low_rad[index]), float(hand.limits.high_rad[index])
    if not low <= angle <= high:
        in_deg = f"{math.degrees(low):.0f} to {math.degrees(high):.0f} degrees"
        raise ValueError(f"{joint} is {text}; the allowed range is {low:.3f} to {high:.3f} rad ({in_deg})")
    return angle
