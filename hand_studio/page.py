"""The page of the studio: a server for this machine alone unless asked otherwise, and who may drive the hand."""

from __future__ import annotations

import ipaddress
import logging
import socket
import time
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any
from urllib.parse import urlsplit

import viser
from viser import _messages

from hand_studio.pace import Pace

LOCAL = "127.0.0.1"
FIRST_PORT, LAST_PORT = 1024, 65535
TITLE = "hand studio"
EYE_M, MIDDLE_M = (0.07, -0.20, 0.14), (0.01, 0.0, 0.085)
"""Where the page is seen from, and what it looks at; the wrist of the hand is the origin."""

READ_ONLY = (
    "This page only shows the hand. It can be driven from the machine that runs the studio, or with --allow-others."
)
SHOWN_S = 6.0
"""Time for which this line is shown."""
CONTROLS = (
    _messages.GuiUpdateMessage, _messages.GuiButtonHoldMessage, _messages.GuiFormSubmitMessage,
    _messages.GuiFormDirtyMessage, _messages.FileTransferStartUpload, _messages.FileTransferPart,
    _messages.CommandTriggerMessage,
)  # fmt: skip
"""All messages by which a client changes a control."""
Handler = Callable[[Any, Any], Coroutine[Any, Any, Any] | None]


class Page:
    """A running server of the page. pace: whether its browsers keep up with it."""

    def __init__(self, listen: str = LOCAL, port: int = 0, *, allow_others: bool = False) -> None:
        """Serve at an address of this machine; port 0: any free port.  allow_others: other machines may drive the hand.

        Raises ValueError, one line, for an address or a port that cannot be used.
        """
        check_address(listen, port)
        self._listen, self._allow_others = listen, allow_others
        # A browser opens connections that it does not use; each would be logged with a traceback.
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        with redirect_stdout(StringIO()):  # it prints addresses even where it is asked to be quiet
            self.server = viser.ViserServer(host=listen, port=port, verbose=False)
        self.pace = Pace(self.server)
        self.port = self.server.get_port()
        if port not in (0, self.port):  # the server takes the next free one without asking
            self.close()
            raise ValueError(f"port {port} of {listen} is taken; give another --port, or none for a free one")
        self._drivers: dict[int, bool] = {}
        self._told_s: dict[int, float] = {}
        self._for_all: set[str] = set()
        self._guard()
        self.server.on_client_disconnect(self._forget)
        _theme(self.server.gui, dark=False)
        self.server.gui.main_panel.dock_right()
        self.server.gui.set_panel_label(TITLE)
        self._dark: set[int] = set()
        scene, camera = self.server.scene, self.server.initial_camera
        scene.set_up_direction("+z")
        _light(scene)
        camera.position, camera.look_at = EYE_M, MIDDLE_M
        scene.add_grid("/floor", 0.5, 0.5, cell_size=0.02, section_size=0.1, position=(0.0, 0.0, -0.02))

    @property
    def url(self) -> str:
        """Address of the page for a browser on this machine."""
        host = LOCAL if ipaddress.ip_address(self._listen).is_unspecified else self._listen
        return f"http://[{host}]:{self.port}" if ":" in host else f"http://{host}:{self.port}"

    def drives(self, client_id: int) -> bool:
        """Whether a client may drive the hand."""
        if client_id not in self._drivers:
            self._drivers[client_id] = self._may_drive(client_id)
        return self._drivers[client_id]

    def add_dark(self) -> None:
        """Add a button that makes the page dark, or light again, in the browser where it is pressed."""
        button = self.server.gui.add_button("Dark or light", color="gray")
        button.on_click(self._turn)
        self._for_all.add(button._impl.uuid)

    def _turn(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is not None:
            self._dark ^= {event.client.client_id}
            _theme(event.client.gui, dark=event.client.client_id in self._dark)

    def _guard(self) -> None:
        """Drop whatever a client changes that may not drive: the server would keep its values, and others see them."""
        endpoint = self.server._websock_server
        for kind in CONTROLS:
            handlers = endpoint._incoming_handlers.get(kind)
            if not handlers:
                raise RuntimeError(f"viser {viser.__version__} does not handle {kind.__name__}")
            endpoint.unregister_handler(kind)
            endpoint.register_handler(kind, self._guarded(handlers))

    def _guarded(self, handlers: Sequence[Handler]) -> Handler:
        async def handle(client_id: int, message: Any) -> None:
            if getattr(message, "uuid", "") not in self._for_all and not self.drives(client_id):
                self._refuse(client_id)
                return
            for handler in handlers:
                answer = handler(client_id, message)
                if answer is not None:
                    await answer

        return handle

    def _refuse(self, client_id: int) -> None:
        """Inform a client that it only sees the hand, not more often than the line is shown."""
        client, now_s = self.server.get_clients().get(client_id), time.monotonic()
        if client is not None and now_s - self._told_s.get(client_id, -SHOWN_S) >= SHOWN_S:
            self._told_s[client_id] = now_s
            client.add_notification("Read only", READ_ONLY, auto_close_seconds=SHOWN_S)

    def _forget(self, client: viser.ClientHandle) -> None:
        self._drivers.pop(client.client_id, None)
        self._told_s.pop(client.client_id, None)
        self._dark.discard(client.client_id)

    def _may_drive(self, client_id: int) -> bool:
        connection: Any = self.server._websock_server._live_connections.get(client_id)
        if connection is None or connection.request is None:
            return False
        return may_drive(connection.remote_address[0], connection.request.headers, self._allow_others)

    def close(self) -> None:
        """End the server."""
        with redirect_stdout(StringIO()):
            self.server.stop()


def _light(scene: viser.SceneApi) -> None:
    """Light from above and from the left of the viewer.

    The lights of viser cast shadows and come from a picture of a room. Where no graphics card draws the page, preparing
    that picture takes two cores 2.5 s before the hand is seen.
    """
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/sky", ground_color=(96, 100, 110), intensity=1.5)
    scene.add_light_directional("/lamp", intensity=2.4, position=(-0.5, -1.0, 1.3))


def _theme(gui: viser.GuiApi, *, dark: bool) -> None:
    gui.configure_theme(control_width="large", show_logo=False, show_share_button=False, dark_mode=dark)


def may_drive(address: str, headers: Mapping[str, str], allow_others: bool) -> bool:
    """Whether a connection may drive the hand: from this machine, unless others are allowed, and from this page.

    A page of another site in the same browser could connect, too. Its Origin is not the Host of the request; and a name
    that somebody else made point to this machine is neither localhost nor an IP address.
    """
    host, origin = headers.get("Host", ""), headers.get("Origin", "")
    if urlsplit(origin).netloc != host:
        return False
    return (allow_others or ipaddress.ip_address(address).is_loopback) and _is_direct(urlsplit(f"//{host}").hostname)


def _is_direct(name: str | None) -> bool:
    """Whether a host name needs no name server."""
    try:
        return name == "localhost" or bool(ipaddress.ip_address(name or ""))
    except ValueError:
        return False


def check_address(listen: str, port: int) -> None:
    """Raise ValueError, one line, where a server cannot listen at this address [IP] and port, 0 for a free one."""
    if port != 0 and not FIRST_PORT <= port <= LAST_PORT:
        raise ValueError(f"--port is {port}; the allowed range is {FIRST_PORT} to {LAST_PORT}, or 0 for a free one")
    try:
        family = socket.AF_INET6 if ipaddress.ip_address(listen).version == 6 else socket.AF_INET
    except ValueError:
        raise ValueError(f"--listen is {listen!r}; it must be an IP address of this machine, as {LOCAL}") from None
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((listen, port))
        except OSError as error:
            advice = "give another --port, or none for a free one" if port else "give another --listen"
            raise ValueError(f"cannot serve at {listen} port {port} ({error.strerror}); {advice}") from None
