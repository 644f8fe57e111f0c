"""Whether the browsers keep up with the pictures: what a slow one has not drawn yet would otherwise grow for ever."""

from __future__ import annotations

import threading
import time
from contextlib import suppress

import viser

LATE_S = 0.25
"""Age of a question that no browser has answered, from which pictures wait."""
SLOWEST_S = 2.0
"""Time after which a picture is sent anyway; a browser that answers nothing for so long is asleep and waited for by
no other."""
PAUSE_S = 0.1
"""Between an answer and the next question."""
KEY = "pace"


class Pace:
    """Asks every browser again and again for an item of its store.

    A browser handles messages in order, so its answer says that it has taken all that was sent before the question.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        """Ask all browsers that connect from now on."""
        self._server = server
        self._lock = threading.Lock()
        self._asked_s: dict[int, float] = {}
        self._sent_s = 0.0
        server.on_client_connect(self._begin)

    def may_send(self) -> bool:
        """Whether to send the next picture now. False while a browser has not taken the earlier ones."""
        now = time.monotonic()
        with self._lock:
            waits_s = [now - asked_s for asked_s in self._asked_s.values()]
        awake = [wait_s for wait_s in waits_s if wait_s < SLOWEST_S]
        asleep = bool(waits_s) and not awake
        if (asleep or max(awake, default=0.0) >= LATE_S) and now - self._sent_s < SLOWEST_S:
            return False
        self._sent_s = now
        return True

    def _begin(self, client: viser.ClientHandle) -> None:
        name = f"pace of browser {client.client_id}"
        threading.Thread(target=self._ask, args=(client,), daemon=True, name=name).start()

    def _ask(self, client: viser.ClientHandle) -> None:
        """Ask until the browser is gone; the time of the newest question stays until the next one."""
        number = client.client_id
        while number in self._server.get_clients():
            with self._lock:
                self._asked_s[number] = time.monotonic()
            with suppress(RuntimeError):  # gone, or it has no store: an answer as well
                client.local_storage.get_item(KEY)
            with self._lock:
                self._asked_s[number] = time.monotonic()
            time.sleep(PAUSE_S)
        with self._lock:
            self._asked_s.pop(number, None)
