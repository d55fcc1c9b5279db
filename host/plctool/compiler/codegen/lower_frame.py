"""The function being written: its context, its memory, its run-time checks.

How each kind of expression, place and statement is written say the modules `lower_...`: a function for each kind, which
registers here with `rule`. So they have the parts of a node written without knowing who does it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from plctool.compiler.base.internal import note_position
from plctool.compiler.codegen.bounds import bounds_check
from plctool.compiler.codegen.ir import NULL, FixedPointer, Function, Value, number
from plctool.compiler.codegen.lengths import KnownLengths, Lengths
from plctool.compiler.codegen.lower_unit import ALL_CHECKS, RAISE, REALS, Check, Form, Unit, value_type
from plctool.compiler.codegen.memory import Memory
from plctool.compiler.codegen.trail import SIZE as TRAIL_SIZE
from plctool.compiler.typed.analysis import Effects
from plctool.compiler.typed.nodes import Dispatch, Expr, External, Label, Place, Pos, Pou, Statement, Variable
from plctool.core import ffi, lib
from plctool.debug.passed_lines import PassedLine
from plctool.iec.areas import Area
from plctool.iec.types import DINT, MAX_ALIGN, Elementary, StringType, Type, alignment_at, base_of, is_scalar

FrameType = TypeVar("FrameType", bound="Frame")
Node = TypeVar("Node")
Written = TypeVar("Written")


_WORD = 4  # bytes
NO_CAPACITY = Value("")  # of what is not a string
RAISED = FixedPointer("%raised")  # where a function leaves the number of an exception that it returns


@dataclass(slots=True)  # not frozen, which takes longer: there is one for every access
class Ref:
    """An address in the generated code: `pointer` plus `offset` bytes, holding a `type`.

    `tag`: alias tag or "". `direct`: reached by name only, not through a pointer. `capacity`: of a STRING
    [characters], an i32; `length`: how many it has, if that holds wherever this is used. `bit`: the bit of an integer
    that a BOOL lives in, -1 for none; `type` is then that integer's. `loose`: a character that may never have been
    written (after the NUL). `sure`: the address is a multiple of so many bytes whatever the type wants, of which a
    packed structure has less.
    """

    pointer: Value
    offset: int
    type: Type
    tag: str = ""
    direct: bool = False
    capacity: Value = NO_CAPACITY
    length: Value | None = None
    bit: int = -1
    loose: bool = False
    sure: int = MAX_ALIGN

    @property
    def align(self) -> int:
        """What the address is a multiple of, in bytes."""
        return min(self.type.align, self.sure)

    @property
    def unaligned(self) -> bool:
        """Whether code that expects a whole variable of the type cannot have this address."""
        return self.sure < self.type.align

    def crosses(self, other: Ref) -> bool:
        """Whether they share memory without being at one place: variables at addresses, and members of a UNION."""
        between = other.offset - self.offset
        return self.pointer == other.pointer and between != 0 and -other.type.size < between < self.type.size

    def member(self, offset: int, t: Type, tag: str = "") -> Ref:
        """A part of it, `offset` bytes further on."""
        sure = alignment_at(offset, self.align)
        return Ref(self.pointer, self.offset + offset, t, tag, self.direct, string_capacity(t), sure=sure)


def string_capacity(t: Type) -> Value:
    return number(t.length) if isinstance(t, StringType) else NO_CAPACITY


class Handler(ABC):
    """Where an exception goes on."""

    @property
    def has_lines(self) -> bool:
        """Whether the line where it was raised is reported, because it stops the task or may do so."""
        return False

    @abstractmethod
    def raise_code(self, frame: Frame, code: int) -> None:
        """Ends a block by raising RTSEXCPT_* `code`."""

    @abstractmethod
    def raise_again(self, frame: Frame) -> None:
        """Ends a block by raising what `frame.raised` holds."""


class Detour(Handler):
    """Statements on every way out of those before them."""

    @abstractmethod
    def go(self, frame: Frame, then: Callable[[], None]) -> None:
        """Ends a block by going there; `then` writes what follows."""


class _Stop(Handler):
    """The runtime, which stops the task."""

    @property
    def has_lines(self) -> bool:
        return True

    def raise_code(self, frame: Frame, code: int) -> None:
        self._call(frame, number(code))

    def raise_again(self, frame: Frame) -> None:
        frame.extend_trail()
        frame.publish_trail()
        self._call(frame, frame.fn.value(f"load i32, ptr {frame.raised}"))

    @staticmethod
    def _call(frame: Frame, code: Value) -> None:
        frame.call_import(RAISE, "void", [f"i32 {code}"], frame.unit.raising)
        frame.fn.terminate("unreachable")


class _Caller(Handler):
    """The function that called this one. `traced`: the exception notes its way."""

    def __init__(self, traced: bool) -> None:
        self._traced = traced

    @property
    def has_lines(self) -> bool:
        return self._traced

    def raise_code(self, frame: Frame, code: int) -> None:
        frame.set_raised(number(code))
        frame.begin_trail()
        frame.fn.branch(_GIVEN_UP)

    def raise_again(self, frame: Frame) -> None:
        frame.extend_trail()
        frame.fn.branch(_GIVEN_UP)


_GIVEN_UP = "given.up"
_STOP, _CALLER, _TRACED_CALLER = _Stop(), _Caller(traced=False), _Caller(traced=True)


class Frame:
    """State of the function being written and access to memory and context."""

    def __init__(self, unit: Unit, fn: Function, pou: Pou | None, form: Form = Form.PLAIN) -> None:
        """`pou`: None for functions that have no source."""
        self.unit = unit
        self.fn = fn
        self.pou = pou
        self.form = form
        caller = _CALLER if unit.trail_variable is None else _TRACED_CALLER
        self.handler: Handler = caller if form is Form.RAISING else _STOP
        # Where the number of an exception is, 0 without one; its trail comes after it.
        self.raised: Value | None = RAISED if form is Form.RAISING else None
        self.locals: dict[Variable, Ref] = {}
        self.shadows: dict[Variable, Value] = {}  # FOR variables that live in a register inside their loop
        self.ranges: dict[Variable, tuple[int, int]] = {}
        self._bases: dict[Area, Value] = {}
        self._addresses: dict[tuple[str, Value, int], Value] = {}  # by block, so that none lives longer than it must
        self._raises: dict[Handler, dict[tuple[int | None, str], str]] = {}
        self._known = Memory()
        self._lengths = Lengths()
        self._free: dict[tuple[int, int], list[Value]] = {}
        self._busy: list[tuple[tuple[int, int], Value]] = []
        self.pointer_int = f"i{8 * unit.target.pointer_size}"

    def open_scope(self, name: str, pos: Pos) -> None:
        """Starts line information."""
        self.fn.scope = self.unit.subprogram(name, pos)
        self.at(pos)
        if self.unit.options.steps:
            self.fn.entry_debug = self.fn.debug

    def at(self, pos: Pos) -> None:
        """What is written from now on belongs to the line of `pos`."""
        if self.fn.scope >= 0:
            self.fn.debug = self.unit.location(pos, self.fn.scope)

    def declare_variable(self, name: str, pointer: Value) -> None:
        """A debugger finds the variable at `pointer`, which is on the stack."""
        if self.fn.scope >= 0 and self.pou is not None:
            self.fn.declare_variable(pointer, self.unit.stack_variable(name, self.pou.pos, self.fn.scope))

    # ---- what is written for each kind of node ----

    def value(self, e: Expr) -> Value:
        """The operand that holds the value of a scalar expression."""
        return self._written(VALUES, e)

    def ref(self, place: Place) -> Ref:
        """The address of a place; writes the instructions and checks that it takes."""
        return self._written(REFS, place)

    def aggregate(self, e: Expr) -> Ref:
        """Where the value of a string, array or struct expression is; valid until the end of the statement."""
        return self._written(AGGREGATES, e)

    def _written(self, table: dict[type, Callable[[Frame, Any], Written]], node: Expr | Place) -> Written:
        try:
            return table[type(node)](self, node)
        except Exception as error:
            note_position(error, node.pos)
            raise

    # ---- context ----

    def context_load(self, offset: int, llvm_type: str, extra: str = "") -> Value:
        """A load from the context at the start of the function."""
        address = self.fn.prologue(f"getelementptr inbounds i8, ptr %ctx, i64 {offset}")
        return self.fn.prologue(f"load {llvm_type}, ptr {address}{extra}, !invariant.load !{self.unit.empty}")

    def area_base(self, area: Area) -> Value:
        base = self._bases.get(area)
        if base is None:
            metadata = self.unit.module.metadata
            size = metadata(f"!{{i64 {max(self.unit.area_sizes.get(area, 0), 1)}}}")
            facts = f", !nonnull !{self.unit.empty}, !align !{metadata('!{i64 8}')}, !dereferenceable !{size}"
            offset = self.unit.area_offset + area.value * self.unit.target.pointer_size
            base = FixedPointer(self.context_load(offset, "ptr", facts))
            self._bases[area] = base
        return base

    def call_import(self, external: External, result: str, arguments: list[str], attributes: str) -> Value | None:
        """Calls a C function, whose result is of the LLVM type `result`. `arguments` with their types."""
        target = self.unit.imported(external, result, arguments) or self._loaded_import(external)
        text = f"call {self.unit.external_convention}{result} {target}({', '.join(arguments)}) {attributes}"
        if result != "void":
            return self.fn.value(text)
        self.fn.do(text)
        return None

    def _loaded_import(self, external: External) -> Value:
        """The address of a C function, loaded here."""
        fn, offset = self.fn, self.unit.import_slot(external) * self.unit.target.pointer_size
        invariant = f"!invariant.load !{self.unit.empty}"
        table = fn.value(f"getelementptr inbounds i8, ptr %ctx, i64 {self.unit.imports_offset}")
        base = fn.value(f"load ptr, ptr {table}, {invariant}")
        entry = fn.value(f"getelementptr inbounds i8, ptr {base}, i64 {offset}")
        return fn.value(f"load ptr, ptr {entry}, {invariant}")

    # ---- checks ----

    @property
    def checks(self) -> frozenset[Check]:
        """The checks to write: all where what they find is caught."""
        if self.pou is not None and not self.pou.checks:
            return frozenset()
        return self.unit.options.checks if self.handler is _STOP else ALL_CHECKS

    @property
    def is_caught(self) -> bool:
        """Whether an exception raised here does not stop the task at once."""
        return self.handler is not _STOP

    def form_of(self, pou: Pou, dispatch: Dispatch | None) -> Form:
        """The form that a POU is called in: the one that returns its exceptions if it may have some, and they are
        caught. Those of the standard library have none, and none stops a C function."""
        raises = self.is_caught and pou.external is None and (pou.checks or dispatch is not None)
        return Form.RAISING if raises else Form.PLAIN

    def expect_exceptions(self) -> None:
        """Makes room for the number of an exception, before a __TRY."""
        if self.raised is None:
            self.raised = self.exception_slot()
        if self.handler is _STOP:
            self.set_raised(number(0))

    def exception_slot(self) -> Value:
        """Room on the stack for the number of an exception, and for its trail if the program has them."""
        return self.fn.slot("i32") if self.unit.trail_variable is None else self.fn.alloca(TRAIL_SIZE, _WORD)

    def copy_exception(self, target: Value, source: Value) -> None:
        """Copies an exception from one slot to another."""
        if self.unit.trail_variable is None:
            self.fn.do(f"store i32 {self.fn.value(f'load i32, ptr {source}')}, ptr {target}")
        else:
            self.fn.do(
                f"call void @llvm.memcpy.p0.p0.{self.pointer_int}(ptr align {_WORD} {target}, "
                f"ptr align {_WORD} {source}, {self.pointer_int} {TRAIL_SIZE}, i1 false)"
            )

    def begin_trail(self) -> None:
        """Notes the line of what is written as the one that raised."""
        line = self._passed_line()
        if line is not None and self.raised is not None:
            self.unit.trail.begin(self.fn, self.raised, line)

    def extend_trail(self) -> None:
        """Notes the line of what is written as one of a call that returned an exception."""
        line = self._passed_line()
        if line is not None and self.raised is not None:
            self.unit.trail.extend(self.fn, self.raised, line)

    def publish_trail(self) -> None:
        """Copies the trail to the variable from which the host reads it."""
        variable = self.unit.trail_variable
        if variable is not None and self.raised is not None:
            target = self.fn.value(f"getelementptr i8, ptr {self.area_base(variable.area)}, i32 {variable.offset}")
            self.unit.trail.publish(self.fn, self.raised, target)

    def _passed_line(self) -> PassedLine | None:
        """Where an exception is noted that passes here; None without a line, or when the program has no trails."""
        found = self.unit.source_line(self.fn.debug)
        if found is None or self.pou is None or self.unit.trail_variable is None:
            return None
        return PassedLine(self.pou.name, *found)

    def set_raised(self, code: Value) -> None:
        """Notes the number of an exception; 0: there is none."""
        self.fn.do(f"store i32 {code}, ptr {self.raised}")

    def note_bounds(self, array: Place | None, value: Expr, low: int, high: int, pos: Pos) -> None:
        """Notes a check for the symbol file: of an index of `array`, or of what is assigned."""
        lost = self.unit.transient.get(self.pou, ()) if self.pou is not None else ()
        self.unit.bounds.append(bounds_check(self.pou, array, value, low, high, pos, lost))

    def require(self, condition: Value, code: int, pos: Pos) -> None:
        """Raises RTSEXCPT_* `code` unless the i1 `condition` holds."""
        self._branch(condition, code, pos)

    def after_call(self, pos: Pos) -> None:
        """Raises again what a function returned that was called in the form for it."""
        raised = self.fn.value(f"load i32, ptr {self.raised}")
        self._branch(self.fn.value(f"icmp eq i32 {raised}, 0"), None, pos)

    def _branch(self, condition: Value, code: int | None, pos: Pos) -> None:
        fn, keep = self.fn, self.fn.debug
        self.at(pos)
        key = (code, fn.debug if self.handler.has_lines else "")
        labels = self._raises.setdefault(self.handler, {})
        if key not in labels:
            labels[key] = fn.label("raise")
        fn.debug = keep
        ok, lengths = fn.label("ok"), self.lengths()
        fn.branch_if(condition, ok, labels[key])
        fn.begin(ok)
        self.keep_lengths(lengths)

    def write_raises(self, handler: Handler | None = None) -> None:
        """Writes the cold blocks that lead to a handler; without one, at the end of the function, to that of its
        own."""
        fn, handler, keep = self.fn, handler or self.handler, self.fn.debug
        for (code, debug), label in self._raises.pop(handler, {}).items():
            fn.debug = debug or keep
            fn.begin_detached(label)
            if code is None:
                handler.raise_again(self)
            else:
                handler.raise_code(self, code)
        fn.debug = keep

    def write_given_up(self, returned: Variable | None) -> None:
        """Writes how a function returns that has raised. `returned`: the variable whose value it returns otherwise."""
        if self.raised is RAISED:
            self.fn.begin_detached(_GIVEN_UP)
            self.fn.terminate("ret void" if returned is None else f"ret {value_type(returned.type)} poison")

    # ---- memory ----

    def address(self, ref: Ref) -> Value:
        """The pointer to `ref`."""
        if ref.offset == 0:
            return ref.pointer
        key = (self.fn.block, ref.pointer, ref.offset)
        known = self._addresses.get(key)
        if known is None:
            flag = "inbounds " if ref.pointer.fixed else ""
            known = self.fn.value(f"getelementptr {flag}i8, ptr {ref.pointer}, {self.pointer_int} {ref.offset}")
            self._addresses[key] = known
        return known

    def element(self, ref: Ref, index: Value, t: Type, *, counted: bool) -> Ref:
        """Element `index` (pointer-sized integer) of the array of `t` at `ref`. `counted`: it is known to be within."""
        flags = "inbounds nuw " if counted and ref.offset >= 0 else ""
        pointer = self.fn.value(
            f"getelementptr {flags}[{t.size} x i8], ptr {self.address(ref)}, {self.pointer_int} {index}"
        )
        return replace(ref, pointer=pointer, offset=0, type=t, capacity=string_capacity(t), length=None, sure=ref.align)

    def load(self, ref: Ref) -> Value:
        """The scalar at `ref`."""
        fn = self.fn
        text = value_type(ref.type)
        value = self._loaded(ref, text)
        if ref.loose:
            return fn.value(f"freeze {text} {value}")
        if ref.bit >= 0:
            shifted = fn.value(f"lshr {text} {value}, {ref.bit}")
            bit = shifted if text == "i8" else fn.value(f"trunc {text} {shifted} to i8")
            return fn.value(f"and i8 {bit}, 1")
        return value

    def store(self, ref: Ref, value: Value) -> None:
        """Stores a scalar."""
        text = value_type(ref.type)
        if ref.bit >= 0:
            value = self._with_bit(ref, text, value)
        if text == "ptr" and self.unit.target.pointer_size == 4:  # pointers take 8 bytes in memory on every target
            self._put(ref.member(4, DINT, ref.tag), "i32", number(0))
        self._put(ref, text, value)

    def ends_constants(self, ref: Ref) -> bool:
        """Whether the bytes from the beginning of its word to this one are known to be constants, and are several."""
        known = [self._memory().value(ref.pointer, at, "i8") for at in range(ref.offset & -_WORD, ref.offset + 1)]
        return len(known) > 1 and all(value is not None and value.constant is not None for value in known)

    def note(self, ref: Ref, value: Value) -> None:
        """`value` is known to be at `ref`."""
        self._memory().note_load(ref.pointer, ref.offset, value_type(ref.type), value)

    def _loaded(self, ref: Ref, text: str) -> Value:
        """What is in memory, without an instruction if that is known."""
        value = self._memory().value(ref.pointer, ref.offset, text)
        if value is None:
            value = self.fn.load(f"load {text}, ptr {self.address(ref)}, align {ref.align}{ref.tag}")
            self._memory().note_load(ref.pointer, ref.offset, text, value)
        return value

    def _put(self, ref: Ref, text: str, value: Value) -> None:
        """Stores; takes out the instruction of an earlier store that nothing reads."""
        if not (ref.direct and ref.pointer.fixed):  # it may be a character
            self._lengths.set({}, -1)
        line = self.fn.store(f"store {text} {value}, ptr {self.address(ref)}, align {ref.align}{ref.tag}")
        useless = self._memory().note_store(ref.pointer, ref.offset, text, value, line)
        if useless is not None:
            self.fn.remove(useless)

    def length(self, ref: Ref) -> Value | None:
        """How many characters a string has, as an i32, if that is known."""
        return ref.length or self.lengths().get((ref.pointer, ref.offset))

    def note_length(self, ref: Ref, length: Value | None, known: KnownLengths | None = None) -> None:
        """What is at `ref` has been written, and is a string of this length if there is one. `known`: before, which
        still holds of all strings that are not part of it."""
        lengths = {}
        if not self.unit.measures:
            return
        if known and ref.direct and ref.pointer.fixed:
            here = range(ref.offset, ref.offset + ref.type.size)
            lengths = {
                (base, at): n
                for (base, at), n in known.items()
                if (at not in here if base == ref.pointer else self._are_apart(base, ref.pointer))
            }
        if length is not None and ref.direct and (ref.tag or ref.pointer.on_stack):  # which no other variable overlaps
            lengths[ref.pointer, ref.offset] = length
        self._lengths.set(lengths, self.fn.writes)

    def _are_apart(self, one: Value, other: Value) -> bool:
        """Whether two bases lead to different memory: an instance may be a global one, which is in an area."""
        areas = self._bases.values()
        return one.on_stack or other.on_stack or (one in areas) == (other in areas)

    def lengths(self) -> KnownLengths:
        """All lengths that are known."""
        return self._lengths.known(self.fn.writes)

    def keep_lengths(self, known: KnownLengths) -> None:
        """They are still known."""
        self._lengths.set(known, self.fn.writes)

    def _memory(self) -> Memory:
        """What is known here."""
        if self._known.since != self.fn.barriers or not self.unit.remembers:
            self._known = Memory(self.fn.barriers)
        return self._known

    def _with_bit(self, ref: Ref, text: str, value: Value) -> Value:
        fn = self.fn
        base = base_of(ref.type)
        assert isinstance(base, Elementary)
        mask = 1 << ref.bit
        old = self._loaded(ref, text)
        if value.constant == 1:
            return fn.value(f"or {text} {old}, {mask}")
        cleared = fn.value(f"and {text} {old}, {~mask}")
        if value.constant == 0:
            return cleared
        wide = fn.value(f"and i8 {value}, 1")
        if text != "i8":
            wide = fn.value(f"zext i8 {wide} to {text}")
        return fn.value(f"or disjoint {text} {cleared}, {fn.value(f'shl {text} {wide}, {ref.bit}')}")

    def copy(self, target: Ref, source: Ref, size: int) -> None:
        """Copies `size` bytes."""
        if size:
            align = min(target.align, source.align)
            apart = target.direct and source.direct and not target.crosses(source)
            name, size_type = "memcpy" if apart else "memmove", self.pointer_int
            self.fn.do(
                f"call void @llvm.{name}.p0.p0.{size_type}(ptr align {align} {self.address(target)}, "
                f"ptr align {align} {self.address(source)}, {size_type} {size}, i1 false)"
            )

    def clear(self, ref: Ref) -> None:
        """Zeroes a place."""
        if is_scalar(ref.type):
            self.store(ref, zero(ref.type))
            return
        size_type = self.pointer_int
        self.fn.do(
            f"call void @llvm.memset.p0.{size_type}(ptr align {ref.align} {self.address(ref)}, i8 0, "
            f"{size_type} {ref.type.size}, i1 false)"
        )

    # ---- temporaries ----

    def scalar(self, t: Type) -> Ref:
        """A scalar on the stack; contents undefined. A pointer has its 8 bytes there as everywhere in memory."""
        text = value_type(t)
        return Ref(self.fn.alloca(t.size, t.align) if text == "ptr" else self.fn.slot(text), 0, t, direct=True)

    def temporary(self, t: Type) -> Ref:
        """Memory for a value of `t` until the next statement; contents undefined."""
        if is_scalar(t):
            return self.scalar(t)
        key = (t.size, t.align)
        free = self._free.setdefault(key, [])
        pointer = free.pop() if free else self.fn.alloca(*key)
        self._busy.append((key, pointer))
        return Ref(pointer, 0, t, direct=True, capacity=string_capacity(t))

    def release_temporaries(self) -> None:
        """Called between statements."""
        for key, pointer in self._busy:
            self._free[key].append(pointer)
        self._busy.clear()


class Body(Frame):
    """The body of one POU."""

    def __init__(self, unit: Unit, fn: Function, pou: Pou, effects: Effects, form: Form) -> None:
        super().__init__(unit, fn, pou, form)
        self.effects = effects
        self.on_return = "return"
        self.loops: list[tuple[str, str, int]] = []  # labels for CONTINUE and EXIT, and how many `finals` are around
        self.finals: list[Detour] = []  # around the statement, the innermost last
        self._labels: dict[str, str] = {}
        self._depths: dict[str, int] = {}  # how many `finals` are around a label of the program

    def label(self, name: str) -> str:
        """The block that a label of the program begins."""
        if name not in self._labels:
            self._labels[name] = self.fn.label("label")
        return self._labels[name]

    def leave(self, label: str, depth: int = 0) -> None:
        """Branches to a block which `depth` of the `finals` are around; those between run first."""
        if len(self.finals) == depth:
            self.fn.branch(label)
            return
        self.finals[-1].go(self, lambda: self.leave(label, depth))

    def jump(self, name: str) -> None:
        """Goes on at a label of the program."""
        self.leave(self.label(name), self._depths[name])

    def statements(self, body: list[Statement]) -> None:
        """Statements in their order."""
        for statement in body:
            if isinstance(statement, Label):
                self._depths[statement.name] = len(self.finals)
        for statement in body:
            self.release_temporaries()
            self.at(statement.pos)
            try:
                STATEMENTS[type(statement)](self, statement)
            except Exception as error:
                note_position(error, statement.pos)
                raise


VALUES: dict[type, Callable[[Frame, Any], Value]] = {}
REFS: dict[type, Callable[[Frame, Any], Ref]] = {}
AGGREGATES: dict[type, Callable[[Frame, Any], Ref]] = {}
STATEMENTS: dict[type, Callable[[Body, Any], None]] = {}


def rule(
    table: dict[type, Callable[[FrameType, Any], Written]], kind: type[Node]
) -> Callable[[Callable[[FrameType, Node], Written]], Callable[[FrameType, Node], Written]]:
    """Makes a function the one that writes a kind of node."""

    def register(function: Callable[[FrameType, Node], Written]) -> Callable[[FrameType, Node], Written]:
        table[kind] = function
        return function

    return register


def zero(t: Type) -> Value:
    """The zero of a scalar type as an LLVM constant."""
    text = value_type(t)
    if text == "ptr":
        return NULL
    return Value("0.0") if text in REALS else number(0)


DIVIDE_BY_ZERO = int(lib.RTSEXCPT_DIVIDEBYZERO)
ARRAY_BOUNDS = int(lib.RTSEXCPT_ARRAYBOUNDS)
ACCESS_VIOLATION = int(lib.RTSEXCPT_ACCESS_VIOLATION)
TIME_MS_OFFSET = int(ffi.offsetof("IEC_CONTEXT", "time_ms"))
TIME_NS_OFFSET = int(ffi.offsetof("IEC_CONTEXT", "time_ns"))
TASK_OFFSET = int(ffi.offsetof("IEC_CONTEXT", "task"))
