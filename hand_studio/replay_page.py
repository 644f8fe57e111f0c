"""A recording in the page: a time cursor, the measured hand, and models before and after a diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np

from hand_studio.curves import Curves
from hand_studio.hand_view import HandView
from hand_studio.legend import REPLAY, legend
from hand_studio.page import Page
from hand_studio.replay import Replay, Run
from hand_studio.tint import tints
from hand_studio.what_if import WhatIf

FRAME_S = 0.04
"""Period of the pictures."""
BEFORE, AFTER = (0, 114, 178), (0, 158, 115)
"""Colours of the ghosts (Okabe and Ito 2008)."""


class ReplayPage:
    """The page of one recording."""

    def __init__(self, page: Page, name: str, replay: Replay, before: Run, after: Run) -> None:
        """Add hand, ghosts and panel to the page. after: the run of the found model; `before` itself without one."""
        self._page, self._replay, self._before, self._after = page, replay, before, after
        self._mismatch = replay.mismatch(before.parameters)
        self._what_if_run: Run | None = None
        self._parameters = after.parameters
        self._segment, self._joint = -1, -1
        hand, server = replay.hand, page.server
        self._measured = HandView(server.scene, hand, "/hand")
        self._ghosts = [
            HandView(server.scene, hand, f"/{n}", ghost=c) for n, c in (("before", BEFORE), ("after", AFTER))
        ]
        gui = server.gui
        gui.add_html(f'<div style="padding:0.4em 0.8em;font-weight:600">{escape(name)}</div>')
        second = "after" if after is not before else "what if"
        gui.add_html(legend(REPLAY.format(second=second), hand))
        self._play = gui.add_checkbox("Play", initial_value=False)
        step = max(0.01, round(replay.duration_s / 2000.0, 2))
        self._time: Any = gui.add_slider("time s", 0.0, replay.duration_s, step, 0.0)
        worst = int(np.argmax(np.nanmax(np.abs(self._mismatch), axis=0)))
        self._curves = Curves(gui, hand.joints, ("measured", "before", second), worst)
        self._what_if = WhatIf(gui, hand, after.parameters)
        page.add_dark()

    def run(self, check: Callable[[], None]) -> None:
        """Show the recording until check(), called all the time, raises."""
        last = time.monotonic()
        while True:
            check()
            time.sleep(FRAME_S)
            now = time.monotonic()
            if not self._page.pace.may_send():
                continue
            if self._play.value:
                after = float(self._time.value) + now - last
                self._time.value = after if after < self._replay.duration_s else 0.0
            last = now
            self._show()

    def _show(self) -> None:
        sample = min(round(self._time.value / self._replay.window.period_s), len(self._before.angle_rad) - 1)
        parameters, segment, joint = self._what_if.take(), self._replay.segment(sample), self._curves.joint
        changed = parameters is not None or segment != self._segment
        if parameters is not None:
            self._parameters = parameters
        if changed:
            other = not np.array_equal(self._parameters, self._after.parameters)
            new = self._replay.what_if(self._after, self._parameters, segment) if other else None
            self._what_if_run = new
        before = self._replay.segment_of(self._before, segment)
        after = self._what_if_run or self._replay.segment_of(self._after, segment)
        cut = self._replay.cut(segment)
        if changed or joint != self._joint:
            self._segment, self._joint = segment, joint
            curves = self._replay.curves(segment, joint, (before, after))
            self._curves.show(self._replay.window.time_s[cut], *curves)
        self._measured.pose(self._replay.window.angle_rad[sample])
        self._measured.tint(tints(self._mismatch[sample]))
        self._ghosts[0].pose(self._before.angle_rad[sample])
        self._ghosts[1].pose(after.angle_rad[sample - cut.start])
