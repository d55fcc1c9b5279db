"""The gateway itself: takes the tools that come to its socket and serves each in a thread of its own.

A thread per tool keeps them apart: what a tool sends, does not send or does not read can stop its own thread only.
All that they share is the device, for which they queue (`shared.py`).
"""

from __future__ import annotations

import math
import os
import select
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from plctool.errors import DeviceError, LinkError, PlcError
from plctool.gateway.frames import (
    AHEAD,
    BUSY,
    ENDING,
    GOODBYE,
    LOST,
    PROTOCOL,
    Closed,
    Frame,
    FrameError,
    Kind,
    Pipe,
    Reply,
    Request,
    Scope,
    document_frame,
)
from plctool.gateway.shared import CLAIM_SILENCE, SharedDevice, Tool
from plctool.link.channel import ChannelLost
from plctool.link.connection import Connection, bounded_factor
from plctool.link.transports import TRANSPORTS, Link
from plctool.printable import one_line
from plctool.version import plctool_version

MAX_TOOLS = 32
MAX_GUESTS = 2 * MAX_TOOLS  # with those that only ask about the gateway, or have not said who they are
MAX_WORDS = 100  # of what a tool calls itself
MAX_PATIENCE = 120.0  # seconds
MAX_NODES = 50  # that fit one reply
_HELLO_PATIENCE = 5.0
_SEND_PATIENCE = 5.0  # of a tool that does not read
_GOODBYE_PATIENCE = 0.2
_CLOSE_PATIENCE = 1.0


