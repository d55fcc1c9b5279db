"""The services of a device as typed functions (codesys-v3-protocol 4.4 .. 4.10 and docs/protocol.md); monitoring has a
module of its own.

Every function takes a `Session`; requests that were lost with their channel are repeated unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial

from plctool.core import error_name, exception_name, lib
from plctool.debug.registers import Registers
from plctool.debug.trace import Trace
from plctool.errors import DeviceError
from plctool.image.file import image_crc
from plctool.link import bintag, l7
from plctool.link.ahead import ahead
from plctool.link.channel import ChannelLost
from plctool.link.connection import ERASE_PATIENCE, SLOW_PATIENCE
from plctool.link.names import version_text
from plctool.link.packing import Packer
from plctool.link.passwords import verifier_of
from plctool.link.session import Request, Session, no_application
from plctool.link.wire import Layout, signed32

_DOWNLOAD_TRIES = 4  # without any progress

_IDENT = Layout("DEV_IDENT")
_STACK = Layout("DEV_STACK")
_STATE = Layout("APP_STATE")
_LAST_EXCEPTION = Layout("APP_LAST_EXCEPTION")
_IMAGE = Layout("APP_IMAGE_IDENTITY")
_CALL = Layout("EXCEPT_CALL")
_TASK = Layout("TASK_INFO")
_LATENESS = Layout("TASK_LATENESS")
_POSITION = Layout("CDL_POSITION")
_PACKED = Layout("CDL_PACKED")
_LOG_RECORD = Layout("LOG_RECORD")


@dataclass(frozen=True)
class Identity:
    """Who the device is. `target_id` is vendor << 16 | device."""

    device_name: str
    vendor_name: str
    node_name: str
    serial_number: str
    target_type: int
    target_id: int
    version: str
    runtime_version: str


@dataclass(frozen=True)
class Stack:
    """Bytes of the device's main stack, and how many of them have never been used since its start."""

    size: int
    unused: int


class AppState(StrEnum):
    NONE = "none"
    RUN = "run"
    STOP = "stop"
    EXCEPTION = "exception"
    HALTED = "halted"


@dataclass(frozen=True)
class AppException:
    """The last exception. `code_offset` is None when it was outside the application's code, `task` an index or -1."""

    code: int
    code_offset: int | None
    task: int
    trace: Trace = field(default_factory=Trace)

    @staticmethod
    def of(code: int, code_offset: int, task: int, trace: Trace) -> AppException:
        """From an APP_EXCEPTION of the device."""
        return AppException(code, None if code_offset == lib.APP_NO_CODE_OFFSET else code_offset, task, trace)

    @property
    def name(self) -> str:
        return exception_name(self.code)


@dataclass(frozen=True)
class Status:
    """What the application does. `image_crc` is 0 without application. `forbidden`: a bit 1 << OPERATION_* for each
    operation that the program forbids now."""

    state: AppState
    image_crc: int
    image_size: int
    exception: AppException | None
    operating_state: int
    forbidden: int = 0


@dataclass(frozen=True)
class TaskInfo:
    """Statistics of a task; `kind` is KIND_* of CompactDownload.h, times in us."""

    name: str
    kind: int
    priority: int
    interval_us: int
    cycles: int
    last_us: int
    avg_us: int
    min_us: int
    max_us: int
    jitter_us: int
    overruns: int
    load_percent: int | None = None
    """Of one processor, in the last half second; None if the device does not know it."""


@dataclass(frozen=True)
class Lateness:
    """`count` starts of cycles were late by less than `below_ns`, and not by less than the class before ends."""

    below_ns: int
    count: int


@dataclass(frozen=True)
class LogEntry:
    """One line of the device's log. `time_ns` counts from the start of the runtime, `log_class` is LOG_*.

    `utc_ns` since 1970-01-01: None if the device has no clock, or it was not set. `start`: of the log that is kept, the
    number of the power-up.
    """

    handle: int
    time_ns: int
    component: str
    log_class: int
    error: int
    text: str
    utc_ns: int | None = field(default=None, compare=False)
    start: int | None = None


# ---- device ----------------------------------------------------------------------------------------------------------


