"""`hand studio` as a user meets it: the page in a real browser, the simulated hand over DDS."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline
from hand_studio import until_sure
from hand_studio.inbox import Inbox
from hand_studio.page import Page
from hand_studio.panel import SMALLEST_NM, Panel
from hand_studio.until_sure import Answer, Cause, Motion
from test.nodes.stack import TOOL, WAIT_S, Client, Stack
from validation.browser import Browser, changed

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
BARS = "[...document.querySelectorAll('#sure ~ table div')].map(bar => bar.style.width)"
"""Widths of the bars of the probabilities in the page."""
SIZE = (700, 560)
"""Of the window [pixels]: small, because no graphics card draws it."""


class Studio(Stack):
    """`hand studio --sim`, a browser on its page, and a node that listens to the hand."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.client = Client()
        self.process = self.start("hand", "studio", "--sim", "--no-browser", "--json", "--out", str(folder))
        try:
            self.client.until(lambda: '"url"' in self.log("hand") or self.process.poll() is not None, 60.0)
            assert self.process.poll() is None, self.log("hand")
        except BaseException:
            self.stop_all()
            self.client.close()
            raise
        line = next(line for line in self.log("hand").splitlines() if '"url"' in line)
        self.url: str = json.loads(line)["url"]
        self.page = Browser(folder, self.url, SIZE)

    def enable(self) -> None:
        """Drive the hand by the page's button, also where a machine that stalled has made the hand vent."""
        self.client.spin(0.1)
        end = time.monotonic() + 2.0 * WAIT_S
        while not self.client.said("controller", "safety", "controlling"):
            assert time.monotonic() < end, f"Enable does not drive the hand: {self.client.statuses}"
            self.page.click("Enable")
            self.client.spin(1.5)  # the status of the nodes comes at 1 Hz

    def torque_limits(self) -> dict[str, float]:
        """Limit of the torque [N m] of each joint, by the controller."""
        self.client.spin(0.1)
        newest = self.client.states[-1]
        return dict(zip(newest.name, newest.torque_limit, strict=True))

    def off_deg(self) -> float:
        """RMS difference of the model's curve from the measured one [deg], by the page; NaN without a curve."""
        found = re.search(r"RMS difference: model: ([\d.]+) deg", self.page.text())
        return float(found[1]) if found else math.nan

    def begin(self, grasp: str, joint: str) -> None:
        """Click a grasp and wait until it has moved a joint by 0.1 rad; a hand that a stall has vented begins again."""
        end = time.monotonic() + WAIT_S
        while not self._moves(grasp, joint):
            assert time.monotonic() < end, f"{grasp} does not begin: {self.client.statuses}"

    def _moves(self, grasp: str, joint: str) -> bool:
        self.enable()
        start = self.client.angle(joint)
        self.page.click(grasp)
        self.during(3.0, lambda: abs(self.client.angle(joint) - start) < 0.1)
        return abs(self.client.angle(joint) - start) >= 0.1

    def during(self, seconds: float, condition: Callable[[], bool]) -> None:
        """Receive messages for some time while a condition holds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and condition():
            self.client.spin(0.05)

    def still(self) -> bytes:
        """A picture that did not change for a while: the browser draws late on a busy machine."""
        pictures = [self.page.scene()]
        end = time.monotonic() + WAIT_S
        while len(pictures) < 2 or changed(*pictures[-2:]) > 0.001:
            assert time.monotonic() < end, "the picture of a hand at rest changes all the time"
            self.client.spin(0.4)
            pictures.append(self.page.scene())
        return pictures[-1]

    def move(self, joint: str, key: str, low_rad: float, high_rad: float) -> None:
        """Press a key on a joint's slider until the joint is there; a hand that was vented by a stall is enabled."""
        end = time.monotonic() + WAIT_S
        while not low_rad < self.client.angle(joint) < high_rad:
            assert time.monotonic() < end, f"{joint} is at {self.client.angle(joint):.3f} rad: {self.client.statuses}"
            self.enable()
            self.page.press(joint, "Home" if key == "End" else "End")  # arrows would turn the camera, too
            self.page.press(joint, key)
            self.during(2.5, lambda: not low_rad < self.client.angle(joint) < high_rad)


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    made = Studio(tmp_path_factory.mktemp("studio"))
    try:
        made.client.until(lambda: made.client.joints, 120.0)  # kernels may have to be compiled
        made.page.until("document.querySelector('canvas')")
        made.page.until_shown("Hz, latency")
        yield made
    finally:
        made.page.close()
        made.stop_all()
        made.client.close()


