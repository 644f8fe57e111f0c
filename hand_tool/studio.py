"""`hand studio`: a hand in the browser, live or from a recording."""

from __future__ import annotations

import functools
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from hand_recording.installed import default_model
from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import fail, note, require, running
from hand_tool.live import Namespace, Prefix
from hand_tool.node_commands import Link, frames_command, node_commands
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.paths import check_folder
from hand_tool.processes import READY_S, ProcessError, Processes
from hand_tool.studio_replay import replay

if TYPE_CHECKING:
    from hand_client.node import HandClient
    from hand_model.description import Hand
    from hand_studio.page import Page

ALONE_S = 1.0
"""Time in which a hand that runs already is discovered before another one is started; `Watch` finds it later, too."""
HEARD_S = 4.0
"""Time in which a hand that runs already is heard; discovery takes up to 2.7 s."""
CLIENT = "hand_studio"
"""Name of the node of this command, by which another studio is found."""


def studio(
    *,
    recording: Annotated[Path | None, typer.Argument(help="Replay this recording. Default: a running hand.")] = None,
    after: Annotated[
        Path | None, typer.Option(help="With a recording: the found model, as OUT or OUT/model.yaml of hand diagnose.")
    ] = None,
    sim: Annotated[bool, typer.Option("--sim", help="Start a simulated hand.")] = False,
    serial: Annotated[str, typer.Option(help="Start the hand at this serial port, such as /dev/ttyUSB0.")] = "",
    can: Annotated[str, typer.Option(help="Start the hand at this CAN channel, such as can0.")] = "",
    can_interface: Annotated[str, typer.Option(help="python-can interface, with --can.")] = "socketcan",
    namespace: Namespace = "hand",
    joint_prefix: Prefix = "",
    model: Model = None,
    out: Annotated[Path, typer.Option(help="Folder for the recordings made in the page.")] = Path(),
    port: Annotated[int, typer.Option(help="Port of the page; 0: any free one.")] = 0,
    listen: Annotated[
        str, typer.Option(help="IP address to serve at; 0.0.0.0: every one of this machine.")
    ] = "127.0.0.1",
    allow_others: Annotated[
        bool, typer.Option("--allow-others", help="Other machines may drive the hand, too.")
    ] = False,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page.")] = True,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show and drive a hand in the browser: the running one, one that this command starts, or a recording.

    Example: hand studio --sim

    Exit codes: 0 ended by Ctrl-C, 2 bad usage, no running hand, a second studio, or a node failed.
    """
    with running("studio", errors=(RuntimeError,)):
        if sum((bool(serial), bool(can), sim, recording is not None)) > 1:
            raise ValueError("a recording, --serial, --can and --sim exclude each other")
        if after is not None and recording is None:
            raise ValueError("--after needs a recording")
        chosen = choose_model(model)
        check_folder(out)
        require("viser")
        from hand_control.grasps import load_grasps
        from hand_model.description import load_hand
        from hand_model.geometry import geometry_of
        from hand_studio.legend import switching
        from hand_studio.page import Page

        hand = load_hand(chosen.path, joint_prefix)
        geometry_of(hand)
        if warning := switching(hand):
            note(f"hand studio: {warning}")
        if recording is not None:
            chosen.print(as_json)
            announce = functools.partial(_announce, browser=browser, as_json=as_json)
            serve = functools.partial(Page, listen, port, allow_others=allow_others)
            replay((recording, namespace), after, hand, serve, announce)
            return
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        grasps = load_grasps(default_model().with_name("grasps.yaml"), hand)
        chosen.print(as_json)
        link = Link(serial, can, can_interface) if serial or can or sim else None
        try:
            with ExitStack() as stack:
                interrupts.release()
                interrupts.end_on_sigterm()
                nodes = Processes(Path(stack.enter_context(TemporaryDirectory())))
                stack.enter_context(nodes)
                if link is not None:
                    for command in node_commands(link, namespace, joint_prefix, chosen.path):
                        nodes.prepare(command[0], command)
                from hand_client.node import HandClient

                checks: list[Callable[[], None]] = [interrupts.check]
                client = stack.enter_context(HandClient(namespace, CLIENT, _all(checks)))
                begun_s = time.monotonic()
                from hand_studio.inbox import Inbox  # other nodes are discovered meanwhile
                from hand_studio.live_page import LivePage
                from hand_tool.until_sure import Experiments

                page = Page(listen, port, allow_others=allow_others)
                stack.callback(page.close)
                if link is not None:
                    client.until(lambda: _runs_already(client, 0), max(ALONE_S - time.monotonic() + begun_s, 0.0))
                    check_alone(client, 0)
                    nodes.go()
                live = LivePage(page, client, hand, grasps, Inbox(client.send_stop))
                checks.append(live.check)
                _announce(page, client.namespace, browser, as_json)
                recorder = BagRecorder(stack.enter_context(TemporaryDirectory()), out, client.namespace)
                with interrupts.until_raised():
                    study = Experiments(hand, chosen.path, out)
                    frames = frames_command(namespace, joint_prefix, chosen.path) if link is not None else []
                    live.run(recorder, study, Watch(client, hand, nodes, frames))
        except ProcessError as error:  # also of a node that had to be killed after Ctrl-C
            fail("studio", str(error), 2)
        note("hand studio: ended" if link is None else "hand studio: vented, nodes ended")


def _runs_already(client: HandClient, own: int) -> bool:
    """Whether there are more controllers, drivers or simulations in the namespace than `own` of either kind."""
    names = client.others()
    return names.count("controller") > own or names.count("driver") + names.count("simulation") > own


def check_alone(client: HandClient, own: int) -> None:
    """Raise ValueError, one line, where a hand runs already. own: controllers that this command has started."""
    if _runs_already(client, own):
        raise ValueError(f"a hand runs already in {client.namespace}; show it with: hand studio; or end it")


def check_joints(joints: Sequence[str], hand: Hand, namespace: str) -> None:
    """Raise ValueError, one line, where a running hand has other joints than the model; none: not known yet."""
    unknown = sorted(set(joints) - set(hand.joints))
    missing = sorted(set(hand.joints) - set(joints))
    if joints and (unknown or missing):
        what = f"has no joint {missing[0]}" if missing else f"has a joint {unknown[0]} that {hand.path} lacks"
        raise ValueError(f"the hand in {namespace} {what}; it has {', '.join(joints)}: give --joint-prefix or --model")


def _all(checks: Sequence[Callable[[], None]]) -> Callable[[], None]:
    """A function that calls all of them, also those that are added later."""

    def check_all() -> None:
        for check in checks:
            check()

    return check_all


def _announce(page: Page, shown: str, browser: bool, as_json: bool) -> None:
    """Print where the page of a hand or recording is, and open it where there is a display."""
    if as_json:
        print(json.dumps({"url": page.url, "shown": shown}), flush=True)
    else:
        print(f"{shown} in the browser: {page.url}", flush=True)
    if not browser:
        return
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")):
        note(
            f"no display here; on another machine: ssh -L {page.port}:localhost:{page.port} HOST, then open the address"
        )
        return
    import webbrowser

    webbrowser.open(page.url)


class Watch:
    """Called all the time: raises where the hand does not come or is not that of the model, a node ends, or another
    studio drives the hand.
    """

    def __init__(self, client: HandClient, hand: Hand, nodes: Processes, frames: list[str]) -> None:
        """frames: the command of the node for other viewers, begun when the page has its hand; [] where none is begun.

        Only a command that started the other nodes starts this one, too.
        """
        self._client, self._hand, self._nodes, self._started = client, hand, nodes, bool(frames)
        self._frames = frames
        self._begun_s, self._heard = time.monotonic(), False

    def __call__(self) -> None:
        """Raise ValueError or ProcessError, one line."""
        self._nodes.check()
        waited_s = time.monotonic() - self._begun_s
        self._heard = self._heard or bool(self._client.state.joints)
        check_joints(self._client.state.joints, self._hand, self._client.namespace)
        if waited_s < HEARD_S:
            if self._started:
                check_alone(self._client, 1)
            if CLIENT in self._client.others():
                raise ValueError(f"a studio of {self._client.namespace} runs already; end it, or use its page")
            return
        if self._heard and self._frames:
            self._nodes.start("frame_publisher", self._frames, optional=True)
            self._frames = []
        if not self._heard and not self._started:
            raise ValueError(f"no hand runs in {self._client.namespace}; start one with: hand studio --sim")
        if not self._heard and waited_s > READY_S:
            raise ProcessError(
                f"no frames from the hand within {READY_S:g} s; {'; '.join(self._client.state.problems)}"
            )


class BagRecorder:
    """Runs the recorder node for each recording."""

    def __init__(self, logs: str, folder: Path, namespace: str) -> None:
        """Recordings are new folders hand_DATE_TIME in a folder."""
        self._processes, self._folder, self._namespace = Processes(Path(logs)), folder, namespace
        self._path = folder

    def start(self) -> str:
        """Begin a recording and return its path."""
        self._path = self._folder / time.strftime("hand_%Y-%m-%d_%H-%M-%S")
        arguments = ["--ros-args", "-r", f"__ns:={self._namespace}", "-p", f"out:={self._path}"]
        self._processes.start("recorder", ["recorder", *arguments])
        return str(self._path)

    def stop(self) -> str:
        """End it; the line that names its path, or the error."""
        try:
            self._processes.check()
            self._processes.stop("recorder")
        except ProcessError as error:
            return f"not recorded: {error}"
        return f"recorded: {self._path}"
