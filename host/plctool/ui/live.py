"""The controller of a page, in one thread: what browsers want to see is polled, what they ask for is done in between.

All browsers together cost one request for values each PERIOD, and none while no browser is there.
"""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from plctool.controller import Controller
from plctool.controller_documents import Document, alarms, log, program_document, status_document, tasks
from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Reading, Symbol
from plctool.device import Plc
from plctool.errors import DeviceError, InternalError, LinkError, PlcError, UsageError
from plctool.gateway.frames import BUSY
from plctool.iec.types import ArrayType, OpenArrayType, StructType
from plctool.link.monitoring import APP_CHANGED
from plctool.ui.sources import lines_around

PERIOD = 0.1  # between two readings of the values [s]
STATUS_PERIOD = 1.0  # of state, tasks, log and devices [s]
RETRY = 1.0  # until a lost controller is looked for again [s]
SYMBOLS_RETRY = 5.0  # until symbols are looked for again [s]: it may take a file from the controller
LOG_SHOWN = 300  # newest entries
_FOREVER = 3600.0
_STEADY = timedelta(seconds=2)  # between two readings of the same time

Publish = Callable[[str, Any], None]
Job = Callable[[Controller], Any]


@dataclass(frozen=True)
class Target:
    """What the page is about. `open` connects to it, and does so again after the link was lost; `pass_time` is called
    as often as values are read, or more often, and returns when it wants to be called again [s]. `folders`: where the
    sources of the program may be."""

    name: str
    open: Callable[[], Controller]
    pass_time: Callable[[Controller], float] | None = None
    folders: Sequence[Path] = ()


@dataclass(frozen=True)
class Wanted:
    """What all browsers together show: the names of variables, and the views `tasks`, `log` and `io`."""

    browsers: int = 0
    names: frozenset[str] = frozenset()
    views: frozenset[str] = frozenset()


@dataclass
class _Due:
    """When what is done next (time.monotonic)."""

    values: float = 0.0
    status: float = 0.0
    symbols: float = 0.0
    time: float = field(default_factory=time.monotonic)


