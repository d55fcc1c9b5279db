"""What names stand for in all sources of a project, its libraries and the standard library."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.rules.builtin import built_in_names
from plctool.compiler.sources.imports import ImportedLibrary
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.compiler.syntax.library import standard_library, without_library
from plctool.compiler.syntax.parser import parse
from plctool.iec.types import ELEMENTARY
from plctool.lsp.items import BODIES, CLASSES, POUS, TYPES, Item, ItemsOf, Kind
from plctool.lsp.tree import Tree

_MAX_BASES = 50  # of a block or type, so that a circle ends
STANDARD = "standard"  # the library of what comes with the tool
ELEMENTARY_NAMES = tuple(dict.fromkeys([*(n for n in ELEMENTARY if not n.startswith("_")), "STRING", "WSTRING"]))


@dataclass(frozen=True)
class Shape:
    """A type: as it is written (`spec`) in the surroundings of `home`, or a declared one (`item`)."""

    spec: ast.TypeSpec | None = None
    home: Item | None = None
    item: Item | None = None


def _ignore(offset: int, code: str, message: str) -> None:
    """A library is checked where it is used."""


class LibraryNames:
    """The items of the standard library and of libraries that are given, made when a name is first asked for."""

    def __init__(self, libraries: Sequence[ImportedLibrary]) -> None:
        self.libraries = libraries
        self._standard: dict[str, Item | None] = {}
        self._imported: dict[str, list[Item]] = {}
        self._of_part: dict[int, ItemsOf] = {}
        self.used: dict[str, Item] = {}  # by key

    def unit(self, key: str) -> Item | None:
        """Returns a unit or global of a library by its case-folded name."""
        found = self.imported(key)
        return found[0] if found else self.standard(key)

    def standard(self, key: str) -> Item | None:
        """Returns what the standard library has of that name; of overloads the first one."""
        key = without_library(key)
        if key not in self._standard:
            self._standard[key] = self._parsed(key)
        return self._standard[key]

    def _parsed(self, key: str) -> Item | None:
        library = standard_library()
        entry = library.entry(key)
        if entry is None:
            return None
        declarations = parse(entry.source, _ignore, entry.start, entry.end)
        items = ItemsOf(entry.source, declarations, STANDARD)
        everything = [*items.units, *items.globals]
        wanted = entry.name.casefold()
        found = next((i for i in everything if i.name.casefold() == wanted), None)
        if found is None:
            return next((v for i in items.units if (v := i.inner.get(wanted)) is not None), None)
        if library.overloads(key):
            found.name = key.upper()
        return found

    def imported(self, key: str, library: ImportedLibrary | None = None) -> list[Item]:
        """Returns what the libraries, or one of them, declare by that name."""
        found = []
        for each in self.libraries if library is None else [library]:
            for part in each.by_name.get(key, ()):
                items = self._of_part.get(id(part))
                if items is None:
                    declarations = parse(part.source, _ignore, part.start, part.end)
                    items = self._of_part[id(part)] = ItemsOf(part.source, declarations, each.name)
                found += [i for i in (*items.units, *items.globals) if i.name.casefold() == key]
        return found

    @cached_property
    def _listed(self) -> list[tuple[str, str, bool]]:
        library = standard_library()
        functions = set(library.names("FUNCTION")) | set(library.names("VAR_GLOBAL"))
        found = [(library.namespace, library.name, False) for library in self.libraries]
        found += [(name, STANDARD, name not in functions) for name in library.names()]
        for each in self.libraries:
            found += [(i.name, each.name, i.kind in TYPES or i.kind in CLASSES) for i in self._all_of(each)]
        return found

    def _all_of(self, library: ImportedLibrary) -> Iterator[Item]:
        for name in sorted(library.names):
            yield from self.imported(name.casefold(), library)[:1]

    def listed(self) -> list[tuple[str, str, bool]]:
        """Returns each name with the library that has it, and whether it is a type."""
        return self._listed


class Names:
    """The names of a project. `trees`: of its sources."""

    def __init__(self, trees: Sequence[Tree], library: LibraryNames) -> None:
        self.trees = trees
        self.library = library
        self.units: dict[str, Item] = {}
        self.globals: dict[str, Item] = {}
        self.lists: dict[str, Item] = {}
        self.values: dict[str, list[Item]] = {}
        self.instances: dict[str, Item] = {}
        self.spaces: dict[str, Item] = {}
        self.others: list[Item] = []
        self._of_libraries: dict[str, Item] = library.used
        self._implementing: dict[str, list[Item]] | None = None
        for tree in trees:
            self._add(tree)

    def _add(self, tree: Tree) -> None:
        items = tree.items
        for unit in items.units:
            key = unit.name.casefold()
            space = unit.namespace.name if unit.namespace is not None else ""
            if space:
                self._add_to_space(space, unit)
            self.units.setdefault(f"{space}.{key}".casefold() if space else key, unit)
            if unit.kind is Kind.ENUM:
                for value in unit.inner.values():
                    self.values.setdefault(value.name.casefold(), []).append(value)
        if items.list is not None:
            self.lists.setdefault(items.list.name.casefold(), items.list)
        for variable in items.globals:
            if variable.namespace is not None and variable.namespace.name:
                self._add_to_space(variable.namespace.name, variable)
            else:
                self.globals.setdefault(variable.name.casefold(), variable)
        for other in items.others:
            self.others.append(other)
            for name, inner in other.inner.items():
                if inner.kind is Kind.INSTANCE:
                    self.instances.setdefault(name.removeprefix("program "), inner)

    def _add_to_space(self, space: str, item: Item) -> None:
        parts = space.split(".")
        outer: Item | None = None
        for n, name in enumerate(parts):
            key = ".".join(parts[: n + 1]).casefold()
            if key not in self.spaces:
                self.spaces[key] = Item(Kind.NAMESPACE, name, f"namespace.{key}", item.source, item.offset, outer)
                if outer is not None:
                    outer.add(self.spaces[key])
            outer = self.spaces[key]
        assert outer is not None
        outer.add(item)

    # ---- all there is ----

    def every(self) -> Iterator[Item]:
        """Returns all items of the project, outer ones first."""
        outermost = [*self.units.values(), *self.globals.values(), *self.lists.values(), *self.others]
        outermost += [i for space in self.spaces.values() for i in space.inner.values() if i.kind is not Kind.NAMESPACE]
        seen: set[int] = set()
        stack = outermost[::-1]
        while stack:
            item = stack.pop()
            if id(item) not in seen:
                seen.add(id(item))
                yield item
                stack += reversed(item.inner.values())

    def by_key(self, key: str) -> Item | None:
        """Returns the item that a use is of."""
        known = self._of_libraries.get(key)
        if known is not None:
            return known
        parts = key.split(".")
        for n in range(len(parts), 0, -1):
            top = self._top.get(".".join(parts[:n]))
            if top is not None:
                return _inside(top, parts[n:])
        return None

    @cached_property
    def _top(self) -> dict[str, Item]:
        """The outermost items by their keys."""
        found = [*self.units.values(), *self.globals.values(), *self.lists.values(), *self.others]
        found += [item for space in self.spaces.values() for item in (space, *space.inner.values())]
        return {item.key: item for item in reversed(found)}

    def remember(self, item: Item) -> None:
        """Makes an item of a library known by its key."""
        if item.library:
            self._of_libraries.setdefault(item.key, item)

    # ---- names ----

    def unit(self, name: str, home: Item | None = None) -> Item | None:
        """Returns a type or POU by its name, as seen from an item."""
        key = name.casefold()
        if home is not None and home.library and home.library != STANDARD:
            library = next((each for each in self.library.libraries if each.name == home.library), None)
            found = self.library.imported(key, library)
            if found:
                return found[0]
        for space in _spaces(home):
            if (item := self.units.get(f"{space}.{key}")) is not None:
                return item
        if home is not None and home.library == STANDARD and (item := self.library.standard(key)) is not None:
            return item
        own = self.units.get(key)
        if own is not None:
            return own
        first, dot, rest = key.partition(".")
        if dot:
            around = self.space(first)
            if around is not None and (inner := self.in_space(around, rest)) is not None:
                return inner
        return self.library.unit(key)

    def value(self, name: str, home: Item | None, *, type_first: bool = False) -> Item | None:
        """Returns what a name stands for in a unit or member."""
        key = name.casefold().removeprefix(".")
        if type_first and (unit := self.unit(name, home)) is not None:
            return unit
        if not name.startswith(".") and (own := self._local(key, home)) is not None:
            return own
        for space in _spaces(home):
            outer = self.spaces.get(space)
            if outer is not None and (item := outer.inner.get(key)) is not None:
                return item
        found = self.globals.get(key) or self.instances.get(key)
        if found is None and (home is None or not home.library):
            values = [v for v in self.values.get(key, ()) if not _is_qualified(v.owner)]
            found = values[0] if values else None
        return found or self.unit(key, home) or self.lists.get(key) or self.space(key)

    def _local(self, key: str, home: Item | None) -> Item | None:
        while home is not None:
            if home.name.casefold() == key and home.kind in (Kind.FUNCTION, Kind.METHOD, Kind.PROPERTY):
                return home
            if (found := self.member(home, key)) is not None and found.kind is not Kind.VALUE:
                return found
            for variable in home.inner.values():  # values of enumerations without a name
                if isinstance(variable.spec, ast.EnumSpec) and (value := variable.inner.get(key)) is not None:
                    return value
            home = home.owner
        return None

    def member(self, item: Item, key: str) -> Item | None:
        """Returns what a unit, type, list or namespace has of that name, also inherited."""
        for each in self.lineage(item):
            if (found := each.inner.get(key)) is not None:
                return found
        return None

    def members(self, item: Item) -> dict[str, Item]:
        """Returns all that a unit or type has, also inherited, own ones first."""
        found: dict[str, Item] = {}
        for each in self.lineage(item):
            for key, member in each.inner.items():
                found.setdefault(key, member)
        return found

    def lineage(self, item: Item) -> Iterator[Item]:
        """Returns a unit or type and those that it extends."""
        seen: set[int] = set()
        waiting = [item]
        while waiting and len(seen) < _MAX_BASES:
            each = waiting.pop(0)
            if id(each) in seen:
                continue
            seen.add(id(each))
            yield each
            waiting += self.bases(each)

    def bases(self, item: Item) -> list[Item]:
        """Returns what a unit or structure extends."""
        names: list[str] = []
        if isinstance(item.decl, ast.PouDecl) and item.kind in CLASSES:
            names = [name for _, name in item.decl.bases]
        elif isinstance(item.spec, ast.StructSpec) and item.spec.base is not None:
            names = [item.spec.base.name]
        found = (self.unit(name, item.owner or item) for name in names)
        return [base for base in found if base is not None and base is not item]

    def interfaces(self, item: Item) -> list[Item]:
        """Returns the interfaces that a block implements by its own words."""
        if not isinstance(item.decl, ast.PouDecl):
            return []
        found = (self.unit(name, item) for _, name in item.decl.interfaces)
        return [interface for interface in found if interface is not None]

    def derived(self, item: Item) -> list[Item]:
        """Returns the units and structures that extend or implement an item."""
        if self._implementing is None:
            self._implementing = {}
            for unit in list(self.units.values()):
                for base in (*self.bases(unit), *self.interfaces(unit)):
                    self._implementing.setdefault(base.key, []).append(unit)
        return self._implementing.get(item.key, [])

    def space(self, key: str) -> Item | None:
        """Returns the namespace of that name: of the project, or of a library."""
        found = self.spaces.get(key)
        if found is not None:
            return found
        library = next((each for each in self.library.libraries if each.namespace.casefold() == key), None)
        if library is None:
            return None
        made = Item(Kind.NAMESPACE, library.namespace, f"namespace.{key}", Source(library.path, ""), 0)
        made.library, made.decl = library.name, library
        self.spaces[key] = made
        return made

    def in_space(self, space: Item, key: str) -> Item | None:
        """Returns what a namespace has of that name."""
        if isinstance(space.decl, ImportedLibrary):
            found = self.library.imported(key, space.decl)
            return found[0] if found else None
        first, _, rest = key.partition(".")
        inner = space.inner.get(first)
        return self.in_space(inner, rest) if inner is not None and rest else inner

    # ---- types ----

    def shape(self, item: Item) -> Shape | None:
        """Returns the type of a variable, the type or unit itself for one of these, the result's for a function."""
        if item.kind is Kind.VALUE:
            return None if item.owner is None else Shape(item=item.owner)
        if item.kind in TYPES or item.kind in CLASSES or item.kind in (Kind.LIST, Kind.NAMESPACE, Kind.CONFIGURATION):
            return self.resolved(Shape(item=item))
        if item.kind is Kind.STEP:
            return Shape(item=item)
        if item.spec is None:
            return None
        if isinstance(item.spec, ast.StructSpec | ast.EnumSpec):
            return Shape(item=item)
        return self.resolved(Shape(item.spec, _home(item)))

    def resolved(self, shape: Shape | None) -> Shape | None:
        """Follows names to a structure, block, interface, array or pointer; None for what is not known."""
        for _ in range(_MAX_BASES):
            if shape is None:
                return None
            if shape.item is not None:
                if shape.item.kind is not Kind.TYPE or shape.item.spec is None:
                    return shape
                if isinstance(shape.item.spec, ast.EnumSpec | ast.StructSpec):
                    return shape
                shape = Shape(shape.item.spec, shape.item)
            if isinstance(shape.spec, ast.NamedType):
                name = shape.spec.name
                if name.upper() in ELEMENTARY or name.upper() in ("STRING", "WSTRING"):
                    return shape
                item = self.unit(name, shape.home)
                if item is None:
                    return None
                shape = Shape(item=item)
            elif isinstance(shape.spec, ast.EnumSpec) and shape.spec.base:
                item = self.unit(shape.spec.base, shape.home)  # `TON(PT := T#1s)` looks like an enumeration
                return Shape(item=item) if item is not None else shape
            else:
                return shape
        return None

    def pointed_to(self, shape: Shape | None) -> Shape | None:
        """Returns what a pointer or reference leads to."""
        shape = self.resolved(shape)
        if shape is None or not isinstance(shape.spec, ast.PointerSpec):
            return None
        return self.resolved(Shape(shape.spec.target, shape.home))

    def element(self, shape: Shape | None) -> Shape | None:
        """Returns the type of the elements of an array."""
        shape = self.dereferenced(shape)
        if shape is not None and isinstance(shape.spec, ast.PointerSpec):
            return self.pointed_to(shape)
        if shape is None or not isinstance(shape.spec, ast.ArraySpec):
            return None
        return self.resolved(Shape(shape.spec.element, shape.home))

    def dereferenced(self, shape: Shape | None) -> Shape | None:
        """Returns what a REFERENCE stands for, other types as they are."""
        shape = self.resolved(shape)
        spec = None if shape is None else shape.spec
        refers = isinstance(spec, ast.PointerSpec) and spec.keyword is ast.Pointing.REFERENCE
        return self.pointed_to(shape) if refers else shape

    def part(self, shape: Shape | None, key: str) -> Item | None:
        """Returns what stands after the point."""
        shape = self.dereferenced(shape)
        if shape is None or shape.item is None:
            return None
        if shape.item.kind is Kind.NAMESPACE:
            return self.in_space(shape.item, key)
        return self.member(shape.item, key)

    def parts(self, shape: Shape | None) -> dict[str, Item]:
        """Returns all that may stand after the point."""
        shape = self.dereferenced(shape)
        if shape is None or shape.item is None:
            return {}
        if isinstance(shape.item.decl, ImportedLibrary):
            library = shape.item.decl
            found = [i for name in library.names for i in self.library.imported(name.casefold(), library)[:1]]
            return {item.name.casefold(): item for item in found}
        return self.members(shape.item)

    def text(self, shape: Shape | None) -> str:
        """Returns the name of a type."""
        if shape is None:
            return ""
        if shape.item is not None:
            return shape.item.name
        return "" if shape.spec is None else written(shape.spec)

    def built_in(self) -> Iterable[str]:
        """Returns the functions that the compiler knows itself."""
        return [name for name in built_in_names() if name not in KEYWORDS]


