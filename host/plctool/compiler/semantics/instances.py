"""Instances of function blocks: which a variable consists of, whether there may be any, their FB_Init and FB_Exit.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import Member
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.iec.types import ArrayType, StructType, Type

INITIALISERS = ("fb_init", "fb_reinit", "fb_exit")  # each class may have its own parameters
INIT_RETAINS, COPY_CODE = "binitretains", "bincopycode"  # the inputs of every FB_Init


def instances_in(t: Type) -> Iterator[StructType]:
    """The structs and function blocks that a variable of the type consists of."""
    while isinstance(t, ArrayType):
        t = t.element
    if isinstance(t, StructType):
        yield t
        for f in t.fields:
            yield from instances_in(f.type)


def is_instance(world: World, t: Type) -> bool:
    """Whether variables of the type are instances of a function block."""
    return _innermost(t) in world.blocks


def require_instances(world: World, t: Type, scope: Scope, offset: int) -> None:
    """Reports a variable of an ABSTRACT function block."""
    cls = world.class_of(_innermost(t))
    if cls is not None and cls.abstract:
        message = f"{cls.name} is ABSTRACT and has no instances; declare one of a function block that extends it"
        scope.error(offset, "inheritance", message)


def initialisers(world: World, t: StructType) -> list[Member]:
    """The FB_Init methods of a block, that of the base first."""
    return list(reversed(_each(world, t, "fb_init")))


def finalisers(world: World, t: StructType) -> list[Member]:
    """The FB_Exit methods of a block, that of the base last."""
    return _each(world, t, "fb_exit")


def starters(world: World, t: StructType) -> list[Member]:
    """The methods with {attribute 'call_after_init'} of a block, those of the base first; of one that is overridden,
    what overrides it."""
    chain, cls = [], world.class_of(t)
    while cls is not None:
        chain.append(cls)
        cls = cls.base
    found: dict[str, Member] = {}
    for cls in reversed(chain):
        for key, member in cls.members.items():
            if "call_after_init" in member.decl.attributes and member.decl.keyword is ast.Unit.METHOD:
                found.setdefault(key, member)
    return [chain[0].find(key) or member for key, member in found.items()]


def path_members(world: World, t: StructType) -> set[str]:
    """Members that hold the path of the instance: those with {attribute 'instance-path'}, case-folded."""
    block = world.blocks.get(t)
    return set() if block is None else {name for name, symbol in block.members.items() if symbol.is_path}


def _each(world: World, t: StructType, key: str) -> list[Member]:
    """The methods of that name of a block and of its bases."""
    found: list[Member] = []
    cls = world.class_of(t)
    while cls is not None:
        if key in cls.members:
            found.append(cls.members[key])
        cls = cls.base
    return found


def _innermost(t: Type) -> Type:
    """The type of the elements of an array, of what they consist of if they are arrays."""
    while isinstance(t, ArrayType):
        t = t.element
    return t