def test_a_slider_moves_the_joint_and_the_picture_until_vent(studio: Studio) -> None:
    """Fails when a slider sends another joint, unit or torque limit, the picture stands still, or Vent does nothing."""
    studio.enable()
    others = {joint: studio.client.angle(joint) for joint in ("middle_proximal", "thumb_distal")}
    before = studio.still()
    studio.move("index_proximal", "End", 1.6, 1.9)
    for joint, angle in others.items():
        assert abs(studio.client.angle(joint) - angle) < 0.1
    studio.client.until(lambda: changed(before, studio.page.scene()) > 0.005)
    limits_nm = studio.torque_limits()
    studio.page.press("torque limit N m", "Home")
    studio.move("middle_proximal", "End", 0.1, 1.9)
    assert studio.torque_limits() == limits_nm | {"middle_proximal": SMALLEST_NM}
    studio.page.press("torque limit N m", "End")
    studio.page.click("Vent")
    studio.client.until(lambda: max(studio.client.valves[-1].pressure) == 0.0, 3.0)
    studio.page.until_shown("vented")


def test_record_writes_a_bag(studio: Studio) -> None:
    """Fails when the button writes nothing, or another hand's topics."""
    studio.page.click("Record")
    studio.page.until_shown("recording to")
    studio.client.spin(1.5)
    studio.page.click("Stop recording")
    studio.page.until_shown("recorded: ")
    (name,) = re.findall(r"recorded: (\S+)", studio.page.text())
    recording = load_recording(Path(name))
    assert recording.namespace == "/hand"
    assert len(recording["joint_states"]) > 50


def test_stop_vents_during_a_grasp_until_enable(studio: Studio) -> None:
    """Fails when a stop waits for the grasp, pressure is commanded after it, or Enable does not clear it."""
    studio.begin("cylindrical", "ring_proximal")
    studio.page.click("Emergency stop")
    studio.client.until(lambda: max(studio.client.valves[-1].pressure) == 0.0, 1.0)
    studio.page.until_shown("emergency stop")
    studio.page.until_shown("vented and latched")
    studio.enable()
    assert studio.client.said("controller", "safety", "controlling")


def test_record_until_sure_moves_and_records_the_joint_until_a_stop(studio: Studio) -> None:
    """Fails when the chosen joint does not move or another one does, or a stop waits for the experiment."""
    end = time.monotonic() + 2.0 * WAIT_S
    joints, moved_rad = ("middle_proximal", "ring_proximal"), 0.0
    while moved_rad < 0.15:
        assert time.monotonic() < end, f"the joint does not move: {studio.page.text()}"
        studio.page.click("Drive")
        studio.enable()
        start, other = (studio.client.angle(joint) for joint in joints)
        studio.page.click("Find")
        studio.page.choose("joint", joints[0])
        studio.page.click("Record until sure")
        studio.during(1.5, lambda: True)
        while moved_rad < 0.15 and "press Enable" not in studio.page.text():  # a machine that stalls vents the hand
            assert time.monotonic() < end, f"the joint does not move: {studio.page.text()}"
            studio.client.spin(0.2)
            moved_rad = abs(studio.client.angle(joints[0]) - start)
            assert abs(studio.client.angle(joints[1]) - other) < 0.1
    studio.page.click("Emergency stop")
    studio.client.until(lambda: max(studio.client.valves[-1].pressure) == 0.0, 1.0)
    studio.page.until_shown("vented and latched")  # said after the recording is closed
    newest = max(studio.folder.glob("hand_*/"), key=lambda folder: folder.stat().st_mtime)
    recorded = load_recording(newest)["joint_states"]
    assert np.ptp(recorded["position"][:, recorded.names.index(joints[0])]) > 0.15
    studio.page.click("Drive")
    studio.enable()


