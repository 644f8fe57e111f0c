"""One line of the list of results; `python -m validation.bench` shows its keys as columns."""

from __future__ import annotations

from typing import Any


def figure(name: str, ours: float, goal: float | None, unit: str, reference: float | None = None) -> dict[str, Any]:
    """Our figure, or with a reference its ratio to it; a goal bounds the ratio where there is one."""
    ratio = float(ours / reference) if reference else None
    other = None if reference is None else float(reference)
    return {"name": name, "ours": float(ours), "reference": other, "ratio": ratio, "goal": goal, "unit": unit}