class Gateway:
    """Serves tools on `listener` until none has been there for `idle` seconds, the line is lost, or `stop`."""

    def __init__(self, connection: Connection, listener: socket.socket, *, link: Link, idle: float) -> None:
        self.line = connection.name
        self.scheme, self.options = link.scheme, link.options
        self.device = SharedDevice(connection)
        self._listener = listener
        self._idle = idle
        self._line_descriptor = connection.transport.fileno()
        self._lock = threading.Lock()
        self._guests: set[_Guest] = set()
        self._idle_since = time.monotonic()
        self._wake, self._woken = socket.socketpair()
        self._wake.setblocking(False)
        self._end: LinkError | None = None  # why it ends; None while it does not

    def run(self) -> None:
        """Serves; returns when the gateway has to end. `end` comes after it."""
        poll = select.poll()
        poll.register(self._listener, select.POLLIN)
        poll.register(self._woken, select.POLLIN)
        if self._line_descriptor is not None:
            poll.register(self._line_descriptor, 0)  # reports only that the line is gone
        while self._end is None and (left := self._idle_left()) > 0:
            for descriptor, event in poll.poll(None if left == math.inf else left * 1000 + 1):
                if descriptor == self._listener.fileno():
                    self._accept()
                elif descriptor == self._woken.fileno():
                    self._woken.recv(100)
                elif event & (select.POLLHUP | select.POLLERR | select.POLLNVAL):
                    self.stop(f"The serial line {self.line} was lost; check the cable and try again.", LOST)

    def stop(self, message: str, code: str) -> None:
        """Makes `run` return, from any thread or signal handler. Tools get the message."""
        self._end = self._end or LinkError(message, code)
        self._look()

    def _look(self) -> None:
        """Makes `run` look again."""
        with suppress(BlockingIOError):  # it will look anyway
            self._wake.send(b"!")

    def end(self) -> None:
        """Disconnects from the tools and the device. The socket's name is gone already."""
        self._listener.close()
        goodbye = self._end or LinkError(f"The gateway of {self.line} ends; try again.", ENDING)
        with self._lock:
            guests = list(self._guests)
        for guest in guests:
            guest.take_leave(goodbye)
        self.device.close(_CLOSE_PATIENCE)

    # ---- tools ----

    def tools(self) -> list[Tool]:
        """The tools that use the line, in the order they came."""
        with self._lock:
            there = [g.tool for g in self._guests if g.tool and not g.is_gone()]
        return sorted(there, key=lambda tool: tool.since)

    def _idle_left(self) -> float:
        with self._lock:
            return math.inf if self._guests else self._idle_since + self._idle - time.monotonic()

    def _accept(self) -> None:
        with suppress(OSError):
            connected, _ = self._listener.accept()
            guest = _Guest(self, connected)
            with self._lock:
                has_room = len(self._guests) < MAX_GUESTS
                if has_room:
                    self._guests.add(guest)
            if not (has_room and guest.start()):
                connected.close()

    def leave(self, guest: _Guest) -> None:
        with self._lock:
            self._guests.discard(guest)
            if guest.tool:
                self._idle_since = time.monotonic()
        self._look()

    def admit(self, guest: _Guest, tool: Tool, hello: dict[str, Any]) -> None:
        """Makes a guest a tool of this line. Raises LinkError when it cannot be served."""
        with self._lock:
            others = [str(g.tool) for g in self._guests if g.tool and not g.is_gone()]
            reason = self._misfit(hello, others)
            if reason is None and len(others) < MAX_TOOLS and self._end is None:
                guest.tool = tool
                return
        if self._end is not None or (reason and not others):
            self.stop(f"The gateway of {self.line} ends; try again.", ENDING)
            raise LinkError(f"The gateway of {self.line} ends; try again.", ENDING)
        raise reason or LinkError(f"{len(others)} tools use {self.line}; end one of them first.", "too-many")

    def _misfit(self, hello: dict[str, Any], others: list[str]) -> LinkError | None:
        users = ", ".join(others)
        if hello.get("protocol") != PROTOCOL:
            return LinkError(
                f"The gateway of {self.line} (pid {os.getpid()}) is of another plctool, {plctool_version()}, and "
                f"serves {users}; end that first, or the gateway with 'plctool gateway stop'.",
                "gateway-version",
            )
        if hello.get("scheme") != self.scheme:
            flag = f"--{TRANSPORTS[self.scheme].flag} {self.line}"
            return LinkError(f"{self.line} is in use as {flag} by {users}; say that, or end it first.", "other-scheme")
        for name, value in self.options.items():
            if hello.get(name) != value:
                return LinkError(
                    f"{self.line} is in use with {value} {name} by {users}; say --{name} {value}, or end that first.",
                    f"other-{name}",
                )
        return None

    # ---- about the gateway ----

    def status(self) -> dict[str, Any]:
        claim = self.device.claim
        return {
            "line": self.line,
            **self.options,
            "pid": os.getpid(),
            "version": plctool_version(),
            "requests": self.device.requests,
            "claim": f"{claim.owner} is {claim.purpose}" if claim else None,
            "tools": [{"tool": tool.words, "pid": tool.pid} for tool in self.tools()],
        }

    def dismiss(self, by: str, only_idle: bool) -> bool:
        """Ends the gateway when that is asked for; not when `only_idle` and there are tools. Raises LinkError while
        a program is on its way."""
        if only_idle and self.tools():
            return False
        if claim := self.device.claim:
            raise LinkError(f"{claim.owner} is {claim.purpose}; stop the gateway when it is done.", BUSY)
        self.stop(f"The gateway of {self.line} was ended by {by}.", "gateway-stopped")
        return True


