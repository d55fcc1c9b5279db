"""Inheritance: which function block extends which, the numbers of classes, and what a class has to keep to.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from itertools import count

from plctool.compiler.semantics.conversions import same_type
from plctool.compiler.semantics.instances import INITIALISERS
from plctool.compiler.semantics.symbols import ERROR, ClassInfo, Member, PouSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.errors import listed
from plctool.iec.types import BOOL

# ---- who extends whom ----


class Hierarchy:
    """All function blocks of a program, and those of the library they extend."""

    def __init__(self, world: World) -> None:
        self._world = world

    @cached_property
    def _derived(self) -> dict[PouSymbol, list[PouSymbol]]:
        """The blocks derived directly from a block; roots are among the keys."""
        derived: dict[PouSymbol, list[PouSymbol]] = {}
        todo = [s for s in self._world.names.pou_symbols() if s.keyword is ast.Unit.FUNCTION_BLOCK]
        seen = set(todo)
        while todo:
            symbol = todo.pop(0)
            base = self.base_of(symbol)
            if base is None:
                derived.setdefault(symbol, [])
                continue
            derived.setdefault(base, []).append(symbol)
            if base not in seen:
                seen.add(base)
                todo.append(base)
        return derived

    def base_of(self, symbol: PouSymbol) -> PouSymbol | None:
        """The block it is derived from directly."""
        for _, name in symbol.decl.bases[:1]:
            base = self._world.scope_of(symbol).unit(name)
            if isinstance(base, PouSymbol) and base.keyword is ast.Unit.FUNCTION_BLOCK:
                return base
        return None

    @cached_property
    def numbers(self) -> dict[PouSymbol, int]:
        """Of the classes that may stand for others: derived, extended or with interfaces. What is derived from itself
        has none."""
        numbers: dict[PouSymbol, int] = {}
        for root in [s for s in self._derived if self.base_of(s) is None]:
            family, todo = list[PouSymbol](), [root]
            while todo:
                symbol = todo.pop()
                family.append(symbol)
                todo += reversed(self._derived.get(symbol, []))
            if len(family) > 1 or any(s.decl.interfaces for s in family):
                numbers.update(zip(family, range(len(numbers) + 1, len(numbers) + 1 + len(family)), strict=True))
        previous = self._world.previous
        return numbers if previous is None else _as_before(numbers, previous.classes)

    def circle(self, symbol: PouSymbol) -> str:
        """`A extends B extends A`"""
        names, at = [symbol.decl.name], self.base_of(symbol)
        while at is not None and at.decl.name not in names:
            names.append(at.decl.name)
            at = self.base_of(at)
        return " extends ".join([*names, at.decl.name if at is not None else "?"])


def _as_before(classes: Iterable[PouSymbol], before: Mapping[str, int]) -> dict[PouSymbol, int]:
    """The numbers that classes have in the program that runs, whose instances stay; new ones get others."""
    had = {name.casefold(): number for name, number in before.items()}
    unused = count(max(had.values(), default=0) + 1)
    keys = {symbol: symbol.decl.full_name.casefold() for symbol in classes}
    return {symbol: had[key] if key in had else next(unused) for symbol, key in keys.items()}


# ---- overriding, abstract methods, interfaces ----


def check_class(world: World, cls: ClassInfo) -> None:
    """Reports what is wrong with the members of a class and what is missing."""
    for key, member in cls.members.items():
        inherited = cls.base.find(key) if cls.base is not None else None
        if inherited is not None and key not in INITIALISERS:
            _check_override(world, member, inherited)
        elif ast.Modifier.OVERRIDE in member.decl.modifiers and not _may_be_inherited(cls, key):
            names = cls.base.member_names() if cls.base is not None else []
            hint = did_you_mean(member.decl.name, names)
            _error(world, member, f"{member.name} overrides nothing{hint}")
        if key == "fb_exit":
            _check_exit(world, member)
        if member.is_property:
            _check_accessors(world, member, key)
        if member.abstract and not cls.abstract:
            _error(world, member, f"{member.name} is ABSTRACT, so {cls.name} has to be ABSTRACT as well")
    if not cls.is_interface:
        _check_interfaces(world, cls)
        if not cls.abstract and cls.base is not None:
            _check_complete(world, cls)


def _may_be_inherited(cls: ClassInfo, key: str) -> bool:
    """True if an interface has the member, or an unknown base or interface may have it."""
    unknown = cls.inherits_unknown or (cls.type is not None and cls.type.of_unknown)
    return unknown or any(key in i.members for i in cls.all_interfaces())


def _check_exit(world: World, member: Member) -> None:
    """The runtime calls it, and tells nothing but whether the instance moves."""
    parameters = [(symbol.name.casefold(), symbol.type) for symbol, _ in world.declared.member(member).parameters]
    if parameters not in ([], [("bincopycode", BOOL)]):
        _error(world, member, f"{member.name} may only have the input bInCopyCode : BOOL")


def _check_accessors(world: World, member: Member, key: str) -> None:
    """What is read is what was written: GET and SET have one type, also when one of them is inherited."""
    name, _, kind = key.rpartition(".")
    get, set_ = member.owner.find(f"{name}.get"), member.owner.find(f"{name}.set")
    if get is None or set_ is None or (kind == "get" and set_.owner is member.owner):
        return
    read, written = world.declared.member(get).result, world.declared.member(set_).parameters[0][0].type
    if read is not None and ERROR not in (read, written) and not same_type(read, written):
        _error(world, member, f"the GET of {member.decl.name} gives {read}, its SET takes {written}; use one type")


def _check_override(world: World, member: Member, inherited: Member) -> None:
    if ast.Modifier.FINAL in inherited.decl.modifiers:
        _error(world, member, f"{inherited.name} is FINAL and cannot be overridden")
    elif ast.Modifier.PRIVATE in inherited.decl.modifiers:
        _error(world, member, f"{inherited.name} is PRIVATE and cannot be overridden; choose another name")
    else:
        _check_signature(world, member, inherited)


def _check_signature(world: World, member: Member, wanted: Member) -> None:
    """The same parameters and result, as calls through the base or interface need it."""
    own, other = _signature_text(world, member), _signature_text(world, wanted)
    a, b = world.declared.member(member), world.declared.member(wanted)
    same = len(a.parameters) == len(b.parameters) and (a.result is None) == (b.result is None)
    if same and a.result is not None and b.result is not None:
        same = same_type(a.result, b.result)
    for (x, x_direction), (y, y_direction) in zip(a.parameters, b.parameters, strict=False):
        same = same and x.name.casefold() == y.name.casefold()
        same = same and x_direction is y_direction and same_type(x.type, y.type)
    if not same:
        _error(world, member, f"{member.name} has to be declared as in {wanted.owner.name}: {other}, not {own}")


def _signature_text(world: World, member: Member) -> str:
    """`m(x : INT; VAR_IN_OUT y : REAL) : BOOL`"""
    info = world.declared.member(member)
    words = [
        f"{'' if direction.value == 'VAR_INPUT' else direction.value + ' '}{symbol.name} : {symbol.type}"
        for symbol, direction in info.parameters
    ]
    return f"{member.decl.name}({'; '.join(words)})" + (f" : {info.result}" if info.result is not None else "")


def _check_interfaces(world: World, cls: ClassInfo) -> None:
    for interface in cls.all_interfaces():
        missing = []
        for key, wanted in interface.members.items():
            member = cls.find(key)
            if (member is None or member.owner.is_interface) and cls.inherits_unknown:
                continue
            if member is None or member.owner.is_interface:
                missing.append(_described(wanted))
            elif member.owner is cls or interface in cls.interfaces:
                _check_implementation(world, member, wanted)
        if missing and not cls.abstract:
            pos = cls.symbol.decl.source.pos(cls.symbol.decl.pos)
            message = f"{cls.name} does not implement {listed(missing)} of {interface.name}"
            world.diagnostics.error(pos, "inheritance", message)


def _check_implementation(world: World, member: Member, wanted: Member) -> None:
    hidden = member.decl.modifiers & {ast.Modifier.PRIVATE, ast.Modifier.PROTECTED}
    if hidden:
        _error(world, member, f"{member.name} implements {wanted.name}, so it cannot be {hidden.pop()}")
    _check_signature(world, member, wanted)


def _check_complete(world: World, cls: ClassInfo) -> None:
    """What bases leave open has to be there."""
    missing: dict[str, str] = {}
    base = cls.base
    while base is not None:
        for key, member in base.members.items():
            found = cls.find(key)
            if member.abstract and found is not None and found.abstract:
                missing[key] = _described(member)
        base = base.base
    if missing:
        pos = cls.symbol.decl.source.pos(cls.symbol.decl.pos)
        message = f"{cls.name} has to implement {listed(missing.values())}, or to be ABSTRACT"
        world.diagnostics.error(pos, "inheritance", message)


def _described(member: Member) -> str:
    return f"{member.decl.keyword} of {member.decl.name}" if member.is_property else member.decl.name


def _error(world: World, member: Member, message: str) -> None:
    world.diagnostics.error(member.decl.source.pos(member.decl.pos), "inheritance", message)
