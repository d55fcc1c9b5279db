"""The web server of the page, on loopback."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, cast

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from uvicorn.protocols.http.h11_impl import H11Protocol

from plctool.controller import Controller
from plctool.errors import PlcError, UsageError
from plctool.ui.access import ADDRESS, App, Guard, new_token
from plctool.ui.browsers import MAX_BROWSERS, Hub
from plctool.ui.drawings import Drawings
from plctool.ui.live import Live, Target
from plctool.ui.messages import MAX_MESSAGE
from plctool.ui.operating import OperatorPage

STATIC = Path(__file__).parent / "static"
MAX_CONNECTIONS = 64 + MAX_BROWSERS
_SILENCE = 10.0  # after which a connection without a request is closed [s]
_START_TIMEOUT = 30.0  # [s]


def serve(
    target: Target,
    plc: Controller,
    port: int = 0,
    announce: Callable[[str], None] = lambda address: None,
    page: OperatorPage | None = None,
) -> None:
    """Serves the page of a controller, which `target` has opened, until an exception such as KeyboardInterrupt.
    `announce` gets its address. Port 0 is one that is free. `page`: that of operators, in place of the one with all
    variables. Raises UsageError if the port is in use."""
    try:
        listening = _listen(port)
    except BaseException:
        plc.close()
        raise
    with closing(listening):
        token, port = new_token(), listening.getsockname()[1]
        shown = _Page(target, Guard(_application(hub := Hub(page)), token, port), hub, listening)
        with closing(shown):
            shown.start()
            announce(f"http://{ADDRESS}:{port}/{token}/")
            shown.live.run(plc)


def _listen(port: int) -> socket.socket:
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((ADDRESS, port))
        listening.listen(128)
    except OSError as error:
        listening.close()
        message = f"Port {port} of {ADDRESS} cannot be used: {error.strerror}. Leave out --port-number for a free one."
        raise UsageError(message, "port") from None
    return listening


def _application(hub: Hub) -> App:
    files = StaticFiles(directory=STATIC, html=True)
    own = [] if hub.page is None else _operators_routes(hub.page)
    return cast("App", Starlette(routes=[WebSocketRoute("/live", hub.serve), *own, Mount("/", files)]))


def _operators_routes(page: OperatorPage) -> list[BaseRoute]:
    async def start(request: Request) -> Response:
        return FileResponse(STATIC / "page.html")

    async def picture(request: Request) -> Response:
        found = page.picture(request.path_params["number"])
        if found is None:
            return Response(status_code=404)
        return Response(found.data, media_type=found.media_type)

    return [Route("/", start), Route("/picture/{number:int}", picture)]


class _Page:
    """The web server in a thread of its own, and the controller for the thread that made this."""

    def __init__(self, target: Target, app: App, hub: Hub, listening: socket.socket) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._hub = hub
        self._listening = listening
        self._started = threading.Event()
        self.live = hub.live = Live(target, self._publish)
        hub.drawings = Drawings(target.folders)
        config = uvicorn.Config(
            cast("Any", app),
            http=_Connection,
            ws="websockets-sansio",
            ws_max_size=MAX_MESSAGE,
            ws_per_message_deflate=False,  # loopback carries more than a core compresses
            lifespan="off",
            log_config=None,  # the address with its token would be in the log
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, name="web server", daemon=True)

    def start(self) -> None:
        self._thread.start()
        if not self._started.wait(_START_TIMEOUT):
            raise PlcError("The web server does not start.", "web-server")

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._started.set()
        try:
            await self._server.serve(sockets=[self._listening])
        finally:
            self.live.end()

    def _publish(self, topic: str, content: Any) -> None:
        """Called by the thread of the controller."""
        assert self._loop is not None
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._hub.publish, topic, content)

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join(_START_TIMEOUT)


class _Connection(H11Protocol):
    """A connection of many, or of one that says nothing, is closed: the page is for few browsers of one user."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        if len(self.connections) > MAX_CONNECTIONS:
            transport.abort()
            return
        self.loop.call_later(_SILENCE, self._close_if_silent)

    def _close_if_silent(self) -> None:
        if self.cycle is None and self.transport.get_protocol() is self and not self.transport.is_closing():
            self.transport.abort()
