"""Short ways to check a text, and a check of the contract between front end and lowering."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass

from plctool.compiler.front import CheckResult, Source, check_sources
from plctool.compiler.semantics.symbols import ERROR, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.typed import nodes as typed
from plctool.compiler.typed.nodes import Binary, BinaryOp, Call, Const, Pou, Statement, TypedProgram, Variable
from plctool.iec.common_types import SIGNED
from plctool.iec.types import BOOL, ArrayType, Elementary, Kind, StringType, Type, base_of, is_scalar

COMPARISONS = {BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE}


def check(text: str, *, library: str | None = None) -> CheckResult:
    """Checks one file; `library` is a text in place of the standard library."""
    lib = [Source("lib.st", library)] if library is not None else []
    return check_sources([Source("f.st", text)], library_sources=lib)


def program(text: str, *, library: str | None = None) -> TypedProgram:
    """The program of a text without errors."""
    result = check(text, library=library)
    assert result.program is not None, result.diagnostics
    verify(result.program)
    return result.program


def main(variables: str, body: str = "", before: str = "") -> str:
    """The text of a PROGRAM Main; its body starts in the line after the variables."""
    return f"{before}PROGRAM Main\nVAR\n{variables}\nEND_VAR\n{body}\nEND_PROGRAM\n"


def body_of(variables: str, body: str, before: str = "", *, library: str | None = None) -> list[Statement]:
    """The typed statements of PROGRAM Main."""
    return program(main(variables, body, before), library=library).programs["Main"].body


def findings(text: str, severity: str = "error", *, library: str | None = None) -> list[tuple[int, int, str]]:
    """Line, column and code of each error (or warning)."""
    return [(d.line, d.column, d.code) for d in check(text, library=library).diagnostics if d.severity == severity]


def messages(text: str, severity: str = "error", *, library: str | None = None) -> list[str]:
    """`line:column: message` of each error (or warning)."""
    found = check(text, library=library).diagnostics
    return [f"{d.line}:{d.column}: {d.message}" for d in found if d.severity == severity]


def folded(expression: str, declared: str = "LREAL") -> Const:
    """The constant an expression is folded to, as a value of the type."""
    statement = body_of(f"x : {declared};", f"x := {expression};")[0]
    assert isinstance(statement, typed.Assign)
    assert isinstance(statement.value, Const), statement.value
    return statement.value


def variable(p: TypedProgram, name: str) -> Variable:
    """The variable of that full name."""
    return next(v for v in p.globals if v.name == name)


# ---- the contract of typed.py --------------------------------------------------------------------------------------


def nodes(root: object) -> Iterator[object]:
    """All typed nodes below `root`, not following calls into other units."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, list | tuple):
            stack.extend(node)
        elif is_dataclass(node) and not isinstance(node, Pou | Variable | Type | typed.Pos):
            yield node
            stack.extend(getattr(node, f.name) for f in fields(node))


def verify(p: TypedProgram) -> None:
    """Asserts what the lowering relies on."""
    for pou in p.pous:
        for node in nodes(pou.body):
            _verify_node(node)
    for v in p.globals:
        assert v.offset >= 0
        assert v.offset % v.type.align == 0
        assert v.offset + v.type.size <= p.area_sizes[v.area]


def _verify_node(node: object) -> None:
    t = getattr(node, "type", None)
    assert t not in (ERROR, UNTYPED_INT, UNTYPED_REAL), node
    if isinstance(node, Const):
        _verify_constant(node)
    elif isinstance(node, Binary):
        if not isinstance(node.left.type, StringType):
            assert base_of(node.left.type) == base_of(node.right.type), node
        assert node.type is BOOL if node.op in COMPARISONS else base_of(node.type) == base_of(node.left.type), node
    elif isinstance(node, Call):
        assert len(node.args) == len(node.function.parameters)
    elif isinstance(node, typed.Assign):
        _verify_assignment(node.target.type, node.value.type)
    elif isinstance(node, typed.If):
        assert all(condition.type is BOOL for condition, _ in node.branches)
    elif isinstance(node, typed.For):
        counter = base_of(node.var.type)
        assert base_of(node.start.type) == node.stop.type == counter
        assert node.step.type in (counter, SIGNED[counter.size * 8])
    elif isinstance(node, typed.FbCall):
        for target, value in node.inputs:
            _verify_assignment(target.type, value.type)


def _verify_constant(node: Const) -> None:
    t = base_of(node.type)
    if isinstance(t, StringType):
        assert isinstance(node.value, str)
    elif isinstance(t, Elementary) and t.kind is Kind.REAL:
        assert isinstance(node.value, float), node
    else:
        assert isinstance(node.value, int), node
        if isinstance(t, Elementary):
            low = -(1 << (t.bits - 1)) if t.signed else 0
            assert low <= node.value < low + (1 << t.bits), node


def _verify_assignment(target: Type, value: Type) -> None:
    if isinstance(target, StringType):
        assert isinstance(value, StringType)
    elif is_scalar(target):
        assert base_of(target) == base_of(value), (target, value)
    elif isinstance(target, ArrayType) and isinstance(value, ArrayType):
        lengths = [[last - first for first, last in t.bounds] for t in (target, value)]
        assert lengths[0] == lengths[1], (target, value)
        _verify_assignment(target.element, value.element)
    else:
        assert target == value or str(target) == str(value), (target, value)


def names(found: Sequence[Variable]) -> list[str]:
    """The names of variables."""
    return [v.name for v in found]
