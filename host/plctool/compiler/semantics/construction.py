"""What has to run when the application starts: initial values that are not constant, and FB_Init of every instance,
first of the members, then of the instance that holds them. And when it ends: FB_Exit, the other way round.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Mapping
from zlib import crc32

from plctool.compiler.semantics.conversions import whole
from plctool.compiler.semantics.instances import (
    COPY_CODE,
    INIT_RETAINS,
    finalisers,
    initialisers,
    instances_in,
    path_members,
    starters,
)
from plctool.compiler.semantics.symbols import NOTHING, Member
from plctool.compiler.semantics.world import Pool, World
from plctool.compiler.typed.kept import is_kept
from plctool.compiler.typed.nodes import (
    AddressOf,
    ArrayInit,
    Assign,
    Binary,
    BinaryOp,
    Call,
    CallStatement,
    ComputedInit,
    Const,
    Direction,
    Expr,
    For,
    If,
    IndexPlace,
    Initial,
    Load,
    MemberPlace,
    Node,
    Parameter,
    Place,
    Pos,
    Pou,
    PouKind,
    ScalarInit,
    SelfPlace,
    Statement,
    Storage,
    StructInit,
    Unary,
    UnaryOp,
    Variable,
    VarPlace,
    array_runs,
    member_place,
    overlay,
    runtime_function,
)
from plctool.compiler.typed.typed_nodes import rewrite
from plctool.iec.areas import Area
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    UDINT,
    ArrayType,
    Keep,
    RawPointerType,
    StringType,
    StructType,
    Type,
)

_LOOP_FROM = 4  # equal elements that are worth a loop


def construct(world: World) -> tuple[Pou | None, Pou | None]:
    """Makes the routines that begin and end the life of all global instances, where there is something to do, and lets
    units begin with the FB_Init of instances among their own variables, which live for one call."""
    start = Pou("FB_Init", PouKind.FUNCTION, Pos("", 1, 1))
    flag = Variable("init_retains", BOOL, Storage.LOCAL, start.pos)
    start.parameters.append(Parameter(flag, Direction.INPUT))
    builder = Construction(world, start, Load(VarPlace(flag, BOOL, start.pos), BOOL, start.pos))
    pools = {pool.elements for pool in world.pools.values()}
    variables = [variable for variable in world.allocation.variables if variable not in pools]
    for variable in variables:
        start.body += builder.variable(variable)
    if start.body:
        world.pous.append(start)
    for pou in world.pous:
        if pou is not start:
            local = Construction(world, pou, Const(1, BOOL, pou.pos))
            pou.body = [s for v in list(pou.locals) for s in local.variable(v)] + pou.body
    end = Pou("FB_Exit", PouKind.FUNCTION, Pos("", 1, 1))
    exits = Destruction(world, end)
    end.body = [s for pool in world.pools.values() for s in exits.pool(pool, world.closers[pool.type])]
    end.body += [s for v in reversed(variables) for s in exits.variable(v)]
    if end.body:
        world.pous.append(end)
    return start if start.body else None, end if end.body else None


def construct_new(world: World) -> Pou | None:
    """Makes the routine that begins the life of those instances which the program that runs does not have."""
    stable = world.allocation.stable
    if stable is None:
        return None
    start = Pou("FB_Init of new variables", PouKind.FUNCTION, Pos("", 1, 1))
    builder = Construction(world, start, Const(1, BOOL, start.pos))
    pools = {pool.elements for pool in world.pools.values()}
    for variable in world.allocation.variables:
        if variable not in pools and (stable.is_new(variable) or variable.constant):
            start.body += builder.new_variable(variable)
        elif stable.has_fresh_parts(variable) and builder.new_variable(variable):
            stable.problem(f"{variable.name}: what is new in {variable.type} has a calculated initial value or FB_Init")
    if not start.body:
        return None
    world.pous.append(start)
    return start


def _kept_function() -> Pou:
    """The function of the runtime that tells whether a value in some memory was put back (CmpIecAbi.h)."""
    pos = Pos("", 1, 1)
    pou = Pou("ieckept", PouKind.FUNCTION, pos, result=Variable("ieckept", BOOL, Storage.LOCAL, pos))
    for name, t in (("address", RawPointerType(BYTE)), ("size", UDINT)):
        pou.parameters.append(Parameter(Variable(name, t, Storage.LOCAL, pos), Direction.INPUT))
    pou.external = runtime_function("ieckept")
    return pou


_KEPT = _kept_function()


class Construction:
    """The FB_Init of what variables hold, and the initial values that are calculated, written into `pou`."""

    def __init__(self, world: World, pou: Pou, init_retains: Expr) -> None:
        self._world = world
        self._pou = pou
        self._init_retains = init_retains
        self._needed: dict[StructType, bool] = {}

    def variable(self, variable: Variable) -> list[Statement]:
        """What a variable and all instances in it need."""
        keep = variable.keep if variable.area is Area.RETAIN else None
        path = variable.name if variable.storage is Storage.AREA else f"{self._pou.name}.{variable.name}"
        return self.place(whole(variable, variable.pos), variable.initial, variable.pos, keep, path)

    def new_variable(self, variable: Variable) -> list[Statement]:
        """The same of a variable of which nothing is kept."""
        return self.place(whole(variable, variable.pos), variable.initial, variable.pos, None, variable.name)

    def _needs(self, t: Type) -> bool:
        while isinstance(t, ArrayType):
            t = t.element
        if not isinstance(t, StructType):
            return False
        known = self._needed.get(t)
        if known is None:
            known = bool(initialisers(self._world, t) or starters(self._world, t) or path_members(self._world, t))
            known = known or any(self._needs(f.type) for f in t.fields)
            known = known or _is_computed(self._world.defaults.get(t.name))
            self._needed[t] = known
        return known

    def place(self, place: Place, initial: Initial | None, pos: Pos, keep: Keep | None, path: str) -> list[Statement]:
        """What a place and all instances in it need. `keep`: None outside of the retain area; `path`: its name."""
        t = place.type
        if isinstance(initial, ComputedInit):
            assign = Assign(place, initial.value, pos)
            fresh = self._is_fresh(place, keep)
            return [assign] if fresh is None else [If([(fresh, [assign])], [], pos)]
        if not self._needs(t) and not _is_computed(initial):
            return []
        if isinstance(t, ArrayType):
            return self._array(place, t, initial, pos, keep, path)
        assert isinstance(t, StructType)
        given = initial if isinstance(initial, StructInit) else StructInit({})
        complete = overlay(t, given, _moved_initial(self._world.defaults.get(t.name), place))
        assert isinstance(complete, StructInit)
        statements: list[Statement] = []
        named = path_members(self._world, t)
        for f in t.fields:
            part, own = member_place(place, f, pos), None if keep is None else keep.of_member(f.keep)
            statements += self.place(part, complete.members.get(f.name), pos, own, f"{path}.{f.name}")
            if f.name.casefold() in named:
                statements.append(Assign(part, Const(_path_value(path, f.type), f.type, pos), pos))
        for member in initialisers(self._world, t):
            statements.append(self._call(member, place, complete.arguments, pos, keep))
        statements += [self._set(t, place, key, value, pos) for key, value in complete.properties.items()]
        statements += [self._start(member, place, pos) for member in starters(self._world, t)]
        return statements

    def _set(self, t: StructType, place: Place, key: str, value: Expr, pos: Pos) -> Statement:
        """The SET of a property that the declaration gives a value."""
        cls = self._world.class_of(t)
        setter = None if cls is None else cls.find(f"{key}.set")
        assert setter is not None
        return CallStatement(Call(self._world.declared.member(setter).pou, [value], NOTHING, pos, instance=place), pos)

    def _start(self, member: Member, place: Place, pos: Pos) -> Statement:
        """The call of a method with {attribute 'call_after_init'}."""
        info = self._world.declared.member(member)
        if info.parameters:
            message = f"{member.name} is called after the initialisation, so it has no inputs and outputs"
            self._world.diagnostics.error(info.pou.pos, "attribute", message)
        return CallStatement(Call(info.pou, [], info.result or NOTHING, pos, instance=place), pos)

    def _is_named(self, t: Type) -> bool:
        """Whether something in a variable of the type gets its path."""
        return any(path_members(self._world, part) for part in instances_in(t))

    def _is_fresh(self, place: Place, keep: Keep | None) -> Expr | None:
        """Whether nothing was put back into a place, so that it is initialised; None if nothing in it is kept."""
        if keep is None or not is_kept(place.type, keep):
            return None
        pos = place.pos
        address = AddressOf(place, RawPointerType(BYTE), pos)
        kept = Call(_KEPT, [address, Const(place.type.size, UDINT, pos)], BOOL, pos)
        return Unary(UnaryOp.NOT, kept, BOOL, pos)

    def _array(
        self, place: Place, t: ArrayType, initial: Initial | None, pos: Pos, keep: Keep | None, path: str
    ) -> list[Statement]:
        base = _flat(place, t, pos)
        statements: list[Statement] = []
        first = 0
        for count, value in array_runs(t, initial):
            if count >= _LOOP_FROM and not self._is_named(t.element):
                loop, element = _loop(self._pou, base, t.element, first, first + count - 1)
                loop.body = self.place(element, value, pos, keep, path)
                statements.append(loop)
            else:
                for n in range(first, first + count):
                    element = IndexPlace(base, [Const(n, DINT, pos)], t.element, pos)
                    statements += self.place(element, value, pos, keep, f"{path}[{_index_text(t, n)}]")
            first += count
        return statements

    def _call(
        self, member: Member, place: Place, arguments: Mapping[str, Expr], pos: Pos, keep: Keep | None
    ) -> Statement:
        info = self._world.declared.member(member)
        args: list[Expr | Place | None] = []
        for symbol, direction in info.parameters:
            key = symbol.name.casefold()
            if key == INIT_RETAINS:
                args.append(self._is_fresh(place, keep) or self._init_retains)
            elif key == COPY_CODE:
                args.append(Const(0, BOOL, pos))
            elif key in arguments:
                args.append(arguments[key])
            elif isinstance(symbol.default, ComputedInit):
                args.append(symbol.default.value)
            elif isinstance(symbol.default, ScalarInit):
                args.append(Const(symbol.default.value, symbol.type, pos))
            elif symbol.given and isinstance(symbol.type, StructType | ArrayType):
                constant = VarPlace(self._world.default_of(symbol, info.pou), symbol.type, pos)
                args.append(Load(constant, symbol.type, pos))
            elif symbol.given:
                args.append(Const("" if isinstance(symbol.type, StringType) else 0, symbol.type, pos))
            elif direction is Direction.INPUT:
                message = f"{member.name} needs {symbol.name}; write {member.owner.name}({symbol.name} := ...)"
                self._world.diagnostics.error(pos, "arguments", message)
                args.append(Const(0, symbol.type, pos))
            else:
                args.append(None)
        result = info.result if info.result is not None else BOOL
        return CallStatement(Call(info.pou, args, result, pos, instance=place), pos)


class Destruction:
    """The FB_Exit of what variables hold: of a derived block before that of its base, of a block before its members."""

    def __init__(self, world: World, pou: Pou) -> None:
        self._world = world
        self._pou = pou

    def variable(self, variable: Variable) -> list[Statement]:
        """The calls for a variable and all instances in it."""
        return self.place(VarPlace(variable, variable.type, variable.pos))

    def pool(self, pool: Pool, closer: Pou) -> list[Statement]:
        """The calls for what __NEW made and nothing deleted."""
        pos = pool.elements.pos
        loop, element = _loop(self._pou, whole(pool.elements, pos), pool.type, 0, pool.count - 1)
        if not self.place(element):
            return []
        state = IndexPlace(whole(pool.state, pos), element.indices, DINT, pos)
        made = Binary(BinaryOp.GT, Load(state, DINT, pos), Const(1, DINT, pos), BOOL, pos)
        ended = Call(closer, [AddressOf(element, RawPointerType(BYTE), pos)], BOOL, pos)
        loop.body = [If([(made, [CallStatement(ended, pos)])], [], pos)]
        return [loop]

    def place(self, place: Place) -> list[Statement]:
        """The calls for a place and all instances in it."""
        t, pos = place.type, place.pos
        if not any(finalisers(self._world, instance) for instance in instances_in(t)):
            return []
        if isinstance(t, ArrayType):
            loop, element = _loop(self._pou, _flat(place, t, pos), t.element, t.count - 1, 0)
            loop.body = self.place(element)
            return [loop]
        assert isinstance(t, StructType)
        statements = [self._call(member, place) for member in finalisers(self._world, t)]
        for f in reversed(t.fields):
            statements += self.place(member_place(place, f, pos))
        return statements

    def _call(self, member: Member, place: Place) -> Statement:
        info, pos = self._world.declared.member(member), place.pos
        args: list[Expr | Place | None] = [Const(0, symbol.type, pos) for symbol, _ in info.parameters]
        return CallStatement(Call(info.pou, args, info.result or BOOL, pos, instance=place), pos)


def _flat(place: Place, t: ArrayType, pos: Pos) -> Place:
    """An array as one with a single index from 0."""
    return MemberPlace(place, 0, ArrayType(t.element, ((0, t.count - 1),)), pos)


def _index_text(t: ArrayType, number: int) -> str:
    """The indices of an element, counted from 0: `2,1`."""
    found: list[str] = []
    for low, high in reversed(t.bounds):
        number, at = divmod(number, high - low + 1)
        found.append(str(low + at))
    return ",".join(reversed(found))


def _loop(pou: Pou, base: Place, t: Type, first: int, last: int) -> tuple[For, IndexPlace]:
    """A loop over elements of an array, upwards or downwards, without a body; and the element it is about."""
    pos = base.pos
    counter = Variable(f"element {len(pou.locals)}", DINT, Storage.LOCAL, pos)
    pou.locals.append(counter)
    index = VarPlace(counter, DINT, pos)
    start, stop, step = (Const(n, DINT, pos) for n in (first, last, 1 if first <= last else -1))
    return For(index, start, stop, step, [], pos), IndexPlace(base, [Load(index, DINT, pos)], t, pos)


def _is_computed(initial: Initial | None) -> bool:
    """Whether something in an initial value is not constant."""
    if isinstance(initial, StructInit):
        return bool(initial.properties) or any(map(_is_computed, initial.members.values()))
    if isinstance(initial, ArrayInit):
        return _is_computed(initial.rest) or any(_is_computed(value) for _, value in initial.runs)
    return isinstance(initial, ComputedInit)


def _path_value(path: str, t: Type) -> str | int:
    """The path of an instance for its member of this type: a DWORD gets the CRC-32, by which tools find the name."""
    return path[: t.length] if isinstance(t, StringType) else crc32(path.encode("latin-1"))


def _moved_initial(initial: Initial | None, instance: Place) -> Initial | None:
    """The default of a function block as it is for one instance: its own members are members of that."""
    if isinstance(initial, StructInit):
        moved = {name: _moved_initial(value, instance) for name, value in initial.members.items()}
        members = {name: value for name, value in moved.items() if value is not None}
        arguments, properties = (
            {name: _moved(e, instance) for name, e in given.items()}
            for given in (initial.arguments, initial.properties)
        )
        return StructInit(members, arguments, properties)
    if isinstance(initial, ArrayInit):
        runs = [(count, _moved_initial(value, instance)) for count, value in initial.runs]
        return ArrayInit(runs, _moved_initial(initial.rest, instance))
    return ComputedInit(_moved(initial.value, instance)) if isinstance(initial, ComputedInit) else initial


def _moved(e: Expr, instance: Place) -> Expr:
    def moved(node: Node) -> Node | None:
        if isinstance(node, SelfPlace):
            return instance
        if isinstance(node, VarPlace) and node.var.storage is Storage.SELF:
            return MemberPlace(instance, node.var.offset, node.type, node.pos)
        return None

    return rewrite(e, moved)
