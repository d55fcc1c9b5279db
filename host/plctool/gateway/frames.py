"""Frames between a tool and the gateway on their local socket: pure encoding and decoding, then a pipe that carries
them.

A frame is a head (payload size, kind, request number) and its payload. The frames HELLO and FAILED and the heads keep
their form in every version, so that a tool and a gateway of different versions can report that.
"""

from __future__ import annotations

import json
import select
import socket
import struct
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any

from plctool.link.channel import MAX_REQUESTS

BUSY = "downloading"  # code of the error while another tool keeps the device to itself
FILES_BUSY = "transferring"  # the same while another one keeps the files
ENDING = "gateway-ending"  # code of a refusal: the gateway ends, and another one may be started
LOST = "link-lost"  # code of the error when the line is gone, and the gateway ends with it
PROTOCOL = 5  # of the gateway; a tool and a gateway work together when theirs are equal
AHEAD = MAX_REQUESTS + 1  # messages of a stream that the gateway may have: one waits there for its time
MAX_PAYLOAD = 0x8000  # bytes; the longest message of the link with its head, or the longest list of tools, fits
_HEAD = struct.Struct("<IBI")
_EXCHANGE = struct.Struct("<IIB")
_REPLY = struct.Struct("<I")
_CHUNK = 0x10000


class Kind(IntEnum):
    # From a tool.
    HELLO = 1  # JSON: who asks; always the first frame
    CALL = 2  # JSON: {"op": ...}
    EXCHANGE = 3  # Request: one message to the device
    STREAM = 4  # Request: one of several messages; AHEAD of them are sent before the first reply
    CANCEL = 5  # no more messages of a stream will come
    # From the gateway.
    DONE = 0x81  # JSON: the result of HELLO, CALL or STREAM
    REPLY = 0x82  # Reply: a message of the device
    FAILED = 0x83  # JSON: an error; with request number 0 the gateway ends
    WAIT = 0x84  # nothing: the request waits for its turn


class Scope(Enum):
    """What a tool may keep to itself. For the device all tools of a gateway are one, with one transfer at a time."""

    DEVICE = "device"
    FILES = "files"


_KINDS = frozenset(int(kind) for kind in Kind)
GOODBYE = 0  # request number of the FAILED frame with which a gateway ends


class FrameError(Exception):
    """What arrived is not a frame."""


class Closed(Exception):
    """The other end closed the socket."""


@dataclass(frozen=True)
class Frame:
    kind: Kind
    number: int  # of the request, as the tool chose it; a reply has that of its request
    payload: bytes = b""

    @property
    def document(self) -> dict[str, Any]:
        """The payload of a JSON frame. Raises FrameError when it is something else."""
        try:
            document = json.loads(self.payload)
        except (ValueError, RecursionError) as error:
            raise FrameError("not JSON") from error
        if not isinstance(document, dict):
            raise FrameError("not an object")
        return document


def document_frame(kind: Kind, number: int, document: dict[str, Any]) -> Frame:
    return Frame(kind, number, json.dumps(document).encode())


@dataclass(frozen=True)
class Request:
    """A message for the device, on the channel that had number `generation`. `patience`: seconds of silence borne."""

    generation: int
    patience: float
    message: bytes
    more: bool = False  # of a stream: another one follows

    def encode(self) -> bytes:
        return _EXCHANGE.pack(self.generation, round(self.patience * 1000), self.more) + self.message

    @staticmethod
    def decode(payload: bytes) -> Request:
        """Raises FrameError."""
        if len(payload) < _EXCHANGE.size:
            raise FrameError("a request is too short")
        generation, patience_ms, more = _EXCHANGE.unpack_from(payload)
        return Request(generation, patience_ms / 1000, payload[_EXCHANGE.size :], bool(more))


