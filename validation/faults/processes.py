"""Processes killed, stopped, ended and restarted in motion, over loopback, a pseudo-terminal and a CAN adapter.

Time runs from the signal to the reaction: to the first valve command of 0 Pa where sensors are lost, to the report of a
vented board where the controller is lost. Afterwards the process runs again: nothing may drive the hand until `reset`
and `enable`, and these must drive it. A recorder may come and go without any effect.
"""

from __future__ import annotations

import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from hand_control.supervisor import VENT_S
from hand_recording.loader import load_recording
from validation.faults.closed_loop import WATCH_S
from validation.faults.live import Nodes, TooLateError, User
from validation.faults.result import FaultResult, Size, Tally

FAMILY = "processes"
LIFETIME_S = 0.1
SLACK_S = 0.15
"""What scheduling and the rate of the reports may add on a machine without other load."""
STOPPED_S = 1.5
QUIET_S = 1.5
"""Time for which a process that is back must not drive the hand."""
QUIET_PA = 2.0e4
"""A measured pressure below this is that of a vented joint, with the error of its sensor."""
CONTROLLER, RECORDER = "controller", "recorder"
RECORDS = "healthy: recorder of"
"""Line of a recorder that receives messages."""
LINKS = ("loopback", "serial", "CAN")
HOW = {"killed": signal.SIGKILL, "stopped and continued": signal.SIGSTOP, "ended": signal.SIGINT}


def run(size: Size, seed: int) -> list[FaultResult]:
    """Every process of every link, each way; quick: the controller killed once on loopback."""
    if size is Size.QUICK:
        return campaign("loopback", {CONTROLLER: ("killed",)}, 1, seed)
    found = []
    for link in LINKS:
        sources = ("simulation",) if link == "loopback" else ("board", "driver")
        victims = {name: tuple(HOW) for name in (*sources, CONTROLLER)}
        victims |= {RECORDER: tuple(HOW)} if link == "loopback" else {}
        found += campaign(link, victims, size.of(1, 2, 5), seed)
    return found


class Rig:
    """A hand on one link: its processes and a user."""

    def __init__(self, nodes: Nodes, user: User, link: str) -> None:
        """Start the processes and drive the hand."""
        self.nodes, self.user = nodes, user
        path = nodes.folder / "port"
        if link == "loopback":
            nodes.node("simulation")
            nodes.node(RECORDER, out=nodes.folder / "recording")
        else:
            option = "--serial" if link == "serial" else "--can"
            nodes.start("board", [sys.executable, "-m", "hand_tool", "emulate-board", option, str(path)])
            user.until(lambda: "ready" in nodes.log("board"), "the emulated board is not ready")
            if link == "serial":
                nodes.node("driver", transport="serial", serial_port=path)
            else:
                nodes.node("driver", transport="can", can_interface="slcan", can_channel=path)
        nodes.node(CONTROLLER)
        user.drive()


@contextmanager
def rig(link: str) -> Iterator[Rig]:
    """A running rig in a folder of its own; everything ends with it."""
    with tempfile.TemporaryDirectory() as folder, Nodes(Path(folder)) as nodes:
        user = User()
        try:
            yield Rig(nodes, user, link)
        finally:
            user.close()


def campaign(link: str, victims: dict[str, tuple[str, ...]], repeats: int, seed: int) -> list[FaultResult]:
    """Each victim in each way, several times, on one running rig."""
    rng = np.random.default_rng([seed, 40 + LINKS.index(link)])
    tallies: dict[tuple[str, str], Tally] = {}
    with rig(link) as running:
        for victim, ways in victims.items():
            for how in ways:
                hazard = f"{victim} {how}, {link}"
                tallies[victim, how] = tally = Tally(FAMILY, hazard, seed, "Pa", real_time=True)
                for number in range(repeats):
                    one_case(running, tally, victim, how, f"{number}", float(rng.uniform(0.1, 0.9)))
    return [tally.result() for tally in tallies.values()]


