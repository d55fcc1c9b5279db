"""A small builder of LLVM IR in text form: fast to write, and every attribute and metadata node is ours to choose.

Blocks are written in the order in which they are begun. Instructions after a terminator go to a fresh block that
nothing reaches, so the lowering never has to ask whether code is dead; LLVM removes it.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from zlib import crc32


class Value(str):
    """An operand, as it stands in the IR."""

    __slots__ = ()

    @property
    def constant(self) -> int | None:
        """The integer it is, when it is one."""
        return None

    @property
    def fixed(self) -> bool:
        """Whether it is a pointer that holds in the whole function to memory that is known to be there, so that sums
        with it stay inside."""
        return False

    @property
    def on_stack(self) -> bool:
        """Whether it is a pointer to memory of this call only."""
        return False


class Number(Value):
    """An integer."""

    __slots__ = ()

    @property
    def constant(self) -> int:
        """The integer."""
        return int(self)


class FixedPointer(Value):
    """A pointer that holds in the whole function."""

    __slots__ = ()

    @property
    def fixed(self) -> bool:
        """It is one."""
        return True


class StackPointer(FixedPointer):
    """A pointer to memory of this call."""

    __slots__ = ()

    @property
    def on_stack(self) -> bool:
        """It is one."""
        return True


_WRITES_MEMORY = ("call ", "tail call ", "cmpxchg ", "atomicrmw ")
_USES_MEMORY = ("load ", *_WRITES_MEMORY)
_ARITHMETIC = " @llvm."  # an intrinsic that has a value

TRUE, FALSE, NULL = Value("true"), Value("false"), Value("null")

_REFERENCE = re.compile(r"!\d+|@[\w.]+")  # to a metadata node, a function or a constant
_NODE = re.compile(r'"[^"]*"|!(\d+)')
_MOST_NODES = (1 << 31) - 1


class Module:
    """Collects functions, constants, declarations and metadata of one LLVM module.

    Names and numbers come from what they stand for, and a text has only what its functions reach, in the order in which
    they do. So the text of a part of a program stays the same when other parts change, and its object is found again
    (`object_cache.py`).
    """

    def __init__(self, triple: str) -> None:
        self._triple = triple
        self._constants: dict[str, str] = {}
        self.functions: dict[str, Definition] = {}
        self._helpers: dict[str, str] = {}
        self._declarations: dict[str, str] = {}
        self._attributes: dict[str, int] = {}
        self._metadata: dict[int, str] = {}
        self._metadata_ids: dict[str, int] = {}
        self._named_metadata: list[str] = []
        self._below: dict[int, list[int]] = {}  # the nodes that a node refers to
        self.collided = False  # a name or number is not that of its content alone, so it depends on what came before

    def metadata(self, text: str) -> int:
        """The number of the metadata node `text`, e.g. '!{i64 8}'; equal nodes exist once."""
        number = self._metadata_ids.get(text)
        if number is None:
            number = self._metadata_ids[text] = self._new_node(text)
        return number

    def _new_node(self, text: str) -> int:
        number = crc32(text.encode()) & _MOST_NODES
        while number in self._metadata:
            self.collided = self.collided or self._metadata[number] != text
            number = (number + 1) & _MOST_NODES
        self._metadata[number] = text
        return number

    def distinct_metadata(self, text: str) -> int:
        """A node of its own, e.g. a DISubprogram."""
        return self._new_node("distinct " + text)

    def forget_metadata(self, number: int) -> None:
        """Forgets a node of its own, which nothing refers to any more."""
        del self._metadata[number]
        self._below.pop(number, None)

    def named_metadata(self, name: str, nodes: list[int]) -> None:
        self._named_metadata.append(f"!{name} = !{{{', '.join(f'!{n}' for n in nodes)}}}")

    def add_compile_unit(self, file: int, *, variables: bool = False) -> int:
        """The node that makes LLVM write debugging information: lines, and where `variables` on the stack are. `file`:
        a DIFile."""
        kind = "FullDebug" if variables else "LineTablesOnly"
        unit = self.distinct_metadata(
            f'!DICompileUnit(language: DW_LANG_C99, file: !{file}, producer: "plctool", isOptimized: true, '
            f"runtimeVersion: 0, emissionKind: {kind})"
        )
        self.named_metadata("llvm.dbg.cu", [unit])
        flags = ('!{i32 7, !"Dwarf Version", i32 4}', '!{i32 2, !"Debug Info Version", i32 3}')
        self.named_metadata("llvm.module.flags", [self.metadata(flag) for flag in flags])
        return unit

    def attributes(self, text: str) -> str:
        """Reference to an attribute group, e.g. '#3'."""
        return f"#{self._attributes.setdefault(text, len(self._attributes))}"

    def constant(self, data: bytes, align: int = 1) -> Value:
        """The address of a read-only constant in the image; equal ones exist once."""
        text = f" = internal unnamed_addr constant [{len(data)} x i8] {bytes_literal(data)}, align {align}"
        number = crc32(text.encode())
        while self._constants.setdefault(f"@const.{number:x}", text) != text:
            self.collided = True
            number += 1
        return Value(f"@const.{number:x}")

    def add(self, name: str, function: Function, linkage: str = "internal") -> None:
        """A function that exists once in the program. `linkage`: "" when it is called from outside."""
        self.functions[name] = Definition(function, linkage)

    def add_helper(self, name: str, definition: str) -> None:
        """A small internal function, of which every part of the module that calls it has its own copy."""
        self._helpers[f"@{name}"] = definition

    def declare(self, name: str, declaration: str) -> None:
        """A function that is not in the module; the first declaration of a name holds."""
        self._declarations.setdefault(f"@{name}", declaration)

    def whole(self) -> str:
        """The module with all its functions."""
        return self.text(d.function.definition(d.linkage) for d in self.functions.values())

    def text(self, functions: Iterable[str]) -> str:
        """The module in LLVM's assembly language, with these functions and all that they refer to."""
        written = "\n".join(functions)
        references = dict.fromkeys(_REFERENCE.findall(written))
        helpers = self._reached_helpers(references)
        for helper in helpers.values():
            references |= dict.fromkeys(_REFERENCE.findall(helper))
        parts = [f'target triple = "{self._triple}"']
        parts += [name + self._constants[name] for name in references if name in self._constants]
        parts += [self._declarations[name] for name in references if name in self._declarations]
        parts += [written, *helpers.values()]
        parts += [f"attributes #{number} = {{ {text} }}" for text, number in self._attributes.items()]
        parts += self._named_metadata
        references |= dict.fromkeys(_REFERENCE.findall("\n".join(self._named_metadata)))
        nodes = self._reached_nodes([int(name[1:]) for name in references if name[0] == "!"])
        parts += [f"!{number} = {self._metadata[number]}" for number in nodes]
        parts.append("")
        return "\n".join(parts)

    def _reached_helpers(self, references: Iterable[str]) -> dict[str, str]:
        """The helpers that are referred to, and those that they call."""
        found: dict[str, str] = {}
        todo = [name for name in references if name in self._helpers]
        while todo:
            name = todo.pop()
            if name not in found:
                found[name] = self._helpers[name]
                todo += [n for n in _REFERENCE.findall(found[name]) if n in self._helpers]
        return dict(sorted(found.items()))

    def _reached_nodes(self, wanted: list[int]) -> list[int]:
        """Metadata nodes and what they refer to, which comes first."""
        found: dict[int, None] = {}
        below, metadata = self._below, self._metadata
        for root in wanted:
            stack = [root]
            while stack:
                number = stack[-1]
                if number in found:
                    stack.pop()
                    continue
                if number not in below:
                    below[number] = [int(n) for n in _NODE.findall(metadata[number]) if n]
                missing = [n for n in below[number] if n not in found]
                if missing:
                    stack += missing
                else:
                    found[number] = None
                    stack.pop()
        return [*found]


