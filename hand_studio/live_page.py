"""A running hand in the page: its state is shown, and what users ask for is sent. One thread talks to the hand."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from hand_client.node import HandClient, NoHandError
from hand_model.description import Hand
from hand_model.kernel.closed_loop import loops
from hand_model.kernel.hooks import HAND_EFFECTS
from hand_model.kernel.open_stages import compile_loop
from hand_studio.hand_view import HandView
from hand_studio.inbox import Inbox, Request
from hand_studio.live_model import LiveModel
from hand_studio.page import Page
from hand_studio.panel import Panel
from hand_studio.tint import tints
from hand_studio.until_sure import Answer, Study, StudyError, record_until_sure

FRAME_S = 0.04
"""Period of the pictures."""
VALUES_S = 0.25
"""Period of the values in the panel."""
CURVES_S = 0.25
"""Period of the curves; a browser without a graphics card draws ten in a second late, and ever later."""
DELAY_NS = 40_000_000
"""Age from which everything that belongs to a frame has been received."""
GHOST = (0, 114, 178)
RECORDER = "recorder"
"""Name of the node that records."""
ENDED = "Record until sure: ended by the next request"
UNTOUCHED_S = 1.0
"""Time after the last slider that was moved from which the sliders follow the hand."""


class Recorder(Protocol):
    """Makes recordings of the hand, one at a time."""

    def start(self) -> str:
        """Begin a recording and return its path."""

    def stop(self) -> str:
        """End it and return a line that names its path, or says why there is none."""


class Superseded(Exception):
    """A grasp ends because something else was asked for."""


class LivePage:
    """The page of one running hand."""

    def __init__(self, page: Page, client: HandClient, hand: Hand, grasps: Mapping[str, object], inbox: Inbox) -> None:
        """Add the hand and its panel to the page. Raises ValueError, one line, for a hand without geometry."""
        self._client, self._hand, self._inbox, self._pace = client, hand, inbox, page.pace
        self._view = HandView(page.server.scene, hand, "/hand")
        self._ghost = HandView(page.server.scene, hand, "/model", ghost=GHOST)
        self._ghost.root.visible = False
        self._model = LiveModel(hand)
        self._compiled, self._forces_compiled = threading.Event(), threading.Event()
        threading.Thread(target=self._compile, daemon=True, name="compile the model").start()
        client.collect(hand.joints, dict(zip(hand.sensors.sites, map(int, hand.sensors.site_joint), strict=True)))
        self._panel = Panel(page, hand, sorted(grasps), inbox)
        self._note, self._recording, self._starting = "", False, ""
        self._shown_s = self._values_s = self._curves_s = self._touched_s = 0.0
        self._targets: dict[str, float] = {}

    def run(self, recorder: Recorder, study: Study, healthy: Callable[[], None]) -> None:
        """Show the hand and serve the requests until healthy(), called all the time, raises."""
        self._study = study
        try:
            while True:
                self._client.spin(FRAME_S)
                healthy()
                self._show()
                self._move()
                request = self._inbox.next()
                if request is not None:
                    self._note = self._answer(request, recorder, healthy)
        finally:
            if self._recording:
                recorder.stop()

    def _compile(self) -> None:
        loops(HAND_EFFECTS)  # seconds where it was never done on this machine
        self._compiled.set()
        compile_loop(HAND_EFFECTS)
        self._forces_compiled.set()

    def check(self) -> None:
        """Wait for the confirmation of an emergency stop next, and end what is going on."""
        if self._inbox.stop.is_set():
            self._inbox.stop.clear()
            self._inbox.ask("confirm stop")

    def _show(self) -> None:
        now, state = time.monotonic(), self._client.state
        if now - self._shown_s < FRAME_S:
            return
        self._shown_s = now
        self._advance()
        if not self._pace.may_send():
            return
        angles = state.values.get("position", {})
        self._view.pose(np.array([angles.get(joint, np.nan) for joint in self._hand.joints]))
        self._view.press(state.values.get("force", {}))
        self._compare()
        if now - self._values_s >= VALUES_S:
            self._values_s = now
            if self._starting and self._client.listens(RECORDER):
                self._note, self._starting = f"recording to {self._starting}", ""
            self._panel.show(state, self._note, self._model.mismatch)
            if now - self._touched_s > UNTOUCHED_S:
                self._panel.follow(state.values.get("reference", {}))

    def _advance(self) -> None:
        """Let the model follow the hand, with the parameters that the page asks for."""
        samples = self._client.samples
        if samples is None or not self._compiled.is_set():
            return
        self._model.add(samples.take(time.time_ns() - DELAY_NS))
        parameters = self._panel.what_if.take()
        if parameters is not None:
            self._model.change(parameters)
            self._curves_s = 0.0

    def _compare(self) -> None:
        """Show the model as the ghost, in the curves and as the tint of the joints."""
        ghost = self._model.ghost_rad
        if ghost is None:
            return
        self._ghost.root.visible = True
        self._ghost.pose(ghost)
        self._view.tint(tints(self._model.mismatch))
        if time.monotonic() - self._curves_s >= CURVES_S:
            self._curves_s = time.monotonic()
            with_force = self._forces_compiled.is_set()
            time_s, curves = self._model.curves(self._panel.curves.joint, with_force=with_force)
            self._panel.curves.show(time_s, *curves)

    def _move(self) -> None:
        angles = self._inbox.angles()
        if angles:
            self._touched_s = time.monotonic()
            self._client.command(angles, self._panel.max_torque_nm)
            if not self._client.state.driven:
                self._note = "the hand does not move; press Enable"

    def _answer(self, request: Request, recorder: Recorder, healthy: Callable[[], None]) -> str:
        """Do what was asked; the line about its outcome."""
        try:
            match request.name:
                case "confirm stop":
                    self._client.stop()
                    ended = f"{ENDED}; " if self._note == ENDED else ""
                    return f"{ended}stopped: vented and latched; Enable goes on"
                case "enable":
                    return self._client.enable(reset=True)[1]
                case "vent":
                    return self._client.vent()[1]
                case "restart":
                    self._model.restart()
                    return ""
                case "grasp":
                    return self._grasp(request.what, healthy)
                case "sure":
                    return self._record_until_sure(request.what, recorder, healthy)
                case _:
                    return self._record(recorder)
        except NoHandError as error:
            return str(error)

    def _meanwhile(self, healthy: Callable[[], None]) -> None:
        """Show the hand while something goes on, until something else is asked for."""
        healthy()
        self._show()
        if self._inbox.waiting:
            raise Superseded

    def _record_until_sure(self, joint: str, recorder: Recorder, healthy: Callable[[], None]) -> str:
        if self._recording:
            return "end the recording first"
        joints = [joint] if joint else list(self._hand.joints)
        robot = _Robot(self._client, self._panel, recorder, lambda: self._meanwhile(healthy))
        try:
            return record_until_sure(robot, self._study, joints, FRAME_S)
        except Superseded:
            return ENDED
        except StudyError as error:
            return f"Record until sure: {error}"
        finally:
            robot.report("", robot.newest)

    def _grasp(self, pattern: str, healthy: Callable[[], None]) -> str:
        try:
            torque_nm = self._panel.max_torque_nm
            return f"{pattern}: {self._client.grasp(pattern, 1.0, torque_nm, lambda: self._meanwhile(healthy))[1]}"
        except Superseded:
            return f"{pattern}: ended by the next request"

    def _record(self, recorder: Recorder) -> str:
        self._recording, self._starting = not self._recording, ""
        if not self._recording:
            self._panel.recording("")
            return recorder.stop()
        self._starting = recorder.start()
        self._panel.recording(self._starting)
        return "the recorder starts"


class _Robot:
    """The hand as a study drives it. newest: the last answer."""

    def __init__(self, client: HandClient, panel: Panel, recorder: Recorder, meanwhile: Callable[[], None]) -> None:
        self._client, self._panel, self._recorder, self._meanwhile = client, panel, recorder, meanwhile
        self.newest: Answer | None = None

    def stay(self, seconds: float) -> None:
        self._client.spin(seconds)
        self._meanwhile()

    def command(self, angles: Mapping[str, float]) -> None:
        self._client.command(angles, self._panel.max_torque_nm)

    def hold(self, joints: Sequence[str]) -> None:
        if self._client.state.driven:
            self._client.hold(joints)

    def refusal(self) -> str:
        state = self._client.state
        return "" if state.driven else f"the hand does not move ({state.safety or 'no hand'}); press Enable"

    def record(self) -> str:
        return self._recorder.start()

    def is_recorded(self) -> bool:
        return self._client.listens(RECORDER)

    def end_recording(self) -> str:
        return self._recorder.stop()

    def report(self, note: str, answer: Answer | None) -> None:
        self.newest = answer
        self._panel.sure(note, answer)
