"""What makes function blocks classes: bases, interfaces, methods, actions, properties, and the numbers of classes.

The world is closed: all classes of a program are known before the first of them is declared. Instances that may stand
for those of another class carry the number of theirs in a hidden first member; all other blocks stay as they are.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.class_rules import check_class
from plctool.compiler.semantics.hierarchy import Hierarchy
from plctool.compiler.semantics.queries import Queries
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
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Dispatch, Initial, Pos, Pou, PouKind, ScalarInit, Storage, Variable
from plctool.compiler.types import UDINT, ArrayType, Field, InterfaceType, StructType, Type

if TYPE_CHECKING:
    from plctool.compiler.semantics.world import World

_LASTING = {"VAR_INST": Role.LOCAL, "STEP": Role.STEP}  # keywords of blocks in members
CLASS_NUMBER = "%class"  # the hidden member; no identifier, so nothing else can have its name


def member_key(decl: ast.PouDecl) -> str:
    """Under which a member is found; a property has two."""
    name = decl.name.casefold()
    return f"{name}.{decl.keyword.lower()}" if decl.keyword in ("GET", "SET") else name


def _named(interfaces: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Without the interface that __QUERYINTERFACE needs elsewhere; here every instance can be asked."""
    return ((offset, name) for offset, name in interfaces if name.casefold() != "__system.iqueryinterface")


def instances_in(t: Type) -> Iterator[StructType]:
    """The structs and function blocks that a variable of the type consists of."""
    while isinstance(t, ArrayType):
        t = t.element
    if isinstance(t, StructType):
        yield t
        for f in t.fields:
            yield from instances_in(f.type)


