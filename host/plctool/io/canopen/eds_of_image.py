"""The EDS of this PLC as a CANopen device: the objects that its SDO server answers, taken from the image."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.image.file import Image
from plctool.io.canopen.data_types import DATA_TYPES
from plctool.io.canopen.device import DRIVER, REASON
from plctool.io.canopen.eds import BIT_RATES, TYPE_ARRAY, TYPE_RECORD, TYPE_VAR
from plctool.io.canopen.profile import dynamic_channels, names_of, segment_at
from plctool.io.configuration import ConnectorEntry, configuration_of_image

_MANDATORY = (0x1000, 0x1001, 0x1018)
_FIRST_MANUFACTURER, _END_MANUFACTURER = 0x2000, 0x6000
_LAST_FIXED = 0x1FFF
_NO_DOWNLOAD = 1  # ObjFlags: a configuration does not write it
_AS_IN_PROFILE = 3  # dynamic channels, in the layout of CiA 405
_ARRAYS = (0x1003, 0x1010, 0x1011, 0x1016, 0x1020, 0x1029)
_DUMMIES = range(1, 8)
_NAMES = {
    0x1000: "Device type", 0x1001: "Error register", 0x1003: "Pre-defined error field",
    0x1005: "COB-ID SYNC", 0x1008: "Manufacturer device name", 0x1009: "Manufacturer hardware version",
    0x100A: "Manufacturer software version", 0x1010: "Store parameters", 0x1011: "Restore default parameters",
    0x1012: "COB-ID TIME", 0x1014: "COB-ID EMCY", 0x1015: "Inhibit time EMCY", 0x1016: "Consumer heartbeat time",
    0x1017: "Producer heartbeat time", 0x1018: "Identity object", 0x1020: "Verify configuration",
    0x1019: "Synchronous counter overflow value",
    0x1029: "Error behaviour", 0x1200: "SDO server parameter",
    0x1F50: "Program data", 0x1F51: "Program control", 0x1F56: "Program software identification",
    0x1F57: "Flash status identification", REASON: "Why the program was refused",
}  # fmt: skip
_SUB_NAMES = {
    (0x1010, 1): "All", (0x1010, 2): "Communication", (0x1010, 3): "Application",
    (0x1011, 1): "All", (0x1011, 2): "Communication", (0x1011, 3): "Application",
    (0x1018, 1): "Vendor-ID", (0x1018, 2): "Product code", (0x1018, 3): "Revision number", (0x1018, 4): "Serial number",
    (0x1020, 1): "Configuration date", (0x1020, 2): "Configuration time", (0x1029, 1): "Communication error",
    (0x1F50, 1): "Program", (0x1F51, 1): "Program", (0x1F56, 1): "Program", (0x1F57, 1): "Program",
    (0x1200, 1): "COB-ID client to server", (0x1200, 2): "COB-ID server to client",
}  # fmt: skip
_PDO_SUBS = {
    1: ("COB-ID", 7), 2: ("Transmission type", 5), 3: ("Inhibit time", 6), 5: ("Event timer", 6)
}  # fmt: skip
_TPDO_SUBS = {**_PDO_SUBS, 6: ("SYNC start value", 5)}
_RPDO, _TPDO, _MAPPING = 0x1400, 0x1800, 0x200


@dataclass(frozen=True)
class Row:
    """A value of the dictionary. `default`: as the file has it, "" for none."""

    sub: int
    name: str
    type: int
    access: str
    default: str = ""
    mappable: bool = False
    limits: tuple[int, int] | None = None
    flags: int = 0  # ObjFlags


@dataclass
class Object:
    """An object with its rows by sub-index."""

    index: int
    name: str
    rows: list[Row] = field(default_factory=list)


def eds_of_image(image: Image, channels: Iterable[dict[str, Any]], file_name: str) -> str:
    """The text of an EDS. `channels`: of the symbols, for names. Raises UsageError if the program is no device."""
    configuration = configuration_of_image(image)
    found = [c for c in configuration.connectors if c.driver == DRIVER] if configuration is not None else []
    if not found:
        raise UsageError(
            "This program makes the controller no CANopen device; write [[canopen_device]] in its .io.toml.",
            "no-device",
        )
    return _Writer(found[0], [c for c in channels if c["device"] == found[0].name]).text(file_name)


class _Writer:
    def __init__(self, connector: ConnectorEntry, channels: list[dict[str, Any]]) -> None:
        self._connector = connector
        self._values = {p.id: p.value for p in connector.parameters}
        self._places: dict[int, str] = {
            c["parameter_bit"] // 8: (c["variable"] or c["channel"]) + ", element 1" * c["type"].startswith("ARRAY")
            for c in channels
            if c["parameter"] == lib.CANOPEN_DEVICE_VALUE
        }
        self._objects: dict[int, Object] = {}
        self._firsts = {
            int(entry.place): int(entry.sub)
            for entry in self._table("CANOPEN_OBJECT", lib.CANOPEN_DEVICE_OBJECTS)
            if entry.where == lib.CANOPEN_IN_VALUES and int(entry.place) in self._places
        }
        self._limits = {
            (int(limit.index), int(limit.sub)): (_signed(limit, limit.low), _signed(limit, limit.high))
            for limit in self._table("CANOPEN_LIMIT", int(lib.CANOPEN_DEVICE_LIMITS))
        }
        self._texts = self._values.get(int(lib.CANOPEN_DEVICE_TEXTS), b"")

    def _number(self, parameter: int) -> int:
        return int.from_bytes(self._values.get(parameter, b""), "little")

    def _table(self, kind: str, parameter: int) -> list[Any]:
        data = self._values.get(int(parameter), b"")
        entries = ffi.new(f"{kind}[]", len(data) // ffi.sizeof(kind))
        ffi.buffer(entries)[:] = data[: len(ffi.buffer(entries))]
        self._kept = [*getattr(self, "_kept", []), entries]
        return list(entries)

    def text(self, file_name: str) -> str:
        for entry in self._table("CANOPEN_OBJECT", lib.CANOPEN_DEVICE_OBJECTS):
            self._add(entry)
        for entry in self._fixed():
            self._add(entry)
        counts = [
            self._add_pdos(first, word, parameter)
            for first, word, parameter in (
                (_RPDO, "RPDO", int(lib.CANOPEN_DEVICE_RPDOS)),
                (_TPDO, "TPDO", int(lib.CANOPEN_DEVICE_TPDOS)),
            )
        ]
        sections = [self._file_info(file_name), self._device_info(*counts), self._dummies(), *self._lists()]
        if self._has_segments():
            sections.append(("DynamicChannels", dynamic_channels()))
        sections += [s for index in sorted(self._objects) for s in self._sections(self._objects[index])]
        return "\n".join("\n".join([f"[{name}]", *lines, ""]) for name, lines in sections)

    # ---- the dictionary ----

    @staticmethod
    def _fixed() -> Iterator[Any]:
        number = 0
        entry = ffi.new("CANOPEN_OBJECT *")
        while lib.CanopenDictGetFixed(number, entry):
            yield entry
            number += 1

    def _add(self, entry: Any) -> None:
        index, sub = int(entry.index), int(entry.sub)
        found = self._objects.setdefault(index, Object(index, ""))
        if not found.name or (entry.where == lib.CANOPEN_IN_VALUES and found.name.startswith("Object ")):
            found.name = self._object_name(entry)
        found.rows.append(
            Row(
                sub, self._row_name(entry), int(entry.type), self._access(entry), self._default(entry),
                bool(entry.access & (lib.CANOPEN_ACCESS_TPDO | lib.CANOPEN_ACCESS_RPDO)),
                self._limits.get((index, sub)), _NO_DOWNLOAD if names_of(index) is not None else 0,
            )
        )  # fmt: skip

    def _variable(self, entry: Any) -> str:
        """The variable of a value; of an element of an array with its number."""
        place = int(entry.place)
        if place in self._places:
            return self._places[place]
        first = max((p for p in self._places if p < place), default=None)
        name = f"object {entry.index:04X}" if first is None else self._places[first]
        number = entry.sub if first is None else entry.sub - self._firsts[first] + 1
        return f"{name.partition(',')[0]}, element {number}"

    def _object_name(self, entry: Any) -> str:
        segment, program = segment_at(int(entry.index)), names_of(int(entry.index))
        if segment is not None:
            return f"{segment.type.name} {'outputs' if segment.is_output else 'inputs'}"
        if program is not None:
            return program[0]
        if entry.where == lib.CANOPEN_IN_VALUES:
            return self._variable(entry).partition(",")[0]
        return _NAMES.get(int(entry.index), f"Object {entry.index:04X}")

    def _row_name(self, entry: Any) -> str:
        index, sub = int(entry.index), int(entry.sub)
        if entry.where == lib.CANOPEN_IN_VALUES:
            return self._variable(entry)
        if sub == 0:
            return "Highest sub-index"
        program = names_of(index)
        if program is not None:
            return program[1][sub - 1]
        return _SUB_NAMES.get((index, sub), f"Entry {sub}")

    @staticmethod
    def _access(entry: Any) -> str:
        if entry.where in (lib.CANOPEN_CONSTANT, lib.CANOPEN_TEXT):
            return "const"
        if not entry.access & lib.CANOPEN_ACCESS_WRITE:
            return "ro"
        if not entry.access & lib.CANOPEN_ACCESS_READ:
            return "wo"
        return "rww" if entry.access & lib.CANOPEN_ACCESS_RPDO else "rw"

    def _default(self, entry: Any) -> str:
        place, where = int(entry.place), entry.where
        if where == lib.CANOPEN_CONSTANT:
            return f"0x{place:X}"
        if where == lib.CANOPEN_OF_NODE:
            return f"$NODEID+0x{place:X}"
        if where == lib.CANOPEN_TEXT:
            return self._texts[place : place + int(entry.size)].decode("ascii").rstrip("\0")
        if where in (lib.CANOPEN_IN_VALUES, lib.CANOPEN_PROGRAM_OBJECT) or entry.index == 0x1018:
            return ""
        stores = bool(self._number(lib.CANOPEN_DEVICE_FLAGS) & lib.CANOPEN_DEVICE_STORE)
        special = {
            0x1005: "0x80", 0x1014: "$NODEID+0x80", 0x1017: str(self._number(lib.CANOPEN_DEVICE_HEARTBEAT)),
            0x1010: str(int(stores)), 0x1011: str(int(stores)),
        }  # fmt: skip
        return special.get(int(entry.index), "0")

    def _add_pdos(self, first: int, word: str, parameter: int) -> int:
        settings = self._table("CANOPEN_PDO_SETTING", parameter)
        for number, pdo in enumerate(settings):
            cob = f"$NODEID+0x{pdo.cob:X}" if pdo.of_node else f"0x{pdo.cob:X}"
            values = {1: cob, 2: str(pdo.type), 3: str(pdo.inhibit), 5: str(pdo.event_ms), 6: str(pdo.start)}
            subs = _TPDO_SUBS if first == _TPDO else _PDO_SUBS
            rows = [Row(0, "Highest sub-index", 5, "const", str(max(subs)))]
            rows += [Row(sub, name, kind, "rw", values[sub]) for sub, (name, kind) in subs.items()]
            self._objects[first + number] = Object(first + number, f"{word} {number + 1} communication", rows)
            maps = [Row(0, "Number of mapped objects", 5, "rw", str(pdo.count))]
            maps += [
                Row(sub, f"Mapping entry {sub}", 7, "rw", f"0x{pdo.map[sub - 1]:X}")
                for sub in range(1, int(lib.CANOPEN_MAPPINGS) + 1)
            ]
            index = first + _MAPPING + number
            self._objects[index] = Object(index, f"{word} {number + 1} mapping", maps)
        return len(settings)

    # ---- sections ----

    def _has_segments(self) -> bool:
        return any(segment_at(index) is not None for index in self._objects)

    @staticmethod
    def _file_info(file_name: str) -> tuple[str, list[str]]:
        lines = [f"FileName={file_name}", "FileVersion=1", "FileRevision=1", "EDSVersion=4.0", "CreatedBy=plctool"]
        return "FileInfo", lines

    def _device_info(self, rpdos: int, tpdos: int) -> tuple[str, list[str]]:
        identity = {row.sub: row.default for row in self._objects[0x1018].rows}
        name = next((row.default for row in self._objects[0x1008].rows), "") if 0x1008 in self._objects else ""
        lss = bool(self._number(lib.CANOPEN_DEVICE_FLAGS) & lib.CANOPEN_DEVICE_LSS)
        return "DeviceInfo", [
            "VendorName=", f"VendorNumber={identity.get(1, '0')}", f"ProductName={name}",
            f"ProductNumber={identity.get(2, '0')}", f"RevisionNumber={identity.get(3, '0')}", "OrderCode=",
            *(f"BaudRate_{rate}=1" for rate in BIT_RATES),
            "SimpleBootUpMaster=0", "SimpleBootUpSlave=1", "Granularity=1",
            f"DynamicChannelsSupported={_AS_IN_PROFILE if self._has_segments() else 0}",
            "GroupMessaging=0", f"NrOfRXPDO={rpdos}", f"NrOfTXPDO={tpdos}", f"LSS_Supported={int(lss)}",
        ]  # fmt: skip

    @staticmethod
    def _dummies() -> tuple[str, list[str]]:
        return "DummyUsage", [f"Dummy{number:04X}=1" for number in _DUMMIES]

    def _lists(self) -> Iterator[tuple[str, list[str]]]:
        groups: dict[str, list[int]] = {"MandatoryObjects": [], "OptionalObjects": [], "ManufacturerObjects": []}
        for index in sorted(self._objects):
            own = _FIRST_MANUFACTURER <= index < _END_MANUFACTURER
            group = "MandatoryObjects" if index in _MANDATORY else "ManufacturerObjects" if own else "OptionalObjects"
            groups[group].append(index)
        for name, indices in groups.items():
            yield name, [f"SupportedObjects={len(indices)}", *(f"{n}=0x{i:04X}" for n, i in enumerate(indices, 1))]

    @staticmethod
    def _sections(found: Object) -> Iterator[tuple[str, list[str]]]:
        rows = sorted(found.rows, key=lambda row: row.sub)
        name = f"{found.index:04X}"
        if len(rows) == 1 and rows[0].sub == 0:
            yield name, _lines(rows[0], found.name)
            return
        is_array = found.index in _ARRAYS or (found.index > _LAST_FIXED and len({row.type for row in rows[1:]}) == 1)
        object_type = TYPE_ARRAY if is_array else TYPE_RECORD
        yield name, [f"ParameterName={found.name}", f"ObjectType=0x{object_type:X}", f"SubNumber={len(rows)}"]
        for row in rows:
            yield f"{name}sub{row.sub:X}", _lines(row, row.name)


def _signed(limit: Any, value: int) -> int:
    """A limit, which the table has without its sign."""
    return value - (1 << 32) if limit.is_signed and value >> 31 else value


def _lines(row: Row, name: str) -> list[str]:
    default = [f"DefaultValue={row.default}"] if row.default else []
    flags = [f"ObjFlags={row.flags}"] if row.flags else []
    limits = [] if row.limits is None else [f"LowLimit={row.limits[0]}", f"HighLimit={row.limits[1]}"]
    return [
        f"ParameterName={name}", f"ObjectType=0x{TYPE_VAR:X}", f"DataType=0x{DATA_TYPES[row.type].code:04X}",
        f"AccessType={row.access}", *limits, *default, f"PDOMapping={int(row.mappable)}", *flags,
    ]  # fmt: skip
