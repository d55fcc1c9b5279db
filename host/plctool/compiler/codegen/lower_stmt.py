"""Statements and the bodies of POUs."""

from __future__ import annotations

from plctool.compiler.codegen.analysis import Effects, root_of, walk
from plctool.compiler.codegen.ir import Function
from plctool.compiler.codegen.lower_arith import is_signed, known_integer
from plctool.compiler.codegen.lower_blocks import BlockCalls
from plctool.compiler.codegen.lower_frame import DIVIDE_BY_ZERO, Ref, string_capacity
from plctool.compiler.codegen.lower_unit import Check, Unit, value_type
from plctool.compiler.codegen.ranges import type_range, value_range
from plctool.compiler.codegen.signatures import result_in_memory
from plctool.compiler.typed import (
    Assign,
    BinaryOp,
    Call,
    CallStatement,
    Case,
    Continue,
    Exit,
    Expr,
    FbCall,
    For,
    If,
    Load,
    Place,
    Pou,
    PouKind,
    Repeat,
    Statement,
    Storage,
    Variable,
    VarPlace,
    While,
)
from plctool.compiler.types import StringType, is_scalar

_WIDEST_SWITCH = 64  # labels of one range that become cases of a switch


class Body(BlockCalls):
    """The body of one POU."""

    def __init__(self, unit: Unit, fn: Function, pou: Pou, effects: Effects) -> None:
        super().__init__(unit, fn, pou)
        self.effects = effects
        self._return = "return"
        self._loops: list[tuple[str, str]] = []  # labels for CONTINUE and EXIT

    def statements(self, body: list[Statement]) -> None:
        for statement in body:
            self.release_temporaries()
            self.at(statement.pos)
            self._statement(statement)

    def _statement(self, s: Statement) -> None:
        if isinstance(s, Assign):
            self._assign(s)
        elif isinstance(s, If):
            self._if(s)
        elif isinstance(s, FbCall):
            self.fb_call(s)
        elif isinstance(s, CallStatement):
            self._call_statement(s.call)
        elif isinstance(s, Case):
            self._case(s)
        elif isinstance(s, For):
            self._for(s)
        elif isinstance(s, While):
            self._while(s)
        elif isinstance(s, Repeat):
            self._repeat_until(s)
        elif isinstance(s, Exit):
            self.fn.branch(self._loops[-1][1])
        elif isinstance(s, Continue):
            self.fn.branch(self._loops[-1][0])
        else:
            self.fn.branch(self._return)

    # ---- assignments and calls ----

    def _assign(self, s: Assign) -> None:
        target = s.target
        if is_scalar(target.type):
            value = self.value(s.value)
            self.store(self.ref(target), value)
        elif isinstance(s.value, Call) and self._may_write_directly(target, s.value):
            self.call(s.value, self.ref(target))
        else:
            self.assign_aggregate(self.ref(target), s.value)

    def _may_write_directly(self, target: Place, call: Call) -> bool:
        """Whether the callee may build its result in the target: it fits, and nobody sees it half done."""
        pou = call.function
        if pou.external or not _fits(call, target) or not self.effects.is_local(pou):
            return False
        root = root_of(target)
        arguments = (
            call.args[1:] if pou.in_place and _is_whole(call.args[0], root) and _is_whole(target, root) else call.args
        )
        return root is not None and all(
            node.var is not root and node.var.storage is not Storage.REFERENCE
            for node in walk(arguments)
            if isinstance(node, VarPlace)
        )

    def _call_statement(self, call: Call) -> None:
        self.call(call, self.temporary(call.type) if result_in_memory(call.function) else None)

    # ---- branches ----

    def _if(self, s: If) -> None:
        fn = self.fn
        end = fn.label("endif")
        for condition, body in s.branches:
            self.at(condition.pos)
            then, otherwise = fn.label("then"), fn.label("else")
            fn.branch_if(self.condition(condition), then, otherwise)
            fn.begin(then)
            self.statements(body)
            fn.branch(end)
            fn.begin(otherwise)
        self.statements(s.otherwise)
        fn.begin(end)

    def _case(self, s: Case) -> None:
        fn, t = self.fn, s.selector.type
        text = value_type(t)
        selector = self.value(s.selector)
        end, default = fn.label("endcase"), fn.label("default")
        labels = [fn.label("case") for _ in s.branches]
        cases, wide = [], []
        for label, (ranges, _) in zip(labels, s.branches, strict=True):
            for low, high in ranges:
                if high - low < _WIDEST_SWITCH:
                    cases += [f"{text} {value}, label %{label}" for value in range(low, high + 1)]
                else:
                    wide.append((low, high, label))
        for low, high, label in wide:
            offset = fn.value(f"sub {text} {selector}, {low}")
            following = fn.label("range")
            fn.branch_if(fn.value(f"icmp ule {text} {offset}, {high - low}"), label, following)
            fn.begin(following)
        fn.terminate(f"switch {text} {selector}, label %{default} [ {' '.join(cases)} ]")
        for label, (_, body) in zip(labels, s.branches, strict=True):
            fn.begin_detached(label)
            self.statements(body)
            fn.branch(end)
        fn.begin_detached(default)
        self.statements(s.otherwise)
        fn.begin(end)

    # ---- loops ----

    def _while(self, s: While) -> None:
        fn = self.fn
        again, body, end = fn.label("while"), fn.label("do"), fn.label("endwhile")
        fn.begin(again)
        self.at(s.condition.pos)
        fn.branch_if(self.condition(s.condition), body, end)
        fn.begin(body)
        self._loop_body(s.body, again, end)
        fn.branch(again)
        fn.begin_detached(end)

    def _repeat_until(self, s: Repeat) -> None:
        fn = self.fn
        again, test, end = fn.label("repeat"), fn.label("until"), fn.label("endrepeat")
        fn.begin(again)
        self._loop_body(s.body, test, end)
        fn.begin(test)
        self.at(s.until.pos)
        fn.branch_if(self.condition(s.until), end, again)
        fn.begin_detached(end)

    def _loop_body(self, body: list[Statement], on_continue: str, on_exit: str) -> None:
        self._loops.append((on_continue, on_exit))
        self.statements(body)
        self._loops.pop()
        self.release_temporaries()

    def _for(self, s: For) -> None:
        """The test in front of the increment keeps the variable from wrapping; it ends at the first value behind
        `stop`, or at the limit of its type."""
        fn = self.fn
        start, stop, step = self.value(s.start), self.value(s.stop), self.value(s.step)
        known_step = known_integer(s.step)
        if known_step is None and Check.DIV in self.checks:
            self.require(fn.value(f"icmp ne {value_type(s.step.type)} {step}, 0"), DIVIDE_BY_ZERO, s.step.pos)
        var = self.effects.owns_loop_variable(s, self.pou) if self.pou else None
        loop = _Loop(self, s, stop, step, known_step, var)
        loop.set(start)
        body, following, end = fn.label("for"), fn.label("next"), fn.label("endfor")
        fn.branch_if(loop.enters(start), body, end)
        fn.begin_detached(body)
        with_range = loop.limits()
        if var is not None and with_range is not None:
            self.ranges[var] = with_range
        self._loop_body(s.body, following, end)
        fn.begin(following)
        self.at(s.pos)
        again, last = fn.label("again"), fn.label("last")
        current = loop.current()
        fn.branch_if(loop.goes_on(current), again, last)
        fn.begin_detached(again)
        loop.set(fn.value(f"add {loop.text} {current}, {step}"))
        fn.branch(body)
        fn.begin_detached(last)
        word = "sadd" if is_signed(s.var.type) else "uadd"
        if known_step is not None and known_step < 0 and word == "uadd":
            word, step = "usub", str(-known_step)
        loop.set(fn.value(f"call {loop.text} @llvm.{word}.sat.{loop.text}({loop.text} {current}, {loop.text} {step})"))
        fn.begin(end)
        if var is not None:
            self.shadows.pop(var, None)
            self.ranges.pop(var, None)

    # ---- the whole ----

    def write(self) -> None:
        """Writes everything from the first local variable to the return."""
        pou, fn = self.pou, self.fn
        assert pou is not None
        if pou.kind in (PouKind.FUNCTION, PouKind.METHOD):
            self._take_parameters(pou)
        self.take_inputs(pou)
        if pou.result is not None and result_in_memory(pou):
            capacity = "%result.capacity" if pou.cuts_result else string_capacity(pou.result.type)
            self.locals[pou.result] = Ref("%result", 0, pou.result.type, direct=True, capacity=capacity)
        for var in pou.locals:
            if var not in self.locals:
                self.locals[var] = self._stack_memory(var)
            if not (pou.no_init or (pou.cuts_result and var is pou.result)):  # whose size is the caller's
                self.clear(self.locals[var])
            self.initialise(self.locals[var], var.initial)
        self.statements(pou.body)
        fn.begin(self._return)
        if pou.result is not None and is_scalar(pou.result.type):
            fn.terminate(f"ret {value_type(pou.result.type)} {self.load(self.locals[pou.result])}")
        else:
            fn.terminate("ret void")
        self.write_raises()

    def write_calls(self, parts: list[str]) -> None:
        """Writes calls of the parts that the body was cut into."""
        assert self.pou is not None
        self.take_inputs(self.pou)
        instance = ", ptr %self" if self.pou.kind is PouKind.FUNCTION_BLOCK else ""
        for symbol in parts:
            self.fn.do(f"call void @{symbol}(ptr %ctx{instance})")
        self.fn.terminate("ret void")

    def _stack_memory(self, var: Variable) -> Ref:
        t = var.type
        if is_scalar(t):
            return Ref(self.fn.slot(value_type(t)), 0, t, direct=True)
        return Ref(self.fn.alloca(t.size, t.align), 0, t, direct=True, capacity=string_capacity(t))

    def _take_parameters(self, pou: Pou) -> None:
        for number, parameter in enumerate(pou.parameters):
            var, name = parameter.variable, f"%p{number}"
            if parameter.by_reference:
                capacity = f"{name}.capacity" if isinstance(var.type, StringType) else ""
                self.locals[var] = Ref(name, 0, var.type, capacity=capacity)
                continue
            ref = self._stack_memory(var)
            self.locals[var] = ref
            if is_scalar(var.type):
                self.store(ref, name)
            elif isinstance(var.type, StringType):
                self.copy_string(ref, Ref(name, 0, var.type, capacity=f"{name}.capacity"))
            else:
                self.copy(ref, Ref(name, 0, var.type), var.type.size)


