"""Values of every equation of every effect, learned laws included, at drawn numbers: they change when an equation does.

test_effects.py says what is right for textbook forms; this file notices any other change, also in the terms of laws.
After a wanted change: python test/model/test_equation_values.py --write
"""

from __future__ import annotations

import json
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import EXOGENOUS, Effect, hook_arguments
from hand_model.kernel.rows import ROW

KEPT = Path(__file__).with_name("equation_values.json")
JOINT = load_hand(Path(__file__).resolve().parents[2] / "config" / "hand.yaml").parameters[:, 4]
CASES = 8
RANGES = {
    "h": (5e-4, 2e-3), "u": (-2e4, 6e5), "p": (0.0, 6e5), "reading": (0.0, 6e5), "error": (-2e5, 2e5),
    "limit": (1e5, 1e7), "phi": (-0.4, 1.7), "before": (-0.2, 1.5), "after": (-0.2, 1.5), "omega": (-3.0, 3.0),
    "creep_angle": (0.0, 0.2), "force": (0.0, 5.0),
}  # fmt: skip
SURROUNDINGS = ((0.0, 100.0), (-0.2, 1.5), (0.0, 5e6), (-50.0, 50.0), (-0.2, 1.5), (-3.0, 3.0), (-50.0, 50.0))


def plain(function: Any) -> Any:
    return getattr(function, "py_func", function)


def values(effect: Effect) -> dict[str, list[list[float]]]:
    """Results of every hook for drawn parameters, memory and arguments, flat, a list for each case."""
    rng = np.random.default_rng(zlib.crc32(effect.name.encode()))
    found: dict[str, list[list[float]]] = {hook: [] for hook in effect.hooks}
    for _ in range(CASES):
        q = [_drawn(parameter, rng) for parameter in effect.parameters] + [
            float(JOINT[ROW[key]]) for key in effect.reads
        ]
        h = float(rng.uniform(*RANGES["h"]))
        q += plain(effect.hooks["prepare"])(tuple(q), h) if effect.prepared else []
        sizes = {"angle": (-0.2, 1.5), "pressure": (0.0, 5e5)}
        m = tuple(float(rng.uniform(*sizes.get(str(start), (-0.5, 0.5)))) for start in effect.starts.values())
        e = tuple(float(rng.uniform(*each)) for each in SURROUNDINGS)
        assert len(e) == EXOGENOUS
        for hook, function in effect.hooks.items():
            drawn = {name: float(rng.uniform(*each)) for name, each in RANGES.items()}
            given = drawn | {"q": tuple(q), "m": m, "e": e, "h": h, "fills": bool(rng.random() < 0.5)}
            if hook == "prepare":
                given["q"] = tuple(q[: len(q) - len(effect.prepared)])
            result = plain(function)(*(given[name] for name in hook_arguments(hook, bool(effect.memory))))
            found[hook].append(_flat(result))
    return found


def _drawn(parameter: Any, rng: np.random.Generator) -> float:
    neutral = parameter.neutral if parameter.neutral is not None else parameter.typical
    value = neutral + rng.uniform(0.3, 1.5) * rng.choice([-1.0, 1.0]) * parameter.typical
    return float(np.clip(value, parameter.low, parameter.high) * parameter.scale)


def _flat(result: Any) -> list[float]:
    if isinstance(result, tuple):
        return [number for part in result for number in _flat(part)]
    return [float(f"{float(result):.11g}")]


@pytest.mark.parametrize("effect", [e for e in CATALOGUE if e.hooks], ids=lambda effect: str(effect.name))
def test_an_equation_gives_the_kept_values(effect: Effect) -> None:
    """Fails when a sign, factor, number or state of any term of an equation changes, and the kept values do not."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))[effect.name]
    found = values(effect)
    assert found.keys() == kept.keys()
    for hook, cases in found.items():
        for case, expected in zip(cases, kept[hook], strict=True):
            assert case == pytest.approx(expected, rel=1e-8, abs=1e-12, nan_ok=True), hook


if __name__ == "__main__" and sys.argv[1:] == ["--write"]:
    lines = [f'"{e.name}": {json.dumps(values(e))}' for e in CATALOGUE if e.hooks]
    KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
