"""Flash, RAM and cycles of the law on a Cortex-M4; `validation/cortex_m4.py` measures them."""

from __future__ import annotations

import shutil
from typing import Any

from validation.bench.result import figure
from validation.cortex_m4 import COMPILER, EMULATOR, SHARE, measure

UNITS = {"flash": "B", "ram": "B", "cycles": "cycles", SHARE: "%"}
GOALS = {SHARE: 50.0}


def run(quick: bool) -> list[dict[str, Any]]:
    del quick
    if shutil.which(COMPILER) is None or shutil.which(EMULATOR) is None:
        return []
    return [
        figure(f"law on a Cortex-M4, 11 joints, single precision: {name}", value, GOALS.get(name), UNITS[name])
        for name, value in measure().items()
    ]