class Live:
    """`publish(topic, content)` is called with what has been read; `want` and `do` may be called by any thread."""

    def __init__(self, target: Target, publish: Publish) -> None:
        self._target = target
        self._publish = publish
        self._jobs: queue.SimpleQueue[tuple[Job, Future[Any]]] = queue.SimpleQueue()
        self._wanted = Wanted()
        self._ended = False
        self._due = _Due()
        self._table: SymbolTable | None = None
        self._read: dict[str, tuple[bytes | None, list[Any]]] = {}  # what was read last, and what browsers get of it
        self._known: dict[str, Symbol | str] = {}  # what was resolved in this table, or why not
        self._since: dict[str, datetime] = {}  # of alarms
        self._program: tuple[str | None, Document | None] = (None, None)  # by CRC

    # ---- for other threads ----

    def want(self, wanted: Wanted) -> None:
        """From now on this is polled."""
        self._wanted = wanted
        self.do(lambda plc: self._poll_soon())

    def do(self, job: Job) -> Future[Any]:
        """Runs a job with the controller; the future has what it returns, or its PlcError."""
        future: Future[Any] = Future()
        self._jobs.put((job, future))
        return future

    def end(self) -> None:
        """Lets `run` return."""
        self._ended = True
        self.do(lambda plc: None)

    # ---- the thread of the controller ----

    def run(self, plc: Controller) -> None:
        """Serves until `end`, or an exception such as KeyboardInterrupt; closes the controller."""
        while not self._ended:
            with plc:
                lost = self._serve(plc)
            if lost is not None:
                self._say_lost(lost)
                found = self._opened_again()
                if found is None:
                    return
                plc = found

    def _serve(self, plc: Controller) -> LinkError | None:
        """Returns the error when the link is lost, None at the end."""
        self._due = _Due()
        self._table, self._known = None, {}
        self._say_linked("")
        while not self._ended:
            try:
                self._run_job(plc, self._until_next())
                self._poll(plc)
            except PlcError as error:  # of a controller that is there: it is busy, or refuses what the page needs
                if isinstance(error, LinkError) and error.code != BUSY:
                    return error
                self._say_linked(error.message)
                later = time.monotonic() + STATUS_PERIOD
                self._due.values = self._due.status = self._due.time = later
        return None

    def _until_next(self) -> float:
        """Seconds until there is something to do besides jobs."""
        due = [time.monotonic() + _FOREVER]
        if self._wanted.browsers:
            due += [self._due.values, self._due.status]
        if self._target.pass_time is not None:
            due.append(self._due.time)
        return max(0.0, min(due) - time.monotonic())

    def _run_job(self, plc: Controller, seconds: float) -> None:
        try:
            job, future = self._jobs.get(timeout=seconds) if seconds > 0 else self._jobs.get_nowait()
        except queue.Empty:
            return
        if not future.set_running_or_notify_cancel():
            return
        try:
            future.set_result(job(plc))
        except PlcError as error:
            future.set_exception(error)
            if isinstance(error, LinkError) and error.code != BUSY:
                raise
        except Exception as error:
            future.set_exception(InternalError(error))

    def _poll_soon(self) -> None:
        self._due.values = self._due.status = 0.0

    def _poll(self, plc: Controller) -> None:
        now = time.monotonic()
        if self._target.pass_time is not None and now >= self._due.time:
            self._due.time = now + self._target.pass_time(plc)
        wanted = self._wanted
        if not wanted.browsers:
            return
        if now >= self._due.values:
            self._due.values = now + PERIOD
            self._poll_values(plc, wanted)
        if now >= self._due.status:
            self._due.status = now + STATUS_PERIOD
            self._poll_status(plc, wanted)

    # ---- values ----

    def _poll_values(self, plc: Controller, wanted: Wanted) -> None:
        table = self._symbols(plc)
        if table is None:
            return
        known = {name: self._resolved(table, name) for name in wanted.names}
        symbols = {name: symbol for name, symbol in known.items() if isinstance(symbol, Symbol)}
        values: dict[str, list[Any]] = {
            name: ["", False, None, reason] for name, reason in known.items() if isinstance(reason, str)
        }
        whole, problem = True, ""
        if symbols:
            try:
                reading = plc.sample_symbols(table, symbols)
            except DeviceError as error:
                if error.code == APP_CHANGED:
                    self._due.symbols = 0.0
                    return
                problem = error.message
            else:
                whole = reading.consistent
                values |= self._shown(reading)
        self._publish("reading", {"whole": whole, "problem": problem})
        self._publish("values", values)

    def _shown(self, reading: Reading) -> dict[str, list[Any]]:
        """The values that were read; those that are as before are the same objects."""
        before, forced = self._read, set(reading.forced)
        self._read = {
            name: known
            if (known := before.get(name)) is not None and known[0] == data and known[1][1] is (name in forced)
            else (data, _shown(reading.symbols[name], data, name in forced))
            for name, data in reading.contents.items()
        }
        return {name: shown for name, (_, shown) in self._read.items()}

    def _symbols(self, plc: Controller) -> SymbolTable | None:
        """The symbols of the program that runs; None if there are none, which is published."""
        if self._table is None and time.monotonic() < self._due.symbols:
            return None
        try:
            table = plc.symbols()
        except (UsageError, DeviceError) as error:
            self._table, self._known = None, {}
            self._due.symbols = time.monotonic() + SYMBOLS_RETRY
            self._publish("symbols", {"crc": None, "message": error.message, "table": None})
            return None
        if table is not self._table:
            self._table, self._known, self._read = table, {}, {}
            crc = f"{table.image_crc:08X}"
            self._publish("symbols", {"crc": crc, "message": "", "table": table})
        return table

    def _resolved(self, table: SymbolTable, name: str) -> Symbol | str:
        """The variable, or why there is none to show."""
        if name not in self._known:
            if len(self._known) > 4 * len(self._wanted.names) + 1000:
                self._known = {}
            self._known[name] = shown_symbol(table, name)
        return self._known[name]

    # ---- state, tasks, log and devices ----

    def _poll_status(self, plc: Controller, wanted: Wanted) -> None:
        status = status_document(plc.status())
        if self._program[0] != status["image_crc"]:
            self._program = (status["image_crc"], self._program_of(plc))
            self._due.symbols = 0.0
        if exception := status["exception"]:
            exception["source"] = lines_around(exception["file"], exception["line"], self._target.folders)
        self._say_linked("")
        self._publish("status", status | {"program": self._program[1]})
        views: dict[str, Callable[[], Any]] = {
            "tasks": lambda: tasks(plc)["tasks"],
            "log": lambda: log(plc)["entries"][-LOG_SHOWN:],
            "alarms": lambda: self._alarms(plc),
            "io": lambda: self._io(plc),
        }
        for view in wanted.views & set(views):
            self._publish(view, _or_message(views[view]))

    def _program_of(self, plc: Controller) -> Document | None:
        if isinstance(plc, Plc):
            return program_document(plc)
        with suppress(UsageError, DeviceError):
            return {"name": plc.symbols().project, "version": ""}
        return None

    def _alarms(self, plc: Controller) -> list[Document]:
        """The alarms, each with a time of day: that of this machine, if the program does not know any."""
        found: list[Document] = alarms(plc)["alarms"]
        for alarm in found:
            age = alarm.pop("age_s")
            if age is not None:
                alarm["since"] = self._steady(alarm["name"], datetime.now() - timedelta(seconds=age))
        return found

    def _steady(self, name: str, at: datetime) -> str:
        """The time at which an alarm came into its state, the same in each reading though these are not as exact."""
        known = self._since.get(name)
        if known is None or abs(known - at) > _STEADY:
            self._since[name] = known = at
        return known.isoformat(" ", "seconds")

    def _io(self, plc: Controller) -> Document:
        """The devices of a controller, and the channels that the symbols name."""
        channels = [] if self._table is None else self._table.io.get("channels", [])
        devices = plc.io_devices() if isinstance(plc, Plc) else []
        return {
            "devices": [{**vars(device), "state": device.state} for device in devices],
            "channels": [
                {k: c[k] for k in ("device", "channel", "output", "variable", "type", "address")} for c in channels
            ],
        }

    # ---- the link ----

    def _say_linked(self, message: str) -> None:
        self._publish("link", {"name": self._target.name, "connected": True, "message": message})

    def _say_lost(self, error: PlcError) -> None:
        self._publish("link", {"name": self._target.name, "connected": False, "message": error.message})

    def _opened_again(self) -> Controller | None:
        """Looks for the controller until it is there; None at the end."""
        while not self._ended:
            self._refuse_jobs(time.monotonic() + RETRY)
            if self._ended:
                break
            try:
                plc = self._target.open()
            except PlcError as error:
                self._say_lost(error)
            else:
                return plc
        return None

    def _refuse_jobs(self, until: float) -> None:
        while (seconds := until - time.monotonic()) > 0 and not self._ended:
            with suppress(queue.Empty):
                _, future = self._jobs.get(timeout=seconds)
                if future.set_running_or_notify_cancel():
                    future.set_exception(LinkError("The link to the device is lost; try again when it is back."))


def shown_symbol(table: SymbolTable, name: str) -> Symbol | str:
    """Returns a variable that a page can show, or why it cannot."""
    try:
        symbol = table.resolve(name)
    except UsageError as error:
        return error.message
    if name.lstrip().startswith("%"):  # one outside the memory of the program would spoil the reading of all others
        return "The page shows declared variables, not addresses."
    if isinstance(symbol.type, StructType | ArrayType | OpenArrayType):
        return f"{name} has no value of its own; show its parts."
    return symbol


def _shown(symbol: Symbol, data: bytes | None, forced: bool) -> list[Any]:
    """What browsers get of a value: text, mark of a force, number for a plot, and no reason why there is none."""
    value = None if data is None else symbol.decode(data)
    return [symbol.literal(value), forced, _number(value), ""]


def _number(value: Any) -> float | int | None:
    """What a plot shows; None for what is not a number."""
    if isinstance(value, bool):
        return int(value)
    return value if isinstance(value, int | float) and math.isfinite(value) else None


def _or_message(read: Callable[[], Any]) -> Any:
    """What was read, or why not: a device may be built without it."""
    try:
        return read()
    except (DeviceError, UsageError) as error:
        return {"message": error.message}
