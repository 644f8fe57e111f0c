"""Pictures of the studio for the documents.

A simulated hand grasps, a recording of another one is replayed, and a headless browser takes the pictures; it needs
chromium.

Example: python -m validation.studio_pictures
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml

from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_recording.installed import default_model
from hand_recording.replay import record_offline
from validation.browser import Browser

SIZE = (1240, 860)
MOTION_S = 5.0
CLOSE = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"
"""Closes what the page says about a browser without a graphics card."""
LOAD_NM, RECORDED_S = 0.05, 8.0
"""Concealed load and length of the recording that is replayed."""


def main() -> None:
    """Write every picture into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"), help="folder of the pictures")
    parser.add_argument("--only", choices=("live", "replay"), help="only these pictures; replay needs no ROS")
    options = parser.parse_args()
    out: Path = options.out
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        if options.only != "replay":
            live(Path(folder), out / "studio.png")
        if options.only != "live":
            replay(Path(folder), out / "studio_replay.png")


def live(folder: Path, out: Path) -> None:
    """The page of a simulated hand that holds the tripod grasp, and next to it a model with a load on every joint."""
    command = [sys.executable, "-m", "hand_tool", "studio", "--sim", "--no-browser", "--json", "--out", str(folder)]
    environment = os.environ | {"ROS_HOME": str(folder)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    page = Browser(folder, json.loads(process.stdout.readline())["url"], SIZE)
    try:
        page.until_shown("Hz, latency")
        page.run(CLOSE)
        _grasp(page)
        out.write_bytes(page.picture())
        page.click("Model")
        page.press("torque_nm", "End")
        time.sleep(1.0)
        picture = page.picture()
        while _vented(page):
            page.click("Drive")
            _grasp(page)
            page.click("Model")
            time.sleep(1.0)
            picture = page.picture()
        out.with_name("studio_model.png").write_bytes(picture)
    finally:
        page.close()
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)


def replay(folder: Path, out: Path) -> None:
    """A recording of fingers with a load that the model lacks, next to the model before and after."""
    hand = load_hand(default_model())
    parameters = hand.parameters.copy()
    parameters[ROW["constant_load.torque_nm"]] = LOAD_NM
    time_s = np.arange(0.0, RECORDED_S, 1.0 / hand.rate_hz)[:, None]
    rise = np.clip(time_s - 0.6, 0.0, 1.0) * np.full(len(hand.joints), 1.5e5)
    recording = folder / "loaded.mcap"
    commands = rise + 4e4 * np.clip(time_s - 2.0, 0.0, 1.0) * np.sin(2.0 * time_s)
    for _ in record_offline(replace(hand, parameters=parameters), commands, recording, seed=2):
        pass
    model = yaml.safe_load(default_model().read_text(encoding="utf-8"))
    model["joint_defaults"]["constant_load"] = {"torque_nm": LOAD_NM}
    found = folder / "found.yaml"
    found.write_text(yaml.safe_dump(model), encoding="utf-8")
    words = [str(recording), "--after", str(found), "--no-browser", "--json"]
    process = subprocess.Popen([sys.executable, "-m", "hand_tool", "studio", *words], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    page = Browser(folder, json.loads(process.stdout.readline())["url"], SIZE)
    try:
        page.until_shown("RMS difference: before")
        page.run(CLOSE)
        page.press("time s", "End")
        page.run("document.activeElement.blur()")
        time.sleep(3.0)
        out.write_bytes(page.picture())
    finally:
        page.close()
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)


def _vented(page: Browser) -> bool:
    return "vented" in page.text()


def _grasp(page: Browser) -> None:
    """Hold the tripod grasp; a busy machine vents the hand, which then begins again."""
    done = False
    while not done:
        page.click("Enable")
        time.sleep(2.0)
        page.click("tripod")
        time.sleep(MOTION_S)
        done = "tripod: " in page.text() and not _vented(page)


if __name__ == "__main__":
    main()
