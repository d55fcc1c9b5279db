"""A controller on a link: flash, start, stop, watch. `with plctool.connect("serial:/dev/ttyS0") as plc: ...`"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, cast

from plctool.archives import MAX_BYTES, ArchiveError, inflate
from plctool.controller import Closed, Controller, OtherTool
from plctool.core import lib
from plctool.debug.breakpoints import Debugger
from plctool.debug.forced import ForcedPlace, ForceList
from plctool.debug.halted import BpStatus
from plctool.debug.recording import Recording
from plctool.debug.registers import Registers
from plctool.debug.symbols import SymbolTable, load_symbols
from plctool.debug.target import DeviceCondition, Target
from plctool.debug.variables import Change, Reading, Symbol, unreachable
from plctool.errors import DeviceError, LinkError, UsageError, did_you_mean
from plctool.gateway.client import GatewayConnection, GatewaySession, connect_gateway
from plctool.gateway.control import dismiss_idle
from plctool.gateway.frames import BUSY
from plctool.gateway.place import NoGateway
from plctool.iec.types import Type
from plctool.iec.values import decode, encode
from plctool.link import breakpoint_services, file_services, io_services, services, traces
from plctool.link.connection import SCAN_SECONDS, Choice, Connection, MessageLink, no_answer, patience_factor
from plctool.link.file_services import SYMBOLS_NAME, FileList, Progress
from plctool.link.io_services import IoDevice, IoModule
from plctool.link.monitoring import (
    APP_CHANGED,
    AreaRange,
    Contents,
    Reader,
    Write,
    force_memory,
    read_forced,
    read_memory,
    unforce_memory,
    write_memory,
)
from plctool.link.names import Node
from plctool.link.passwords import AskPassword, no_password
from plctool.link.services import Identity, Lateness, LogEntry, Stack, Status, TaskInfo
from plctool.link.session import Session
from plctool.link.traces import TRACE_FILE, TraceState, decode_config
from plctool.link.transports import Link, can_transport, open_transport, parse_link, share_bus

PASSWORD_VARIABLE = "PLC_PASSWORD"
_TRACE_POLL = 0.05  # shortest time between two looks at a trace that has nothing new [s]
_HALT_POLL = 0.02  # how often a device is asked whether its program is halted [s]
_BUSY_POLL = 0.2  # shortest time between two looks at a device that another tool keeps to itself [s]


def connect(
    link: str | Link,
    symbols: Path | str | None = None,
    *,
    gateway: bool | None = None,
    tool: str | None = None,
    password: str | AskPassword | None = None,
) -> Plc:
    """Opens a link to a controller, such as "serial:/dev/ttyS0", "serial:/dev/ttyS0?baud=9600" or
    "serial:socket://host:port".

    `symbols` names a symbol file when it is neither in the cache nor beside the image. A serial port of this machine is
    shared with other tools through a gateway where there can be one; with `gateway` false, or PLCTOOL_GATEWAY=off, it
    is opened by this process and locked. `tool` is how this one is shown to other tools. `password` is that of the
    controller, or a function that is called when it has one; without either the environment's PLC_PASSWORD. Raises
    UsageError for what is not a link, LinkError when it cannot be opened; whether a controller answers, and takes the
    password, shows with the first call.
    """
    ask = _asking(password)
    return Plc(_open_link(link, gateway, tool, ask), Path(symbols) if symbols else None, ask)


def _asking(password: str | AskPassword | None) -> AskPassword:
    if callable(password):
        return password
    return lambda: os.environ.get(PASSWORD_VARIABLE) if password is None else password


def scan(
    link: str | Link, seconds: float = SCAN_SECONDS, *, gateway: bool | None = None, tool: str | None = None
) -> list[Node]:
    """The controllers that answer on a link within `seconds`, times PLCTOOL_PATIENCE. Raises LinkError when there are
    none."""
    connection = _open_link(link, gateway, tool, no_password)
    try:
        nodes = connection.scan(patience_factor() * seconds)
        if not nodes:
            raise no_answer(connection.name)
        return nodes
    finally:
        connection.close()


def _open_link(text: str | Link, gateway: bool | None, tool: str | None, ask_password: AskPassword) -> MessageLink:
    """A way to the device, through a gateway where that is possible and wanted."""
    link = text if isinstance(text, Link) else parse_link(text)
    if link.is_shared:
        if gateway is None:
            gateway = os.environ.get("PLCTOOL_GATEWAY", "on").lower() not in ("off", "no", "0")
        if gateway:
            with suppress(NoGateway):
                return connect_gateway(link, tool or Path(sys.argv[0]).name or "Python", ask_password)
        else:
            dismiss_idle(link.place)
    return Connection(open_transport(link), _choice(link))


@contextmanager
def connect_several(
    link: Link, symbols: Path | None = None, password: str | AskPassword | None = None
) -> Iterator[dict[str, Plc]]:
    """The controllers that the nodes of a link on a bus name, each for a thread of its own. Raises LinkError."""
    bus = share_bus(link)
    opened: dict[str, Plc] = {}
    try:
        for node in link.nodes or []:
            one = link.of_node(node)
            opened[node] = Plc(Connection(can_transport(one, bus.part()), _choice(one)), symbols, _asking(password))
        yield opened
    finally:
        for plc in opened.values():
            plc.close()
        bus.close()


def _choice(link: Link) -> Choice | None:
    nodes = link.nodes
    if nodes is None:
        return None
    if len(nodes) > 1:
        raise UsageError(f"Only 'flash' takes several devices; name one of {', '.join(nodes)}.", "no-such-link")
    return Choice(nodes[0] if nodes else "")


class Plc(Controller):
    """A controller on a link. Channel and login are made at the first call and renewed by themselves."""

    def __init__(
        self, connection: MessageLink, symbols: Path | None = None, ask_password: AskPassword = no_password
    ) -> None:
        super().__init__()
        self._connection = connection
        self._closed = False
        self._session: Session = (
            GatewaySession(connection)
            if isinstance(connection, GatewayConnection)
            else Session(connection, ask_password)
        )
        self._symbol_file = symbols
        self._reader: tuple[list[Symbol], Reader] = ([], Reader([]))  # of what was read last
        self._prepared: services.Prepared | None = None  # of the download that follows

    def close(self) -> None:
        if not self._closed:
            self.end_debugging()
            self._closed = True
            self._connection.close()
            self._session = self._connection = cast("Any", Closed("The connection is closed; connect again."))

    def others(self) -> list[OtherTool]:
        if not isinstance(self._connection, GatewayConnection):
            return []
        return [OtherTool(tool, pid) for tool, pid in self._connection.others()]

    # ---- the device ----

    def identity(self) -> Identity:
        """Name, vendor, target and versions of the controller."""
        return services.read_identity(self._session)

    def stack(self) -> Stack | None:
        """What is left of the main stack of the controller; None if it does not report it."""
        return services.read_stack(self._session)

    def info(self) -> dict[str, str]:
        """Project, author, version and so on, of the application."""
        return services.read_application_info(self._session)

    def log(self, after: int = 0, *, kept: bool = False) -> list[LogEntry]:
        return services.read_log(self._session, after, kept)

    def shell(self, command: str) -> str:
        """The answer of the controller's PLC shell, in lines; `?` lists its commands."""
        return services.run_shell(self._session, command)

    def set_password(self, password: str | None) -> None:
        """Sets the password of the controller, of at least 8 characters, or removes it with None. The logins of other
        tools end. It is not sent, but what is sent would help who hears it to guess it: set it on a line of your
        own."""
        services.set_password(self._session, password)

    # ---- files ----

    def files(self) -> FileList:
        """What the controller keeps for its tools, and what it makes itself: its program and its log."""
        return file_services.list_files(self._session)

    def read_file(self, name: str, progress: Progress = lambda done, total: None) -> bytes:
        """The content of a file of the controller. Raises DeviceError if there is none."""
        return file_services.read_file(self._session, name, progress)

    def write_file(self, name: str, data: bytes, progress: Progress = lambda done, total: None) -> None:
        """Puts a file onto the controller, in place of the previous one of that name. Raises DeviceError if it has no
        room."""
        file_services.write_file(self._session, name, data, progress)

    def delete_file(self, name: str) -> None:
        file_services.delete_file(self._session, name)

    # ---- inputs and outputs ----

    def io_devices(self) -> list[IoDevice]:
        """The devices, modules and buses of the application. Raises DeviceError if the controller has no I/O
        manager."""
        return io_services.list_devices(self._session)

    def io_device(self, name: str) -> IoDevice:
        """The one of that name. Raises UsageError if there is none."""
        devices = self.io_devices()
        found = next((d for d in devices if d.name.casefold() == name.casefold()), None)
        if found is None:
            hint = did_you_mean(name, (d.name for d in devices)) or "; 'plctool io status' lists them."
            raise UsageError(f"The program has no device {name}{hint}", "unknown-device")
        return found

    def io_read_parameter(self, device: str, number: int, t: Type) -> Any:
        """The value of a parameter of a device, by its name and the number of the parameter."""
        bits = 8 * t.size
        return decode(t, io_services.read_parameter(self._session, self.io_device(device).index, number, bits))

    def io_write_parameter(self, device: str, number: int, t: Type, value: Any) -> None:
        """Sets a parameter of a device, until the application is loaded again."""
        data = encode(t, value)
        io_services.write_parameter(self._session, self.io_device(device).index, number, 8 * len(data), data)

    def io_identify(self, device: str) -> None:
        """A device shows itself, by a light for example."""
        io_services.identify(self._session, self.io_device(device).index)

    def io_scan(self, bus: str) -> Iterator[IoModule]:
        """What is on a bus, whether the program uses it or not; each when it is found."""
        found = self.io_device(bus)
        try:
            yield from io_services.scan(self._session, found.index)
        except DeviceError as error:
            if found.parent is None or error.result != lib.ERR_NOT_SUPPORTED:
                raise
            parent = next(d.name for d in self.io_devices() if d.index == found.parent)
            message = f"{found.name} has no bus of its own; it is on {parent}: plctool io scan {parent}"
            raise DeviceError(message, "no-bus", error.result) from None

    # ---- the application ----

    def start(self) -> None:
        services.start(self._session)

    def _start_checked(self) -> Status:
        return services.start_checked(self._session)

    def stop(self) -> None:
        services.stop(self._session)

    def cycle(self) -> None:
        """Runs one cycle of each task of a stopped program, which is stopped again then. Raises DeviceError when it
        runs, had an exception, or there is none."""
        services.cycle(self._session)

    def _reset(self, option: int) -> None:
        services.reset(self._session, option)

    def raw_status(self) -> Status:
        return services.read_status(self._session)

    def tasks(self) -> list[TaskInfo]:
        return services.read_tasks(self._session)

    def lateness(self) -> list[list[Lateness]]:
        """How late the cycles of each task began, in the order of `tasks`."""
        return services.read_lateness(self._session)

    def create_boot_project(self) -> None:
        with self._alone("making the boot project"):
            services.create_boot_project(self._session)

    def _now(self) -> float:
        return self._connection.now()

    def _alone(self, purpose: str) -> AbstractContextManager[None]:
        return self._session.exclusive(purpose)

    def _download(
        self, data: bytes, start: bool, restart: bool, boot: bool | None, progress: Callable[[int], None]
    ) -> None:
        prepared, self._prepared = self._prepared, None
        services.download(self._session, data, restart, progress, prepared, start=start, boot=boot)

    def _change(self, data: bytes, progress: Callable[[int], None]) -> None:
        prepared, self._prepared = self._prepared, None
        services.download(self._session, data, False, progress, prepared, change=True)

    def _status_before(self, data: bytes) -> Status:
        status, self._prepared = services.prepare_download(self._session, data)
        return status

    # ---- variables ----

    def _application_crc(self) -> int:
        return self._session.recover(self._session.application).image_crc

    def _find_symbols(self, crc: int) -> SymbolTable:
        if self._symbol_file is None:
            try:
                return super()._find_symbols(crc)
            except UsageError:
                if (table := self._own_symbols(crc)) is None:
                    raise
                return table
        table = load_symbols(self._symbol_file)
        if table.image_crc != crc:
            raise UsageError(
                f"{self._symbol_file} belongs to another image than the one on the device (CRC {crc:08X}); "
                "name its own symbol file.",
                "wrong-symbols",
            )
        return table

    def _own_symbols(self, crc: int) -> SymbolTable | None:
        """Those that the controller keeps; None if it has none of this image."""
        with suppress(DeviceError, UsageError, ArchiveError, ValueError):
            text = inflate(self.read_file(SYMBOLS_NAME), MAX_BYTES, gzip=True).decode()
            table = SymbolTable.from_json(text, SYMBOLS_NAME)
            return table if table.image_crc == crc else None
        return None

    def _read(self, table: SymbolTable, symbols: Sequence[Symbol]) -> Contents:
        """Pointers are followed by the controller."""
        if symbols != self._reader[0]:
            ranges = [_range(symbol) for symbol in symbols if symbol.fixed is None]
            self._reader = (list(symbols), Reader(ranges))
        contents = self._reader[1].read(self._session, table.image_crc)
        read = iter(contents.values)
        values = [next(read) if s.fixed is None else s.fixed for s in symbols]
        return Contents(values, contents.consistent, contents.forced)

    def _write(self, table: SymbolTable, changes: Sequence[tuple[Symbol, Change]]) -> int:
        """By one message if they fit."""
        writes = [Write(_range(s).part(c.offset, len(c.data)), c.data, c.mask) for s, c in changes]
        try:
            return write_memory(self._session, table.image_crc, writes)
        except DeviceError:
            self._check_reachable(table, [symbol for symbol, _ in changes if symbol.pointer is not None])
            raise

    def _force(self, table: SymbolTable, changes: Sequence[tuple[Symbol, ForcedPlace]]) -> None:
        try:
            force_memory(self._session, table.image_crc, [place for _, place in changes])
        except DeviceError:
            self._check_reachable(table, [symbol for symbol, _ in changes if symbol.pointer is not None])
            raise

    def _unforce(self, table: SymbolTable, places: Sequence[ForcedPlace]) -> None:
        unforce_memory(self._session, table.image_crc, places)

    def _unforce_all(self) -> None:
        services.end_all_forces(self._session)

    def _read_forces(self) -> ForceList:
        return read_forced(self._session)

    # ---- dumps ----

    def areas(self, table: SymbolTable) -> list[tuple[int, int, bytes]]:
        """Each memory area of the program as far as its variables go: APP_AREA_*, what pointers to it contain (0:
        unknown), its bytes."""
        sizes: dict[int, int] = {}
        for symbol in table.variables.values():
            if symbol.fixed is None and symbol.pointer is None:
                sizes[symbol.area] = max(sizes.get(symbol.area, 0), symbol.offset + symbol.size)
        ranges = [AreaRange(area, 0, size) for area, size in sorted(sizes.items()) if size]
        contents = read_memory(self._session, table.image_crc, ranges).values
        places = [services.area_address(self._session, r.area) for r in ranges]
        return [(r.area, a, c) for r, a, c in zip(ranges, places, contents, strict=True) if c is not None]

    def pointer_size(self) -> int:
        """Bytes of an address on the processor of the controller."""
        return services.pointer_size(self._session)

    def registers(self) -> Registers | None:
        """The registers of the processor at the fault that stopped the program. None without fault, as of an error that
        the program or the runtime found, and if the firmware does not keep them."""
        return services.read_registers(self._session, self.pointer_size())

    # ---- traces ----

    def _renew_traces(self, before: int, after: int, removed: Sequence[Symbol], tasks: Collection[int]) -> None:
        with suppress(DeviceError):
            for name in [file.name for file in self.files().files if file.name.startswith(TRACE_FILE)]:
                config = decode_config(self.read_file(name))
                if config.image_crc == before and not config.is_about(removed, tasks):
                    self.write_file(name, config.for_image(after))

    def create_trace(self, config: bytes) -> int:
        self._session.recover(self._session.application)
        return traces.create(self._session, config)

    def delete_trace(self, packet: int) -> None:
        traces.delete(self._session, packet)

    def next_trace(self, packet: int) -> tuple[int, bytes] | None:
        return traces.next_packet(self._session, packet)

    def read_trace(self, packet: int, first: int, sizes: Sequence[int]) -> TraceState:
        return traces.read(self._session, packet, first, sizes)

    def _pass_cycle(self, recording: Recording) -> None:
        time.sleep(min(max(recording.interval_us / 1e6, _TRACE_POLL), 1.0))

    def _make_debugger(self) -> Debugger:
        return Debugger(_DebuggedPlc(self, self._session))

    def read_symbols(self, symbols: Sequence[Symbol]) -> list[bytes | None]:
        """Their bytes, one by one where they cannot be read together: None for what cannot be reached."""
        if not symbols:
            return []
        table = self.symbols()
        try:
            return list(self._read(table, symbols).values)
        except DeviceError:
            if len(symbols) == 1:
                return [None]
        return [self.read_symbols([symbol])[0] for symbol in symbols]

    def write_symbol(self, symbol: Symbol, change: Change) -> None:
        """A change of a variable."""
        self._write(self.symbols(), [(symbol, change)])

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

        Pointers are followed again each time; a value whose pointer leads to no variable is None. While another
        tool downloads a program through the gateway there are no readings; `waiting` is called with the reason when
        that begins. After a download the readings are of the new program, if its symbols are found; else DeviceError.
        """
        begin = time.monotonic()
        due, readings, waits = begin, 0, False
        while count is None or readings < count:
            time.sleep(max(0.0, due - time.monotonic()))
            due += interval
            at = time.monotonic() - begin
            try:
                table = self.symbols()
                reading = self.sample_symbols(table, table.select(names))
            except LinkError as error:
                if error.code != BUSY:
                    raise
                if not waits:
                    waiting(error.message)
                waits, due = True, max(due, time.monotonic() + _BUSY_POLL)
            except DeviceError as error:
                if error.code != APP_CHANGED or not self._has_symbols():
                    raise
            else:
                waits, readings = False, readings + 1
                yield at, reading

    def _has_symbols(self) -> bool:
        """Whether the symbols of the application on the device can be found."""
        with suppress(UsageError):
            self.symbols()
            return True
        return False


class _DebuggedPlc(Target):
    """What a controller on a link does for a debugger (`debug.breakpoints.Target`)."""

    def __init__(self, plc: Plc, session: Session) -> None:
        self._plc = plc
        self._session = session

    def attach(self, keep: bool) -> None:
        self._session.forget_application()  # another tool may have replaced it
        breakpoint_services.attach(self._session, keep=keep)

    def detach(self) -> None:
        breakpoint_services.detach(self._session)

    def status(self) -> BpStatus:
        return breakpoint_services.status(self._session)

    def set(self, offset: int, skip: int, condition: DeviceCondition | None) -> None:
        breakpoint_services.set_breakpoint(self._session, offset, skip, condition)

    def clear(self, offset: int) -> None:
        breakpoint_services.clear_breakpoint(self._session, offset)

    def hits(self) -> dict[int, int]:
        return breakpoint_services.read_hits(self._session)

    def watch(self, places: Sequence[ForcedPlace], offsets: Sequence[int]) -> None:
        breakpoint_services.watch(self._session, places, offsets)

    def temporary(self, offsets: Sequence[int]) -> None:
        breakpoint_services.set_temporary(self._session, offsets)

    def go(self, how: int, serial: int) -> None:
        breakpoint_services.go(self._session, how, serial)

    def pause(self) -> None:
        breakpoint_services.pause(self._session)

    def pass_time(self, seconds: float) -> float:
        time.sleep(min(seconds, _HALT_POLL))
        return _HALT_POLL

    def table(self) -> SymbolTable:
        return self._plc.symbols()

    def task_names(self) -> list[str]:
        return self.table().tasks

    def read_areas(self, symbols: Sequence[Symbol]) -> list[bytes | None]:
        return self._plc.read_symbols(symbols)

    def write_area(self, symbol: Symbol, change: Change) -> None:
        self._plc.write_symbol(symbol, change)

    def read_stack(self, distance: int, size: int) -> bytes:
        return breakpoint_services.read_stack(self._session, distance, size)

    def write_stack(self, distance: int, data: bytes) -> None:
        breakpoint_services.write_stack(self._session, distance, data)


def _range(symbol: Symbol) -> AreaRange:
    area, offset, hops = symbol.place
    return AreaRange(area, offset, symbol.size, hops)
