"""The row table of a joint: every array of parameters or state has its rows in this order.

    parameters of the plain plant | parameters of the effects       <- arrays of parameters end here
    | prepared constants | memory of the effects | state            <- working arrays of the loops

All values are in SI. Arrays of parameters are (rows of JOINT_PARAMETERS, joints).
"""

from __future__ import annotations

from hand_model.effects import CATALOGUE
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import DEGREE, PLANT_PARAMETERS, STEP_S, Parameter

__all__ = [
    "DEGREE",
    "JOINT_PARAMETERS",
    "MEMORY_ROW",
    "PREPARED_ROW",
    "ROW",
    "STARTS",
    "STATES",
    "STATE_ROW",
    "STEP_S",
    "WORK_ROWS",
    "Parameter",
    "effect_rows",
    "markdown_table",
    "memory_rows",
]

JOINT_PARAMETERS: tuple[Parameter, ...] = PLANT_PARAMETERS + tuple(
    parameter for effect in CATALOGUE for parameter in effect.parameters
)

ROW: dict[str, int] = {parameter.key: row for row, parameter in enumerate(JOINT_PARAMETERS)}
"""Row of a parameter by its key."""

_PREPARED = [f"{effect.name}.{name}" for effect in CATALOGUE for name in effect.prepared]
PREPARED_ROW: dict[str, int] = {name: len(ROW) + place for place, name in enumerate(_PREPARED)}
"""Row of a prepared constant by "effect.name"."""

_MEMORY = [(f"{effect.name}.{name}", start) for effect in CATALOGUE for name, start in effect.starts.items()]
MEMORY_ROW: dict[str, int] = {name: len(ROW) + len(_PREPARED) + place for place, (name, _) in enumerate(_MEMORY)}
"""Row of a memory by "effect.name"."""
STARTS: tuple[tuple[int, str], ...] = tuple(
    (MEMORY_ROW[name], start) for name, start in _MEMORY if isinstance(start, str)
)
"""Rows of memory that start at the first "angle" or "pressure"; the others start at 0."""

STATES = 4
"""Rows of a state: pressure [Pa], angle [rad], speed [rad/s], creeping ratio."""
STATE_ROW = len(ROW) + len(_PREPARED) + len(_MEMORY)
"""First row of the state in a working array."""
WORK_ROWS = STATE_ROW + STATES
"""Rows of a working array; a loop may append rows of its own."""


def effect_rows(effect: Effect, prepared: bool = True) -> tuple[int, ...]:
    """Rows of what an equation of the effect gets as q: own parameters, numbers read, prepared constants."""
    keys = (*(parameter.key for parameter in effect.parameters), *effect.reads)
    constants = tuple(PREPARED_ROW[f"{effect.name}.{name}"] for name in effect.prepared) if prepared else ()
    return tuple(ROW[key] for key in keys) + constants


def memory_rows(effect: Effect) -> tuple[int, ...]:
    """Rows of what an equation of the effect gets as m."""
    return tuple(MEMORY_ROW[f"{effect.name}.{name}"] for name in effect.starts)


def markdown_table() -> str:
    """All parameters as a Markdown table, in row order; docs/model.md carries it."""
    rows = ["| key in hand.yaml | range | if left out | meaning |", "|---|---|---|---|"]
    for parameter in JOINT_PARAMETERS:
        default = "an error" if parameter.neutral is None else f"{parameter.neutral:.4g}"
        bounds = f"{parameter.low:g} … {parameter.high:g}"
        rows.append(f"| `{parameter.key}` | {bounds} | {default} | {parameter.doc} |")
    return "\n".join(rows) + "\n"