def _inside(item: Item | None, names: Sequence[str]) -> Item | None:
    for name in names:
        if item is None:
            return None
        item = item.inner.get(name) or item.inner.get(f"program {name}")
    return item


def _home(item: Item) -> Item:
    """The item in whose surroundings the type of another one is written."""
    owner = item.owner
    while owner is not None and owner.kind not in POUS and owner.kind not in BODIES and owner.owner is not None:
        owner = owner.owner
    return owner or item


def _spaces(home: Item | None) -> list[str]:
    """The namespaces around an item and those that it is USING, case-folded, innermost first."""
    unit = None if home is None else home.unit
    if unit is None or unit.namespace is None:
        return []
    parts = unit.namespace.name.casefold().split(".") if unit.namespace.name else []
    around = [".".join(parts[:n]) for n in range(len(parts), 0, -1)]
    return around + [name.casefold() for _, name in unit.namespace.using]


def _is_qualified(item: Item | None) -> bool:
    return item is not None and isinstance(item.decl, ast.TypeDecl) and item.decl.qualified


def written(spec: ast.TypeSpec) -> str:
    """Returns a type as it is written, bounds by the words of the source where they are names or numbers."""
    if isinstance(spec, ast.NamedType):
        return spec.name if spec.length is None else f"{spec.name}[{expression(spec.length)}]"
    if isinstance(spec, ast.TypeOf):
        return f"the type of {expression(spec.value)}"
    if isinstance(spec, ast.SubrangeSpec):
        return f"{spec.base} ({expression(spec.low)}..{expression(spec.high)})"
    if isinstance(spec, ast.EnumSpec):
        if spec.base and len(spec.values) and spec.values[0][2] is not None:
            return spec.base
        return f"({', '.join(name for _, name, _ in spec.values[:8])}{', ...' if len(spec.values) > 8 else ''})"
    if isinstance(spec, ast.ArraySpec):
        bounds = ", ".join("*" if b is None else f"{expression(b[0])}..{expression(b[1])}" for b in spec.bounds)
        return f"ARRAY[{bounds}] OF {written(spec.element)}"
    if isinstance(spec, ast.PointerSpec):
        word = "REF_TO" if spec.keyword is ast.Pointing.REF_TO else f"{spec.keyword.value} TO"
        return f"{word} {written(spec.target)}"
    return "UNION" if spec.union else "STRUCT"


def expression(e: object) -> str:
    """Returns a simple expression as text."""
    if isinstance(e, ast.Literal):
        return f"'{e.value}'" if isinstance(e.value, str) else str(e.value)
    if isinstance(e, ast.Name):
        return e.name
    if isinstance(e, ast.EnumValue):
        return f"{e.type_name}#{e.name}"
    if isinstance(e, ast.DirectAddress):
        return e.text
    if isinstance(e, ast.Member):
        return f"{expression(e.base)}.{e.name}"
    if isinstance(e, ast.Unary):
        sign = e.op.value
        return f"{sign}{' ' if sign.isalpha() else ''}{expression(e.operand)}"
    if isinstance(e, ast.Binary):
        return f"{expression(e.left)} {e.op.value} {expression(e.right)}"
    return "..."
