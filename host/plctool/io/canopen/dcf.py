"""Device configuration files (DCF), CiA 306: what one writes into a node, and the one of a node of a description."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from plctool.io.canopen.data_types import DataType, Value
from plctool.io.canopen.eds import WRITABLE, Eds, Entry
from plctool.io.canopen.ini import Section, read_sections
from plctool.io.mistakes import Mistakes

_LAID_OUT = range(0x1400, 0x1C00)  # parameters and mapping of PDOs, which the tool lays out
_WATCHING = (0x100C, 0x100D, 0x1017)  # keys of the description
_COMMANDS = (0x1010, 0x1011)
_UNSIGNED32 = 7
_COMMUNICATION = range(0x1000, 0x2000)

Write = tuple[int, int, bytes]


def heartbeat_ms(eds: Eds, node: int) -> int | None:
    """The period of the heartbeat (1017) that a DCF gives, None if it gives none."""
    entry = eds.entry(0x1017)
    value = None if entry is None or entry.value is None else entry.value.at(node)
    return value if isinstance(value, int) and value > 0 else None


def writes_of_dcf(eds: Eds, node: int, mistakes: Mistakes) -> Iterator[Write]:
    """The values of a DCF in the order of their indices, without those of PDOs, heartbeat and guarding."""
    for index in sorted(eds.objects):
        if index in _LAID_OUT or index in _WATCHING or index in _COMMANDS:
            continue
        for entry in eds.objects[index].entries.values():
            if entry.value is None or entry.access not in WRITABLE:
                continue
            if entry.type is None:
                mistakes.error(entry.pos, f"{entry.place} has a ParameterValue, but no DataType that is known")
            else:
                yield index, entry.sub, entry.type.encode(entry.value.at(node))


@dataclass(frozen=True)
class NodeOf:
    """Whose DCF it is. `bit_rate`: kbit/s."""

    file_name: str
    eds_name: str
    number: int
    name: str
    network: int
    network_name: str
    bit_rate: int


def dcf_of(eds: Eds, writes: Iterable[Write], node: NodeOf) -> str:
    """The text of an EDS with the values that a manager writes, and section DeviceComissioning."""
    text = _Text(eds)
    text.put_in("FileInfo", {"FileName": node.file_name, "LastEDS": node.eds_name})
    last = {(index, sub): data for index, sub, data in writes}
    for (index, sub), data in last.items():
        text.put_value(index, sub, data)
    text.put_in(
        "DeviceComissioning",
        {
            "NodeID": str(node.number), "NodeName": node.name, "Baudrate": str(node.bit_rate),
            "NetNumber": str(node.network), "NetworkName": node.network_name, "CANopenManager": "0",
        },
    )  # fmt: skip
    return text.result()


@dataclass
class _Text:
    """The lines of a file, and what is changed of them."""

    eds: Eds
    sections: dict[str, Section] = field(init=False)
    replaced: dict[int, str] = field(default_factory=dict)  # by the number of a line, from 1
    inserted: dict[int, list[str]] = field(default_factory=dict)  # after a line
    added: dict[str, list[str]] = field(default_factory=dict)  # sections

    def __post_init__(self) -> None:
        self.sections = read_sections(self.eds.file, self.eds.text, Mistakes())

    def put_in(self, name: str, values: dict[str, str]) -> None:
        """Sets keys of a section."""
        section = self.sections.get(name.casefold())
        for key, value in values.items():
            line = f"{key}={value}"
            item = None if section is None else section.items.get(key.casefold())
            if section is None:
                self.added.setdefault(name, []).append(line)
            elif item is not None:
                self.replaced[item.pos.line] = line
            else:
                self.inserted.setdefault(section.pos.line, []).append(line)

    def put_value(self, index: int, sub: int, data: bytes) -> None:
        """Sets the value of an entry; one that the EDS does not have gets a section."""
        entry = self.eds.entry(index, sub)
        value = _value_text(index, None if entry is None else entry.type, data)
        section = self._section_of(entry, index, sub)
        if section is not None:
            self.put_in(section, {"ParameterValue": value})
        elif entry is not None:
            self.put_in(f"{index:04X}Value", {str(sub): value})
        else:
            self._add_entry(index, sub, value)

    def _section_of(self, entry: Entry | None, index: int, sub: int) -> str | None:
        if entry is None:
            return None
        own = self.sections.get(f"{index:04x}sub{sub:x}")
        if own is None and sub == 0 and not self._is_compact(index):
            own = self.sections.get(f"{index:04x}")
        return None if own is None else own.name

    def _is_compact(self, index: int) -> bool:
        return self.sections[f"{index:04x}"].get("CompactSubObj") is not None

    def _add_entry(self, index: int, sub: int, value: str) -> None:
        self.added[f"{index:04X}sub{sub:X}"] = [
            f"ParameterName=Entry {sub}", "ObjectType=0x7", f"DataType=0x{_UNSIGNED32:04X}", "AccessType=rw",
            f"ParameterValue={value}", "PDOMapping=0",
        ]  # fmt: skip
        found = self.eds.objects.get(index)
        if found is not None:
            more = sum(name.startswith(f"{index:04X}sub") for name in self.added)
            self.put_in(f"{index:04X}", {"SubNumber": str(len(found.entries) + more)})

    def result(self) -> str:
        lines: list[str] = []
        for number, line in enumerate(self.eds.text.rstrip("\n").split("\n"), 1):
            lines += [self.replaced.get(number, line), *self.inserted.get(number, ())]
        for name, values in self.added.items():
            lines += ["", f"[{name}]", *values]
        return "\n".join(lines) + "\n"


def _value_text(index: int, t: DataType | None, data: bytes) -> str:
    value: Value = int.from_bytes(data, "little")
    with_type = t is not None and (not t.bits or len(data) == t.size)
    if t is not None and with_type:
        value = t.decode(data)
    if isinstance(value, bool) or (isinstance(value, int) and index not in _COMMUNICATION):
        return str(int(value))
    if isinstance(value, int):
        return f"0x{value:X}" if value >= 0 else str(value)
    return value.hex(" ") if isinstance(value, bytes) else str(value)
