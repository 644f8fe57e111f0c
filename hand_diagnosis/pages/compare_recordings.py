"""Two recordings side by side: their signals over one axis of time, and how far they differ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hand_diagnosis.pages.compare import Cell, Comparison
from hand_diagnosis.pages.page_plots import nth_shown
from hand_diagnosis.settings import SETTINGS
from hand_model.arrays import Array
from hand_model.quantities import HAND, Wording
from hand_pages.plots import Curve, Panel, Plot
from hand_recording.interpolation import in_force, interpolate
from hand_recording.signals import Signals

FIELDS = ("pressure_pa", "angle_rad", "force_n")
"""Fields of Signals in the order of Wording.signals."""
PRESSURE, ANGLE, FORCE = range(3)


def compare_recordings(first: Signals, second: Signals, wording: Wording = HAND) -> Comparison:
    """Signals of both over one axis of time, each from its own start, and their RMS difference.

    Of a hand and of a machine that its input moves: position or angle, and input or pressure. Of a machine that is
    moved from outside also the measured force, which comes first then. The joint whose first signal differs most is
    the first. Raises ValueError, one line, for recordings without a joint or a stretch in common.
    """
    joints = [joint for joint in first.joints if joint in second.joints]
    count = min(first.samples, int((second.samples - 1) * second.period_s / first.period_s) + 1)
    if not joints:
        raise ValueError(f"{first.name} and {second.name} have no {wording.axis} in common")
    stages = (FORCE, ANGLE, PRESSURE) if first.driven else (ANGLE, PRESSURE)
    nth = nth_shown(count * len(joints))
    pairs = [_pair((first, second), joint, count, nth, stages, wording) for joint in joints]
    leading = f"{wording.signals[stages[0]]}_rms"
    pairs.sort(key=lambda pair: -pair[0][leading])
    numbers = [pair[0] for pair in pairs]
    remarks = [
        f"Compared over the {(count - 1) * first.period_s:.3g} s that both have, each from its own first sample."
    ]
    commands = "inputs" if first.machine else "set-points"
    if not all(row["same_commands"] for row in numbers):
        remarks.append(f"Where the {commands} differ, the motions do too, whatever {wording.whole} is.")
    names = [wording.signals[stage] for stage in stages]
    rows = [
        (
            Cell(row["joint"]),
            *(Cell(_amount(row, name)) for name in names),
            Cell("equal" if row["same_commands"] else "different"),
        )
        for row in numbers
    ]
    return Comparison(
        _answer(numbers, names[0]),
        tuple(remarks),
        (wording.axis, *(f"{name}, RMS difference" for name in names), commands),
        tuple(rows),
        {"kind": "recording", "joints": numbers},
        tuple(pair[1] for pair in pairs),
    )


def _answer(numbers: Sequence[dict[str, Any]], name: str) -> str:
    worst = numbers[0]
    if len(numbers) == 1:
        return f"{worst['joint']}: the {name} differs by {_amount(worst, name)} RMS"
    return f"{worst['joint']} differs most: {_amount(worst, name)} RMS of the {name}"


def _amount(row: dict[str, Any], name: str) -> str:
    """The difference with its unit; the unit of an input is called as the input."""
    unit = row[f"{name}_unit"]
    return f"{row[f'{name}_rms']:.3g}{'' if unit == name else f' {unit}'}"


def _pair(
    both: tuple[Signals, Signals], joint: str, count: int, nth: int, stages: Sequence[int], wording: Wording
) -> tuple[dict[str, Any], Plot]:
    """The RMS differences of a joint over `count` samples of the first recording, and its plot of every nth one.

    Under each signal of both is its difference.
    """
    (first, second), period_s = both, both[0].period_s
    i, k, time_s = first.joints.index(joint), second.joints.index(joint), first.time_s[:count]
    numbers: dict[str, Any] = {"joint": joint}
    panels: list[Panel] = []
    parts = []
    for stage in stages:
        scale, unit = wording.signal_units[stage]
        name = wording.signals[stage]
        ours, theirs = getattr(first, FIELDS[stage])[:count, i], getattr(second, FIELDS[stage])[:, k]
        a, b = scale * ours, scale * interpolate(time_s, second.time_s, theirs, np.inf)
        numbers |= {f"{name}_rms": _rms(a - b), f"{name}_unit": unit}
        axis = (0.0, nth * period_s)
        curves = [Curve("A", "before", axis, a[::nth]), Curve("B", "after", axis, b[::nth])]
        label = name if name == unit else f"{name} [{unit}]"
        panels.append(Panel(f"{joint}: {label}", curves, 2.0 if panels else 3.0))
        apart = [Curve("A - B", "third", axis, (a - b)[::nth])]
        panels.append(Panel("A - B" if name == unit else f"A - B [{unit}]", apart, 1.5, zero=True))
        parts.append(f"{name} {_amount(numbers, name)}")
    held: Array = second.set_point_pa[in_force(time_s, second.time_s), k]
    numbers["same_commands"] = _rms(first.set_point_pa[:count, i] - held) <= SETTINGS.same_commands_pa
    alt = f"RMS difference of {joint}: {', '.join(parts)}"
    return numbers, Plot(label="time [s]", panels=panels, alt=alt, caption=f"{alt}.", group="time")


def _rms(difference: Array) -> float:
    return float(np.sqrt(np.mean(difference**2)))
