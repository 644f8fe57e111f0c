"""Which compiled loop computes a set of effects: one of its own where that is worth compiling, or that of all effects.

An effect that is compiled in and neutral changes no bit, so the choice changes the time alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from hand_model.effects.effect import Effect

WORTH_STEPS = 8_000_000
"""Steps of blocks that a set of effects may take in the loop of all effects before a loop of its own is compiled.

They take about 2 s longer there. To compile its own loop takes about 2 s, and it stays on disk for later processes.
"""
LOOKED_UP_SHARE = 0.01
"""Share of these steps from which the disk is asked for a loop of its own; the answer takes as long as they do."""
LAW_STEPS = 8
"""A step with laws counts as so many: the loop of all effects reads the coefficients of all laws."""
WORTH_OF_MORE = 2
"""A set of several effects must take so many times as many: other recordings hardly need the same one."""
MOST_COMPILED = 12
"""Loops that one process compiles for such sets; each takes about 10 MB of its memory."""


class NarrowLoops:
    """Counts the steps of every set of effects, and has the loops of those compiled that fits use most."""

    def __init__(
        self,
        compile_loop: Callable[[tuple[Effect, ...], bool], Any],
        is_kept: Callable[[tuple[Effect, ...], bool], bool],
        worth_steps: float = WORTH_STEPS,
    ) -> None:
        """compile_loop, is_kept: the loop of a set of effects, with or without laws, and whether the disk holds it."""
        self._compile, self._is_kept, self._worth = compile_loop, is_kept, worth_steps
        self._done: dict[tuple[tuple[Effect, ...], bool], float] = {}
        self._compiled = 0

    def loop(self, acting: tuple[Effect, ...], every: tuple[Effect, ...], laws: bool, steps: int) -> Any:
        """The loop of the effects that act, or of every one, for a call that takes so many steps of blocks."""
        own = acting, laws
        before = self._done.get(own, 0.0)
        done = before + steps * (LAW_STEPS if laws else 1)
        if before < LOOKED_UP_SHARE * self._worth <= done and self._is_kept(*own):
            done = math.inf
        elif done < math.inf and self._is_worth(acting, done):
            done = math.inf
            self._compiled += 1
        self._done[own] = done
        return self._compile(*own) if done == math.inf else self._compile(every, laws)

    def _is_worth(self, acting: tuple[Effect, ...], done: float) -> bool:
        worth = self._worth * (WORTH_OF_MORE if len(acting) > 1 else 1)
        return done > worth and self._compiled < MOST_COMPILED
