"""The end of `hand demo`: how often its diagnosis names the effect that was drawn and concealed, and how long it takes.

Each run draws an effect, its size, a finger and a joint from its seed, as `hand demo` does. The processor time is that
of the process of the diagnosis, and hardly depends on other programs.
"""

from __future__ import annotations

import resource
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from hand_model.description import load_hand
from hand_tool.demo_diagnosis import conceal_and_diagnose
from hand_tool.machine_load import LoadMeter
from validation.bench.result import figure

SEEDS = range(1, 13)
QUICK_SEED = 5
MODEL = Path(__file__).parents[2] / "config" / "hand.yaml"
GOAL_S = 20.0


def run(quick: bool) -> list[dict[str, Any]]:
    """Share of SEEDS that are wrong, and times of their diagnoses; quick: one seed."""
    seeds = [QUICK_SEED] if quick else SEEDS
    print(f"seeds {', '.join(map(str, seeds))}")
    meter = LoadMeter()
    rows = [conceal(seed) for seed in seeds]
    load = meter.load()
    wrong = sum(not row["right"] for row in rows) / len(rows)
    seconds, cpu_s = ([row[key] for row in rows] for key in ("seconds", "cpu_s"))
    return [
        figure("demo: concealed effects that are not named first in their joint", wrong, 0.0, "share") | {"rows": rows},
        figure("demo: diagnosis of a concealed effect, median", median(seconds), None, "s"),
        figure("demo: diagnosis of a concealed effect, longest", max(seconds), GOAL_S, "s"),
        figure("demo: diagnosis of a concealed effect, longest, CPU", max(cpu_s), GOAL_S, "s CPU"),
        figure("demo: load by other programs meanwhile", 0.0 if load is None else load.others, None, "share"),
    ]


def conceal(seed: int) -> dict[str, Any]:
    """One run of the end of the demo."""
    before_s = _cpu_s()
    with TemporaryDirectory() as folder:
        outcome = conceal_and_diagnose(load_hand(MODEL), MODEL, Path(folder), seed)
    row = {name: getattr(outcome, name) for name in ("seed", "concealed", "answer", "right", "seconds")}
    row["cpu_s"] = _cpu_s() - before_s
    print(f"{seed}: {outcome.concealed}; {outcome.answer}; {outcome.seconds:.1f} s", flush=True)
    return row


def _cpu_s() -> float:
    """CPU time [s] of the processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
