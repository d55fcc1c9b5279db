"""From the functions of a module to the sources LLVM compiles: where inlining ends, and into which parts a large module
is cut, to be compiled side by side, and only as far as they have changed.

LLVM inlines what is small, and what is called once. It never looks at how large the caller becomes, and its passes take
more than proportional time for large functions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256

from plctool.compiler.codegen.ir import Definition, Function, Module

_SMALL = 20  # instructions of a function that is inlined anywhere
_LARGE = 10_000  # instructions up to which a function may grow
_WHOLE = 20_000  # instructions of a module (about 5000 lines of ST) that is optimised as one
_FEW = 5_000  # instructions for which several parts do not pay
_GROUP = 2_000  # instructions, about, of what is compiled again when one function has changed
_LONGEST_GROUP = 3 * _GROUP
_COPIED = 300  # instructions of a function up to which LLVM may find it worth inlining when it is called often
_DECLARED = "declared"  # in place of a linkage: of a function that is in another part
_LONG_RUN = 50  # instructions between branches, on average: `memory.py` has left little for LLVM to find


@dataclass(frozen=True)
class Part:
    """What is compiled by itself. `large`: part of a large module; `plain`: long runs of instructions, without loops
    and without calls that could be inlined."""

    text: str
    large: bool = False
    plain: bool = False


KnownParts = dict[tuple[tuple[Function, str, str], ...], str]
"""The IR of parts by their functions, each with its linkage and its attribute about inlining."""


def parts(module: Module, *, cut: bool = True, grouped: bool = True, known: KnownParts | None = None) -> list[Part]:
    """The parts of a module: one if it is small or not to be `cut`, else several, of plain functions and of others. A
    part has copies of functions of others that may be inlined. `grouped`: many small parts, which stay the same where a
    program does; else an even number of the same size, in which LLVM sees more at once. `known`: the parts of the last
    call for this module, which those of this one replace."""
    functions = module.functions
    calls = {name: Counter(c for c in d.function.callees if c in functions) for name, d in functions.items()}
    _limit_growth(functions, calls)
    if not cut or _size(functions) <= _WHOLE:
        return [Part(module.whole())]
    plain = {name: d for name, d in functions.items() if _is_plain(d.function, functions)}
    if _size(plain) < _FEW:
        plain = {}
    found, written_parts = [], KnownParts()
    for some in (plain, {name: d for name, d in functions.items() if name not in plain}):
        for names in _groups(some) if grouped else _cut(some):
            written = _part(names, functions, calls, _COPIED if grouped else _LARGE)
            key = tuple((function, linkage, function.inlining) for function, linkage in written)
            text = None if known is None else known.get(key)
            if text is None:
                text = module.text(_text(function, linkage) for function, linkage in written)
            written_parts[key] = text
            found.append(Part(text, large=True, plain=bool(plain) and some is plain))
    if known is not None:
        known.clear()
        known.update(written_parts)
    return found


def _text(function: Function, linkage: str) -> str:
    return function.declaration("hidden") if linkage == _DECLARED else function.definition(linkage)


def _size(functions: dict[str, Definition]) -> int:
    return sum(d.function.size for d in functions.values())


def _is_plain(function: Function, functions: dict[str, Definition]) -> bool:
    """Whether LLVM's passes for loops, branches and inlining have nothing to do in a function."""
    return (
        not function.loops
        and function.size >= _LONG_RUN * function.blocks
        and all(c in functions and functions[c].function.inlining == "noinline" for c in function.callees)
    )


def _limit_growth(functions: dict[str, Definition], calls: dict[str, Counter[str]]) -> None:
    """Forbids the inlining of functions that would make another one larger than _LARGE."""
    sizes: dict[str, int] = {}

    def grown(name: str) -> int:
        """The size after inlining."""
        if name not in sizes:
            own = sizes[name] = functions[name].function.size
            inlined = sum(grown(callee) * count for callee, count in calls[name].items())
            if own + inlined > _LARGE:
                for callee in calls[name]:
                    function = functions[callee].function
                    if not function.inlining and function.size > _SMALL:
                        function.inlining = "noinline"
                inlined = 0
            sizes[name] = own + inlined
        return sizes[name]

    for name in functions:
        grown(name)


def _cut(functions: dict[str, Definition]) -> list[list[str]]:
    """Names of functions, in an even number of parts of about the same size that are not too large; one for few."""
    total = _size(functions)
    part_size = total if total < _FEW else total // (2 * (1 + total // (2 * _WHOLE)))
    found: list[list[str]] = []
    size = part_size
    for name, definition in functions.items():
        if size >= part_size:
            found.append([])
            size = 0
        found[-1].append(name)
        size += definition.function.size
    return found


def _groups(functions: dict[str, Definition]) -> Iterator[list[str]]:
    """Names of functions, in groups of some thousand instructions. A group begins at some names, whatever
    is before them, so that a function that is longer, new or gone changes its own group only, and seldom the next."""
    average = max(1, _size(functions) // max(1, len(functions)))
    functions_of_group = 1 << max(0, (_GROUP // average).bit_length() - 1)
    group: list[str] = []
    size = 0
    for name, definition in functions.items():
        if group and (size > _LONGEST_GROUP or sha256(name.encode()).digest()[0] % functions_of_group == 0):
            yield group
            group, size = [], 0
        group.append(name)
        size += definition.function.size
    if group:
        yield group


def _part(
    own: list[str], functions: dict[str, Definition], calls: dict[str, Counter[str]], copied: int
) -> list[tuple[Function, str]]:
    """The functions of one part, each with its linkage, and what they call in others: a copy when it may be inlined and
    has no more than `copied` instructions, else a declaration."""
    found: list[tuple[Function, str]] = []
    seen, todo = set(own), list(own)
    here = frozenset(own)
    while todo:
        name = todo.pop()
        function, linkage = functions[name].function, functions[name].linkage
        if name in here:
            found.append((function, "hidden" if linkage else ""))
        elif function.inlining == "noinline" or (function.size > copied and not function.inlining):
            found.append((function, _DECLARED))
            continue
        else:
            found.append((function, "available_externally hidden"))
        todo += [callee for callee in calls[name] if callee not in seen]
        seen.update(calls[name])
    return found
