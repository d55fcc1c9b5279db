"""What is declared when something first needs it, so that the order of declarations does not matter.

A statement needs a function, whose parameter is an array, whose bound is a constant expression, which names a global
... So rules ask for what is declared, and what declares asks the rules. Here is what can be asked for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    BlockInfo,
    FunctionInfo,
    GlobalSymbol,
    Member,
    PouSymbol,
    TypeSymbol,
    VarSymbol,
)
from plctool.iec.types import InterfaceType, StructType, Type


@dataclass(frozen=True)
class Declared:
    """Who declares what. Each of them says what is wrong the first time, and does nothing the second time."""

    type_of: Callable[[TypeSymbol], Type]
    type_named: Callable[[int, str, Scope], Type]  # ERROR after an error
    variable: Callable[[GlobalSymbol], VarSymbol]
    function: Callable[[PouSymbol, dict[str, Type]], FunctionInfo | None]  # None while it is being declared
    member: Callable[[Member], FunctionInfo]
    block: Callable[[PouSymbol], BlockInfo | None]  # None when it contains itself
    layout: Callable[[PouSymbol], StructType | None]  # the type of a block, also while it is being declared
    interface: Callable[[PouSymbol], InterfaceType]
