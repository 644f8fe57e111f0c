"""How busy the machine was while something ran: by this command's processes, and by other programs."""

from __future__ import annotations

import os
import resource
from dataclasses import asdict, dataclass
from pathlib import Path

STAT = Path("/proc/stat")
BUSY = 0.2
"""Share of all cores used by other programs above which times say more about them than about the hand."""


@dataclass(frozen=True, slots=True)
class Load:
    """Shares of all cores [-]. own: of this command and the processes that it has ended.  others: of the rest."""

    cores: int
    own: float
    others: float

    @property
    def disturbs(self) -> bool:
        """Whether other programs take so much that times are not those of the hand alone."""
        return self.others > BUSY

    def as_json(self) -> dict[str, float]:
        """For summary.json."""
        return asdict(self)

    def __str__(self) -> str:
        """The load in a few words."""
        return f"{100 * (self.own + self.others):.0f} % of {self.cores} cores busy, {100 * self.others:.0f} % by others"


class LoadMeter:
    """Measures from when it is made; needs /proc/stat."""

    def __init__(self, stat: Path = STAT) -> None:
        """stat: the file with the times of all cores."""
        self._stat = stat
        self._busy_s, self._all_s, self._own_s = self._times()

    def load(self) -> Load | None:
        """The mean load since then; None where the system does not say it, or no time has passed."""
        busy, total, own = (now - then for now, then in zip(self._times(), self._begun(), strict=True))
        if total <= 0.0:
            return None
        share = min(own / total, 1.0)
        return Load(os.cpu_count() or 1, share, max(busy / total - share, 0.0))

    def _begun(self) -> tuple[float, float, float]:
        return self._busy_s, self._all_s, self._own_s

    def _times(self) -> tuple[float, float, float]:
        """Times [s] of all cores: busy, busy and idle; and those of this process and its ended children."""
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        own_s = sum(each.ru_utime + each.ru_stime for each in used)
        try:
            ticks = [int(word) for word in self._stat.read_text(encoding="ascii").split("\n", 1)[0].split()[1:9]]
        except (OSError, ValueError):
            return 0.0, 0.0, own_s
        total = sum(ticks) / os.sysconf("SC_CLK_TCK")
        idle = sum(ticks[3:5]) / os.sysconf("SC_CLK_TCK")
        return total - idle, total, own_s
