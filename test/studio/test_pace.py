"""Pictures wait for the browsers: one in Chromium that is busy, and one of two that sleeps."""

from __future__ import annotations

import threading
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from hand_studio import pace
from hand_studio.pace import Pace
from hand_studio.page import Page
from test.waiting import until
from validation.browser import Browser

BUSY = "(() => { const end = Date.now() + 1800; while (Date.now() < end); })()"
"""Keeps the thread of a page busy for 1.8 s."""


def test_pictures_wait_while_a_browser_is_busy(tmp_path: Path) -> None:
    """Fails when a browser's answers are not heard, or pictures go on while it takes none."""
    page = Page()
    with closing(page), closing(Browser(tmp_path, page.url, (700, 560))) as browser:
        browser.until("document.querySelector('canvas')")
        until(page.server.get_clients)
        (client,) = page.server.get_clients().values()
        client.local_storage.get_item("any", 60.0)
        until(lambda: all(page.pace.may_send() for _ in range(5)))
        busy = threading.Thread(target=browser.run, args=(BUSY,))
        busy.start()
        until(lambda: not page.pace.may_send())
        time.sleep(pace.LATE_S)
        assert not page.pace.may_send()
        busy.join()
        until(lambda: all(page.pace.may_send() for _ in range(5)))


def test_pictures_wait_for_a_late_browser_but_not_for_one_that_sleeps() -> None:
    """Fails when a tab in the background stops the page of another browser, or a page alone is never sent again."""
    awake, asleep = _Client(1), _Client(2)
    server: Any = SimpleNamespace(clients={1: awake}, begin=None)
    server.get_clients = lambda: server.clients
    server.on_client_connect = lambda begin: setattr(server, "begin", begin)
    made = Pace(server)
    assert made.may_send()  # nobody looks
    server.begin(awake)
    until(awake.asked.is_set)
    assert made.may_send()
    server.clients[2] = asleep
    asleep.answers.clear()
    server.begin(asleep)
    time.sleep(2.0 * pace.LATE_S)
    assert not made.may_send()  # it may be slow
    time.sleep(pace.SLOWEST_S)
    assert all(made.may_send() for _ in range(5))
    awake.answers.clear()
    until(lambda: not made.may_send())
    time.sleep(2.0 * pace.SLOWEST_S)
    assert [made.may_send() for _ in range(3)] == [True, False, False]  # all sleep: one picture now and then
    server.clients.clear()
    awake.answers.set()
    asleep.answers.set()
    until(lambda: all(made.may_send() for _ in range(3)))


class _Client:
    """A browser that answers while `answers` is set. asked: whether it ever was."""

    def __init__(self, client_id: int) -> None:
        self.client_id, self.local_storage = client_id, self
        self.asked, self.answers = threading.Event(), threading.Event()
        self.answers.set()

    def get_item(self, key: str) -> None:
        assert key == pace.KEY
        self.asked.set()
        self.answers.wait()
