"""An editor for tests: starts `plctool lsp`, sends what an editor sends, and waits for what comes back."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

WAIT = 60.0  # seconds for an answer on a busy machine
Json = dict[str, Any]


class RequestFailed(Exception):
    """The server refused a request."""


class Editor:
    """A session with a server that works on a folder. A place in a file is given by what stands before and after it."""

    def __init__(self, folder: Path, *, settings: Json | None = None, capabilities: Json | None = None) -> None:
        self.folder = folder
        self.diagnostics: dict[str, list[Json]] = {}
        self.messages: list[str] = []
        self.published = 0
        self._answers: dict[int, queue.Queue[Json]] = {}
        self._changed = threading.Condition()
        self._number = 0
        self._versions: dict[str, int] = {}
        self.texts: dict[str, str] = {}
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "plctool", "lsp"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=folder,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in sys.path)},
        )
        threading.Thread(target=self._read, daemon=True).start()
        self.server: Json = self.request(
            "initialize",
            {
                "processId": None,
                "rootUri": folder.as_uri(),
                "workspaceFolders": [{"uri": folder.as_uri(), "name": folder.name}],
                "capabilities": capabilities or {},
                "initializationOptions": {"delay": 0} | (settings or {}),
            },
        )
        self.notify("initialized", {})

    def __enter__(self) -> Editor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the server as an editor does."""
        if self.process.poll() is None:
            self.request("shutdown", None)
            self.notify("exit", None)
            self.process.wait(WAIT)

    # ---- messages ----

    def _read(self) -> None:
        assert self.process.stdout is not None
        stream = self.process.stdout
        while line := stream.readline():
            length = 0
            while line.strip():
                name, _, value = line.decode("ascii").partition(":")
                if name.lower() == "content-length":
                    length = int(value)
                line = stream.readline()
            self._take(json.loads(stream.read(length)))
        for waiting in list(self._answers.values()):
            waiting.put({"error": {"message": "the server has ended"}})

    def _take(self, message: Json) -> None:
        if "method" in message and "id" in message:  # a request of the server
            self._send({"id": message["id"], "result": None})
        elif message.get("method") == "textDocument/publishDiagnostics":
            with self._changed:
                params = message["params"]
                self.diagnostics[params["uri"]] = params["diagnostics"]
                self.published += 1
                self._changed.notify_all()
        elif message.get("method") == "window/showMessage":
            with self._changed:
                self.messages.append(message["params"]["message"])
                self._changed.notify_all()
        elif "id" in message:
            self._answers[message["id"]].put(message)

    def _send(self, message: Json) -> None:
        data = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(data), data))
        self.process.stdin.flush()

    def notify(self, method: str, params: Any) -> None:
        """Sends a notification."""
        self._send({"method": method, "params": params})

    def request(self, method: str, params: Any) -> Any:
        """Sends a request and returns its result."""
        self._number += 1
        number = self._number
        self._answers[number] = queue.Queue()
        self._send({"id": number, "method": method, "params": params})
        answer = self._answers[number].get(timeout=WAIT)
        del self._answers[number]
        if "error" in answer:
            raise RequestFailed(answer["error"]["message"])
        return answer["result"]

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Waits until what the server has sent fulfils a condition."""
        end = time.monotonic() + WAIT
        with self._changed:
            while not condition():
                left = end - time.monotonic()
                assert left > 0, f"{what}; have {self._said()[:2000]} {self.messages}"
                self._changed.wait(left)

    def _said(self) -> str:
        found = {uri.rpartition("/")[2]: [d["message"] for d in said] for uri, said in self.diagnostics.items() if said}
        return str(found)

    # ---- open files ----

    def uri(self, name: str) -> str:
        """Returns the URI of a file of the folder."""
        return (self.folder / name).as_uri()

    def open(self, name: str, text: str | None = None) -> None:
        """Opens a file, with another text than the file has if that is given."""
        text = (self.folder / name).read_text() if text is None else text
        self.texts[name] = text
        self._versions[name] = 1
        document = {"uri": self.uri(name), "languageId": "iecst", "version": 1, "text": text}
        self.notify("textDocument/didOpen", {"textDocument": document})

    def type(self, name: str, text: str) -> None:
        """Gives an open file another text."""
        self.texts[name] = text
        self._versions[name] += 1
        document = {"uri": self.uri(name), "version": self._versions[name]}
        self.notify("textDocument/didChange", {"textDocument": document, "contentChanges": [{"text": text}]})

    def shut(self, name: str) -> None:
        """Closes a file."""
        del self.texts[name]
        self.notify("textDocument/didClose", {"textDocument": {"uri": self.uri(name)}})

    # ---- requests about a place ----

    def place(self, name: str, before: str, after: str = "") -> Json:
        """Returns the parameters for the place between two parts of the text of an open file."""
        text = self.texts[name]
        at = text.index(before + after) + len(before)
        line = text.count("\n", 0, at)
        column = at - text.rfind("\n", 0, at) - 1
        character = len(text[at - column : at].encode("utf-16-le")) // 2
        return {"textDocument": {"uri": self.uri(name)}, "position": {"line": line, "character": character}}

    def at(self, request: str, name: str, before: str, after: str = "", **more: Any) -> Any:
        """Sends a request about a place."""
        return self.request(f"textDocument/{request}", self.place(name, before, after) | more)

    def complete(self, name: str, before: str, after: str = "") -> list[Json]:
        """Returns what may stand at a place."""
        result = self.at("completion", name, before, after)
        return list(result["items"])

    def labels(self, name: str, before: str, after: str = "") -> list[str]:
        """Returns the labels of what may stand at a place, best first."""
        return [item["label"] for item in self.complete(name, before, after)]

    # ---- diagnostics ----

    def messages_of(self, name: str) -> list[str]:
        """Returns what the diagnostics of a file say."""
        return [d["message"] for d in self.diagnostics.get(self.uri(name), [])]

    def expect(self, name: str, *parts: str) -> list[Json]:
        """Waits until a file has exactly these diagnostics, each named by a part of its message; returns them."""

        def fits() -> bool:
            found = self.messages_of(name)
            return len(found) == len(parts) and all(part in m for part, m in zip(parts, found, strict=True))

        self.wait(fits, f"{name} has the diagnostics {parts}")
        return self.diagnostics.get(self.uri(name), [])


def words(editor: Editor, name: str, range_: Json) -> str:
    """Returns the text of a range in a file."""
    lines = editor.texts[name].split("\n")
    line = lines[range_["start"]["line"]]
    return line[range_["start"]["character"] : range_["end"]["character"]]


def edited(text: str, edits: list[Json]) -> str:
    """Returns a text after edits."""

    def offset(position: Json) -> int:
        lines = text.split("\n")
        before = sum(len(line) + 1 for line in lines[: position["line"]])
        if position["line"] >= len(lines):
            return len(text)
        line = lines[position["line"]].encode("utf-16-le")
        return before + len(line[: 2 * position["character"]].decode("utf-16-le"))

    placed = sorted(
        ((offset(e["range"]["start"]), offset(e["range"]["end"]), e["newText"]) for e in edits), reverse=True
    )
    for start, end, new in placed:
        text = text[:start] + new + text[end:]
    return text