class Classes:
    """Declares classes and interfaces when they are first referred to."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.interface_infos: dict[StructType, ClassInfo] = {}
        self.used = False  # whether anything has methods, actions or properties
        self._interfaces: dict[PouSymbol, InterfaceType] = {}
        self._programs: list[ClassInfo] = []
        self._complete: set[ClassInfo] = set()
        self.hierarchy = Hierarchy(world)
        self.queries = Queries()
        self._blocks: dict[PouSymbol, ClassInfo] = {}
        self._dispatches: dict[tuple[ClassInfo, str], Dispatch] = {}
        self._own_calls: list[tuple[Pou, Dispatch, Pos]] = []
        self._other_calls: list[tuple[Pou, Pou, Dispatch | None, Pos]] = []

    # ---- declaring ----

    def scope_of(self, symbol: PouSymbol) -> Scope:
        """The surroundings of a unit: its source and namespace."""
        scope = self.world.scope(symbol.decl.source, library=symbol.library)
        scope.enter(symbol.decl.namespace)
        return scope

    def begin_block(self, symbol: PouSymbol, info: BlockInfo, scope: Scope, defaults: dict[str, Initial]) -> None:
        """Gives a block that is being declared what it inherits, and its class number."""
        decl = symbol.decl
        cls = ClassInfo(symbol, decl.full_name, info.type, info, number=self.hierarchy.numbers.get(symbol, 0))
        info.cls = self._blocks[symbol] = scope.cls = cls
        scope.outer = cls.names
        base = self._base(symbol, scope)
        if base is not None and base.cls is not None:
            cls.base = base.cls
            self._inherit(info, base, defaults)
        elif cls.number:
            info.type.fields.append(Field(CLASS_NUMBER, UDINT))
        if cls.number:
            defaults[CLASS_NUMBER] = ScalarInit(cls.number)
        for offset, name in _named(decl.interfaces):
            interface = self._interface_named(offset, name, scope)
            if interface is not None:
                cls.interfaces.append(interface)
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
        if isinstance(base, PouSymbol) and base.keyword == "FUNCTION_BLOCK":
            info = self.world.units.block(base)
            if info is None:
                scope.error(offset, "recursion", f"{symbol.decl.name} extends itself: {self.hierarchy.circle(symbol)}")
            elif "FINAL" in base.decl.modifiers:
                scope.error(offset, "inheritance", f"{name} is FINAL and cannot be extended")
            return info
        if isinstance(base, PouSymbol) and base.keyword == "INTERFACE":
            scope.error(offset, "inheritance", f"{name} is an interface; write IMPLEMENTS {name}")
        else:
            self._no_such(offset, name, scope, "function block", base is None)
        return None

    def _no_such(self, offset: int, name: str, scope: Scope, what: str, unknown: bool) -> None:
        if unknown:
            hint = did_you_mean(name, self.world.type_names())
            scope.error(offset, "unknown", f"unknown {what} {name}{hint}")
        else:
            scope.error(offset, "type", f"{name} is not {'an' if what[0] in 'aeiou' else 'a'} {what}")

    def _inherit(self, info: BlockInfo, base: BlockInfo, defaults: dict[str, Initial]) -> None:
        info.type.base = base.type
        info.type.fields += [Field(f.name, f.type) for f in base.type.fields]
        info.members |= base.members
        info.retain = base.retain
        info.pou.parameters += base.pou.parameters
        inherited = self.world.defaults.get(base.type.name)
        if inherited is not None:
            defaults.update(inherited.members)
        assert info.cls is not None and base.cls is not None
        private = {k for k, s in base.cls.names.items() if isinstance(s, VarSymbol) and s.access == "PRIVATE"}
        info.cls.names.update((k, s) for k, s in base.cls.names.items() if k not in private)

    def _add_members(self, cls: ClassInfo) -> None:
        for decl in cls.symbol.decl.members:
            key = member_key(decl)
            if key in cls.members:
                pos = decl.source.pos(decl.pos)
                self.world.diagnostics.error(pos, "duplicate", f"{cls.name} has a {decl.keyword} {decl.name} already")
                continue
            cls.members[key] = Member(decl, cls)
            cls.names[decl.name.casefold()] = MemberSymbol(decl.name)

    def instance_variables(self, info: BlockInfo, defaults: dict[str, Initial], scope: Scope) -> None:
        """VAR_INST of methods, and the steps of charts in actions: hidden members of the instance."""
        assert info.cls is not None
        for full_name, symbol in self._lasting(info.cls, scope):
            symbol.variable = Variable(full_name, symbol.type, Storage.SELF, symbol.pos, initial=symbol.default)
            info.members[full_name.casefold()] = symbol
            info.type.fields.append(Field(full_name, symbol.type))
            if symbol.default is not None:
                defaults[full_name] = symbol.default

    def _lasting(self, cls: ClassInfo, scope: Scope) -> Iterator[tuple[str, VarSymbol]]:
        """The variables of members that last as long as the instance, as `member.variable`."""
        for key, member in cls.members.items():
            for block in member.decl.blocks:
                role = _LASTING.get(block.keyword)
                for line in block.decls if role is not None else []:
                    assert role is not None
                    t, default = self.world.declarations.declared_type(line, scope)
                    for offset, name in line.names:
                        symbol = VarSymbol(name, scope.pos(offset), t, role, default=default)
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
            known = inherited.get(key) is symbol and (symbol.access == "PRIVATE" or key not in own)
            if "." not in key and not known:
                self._see(cls, key, symbol)
        cls.names.update(scope.edges)

    def _see(self, cls: ClassInfo, key: str, symbol: VarSymbol) -> None:
        other = cls.names.get(key)
        if isinstance(other, MemberSymbol):
            message = f"{symbol.name} is a variable of {cls.name} and a method, action or property as well"
            self.world.diagnostics.error(symbol.pos, "duplicate", message)
            return
        if isinstance(other, VarSymbol) and other.pos == symbol.pos:
            return  # inherited; for an input with R_EDGE that is its edge
        if isinstance(other, VarSymbol) and other.role is not Role.TEMP:
            where = f"{other.name} in line {other.pos.line}"
            message = f"{symbol.name} is inherited already: {where}"
            self.world.diagnostics.error(symbol.pos, "duplicate", message)
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
        decl, scope = symbol.decl, self.scope_of(symbol)
        target = StructType(decl.full_name)
        cls = ClassInfo(symbol, decl.full_name, target)
        t = self._interfaces[symbol] = InterfaceType(target)
        self.interface_infos[target] = cls
        self._add_members(cls)
        for offset, name in _named(decl.bases):
            base = self._interface_named(offset, name, scope)
            if base is not None and (base is cls or cls in base.all_interfaces()):
                scope.error(offset, "recursion", f"{decl.name} extends itself through {name}")
            elif base is not None:
                cls.interfaces.append(base)
        target.interfaces = [i.type for i in cls.all_interfaces() if i.type is not None]
        return t

    def _interface_named(self, offset: int, name: str, scope: Scope) -> ClassInfo | None:
        symbol = scope.unit(name)
        if symbol is not None and not scope.may_use(symbol, name, offset):
            return None
        if isinstance(symbol, PouSymbol) and symbol.keyword == "INTERFACE":
            return self.interface_infos[self.interface(symbol).target]  # type: ignore[index]
        self._no_such(offset, name, scope, "interface", symbol is None)
        return None

    def class_of(self, t: Type) -> ClassInfo | None:
        """The class of instances of a function block type or behind an interface."""
        if not isinstance(t, StructType):
            return None
        block = self.world.blocks.get(t)
        return block.cls if block is not None else self.interface_infos.get(t)

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
        scope = self.scope_of(cls.symbol)
        scope.pou, scope.cls, scope.outer = pou, cls, cls.names
        if decl.namespace is not None:
            scope.use(decl.namespace.using)
        scope.names.update(cls.instance_variables.get(member_key(decl), {}))
        self.world.units.signature(info, decl, scope)
        if not member.abstract:
            self.world.add_body(scope, decl, pou, cls.symbol.library)
        elif decl.body:
            scope.error(decl.pos, "inheritance", f"{member.name} has no body, because it is ABSTRACT")
        return info

    def declare_members(self) -> None:
        """Declares the members of everything known so far, used or not, so that all of it is checked."""
        for symbol in self.world.pou_symbols():
            if symbol.keyword == "INTERFACE":
                self.interface(symbol)
        classes = [*self.interface_infos.values(), *self._blocks.values(), *self._programs]
        new = [cls for cls in classes if cls not in self._complete]
        self._complete.update(new)
        for cls in new:
            for member in cls.members.values():
                self.signature(member)
        for cls in new:
            check_class(self, cls)

    # ---- calls of what is only known when it runs ----

    def dispatch(self, cls: ClassInfo, key: str, function: Pou) -> Dispatch | None:
        """For a call of the member `key`, or of the body for "", of an instance of `cls` or of a class that conforms;
        None when there is only `cls`."""
        if not cls.is_interface and not cls.number:
            return None
        return self._dispatches.setdefault((cls, key), Dispatch(function))

    def note_own_call(self, caller: Pou | None, dispatch: Dispatch, pos: Pos) -> None:
        """A call on the own instance, which counts as recursion when it leads back."""
        if caller is not None:
            self._own_calls.append((caller, dispatch, pos))

    def note_other_call(self, caller: Pou | None, function: Pou, dispatch: Dispatch | None, pos: Pos) -> None:
        """A call on an instance behind a pointer, which may be the own one or not."""
        if caller is not None:
            self._other_calls.append((caller, function, dispatch, pos))

    def finish(self, variables: Iterable[Variable]) -> None:
        """Finds the targets of all dispatches: of classes that have instances among the variables."""
        present = {t for v in variables for t in instances_in(v.type)}
        self.queries.finish(cls for cls in self._blocks.values() if cls.number and cls.type in present)
        for (cls, key), dispatch in self._dispatches.items():
            for other in self._blocks.values():
                if other.type not in present or cls.type is None or not other.type.conforms(cls.type):
                    continue
                assert other.block is not None
                member = other.find(key) if key else None
                if not key:
                    dispatch.targets[other.number] = other.block.pou
                elif member is not None and not member.abstract:
                    dispatch.targets[other.number] = self.signature(member).pou
        for caller, dispatch, pos in self._own_calls:
            for target in dispatch.targets.values():
                self.world.calls.add(caller, target, pos)
        for caller, function, dispatch_of, pos in self._other_calls:
            targets = [function] if dispatch_of is None else list(dispatch_of.targets.values())
            if caller in targets:
                message = f"{caller.name} may call itself here: the calls have to fit the stack of the controller"
                self.world.diagnostics.warning(pos, "recursion", message)

    # ---- instances ----

    def require_instances(self, t: Type, scope: Scope, offset: int) -> None:
        """Reports a variable of an ABSTRACT function block."""
        while isinstance(t, ArrayType):
            t = t.element
        cls = self.class_of(t)
        if cls is not None and cls.abstract:
            message = f"{cls.name} is ABSTRACT and has no instances; declare one of a function block that extends it"
            scope.error(offset, "inheritance", message)

    def initialisers(self, t: StructType) -> list[Member]:
        """The FB_Init methods of a block, that of the base first."""
        return list(reversed(self._each(t, "fb_init")))

    def finalisers(self, t: StructType) -> list[Member]:
        """The FB_Exit methods of a block, that of the base last."""
        return self._each(t, "fb_exit")

    def _each(self, t: StructType, key: str) -> list[Member]:
        """The methods of that name of a block and of its bases."""
        found: list[Member] = []
        cls = self.class_of(t)
        while cls is not None:
            if key in cls.members:
                found.append(cls.members[key])
            cls = cls.base
        return found