def read_identity(session: Session) -> Identity:
    tags = session.recover(lambda: session.call(lib.SG_DEVICE, lib.SRV_DEV_GET_TARGET_IDENT))
    ident = _IDENT.unpack(tags.bytes(lib.TAG_DEV_IDENT, _IDENT.size))
    serial = tags.find(lib.TAG_DEV_SERIAL_NUMBER) or b"\0\0"
    return Identity(
        device_name=_wide_text(tags.bytes(lib.TAG_DEV_DEVICE_NAME, 4)),
        vendor_name=_wide_text(tags.bytes(lib.TAG_DEV_VENDOR_NAME, 4)),
        node_name=_wide_text(tags.bytes(lib.TAG_DEV_NODE_NAME, 4)),
        serial_number=serial[2 : 2 + int.from_bytes(serial[:2], "little")].decode("ascii", "replace"),
        target_type=ident.type,
        target_id=ident.id,
        version=version_text(ident.version),
        runtime_version=version_text(tags.u32(lib.TAG_DEV_RTS_VERSION)),
    )


def read_stack(session: Session) -> Stack | None:
    """What the main stack has left; None if the device does not report it."""
    tags = session.recover(lambda: session.call(lib.SG_DEVICE, lib.SRV_DEV_GET_TARGET_IDENT))
    if tags.find(lib.TAG_DEV_STACK) is None:
        return None
    stack = Stack(*_STACK.unpack(tags.bytes(lib.TAG_DEV_STACK, _STACK.size)))
    return stack if stack.size else None


def _wide_text(content: bytes) -> str:
    """A string as group 1 has them: byte length with NUL, UTF-16."""
    size = int.from_bytes(content[:4], "little")
    return content[4 : 4 + size].decode("utf-16-le", "replace").split("\0", 1)[0]


def echo(session: Session, data: bytes) -> bytes:
    """What the device sends back for `data`; equal when the line is well. `data` must fit a message."""
    (reply,) = session.recover(lambda: session.call_each([echo_request(data)]))
    return reply.bytes(lib.TAG_DEV_ECHO_DATA)


def echo_request(data: bytes) -> Request:
    """What `echo` asks for."""
    tags = [
        bintag.u32(lib.TAG_DEV_ECHO_LENGTH, len(data)),
        bintag.u32(lib.TAG_DEV_ECHO_REPLY_LENGTH, len(data)),
        bintag.raw(lib.TAG_DEV_ECHO_DATA, data),
    ]
    return Request(lib.SG_DEVICE, lib.SRV_DEV_ECHO, tags)


def set_password(session: Session, password: str | None) -> None:
    """Sets the password of the device, or removes it. Other logins end. Raises UsageError for a password that is too
    short or too long, DeviceError when the device does not take it, as one that has no passwords."""
    look(session)
    tags = [bintag.raw(lib.TAG_USER_VERIFIER, verifier_of(password))]
    try:
        call = partial(session.call, lib.SG_USERMGR, lib.SRV_USER_SET_CREDENTIALS, tags, SLOW_PATIENCE)
        reply = session.recover(call, repeatable=False)
    except DeviceError as error:
        if error.result not in (lib.ERR_L7_UNKNOWNCMDGROUP, lib.ERR_L7_UNKNOWNCMD):
            raise
        raise DeviceError(
            "The firmware of this device has no passwords; build one with COMM_PASSWORD (docs/porting.md).",
            "no-passwords",
            error.result,
        ) from None
    l7.check_result(reply.u16(lib.TAG_SERVICE_RESULT), "password")


# ---- application -----------------------------------------------------------------------------------------------------


_READ_STATUS = Request(lib.SG_APPLICATION, lib.SRV_APP_READ_STATUS)


def read_status(session: Session) -> Status:
    return _status_of(session.recover(lambda: session.call(lib.SG_APPLICATION, lib.SRV_APP_READ_STATUS)))


def _status_of(tags: bintag.Tags) -> Status:
    status = tags.container(lib.TAG_APP_STATUS)
    state = _STATE.unpack(status.bytes(lib.TAG_APP_STATE, _STATE.size))
    l7.check_result(state.result, "status")
    last = _LAST_EXCEPTION.unpack(status.bytes(lib.TAG_APP_LAST_EXCEPTION, _LAST_EXCEPTION.size))
    image = _IMAGE.unpack(status.bytes(lib.TAG_APP_IMAGE, _IMAGE.size))
    exception = None
    if last.code != lib.RTSEXCPT_NOEXCEPTION:
        trace = Trace.of(_CALL.unpack_each(status.find(lib.TAG_APP_CALLS) or b""))
        exception = AppException.of(last.code, last.code_offset, signed32(last.task), trace)
    forbidden = 0 if status.find(lib.TAG_APP_FORBIDDEN) is None else status.u32(lib.TAG_APP_FORBIDDEN)
    state_now = app_state(state.state, state.op_state)
    return Status(state_now, image.crc, image.size, exception, state.op_state, forbidden)


