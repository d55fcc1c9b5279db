"""Bodies whose networks are trees: their statements.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.base.source import Source
from plctool.compiler.formats.library_units import is_declared, is_operator
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit
from plctool.compiler.formats.plcopen_graph import Network
from plctool.compiler.formats.xml_tree import Element
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.parser import parse


def units_of(declaration: str) -> list[ast.PouDecl]:
    """The units that a text declares; errors in it are reported elsewhere."""
    found = parse(Source("", declaration), lambda offset, code, message: None)
    return [unit for unit in found if isinstance(unit, ast.PouDecl)]


def translate_networks(body: Element, unit: Unit, made: Body) -> None:
    """Adds the statements of networks. Raises NotTranslatedError."""
    try:
        _declare_called(body, unit)
        Network(body, unit, made).translate()
    except RecursionError:
        raise NotTranslatedError(body.at, "it is too deep") from None


def _declare_called(body: Element, unit: Unit) -> None:
    """Takes over what the file says with a call about results."""
    for block in body.all("block"):
        kind = block.get("typeName")
        if is_operator(kind) or is_declared(kind) or kind.casefold() in unit.results:
            continue
        outputs = [v for part in block.all("outputVariables") for v in part.all("variable")]
        results = [v.get("type") for v in outputs if v.get("formalParameter").upper() != "ENO"]
        if block.get("instanceName") or not results or results[0]:
            unit.results[kind.casefold()] = bool(results) and not block.get("instanceName")
