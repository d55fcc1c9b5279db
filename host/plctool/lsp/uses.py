"""What each word of a text stands for: one walk over its tokens, which also works on a text that is not finished."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import Token
from plctool.iec.types import ELEMENTARY
from plctool.lsp.items import BODIES, CALLED, Item, Kind
from plctool.lsp.names import Names, Shape
from plctool.lsp.outline import SECTIONS, UNITS
from plctool.lsp.tree import Tree

_TYPE_FOLLOWS = frozenset(("_OF", "_EXTENDS", "_IMPLEMENTS", "REF_TO"))
_VALUE_ENDS = frozenset(("IDENT", "_RSQB", "_RPAR", "_CARET"))
_UNIT_ENDS = frozenset(
    f"_END_{kind}" for kind in (
        "PROGRAM", "FUNCTION", "FUNCTION_BLOCK", "CLASS", "INTERFACE", "METHOD", "ACTION", "PROPERTY", "GET", "SET",
        "TEST", "SETUP", "TEARDOWN",
    )
)  # fmt: skip


_OF_TESTS = ("TEST", "SETUP", "TEARDOWN")


@dataclass(frozen=True, slots=True)
class Use:
    """A word that stands for an item. `declares`: it is its declaration; `writes`: it gets a value; `calls`: it is
    called; `unit`: the key of the unit or member that it is in."""

    offset: int
    length: int
    key: str
    declares: bool = False
    writes: bool = False
    calls: bool = False
    unit: str = ""


@dataclass(slots=True)
class Argument:
    """`name`: that of the parameter, if it is written."""

    offset: int
    name: str = ""


@dataclass(slots=True)
class Site:
    """A call: `opening` and `closing` are offsets of the parentheses; -1 for one that is not there."""

    callee: str
    unit: str
    opening: int
    closing: int = -1
    arguments: list[Argument] = field(default_factory=list)


@dataclass(slots=True)
class Frame:
    """An open bracket. `callee` and `shape`: what is called, or the structure that gets values; `before`: the type of
    what stands before the bracket; `parameter`: that of the last name with := in it."""

    kind: str
    callee: Item | None = None
    shape: Shape | None = None
    before: Shape | None = None
    before_item: Item | None = None
    parameter: Item | None = None
    site: Site | None = None
    is_type: bool = False
    commas: int = 0
    comparand: Shape | None = None


class Walk:
    """Goes over tokens. After it `uses` and `sites` are complete, and the other attributes say what the last token was
    followed by: what completion needs."""

    def __init__(self, tree: Tree, names: Names) -> None:
        self.tree = tree
        self.names = names
        self.uses: list[Use] = []
        self.sites: list[Site] = []
        self.units: list[Item] = []
        self.frames: list[Frame] = []
        self.section = ""  # VAR, GLOBAL ..., STRUCT or TYPE, in which the token is
        self.is_type = False  # a type is expected
        self.item: Item | None = None  # what stands before, and its type
        self.shape: Shape | None = None
        self.declared: Item | None = None  # the variable of the line
        self.target: Shape | None = None  # what gets the value
        self.comparand: Shape | None = None  # what stands on the left of a comparison
        self.previous = ""  # the type of the token before
        self._sections: list[str] = []
        self._after_dot = False
        self._unit_word = ""
        self._headers = False
        self._lone_dot = False
        self._configures = False  # in a CONFIGURATION
        self._own = ""  # THIS or SUPER, if that was the last word

    @property
    def unit(self) -> Item | None:
        """The unit or member that the token is in."""
        return self.units[-1] if self.units else None

    def run(self, tokens: Sequence[Token]) -> None:
        """Goes over tokens of the tree that follow each other, from the beginning of an outermost block."""
        for at, token in enumerate(tokens):
            kind = token.type
            if kind == "IDENT":
                self._word(token, tokens[at + 1].type if at + 1 < len(tokens) else "")
            elif kind == "TYPED":
                self._typed(token)
            elif kind in ("STRING", *_OF_TESTS) and (test := self.tree.items.declared.get(token.pos)) is not None:
                if kind in _OF_TESTS:
                    self._begin_unit(kind)
                self.units[:] = [test]
            elif kind in ("NUMBER", "STRING", "TRUE", "FALSE", "DIRECT", "NULL"):
                self._argument(token)
                if not (kind == "NUMBER" and self._after_dot):
                    self._nothing()
                else:
                    self.item, self.shape = None, None  # a bit
            else:
                self._other(kind, token)
            self._after_dot = kind == "_DOT"
            self.previous = kind

    def _nothing(self) -> None:
        self.item, self.shape = None, None

    # ---- words ----

    def _word(self, token: Token, following: str) -> None:
        declared = self.tree.items.declared.get(token.pos)
        if declared is not None and not self._after_dot:
            self._declaration(token, declared)
            return
        if self._unit_word and self.previous in (*UNITS, "MODIFIER"):
            unit = self._lost_unit(token)
            self._unit_word = ""
            if unit is not None:
                self.units.append(unit)
                self._use(token.pos, len(token.text), unit, declares=True)
            return
        self._unit_word = ""
        name = token.text
        frame = self.frames[-1] if self.frames else None
        if self._after_dot:
            item = self._part(name)
        elif frame is not None and following in ("_ASSIGN", "_ARROW") and self.previous in ("_LPAR", "_COMMA"):
            self._parameter(frame, token)
            return
        else:
            self._argument(token)
            item = self._task(name) if self.previous == "_WITH" else self._looked_up(name)
        if item is not None:
            self.names.remember(item)
            writes = following in ("_ASSIGN", "ATTEMPT") and not self.section
            self._use(token.pos, len(name), item, writes=writes, calls=following == "_LPAR")
        self.item = item
        self.shape = None if item is None else self.names.shape(item)

    def _task(self, name: str) -> Item | None:
        found = (o.inner.get(name.casefold()) for o in self.names.others if o.kind is Kind.CONFIGURATION)
        return next((item for item in found if item is not None), None)

    def _part(self, name: str) -> Item | None:
        """What stands after a point; one that nothing stands before leads to a global variable."""
        if self._lone_dot:
            return self.names.value(f".{name}", self.unit)
        return None if self.shape is None else self.names.part(self.shape, name.casefold())

    def _looked_up(self, name: str) -> Item | None:
        upper, home = name.upper(), self.unit
        self._own = upper if upper in ("THIS", "SUPER") else ""
        if self._own or upper in ELEMENTARY:
            return None
        type_first = self.is_type and not any(f.kind == "_LSQB" or not f.is_type for f in self.frames)
        return self.names.value(name, home, type_first=type_first)

    def _declaration(self, token: Token, item: Item) -> None:
        self._use(token.pos, len(token.text), item, declares=True)
        self._unit_word = ""
        if item.kind in CALLED or item.kind in (Kind.PROPERTY, Kind.INTERFACE, Kind.TEST):
            if self.units and (self.units[-1] is item or item.owner is None):
                self.units.clear()
            self.units.append(item)
            self._headers = True
        else:
            self.declared = item
        self.item, self.shape = None, None

    def _lost_unit(self, token: Token) -> Item | None:
        """The unit whose declaration has errors."""
        key = token.text.casefold()
        if self._unit_word in ("METHOD", "ACTION", "PROPERTY") and self.units:
            return self.names.member(self.units[0], key)
        self.units.clear()
        return self.names.units.get(key)

    def _parameter(self, frame: Frame, token: Token) -> None:
        """`name :=` or `name =>` in a call or in the value of a structure."""
        key = token.text.casefold()
        item = None
        if frame.callee is not None and frame.callee.kind in CALLED:
            item = self.names.member(frame.callee, key)
        if item is None and frame.shape is not None:
            item = self.names.part(frame.shape, key)
        frame.parameter = item
        if frame.site is not None:
            frame.site.arguments.append(Argument(token.pos, token.text))
        if item is not None:
            self._use(token.pos, len(token.text), item)
        self.item = item
        self.shape = None if item is None else self.names.shape(item)

    def _typed(self, token: Token) -> None:
        """`Color#Red`, `Plant.Color#Red`"""
        prefix, _, rest = token.text.partition("#")
        inner = self._part(prefix) if self._after_dot else None
        if not self._after_dot:
            self._argument(token)
        self._nothing()
        if prefix.upper() in ELEMENTARY or not prefix[:1].isalpha():
            return
        item = inner or self.names.unit(prefix, self.unit)
        if item is None:
            return
        self._use(token.pos, len(prefix), item)
        value = self.names.part(self.names.shape(item), rest.casefold())
        if value is not None:
            self._use(token.pos + len(prefix) + 1, len(rest), value)

    def _use(self, offset: int, length: int, item: Item, **more: bool) -> None:
        self.names.remember(item)
        unit = self.units[-1].key if self.units else ""
        self.uses.append(Use(offset, length, item.key, unit=unit, **more))

    def _argument(self, token: Token) -> None:
        """Notes where an argument without a name begins."""
        frame = self.frames[-1] if self.frames else None
        if frame is not None and frame.site is not None and self.previous in ("_LPAR", "_COMMA"):
            frame.site.arguments.append(Argument(token.pos))

    # ---- the others ----

    def _other(self, kind: str, token: Token) -> None:
        if kind == "_DOT":
            self._lone_dot = self.previous not in _VALUE_ENDS
            if self._lone_dot:
                self._nothing()
        elif kind == "_CARET":
            self.shape = self.names.pointed_to(self.shape) if self.shape is not None else self._own_instance()
            self.item = None
        elif kind in ("_LPAR", "_LSQB"):
            self._open(kind, token)
        elif kind in ("_RPAR", "_RSQB"):
            self._close(kind, token)
        elif kind == "_ASSIGN":
            self._assign()
        elif kind == "_SEMI":
            self._end_of_line()
        elif kind == "_COLON":
            self.is_type = bool(self.section or self._headers or self._configures) and not self.frames
            self._nothing()
        elif kind == "_COMMA":
            if self.frames:
                self.frames[-1].commas += 1
                self.frames[-1].parameter = None
                self.frames[-1].comparand = None
            if self.frames or not (self.section or self._headers):
                self._nothing()
        elif kind in _TYPE_FOLLOWS or (kind == "_TO" and self.previous in ("POINTER", "REFERENCE")):
            self.is_type = kind not in ("_OF",) or self.is_type
            if kind == "_OF":
                self._nothing()
        elif kind in ("EQ", "OP", "SIGN", "NOT"):
            self._argument(token)
            compares = kind == "EQ" or token.text in ("<>", "<", ">", "<=", ">=")
            self.comparand = self.shape if compares else None
            self._nothing()
        elif kind in SECTIONS or kind in ("STRUCT", "UNION", "TYPE"):
            self._sections.append(kind)
            self._enter(kind)
        elif kind in ("_END_VAR", "_END_STRUCT", "_END_UNION", "_END_TYPE"):
            if self._sections:
                self._sections.pop()
            self._enter(self._sections[-1] if self._sections else "")
        elif kind in ("CONFIGURATION", "_END_CONFIGURATION"):
            self._configures = kind == "CONFIGURATION"
            self.units.clear()
            self._end_of_line()
        elif kind == "PROGRAM" and self._configures:
            self._nothing()
        elif kind in _UNIT_ENDS:
            self._end_of_unit(kind)
        elif kind in UNITS:
            self._begin_unit(kind)
        else:
            self._nothing()
            if kind != "MODIFIER":
                self.comparand = None
                if kind not in ("QUALIFIER", "EDGE", "_AT", "ARRAY", "POINTER", "REFERENCE", "TEXT"):
                    self._headers = False

    def _own_instance(self) -> Shape | None:
        """What `THIS^` and `SUPER^` are."""
        outer, word, self._own = self.units[0] if self.units else None, self._own, ""
        if outer is None or not word:
            return None
        if word == "THIS":
            return Shape(item=outer)
        bases = self.names.bases(outer)
        return Shape(item=bases[0]) if bases else None

    def _begin_unit(self, kind: str) -> None:
        self._unit_word = kind
        self.frames.clear()
        self._sections.clear()
        self._enter("")
        self._headers = True
        if kind in ("GET", "SET") and self.units and self.units[-1].kind is Kind.PROPERTY:
            self._unit_word = ""

    def _end_of_unit(self, kind: str) -> None:
        self.frames.clear()
        self._sections.clear()
        self._enter("")
        self._headers = False
        if kind in ("_END_GET", "_END_SET"):
            return
        inner = kind in ("_END_METHOD", "_END_ACTION", "_END_PROPERTY")
        if inner and self.units and self.units[-1].kind in BODIES:
            self.units.pop()
        elif not inner:
            self.units.clear()

    def _enter(self, section: str) -> None:
        self.section = section
        self.is_type = False
        self._headers = False
        self._end_of_line()

    def _end_of_line(self) -> None:
        if not self.section and self.frames:
            self.frames.clear()  # one that was not closed
        self.is_type = False
        self._headers = False
        self.target = self.comparand = self.declared = None
        self._nothing()

    def _open(self, kind: str, token: Token) -> None:
        if kind == "_LPAR":
            self._argument(token)
        frame = Frame(kind, before=self.shape, before_item=self.item, is_type=self.is_type, comparand=self.comparand)
        if kind == "_LPAR" and self.previous in _VALUE_ENDS and not self.section:
            frame.callee = self._callee()
            frame.shape = self.shape
            if frame.callee is not None:
                unit = self.units[-1].key if self.units else ""
                self.names.remember(frame.callee)
                frame.site = Site(frame.callee.key, unit, token.pos)
                self.sites.append(frame.site)
        elif kind == "_LPAR" and self.section:
            frame.shape = self._initialised()
            frame.is_type = False
        elif kind == "_LSQB" and self.section and not self.is_type:
            frame.shape = self.names.element(self._initialised())
        self.frames.append(frame)
        self.comparand = None
        self._nothing()

    def _initialised(self) -> Shape | None:
        """The type of what gets the value that begins here."""
        frame = self.frames[-1] if self.frames else None
        if frame is None:
            return None if self.declared is None else self.names.shape(self.declared)
        if frame.parameter is not None:
            return self.names.shape(frame.parameter)
        return frame.shape if frame.kind == "_LSQB" else None

    def _callee(self) -> Item | None:
        """What is called: a function, method or action, or the block of an instance."""
        if self.item is not None and self.item.kind in CALLED:
            return self.item
        shape = self.names.dereferenced(self.shape)
        if shape is None and self.item is not None:
            return None
        return shape.item if shape is not None and shape.item is not None and shape.item.kind in CALLED else None

    def _close(self, kind: str, token: Token) -> None:
        if not self.frames:
            self._nothing()
            return
        frame = self.frames.pop()
        if frame.site is not None:
            frame.site.closing = token.pos
        self.comparand = frame.comparand
        if kind == "_RSQB":
            self.item = None
            self.shape = self.names.element(frame.before) if frame.before is not None else None
        elif frame.callee is not None:
            callee = frame.callee
            has_result = callee.kind in (Kind.FUNCTION, Kind.METHOD) and callee.spec is not None
            self.item, self.shape = None, self.names.shape(callee) if has_result else None

    def _assign(self) -> None:
        frame = self.frames[-1] if self.frames else None
        if frame is None and not self.section:
            self.target = self.shape
        self.is_type = False
        self._nothing()

    def expected(self) -> Shape | None:
        """The type of the value that is expected next, as far as it is known."""
        if self.comparand is not None:
            return self.comparand
        frame = self.frames[-1] if self.frames else None
        if frame is not None and frame.kind == "_LPAR":
            if frame.parameter is not None:
                return self.names.shape(frame.parameter)
            if frame.callee is not None:
                inputs = [p for p in frame.callee.parameters() if p.section is not ast.Section.VAR_OUTPUT]
                return self.names.shape(inputs[frame.commas]) if frame.commas < len(inputs) else None
            return frame.comparand or self.target
        if self.section and self.declared is not None:
            return self.names.shape(self.declared)
        return self.target


def uses_of(tree: Tree, names: Names) -> Walk:
    """Returns what the words of a text stand for."""
    walk = Walk(tree, names)
    walk.run(tree.tokens)
    return walk
