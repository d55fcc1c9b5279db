"""The runtime in this process, on a virtual clock: for `plctool run` and for unit tests with pytest.

It is the same C core that runs on a controller, with the simulator port: a day of PLC time takes seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, SupportsFloat, SupportsIndex

from plctool import sim_traces
from plctool.controller import Closed, Controller
from plctool.core import Core, error_name, give_back_core, lib, take_core
from plctool.debug.breakpoints import Debugger
from plctool.debug.forced import ForcedPlace, ForceList
from plctool.debug.halted import BpStatus
from plctool.debug.recording import Recording
from plctool.debug.symbols import SymbolTable, find_symbols
from plctool.debug.target import DeviceCondition, Target
from plctool.debug.trace import Trace
from plctool.debug.variables import Change, Symbol
from plctool.errors import DeviceError, UsageError
from plctool.iec.areas import Area
from plctool.iec.types import Type
from plctool.image.file import image_crc, parse_image, read_program
from plctool.image.targets import host_target
from plctool.io.canopen.events import posted_events
from plctool.io.configuration import configuration_of_image
from plctool.link import l7
from plctool.link.monitoring import Contents
from plctool.link.services import AppException, LogEntry, Status, TaskInfo, app_state
from plctool.link.session import no_application
from plctool.link.traces import TraceState
from plctool.sim_can import CanFrame, send_frame, take_frames
from plctool.sim_functions import SimFunctions
from plctool.sim_io import SimIo, is_input, read_parameter, set_fault, set_modbus
from plctool.sim_net import Datagram, send_datagram, take_datagrams
from plctool.sim_variables import SimVariables
from plctool.sim_worker import Worker

if TYPE_CHECKING:
    from plctool.compiler import Level

_FLASH_SIZE = 4 << 20  # bytes: room for two slots of any program that fits plcrt
_MAX_CYCLES = 0xFFFF_FFFF  # of one call of the C core
_SECTOR = 4096
_KEPT_LOG = 2 * _SECTOR  # bytes for the log that outlasts power-off
_FILE_STORE = (1 << 20) - _KEPT_LOG  # bytes for files, as on plcrt; the program's own room stays as it was
_PROGRAM_UNIT = 8
MAX_NS = 2**62  # at once; the clock goes twice as far
_SERIAL = 64 * 1024  # bytes that a serial line holds
_NEVER = 2**63 - 1  # the last moment of that clock [ns]
# What the C core runs before Python is asked whether the user wants it to end.
_CYCLES_AT_ONCE = 100_000
_NS_AT_ONCE = 3600 * 10**9
_NS_DEBUGGED = 10**8  # the rest of which still passes when a halted program goes on


class Watcher(Protocol):
    """A debugger of the simulators that code of others makes, such as a test: that code runs until a program halts, and
    again when it goes on."""

    def made(self, plc: Simulator) -> None:
        """It has a program, which has not begun."""

    def before(self, plc: Simulator) -> None:
        """Time is about to pass."""

    def halted(self, plc: Simulator) -> None:
        """Its program is halted. Returns when it has gone on."""

    def closed(self, plc: Simulator) -> None: ...


_watchers: list[Watcher] = []


@contextmanager
def watched_by(watcher: Watcher) -> Iterator[None]:
    """Simulators that are made meanwhile have this debugger."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.pop()


def is_debugged() -> bool:
    """Whether programs are to be compiled for a debugger, since simulators that are made now have one."""
    return bool(_watchers)


