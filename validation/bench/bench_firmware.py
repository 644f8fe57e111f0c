"""Flash, RAM and cycles of the control law on a Cortex-M4, as `validation/cortex_m4.py` measures them."""

from __future__ import annotations

from typing import Any

from validation.bench.result import figure
from validation.cortex_m4 import SHARE, measure

UNITS = {"flash": "B", "ram": "B", "cycles": "cycles", SHARE: "%"}
GOALS = {SHARE: 50.0}


def run(quick: bool) -> list[dict[str, Any]]:
    """One tick of 11 joints; the quick form is the same. RuntimeError where compiler or emulator fail."""
    del quick
    return [
        figure(f"law on a Cortex-M4, 11 joints, single precision: {name}", value, GOALS.get(name), UNITS[name])
        for name, value in measure().items()
    ]
