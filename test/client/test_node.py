"""The client of a running hand, without one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from hand_client.node import HandClient


class Interrupted(BaseException):
    """What Ctrl-C raises."""


@pytest.mark.parametrize("becomes", ["nothing", "an error of compiled code"])
def test_ctrl_c_in_a_callback_is_still_ctrl_c(becomes: str) -> None:
    """Fails when a command cannot end in order because Ctrl-C came while a message was handled."""

    def spin(*_: Any, **__: Any) -> None:
        if becomes != "nothing":
            raise RuntimeError("the executor has stopped")

    def check() -> None:
        raise Interrupted

    client = HandClient.__new__(HandClient)
    client._executor, client._check, client._ended = SimpleNamespace(spin_until_future_complete=spin), check, False
    with pytest.raises(Interrupted):
        client.spin(0.1)
    if becomes == "nothing":
        client.spin(0.1)  # what ends the program may still wait for an answer
