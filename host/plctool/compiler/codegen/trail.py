"""The lines that an exception passed before a `__TRY` without `__CATCH`, or a `__CATCH` itself, let it out again.

Beside the number of the exception on the stack of the task is how many lines it passed, and the numbers of the first
ones and of the last: where it was raised, then the calls that returned it. What stops the task copies them to a
variable, where the host reads them. Only programs that may need it have the variable.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import Function, Value
from plctool.debug.passed_lines import DEPTH, PassedLine

_WORD = 4  # bytes
COUNT = _WORD  # offset of the count
SIZE = _WORD * (2 + DEPTH)  # with the number of the exception


class Trail:
    """The lines of one compilation where an exception may be raised or handed on, by their numbers from 1."""

    def __init__(self) -> None:
        self._numbers: dict[PassedLine, int] = {}

    @property
    def lines(self) -> list[PassedLine]:
        return [*self._numbers]

    def number(self, line: PassedLine) -> int:
        return self._numbers.setdefault(line, len(self._numbers) + 1)

    def begin(self, fn: Function, raised: Value, line: PassedLine) -> None:
        """Notes where an exception was raised."""
        _store(fn, raised, COUNT, "1")
        _store(fn, raised, COUNT + _WORD, str(self.number(line)))

    def extend(self, fn: Function, raised: Value, line: PassedLine) -> None:
        """Notes the line of a call that returned an exception; when there is no room, in place of the last one."""
        count = fn.value(f"load i32, ptr {_at(fn, raised, COUNT)}")
        is_room = fn.value(f"icmp ult i32 {count}, {DEPTH - 1}")
        index = fn.value(f"select i1 {is_room}, i32 {count}, i32 {DEPTH - 1}")
        entry = fn.value(f"getelementptr i32, ptr {_at(fn, raised, COUNT + _WORD)}, i32 {index}")
        fn.do(f"store i32 {self.number(line)}, ptr {entry}")
        _store(fn, raised, COUNT, str(fn.value(f"add i32 {count}, 1")))

    def publish(self, fn: Function, raised: Value, target: Value) -> None:
        """Copies the count and the numbers to `target`, 0 where there is none."""
        count = fn.value(f"load i32, ptr {_at(fn, raised, COUNT)}")
        _store(fn, target, 0, str(count))
        for entry in range(DEPTH):
            number = fn.value(f"load i32, ptr {_at(fn, raised, COUNT + _WORD * (1 + entry))}")
            is_noted = fn.value(f"icmp ugt i32 {count}, {entry}")
            noted = fn.value(f"select i1 {is_noted}, i32 {number}, i32 0")
            _store(fn, target, _WORD * (1 + entry), str(noted))


def _at(fn: Function, raised: Value, offset: int) -> Value:
    return fn.value(f"getelementptr i8, ptr {raised}, i32 {offset}")


def _store(fn: Function, raised: Value, offset: int, value: str) -> None:
    fn.do(f"store i32 {value}, ptr {_at(fn, raised, offset)}")
