"""One device that several tools share: whose turn it is, and who keeps the others out."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from itertools import chain, islice

from plctool.core import lib
from plctool.errors import DeviceError, LinkError
from plctool.gateway.frames import BUSY, FILES_BUSY, Scope
from plctool.link import l7
from plctool.link.channel import ChannelLost
from plctool.link.connection import Connection
from plctool.link.names import Node
from plctool.link.passwords import is_same, password_needed, wrong_password
from plctool.link.session import Application, Session

CLAIM_SILENCE = 30.0  # a tool that has reserved the device and sends nothing for so long loses it [s]
_BEAT = 2.0  # how often a tool that waits for its turn gets WAIT again [s]


class Turns:
    """First come, first served. A tool asks one thing at a time, so none has two turns while another one waits."""

    def __init__(self) -> None:
        self._queue: deque[object] = deque()
        self._changed = threading.Condition()

    @contextmanager
    def turn(self, beat: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Holds the turn. `beat` is called every few seconds of waiting; what it raises ends the waiting."""
        ticket = object()
        with self._changed:
            self._queue.append(ticket)
        try:
            while not self._wait(ticket, _BEAT):
                beat()
            yield
        finally:
            with self._changed:
                self._queue.remove(ticket)
                self._changed.notify_all()

    def __len__(self) -> int:
        return len(self._queue)

    def _wait(self, ticket: object, seconds: float) -> bool:
        """Whether it is the ticket's turn, at the latest after so many seconds."""
        with self._changed:
            return self._changed.wait_for(lambda: self._queue[0] is ticket, seconds)


@dataclass(eq=False)
class Tool:
    """A tool of this machine that uses the line. `words` is how its user called it."""

    words: str
    pid: int
    drop: Callable[[], None] = lambda: None  # ends its connection
    check: Callable[[], None] = lambda: None  # raises when it is gone
    beat: Callable[[], None] = lambda: None  # tells it to wait on; raises when it is gone
    since: float = field(default_factory=time.monotonic)
    silent_since: float = field(default_factory=time.monotonic)  # math.inf while it asks for something
    patience: float = 1.0  # how many times as long as usual a device may be silent, for this tool
    login: int = 0  # the one that it has opened, with the password if the device has one

    def __str__(self) -> str:
        return f"{self.words} (pid {self.pid})"


@dataclass(frozen=True)
class Claim:
    """`owner` keeps the device, or its files, to itself. `purpose`: shown to the others, such as "downloading
    app.cdl"."""

    owner: Tool
    purpose: str


@dataclass(frozen=True)
class OpenChannel:
    """What a tool has to know of the channel. `generation` is another one after each time it was lost."""

    generation: int
    session: int
    buffer_size: int
    best_size: int
    is_slow: bool


