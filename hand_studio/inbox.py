"""What users ask for in the page, from the threads of the page to the one thread that talks to the hand."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Request:
    """A button: its name, and what it is about, such as the pattern of a grasp."""

    name: str
    what: str = ""


@dataclass
class Inbox:
    """Newest wanted angle of each joint, and requests in order. An emergency stop removes all that waits.

    send_stop: sends an emergency stop, from any thread and at once.  stop: set by it, cleared by the other thread.
    """

    send_stop: Callable[[], None]
    stop: threading.Event = field(default_factory=threading.Event)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _angle_rad: dict[str, float] = field(default_factory=dict)
    _requests: list[Request] = field(default_factory=list)

    def move(self, joint: str, angle_rad: float) -> None:
        """Take a wanted angle [rad] of a joint; an earlier one that waits is replaced."""
        with self._lock:
            self._angle_rad[joint] = angle_rad

    def ask(self, name: str, what: str = "") -> None:
        """Take a request; the emergency stop is sent at once, whatever the other thread does."""
        if name != "stop":
            with self._lock:
                self._requests.append(Request(name, what))
            return
        self.send_stop()
        with self._lock:
            self._angle_rad.clear()
            self._requests.clear()
            self.stop.set()

    @property
    def waiting(self) -> bool:
        """Whether anything was asked for that has not been taken."""
        return bool(self._angle_rad or self._requests or self.stop.is_set())

    def angles(self) -> dict[str, float]:
        """Wanted angles [rad] by joint since the last call."""
        with self._lock:
            taken, self._angle_rad = self._angle_rad, {}
        return taken

    def next(self) -> Request | None:
        """The oldest request that waits."""
        with self._lock:
            return self._requests.pop(0) if self._requests else None
