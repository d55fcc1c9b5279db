"""What all program organisation units declare alike: constants, VAR_EXTERNAL, VAR_STAT, variables of a call.

Beside such an input are two more variables: its value at the previous call, and the edge. The body begins by computing
the edge, and sees it under the name of the input; all others see the input itself.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from plctool.compiler.semantics.declarations.type_declarations import TypeDeclarations
from plctool.compiler.semantics.declarations.variables import Variables
from plctool.compiler.semantics.instances import is_instance, require_instances
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import DIRECTIONS, ERROR, GlobalSymbol, PouSymbol, Role, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.ast import Section
from plctool.compiler.typed.nodes import (
    Assign,
    Binary,
    BinaryOp,
    Load,
    Pou,
    PouKind,
    Storage,
    Unary,
    UnaryOp,
    Variable,
    VarPlace,
)
from plctool.iec.types import BOOL, Keep

# ---- R_EDGE and F_EDGE ----


def edge_variables(raw: Variable) -> tuple[Variable, Variable]:
    """What an input was at the previous call, and its edge; they have no name in the program."""
    owner, dot, name = raw.name.rpartition(".")
    last, edge = (Variable(f"{owner}{dot}%{name}.{e}", BOOL, raw.storage, raw.pos) for e in ("before", "edge"))
    return last, edge


def see_edge(symbol: VarSymbol, kind: ast.Edge, last: Variable, edge: Variable, scope: Scope) -> None:
    """Lets the body in `scope` see the edge in place of the input."""
    assert symbol.variable is not None
    pos = symbol.pos
    now, before = (Load(VarPlace(v, BOOL, pos), BOOL, pos) for v in (symbol.variable, last))
    high, low = (now, before) if kind is ast.Edge.RISING else (before, now)
    found = Binary(BinaryOp.AND, high, Unary(UnaryOp.NOT, low, BOOL, pos), BOOL, pos)
    scope.prologue += [Assign(VarPlace(edge, BOOL, pos), found, pos), Assign(VarPlace(last, BOOL, pos), now, pos)]
    scope.edges[symbol.name.casefold()] = replace(symbol, variable=edge)


# ---- constants, VAR_EXTERNAL, VAR_STAT, variables of a call ----

ROLES = {
    Section.VAR_INPUT: Role.INPUT,
    Section.VAR_OUTPUT: Role.OUTPUT,
    Section.VAR_IN_OUT: Role.IN_OUT,
    Section.VAR: Role.LOCAL,
    Section.VAR_TEMP: Role.TEMP,
    Section.VAR_STAT: Role.LOCAL,
    Section.VAR_INST: Role.LOCAL,
    Section.VAR_GENERIC: Role.LOCAL,
    Section.STEP: Role.STEP,
}
_KINDS = {
    ast.Unit.FUNCTION: PouKind.FUNCTION,
    ast.Unit.FUNCTION_BLOCK: PouKind.FUNCTION_BLOCK,
    ast.Unit.PROGRAM: PouKind.PROGRAM,
}
_KEEPING = {
    PouKind.FUNCTION: "a FUNCTION_BLOCK", PouKind.METHOD: "VAR_INST", PouKind.FUNCTION_BLOCK: "VAR",
    PouKind.PROGRAM: "VAR",
}  # fmt: skip


def _holds_constants(block: ast.VarBlock) -> bool:
    """Whether what a block declares has one value for ever. CONSTANT parameters are only read-only."""
    return ast.Modifier.CONSTANT in block.qualifiers and block.keyword not in (
        *DIRECTIONS,
        Section.VAR_EXTERNAL,
        Section.VAR_INST,
    )


def _in_order_of_use(lines: list[tuple[ast.VarDecl, Role]]) -> list[tuple[ast.VarDecl, Role]]:
    """Declarations of constants, each after those that it uses. What uses itself stays where it is."""
    ordered: list[tuple[ast.VarDecl, Role]] = []
    pending = list(lines)
    while pending:
        undeclared = {name.casefold() for line, _ in pending for _, name in line.names}
        ready = [pair for pair in pending if not undeclared & _names_used(pair[0])] or pending
        ordered += ready
        pending = [pair for pair in pending if pair not in ready]
    return ordered


def _names_used(line: ast.VarDecl) -> set[str]:
    """The names, case-folded, in the type and the initial value of a declaration."""
    return {name.name.casefold() for name in ast.every(ast.Name, line)}


def _initialised_in_order(block: ast.VarBlock, scope: Scope) -> ast.VarBlock:
    """The declarations of a VAR, each after those that its initial value reads; a warning for one that is moved."""
    if block.keyword not in (Section.VAR, Section.VAR_TEMP) or all(line.init is None for line in block.decls):
        return block
    declared_in = {name.casefold(): line for line in block.decls for _, name in line.names}
    ordered: list[ast.VarDecl] = []
    waiting: list[tuple[ast.VarDecl, set[str]]] = []
    for line in block.decls:
        used = _names_used(line) if line.init is not None else set()
        later = {n for n in used if n in declared_in and declared_in[n] not in ordered and scope.lookup(n) is None}
        if later:
            waiting.append((line, later))
            continue
        ordered.append(line)
        while ready := [pair for pair in waiting if all(declared_in[n] in ordered for n in pair[1])]:
            moved, read = ready[0]
            waiting.remove(ready[0])
            ordered.append(moved)
            names = f"{moved.names[0][1]} starts with {declared_in[min(read)].names[0][1]}"
            message = f"{names}, which is declared below and is initialised first here; move that line up"
            scope.warning(moved.pos, "order", message)
    return replace(block, decls=[*ordered, *(line for line, _ in waiting)]) if ordered != block.decls else block


def _seen_by_actions(block: ast.VarBlock, decl: ast.PouDecl) -> bool:
    """Whether an ACTION of the unit uses a name that the block declares."""
    names = {name.casefold() for line in block.decls for _, name in line.names}
    actions = [member.body for member in decl.members if member.keyword is ast.Unit.ACTION]
    return any(name.name.casefold() in names for name in ast.every(ast.Name, actions))


def _owner(decl: ast.PouDecl, scope: Scope) -> str:
    """What stands in front of the name of something that exists once: of a PROGRAM, for all its instances."""
    pou = scope.pou
    return decl.full_name if pou is None or pou.kind is PouKind.PROGRAM else pou.name


def new_pou(symbol: PouSymbol, name: str) -> Pou:
    """The unit that a declaration becomes, still empty."""
    decl = symbol.decl
    checks = "no_checks" not in decl.attributes
    pou = Pou(name, _KINDS[decl.keyword], decl.source.pos(decl.pos), checks=checks)
    pou.no_init = "no_init" in decl.attributes
    pou.cuts_result = "cuts_result" in decl.attributes
    pou.in_place = "in_place" in decl.attributes
    return pou


class UnitVariables:
    """Declares them in the scope of a unit."""

    def __init__(self, world: World, types: TypeDeclarations, variables: Variables) -> None:
        self._world = world
        self._types = types
        self._variables = variables

    def declare_alike(self, decl: ast.PouDecl, pou: Pou, scope: Scope) -> Iterator[ast.VarBlock]:
        """Declares constants, VAR_EXTERNAL, VAR_STAT and VAR_TEMP; gives the other sections, each in its turn."""
        self._declare_constants(decl, scope)
        for written in decl.blocks:
            block = _initialised_in_order(written, scope)
            if _holds_constants(block):
                continue
            if block.keyword is Section.VAR_EXTERNAL:
                self._declare_externals(block, scope)
            elif block.keyword is Section.VAR_STAT:
                self._declare_statics(block, decl, scope)
            elif block.keyword is Section.VAR_TEMP and not _seen_by_actions(block, decl):
                self.declare_stack_variables(block, pou, scope)
            elif block.keyword is Section.VAR_TEMP:
                yield replace(block, keyword=Section.VAR)
                self._start_anew(block, pou, scope)
            else:
                yield block

    def _start_anew(self, block: ast.VarBlock, pou: Pou, scope: Scope) -> None:
        """Lets the body begin with the initial values of VAR_TEMP that actions see, and that are kept for them."""
        for symbol in (scope.names.get(name.casefold()) for line in block.decls for _, name in line.names):
            if isinstance(symbol, VarSymbol) and symbol.variable is not None and symbol.type not in self._world.blocks:
                pos, t = symbol.pos, symbol.type
                first = VarPlace(self._world.default_of(symbol, pou), t, pos)
                scope.prologue.append(Assign(VarPlace(symbol.variable, t, pos), Load(first, t, pos), pos))

    def _declare_constants(self, decl: ast.PouDecl, scope: Scope) -> None:
        """VAR CONSTANT comes first, wherever it stands: array bounds and initial values may use it."""
        lines = [(line, ROLES[b.keyword]) for b in decl.blocks if _holds_constants(b) for line in b.decls]
        for line, role in _in_order_of_use(lines):
            t, init = self._types.declared_type(line, scope)
            for offset, name in line.names:
                symbol = self._variables.constant_symbol(offset, name, t, init, scope, _owner(decl, scope), role)
                symbol.given = line.init is not None
                scope.declare(symbol, offset)

    def _declare_externals(self, block: ast.VarBlock, scope: Scope) -> None:
        """VAR_EXTERNAL only repeats what is declared elsewhere."""
        for line in block.decls:
            t, _ = self._types.declared_type(line, scope)
            for offset, name in line.names:
                keys = [f"{space}.{name}".casefold() for space in scope.path] + [name.casefold()]
                named = (self._world.names.lookup(key, library=scope.library) for key in keys)
                found = next((symbol for symbol in named if isinstance(symbol, GlobalSymbol)), None)
                if found is None:
                    scope.error(offset, "unknown", f"there is no VAR_GLOBAL {name}")
                    scope.names[name.casefold()] = VarSymbol(name, scope.pos(offset), ERROR, Role.IN_OUT)
                    continue
                if self._world.names.same_named(name):
                    listed = " or ".join(s.full_name for s in self._world.names.same_named(name))
                    scope.error(offset, "ambiguous", f"{name} is in several lists; write {listed} in the statements")
                    continue
                symbol = self._world.declared.variable(found)
                if ERROR not in (t, symbol.type) and t != symbol.type:
                    scope.error(offset, "type", f"the VAR_GLOBAL {name} is of type {symbol.type}, not {t}")
                if ast.Modifier.CONSTANT in block.qualifiers:
                    symbol = replace(symbol, constant=True)
                scope.names[name.casefold()] = symbol

    def _declare_statics(self, block: ast.VarBlock, decl: ast.PouDecl, scope: Scope) -> None:
        """VAR_STAT exists once, whatever calls or has the unit."""
        for line in block.decls:
            t, init = self._types.declared_type(line, scope)
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, Role.LOCAL)
                if t is not ERROR:
                    full_name = f"{_owner(decl, scope)}.{name}"
                    keep = Keep.of(block.qualifiers)
                    self._variables.check_kept(name, t, keep, scope, offset)
                    symbol.variable = self._variables.shared_variable(full_name, t, init, scope, offset, keep=keep)
                scope.declare(symbol, offset)

    def keep_of(self, block: ast.VarBlock, pou: Pou) -> Keep:
        """Whether the variables of a section keep their values; where none can, `permitted` has said so."""
        short = pou.kind in (PouKind.FUNCTION, PouKind.METHOD) and block.keyword not in (
            Section.VAR_STAT,
            Section.VAR_INST,
        )
        if short or block.keyword in (Section.VAR_TEMP, Section.VAR_IN_OUT):
            return Keep.UNSAID
        return Keep.of(block.qualifiers)

    def declare_stack_variables(self, block: ast.VarBlock, pou: Pou, scope: Scope) -> None:
        """VAR of a function, VAR_TEMP: they live during the call."""
        for line in block.decls:
            t, init = self._types.declared_type(line, scope)
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, ROLES[block.keyword])
                if is_instance(self._world, t):
                    require_instances(self._world, t, scope, offset)
                    message = f"the instance {name} is initialised at every call; {_KEEPING[pou.kind]} would keep it"
                    scope.warning(offset, "lifetime", message)
                if t is not ERROR:
                    symbol.variable = Variable(name, t, Storage.LOCAL, symbol.pos, initial=init)
                    pou.locals.append(symbol.variable)
                scope.declare(symbol, offset)