def test_what_if_changes_the_curve_until_it_is_reset(studio: Studio) -> None:
    """Fails when the model next to the hand does not start or is off, or a slider does not reach its curve.

    The model's pressure and force are shown for a joint that has a force sensor.
    """
    studio.page.click("Model")
    studio.client.until(lambda: studio.off_deg() < 1.0)
    shown = re.compile(r" deg; pressure, model: 0\.0\d bar; force, model: 0\.\d\d N")
    studio.client.until(lambda: shown.search(studio.page.text()))
    studio.page.press("torque [N m]", "End")
    studio.client.until(lambda: studio.off_deg() > 2.0)
    studio.page.click("Reset to what was found")
    studio.client.until(lambda: studio.off_deg() < 1.0)


def test_the_hand_goes_on_without_a_browser(studio: Studio) -> None:
    """Fails when a page that is closed ends the studio, or the next page shows nothing."""
    studio.page.open("about:blank")
    studio.client.spin(1.5)
    assert studio.process.poll() is None and "Traceback" not in studio.log("hand")
    assert studio.client.statuses
    studio.page.open(studio.url)
    studio.page.until_shown("Hz, latency")


def loaded_model(folder: Path) -> Path:
    """Write model.yaml, the hand with a load of 0.05 N m on each joint, into a new folder; its path."""
    folder.mkdir()
    model = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    model["joint_defaults"]["constant_load"] = {"torque_nm": 0.05}
    path = folder / "model.yaml"
    path.write_text(yaml.safe_dump(model), encoding="utf-8")
    return path


class Scripted:
    """A robot that stands still, and a study with given answers, on a panel of a page."""

    def __init__(self, panel: Panel, answers: list[Answer], shown: Callable[[], None]) -> None:
        self._panel, self._answers, self._shown = panel, answers, shown
        self.report = panel.sure
        self.stay = self.command = self.hold = self.cancel = self.diagnose = lambda *_: None
        self.refusal, self.record, self.is_recorded = lambda: "", lambda: "bag", lambda: True
        self.end_recording = lambda: "recorded: bag"

    def motion(self, name: str, joints: Sequence[str]) -> Motion:
        """Called when an answer has been reported and the next experiment begins: look at the page."""
        if name:
            self._shown()
        return Motion(name or "slow_triangle", 0.01, lambda _: dict.fromkeys(joints, 0.0))

    def answer(self) -> Answer:
        return self._answers.pop(0)


