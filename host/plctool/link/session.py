"""A login on a device, renewed automatically when the channel was lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TypeVar

from plctool.core import lib
from plctool.errors import DeviceError
from plctool.link import bintag, l7
from plctool.link.channel import ChannelLost
from plctool.link.connection import PATIENCE, MessageLink
from plctool.link.passwords import (
    AskPassword,
    no_password,
    password_needed,
    password_not_taken,
    proof_of,
    wrong_password,
)
from plctool.link.wire import Layout

_T = TypeVar("_T")
_TRIES = 3
_APPLICATION = "Application"
_LOGIN_REPLY = Layout("APP_LOGIN_REPLY")
_CHALLENGE_SIZE = Layout("DEV_CHALLENGE").size
_PAUSE = 0.1  # between two tries while the device takes no password, because of a wrong one before [s]
_PAUSE_PATIENCE = 10 * lib.PASSWORD_PAUSE_MS / 1000  # [s]; the clock of a busy device may be slow


@dataclass(frozen=True)
class Application:
    """The login to the application: the session number and the identity of its data."""

    session: int
    data_guid: bytes

    @property
    def image_crc(self) -> int:
        return int.from_bytes(self.data_guid[:4], "little")


@dataclass(frozen=True)
class Request:
    """What `Session.call_each` asks for."""

    group: int
    service: int
    tags: Sequence[bintag.Tag] = ()


class Session:
    """Calls services of one device. Channel and logins are made when first needed."""

    def __init__(self, connection: MessageLink, ask_password: AskPassword = no_password) -> None:
        self.connection = connection
        self.logins = 0  # how often it has logged in
        self.password: str | None = None  # that the last login needed
        self._ask_password = ask_password
        self._id: int | None = None
        self._application: Application | None = None

    def call(
        self,
        group: int,
        service: int,
        tags: Iterable[bintag.Tag] = (),
        patience: float = PATIENCE,
        *,
        more: bool = False,
    ) -> bintag.Tags:
        """One request and its reply. Raises ChannelLost when the channel is gone, DeviceError when refused. `more`: as
        in Connection.stream."""
        try:
            reply = self._exchange(self.message(group, service, bintag.encode(tags)), patience, more)
        except DeviceError as error:
            self._check_login(error)
            raise
        self._check_application_login(group, reply)
        return reply

    def call_each(
        self, requests: Sequence[Request], patience: float = PATIENCE, *, more: bool = False
    ) -> list[bintag.Tags]:
        """The replies to requests that are sent without waiting. Raises as `call`, also ChannelLost when a reply was
        lost; whether the device took the requests is not known then. `more`: as in Connection.stream."""
        messages = [self.message(r.group, r.service, bintag.encode(r.tags)) for r in requests]
        replies = list(self.connection.stream(map(l7.encode, messages), patience, more=more))
        if len(replies) < len(requests):
            raise ChannelLost("A reply of the device was lost; try again.", "timeout")
        try:
            found = [l7.decode_reply(reply, message) for reply, message in zip(replies, messages, strict=True)]
        except DeviceError as error:
            self._check_login(error)
            raise
        for request, tags in zip(requests, found, strict=True):
            self._check_application_login(request.group, tags)
        return found

    def _check_login(self, error: DeviceError) -> None:
        """Raises ChannelLost when a service was refused because the login has ended."""
        if error.result == lib.ERR_INVALID_SESSION_ID:
            self.forget_login()
            raise ChannelLost("The login on the device has ended; try again.", "closed") from None

    def _check_application_login(self, group: int, reply: bintag.Tags) -> None:
        """Raises ChannelLost when a service was refused because the login to the application has ended."""
        if _wants_application_login(group, reply):
            self.forget_application()
            raise ChannelLost("Another tool took the login to the application; try again.", "closed")

    def message(self, group: int, service: int, content: bytes) -> l7.Message:
        """A request with the id of the session, which is created when there is none."""
        return l7.Message(group, service, self.ensure(), content)

    def ensure(self) -> int:
        """Opens a channel and logs in, unless that is done. Returns the id of the session."""
        if self.is_logged_in and self._id is not None:
            return self._id
        self._id = self._application = None
        if not self.connection.is_open:
            self.connection.open()
        self._id = self._login()
        self.logins += 1
        return self._id

    @property
    def is_logged_in(self) -> bool:
        return self.connection.is_open and self._id is not None

    def forget_login(self) -> None:
        """To be called when the device has ended the session; the channel stays."""
        self._id = self._application = None

    def application(self) -> Application:
        """The login to the application on the device. Raises DeviceError when there is none."""
        self.ensure()
        if self._application is None:
            self._application = self._login_application()
        return self._application

    def forget_application(self) -> None:
        """To be called when the application on the device may have changed."""
        self._application = None

    @property
    def application_session(self) -> int:
        """The session number of the login to the application; 0 when there is none at present."""
        return self._application.session if self._application else 0

    def exclusive(self, purpose: str) -> AbstractContextManager[None]:
        """Reserves the device: other tools of this machine must wait. `purpose`, such as "downloading app.cdl", is
        shown to them. Without a gateway there are no other tools."""
        return nullcontext()

    def transferring(self, purpose: str) -> AbstractContextManager[None]:
        """Reserves the files of the device in the same way: it has one transfer at a time. Waits while another tool
        has them."""
        return nullcontext()

    def recover(self, action: Callable[[], _T], repeatable: bool = True) -> _T:
        """Runs `action`, and again on a new channel when the channel was lost.

        What is not `repeatable` is repeated only when the device did not take the request: its channel was closed, or
        the application session was no longer valid.
        """
        for left in reversed(range(_TRIES)):
            ready = False
            try:
                self.ensure()
                ready = True
                return action()
            except ChannelLost as error:
                unknown = ready and not repeatable and error.code != "closed"
                if unknown or not left or error.code == "no-answer":
                    raise
        raise AssertionError("the last try returns or raises")

    def finish(self, action: Callable[[], None], done: int) -> None:
        """Runs `action`, also again as `recover` does. A repetition that the device refuses with the result `done`
        finds that it was carried out, and only its reply was lost."""
        tries = 0

        def attempt() -> None:
            nonlocal tries
            tries += 1
            try:
                action()
            except DeviceError as error:
                if tries == 1 or error.result != done:
                    raise

        self.recover(attempt)

    def _exchange(self, request: l7.Message, patience: float, more: bool) -> bintag.Tags:
        return l7.decode_reply(self.connection.exchange(l7.encode(request), patience, more=more), request)

    def _login(self) -> int:
        """Logs in, with the password if the device has one. Returns the session id. Raises DeviceError without
        it."""
        self.password = None
        user = bintag.container(lib.TAG_DEV_CREDENTIALS, bintag.u16(lib.TAG_DEV_USER, 0))
        result, reply = self._ask_for_login(lib.DEV_CRYPT_XOR, user)
        if result == lib.ERR_NO_ACCESS_RIGHTS:
            reply = self._login_with_password(result)
        else:
            l7.check_result(result, "login")
        return reply.u32(lib.TAG_DEV_SESSION_ID)

    def _login_with_password(self, refused: int) -> bintag.Tags:
        """`refused`: the result of the login without one. A wrong password, also of a previous client, makes the
        device wait."""
        end = self.connection.now() + _PAUSE_PATIENCE
        while True:
            result, reply = self._ask_for_login(lib.DEV_CRYPT_PROOF)
            if result != lib.ERR_PENDING:  # it is not one of ours
                l7.check_result(refused, "login")
            password = self._ask_password()
            if password is None:
                raise password_needed()
            proof = proof_of(password, reply.bytes(lib.TAG_DEV_CHALLENGE, _CHALLENGE_SIZE))
            result, reply = self._ask_for_login(lib.DEV_CRYPT_PROOF, bintag.raw(lib.TAG_DEV_PROOF, proof))
            if result == lib.ERR_NOT_READY_YET:
                if self.connection.now() >= end:
                    raise password_not_taken()
                self.connection.wait(_PAUSE)
            elif result == lib.ERR_NO_ACCESS_RIGHTS:
                raise wrong_password()
            else:
                l7.check_result(result, "login")
                self.password = password
                return reply

    def _ask_for_login(self, crypt_type: int, *tags: bintag.Tag) -> tuple[int, bintag.Tags]:
        """The result of a login, and the elements with it."""
        content = bintag.encode([bintag.u32(lib.TAG_DEV_CRYPT_TYPE, crypt_type), *tags])
        request = l7.Message(lib.SG_DEVICE, lib.SRV_DEV_LOGIN, lib.L7_SESSION_INITIAL, content)
        reply = self._exchange(request, PATIENCE, more=True).container(lib.TAG_DEV_LOGIN_REPLY)
        return reply.u16(lib.TAG_DEV_LOGIN_RESULT), reply

    def _login_application(self) -> Application:
        name = bintag.text(lib.TAG_APP_LOGIN_NAME, _APPLICATION)
        tags = self.call(lib.SG_APPLICATION, lib.SRV_APP_LOGIN, [name], more=True)
        content = tags.container(lib.TAG_APP_DESCRIPTOR).bytes(lib.TAG_APP_OPTION, _LOGIN_REPLY.size)
        login = _LOGIN_REPLY.unpack(content)
        if login.result == lib.ERR_APP_NOT_EXIST:
            raise no_application()
        l7.check_result(login.result, "login to the application")
        return Application(login.session, login.data_guid)


def no_application() -> DeviceError:
    """The error of what needs an application when there is none."""
    result = lib.ERR_APP_NOT_EXIST
    return DeviceError("There is no application on the device; flash one first.", "app-not-exist", result)


def _wants_application_login(group: int, reply: bintag.Tags) -> bool:
    """Whether a service was refused because the application session is not valid any more."""
    tag = {lib.SG_APPLICATION: lib.TAG_SERVICE_RESULT, lib.SG_MONITORING2: lib.TAG_MON2_ERROR}.get(group)
    result = None if tag is None else reply.find(tag)
    return result is not None and int.from_bytes(result, "little") == lib.ERR_APP_INVALID_SESSIONID
