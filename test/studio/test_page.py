"""The parts of the studio that need no browser: who may drive, what waits to be sent, shapes, missing parts."""

from __future__ import annotations

import math
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser
import yaml
from msgspec import msgpack
from typer.testing import CliRunner
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from hand_client.live_state import ERROR, LiveState
from hand_model.description import load_hand
from hand_model.geometry import Shape, pose, rotation_about
from hand_studio.hand_meshes import mesh, quaternion
from hand_studio.inbox import Inbox, Request
from hand_studio.legend import LIVE, legend
from hand_studio.page import Page, check_address, may_drive
from hand_studio.panel import LOOKING, said
from hand_tool import studio
from hand_tool.cli import app
from test.waiting import until

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
HERE = {"Host": "127.0.0.1:8000", "Origin": "http://127.0.0.1:8000"}


def test_only_the_own_page_on_this_machine_drives() -> None:
    """Fails when another machine, a page of another site, or a foreign name of this machine may move the hand."""
    assert may_drive("127.0.0.1", HERE, allow_others=False)
    assert may_drive("::1", {"Host": "localhost:80", "Origin": "http://localhost:80"}, allow_others=False)
    assert not may_drive("192.168.0.7", HERE, allow_others=False)
    assert may_drive("192.168.0.7", HERE, allow_others=True)
    for host, origin in (
        ("127.0.0.1:8000", "http://example.org"),
        ("127.0.0.1:8000", "http://127.0.0.1:9000"),
        ("127.0.0.1:8000", ""),
        ("example.org:8000", "http://example.org:8000"),
    ):
        assert not may_drive("127.0.0.1", {"Host": host, "Origin": origin}, allow_others=True), (host, origin)


def test_who_may_not_drive_changes_no_control() -> None:
    """Fails when a control keeps what a foreign page sets, or what the page of this machine sets has no effect."""
    page = Page()
    try:
        foreign, own = (page.server.gui.add_slider(name, 0.0, 1.0, 0.1, 0.5) for name in ("foreign", "own"))
        with (
            send_value(page, "http://example.org", foreign._impl.uuid, 0.9),
            send_value(page, page.url, own._impl.uuid, 0.2),
        ):
            until(lambda: own.value == 0.2)
        assert foreign.value == 0.5
    finally:
        page.close()


@contextmanager
def send_value(page: Page, origin: str, uuid: str, value: float) -> Iterator[None]:
    """A client that comes from a page of an origin and sets the value of one control."""
    version = Subprotocol(f"viser-v{viser.__version__}")
    with connect(page.url.replace("http", "ws"), origin=Origin(origin), subprotocols=[version]) as connection:
        message = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
        connection.send(msgpack.encode(message))
        yield


def test_an_emergency_stop_removes_what_waits() -> None:
    """Fails when a stop waits for the thread that talks to the hand, or what was asked for before is sent after it."""
    sent: list[bool] = []
    inbox = Inbox(lambda: sent.append(True))
    inbox.move("index_proximal", 0.3)
    inbox.move("index_proximal", 0.5)
    inbox.ask("grasp", "tripod")
    inbox.ask("stop")
    assert sent == [True] and inbox.stop.is_set() and inbox.waiting
    assert inbox.angles() == {} and inbox.next() is None
    inbox.move("index_proximal", 0.2)
    inbox.ask("enable")
    assert inbox.angles() == {"index_proximal": 0.2} and inbox.angles() == {}
    assert inbox.next() == Request("enable") and inbox.next() is None and sent == [True]


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (Shape("box", (0.09, 0.08, 0.03), np.eye(4)), 0.09 * 0.08 * 0.03),
        (Shape("capsule", (0.03, 0.01), pose(np.array([0.1, 0.0, 0.0]))), math.pi * 1e-4 * (0.03 + 0.04 / 3.0)),
    ],
    ids=["box", "capsule"],
)
def test_meshes_are_closed_and_point_outwards(shape: Shape, volume: float) -> None:
    """Fails when a face is missing or seen from inside: the divergence theorem then gives another volume."""
    vertices, faces = mesh(shape)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(volume, rel=0.05)
    assert vertices.mean(axis=0) == pytest.approx(shape.pose[:3, 3], abs=1e-9)


