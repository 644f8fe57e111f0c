"""What colours and ghosts of a page mean, in words."""

from __future__ import annotations

from html import escape

from hand_model.description import Hand

LIVE = (
    "Solid: the measured hand, orange where it does not do what the model expects. Blue ghost: the model on its own; it"
    " is visible only where it differs from the hand. Spheres: forces."
)
REPLAY = (
    "Solid: the measured hand, coloured where it differs from the model. Ghosts: the model before (blue) and"
    " {second} (green); they are visible only where they differ from the hand."
)


def switching(hand: Hand) -> str:
    """A line about a hand whose valves differ from those of the model in a page; "" for analog valves."""
    if not hand.row("switching_valve.share").any():
        return ""
    return (
        f"valve_kind of {hand.path} is switching, but the model in the page has analog valves: ghosts, colours and What"
        " if show this difference, too"
    )


def legend(text: str, hand: Hand) -> str:
    """HTML of LIVE or REPLAY, and of what `switching` says."""
    warning = switching(hand)
    bold = f'<div id="valves" style="font-weight:600;overflow-wrap:anywhere">{escape(warning)}</div>' if warning else ""
    return f'<div style="padding:0 0.8em 0.4em;font-size:0.85em"><div id="legend">{escape(text)}</div>{bold}</div>'
