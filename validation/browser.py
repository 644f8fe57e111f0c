"""A headless Chromium, driven through its DevTools protocol, for tests and pictures of pages."""

from __future__ import annotations

import base64
import io
import itertools
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.image import imread
from websockets.sync.client import connect

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--no-first-run", "--disable-quic", "--hide-scrollbars", "--mute-audio")
DRAWING = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
QUIET = ("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions")
LAST = ("nice", "-n", "19")
KEEP_LAST = ("setpriv", "--bounding-set", "-sys_nice", "--inh-caps", "-sys_nice")
"""Without a graphics card the browser takes every core that it gets, and the hand under test keeps deadlines. So it has
the lowest priority, and where it runs as root, it loses the right to raise that of the process that draws."""
WAIT_S = 90.0


def changed(first: bytes, second: bytes) -> float:
    """Share [0 to 1] of the pixels that differ clearly between two PNG pictures of one size."""
    pictures = [imread(io.BytesIO(picture))[..., :3] for picture in (first, second)]
    return float(np.mean(np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.1))


class Browser:
    """One page at a size in pixels."""

    def __init__(self, folder: Path, url: str, size: tuple[int, int] = (900, 700)) -> None:
        assert BROWSER, "no browser: install chromium"
        profile = folder / "profile"
        window = f"--window-size={size[0]},{size[1]}"
        options = [*FLAGS, *DRAWING, *QUIET, window, f"--user-data-dir={profile}", "--remote-debugging-port=0"]
        with (folder / "browser.log").open("wb") as log:
            root = os.geteuid() == 0 and shutil.which(KEEP_LAST[0]) is not None
            self._process = subprocess.Popen(
                [*(KEEP_LAST if root else ()), *LAST, BROWSER, *options, "about:blank"], stdout=log, stderr=log
            )
        self._numbers = itertools.count(1)
        port_file = profile / "DevToolsActivePort"
        self._until(lambda: port_file.is_file() and len(port_file.read_text().splitlines()) == 2)
        port, path = port_file.read_text(encoding="utf-8").splitlines()
        self._socket = connect(f"ws://127.0.0.1:{port}{path}", max_size=None)
        self._session = ""
        targets = self._call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        self.open(url)

    @property
    def pid(self) -> int:
        """Number of its first process."""
        return self._process.pid

    def open(self, url: str) -> None:
        """Show another page."""
        self._call("Page.navigate", url=url)

    def _until(self, condition: Callable[[], Any], timeout_s: float = WAIT_S) -> None:
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, "the browser does not answer"
            time.sleep(0.05)

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        self._socket.send(json.dumps(message | ({"sessionId": self._session} if self._session else {})))
        while True:
            answer = json.loads(self._socket.recv(timeout=WAIT_S))
            if answer.get("id") == number:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result

    def run(self, script: str) -> Any:
        """The value of a JavaScript expression in the page."""
        answer = self._call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def busy_s(self, script: str) -> float:
        """Processor time [s] that the page takes to evaluate a JavaScript expression; other programs do not count."""
        self._call("Performance.enable", timeDomain="threadTicks")
        begun_s = self._busy_s()
        self.run(script)
        return self._busy_s() - begun_s

    def _busy_s(self) -> float:
        metrics = self._call("Performance.getMetrics")["metrics"]
        return next(float(each["value"]) for each in metrics if each["name"] == "TaskDuration")

    def text(self) -> str:
        """What the page shows."""
        return str(self.run("document.body?.innerText ?? ''"))

    def until(self, script: str, timeout_s: float = WAIT_S) -> None:
        """Wait until a JavaScript expression is true."""
        end = time.monotonic() + timeout_s
        while not self.run(f"Boolean({script})"):
            assert time.monotonic() < end, f"{script} within {timeout_s} s; the page shows:\n{self.text()}"
            time.sleep(0.05)

    def until_shown(self, text: str, timeout_s: float = WAIT_S) -> None:
        """Wait until the page shows a text."""
        self.until(f"(document.body?.innerText ?? '').includes({json.dumps(text)})", timeout_s)

    def click(self, label: str) -> None:
        """Click the first button or tab whose text begins with the label, when it lies still and nothing covers it."""
        every = "[...document.querySelectorAll('button, [role=tab]')]"
        find = f"{every}.find(b => b.innerText.startsWith({json.dumps(label)}))"
        self.until(find)
        x, y = self._still(find)
        for kind in ("mousePressed", "mouseReleased"):
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def _still(self, find: str) -> tuple[float, float]:
        """The middle of an element [pixels], by a JavaScript expression, once a click there would reach it.

        It is scrolled to until then: a line that appears above it, such as why the hand was vented, moves it away.
        """
        middle = "(r => [r.x + r.width / 2, r.y + r.height / 2])(e.getBoundingClientRect())"
        script = f"(e => (([x, y]) => [x, y, e.contains(document.elementFromPoint(x, y))])({middle}))({find})"
        before, end = None, time.monotonic() + WAIT_S
        while True:
            self.run(f"{find}.scrollIntoView({{block: 'nearest'}})")
            x, y, reached = self.run(script)
            if reached and (x, y) == before:
                return x, y
            assert time.monotonic() < end, f"{find} moves or is covered; the page shows:\n{self.text()}"
            before = (x, y)
            time.sleep(0.05)

    def drag(self, selector: str, begin: float, end: float) -> None:
        """Drag the mouse over the first element that a CSS selector finds. begin, end: shares of its width [-]."""
        find = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{find}.scrollIntoView({{block: 'center'}})")
        x, y, width, height = self.run(f"(r => [r.x, r.y, r.width, r.height])({find}.getBoundingClientRect())")
        for kind, share in (("mousePressed", begin), ("mouseMoved", end), ("mouseReleased", end)):
            place = {"x": x + share * width, "y": y + height / 2.0, "button": "left", "buttons": 1}
            self._call("Input.dispatchMouseEvent", type=kind, clickCount=1, **place)

    def choose(self, label: str, option: str) -> None:
        """Choose an option of the list with this label."""
        find = f"[...document.querySelectorAll('label')].find(l => l.innerText === {json.dumps(label)})"
        self.until(find)
        self.run(
            f"(() => {{ let row = {find}; while (!row.querySelector('input')) row = row.parentElement;"
            " row.querySelector('input').click(); })()"
        )
        found = f"[...document.querySelectorAll('[role=option]')].find(o => o.innerText === {json.dumps(option)})"
        self.until(found)
        self.run(f"{found}.click()")

    def press(self, slider: str, key: str, times: int = 1) -> None:
        """Press a key on the slider with this label: Home, End, ArrowLeft or ArrowRight."""
        find = f"[...document.querySelectorAll('label')].find(l => l.innerText === {json.dumps(slider)})"
        self.run(
            f"(() => {{ let row = {find};"
            " while (!row.querySelector('[role=slider]')) row = row.parentElement;"
            " row.querySelector('[role=slider]').focus(); })()"
        )
        for _ in range(times):
            for kind in ("keyDown", "keyUp"):
                self._call("Input.dispatchKeyEvent", type=kind, key=key, code=key)

    def key(self, key: str) -> None:
        """Press a key on the element that has the focus."""
        text = {"text": key} if len(key) == 1 else {}
        self._call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self._call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def element(self, selector: str) -> bytes:
        """The picture of the first element that a CSS selector finds, as PNG."""
        self.until(f"document.querySelector({json.dumps(selector)})")
        find = f"document.querySelector({json.dumps(selector)})"
        box = self.run(f"(r => [r.x, r.y, r.width, r.height])({find}.getBoundingClientRect())")
        clip = dict(zip(("x", "y", "width", "height"), box, strict=True)) | {"scale": 1}
        return base64.b64decode(self._call("Page.captureScreenshot", format="png", clip=clip)["data"])

    def scene(self) -> bytes:
        """The picture of the 3-D scene, as PNG."""
        return self.element("canvas")

    def picture(self) -> bytes:
        """The page as PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])

    def emulate(self, size: tuple[int, int], *, dark: bool = False, printed: bool = False) -> None:
        """Show the page at another size in pixels, in light or dark colours, on a screen or as it is printed."""
        width, height = size
        self._call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", media="print" if printed else "screen", features=[scheme])

    def whole(self) -> bytes:
        """The whole page as PNG, also what lies below the window."""
        return base64.b64decode(
            self._call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=self._extent())["data"]
        )

    def _extent(self) -> dict[str, float]:
        size = self._call("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0.0, "y": 0.0, "width": size["width"], "height": size["height"], "scale": 1.0}

    def close(self) -> None:
        """End the browser."""
        self._socket.close()
        self._process.terminate()
        self._process.wait(timeout=20)
