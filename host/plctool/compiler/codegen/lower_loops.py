"""Loops."""

from __future__ import annotations

from plctool.compiler.codegen.ir import TRUE, Value, number
from plctool.compiler.codegen.lower_arith import compare, is_signed, known_integer
from plctool.compiler.codegen.lower_expr import truth
from plctool.compiler.codegen.lower_frame import DIVIDE_BY_ZERO, STATEMENTS, Body, rule
from plctool.compiler.codegen.lower_unit import Check, value_type
from plctool.compiler.typed.nodes import BinaryOp, Convert, For, Load, Repeat, Statement, Variable, While
from plctool.compiler.typed.ranges import type_range, value_range
from plctool.iec.types import SubrangeType


@rule(STATEMENTS, While)
def while_loop(frame: Body, s: While) -> None:
    """The test comes before each iteration."""
    fn = frame.fn
    again, body, end = fn.label("while"), fn.label("do"), fn.label("endwhile")
    fn.begin(again)
    frame.at(s.condition.pos)
    fn.branch_if(truth(frame, s.condition), body, end)
    fn.begin(body)
    _loop_body(frame, s.body, again, end)
    fn.branch(again)
    fn.begin_detached(end)


@rule(STATEMENTS, Repeat)
def repeat_loop(frame: Body, s: Repeat) -> None:
    """The condition is tested after each iteration."""
    fn = frame.fn
    again, test, end = fn.label("repeat"), fn.label("until"), fn.label("endrepeat")
    fn.begin(again)
    _loop_body(frame, s.body, test, end)
    fn.begin(test)
    frame.at(s.until.pos)
    fn.branch_if(truth(frame, s.until), end, again)
    fn.begin_detached(end)


def _loop_body(frame: Body, body: list[Statement], on_continue: str, on_exit: str) -> None:
    frame.loops.append((on_continue, on_exit, len(frame.finals)))
    frame.statements(body)
    frame.loops.pop()
    frame.release_temporaries()


@rule(STATEMENTS, For)
def for_loop(frame: Body, s: For) -> None:
    """Ends with the first value of the variable past `stop`, or with the limit of its type."""
    if s.each_turn and (known_integer(s.stop) is None or known_integer(s.step) is None):
        _loop_with_limits_of_each_turn(frame, s)
        return
    fn = frame.fn
    start = frame.value(s.start)
    stop, step = _stop_and_step(frame, s)
    known_step = known_integer(s.step)
    var = _own_variable(frame, s)
    loop = _Loop(frame, s, stop, step, known_step, var)
    loop.set(start)
    body, following, end = fn.label("for"), fn.label("next"), fn.label("endfor")
    fn.branch_if(loop.enters(start), body, end)
    fn.begin_detached(body)
    loop.show()
    with_range = loop.limits()
    if var is not None and with_range is not None:
        frame.ranges[var] = with_range
    _check_subrange(frame, s)
    _loop_body(frame, s.body, following, end)
    fn.begin(following)
    frame.at(s.pos)
    loop.turn(body, end)
    fn.begin(end)
    loop.show()
    if var is not None:
        frame.shadows.pop(var, None)
        frame.ranges.pop(var, None)


def _loop_with_limits_of_each_turn(frame: Body, s: For) -> None:
    """The variable is set before `stop` is computed, in each turn again; `step` at the start and after each turn."""
    fn = frame.fn
    start, known_step = frame.value(s.start), known_integer(s.step)
    var = _own_variable(frame, s)
    text, step = value_type(s.step.type), _step(frame, s)
    kept = None if known_step is not None else fn.slot(text)
    if kept is not None:
        fn.do(f"store {text} {step}, ptr {kept}")
    loop = _Loop(frame, s, start, step, known_step, var)
    loop.set(start)
    test, body, following, end = (fn.label(name) for name in ("to", "for", "next", "endfor"))
    fn.begin(test)
    frame.at(s.pos)
    loop.show()
    if kept is not None:
        step = fn.value(f"load {text}, ptr {kept}")
    loop.use(frame.value(s.stop), step)
    fn.branch_if(loop.enters(loop.current()), body, end)
    fn.begin_detached(body)
    _check_subrange(frame, s)
    _loop_body(frame, s.body, following, end)
    fn.begin(following)
    frame.at(s.pos)
    step = _step(frame, s)
    if kept is not None:
        fn.do(f"store {text} {step}, ptr {kept}")
    loop.advance(step, test, end)
    fn.begin_detached(end)
    loop.show()
    if var is not None:
        frame.shadows.pop(var, None)