@dataclass(frozen=True)
class Reply:
    """A message of the device. `taken`: messages of the stream that the gateway has taken so far."""

    taken: int
    message: bytes

    def encode(self) -> bytes:
        return _REPLY.pack(self.taken) + self.message

    @staticmethod
    def decode(payload: bytes) -> Reply:
        """Raises FrameError."""
        if len(payload) < _REPLY.size:
            raise FrameError("a reply is too short")
        return Reply(_REPLY.unpack_from(payload)[0], payload[_REPLY.size :])


def encode(frame: Frame) -> bytes:
    """The bytes of a frame. Raises FrameError when it is too long."""
    if len(frame.payload) > MAX_PAYLOAD:
        raise FrameError(f"a frame of {len(frame.payload)} bytes is too long")
    return _HEAD.pack(len(frame.payload), frame.kind, frame.number) + frame.payload


class Decoder:
    """Takes bytes as they come and gives the frames in them. It never keeps more than one frame and one chunk."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that are complete now. Raises FrameError at the first invalid head."""
        self._data += data
        frames = []
        while (frame := self._next()) is not None:
            frames.append(frame)
        return frames

    def _next(self) -> Frame | None:
        if len(self._data) < _HEAD.size:
            return None
        size, kind, number = _HEAD.unpack_from(self._data)
        if size > MAX_PAYLOAD or kind not in _KINDS:
            raise FrameError(f"a head of kind {kind} and {size} bytes")
        end = _HEAD.size + size
        if len(self._data) < end:
            return None
        payload = bytes(self._data[_HEAD.size : end])
        del self._data[:end]
        return Frame(Kind(kind), number, payload)


class Pipe:
    """Frames over a connected socket. One thread receives; any may send."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self._socket = connected
        self._readable, self._writable = select.poll(), select.poll()
        self._readable.register(connected, select.POLLIN)
        self._writable.register(connected, select.POLLOUT)
        self._decoder = Decoder()
        self._frames: deque[Frame] = deque()
        self._sending = threading.Lock()

    def receive(self, timeout: float | None = None) -> Frame:
        """The next frame. Raises Closed, FrameError, and TimeoutError when it is not complete after `timeout` s."""
        end = None if timeout is None else time.monotonic() + timeout
        while not self._frames:
            if not self._fetch():
                _wait(self._readable, end)
        return self._frames.popleft()

    def look(self, most: int) -> list[Frame]:
        """The frames that have come and were not received yet, up to about `most`. Raises Closed, FrameError."""
        while len(self._frames) < most and self._fetch():
            pass
        return list(self._frames)

    def _fetch(self) -> bool:
        """Takes what the socket has; False when that is nothing."""
        try:
            data = self._socket.recv(_CHUNK)
        except BlockingIOError:
            return False
        except OSError as error:
            raise Closed from error
        if not data:
            raise Closed
        self._frames.extend(self._decoder.feed(data))
        return True

    def send(self, frame: Frame, timeout: float) -> None:
        """Raises Closed; TimeoutError when the other end does not read for `timeout` s: the pipe is of no use then."""
        rest = memoryview(encode(frame))
        end = time.monotonic() + timeout
        if not self._sending.acquire(timeout=timeout):
            raise TimeoutError
        try:
            while rest:
                try:
                    rest = rest[self._socket.send(rest) :]
                except BlockingIOError:
                    _wait(self._writable, end)
        except OSError as error:
            if isinstance(error, TimeoutError):
                raise
            raise Closed from error
        finally:
            self._sending.release()

    def is_gone(self) -> bool:
        """Whether the other end has closed, though there may be something left to receive. From any thread."""
        poll = select.poll()
        try:
            poll.register(self._socket, 0)  # reports only the end
        except (OSError, ValueError):
            return True
        return any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0))

    def shut(self) -> None:
        """Ends the traffic in both directions; a thread that waits in `receive` gets Closed."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.shut()  # a process that was forked meanwhile has the socket, too
        self._socket.close()


def _wait(poll: select.poll, end: float | None) -> None:
    """Raises TimeoutError at `end`."""
    left = None if end is None else (end - time.monotonic()) * 1000
    if left is not None and left <= 0:
        raise TimeoutError
    poll.poll(left)
