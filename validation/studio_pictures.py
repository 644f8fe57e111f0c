"""Pictures of the studio for the documents.

A simulated hand grasps, and a headless browser takes the pictures; it needs chromium and about half a minute.

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
from pathlib import Path
from tempfile import TemporaryDirectory

from validation.browser import Browser

SIZE = (1240, 860)
MOTION_S = 5.0


def main() -> None:
    """Write every picture into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"), help="folder of the pictures")
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        live(Path(folder), out / "studio.png")


def live(folder: Path, out: Path) -> None:
    """The page of a simulated hand that holds the tripod grasp, and next to it a model with a load on every joint."""
    command = [sys.executable, "-m", "hand_tool", "studio", "--sim", "--no-browser", "--json", "--out", str(folder)]
    environment = os.environ | {"ROS_HOME": str(folder)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    page = Browser(folder, json.loads(process.stdout.readline())["url"], SIZE)
    try:
        page.until_shown("Hz, latency")
        page.run("document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())")
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