def app_state(state: int, operating: int) -> AppState:
    """From AS_* and the OS_* flags."""
    if operating & lib.OS_EXCEPTION:
        return AppState.EXCEPTION
    known = {lib.AS_NONE: AppState.NONE, lib.AS_RUN: AppState.RUN, lib.AS_HALT_ON_BP: AppState.HALTED}
    return known.get(state, AppState.STOP)


def start(session: Session) -> None:
    """Starts the application. Not again when no reply came and it is stopped with an exception: a controller that went
    down with it, and came back, would start the previous one."""
    look(session)
    start_checked(session)


def start_checked(session: Session) -> Status:
    """As `start`, on a channel that has just been used. Returns the status after it, which is asked for at once."""
    try:
        started, status = session.call_each([_control_request(session, lib.SRV_APP_START), _READ_STATUS], SLOW_PATIENCE)
        _check_control(started, "start")
        return _status_of(status)
    except ChannelLost:
        found = read_status(session)
    if found.exception is not None:
        message = "No reply came to the start, and the program is stopped with an exception; see the log."
        raise DeviceError(message, "died")
    if found.state is not AppState.RUN:
        _check_control(_control(session, lib.SRV_APP_START), "start")
    return read_status(session)


def look(session: Session) -> None:
    """Before what is waited for longer: a channel that was lost is opened again here, and a device that is gone is
    noticed."""
    read_status(session)


def create_boot_project(session: Session) -> None:
    """Makes the application what starts at power-up."""
    look(session)

    def request() -> bintag.Tags:
        number = bintag.u32(lib.TAG_APP_SESSION, session.application().session)
        return session.call(lib.SG_APPLICATION, lib.SRV_APP_CREATE_BOOTPROJECT, [number], SLOW_PATIENCE)

    try:
        reply = session.recover(request)
    except DeviceError as error:
        if error.result != lib.ERR_L7_UNKNOWNCMD:
            raise
        return  # each download is the boot project
    _check_control(reply, "boot project")


def stop(session: Session) -> None:
    look(session)
    _check_control(session.recover(partial(_control, session, lib.SRV_APP_STOP)), "stop")


def cycle(session: Session) -> None:
    """Runs one cycle of each task of an application that is stopped. Not again when no reply came: it may have run."""
    look(session)
    try:
        reply = session.recover(partial(_control, session, lib.SRV_APP_SINGLE_CYCLE), repeatable=False)
    except DeviceError as error:
        if error.result != lib.ERR_L7_UNKNOWNCMD:
            raise
        raise DeviceError(
            "The firmware of this device has no single cycle; SRV_OTHER_CLIENTS gives it (docs/compatibility.md).",
            "no-single-cycle",
            error.result,
        ) from None
    _check_control(reply, "cycle")


def end_all_forces(session: Session) -> None:
    """Ends the force of all variables."""
    reply = session.recover(partial(_control, session, lib.SRV_APP_RELEASE_FORCE_LIST))
    _check_control(reply, "unforce")


def _area_address(session: Session, area: int) -> bytes | None:
    """Where a memory area begins, as many bytes as a pointer has; None from a firmware that does not say it."""

    def request() -> bintag.Tags:
        number = session.application().session
        tags = [bintag.u32(lib.TAG_APP_SESSION, number), bintag.u32(lib.TAG_APP_AREA, area)]
        return session.call(lib.SG_APPLICATION, lib.SRV_APP_GET_AREA_ADDRESS, tags)

    try:
        return session.recover(request).find(lib.TAG_APP_AREA_ADDRESS)
    except DeviceError as error:
        if error.result in (lib.ERR_L7_UNKNOWNCMD, lib.ERR_APP_MAPPED_AREA_NOT_FOUND):
            return None
        raise