class Simulator(Controller):
    """A controller in this process, with a program in it, started. Each has a clock of its own; all of a process are
    used by one thread.

    Its symbols are `symbols`, else what is found by the CRC of the image. A cycle that takes longer than
    `cycle_limit_ms` of the processor's time is aborted; 0: SIM_CYCLE_LIMIT_MS. `functions`: those that Python
    implements. Raises DeviceError for an image that is
    refused and when the program fails.
    """

    _io: tuple[SymbolTable, SimIo] | None = None

    def __init__(
        self,
        image: bytes,
        symbols: SymbolTable | None = None,
        *,
        start: bool = True,
        cycle_limit_ms: int = 0,
        functions: SimFunctions | None = None,
    ) -> None:
        super().__init__()
        self._functions = functions or SimFunctions()
        self._plants: list[_Plant] = []
        self._worker: Worker | None = None  # while a debugger is attached
        self._watcher = _watchers[-1] if _watchers else None
        if symbols is not None:
            self.add_symbols(symbols)
        self._core = take_core()
        self._ffi, self._lib = self._core.ffi, self._core.lib
        self._variables: SimVariables | Closed = SimVariables(self._core)
        self._closed = False
        try:
            self._power_on(cycle_limit_ms)
            self._download(image, start=False, restart=True, boot=None, progress=lambda done: None)
            if self._watcher is not None:
                self._watcher.made(self)
            if start:
                self.check_running()  # initialisation may have failed
                self.start()
        except BaseException:
            self.close()
            raise

    @classmethod
    def from_file(cls, path: Path | str, *, start: bool = True) -> Simulator:
        """The program in `app.cdl` with its symbols (`app.sym` beside it)."""
        file = Path(path)
        image = read_program(file)
        return cls(image, find_symbols(parse_image(image).crc, file), start=start)

    @classmethod
    def from_sources(
        cls,
        *paths: Path | str,
        level: Level = 2,
        checks: str = "all",
        start: bool = True,
        cycle_limit_ms: int = 0,
        functions: Mapping[str, Callable[..., Any]] | None = None,
        dialect: str | None = None,
    ) -> Simulator:
        """The program in source files and folders, compiled for this. `level`, `checks` and `dialect` as in
        `compile_sources`, which says what is raised; level 0 is for debugging, too. `functions`: FUNCTIONs of the
        program, by name, that Python implements: they get the values of the inputs, an `Output` for each VAR_OUTPUT and
        VAR_IN_OUT, and return the result."""
        # Only here: what runs images needs no compiler.
        from plctool.compiler import compile_sources
        from plctool.compiler.semantics.python_functions import PythonFunctions

        for name, function in (functions or {}).items():
            if not callable(function):
                raise UsageError(f"{name} in Python is {function!r}, which cannot be called.", "python")
        python = PythonFunctions(functions) if functions else None
        level = 0 if is_debugged() else level
        built = compile_sources(
            paths,
            target=host_target(),
            level=level,
            checks=checks,
            debug=level == 0,
            python=python,
            dialect=dialect,
        )
        connected = SimFunctions(functions, python.units) if python else None
        try:
            return cls(built.image, built.symbols, start=start, cycle_limit_ms=cycle_limit_ms, functions=connected)
        except DeviceError as error:
            if error.result == lib.ERR_APP_UNRESOLVED_REFERENCE:
                error.add_note("What is in C on a board may be given in Python: functions={'Name': function}.")
            raise

    def _power_on(self, cycle_limit_ms: int) -> None:
        """With an empty flash and no events."""
        self._lib.SimSetClock(lib.SIM_CLOCK_FIRST_S * 1_000_000_000)
        self._lib.SimSetFileStore(_FILE_STORE)
        self._lib.SimSetKeptLog(_KEPT_LOG)
        made = self._lib.SimFlashConfigure(_FLASH_SIZE + _FILE_STORE + _KEPT_LOG, _SECTOR, _PROGRAM_UNIT, 0xFF)
        _check(made, "The simulated flash cannot be made")
        self._limited = cycle_limit_ms > 0
        if self._limited:
            self._lib.SimSetCycleLimit(cycle_limit_ms)
        self._functions.connect(self._core)
        _check(self._lib.SimStart(), "The simulator does not start")
        self._lib.SimForgetEvents()

    def close(self) -> None:
        """Shuts the runtime down."""
        if self._closed:
            return
        if self._watcher is not None:
            self._watcher.closed(self)
        self.end_debugging()
        with self._functions.while_running():
            self._closed = True
            self._lib.SimStop()
            self._lib.SimSetFileStore(0)
            self._lib.SimSetKeptLog(0)
            self._lib.SimNetSetAddress(0)
            self._functions.disconnect(self._core)
            if self._limited:
                self._lib.SimSetCycleLimit(0)
            self._lib = self._ffi = self._variables = Closed(
                "The simulator is closed; make another one."
            )  # before another one has the runtime
            give_back_core(self._core)

    # ---- the program ----

    def _check_allowed(self, operation: int, action: str) -> None:
        """As the services of a device do. Writing is always allowed: it stands for what happens at the inputs."""
        l7.check_result(self._lib.OperationMay(operation), action)

    def _check_result(self, result: int, action: str) -> None:
        reason = self._ffi.string(self._lib.AppTakeReason()).decode("latin-1")
        l7.check_result(result, action, reason if result == lib.ERR_OPERATION_DENIED else "")

    def _download(
        self, data: bytes, start: bool, restart: bool, boot: bool | None, progress: Callable[[int], None]
    ) -> None:
        self._check_allowed(lib.OPERATION_DOWNLOAD, "download")
        is_on_trial = self._lib.AppDownloadTriesAll() if boot is None else not boot
        end = self._lib.AppDownloadTry if is_on_trial else self._lib.AppDownloadEnd
        self._send(data, end, "download", progress)

    def create_boot_project(self) -> None:
        l7.check_result(self._lib.AppCreateBootProject(), "boot")

    def _change(self, data: bytes, progress: Callable[[int], None]) -> None:
        self._check_allowed(lib.OPERATION_ONLINE_CHANGE, "online change")
        self._send(data, self._lib.AppDownloadChange, "online change", progress)

    def _send(self, data: bytes, end: Callable[[Any], int], action: str, progress: Callable[[int], None]) -> None:
        self._add_events(data)
        _check(self._lib.AppDownloadBegin(len(data), image_crc(data)), "The image is refused")
        _check(self._lib.AppDownloadWrite(0, data, len(data)), "The image cannot be stored")
        refusal = self._ffi.new("APP_REFUSAL *")
        with self._not_debugged(), self._functions.while_running():
            result = end(refusal)
        l7.check_result(result, action, self._ffi.string(refusal.text).decode("latin-1") if result else "")
        progress(len(data))

    def _add_events(self, image: bytes) -> None:
        """The simulated device has every external event that the program waits for and no driver posts."""
        with suppress(UsageError):  # a bad image is refused with the reason of the device
            parsed = parse_image(image)
            configuration = configuration_of_image(parsed)
            posted = posted_events(configuration) if configuration is not None else set()
            for task in parsed.tasks:
                if task.external and task.external not in posted:
                    _check(self._lib.SimAddEvent(task.external.encode("ascii")), "The simulator has too many events")

    def post(self, event: str) -> None:
        """An external event happens: what waits for it runs when time passes. Raises DeviceError when nothing does."""
        posted = self._lib.SimPostEvent(event.encode("ascii", "replace"))
        _check(posted, f"The program does not wait for the event {event}")

    def start(self) -> None:
        """Starts the program; the first cycle of each task is due at once."""
        self._application_crc()
        with self._functions.while_running():
            result = self._lib.AppStartApplication()
        self._check_result(result, "start")

    def stop(self) -> None:
        self._application_crc()
        self._check_allowed(lib.OPERATION_STOP, "stop")
        with self._not_debugged(), self._functions.while_running():
            result = self._lib.AppStopApplication()
        self._check_result(result, "stop")

    def _reset(self, option: int) -> None:
        self._application_crc()
        if option != lib.RESET_OPTION_ORIGIN:
            self._check_allowed(lib.OPERATION_RESET, "reset")
        with self._not_debugged(), self._functions.while_running():
            result = self._lib.AppReset(option)
        self._check_result(result, "reset")

    def restart(self) -> None:
        """Power off and on again: what is in flash survives."""
        with self._not_debugged(), self._functions.while_running():
            self._lib.SimStop()
            result = self._lib.SimStart()
        _check(result, "The simulator does not start")
        for plant in self._plants:  # the clock begins at 0 again
            plant.due_ns = self.now_ns + plant.every_ns

    # ---- the wall clock ----

    def set_clock(self, time: datetime) -> None:
        """Sets the wall clock of the device, which follows virtual time; it begins with 2000-01-01. A time without zone
        is UTC."""
        utc = time if time.tzinfo else time.replace(tzinfo=UTC)
        since = utc - datetime(1970, 1, 1, tzinfo=UTC)
        if since < timedelta(0):
            raise UsageError(f"The clock counts from 1970 on: {time} is before.", "clock")
        self._lib.SimSetClock(since // timedelta(microseconds=1) * 1000)

    # ---- files ----

    def put_file(self, name: str, data: bytes) -> None:
        """Gives the device a file, which its program may read. Raises DeviceError if there is no room for it."""
        put = self._lib.SimPutFile(name.encode("latin-1", "replace"), data, len(data))
        _check(put, f"The simulated device cannot have the file {name}")

    def files(self) -> dict[str, bytes]:
        """The files that the device has, by name."""
        found: dict[str, bytes] = {}
        name, size = self._ffi.new("char[36]"), self._ffi.new("RTS_UI32 *")
        index = 0
        while self._lib.SimGetFile(index, name, size) == lib.ERR_OK:
            index += 1
            if name[0] == b"\0":
                continue
            data = self._ffi.new("RTS_UI8[]", max(size[0], 1))
            _check(self._lib.SimReadFile(name, data, size[0]), "A file of the simulated device cannot be read")
            found[self._ffi.string(name).decode("latin-1")] = bytes(self._ffi.buffer(data, size[0]))
        return found

    def raw_status(self) -> Status:
        c = self._ffi.new("APP_STATUS *")
        self._lib.AppGetStatus(c)
        exception = None
        if c.exception.code != lib.RTSEXCPT_NOEXCEPTION:
            found = self._lib.SysExceptGetTrace()
            trace = Trace.of((call.target, call.distance) for call in found.call[0 : found.count])
            exception = AppException.of(c.exception.code, c.exception.code_offset, c.exception.task, trace)
        state, forbidden = app_state(c.state, c.op_state), self._lib.OperationForbidden()
        return Status(state, c.image_crc, c.image_size, exception, c.op_state, forbidden)

    def _application_crc(self) -> int:
        c = self._ffi.new("APP_STATUS *")
        self._lib.AppGetStatus(c)
        if c.state == lib.AS_NONE:
            raise no_application()
        return int(c.image_crc)

    def tasks(self) -> list[TaskInfo]:
        """Statistics of the tasks; the times are real, measured on this machine."""
        infos = []
        for index in range(self._lib.IecTaskGetCount()):
            c = self._ffi.new("IEC_TASK_INFO *")
            _check(self._lib.IecTaskGetInfo(index, c), "The task has no statistics")
            name = self._ffi.string(c.name).decode("latin-1")
            infos.append(
                TaskInfo(
                    name, c.kind, c.priority, c.interval_us, c.cycles, c.last_us, c.avg_us, c.min_us, c.max_us,
                    c.jitter_us, c.overruns, self._lib.TaskLoadGet(index),
                )
            )  # fmt: skip
        return infos

    def log(self, after: int = 0, *, kept: bool = False) -> list[LogEntry]:
        entries = []
        c, origin, utc = self._ffi.new("LOG_ENTRY *"), self._ffi.new("LOG_KEPT_FROM *"), self._ffi.new("RTS_I64 *")
        clock = utc[0] - self._lib.SimNow() if self._lib.SysTimeRtcGet(utc) == lib.ERR_OK else None
        if kept:
            self._lib.SimCommCycle()  # main copies what has happened
        while (
            self._lib.LogKeepGet(after + 1, c, origin) if kept else self._lib.LogGetEntry(after + 1, c)
        ) == lib.ERR_OK:
            after = c.handle
            component = self._ffi.string(self._lib.CMGetComponentName(c.component)).decode("latin-1")
            text = self._ffi.string(c.text).decode("latin-1")
            utc_ns = (origin.utc_ns or None) if kept else None if clock is None else clock + c.time_ns
            start = origin.start if kept else None
            entries.append(LogEntry(after, c.time_ns, component, c.log_class, c.error, text, utc_ns, start))
        return entries

    # ---- inputs and outputs ----

    @property
    def io(self) -> SimIo:
        """The channels of the program. Raises UsageError if its symbols are not found."""
        symbols = self.symbols()
        if self._io is None or self._io[0] is not symbols:
            self._io = (symbols, SimIo(symbols, self._core))
        return self._io[1]

    def set_input(self, name: str, value: Any) -> None:
        """What a device measures from now on; `name`: of the channel (`Bench.button`) or its variable (`Main.start`).
        The program sees it from its next cycle on; what a Modbus device measures, when it has been asked."""
        self.io.set_input(name, value)

    def output(self, name: str) -> Any:
        """What a device has now, by the name of the channel or of its variable; while the program is stopped, what the
        description says of that."""
        return self.io.value(name)

    def fault(self, device: str, fault: str, value: int = 1) -> None:
        """Makes a device fail: "absent", "late" (ms), "type", "answers" (how many are bad), "cut" (of how many only
        half arrives); 0 ends it. A line of Modbus can only be "absent", which is that it is pulled."""
        set_fault(self._core, device, fault, value)

    def io_read_parameter(self, device: str, number: int, t: Type) -> Any:
        """The value of a parameter of a device or line, as the driver has it. Raises DeviceError."""
        return read_parameter(self._core, device, number, t)

    def set_modbus(self, device: str, reference: int, value: int) -> None:
        """What a Modbus device replies to MODBUS_READ: `reference` as manuals have it, such as 40001 for the first
        holding register, 5 for a coil. It also has what MODBUS_WRITE wrote, and refuses to read all else. Raises
        DeviceError if the description names no such device."""
        set_modbus(self._core, device, reference, value)

    def can_send(self, id: int, data: bytes = b"", *, extended: bool = False, remote: bool = False) -> None:
        """A frame of another node on the CAN bus: it is there when time passes."""
        send_frame(self._core, CanFrame(id, bytes(data), extended, remote))

    def can_receive(self) -> list[CanFrame]:
        """The frames that the device has sent on the CAN bus since the last call, the 4096 newest at most."""
        return take_frames(self._core)

    def serial_send(self, port: int, data: bytes) -> None:
        """Bytes for a serial port of the program, from 1 on. Raises DeviceError unless it takes all of them."""
        if self._lib.SimComPutPort(port, bytes(data), len(data)) != len(data):
            message = f"Serial port {port} does not take {len(data)} bytes: the program has to open it."
            raise DeviceError(message, "serial")

    def serial_receive(self, port: int) -> bytes:
        """The bytes that the program has written to a serial port since the last call."""
        room = self._ffi.new("RTS_UI8[]", _SERIAL)
        return bytes(self._ffi.buffer(room)[: self._lib.SimComGetPort(port, room, _SERIAL)])

    def udp_send(self, data: bytes, port: int, *, sender: tuple[str, int] = ("192.168.0.1", 1)) -> None:
        """A datagram of another host to a port of the program: it is there when time passes."""
        send_datagram(self._core, Datagram(bytes(data), *sender, to_port=port))

    def udp_receive(self) -> list[Datagram]:
        """The datagrams that the program has sent to other hosts since the last call. For simulators that are not on a
        Network."""
        return take_datagrams(self._core)

    def join_network(self, ip: int) -> Core:
        """Has this address from now on; for `Network`."""
        self._lib.SimNetSetAddress(ip)
        return self._core

    def attach(self, step: Callable[[Simulator], None], every_ms: float = 1) -> None:
        """A plant: `step(plc)` is called each `every_ms` of virtual time, from now on, while time passes. It reads
        outputs and sets inputs."""
        _check_callable(step)
        every = _ns(every_ms)
        if every <= 0:
            raise UsageError("A plant needs a step of more than 0 ms.", "time")
        self._plants.append(_Plant(step, every, self.now_ns + every))

    def at(self, after_ms: float, step: Callable[[Simulator], None]) -> None:
        """`step(plc)` is called once, when so much virtual time has passed; never, if there is a `restart` before."""
        _check_callable(step)
        self._plants.append(_Plant(step, 2 * MAX_NS, self.now_ns + _ns(after_ms)))

    def _step_plants(self) -> None:
        """Calls the plants whose time has come."""
        for plant in self._plants:
            while plant.due_ns <= self.now_ns:
                plant.due_ns += plant.every_ns
                plant.step(self)

    # ---- time ----

    def _now(self) -> float:
        return self.now_ns / 1e9

    @property
    def now_ns(self) -> int:
        """Virtual time since power on [ns]."""
        return int(self._lib.SimNow())

    def run_cycles(self, count: int, *, check: bool = True) -> None:
        """Runs until the first task has made `count` more cycles. Raises ProgramStopped when the program stopped with
        an exception; without `check`, `status()` has it."""
        if not isinstance(count, SupportsIndex) or not 0 <= count <= _MAX_CYCLES:
            raise UsageError(f"At most {_MAX_CYCLES} cycles are run at once, and at least 0, not {count!r}.", "cycles")
        left = int(count)
        self._check_not_halted()
        while left > 0 and self.raw_status().exception is None and not self.is_halted:
            step = 1 if self._plants or self._worker is not None else min(left, _CYCLES_AT_ONCE)
            self._run_cycles(step)
            left -= step
        if check:
            self.check_running()

    def _run_cycles(self, count: int) -> None:
        """With the steps of plants on the way."""
        limit = self.now_ns + lib.SIM_RUN_LIMIT_MS * 1_000_000
        while True:
            due = min([_NEVER, *(plant.due_ns for plant in self._plants)])
            result = self._timed(lambda count, due: self._lib.SimRunCyclesUntil(count, due), count, due)
            if self.is_halted:
                return
            if result != lib.ERR_PENDING or self.now_ns > limit:
                break
            self._step_plants()
        if result in (lib.ERR_TIMEOUT, lib.ERR_PENDING):
            message = "The first task waits for something that does not happen; give a time (--time) instead."
            raise DeviceError(message, "waits", result)
        if result not in (lib.ERR_OK, lib.ERR_EXCEPTION):
            _check(result, "The program does not run")

    def run_for(self, ms: float | timedelta = 0, *, seconds: float = 0, check: bool = True) -> None:
        """Lets virtual time pass: ten times 10 ms are ten cycles of a 10 ms task. Raises UsageError for a time that is
        negative or longer than 146 years, or none at all, and ProgramStopped as `run_cycles` does."""
        if not isinstance(ms, int | float | timedelta):
            raise UsageError(f"run_for takes milliseconds or a timedelta, not {ms!r}.", "time")
        passed = ms / timedelta(milliseconds=1) if isinstance(ms, timedelta) else ms
        ns = _ns(passed, seconds)
        if not 0 <= ns < MAX_NS:
            raise UsageError(f"Time passes forwards, and for at most {MAX_NS // 10**9} s.", "time")
        end = self.now_ns + ns
        self._check_not_halted()
        while not self.is_halted and self._plants and (due := min(p.due_ns for p in self._plants)) <= end:
            self._run_for(due - self.now_ns)
            if not self.is_halted:
                self._step_plants()
        if not self.is_halted:
            self._run_for(end - self.now_ns)
        if check:
            self.check_running()

    def _run_for(self, ns: int) -> None:
        end = self.now_ns + max(0, ns)
        while True:
            most = _NS_AT_ONCE if self._worker is None else _NS_DEBUGGED
            result = self._timed(lambda ns: self._lib.SimRunFor(ns), min(end - self.now_ns, most))
            if self.is_halted:
                return
            _check(result, "Time does not advance")
            if self.now_ns >= end:
                return

    def _timed(self, call: Callable[..., int], *arguments: int) -> int:
        """Lets time pass by a call of the C core; 0 if the program halted in it."""

        def run() -> int:
            with self._functions.while_running():
                return call(*arguments)

        worker, watcher = self._worker, self._watcher
        if worker is None:
            return run()
        if watcher is None:
            return worker.run(run) or 0
        watcher.before(self)
        worker.start(run)
        while self.is_halted:
            watcher.halted(self)
        return worker.settle() or 0

    # ---- breakpoints ----

    @property
    def is_halted(self) -> bool:
        """Whether the program stands still in the middle of a cycle, and time with it."""
        return self._worker is not None and self._worker.is_busy

    def _check_not_halted(self) -> None:
        if self.is_halted:
            raise UsageError("The program is halted at a breakpoint; let it go on first.", "halted")

    def _make_debugger(self) -> Debugger:
        return Debugger(_DebuggedSimulator(self))

    @contextmanager
    def _not_debugged(self) -> Iterator[None]:
        """For what stops the program: the cycle in which it is halted ends; its breakpoints are set again after it."""
        if self._worker is None or self._debugger is None:
            yield
            return
        self._lib.AppBpDetach()
        self._worker.settle()
        self._debugger.forget_halt()
        try:
            yield
        finally:
            self._debugger.install_again()

    def run_devices(self, ns: int) -> None:
        """In a function of the program: virtual time passes for the devices, and the program stands still in its cycle.
        Its outputs leave, and its inputs come, as often as its first task runs otherwise."""
        _check(self._lib.SimRunDevices(ns), "Time does not advance")

    def bench(self, task: int, cycles: int) -> tuple[float, float]:
        """Real time per call of a task's code alone, and of a complete cycle with what the runtime adds [ns]."""
        code, cycle = self._ffi.new("double *"), self._ffi.new("double *")
        _check(self._lib.SimBench(task, cycles, code, cycle), "The benchmark failed")
        return code[0], cycle[0]

    # ---- variables ----

    def _read(self, table: SymbolTable, symbols: Sequence[Symbol]) -> Contents:
        """As they are between two cycles."""
        forced = self._lib.ForceGetSerial() if self._lib.ForceGetCount() else None
        return Contents([self._variables.content(symbol) for symbol in symbols], consistent=True, forced=forced)

    def _write(self, table: SymbolTable, changes: Sequence[tuple[Symbol, Change]]) -> int:
        for symbol, _ in changes:
            self._variables.writable(symbol)  # all or none are written
        for symbol, change in changes:
            memory = self._variables.writable(symbol)
            part = slice(change.offset, change.offset + len(change.data))
            both = zip(change.data, memory[part], strict=True)
            memory[part] = bytes(new & change.mask | old & ~change.mask for new, old in both)
            if is_input(symbol) and table.io:
                first = symbol.offset * 8 + (symbol.bit or 0)
                self.follow_inputs(first, first + (1 if symbol.bit is not None else symbol.size * 8))
        return 1

    def _force(self, table: SymbolTable, changes: Sequence[tuple[Symbol, ForcedPlace]]) -> None:
        self._check_allowed(lib.OPERATION_FORCE, "force")
        self._variables.force(changes)

    def _unforce(self, table: SymbolTable, places: Sequence[ForcedPlace]) -> None:
        self._variables.unforce(places)

    def _unforce_all(self) -> None:
        self._lib.ForceEndAll()

    def _read_forces(self) -> ForceList:
        return self._variables.forces()

    def memory(self, area: Area, offset: int, size: int) -> memoryview:
        """Bytes of an area, to read and to write, until this simulator is closed."""
        return self._variables.area(area, offset, size)

    # ---- traces ----

    def create_trace(self, config: bytes) -> int:
        return sim_traces.create_trace(self._running(), config)

    def delete_trace(self, packet: int) -> None:
        sim_traces.delete_trace(self._running(), packet)

    def next_trace(self, packet: int) -> tuple[int, bytes] | None:
        return sim_traces.next_trace(self._running(), packet)

    def read_trace(self, packet: int, first: int, sizes: Sequence[int]) -> TraceState:
        return sim_traces.read_trace(self._running(), packet, first, sizes)

    def _running(self) -> Core:
        """The core, as far as it is not given back."""
        return Core(self._ffi, self._lib)

    def _pass_cycle(self, recording: Recording) -> None:
        self.run_for(max(recording.interval_us / 1000, 1))

    def follow_inputs(self, first_bit: int, end_bit: int) -> None:
        """These bits of the inputs were written: the devices measure that from now on."""
        self.io.follow(first_bit, end_bit, partial(self.memory, Area.INPUT))


class _DebuggedSimulator(Target):
    """What a simulator does for a debugger (`debug.breakpoints.Target`)."""

    def __init__(self, sim: Simulator) -> None:
        self._sim = sim
        self._ffi, self._lib = sim._ffi, sim._lib

    def attach(self, keep: bool) -> None:
        result = self._lib.AppBpAttach(keep)
        if result == lib.ERR_NOT_SUPPORTED:
            raise DeviceError("Breakpoints need an x86-64 processor here.", "no-breakpoints", result)
        _check(result, "The debugger is refused")
        if self._sim._worker is None:
            self._sim._worker = Worker(lambda: bool(self._lib.AppBpIsHalted()))

    def detach(self) -> None:
        self._lib.AppBpDetach()
        worker, self._sim._worker = self._sim._worker, None
        if worker is not None:
            worker.end()

    def status(self) -> BpStatus:
        c = self._ffi.new("BP_STATUS *")
        self._lib.AppBpGetStatus(c)
        return BpStatus(
            bool(c.supported),
            bool(c.attached),
            bool(c.halted),
            c.serial,
            c.code,
            c.task,
            None if c.code_offset == lib.APP_NO_CODE_OFFSET else c.code_offset,
            c.stack_size,
            c.stack,
            tuple(c.area),
            c.breakpoints,
            c.room,
            c.traps,
            None if c.link == lib.APP_NO_CODE_OFFSET else c.link,
        )

    def set(self, offset: int, skip: int, condition: DeviceCondition | None) -> None:
        c = self._ffi.new("BP_BREAKPOINT *")
        c.offset, c.skip = offset, skip
        if condition is not None:
            c.condition.relation, c.condition.kind = condition.relation, condition.kind
            c.condition.place = self._sim._variables.c_place(condition.place)[0]
            c.condition.value = int.from_bytes(condition.place.value, "little")
        _check(self._lib.AppBpSet(c), "The breakpoint cannot be set")

    def clear(self, offset: int) -> None:
        _check(self._lib.AppBpClear(offset), "The breakpoint cannot be cleared")

    def hits(self) -> dict[int, int]:
        c = self._ffi.new("BP_BREAKPOINT *")
        found: dict[int, int] = {}
        while self._lib.AppBpGet(len(found), c):
            found[c.offset] = c.hits
        return found

    def watch(self, places: Sequence[ForcedPlace], offsets: Sequence[int]) -> None:
        self._lib.AppBpClearWatches()
        for place in places:
            _check(self._lib.AppBpAddWatch(self._sim._variables.c_place(place)), "The variable cannot be compared")
        for offset in offsets:
            _check(self._lib.AppBpAddWatchTrap(offset), "The variable cannot be compared there")

    def temporary(self, offsets: Sequence[int]) -> None:
        self._lib.AppBpClearTemporary()
        for offset in offsets:
            _check(self._lib.AppBpAddTemporary(offset), "The step cannot be made")

    def go(self, how: int, serial: int) -> None:
        _check(self._lib.AppBpGo(how), "The program does not go on")
        if self._sim._watcher is not None and self._sim._worker is not None:
            self._sim._worker.wait()  # what let time pass gets what was raised
        elif self._sim._worker is not None:
            self._sim._worker.settle()

    def pause(self) -> None:
        _check(self._lib.AppBpPause(), "The program cannot be halted")

    def pass_time(self, seconds: float) -> float:
        before = self._sim.now_ns
        self._sim.run_for(seconds=min(seconds, _NS_DEBUGGED / 1e9), check=False)
        return seconds if self._sim.raw_status().exception else (self._sim.now_ns - before) / 1e9

    def table(self) -> SymbolTable:
        return self._sim.symbols()

    def task_names(self) -> list[str]:
        return self.table().tasks

    def read_areas(self, symbols: Sequence[Symbol]) -> list[bytes | None]:
        return [self._read_area(symbol) for symbol in symbols]

    def _read_area(self, symbol: Symbol) -> bytes | None:
        with suppress(DeviceError):
            return self._sim._variables.content(symbol)
        return None

    def write_area(self, symbol: Symbol, change: Change) -> None:
        self._sim._write(self.table(), [(symbol, change)])

    def read_stack(self, distance: int, size: int) -> bytes:
        return bytes(self._stack(distance, size))

    def write_stack(self, distance: int, data: bytes) -> None:
        self._stack(distance, len(data))[:] = data

    def _stack(self, distance: int, size: int) -> Any:
        at = self._lib.AppBpGetStack(distance, size)
        if at == self._ffi.NULL:
            raise DeviceError("The stack of the program cannot be read there.", "no-stack")
        return self._ffi.buffer(at, size)


@dataclass
class _Plant:
    """`due_ns`: when `step` is called next."""

    step: Callable[[Simulator], None]
    every_ns: int
    due_ns: int


def _ns(ms: float, seconds: float = 0) -> int:
    """Raises UsageError for what is infinite or not a number."""
    for part in (ms, seconds):
        if not isinstance(part, SupportsFloat) or not isfinite(part):
            raise UsageError(f"{part!r} is not a length of time.", "time")
    return round(ms * 1e6 + seconds * 1e9)


def _check_callable(step: object) -> None:
    if not callable(step):
        raise UsageError(f"A plant is a function that gets the simulator, not {step!r}.", "plant")


def _check(result: int, what: str) -> None:
    if result != lib.ERR_OK:
        raise DeviceError(f"{what}: {l7.why(result)}.", l7.slug(error_name(result)), result)
