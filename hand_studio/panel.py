"""The panel of a running hand: buttons, sliders and values. What users do goes into the inbox."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import viser

from hand_client.live_state import LiveState
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_studio.curves import Curves
from hand_studio.inbox import Inbox
from hand_studio.legend import LIVE, legend
from hand_studio.page import Page
from hand_studio.until_sure import Answer, table
from hand_studio.what_if import ALL, WhatIf

SMALLEST_NM = 0.01
LOOKING = "waiting for the controller"
FIND = (
    "What does the model lack? The button moves the joint through experiments, records them and looks for the causes of"
    " every difference from the model, until they are certain. It takes minutes, and ends when you use another control"
    " of the hand."
)
USE_FOUND, USE_FILE = "Use the found model", "Use the model of the file"
"""Labels of the button that gives the ghost the found model, and takes it away again."""
CALLS = re.compile(r"; call reset(_driver)?(, then enable)?$")
"""What a node asks for in the words of ROS; in the page, the button Enable does it."""
STATUS_EM = 5.5
"""Height of the state of the hand: a line more or less does not move what is below it."""
COLUMNS = ("joint", "angle deg", "pressure bar", "torque N m", "mismatch / noise", "contact")


class Panel:
    """Controls and values of one hand."""

    def __init__(self, page: Page, hand: Hand, grasps: Sequence[str], inbox: Inbox) -> None:
        """Add everything to the page."""
        self._page, self._hand, self._inbox = page, hand, inbox
        gui = page.server.gui
        self._button("Emergency stop", "stop", color="red")  # first, so that no line of text ever moves it
        self._status = gui.add_html(_status(LOOKING, (), ""))
        self._record = self._button("Record", "record")
        gui.add_html(legend(LIVE, hand))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Drive"):
            self._add_drive(gui, grasps)
        with tabs.add_tab("Model"):
            self.curves = Curves(gui, hand.joints, ("measured", "model"))
            self._button("Start the model again", "restart")
            self.what_if = WhatIf(gui, hand, hand.parameters)
        with tabs.add_tab("Find"):
            self._add_find(gui)
        with tabs.add_tab("Values"):
            self._values = gui.add_html("")
        page.add_dark()

    def _add_drive(self, gui: viser.GuiApi, grasps: Sequence[str]) -> None:
        self._button("Enable", "enable")
        self._button("Vent", "vent")
        largest = float(self._hand.limits.max_torque_nm.min())
        self._torque = gui.add_slider("torque limit N m", SMALLEST_NM, largest, 0.005, largest)
        choice = gui.add_button_group("grasp", list(grasps))
        choice.on_click(lambda event: self._inbox.ask("grasp", event.target.value))
        with gui.add_folder("Joints, degrees"):
            self._sliders: list[Any] = [self._slider(gui, index) for index in range(len(self._hand.joints))]

    def _add_find(self, gui: viser.GuiApi) -> None:
        gui.add_html(f'<div style="padding:0.4em 0.8em">{escape(FIND)}</div>')
        joint = gui.add_dropdown("joint", (ALL, *self._hand.joints))
        button = gui.add_button("Record until sure")
        button.on_click(lambda _: self._inbox.ask("sure", "" if joint.value == ALL else str(joint.value)))
        self._sure = gui.add_html("")
        self._answer: Answer | None = None
        self._use = gui.add_button(USE_FOUND, visible=False)
        self._use.on_click(lambda _: self._use_found())

    def sure(self, note: str, answer: Answer | None) -> None:
        """Show what Record until sure does now, and its newest answer."""
        content = table(note, answer)
        if self._sure.content != content:
            self._sure.content = content
        if answer is not None and answer is not self._answer:
            self._answer, self._use.label, self._use.visible = answer, USE_FOUND, bool(answer.model)

    def _use_found(self) -> None:
        """Give ghost and What if the found model, or the one of the file again."""
        answer, use = self._answer, self._use.label == USE_FOUND
        if answer is None:
            return
        try:
            model = load_hand(answer.model, self._hand.prefix) if use else self._hand
        except ValueError as error:
            self.sure(str(error), answer)
            return
        self.what_if.begin_with(model.parameters)
        self._use.label = USE_FILE if use else USE_FOUND

    @property
    def max_torque_nm(self) -> float:
        """Torque limit [N m] that is set in the page; 0 for the configured one, the largest."""
        value = float(self._torque.value)
        return 0.0 if value >= float(self._hand.limits.max_torque_nm.min()) - 1e-9 else value

    def show(self, state: LiveState, note: str, mismatch: Array) -> None:
        """Show values and safety of the hand, a line about the last request, and the mismatch (joints,) [-]."""
        known = math.isfinite(state.rate_hz)
        rate = f"{state.rate_hz:.0f} Hz, latency {1e3 * state.latency_s:.1f} ms" if known else ""
        self._status.content = _status(*said(state), rate, note)
        self._values.content = _table(state, dict(zip(self._hand.joints, mismatch.tolist(), strict=True)))

    def follow(self, reference_rad: dict[str, float]) -> None:
        """Move the sliders to where the controller leads the joints, by name [rad]."""
        for joint, slider in zip(self._hand.joints, self._sliders, strict=True):
            angle = reference_rad.get(joint, math.nan)
            if math.isfinite(angle) and abs(slider.value - math.degrees(angle)) > 0.5:
                slider.value = float(np.clip(round(math.degrees(angle), 1), slider.min, slider.max))

    def recording(self, name: str) -> None:
        """Label the button by the recording that is made, "" for none."""
        self._record.label = f"Stop recording {name}" if name else "Record"

    def _button(self, label: str, name: str, what: str = "", color: Any = None) -> viser.GuiButtonHandle:
        button = self._page.server.gui.add_button(label, color=color)
        button.on_click(lambda _: self._inbox.ask(name, what))
        return button

    def _slider(self, gui: viser.GuiApi, index: int) -> viser.GuiSliderHandle[float]:
        joint, limits = self._hand.joints[index], self._hand.limits
        low, high = (math.degrees(float(limit[index])) for limit in (limits.low_rad, limits.high_rad))
        slider = gui.add_slider(joint, round(low, 1), round(high, 1), 0.1, float(np.clip(0.0, low, high)))
        radians = (float(limits.low_rad[index]), float(limits.high_rad[index]))

        def move(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client_id is not None:  # not where the studio itself lets the slider follow the hand
                self._inbox.move(joint, float(np.clip(math.radians(event.target.value), *radians)))

        slider.on_update(move)
        return slider


def said(state: LiveState) -> tuple[str, tuple[str, ...]]:
    """What the hand does or why it does not move, and every other error that a node reports now."""
    safety = CALLS.sub("; press Enable", state.safety)
    reason = state.safety.partition("; call ")[0].removeprefix("vented: ")
    others = [text for text in state.problems if not reason or reason not in text]
    return safety or LOOKING, tuple(CALLS.sub("", text) for text in others)


def _status(safety: str, problems: Sequence[str], rate: str, note: str = "") -> str:
    bad = "color:light-dark(#b3261e,#ff8a80)"
    bold = f"font-weight:600;{bad if safety.startswith('vented') else ''}"
    lines = [f'<div id="safety" style="{bold}">{escape(safety)}</div>', f"<div>{escape(rate)}</div>"]
    lines += [f'<div style="font-size:0.85em;{bad}">{escape(text)}</div>' for text in problems]
    lines.append(f'<div id="note">{escape(note)}</div>')
    style = f"padding:0.4em 0.8em;overflow-wrap:anywhere;min-height:{STATUS_EM}em"
    return f'<div style="{style}">{"".join(lines)}</div>'


def _fixed(value: float, digits: int) -> str:
    """A number with so many digits, without the sign of a zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _table(state: LiveState, mismatch: dict[str, float]) -> str:
    """Values of every joint as an HTML table."""
    rows = [f"<tr>{''.join(f'<th>{name}</th>' for name in COLUMNS)}</tr>"]
    for joint, row in state.as_json()["joints"].items():
        cells = [(row["angle_rad"], 180.0 / math.pi, 1), (row["pressure_pa"], 1e-5, 2), (row["torque_nm"], 1.0, 3)]
        texts = ["-" if value is None else _fixed(value * factor, digits) for value, factor, digits in cells]
        texts += [f"{abs(mismatch.get(joint, 0.0)):.0f}", "yes" if row["contact"] else ""]
        rows.append(
            f"<tr><td style='text-align:left'>{escape(joint)}</td>{''.join(f'<td>{text}</td>' for text in texts)}</tr>"
        )
    style = "width:100%;padding-right:0.6em;font-size:0.76em;text-align:right;font-variant-numeric:tabular-nums"
    return f'<div style="overflow-x:auto"><table style="{style}">{"".join(rows)}</table></div>'
