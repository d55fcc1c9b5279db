"""Function blocks that are given inputs but never called, so that nothing comes of it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.nodes import Assign, Direction, MemberPlace, Pos, Pou, PouKind, Storage, Variable, VarPlace
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import StructType

_Member = tuple[StructType, int]  # a block and an offset in its instance


def report_uncalled_blocks(pous: Iterable[Pou], diagnostics: Diagnostics) -> None:
    """Warns at the first input that an instance is given. What is handed on, or called from elsewhere, is called."""
    units = list(pous)
    inputs = {member: name for unit in units for member, name in _inputs(unit)}
    if not inputs:
        return
    used: set[Variable | _Member] = set()
    given: dict[Variable, tuple[Pos, str, Pou]] = {}
    for unit in units:
        bases: set[int] = set()  # each is after what it is the base of
        for node in walk(unit.body):
            if isinstance(node, MemberPlace):
                bases.add(id(node.base))
            if isinstance(node, VarPlace) and id(node) not in bases:
                used.add(node.var)
            elif isinstance(node, MemberPlace) and id(node) not in bases and isinstance(node.base.type, StructType):
                used.add((node.base.type, node.offset))
            elif isinstance(node, Assign) and isinstance(node.target, MemberPlace):
                base = node.target.base
                name = inputs.get((base.type, node.target.offset)) if isinstance(base.type, StructType) else None
                if name is not None and isinstance(base, VarPlace) and base.var.storage is not Storage.REFERENCE:
                    found = (node.pos, name, unit)
                    given[base.var] = min(given.get(base.var, found), found, key=lambda f: (f[0].line, f[0].column))
    for variable, (pos, name, unit) in given.items():
        member = None if unit.instance is None else (unit.instance, variable.offset)
        if variable not in used and not (variable.storage is Storage.SELF and member in used):
            instance = variable.name.rpartition(".")[2]
            message = f"{instance} is never called, so nothing comes of its {name}; write {instance}({name} := ...);"
            diagnostics.warning(pos, "uncalled", message)


def _inputs(unit: Pou) -> Iterator[tuple[_Member, str]]:
    """The inputs of a function block that does something when it is called."""
    if unit.kind is PouKind.FUNCTION_BLOCK and unit.instance is not None and (unit.body or unit.external):
        for parameter in unit.parameters:
            if parameter.direction is Direction.INPUT:
                yield (unit.instance, parameter.variable.offset), parameter.variable.name
