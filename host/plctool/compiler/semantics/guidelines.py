"""PLCopen's Coding Guidelines, where a project asks for them: rules about names, about what is written, about what it
means. `syntax/guidelines.py` says what each rule is; numbers are those of the guidelines.

What the compiler writes itself, as for the networks of LD and FBD, is not held to rules about statements.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from plctool.compiler.semantics.stages import Checked
from plctool.compiler.semantics.symbols import PouSymbol, TypeSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.guidelines import Guidelines, read_form
from plctool.compiler.typed.nodes import Assign as TypedAssign
from plctool.compiler.typed.nodes import (
    AssignedValue,
    Binary,
    BinaryOp,
    Convert,
    Expr,
    FbCall,
    For,
    MemberPlace,
    Place,
    Pos,
    Pou,
    PouKind,
    SelfPlace,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import Elementary, Kind, PointerType

_ALLOCATORS = ("__new",)
_ORDERED = (BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE)
_KIND_OF_SECTION = {
    ast.Section.VAR_INPUT: "input",
    ast.Section.VAR_OUTPUT: "output",
    ast.Section.VAR_IN_OUT: "in-out",
    ast.Section.VAR_GLOBAL: "global",
}
_PARAMETERS = (ast.Section.VAR_INPUT, ast.Section.VAR_OUTPUT, ast.Section.VAR_IN_OUT)
_RULE_OF_KIND = {"struct": "n10", "enumeration": "n10", "type": "n10"} | dict.fromkeys(
    ("global", "input", "output", "in-out", "local"), "n2"
)  # n4 for all others
_WORDS = (*(unit.value for unit in ast.Unit), *(word.value for word in ast.Modifier), "PROPERTY", "TYPE")
_BEFORE = re.compile(rf"(\{{[^{{}}]*\}}|\b(?:{'|'.join(_WORDS)})|\s)\Z", re.IGNORECASE)
"""What stands between the comment of a declaration and its name."""


def report_guidelines(checked: Checked) -> None:
    """Warns of what a project's guidelines do not allow."""
    asked = checked.diagnostics.options.guidelines
    if asked is None:
        return
    _Names(checked, asked).report()
    for unit in _units(checked):
        _report_written(unit, asked, checked.diagnostics)
    declared = {unit.source.pos(unit.pos) for unit in _units(checked)}
    pous = [pou for pou in checked.program.world.pous if pou.pos in declared]  # neither of libraries nor of tests
    for pou in pous:
        _report_meaning(pou, asked, checked.diagnostics)
    _report_written_by_several(pous, checked.diagnostics)


def _units(checked: Checked) -> Iterator[ast.PouDecl]:
    """The units that the program itself declares, and what they hold."""
    for symbol in checked.program.world.names.units():
        if isinstance(symbol, PouSymbol) and not symbol.library:
            yield symbol.decl
            yield from symbol.decl.members


# ---- names and comments ----


@dataclass(frozen=True)
class _Named:
    """Something with a name. `kind` is one of NAME_KINDS."""

    name: str
    kind: str
    pos: Pos


