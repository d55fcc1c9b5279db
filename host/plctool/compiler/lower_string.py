"""Strings: copying with cutting, comparing.

A STRING is a run of bytes up to a NUL or the capacity, whichever comes first: no memory content makes these functions
read or write outside of it. Bytes behind the NUL have no meaning and may be overwritten.
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.lower_arith import Arithmetic
from plctool.compiler.lower_frame import Ref
from plctool.compiler.typed import BinaryOp
from plctool.compiler.types import DINT, StringType

_INLINE_COPY = 128  # bytes that LLVM copies with a few vector moves
_SHORT_COPY = 16  # bytes that it copies without vectors, but with unaligned words
_TINY_COPY = 4
_INLINE_COMPARE = 16


class Strings(Arithmetic):
    """String operations of the function being written."""

    def copy_string(self, target: Ref, source: Ref) -> None:
        """target := source, cut to the target's capacity."""
        if target.capacity.isdigit() and source.capacity.isdigit():
            length = min(int(target.capacity), int(source.capacity))
            target_machine = self.unit.target
            inline = _INLINE_COPY if target_machine.vectors else _SHORT_COPY if target_machine.unaligned else _TINY_COPY
            if length <= inline:
                self.copy(target, source, length)
                self._terminate(target, length)
                return
        name, capacity = self.unit.helper("str.copy"), source.capacity
        self.fn.value(
            f"call i32 @{name}(ptr null, ptr {self.address(target)}, i32 {target.capacity}, i32 0, "
            f"ptr {self.address(source)}, i32 {capacity}, i32 0, i32 {capacity})"
        )

    def copy_literal(self, target: Ref, text: bytes) -> None:
        """target := constant, cut to the target's capacity."""
        if not target.capacity.isdigit():
            self.copy_string(target, self.literal(text))
            return
        text = text[: int(target.capacity)]
        if text:
            self.copy(target, replace(self.literal(text), direct=target.direct), len(text))
        self._terminate(target, len(text))

    def literal(self, text: bytes) -> Ref:
        """A constant string in the image."""
        pointer = self.unit.module.constant(text + b"\0")
        return Ref(pointer, 0, StringType(len(text)), direct=True, capacity=str(len(text)))

    def _terminate(self, target: Ref, length: int) -> None:
        end = self.address(replace(target, offset=target.offset + length))
        self.fn.do(f"store i8 0, ptr {end}, align 1")

    def compare_strings(self, op: BinaryOp, left: Ref, right: Ref) -> str:
        """The i1 of a comparison, byte by byte, unsigned."""
        order = self.fn.value(
            f"call i32 @{self.unit.helper('str.compare')}(ptr {self.address(left)}, i32 {left.capacity}, "
            f"ptr {self.address(right)}, i32 {right.capacity})"
        )
        return self.compare(op, order, "0", DINT)

    def equals_literal(self, ref: Ref, text: bytes) -> str | None:
        """The i1 of a comparison with a short constant, without a loop; None when that is not possible."""
        size = len(text) + 1
        if not ref.capacity.isdigit() or size > _INLINE_COMPARE:
            return None
        if int(ref.capacity) < len(text):
            return "false"
        fn, data, at = self.fn, text + b"\0", 0
        parts = []
        while at < size:
            width = max(w for w in (1, 2, 4, 8) if w <= min(size - at, self.unit.target.pointer_size))
            pointer = self.address(replace(ref, offset=ref.offset + at))
            loaded = fn.value(f"freeze i{8 * width} {fn.value(f'load i{8 * width}, ptr {pointer}, align 1')}")
            wanted = int.from_bytes(data[at : at + width], "little")
            parts.append(fn.value(f"icmp eq i{8 * width} {loaded}, {wanted}"))
            at += width
        result = parts[0]
        for part in parts[1:]:
            result = fn.value(f"and i1 {result}, {part}")
        return result
