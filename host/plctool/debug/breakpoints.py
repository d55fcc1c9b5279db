"""Breakpoints and steps, on any controller that has them.

The controller knows traps at offsets of its code, and how a halted task goes on; this knows lines, calls and
expressions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import dataclass, field, replace

from plctool.core import exception_name, lib
from plctool.debug.expressions import NAME, check_expression
from plctool.debug.forced import ForcedPlace, name_forced, place_of
from plctool.debug.halted import BpStatus, Call, Halted
from plctool.debug.statements import CodeOfLine, Statements
from plctool.debug.symbols import SymbolTable
from plctool.debug.target import DeviceCondition, Target
from plctool.debug.variables import Symbol
from plctool.debug.watches import Changed, DataBreakpoint, Watches, check_watchable
from plctool.errors import DeviceError, PlcError, UsageError
from plctool.iec.types import Elementary, Kind, base_of

_RELATIONS = {
    "=": lib.BP_EQUAL, "<>": lib.BP_NOT_EQUAL, "<": lib.BP_LESS, "<=": lib.BP_LESS_EQUAL, ">": lib.BP_GREATER,
    ">=": lib.BP_GREATER_EQUAL,
}  # fmt: skip
_SIMPLE = re.compile(rf"\s*({NAME.pattern})\s*(<=|>=|<>|=|<|>)\s*([-\w.#:+']+)\s*")
_SIZES = (1, 2, 4, 8)
_SHORTEST = 1e-6  # time that passes [s]


@dataclass(frozen=True)
class Breakpoint:
    """A breakpoint at a line. `line` is the one that has code. `hits`: it halts when it is met for this time, and after
    that; `condition` and `log` are as typed. `by_device`: the controller checks the condition, without a halt."""

    number: int
    file: str
    line: int
    offsets: tuple[int, ...]
    condition: str = ""
    hits: int = 1
    log: str = ""
    by_device: DeviceCondition | None = None


@dataclass(frozen=True)
class Halt:
    """Why and where a task halted. `reason`: breakpoint, data breakpoint, step, pause or exception; `exception` is its
    name; `changed`: the variables of data breakpoints."""

    reason: str
    task: str
    halted: Halted
    breakpoints: list[Breakpoint] = field(default_factory=list)
    exception: str = ""
    changed: list[Changed] = field(default_factory=list)

    @property
    def calls(self) -> list[Call]:
        """The calls that have not returned, the innermost first."""
        return self.halted.calls

    def __str__(self) -> str:
        where = (
            f"{self.calls[0].pou}, {self.calls[0].file}:{self.calls[0].line}" if self.calls else "code without a line"
        )
        what = f"exception {self.exception}" if self.exception else ", ".join(map(str, self.changed)) or self.reason
        return f"{self.task} halted ({what}): {where}"


Places = Callable[[int], set[int]]
"""Where a step from an offset may lead."""


class Debugger:
    """Breakpoints of one controller. It is attached when it is made; `close` takes all breakpoints out.

    `keep`: breakpoints and a halted task stay when this process ends. `output` gets what logpoints say. Raises
    DeviceError if the controller has no breakpoints.
    """

    def __init__(self, target: Target, *, keep: bool = False, output: Callable[[str], None] = print) -> None:
        self._target = target
        self._keep = keep
        self.output = output
        self._number = 0
        self._breakpoints: dict[int, Breakpoint] = {}
        self._halt: Halt | None = None
        self._asked: str = ""  # what ends with the next halt: step or pause
        self._how = int(lib.BP_GO)
        self._loaded: tuple[SymbolTable, Statements] | None = None
        self._temporary: frozenset[int] = frozenset()
        self._counts: dict[int, int] = {}  # of true conditions that only this checks, by breakpoint
        self._watches = Watches()
        target.attach(keep)

    def close(self) -> None:
        """All breakpoints end, and what is halted goes on."""
        self._halt = None
        with suppress(PlcError):
            self._target.detach()
        self._breakpoints.clear()
        self._watches = Watches()

    @property
    def table(self) -> SymbolTable:
        """The symbols of the program."""
        return self._known()[0]

    @property
    def statements(self) -> Statements:
        """The lines of the program."""
        return self._known()[1]

    def _known(self) -> tuple[SymbolTable, Statements]:
        table = self._target.table()
        if self._loaded is None or self._loaded[0] is not table:
            self._loaded = (table, Statements(table))
        return self._loaded

    # ---- breakpoints ----

    def set(self, file: str, line: int, *, condition: str = "", hits: int = 1, log: str = "") -> Breakpoint:
        """Sets a breakpoint at a line, or at the next one that has code. With `log` the program does not halt: `output`
        gets the text, with values in place of {expressions}. Raises UsageError for what makes no sense, DeviceError if
        the controller refuses it."""
        code = self.statements.find_line(file, line)
        if hits < 1:
            raise UsageError(f"A breakpoint halts from the first hit on, or a later one, not from {hits}.", "hits")
        if condition:
            check_expression(condition)
        by_device = self._by_device(condition) if condition else None
        self._number += 1
        made = Breakpoint(self._number, code.file, code.line, code.offsets, condition, hits, log, by_device)
        self._install(made)
        self._breakpoints[made.number] = made
        return made

    def watch(self, what: str | Symbol, *, condition: str = "", hits: int = 1) -> DataBreakpoint:
        """Halts when a variable has changed: at the next place where the controller compares it (`granularity`). A name
        is one of a program or a global one. Raises UsageError for what is not compared, DeviceError if the controller
        has no room."""
        symbol = self.table.resolve(what) if isinstance(what, str) else what
        check_watchable(symbol)
        if not isinstance(what, str):  # a member of an instance: by its name in the program
            symbol = next(s for s, _ in name_forced([place_of(symbol)], self.table.variables.values()).values())
        if hits < 1:
            raise UsageError(f"A breakpoint halts from the first hit on, or a later one, not from {hits}.", "hits")
        if condition:
            check_expression(condition)
        self._number += 1
        made = DataBreakpoint(self._number, symbol, condition, hits)
        self._watches.listed[made.number] = made
        try:
            self._install_watches()
        except PlcError:
            del self._watches.listed[made.number]
            self._install_watches()
            raise
        return made

    def _install_watches(self) -> None:
        self._watches.install(self._target, self.statements, self._target.status())

    @property
    def granularity(self) -> str:
        """Where the controller compares the variables of data breakpoints."""
        return self._watches.granularity

    def watched(self) -> list[tuple[DataBreakpoint, int]]:
        """The data breakpoints, and how many changes of each were seen."""
        return [(b, self._watches.counts.get(b.number, 0)) for b in self._watches.listed.values()]

    def _install(self, made: Breakpoint) -> None:
        skip = made.hits - 1 if self._halts_at_once(made) else 0
        for offset in made.offsets:
            self._target.set(offset, skip, made.by_device)

    @staticmethod
    def _halts_at_once(made: Breakpoint) -> bool:
        """Whether the controller counts the hits: of what only the host can check, it would count others, too."""
        return not made.condition or made.by_device is not None

    def clear(self, number: int) -> None:
        """Ends a breakpoint. Raises UsageError if there is none of this number."""
        if self._watches.listed.pop(number, None) is not None:
            self._install_watches()
            return
        if number not in self._breakpoints:
            raise UsageError(f"There is no breakpoint {number}.", "no-breakpoint")
        gone = self._breakpoints.pop(number)
        others = {offset: other for other in self._breakpoints.values() for offset in other.offsets}
        for offset in gone.offsets:
            if offset in others:
                self._install(others[offset])
            else:
                with suppress(DeviceError):  # it ended with the program
                    self._target.clear(offset)

    def clear_all(self) -> None:
        for number in [*self._breakpoints, *self._watches.listed]:
            self.clear(number)

    def list(self) -> list[tuple[Breakpoint, int]]:
        """The breakpoints, and how often the controller met each. Those that have ended there are set again."""
        self._keep_set(self._target.status())
        hits = self._target.hits()
        return [(b, max((hits.get(offset, 0) for offset in b.offsets), default=0)) for b in self._breakpoints.values()]

    def _keep_set(self, status: BpStatus) -> bool:
        """Sets the breakpoints again that the controller has forgotten, and says so. False: it has them."""
        offsets = {offset for b in self._breakpoints.values() for offset in b.offsets}
        if status.attached and status.breakpoints >= len(offsets):
            return False
        had = {b.number: f"{b.file}:{b.line}" for b in self._breakpoints.values()}
        had |= {b.number: b.name for b in self._watches.listed.values()}
        reason = "has another program" if status.attached else "has heard nothing of this debugger for 5 s"
        self.output(f"The controller {reason}, or another tool has ended the breakpoints: they are set again.")
        self.install_again()
        for number, place in had.items():
            if number not in self._breakpoints and number not in self._watches.listed:
                self.output(f"Breakpoint {number} has ended: the program has no {place} any more.")
        return True

    def forget_halt(self) -> None:
        """The program has gone on by other means."""
        self._halt, self._asked = None, ""

    def install_again(self) -> None:
        """After a download or a reset: the breakpoints at the same lines. One whose line has no code any more ends."""
        self._target.attach(self._keep)
        for old in list(self._breakpoints.values()):
            del self._breakpoints[old.number]
            with suppress(UsageError):
                code = self.statements.find_line(old.file, old.line)
                by_device = self._by_device(old.condition) if old.condition else None
                made = Breakpoint(
                    old.number, code.file, code.line, code.offsets, old.condition, old.hits, old.log, by_device
                )
                self._install(made)
                self._breakpoints[made.number] = made
        for watch in list(self._watches.listed.values()):
            try:
                self._watches.listed[watch.number] = replace(watch, symbol=self.table.resolve(watch.name))
            except UsageError:
                del self._watches.listed[watch.number]
        self._install_watches()

    def _by_device(self, condition: str) -> DeviceCondition | None:
        """`variable operator constant`, if the controller can compare that."""
        match = _SIMPLE.fullmatch(condition)
        if match is None:
            return None
        with suppress(UsageError):
            symbol = self.table.resolve(match[1])
            base = base_of(symbol.type)
            if not isinstance(base, Elementary) or symbol.size not in _SIZES or symbol.fixed is not None:
                return None
            place = place_of(symbol)
            if len(place.hops) > lib.PLACE_POINTERS:
                return None
            change = symbol.change(symbol.parse(match[3]))
            value = bytes([bool(any(change.data))]) if place.is_bits else change.data
            kind = lib.BP_REAL if base.kind is Kind.REAL else lib.BP_SIGNED if base.signed else lib.BP_UNSIGNED
            known = ForcedPlace(place.area, place.offset, place.hops, place.size, place.mask, value)
            return DeviceCondition(known, _RELATIONS[match[2]], kind)
        return None

    # ---- halts ----

    @property
    def halt(self) -> Halt | None:
        """Where the program is halted; None while it runs."""
        return self._halt

    def wait(self, seconds: float = 10.0) -> Halt | None:
        """Lets the program run until it halts, at most so long; of a simulator that is virtual time. None: it still
        runs."""
        while self._halt is None:
            self._halt = self._look()
            if self._halt is None and seconds < _SHORTEST:
                break
            if self._halt is None:
                seconds -= self._target.pass_time(seconds)
        return self._halt

    def _look(self) -> Halt | None:
        """The halt, if there is one that concerns the user; the program goes on from others."""
        status = self._target.status()
        if self._keep_set(status):
            self._asked = ""
            status = self._target.status()
        while status.halted:
            halt = self._explained(status)
            if halt is not None:
                self._asked = ""
                return halt
            self._target.go(self._how if self._asked == "step" else lib.BP_GO, status.serial)
            status = self._target.status()
        return None

    def _explained(self, status: BpStatus) -> Halt | None:
        halted = self._target.halted(status, self.table)
        names = self._target.task_names()
        task = names[status.task] if status.task < len(names) else f"task {status.task}"
        if not status.code:
            return Halt("dump", task, halted)
        if status.code != lib.RTSEXCPT_BREAKPOINT:
            return Halt("exception", task, halted, [], exception_name(status.code))
        here = [b for b in self._breakpoints.values() if status.code_offset in b.offsets]
        hit = [b for b in here if self._is_hit(b, halted)]
        compared = status.code_offset in self._watches.traps
        changed = [c for c in self._watches.changed(halted) if self._is_wanted(c, halted)] if compared else []
        if hit or changed:
            return Halt("breakpoint" if hit else "data breakpoint", task, halted, hit, changed=changed)
        temporary = self._temporary if self._asked else frozenset()
        if status.code_offset in temporary:
            return Halt(self._asked, task, halted)
        return None if here or compared or not self._asked else Halt(self._asked, task, halted)

    def _is_wanted(self, changed: Changed, halted: Halted) -> bool:
        """Counts a change, and checks the condition and the hits."""
        b, counts = changed.breakpoint, self._watches.counts
        if b.condition and not self._holds(b.number, b.condition, halted):
            return False
        counts[b.number] = counts.get(b.number, 0) + 1
        return counts[b.number] >= b.hits

    def _holds(self, number: int, condition: str, halted: Halted) -> bool:
        """True also of a condition that cannot be evaluated: the output says why."""
        try:
            return bool(halted.evaluate(condition, halted.calls[0] if halted.calls else None))
        except PlcError as error:
            self.output(f"Breakpoint {number}: {error}")
            return True

    def _is_hit(self, b: Breakpoint, halted: Halted) -> bool:
        call = halted.calls[0] if halted.calls else None
        if b.condition and b.by_device is None:
            try:
                if not halted.evaluate(b.condition, call):
                    return False
            except PlcError as error:
                self.output(f"Breakpoint {b.number}: {error}")
                return True
            if not self._count_hit(b):
                return False
        if b.log:
            self.output(self._filled(b.log, halted, call))
            return False
        return True

    def _count_hit(self, b: Breakpoint) -> bool:
        """Of a condition that the host checks: whether it has been true often enough."""
        self._counts[b.number] = self._counts.get(b.number, 0) + 1
        return self._counts[b.number] >= b.hits

    @staticmethod
    def _filled(log: str, halted: Halted, call: Call | None) -> str:
        def value(match: re.Match[str]) -> str:
            try:
                with suppress(UsageError):
                    return halted.text(halted.resolve(match[1], call))
                return str(halted.evaluate(match[1], call))
            except PlcError as error:
                return f"<{error}>"

        return re.sub(r"\{([^{}]*)\}", value, log)

    # ---- going on ----

    def _halted(self) -> tuple[Halt, BpStatus]:
        if self._halt is None:
            raise UsageError("The program runs; only one that is halted can step.", "not-halted")
        return self._halt, self._target.status()

    def go(self) -> None:
        """The program runs on."""
        _, status = self._halted()
        self._go(lib.BP_GO, status.serial, "")

    def _go(self, how: int, serial: int, asked: str) -> None:
        self._target.go(how, serial)
        self._halt, self._asked, self._how = None, asked, how

    def step_over(self) -> None:
        """To the next line of the same POU, or to where it was called."""
        self._step(self.statements.step_over, out=True)

    def step_into(self) -> None:
        """To the next line, also of what this line calls."""
        self._step(lambda offset: self.statements.step_over(offset) | set(self.statements.beginnings), out=True)

    def step_out(self) -> None:
        """To where this POU was called; of a program, to the next cycle of its task."""
        self._step(lambda offset: set(), out=True)

    def step_cycle(self) -> None:
        """To the first line of the next cycle of this task."""
        self._halted()
        self._step(lambda offset: set(self._entries()), out=False)

    def run_to(self, file: str, line: int) -> CodeOfLine:
        """To a line, or the next one that has code."""
        code = self.statements.find_line(file, line)
        self._step(lambda offset: set(code.offsets), out=False)
        return code

    def _step(self, places: Places, *, out: bool) -> None:
        _, status = self._halted()
        assert self._halt is not None
        frames = self._halt.halted.frames()
        offset = frames[0].offset if frames else None
        traps = places(offset) if offset is not None else set()
        caller = next((f for f in frames[1:] if self._has_source(f.offset)), None) if out else None
        if caller is not None:
            traps.add(caller.offset + 1)
        if out and (caller is None or caller is not frames[1]):
            traps |= set(self.statements.beginnings)
        how = lib.BP_STEP if caller is not None else lib.BP_STEP_OUT
        self._set_temporary(traps, status)
        self._go(how, status.serial, "step")

    def _has_source(self, offset: int) -> bool:
        """Whether a call is one of the source, not one of a part of a POU or of a task."""
        scopes = self.table.debug_info.scopes(offset)
        return bool(self.statements.of_function(offset)) and (not scopes or scopes[0].pou != "")

    def _entries(self) -> Sequence[int]:
        """The first statement of the program that the task is in; of all POUs if that is not known."""
        assert self._halt is not None
        frames = self._halt.halted.frames()
        outer = next((f.offset for f in reversed(frames) if self._has_source(f.offset)), 0)
        function = self.table.debug_info.function_at(outer)
        begin, end = function or (0, 0)
        return [b for b in self.statements.beginnings if begin <= b < end] or self.statements.beginnings

    def _set_temporary(self, offsets: AbstractSet[int], status: BpStatus) -> None:
        used = status.breakpoints + len(self._watches.traps - offsets)
        if len(offsets) + used > status.traps:
            raise DeviceError(
                f"This step may lead to {len(offsets)} places, and the controller has room for {status.traps}; "
                "set a breakpoint and go on instead.",
                "too-many-places",
            )
        self._temporary = frozenset(offsets)
        self._target.temporary(sorted(offsets))

    def pause(self) -> None:
        """The program halts at the next line that it reaches."""
        if self._halt is not None:
            return
        status = self._target.status()
        every = self.statements.stops
        most = status.traps - status.breakpoints - len(self._watches.traps - every)
        self._set_temporary(every if len(every) <= most else set(self.statements.beginnings), status)
        self._asked = "pause"
        with suppress(DeviceError):  # it has halted meanwhile
            self._target.pause()