class _Names:
    """The names of a program, each held to the rules."""

    def __init__(self, checked: Checked, asked: Guidelines) -> None:
        self._checked = checked
        self._asked = asked
        self._diagnostics = checked.diagnostics
        self._forms = {kind: read_form(form) for kind, form in asked.forms.items()}
        names = checked.program.world.names
        self._globals = {g.name.casefold(): g.source.pos(g.pos) for g in names.globals()}
        self._units = {symbol.decl.name.casefold(): symbol for symbol in names.units()}

    def report(self) -> None:
        """All rules about names, and that about comments."""
        for symbol in self._units.values():
            if isinstance(symbol, TypeSymbol):
                self._type(symbol.decl)
        for unit in _units(self._checked):
            self._unit(unit)
        for variable in self._checked.program.world.names.globals():
            kind = "constant" if ast.Modifier.CONSTANT in variable.qualifiers else "global"
            self._hold(_Named(variable.name, kind, variable.source.pos(variable.pos)))

    def _type(self, decl: ast.TypeDecl) -> None:
        kinds = {ast.StructSpec: "struct", ast.EnumSpec: "enumeration"}
        self._hold(_Named(decl.name, kinds.get(type(decl.spec), "type"), decl.source.pos(decl.pos)))
        self._comment(decl)

    def _comment(self, decl: ast.TypeDecl | ast.PouDecl) -> None:
        if decl.source.is_copied(decl.pos) and not _is_commented(decl.source.text, decl.pos):
            message = f"no comment says what {decl.name} is for; write one above it"
            self._diagnostics.warning(decl.source.pos(decl.pos), "c2", message)

    def _unit(self, unit: ast.PouDecl) -> None:
        kind = "property" if unit.is_property else unit.keyword.lower().replace("_", "-")
        pos = unit.source.pos(unit.pos)
        self._hold(_Named(unit.name, kind, pos))
        if not unit.is_property:  # the comment is that of GET and SET together
            self._comment(unit)
        for block in unit.blocks:
            if block.keyword in (ast.Section.STEP, ast.Section.VAR_EXTERNAL):
                continue
            kind = (
                "constant"
                if ast.Modifier.CONSTANT in block.qualifiers
                else _KIND_OF_SECTION.get(block.keyword, "local")
            )
            for offset, name in (named for line in block.decls for named in line.names):
                self._variable(_Named(name, kind, unit.source.pos(offset)))
        parameters = sum(len(line.names) for b in unit.blocks if b.keyword in _PARAMETERS for line in b.decls)
        if parameters > self._asked.parameters:
            message = f"{unit.name} has {parameters} parameters, more than {self._asked.parameters}; use a STRUCT"
            self._diagnostics.warning(pos, "cp23", message)

    def _variable(self, named: _Named) -> None:
        self._hold(named)
        hidden = self._globals.get(named.name.casefold())
        if hidden is not None:
            where = f"{hidden.file}:{hidden.line}"
            self._diagnostics.warning(
                named.pos, "n5", f"{named.name} hides the global variable of {where}; give one of them another name"
            )
        unit = self._units.get(named.name.casefold())
        if unit is not None:
            self._diagnostics.warning(
                named.pos, "n9", f"{named.name} is the name of a type or unit as well; give one of them another name"
            )

    def _hold(self, named: _Named) -> None:
        form = self._forms.get(named.kind)
        if form is not None and not form.fullmatch(named.name):
            rule = _RULE_OF_KIND.get(named.kind, "n4")
            message = f"{named.name} is not of the form {self._asked.forms[named.kind]}, which the project asks of this"
            self._diagnostics.warning(named.pos, rule, f"{message} {named.kind}")
        if named.name.casefold() in self._asked.avoided:
            self._diagnostics.warning(named.pos, "n3", f"the project avoids the name {named.name}")
        length, least, most = len(named.name), self._asked.shortest_name, self._asked.longest_name
        if not least <= length <= most:
            message = f"{named.name} has {length} characters; the project allows {least} to {most}"
            self._diagnostics.warning(named.pos, "n6", message)


def _is_commented(text: str, offset: int) -> bool:
    """Whether a comment ends before a declaration: before its keywords and attributes."""
    end = offset
    while match := _BEFORE.search(text, max(0, end - 2000), end):
        if _in_line_comment(text, end):
            return True
        end = match.start()
    return text.endswith(("*)", "*/"), 0, end) or _in_line_comment(text, end)


def _in_line_comment(text: str, end: int) -> bool:
    """Whether `//` stands in the line that `end` is in, before it."""
    return "//" in text[text.rfind("\n", 0, end) + 1 : end]


# ---- what is written ----


