"""How much stack a program needs: the frames of its functions, and the deepest chain of calls.

What the processor pushes when it is interrupted is not counted, nor C functions that are called by their address,
as on processors of computers, whose stacks are large.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Set
from typing import NamedTuple

from plctool.compiler.codegen.calls import branches
from plctool.image.targets import Machine

Frames = dict[int, tuple[int, int]]
"""Size of the code and of the frame of each function, by its offset in the block; in bytes."""


class _Deepest(NamedTuple):
    """What a function needs with the deepest of its calls: `amount` of bytes, what it calls then, and whether its frame
    is still there."""

    amount: int
    target: int | None = None
    keeps: bool = True


class CallGraph:
    """The functions of a block of code, and which calls which. `entries`: where they are entered besides their
    beginnings."""

    def __init__(self, code: bytes, machine: Machine, frames: Frames, entries: Set[int] = frozenset()) -> None:
        self._frames = frames
        self._starts = sorted(frames)
        self._called: dict[int, dict[int, bool]] = {}  # by caller: what it calls (true), or jumps to at its end
        self._recursive: set[int] = set()
        self._leaving: set[int] = set()
        self._deepest: dict[int, _Deepest] = {}
        for branch in branches(code, machine, frames.keys() | entries):
            caller, target = self.function_at(branch.place), self.function_at(branch.target)
            if caller is None:
                continue
            if target is None:
                self._leaving.add(caller)
            elif caller != target:
                targets = self._called.setdefault(caller, {})
                targets[target] = targets.get(target, False) or branch.returns
            elif branch.returns:
                self._recursive.add(caller)

    def leaves(self, function: int) -> bool:
        """Whether it calls what is no function of the block."""
        return function in self._leaving

    def function_at(self, place: int) -> int | None:
        """The function that an offset is in."""
        at = bisect_right(self._starts, place) - 1
        start = self._starts[at] if at >= 0 else place
        inside = at >= 0 and place < start + max(self._frames[start][0], 1)
        return start if inside else None

    def below(self, root: int) -> dict[int, set[int]]:
        """A function and all that it leads to, with what each of them calls."""
        found: dict[int, set[int]] = {}
        path = [root]
        while path:
            function = path.pop()
            if function not in found:
                itself = {function} & self._recursive
                found[function] = itself | self._called.get(function, {}).keys()
                path += found[function]
        return found

    def deepest(self, roots: Iterable[int]) -> list[tuple[int, int]]:
        """The chain of calls from one of `roots` that needs most: functions with the bytes of their frames."""
        known = [root for root in roots if root in self._frames]
        for root in known:
            self._measure(root)
        at = max(known, key=lambda root: self._deepest[root].amount, default=None)
        chain: dict[int, int] = {}
        while at is not None and at not in chain:
            found = self._deepest[at]
            chain[at] = self._frames[at][1] if found.keeps else 0
            at = found.target
        return list(chain.items())

    def _measure(self, root: int) -> None:
        """A function and all that it leads to, however long the chain of calls is."""
        path: list[tuple[int, Iterator[int]]] = []

        def enter(function: int) -> None:
            if function not in self._deepest:
                self._deepest[function] = _Deepest(self._frames[function][1])  # what only looks like a recursion ends
                path.append((function, iter(self._called.get(function, ()))))

        enter(root)
        while path:
            function, targets = path[-1]
            target = next(targets, None)
            if target is not None:
                enter(target)
                continue
            path.pop()
            own = self._frames[function][1]
            for target, returns in self._called.get(function, {}).items():
                amount = self._deepest[target].amount + (own if returns else 0)
                if amount > self._deepest[function].amount:
                    self._deepest[function] = _Deepest(amount, target, returns)


# ---- the frames -----------------------------------------------------------------------------------------------------

_ADVANCE, _OFFSET, _RESTORE = 0x40, 0x80, 0xC0
_SKIPPED = {0x00: "", 0x01: "a", 0x02: "1", 0x03: "2", 0x04: "4", 0x05: "uu", 0x06: "u", 0x07: "u", 0x08: "u",
            0x09: "uu", 0x0A: "", 0x0B: "", 0x0D: "u", 0x0F: "b", 0x10: "ub", 0x11: "us", 0x12: "us", 0x13: "s",
            0x14: "uu", 0x15: "us", 0x16: "ub", 0x2E: "u"}  # fmt: skip
"""Operands of the instructions that leave the size of the frame alone (DWARF 4, 7.23): address, fixed size, LEB128,
block."""


def read_frames(data: bytes, address_size: int, block: int = 0) -> Frames:
    """From a .debug_frame (DWARF 4, 6.4.1): the largest distance between the stack pointer before the call and within
    the function. `block`: the address of the block. Functions that are no part of it, as they are before it, are left
    out."""
    initial: dict[int, int] = {}
    frames: Frames = {}
    at = 0
    while at + 8 <= len(data):
        length = int.from_bytes(data[at : at + 4], "little")
        reader = _Reader(data, at + 8, at + 4 + length, address_size)
        cie = int.from_bytes(data[at + 4 : at + 8], "little")
        if cie == 0xFFFF_FFFF:
            initial[at] = _largest_frame(reader.after_head())
        else:
            begin, size = reader.fixed(address_size), reader.fixed(address_size)
            begin = (begin - block) % (1 << 8 * address_size)
            if begin >> (8 * address_size - 1) == 0:
                frames[begin] = (size, max(initial.get(cie, 0), _largest_frame(reader)))
        at += 4 + length
    return frames


class _Reader:
    def __init__(self, data: bytes, at: int, end: int, address_size: int) -> None:
        self._data, self._at, self._end, self._address_size = data, at, end, address_size

    def __bool__(self) -> bool:
        return self._at < self._end

    def fixed(self, size: int) -> int:
        self._at += size
        return int.from_bytes(self._data[self._at - size : self._at], "little")

    def unsigned(self) -> int:
        """An LEB128 number; of a signed one only that it is passed."""
        value = shift = 0
        while True:
            byte = self.fixed(1)
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def after_head(self) -> _Reader:
        """Passes what a CIE has before its instructions."""
        version = self.fixed(1)
        while self.fixed(1):
            pass
        if version >= 4:
            self.fixed(2)
        for _ in range(3):  # alignment of code and data, register of the return address
            self.unsigned()
        return self

    def skip(self, operands: str) -> None:
        for kind in operands:
            if kind == "a":
                self.fixed(self._address_size)
            elif kind in "us":
                self.unsigned()
            elif kind == "b":
                self.fixed(self.unsigned())
            else:
                self.fixed(int(kind))


def _largest_frame(reader: _Reader) -> int:
    return max(_frame_sizes(reader), default=0)


def _frame_sizes(reader: _Reader) -> Iterator[int]:
    while reader:
        code = reader.fixed(1)
        if code & 0xC0 == _OFFSET:
            reader.unsigned()
        elif code & 0xC0 in (_ADVANCE, _RESTORE):
            pass
        elif code in (0x0C, 0x0E):  # DW_CFA_def_cfa, DW_CFA_def_cfa_offset
            if code == 0x0C:
                reader.unsigned()
            yield reader.unsigned()
        elif code in _SKIPPED:
            reader.skip(_SKIPPED[code])
        else:
            return  # unknown: what follows cannot be read
