"""The result of one hazard: how many cases were injected, how many were handled, how soon, and what was worst."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from statistics import median
from typing import Any

MOST_NAMED, MOST_LETTERS = 20, 160
"""Number of unhandled cases that a result names, and of letters of each name."""


class Size(IntEnum):
    """How much a family runs: a quick form of seconds, minutes in virtual time, or processes in real time as well."""

    QUICK = 0
    NORMAL = 1
    FULL = 2

    def of(self, quick: int, normal: int, full: int | None = None) -> int:
        """The number of cases at this size; full: by default as many as at NORMAL."""
        return (quick, normal, normal if full is None else full)[self]


@dataclass(frozen=True, slots=True)
class FaultResult:
    """The cases of one hazard.

    family: module of validation.faults.  hazard: what was injected.  cases: how often.  handled: how often the
    reaction was the required one.  bounded: how often nothing was found, because the fault stayed within what the
    model allows and its consequence was small.  unhandled: names of the others, at most MOST_NAMED.  misses: how many
    cases lack what, by its name; a case may lack several.  false_accepts: damaged inputs that passed as good.
    median_s, max_s: time from the fault to the reaction [s], None where the reaction takes no time.  worst, unit: the
    largest excess that the cases reached, for example a pressure or an angle error.  seed: of the random numbers.
    real_time: times were measured on this machine's clock and depend on its load.  note: one line.
    """

    family: str
    hazard: str
    cases: int
    handled: int
    unhandled: tuple[str, ...] = ()
    false_accepts: int = 0
    median_s: float | None = None
    max_s: float | None = None
    worst: float | None = None
    unit: str = ""
    seed: int = 0
    real_time: bool = False
    note: str = ""
    bounded: int = 0
    misses: dict[str, int] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether every case was handled or bounded, and nothing damaged was accepted."""
        return self.cases > 0 and self.handled + self.bounded == self.cases and not self.false_accepts

    def as_dict(self) -> dict[str, Any]:
        """The result as it is stored in faults.json."""
        return asdict(self) | {"passed": self.passed}


@dataclass(slots=True)
class Tally:
    """Counts the cases of one hazard; `result` gives the FaultResult."""

    family: str
    hazard: str
    seed: int = 0
    unit: str = ""
    real_time: bool = False
    cases: int = 0
    handled: int = 0
    false_accepts: int = 0
    worst: float | None = None
    note: str = ""
    bounded: int = 0
    misses: dict[str, int] = field(default_factory=dict)
    _unhandled: list[str] = field(default_factory=list)
    _times_s: list[float] = field(default_factory=list)

    def case(
        self, name: str, handled: bool, time_s: float | None = None, worst: float | None = None, bounded: bool = False
    ) -> None:
        """Count one case: time_s [s] from the fault to the reaction, worst in the unit of this tally.

        bounded: not handled, but its consequence was small.
        """
        self.cases += 1
        self.handled += handled
        self.bounded += bounded and not handled
        if not handled and not bounded and len(self._unhandled) < MOST_NAMED:
            self._unhandled.append(name[:MOST_LETTERS])
        if time_s is not None:
            self._times_s.append(time_s)
        if worst is not None:
            self.worst = worst if self.worst is None else max(self.worst, worst)

    def missed(self, kinds: Iterable[str]) -> None:
        """Count what the last case lacks."""
        for kind in kinds:
            self.misses[kind] = self.misses.get(kind, 0) + 1

    def many(self, cases: int, handled: int) -> None:
        """Count cases that have no name of their own."""
        self.cases += cases
        self.handled += handled
        if handled != cases and len(self._unhandled) < MOST_NAMED:
            self._unhandled.append(f"{cases - handled} of {cases}")

    def result(self) -> FaultResult:
        """All counts so far."""
        times_s = self._times_s
        return FaultResult(
            self.family, self.hazard, self.cases, self.handled, tuple(self._unhandled), self.false_accepts,
            median(times_s) if times_s else None, max(times_s) if times_s else None,
            self.worst, self.unit, self.seed, self.real_time, self.note, self.bounded,
            dict(self.misses),
        )  # fmt: skip
