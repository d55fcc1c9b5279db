"""Program organisation units: signatures of functions, layouts of function blocks, instances of programs.

Bodies are checked later (World.check_bodies), when everything they may refer to is known.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
import zlib
from typing import TYPE_CHECKING

from plctool.compiler.semantics.declarations import RETAINING, May
from plctool.compiler.semantics.edges import edge_variables, see_edge
from plctool.compiler.semantics.generics import LIBRARY_STRING, WIDE_LIBRARY_STRING, is_group
from plctool.compiler.semantics.open_arrays import bound_parameters, give_bounds
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    ERROR,
    BlockInfo,
    FunctionInfo,
    PouSymbol,
    ProgramInfo,
    Role,
    VarSymbol,
)
from plctool.compiler.semantics.unit_variables import DIRECTIONS, ROLES, UnitVariables
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    ComputedInit,
    Direction,
    External,
    Initial,
    Parameter,
    Pou,
    PouKind,
    Storage,
    StructInit,
    Variable,
)  # fmt: skip
from plctool.compiler.types import (
    ArrayType,
    Field,
    OpenArrayType,
    ReferenceType,
    StringType,
    StructType,
    Type,
)  # fmt: skip

if TYPE_CHECKING:
    from plctool.compiler.semantics.declarations import Allocation
    from plctool.compiler.semantics.world import World

_KINDS = {"FUNCTION": PouKind.FUNCTION, "FUNCTION_BLOCK": PouKind.FUNCTION_BLOCK, "PROGRAM": PouKind.PROGRAM}
_VERSION = re.compile(r"(\d{1,5})\.(\d{1,5})")
_ACCESS = {"PUBLIC", "PRIVATE", "PROTECTED", "INTERNAL"}
_MEMBER_MAY = {
    Role.INPUT: May.BE_EDGE | May.HAVE_OPEN_ADDRESS, Role.OUTPUT: May.HAVE_OPEN_ADDRESS,
    Role.IN_OUT: May.BE_OPEN_ARRAY, Role.LOCAL: May.HAVE_OPEN_ADDRESS, Role.STEP: May.BE_PLAIN,
}  # fmt: skip
_PROGRAM_MAY = {
    Direction.INPUT: May.HAVE_ADDRESS | May.BE_EDGE, Direction.OUTPUT: May.HAVE_ADDRESS, None: May.HAVE_ADDRESS,
}  # fmt: skip


class Units(UnitVariables):
    """Declares POUs when they are first referred to."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._functions: dict[tuple[PouSymbol, tuple[tuple[str, Type], ...]], FunctionInfo] = {}
        self._blocks: dict[PouSymbol, BlockInfo] = {}
        self._layouts: dict[PouSymbol, StructType] = {}
        self._busy: set[PouSymbol] = set()

    # ---- what all units share ----

    def _scope(self, symbol: PouSymbol, pou: Pou, bindings: dict[str, Type] | None = None) -> Scope:
        scope = self.world.classes.scope_of(symbol)
        scope.pou = pou
        scope.bindings = bindings or {}
        return scope

    def _pou(self, symbol: PouSymbol, name: str) -> Pou:
        decl = symbol.decl
        checks = "no_checks" not in decl.attributes
        pou = Pou(name, _KINDS[decl.keyword], decl.source.pos(decl.pos), checks=checks)
        pou.no_init = "no_init" in decl.attributes
        pou.cuts_result = "cuts_result" in decl.attributes
        pou.in_place = "in_place" in decl.attributes
        return pou

    # ---- functions ----

    def function(self, symbol: PouSymbol, bindings: dict[str, Type] | None = None) -> FunctionInfo | None:
        """A function ready to be called; `bindings` for a generic one. None while it is being declared."""
        key = (symbol, tuple(sorted((bindings or {}).items(), key=lambda item: item[0])))
        info = self._functions.get(key)
        if info is not None:
            return info
        if symbol in self._busy:
            return None
        self._busy.add(symbol)
        try:
            info = self._declare_function(symbol, bindings or {})
        finally:
            self._busy.discard(symbol)
        self._functions[key] = info
        return info

    def is_generic(self, symbol: PouSymbol) -> bool:
        """Whether parameters of the function are of a type ANY_..."""
        return any(
            isinstance(line.type, ast.NamedType) and is_group(line.type.name)
            for block in symbol.decl.blocks
            if block.keyword in DIRECTIONS
            for line in block.decls
        )

    def _declare_function(self, symbol: PouSymbol, bindings: dict[str, Type]) -> FunctionInfo:
        decl = symbol.decl
        name = f"{decl.full_name}({','.join(t.name for t in bindings.values())})" if bindings else decl.full_name
        pou = self._pou(symbol, name)
        scope = self._scope(symbol, pou, bindings)
        info = FunctionInfo(pou, [], None, decl.attributes)
        self.signature(info, decl, scope)
        external = decl.attributes.get("external")
        if external is not None:
            pou.external = self._external(external, info, scope)
        else:
            self.world.add_body(scope, decl, pou, symbol.library)
        return info

    def signature(self, info: FunctionInfo, decl: ast.PouDecl, scope: Scope) -> None:
        """Declares result, parameters and variables of a function or method."""
        if decl.result is not None:
            self._declare_result(info, decl, decl.result, scope)
        for block in self.declare_alike(decl, info.pou, scope):
            if block.keyword in DIRECTIONS:
                self._parameters(block, info, scope)
            elif block.keyword not in ("VAR_INST", "STEP"):
                self.declare_stack_variables(block, info.pou, scope)
        info.pou.parameters += bound_parameters(info.pou.parameters)

    def _declare_result(self, info: FunctionInfo, decl: ast.PouDecl, spec: ast.TypeSpec, scope: Scope) -> None:
        t, default = self._parameter_type(spec, scope)
        if self.is_instance(t):
            scope.error(spec.pos, "type", f"a function cannot return the function block {t}")
            t = ERROR
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
        return self.world.declarations.type_of(spec, scope)

    def _parameters(self, block: ast.VarBlock, info: FunctionInfo, scope: Scope) -> None:
        direction, declarations = DIRECTIONS[block.keyword], self.world.declarations
        for line in block.decls:
            if scope.library and line.init is None and isinstance(line.type, ast.NamedType):
                t, default = self._parameter_type(line.type, scope)
            else:
                t, default = declarations.declared_type(line, scope, May.BE_OPEN_ARRAY)
            if isinstance(default, ComputedInit):
                scope.error(line.pos, "constant", "the default of a parameter has to be constant")
            by_reference = direction is not Direction.INPUT or self._passes_reference(line, info.attributes, t)
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, ROLES[block.keyword], default=default)
                symbol.given, symbol.by_reference, symbol.used = line.init is not None, by_reference, True
                symbol.constant = "CONSTANT" in block.qualifiers
                if not declarations.add(scope, symbol, offset):
                    continue
                if direction is not Direction.IN_OUT and self.is_instance(t):
                    scope.error(offset, "type", f"pass the function block {name} as VAR_IN_OUT")
                    symbol.type = ERROR
                storage = Storage.REFERENCE if by_reference else Storage.LOCAL
                symbol.variable = Variable(name, t, storage, symbol.pos)
                info.parameters.append((symbol, direction))
                info.pou.parameters.append(Parameter(symbol.variable, direction, by_reference))

    def _passes_reference(self, line: ast.VarDecl, attributes: dict[str, str], t: Type) -> bool:
        """A read-only string, array or struct input, which the library passes without a copy; an ARRAY[*]."""
        wanted = isinstance(t, OpenArrayType) or "by_reference" in line.attributes or "by_reference" in attributes
        return wanted and isinstance(t, StringType | ArrayType | StructType)

    def _external(self, name: str, info: FunctionInfo, scope: Scope) -> External:
        """The C function: its interface text is `name(TYPE,&TYPE):RESULT`."""
        version = _VERSION.fullmatch(info.attributes.get("version", "1.0"))
        if version is None:
            scope.world.diagnostics.error(info.pou.pos, "attribute", "the attribute version is written '1.0'")
            return External(name, 0, 0)
        major, minor = (int(part) for part in version.groups())
        text = interface_text(name.lower(), info.pou)
        return External(name.lower(), zlib.crc32(text.encode("latin-1", "replace")), major << 16 | minor)

    # ---- function blocks ----

    def block(self, symbol: PouSymbol) -> BlockInfo | None:
        """A function block ready to be instantiated; None when it contains itself."""
        info = self._blocks.get(symbol)
        if info is not None:
            return info
        if symbol in self._busy:
            return None
        self._busy.add(symbol)
        try:
            info = self._declare_block(symbol)
        finally:
            self._busy.discard(symbol)
        self._blocks[symbol] = info
        return info

    def _declare_block(self, symbol: PouSymbol) -> BlockInfo:
        decl = symbol.decl
        hidden = symbol.library and self.world.is_user_name(decl.name)
        pou = self._pou(symbol, f"Standard.{decl.name}" if hidden else decl.full_name)
        scope = self._scope(symbol, pou)
        layout = StructType(pou.name)
        info = BlockInfo(pou, layout, {})
        pou.instance = layout
        defaults: dict[str, Initial] = {}
        self._layouts[symbol] = layout
        self.world.classes.begin_block(symbol, info, scope, defaults)
        for block in self.declare_alike(decl, pou, scope):
            self._members(block, info, defaults, scope)
        self.world.classes.instance_variables(info, defaults, scope)
        layout.fields = [f for f in layout.fields if f.type is not ERROR]
        layout.lay_out()
        for field in layout.fields:
            symbol_of = info.members.get(field.name.casefold())
            if symbol_of is not None and symbol_of.variable is not None:
                symbol_of.variable.offset = field.offset
        if defaults:
            self.world.defaults[layout.name] = StructInit(defaults)
        info.members |= {k: s for k, s in scope.names.items() if isinstance(s, VarSymbol) and s.role is not Role.TEMP}
        self.world.blocks[layout] = info
        self.world.classes.end_block(info, scope)
        self.world.add_body(scope, decl, pou, symbol.library)
        return info

    def layout(self, symbol: PouSymbol) -> StructType | None:
        """The type of instances, also while the block is being declared: what points to it may be part of it."""
        if symbol not in self._layouts:
            self.block(symbol)
        return self._layouts.get(symbol)

    def _members(self, block: ast.VarBlock, info: BlockInfo, defaults: dict[str, Initial], scope: Scope) -> None:
        role, direction = ROLES[block.keyword], DIRECTIONS.get(block.keyword)
        info.retain = info.retain or bool(block.qualifiers & RETAINING)
        for line in block.decls:
            t, default = self.world.declarations.declared_type(line, scope, _MEMBER_MAY[role])
            if role is not Role.IN_OUT:
                self.world.classes.require_instances(t, scope, line.pos)
            info.retain = info.retain or (role is not Role.IN_OUT and self.world.declarations.is_retain(t))
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, role, default=default)
                symbol.given, symbol.used = line.init is not None, direction is not None
                symbol.access = next(iter(block.qualifiers & _ACCESS), "")
                symbol.open_area = line.location.text[1] if line.location is not None else ""
                symbol.constant = "CONSTANT" in block.qualifiers
                if not self.world.declarations.add(scope, symbol, offset):
                    continue
                info.members[name.casefold()] = symbol
                alias = line.attributes.get("alias", "") if scope.library else ""
                if alias:
                    info.members[alias.casefold()] = symbol
                if t is ERROR:
                    continue
                reference = role is Role.IN_OUT
                storage = Storage.REFERENCE if reference else Storage.SELF
                symbol.variable = Variable(name, t, storage, symbol.pos, initial=None if reference else default)
                info.type.fields.append(Field(name, ReferenceType(t) if reference else t, alias=alias))
                if default is not None and not reference:
                    defaults[name] = default
                if direction is not None:
                    info.pou.parameters.append(Parameter(symbol.variable, direction, reference))
                for bound in give_bounds(symbol.variable, Storage.SELF):
                    self._hidden_member(bound, info)
                if line.edge:
                    last, edge = edge_variables(symbol.variable)
                    self._hidden_member(last, info)
                    self._hidden_member(edge, info)
                    see_edge(symbol, line.edge, last, edge, scope)

    def _hidden_member(self, variable: Variable, info: BlockInfo) -> None:
        """A member that has no name in the program."""
        symbol = VarSymbol(variable.name, variable.pos, variable.type, Role.LOCAL, variable)
        info.members[variable.name.casefold()] = symbol
        info.type.fields.append(Field(variable.name, variable.type))

    # ---- programs ----

    def program(
        self, symbol: PouSymbol, name: str, allocation: Allocation, qualifiers: set[str]
    ) -> tuple[ProgramInfo, Scope]:
        """An instance of a program with its variables placed; its body is queued for checking. `qualifiers` of the
        instance, such as RETAIN, are for all variables that have none."""
        decl = symbol.decl
        pou = self._pou(symbol, name)
        info = ProgramInfo(name, pou, [])
        scope = self._scope(symbol, pou)
        for block in self.declare_alike(decl, pou, scope):
            if block.keyword == "VAR_IN_OUT":
                scope.error(
                    block.pos, "unsupported", "a PROGRAM has no VAR_IN_OUT; use VAR_EXTERNAL or a global variable"
                )
            else:
                self._program_variables(block, info, scope, allocation, block.qualifiers or qualifiers)

        def place(member: str, variable: VarSymbol) -> Variable | None:
            full_name, t = f"{name}.{member}", variable.type
            placed = self.world.declarations.area_variable(full_name, t, variable.default, None, qualifiers, scope, 0)
            if placed is not None:
                allocation.add(placed)
            return placed

        self.world.classes.program(symbol, scope, place)
        self.world.add_body(scope, decl, pou, symbol.library)
        return info, scope

    def _program_variables(
        self, block: ast.VarBlock, info: ProgramInfo, scope: Scope, allocation: Allocation, qualifiers: set[str]
    ) -> None:
        declarations = self.world.declarations
        direction = DIRECTIONS.get(block.keyword)
        for line in block.decls:
            t, init = declarations.declared_type(line, scope, _PROGRAM_MAY[direction])
            self.world.classes.require_instances(t, scope, line.pos)
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, ROLES[block.keyword], default=init)
                symbol.used = direction is not None or line.location is not None
                if not declarations.add(scope, symbol, offset) or t is ERROR:
                    continue
                full_name = f"{info.name}.{name}"
                location = declarations.address(line.location, t, symbol.pos, full_name)
                symbol.variable = declarations.area_variable(full_name, t, init, location, qualifiers, scope, offset)
                if symbol.variable is None:
                    continue
                allocation.add(symbol.variable)
                if direction is not None:
                    info.parameters.append((symbol, direction))
                if line.edge:
                    last, edge = edge_variables(symbol.variable)
                    allocation.add(last)
                    allocation.add(edge)
                    see_edge(symbol, line.edge, last, edge, scope)


def interface_text(name: str, pou: Pou) -> str:
    """What the signature of a C function is made of: `name(TYPE,&TYPE):RESULT`."""
    types = (("&" if p.by_reference else "") + _interface_name(p.variable.type) for p in pou.parameters)
    result = "" if pou.result is None else ":" + _interface_name(pou.result.type)
    return f"{name}({','.join(types)}){result}"


def _interface_name(t: Type) -> str:
    if isinstance(t, StringType):
        return "STRING"
    return t.name.upper()
