"""Functions: their parameters, results and variables; those in C.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from plctool.compiler.semantics.conversions import is_global
from plctool.compiler.semantics.declarations.type_declarations import May, TypeDeclarations
from plctool.compiler.semantics.declarations.unit_variables import ROLES, UnitVariables, new_pou
from plctool.compiler.semantics.generics import (
    LIBRARY_STRING,
    NAME,
    WIDE_LIBRARY_STRING,
    bound_parameters,
    describes_any,
    group_of,
    is_any,
    parameter,
)
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    DIRECTIONS,
    ERROR,
    FunctionInfo,
    PouSymbol,
    Role,
    VarSymbol,
)
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    ComputedInit,
    Direction,
    External,
    Initial,
    Parameter,
    Pou,
    PouKind,
    Storage,
    Variable,
)  # fmt: skip
from plctool.iec.types import (
    ArrayType,
    EnumType,
    Field,
    OpenArrayType,
    ReferenceType,
    StringType,
    StructType,
    Type,
)  # fmt: skip
from plctool.image.c_functions import interface_signature, parse_version

_NAMESPACE = re.compile(r"\w+\.(?=[^\W\d])")


class Functions:
    """Declares functions when they are first referred to."""

    def __init__(self, world: World, types: TypeDeclarations, units: UnitVariables) -> None:
        self._world = world
        self._types = types
        self._units = units
        self._functions: dict[tuple[PouSymbol, tuple[tuple[str, Type], ...]], FunctionInfo] = {}
        self._externals: dict[str, Pou] = {}  # of the program, not of libraries
        self._busy: set[PouSymbol] = set()

    def function(self, symbol: PouSymbol, bindings: dict[str, Type]) -> FunctionInfo | None:
        """A function ready to be called; `bindings` for a generic one. None while it is being declared."""
        key = (symbol, tuple(sorted(bindings.items(), key=lambda item: item[0])))
        info = self._functions.get(key)
        if info is not None:
            return info
        if symbol in self._busy:
            return None
        self._busy.add(symbol)
        try:
            info = self._declare_function(symbol, bindings)
        finally:
            self._busy.discard(symbol)
        self._functions[key] = info
        return info

    def _declare_function(self, symbol: PouSymbol, bindings: dict[str, Type]) -> FunctionInfo:
        decl = symbol.decl
        name = f"{decl.full_name}({','.join(t.name for t in bindings.values())})" if bindings else decl.full_name
        pou = new_pou(symbol, name)
        scope = self._world.scope_of(symbol)
        scope.pou, scope.bindings = pou, bindings
        info = FunctionInfo(pou, [], None, decl.attributes)
        self.signature(info, decl, scope)
        external = decl.attributes.get("external")
        if external is not None:
            self.set_external(pou, external, decl.attributes, scope)
        else:
            self._world.bodies.add(scope, decl)
        return info

    def signature(self, info: FunctionInfo, decl: ast.PouDecl, scope: Scope) -> None:
        """Declares result, parameters and variables of a function or method."""
        if decl.result is not None:
            self._declare_result(info, decl, decl.result, scope)
        behind: list[Parameter] = []
        described = describes_any(decl)
        for block in self._units.declare_alike(decl, info.pou, scope):
            if block.keyword in DIRECTIONS:
                for line in block.decls:
                    if described and is_any(line.type):
                        behind += self._any_parameters(block, line, info, scope)
                    else:
                        self._parameters(replace(block, decls=[line]), info, scope)
            elif block.keyword not in (ast.Section.VAR_INST, ast.Section.STEP):
                self._units.declare_stack_variables(block, info.pou, scope)
        info.pou.parameters += [*bound_parameters(info.pou.parameters), *behind]

    def _any_parameters(
        self, block: ast.VarBlock, line: ast.VarDecl, info: FunctionInfo, scope: Scope
    ) -> list[Parameter]:
        """Inputs that describe their arguments; what is passed after all other parameters."""
        assert isinstance(line.type, ast.NamedType)
        if block.keyword is not ast.Section.VAR_INPUT or line.init is not None:
            scope.error(line.pos, "type", f"{line.type.name} is for inputs here, without an initial value")
            return []
        t, behind = self._world.declared.type_named(line.pos, f"__SYSTEM.{NAME}", scope), list[Parameter]()
        for offset, name in line.names:
            symbol = VarSymbol(name, scope.pos(offset), t, ROLES[block.keyword])
            symbol.used, symbol.group = True, group_of(line.type)
            if not scope.declare(symbol, offset):
                continue
            symbol.variable = Variable(name, t, Storage.LOCAL, symbol.pos)
            info.pou.locals.append(symbol.variable)
            own, more, begin = parameter(name, symbol.variable)
            info.parameters.append((symbol, Direction.INPUT))
            info.pou.parameters.append(own)
            behind += more
            scope.prologue += begin
        return behind

    def _declare_result(self, info: FunctionInfo, decl: ast.PouDecl, spec: ast.TypeSpec, scope: Scope) -> None:
        t, default = self._parameter_type(spec, scope)
        info.result = t
        symbol = VarSymbol(decl.name, scope.pos(decl.pos), t, Role.RESULT)
        if t is not ERROR:
            info.pou.result = symbol.variable = Variable(decl.name, t, Storage.LOCAL, symbol.pos, initial=default)
            info.pou.locals.append(symbol.variable)
        scope.names[decl.name.casefold()] = symbol

    def _parameter_type(self, spec: ast.TypeSpec, scope: Scope) -> tuple[Type, Initial | None]:
        if scope.library and isinstance(spec, ast.NamedType) and spec.length is None:
            text = {"STRING": LIBRARY_STRING, "WSTRING": WIDE_LIBRARY_STRING}.get(spec.name.upper())
            if text is not None:
                return text, None
        return self._types.type_of(spec, scope)

    def _parameters(self, block: ast.VarBlock, info: FunctionInfo, scope: Scope) -> None:
        direction = DIRECTIONS[block.keyword]
        for line in block.decls:
            if scope.library and line.init is None and isinstance(line.type, ast.NamedType):
                t, default = self._parameter_type(line.type, scope)
            else:
                t, default = self._types.declared_type(line, scope, May.BE_OPEN_ARRAY)
            if isinstance(default, ComputedInit) and not is_global(default.value):
                message = "the default of a parameter is made of constants and global variables"
                scope.error(line.pos, "constant", f"{message}; assign anything else in the body")
            by_reference = direction is not Direction.INPUT or self._passes_reference(line, info.attributes, t)
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, ROLES[block.keyword], default=default)
                symbol.given, symbol.by_reference, symbol.used = line.init is not None, by_reference, True
                symbol.constant = ast.Modifier.CONSTANT in block.qualifiers
                if not scope.declare(symbol, offset):
                    continue
                storage = Storage.REFERENCE if by_reference else Storage.LOCAL
                initial = default if direction is Direction.OUTPUT else None
                symbol.variable = Variable(name, t, storage, symbol.pos, initial=initial)
                info.parameters.append((symbol, direction))
                info.pou.parameters.append(Parameter(symbol.variable, direction, by_reference))

    def _passes_reference(self, line: ast.VarDecl, attributes: dict[str, str], t: Type) -> bool:
        """A read-only string, array or struct input, which the library passes without a copy; an ARRAY[*]."""
        wanted = isinstance(t, OpenArrayType) or "by_reference" in line.attributes or "by_reference" in attributes
        return wanted and isinstance(t, StringType | ArrayType | StructType)

    def set_external(self, pou: Pou, name: str, attributes: Mapping[str, str], scope: Scope) -> None:
        """Makes a unit whose parameters are declared one that is implemented by the C function `name`."""
        version = parse_version(attributes.get("version", "1.0"))
        if version is None:
            message = "the attribute version is written '1.0' or '1.0.0.0', of numbers up to 255"
            self._world.diagnostics.error(pou.pos, "attribute", message)
        name = name.lower()
        pou.external = External(name, interface_signature(_signed_text(name, pou)), version or 0)
        if not scope.library:
            self._check_declared_once(pou.external, pou)

    def _check_declared_once(self, external: External, pou: Pou) -> None:
        """A device has one C function of a name."""
        other = self._externals.setdefault(external.name, pou)
        if other.external != external:
            message = (
                f"the C function {external.name} is {other.name} already, with other parameters or another version: "
                "declare it once, and call that one"
            )
            self._world.diagnostics.error(pou.pos, "external", message)


def interface_text(name: str, pou: Pou) -> str:
    """The interface of a C function: `name(TYPE,&TYPE):RESULT`. A block or method has the instance first, and the
    variables of a block are in that."""
    types = [("&" if p.by_reference else "") + _interface_name(p.variable.type) for p in pou.parameters]
    if pou.instance is not None:
        types = ["&" + _interface_name(pou.instance), *(types if pou.kind is PouKind.METHOD else [])]
    result = "" if pou.result is None else ":" + _interface_name(pou.result.type)
    return f"{name}({','.join(types)}){result}"


def _signed_text(name: str, pou: Pou) -> str:
    """The same of a block or method with the layout of the instance, and of what else is passed by its address."""
    if pou.instance is None:
        return interface_text(name, pou)
    parameters = pou.parameters if pou.kind is PouKind.METHOD else []
    types = (_layout(p.variable.type, pou.instance) for p in parameters)
    result = "" if pou.result is None else ":" + _layout(pou.result.type, pou.instance)
    return f"{name}({','.join(('&' + _layout(pou.instance), *types))}){result}"


def layout_signature(t: Type) -> int:
    """The signature of a variable that components in C use."""
    return interface_signature(_layout(t))


def call_signature(members: list[Field], size: int) -> int:
    """The signature of a function that components in C call with a structure of its parameters and result."""
    return interface_signature(f"CALL[{size}]{{{_members(members)}}}")


def _members(fields: list[Field], *known: StructType) -> str:
    return ",".join(f"{f.name.upper()}@{f.offset}:{_layout(f.type, *known)}" for f in fields)


def _layout(t: Type, *known: StructType) -> str:
    """The name of a type, and where its members are unless it is one of those that are `known`."""
    if isinstance(t, ReferenceType):
        return "&" + _layout(t.target, *known)
    if isinstance(t, ArrayType):
        return f"{t.count}*{_layout(t.element, *known)}"
    if isinstance(t, EnumType):
        return f"{_interface_name(t)}={t.base.name}"
    if not isinstance(t, StructType) or t in known:
        return _NAMESPACE.sub("", t.name).upper()
    return f"{_interface_name(t)}[{t.size}]{{{_members(t.fields, t, *known)}}}"


def _interface_name(t: Type) -> str:
    """Without namespaces: a library has the same functions in a program that imports it as in one of its own."""
    if isinstance(t, StringType):
        return "WSTRING" if t.wide else "STRING"
    return _NAMESPACE.sub("", t.name).upper()
