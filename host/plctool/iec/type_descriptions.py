"""Types in the symbol file: by name, each described by those it consists of."""

from __future__ import annotations

from typing import Any

from plctool.iec.types import (
    ELEMENTARY,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    InterfaceType,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)

_POINTERS: dict[str, type[PointerType]] = {
    "REF_TO": PointerType,
    "POINTER TO": RawPointerType,
    "REFERENCE TO": ReferenceType,
}


def describe(t: Type, types: dict[str, Any]) -> None:
    """Adds a type and those it consists of to `types`, by name, however deep these are."""
    waiting = [t]
    while waiting:
        t = waiting.pop()
        if not isinstance(t, Elementary) and t.name not in types:
            waiting += reversed(_describe(t, types))


def _describe(t: Type, types: dict[str, Any]) -> list[Type]:
    """Adds a type alone; returns what it consists of."""
    entry: dict[str, Any] = {}
    types[t.name] = entry
    if isinstance(t, StringType):
        entry.update(kind="string", length=t.length, wide=t.wide)
    elif isinstance(t, EnumType):
        entry.update(kind="enum", base=t.base.name, values=t.values)
    elif isinstance(t, SubrangeType):
        entry.update(kind="subrange", base=t.base.name, low=t.low, high=t.high)
    elif isinstance(t, OpenArrayType):
        entry.update(kind="open array", element=t.element.name, dimensions=len(t.bounds))
        return [t.element]
    elif isinstance(t, ArrayType):
        entry.update(kind="array", element=t.element.name, bounds=[list(b) for b in t.bounds])
        return [t.element]
    elif isinstance(t, InterfaceType):
        entry.update(kind="interface")
    elif isinstance(t, PointerType):
        entry.update(kind=t.name.removesuffix(f" {t.target}"), target=t.target.name)
        return [t.target]
    elif isinstance(t, StructType):
        entry.update(kind="struct", size=t.size, align=t.align, union=t.union)
        entry["fields"] = [_field_entry(f) for f in t.fields]
        if t.properties:
            entry["properties"] = t.properties
        return [f.type for f in t.fields]
    return []


def _field_entry(f: Field) -> list[Any]:
    """Name, type and offset; of a BIT also its bit."""
    return [f.name, f.type.name, f.offset, *([] if f.bit is None else [f.bit])]


class DescribedTypes:
    """Types by name, made from their description when they are first asked for."""

    def __init__(self, described: dict[str, Any]) -> None:
        self._described = described
        self._made: dict[str, Type] = dict(ELEMENTARY)

    def get(self, name: str) -> Type:
        made = self._made.get(name)
        if made is None:
            made = self._make(name, self._described[name])
            self._made[name] = made
        return made

    def _make(self, name: str, entry: dict[str, Any]) -> Type:
        kind = entry["kind"]
        if kind == "string":
            return StringType(entry["length"], entry["wide"])
        if kind == "enum":
            return EnumType(name, ELEMENTARY[entry["base"]], entry["values"])
        if kind == "subrange":
            return SubrangeType(name, ELEMENTARY[entry["base"]], entry["low"], entry["high"])
        if kind == "array":
            return ArrayType(self.get(entry["element"]), tuple((low, high) for low, high in entry["bounds"]))
        if kind == "open array":
            return OpenArrayType(self.get(entry["element"]), ((0, -1),) * entry["dimensions"])
        if kind == "interface":
            return InterfaceType(StructType(name))
        if kind in _POINTERS:
            return _POINTERS[kind](self.get(entry["target"]))
        struct = StructType(name, union=entry["union"], _size=entry["size"], _align=entry["align"])
        struct.properties = entry.get("properties", [])
        self._made[name] = struct  # references may lead back to it
        struct.fields = [
            Field(n, self.get(t), offset, bit=bit[0] if bit else None) for n, t, offset, *bit in entry["fields"]
        ]
        return struct
