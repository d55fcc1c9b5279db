"""A controller, on a link (`device.Plc`) or in this process (`sim.Simulator`).

An operation uses only `Controller`, so it works on both. What both do the same way is done here; what
each does its own way is abstract.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Never, Self, overload

from plctool.controller_results import (
    ChangeResult,
    Closed,
    ExceptionInfo,
    FlashResult,
    OtherTool,
    PlcStatus,
    ProgramStopped,
)
from plctool.core import lib
from plctool.debug.alarms import (
    CONFIRM,
    HISTORY,
    NOW,
    Alarm,
    History,
    alarm_of,
    chosen,
    history_of,
    in_order,
    member,
    need_alarms,
    now_of,
    shared,
    variables_of,
)
from plctool.debug.breakpoints import Debugger
from plctool.debug.exchange import check_base, is_at, other_tasks, removed_variables, with_names
from plctool.debug.forced import ForcedPlace, ForceList, forcible, name_forced, not_forced, place_of
from plctool.debug.kept_changes import KeptChanges, kept_changes
from plctool.debug.recipes import (
    Difference,
    Fitting,
    Loaded,
    Recipe,
    differences,
    fit_recipe,
    not_kept,
    read_recipe,
    recipe_of,
    recipe_variables,
    write_recipe,
)
from plctool.debug.recording import Recording
from plctool.debug.symbols import (
    SourceLine,
    SymbolTable,
    cache_path,
    find_symbols,
    is_pattern,
    load_symbols,
    symbol_path,
)
from plctool.debug.variables import Change, Reading, Symbol
from plctool.errors import DeviceError, UsageError
from plctool.files import write_atomically
from plctool.image.file import image_crc, parse_image, read_program
from plctool.link.monitoring import Contents
from plctool.link.services import AppException, AppState, LogEntry, Status, TaskInfo, went_down
from plctool.link.traces import (
    RunningTrace,
    TraceConfig,
    TraceOptions,
    TraceState,
    columns_of,
    columns_on,
    decode_config,
    encode_config,
)

__all__ = [
    "OPERATIONS",
    "RESET_OPTIONS",
    "ChangeResult",
    "Closed",
    "Controller",
    "ExceptionInfo",
    "FlashResult",
    "OtherTool",
    "PlcStatus",
    "ProgramStopped",
]

_CONDITION_S = 2.0  # a debugger needs less for a condition, unless its machine is very busy
_CONDITION_POLL_S = 0.01
RESET_OPTIONS = {
    "warm": lib.RESET_OPTION_WARM,
    "cold": lib.RESET_OPTION_COLD,
    "origin": lib.RESET_OPTION_ORIGIN,
}

OPERATIONS = ("online change", "download", "stop", "breakpoint", "write", "force", "reset")
"""What a program may forbid, by the number OPERATION_* (CmpOperationControl.h)."""


class Controller(ABC):
    """One controller. Use it as a context manager."""

    def __init__(self) -> None:
        self._tables: dict[int, SymbolTable] = {}  # by CRC of the image
        self._forces: ForceList | None = None  # that was read last
        self._debugger: Debugger | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Ends the use of the controller; never raises, harmless when repeated."""

    def others(self) -> list[OtherTool]:
        """The other tools that use the same line at present; none when this process has it to itself."""
        return []

    @abstractmethod
    def log(self, after: int = 0, *, kept: bool = False) -> list[LogEntry]:
        """The log entries with a handle above `after` that the controller still has, oldest first. `kept`: those that
        outlast power-off, starts, stops, exceptions and causes of resets. Raises DeviceError if it keeps none."""

    # ---- the application ----

    def flash(
        self,
        image: Path | str | bytes,
        *,
        start: bool = True,
        force: bool = False,
        unchecked: bool = False,
        boot: bool | None = None,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> FlashResult:
        """Replaces the application and starts it. The old one runs until the new one has arrived and passed all checks.

        `force`: also when the controller has this very image already. `unchecked`: the image is not checked here;
        the controller checks it anyway. `boot`: whether the program starts at power-up, in place of the previous one;
        False: when `create_boot_project` makes it so. None: as a setting of the device says, which is True in most.
        `progress` gets the bytes that have arrived and their total. Other tools must wait meanwhile. Raises LinkError
        when one of them is downloading, UsageError for what is not an image, DeviceError when the controller refuses
        it.
        """
        data = image if isinstance(image, bytes) else read_program(Path(image), unchecked)
        if not unchecked:
            parse_image(data)
        what = "a program" if isinstance(image, bytes) else Path(image).name
        with self._alone(f"downloading {what}"):
            if not isinstance(image, bytes):
                _keep_symbols(Path(image), image_crc(data))
            return self._flash(data, start, force, unchecked, boot, progress)

    def _flash(
        self,
        data: bytes,
        start: bool,
        force: bool,
        unchecked: bool,
        boot: bool | None,
        progress: Callable[[int, int], None],
    ) -> FlashResult:
        crc = image_crc(data)
        status = self._status_before(data)
        is_there = (status.image_crc, status.image_size) == (crc, len(data))
        skipped = is_there and status.exception is None and not force and not unchecked
        begin = self._now()
        if not skipped:
            self._download(data, start, is_there or unchecked, boot, lambda done: progress(done, len(data)))
        seconds = self._now() - begin
        persistent = None if skipped else self._kept_changes(status.image_crc, crc)
        if skipped and start and status.state is not AppState.RUN:
            self.start()
        now = self.raw_status()
        if start and not skipped and now.image_crc == crc:
            now = self._started(now)
        if now.image_crc != crc:
            raise went_down()
        boots = bool(now.operating_state & lib.OS_BOOTPROJECT_VALID)
        return FlashResult(len(data), seconds, skipped, now.state, persistent, boots)

    @abstractmethod
    def create_boot_project(self) -> None:
        """Makes the program what starts at power-up, if it is not yet. Raises DeviceError without one."""

    def change(
        self,
        image: Path | str | bytes,
        *,
        unchecked: bool = False,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> ChangeResult:
        """Replaces the application by an image that was built with it as base, between two cycles: variables that both
        have keep their values. What is forced of removed variables is not forced any more; traces of them end, and all
        breakpoints.
        `unchecked`: the image is not checked here; the controller checks it anyway.

        Raises UsageError for an image that was not built to replace what runs, DeviceError when the controller refuses
        it. The application goes on as it was then.
        """
        data = image if isinstance(image, bytes) else read_program(Path(image))
        with self._alone("changing the program"):
            if not isinstance(image, bytes):
                _keep_symbols(Path(image), image_crc(data))
            status = self._status_before(data)
            if not unchecked:
                check_base(data, status.image_crc)
            self._wait_for_conditions(status)
            self.end_debugging()  # its breakpoints are in the old code
            tables = self._both_tables(status.image_crc, image_crc(data))
            forced = {} if tables is None else self._release(*tables)
            removed = ([], set[int]()) if tables is None else (removed_variables(*tables), other_tasks(*tables))
            ended = self._end_traces_of(*removed)
            begin = self._now()
            try:
                self._change(data, lambda done: progress(done, len(data)))
            except DeviceError as error:
                self._force_again(forced)
                raise with_names(error, self._tables.get(status.image_crc)) from None
            seconds = self._now() - begin
            now = self.raw_status()
            if now.image_crc != image_crc(data):
                raise went_down()
            released = self._force_again(forced)
            if tables is not None:
                self._renew_traces(status.image_crc, now.image_crc, *removed)
        return ChangeResult(len(data), seconds, now.state, released, ended)

    def _wait_for_conditions(self, status: Status) -> None:
        """A debugger that evaluates a condition halts the program for some milliseconds. Raises DeviceError when it
        stays halted."""
        end = time.monotonic() + _CONDITION_S
        own = self._debugger is not None and self._debugger.halt is not None
        while status.state is AppState.HALTED:
            if own or time.monotonic() > end:
                raise DeviceError("A debugger has halted the program; let it go on first.", "halted")
            time.sleep(_CONDITION_POLL_S)
            status = self.raw_status()

    def _both_tables(self, before: int, after: int) -> tuple[SymbolTable, SymbolTable] | None:
        """The symbols of two programs; None if those of one are not known."""
        with suppress(UsageError):
            return (self._tables.get(before) or find_symbols(before), self._tables.get(after) or find_symbols(after))
        return None

    def _release(self, had: SymbolTable, has: SymbolTable) -> dict[str, Any]:
        """Ends the force of variables that the new program does not have, or has at another place. Returns the
        values."""
        released: dict[str, tuple[Symbol, bytes]] = {}
        with suppress(DeviceError):
            variables = list(had.variables.values())
            places = []
            for place in self._read_forces().places:
                named = name_forced([place], variables)
                known = any(is_at(had, name, symbol.place) for name, (symbol, _) in named.items())
                if known and not all(is_at(has, name, symbol.place) for name, (symbol, _) in named.items()):
                    places.append(place)
                    released |= named
            if places:
                self._unforce(had, places)
        return {name: symbol.decode(content) for name, (symbol, content) in released.items()}

    def _force_again(self, values: Mapping[str, Any]) -> list[str]:
        """Forces variables that have moved; returns those that cannot be, such as removed ones."""
        failed = []
        for name, value in values.items():
            try:
                self.force({name: value})
            except (DeviceError, UsageError):
                failed.append(name)
        return failed

    def _end_traces_of(self, removed: Sequence[Symbol], tasks: Collection[int]) -> list[str]:
        ended = []
        with suppress(DeviceError):
            for packet, config in list(self._packets()):
                if config.is_about(removed, tasks):
                    self.delete_trace(packet)
                    ended.append(config.name)
        return ended

    def _renew_traces(self, before: int, after: int, removed: Sequence[Symbol], tasks: Collection[int]) -> None:
        """Makes the persistent traces of the program `before` those of `after`, but for those of removed variables and
        of tasks that are other ones."""
        return  # a controller that keeps files has some

    @abstractmethod
    def _change(self, data: bytes, progress: Callable[[int], None]) -> None:
        """Sends an image for an online change, which is done when it returns."""

    def _status_before(self, data: bytes) -> Status:
        """The status before a download of this image."""
        return self.raw_status()

    def _started(self, now: Status) -> Status:
        """The status of an application that the controller has just installed and should have started; `now` is the
        first one. Older firmware waits for a start, others may have refused it: they give the reason here. Raises
        ProgramStopped when the initialisation failed."""
        if now.exception is not None and now.exception.task < 0:
            self.check_running()
        return self._start_checked() if now.state is AppState.STOP else now

    def _start_checked(self) -> Status:
        """As `start`, just after the controller has replied; the status then."""
        self.start()
        return self.raw_status()

    def _kept_changes(self, before: int, after: int) -> KeptChanges | None:
        """By the CRCs of both images."""
        with suppress(UsageError):
            had, has = (self._tables.get(crc) or find_symbols(crc) for crc in (before, after))
            return kept_changes(had.kept, has.kept)
        return None

    @abstractmethod
    def start(self) -> None:
        """Starts the application. Raises DeviceError when it stopped with an exception, or there is none."""

    @abstractmethod
    def stop(self) -> None:
        """Stops the application after the cycles that run just now. Raises DeviceError when there is none."""

    def reset(self, option: str = "warm") -> None:
        """Stops it; `warm` keeps RETAIN variables, `cold` only PERSISTENT ones, `origin` deletes the application."""
        if option not in RESET_OPTIONS:
            raise UsageError(f"There is no reset '{option}'; choose one of {', '.join(RESET_OPTIONS)}.", "bad-reset")
        self._reset(RESET_OPTIONS[option])

    def status(self) -> PlcStatus:
        """What the application does, and the exception that stopped it, with the names and lines of its symbols."""
        status = self.raw_status()
        exception = self._explain(status.image_crc, status.exception) if status.exception else None
        forced = list(self._named_forces(status.image_crc)) if status.operating_state & lib.OS_FORCE_ACTIVE else []
        forbidden = [name for bit, name in enumerate(OPERATIONS) if status.forbidden >> bit & 1]
        boots = bool(status.operating_state & lib.OS_BOOTPROJECT_VALID)
        return PlcStatus(status.state, status.image_crc, status.image_size, exception, forced, forbidden, boots)

    def check_running(self) -> None:
        """Raises ProgramStopped when the application stopped with an exception."""
        if self.raw_status().exception is not None and (exception := self.status().exception):
            raise ProgramStopped(exception)

    @abstractmethod
    def raw_status(self) -> Status:
        """The same as the controller reports it: an exception has a code offset and words of the stack."""

    def _explain(self, crc: int, exception: AppException) -> ExceptionInfo:
        """Adds names and locations from the symbols."""
        try:
            table = self._symbols_of(crc)
        except UsageError:
            table = None
        task = None
        with suppress(DeviceError):  # a device may be built without task information
            task = next((t.name for i, t in enumerate(self.tasks()) if i == exception.task), None)
        places = self._call_stack(table, exception) if table else []
        if not places:
            return ExceptionInfo(exception.code, exception.name, task)
        place, detail = places[0], ""
        if table is not None and exception.code == lib.RTSEXCPT_ARRAYBOUNDS:
            with suppress(DeviceError, UsageError):
                detail = table.what_was_outside(place, lambda symbols: self._read(table, symbols).values)
        return ExceptionInfo(
            exception.code, exception.name, task, place.pou, place.file, place.line, places[1:], detail
        )

    def _call_stack(self, table: SymbolTable, exception: AppException) -> list[SourceLine]:
        """Where it was raised, and the calls that led there, as far as the controller can be asked."""
        with suppress(DeviceError, UsageError):
            return table.whole_stack(
                exception.code_offset, exception.trace, lambda symbols: self._read(table, symbols).values
            )
        return table.call_stack(exception.code_offset, exception.trace)

    def info(self) -> dict[str, str]:
        """Project, author, version and so on, of the application. Raises DeviceError when the controller does not say
        it."""
        raise DeviceError("This controller does not say what its application is.", "no-info")

    @abstractmethod
    def tasks(self) -> list[TaskInfo]:
        """Statistics of the tasks."""

    # ---- variables ----

    def symbols(self) -> SymbolTable:
        """The symbols of the application on the controller. Raises UsageError when they cannot be found, DeviceError
        when there is no application."""
        return self._symbols_of(self._application_crc())

    def add_symbols(self, table: SymbolTable) -> None:
        """Symbols of an image that are neither in the cache nor beside it."""
        self._tables[table.image_crc] = table

    def _symbols_of(self, crc: int) -> SymbolTable:
        if crc not in self._tables:
            self._tables[crc] = self._find_symbols(crc)
        return self._tables[crc]

    def _find_symbols(self, crc: int) -> SymbolTable:
        return find_symbols(crc)

    @overload
    def read(self, name: str, /) -> Any: ...
    @overload
    def read(self, name: str, other: str, /, *more: str) -> dict[str, Any]: ...
    def read(self, *names: str) -> Any:
        """The value of one variable, or the values of several by the names given; also of those that match a pattern
        such as `Main.*`."""
        if not names:
            raise UsageError('Name a variable; write for example plc.read("Main.speed").')
        if not all(isinstance(name, str) for name in names):
            raise UsageError('Write the names one by one, as in plc.read("Main.a", "Main.b"); read_all takes a list.')
        values = self.read_all(names)
        return values if len(names) > 1 or is_pattern(names[0]) else values[names[0]]

    def read_all(self, names: Sequence[str]) -> dict[str, Any]:
        """Values by name. Structs and arrays come as dicts and lists, TIME as a string with a `timedelta`."""
        return self.sample(names).values

    def sample(self, names: Sequence[str]) -> Reading:
        """The variables with these names, or that match these patterns, as they are now; of one moment between two
        cycles if the reading says so.

        Raises UsageError for a name that is unknown, DeviceError when a pointer leads to no variable; what a pattern
        finds is None then.
        """
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise UsageError(f'This takes a list of names, such as ["Main.a", "Main.b"], not {names!r}.')
        table = self.symbols()
        reading = self.sample_symbols(table, table.select(names))
        typed = [name for name in names if not is_pattern(name)]
        reading.check(typed, lambda pointer: self._read(table, [pointer]).values[0])
        return reading

    def sample_symbols(self, table: SymbolTable, symbols: dict[str, Symbol]) -> Reading:
        """The same of variables of a table, by the names they are to have. None: a pointer leads to no variable."""
        contents = self._read(table, list(symbols.values()))
        forced = [] if contents.forced is None else self._forced_of(symbols, contents.forced)
        return Reading(symbols, dict(zip(symbols, contents.values, strict=True)), contents.consistent, forced)

    def _forced_of(self, symbols: dict[str, Symbol], serial: int) -> list[str]:
        """The names of those of which a part is in the list with this serial number, or a newer one."""
        if self._forces is None or self._forces.serial != serial:
            self._forces = self._read_forces()
        places = self._forces.places
        return [n for n, s in symbols.items() if s.fixed is None and any(place.overlaps(s) for place in places)]

    def write(self, values: Mapping[str, Any], *rest: Never) -> None:
        """Sets variables, at once if they fit a message; strings such as 'T#80ms' are understood. Writing one bit keeps
        the others of its byte. Raises UsageError, and writes nothing, when a value does not fit or is a
        constant; DeviceError when a pointer leads to no variable."""
        if rest and isinstance(values, str):
            raise UsageError(f"write takes a dict of names and values: write({{{values!r}: {rest[0]!r}}}).")
        if rest or not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
            raise UsageError(f'This takes names with values, such as {{"Main.speed": 5}}, not {values!r}.')
        table = self.symbols()
        named = [(table.resolve(name), value) for name, value in values.items()]
        for symbol, _ in named:
            symbol.check_writable(symbol.area)
        self._write(table, [(symbol, symbol.change(value)) for symbol, value in named])

    # ---- recipes ----

    def save_recipe(self, file: Path | str, names: Sequence[str] = ()) -> Recipe:
        """Writes the values of variables to a recipe: of names and patterns, or of those that the file has already.
        Raises UsageError for what is unknown or cannot be written."""
        path = Path(file)
        names = names or (list(read_recipe(path).values) if path.exists() else ())
        recipe = self.recipe(names, str(path))
        write_recipe(path, recipe)
        return recipe

    def recipe(self, names: Sequence[str], source: str = "The recipe") -> Recipe:
        """The values of variables as a recipe; `source` is what messages call it."""
        table = self.symbols()
        variables = {symbol.name: symbol for symbol in recipe_variables(table, names)}
        contents = self.sample_symbols(table, variables).contents
        held = {name: (symbol, contents[name]) for name, symbol in variables.items()}
        return recipe_of({name: (symbol, data) for name, (symbol, data) in held.items() if data is not None}, source)

    def check_recipe(self, recipe: Recipe | Path | str) -> list[Fitting]:
        """Checks names, types and ranges against the program. Raises UsageError, which names all mistakes."""
        return fit_recipe(self.symbols(), _recipe(recipe))

    def recipe_differences(self, recipe: Recipe | Path | str) -> list[Difference]:
        """The variables whose values differ from the recipe. Raises UsageError if the recipe does not fit."""
        return self._differences(self.check_recipe(recipe))

    def _differences(self, fittings: Sequence[Fitting]) -> list[Difference]:
        variables = {fitting.name: fitting.symbol for fitting in fittings}
        return differences(fittings, self.sample_symbols(self.symbols(), variables).contents)

    def load_recipe(self, recipe: Recipe | Path | str, then: Mapping[str, Any] | None = None) -> Loaded:
        """Checks a recipe, writes all of its values and reads them back. What fits one request is written in one; no
        power cut divides that. `then`: written after all that, such as {"Main.take_over": True}.

        Raises UsageError, and writes nothing, if the recipe or `then` does not fit the program; DeviceError if a
        variable has another value afterwards.
        """
        given = _recipe(recipe)
        fittings = self.check_recipe(given)
        for name, value in (then or {}).items():
            symbol = self.symbols().resolve(name)
            symbol.check_writable(symbol.area)
            symbol.change(value)
        changed = self._differences(fittings)
        requests = self._write(self.symbols(), [(fitting.symbol, fitting.change) for fitting in fittings])
        others = self._differences(fittings)
        if others:
            raise not_kept(given, others)
        if then:
            self.write(then)
        return Loaded(len(fittings), changed, requests == 1)

    # ---- alarms ----

    def alarms(self, *, all: bool = False) -> list[Alarm]:
        """The alarms of the program that are active or wait for an acknowledgement, these first, then by priority;
        with `all` also those that are normal. Raises UsageError if the program has no ALARM."""
        table = self.symbols()
        there = need_alarms(table)
        if not all:
            states = {name: member(alarm, "State") for name, alarm in there.items()}
            values = self.sample_symbols(table, states).values
            there = {name: alarm for name, alarm in there.items() if values[name] != "NORMAL"}
        values = self.sample_symbols(table, {NOW: now_of(table), **variables_of(there)}).values
        found = in_order([alarm_of(name, values, values[NOW]) for name in there])
        return [alarm for alarm in found if all or alarm.is_open]

    def alarm_history(self) -> History:
        """The changes of alarms that the controller still has. Raises UsageError if the program has no ALARM."""
        table = self.symbols()
        there = need_alarms(table)
        ids = {name: member(alarm, "Id__") for name, alarm in there.items()}
        values = self.sample_symbols(table, {HISTORY: shared(table, HISTORY), **ids}).values
        return history_of(values[HISTORY], {values[name]: name for name in ids})

    def acknowledge(self, names: Sequence[str] | None = None) -> list[str]:
        """Acknowledges the alarms of these names and patterns, or all, as far as they wait for it: the block does so
        when it is called next. Returns which. Raises UsageError for an unknown one."""
        table = self.symbols()
        there = need_alarms(table)
        wanted = list(there) if names is None else chosen(names, there)
        waiting = [alarm.name for alarm in self.alarms() if alarm.waits and alarm.name in wanted]
        confirm = {name: member(there[name], CONFIRM) for name in waiting}
        if confirm:
            self._write(table, [(symbol, symbol.change(True)) for symbol in confirm.values()])
        return waiting

    def unconfirmed(self, names: Sequence[str]) -> list[str]:
        """The alarms of these names whose blocks have not been called since they were acknowledged."""
        table = self.symbols()
        there = need_alarms(table)
        values = self.sample_symbols(table, {name: member(there[name], CONFIRM) for name in names}).values
        return [name for name, waits in values.items() if waits]

    # ---- forced variables ----

    def force(self, values: Mapping[str, Any]) -> None:
        """Keeps variables, inputs and outputs at these values, whatever the program and the devices write, until
        `unforce`, a reset, a download or power-off; all of them, or none when one cannot be forced. A value is
        what `write` takes; a bit, a scalar, an element or a member, not a string, an array or a structure.

        Raises UsageError for what cannot be forced, DeviceError when the controller has no room for as many.
        """
        if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
            raise UsageError(f'This takes names with values, such as {{"Main.speed": 5}}, not {values!r}.')
        table = self.symbols()
        named = [(forcible(table.resolve(name)), value) for name, value in values.items()]
        for symbol, _ in named:
            symbol.check_writable(symbol.area)
        changes = [(symbol, replace(place_of(symbol), value=symbol.change(value).data)) for symbol, value in named]
        try:
            self._force(table, changes)
        except DeviceError as error:
            raise not_forced(error, [symbol for symbol, _ in changes], self._read_forces) from None

    def unforce(self, names: Sequence[str] | None = None) -> None:
        """Ends the force of these variables, or of all with None. They keep their values until they are written.
        Raises UsageError, and ends nothing, when one is not forced."""
        if names is None:
            return self._unforce_all()
        if isinstance(names, str):
            raise UsageError(f'This takes a list of names, such as ["Main.a"], not {names!r}.')
        table = self.symbols()
        places = [(name, place_of(table.resolve(name))) for name in names]
        listed = self._read_forces().places
        for name, place in places:
            if not any(place.same_place(forced) for forced in listed):
                raise UsageError(f"{name} is not forced; 'plctool forced' shows what is.", "not-forced")
        self._unforce(table, [place for _, place in places])
        return None

    def forced(self) -> dict[str, Any]:
        """What is forced, by name, and the values."""
        return self.forced_reading().values

    def forced_reading(self) -> Reading:
        """The same as a reading."""
        found = self._named_forces(self._application_crc())
        symbols = {name: symbol for name, (symbol, _) in found.items()}
        return Reading(symbols, {name: content for name, (_, content) in found.items()}, forced=list(found))

    def _named_forces(self, crc: int) -> dict[str, tuple[Symbol, bytes]]:
        variables: list[Symbol] = []
        with suppress(UsageError):  # without symbols they have addresses only
            variables = list(self._symbols_of(crc).variables.values())
        self._forces = self._read_forces()
        return name_forced(self._forces.places, variables)

    # ---- traces ----

    def trace(
        self,
        names: Sequence[str],
        *,
        task: str | None = None,
        every: int = 1,
        samples: int = 1000,
        trigger: str | None = None,
        before: int = 0,
        level: bool = False,
        wait: float | None = None,
    ) -> Recording:
        """Records variables in the cycles of a task, as an oscilloscope does, and returns when all `samples` are here.

        `names`: of variables, structures and arrays; `@cycle`, `@late`, `@load` of the task. `task`: the first one by
        default. `every`: its every n-th cycle. `trigger`: a condition such as "Main.x > 5" or the name of a BOOL, from
        whose becoming true on samples are kept, and `before` of those before it; `level`: it need not have been false.
        `wait`: seconds after which what is here then is returned. In the simulator time passes meanwhile.

        Raises UsageError for what cannot be traced, DeviceError when the controller has no room or the trace is ended.
        """
        options = TraceOptions(every, samples, trigger, before, level)
        with self.start_trace(names, options, task) as running:
            return self.finish_trace(running, wait)

    def start_trace(self, names: Sequence[str], options: TraceOptions, task: str | None = None) -> RunningTrace:
        """Begins to record and returns at once; `poll` of what it returns reads what has been recorded."""
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise UsageError(f'This takes a list of names, such as ["Main.a", "Main.b"], not {names!r}.')
        table = self.symbols()
        columns = columns_of(table, names)
        index, info = self._task(task)
        if info.kind != lib.KIND_CYCLIC and any(column.name == "@load" for column in columns):
            raise UsageError(f"@load needs a cyclic task, and {info.name} is none; trace @cycle.", "not-traceable")
        if options.name and any(known.name == options.name for known in self.traces()):
            raise UsageError(
                f"There is a trace {options.name}; end it with 'plctool trace --end {options.name}', or choose another "
                "name.",
                "trace-exists",
            )
        config = encode_config(table, columns, index, info.interval_us, options)
        return RunningTrace(self, self.create_trace(config), decode_config(config), columns, info)

    def finish_trace(self, running: RunningTrace, wait: float | None = None) -> Recording:
        """Reads it until it is complete, for at most `wait` seconds."""
        end = None if wait is None else self._now() + wait
        while not running.is_complete and (end is None or self._now() < end):
            if not running.poll():
                self._pass_cycle(running.recording)
        return running.recording

    def traces(self) -> list[TraceConfig]:
        """What is traced, by this tool and others."""
        return [config for _, config in self._packets()]

    def open_trace(self, name: str) -> RunningTrace:
        """A trace that was begun with a name; its variables have the names of the symbols, if they are found."""
        packet, config = self._packet(name)
        table = None
        with suppress(UsageError):
            table = self._symbols_of(config.image_crc)
        tasks = self.tasks()
        if config.task >= len(tasks):
            raise DeviceError(f"The program has no task for the trace {name}.", "no-task")
        return RunningTrace(self, packet, config, columns_on(config, table), tasks[config.task])

    def end_trace(self, name: str) -> None:
        """Ends a trace that was begun with a name."""
        self.delete_trace(self._packet(name)[0])

    def _packet(self, name: str) -> tuple[int, TraceConfig]:
        found = list(self._packets())
        for packet, config in found:
            if config.name.casefold() == name.casefold():
                return packet, config
        known = [config.name for _, config in found if config.name]
        there = f"there are {', '.join(known)}" if known else "there is none with a name"
        raise UsageError(f"There is no trace {name}; {there}.", "no-such-trace")

    def _packets(self) -> Iterator[tuple[int, TraceConfig]]:
        packet = 0
        while (found := self.next_trace(packet)) is not None:
            packet, data = found
            yield packet, decode_config(data)

    def _task(self, name: str | None) -> tuple[int, TaskInfo]:
        """Index and statistics; the first one without a name."""
        tasks = self.tasks()
        for index, info in enumerate(tasks):
            if name is None or info.name.casefold() == name.casefold():
                return index, info
        if name is None:
            raise DeviceError("The program has no task.", "no-task")
        raise UsageError(f"There is no task {name}; there are {', '.join(t.name for t in tasks)}.", "no-task")

    @abstractmethod
    def _pass_cycle(self, recording: Recording) -> None:
        """Lets some time pass for the program."""

    @abstractmethod
    def create_trace(self, config: bytes) -> int:
        """Begins a packet; as all with packets as TraceAccess says it."""

    @abstractmethod
    def delete_trace(self, packet: int) -> None: ...

    @abstractmethod
    def next_trace(self, packet: int) -> tuple[int, bytes] | None: ...

    @abstractmethod
    def read_trace(self, packet: int, first: int, sizes: Sequence[int]) -> TraceState: ...

    # ---- breakpoints ----

    @property
    def breakpoints(self) -> Debugger:
        """Breakpoints, steps and what a halted program shows. Attached at the first use; a controller on a link takes
        all breakpoints out when nothing has asked it for 5 s. Raises DeviceError if the controller has none."""
        if self._debugger is None:
            self._debugger = self._make_debugger()
        return self._debugger

    @abstractmethod
    def _make_debugger(self) -> Debugger: ...

    def end_debugging(self) -> None:
        """All breakpoints end, and a halted program goes on."""
        if self._debugger is not None:
            self._debugger.close()
            self._debugger = None

    # ---- what each kind does its own way ----

    @abstractmethod
    def _now(self) -> float:
        """Seconds, for the time a transfer takes."""

    def _alone(self, purpose: str) -> AbstractContextManager[None]:
        """Other tools must wait; `purpose`, such as "downloading app.cdl", is shown to them."""
        return nullcontext()

    @abstractmethod
    def _download(
        self, data: bytes, start: bool, restart: bool, boot: bool | None, progress: Callable[[int], None]
    ) -> None:
        """Makes an image the application. With `start` it is started if the controller does that with the download,
        else stopped. `restart`: from the first byte. `boot`: as of `flash`. Raises DeviceError with the reason when it
        is refused."""

    @abstractmethod
    def _reset(self, option: int) -> None:
        """`option`: RESET_OPTION_*."""

    @abstractmethod
    def _application_crc(self) -> int:
        """The CRC of the application's image. Raises DeviceError when there is none."""

    @abstractmethod
    def _read(self, table: SymbolTable, symbols: Sequence[Symbol]) -> Contents:
        """Their bytes. Raises DeviceError when the symbols are no longer those of the application."""

    @abstractmethod
    def _write(self, table: SymbolTable, changes: Sequence[tuple[Symbol, Change]]) -> int:
        """Returns how many requests it took. Raises DeviceError when a pointer to one of the variables leads to no
        variable."""

    @abstractmethod
    def _force(self, table: SymbolTable, changes: Sequence[tuple[Symbol, ForcedPlace]]) -> None:
        """Raises DeviceError with MONITORING_ERR_* as its result, or when a pointer leads to no variable."""

    @abstractmethod
    def _unforce(self, table: SymbolTable, places: Sequence[ForcedPlace]) -> None: ...

    @abstractmethod
    def _unforce_all(self) -> None: ...

    @abstractmethod
    def _read_forces(self) -> ForceList: ...


def _recipe(recipe: Recipe | Path | str) -> Recipe:
    return recipe if isinstance(recipe, Recipe) else read_recipe(Path(recipe))


def _keep_symbols(image: Path, crc: int) -> None:
    """Puts the symbols beside an image where they are found later, also from another folder."""
    source, kept = symbol_path(image), cache_path(crc)
    with suppress(OSError, UsageError):
        if load_symbols(source).image_crc == crc:
            kept.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(kept, source.read_bytes())  # another process may read it now
