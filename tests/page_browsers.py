"""`plctool ui` as a process of its own, and browsers that speak to it."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect

from plctool.testing.children import ends_with_us
from plctool.testing.waiting import PATIENCE


class Page:
    """A process of `plctool ui`; `options` say of which controller."""

    def __init__(self, folder: Path, *options: str, **environment: str) -> None:
        env = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")} | environment
        self.process = subprocess.Popen(
            ends_with_us([sys.executable, "-m", "plctool", "ui", "--json", *options]),
            cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout and self.process.stderr
        line = self.process.stdout.readline()
        assert line, self.process.stderr.read()
        document = json.loads(line)
        assert "url" in document, document
        self.url: str = document["url"]
        parts = urlsplit(self.url)
        assert parts.port
        self.port, self.path = parts.port, parts.path
        self.origin = f"http://127.0.0.1:{self.port}"

    def get(self, path: str, **headers: str) -> http.client.HTTPResponse:
        """The reply to a request for a path, which begins with / and has the token."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        return connection.getresponse()

    def open(self, **options: Any) -> ClientConnection:
        """A websocket, as that of the page unless the options say otherwise."""
        address = self.url.replace("http:", "ws:") + "live"
        return connect(
            options.pop("address", address), origin=options.pop("origin", self.origin), max_size=None,
            open_timeout=PATIENCE, compression=options.pop("compression", None), **options,
        )  # fmt: skip

    def end(self) -> int:
        self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=PATIENCE)
        return self.process.returncode


class Browser:
    """What the page's JavaScript does: asks, and keeps what it is sent."""

    def __init__(self, page: Page) -> None:
        self.socket = page.open()
        self.topics: dict[str, Any] = {}
        self.values: dict[str, Any] = {}
        self.messages = 0
        self._id = 0

    def take(self) -> dict[str, Any]:
        message: dict[str, Any] = json.loads(self.socket.recv(timeout=PATIENCE))
        self.messages += 1
        if message["is"] == "values":
            self.values |= message["content"]
        elif message["is"] != "reply":
            self.topics[message["is"]] = message["content"]
        return message

    def ask(self, verb: str, **fields: Any) -> dict[str, Any]:
        """The reply."""
        self._id += 1
        self.socket.send(json.dumps({"do": verb, "id": self._id, **fields}))
        while (message := self.take()).get("id") != self._id or message["is"] != "reply":
            pass
        return message

    def until(self, condition: Callable[[Browser], Any]) -> None:
        """Takes messages until the condition holds."""
        while not condition(self):
            self.take()

    def ready(self) -> Browser:
        """With the symbols and the state of the program."""
        self.until(lambda b: "status" in b.topics and b.topics.get("symbols", {}).get("crc"))
        return self
