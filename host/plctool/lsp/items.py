"""What a text declares, as an editor shows it: made of its syntax tree."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast


class Kind(Enum):
    """Kinds of what has a name."""

    PROGRAM = "PROGRAM"
    FUNCTION = "FUNCTION"
    FUNCTION_BLOCK = "FUNCTION_BLOCK"
    INTERFACE = "INTERFACE"
    METHOD = "METHOD"
    ACTION = "ACTION"
    PROPERTY = "PROPERTY"
    TYPE = "TYPE"
    STRUCT = "STRUCT"
    ENUM = "enumeration"
    VALUE = "enumeration value"
    VARIABLE = "variable"
    GLOBAL = "global variable"
    FIELD = "member"
    STEP = "step"
    LIST = "list of global variables"
    NAMESPACE = "NAMESPACE"
    CONFIGURATION = "CONFIGURATION"
    TASK = "TASK"
    INSTANCE = "program instance"
    TEST = "TEST"


POUS = frozenset((Kind.PROGRAM, Kind.FUNCTION, Kind.FUNCTION_BLOCK, Kind.INTERFACE))
CLASSES = frozenset((Kind.PROGRAM, Kind.FUNCTION_BLOCK, Kind.INTERFACE))
BODIES = frozenset((Kind.METHOD, Kind.ACTION, Kind.PROPERTY))
TYPES = frozenset((Kind.TYPE, Kind.STRUCT, Kind.ENUM))
CALLED = frozenset((Kind.PROGRAM, Kind.FUNCTION, Kind.FUNCTION_BLOCK, Kind.METHOD, Kind.ACTION))
VALUES = frozenset((Kind.VARIABLE, Kind.GLOBAL, Kind.FIELD, Kind.VALUE, Kind.INSTANCE, Kind.STEP))

PARAMETERS = (ast.Section.VAR_INPUT, ast.Section.VAR_OUTPUT, ast.Section.VAR_IN_OUT)


@dataclass(eq=False, slots=True)
class Item:
    """Something that has a name. `key`: the same after the text around it has changed. `spec`: its type as it is
    written, that of the result of a function; `line`: the declaration line of a variable; `section`: its keyword;
    `inner`: what it declares, by case-folded name; `library`: it is of a library."""

    kind: Kind
    name: str
    key: str
    source: Source
    offset: int
    owner: Item | None = None
    decl: object = None
    spec: ast.TypeSpec | None = None
    line: ast.VarDecl | None = None
    section: ast.Section | None = None
    qualifiers: frozenset[ast.Modifier] = frozenset()
    inner: dict[str, Item] = field(default_factory=dict)
    library: str = ""
    namespace: ast.Namespace | None = None

    @property
    def unit(self) -> Item:
        """The outermost unit that it is in, or it itself."""
        return self if self.owner is None else self.owner.unit

    @property
    def is_parameter(self) -> bool:
        """True for an input, output or in-out."""
        return self.section in PARAMETERS

    @property
    def full_name(self) -> str:
        """The name with those around it."""
        return self.name if self.owner is None else f"{self.owner.full_name}.{self.name}"

    def add(self, item: Item) -> None:
        """Adds what it declares; the first one of a name counts."""
        self.inner.setdefault(item.name.casefold(), item)

    def parameters(self) -> list[Item]:
        """Its own inputs, outputs and in-outs, in order."""
        return [item for item in self.inner.values() if item.is_parameter]


_POU_KINDS = {
    ast.Unit.PROGRAM: Kind.PROGRAM, ast.Unit.FUNCTION: Kind.FUNCTION, ast.Unit.FUNCTION_BLOCK: Kind.FUNCTION_BLOCK,
    ast.Unit.INTERFACE: Kind.INTERFACE, ast.Unit.METHOD: Kind.METHOD, ast.Unit.ACTION: Kind.ACTION,
    ast.Unit.GET: Kind.PROPERTY, ast.Unit.SET: Kind.PROPERTY,
}  # fmt: skip


class ItemsOf:
    """The items of a text. `units`: types and POUs; `globals`: each with the list that it is in; `values`: those of
    enumerations; `others`: configurations and tests."""

    def __init__(self, source: Source, declarations: Iterable[ast.Declaration], library: str = "") -> None:
        self.source = source
        self.library = library
        self.units: list[Item] = []
        self.globals: list[Item] = []
        self.others: list[Item] = []
        self.list: Item | None = None
        self.declared: dict[int, Item] = {}
        declarations = list(declarations)
        for declaration in declarations:
            self._add(declaration)
        self._add_lists(declarations)

    # ---- making them ----

    def _make(self, kind: Kind, name: str, offset: int, owner: Item | None, **more: object) -> Item:
        space = "" if owner is None else owner.key
        key = f"{self.library}{space}.{name}".casefold() if owner is None else f"{space}.{name}".casefold()
        item = Item(kind, name, key, self.source, offset, owner, library=self.library)
        for field_name, value in more.items():
            setattr(item, field_name, value)
        self.declared.setdefault(offset, item)
        return item

    def _add(self, declaration: ast.Declaration) -> None:
        if isinstance(declaration, ast.PouDecl):
            self.units.append(self._pou(declaration, None))
        elif isinstance(declaration, ast.TypeDecl):
            self.units.append(self._type(declaration))
        elif isinstance(declaration, ast.ConfigurationDecl):
            self._configuration(declaration)
        elif isinstance(declaration, ast.TestDecl):
            name = declaration.name or declaration.keyword.value
            test = self._make(Kind.TEST, name, declaration.pos, None, decl=declaration, namespace=declaration.namespace)
            test.key += f"@test{len(self.others)}"
            self._variables(test, declaration.blocks)
            self.others.append(test)

    def _pou(self, decl: ast.PouDecl, owner: Item | None) -> Item:
        kind = _POU_KINDS[decl.keyword]
        if owner is not None and kind is Kind.PROPERTY and (other := owner.inner.get(decl.name.casefold())):
            self._variables(other, decl.blocks)
            return other
        item = self._make(
            kind, decl.name, decl.pos, owner, decl=decl, spec=decl.result, namespace=decl.namespace
        )  # fmt: skip
        if owner is None and decl.namespace is not None and decl.namespace.name:
            item.key = f"{self.library}.{decl.full_name}".casefold()
        self._variables(item, decl.blocks)
        if decl.chart is not None:
            for step in decl.chart.steps:
                item.add(self._make(Kind.STEP, step.name, step.pos, item, decl=step))
        for member in decl.members:
            item.add(self._pou(member, item))
        return item

    def _variables(self, owner: Item, blocks: Iterable[ast.VarBlock]) -> None:
        for block in blocks:
            qualifiers = frozenset(block.qualifiers)
            for line in block.decls:
                for offset, name in line.names:
                    variable = self._make(
                        Kind.VARIABLE, name, offset, owner, decl=line, spec=line.type, line=line,
                        section=block.keyword, qualifiers=qualifiers,
                    )  # fmt: skip
                    owner.add(variable)
                    self._parts(line.type, variable)

    def _type(self, decl: ast.TypeDecl) -> Item:
        item = self._make(Kind.TYPE, decl.name, decl.pos, None, decl=decl, spec=decl.spec, namespace=decl.namespace)
        if decl.namespace is not None and decl.namespace.name:
            item.key = f"{self.library}.{decl.namespace.name}.{decl.name}".casefold()
        if isinstance(decl.spec, ast.StructSpec):
            item.kind = Kind.STRUCT
        elif isinstance(decl.spec, ast.EnumSpec):
            item.kind = Kind.ENUM
        self._parts(decl.spec, item)
        return item

    def _parts(self, spec: ast.TypeSpec, owner: Item) -> None:
        """The members of a structure and the values of an enumeration."""
        if isinstance(spec, ast.StructSpec):
            for line in spec.fields:
                for offset, name in line.names:
                    member = self._make(Kind.FIELD, name, offset, owner, decl=line, spec=line.type, line=line)
                    owner.add(member)
                    self._parts(line.type, member)
        elif isinstance(spec, ast.EnumSpec):
            for offset, name, value in spec.values:
                owner.add(self._make(Kind.VALUE, name, offset, owner, decl=value))
        elif isinstance(spec, ast.ArraySpec):
            self._parts(spec.element, owner)

    def _configuration(self, decl: ast.ConfigurationDecl) -> None:
        item = self._make(Kind.CONFIGURATION, decl.name, decl.pos, None, decl=decl)
        item.key += "@configuration"
        for task in decl.tasks:
            item.add(self._make(Kind.TASK, task.name, task.pos, item, decl=task))
        for program in decl.programs:
            spec = ast.NamedType(program.type_pos, program.type_name)
            instance = self._make(Kind.INSTANCE, program.name, program.pos, item, decl=program, spec=spec)
            item.inner.setdefault(f"program {program.name}".casefold(), instance)
        self.others.append(item)
        for block in decl.globals:
            self._globals(block, None)

    def _globals(self, block: ast.VarBlock, owner: Item | None, namespace: ast.Namespace | None = None) -> None:
        for line in block.decls:
            for offset, name in line.names:
                variable = self._make(
                    Kind.GLOBAL, name, offset, None, decl=line, spec=line.type, line=line, section=block.keyword,
                    qualifiers=frozenset(block.qualifiers), namespace=namespace,
                )  # fmt: skip
                space = f"{namespace.name}." if namespace is not None and namespace.name else ""
                variable.key = f"{self.library}global.{space}{owner.name + '.' if owner else ''}{name}".casefold()
                self.globals.append(variable)
                if owner is not None:
                    owner.add(variable)
                self._parts(line.type, variable)

    def _add_lists(self, declarations: list[ast.Declaration]) -> None:
        blocks = [d for d in declarations if isinstance(d, ast.GlobalBlock)]
        if not blocks:
            return
        self.list = Item(
            Kind.LIST, self.source.stem, f"{self.library}list.{self.source.stem}".casefold(), self.source, 0
        )
        self.list.offset, self.list.library = blocks[0].block.pos, self.library
        self.list.decl = blocks[0]
        for block in blocks:
            named = block.namespace is not None and bool(block.namespace.name)
            self._globals(block.block, None if named else self.list, block.namespace)
