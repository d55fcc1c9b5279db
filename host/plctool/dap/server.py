"""Where an editor is: at the standard streams of this process, or at a port of this machine."""

from __future__ import annotations

import os
import socket
import sys
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import BinaryIO

from plctool.dap.adapter import Adapter
from plctool.dap.messages import BadMessage, Message, Sender, read_message
from plctool.errors import UsageError

LOOPBACK = "127.0.0.1"


def serve(stream: BinaryIO, write: Callable[[bytes], object]) -> None:
    """Serves the editor at the other end, until it is gone."""
    requests: SimpleQueue[Message | None] = SimpleQueue()

    def receive() -> None:
        try:
            while (message := read_message(stream)) is not None:
                requests.put(message)
        except (BadMessage, OSError, ValueError):
            pass
        requests.put(None)

    threading.Thread(target=receive, name="editor", daemon=True).start()
    try:
        Adapter(requests, Sender(write)).run()
    except (BrokenPipeError, ConnectionError):
        return


def serve_standard_streams() -> None:
    """Nothing else may be written to the standard output, so what is printed goes to the standard error."""
    sys.stdout.flush()
    output = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def write(data: bytes) -> None:
        while data:
            data = data[os.write(output, data) :]

    # A thread may still wait for the input when the process ends: not in the stream that Python closes then.
    serve(os.fdopen(os.dup(sys.stdin.fileno()), "rb", closefd=False), write)


def listen(port: int, ready: Callable[[int], None]) -> None:
    """Serves one editor after the other at a port of this machine, 0 for a free one, which `ready` gets. Raises
    UsageError when it is in use."""
    try:
        listener = socket.create_server((LOOPBACK, port))
    except OSError as error:
        raise UsageError(f"Port {port} cannot be used: {error.strerror}; choose another one.", "listen") from None
    with listener:
        ready(listener.getsockname()[1])
        while True:
            connection, _ = listener.accept()
            with connection, connection.makefile("rb") as stream:
                serve(stream, connection.sendall)