def _report_written(unit: ast.PouDecl, asked: Guidelines, diagnostics: Diagnostics) -> None:
    """Rules about the statements of a unit, and about addresses in them."""

    def warn(offset: int, rule: str, message: str) -> None:
        if unit.source.is_copied(offset) and offset != unit.pos:  # there the compiler puts what EN means
            diagnostics.warning(unit.source.pos(offset), rule, message)

    for address in ast.every(ast.DirectAddress, unit.body):
        warn(address.pos, "n1", f"{address.text} is an address; declare a variable AT {address.text} and use its name")
    for call in ast.every(ast.Call, unit.body):
        if isinstance(call.callee, ast.Name) and call.callee.name.casefold() in _ALLOCATORS:
            warn(call.pos, "e1", f"{call.callee.name} takes memory while the program runs; declare a variable")
    for leave in ast.every(ast.Exit, unit.body):
        warn(leave.pos, "l10", "EXIT leaves a loop; let its condition say when it ends")
    for go_on in ast.every(ast.Continue, unit.body):
        warn(go_on.pos, "l10", "CONTINUE leaves out the rest of a loop's body; use IF")
    for jump in ast.every(ast.Jump, unit.body):
        warn(jump.pos, "cp19", "JMP makes a program hard to follow; use IF, CASE or a loop")
    for statement in ast.every(ast.Return, unit.body[:-1] if _is_return(unit.body) else unit.body):
        warn(statement.pos, "cp14", f"RETURN ends {unit.name} before its end; put the rest into an IF")
    for choice in ast.every(ast.If, unit.body):
        if not choice.has_else:
            warn(choice.pos, "l17", "this IF has no ELSE, so it does not say what happens otherwise")
    branches = 1 + _branches(unit.body)
    if branches > asked.branches:
        message = f"{unit.name} has {branches} ways through it, more than {asked.branches}; split it"
        diagnostics.warning(unit.source.pos(unit.pos), "cp9", message)


def _is_return(body: list[ast.Stmt]) -> bool:
    return bool(body) and isinstance(body[-1], ast.Return)


def _branches(body: list[ast.Stmt]) -> int:
    """How many decisions a body takes: conditions of IF, groups of labels of CASE, loops (McCabe)."""
    ifs = sum(len(choice.branches) for choice in ast.every(ast.If, body))
    cases = sum(len(choice.branches) for choice in ast.every(ast.Case, body))
    loops = sum(1 for kind in (ast.For, ast.While, ast.RepeatUntil) for _ in ast.every(kind, body))
    return ifs + cases + loops


# ---- what it means ----


def _report_meaning(pou: Pou, asked: Guidelines, diagnostics: Diagnostics) -> None:
    """Rules about types, instances and global variables in a body."""
    for node in walk(pou.body):
        if isinstance(node, Binary):
            _report_operation(node, diagnostics)
        elif isinstance(node, For):
            _report_assigned_variable(node, diagnostics)
    _report_repeated_calls(pou, diagnostics)
    found = _globals_in(pou)
    if pou.kind is not PouKind.PROGRAM:
        for variable, pos in found.items():
            message = f"{pou.name} uses the global variable {variable.name}; hand it over as a parameter"
            diagnostics.warning(pos, "cp6", message)
    if len(found) > asked.globals:
        message = f"{pou.name} uses {len(found)} global variables, more than {asked.globals}"
        diagnostics.warning(pou.pos, "cp18", message)


def _report_operation(node: Binary, diagnostics: Diagnostics) -> None:
    operand = node.left.type
    if _is_address(node.left) or _is_address(node.right):
        if node.op in _ORDERED:
            diagnostics.warning(
                node.pos, "e3", f"pointers are compared with {node.op.value}; their order means nothing"
            )
        elif node.op in (BinaryOp.ADD, BinaryOp.SUB):
            diagnostics.warning(node.pos, "e2", "a pointer is moved by arithmetic; use the index of an array")
    elif node.op in (BinaryOp.EQ, BinaryOp.NE) and isinstance(operand, Elementary):
        if operand.kind is Kind.REAL:
            message = f"{operand.name} values are seldom equal to the last digit; compare with a tolerance"
            diagnostics.warning(node.pos, "cp8", message)
        elif operand.kind in (Kind.TIME, Kind.DATE):
            message = f"{operand.name} values may pass {node.op.value} between two cycles; compare with >= or <="
            diagnostics.warning(node.pos, "cp28", message)