def area_address(session: Session, area: int) -> int:
    """What pointers to the beginning of a memory area contain; 0 from a firmware that does not say it."""
    return int.from_bytes(_area_address(session, area) or b"", "little")


def pointer_size(session: Session) -> int:
    """Bytes of an address on the processor of the device; 4 from a firmware that does not say it."""
    return len(_area_address(session, lib.APP_AREA_DATA) or bytes(4))


def reset(session: Session, option: int) -> None:
    """`option` is RESET_OPTION_*; origin deletes the application."""
    look(session)
    which = bintag.u32(lib.TAG_APP_OPTION, option)
    done = lib.ERR_APP_NOT_EXIST if option == lib.RESET_OPTION_ORIGIN else lib.ERR_OK
    session.finish(lambda: _check_control(_control(session, lib.SRV_APP_RESET, which), "reset"), done)
    session.forget_application()


def _control(session: Session, service: int, *options: bintag.Tag) -> bintag.Tags:
    request = _control_request(session, service, *options)
    return session.call(request.group, request.service, request.tags, SLOW_PATIENCE)


def _control_request(session: Session, service: int, *options: bintag.Tag) -> Request:
    number = bintag.u32(lib.TAG_APP_SESSION, session.application().session)
    return Request(lib.SG_APPLICATION, service, [bintag.container(lib.TAG_APP_DESCRIPTOR, number, *options)])


def _check_control(reply: bintag.Tags, action: str) -> None:
    l7.check_result(reply.u16(lib.TAG_SERVICE_RESULT), action, reply.text(lib.TAG_APP_REASON))


def read_application_info(session: Session) -> dict[str, str]:
    """Project, version, author, description and profile, as far as they are given."""
    tags = session.recover(lambda: session.call(lib.SG_APPLICATION, lib.SRV_APP_READ_APPLICATION_INFO))
    fields = {
        "project": lib.TAG_APP_INFO_PROJECT,
        "version": lib.TAG_APP_INFO_VERSION,
        "author": lib.TAG_APP_INFO_AUTHOR,
        "description": lib.TAG_APP_INFO_DESCRIPTION,
        "profile": lib.TAG_APP_INFO_PROFILE,
    }
    return {name: text for name, tag in fields.items() if (text := tags.text(tag))}


def read_tasks(session: Session) -> list[TaskInfo]:
    tags = session.recover(lambda: session.call(lib.SG_APPLICATION, lib.SRV_APP_READ_TASK_INFO))
    tasks = []
    for tag, content in tags:
        if tag == lib.TAG_TASK_INFO and isinstance(content, bytes) and len(content) >= _TASK.size:
            name = content[_TASK.size :].split(b"\0", 1)[0].decode(errors="replace")
            tasks.append(TaskInfo(name, *_TASK.unpack(content)))
        elif tag == lib.TAG_TASK_LOAD and isinstance(content, bytes) and len(content) == 4 and tasks:
            tasks[-1] = replace(tasks[-1], load_percent=int.from_bytes(content, "little"))
    return tasks


def read_registers(session: Session, pointer_size: int) -> Registers | None:
    """The registers of the processor at the fault that stopped the program; None if the device does not know them."""
    try:
        tags = session.recover(lambda: session.call(lib.SG_APPLICATION, lib.SRV_APP_READ_REGISTERS))
    except DeviceError as error:
        if error.result != lib.ERR_L7_UNKNOWNCMD:
            raise
        return None
    content = tags.find(lib.TAG_APP_REGISTERS)
    return None if content is None else Registers.of_words(content, pointer_size)


def read_lateness(session: Session) -> list[list[Lateness]]:
    """The classes of each task in which starts of cycles were counted, tasks in the order of `read_tasks`."""
    try:
        tags = session.recover(lambda: session.call(lib.SG_APPLICATION, lib.SRV_APP_READ_TASK_LATENESS))
    except DeviceError as error:
        if error.result != lib.ERR_L7_UNKNOWNCMD:
            raise
        raise DeviceError(
            "The firmware of this device does not count how late cycles begin. Build it with IEC_LATENESS; "
            "'plctool tasks' shows the latest one.",
            "no-lateness",
            error.result,
        ) from None
    tasks = []
    for tag, content in tags:
        if tag == lib.TAG_TASK_LATENESS and isinstance(content, bytes):
            starts = range(0, len(content) - _LATENESS.size + 1, _LATENESS.size)
            tasks.append([Lateness(*_LATENESS.unpack(content[at : at + _LATENESS.size])) for at in starts])
    return tasks


