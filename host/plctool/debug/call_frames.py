"""What the compiler's debugging information says about a moment of the program: which calls led to it.

A call that was inlined is in the DWARF tree of the function; a call that was made is on the stack, at the location that
the call frame information (DWARF 4, 6.4) gives for each instruction.
"""

from __future__ import annotations

import io
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from elftools.dwarf.callframe import FDE
from elftools.dwarf.dwarf_expr import DWARFExprParser
from elftools.dwarf.ranges import BaseAddressEntry
from elftools.elf.elffile import ELFFile

from plctool.debug.trace import Trace

# Registers of the stack pointer in DWARF.
_STACK_POINTER = {"EM_X86_64": 7, "EM_ARM": 13, "EM_AARCH64": 31, "EM_RISCV": 2}
_MOST_CALLS = 64
_MOST_PUSHED = 128  # bytes, by a function of the runtime


@dataclass(frozen=True)
class Scope:
    """Code that came from the source of `pou`. When it was inlined: the line with the call, else line 0. Without a POU
    it does no more than call its parts, for which the source has no call."""

    pou: str
    call_file: str
    call_line: int


@dataclass(frozen=True)
class _Frame:
    """At an instruction: bytes of stack that the function holds, and where below their end the return address is
    (None: in the link register)."""

    size: int
    return_address: int | None


@dataclass(frozen=True)
class StackFrame:
    """A call that has not returned: `offset` in the code where it is, `stack` bytes from the stack pointer of the
    innermost one to its own."""

    offset: int
    stack: int


class DebugInfo:
    """Reads the objects of `Linked.debug`; the tables are made when first needed."""

    def __init__(self, objects: list[bytes]) -> None:
        self._scopes: list[tuple[int, int, int, Scope]] = []  # begin, end, depth
        self._functions: list[tuple[int, int, Any, int]] = []  # begin, end, how its frame changes, the stack pointer
        self._variables: list[tuple[int, int, dict[str, int]]] = []  # begin, end, bytes from the stack pointer
        self._word = 8
        for data in objects:
            elf = ELFFile(io.BytesIO(data))
            self._word = elf.elfclass // 8
            dwarf = elf.get_dwarf_info(relocate_dwarf_sections=False)
            for unit in dwarf.iter_CUs():
                self._scopes += _Unit(dwarf, unit).scopes()
                self._variables += _variables(dwarf, unit, _STACK_POINTER[elf["e_machine"]])
            self._functions += _functions(dwarf, _STACK_POINTER[elf["e_machine"]])
        self._scopes.sort(key=lambda scope: scope[:3])
        self._functions.sort(key=lambda function: function[0])

    def scopes(self, offset: int) -> list[Scope]:
        """The scopes that hold the code at `offset`, the innermost first; the last one is that of the function."""
        found = [(depth, scope) for begin, end, depth, scope in self._scopes if begin <= offset < end]
        return [scope for _, scope in sorted(found, key=lambda item: -item[0])]

    def callers(self, offset: int | None, trace: Trace) -> list[int]:
        """Offsets of the calls on the stack that led to `offset`, the innermost first. `offset` is None when the
        program stopped in a function that is not its own. Then, and on the way there, those are taken that lead
        furthest."""
        if offset is not None and self._frame(offset) is not None:
            return self._unwind(offset, 0, trace.words, trace.link)
        starts = [(at + self._word, target) for at, target in sorted(trace.words.items())]
        if trace.link is not None:  # a function that calls no other; how much it has pushed is not known
            starts += [(pushed, trace.link) for pushed in range(0, _MOST_PUSHED, self._word)]
        chains = [[target - 1, *self._unwind(target - 1, pointer, trace.words)] for pointer, target in starts]
        if offset is not None and self._function(offset) >= 0 and trace.words:
            # It makes room on the stack, over what earlier calls have left there. The highest word is not.
            outermost = trace.words[max(trace.words)] - 1
            chains = [chain for chain in chains if chain[-1] == outermost and self._is_possible([offset, *chain])]
        return max(chains, key=len, default=[])

    def function_at(self, offset: int) -> tuple[int, int] | None:
        """Begin and end of the function that holds the code at `offset`."""
        i = self._function(offset)
        return None if i < 0 else self._functions[i][:2]

    def variables(self, offset: int) -> dict[str, int]:
        """What is on the stack in the function at `offset`, by name: bytes from its stack pointer."""
        return next((names for begin, end, names in self._variables if begin <= offset < end), {})

    def frames(self, offset: int | None, words: Mapping[int, int], link: int | None = None) -> list[StackFrame]:
        """The calls that have not returned, the innermost first. `words`: by distance from the stack pointer, the code
        offsets to which calls may return; `link`: that of the link register. `offset` is None in a function that is not
        the program's: then the first return address is that of the program's call of it."""
        pointer = 0
        found: list[StackFrame] = []
        if offset is None:
            distance, target = min(words.items(), default=(0, 0))
            if not target:
                return []
            offset, pointer = target - 1, distance + self._word
        while len(found) < _MOST_CALLS:
            found.append(StackFrame(offset, pointer))
            frame = self._frame(offset)
            if frame is None:
                break
            saved = frame.return_address
            back = link if saved is None else words.get(pointer + frame.size + saved)
            if back is None:
                break
            offset, pointer, link = back - 1, pointer + frame.size, None
        return found

    def _is_possible(self, chain: list[int]) -> bool:
        """No function calls itself, directly or by way of others: what says so was left by earlier calls."""
        functions = [i for i in map(self._function, chain) if i >= 0]
        return len(set(functions)) == len(functions)

    def _unwind(self, offset: int, pointer: int, words: Mapping[int, int], link: int | None = None) -> list[int]:
        """`link`: where the function at `offset` returns to, if it has not saved that."""
        calls: list[int] = []
        while len(calls) < _MOST_CALLS and (frame := self._frame(offset)) is not None:
            pointer += frame.size
            target = link if frame.return_address is None else words.get(pointer + frame.return_address)
            if target is None:
                break
            offset, link = target - 1, None
            calls.append(offset)
        return calls

    def _function(self, offset: int) -> int:
        """The index of the function that holds the code at `offset`, -1 for none."""
        i = bisect_right(self._functions, offset, key=lambda function: function[0]) - 1
        return i if i >= 0 and offset < self._functions[i][1] else -1

    def _frame(self, offset: int) -> _Frame | None:
        i = self._function(offset)
        if i < 0:
            return None
        _, _, changes, stack_pointer = self._functions[i]
        row = [row for row in changes.get_decoded().table if row["pc"] <= offset][-1]
        rule = row.get(changes.cie["return_address_register"])
        if row["cfa"].reg != stack_pointer or (rule is not None and rule.type != "OFFSET"):
            return None
        return _Frame(row["cfa"].offset, rule.arg if rule else None)