class SharedDevice:
    """The one channel and login of a device. Every method takes its turn first, and raises LinkError with code BUSY
    when another tool keeps the device to itself."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._session = Session(connection, lambda: self._given)
        self._given: str | None = None  # the password, by the tool whose turn it is
        self._turns = Turns()
        self._claims: dict[Scope, Claim] = {}
        self._claiming = threading.Lock()

    @property
    def requests(self) -> int:
        """Requests that are waiting or under way."""
        return len(self._turns)

    @property
    def claim(self) -> Claim | None:
        """Of the device; None while tools share it."""
        return self._claims.get(Scope.DEVICE)

    # ---- what tools ask for ----

    def open(self, tool: Tool, password: str | None) -> OpenChannel:
        """Opens a channel and logs in, unless that is done. A login is for the tools that give the password it was made
        with; raises DeviceError for others."""
        with self._turn(tool):
            self._given = password
            session = self._session.ensure()
            self._check_password(password)
            tool.login = self._session.logins
            connection = self._connection
            return OpenChannel(
                self._session.logins, session, connection.buffer_size, connection.best_size, connection.is_slow
            )

    def _check_password(self, given: str | None) -> None:
        needed = self._session.password
        if needed is not None and given is None:
            raise password_needed()
        if needed is not None and given is not None and not is_same(given, needed):
            raise wrong_password()

    def application(self, tool: Tool, generation: int) -> Application:
        """The login to the application, one for all tools."""
        with self._turn(tool, generation):
            return self._session.application()

    def forget_application(self, tool: Tool, session: int) -> None:
        """To be called by the tool that has found application session `session` out of date."""
        with self._turn(tool):
            if self._session.application_session == session:
                self._session.forget_application()

    def exchange(self, tool: Tool, generation: int, message: bytes, patience: float) -> bytes:
        """A request and its reply. Raises ChannelLost."""
        with self._turn(tool, generation):
            self._note(message)
            answer = self._connection.exchange(message, patience)
            self._note_end(message, answer)
            return answer

    def stream(
        self,
        tool: Tool,
        generation: int,
        messages: Iterable[bytes],
        patience: float,
        reply: Callable[[bytes], None],
        check: Callable[[], None],
    ) -> None:
        """Requests one after the other; `reply` gets each reply. No other tool has the device until the end; while a
        program is sent, others are refused. `check` is called again and again; what it raises, or `reply`, ends the
        stream and closes the channel."""
        following = iter(messages)
        first = list(islice(following, 1))
        sent: deque[bytes] = deque()  # without a reply yet

        def noted(message: bytes) -> bytes:
            self._note(message)
            sent.append(message)
            return message

        with (
            self._turn(tool, generation),
            self._claimed_meanwhile(tool) if any(map(_sends_program, first)) else nullcontext(),
            closing(self._connection.stream(map(noted, chain(first, following)), patience, check)) as answers,
        ):
            for answer in answers:
                self._note_end(sent.popleft(), answer)
                reply(answer)

    def scan(self, tool: Tool, seconds: float, enough: int) -> list[Node]:
        with self._turn(tool):
            return self._connection.scan(seconds, enough)

    def close(self, patience: float) -> None:
        """Closes channel and line for good. Returns after `patience` seconds though a request is still under way."""
        waited = threading.Thread(target=self._close, daemon=True)
        waited.start()
        waited.join(patience)

    def _close(self) -> None:
        with self._turns.turn():
            self._connection.close()

    # ---- turns ----

    @contextmanager
    def _turn(self, tool: Tool, generation: int | None = None) -> Iterator[None]:
        self._refuse_others(tool)
        tool.silent_since = math.inf
        try:
            with self._turns.turn(tool.beat):
                tool.check()
                self._refuse_others(tool)  # it may have been claimed meanwhile
                if generation is not None:
                    self._check_generation(tool, generation)
                self._connection.patience_factor = tool.patience
                yield
        finally:
            tool.silent_since = time.monotonic()

    def _check_generation(self, tool: Tool, generation: int) -> None:
        """The code says that the device has not taken the request, so it may be repeated on another channel."""
        may_use = self._session.password is None or tool.login == generation
        if generation != self._session.logins or not self._session.is_logged_in or not may_use:
            raise ChannelLost("The channel to the device was closed; try again.", "closed")

    # ---- claims ----

    def take(self, tool: Tool, purpose: str, scope: Scope = Scope.DEVICE) -> None:
        """Keeps the device or its files for this tool, after the requests that wait already, until `release`."""
        with self._turn(tool):
            self._refuse_others(tool, scope)
            with self._claiming:
                self._claims[scope] = Claim(tool, purpose)

    def release(self, tool: Tool, *scopes: Scope) -> None:
        """Also of a tool that keeps nothing."""
        with self._claiming:
            for scope in scopes:
                if (claim := self._claims.get(scope)) and claim.owner is tool:
                    del self._claims[scope]

    @contextmanager
    def _claimed_meanwhile(self, tool: Tool) -> Iterator[None]:
        if self.claim:
            yield
            return
        self._claims[Scope.DEVICE] = Claim(tool, "sending a program")
        try:
            yield
        finally:
            self.release(tool, Scope.DEVICE)

    def _refuse_others(self, tool: Tool, scope: Scope = Scope.DEVICE) -> None:
        """Raises LinkError while another tool keeps it; one that has fallen silent loses it."""
        with self._claiming:
            claim = self._claims.get(scope)
            if claim is None or claim.owner is tool:
                return
            if time.monotonic() - claim.owner.silent_since <= CLAIM_SILENCE:
                code = BUSY if scope is Scope.DEVICE else FILES_BUSY
                raise LinkError(f"{claim.owner} is {claim.purpose}; try again when it is done.", code)
            del self._claims[scope]
        claim.owner.drop()

    # ---- the login to the application ----

    def _note(self, message: bytes) -> None:
        """The login to the application holds for the one that is there. A tool may end before it can say that it
        brought another one."""
        try:
            request = l7.decode(message)
        except LinkError:
            return
        changes = (lib.SRV_APP_DOWNLOAD_COMPACT, lib.SRV_APP_RESET)
        if request.group == lib.SG_APPLICATION and request.service in changes:
            self._session.forget_application()

    def _note_end(self, message: bytes, answer: bytes) -> None:
        """A login ends with the password it was made with: every tool has to give the new one. And the device may have
        ended it, because another client set a password."""
        try:
            request = l7.decode(message)
            l7.decode_reply(answer, request)
            ended = request.group == lib.SG_USERMGR
        except DeviceError as error:
            ended = error.result == lib.ERR_INVALID_SESSION_ID
        except LinkError:
            return
        if ended:
            self._session.forget_login()


def _sends_program(message: bytes) -> bool:
    try:
        request = l7.decode(message)
    except LinkError:
        return False
    return (request.group, request.service) == (lib.SG_APPLICATION, lib.SRV_APP_DOWNLOAD_COMPACT)