# ---- download --------------------------------------------------------------------------------------------------------

_BLOCK_OVERHEAD = 44  # layer 7 header and tags around the data of a block, bytes
_PACKED_SIZE = 8192  # of packed data at most, bytes
_FIRST_PACKED_SIZE = 900  # of the first message: the line need not wait for a long search, and is busy during the next
_PACKED_AHEAD = 2  # blocks that are packed while the line carries others
_SHARING = 4  # blocks for which one reply does, on a bus
_BLOCK_ALIGN = 16  # flash is written best in whole program units


@dataclass(frozen=True)
class Prepared:
    """What a device has said before a download: the `arrived` bytes of this image that it has, and how many bytes of it
    a packed block may be; 0: it cannot unpack. `changes`: whether its firmware knows online changes."""

    arrived: int
    unpacks: int
    changes: bool = False
    tries: bool = False


def prepare_download(session: Session, image: bytes) -> tuple[Status, Prepared]:
    """The status, and what `download` of this image asks first, in one go."""
    requests = [_READ_STATUS, _question(image)]
    status, answer = session.recover(lambda: session.call_each(requests, more=True))
    return _status_of(status), _prepared(answer)


def _question(image: bytes) -> Request:
    """How much of this image the device has; all of it when it is the application already."""
    position = _position(image, lib.DLF_CONTINUEDOWNLOAD, 0)
    return Request(lib.SG_APPLICATION, lib.SRV_APP_DOWNLOAD_COMPACT, [position])


def _prepared(answer: bintag.Tags) -> Prepared:
    unpacks = 0 if answer.find(lib.TAG_CDL_UNPACKS) is None else answer.u32(lib.TAG_CDL_UNPACKS)
    changes, tries = (answer.find(tag) is not None for tag in (lib.TAG_CDL_CHANGES, lib.TAG_CDL_TRIES))
    return Prepared(_arrived(answer), unpacks, changes, tries)


def _position(image: bytes, flags: int, offset: int) -> bintag.Tag:
    content = _POSITION.pack(flags=flags, offset=offset, total_size=len(image), crc=image_crc(image))
    return bintag.raw(lib.TAG_CDL_POSITION, content)


def _arrived(tags: bintag.Tags) -> int:
    l7.check_result(tags.u16(lib.TAG_SERVICE_RESULT), "download", tags.text(lib.TAG_CDL_REASON))
    return tags.u32(lib.TAG_CDL_NEXT)


def download(
    session: Session,
    image: bytes,
    restart: bool = False,
    progress: Callable[[int], None] = lambda done: None,
    prepared: Prepared | None = None,
    *,
    start: bool = False,
    change: bool = False,
    boot: bool | None = None,
) -> None:
    """Sends an image; the device checks it and makes it its application, stopped. With `start` the device also starts
    it, unless its firmware is older than `DLF_START`: the status shows that. `change`: it takes the place of the one
    that runs, between two cycles. `boot`: whether it is the boot project; None: as a setting of the device says.

    Continues an aborted transfer of the same image, also automatically after the channel was lost; `restart`
    begins at the first byte in any case. `progress` is called with the bytes that have arrived. Raises DeviceError with
    the device's reason when it refuses the image; its old application is untouched then. `prepared`: what
    `prepare_download` has just found.
    """
    transfer = _Transfer(session, image, start, change, boot, progress)
    tries = 0
    while True:
        arrived = transfer.arrived
        try:
            start_at = transfer.begin(prepared)
            prepared = None
            if transfer.sent_all and arrived and not start_at:
                raise went_down()  # and would do so again
            if restart:
                start_at, restart = 0, False
            if start_at < len(image):
                transfer.run(start_at)
            session.forget_application()
            return
        except ChannelLost:
            tries = tries + 1 if transfer.arrived <= arrived else 0
            if tries == _DOWNLOAD_TRIES:
                raise


def went_down() -> DeviceError:
    """The error of a new program that is not on the device any more."""
    return DeviceError(
        "The controller went down when it had the new program, and has the previous one; see the log.", "died"
    )


