"""Puts declarations together: methods with the unit they belong to, namespaces with what they hold.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import Report, Token

MEMBERS = frozenset((ast.Unit.METHOD, ast.Unit.ACTION, ast.Unit.GET, ast.Unit.SET))
"""Keywords of PouDecls that stand in another POU, or after it."""

_OWNERS = frozenset((ast.Unit.FUNCTION_BLOCK, ast.Unit.PROGRAM, ast.Unit.INTERFACE))


def _flat(units: Iterable[Any]) -> list[Any]:
    found: list[Any] = []
    for unit in units:
        if isinstance(unit, list):
            found += _flat(unit)
        elif unit is not None:
            found.append(unit)
    return found


class Arrangement:
    """What the tree builder does with whole units. `pou` makes one of its parts."""

    def __init__(self, report: Report, pou: Callable[..., ast.PouDecl]) -> None:
        self._report = report
        self._pou = pou

    def arrange(self, units: Iterable[Any]) -> list[Any]:
        """The units of a file or namespace. A METHOD or ACTION between units belongs to the previous one."""
        found: list[Any] = []
        using: list[tuple[int, str]] = []
        for unit in _flat(units):
            if isinstance(unit, ast.Namespace):
                using += unit.using
            elif isinstance(unit, ast.PouDecl) and unit.keyword in MEMBERS:
                self._attach(unit, found)
            else:
                found.append(unit)
        if using:
            for unit in found:
                _namespace(unit).using += using
        return found

    def _attach(self, member: ast.PouDecl, units: list[Any]) -> None:
        owner = units[-1] if units else None
        if isinstance(owner, ast.PouDecl) and owner.keyword in _OWNERS:
            owner.members.append(member)
            return
        message = f"the {member.keyword} {member.name} has no FUNCTION_BLOCK or PROGRAM before it"
        self._report(member.pos, "syntax", message)

    def complete(self, decl: ast.PouDecl, bases: Any, interfaces: Any, parts: Sequence[Any]) -> None:
        """Adds what a unit extends, implements and holds."""
        decl.chart, parts = self._chart(decl, parts)
        decl.bases, decl.interfaces = bases or [], interfaces or []
        for part in _flat(parts):
            if isinstance(part, ast.PouDecl):
                decl.members.append(part)
            elif isinstance(part, ast.Namespace):
                _namespace(decl).using += part.using
            elif isinstance(part, ast.InstanceBlock):
                self._give_access(decl, part)
            else:
                decl.blocks.append(part)

    def _give_access(self, decl: ast.PouDecl, block: ast.InstanceBlock) -> None:
        lines = [line for line in block.lines if isinstance(line, ast.AccessLine)]
        if decl.keyword is ast.Unit.PROGRAM:
            decl.accesses += lines
        elif lines:
            self._report(lines[0].pos, "syntax", "VAR_ACCESS stands in a PROGRAM or in the CONFIGURATION")

    def _chart(self, decl: ast.PouDecl, parts: Sequence[Any]) -> tuple[ast.Chart | None, Sequence[Any]]:
        """The steps and transitions, and the rest."""
        steps = [p for p in parts if isinstance(p, ast.Step)]
        transitions = [p for p in parts if isinstance(p, ast.Transition)]
        if not steps and not transitions:
            return None, parts
        if decl.body:
            message = f"{decl.name} has statements and steps; put the statements into an ACTION"
            self._report(decl.body[0].pos, "syntax", message)
        return ast.Chart(steps, transitions), [p for p in parts if not isinstance(p, ast.Step | ast.Transition)]

    def property(self, keyword: Token, rest: Sequence[Any]) -> list[ast.PouDecl]:
        """The GET is a method that returns the value, the SET one that takes it as its input, both by the name of the
        property."""
        at = next(i for i, part in enumerate(rest) if part is not None and not hasattr(part, "text"))
        *modifiers, name = rest[:at]
        spec, blocks, *accessors = rest[at:]
        found = []
        for accessor in accessors:
            if accessor is None:
                continue
            token, more, own_blocks, body = accessor
            all_blocks = [*(blocks or []), *(own_blocks or [])]
            decl = self._pou(keyword, [*modifiers, *more, name], None, all_blocks, body, ast.Unit(token.type))
            found.append(self._accessor(decl, spec, name))
        if not found:
            self._report(name.pos, "syntax", f"the property {name.text} needs a GET or a SET")
        return found

    def single_accessor(self, keyword: Token, rest: Sequence[Any]) -> ast.PouDecl:
        """PROPERTY_GET and PROPERTY_SET of the fourth edition."""
        *head, spec, blocks, body = rest
        decl = self._pou(keyword, head, None, blocks, body, ast.Unit(keyword.type.removeprefix("PROPERTY_")))
        return self._accessor(decl, spec, head[-1])

    def _accessor(self, decl: ast.PouDecl, spec: ast.TypeSpec, name: Token) -> ast.PouDecl:
        if decl.keyword is ast.Unit.GET:
            decl.result = spec
        else:
            line = ast.VarDecl(name.pos, [(name.pos, name.text)], None, spec, None)
            decl.blocks.insert(0, ast.VarBlock(name.pos, ast.Section.VAR_INPUT, set(), [line]))
        return decl

    def namespace(self, rest: Sequence[Any]) -> list[Any]:
        """The units of a namespace, which know its name."""
        at = next(i for i, part in enumerate(rest) if isinstance(part, tuple))
        words, name = {token.text.upper() for token in rest[:at]}, rest[at][1]
        for token in rest[:at]:
            if token.text.upper() not in ("PUBLIC", "INTERNAL") or len(words) > 1:
                self._report(token.pos, "syntax", "a NAMESPACE is INTERNAL, or seen by all; leave out other words")
        units = self.arrange(rest[at + 1 :])
        for unit in units:
            space = _namespace(unit)
            space.name = f"{name}.{space.name}" if space.name else name
            if space.internal is not None:
                space.internal = f"{name}.{space.internal}" if space.internal else name
            elif "INTERNAL" in words:
                space.internal = name.rpartition(".")[0]
        return units


def _namespace(unit: Any) -> ast.Namespace:
    space: ast.Namespace | None = getattr(unit, "namespace", None)
    if space is None:
        space = ast.Namespace()
        if isinstance(unit, ast.PouDecl | ast.TypeDecl | ast.GlobalBlock | ast.TestDecl):
            unit.namespace = space
    return space