def one_case(running: Rig, tally: Tally, victim: str, how: str, name: str, after_s: float) -> None:
    """Hit one process in motion, check the reaction, bring it back, check that nothing drives, and drive again."""
    user, nodes = running.user, running.nodes
    took_s: float | None = None
    try:
        user.drive()
        user.spin(after_s)
        user.worst_pa = 0.0
        at_s = time.monotonic()
        nodes.send(victim, HOW[how])
        if victim == RECORDER:
            fault = _undisturbed(running)
        else:
            took_s, fault = _reaction(user, victim, at_s)
        back(running, victim, how)
        after = _undisturbed(running) or readable(nodes.folder) if victim == RECORDER else _quiet(user)
        fault = fault or after
        user.drive()
        tally.case(f"{name}: {fault}", not fault, took_s, user.worst_pa)
    except TooLateError as error:
        tally.case(f"{name}: {error}", False, took_s)


def _reaction(user: User, victim: str, at_s: float) -> tuple[float, str]:
    """Time until the hand is vented, and what is wrong with it."""
    if victim == CONTROLLER:
        user.until(lambda: user.board_vented and user.board_at_s > at_s, "the board does not vent", 3.0)
        took_s, allowed_s = user.board_at_s - at_s, LIFETIME_S + SLACK_S
    else:
        took_s, allowed_s = user.until_vented(at_s), VENT_S + WATCH_S + SLACK_S
        user.until_latched()
    return took_s, "" if took_s <= allowed_s else f"vented only after {took_s:.3f} s"


def back(running: Rig, victim: str, how: str) -> None:
    """Bring a process back: continue it, or start it again."""
    if how.startswith("stopped"):
        running.user.spin(STOPPED_S)
        running.nodes.send(victim, signal.SIGCONT)
        return
    running.user.spin(0.3)
    if victim == RECORDER:
        recording = running.nodes.folder / "recording"
        running.nodes.running[victim].wait(20.0)
        kept = running.nodes.folder / f"recording_{time.monotonic_ns()}"
        recording.rename(kept)
        healthy = running.nodes.log(victim).count(RECORDS)
        running.nodes.restart(victim)
        # One that is ended before it has met its topics has nothing to record.
        running.user.until(lambda: running.nodes.log(victim).count(RECORDS) > healthy, "the recorder does not record")
        return
    running.nodes.restart(victim)
    node = "driver" if victim == "board" else victim
    running.user.statuses.clear()
    running.user.until(lambda: any(f"/{node}:" in name for name in running.user.statuses), f"{node} is not back")


def _quiet(user: User) -> str:
    """Whether the hand stays vented for QUIET_S."""
    user.spin(0.2)  # what was on the way
    user.worst_pa, most = 0.0, 0.0
    end_s = time.monotonic() + QUIET_S
    while time.monotonic() < end_s:
        user.spin(0.02)
        most = max(most, user.commanded_pa if user.command_at_s > end_s - QUIET_S else 0.0)
    if most > 0.0:
        return f"driven without a request, {most:.0f} Pa commanded"
    return "" if user.worst_pa < QUIET_PA else f"driven without a request, {user.worst_pa:.0f} Pa measured"


def _undisturbed(running: Rig) -> str:
    """Whether control goes on for a second without a missed frame or a fault."""
    running.user.stamps_ns.clear()
    running.user.motion()
    running.user.spin(1.0)
    frames = len(running.user.stamps_ns)
    if running.user.latched:
        return f"latched: {running.user.status(CONTROLLER, 'safety')[1]}"
    return "" if frames > 180 else f"{frames} frames in a second"


def readable(folder: Path) -> str:
    """Whether the recordings of killed recorders can be loaded, after a repair where one is offered."""
    for path in sorted(folder.glob("recording_*")):
        try:
            recording = load_recording(path)
        except ValueError as error:
            if "--repair" not in str(error):
                return f"{path.name}: {error}"
        else:
            if "joint_states" not in recording:
                return f"{path.name} has no joint_states"
    return ""
