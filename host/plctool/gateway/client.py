"""A tool's end of the gateway: finds it or starts it, and looks like a connection of one's own."""

from __future__ import annotations

import itertools
import json
import os
import selectors
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace
from typing import Any

from plctool.errors import DeviceError, LinkError
from plctool.gateway.frames import (
    AHEAD,
    ENDING,
    FILES_BUSY,
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
from plctool.gateway.place import NoGateway, Place, find_holder, find_place, locked
from plctool.link.channel import ChannelLost
from plctool.link.connection import PATIENCE, SCAN_SECONDS, patience_factor
from plctool.link.names import Node
from plctool.link.passwords import AskPassword, no_password, password_needed
from plctool.link.session import Application, Session
from plctool.link.transports import Link

_ATTACH_PATIENCE = 30.0  # to find or start a gateway [s]
_START_PATIENCE = 20.0  # from its start to its first word [s]
_ANSWER_PATIENCE = 20.0  # beyond that of the request: it may have to find the device and open a channel [s]
_SEND_PATIENCE = 10.0
_FILES_PATIENCE = 30.0  # for a transfer of another tool to end; a file is small [s]
_FILES_POLL = 0.1  # between two looks whether it has ended [s]
_RETRY = 0.01  # after a gateway that was just ending [s]


class Ended(Exception):
    """The gateway has just ended; another one may be started."""


# ---- finding and starting ----


def connect_gateway(link: Link, words: str, ask_password: AskPassword = no_password) -> GatewayConnection:
    """A connection through the gateway of a link, which is started when it does not run. `words`: how this one is shown
    to other tools. `ask_password`: asked when the device has a password, whether the gateway is logged in or not.

    Raises NoGateway when there can be none, LinkError when the line cannot be opened or not be shared.
    """
    return GatewayConnection(link, words, ask_password)


def _attach(link: Link, words: str) -> tuple[Place, Pipe]:
    """The place of the line now, and what leads there. Raises NoGateway, LinkError."""
    end = time.monotonic() + _ATTACH_PATIENCE
    while True:
        place = find_place(link.place)
        try:
            pipe = connect(place) or _start_once(place, link)
            hello = {"scheme": link.scheme, **link.options, "tool": words, "patience": patience_factor()}
            greet(pipe, place, hello)
            return place, pipe
        except Ended:
            if time.monotonic() >= end:
                raise _stuck(place) from None
            time.sleep(_RETRY)


def connect(place: Place) -> Pipe | None:
    """None when nothing listens there, as after a gateway was killed."""
    connected = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connected.settimeout(_ANSWER_PATIENCE)
        connected.connect(str(place.socket))
    except (FileNotFoundError, ConnectionRefusedError):
        connected.close()
        return None
    except TimeoutError:
        connected.close()
        raise _stuck(place) from None
    except OSError as error:
        connected.close()
        raise NoGateway(str(error)) from error
    return Pipe(connected)


def _start_once(place: Place, link: Link) -> Pipe:
    """Starts the gateway unless another tool has just done that. Raises Ended when it has ended already, or when the
    line has another place now."""
    try:
        with locked(place.start_lock, _ATTACH_PATIENCE):
            pipe = connect(place)
            if pipe is None:
                _start(place, link)
                pipe = connect(place)
    except TimeoutError:
        raise _stuck(place) from None
    except OSError as error:
        raise NoGateway(str(error)) from error
    if pipe is None:
        raise Ended
    return pipe


def _start(place: Place, link: Link) -> None:
    """Returns when the gateway listens. Raises NoGateway when it does not start, LinkError when it cannot open the
    line, Ended when the line is not the one of the place."""
    if not sys.executable or getattr(sys, "frozen", False):
        raise NoGateway("this program cannot start Python")
    here = replace(link, place=place.line)  # it works in another folder
    command = [sys.executable, "-P", "-m", "plctool.gateway", str(here), str(place.folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(os.path.abspath(p) for p in sys.path if p)}
    with open(place.log, "wb") as log, suppress(subprocess.TimeoutExpired):
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            start_new_session=True,
            cwd="/",
            env=environment,
        )
        assert process.stdout
        with process.stdout:
            line = _first_line(process.stdout.fileno(), _START_PATIENCE)
        process.wait(_START_PATIENCE)  # only what started the gateway, which is not our child process
    if line is None:
        raise _stuck(place)
    try:
        said = json.loads(line)
    except ValueError:
        raise NoGateway(f"it did not start; {place.log} may say why") from None
    if "busy" in said:
        raise LinkError(said["busy"], "gateway-stuck")
    if "moved" in said:
        raise Ended
    if "error" in said:
        raise LinkError(said["error"]["message"], said["error"]["code"])


def _first_line(descriptor: int, patience: float) -> bytes | None:
    """What comes up to the end of a line, or until the other end has closed; None when it does not come in time."""
    end = time.monotonic() + patience
    line = b""
    with selectors.DefaultSelector() as selector:
        selector.register(descriptor, selectors.EVENT_READ)
        while not line.endswith(b"\n"):
            if not selector.select(max(0.0, end - time.monotonic())):
                return None
            data = os.read(descriptor, 4096)
            if not data:
                break
            line += data
    return line


def greet(pipe: Pipe, place: Place, hello: dict[str, Any], patience: float = _ANSWER_PATIENCE) -> None:
    """Introduces this tool. Raises LinkError when the gateway refuses it, Ended when it ends."""
    ask(pipe, place, document_frame(Kind.HELLO, 1, {"protocol": PROTOCOL, "pid": os.getpid(), **hello}), patience)


def ask(pipe: Pipe, place: Place, frame: Frame, patience: float = _ANSWER_PATIENCE) -> dict[str, Any]:
    """Asks the gateway something on a new pipe. Raises LinkError, and Ended when it ends."""
    try:
        with suppress(Closed):  # it may have sent something before
            pipe.send(frame, patience)
        answer = pipe.receive(patience)
        said = answer.document
    except Closed:
        pipe.close()
        raise Ended from None
    except (TimeoutError, FrameError):
        pipe.close()
        raise _stuck(place) from None
    if answer.kind is Kind.DONE:
        return said
    pipe.close()
    if answer.number == GOODBYE or said.get("code") == ENDING:
        raise Ended
    raise failure(said)


def _stuck(place: Place) -> LinkError:
    holder = find_holder(place.lock)
    who = f" (pid {holder.pid})" if holder else ""
    return LinkError(
        f"The gateway of {place.line}{who} does not answer; end it with 'plctool gateway stop'.", "gateway-stuck"
    )


def failure(said: dict[str, Any]) -> LinkError | DeviceError:
    """The error of a FAILED frame."""
    message, code = str(said.get("message", "")), str(said.get("code", ""))
    if said.get("kind") == "device":
        return DeviceError(message, code, int(said.get("result", 0)))
    return ChannelLost(message, code) if said.get("kind") == "channel" else LinkError(message, code)


# ---- the connection ----


class GatewayConnection:
    """A MessageLink through the gateway of a line. Finds the gateway again, or starts another one, when it was lost."""

    def __init__(self, link: Link, words: str, ask_password: AskPassword = no_password) -> None:
        self.session = 0  # id of the device's session, while the channel is open
        self.buffer_size = 0
        self.best_size = 0
        self.is_slow = False
        self.is_bus = False  # a bus needs no gateway
        self._link = link
        self._words = words
        self._ask_password = ask_password
        self._password: str | None = None  # that was right
        self._numbers = itertools.count(1)
        self._generation: int | None = None  # of the channel; None while none is open
        self._purpose: str | None = None  # why this tool keeps the device to itself
        self._pipe: Pipe | None
        self._place, self._pipe = _attach(link, words)

    @property
    def name(self) -> str:
        return self._link.place

    @property
    def is_open(self) -> bool:
        return self._generation is not None

    def now(self) -> float:
        return time.monotonic()

    def open(self) -> None:
        """Has a channel opened unless there is one. Raises LinkError when no device answers, DeviceError without its
        password."""
        opened = self._call_open()
        self.session, self.buffer_size = int(opened["session"]), int(opened["buffer_size"])
        self.best_size, self.is_slow = int(opened["best_size"]), bool(opened["is_slow"])
        self._generation = int(opened["generation"])

    def _call_open(self) -> dict[str, Any]:
        try:
            return self._call("open", password=self._password)
        except DeviceError as error:
            password = self._ask_password() if error.code == password_needed().code else None
            if password is None:
                raise
        opened = self._call("open", password=password)
        self._password = password
        return opened

    def forget_channel(self) -> None:
        """The next request needs `open` first."""
        self._generation = None

    def exchange(self, message: bytes, patience: float = PATIENCE, *, more: bool = False) -> bytes:
        """Sends a request and returns the reply. Raises ChannelLost when the channel is gone or the gateway ended.
        `more` is of no use: another tool may come between."""
        number = self._ask(Kind.EXCHANGE, Request(self._channel(), patience, message).encode())
        return self._reply(self._answer(number, patience)).message

    def stream(
        self, messages: Iterable[bytes], patience: float = PATIENCE, *, sharing: bool = False, more: bool = False
    ) -> Iterator[bytes]:
        """Sends requests, the next ones already while the device works, and yields the replies; see Connection."""
        assert not sharing
        generation, source = self._channel(), iter(messages)
        following = next(source, None)
        if following is None:
            return
        number, sent, taken, ended = next(self._numbers), 0, 0, False
        try:
            while True:
                while following is not None and sent < taken + AHEAD:
                    message, following, sent = following, next(source, None), sent + 1
                    request = Request(generation, patience, message, more=following is not None)
                    self._ask(Kind.STREAM, request.encode(), number)
                try:
                    frame = self._answer(number, patience)
                except (LinkError, DeviceError):
                    ended = True
                    raise
                if ended := frame.kind is Kind.DONE:
                    return
                reply = self._reply(frame)
                taken = reply.taken
                yield reply.message
        finally:
            if not ended:
                with suppress(LinkError):
                    self._ask(Kind.CANCEL, b"", number)

    def scan(self, seconds: float = SCAN_SECONDS, enough: int = 0) -> list[Node]:
        """See Connection."""
        nodes = self._call("scan", seconds + PATIENCE, seconds=seconds, enough=enough)["nodes"]
        return [Node(**node | {"address": bytes.fromhex(node["address"])}) for node in nodes]

    def wait(self, seconds: float) -> None:
        """See MessageLink."""
        time.sleep(seconds)

    def close(self) -> None:
        """Leaves the gateway; never raises."""
        self._drop()

    # ---- what tools share ----

    def application(self) -> Application:
        """The login to the application that all tools share. Raises DeviceError when there is none."""
        said = self._call("application", generation=self._channel())
        return Application(int(said["session"]), bytes.fromhex(said["data_guid"]))

    def forget_application(self, session: int) -> None:
        """Application session `session` is out of date; harmless when it is not the one in use."""
        self._call("forget", session=session)

    def others(self) -> list[tuple[str, int]]:
        """The other tools that use the line, as their users called them, and their process numbers."""
        return [(str(tool["tool"]), int(tool["pid"])) for tool in self._call("others")["tools"]]

    @contextmanager
    def exclusive(self, purpose: str) -> Iterator[None]:
        """Reserves the device for this tool. Raises LinkError when another one has reserved it."""
        self._call("claim", purpose=purpose)
        self._purpose = purpose  # also for another gateway, should this one be lost
        try:
            yield
        finally:
            self._purpose = None
            with suppress(LinkError):
                self._call("release")

    @contextmanager
    def transferring(self, purpose: str) -> Iterator[None]:
        """Reserves the files of the device. Waits for a tool that has them, but not for long: then, and while one has
        reserved the device, it raises LinkError."""
        end = time.monotonic() + patience_factor() * _FILES_PATIENCE
        while not self._reserves_files(purpose, last=time.monotonic() >= end):
            time.sleep(_FILES_POLL)
        try:
            yield
        finally:
            with suppress(LinkError):
                self._call("release", scope=Scope.FILES.value)

    def _reserves_files(self, purpose: str, *, last: bool) -> bool:
        try:
            self._call("claim", purpose=purpose, scope=Scope.FILES.value)
        except LinkError as error:
            if last or error.code != FILES_BUSY:
                raise
            return False
        return True

    # ---- frames ----

    def _channel(self) -> int:
        if self._generation is None:
            raise ChannelLost("There is no connection to the device.", "closed")
        return self._generation

    def _call(self, op: str, patience: float = PATIENCE, **arguments: Any) -> dict[str, Any]:
        """Asks the gateway; another one when this one was lost before it could know of it."""
        try:
            return self._call_once(op, patience, arguments)
        except ChannelLost as error:
            if self._pipe is not None or error.code != "closed":
                raise
            return self._call_once(op, patience, arguments)

    def _call_once(self, op: str, patience: float, arguments: dict[str, Any]) -> dict[str, Any]:
        if self._pipe is None:
            self._attach_again()
        number = self._ask(Kind.CALL, json.dumps({"op": op, **arguments}).encode())
        try:
            return self._answer(number, patience).document
        except FrameError:
            raise self._nonsense() from None

    def _attach_again(self) -> None:
        try:
            self._place, self._pipe = _attach(self._link, self._words)
        except NoGateway as error:
            raise LinkError(f"The gateway of {self.name} cannot be started again ({error}); try again.") from error
        if self._purpose:
            self._call_once("claim", PATIENCE, {"purpose": self._purpose})

    def _ask(self, kind: Kind, payload: bytes, number: int = GOODBYE) -> int:
        """Sends a request, with the number of one that has begun or a new one, which is returned."""
        number = number or next(self._numbers)
        if self._pipe is None:
            raise self._not_taken()
        try:
            self._pipe.send(Frame(kind, number, payload), _SEND_PATIENCE)
        except TimeoutError:
            self._drop()
            raise _stuck(self._place) from None
        except FrameError:
            raise LinkError(f"A request of {len(payload)} bytes is too long.", "too-long") from None
        except Closed:
            self._farewell()
            raise self._not_taken() from None
        return number

    def _farewell(self) -> None:
        """Raises what the gateway has said before it ended, if it has."""
        pipe = self._pipe
        try:
            while pipe is not None:
                frame = pipe.receive(0.0)
                if frame.number == GOODBYE:
                    raise failure(frame.document)
        except (Closed, FrameError, TimeoutError):
            pass
        finally:
            self._drop()

    def _answer(self, number: int, patience: float) -> Frame:
        """The next reply to a request. Raises what has failed."""
        while True:
            frame = self._next_frame(patience_factor() * patience + _ANSWER_PATIENCE)
            if frame.number not in (number, GOODBYE) or frame.kind is Kind.WAIT:
                continue  # WAIT, or what remains of a stream that was aborted
            if frame.kind is not Kind.FAILED:
                return frame
            try:
                error = failure(frame.document)
            except FrameError:
                raise self._nonsense() from None
            if frame.number == GOODBYE or error.code == LOST:  # its farewell would say the same once more
                self._drop()
            if isinstance(error, ChannelLost):
                self._generation = None
            raise error

    def _next_frame(self, patience: float) -> Frame:
        if self._pipe is None:
            raise self._not_taken()
        try:
            return self._pipe.receive(patience)
        except Closed:
            self._drop()
            raise ChannelLost(
                f"The gateway of {self.name} ended while it worked on a request, which may have been carried out; "
                "look, and try again.",
                "gateway-lost",
            ) from None
        except TimeoutError:
            self._drop()
            raise _stuck(self._place) from None
        except FrameError:
            raise self._nonsense() from None

    def _reply(self, frame: Frame) -> Reply:
        try:
            return Reply.decode(frame.payload)
        except FrameError:
            raise self._nonsense() from None

    def _nonsense(self) -> LinkError:
        self._drop()
        return LinkError(
            f"The gateway of {self.name} sent what plctool does not understand; end it with 'plctool gateway stop'.",
            "gateway-protocol",
        )

    def _not_taken(self) -> ChannelLost:
        self._drop()
        return ChannelLost(f"The gateway of {self.name} has ended; try again.", "closed")

    def _drop(self) -> None:
        pipe, self._pipe, self._generation = self._pipe, None, None
        if pipe:
            pipe.close()


class GatewaySession(Session):
    """A session whose logins are those of the gateway."""

    def __init__(self, gateway: GatewayConnection) -> None:
        super().__init__(gateway)
        self._gateway = gateway

    def exclusive(self, purpose: str) -> AbstractContextManager[None]:
        return self._gateway.exclusive(purpose)

    def transferring(self, purpose: str) -> AbstractContextManager[None]:
        return self._gateway.transferring(purpose)

    def forget_login(self) -> None:
        super().forget_login()
        self._gateway.forget_channel()

    def forget_application(self) -> None:
        if session := self.application_session:
            with suppress(LinkError):  # a gateway that is gone has forgotten everything
                self._gateway.forget_application(session)
        super().forget_application()

    def _login(self) -> int:
        return self._gateway.session

    def _login_application(self) -> Application:
        return self._gateway.application()
