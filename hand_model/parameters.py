"""Every parameter of a joint: those of the plain plant, then those of the effects of the catalogue.

The order of JOINT_PARAMETERS is the row order of every parameter array, (rows, joints), in SI units.
"""

from __future__ import annotations

from hand_model.effects import EFFECT_PARAMETERS
from hand_model.plant_parameters import DEGREE, PLANT_PARAMETERS, STEP_S, Parameter

__all__ = ["DEGREE", "JOINT_PARAMETERS", "ROW", "STEP_S", "Parameter", "markdown_table"]

JOINT_PARAMETERS: tuple[Parameter, ...] = PLANT_PARAMETERS + EFFECT_PARAMETERS

ROW: dict[str, int] = {parameter.key: row for row, parameter in enumerate(JOINT_PARAMETERS)}
"""Row of a parameter by its key."""


def markdown_table() -> str:
    """All parameters as a Markdown table, in row order; docs/model.md carries it."""
    rows = ["| key in hand.yaml | range | if left out | meaning |", "|---|---|---|---|"]
    for parameter in JOINT_PARAMETERS:
        default = "an error" if parameter.neutral is None else f"{parameter.neutral:.4g}"
        bounds = f"{parameter.low:g} … {parameter.high:g}"
        rows.append(f"| `{parameter.key}` | {bounds} | {default} | {parameter.doc} |")
    return "\n".join(rows) + "\n"