def _fits(call: Call, target: Place) -> bool:
    """Whether the callee stays within the memory of the target."""
    result, t = call.type, target.type
    if isinstance(result, StringType) and isinstance(t, StringType):
        return call.function.cuts_result or result.length <= t.length
    return result == t


def _is_whole(argument: Expr | Place | None, variable: Variable | None) -> bool:
    """Whether an argument is just that variable."""
    place = argument.place if isinstance(argument, Load) else argument
    return isinstance(place, VarPlace) and place.var is variable


class _Loop:
    """The control variable of a FOR loop. When only the loop writes it, its value is kept in a register as well."""

    def __init__(self, body: Body, s: For, stop: str, step: str, known_step: int | None, var: Variable | None) -> None:
        self._body, self._s, self._stop, self._step, self._known_step = body, s, stop, step, known_step
        self.text = value_type(s.var.type)
        self._shadow = body.fn.slot(self.text) if var is not None else ""
        if var is not None:
            body.shadows[var] = self._shadow

    def set(self, value: str) -> None:
        body = self._body
        body.store(body.ref(self._s.var), value)
        if self._shadow:
            body.fn.do(f"store {self.text} {value}, ptr {self._shadow}")

    def current(self) -> str:
        body = self._body
        if self._shadow:
            return body.fn.value(f"load {self.text}, ptr {self._shadow}")
        return body.load(body.ref(self._s.var))

    def enters(self, start: str) -> str:
        return self._reaches(start)

    def goes_on(self, current: str) -> str:
        """Whether another round follows: `current` + step neither passes `stop` nor wraps."""
        body, fn, t = self._body, self._body.fn, self._s.var.type
        if self._known_step in (1, -1):
            op = BinaryOp.LT if self._known_step == 1 else BinaryOp.GT
            return body.compare(op, current, self._stop, t)
        if self._shadow and self._next_fits():
            return self._reaches(fn.value(f"add {self.text} {current}, {self._step}"))
        room = self._by_direction(
            fn.value(f"sub {self.text} {self._stop}, {current}"), fn.value(f"sub {self.text} {current}, {self._stop}")
        )
        size = self._by_direction(self._step, fn.value(f"sub {self.text} 0, {self._step}"))
        enough = fn.value(f"icmp uge {self.text} {room}, {size}")
        return fn.value(f"and i1 {self._reaches(current)}, {enough}")

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

    def _reaches(self, value: str) -> str:
        """Whether `value` is not beyond `stop`."""
        body, t = self._body, self._s.var.type
        if self._known_step is not None:
            op = BinaryOp.LE if self._known_step > 0 else BinaryOp.GE
            return body.compare(op, value, self._stop, t)
        up, down = (body.compare(op, value, self._stop, t) for op in (BinaryOp.LE, BinaryOp.GE))
        return body.fn.value(f"select i1 {self._upwards()}, i1 {up}, i1 {down}")

    def _by_direction(self, up: str, down: str) -> str:
        if self._known_step is not None:
            return up if self._known_step > 0 else down
        return self._body.fn.value(f"select i1 {self._upwards()}, {self.text} {up}, {self.text} {down}")

    def _upwards(self) -> str:
        if not is_signed(self._s.step.type):
            return "true"
        return self._body.fn.value(f"icmp sgt {self.text} {self._step}, 0")
