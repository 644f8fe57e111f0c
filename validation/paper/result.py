"""What the reproduction of one figure or table of the paper gives: a picture, sentences, numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

Progress = Callable[[float], None]
"""Told the share done, 0 ... 1."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of the paper beside ours; paper is None where the paper gives none."""

    id: str
    quantity: str
    unit: str
    paper: float | None
    ours: float
    note: str = ""


@dataclass(frozen=True, slots=True)
class Reproduction:
    """One figure or table.

    id: its name on the command line, "fig13".  shows: a sentence, what the paper shows.  gets: a sentence, what
    we get, with its numbers.  differs: where the two differ and why, empty where they agree.
    """

    id: str
    title: str
    shows: str
    gets: str
    differs: str
    figure: Figure
    quantities: tuple[Quantity, ...]
