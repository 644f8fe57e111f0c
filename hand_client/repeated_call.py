"""A service that is called again where no answer comes: it is lost where the server has not heard of the client yet."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


class RepeatedCall:
    """Calls of one service, whose first answer counts; the service must bear to be called more than once."""

    def __init__(self, call: Callable[[], Any], again_s: float) -> None:
        """call: calls the service and returns its future.  again_s: time [s] after which it is called again."""
        self._call, self._again_s = call, again_s
        self._begun_s, self._calls = time.monotonic(), list[Any]()

    def answered(self) -> bool:
        """Whether an answer has come; calls where it is time to."""
        if time.monotonic() - self._begun_s >= self._again_s * len(self._calls):
            self._calls.append(self._call())
        return any(call.done() for call in self._calls)

    def answer(self) -> Any:
        """The answer that has come."""
        return next(call.result() for call in self._calls if call.done())
