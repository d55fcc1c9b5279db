"""From the functions of a module to the sources LLVM compiles: where inlining ends, and into which parts a large module
is cut, to be compiled side by side.

LLVM inlines what is small, and what is called once. It never looks at how large the caller becomes, and its passes take
more than proportional time for large functions.
"""

from __future__ import annotations

from collections import Counter

from plctool.compiler.codegen.ir import Definition, Module

_SMALL = 20  # instructions of a function that is inlined anywhere
_LARGE = 10_000  # instructions up to which a function may grow
_WHOLE = 20_000  # instructions of a module (about 5000 lines of ST) that is optimised as one


def texts(module: Module) -> list[str]:
    """The parts of a module, an even number of them when there are several. A part has copies of functions of others
    that may be inlined."""
    functions = module.functions
    calls = {name: Counter(c for c in d.function.callees if c in functions) for name, d in functions.items()}
    _limit_growth(functions, calls)
    total = sum(d.function.size for d in functions.values())
    if total <= _WHOLE:
        return [module.text(d.function.definition(d.linkage) for d in functions.values())]
    parts = _cut(functions, total // (2 * (1 + total // (2 * _WHOLE))))
    return [module.text(_part(names, functions, calls)) for names in parts]


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


def _cut(functions: dict[str, Definition], part_size: int) -> list[list[str]]:
    """Names of functions, in parts of at least this many instructions, but for the last."""
    parts: list[list[str]] = []
    size = part_size
    for name, definition in functions.items():
        if size >= part_size:
            parts.append([])
            size = 0
        parts[-1].append(name)
        size += definition.function.size
    return parts


def _part(own: list[str], functions: dict[str, Definition], calls: dict[str, Counter[str]]) -> list[str]:
    """The functions of one part, and what they call in others: a copy when it may be inlined, else a declaration."""
    found, seen, todo = [], set(own), list(own)
    while todo:
        name = todo.pop()
        function, linkage = functions[name].function, functions[name].linkage
        if name in own:
            found.append(function.definition("hidden" if linkage else ""))
        elif function.inlining == "noinline":
            found.append(function.declaration("hidden"))
            continue
        else:
            found.append(function.definition("available_externally hidden"))
        todo += [callee for callee in calls[name] if callee not in seen]
        seen.update(calls[name])
    return found
