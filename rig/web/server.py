"""The server of the workbench: one process, one address, access with a token."""

from __future__ import annotations

import atexit
import logging
import signal
import socket
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from urllib.parse import parse_qs

import numpy as np
import uvicorn
from fastapi import FastAPI
from nicegui import Client, core, run, ui
from nicegui.translations import translations
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calibrations.discovery.rows import Rows
from calibrations.model.file import read_model
from calibrations.presentation.charts.fit import fit_album
from calibrations.presentation.second_core import SecondCore
from calibrations.table import Table
from rig.errors import RigError
from rig.files import home, write_whole
from rig.runs.signals import signal_handlers
from rig.web.calculations import begin, leave_calculations
from rig.web.desk import Desk
from rig.web.frame import TITLE
from rig.web.guard import TOKEN, Guard, names
from rig.web.pages import register

LOST = {  # the message of a page whose server does not answer
    "connection_lost": "The workbench does not answer. Buttons and keys have no effect.",
    "trying_to_reconnect": "If a run is in progress, it continues: use the emergency stop of the rig to stop it now. "
    "This page connects again by itself. If it does not, start the workbench again.",
}
RETURN_S = 20.0  # time in which a browser may connect again after a loss; its analyses continue
LEFT = 1001  # the code with which a browser closes the connection of a page that it leaves (RFC 6455, 7.4.1)
PING_S, ANSWER_S = 8.0, 20.0  # between two checks of a connection, and until it counts as lost: an analysis delays both
PORT = 8473  # preferred, so that an open page finds a restarted server
PORT_FILE = "web-port"
POSES = 36  # of the analysis at the start


@dataclass(frozen=True)
class Place:
    """Address of the workbench, and the token for access. `taken`: ports that other programs use."""

    host: str
    port: int
    token: str
    taken: tuple[int, ...] = ()

    @property
    def url(self) -> str:
        """The address to open."""
        return f"http://{self.host}:{self.port}/?{TOKEN}={self.token}"


def serve(desk: Desk, host: str, port: int | None, token: str, ready: Callable[[Place], None]) -> None:
    """Serve until SIGINT or SIGTERM; calls `ready` with the address when pages can be opened.

    Raises RigError if the address is not available; without `port` it is the last one of this user, else any free one.
    """
    listener, taken = _listen(host, port)
    place = Place(host, listener.getsockname()[1], token, taken)
    app = FastAPI(openapi_url=None)
    register(desk)
    translations["en-US"] |= LOST
    run.process_pool_start_method = "spawn"  # the pool is not used; this avoids a warning
    ui.run_with(
        app,
        title=TITLE,
        dark=None,
        language="en-US",
        tailwind=False,
        show_welcome_message=False,
        reconnect_timeout=RETURN_S,
        gzip_middleware_factory=None,
    )

    def started() -> None:
        ready(place)
        begin(load_ahead, desk.second_core)

    guarded = Guard(LeftPages(app), place.token, names(host, place.port))
    config = uvicorn.Config(
        guarded, log_level="warning", access_log=False, timeout_graceful_shutdown=0, ws_max_size=1 << 24
    )  # open pages keep their connections, so there is nothing to wait for
    logging.getLogger("uvicorn.error").addFilter(lambda entry: "graceful shutdown" not in entry.getMessage())
    ignored = signal_handlers(lambda *_: None, signal.SIGINT, signal.SIGTERM)  # uvicorn raises them again after its end
    with ignored, listener, closing(desk):
        _Server(config, started).run(sockets=[listener])
    atexit.register(leave_calculations)


@dataclass(frozen=True)
class LeftPages:
    """Serves `app`, and ends a page and its analyses as soon as its browser leaves it.

    A page whose connection is lost is another thing: its browser may come back.
    """

    app: ASGIApp

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def receiving() -> Message:
            message = await receive()
            if message["type"] == "websocket.disconnect" and message.get("code") == LEFT:
                for client_id in parse_qs(scope["query_string"].decode("latin-1")).get("client_id", []):
                    if (client := Client.instances.get(client_id)) is not None:
                        client.delete()
            return message

        await self.app(scope, receiving if scope["type"] == "websocket" else receive, send)


class _Server(uvicorn.Server):
    """A server that reports when it is ready."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        connections = core.sio.eio  # NiceGUI gives a busy browser 4 s, and then makes its page again
        connections.ping_interval, connections.ping_timeout = PING_S, ANSWER_S
        self._ready()


def _listen(host: str, port: int | None) -> tuple[socket.socket, tuple[int, ...]]:
    """A socket that listens at the address, and the ports that were taken. Raises RigError."""
    if port is not None:
        try:
            return _open_listening_socket(host, port), ()
        except OSError as error:
            raise RigError(f"cannot listen at {host}:{port}: {error.strerror}; give another --port or --host") from None
    taken = []
    for preferred in dict.fromkeys((*_last_port(), PORT)):
        try:
            listener = _open_listening_socket(host, preferred)
        except OSError:
            taken.append(preferred)
        else:
            _keep_port(preferred)
            return listener, tuple(taken)
    listener = _open_listening_socket(host, 0)
    _keep_port(listener.getsockname()[1])
    return listener, tuple(taken)


# The port is kept for the user, as the token is: a bookmark lasts where another program has the usual port.


def _last_port() -> tuple[int, ...]:
    """The port of this user's last start without --port; empty without one."""
    try:
        return (int((home() / PORT_FILE).read_text(encoding="ascii")),)
    except (OSError, ValueError):
        return ()


def _keep_port(port: int) -> None:
    """Keep the port for the next start; without room on the disk the next one may have another."""
    with suppress(RigError, OSError):
        write_whole(home() / PORT_FILE, str(port))


def _open_listening_socket(host: str, port: int) -> socket.socket:
    """A socket that listens from the start: until then another server may take the same port. Raises OSError."""
    listener = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()
    except OSError:
        listener.close()
        raise
    return listener


def load_ahead(second_core: SecondCore) -> None:
    """Fit a few poses of an ideal sensor and draw them, for the first analysis and the first report.

    That loads the compiled loops, and compiles them where needed, and in both processes what draws pictures.
    """
    data = Rows(_sweep())
    comparison = data.compare(data.fit_without_outliers(read_model("linear"))[1].model)
    second_core.start()
    second_core.draw(fit_album(comparison.fit))


def _sweep() -> Table:
    """Three turns of a sensor of 1 V/g with a pattern in place of noise."""
    alpha_deg, beta_deg = np.repeat([90.0, 30.0, 150.0], POSES // 3), np.tile(np.arange(0.0, 360.0, 30.0), 3)
    load, turn = np.sin(np.radians(alpha_deg)), np.radians(beta_deg)
    pattern = 1e-5 * np.cos(np.arange(POSES) ** 2)
    columns = {
        "alpha_deg": alpha_deg,
        "beta_deg": beta_deg,
        "direction": np.ones(POSES),
        "vx_v": 2.5 + load * np.cos(turn) + pattern,
        "vy_v": 2.5 + load * np.sin(turn) - pattern,
        "vx_std_v": np.full(POSES, 1e-3),
        "vy_std_v": np.full(POSES, 1e-3),
        "n": np.full(POSES, 1000.0),
        "t_s": 10.0 * np.arange(POSES),
    }
    return Table.from_columns("poses", columns, {"filter_corner_hz": 15.0, "sample_rate_hz": 1000.0}, "ideal")