class _Guest:
    """A tool at the socket. `tool` is None until it has said who it is, and for one that asks about the gateway."""

    def __init__(self, gateway: Gateway, connected: socket.socket) -> None:
        self.tool: Tool | None = None
        self._gateway = gateway
        self._device = gateway.device
        self._pipe = Pipe(connected)
        self._peer = _peer_pid(connected)
        self._words = ""
        self._number = GOODBYE  # of the request that is served
        self._ended_stream = GOODBYE  # number of the last stream that has ended: what is still to come of it is ignored

    def start(self) -> bool:
        """Serves it in a thread of its own; False when the system gives none."""
        try:
            threading.Thread(target=self._live, daemon=True).start()
        except RuntimeError:
            self._gateway.leave(self)
            return False
        return True

    def _live(self) -> None:
        try:
            self._greet()
            while True:
                self._serve(self._pipe.receive())
        except (Closed, FrameError, TimeoutError):
            pass  # gone, or of no use
        finally:
            if self.tool:
                self._device.release(self.tool, *Scope)
            self._gateway.leave(self)
            self._pipe.close()

    def take_leave(self, reason: LinkError) -> None:
        """Tells the tool why the gateway ends, as far as it reads, and ends its thread."""
        with suppress(Closed, TimeoutError):
            self._pipe.send(_failure(GOODBYE, reason), _GOODBYE_PATIENCE)
        self._pipe.shut()

    def is_gone(self) -> bool:
        """Whether the tool has left, though its thread may not know it yet."""
        return self._pipe.is_gone()

    def _greet(self) -> None:
        """The first frame says who it is."""
        frame = self._pipe.receive(_HELLO_PATIENCE)
        if frame.kind is not Kind.HELLO:
            raise FrameError("no hello")
        hello = frame.document
        pid = self._peer or _integer(hello, "pid")
        self._words = f"{_printable(hello.get('tool')) or 'a tool'} (pid {pid})"
        if not hello.get("asks_only"):
            tool = Tool(_printable(hello.get("tool")) or "a tool", pid, self._pipe.shut, self._check, self._beat)
            try:
                self._gateway.admit(self, tool, hello)
            except LinkError as error:
                self._send(_failure(frame.number, error))
                raise Closed from error
            tool.patience = bounded_factor(_number(hello, "patience"))
        self._done(frame.number, {"pid": os.getpid(), "line": self._gateway.line})

    # ---- requests ----

    def _serve(self, frame: Frame) -> None:
        self._number = frame.number
        try:
            match frame.kind:
                case Kind.CALL:
                    self._done(frame.number, self._call(frame.document))
                case Kind.EXCHANGE:
                    self._exchange(frame)
                case Kind.STREAM:
                    self._stream(frame)
                case Kind.CANCEL:
                    pass  # the stream had ended when it was sent
                case _:
                    raise FrameError(f"{frame.kind.name} is not a request")
        except PlcError as error:
            self._send(_failure(frame.number, error))
            if error.code == LOST:
                self._gateway.stop(error.message, LOST)

    def _exchange(self, frame: Frame) -> None:
        request = Request.decode(frame.payload)
        patience = min(request.patience, MAX_PATIENCE)
        answer = self._device.exchange(self._known(), request.generation, request.message, patience)
        self._send(Frame(Kind.REPLY, frame.number, Reply(1, answer).encode()))

    def _stream(self, frame: Frame) -> None:
        if frame.number == self._ended_stream:
            return
        source = _Source(self._pipe, frame)
        generation = source.request.generation
        self._ended_stream = frame.number
        with suppress(_Cancelled):
            self._device.stream(
                self._known(), generation, source.messages(), source.patience, source.reply, source.check
            )
            self._done(frame.number, {})

    def _call(self, call: dict[str, Any]) -> dict[str, Any]:
        match call.get("op"):
            case "open":
                password = call.get("password")
                return asdict(self._device.open(self._known(), password if isinstance(password, str) else None))
            case "application":
                application = self._device.application(self._known(), _integer(call, "generation"))
                return {"session": application.session, "data_guid": application.data_guid.hex()}
            case "forget":
                self._device.forget_application(self._known(), _integer(call, "session"))
            case "claim":
                purpose = _printable(call.get("purpose")) or "using it alone"
                self._device.take(self._known(), purpose, _scope(call))
            case "release":
                self._device.release(self._known(), _scope(call))
            case "others":
                others = [tool for tool in self._gateway.tools() if tool is not self.tool]
                return {"tools": [{"tool": tool.words, "pid": tool.pid} for tool in others]}
            case "scan":
                seconds = min(_number(call, "seconds"), MAX_PATIENCE)
                nodes = self._device.scan(self._known(), seconds, _integer(call, "enough"))
                return {"nodes": [asdict(node) | {"address": node.address.hex()} for node in nodes[:MAX_NODES]]}
            case "status":
                return self._gateway.status()
            case "stop":
                return {"ends": self._gateway.dismiss(self._words, only_idle=bool(call.get("only_idle")))}
            case _:
                raise FrameError("no such call")
        return {}

    def _known(self) -> Tool:
        if self.tool is None:
            raise FrameError("this is for tools that use the line")
        return self.tool

    # ---- replies ----

    def _send(self, frame: Frame) -> None:
        self._pipe.send(frame, _SEND_PATIENCE)

    def _done(self, number: int, document: dict[str, Any]) -> None:
        self._send(document_frame(Kind.DONE, number, document))

    def _check(self) -> None:
        if self._pipe.is_gone():
            raise Closed

    def _beat(self) -> None:
        self._check()
        self._send(Frame(Kind.WAIT, self._number))


