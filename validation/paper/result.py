"""The reproduction of a figure or table of the paper: its picture, sentences and numbers, and how to run it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from hand_pages.plots import Plot

Progress = Callable[[float], None]
"""Called with the share done, 0 ... 1."""
IDS = ("table1", "fig06", "fig07", "fig08", "fig09", "fig10", "fig13", "fig14", "prony")
"""Every figure and table that is reproduced, by its name on the command line."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of this code and the paper's; paper is None where the paper prints none."""

    id: str
    quantity: str
    unit: str
    paper: float | None
    ours: float
    note: str = ""


@dataclass(frozen=True, slots=True)
class Reproduction:
    """A figure or table.

    id: its name on the command line, such as "fig13".  shows: what the paper shows.  gets: the result of this code,
    with its numbers.  differs: where the two differ and why; empty where they agree.  plots: its curves for the
    page; none where its axes are logarithmic or it has markers.
    """

    id: str
    title: str
    shows: str
    gets: str
    differs: str
    figure: Figure
    quantities: tuple[Quantity, ...]
    plots: tuple[Plot, ...] = ()


def reproduce(name: str, seed: int, progress: Progress) -> Reproduction:
    """Run one of IDS. ValueError for another name."""
    if name not in IDS:
        raise ValueError(f"--only is {name!r}; it must be one of {', '.join(IDS)}")
    run: Callable[[int, Progress], Reproduction] = importlib.import_module(f"validation.paper.{name}").reproduce
    return run(seed, progress)
