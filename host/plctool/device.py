"""A controller on a link: flash, start, stop, watch. `with plctool.connect("serial:/dev/ttyS0") as plc: ...`"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, overload

from plctool.core import lib
from plctool.debug.kept_changes import KeptChanges, kept_changes
from plctool.debug.symbols import SourceLine, SymbolTable, cache_path, find_symbols, load_symbols, symbol_path
from plctool.debug.variables import Reading, Symbol, unreachable
from plctool.errors import DeviceError, LinkError, UsageError
from plctool.files import read_image
from plctool.gateway.client import GatewayConnection, GatewaySession, connect_gateway
from plctool.gateway.control import dismiss_idle
from plctool.gateway.frames import BUSY
from plctool.gateway.place import NoGateway
from plctool.image.file import parse_image
from plctool.link import services
from plctool.link.connection import SCAN_SECONDS, Connection, MessageLink
from plctool.link.monitoring import AreaRange, Contents, Write, read_memory, write_memory
from plctool.link.names import Node
from plctool.link.serial import DEFAULT_BAUD, SerialTransport
from plctool.link.services import AppState, Identity, LogEntry, Stack, TaskInfo
from plctool.link.session import Session
from plctool.link.transport import BlockTransport

RESET_OPTIONS = {
    "warm": lib.RESET_OPTION_WARM,
    "cold": lib.RESET_OPTION_COLD,
    "origin": lib.RESET_OPTION_ORIGIN,
}
_BUSY_POLL = 0.2  # shortest time between two looks at a device that another tool keeps to itself [s]


@dataclass(frozen=True)
class ExceptionInfo:
    """What stopped the program. `task` is None for initialisation code; the place is None without symbols. `calls`
    led there, the nearest first."""

    code: int
    name: str
    task: str | None
    pou: str | None = None
    file: str | None = None
    line: int | None = None
    calls: list[SourceLine] = field(default_factory=list)

    def __str__(self) -> str:
        task = f" in task {self.task}" if self.task else ""
        place = f", {self.pou}, {self.file}:{self.line}" if self.file else ""
        calls = "".join(f", called from {c.pou}, {c.file}:{c.line}" for c in self.calls)
        return f"{self.name}{task}{place}{calls}"


@dataclass(frozen=True)
class PlcStatus:
    """`state` is "run", "stop", "exception" or "none"; `image_crc` is 0 without application."""

    state: AppState
    image_crc: int
    image_size: int
    exception: ExceptionInfo | None


@dataclass(frozen=True)
class FlashResult:
    """`skipped`: the device had this very image already. `seconds` is the time the transfer took. `persistent`: what
    became of PERSISTENT values, None when the symbols of one of the programs are not there."""

    bytes: int
    seconds: float
    skipped: bool
    state: AppState
    persistent: KeptChanges | None = None


@dataclass(frozen=True)
class OtherTool:
    """Another tool of this machine that uses the same line: how its user called it, and its process number."""

    tool: str
    pid: int

    def __str__(self) -> str:
        return f"{self.tool} (pid {self.pid})"


def connect(
    link: str,
    baud: int = DEFAULT_BAUD,
    symbols: Path | str | None = None,
    *,
    gateway: bool | None = None,
    tool: str | None = None,
) -> Plc:
    """Opens a link to a controller, such as "serial:/dev/ttyS0" or "serial:socket://host:port".

    `symbols` names a symbol file when it is neither in the cache nor beside the image. A serial port of this machine is
    shared with other tools through a gateway where there can be one; with `gateway` false, or PLCTOOL_GATEWAY=off, it
    is opened by this process and locked. `tool` is what other tools are told this one is. Raises LinkError when the
    link cannot be opened; whether a controller answers shows with the first call.
    """
    return Plc(_open_link(link, baud, gateway, tool), Path(symbols) if symbols else None)


def scan(
    link: str,
    baud: int = DEFAULT_BAUD,
    seconds: float = SCAN_SECONDS,
    *,
    gateway: bool | None = None,
    tool: str | None = None,
) -> list[Node]:
    """The controllers that answer on a link within `seconds`. Raises LinkError when there are none."""
    connection = _open_link(link, baud, gateway, tool)
    try:
        nodes = connection.scan(seconds)
        if not nodes:
            raise LinkError(f"No device answers on {connection.name}; check cable, baud rate and power.", "no-answer")
        return nodes
    finally:
        connection.close()


def _open_link(link: str, baud: int, gateway: bool | None, tool: str | None) -> MessageLink:
    """A way to the device, through a gateway where that is possible and wanted."""
    kind, _, port = link.partition(":")
    if kind == "serial" and port:
        if gateway is None:
            gateway = os.environ.get("PLCTOOL_GATEWAY", "on").lower() not in ("off", "no", "0")
        if gateway:
            with suppress(NoGateway):
                return connect_gateway(port, baud, tool or Path(sys.argv[0]).name or "Python")
        else:
            dismiss_idle(port)
    return Connection(open_transport(link, baud))


def open_transport(link: str, baud: int = DEFAULT_BAUD) -> BlockTransport:
    """The block transport a link names."""
    kind, separator, address = link.partition(":")
    if separator and kind == "serial" and address:
        return SerialTransport(address, baud)
    if separator and kind in ("can", "udp", "tcp"):
        raise UsageError(f"Links over {kind} are not in this version; use a serial line (--port).", "no-such-link")
    raise UsageError(f"'{link}' is not a link; write for example serial:/dev/ttyS0.", "no-such-link")


class Plc:
    """One controller. Channel and login are made at the first call and renewed by themselves."""

    def __init__(self, connection: MessageLink, symbols: Path | None = None) -> None:
        self._connection = connection
        self._session = GatewaySession(connection) if isinstance(connection, GatewayConnection) else Session(connection)
        self._symbol_file = symbols
        self._table: SymbolTable | None = None

    def __enter__(self) -> Plc:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        self._connection.close()

    def others(self) -> list[OtherTool]:
        """The other tools that use the line at present; none when this process has it to itself."""
        if not isinstance(self._connection, GatewayConnection):
            return []
        return [OtherTool(tool, pid) for tool, pid in self._connection.others()]

    # ---- the device ----

    def identity(self) -> Identity:
        """Name, vendor, target and versions of the controller."""
        return services.read_identity(self._session)

    def stack(self) -> Stack | None:
        """What the main stack of the controller has left; None when it does not tell."""
        return services.read_stack(self._session)

    def info(self) -> dict[str, str]:
        """Project, author, version and so on, of the application."""
        return services.read_application_info(self._session)

    def log(self, after: int = 0) -> list[LogEntry]:
        """The log entries with a handle above `after` that the controller still has, oldest first."""
        return services.read_log(self._session, after)

    # ---- the application ----

    def flash(
        self,
        image: Path | str | bytes,
        *,
        start: bool = True,
        force: bool = False,
        unchecked: bool = False,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> FlashResult:
        """Replaces the application and starts it. The old one runs until the new one has arrived and passed all checks.

        `force`: also when the controller has this very image already. `unchecked`: without a look at the image here;
        the controller checks it anyway. `progress` gets the bytes that have arrived and their total. Other tools are
        kept away meanwhile; raises LinkError when one of them is downloading.
        """
        data = image if isinstance(image, bytes) else read_image(Path(image))
        if not unchecked:
            parse_image(data)
        what = "a program" if isinstance(image, bytes) else Path(image).name
        with self._session.exclusive(f"downloading {what}"):
            return self._flash(image, data, start, force, unchecked, progress)

    def _flash(
        self,
        image: Path | str | bytes,
        data: bytes,
        start: bool,
        force: bool,
        unchecked: bool,
        progress: Callable[[int, int], None],
    ) -> FlashResult:
        crc = int.from_bytes(data[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4], "little")
        status = services.read_status(self._session)
        is_there = (status.image_crc, status.image_size) == (crc, len(data))
        if not isinstance(image, bytes):
            _keep_symbols(Path(image), crc)
        skipped = is_there and status.exception is None and not force and not unchecked
        begin = self._connection.now()
        if not skipped:
            afresh = is_there or unchecked
            services.download(self._session, data, afresh, lambda done: progress(done, len(data)))
            self._verify(crc)
        seconds = self._connection.now() - begin
        persistent = None if skipped else self._kept_changes(status.image_crc, crc)
        if start and not (skipped and status.state is AppState.RUN):
            services.start(self._session)
        return FlashResult(len(data), seconds, skipped, services.read_status(self._session).state, persistent)

    def _kept_changes(self, before: int, after: int) -> KeptChanges | None:
        """By the CRCs of both images."""
        with suppress(UsageError):
            return kept_changes(find_symbols(before).kept, find_symbols(after).kept)
        return None

    def _verify(self, crc: int) -> None:
        found = services.read_status(self._session).image_crc
        if found != crc:
            raise DeviceError(f"The device has image {found:08X} instead of {crc:08X}; flash again.", "verify")

    def start(self) -> None:
        services.start(self._session)

    def stop(self) -> None:
        services.stop(self._session)

    def reset(self, option: str = "warm") -> None:
        """Stops it; `warm` keeps RETAIN variables, `cold` only PERSISTENT ones, `origin` deletes the application."""
        if option not in RESET_OPTIONS:
            raise UsageError(f"There is no reset '{option}'; choose one of {', '.join(RESET_OPTIONS)}.", "bad-reset")
        services.reset(self._session, RESET_OPTIONS[option])

    def status(self) -> PlcStatus:
        status = services.read_status(self._session)
        exception = self._explain(status) if status.exception else None
        return PlcStatus(status.state, status.image_crc, status.image_size, exception)

    def _explain(self, status: services.Status) -> ExceptionInfo:
        """Adds the names and places that the symbols know."""
        assert status.exception
        try:
            table = self._symbols_of(status.image_crc)
        except UsageError:
            table = None
        task = None
        with suppress(DeviceError):  # a device may be built without task information
            task = next((t.name for i, t in enumerate(self.tasks()) if i == status.exception.task), None)
        return explain_exception(status.exception, task, table)

    def tasks(self) -> list[TaskInfo]:
        """Statistics of the tasks."""
        return services.read_tasks(self._session)

    # ---- variables ----

    def symbols(self) -> SymbolTable:
        """The symbols of the application on the controller. Raises UsageError when they cannot be found."""
        application = self._session.recover(self._session.application)
        return self._symbols_of(application.image_crc)

    def _symbols_of(self, image_crc: int) -> SymbolTable:
        if self._table is None or self._table.image_crc != image_crc:
            self._table = self._find_symbols(image_crc)
        return self._table

    def _find_symbols(self, image_crc: int) -> SymbolTable:
        if self._symbol_file is None:
            return find_symbols(image_crc)
        table = load_symbols(self._symbol_file)
        if table.image_crc != image_crc:
            raise UsageError(
                f"{self._symbol_file} belongs to another image than the one on the device (CRC {image_crc:08X}); "
                "name its own symbol file.",
                "wrong-symbols",
            )
        return table

    @overload
    def read(self, name: str, /) -> Any: ...
    @overload
    def read(self, name: str, other: str, /, *more: str) -> dict[str, Any]: ...
    def read(self, *names: str) -> Any:
        """The value of one variable, or the values of several by the names given."""
        values = self.read_all(names)
        return values if len(names) > 1 else values[names[0]]

    def read_all(self, names: Sequence[str]) -> dict[str, Any]:
        """Values by name. Structs and arrays come as dicts and lists, TIME as text."""
        return self.sample(names).values

    def sample(self, names: Sequence[str]) -> Reading:
        """The variables with these names as they are now; of one moment between two cycles if the reading says so.

        Pointers are followed by the controller. Raises DeviceError when one leads to no variable.
        """
        table = self.symbols()
        reading = self._sample(table, names)
        reading.check(lambda pointer: self._read(table, [pointer]).values[0])
        return reading

    def _sample(self, table: SymbolTable, names: Sequence[str]) -> Reading:
        symbols = {name: table.resolve(name) for name in names}
        contents = self._read(table, list(symbols.values()))
        return Reading(symbols, dict(zip(symbols, contents.values, strict=True)), contents.consistent)

    def _read(self, table: SymbolTable, symbols: Sequence[Symbol]) -> Contents:
        """Raises DeviceError when the symbols are no longer those of the application."""
        ranges = [_range(symbol) for symbol in symbols if symbol.fixed is None]
        contents = read_memory(self._session, table.image_crc, ranges)
        read = iter(contents.values)
        return Contents([next(read) if s.fixed is None else s.fixed for s in symbols], contents.consistent)

    def write(self, values: Mapping[str, Any]) -> None:
        """Sets variables, by one message if they fit; texts such as 'T#80ms' are understood. Of a single bit the
        controller leaves the rest of its byte alone."""
        table = self.symbols()
        named = [(table.resolve(name), value) for name, value in values.items()]
        for symbol, _ in named:
            symbol.check_writable(symbol.area)
        changes = [(_range(symbol), symbol.change(value)) for symbol, value in named]
        try:
            write_memory(
                self._session,
                table.image_crc,
                [Write(place.part(c.offset, len(c.data)), c.data, c.mask) for place, c in changes],
            )
        except DeviceError:
            self._check_reachable(table, [symbol for symbol, _ in named if symbol.pointer is not None])
            raise

    def _check_reachable(self, table: SymbolTable, symbols: Sequence[Symbol]) -> None:
        """Raises DeviceError when a pointer to one of the variables leads to no variable."""
        for symbol, data in zip(symbols, self._read(table, symbols).values if symbols else (), strict=True):
            if data is None:
                raise unreachable(symbol, lambda pointer: self._read(table, [pointer]).values[0])

    def watch(
        self,
        names: Sequence[str],
        interval: float = 0.5,
        count: int | None = None,
        waiting: Callable[[str], None] = lambda reason: None,
    ) -> Iterator[tuple[float, Reading]]:
        """Reads again and again: yields seconds since the first reading, and what was read. Endless without `count`.

        Pointers are followed anew each time; a value whose pointer leads to no variable is None. While another
        tool downloads a program there are no readings; `waiting` is called with the reason at the begin of that.
        """
        begin = time.monotonic()
        due, readings, waits = begin, 0, False
        while count is None or readings < count:
            time.sleep(max(0.0, due - time.monotonic()))
            due += interval
            at = time.monotonic() - begin
            try:
                reading = self._sample(self.symbols(), names)
            except LinkError as error:
                if error.code != BUSY:
                    raise
                if not waits:
                    waiting(error.message)
                waits, due = True, max(due, time.monotonic() + _BUSY_POLL)
            else:
                waits, readings = False, readings + 1
                yield at, reading


def explain_exception(exception: services.AppException, task: str | None, table: SymbolTable | None) -> ExceptionInfo:
    """The exception with the source lines that `table` knows for it."""
    places = table.call_stack(exception.code_offset, exception.trace) if table else []
    if not places:
        return ExceptionInfo(exception.code, exception.name, task)
    place = places[0]
    return ExceptionInfo(exception.code, exception.name, task, place.pou, place.file, place.line, places[1:])


def _keep_symbols(image: Path, crc: int) -> None:
    """Puts the symbols beside an image where they are found later, also from another folder."""
    source, kept = symbol_path(image), cache_path(crc)
    with suppress(OSError, UsageError):
        if load_symbols(source).image_crc == crc:
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, kept)


def _range(symbol: Symbol) -> AreaRange:
    area, offset, hops = symbol.place
    return AreaRange(area, offset, symbol.size, hops)