class _Transfer:
    """One image on its way. `arrived` is the number of bytes the device has confirmed; `sent_all`: since the channel
    was opened, all blocks have been sent."""

    def __init__(
        self,
        session: Session,
        image: bytes,
        start: bool,
        change: bool,
        boot: bool | None,
        progress: Callable[[int], None],
    ) -> None:
        self.arrived = 0
        self.sent_all = False
        self._flags = lib.DLF_CHANGE if change else lib.DLF_START if start else 0
        if boot is not None:
            self._flags |= lib.DLF_WRITEBOOTAPPLICATION if boot else lib.DLF_TRY
        self._session = session
        self._image = image
        self._progress = progress
        self._unpacks = 0  # bytes of the image that a packed block may be; 0: the device cannot unpack

    def begin(self, prepared: Prepared | None) -> int:
        """Where to begin; asks the device, unless that is known."""
        if prepared is None:
            question = _question(self._image)
            prepared = _prepared(self._session.call(question.group, question.service, question.tags))
        if self._flags & lib.DLF_CHANGE and not prepared.changes:
            raise DeviceError("The firmware of this device knows no online change; download the program.", "no-change")
        if self._flags & lib.DLF_TRY and not prepared.tries:
            message = "The firmware of this device makes each download the boot project; flash without --no-boot."
            raise DeviceError(message, "no-boot")
        self._unpacks = prepared.unpacks
        self._take(prepared.arrived)
        return self.arrived

    def run(self, start_at: int) -> None:
        """Sends everything from `start_at` on and waits for the verdict."""
        self.sent_all = False
        self._session.ensure()
        request = self._session.message(lib.SG_APPLICATION, lib.SRV_APP_DOWNLOAD_COMPACT, b"")
        connection = self._session.connection
        messages = self._messages(start_at)
        for reply in connection.stream(messages, ERASE_PATIENCE, sharing=connection.is_bus, more=True):
            self._take(_arrived(l7.decode_reply(reply, request)))
        if self.arrived != len(self._image):
            raise DeviceError(f"The device took {self.arrived} of {len(self._image)} bytes; try again.", "incomplete")

    def _messages(self, start_at: int) -> Iterator[bytes]:
        offset = start_at
        for number, (data, size) in enumerate(self._blocks(start_at), 1):
            flags = self._flags | (lib.DLF_CONTINUEDOWNLOAD if offset else 0)
            if self._session.connection.is_bus and number % _SHARING and offset + size < len(self._image):
                flags |= lib.DLF_REPLYMAYWAIT
            position = _position(self._image, flags, offset)
            content = bintag.encode([position, data])
            self.sent_all = offset + size == len(self._image)
            yield l7.encode(self._session.message(lib.SG_APPLICATION, lib.SRV_APP_DOWNLOAD_COMPACT, content))
            offset += size

    def _blocks(self, start_at: int) -> Iterator[tuple[bintag.Tag, int]]:
        """What the messages carry, and of how many bytes of the image; packed if that pays."""
        room = self._session.connection.best_size - _BLOCK_OVERHEAD
        if self._session.connection.is_slow and self._unpacks:
            return self._packed_blocks(start_at, room, self._unpacks)
        return self._plain_blocks(start_at, room // _BLOCK_ALIGN * _BLOCK_ALIGN)

    def _plain_blocks(self, start_at: int, longest: int) -> Iterator[tuple[bintag.Tag, int]]:
        for offset in range(start_at, len(self._image), longest):
            part = self._image[offset : offset + longest]
            yield bintag.raw(lib.TAG_CDL_DATA, part), len(part)

    def _packed_blocks(self, start_at: int, room: int, longest: int) -> Iterator[tuple[bintag.Tag, int]]:
        offset = start_at
        most = min(room - _PACKED.size, _PACKED_SIZE)
        blocks = Packer(self._image).blocks(start_at, most, longest, _FIRST_PACKED_SIZE)
        for block in ahead(blocks, _PACKED_AHEAD):
            if len(block.data) + _PACKED.size < block.size:
                yield bintag.raw(lib.TAG_CDL_PACKED, _PACKED.pack(unpacked=block.size) + block.data), block.size
            else:
                yield bintag.raw(lib.TAG_CDL_DATA, self._image[offset : offset + block.size]), block.size
            offset += block.size

    def _take(self, arrived: int) -> None:
        self.arrived = arrived
        self._progress(arrived)


# ---- PLC shell -------------------------------------------------------------------------------------------------------


def run_shell(session: Session, command: str) -> str:
    """The answer of a device to a command of its PLC shell. Raises DeviceError when it has none, or refuses it."""
    answer, block = "", 0

    def ask() -> bintag.Tags:
        content = [
            bintag.u32(lib.TAG_SHELL_SESSION, session.ensure()),
            bintag.u32(lib.TAG_SHELL_BLOCK, block),
            bintag.text(lib.TAG_SHELL_COMMAND, command),
        ]
        return session.call(lib.SG_PLCSHELL, lib.SRV_SHELL_EXECUTE, content)

    while True:
        tags = session.recover(ask, repeatable=False)  # it may do something
        parts = tags.containers(lib.TAG_SHELL_PART)
        last = parts or tags.containers(lib.TAG_SHELL_LAST)
        text = "".join(part.text(lib.TAG_SHELL_TEXT) for part in last)
        _check_shell(command, last, text.strip())
        answer, block = answer + text, block + 1
        if not parts or not text:
            return answer.replace("\r\n", "\n").rstrip("\n")


def _check_shell(command: str, parts: Sequence[bintag.Tags], text: str) -> None:
    """Raises DeviceError if a part of the answer has the error of a command that is refused."""
    results = [part.u16(lib.TAG_SHELL_RESULT) for part in parts if part.find(lib.TAG_SHELL_RESULT) is not None]
    for result in results:
        if result == lib.ERR_APP_NOT_LOADED:
            raise no_application()
        if result in (lib.ERR_NO_OBJECT, lib.ERR_NO_ACCESS_RIGHTS):  # the device says it in words
            raise DeviceError(text, l7.slug(error_name(result)), result)
        words = text.removeprefix(f"{command}: ")
        l7.check_result(result, command, "" if words.startswith("error ") else words)


# ---- log -------------------------------------------------------------------------------------------------------------


_LAST_HANDLE = 0xFFFFFFFF
KEPT_LOG = "KeptLog"  # LOG_KEPT_NAME
NO_KEPT_LOG = "This device keeps no log over power-off. Build its firmware with LOG_KEEP and HAS_CmpLogKeep."


def read_log(session: Session, after: int = 0, kept: bool = False) -> list[LogEntry]:
    """The entries that the device still has with a handle above `after`, oldest first. `kept`: of the log that
    outlasts power-off. Raises DeviceError if the device has none."""
    entries: list[LogEntry] = []
    while after < _LAST_HANDLE and (batch := session.recover(partial(_read_log_batch, session, after + 1, kept))):
        entries += batch
        after = batch[-1].handle
    return entries


def _read_log_batch(session: Session, start_handle: int, kept: bool) -> list[LogEntry]:
    choice = bintag.text(lib.TAG_LOG_NAME, KEPT_LOG) if kept else bintag.u32(lib.TAG_LOG_CLOCK, 1)
    tags = session.call(
        lib.SG_LOG, lib.SRV_LOG_GET_ENTRIES, [bintag.u32(lib.TAG_LOG_START_HANDLE, start_handle), choice]
    )
    if kept and tags.find(lib.TAG_LOG_NAME) is None:
        raise DeviceError(NO_KEPT_LOG, "no-kept-log")
    clock = _number64(tags.find(lib.TAG_LOG_CLOCK))
    entries = []
    for record in tags.containers(lib.TAG_LOG_RECORD):
        entry = _LOG_RECORD.unpack(record.bytes(lib.TAG_LOG_ENTRY, _LOG_RECORD.size))
        handle = record.u32(lib.TAG_LOG_HANDLE)
        if handle >= start_handle:
            time_ns = int.from_bytes(record.bytes(lib.TAG_LOG_TIME_NS, 8)[:8], "little", signed=True)
            component = record.text(lib.TAG_LOG_COMPONENT_NAME)
            text = record.text(lib.TAG_LOG_TEXT)
            utc_ns = (_number64(record.find(lib.TAG_LOG_UTC_NS)) or None) if clock is None else clock + time_ns
            start = record.u32(lib.TAG_LOG_START) if kept else None
            entries.append(LogEntry(handle, time_ns, component, entry.log_class, entry.error, text, utc_ns, start))
    return entries


def _number64(data: bytes | None) -> int | None:
    return None if data is None or len(data) < 8 else int.from_bytes(data[:8], "little", signed=True)
