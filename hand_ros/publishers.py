"""One publisher of each topic of authority: which is one too many, where it runs, and how long the hand holds.

Two publishers of valve commands, or two of joint states, cannot both be right. From the moment a second one is found,
the hand holds its pressures for HOLD_S and then vents, and the fault is latched. QUIET_S after a second publisher has
left, a hold ends and the first one is obeyed again. Holds of several visits within SUMMED_S add up: a second publisher
that comes and goes must not hold the hand for ever.

A publisher is known by its DDS identifier. Those of Fast DDS contain 16 bits each of the host and of the process. No
interface of ROS 2 gives the address of another machine.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from hand_ros.streams import MOST_HZ

HOLD_S = 0.5
"""Time for which the pressures are held before the hand vents."""
QUIET_S = 0.1
"""Time without a second publisher after which a hold ends."""
SUMMED_S = 5.0
"""Time in which holds add up."""
FAST_DDS = b"\x01\x0f"
"""Begin of the identifiers of Fast DDS, then two bytes of the host, two of the process, and two random ones."""
PROCESS_BITS = 16

Processes = Mapping[int, tuple[int, str]]
"""Processes of this machine: process number to its start time [ticks] and its command line."""


@dataclass(frozen=True, slots=True)
class Publisher:
    """A publisher: fully qualified name of its node, and its DDS identifier."""

    node: str
    gid: bytes

    @property
    def host(self) -> bytes:
        """What the identifier contains of the machine; empty where it contains nothing of it."""
        return self.gid[2:4] if self.gid.startswith(FAST_DDS) else b""

    @property
    def process(self) -> int:
        """The low PROCESS_BITS bits of the process number."""
        return int.from_bytes(self.gid[4:6], "little")


class SolePublishers:
    """The publishers of some topics. One of each topic is accepted: our own, or else the first one found."""

    def __init__(self, processes: Callable[[int], Processes]) -> None:
        """processes: the processes of this machine whose number has these low bits."""
        self._processes = processes
        self._accepted: dict[str, bytes] = {}
        self._own: dict[str, bytes] = {}
        self._host = b""
        self._seen: dict[bytes, dict[int, int]] = {}
        self.rivals: dict[str, tuple[Publisher, ...]] = {}

    def own(self, topic: str, publisher: Publisher) -> None:
        """Name our own publisher of a topic."""
        self._own[topic], self._host = publisher.gid, publisher.host

    @property
    def host(self) -> str:
        """The 16 bits by which Fast DDS marks this machine, in hexadecimal digits; empty if unknown."""
        return self._host.hex()

    def accepted(self, topic: str) -> bytes:
        """Identifier of the accepted publisher of a topic; empty for none."""
        return self._accepted.get(topic, b"")

    def disown(self, topic: str) -> None:
        """We publish a topic no longer."""
        self._own.pop(topic, None)

    def gives_way_to(self, topic: str, present: Sequence[Publisher], name: str) -> Publisher | None:
        """A publisher, of those that DDS lists now, that keeps the node `name` from publishing; None for none.

        Of two nodes of one name that publish both, that with the lower identifier stays.
        """
        own = self._own.get(topic, b"")
        others = (publisher for publisher in self._live(present) if publisher.gid != own)
        return next((each for each in others if not own or each.node != name or each.gid < own), None)

    def _live(self, present: Sequence[Publisher]) -> list[Publisher]:
        """The publishers whose process runs. DDS lists one that was killed for 20 s more."""
        for publisher in present:
            self._remember(publisher)
        return [publisher for publisher in present if not self._ended(publisher)]

    def update(self, topic: str, present: Sequence[Publisher]) -> None:
        """Take the publishers of a topic that DDS lists now."""
        live = self._live(present)
        accepted = self._own.get(topic) or self.accepted(topic)
        gids = [publisher.gid for publisher in live]
        if topic not in self._own and accepted not in gids:
            accepted = gids[0] if len(gids) == 1 else b""
        self._accepted[topic] = accepted
        others = tuple(publisher for publisher in live if publisher.gid != accepted)
        self.rivals[topic] = others if topic in self._own or len(live) > 1 else ()

    def line(self, disturbed: Sequence[str] = ()) -> str:
        """Every second publisher with its topics and where it runs, one line; empty where there is none.

        disturbed: topics with messages of a second publisher, which DDS may not have shown yet.
        """
        topics: dict[tuple[str, bytes], list[str]] = {}
        for topic, rivals in self.rivals.items():
            for rival in rivals:
                topics.setdefault((rival.node, rival.gid[:12]), []).append(topic)
        parts = [f"{', '.join(names)} from {node} {self._place(node, gid)}" for (node, gid), names in topics.items()]
        hidden = [topic for topic in disturbed if not self.rivals.get(topic)]
        if hidden:
            fast = f"or from one that publishes faster than {MOST_HZ:.0f} Hz"
            parts.append(f"{', '.join(hidden)} from a node that DDS has not shown yet, {fast}")
        return f"second publisher: {'; '.join(parts)}; stop it" if parts else ""

    def _place(self, node: str, gid: bytes) -> str:
        publisher = Publisher(node, gid)
        if not publisher.host:
            return f"(DDS identifier {gid.hex()}; this middleware does not give its machine)"
        if publisher.host != self._host:
            return f"on another machine (DDS host {publisher.host.hex()}; DDS does not give its address)"
        found = self._processes(publisher.process)
        if len(found) == 1:
            ((number, (_, command)),) = found.items()
            return f"on this machine (process {number}: {command})"
        return f"on this machine (process number modulo 65536: {publisher.process})"

    def _remember(self, publisher: Publisher) -> None:
        if publisher.gid not in self._seen and publisher.host and publisher.host == self._host:
            found = self._processes(publisher.process)
            self._seen[publisher.gid] = {number: start for number, (start, _) in found.items()}

    def _ended(self, publisher: Publisher) -> bool:
        """Whether its process was seen on this machine and is gone. One never seen may run in a container."""
        before = self._seen.get(publisher.gid)
        if not before:
            return False
        now = self._processes(publisher.process)
        return all(number not in now or now[number][0] != start for number, start in before.items())


class Verdict(Enum):
    """What a second publisher means for the hand now."""

    ALONE = "no second publisher"
    HOLD = "hold the pressures"
    VENT = "vent and latch"


class Conflict:
    """How long a conflict has lasted. Times are nanoseconds of one monotonic clock."""

    def __init__(self) -> None:
        """Begin without a conflict."""
        self.line = ""
        self._since_ns: int | None = None
        self._last_ns = 0
        self._vented = False
        self._holds: deque[tuple[int, int]] = deque()  # begin and end of the earlier ones

    def update(self, now_ns: int, line: str) -> Verdict:
        """Take the line that names every second publisher now, empty for none."""
        if line:
            self.line, self._last_ns = line, now_ns
            self._since_ns = now_ns if self._since_ns is None else self._since_ns
        elif self._since_ns is not None and now_ns - self._last_ns > QUIET_S * 1e9:
            self._end(self._since_ns, now_ns)
        verdict = self.verdict(now_ns)
        self._vented = self._vented or verdict is Verdict.VENT
        return verdict

    def _end(self, since_ns: int, now_ns: int) -> None:
        """End a hold and remember it. After a vent, which is latched, the sum begins again."""
        self._holds.append((since_ns, now_ns))
        if self._vented:
            self._holds.clear()
        self.line, self._since_ns, self._vented = "", None, False

    def verdict(self, now_ns: int) -> Verdict:
        """The verdict at now_ns [ns]."""
        if self._since_ns is None:
            return Verdict.ALONE
        held_ns = now_ns - self._since_ns + self._earlier_ns(now_ns)
        return Verdict.VENT if held_ns >= HOLD_S * 1e9 else Verdict.HOLD

    def _earlier_ns(self, now_ns: int) -> int:
        """How long the earlier holds have lasted within the last SUMMED_S [ns]."""
        from_ns = now_ns - round(SUMMED_S * 1e9)
        while self._holds and self._holds[0][1] <= from_ns:
            self._holds.popleft()
        return sum(end_ns - max(begin_ns, from_ns) for begin_ns, end_ns in self._holds)
