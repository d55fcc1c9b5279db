"""Bodies whose networks are trees: their statements, and what the declarations around them say about types.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable

from plctool.compiler.base.source import Source
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit
from plctool.compiler.formats.plcopen_graph import Network
from plctool.compiler.formats.plcopen_result_types import declared, is_operator, written_type
from plctool.compiler.formats.xml_tree import Element
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.parser import parse

Types = dict[str, str]
"""Types of variables, by case-folded name."""


def units_of(declaration: str) -> list[ast.PouDecl]:
    """The units that a text declares; errors in it are reported elsewhere."""
    found = parse(Source("", declaration), lambda offset, code, message: None)
    return [unit for unit in found if isinstance(unit, ast.PouDecl)]


def types_of(units: Iterable[ast.PouDecl]) -> Types:
    """The types of the variables of some units."""
    return {
        name.casefold(): written_type(d.type) for u in units for b in u.blocks for d in b.decls for _, name in d.names
    }


def translate_networks(body: Element, unit: Unit, made: Body) -> None:
    """Adds the statements of networks. Raises NotTranslatedError."""
    try:
        _declare_called(body, unit)
        Network(body, unit, made).translate()
    except RecursionError:
        raise NotTranslatedError(body.at, "it is too deep") from None


def _declare_called(body: Element, unit: Unit) -> None:
    """Takes over the types of outputs that the file says with a call."""
    for block in body.all("block"):
        kind = block.get("typeName")
        if is_operator(kind) or declared(kind) or kind.casefold() in unit.blocks:
            continue
        outputs = [v for part in block.all("outputVariables") for v in part.all("variable")]
        known = {v.get("formalParameter").casefold(): v.get("type") for v in outputs}
        results = [v.get("type") for v in outputs if v.get("formalParameter").upper() != "ENO"]
        if not block.get("instanceName"):
            known[""] = results[0] if results else ""
        if block.get("instanceName") or not results or results[0]:
            unit.blocks[kind.casefold()] = known