def test_the_answer_changes_in_the_page_with_every_diagnosis_and_its_model_can_be_used(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when a probability or its bar stays that of the diagnosis before, or size, report or model do not come."""
    monkeypatch.setattr(until_sure, "REST_S", 0.001)
    hand = load_hand(CONFIG)
    found = loaded_model(studio.folder / "hand_diagnosis")
    seen: list[tuple[str, ...]] = []
    answers = [
        Answer(
            f"index_proximal: constant load of {number}",
            (Cause("index_proximal", "constant load", p, number), Cause("index_proximal", "hysteresis", 1.0 - p)),
            not following,
            following,
            str(found.parent),
            str(found),
        )
        for p, number, following in (
            (0.55, "0.06 ± 0.02 N m", "reversals"),
            (0.74, "0.052 ± 0.007 N m", "steps"),
            (0.97, "0.050 ± 0.002 N m", ""),
        )
    ]
    page = Page()
    try:
        panel = Panel(page, hand, ["tripod"], Inbox(lambda: None))
        studio.page.open(page.url)
        studio.page.until_shown("Find")
        studio.page.click("Find")
        studio.page.until_shown("Record until sure")

        def shown() -> None:
            expected = (("55%", "45%"), ("74%", "26%"), ("97%", "3%"))[len(seen)]
            studio.page.until(BARS + f".join() == '{','.join(expected)}'")
            text, answer = studio.page.text(), answers[len(seen)]
            assert [part for part in text.split() if part.endswith("%")] == list(expected)
            assert answer.sentence in text and text.count(answer.causes[0].number) == 2
            assert f"Report: {found.parent}" in text
            seen.append(expected)

        script = Scripted(panel, list(answers), shown)
        line = f"{answers[-1].sentence}; sure after 3 recordings; report in {found.parent}"
        assert until_sure.record_until_sure(script, script, ["index_proximal"], 0.001) == line
        shown()
        assert len(seen) == len(answers)
        for button, expected_nm in (("Use the found model", 0.05), ("Use the model of the file", 0.0)):
            studio.page.click(button)
            taken: list[Array | None] = [None]
            while taken[-1] is None:
                studio.client.spin(0.05)
                taken.append(panel.what_if.take())
            assert taken[-1][ROW["constant_load.torque_nm"]] == pytest.approx(expected_nm)
    finally:
        studio.page.open(studio.url)
        page.close()


def test_what_cannot_be_served_is_one_line(studio: Studio) -> None:
    """Fails when a second studio, a second hand or a hand that is not there does not end with code 2 and its reason."""
    expected = {
        (): "a studio of /hand runs already",
        ("--sim",): "a hand runs already in /hand; show it with: hand studio",
        ("--namespace", "nobody"): "no hand runs in /nobody; start one with: hand studio --sim",
    }
    command = (*TOOL, "studio", "--no-browser", "--quiet")
    started = [
        subprocess.Popen([*command, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for words in expected
    ]
    for process, line in zip(started, expected.values(), strict=True):
        _, error = process.communicate(timeout=3.0 * WAIT_S)
        assert (process.returncode, error.count("\n")) == (2, 1), error
        assert error.startswith("hand studio: ") and line in error


def test_ctrl_c_vents_and_ends_the_hand(studio: Studio) -> None:
    """Fails when a node survives the studio, or the last command is not 0 Pa."""
    path = Path(f"/proc/{studio.process.pid}/task/{studio.process.pid}/children")
    nodes = path.read_text(encoding="utf-8").split()
    assert len(nodes) == 3  # simulation, controller, frame_publisher
    assert studio.stop(studio.process, signal.SIGINT) == 0
    assert studio.client.last_pressure_pa() == 0.0
    assert not any(Path(f"/proc/{pid}").exists() for pid in nodes)
    assert "Traceback" not in studio.log("hand")


@pytest.mark.long
def test_a_node_that_has_to_be_killed_is_named_after_ctrl_c(tmp_path: Path) -> None:
    """Fails when the studio says that its nodes have ended although one of them did not, or hides which."""
    domain = str((int(os.environ["ROS_DOMAIN_ID"]) + 1) % 100)  # the hand of the other tests is not to be heard
    command = [*TOOL, "studio", "--sim", "--no-browser", "--json", "--quiet", "--out", str(tmp_path)]
    environment = os.environ | {"ROS_HOME": str(tmp_path), "ROS_DOMAIN_ID": domain}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None and process.stdout.readline()
        node = int(Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="utf-8").split()[0])
        os.kill(node, signal.SIGSTOP)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=3.0 * WAIT_S)
    assert process.returncode == 2
    assert re.fullmatch(r"hand studio: simulation did not end within 15 s: .*\n", error), error


def test_a_recording_is_replayed_next_to_the_model_before_and_after(studio: Studio) -> None:
    """Fails when time, hand or a model of a recording is not shown, --after reads no folder, or nothing gets dark."""
    hand = load_hand(CONFIG)
    rising = np.clip(np.arange(600) / 200.0 - 0.6, 0.0, 1.0)[:, None] * np.full(len(hand.joints), 1.5e5)
    concealed = hand.parameters.copy()
    concealed[ROW["constant_load.torque_nm"]] = 0.05
    bag, found = studio.folder / "loaded.mcap", studio.folder / "diagnosis"
    for _ in record_offline(replace(hand, parameters=concealed), rising, bag, seed=2):
        pass
    loaded_model(found)
    command = [*TOOL, "studio", str(bag), "--after", str(found), "--no-browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            studio.page.open(json.loads(process.stdout.readline())["url"])
            studio.page.until_shown("RMS difference: before")
            off_deg = re.search(r"before: ([\d.]+) deg, after: ([\d.]+) deg", studio.page.text())
            assert off_deg is not None and float(off_deg[2]) < 0.3 < 3.0 < float(off_deg[1])
            assert "Ghosts: the model before (blue) and after (green)" in studio.page.text()
            studio.page.press("torque [N m]", "Home")
            studio.page.until("parseFloat(document.body.innerText.split('after: ')[1]) > 3")
            studio.page.click("Reset to what was found")
            studio.page.until("parseFloat(document.body.innerText.split('after: ')[1]) < 0.3")
            scheme = "getComputedStyle(document.documentElement).colorScheme"
            assert studio.page.run(scheme) == "light"
            studio.page.click("Dark or light")
            studio.page.until(f"{scheme} === 'dark'")
            before = studio.still()
            studio.page.press("time s", "End")
            studio.client.until(lambda: changed(before, studio.page.scene()) > 0.005)
        finally:
            process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 0
