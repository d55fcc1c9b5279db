"""__NEW and __DELETE: elements of a fixed number, for which {attribute 'pool'} of their type reserves the memory.

Each pool has an array of elements and a state for each of them (stdlib/pool.st). Its functions are declared when a
program first uses __NEW for the type; they are written when all types are known.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.semantics.construction import Construction, Destruction
from plctool.compiler.semantics.conversions import same_type, whole
from plctool.compiler.semantics.symbols import PouSymbol
from plctool.compiler.semantics.world import Pool, World
from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    Binary,
    BinaryOp,
    Call,
    CallStatement,
    Const,
    Direction,
    Expr,
    For,
    If,
    IndexPlace,
    Initialise,
    Load,
    Parameter,
    Place,
    Pos,
    Pou,
    PouKind,
    Statement,
    Storage,
    StructInit,
    Try,
    Unary,
    UnaryOp,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import callees, walk
from plctool.iec.types import BOOL, BYTE, DINT, MAX_SIZE, ArrayType, PointerType, RawPointerType, StructType, Type

MAX_ELEMENTS = 65535
DEFAULT_ELEMENTS = 8  # of a type without {attribute 'pool'}
DEFAULT_ROWS = 4  # as many times n for the largest __NEW(T, n)
DEFAULT_OF_VARIABLE = 64  # where n is not constant


def pool_of(world: World, t: Type, pos: Pos) -> Pool:
    """The pool of a type, which __NEW at `pos` needs."""
    pool = world.pools.get(t)
    if pool is None:
        elements = Variable(f"__pool.{t}", ArrayType(t, ((0, 0),)), Storage.AREA, pos)
        state = Variable(f"__pool.{t}.state", ArrayType(DINT, ((0, 0),)), Storage.AREA, pos)
        pool = world.pools[t] = Pool(t, pos, elements, state)
        for name in _LIBRARY:
            _library(world, name)
        closer_of(world, t, pos)
    return pool


def creator_of(pool: Pool, start: Variable | None, inputs: list[tuple[str, Type]], pos: Pos) -> Pou:
    """The function that takes elements, which are copies of `start`, and gives their FB_Init these inputs."""
    names = tuple(name.casefold() for name, _ in inputs)
    if (start, names) not in pool.creators:
        shown = str(pool.type) if start is None else start.name.removeprefix("default of ")
        name = f"__NEW({', '.join([shown, *names])})"
        pool.creators[start, names] = _function(name, RawPointerType(pool.type), pos, ("n", DINT), *inputs)
    return pool.creators[start, names]


def closer_of(world: World, t: Type, pos: Pos) -> Pou:
    """The function that ends what __NEW made of a type or of those derived from it: whether it was that."""
    closer = world.closers.get(t)
    if closer is None:
        closer = world.closers[t] = _function(f"__DELETE({t})", BOOL, pos, ("p", RawPointerType(BYTE)))
    return closer


def _conforms(t: Type, wanted: Type) -> bool:
    return same_type(t, wanted) or (isinstance(t, StructType) and t.conforms(wanted))


def _reserve(world: World, pool: Pool) -> None:
    """Gives a pool its memory; says how much it is where no attribute says it."""
    size = pool.count * pool.type.size
    if size > MAX_SIZE:
        message = f"a pool of {pool.count} {pool.type} with {pool.type.size} bytes each is too large"
        world.diagnostics.error(pool.pos, "size", message)
        return
    if not pool.declared:
        own = isinstance(pool.type, StructType)
        where = "before its declaration" if own else f"before a TYPE that is {pool.type}, and give __NEW that type"
        room = f"{pool.type} has no pool, so there is room for {pool.count} of them ({size} bytes)"
        message = f"{room}; for another number write {{attribute 'pool' := '{pool.count}'}} {where}"
        world.diagnostics.warning(pool.pos, "pool", message)
    for variable, t in ((pool.elements, pool.type), (pool.state, DINT)):
        variable.type = ArrayType(t, ((0, pool.count - 1),))
        world.allocation.add(variable)


def write_pools(world: World) -> None:
    """Gives all pools their memory and writes their functions."""
    creators: list[Pou] = []
    for pool in world.pools.values():
        _reserve(world, pool)
        for (start, _), creator in pool.creators.items():
            _Writer(world, creator).create(pool, start)
            creators.append(creator)
    for t, closer in world.closers.items():
        _Writer(world, closer).close([pool for of, pool in world.pools.items() if _conforms(of, t)])
    world.pous += [*creators, *world.closers.values()]
    for pou in [*creators, *world.closers.values()]:
        for node in walk(pou.body):
            for callee in callees(node):
                world.calls.add(pou, callee, pou.pos)


_LIBRARY = ("POOL_TAKE__", "POOL_OPEN__", "POOL_CLOSE__", "POOL_FIND__", "POOL_FREE__")


def _library(world: World, name: str) -> Pou:
    symbol = world.names.unit(name.casefold(), library=True)
    assert isinstance(symbol, PouSymbol)
    info = world.declared.function(symbol, {})
    assert info is not None
    return info.pou


def _function(name: str, result: Type, pos: Pos, *parameters: tuple[str, Type]) -> Pou:
    pou = Pou(name, PouKind.FUNCTION, pos, result=Variable(name, result, Storage.LOCAL, pos))
    assert pou.result is not None
    pou.locals.append(pou.result)
    for text, t in parameters:
        pou.parameters.append(Parameter(Variable(text, t, Storage.LOCAL, pos), Direction.INPUT))
    return pou


@dataclass
class _Writer:
    """The body of one function."""

    world: World
    pou: Pou

    def create(self, pool: Pool, start: Variable | None) -> None:
        """Takes elements, gives them their initial values, or that of `start`, and calls FB_Init; those taken are free
        again when that raises."""
        pos, number = self.pou.pos, self.pou.parameters[0].variable
        first, element = self._local("first", DINT), self._local("element", DINT)
        taken = self._call("POOL_TAKE__", DINT, self._state(pool), _number(pool.count, pos), _load(number))
        place = self._element(pool, _load(element))
        construction = Construction(self.world, self.pou, Const(1, BOOL, pos))
        given = {p.variable.name.casefold(): _load(p.variable) for p in self.pou.parameters[1:]}
        initial = StructInit({}, dict(given)) if given else None
        special = construction.place(place, initial, pos, None, str(pool.type))
        last = Binary(BinaryOp.ADD, _load(first), self._less_one(_load(number)), DINT, pos)
        filled = Initialise(place, pos) if start is None else Assign(place, _load(start), pos)
        fresh: Statement = self._loop(element, _load(first), last, [filled, *special])
        opened = self._do("POOL_OPEN__", BOOL, self._state(pool), _load(first), _load(number))
        assert self.pou.result is not None
        address = AddressOf(self._element(pool, _load(first)), self.pou.result.type, pos)
        done = [opened, Assign(whole(self.pou.result, pos), address, pos)]
        body = [fresh, *done]
        if special:
            made = Binary(BinaryOp.NE, _load(self.pou.result), Const(0, self.pou.result.type, pos), BOOL, pos)
            failed = If([(Unary(UnaryOp.NOT, made, BOOL, pos), [self._free(pool, first, number)])], [], pos)
            body = [Try(body, None, [], [failed], pos)]
        found = Binary(BinaryOp.GE, _load(first), _number(0, pos), BOOL, pos)
        self.pou.body = [Assign(whole(first, pos), taken, pos), If([(found, body)], [], pos)]

    def close(self, pools: list[Pool]) -> None:
        """Calls FB_Exit and makes the elements free."""
        pos, given = self.pou.pos, self.pou.parameters[0].variable
        assert self.pou.result is not None
        first, number, element = (self._local(name, DINT) for name in ("first", "number", "element"))
        true = Assign(whole(self.pou.result, pos), Const(1, BOOL, pos), pos)
        nothing = Binary(BinaryOp.EQ, _load(given), Const(0, given.type, pos), BOOL, pos)
        self.pou.body = [If([(nothing, [true])], [], pos)]
        for pool in pools:
            elements = AddressOf(whole(pool.elements, pos), given.type, pos)
            size, count = _number(pool.type.size, pos), _number(pool.count, pos)
            found = self._call("POOL_FIND__", DINT, _load(given), elements, size, count)
            closed = self._call("POOL_CLOSE__", DINT, self._state(pool), _load(first))
            exits = Destruction(self.world, self.pou).place(self._element(pool, _load(element)))
            ending: list[Statement] = [self._free(pool, first, number)]
            if exits:
                last = Binary(BinaryOp.ADD, _load(first), self._less_one(_load(number)), DINT, pos)
                ending = [Try([self._loop(element, _load(first), last, exits)], None, [], ending, pos)]
            valid = Binary(BinaryOp.GT, _load(number), _number(0, pos), BOOL, pos)
            self.pou.body += [
                Assign(whole(first, pos), found, pos),
                Assign(whole(number, pos), closed, pos),
                If([(valid, [true, *ending])], [], pos),
            ]

    def _local(self, name: str, t: Type) -> Variable:
        variable = Variable(name, t, Storage.LOCAL, self.pou.pos)
        self.pou.locals.append(variable)
        return variable

    def _state(self, pool: Pool) -> Expr:
        return AddressOf(whole(pool.state, self.pou.pos), PointerType(DINT), self.pou.pos)

    def _element(self, pool: Pool, index: Expr) -> Place:
        return IndexPlace(whole(pool.elements, self.pou.pos), [index], pool.type, self.pou.pos)

    def _call(self, name: str, result: Type, *arguments: Expr) -> Call:
        return Call(_library(self.world, name), list(arguments), result, self.pou.pos)

    def _do(self, name: str, result: Type, *arguments: Expr) -> Statement:
        return CallStatement(self._call(name, result, *arguments), self.pou.pos)

    def _free(self, pool: Pool, first: Variable, number: Variable) -> Statement:
        return self._do("POOL_FREE__", DINT, self._state(pool), _load(first), _load(number))

    def _less_one(self, e: Expr) -> Expr:
        return Binary(BinaryOp.SUB, e, _number(1, self.pou.pos), DINT, self.pou.pos)

    def _loop(self, counter: Variable, start: Expr, stop: Expr, body: list[Statement]) -> Statement:
        pos = self.pou.pos
        return For(VarPlace(counter, DINT, pos), start, stop, _number(1, pos), body, pos)


def _load(variable: Variable) -> Load:
    return Load(VarPlace(variable, variable.type, variable.pos), variable.type, variable.pos)


def _number(value: int, pos: Pos) -> Const:
    return Const(value, DINT, pos)
