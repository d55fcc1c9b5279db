"""Where a failed check goes on: `__TRY`, and what is called from one.

An exception is the number of its kind and a branch. A function that a __TRY calls, directly or through others, is
compiled in a second form: it gets a pointer to where it leaves the number, and returns when it has raised. Its caller
looks at the number after the call. So there is nothing to unwind, the number lives on the stack of the task, and
programs without a __TRY are what they would be without all this.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from plctool.compiler.codegen.ir import Value, number
from plctool.compiler.codegen.lower_frame import STATEMENTS, Body, Detour, Frame, Handler, Ref, rule
from plctool.compiler.typed.nodes import Try


class Catch(Handler):
    """The __CATCH of the same function."""

    def __init__(self, label: str) -> None:
        self._label = label

    def raise_code(self, frame: Frame, code: int) -> None:
        frame.set_raised(number(code))
        frame.fn.branch(self._label)

    def raise_again(self, frame: Frame) -> None:
        frame.fn.branch(self._label)


@dataclass(eq=False)
class Finally(Detour):
    """A __FINALLY on the way out. `ways`: what follows it, by number; 0 is the end of the statement."""

    label: str
    way: Value  # where the number is
    outer: Handler
    ways: list[Callable[[], None]] = field(default_factory=list)
    pending: Value | None = None  # where an exception waits meanwhile

    @property
    def has_lines(self) -> bool:
        """As what follows it."""
        return self.outer.has_lines

    def go(self, frame: Frame, then: Callable[[], None]) -> None:
        self.ways.append(then)
        frame.fn.do(f"store i32 {len(self.ways) - 1}, ptr {self.way}")
        frame.fn.branch(self.label)

    def raise_code(self, frame: Frame, code: int) -> None:
        debug = frame.fn.debug

        def raised() -> None:
            frame.fn.debug = debug
            self.outer.raise_code(frame, code)

        self.go(frame, raised)

    def raise_again(self, frame: Frame) -> None:
        fn, debug = frame.fn, frame.fn.debug
        assert frame.raised is not None
        raised_slot = frame.raised
        pending = self.pending = self.pending or frame.exception_slot()
        frame.copy_exception(pending, raised_slot)
        frame.set_raised(number(0))

        def raised() -> None:
            fn.debug = debug
            frame.copy_exception(raised_slot, pending)
            self.outer.raise_again(frame)

        self.go(frame, raised)


@rule(STATEMENTS, Try)
def try_statement(frame: Body, s: Try) -> None:
    """The body with its exceptions led to where they are caught."""
    frame.expect_exceptions()
    if s.last:
        _with_last(frame, s)
    else:
        _with_catch(frame, s)


def _with_catch(frame: Body, s: Try) -> None:
    fn, outer = frame.fn, frame.handler
    if s.exception is None:
        frame.statements(s.body)
        return
    label, end = fn.label("catch"), fn.label("endtry")
    handler = frame.handler = Catch(label)
    frame.statements(s.body)
    frame.handler = outer
    fn.branch(end)
    frame.write_raises(handler)
    fn.begin_detached(label)
    frame.at(s.exception.pos)
    code = fn.value(f"load i32, ptr {frame.raised}")
    frame.set_raised(number(0))
    place: Ref = frame.ref(s.exception)
    frame.store(place, code)
    frame.statements(s.caught)
    fn.begin(end)


def _with_last(frame: Body, s: Try) -> None:
    fn, outer = frame.fn, frame.handler
    end = fn.label("endtry")
    region = Finally(fn.label("finally"), fn.slot("i32"), outer)
    frame.handler = region
    frame.finals.append(region)
    _with_catch(frame, s)
    region.go(frame, lambda: fn.branch(end))
    frame.write_raises(region)
    frame.finals.pop()
    frame.handler = outer
    fn.begin_detached(region.label)
    frame.statements(s.last)
    frame.at(s.pos)
    _go_on(frame, region)
    fn.begin_detached(end)


def _go_on(frame: Body, region: Finally) -> None:
    """What follows a __FINALLY, by the number of the way that led there."""
    fn = frame.fn
    labels = [fn.label("way") for _ in region.ways]
    chosen = fn.value(f"load i32, ptr {region.way}")
    cases = " ".join(f"i32 {n}, label %{label}" for n, label in enumerate(labels[1:], 1))
    fn.terminate(f"switch i32 {chosen}, label %{labels[0]} [ {cases} ]")
    debug = fn.debug
    for label, then in zip(labels, region.ways, strict=True):
        fn.begin_detached(label)
        then()
        fn.debug = debug