def _own_variable(frame: Body, s: For) -> Variable | None:
    """The variable if only the loop writes it, which a debugger may do as well."""
    if frame.pou is None or frame.unit.options.steps:
        return None
    return frame.effects.owns_loop_variable(s, frame.pou)


def _check_subrange(frame: Body, s: For) -> None:
    """Each iteration has a value of the subrange that the variable may be of."""
    t = s.var.type
    if isinstance(t, SubrangeType):
        frame.value(Convert(Load(s.var, t.base, s.pos), t, s.pos, check=(t.low, t.high)))


def _stop_and_step(frame: Body, s: For) -> tuple[Value, Value]:
    """Their values now; a step of 0 is an exception."""
    return frame.value(s.stop), _step(frame, s)


def _step(frame: Body, s: For) -> Value:
    step = frame.value(s.step)
    if known_integer(s.step) is None and Check.DIV in frame.checks:
        frame.require(frame.fn.value(f"icmp ne {value_type(s.step.type)} {step}, 0"), DIVIDE_BY_ZERO, s.step.pos)
    return step


class _Loop:
    """The control variable of a FOR loop. When only the loop writes it, its value is kept in a register, and `show`
    stores it where the program may read it, leave the loop or stop."""

    def __init__(
        self, body: Body, s: For, stop: Value, step: Value, known_step: int | None, var: Variable | None
    ) -> None:
        self._body, self._s, self._stop, self._step, self._known_step = body, s, stop, step, known_step
        self.text = value_type(s.var.type)
        self._shadow = body.fn.slot(self.text) if var is not None else None
        if var is not None and self._shadow is not None:
            body.shadows[var] = self._shadow

    def set(self, value: Value) -> None:
        if self._shadow is None:
            self._store(value)
        else:
            self._body.fn.do(f"store {self.text} {value}, ptr {self._shadow}")

    def show(self) -> None:
        """At the start of each iteration, and after the last one."""
        if self._shadow is not None:
            self._store(self.current())

    def _store(self, value: Value) -> None:
        self._body.store(self._body.ref(self._s.var), value)

    def current(self) -> Value:
        """The value of the variable."""
        body = self._body
        if self._shadow is not None:
            return body.fn.value(f"load {self.text}, ptr {self._shadow}")
        return body.load(body.ref(self._s.var))

    def use(self, stop: Value, step: Value) -> None:
        """From now on these hold."""
        self._stop, self._step = stop, step

    def enters(self, start: Value) -> Value:
        return self._reaches(start)

    def turn(self, again: str, end: str) -> None:
        """Sets the next value. Branches to `again`, or to `end` when it is past `stop`, or would wrap, which leaves
        the limit of the type."""
        fn, current = self._body.fn, self.current()
        following = fn.value(f"add {self.text} {current}, {self._step}")
        if self._shadow is not None and self._next_fits():
            self.set(following)
            fn.branch_if(self._reaches(following), again, end)
            return
        goes_on, last = self._goes_on(current), fn.label("last")
        if self._shadow is not None:
            self.set(following)  # where it is seen by nothing else, so it may wrap
            fn.branch_if(goes_on, again, last)
        else:
            advance = fn.label("again")
            fn.branch_if(goes_on, advance, last)
            fn.begin_detached(advance)
            self.set(following)
            fn.branch(again)
        fn.begin_detached(last)
        self.set(self._saturated(current))
        fn.branch(end)

    def advance(self, step: Value, again: str, end: str) -> None:
        """Sets the next value. Branches to `again`, or to `end` when it would wrap, which leaves the limit of the
        type."""
        self._step = step
        body, fn, current, t = self._body, self._body.fn, self.current(), self._s.var.type
        following = fn.value(f"add {self.text} {current}, {step}")
        up, down = (compare(body, op, following, current, t) for op in (BinaryOp.GT, BinaryOp.LT))
        if self._known_step is not None:
            fits = up if self._known_step > 0 else down
        else:
            fits = fn.value(f"select i1 {self._upwards()}, i1 {up}, i1 {down}")
        fitting, last = fn.label("again"), fn.label("last")
        fn.branch_if(fits, fitting, last)
        fn.begin_detached(fitting)
        self.set(following)
        fn.branch(again)
        fn.begin_detached(last)
        self.set(self._saturated(current))
        fn.branch(end)

    def _goes_on(self, current: Value) -> Value:
        """Whether `current` + step neither passes `stop` nor wraps."""
        body, fn, t = self._body, self._body.fn, self._s.var.type
        if self._known_step in (1, -1):
            op = BinaryOp.LT if self._known_step == 1 else BinaryOp.GT
            return compare(body, op, current, self._stop, t)
        room = self._by_direction(
            fn.value(f"sub {self.text} {self._stop}, {current}"), fn.value(f"sub {self.text} {current}, {self._stop}")
        )
        size = self._by_direction(self._step, fn.value(f"sub {self.text} 0, {self._step}"))
        enough = fn.value(f"icmp uge {self.text} {room}, {size}")
        return fn.value(f"and i1 {self._reaches(current)}, {enough}")

    def _saturated(self, current: Value) -> Value:
        """`current` + step, or the limit of the type."""
        step, known = self._step, self._known_step
        if is_signed(self._s.var.type):
            return self._limited("sadd", current, step)
        if known is not None:
            return self._limited("uadd" if known > 0 else "usub", current, number(abs(known)))
        up = self._limited("uadd", current, step)
        if not is_signed(self._s.step.type):
            return up
        size = self._body.fn.value(f"sub {self.text} 0, {step}")
        return self._by_direction(up, self._limited("usub", current, size))

    def _limited(self, word: str, current: Value, amount: Value) -> Value:
        text = self.text
        return self._body.fn.value(f"call {text} @llvm.{word}.sat.{text}({text} {current}, {text} {amount})")

    def limits(self) -> tuple[int, int] | None:
        """The values the variable can have in the body."""
        start = value_range(self._s.start, self._body.ranges)
        stop = value_range(self._s.stop, self._body.ranges)
        if start is None or stop is None or self._known_step is None:
            return None
        return (start[0], stop[1]) if self._known_step > 0 else (stop[0], start[1])

    def _next_fits(self) -> bool:
        """Whether stop + step is a value of the variable's type."""
        stop, whole = value_range(self._s.stop, {}), type_range(self._s.var.type)
        if stop is None or whole is None or self._known_step is None:
            return False
        return whole[0] <= stop[0] + self._known_step and stop[1] + self._known_step <= whole[1]

    def _reaches(self, value: Value) -> Value:
        """Whether `value` is not beyond `stop`."""
        body, t = self._body, self._s.var.type
        if self._known_step is not None:
            op = BinaryOp.LE if self._known_step > 0 else BinaryOp.GE
            return compare(body, op, value, self._stop, t)
        up, down = (compare(body, op, value, self._stop, t) for op in (BinaryOp.LE, BinaryOp.GE))
        return body.fn.value(f"select i1 {self._upwards()}, i1 {up}, i1 {down}")

    def _by_direction(self, up: Value, down: Value) -> Value:
        if self._known_step is not None:
            return up if self._known_step > 0 else down
        return self._body.fn.value(f"select i1 {self._upwards()}, {self.text} {up}, {self.text} {down}")

    def _upwards(self) -> Value:
        if not is_signed(self._s.step.type):
            return TRUE
        return self._body.fn.value(f"icmp sgt {self.text} {self._step}, 0")