class Function:
    """The body of one function while it is written."""

    def __init__(self, signature: str, attributes: str, inlining: str = "") -> None:
        """`signature`: result, name and parameters, e.g. 'void @f(ptr %ctx)'; `inlining`: 'noinline', 'inlinehint', or
        "" to leave it to LLVM."""
        self._signature = signature
        self._attributes = attributes
        self.inlining = inlining
        self._allocas: list[str] = []
        self._prologue: list[str] = []
        self._lines: list[str] = []
        self._count = 0
        self.callees: list[str] = []  # the symbol of the function of every call
        self._phis: dict[str, int] = {}  # the index of the line, by name
        self._dead = False
        self.block = "entry"
        self.blocks = 1
        self.loops = False  # there is a branch back
        self._begun: set[str] = set()
        self.barriers = 0  # grows with all that ends a block or may use memory, but `load` and `store`
        self.writes = 0  # grows with all that ends a block or may write memory, but `store`
        self.scope = -1  # its DISubprogram
        self.debug = ""  # e.g. ', !dbg !7', added to every instruction
        self.entry_debug = ""  # the same for `prologue`, if not that of what needs it

    # ---- instructions ----

    def value(self, text: str) -> Value:
        """Writes an instruction that gives a value."""
        if text.startswith(_USES_MEMORY):
            self.barriers += 1
            self.writes += text.startswith(_WRITES_MEMORY) and _ARITHMETIC not in text
        return self.load(text)

    def load(self, text: str) -> Value:
        """Writes a load of which the caller keeps account, as `value`."""
        if self._dead:
            self.begin(self.label("dead"))
        self._count += 1
        name = f"%v{self._count}"
        self._lines.append(f"  {name} = {text}{self.debug}")
        return Value(name)

    def do(self, text: str) -> None:
        """Writes an instruction without a value."""
        self.barriers += 1
        self.writes += 1
        self.store(text)

    def store(self, text: str) -> int:
        """Writes a store of which the caller keeps account, as `do`. Returns its line, for `remove`."""
        if self._dead:
            self.begin(self.label("dead"))
        self._lines.append(f"  {text}{self.debug}")
        return len(self._lines) - 1

    def declare_variable(self, pointer: Value, variable: int) -> None:
        """Has the debugging information say that a DILocalVariable is at `pointer`, which is on the stack."""
        location = self.debug.removeprefix(", !dbg ")
        self._lines.append(f"    #dbg_declare(ptr {pointer}, !{variable}, !DIExpression(), {location})")

    def remove(self, line: int) -> None:
        """Takes out an instruction without a value."""
        self._lines[line] = ""

    def phi(self, llvm_type: str, *incoming: tuple[Value, str]) -> Value:
        """At the beginning of a block, the value that belongs to the block before: pairs of both. `add_incoming` adds
        those that are not known yet."""
        assert not self.debug, "a phi has no line"
        result = self.value(f"phi {llvm_type} ")
        self._phis[result] = len(self._lines) - 1
        self._lines[-1] += ", ".join(f"[ {value}, %{block} ]" for value, block in incoming)
        return result

    def add_incoming(self, phi: Value, value: Value, block: str) -> None:
        """What a phi is after `block`."""
        self._lines[self._phis[phi]] += f", [ {value}, %{block} ]"

    def call(self, symbol: str, arguments: Iterable[str], attributes: str = "", *, tail: bool = False) -> None:
        """Calls a function of the program for its effect. `arguments` with their types."""
        self.callees.append(symbol)
        self.do(f"{'tail ' if tail else ''}call void @{symbol}({', '.join(arguments)}){attributes}")

    def call_value(
        self, result: str, symbol: str, arguments: Iterable[str], attributes: str = "", *, tail: bool = False
    ) -> Value:
        """Calls a function of the program for its result, of the LLVM type `result`."""
        self.callees.append(symbol)
        return self.value(f"{'tail ' if tail else ''}call {result} @{symbol}({', '.join(arguments)}){attributes}")

    def prologue(self, text: str) -> Value:
        """Writes an instruction that gives a value, before all others of the function."""
        self._count += 1
        name = f"%v{self._count}"
        self._prologue.append(f"  {name} = {text}{self.entry_debug or self.debug}")
        return Value(name)

    def alloca(self, size: int, align: int) -> Value:
        """Memory on the stack for the whole call, contents undefined. Returns the pointer."""
        self._count += 1
        name = f"%m{self._count}"
        self._allocas.append(f"  {name} = alloca [{size} x i8], align {align}")
        return StackPointer(name)

    def slot(self, llvm_type: str) -> Value:
        """A scalar on the stack, which LLVM turns into registers. Returns the pointer."""
        self._count += 1
        name = f"%s{self._count}"
        self._allocas.append(f"  {name} = alloca {llvm_type}")
        return FixedPointer(name)

    # ---- blocks ----

    def label(self, hint: str) -> str:
        self._count += 1
        return f"{hint}{self._count}"

    @property
    def open(self) -> bool:
        """Whether what is written next is reached."""
        return not self._dead

    def begin(self, label: str) -> None:
        """Starts the block `label`, falling through to it when the block before is still open."""
        if not self._dead:
            self._lines.append(f"  br label %{label}{self.debug}")
        self.barriers += 1
        self.writes += 1
        self._lines.append(f"{label}:")
        self._begun.add(label)
        self.block = label
        self.blocks += 1
        self._dead = False

    def terminate(self, text: str) -> None:
        self.do(text)
        self._dead = True

    def branch(self, label: str) -> None:
        self.loops = self.loops or label in self._begun
        self.terminate(f"br label %{label}")

    def branch_if(self, condition: Value, then: str, otherwise: str) -> None:
        self.loops = self.loops or then in self._begun or otherwise in self._begun
        self.terminate(f"br i1 {condition}, label %{then}, label %{otherwise}")

    def begin_detached(self, label: str) -> None:
        """Starts a block after a terminator, reached only by branches written earlier."""
        assert self._dead, "the block before is open"
        self.begin(label)

    # ---- the finished function; its last block was terminated ----

    @property
    def size(self) -> int:
        """Instructions, about."""
        return len(self._prologue) + len(self._lines)

    def definition(self, linkage: str) -> str:
        scope = f"!dbg !{self.scope}" if self.scope >= 0 else ""
        head = " ".join(filter(None, ("define", linkage, self._signature, self.inlining, self._attributes, scope, "{")))
        return "\n".join([head, "entry:", *self._allocas, *self._prologue, *filter(None, self._lines), "}"])

    def declaration(self, linkage: str) -> str:
        return f"declare {linkage} {self._signature}"


@dataclass(frozen=True)
class Definition:
    """A function of a module."""

    function: Function
    linkage: str


def number(value: int) -> Value:
    """An integer."""
    return Number(value)


def bytes_literal(data: bytes) -> str:
    """An LLVM c"..." literal."""
    if not any(data):
        return "zeroinitializer"
    return f'c"{escape(data)}"'


def escape(data: bytes) -> str:
    """The inside of a quoted string of LLVM's assembly language."""
    return "".join(chr(b) if 32 <= b < 127 and b not in b'"\\' else f"\\{b:02X}" for b in data)


def float_literal(value: float, bits: int) -> Value:
    """A REAL (32) or LREAL (64) constant, exact; values that a REAL cannot hold are rounded to the nearest."""
    if bits == 32:
        value = round_to_single(value)
    return Value(f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}")


def round_to_single(value: float) -> float:
    """`value` as a REAL holds it; too large values become infinite."""
    try:
        result: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")
    return result
