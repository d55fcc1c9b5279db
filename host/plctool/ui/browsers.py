"""The browsers that show the page: what each wants to see and has been sent. Everything here runs in the event loop."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from plctool.controller import Controller
from plctool.debug.symbols import SymbolTable
from plctool.errors import PlcError, UsageError
from plctool.ui.drawings import Drawings
from plctool.ui.live import Live, Wanted
from plctool.ui.messages import Request, id_of, parse
from plctool.ui.operating import ONLY_SHOWS, OperatorPage
from plctool.ui.variables import Tree

MAX_BROWSERS = 16
_NO_SYMBOLS = "The symbols of the program are not known."
_TRY_AGAIN_LATER = 1013  # of RFC 6455's registry of close codes
_TOO_MANY = f"{MAX_BROWSERS} pages are open already; close one."


class Hub:
    """All browsers of a page. `publish` gets what the controller's thread has read. `page`: that of operators, which
    limits what browsers may ask for."""

    def __init__(self, page: OperatorPage | None = None) -> None:
        self.live: Live  # set before the first browser comes
        self.drawings = Drawings([])
        self.table: SymbolTable | None = None
        self.page = page
        self.topics: dict[str, Any] = {} if page is None else {"page": page.document()}
        self.values: dict[str, Any] = {}
        self.tree: Tree | None = None
        self._browsers: set[Browser] = set()

    def publish(self, topic: str, content: Any) -> None:
        if topic == "values":
            self.values = content
        elif topic == "symbols":
            table = self.table = content["table"]
            self.tree = None if table is None else Tree(table)
            self.values = {}
            self._replace(topic, {name: value for name, value in content.items() if name != "table"})
        else:
            self._replace(topic, content)
        for browser in self._browsers:
            browser.news.set()

    def _replace(self, topic: str, content: Any) -> None:
        """What is the same stays the same object, so that it is not sent again."""
        if topic not in self.topics or self.topics[topic] != content:
            self.topics[topic] = content

    def changed(self) -> None:
        """A browser wants something else."""
        names: set[str] = set()
        views: set[str] = set()
        for browser in self._browsers:
            names |= browser.names
            views |= browser.views
        self.live.want(Wanted(len(self._browsers), frozenset(names), frozenset(views)))

    async def serve(self, socket: WebSocket) -> None:
        """Serves one browser until it leaves."""
        await socket.accept()
        if len(self._browsers) >= MAX_BROWSERS:
            await socket.close(_TRY_AGAIN_LATER, _TOO_MANY)
            return
        browser = Browser(self, socket)
        self._browsers.add(browser)
        self.changed()
        sending = asyncio.create_task(browser.send_news())
        try:
            await browser.receive()
        finally:
            self._browsers.discard(browser)
            browser.release()
            self.changed()
            sending.cancel()
            with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await sending


class Browser:
    """One browser. A slow one gets the newest values only: there is no queue."""

    def __init__(self, hub: Hub, socket: WebSocket) -> None:
        self._hub = hub
        self._socket = socket
        self.names: set[str] = set()
        self.views: set[str] = set()
        self.news = asyncio.Event()
        self.news.set()
        self._sent: dict[str, Any] = {}
        self._sent_values: dict[str, Any] = {}
        self._pressed: set[int] = set()  # buttons of an operators' page
        self._sending = asyncio.Lock()  # replies and news come from two tasks

    async def _send(self, message: dict[str, Any]) -> None:
        async with self._sending:
            await self._socket.send_text(json.dumps(message, allow_nan=False))

    # ---- news ----

    async def send_news(self) -> None:
        """Sends what has changed since it was sent last, again and again."""
        while True:
            await self.news.wait()
            self.news.clear()
            for topic, content in list(self._hub.topics.items()):
                if self._sent.get(topic) is not content:
                    self._sent[topic] = content
                    await self._send({"is": topic, "content": content})
            values = self._hub.values
            changed = {n: values[n] for n in self.names if n in values and self._sent_values.get(n) != values[n]}
            if changed:
                self._sent_values |= changed
                await self._send({"is": "values", "content": changed})

    # ---- requests ----

    async def receive(self) -> None:
        """Answers its messages, one after the other, until it leaves."""
        while True:
            try:
                text = await self._socket.receive_text()
            except (WebSocketDisconnect, KeyError):  # or it sent bytes
                return
            await self._send(await self._reply(text))

    async def _reply(self, text: str) -> dict[str, Any]:
        try:
            request = parse(text)
            return {"is": "reply", "id": request.id, "result": await self._answer(request)}
        except PlcError as error:
            return {"is": "reply", "id": id_of(text), "error": error.message}

    async def _answer(self, request: Request) -> Any:
        fields = request.fields
        if self._hub.page is not None:
            return await self._operators_answer(self._hub.page, request)
        if request.verb == "show":
            return self._show(set(fields["names"]), set(fields["views"]))
        if request.verb == "children":
            return await asyncio.to_thread(self._tree().children, fields["path"], fields["start"])
        if request.verb == "search":
            return await asyncio.to_thread(self._tree().search, fields["text"])
        if request.verb == "diagrams":
            return await asyncio.to_thread(self._hub.drawings.listed, self._table())
        if request.verb == "diagram":
            return await asyncio.to_thread(self._hub.drawings.picture, self._table(), fields["name"])
        if request.verb not in _OPERATIONS:
            raise UsageError("Only an operators' page has elements; start 'plctool ui' with --page.", "bad-message")
        return await self._do(lambda plc: _OPERATIONS[request.verb](plc, **fields))

    async def _do(self, job: Callable[[Controller], object]) -> None:
        await asyncio.wrap_future(self._hub.live.do(job))
        self._hub.changed()  # and what it has changed is read at once

    async def _operators_answer(self, page: OperatorPage, request: Request) -> Any:
        """Refuses everything but showing the variables of the page and operating its elements."""
        fields = request.fields
        if request.verb == "operate":
            return await self._operate(page, fields["element"], fields["text"])
        shows = request.verb == "show" and page.views.issuperset(fields["views"])
        if not shows or not page.names.issuperset(fields["names"]):
            raise UsageError(ONLY_SHOWS, "not-operated")
        return self._show(set(fields["names"]), set(fields["views"]))

    async def _operate(self, page: OperatorPage, element: int, text: str) -> None:
        if page.holds(element, text):
            self._pressed.add(element)  # before it is written: the browser may leave in between
        await self._do(lambda plc: page.operate(plc, element, text))
        if page.holds(element, text) is False:
            self._pressed.discard(element)

    def release(self) -> None:
        """Releases the buttons that are pressed when the browser leaves."""
        if self._hub.page is not None:
            for number in self._pressed:
                self._hub.live.do(partial(self._hub.page.release, number=number))

    def _show(self, names: set[str], views: set[str]) -> None:
        self._sent_values = {name: value for name, value in self._sent_values.items() if name in names}
        for view in views - self.views:
            self._sent.pop(view, None)
        self.names, self.views = names, views
        self._hub.changed()
        self.news.set()

    def _tree(self) -> Tree:
        if self._hub.tree is None:
            raise UsageError(_NO_SYMBOLS, "no-symbols")
        return self._hub.tree

    def _table(self) -> SymbolTable:
        if self._hub.table is None:
            raise UsageError(_NO_SYMBOLS, "no-symbols")
        return self._hub.table


def _write(plc: Controller, name: str, text: str) -> None:
    plc.write({name: plc.symbols().resolve(name).parse(text)})


def _force(plc: Controller, name: str, text: str) -> None:
    plc.force({name: plc.symbols().resolve(name).parse(text)})


_OPERATIONS: dict[str, Callable[..., object]] = {
    "write": _write,
    "force": _force,
    "unforce": lambda plc, name: plc.unforce([name]),
    "unforce_all": lambda plc: plc.unforce(),
    "acknowledge": lambda plc, name: plc.acknowledge([name]),
    "start": lambda plc: plc.start(),
    "stop": lambda plc: plc.stop(),
    "reset": lambda plc: plc.reset("warm"),
}