def test_quaternions_turn_as_their_matrices() -> None:
    """Fails when w is not first, or the turn has the other sign."""
    rng = np.random.default_rng(7)
    print("seed 7")
    for _ in range(20):
        axis = rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        angle = rng.uniform(0.01, np.pi - 0.01)
        w, *xyz = quaternion(rotation_about(axis, angle)) * 1.0
        assert np.array([w, *xyz]) * np.sign(w) == pytest.approx([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def test_a_port_or_an_address_that_cannot_be_used_is_one_line() -> None:
    """Fails when the server would take another port without asking, or the reason is not given."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ValueError, match=f"cannot serve at 127.0.0.1 port {port}"):
            check_address("127.0.0.1", port)
    for listen, port, line in (
        ("127.0.0.1", 80, "1024 to 65535"),
        ("here", 0, "IP address"),
        ("192.0.2.1", 0, "cannot"),
    ):
        with pytest.raises(ValueError, match=line):
            check_address(listen, port)


def test_what_the_studio_lacks_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a missing viser or a hand without geometry starts a hand, or takes more than a line."""
    flat = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    del flat["geometry"]
    path = tmp_path / "hand.yaml"
    path.write_text(yaml.safe_dump(flat), encoding="utf-8")
    answer = CliRunner().invoke(app, ["studio", "--sim", "--model", str(path)])
    assert answer.exit_code == 2 and "geometry is missing" in answer.output
    answer = CliRunner().invoke(app, ["studio", "--sim", "--serial", "/dev/null"])
    assert answer.exit_code == 2 and "exclude each other" in answer.output

    def absent(*modules: str) -> None:
        raise ModuleNotFoundError(f"No module named {modules[0]!r}", name=modules[0])

    monkeypatch.setattr(studio, "require", absent)
    answer = CliRunner().invoke(app, ["studio", "--sim"])
    assert answer.exit_code == 2 and "pip install 'fluidic_hand[studio]'" in answer.output
    assert len(answer.output.splitlines()) == 1


def test_a_running_hand_that_is_not_the_models_is_one_line() -> None:
    """Fails when a hand with other joints is shown at rest without a reason, or one whose joints come in another order
    is refused.
    """
    hand = load_hand(CONFIG)
    client: Any = SimpleNamespace(state=LiveState(), others=list, namespace="/left_hand")
    nodes: Any = SimpleNamespace(check=lambda: None)
    watch = studio.Watch(client, hand, nodes, [])
    watch()
    client.state.joints = hand.joints[::-1]
    watch()
    for joints, reason in (
        (tuple(f"left_{joint}" for joint in hand.joints), "has no joint index_distal; it has left_"),
        (hand.joints[:-1], f"has no joint {hand.joints[-1]}"),
        ((*hand.joints, "wrist"), f"has a joint wrist that {CONFIG} lacks"),
    ):
        client.state.joints = joints
        with pytest.raises(ValueError, match=rf"the hand in /left_hand {re.escape(reason)}.* give --joint-prefix"):
            watch()


def test_a_hand_whose_valves_switch_is_shown_with_a_warning(tmp_path: Path) -> None:
    """Fails when a model with analog valves is shown next to a hand with switching ones without a word."""
    text = CONFIG.read_text(encoding="utf-8")
    (tmp_path / "hand.yaml").write_text(text.replace("valve_kind: analog", "valve_kind: switching"), encoding="utf-8")
    for path, warns in ((tmp_path / "hand.yaml", True), (CONFIG, False)):
        hand = load_hand(path)
        assert ("valve_kind of" in legend(LIVE, hand)) == warns and "Blue ghost" in legend(LIVE, hand)
        answer = CliRunner().invoke(app, ["studio", str(tmp_path / "none.mcap"), "--model", str(path)])
        assert answer.exit_code == 2 and ("is switching, but the model" in answer.output) == warns


def test_the_status_says_once_why_the_hand_does_not_move() -> None:
    """Fails when a reason stands there twice, other errors are lost, or a button has the name of a service."""
    assert said(LiveState()) == (LOOKING, ())
    reason = "emergency stop: a message arrived on emergency_stop"
    vented = f"vented: {reason}; call reset, then enable"
    state = LiveState(
        statuses={
            "controller: safety": (ERROR, vented),
            "simulation: safety": (ERROR, f"vented: {reason}; call reset_driver"),
            "controller: board": (ERROR, f"the driver holds the hand vented: {reason}; call reset_driver"),
            "recorder: disk": (ERROR, "the disk is full"),
            "controller: rate": (0, "OK"),
        }
    )
    assert said(state) == (f"vented: {reason}; press Enable", ("recorder: disk: the disk is full",))
    late = LiveState(statuses={"controller: safety": (1, "sensor data is late")})
    assert said(late) == ("sensor data is late", ())


@pytest.mark.parametrize("display", ["", ":0"])
def test_without_a_display_the_address_is_printed_with_a_way_to_it(
    display: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a browser is started where no display is, the line is missing, or it is shown where one is."""
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", display)
    page: Any = SimpleNamespace(url="http://127.0.0.1:5678", port=5678)
    studio._announce(page, "/hand", browser=True, as_json=False)
    shown = capsys.readouterr()
    assert shown.out == "/hand in the browser: http://127.0.0.1:5678\n"
    assert opened == ([page.url] if display else [])
    assert ("ssh -L 5678:localhost:5678 HOST" in shown.err) == (not display)
    assert shown.err.count("\n") == (0 if display else 1)
