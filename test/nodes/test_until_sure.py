"""Record until sure as a user meets it: a concealed effect in a simulated hand, the page in a real browser, DDS."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from hand_recording.loader import load_recording
from test.nodes.stack import Client, Stack
from validation.browser import Browser

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
JOINT, FRICTION_NM = "index_proximal", 0.02
SIZE = (700, 560)
LONGEST_S = 240.0


class Concealed(Stack):
    """A simulated hand with friction in one joint, and a studio whose model does not have it."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.client = Client()
        model = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
        own = next(joint for joint in model["joints"] if joint["name"] == JOINT)
        own["coulomb_friction"] = {"torque_nm": FRICTION_NM}
        other = folder / "concealed.yaml"
        other.write_text(yaml.safe_dump(model), encoding="utf-8")
        self.start("hand", "up", "--sim", "--model", str(other))
        self.client.until(lambda: self.client.joints, 120.0)
        self.start("hand", "studio", "--no-browser", "--json", "--model", str(CONFIG), "--out", str(folder))
        self.client.until(lambda: '"url"' in self.log("hand"), 60.0)
        line = next(line for line in self.log("hand").splitlines() if '"url"' in line)
        self.page = Browser(folder, json.loads(line)["url"], SIZE)

    def begin(self) -> None:
        """Enable the hand and press the button until a motion begins; a machine that stalls makes the hand vent."""
        end = time.monotonic() + LONGEST_S
        while not re.search(r"of 21 s", self.page.text()):
            assert time.monotonic() < end, f"{self.page.text()}\n{self.client.statuses}"
            if not self.client.said("controller", "safety", "controlling"):
                self.page.click("Drive")
                self.page.click("Enable")
                self.client.spin(1.5)  # the status of the nodes comes at 1 Hz
                self.page.click("Find")
            self.page.click("Record until sure")
            self.client.spin(3.0)


@pytest.fixture
def concealed(tmp_path: Path) -> Iterator[Concealed]:
    made = Concealed(tmp_path)
    try:
        made.page.until_shown("Hz, latency")
        yield made
    finally:
        made.page.close()
        made.stop_all()
        made.client.close()


def test_record_until_sure_finds_a_concealed_effect(concealed: Concealed) -> None:
    """Fails when the button moves nothing, records nothing, or the diagnosis of it does not reach the page."""
    page = concealed.page
    page.click("Find")
    page.choose("joint", JOINT)
    end = time.monotonic() + LONGEST_S
    concealed.begin()
    while not re.search(r"; \d recordings?", page.text()):
        assert time.monotonic() < end, f"{page.text()}\n{concealed.log('hand')}"
        if "Record until sure: " in page.text():  # a machine that stalled has made the hand vent
            concealed.begin()
        concealed.client.spin(0.2)
    shown = page.text()
    assert "sure; " in shown and "not sure" not in shown, shown
    assert re.search(rf"coulomb_friction\s+{JOINT}\s+(9\d|100)%", shown), shown
    (recording, *_) = sorted(concealed.folder.glob("hand_*_*[0-9]"))
    assert len(load_recording(recording)["valve_command"]) > 1000
    report = json.loads(next(concealed.folder.glob("hand_*_diagnosis/report.json")).read_text(encoding="utf-8"))
    assert [(found["joint"], found["effect"]) for found in report["findings"]] == [(JOINT, "coulomb_friction")]
