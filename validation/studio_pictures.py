"""Pictures of the studio for the documents.

A simulated hand grasps, another one is looked at by Record until sure, a recording is replayed, and a headless browser
takes the pictures; it needs chromium.

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
from validation.bench.bench_studio import control
from validation.browser import Browser

SIZE = (1240, 860)
MOTION_S = 5.0
CLOSE = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"
"""Closes what the page says about a browser without a graphics card."""
LOAD_NM, RECORDED_S = 0.05, 8.0
"""Concealed load and length of the recording that is replayed."""
RUBBING, FRICTION_NM = "index_proximal", 0.012
"""Joint and size of the friction that Record until sure finds."""
SURE_S = 600.0
"""Longest time for it."""
TRIES = 5
"""Most attempts at a picture of a hand that a busy machine vents."""


def main() -> None:
    """Write every picture into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"), help="folder of the pictures")
    parser.add_argument("--only", choices=("live", "find", "replay"), help="only these pictures; replay needs no ROS")
    options = parser.parse_args()
    out: Path = options.out
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        for name, draw in (("live", live), ("find", find), ("replay", replay)):
            if options.only in (None, name):
                (Path(folder) / name).mkdir()
                draw(Path(folder) / name, out)


def live(folder: Path, out: Path) -> None:
    """The page of a simulated hand that holds the tripod grasp, and next to it a model with a load on every joint."""
    process, page = _studio(folder, "--sim", "--out", str(folder))
    try:
        page.until_shown("Hz, latency")
        page.run(CLOSE)
        _grasp(page)
        (out / "studio.png").write_bytes(page.picture())
        page.click("Model")
        page.press("torque [N m]", "End")
        time.sleep(1.0)
        picture = page.picture()
        for _ in range(TRIES):
            if not _vented(page):
                break
            page.click("Drive")
            _grasp(page)
            page.click("Model")
            time.sleep(1.0)
            picture = page.picture()
        (out / "studio_model.png").write_bytes(picture)
    finally:
        page.close()
        _end(process)


def find(folder: Path, out: Path) -> None:
    """Record until sure, next to a hand with friction in a joint that the model lacks, when it has its answer."""
    model = yaml.safe_load(default_model().read_text(encoding="utf-8"))
    next(joint for joint in model["joints"] if joint["name"] == RUBBING)["coulomb_friction"] = {
        "torque_nm": FRICTION_NM
    }
    rubs = folder / "rubs.yaml"
    rubs.write_text(yaml.safe_dump(model), encoding="utf-8")
    hand = _start(folder, "up", "--sim", "--model", str(rubs))
    assert hand.stdout is not None
    while "controlling" not in hand.stdout.readline():
        assert hand.poll() is None, "hand up has ended"
    process, page = _studio(folder, "--out", str(folder))
    try:
        page.until_shown("Hz, latency")
        page.run(CLOSE)
        page.click("Find")
        page.choose("joint", RUBBING)
        assert any(_look(page) for _ in range(TRIES)), page.text()
        (out / "studio_find.png").write_bytes(page.picture())
    finally:
        page.close()
        _end(process)
        _end(hand)


def _look(page: Browser) -> bool:
    """Record until sure, from the button to the answer; False where a busy machine vents the hand meanwhile."""
    page.click("Drive")
    control(page)
    page.click("Find")
    page.click("Record until sure")
    page.until("/; report in |^Record until sure:/.test(document.querySelector('#note').innerText)", SURE_S)
    return not page.run("document.querySelector('#note').innerText.startsWith('Record until sure:')")


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
    process, page = _studio(folder, str(recording), "--after", str(found))
    try:
        page.until_shown("RMS difference: before")
        page.run(CLOSE)
        page.press("time s", "End")
        page.run("document.activeElement.blur()")
        time.sleep(3.0)
        (out / "studio_replay.png").write_bytes(page.picture())
    finally:
        page.close()
        _end(process)


def _start(folder: Path, *words: str) -> subprocess.Popen[str]:
    """Begin a command of `hand`."""
    environment = os.environ | {"ROS_HOME": str(folder)}
    return subprocess.Popen(
        [sys.executable, "-m", "hand_tool", *words], stdout=subprocess.PIPE, text=True, env=environment
    )


def _studio(folder: Path, *words: str) -> tuple[subprocess.Popen[str], Browser]:
    """Begin `hand studio`, and open its page."""
    page = Browser(folder, "about:blank", SIZE)
    process = _start(folder, "studio", "--no-browser", "--json", *words)
    assert process.stdout is not None
    page.open(json.loads(process.stdout.readline())["url"])
    return process, page


def _end(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGINT)
    process.wait(timeout=30)


def _vented(page: Browser) -> bool:
    return "vented" in page.text()


def _grasp(page: Browser) -> None:
    """Hold the tripod grasp; a busy machine vents the hand, which then begins again. RuntimeError after TRIES times."""
    for _ in range(TRIES):
        control(page)
        page.click("tripod")
        time.sleep(MOTION_S)
        if "tripod: " in page.text() and not _vented(page):
            return
    raise RuntimeError(f"the hand does not hold the grasp: {page.text()}")


if __name__ == "__main__":
    main()
