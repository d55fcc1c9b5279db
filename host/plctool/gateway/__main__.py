"""The process of a gateway: `python -m plctool.gateway LINK FOLDER`, started by the first tool (`client.py`).

It reports on stdout, in one line of JSON, that it serves the line or why it cannot, and goes on without a terminal.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from plctool.errors import PlcError
from plctool.gateway.place import Place, locked
from plctool.link.transports import Link, open_transport, parse_link

DEFAULT_IDLE = 3.0  # seconds without tools after which a gateway ends
_LOCK_PATIENCE = 5.0  # for the gateway before, which may just be ending
_BACKLOG = 64


def main(arguments: list[str]) -> int:
    link, folder = parse_link(arguments[0]), arguments[1]
    line = link.place
    os.umask(0o077)
    if os.fork():  # the tool has no child that it would have to wait for
        os._exit(0)
    place = Place(Path(folder), line)
    try:
        with locked(place.lock, _LOCK_PATIENCE) as lock:
            os.ftruncate(lock, 0)
            os.write(lock, f"{os.getpid()} {line}".encode(errors="surrogateescape"))
            _serve(place, link)
    except _Moved:
        _say({"moved": True})
    except TimeoutError:
        _say({"busy": f"The gateway of {line} that is running takes no tools; end it with 'plctool gateway stop'."})
    except PlcError as error:
        _say({"error": {"code": error.code, "message": error.message}})
    return 0


class _Moved(Exception):
    """The name of the line is a link to another one."""


def _serve(place: Place, link: Link) -> None:
    """Raises LinkError when the line cannot be opened, _Moved when it is another one."""
    from plctool.gateway.server import Gateway
    from plctool.link.connection import Connection

    try:
        connection = Connection(open_transport(link))
    finally:
        # When the tool looked, nothing had the name, as while an adapter is being plugged in. Served under the name of
        # the link, the line would be in use for those who come to its gateway by another name.
        if os.path.realpath(place.line) != place.line:
            raise _Moved
    listener = _listen(place.socket)
    gateway = Gateway(connection, listener, link=link, idle=_idle_seconds())
    end = f"The gateway of {place.line} was ended (SIGTERM)."
    signal.signal(signal.SIGTERM, lambda number, frame: gateway.stop(end, "gateway-stopped"))
    _say({})
    try:
        gateway.run()
    finally:
        # The name goes first: a tool that comes now starts another gateway, which waits until the line is free.
        with suppress(OSError):
            place.socket.unlink()
        gateway.end()


def _listen(path: Path) -> socket.socket:
    """The socket; what a killed gateway has left there is removed, which is safe with the lock."""
    with suppress(FileNotFoundError):
        path.unlink()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listener.bind(str(path))
    listener.listen(_BACKLOG)
    listener.setblocking(False)
    return listener


def _idle_seconds() -> float:
    with suppress(ValueError):
        if 0 <= (seconds := float(os.environ.get("PLCTOOL_GATEWAY_IDLE", DEFAULT_IDLE))) < 1e9:
            return seconds
    return DEFAULT_IDLE


def _say(document: dict[str, Any]) -> None:
    """Reports to the tool that waits, and disconnects it."""
    with suppress(OSError):
        os.write(1, json.dumps(document).encode() + b"\n")
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 1)
    os.close(nothing)


if __name__ == "__main__":
    status = main(sys.argv[1:])
    os._exit(status)  # threads of tools that do not read any more are left as they are
