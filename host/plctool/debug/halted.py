"""What a debugger sees of a program that is halted: its calls, and the variables of each of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from plctool.debug.call_frames import StackFrame
from plctool.debug.expressions import evaluate
from plctool.debug.frames import INSTANCE, POINTER_TO
from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Change, Symbol, Units, shown, walk
from plctool.errors import DeviceError, UsageError
from plctool.iec.areas import Area
from plctool.iec.types import ELEMENTARY, Elementary, Kind, OpenArrayType, StructType, Type, base_of
from plctool.image.targets import Machine, find_target

STACK = 0x100  # the area of what is on the stack of the halted task; its offset counts from the stack pointer
_MOST_STACK = 64 * 1024  # bytes that are read to find the calls


@dataclass(frozen=True)
class BpStatus:
    """What a controller says of its breakpoints, as BP_STATUS has it. `areas`: the address of each; `link`: the code
    offset in the link register of processors that have one."""

    supported: bool
    attached: bool
    halted: bool
    serial: int
    code: int
    task: int
    code_offset: int | None
    stack_size: int
    stack: int
    areas: tuple[int, ...]
    breakpoints: int
    room: int
    traps: int
    link: int | None = None


class Memory(Protocol):
    """The memory of a controller."""

    def read_areas(self, symbols: Sequence[Symbol]) -> list[bytes | None]:
        """Bytes of variables in the areas."""

    def write_area(self, symbol: Symbol, change: Change) -> None: ...

    def read_stack(self, distance: int, size: int) -> bytes: ...

    def write_stack(self, distance: int, data: bytes) -> None: ...


@dataclass(frozen=True)
class Call:
    """A call that has not returned: the POU and the line where it is; the innermost one is where the task halted."""

    pou: str
    file: str
    line: int
    frame: StackFrame


class Halted:
    """A halted task. Names are looked up in a call: its variables first, then those of the program."""

    def __init__(self, status: BpStatus, table: SymbolTable, memory: Memory) -> None:
        self._status = status
        self._table = table
        self._memory = memory
        self._units = Units(table.classes)
        target = find_target(table.target)
        self._word = target.pointer_size
        self._mode_bit = int(target.machine in (Machine.THUMB, Machine.THUMB_V6M))
        self.calls = list(self._calls())

    # ---- calls ----

    def _calls(self) -> Iterator[Call]:
        for frame in self.frames():
            place = self._table.address_to_line(frame.offset)
            if place is None:
                continue
            scopes = self._table.debug_info.scopes(frame.offset)
            named = scopes[0].pou if scopes else place.pou
            if named:  # not what only calls the parts of a POU
                yield Call(named, place.file, place.line, frame)

    def frames(self) -> list[StackFrame]:
        """All calls, also those that have no line."""
        size = min(self._status.stack_size, _MOST_STACK)
        data = self._memory.read_stack(0, size) if size else b""
        base = self._status.areas[Area.CODE.value]
        end = self._table.lines[-1][0] if self._table.lines else 0
        words = {}
        for at in range(0, len(data) - self._word + 1, self._word):
            target = int.from_bytes(data[at : at + self._word], "little") - self._mode_bit - base
            if 0 < target <= end:
                words[at] = target
        return self._table.debug_info.frames(self._status.code_offset, words, self._status.link)

    # ---- variables ----

    def locals(self, call: Call) -> dict[str, Symbol]:
        """The variables of a call on the stack, parameters included."""
        found = self._on_stack(call)
        return {name: symbol for name, symbol in found.items() if name != INSTANCE}

    def instance(self, call: Call) -> dict[str, Symbol]:
        """The members of the instance that a function block or method works on, and those of a program."""
        own = self._on_stack(call).get(INSTANCE)
        if own is not None:
            parts = {part.name.removeprefix(own.name + "."): part for part in own.parts()}
            return {
                name: replace(shown(part, self._units), name=name) for name, part in parts.items() if "%" not in name
            }
        prefix = call.pou.casefold() + "."
        named = {n: s for n, s in self._table.variables.items() if n.casefold().startswith(prefix) and "%" not in n}
        return {name[len(prefix) :]: shown(symbol, self._units) for name, symbol in named.items()}

    def _on_stack(self, call: Call) -> dict[str, Symbol]:
        """By name; the order is that of the declarations."""
        places = self._table.debug_info.variables(call.frame.offset)
        found: dict[str, Symbol] = {}
        for name, t in self._types(call.pou).items():
            direct, pointer = places.get(name), places.get(POINTER_TO + name)
            if direct is not None:
                found[name] = Symbol(name, STACK, call.frame.stack + direct, t)
            elif pointer is not None and not isinstance(t, OpenArrayType):
                way = Symbol(name, STACK, call.frame.stack + pointer, t)
                found[name] = Symbol(name, 0, 0, t, None, way)
        return found

    def _types(self, pou: str) -> dict[str, Type]:
        return self._table.frames.get(pou, {})

    def resolve(self, path: str, call: Call | None) -> Symbol:
        """What a name means in a call. Raises UsageError."""
        text = path.strip()
        first = text
        for sign in ".[^":
            first = first.partition(sign)[0]
        for names in (self.locals(call), self.instance(call)) if call is not None else ():
            root = next((s for n, s in names.items() if n.casefold() == first.casefold()), None)
            if root is not None:
                return walk(root, first + text[len(first) :], len(first), self._units)
        return self._table.resolve(text)

    def in_area(self, path: str, call: Call | None) -> Symbol:
        """What a name means in a call, as a variable that stays when the call returns. Raises UsageError."""
        return self.symbol_in_area(self.resolve(path, call))

    def symbol_in_area(self, symbol: Symbol) -> Symbol:
        """The same for a variable that was resolved: pointers that begin on the stack are followed."""
        found = self._found(symbol)
        if found is None:
            raise UsageError(f"{symbol.name} cannot be reached: a pointer leads to no variable.", "no-target")
        if found.area == STACK:
            raise UsageError(f"{symbol.name} is a variable of a call, which ends with it.", "on-stack")
        return found

    def read(self, symbols: Sequence[Symbol]) -> list[bytes | None]:
        """Their bytes; None where a pointer leads to no variable."""
        found = [self._found(symbol) for symbol in symbols]
        plain = [s for s in found if s is not None and s.area != STACK and s.fixed is None]
        read = iter(self._memory.read_areas(plain))
        return [
            None if s is None else self._stack_bytes(s) if s.area == STACK else s.fixed or next(read) for s in found
        ]

    def value(self, path: str, call: Call | None) -> Any:
        """The value of a variable as an expression uses it: TIME and the like as a number."""
        symbol = self.resolve(path, call)
        (data,) = self.read([symbol])
        if data is None:
            raise DeviceError(f"{symbol.name} cannot be reached: a pointer leads to no variable.", "no-target")
        base = base_of(symbol.type)
        if symbol.bit is None and isinstance(base, Elementary) and base.kind in (Kind.TIME, Kind.DATE):
            return int.from_bytes(data, "little")
        return symbol.decode(data)

    def evaluate(self, text: str, call: Call | None) -> Any:
        """The value of an expression."""
        return evaluate(text, lambda name: self.value(name, call))

    def text(self, symbol: Symbol) -> str:
        """The value of a variable as ST writes it; "?" if a pointer leads to no variable."""
        (data,) = self.read([symbol])
        return "?" if data is None else symbol.literal(symbol.decode(data))

    def write(self, path: str, text: str, call: Call | None) -> Symbol:
        """Sets a variable to the value that a person typed. Raises UsageError."""
        return self.write_symbol(self.resolve(path, call), text)

    def write_symbol(self, symbol: Symbol, text: str) -> Symbol:
        """The same for a variable that was resolved."""
        if isinstance(symbol.type, StructType):
            raise UsageError(f"{symbol.name} has several parts; name one of them.", "no-value")
        change = symbol.change(symbol.parse(text))
        found = self._found(symbol)
        if found is None:
            raise DeviceError(f"{symbol.name} cannot be reached: a pointer leads to no variable.", "no-target")
        found.check_writable(found.area)
        if found.area != STACK:
            self._memory.write_area(found, change)
            return symbol
        old = self._memory.read_stack(found.offset + change.offset, len(change.data))
        new = bytes(n & change.mask | o & ~change.mask for n, o in zip(change.data, old, strict=True))
        self._memory.write_stack(found.offset + change.offset, new)
        return symbol

    # ---- pointers ----

    def _found(self, symbol: Symbol) -> Symbol | None:
        """The variable in an area or on the stack, pointers followed as far as they begin on the stack."""
        if symbol.pointer is None or (symbol.place[0] != STACK and self._root(symbol).area != STACK):
            return symbol
        pointer = self._found(replace(symbol.pointer, type=ELEMENTARY["LWORD" if self._word == 8 else "DWORD"]))
        if pointer is None:
            return None
        (data,) = self.read([pointer])
        return None if data is None else self._at_address(symbol, int.from_bytes(data[: self._word], "little"))

    @staticmethod
    def _root(symbol: Symbol) -> Symbol:
        while symbol.pointer is not None:
            symbol = symbol.pointer
        return symbol

    def _at_address(self, symbol: Symbol, address: int) -> Symbol | None:
        """The same variable by the place that a pointer holds."""
        distance = address - self._status.stack
        if 0 <= distance < self._status.stack_size:
            return replace(symbol, area=STACK, offset=distance + symbol.offset, pointer=None)
        below = [(base, area) for area, base in enumerate(self._status.areas) if 0 < base <= address]
        if not below:
            return None
        base, area = max(below)
        return replace(symbol, area=area, offset=address - base + symbol.offset, pointer=None)

    def _stack_bytes(self, symbol: Symbol) -> bytes | None:
        if symbol.offset < 0 or symbol.offset + symbol.size > self._status.stack_size:
            return None
        return self._memory.read_stack(symbol.offset, symbol.size)
