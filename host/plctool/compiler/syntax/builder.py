"""Builds the syntax tree: one method for each rule of grammar.lark.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast, slips
from plctool.compiler.syntax.attributes import Attributes, Repeated
from plctool.compiler.syntax.builder_chart import read_action, read_priority
from plctool.compiler.syntax.builder_units import Arrangement
from plctool.compiler.syntax.lexer import Report, Token
from plctool.iec import literals
from plctool.iec.types import ELEMENTARY

_KINDS_OF_TYPES = {ast.EnumSpec: "enumeration", ast.StructSpec: "STRUCT"}
_TYPE_NAMES = frozenset((*ELEMENTARY, "STRING", "WSTRING", *slips.TYPES))
_Init = TypeVar("_Init", bound="ast.Init | None")

_PRECEDENCE = {
    operator: precedence
    for precedence, operators in enumerate(
        (
            (ast.Operator.OR, ast.Operator.OR_ELSE),
            (ast.Operator.XOR,),
            (ast.Operator.AND, ast.Operator.AND_THEN),
            (ast.Operator.EQ, ast.Operator.NE),
            (ast.Operator.LT, ast.Operator.GT, ast.Operator.LE, ast.Operator.GE),
            (ast.Operator.ADD, ast.Operator.SUB),
            (ast.Operator.MUL, ast.Operator.DIV, ast.Operator.MOD),
            (ast.Operator.POWER,),
        )
    )
    for operator in operators
}


def _operator(token: Token) -> ast.Operator:
    text = token.text.upper()
    return ast.Operator.AND if text == "&" else ast.Operator(text)


def _chain(operands: Sequence[ast.Expr], operators: Sequence[Token]) -> ast.Expr:
    """Sorts out `a op b op c` by precedence, left-associative."""
    values, pending = [operands[0]], list[tuple[int, ast.Operator, int]]()

    def reduce() -> None:
        _, op, pos = pending.pop()
        right = values.pop()
        values[-1] = ast.Binary(pos, op, values[-1], right)

    for token, operand in zip(operators, operands[1:], strict=True):
        op = _operator(token)
        precedence = _PRECEDENCE[op]
        while pending and pending[-1][0] >= precedence:
            reduce()
        pending.append((precedence, op, token.pos))
        values.append(operand)
    while pending:
        reduce()
    return values[0]


def _listed(children: tuple[Any, ...]) -> list[Any]:
    return [c for c in children if c is not None]


def _type_in(statement: ast.Stmt) -> str:
    """The name of the type when a statement is what follows the colon of a declaration, else ""."""
    if isinstance(statement, ast.Assign):
        target = statement.targets[0]
        return target.name if isinstance(target, ast.Name) and target.name.upper() in _TYPE_NAMES else ""
    value = statement.value if isinstance(statement, ast.ExprStmt) else None
    if isinstance(value, ast.Name):
        return slips.TYPES.get(value.name.upper(), value.name)
    base = value.base if isinstance(value, ast.Index) else None
    return base.name if isinstance(base, ast.Name) and base.name.upper() in _TYPE_NAMES else ""


def _placed(init: _Init, pos: int) -> _Init:
    """An initial value; `()` has no token of its own, so it stands where its name does."""
    if isinstance(init, ast.StructInit) and init.pos < 0:
        init.pos = pos
    return init


class Builder:
    """One method per grammar rule. What an optional part left out is None; so is what error recovery put in."""

    def __init__(self) -> None:
        self.source = Source("", "")
        self.attributes: Attributes = {}
        self.repeated: Repeated = {}
        self.places: dict[int, str] = {}  # what is declared where an attribute stands in front
        self.report: Report = lambda pos, code, message: None
        self.units = Arrangement(lambda pos, code, message: self.report(pos, code, message), self.pou)

    def _attributes_at(self, pos: int, what: str) -> dict[str, str]:
        """The attributes before a declaration."""
        found = self.attributes.get(pos)
        if found is None:
            return {}
        self.places[pos] = what
        return found

    # ---- types ----

    def start(self, *units: Any) -> list[Any]:
        return self.units.arrange(units)

    def types(self, keyword: Token, *decls: Any) -> list[Any]:
        kinds = {decl: _KINDS_OF_TYPES.get(type(decl.spec), "TYPE") for decl in _listed(decls)}
        first = next((kind for kind in kinds.values() if kind != "TYPE"), "TYPE")
        of_all = self._attributes_at(keyword.pos, first)
        for decl, kind in kinds.items():
            decl.attributes = {**of_all, **self._attributes_at(decl.pos, kind)}
            if isinstance(decl.spec, ast.StructSpec):
                decl.spec.pack_mode = decl.attributes.get("pack_mode")
        return list(kinds)

    def type_decl(self, *rest: Any) -> ast.TypeDecl:
        *modifiers, name, base, spec, init = rest
        if base is not None and isinstance(spec, ast.StructSpec):
            spec.base = ast.NamedType(*base)
        elif base is not None:
            self.report(base[0], "syntax", "only a STRUCT or UNION can extend another one")
        decl = ast.TypeDecl(name.pos, name.text, spec, init, self.source)
        decl.modifiers = {ast.Modifier(token.text.upper()) for token in modifiers}
        return decl

    def named_type(self, name: tuple[int, str], opening: Token | None = None, *rest: Any) -> ast.NamedType:
        if opening is None:
            return ast.NamedType(*name)
        *constants, closing = rest
        if (opening.text, closing.text) != ("<", ">"):
            self.report(opening.pos, "syntax", "the constants of a block stand between < and >")
        return ast.NamedType(*name, constants=constants, template=name[1])

    def signed(self, sign: Token, number: Token) -> ast.Expr:
        return ast.Unary(sign.pos, ast.Operator(sign.text), self.number(number))

    def constant_name(self, name: tuple[int, str]) -> ast.Name:
        return ast.Name(*name)

    def initialised_type(self, name: tuple[int, str], inits: ast.ArrayInit) -> ast.NamedType:
        return ast.NamedType(*name, inits=inits)

    def text_type(self, name: Token, length: ast.Expr | None) -> ast.NamedType:
        return ast.NamedType(name.pos, name.text, length)

    def type_of(self, word: Token, value: ast.Expr) -> ast.TypeOf:
        self.temp(word)
        return ast.TypeOf(word.pos, value)

    def subrange(self, base: tuple[int, str], low: ast.Expr, high: ast.Expr) -> ast.SubrangeSpec:
        return ast.SubrangeSpec(*base, low, high)

    def enum(self, values: list[tuple[int, str, ast.Init | None]]) -> ast.EnumSpec:
        return ast.EnumSpec(values[0][0] if values else 0, None, values)

    def enum_with_base(self, values: list[tuple[int, str, ast.Init | None]], base: Token) -> ast.EnumSpec:
        return ast.EnumSpec(base.pos, base.text, values)

    def enum_of_base(self, base: tuple[int, str], values: list[Any]) -> ast.EnumSpec:
        """`INT (red, green := 5)`, or an instance with values, perhaps without names: `Pump(valve, limit := 5)`."""
        named = [(v.pos, v.name, None) if isinstance(v, ast.Name) else v for v in values]
        return ast.EnumSpec(*base, [v if isinstance(v, tuple) else (v.pos, "", v) for v in named])

    def enum_values(self, *values: Any) -> list[Any]:
        return [v for v in values if v is not None]

    type_args = enum_values

    def enum_value(self, name: Token, value: ast.Init | None) -> tuple[int, str, ast.Init | None]:
        return name.pos, name.text, value

    def array(self, keyword: Token, *rest: Any) -> ast.ArraySpec:
        *bounds, element = rest
        return ast.ArraySpec(keyword.pos, bounds, element)

    def open_bounds(self, star: Token) -> None:
        if star.text != "*":
            self.report(star.pos, "syntax", f"expected the bounds of the array or *, found {star.text}")

    def bounds(self, low: ast.Expr, high: ast.Expr) -> tuple[ast.Expr, ast.Expr]:
        return low, high

    def pointer(self, keyword: Token, target: ast.TypeSpec) -> ast.PointerSpec:
        return ast.PointerSpec(keyword.pos, ast.Pointing(keyword.text.upper()), target)

    def struct(self, keyword: Token, overlap: Token | None, *fields: ast.VarDecl | None) -> ast.StructSpec:
        if overlap is not None and keyword.type == "STRUCT":
            self.report(overlap.pos, "syntax", "the members of a STRUCT do not overlap; those of a UNION do")
        return ast.StructSpec(keyword.pos, [f for f in fields if f is not None], keyword.type == "UNION")

    def name(self, first: Token, *rest: Token) -> tuple[int, str]:
        return first.pos, ".".join((first.text, *(t.text for t in rest)))

    # ---- variables ----

    def var_block(self, keyword: Token, *items: Any) -> ast.VarBlock:
        qualifiers = {ast.Modifier(t.text.upper()) for t in items if isinstance(t, Token)}
        decls = [d for d in items if isinstance(d, ast.VarDecl)]
        return ast.VarBlock(keyword.pos, ast.Section(keyword.text.upper()), qualifiers, decls)

    def var_decl(
        self,
        names: list[Token],
        location: Token | None,
        spec: ast.TypeSpec,
        edge: Token | None,
        init: ast.Init | None,
    ) -> ast.VarDecl:
        pos = names[0].pos
        address = self.direct(location) if location else None
        attributes = self._attributes_at(pos, "variable")
        init = _placed(init, pos)
        written = [(t.pos, t.text) for t in names]
        return ast.VarDecl(pos, written, address, spec, init, attributes, ast.Edge(edge.text.upper()) if edge else None)

    def nameless_decl(self, location: Token, spec: ast.TypeSpec, init: ast.Init | None) -> ast.VarDecl:
        """`AT %MW1 : INT;`: the address is its name."""
        return self.var_decl([location], location, spec, None, init)

    def var_names(self, *names: Token) -> list[Token]:
        return list(names)

    def ref_init(self, op: Token, _equals: Token, value: ast.Expr) -> ast.Expr:
        if op.text.upper() != "REF":
            self.report(op.pos, "syntax", f"{op.text} has no place here; an initial value is written :=, or REF=")
        return value

    def array_init(self, *items: Any) -> ast.ArrayInit:
        return ast.ArrayInit(items[0].pos, list(items))

    def repeat(self, count: Token, *values: Any) -> ast.Repeat:
        return ast.Repeat(count.pos, self.number(count), _listed(values))

    def struct_init(self, *items: Any) -> ast.StructInit:
        """Values without a name are further elements of the array before them: `(start := 3, 4, end := 5)`."""
        members: list[tuple[int, str, ast.Init]] = []
        listed: ast.ArrayInit | None = None
        for item in _listed(items):
            if isinstance(item, tuple):
                members.append(item)
                listed = None
            elif listed is None:
                offset, name, first = members[-1]
                listed = ast.ArrayInit(first.pos, [first, item])
                members[-1] = offset, name, listed
            else:
                listed.items.append(item)
        return ast.StructInit(members[0][0] if members else -1, members)

    def positional_init(self, *values: Any) -> ast.StructInit:
        """`(1, 2)`: the inputs of FB_Init in their order."""
        given = _listed(values)
        return ast.StructInit(given[0].pos, [v if isinstance(v, tuple) else (v.pos, "", v) for v in given])

    def member_init(self, name: Token, value: ast.Init) -> tuple[int, str, ast.Init]:
        return name.pos, name.text, _placed(value, name.pos)

    # ---- units ----

    def global_block(self, keyword: Token, *items: Any) -> ast.GlobalBlock:
        block = self.var_block(keyword, *items)
        qualified = "qualified_only" in self._attributes_at(keyword.pos, "VAR_GLOBAL")
        return ast.GlobalBlock(block, self.source, qualified=qualified)

    def var_blocks(self, *blocks: Any) -> list[Any]:
        return [b for b in blocks if b is not None]

    def pou(
        self, keyword: Token, head: list[Any], result: Any, blocks: Any, body: Any, unit: ast.Unit | None = None
    ) -> ast.PouDecl:
        """`head`: modifiers and name; `unit`: what it is when the keyword alone does not say it."""
        *modifiers, name = head
        attributes = self._attributes_at(keyword.pos, keyword.text.upper())
        unit = unit or ast.Unit(keyword.text.upper())
        decl = ast.PouDecl(name.pos, unit, name.text, result, [], body or [], attributes, self.source)
        decl.modifiers = {ast.Modifier(t.text.upper()) for t in modifiers if t is not None}
        self.units.complete(decl, None, None, blocks or [])
        return decl

    def function(self, keyword: Token, *rest: Any) -> Any:
        *head, result, blocks, body = rest
        return self.pou(keyword, head, result, blocks, body)

    def function_block(self, keyword: Token, *rest: Any) -> Any:
        *head, bases, interfaces, parts, body, members = rest
        decl = self.pou(keyword, head, None, [], body)
        self.units.complete(decl, bases, interfaces, [*(parts or []), *(members or [])])
        return decl

    def program(self, keyword: Token, *rest: Any) -> Any:
        return self.function_block(keyword, *rest[:-3], None, None, *rest[-3:])

    # ---- sequential function charts ----

    def step(self, keyword: Token, name: Token, *actions: Any) -> ast.Step:
        found = [read_action(statement.value, self.report) for statement in actions if statement is not None]
        return ast.Step(name.pos, name.text, keyword.type == "INITIAL_STEP", _listed(tuple(found)))

    def transition(
        self, keyword: Token, _name: Any, word: Any, number: Any, sources: Any, targets: Any, condition: Any
    ) -> ast.Transition:
        priority = None if word is None else read_priority(word, number, self.report)
        ends = [[(t.pos, t.text) for t in tokens] for tokens in (sources, targets)]
        return ast.Transition(keyword.pos, priority, ends[0], ends[1], condition)

    # ---- methods, classes, namespaces ----

    def class_block(self, keyword: Token, *rest: Any) -> Any:
        *head, bases, interfaces, parts = rest
        decl = self.pou(keyword, head, None, [], [], ast.Unit.FUNCTION_BLOCK)
        decl.modifiers.add(ast.Modifier.CLASS)
        self.units.complete(decl, bases, interfaces, parts or [])
        return decl

    def interface(self, keyword: Token, *rest: Any) -> Any:
        *head, bases, members = rest
        decl = self.pou(keyword, head, None, [], [])
        self.units.complete(decl, bases, None, members or [])
        return decl

    parts = members = names = step_names = chart = steps = var_blocks

    def method(self, keyword: Token, *rest: Any) -> Any:
        *head, result, blocks, body, steps = rest
        return self.pou(keyword, head, result, [*(blocks or []), *(steps or [])], body)

    def property(self, keyword: Token, *rest: Any) -> list[ast.PouDecl]:
        return self.units.property(keyword, rest)

    def single_accessor(self, keyword: Token, *rest: Any) -> ast.PouDecl:
        return self.units.single_accessor(keyword, rest)

    def accessor(self, keyword: Token, *rest: Any) -> tuple[Token, list[Any], Any, Any]:
        *modifiers, blocks, body = rest
        return keyword, modifiers, blocks, body

    def action(self, keyword: Token, name: Token, body: Any, steps: Any) -> Any:
        return self.pou(keyword, [name], None, steps, body)

    def namespace(self, keyword: Token, *rest: Any) -> list[Any]:
        return self.units.namespace(rest)

    def using(self, keyword: Token, names: Any) -> ast.Namespace:
        return ast.Namespace("", names or [])

    def configuration(self, keyword: Token, name: Token, *items: Any) -> ast.ConfigurationDecl:
        decl = ast.ConfigurationDecl(name.pos, name.text, [], [], [], self.source)
        self._configure(decl, items)
        return decl

    def _configure(self, decl: ast.ConfigurationDecl, items: Any) -> None:
        for item in items:
            if isinstance(item, ast.VarBlock):
                decl.globals.append(item)
            elif isinstance(item, ast.TaskDecl):
                decl.tasks.append(item)
            elif isinstance(item, ast.ProgramInstance):
                decl.programs.append(item)
            elif isinstance(item, ast.InstanceBlock):
                decl.instance_blocks.append(item)
            elif isinstance(item, tuple):
                decl.resources.append(item[0])
                self._configure(decl, item[1])

    def config_globals(self, keyword: Token, *items: Any) -> ast.VarBlock:
        return self.var_block(keyword, *items)

    def resource(self, _keyword: Token, name: Token, _type: Token, *items: Any) -> tuple[str, Any]:
        return name.text, items

    def instance_config(self, _keyword: Token, *lines: Any) -> ast.InstanceBlock:
        return ast.InstanceBlock(_listed(lines), self.source)

    instance_access = instance_config

    def config_line(
        self, path: ast.Expr, location: Token | None, spec: ast.TypeSpec, init: ast.Init | None
    ) -> ast.ConfigLine:
        return ast.ConfigLine(path.pos, path, self.direct(location) if location else None, spec, init)

    def access_line(self, name: Token, path: ast.Expr, spec: ast.TypeSpec, rights: Token | None) -> ast.AccessLine:
        writable = rights is not None and rights.text.upper() == "READ_WRITE"
        return ast.AccessLine(name.pos, name.text, path, spec, writable)

    def task(self, _keyword: Token, name: Token, *properties: Any) -> ast.TaskDecl:
        return ast.TaskDecl(name.pos, name.text, _listed(properties))

    def instance(
        self, _keyword: Token, qualifier: Token | None, name: Token, task: Token | None, type_name: Token, args: Any
    ) -> ast.ProgramInstance:
        qualifiers = {ast.Modifier(qualifier.text.upper())} if qualifier else set[ast.Modifier]()
        return ast.ProgramInstance(
            name.pos,
            name.text,
            (task.pos, task.text) if task else None,
            type_name.pos,
            type_name.text,
            args or [],
            qualifiers,
        )

    # ---- unit tests ----

    def test(self, keyword: Token, name: Token, blocks: Any, body: Any) -> ast.TestDecl:
        text = self.string(name)
        decl = ast.TestDecl(keyword.pos, ast.TestUnit.TEST, str(text.value), blocks, body, self.source)
        if "fault" in self._attributes_at(keyword.pos, "TEST"):
            decl.faults = [(at, said) for at, attribute, said in self.repeated[keyword.pos] if attribute == "fault"]
        return decl

    def setup(self, keyword: Token, blocks: Any, body: Any) -> ast.TestDecl:
        return ast.TestDecl(keyword.pos, ast.TestUnit(keyword.type), keyword.text, blocks, body, self.source)

    def mock(self, keyword: Token, instance: ast.Expr) -> ast.ExprStmt:
        return self._statement_call(keyword, ast.Argument(instance.pos, None, instance))

    def mock_function(self, keyword: Token, target: ast.Expr, returns: Token, value: ast.Expr) -> ast.ExprStmt:
        if returns.text.upper() != "RETURNS":
            self.report(returns.pos, "syntax", f"expected RETURNS before the value, found {returns.text}")
        function = ast.Argument(target.pos, None, target)
        return self._statement_call(keyword, function, ast.Argument(value.pos, None, value))

    def _statement_call(self, keyword: Token, *args: ast.Argument) -> ast.ExprStmt:
        """A statement that begins with a keyword, as a call of that name."""
        callee = ast.Name(keyword.pos, keyword.type)
        return ast.ExprStmt(keyword.pos, ast.Call(keyword.pos, callee, list(args)))

    # ---- statements ----

    def stmts(self, *children: Any) -> list[Any]:
        found = [c for c in children if c is not None]
        return self._without_declarations(found) if any(type(c) is ast.Label for c in found) else found

    def _without_declarations(self, found: list[ast.Stmt]) -> list[ast.Stmt]:
        """Reports `speed : INT;`, which reads as a label with a statement, and leaves it out."""
        kept: list[ast.Stmt] = []
        for statement in found:
            previous = kept[-1] if kept else None
            if isinstance(previous, ast.Label) and previous.name and (declared := _type_in(statement)):
                self.report(previous.pos, "syntax", slips.DECLARED.format(name=previous.name, type=declared))
                kept.pop()
            else:
                kept.append(statement)
        return kept

    def empty(self) -> None:
        return None

    def assign(self, target: ast.Expr, value: Any) -> ast.Assign:
        if type(value) is tuple:
            return ast.Assign(target.pos, [target, *value[0]], ast.Assigning.VALUE, value[1])
        return ast.Assign(target.pos, [target], ast.Assigning.VALUE, value)

    def chained(self, target: ast.Expr, value: Any) -> tuple[list[ast.Expr], ast.Expr]:
        if type(value) is tuple:
            return [target, *value[0]], value[1]
        return [target], value

    def assign_with(self, target: ast.Expr, op: Token, _equals: Token, value: Any) -> ast.Assign | None:
        sign = self._assigning(target, op)
        others, value = value if type(value) is tuple else ([], value)
        if sign is None or any(other is None for other, _ in others):
            return None
        if others and ast.Assigning.REFERENCE in (sign, *(other for other, _ in others)):
            self.report(op.pos, "syntax", "REF= stands alone; write a statement for each reference")
            return None
        return ast.Assign(op.pos, [target], sign, value, others)

    def set_chain(self, target: ast.Expr, op: Token, _equals: Token, value: Any) -> tuple[list[Any], ast.Expr]:
        others, value = value if type(value) is tuple else ([], value)
        return [(self._assigning(target, op), target), *others], value

    def _assigning(self, target: ast.Expr, op: Token) -> ast.Assigning | None:
        """The sign that begins with a name; None after an error."""
        name = op.text.upper()
        if name in ("S", "R", "REF"):
            return ast.Assigning(name + "=")
        message = f"{op.text} has no place here; an assignment is written :=, S= or R="
        if isinstance(target, ast.Name) and target.name.upper() in ELEMENTARY:
            message = f"variables are declared in VAR ... END_VAR before the statements: {op.text} : {target.name};"
        self.report(op.pos, "syntax", message)
        return None

    def attempt(self, target: ast.Expr, op: Token, value: ast.Expr) -> ast.Assign:
        return ast.Assign(op.pos, [target], ast.Assigning(op.text), value)

    def expr_stmt(self, value: ast.Expr) -> ast.ExprStmt:
        return ast.ExprStmt(value.pos, value)

    def if_stmt(self, keyword: Token, condition: ast.Expr, body: list[ast.Stmt], *rest: Any) -> ast.If:
        *elsifs, otherwise = rest
        return ast.If(keyword.pos, [(condition, body), *elsifs], otherwise or [], otherwise is not None)

    def elsif(self, condition: ast.Expr, body: list[ast.Stmt]) -> tuple[ast.Expr, list[ast.Stmt]]:
        return condition, body

    def case_stmt(self, keyword: Token, selector: ast.Expr, *rest: Any) -> ast.Case:
        *items, otherwise = rest
        branches: list[tuple[list[ast.CaseLabel], list[ast.Stmt]]] = []
        for item in items:
            if type(item) is list:
                branches.append((item, []))
            elif item is not None:
                if not branches:
                    self.report(item.pos, "syntax", "this statement stands before the first label of the CASE")
                    continue
                branches[-1][1].append(item)
        return ast.Case(keyword.pos, selector, branches, otherwise or [], otherwise is not None)

    def case_labels(self, *labels: ast.CaseLabel) -> list[ast.CaseLabel]:
        return _listed(labels)

    def case_label(self, low: ast.Expr, high: ast.Expr | None) -> ast.CaseLabel:
        return ast.CaseLabel(low.pos, low, high)

    def for_stmt(self, keyword: Token, var: Any, start: Any, stop: Any, step: Any, body: Any) -> ast.For:
        return ast.For(keyword.pos, var, start, stop, step, body)

    def while_stmt(self, keyword: Token, condition: ast.Expr, body: list[ast.Stmt]) -> ast.While:
        return ast.While(keyword.pos, condition, body)

    def repeat_stmt(self, keyword: Token, body: list[ast.Stmt], until: ast.Expr) -> ast.RepeatUntil:
        return ast.RepeatUntil(keyword.pos, body, until)

    def exit_stmt(self, keyword: Token) -> ast.Exit:
        return ast.Exit(keyword.pos)

    def continue_stmt(self, keyword: Token) -> ast.Continue:
        return ast.Continue(keyword.pos)

    def label(self, name: Token) -> ast.Label:
        return ast.Label(name.pos, name.text)

    def jump(self, keyword: Token, label: Token) -> ast.Jump:
        return ast.Jump(keyword.pos, label.text, label.pos)

    def try_stmt(
        self, keyword: Token, body: list[ast.Stmt], catch: ast.Catch | None, last: list[ast.Stmt] | None
    ) -> ast.Try:
        return ast.Try(keyword.pos, body, catch, last)

    def catch(self, var: ast.Expr | None, body: list[ast.Stmt]) -> ast.Catch:
        return ast.Catch(var, body)

    def return_stmt(self, keyword: Token, condition: ast.Expr | None) -> ast.Return:
        return ast.Return(keyword.pos, condition)

    # ---- expressions ----

    def binary(self, *children: Any) -> ast.Expr:
        if len(children) == 3:
            return ast.Binary(children[1].pos, _operator(children[1]), children[0], children[2])
        return _chain(children[::2], children[1::2])

    def unary(self, op: Token, operand: ast.Expr) -> ast.Expr:
        return ast.Unary(op.pos, ast.Operator(op.text.upper()), operand)

    def parenthesised(self, value: ast.Expr) -> ast.Expr:
        return value

    def assigned(self, target: ast.Expr, value: Any) -> ast.Assigned:
        (*others, last), source = self.chained(target, value)
        assigned = ast.Assigned(last.pos, last, source)
        for place in reversed(others):
            assigned = ast.Assigned(place.pos, place, assigned)
        return assigned

    def assigned_condition(self, target: ast.Expr, value: Any) -> ast.Assigned:
        assigned = self.assigned(target, value)
        assigned.bare = True
        return assigned

    def number(self, token: Token) -> ast.Literal:
        if len(token.text) < 19 and token.text.isdigit():
            return ast.Literal(token.pos, ast.LiteralKind.INT, int(token.text))
        try:
            return ast.Literal(token.pos, *literals.unsigned(token.text))
        except literals.LiteralError as error:
            return self._bad(token, error)

    def typed_in_namespace(self, base: ast.Expr, token: Token) -> ast.Expr:
        """`Plant.Color#Red`"""
        names = [token.text]
        while isinstance(base, ast.Member):
            names.append(base.name)
            base = base.base
        if not isinstance(base, ast.Name) or literals.is_elementary(token.text):
            message = (
                f"a value is written TYPE#VALUE, or NAMESPACE.TYPE#VALUE; take away what stands before {token.text}"
            )
            return self._bad(token, literals.LiteralError(message))
        return self.typed(Token(token.type, ".".join([base.name, *reversed(names)]), base.pos))

    def typed(self, token: Token) -> ast.Expr:
        prefix, _, rest = token.text.partition("#")
        if literals.is_enum_value(prefix, rest):
            return ast.EnumValue(token.pos, prefix, rest)
        try:
            kind, value, name = literals.typed(token.text)
            return ast.Literal(token.pos, kind, value, name)
        except literals.LiteralError as error:
            if slips.CUT_DURATION.match(self.source.text, token.end):  # said of what follows
                return ast.Literal(token.pos, ast.LiteralKind.BAD, 0)
            return self._bad(token, error)

    def string(self, token: Token) -> ast.Literal:
        prefix, hash_sign, rest = token.text.partition("#")
        typed = bool(hash_sign) and prefix[:1] not in "'\""
        text = rest if typed else token.text
        wide = text.startswith('"')
        name = prefix.upper() if typed else "WSTRING" if wide else "STRING"
        try:
            if wide is not (name[0] == "W"):
                right = "'...'" if wide else '"..."'
                raise literals.LiteralError(f"a {name} is written {name}#{right}")
            kind = ast.LiteralKind.WSTRING if wide else ast.LiteralKind.STRING
            return ast.Literal(token.pos, kind, literals.string(text), name)
        except literals.LiteralError as error:
            return self._bad(token, error)

    def word(self, token: Token) -> ast.Literal:
        if token.type == "NULL":
            return ast.Literal(token.pos, ast.LiteralKind.NULL, 0)
        return ast.Literal(token.pos, ast.LiteralKind.BOOL, int(token.type == "TRUE"))

    def _bad(self, token: Token, error: literals.LiteralError) -> ast.Literal:
        self.report(token.pos, "literal", str(error))
        return ast.Literal(token.pos, ast.LiteralKind.BAD, 0)

    def name_expr(self, token: Token) -> ast.Name:
        return ast.Name(token.pos, token.text)

    def temp(self, token: Token) -> ast.Temp:
        if self.source.is_copied(token.pos):
            self.report(token.pos, "character", "@ has no place in a program")
        return ast.Temp(token.pos, token.text)

    def global_name(self, token: Token) -> ast.Name:
        return ast.Name(token.pos - 1, f".{token.text}")

    def direct(self, token: Token) -> ast.DirectAddress:
        return ast.DirectAddress(token.pos, token.text.upper())

    def member(self, base: ast.Expr, name: Token) -> ast.Member:
        return ast.Member(base.pos, base, name.text, name.pos)

    def bit(self, base: ast.Expr, token: Token) -> ast.Expr:
        text = token.text.lstrip("%").upper()
        width = text[0] if text[0] in "XBWDL" else "X"
        digits = text.removeprefix(width)
        if not digits.isdigit() or len(digits) > 4:
            return self._bad(token, literals.LiteralError(f"{token.text} is not the number of a bit"))
        return ast.BitAccess(base.pos, base, width, int(digits), token.pos)

    def index(self, base: ast.Expr, *indices: ast.Expr) -> ast.Index:
        return ast.Index(base.pos, base, list(indices))

    def deref(self, base: ast.Expr) -> ast.Deref:
        return ast.Deref(base.pos, base)

    def call(self, callee: ast.Expr, args: list[ast.Argument]) -> ast.Call:
        return ast.Call(callee.pos, callee, args)

    def args(self, *children: Any) -> list[Any]:
        return [c for c in children if c is not None]

    def positional(self, value: ast.Expr) -> ast.Argument:
        return ast.Argument(value.pos, None, value)

    def type_argument(self, spec: ast.TypeSpec) -> ast.Argument:
        return ast.Argument(spec.pos, None, ast.TypeArgument(spec.pos, spec))

    def input(self, name: Token, value: ast.Expr | None = None) -> ast.Argument:
        return ast.Argument(name.pos, name.text, value)

    def output(self, name: Token, target: ast.Expr | None = None) -> ast.Argument:
        return ast.Argument(name.pos, name.text, target, output=True)

    def output_negated(self, _not: Token, name: Token, target: ast.Expr | None = None) -> ast.Argument:
        return ast.Argument(name.pos, name.text, target, output=True, negated=True)

    def block_with_task(self, block: Token, task: Token) -> None:
        """`PROGRAM p : Main(timer WITH fast);`: a task for a block of its own, which is refused."""
        message = f"a task runs programs only; call {block.text} in a program that {task.text} runs"
        self.report(block.pos, "syntax", message)
