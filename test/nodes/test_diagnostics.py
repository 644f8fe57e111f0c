"""What a node says and how often: neither refused commands nor a fault that lasts may flood diagnostics and log."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

import hand_ros.node
from hand_messages.health import Health, Level
from hand_ros.node import CHANGE_PERIOD_S, LOG_PERIOD_S, RARELY_S, HandNode

if TYPE_CHECKING:
    from test.nodes.stack import Client


class Clock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


class Probe(HandNode):
    """A configured node whose only status is what the test sets; it keeps what it publishes and logs."""

    def __init__(self) -> None:
        super().__init__("probe", ())
        self.configured = self.active = True
        self.status = Health("commands", Level.OK, "accepted")
        self.published: list[Any] = []
        self.logged: list[str] = []
        self._diagnostics = SimpleNamespace(publish=self.published.append)

    def health(self) -> list[Health]:
        return [self.status]

    def get_logger(self) -> Any:
        keep = self.logged.append
        return SimpleNamespace(info=keep, warning=keep, error=keep)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(hand_ros.node, "time", made)
    return made


@pytest.fixture
def probe(client: Client, clock: Clock) -> Iterator[Probe]:
    assert client.node and clock  # ROS has been started, and time stands still
    made = Probe()
    yield made
    made.destroy_node()


def test_refused_commands_do_not_amplify(probe: Probe, clock: Clock) -> None:
    """Fails when each of 2,000 refused goals a second causes a message of diagnostics or a line of the log."""
    seconds = 2.0
    for k in range(round(2000 * seconds)):
        clock.now_s += 1.0 / 2000
        line = f"grasp refused: pattern is 'p{k}'"
        probe.status = Health("commands", Level.ERROR, line)
        probe.log_throttled(Level.ERROR, "grasp", line)
        probe.publish_health()
    assert 2 <= len(probe.published) <= 1 + seconds / CHANGE_PERIOD_S
    assert 1 <= len(probe.logged) <= 1 + seconds / LOG_PERIOD_S
    assert f"'p{round(2000 * seconds) - 1}'" in probe.status.message


def test_a_change_is_published_at_once_and_no_change_once_a_second(probe: Probe, clock: Clock) -> None:
    """Fails when a new status waits for the next second, or one that stays floods the topic."""
    probe.publish_health()
    clock.now_s += 0.1
    probe.status = Health("safety", Level.ERROR, "vented: a fault")
    probe.publish_health()
    assert len(probe.published) == 2
    assert [(each.key, each.value) for each in probe.published[-1].status[0].values] == [("level", "2")]
    for _ in range(100):  # 10 s of the timer
        clock.now_s += 0.1
        probe.publish_health()
    assert 2 + 9 <= len(probe.published) <= 2 + 10


def test_a_node_without_frames_is_reported_once(probe: Probe, clock: Clock) -> None:
    """Fails when a node that receives no frames logs nothing, repeats its line at once, or is called healthy."""
    probe.cycles = 0
    for _ in range(100):  # 10 s of the timer
        clock.now_s += 0.1
        probe.publish_health()
    assert probe.logged == ["not healthy: probe in /hand receives no frames"]
    for _ in range(20):
        clock.now_s += 0.1
        probe.cycles += 20
        probe.publish_health()
    assert len(probe.logged) == 2 and probe.logged[1].startswith("healthy: probe runs in /hand at ")


def test_a_latched_fault_is_logged_once_and_then_rarely(probe: Probe, clock: Clock) -> None:
    """Fails when a fault that stays latched fills the log, is never mentioned again, or a new one is not logged."""
    hours = 2.0
    for _ in range(round(hours * 3600.0 / 0.02 / 100)):  # every hundredth call of the timer of 20 ms
        clock.now_s += 2.0
        probe.log_throttled(Level.ERROR, "fault", "vented: no usable sensor data", RARELY_S)
    assert hours * 3600.0 / RARELY_S <= len(probe.logged) <= 1 + hours * 3600.0 / RARELY_S
    clock.now_s += LOG_PERIOD_S
    probe.log_throttled(Level.ERROR, "fault", "vented: another fault", RARELY_S)
    assert probe.logged[-1] == "vented: another fault"