class _Unit:
    """The functions of one compilation unit."""

    def __init__(self, dwarf: Any, unit: Any) -> None:
        self._unit = unit
        self._ranges = dwarf.range_lists()
        self._files = [""]
        lines = dwarf.line_program_for_CU(unit)
        directories = [b"", *lines["include_directory"]]
        for entry in lines["file_entry"]:
            directory = directories[entry.dir_index]
            self._files.append((directory + b"/" + entry.name if directory else entry.name).decode())

    def scopes(self) -> Iterator[tuple[int, int, int, Scope]]:
        top = self._unit.get_top_DIE()
        todo = [(die, 0) for die in top.iter_children()]
        while todo:
            die, depth = todo.pop()
            if die.tag not in ("DW_TAG_subprogram", "DW_TAG_inlined_subroutine"):
                continue
            todo += [(child, depth + 1) for child in die.iter_children()]
            scope = self._scope(die)
            for begin, end in self._places(die, top):
                yield begin, end, depth, scope

    def _scope(self, die: Any) -> Scope:
        origin = die
        while "DW_AT_abstract_origin" in origin.attributes:
            origin = origin.get_DIE_from_attribute("DW_AT_abstract_origin")
        values = {name: attribute.value for name, attribute in die.attributes.items()}
        file = self._files[values.get("DW_AT_call_file", 0)]
        name = origin.attributes["DW_AT_name"].value.decode() if "DW_AT_name" in origin.attributes else ""
        return Scope(name, file, values.get("DW_AT_call_line", 0))

    def _places(self, die: Any, top: Any) -> Iterator[tuple[int, int]]:
        values = {name: attribute.value for name, attribute in die.attributes.items()}
        if "DW_AT_high_pc" in values:
            yield values["DW_AT_low_pc"], values["DW_AT_low_pc"] + values["DW_AT_high_pc"]
        elif "DW_AT_ranges" in values:
            base = top.attributes["DW_AT_low_pc"].value
            for entry in self._ranges.get_range_list_at_offset(values["DW_AT_ranges"], self._unit):
                if isinstance(entry, BaseAddressEntry):
                    base = entry.base_address
                else:
                    yield base + entry.begin_offset, base + entry.end_offset


def _variables(dwarf: Any, unit: Any, stack_pointer: int) -> Iterator[tuple[int, int, dict[str, int]]]:
    """Of each function whose frame is found by its stack pointer, the variables that stay at one place of it."""
    expressions = DWARFExprParser(dwarf.structs)

    def parsed(die: Any, name: str) -> tuple[str, Any]:
        value = die.attributes[name].value if name in die.attributes else []
        operations = expressions.parse_expr(value) if isinstance(value, list) else []
        if len(operations) != 1:
            return "", 0
        return operations[0].op_name, next(iter(operations[0].args), 0)

    for die in unit.get_top_DIE().iter_children():
        if die.tag != "DW_TAG_subprogram" or parsed(die, "DW_AT_frame_base")[0] != f"DW_OP_reg{stack_pointer}":
            continue
        begin = die.attributes["DW_AT_low_pc"].value
        found = {}
        for child in die.iter_children():
            operation, distance = parsed(child, "DW_AT_location")
            if child.tag in ("DW_TAG_variable", "DW_TAG_formal_parameter") and operation == "DW_OP_fbreg":
                found[child.attributes["DW_AT_name"].value.decode()] = distance
        yield begin, begin + die.attributes["DW_AT_high_pc"].value, found


def _functions(dwarf: Any, stack_pointer: int) -> Iterator[tuple[int, int, Any, int]]:
    for entry in dwarf.CFI_entries() if dwarf.has_CFI() else []:
        if isinstance(entry, FDE):
            begin = entry["initial_location"]
            yield begin, begin + entry["address_range"], entry, stack_pointer
