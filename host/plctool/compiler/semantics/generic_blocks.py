"""Function blocks with VAR_GENERIC CONSTANT: `Fifo<10>` is a block of its own, in which the constant is 10.

It is made before names are known, as a copy of the block whose VAR_GENERIC is a VAR CONSTANT. So a constant is a
number, the name of a constant that has one, or made of these.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from itertools import chain

from plctool.compiler.semantics.participants import Files
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics, SourceDiagnostics
from plctool.errors import counted

_MAX_DEPTH = 20  # of constants that name others, and of blocks that have blocks of another size
_SUMS: dict[ast.Operator, Callable[[int, int], int]] = {
    ast.Operator.ADD: int.__add__, ast.Operator.SUB: int.__sub__, ast.Operator.MUL: int.__mul__,
}  # fmt: skip
_QUOTIENTS = (ast.Operator.DIV, ast.Operator.MOD)
_Constants = Mapping[str, ast.Expr]  # by case-folded name


def with_instances(files: Files, diagnostics: Diagnostics) -> Files:
    """The declarations of a program, in which each generic block is replaced by those that the program has of it."""
    units = [d for _, declared in files for d in declared if isinstance(d, ast.PouDecl)]
    templates = {unit.name.casefold(): unit for unit in units if _is_generic(unit)}
    if not templates:
        return files
    instances = _Instances(templates, _global_constants(files), diagnostics)
    found: Files = []
    for source, declared in files:
        kept = [d for d in declared if not _is_generic(d)]
        for declaration in kept:
            instances.name_types(declaration, diagnostics.at(source))
        found.append((source, kept))
    return [(source, [*kept, *instances.of(source.path)]) for source, kept in found]


def _is_generic(declaration: ast.Declaration) -> bool:
    return isinstance(declaration, ast.PouDecl) and any(map(_is_generic_section, declaration.blocks))


def _is_generic_section(block: ast.VarBlock) -> bool:
    return block.keyword is ast.Section.VAR_GENERIC


def _global_constants(files: Files) -> dict[str, ast.Expr]:
    blocks = [d.block for _, declared in files for d in declared if isinstance(d, ast.GlobalBlock)]
    return _constants(blocks)


def _constants(blocks: Iterable[ast.VarBlock]) -> dict[str, ast.Expr]:
    """The constants of some sections that have an expression as their value."""
    lines = chain.from_iterable(b.decls for b in blocks if ast.Modifier.CONSTANT in b.qualifiers)
    return {
        name.casefold(): line.init
        for line in lines
        for _, name in line.names
        if line.init is not None and not isinstance(line.init, ast.ArrayInit | ast.StructInit)
    }


class _Instances:
    """The blocks that are made, by name; they wait for their own types to be named."""

    def __init__(self, templates: Mapping[str, ast.PouDecl], constants: _Constants, diagnostics: Diagnostics) -> None:
        self._templates = templates
        self._constants = constants
        self._diagnostics = diagnostics
        self._made: dict[str, ast.PouDecl] = {}
        self._depth = 0

    def of(self, path: str) -> list[ast.PouDecl]:
        """Those whose template is in a file."""
        return [made for made in self._made.values() if made.source.path == path]

    def name_types(self, declaration: ast.Declaration, reports: SourceDiagnostics) -> None:
        """Gives all types in a declaration that are such blocks the names of these. Others with constants keep theirs,
        and are refused when they are looked at."""
        own = _constants(declaration.blocks) if isinstance(declaration, ast.PouDecl) else {}
        for spec in ast.every(ast.NamedType, declaration):
            template = self._templates.get((spec.template or spec.name).casefold())
            if template is not None:
                self._name(spec, template, {**self._constants, **own}, reports)

    def _name(self, spec: ast.NamedType, template: ast.PouDecl, known: _Constants, reports: SourceDiagnostics) -> None:
        lines = [(n, d) for b in template.blocks if _is_generic_section(b) for d in b.decls for _, n in d.names]
        given: list[ast.Expr | None] = list(spec.constants) or [
            None if isinstance(d.init, ast.ArrayInit | ast.StructInit) else d.init for _, d in lines
        ]
        values = [_value(e, known) for e in given if e is not None]
        if len(values) != len(lines):
            wanted = ", ".join(name for name, _ in lines)
            message = f"{template.name} has {counted(len(lines), 'constant')}: write {template.name}<{wanted}>"
            reports.error(spec.pos, "type", message)
        elif None in values:
            message = f"a constant of {template.name} is a number, or a constant that is one"
            reports.error(spec.pos, "constant", message)
        whole = [v for v in values if v is not None]
        whole = whole if len(whole) == len(lines) else [1] * len(lines)  # nothing else is wrong there
        spec.template = spec.template or spec.name
        spec.name = f"{template.name}<{','.join(map(str, whole))}>"
        if spec.name.casefold() not in self._made:
            self._make(spec, template, whole, reports)

    def _make(self, spec: ast.NamedType, template: ast.PouDecl, values: list[int], reports: SourceDiagnostics) -> None:
        if self._depth > _MAX_DEPTH:
            reports.error(spec.pos, "recursion", f"{template.name} has blocks of ever other sizes")
            spec.name = "BOOL"  # so that no more is said of it
            return
        same = {id(template.source): template.source, id(template.namespace): template.namespace}
        made = replace(deepcopy(template, same), name=spec.name)
        waiting = iter(values)
        made.blocks = [_as_constants(b, waiting) if _is_generic_section(b) else b for b in made.blocks]
        self._made[spec.name.casefold()] = made
        self._depth += 1
        self.name_types(made, self._diagnostics.at(template.source))
        self._depth -= 1


def _as_constants(block: ast.VarBlock, values: Iterable[int]) -> ast.VarBlock:
    """VAR_GENERIC CONSTANT as VAR CONSTANT, with values."""
    waiting = iter(values)
    lines = [
        replace(line, names=[name], init=ast.Literal(name[0], ast.LiteralKind.INT, next(waiting)))
        for line in block.decls
        for name in line.names
    ]
    return replace(block, keyword=ast.Section.VAR, qualifiers={ast.Modifier.CONSTANT}, decls=lines)


def _value(e: ast.Expr, known: _Constants, depth: int = 0) -> int | None:
    """The value of a constant expression; None if it has none that is known before the program is declared."""
    if depth > _MAX_DEPTH:
        return None
    if isinstance(e, ast.Literal):
        return e.value if e.kind is ast.LiteralKind.INT and isinstance(e.value, int) else None
    if isinstance(e, ast.Name):
        named = known.get(e.name.rpartition(".")[2].casefold())
        return None if named is None else _value(named, known, depth + 1)
    if isinstance(e, ast.Member):
        return _value(ast.Name(e.pos, e.name), known, depth + 1)
    if isinstance(e, ast.Unary) and e.op in (ast.Operator.SUB, ast.Operator.ADD):
        value = _value(e.operand, known, depth + 1)
        return value if value is None or e.op is ast.Operator.ADD else -value
    if isinstance(e, ast.Binary):
        return _sum(e.op, _value(e.left, known, depth + 1), _value(e.right, known, depth + 1))
    return None


def _sum(op: ast.Operator, left: int | None, right: int | None) -> int | None:
    if left is None or right is None:
        return None
    if op in _SUMS:
        return _SUMS[op](left, right)
    if op not in _QUOTIENTS or right == 0:
        return None
    quotient = abs(left) // abs(right) * (1 if (left < 0) is (right < 0) else -1)
    return quotient if op is ast.Operator.DIV else left - quotient * right
