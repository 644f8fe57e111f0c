"""Every figure and table that is reproduced, by its name on the command line."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from validation.paper.result import Progress, Reproduction

IDS = ("table1", "fig06", "fig07", "fig08", "fig09", "fig10", "fig13", "fig14", "prony")


def reproduce(name: str, seed: int, progress: Progress) -> Reproduction:
    """Run one of IDS. ValueError for a name that is not one of them."""
    if name not in IDS:
        raise ValueError(f"--only is {name!r}; it must be one of {', '.join(IDS)}")
    run: Callable[[int, Progress], Reproduction] = importlib.import_module(f"validation.paper.{name}").reproduce
    return run(seed, progress)
