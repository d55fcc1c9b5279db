"""Who may use the page: requests with the token in their path, from this machine and from the page itself.

The token is the first part of each path, so that relative addresses of the page have it, too. There are no cookies:
those of 127.0.0.1 go to every port of it.
"""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from hmac import compare_digest
from typing import Any

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

ADDRESS = "127.0.0.1"
_TOKEN_BYTES = 24
_REFUSAL = "Open the address that 'plctool ui' printed, whole and on this machine.\n"
_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}


def new_token() -> str:
    """Returns a token that cannot be guessed."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


class Guard:
    """An ASGI application in front of another one, whose paths are without the token."""

    def __init__(self, app: App, token: str, port: int) -> None:
        self._app = app
        self._token = token.encode()
        self._hosts = {f"{host}:{port}".encode() for host in (ADDRESS, "localhost")}
        self._origins = {b"http://" + host for host in self._hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        token, slash, path = scope["path"].removeprefix("/").partition("/")
        has_token = compare_digest(token.encode("utf-8", "replace"), self._token)
        if not (has_token and slash and self._is_ours(scope)):
            await _refuse(scope, send)
            return
        await self._app({**scope, "path": f"/{path}", "raw_path": f"/{path}".encode()}, receive, _with_headers(send))

    def _is_ours(self, scope: Scope) -> bool:
        """True for a request to this server by its address, and from the page or typed by the user. A page of another
        server has another Origin; one whose name was led to this machine has another Host."""
        hosts = [value for name, value in scope["headers"] if name == b"host"]
        origins = [value for name, value in scope["headers"] if name == b"origin"]
        needed = scope["type"] == "websocket"
        return (
            len(hosts) == 1
            and hosts[0] in self._hosts
            and len(origins) in ((1,) if needed else (0, 1))
            and all(origin in self._origins for origin in origins)
        )


async def _refuse(scope: Scope, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    start = {"type": "http.response.start", "status": 403, "headers": [(b"content-type", b"text/plain")]}
    await _with_headers(send)(start)
    await send({"type": "http.response.body", "body": _REFUSAL.encode()})


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            ours = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *ours]}
        await send(message)

    return send_with_headers
