"""What the program offers to components in C by {attribute 'from_c'}: functions, methods of instances, programs and
variables (docs/c-functions.md).

The runtime calls a function without parameters (IEC_ENTRY). It finds those of the program in a hidden structure, calls
it, and leaves outputs and result there.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

from plctool.compiler.semantics.declarations.functions import call_signature, layout_signature
from plctool.compiler.semantics.generics import is_generic
from plctool.compiler.semantics.symbols import NOTHING, FunctionInfo, Member, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    Call,
    CallStatement,
    Const,
    Direction,
    Export,
    Expr,
    IndexPlace,
    Load,
    MemberPlace,
    Place,
    Pos,
    Pou,
    PouKind,
    Storage,
    Variable,
    VarPlace,
)
from plctool.core import lib
from plctool.iec.types import DINT, ArrayType, Field, PointerType, StructType, Type

FROM_C = "from_c"
MOST_INSTANCES = 256  # of a block whose method is offered
_LONGEST = int(lib.APP_NAME_SIZE) - 1


def declare_exports(world: World, programs: Mapping[str, Pou]) -> list[Export]:
    """Declares what components in C find by name. `programs`: by the names of their instances."""
    exports = [
        *_variables(world),
        *_functions(world),
        *_programs(world, programs),
        *_methods(world),
    ]
    _report_others(world)
    for export in exports:
        if len(export.name) > _LONGEST or not export.name.isascii():
            message = f"a component in C finds {export.name} by its name: at most {_LONGEST} characters of ASCII"
            world.diagnostics.error(export.pos, "attribute", message)
    return exports


def declare_called_programs(world: World) -> None:
    """Declares the programs that components in C call: perhaps no task runs them."""
    for planned in world.names.planned.values():
        if FROM_C in planned.symbol.decl.attributes:
            world.declared.instance(planned)


# ---- variables ----


def _variables(world: World) -> Iterator[Export]:
    for variable in world.allocation.variables:
        if not variable.from_c:
            continue
        problem = _problem(world, variable.type)
        if variable.bit is not None:
            problem = "is a bit in a byte that it shares"
        elif variable.constant:
            problem = "is CONSTANT"
        if problem:
            _refuse(world, variable.pos, variable.name, problem)
        else:
            yield Export(variable.name, layout_signature(variable.type), variable.pos, variable)


def _problem(world: World, t: Type) -> str:
    """Why a component in C cannot use a value of the type; "" if it can."""
    if isinstance(t, ArrayType):
        return _problem(world, t.element)
    if isinstance(t, PointerType):
        return "is or has a pointer, a reference or an interface, which mean nothing outside of the program"
    if isinstance(t, StructType):
        if t in world.blocks:
            return "is or has an instance of a function block; offer its methods or variables"
        if any(f.bit is not None for f in t.fields):
            return "has a BIT"
        return next(filter(None, (_problem(world, f.type) for f in t.fields)), "")
    return ""


def _refuse(world: World, pos: Pos, name: str, problem: str) -> None:
    world.diagnostics.error(pos, "attribute", f"{name} cannot be used by components in C: it {problem}")


# ---- functions, methods, programs ----


def _functions(world: World) -> Iterator[Export]:
    for symbol in world.names.functions():
        if FROM_C not in symbol.decl.attributes:
            continue
        pos = symbol.decl.source.pos(symbol.decl.pos)
        if "external" in symbol.decl.attributes:
            _refuse(world, pos, symbol.decl.name, "is in C itself")
        elif is_generic(symbol.decl):
            _refuse(world, pos, symbol.decl.name, "takes parameters of any type")
        else:
            info = world.declared.function(symbol, {})
            values = None if info is None else _values(world, symbol.full_name, symbol.decl.name, info)
            if info is not None and values is not None:
                yield _export(world, symbol.full_name, info, values, None)


def _methods(world: World) -> Iterator[Export]:
    shared: dict[Member, Variable | None] = {}
    counts: dict[Member, int] = {}
    for variable in list(world.allocation.variables):
        if variable.storage is not Storage.AREA or variable.constant or not _is_named(variable.name):
            continue
        whole = VarPlace(variable, variable.type, variable.pos)
        for path, place, t in _instances(world, variable.name, whole, variable.type):
            for member in _offered(world, t):
                info = world.declared.member(member)
                if member not in shared:
                    shared[member] = _values(world, f"{t.name}.{member.decl.name}", member.decl.name, info)
                values = shared[member]
                counts[member] = counts.get(member, 0) + 1
                if values is not None and counts[member] <= MOST_INSTANCES:
                    yield _export(world, f"{path}.{member.decl.name}", info, values, place)
    for member, count in counts.items():
        if count > MOST_INSTANCES:
            pos = member.decl.source.pos(member.decl.pos)
            _refuse(world, pos, member.decl.name, f"is a method of {count} instances, more than {MOST_INSTANCES}")


def _is_named(name: str) -> bool:
    return all(part.isidentifier() for part in name.split("."))


def _instances(world: World, path: str, place: Place, t: Type) -> Iterator[tuple[str, Place, StructType]]:
    """The instances of function blocks in a variable, with their names."""
    if not has_methods_for_c(world, t):
        return
    if isinstance(t, ArrayType):
        for indices in product(*(range(low, high + 1) for low, high in t.bounds)):
            numbers: list[Expr] = [Const(i, DINT, place.pos) for i in indices]
            name = f"{path}[{','.join(map(str, indices))}]"
            yield from _instances(world, name, IndexPlace(place, numbers, t.element, place.pos), t.element)
    elif isinstance(t, StructType):
        if t in world.blocks:
            yield path, place, t
        for f in t.fields:
            if not f.hidden:
                member = MemberPlace(place, f.offset, f.type, place.pos)
                yield from _instances(world, f"{path}.{f.name}", member, f.type)


def has_methods_for_c(world: World, t: Type) -> bool:
    """True for a block, or an array or structure with one, that has a method which components in C call."""
    while isinstance(t, ArrayType):
        t = t.element
    if not isinstance(t, StructType):
        return False
    return bool(_offered(world, t)) or any(has_methods_for_c(world, f.type) for f in t.fields)


def _offered(world: World, t: StructType) -> list[Member]:
    """The methods with the attribute, also of the bases; of one that is overridden, what overrides it."""
    found: dict[str, Member] = {}
    top = cls = world.class_of(t) if t in world.blocks else None
    while cls is not None and top is not None:
        for key, member in cls.members.items():
            if FROM_C in member.decl.attributes and member.decl.keyword is ast.Unit.METHOD:
                found.setdefault(key, top.find(key) or member)
        cls = cls.base
    return list(found.values())


def _programs(world: World, programs: Mapping[str, Pou]) -> Iterator[Export]:
    for planned in world.names.planned.values():
        pou = programs.get(planned.name)
        if FROM_C in planned.symbol.decl.attributes and pou is not None:
            caller = Pou(planned.name, PouKind.FUNCTION, pou.pos)
            caller.body = [CallStatement(Call(pou, [], NOTHING, pou.pos), pou.pos)]
            world.pous.append(caller)
            yield Export(planned.name, call_signature([], 0), pou.pos, None, caller)


def _values(world: World, full_name: str, name: str, info: FunctionInfo) -> Variable | None:
    """The structure with parameters and result; one without members if there are none; None after an error."""
    pos = info.pou.pos
    struct = StructType(f"%call of {full_name}")
    given: list[tuple[str, VarSymbol | None, Type]] = [(s.name, s, s.type) for s, _ in info.parameters]
    if info.result is not None:
        given.append((name, None, info.result))
    for member, symbol, t in given:
        problem = "takes any type" if symbol is not None and symbol.group else _problem(world, t)
        if problem:
            _refuse(
                world, pos, f"{full_name}, {member}" if symbol is not None else f"the result of {full_name}", problem
            )
            return None
        struct.fields.append(Field(member, t))
    if len(info.pou.parameters) != len(info.parameters):
        _refuse(world, pos, full_name, "takes an array of any length")
        return None
    struct.lay_out()
    variable = Variable(struct.name, struct, Storage.AREA, pos)
    if struct.fields:
        world.allocation.add(variable)
    return variable


def _export(world: World, name: str, info: FunctionInfo, values: Variable, instance: Place | None) -> Export:
    pos, struct = info.pou.pos, values.type
    assert isinstance(struct, StructType)
    whole = VarPlace(values, struct, pos)
    places: list[Place] = [MemberPlace(whole, f.offset, f.type, pos) for f in struct.fields]
    args: list[Expr | Place | None] = [
        Load(place, place.type, pos) if direction is Direction.INPUT else place
        for (_, direction), place in zip(info.parameters, places, strict=False)
    ]
    call = Call(info.pou, args, info.result or NOTHING, pos, instance)
    caller = Pou(name, PouKind.FUNCTION, pos)
    caller.body = [Assign(places[-1], call, pos) if info.result is not None else CallStatement(call, pos)]
    world.pous.append(caller)
    if not struct.fields:
        return Export(name, call_signature([], 0), pos, None, caller)
    return Export(name, call_signature(struct.fields, struct.size), pos, values, caller)


def _report_others(world: World) -> None:
    """Variables that have no place of their own cannot have the attribute."""
    for symbol in world.names.pou_symbols():
        units = [symbol.decl, *symbol.decl.members]
        for unit in units[1:] if symbol.keyword is ast.Unit.PROGRAM else units:
            for line in (line for block in unit.blocks for line in block.decls if FROM_C in line.attributes):
                where = f"{{attribute '{FROM_C}'}} is for variables of a VAR_GLOBAL or a PROGRAM"
                world.scope_of(symbol).error(line.pos, "attribute", f"{where}, and not of {unit.name}")