def _is_address(value: Expr) -> bool:
    """Also one that became a number, as operands do."""
    while isinstance(value, Convert):
        value = value.operand
    return isinstance(value.type, PointerType)


def _report_assigned_variable(loop: For, diagnostics: Diagnostics) -> None:
    if not isinstance(loop.var, VarPlace):
        return
    for node in walk(loop.body):
        if isinstance(node, TypedAssign) and isinstance(node.target, VarPlace) and node.target.var is loop.var.var:
            name = loop.var.var.name.rpartition(".")[2]
            diagnostics.warning(node.pos, "l22", f"{name} is the variable of a FOR around this; use another one")


def _report_repeated_calls(pou: Pou, diagnostics: Diagnostics) -> None:
    """Of instances with a name; elements of arrays with an index are others in each turn of a loop."""
    calls: dict[tuple[object, ...], list[FbCall]] = {}
    for node in walk(pou.body):
        if isinstance(node, FbCall) and (key := _instance(node.instance)):
            calls.setdefault(key, []).append(node)
    for found in calls.values():
        first, *others = sorted(found, key=lambda call: (call.pos.line, call.pos.column))
        for call in others:
            if call.pos != first.pos:
                message = f"this instance is called in line {first.pos.line} as well; call it once and use its outputs"
                diagnostics.warning(call.pos, "cp20", message)


def _instance(place: Place) -> tuple[object, ...]:
    """What tells one instance from the others of a body; () for one that is not always the same."""
    match place:
        case VarPlace(var=variable):
            return (variable,)
        case SelfPlace():
            return ("THIS",)
        case MemberPlace(base=base, offset=offset):
            outer = _instance(base)
            return (*outer, offset) if outer else ()
        case _:
            return ()


def _globals_in(pou: Pou) -> dict[Variable, Pos]:
    """The global variables that a body reads or writes, each with its first place. Constants are left out."""
    found: dict[Variable, Pos] = {}
    for node in walk(pou.body):
        if isinstance(node, VarPlace) and _is_global(node.var, pou):
            first = found.get(node.var)
            if first is None or (node.pos.line, node.pos.column) < (first.line, first.column):
                found[node.var] = node.pos
    return found


def _is_global(variable: Variable, pou: Pou) -> bool:
    """Whether a variable lives outside of this unit. Addresses such as %QX0.0, which n1 is about, are left out."""
    if variable.storage is not Storage.AREA or variable.constant or variable.name.startswith("%"):
        return False
    return not variable.name.casefold().startswith(f"{pou.name}.".casefold())


def _report_written_by_several(pous: list[Pou], diagnostics: Diagnostics) -> None:
    writers: dict[Variable, dict[str, Pos]] = {}
    for pou in pous:
        if pou.kind is not PouKind.PROGRAM:
            continue
        for node in walk(pou.body):
            assigned = node.assignment if isinstance(node, AssignedValue) else node
            if isinstance(assigned, TypedAssign) and (variable := _root(assigned.target)) and _is_global(variable, pou):
                writers.setdefault(variable, {}).setdefault(pou.name, assigned.pos)
    for variable, by_program in writers.items():
        if len(by_program) > 1:
            *_, last = by_program.items()
            others = ", ".join(name for name in by_program if name != last[0])
            message = f"{variable.name} is written here and in {others}; let one program write it"
            diagnostics.warning(last[1], "cp26", message)


def _root(place: Place) -> Variable | None:
    """The variable that a place is in; None for what a pointer leads to."""
    while not isinstance(place, VarPlace):
        base = getattr(place, "base", None)
        if base is None:
            return None
        place = base
    return place.var
