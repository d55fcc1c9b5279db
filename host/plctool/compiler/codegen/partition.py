"""From the functions of a module to the sources LLVM compiles: where inlining ends, and into which parts a large module
is cut, to be compiled side by side.

LLVM inlines what is small, and what is called once. It never looks at how large the caller becomes, and its passes take
more than proportional time for large functions.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from plctool.compiler.codegen.ir import Definition, Function, Module

_SMALL = 20  # instructions of a function that is inlined anywhere
_LARGE = 10_000  # instructions up to which a function may grow
_WHOLE = 20_000  # instructions of a module (about 5000 lines of ST) that is optimised as one
_FEW = 5_000  # instructions for which several parts do not pay
_LONG_RUN = 50  # instructions between branches, on average: `memory.py` has left little for LLVM to find


@dataclass(frozen=True)
class Part:
    """What is compiled by itself. `large`: part of a large module; `plain`: long runs of instructions, without loops
    and without calls that could be inlined."""

    text: str
    large: bool = False
    plain: bool = False


def parts(module: Module, *, cut: bool = True) -> list[Part]:
    """The parts of a module: one if it is small or not to be `cut`, else an even number of the same size, of plain
    functions and of others. A part has copies of functions of others that may be inlined."""
    functions = module.functions
    calls = {name: Counter(c for c in d.function.callees if c in functions) for name, d in functions.items()}
    _limit_growth(functions, calls)
    if not cut or _size(functions) <= _WHOLE:
        return [Part(module.whole())]
    plain = {name: d for name, d in functions.items() if _is_plain(d.function, functions)}
    if _size(plain) < _FEW:
        plain = {}
    found = []
    for some in (plain, {name: d for name, d in functions.items() if name not in plain}):
        for names in _cut(some):
            text = module.text(_part(names, functions, calls))
            found.append(Part(text, large=True, plain=bool(plain) and some is plain))
    return found


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


def _part(own: list[str], functions: dict[str, Definition], calls: dict[str, Counter[str]]) -> list[str]:
    """The functions of one part, and what they call in others: a copy when it may be inlined, else a declaration."""
    found, seen, todo = [], set(own), list(own)
    here = frozenset(own)
    while todo:
        name = todo.pop()
        function, linkage = functions[name].function, functions[name].linkage
        if name in here:
            found.append(function.definition("hidden" if linkage else ""))
        elif function.inlining == "noinline":
            found.append(function.declaration("hidden"))
            continue
        else:
            found.append(function.definition("available_externally hidden"))
        todo += [callee for callee in calls[name] if callee not in seen]
        seen.update(calls[name])
    return found
