"""What makes function blocks classes: bases, interfaces, methods, actions, properties, and the numbers of classes.

The world is closed: all classes of a program are known before the first of them is declared. Instances that may stand
for those of another class carry the number of theirs in a hidden first member; all other blocks stay as they are.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from plctool.compiler.base.missing_names import known_name_like
from plctool.compiler.semantics.declarations.functions import Functions
from plctool.compiler.semantics.declarations.inheritance import Hierarchy, check_class
from plctool.compiler.semantics.declarations.type_declarations import TypeDeclarations
from plctool.compiler.semantics.instances import instances_in
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    ERROR,
    BlockInfo,
    ClassInfo,
    FunctionInfo,
    Member,
    MemberSymbol,
    PouSymbol,
    Role,
    VarSymbol,
)  # fmt: skip
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Initial, Pou, PouKind, ScalarInit, Storage, Variable
from plctool.iec.types import CLASS_NUMBER, UDINT, EnumType, Field, InterfaceType, Keep, StructType

_LASTING = {ast.Section.VAR_INST: Role.LOCAL, ast.Section.STEP: Role.STEP}  # keywords of blocks in members


def _named(interfaces: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Without the interface that __QUERYINTERFACE needs elsewhere; here every instance can be asked."""
    return ((offset, name) for offset, name in interfaces if name.casefold() != "__system.iqueryinterface")


def _is_enumeration_value(symbol: VarSymbol) -> bool:
    """Whether a name is that of a value, as `Idle` of `state : (Idle, Run);`"""
    return isinstance(symbol.type, EnumType) and symbol.value is not None and symbol.name in symbol.type.values


def _name_in_c(block: ast.PouDecl, member: str) -> str:
    """The C function of the body (`main`) or a method of a block that is written in C."""
    return f"{block.attributes['external']}__{member}"


