"""The numbers in force as report.json lists them, and the settings as the table of the documents."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from typing import Any

from hand_diagnosis.settings import SETTINGS, FitPass, Settings
from hand_identification.free_parameters import FARTHEST
from hand_identification.joint_problem import (
    BLOCK_S,
    CORRELATION_S,
    FLOOR,
    HELD_OUT_EVERY,
    MIN_FLOORS_TAKEN,
    SETTLING_S,
)


def numbers_in_force() -> dict[str, Any]:
    """All numbers on which a diagnosis depends, splits of the data included: `settings` and `fit_settings`."""
    return {"settings": document(), "fit_settings": _fit_settings()}


def _fit_settings() -> dict[str, Any]:
    """Numbers of the identification that act in a diagnosis, by name with units."""
    return {
        "floor_pa": FLOOR[0],
        "floor_rad": float(FLOOR[1]),
        "floor_n": FLOOR[2],
        "min_floors_taken": MIN_FLOORS_TAKEN,
        "correlation_s": CORRELATION_S,
        "settling_s": SETTLING_S,
        "block_s": BLOCK_S,
        "validation_every_block": HELD_OUT_EVERY,
        "max_tolerances": FARTHEST,
    }


def document(settings: Settings = SETTINGS) -> dict[str, Any]:
    """Every value by name, as report.json lists it; infinite values as text, JSON has none."""
    return {name: _plain(value) for name, value in asdict(settings).items()}


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return "inf" if value == math.inf else value


def markdown_table(settings: Settings = SETTINGS) -> str:
    """The settings as a Markdown table, one row each."""
    rows = ["| setting | value | unit | meaning | source | halved | doubled |", "|---|---|---|---|---|---|---|"]
    for entry in fields(settings):
        about = entry.metadata
        value = _shown(getattr(settings, entry.name))
        cells = [about[key] for key in ("unit", "meaning", "source", "halved", "doubled")]
        rows.append(f"| `{entry.name}` | {value} | " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(_shown(item) for item in value)
    if isinstance(value, FitPass):
        return f"({value.most}, {value.iterations}, {value.tolerance:g}, {value.step_s:g})"
    return f"{value:.6g}"
