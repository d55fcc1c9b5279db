"""IEC 61131-3 types and their memory layout.

The layout is the same on every target (natural alignment, little-endian), so offsets in the symbol file, in the
image and
in the monitoring service mean the same everywhere. TIME is a signed 32-bit count of milliseconds, STRING[n] is n+1
bytes, NUL-terminated, as in the CODESYS family.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection
from dataclasses import field
from enum import Enum
from operator import attrgetter

from plctool.records import dataclass


class Kind(Enum):
    """What an elementary type is, as far as arithmetic is concerned."""

    BOOL = "bool"
    INT = "int"  # ANY_INT: arithmetic
    BIT = "bit"  # ANY_BIT without BOOL: BYTE..LWORD
    REAL = "real"
    TIME = "time"  # durations: TIME [ms, i32], LTIME [ns, i64]
    DATE = "date"  # DATE, TOD, DT and their L variants
    CHAR = "char"


MAX_ALIGN = 8  # bytes: no type wants more
BITS_OF_BYTE = 8


class Type:
    """Base of all types. `size` and `align` are in bytes."""

    name: str

    @property
    def size(self) -> int:
        raise NotImplementedError

    @property
    def align(self) -> int:
        raise NotImplementedError

    def __str__(self) -> str:
        return self.name


@dataclass(eq=False)
class Elementary(Type):
    """A scalar; there is one of each. `type_class` is the number monitoring uses (codesys-v3-protocol 4.9,
    SysInternalLib enum order)."""

    name: str
    kind: Kind
    bits: int  # BOOL: 8 in memory, value 0 or 1
    signed: bool
    type_class: int

    @property
    def size(self) -> int:
        return self.bits // 8

    @property
    def align(self) -> int:
        return self.size


BOOL = Elementary("BOOL", Kind.BOOL, 8, False, 0)
BYTE = Elementary("BYTE", Kind.BIT, 8, False, 2)
WORD = Elementary("WORD", Kind.BIT, 16, False, 3)
DWORD = Elementary("DWORD", Kind.BIT, 32, False, 4)
LWORD = Elementary("LWORD", Kind.BIT, 64, False, 5)
SINT = Elementary("SINT", Kind.INT, 8, True, 6)
INT = Elementary("INT", Kind.INT, 16, True, 7)
DINT = Elementary("DINT", Kind.INT, 32, True, 8)
LINT = Elementary("LINT", Kind.INT, 64, True, 9)
USINT = Elementary("USINT", Kind.INT, 8, False, 10)
UINT = Elementary("UINT", Kind.INT, 16, False, 11)
UDINT = Elementary("UDINT", Kind.INT, 32, False, 12)
ULINT = Elementary("ULINT", Kind.INT, 64, False, 13)
REAL = Elementary("REAL", Kind.REAL, 32, True, 14)
LREAL = Elementary("LREAL", Kind.REAL, 64, True, 15)
TIME = Elementary("TIME", Kind.TIME, 32, True, 18)
LTIME = Elementary("LTIME", Kind.TIME, 64, True, 37)
DATE = Elementary("DATE", Kind.DATE, 32, False, 19)  # s since 1970-01-01, a multiple of a day
TOD = Elementary("TOD", Kind.DATE, 32, False, 21)  # ms since midnight
DT = Elementary("DT", Kind.DATE, 32, False, 20)  # s since 1970-01-01
LDATE = Elementary("LDATE", Kind.DATE, 64, False, 19)  # ns, as the other L types
LTOD = Elementary("LTOD", Kind.DATE, 64, False, 21)
LDT = Elementary("LDT", Kind.DATE, 64, False, 20)
CHAR = Elementary("CHAR", Kind.CHAR, 8, False, 2)  # a character of a STRING
WCHAR = Elementary("WCHAR", Kind.CHAR, 16, False, 3)  # a UTF-16 code unit

ELEMENTARY: dict[str, Elementary] = {
    t.name: t
    for t in (
        BOOL, BYTE, WORD, DWORD, LWORD, SINT, INT, DINT, LINT, USINT, UINT, UDINT, ULINT, REAL, LREAL, TIME, LTIME,
        DATE, TOD, DT, LDATE, LTOD, LDT, CHAR, WCHAR,
    )
} | {
    "TIME_OF_DAY": TOD, "LTIME_OF_DAY": LTOD, "DATE_AND_TIME": DT, "LDATE_AND_TIME": LDT,
    "__XWORD": LWORD, "__UXINT": ULINT, "__XINT": LINT, "XWORD": LWORD, "UXINT": ULINT, "XINT": LINT,
}  # fmt: skip
"""By name, in capitals; a type may have several names. The last six are integers as wide as a pointer in memory."""

DEFAULT_STRING_LENGTH = 80
MAX_CHOICES = 12  # values of an enumeration that a message lists
CLASS_NUMBER = "%class"  # hidden member with the number of a class; no identifier, so nothing else has its name
MAX_SIZE = 0x7FFF_FFFF  # of a variable and of an area; offsets are signed 32-bit numbers on the targets


@dataclass(frozen=True)
class StringType(Type):
    """STRING[length]: `length` characters and a NUL. `wide`: WSTRING[length], UTF-16 in two bytes per character."""

    length: int
    wide: bool = False

    @property
    def name(self) -> str:  # type: ignore[override]
        return f"{self.keyword}[{self.length}]"

    @property
    def keyword(self) -> str:
        """STRING or WSTRING."""
        return "WSTRING" if self.wide else "STRING"

    @property
    def character(self) -> Elementary:
        """CHAR or WCHAR."""
        return WCHAR if self.wide else CHAR

    @property
    def unit(self) -> int:
        """Bytes of a character."""
        return 2 if self.wide else 1

    @property
    def size(self) -> int:
        return (self.length + 1) * self.unit

    @property
    def align(self) -> int:
        return self.unit


@dataclass(eq=False)
class EnumType(Type):
    name: str
    base: Elementary
    values: dict[str, int]  # in order of declaration, names as declared
    strict: bool = False  # only its own values may be assigned
    named: bool = False  # TO_STRING gives the name of a value, not its number

    @property
    def inline(self) -> bool:
        """Whether it is declared with a variable, without a name of its own."""
        return self.name.startswith("(")

    def has(self, name: str) -> bool:
        """Whether it has a value of that name."""
        return name.casefold() in map(str.casefold, self.values)

    @property
    def choices(self) -> str:
        """`Red (0), Green (1)`: what there is, for messages."""
        shown = [f"{name} ({value})" for name, value in list(self.values.items())[:MAX_CHOICES]]
        return ", ".join(shown) + ", ..." * (len(self.values) > MAX_CHOICES)

    @property
    def size(self) -> int:
        return self.base.size

    @property
    def align(self) -> int:
        return self.base.align


@dataclass(frozen=True)
class SubrangeType(Type):
    """`name` is the declared name or 'INT(1..10)'. Values outside low..high raise ARRAYBOUNDS at assignment."""

    name: str
    base: Elementary
    low: int
    high: int

    @property
    def size(self) -> int:
        return self.base.size

    @property
    def align(self) -> int:
        return self.base.align


@dataclass(frozen=True)
class ArrayType(Type):
    element: Type
    bounds: tuple[tuple[int, int], ...]  # inclusive, row-major: the last index runs fastest

    @property
    def name(self) -> str:  # type: ignore[override]
        return "ARRAY[" + ",".join(f"{lo}..{hi}" for lo, hi in self.bounds) + f"] OF {self.element}"

    @property
    def count(self) -> int:
        n = 1
        for lo, hi in self.bounds:
            n *= hi - lo + 1
        return n

    @property
    def size(self) -> int:
        return self.count * self.element.size

    @property
    def align(self) -> int:
        return self.element.align


@dataclass(frozen=True)
class OpenArrayType(ArrayType):
    """ARRAY[*] of a VAR_IN_OUT: the bounds come with each call, in variables beside it; `bounds` are empty ranges."""

    @property
    def name(self) -> str:  # type: ignore[override]
        return "ARRAY[" + ",".join("*" for _ in self.bounds) + f"] OF {self.element}"


@dataclass(frozen=True)
class PointerType(Type):
    """REF_TO; always 8 bytes in memory so that layouts agree on all targets."""

    target: Type

    @property
    def name(self) -> str:  # type: ignore[override]
        return f"REF_TO {self.target}"

    @property
    def size(self) -> int:
        return 8

    @property
    def align(self) -> int:
        return 8


@dataclass(frozen=True)
class RawPointerType(PointerType):
    """POINTER TO: a REF_TO that takes any address and can be computed with, in bytes."""

    @property
    def name(self) -> str:  # type: ignore[override]
        return f"POINTER TO {self.target}"


@dataclass(frozen=True)
class InterfaceType(PointerType):
    """A variable of an INTERFACE: the address of an instance that implements it, or NULL. `target` has no members; it
    stands for whatever implements the interface."""

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.target.name


class ReferenceType(PointerType):
    """REFERENCE TO: a pointer that is followed wherever it is used; the typed program holds it as a DerefPlace."""

    @property
    def name(self) -> str:  # type: ignore[override]
        return f"REFERENCE TO {self.target}"


class Keep(Enum):
    """Whether a declaration says that a variable keeps its value over a power cut. PERSISTENT ones keep it over a cold
    reset and a download, too."""

    UNSAID = ""
    NON_RETAIN = "NON_RETAIN"
    RETAIN = "RETAIN"
    PERSISTENT = "PERSISTENT"

    @staticmethod
    def of(qualifiers: Collection[str]) -> Keep:
        """What the qualifiers of a section say; the strongest counts."""
        return next((k for k in (Keep.PERSISTENT, Keep.RETAIN, Keep.NON_RETAIN) if k.value in qualifiers), Keep.UNSAID)

    @property
    def kept(self) -> bool:
        """Whether the value is kept."""
        return self in (Keep.RETAIN, Keep.PERSISTENT)

    def of_member(self, own: Keep) -> Keep:
        """Of a member that says `own`, in a variable of this kind: what it says itself counts, but a RETAIN member is
        PERSISTENT in a PERSISTENT variable."""
        if own is Keep.UNSAID or (own is Keep.RETAIN and self is Keep.PERSISTENT):
            return self
        return own


@dataclass
class Field:
    """A member of a struct or function block; `offset` in bytes is set by `lay_out`. `alias`: a second name. `bit`: of
    a BIT, its number in the byte at `offset` (-1 before `lay_out`); `type` is BOOL then."""

    name: str
    type: Type
    offset: int = -1
    alias: str = ""
    keep: Keep = Keep.UNSAID
    bit: int | None = None

    @property
    def hidden(self) -> bool:
        """Whether it is our own, such as the number of a class: its name is no identifier."""
        return self.name.startswith("%")


@dataclass(eq=False)
class StructType(Type):
    """Members in order of declaration. Function block instances are StructTypes as well (see typed.Pou.instance).
    The members of a `union` share their memory. `base`: of a derived function block, whose members come first.
    `interfaces`: all that a block or interface names itself, and what those extend."""

    name: str
    fields: list[Field] = field(default_factory=list)
    union: bool = False
    _size: int = 0
    _align: int = 1
    base: StructType | None = None
    interfaces: list[StructType] = field(default_factory=list)
    properties: list[str] = field(default_factory=list)  # what looks like a member but is not
    pack: int = MAX_ALIGN  # members are at multiples of this [bytes] or of what their type wants, whichever is less
    of_unknown: bool = False  # extends or implements something that is not declared anywhere

    @property
    def root(self) -> StructType:
        """The block it is derived from in the end; itself for most."""
        return self if self.base is None else self.base.root

    def conforms(self, other: Type) -> bool:
        """Whether an instance can stand where `other` is wanted: the type itself, a base of it or an interface."""
        if other is self or other in self.interfaces:
            return True
        return self.base is not None and self.base.conforms(other)

    def may_conform(self, other: Type) -> bool:
        """As `conforms`; also True where an unknown base or interface may be the reason."""
        return self.conforms(other) or self.of_unknown or (self.base is not None and self.base.may_conform(other))

    def lay_out(self, *, behind_base: bool = False) -> None:
        """Gives every field its offset. Call once, when all field types are known and laid out. `behind_base`: own
        fields do not use the padding at the end of the base, which is copied as a whole when it is assigned."""
        end, align, own = 0, 1, self.fields
        if behind_base and self.base is not None:
            end, align, own = self.base.size, self.base.align, self.fields[len(self.base.fields) :]
            for f, of_base in zip(self.fields, self.base.fields, strict=False):
                f.offset = of_base.offset
        free = BITS_OF_BYTE  # the next bit of the last byte
        for f in own:
            multiple = min(f.type.align, self.pack)
            f.offset = 0 if self.union else align_up(end, multiple)
            if f.bit is None or self.union:
                free = BITS_OF_BYTE
                f.bit = None if f.bit is None else 0
            elif free < BITS_OF_BYTE:
                f.offset, f.bit, free = end - 1, free, free + 1
            else:
                f.bit, free = 0, 1
            end = max(end, f.offset + f.type.size)
            align = max(align, multiple)
        self._align = align
        self._size = align_up(max(end, 1), align)

    def padding_after(self, offset: int, size: int) -> int:
        """How many bytes between the field there and the next one belong to none. None after the last: a block that
        is derived may have variables there."""
        if self.union:
            return 0
        end = offset + size
        following = bisect_left(self.fields, end, key=attrgetter("offset"))
        return self.fields[following].offset - end if following < len(self.fields) else 0

    def member(self, name: str) -> Field | None:
        key = name.casefold()
        return next((f for f in self.fields if key in (f.name.casefold(), f.alias.casefold())), None)

    @property
    def size(self) -> int:
        return self._size

    @property
    def align(self) -> int:
        return self._align


def alignment_at(offset: int, align: int) -> int:
    """What an address is a multiple of that is `offset` bytes after a multiple of `align`, in bytes."""
    return min(align, offset & -offset) if offset else align


def align_up(value: int, align: int) -> int:
    """The next multiple of `align` (a power of two or any positive number) at or above `value`."""
    return (value + align - 1) // align * align


def is_scalar(t: Type) -> bool:
    """Whether values of the type fit a register (everything but strings, arrays and structs)."""
    return isinstance(t, Elementary | EnumType | SubrangeType | PointerType)


def base_of(t: Type) -> Type:
    """The elementary type of an enum or subrange; other types are returned as they are."""
    return t.base if isinstance(t, EnumType | SubrangeType) else t