class _Cancelled(Exception):
    """The tool has cancelled its stream."""


class _Source:
    """The messages of a stream, as the tool sends them, and the way back for their replies.

    When the tool gives up or is gone, the stream ends at once by an exception: the device must not get more of a
    program that is here already.
    """

    def __init__(self, pipe: Pipe, first: Frame) -> None:
        self.request = Request.decode(first.payload)
        self.patience = min(self.request.patience, MAX_PATIENCE)
        self._pipe = pipe
        self._number = first.number
        self._taken = 0

    def messages(self) -> Iterator[bytes]:
        """Raises what `Pipe.receive` does, and _Cancelled."""
        while True:
            self._taken += 1
            yield self.request.message
            if not self.request.more:
                return
            frame = self._pipe.receive(CLAIM_SILENCE)
            self._look(frame)
            self.request = Request.decode(frame.payload)

    def check(self) -> None:
        """Raises _Cancelled or Closed when no more is to be sent."""
        if self._pipe.is_gone():
            raise Closed
        for frame in self._pipe.look(AHEAD):
            self._look(frame)

    def reply(self, message: bytes) -> None:
        self._pipe.send(Frame(Kind.REPLY, self._number, Reply(self._taken, message).encode()), _SEND_PATIENCE)

    def _look(self, frame: Frame) -> None:
        if frame.number != self._number or frame.kind not in (Kind.STREAM, Kind.CANCEL):
            raise FrameError("another request within a stream")
        if frame.kind is Kind.CANCEL:
            raise _Cancelled


def _failure(number: int, error: PlcError) -> Frame:
    kind = "channel" if isinstance(error, ChannelLost) else "device" if isinstance(error, DeviceError) else "link"
    result = error.result if isinstance(error, DeviceError) else 0
    failure = {"kind": kind, "code": error.code, "message": error.message, "result": result}
    return document_frame(Kind.FAILED, number, failure)


def _printable(words: object) -> str:
    """What a tool calls itself, fit for another tool's terminal."""
    return one_line(str(words or ""))[:MAX_WORDS]


def _integer(document: dict[str, Any], name: str) -> int:
    value = document.get(name)
    if not isinstance(value, int):
        raise FrameError(f"{name} is not a number")
    return value


def _number(document: dict[str, Any], name: str) -> float:
    value = document.get(name)
    if not isinstance(value, (int, float)) or not 0 <= value < math.inf:
        raise FrameError(f"{name} is not a number")
    return float(value)


def _scope(document: dict[str, Any]) -> Scope:
    try:
        return Scope(document.get("scope", Scope.DEVICE))
    except ValueError:
        raise FrameError("scope is not one of those that a tool can keep") from None


def _peer_pid(connected: socket.socket) -> int:
    """The process at the other end; 0 where the system does not tell."""
    if not hasattr(socket, "SO_PEERCRED"):
        return 0
    credentials = struct.Struct("3i")
    return int(credentials.unpack(connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, credentials.size))[0])
