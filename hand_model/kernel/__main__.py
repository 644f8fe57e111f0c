"""Compile the loops that programs start with and those of the fits, so that nobody waits for them later.

Numba keeps them on disk next to the source, or in the user's cache where that folder is read-only. A change of any
equation makes them void, and the next start compiles them again.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

from hand_model.effects.effect import Effect
from hand_model.kernel.closed_loop import loops
from hand_model.kernel.hooks import HAND_EFFECTS
from hand_model.kernel.open_stages import JOINT, VALVE


def _closed(effects: tuple[Effect, ...]) -> None:
    loops(effects)


def _open(of_joint: bool, effects: tuple[Effect, ...], laws: bool) -> None:
    (JOINT if of_joint else VALVE).compile(effects, laws)


def common_loops() -> list[Callable[[], None]]:
    """What compiles each of the common loops, those that take longest first.

    The closed loops of the plain plant and of the studio; the open loops of the plain plant, of all effects of a hand
    and of each of them alone, with and without its law.
    """
    jobs: list[Callable[[], None]] = [partial(_closed, HAND_EFFECTS)]
    stages = [(stage is JOINT, stage.of(HAND_EFFECTS)) for stage in (JOINT, VALVE)]
    jobs += [partial(_open, of_joint, effects, laws) for laws in (True, False) for of_joint, effects in stages]
    jobs += [partial(_closed, ())]
    for of_joint, effects in stages:
        jobs += [partial(_open, of_joint, (), False)]
        jobs += [partial(_open, of_joint, (effect,), False) for effect in effects if effect.keys]
        jobs += [partial(_open, of_joint, (effect,), True) for effect in effects if effect.coefficients]
    return jobs


def _run(number: int) -> None:
    common_loops()[number]()


def main() -> None:
    """Compile all of them, on all cores."""
    parser = argparse.ArgumentParser(
        prog="python -m hand_model.kernel",
        description="Compile the common loops of the kernel into the cache. Example: python -m hand_model.kernel",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes; by default one a core")
    jobs = parser.parse_args().jobs
    if jobs < 1:
        parser.error(f"--jobs is {jobs}; the least is 1")
    with ProcessPoolExecutor(jobs) as pool:
        list(pool.map(_run, range(len(common_loops()))))


if __name__ == "__main__":
    main()