class Classes:
    """Declares classes and interfaces when they are first referred to."""

    def __init__(self, world: World, types: TypeDeclarations, functions: Functions) -> None:
        self._world = world
        self._types = types
        self._functions = functions
        self._interfaces: dict[PouSymbol, InterfaceType] = {}
        self._programs: list[ClassInfo] = []
        self._complete: set[ClassInfo] = set()
        self._hierarchy = Hierarchy(world)
        self._blocks: dict[PouSymbol, ClassInfo] = {}

    # ---- declaring ----

    def begin_block(self, symbol: PouSymbol, info: BlockInfo, scope: Scope, defaults: dict[str, Initial]) -> None:
        """Gives a block that is being declared what it inherits, and its class number."""
        decl = symbol.decl
        cls = ClassInfo(symbol, decl.full_name, info.type, info, number=self._hierarchy.numbers.get(symbol, 0))
        info.cls = self._blocks[symbol] = scope.cls = cls
        scope.outer = cls.names
        base = self._base(symbol, scope)
        if base is not None and base.cls is not None:
            cls.base = base.cls
            self._inherit(info, base, defaults, scope)
        elif cls.number:
            info.type.fields.append(Field(CLASS_NUMBER, UDINT))
        if cls.number:
            defaults[CLASS_NUMBER] = ScalarInit(cls.number)
        for offset, name in _named(decl.interfaces):
            interface = self._interface_named(offset, name, scope)
            if interface is not None:
                cls.interfaces.append(interface)
                info.type.of_unknown = info.type.of_unknown or interface.inherits_unknown
            else:
                info.type.of_unknown = True
        info.type.interfaces = [i.type for i in cls.all_interfaces() if i.type is not None]
        self._add_members(cls)
        info.type.properties = sorted({m.decl.name for m in cls.members.values() if m.is_property})
        if info.type.base is not None:
            info.type.properties += info.type.base.properties

    def _base(self, symbol: PouSymbol, scope: Scope) -> BlockInfo | None:
        bases = symbol.decl.bases
        if not bases:
            return None
        if len(bases) > 1:
            scope.error(bases[1][0], "inheritance", "a function block extends one other; use IMPLEMENTS for interfaces")
        offset, name = bases[0]
        base = scope.unit(name)
        if base is not None and not scope.may_use(base, name, offset):
            return None
        if isinstance(base, PouSymbol) and base.keyword is ast.Unit.FUNCTION_BLOCK:
            info = self._world.declared.block(base)
            if info is None:
                scope.error(offset, "recursion", f"{symbol.decl.name} extends itself: {self._hierarchy.circle(symbol)}")
            elif ast.Modifier.FINAL in base.decl.modifiers:
                scope.error(offset, "inheritance", f"{name} is FINAL and cannot be extended")
            elif "external" in base.decl.attributes:
                advice = f"declare a variable of it in {symbol.decl.name}"
                scope.error(offset, "inheritance", f"{name} is written in C and cannot be extended; {advice}")
            return info
        if isinstance(base, PouSymbol) and base.keyword is ast.Unit.INTERFACE:
            scope.error(offset, "inheritance", f"{name} is an interface; write IMPLEMENTS {name}")
        else:
            scope.lacks(symbol.decl.full_name)
            assert scope.cls is not None and scope.cls.type is not None
            scope.cls.of_unknown = scope.cls.type.of_unknown = True
            self._no_such(offset, name, scope, "function block", self._world.names.block_names(), base is None)
        return None

    def _no_such(self, offset: int, name: str, scope: Scope, what: str, names: list[str], unknown: bool) -> None:
        if unknown:
            hint = known_name_like(name, names)
            if hint:
                scope.error(offset, "unknown", f"unknown {what} {name}{hint}")
            else:
                scope.missing(offset, name, f"unknown {what} {name}")
        else:
            scope.error(offset, "type", f"{name} is not {'an' if what[0] in 'aeiou' else 'a'} {what}")

    def _inherit(self, info: BlockInfo, base: BlockInfo, defaults: dict[str, Initial], scope: Scope) -> None:
        info.type.base = base.type
        if scope.is_incomplete(base.type.name):
            scope.lacks(info.type.name)
        info.type.fields += [Field(f.name, f.type, keep=f.keep) for f in base.type.fields]
        info.members |= base.members
        info.retain = base.retain
        info.pou.parameters += base.pou.parameters
        inherited = self._world.defaults.get(base.type.name)
        if inherited is not None:
            defaults.update(inherited.members)
        assert info.cls is not None and base.cls is not None
        private = {
            k for k, s in base.cls.names.items() if isinstance(s, VarSymbol) and s.access is ast.Modifier.PRIVATE
        }
        info.cls.names.update((k, s) for k, s in base.cls.names.items() if k not in private)

    def _add_members(self, cls: ClassInfo) -> None:
        for decl in cls.symbol.decl.members:
            key = decl.member_key
            if key in cls.members:
                pos = decl.source.pos(decl.pos)
                self._world.diagnostics.error(pos, "duplicate", f"{cls.name} has a {decl.keyword} {decl.name} already")
                continue
            cls.members[key] = Member(decl, cls)
            cls.names[decl.name.casefold()] = MemberSymbol(decl.name)

    def instance_variables(self, info: BlockInfo, defaults: dict[str, Initial], scope: Scope) -> None:
        """VAR_INST of methods, and the steps of charts in actions: hidden members of the instance."""
        assert info.cls is not None
        for full_name, symbol in self._lasting(info.cls, scope):
            info.make_way(full_name, defaults)
            symbol.variable = Variable(full_name, symbol.type, Storage.SELF, symbol.pos, initial=symbol.default)
            info.members[full_name.casefold()] = symbol
            info.type.fields.append(Field(full_name, symbol.type, keep=symbol.keep))
            info.retain = info.retain or symbol.keep.kept
            if symbol.default is not None:
                defaults[full_name] = symbol.default

    def _lasting(self, cls: ClassInfo, scope: Scope) -> Iterator[tuple[str, VarSymbol]]:
        """The variables of members that last as long as the instance, as `member.variable`."""
        for key, member in cls.members.items():
            for block in member.decl.blocks:
                role = _LASTING.get(block.keyword)
                for line in block.decls if role is not None else []:
                    assert role is not None
                    t, default = self._types.declared_type(line, scope)
                    for offset, name in line.names:
                        symbol = VarSymbol(name, scope.pos(offset), t, role, default=default)
                        symbol.keep = Keep.of(block.qualifiers)
                        cls.instance_variables.setdefault(key, {})[name.casefold()] = symbol
                        if t is not ERROR:
                            yield f"{key}.{name}", symbol

    def end_block(self, info: BlockInfo, scope: Scope) -> None:
        """The variables of a block are declared: its members see them."""
        cls = info.cls
        assert cls is not None
        inherited = cls.base.block.members if cls.base is not None and cls.base.block is not None else {}
        own = {member.decl.name.casefold() for member in cls.members.values()}
        for key, symbol in info.members.items():
            known = inherited.get(key) is symbol and (symbol.access is ast.Modifier.PRIVATE or key not in own)
            if "." not in key and not known:
                self._see(cls, key, symbol)
        cls.names.update(scope.edges)

    def in_c(self, info: BlockInfo, scope: Scope) -> None:
        """Makes a block whose variables are declared one whose body is implemented in C."""
        assert info.cls is not None
        decl = info.cls.symbol.decl
        self._functions.set_external(info.pou, _name_in_c(decl, "main"), decl.attributes, scope)

    def _see(self, cls: ClassInfo, key: str, symbol: VarSymbol) -> None:
        other = cls.names.get(key)
        if isinstance(other, MemberSymbol) and _is_enumeration_value(symbol):
            return  # the member comes first; where the enumeration is wanted, its value does
        if isinstance(other, MemberSymbol):
            message = f"{symbol.name} is a variable of {cls.name} and a method, action or property as well"
            self._world.diagnostics.error(symbol.pos, "duplicate", message)
            return
        if isinstance(other, VarSymbol) and other.pos == symbol.pos:
            return  # inherited; for an input with R_EDGE that is its edge
        if isinstance(other, VarSymbol) and other.role is not Role.TEMP:
            where = f"{other.name} in line {other.pos.line}"
            message = f"{symbol.name} is inherited already: {where}"
            self._world.diagnostics.error(symbol.pos, "duplicate", message)
        cls.names[key] = symbol

    def program(
        self, symbol: PouSymbol, scope: Scope, place: Callable[[str, VarSymbol], Variable | None]
    ) -> ClassInfo | None:
        """The actions and methods of a program instance whose variables are declared; None when it has none. `place`
        makes a variable of the instance."""
        if not symbol.decl.members:
            return None
        assert scope.pou is not None
        cls = ClassInfo(symbol, scope.pou.name)
        self._add_members(cls)
        for full_name, lasting in self._lasting(cls, scope):
            lasting.variable = place(full_name, lasting)
        for key, variable in scope.names.items():
            if isinstance(variable, VarSymbol) and variable.role is not Role.TEMP:
                self._see(cls, key, variable)
        cls.names.update(scope.edges)
        scope.outer, scope.cls = cls.names, cls
        self._programs.append(cls)
        return cls

    def interface(self, symbol: PouSymbol) -> InterfaceType:
        """The type of variables of an interface."""
        known = self._interfaces.get(symbol)
        if known is not None:
            return known
        decl, scope = symbol.decl, self._world.scope_of(symbol)
        target = StructType(decl.full_name)
        cls = ClassInfo(symbol, decl.full_name, target)
        t = self._interfaces[symbol] = InterfaceType(target)
        self._world.interfaces[target] = cls
        self._add_members(cls)
        for offset, name in _named(decl.bases):
            base = self._interface_named(offset, name, scope)
            if base is None:
                cls.of_unknown = target.of_unknown = True
            elif base is cls or cls in base.all_interfaces():
                scope.error(offset, "recursion", f"{decl.name} extends itself through {name}")
            else:
                cls.interfaces.append(base)
                target.of_unknown = target.of_unknown or base.inherits_unknown
        target.interfaces = [i.type for i in cls.all_interfaces() if i.type is not None]
        return t

    def _interface_named(self, offset: int, name: str, scope: Scope) -> ClassInfo | None:
        symbol = scope.unit(name)
        if symbol is not None and not scope.may_use(symbol, name, offset):
            return None
        if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.INTERFACE:
            return self._world.interfaces[self.interface(symbol).target]  # type: ignore[index]
        self._no_such(offset, name, scope, "interface", self._world.names.interface_names(), symbol is None)
        return None

    def signature(self, member: Member) -> FunctionInfo:
        """A member ready to be called; its body is queued for checking."""
        if member.info is not None:
            return member.info
        cls, decl = member.owner, member.decl
        suffix = f".{decl.keyword.capitalize()}" if member.is_property else ""
        kind = PouKind.FUNCTION if cls.type is None else PouKind.METHOD
        pou = Pou(member.name + suffix, kind, decl.source.pos(decl.pos), instance=cls.type)
        pou.checks = "no_checks" not in decl.attributes
        info = member.info = FunctionInfo(pou, [], None, decl.attributes)
        scope = self._world.scope_of(cls.symbol)
        scope.pou, scope.cls, scope.outer = pou, cls, cls.names
        if decl.namespace is not None:
            scope.use(decl.namespace.using)
        scope.names.update(cls.instance_variables.get(decl.member_key, {}))
        self._functions.signature(info, decl, scope)
        if "external" in cls.symbol.decl.attributes:
            self._functions.set_external(pou, _name_in_c(cls.symbol.decl, decl.name), cls.symbol.decl.attributes, scope)
        elif not member.abstract:
            self._world.bodies.add(scope, decl)
        elif decl.body:
            reason = "belongs to an INTERFACE" if cls.is_interface else "is ABSTRACT"
            scope.error(decl.pos, "inheritance", f"{member.name} has no body, because it {reason}")
        return info

    def declare_members(self) -> None:
        """Declares the members of everything known so far, used or not, so that all of it is checked."""
        for symbol in self._world.names.pou_symbols():
            if symbol.keyword is ast.Unit.INTERFACE:
                self.interface(symbol)
        classes = [*self._world.interfaces.values(), *self._blocks.values(), *self._programs]
        new = [cls for cls in classes if cls not in self._complete]
        self._complete.update(new)
        for cls in new:
            for member in cls.members.values():
                self.signature(member)
        for cls in new:
            check_class(self._world, cls)

    def find_targets(self, variables: Iterable[Variable]) -> None:
        """Finds the targets of all calls that depend on a class: of those that have instances among the variables."""
        present = {t for v in variables for t in instances_in(v.type)}
        self._world.dispatches.find_targets(
            (cls for cls in self._blocks.values() if cls.type in present), self.signature
        )
