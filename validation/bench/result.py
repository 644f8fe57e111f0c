"""One line of a bench's results, and the rule that says whether its goal is reached."""

from __future__ import annotations

from typing import Any

KEYS = ("name", "ours", "reference", "ratio", "goal", "unit")
"""Keys of a result; `rows`, the lines of a table behind it, may come in addition."""


def figure(name: str, ours: float, goal: float | None, unit: str, reference: float | None = None) -> dict[str, Any]:
    """One result with the keys KEYS.

    ours: this project's value [unit].  reference: the same of what it is compared with; the ratio is then ours over
    reference.  goal: upper bound of the ratio where there is a reference, else of our value; None where there is none.
    """
    ratio = float(ours / reference) if reference else None
    other = None if reference is None else float(reference)
    return {"name": name, "ours": float(ours), "reference": other, "ratio": ratio, "goal": goal, "unit": unit}


def reached(result: dict[str, Any]) -> bool | None:
    """Whether the goal is reached, None where there is no goal."""
    if result["goal"] is None:
        return None
    value = result["ours"] if result["ratio"] is None else result["ratio"]
    return bool(value <= result["goal"])
