"""Electronic data sheets (EDS) and device configuration files (DCF) of CANopen devices, CiA 306.

The reader is forgiving: files of vendors deviate from CiA 306 in many ways. Each doubt is a finding with its line; an
error is about an object that cannot be used, a warning says what is assumed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from plctool.errors import UsageError, counted, did_you_mean, listed
from plctool.files import Pos, read_regular
from plctool.io.canopen.data_types import (
    DATA_TYPES,
    DOMAIN,
    FIRST_COMPLEX,
    UNSIGNED8,
    UNSIGNED32,
    DataType,
    Value,
    parse_whole,
)
from plctool.io.canopen.ini import Item, NotText, Section, read_sections, shown, text_of
from plctool.io.canopen.profile import segment_of
from plctool.io.mistakes import Mistakes

MAX_EDS = 8 << 20
"""Bytes of a file. Those of large drives have less than 3 MiB."""
MAX_FINDINGS = 200  # of one file
MAX_SEGMENTS = 255  # of [DynamicChannels]
_RANGE = re.compile(r"0x([0-9A-Fa-f]{4})-0x([0-9A-Fa-f]{4})")
LAST_NODE = 127
LAST_PDO = 511
LAST_SUB = 254  # 255 describes the structure of the object
MAX_PDO_BITS = 64

TYPE_VAR, TYPE_DOMAIN, TYPE_ARRAY, TYPE_RECORD = 7, 2, 8, 9
_OBJECT_TYPES = {0: "NULL", 2: "DOMAIN", 5: "DEFTYPE", 6: "DEFSTRUCT", 7: "VAR", 8: "ARRAY", 9: "RECORD"}
_WITH_SUBS = (6, TYPE_ARRAY, TYPE_RECORD)
_ACCESS = ("ro", "wo", "rw", "rwr", "rww", "const")
READABLE, WRITABLE = ("ro", "rw", "rwr", "rww", "const"), ("wo", "rw", "rwr", "rww")
_FROM_DEVICE, _TO_DEVICE = ("ro", "rw", "rwr", "const"), ("wo", "rw", "rww")  # in TPDOs, in RPDOs
BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)  # kbit/s

_INDEX = re.compile(r"[0-9a-f]{4}")
_SUB = re.compile(r"([0-9a-f]{4})sub([0-9a-f]{1,2})")
_TABLE = re.compile(r"([0-9a-f]{4})(name|value|denotation)")
_NODE_ID = re.compile(r"\$node_?id", re.IGNORECASE)
_LISTS = {"mandatoryobjects": "mandatory", "optionalobjects": "optional", "manufacturerobjects": "manufacturer"}
_KNOWN = re.compile(
    r"fileinfo|deviceinfo|dummyusage|comments?|devicecomm?issioning|dynamicchannels|tools|tool\d+|supportedmodules|"
    r"m\d+.*|[0-9a-f]{4}objectlinks|standarddatatypes"
)
_OBJECT_KEYS = (
    "ParameterName", "ObjectType", "DataType", "AccessType", "LowLimit", "HighLimit", "DefaultValue", "PDOMapping",
    "ObjFlags", "SubNumber", "CompactSubObj", "ParameterValue", "Denotation", "UploadFile", "DownloadFile",
)  # fmt: skip


@dataclass(frozen=True)
class Setting:
    """A value of a file; with `node_id` the number of the node is added."""

    value: Value
    node_id: bool = False

    def at(self, node: int) -> Value:
        """The value in the device with that number."""
        return self.value + node if self.node_id and isinstance(self.value, int) else self.value


@dataclass(frozen=True)
class Entry:
    """A value of the object dictionary. `type` is None if the file does not give one that is known."""

    index: int
    sub: int
    name: str
    type: DataType | None
    access: str
    pos: Pos
    default: Setting | None = None
    low: Setting | None = None
    high: Setting | None = None
    value: Setting | None = None  # of a DCF
    mappable: bool = False
    flags: int = 0

    @property
    def place(self) -> str:
        """`6041:00`."""
        return f"{self.index:04X}:{self.sub:02X}"


@dataclass
class Object:
    """An object of the dictionary with its entries by sub-index; a VAR has sub-index 0 only."""

    index: int
    name: str
    object_type: int
    pos: Pos
    group: str = ""  # mandatory, optional, manufacturer; "" of one that no list names
    entries: dict[int, Entry] = field(default_factory=dict)


@dataclass(frozen=True)
class DeviceInfo:
    """Section DeviceInfo. Numbers are None if the file does not give them."""

    vendor_name: str = ""
    product_name: str = ""
    order_code: str = ""
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    bit_rates: tuple[int, ...] = ()  # kbit/s
    rx_pdos: int | None = None
    tx_pdos: int | None = None
    granularity: int | None = None
    lss: bool = False
    boot_up_master: bool = False
    dynamic_channels: int = 0
    group_messaging: bool = False


@dataclass(frozen=True)
class Commissioning:
    """Section DeviceComissioning of a DCF."""

    node: int | None = None
    node_name: str = ""
    bit_rate: int | None = None  # kbit/s
    network: int | None = None
    network_name: str = ""
    manager: bool = False
    serial: int | None = None


@dataclass
class Eds:
    """What a file says. `findings`: its errors and warnings in the order of the file."""

    file: str
    text: str = field(repr=False)
    info: dict[str, str] = field(default_factory=dict)  # section FileInfo
    device: DeviceInfo = field(default_factory=DeviceInfo)
    dummies: frozenset[int] = frozenset()
    objects: dict[int, Object] = field(default_factory=dict)
    commissioning: Commissioning | None = None
    findings: Mistakes = field(default_factory=Mistakes)
    more_findings: int = 0  # that are not kept

    def entry(self, index: int, sub: int = 0) -> Entry | None:
        """An entry of the dictionary, None if the file has none."""
        found = self.objects.get(index)
        return None if found is None else found.entries.get(sub)

    @property
    def has_errors(self) -> bool:
        """True if a part of the file cannot be used."""
        return any(f.severity == "error" for f in self.findings.found)

    def pdos(self, first: int) -> list[int]:
        """The numbers (from 0) of the PDOs whose parameters begin at object `first`, 1400h or 1800h."""
        return [i for i in range(LAST_PDO + 1) if first + i in self.objects]


def load_eds(path: Path) -> Eds:
    """Reads a file. Raises UsageError if it cannot be read at all."""
    try:
        data = read_regular(path, MAX_EDS)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "bad-eds") from None
    return read_eds(str(path), data)


def read_eds(file: str, data: bytes) -> Eds:
    """What the bytes of a file say. Raises UsageError for what is not a text file."""
    try:
        text = text_of(data)
    except NotText:
        raise UsageError(f"{file} is not a text file; give an EDS or DCF.", "bad-eds") from None
    return _Reader(file, text).read()


class _Reader:
    def __init__(self, file: str, text: str) -> None:
        self.eds = Eds(file, text)
        self.found = Mistakes()
        self.sections = read_sections(file, text, self.found)
        self.top = Pos(file, 1, 1)
        self.subs: dict[int, list[tuple[int, Section]]] = {}
        for name, section in self.sections.items():
            if match := _SUB.fullmatch(name):
                self.subs.setdefault(int(match[1], 16), []).append((int(match[2], 16), section))

    def read(self) -> Eds:
        eds = self.eds
        if not self.sections:
            self.found.error(self.top, "the file has no sections; give an EDS or DCF.")
        else:
            self._read_head()
            self._read_objects()
            self._check_mappings()
            self._check_dynamic_channels()
        found = sorted(self.found.found, key=lambda m: (m.pos.line, m.pos.column))
        eds.findings.found, eds.more_findings = found[:MAX_FINDINGS], max(0, len(found) - MAX_FINDINGS)
        return eds

    def _check_dynamic_channels(self) -> None:
        """The areas of CiA 405 cannot be others; a device may have fewer, or parts of them."""
        section = self.sections.get("dynamicchannels")
        for number in range(1, MAX_SEGMENTS + 1):
            item = None if section is None else section.get(f"Range{number}")
            if section is None or item is None:
                continue
            kind, way = self.whole(section, f"Type{number}"), self.text(section, f"Dir{number}").strip().lower()
            match = _RANGE.fullmatch(item.value.strip())
            area = None
            if kind in DATA_TYPES:
                area = segment_of(DATA_TYPES[kind], is_output=way != "ro")
            if match is None:
                self.found.warning(item.pos, f"Range{number} is not a range such as 0xA000-0xA03F; it is ignored.")
            elif area is None or not area.first <= int(match[1], 16) <= int(match[2], 16) <= area.last:
                where = "no area" if area is None else f"the area 0x{area.first:04X} to 0x{area.last:04X}"
                self.found.warning(item.pos, f"Range{number} is not that of CiA 405, which has {where} for this type.")

    # ---- values ----

    def text(self, section: Section, name: str) -> str:
        item = section.get(name)
        return "" if item is None else item.value

    def whole(self, section: Section, name: str, low: int = 0, high: int = 0xFFFF_FFFF) -> int | None:
        """A number, None if it is absent or wrong."""
        item = section.get(name)
        if item is None:
            return None
        try:
            value = parse_whole(_without_comment(item.value))
        except ValueError as error:
            self.found.error(item.pos, f"{item.name}: {error}.")
            return None
        if not low <= value <= high:
            self.found.error(item.pos, f"{item.name} is {value}; it has to be {low} to {high}.")
            return None
        return value

    def flag(self, section: Section, name: str) -> bool:
        item = section.get(name)
        if item is None:
            return False
        words = _without_comment(item.value).lower()
        if words not in ("0", "1", "true", "false", "0x0", "0x1", "0x00", "0x01"):
            self.found.warning(item.pos, f"{item.name} is 0 or 1, not '{shown(item.value)}'; 1 is assumed.")
            return True
        return words.endswith(("1", "true"))

    def setting(self, section: Section, name: str, t: DataType | None) -> Setting | None:
        """A value of a type, perhaps with $NODEID; None if it is absent or wrong."""
        item = section.get(name)
        return None if item is None or t is None else self.setting_of(item, t)

    def setting_of(self, item: Item, t: DataType) -> Setting | None:
        if t is DOMAIN:
            return None
        try:
            if t.is_whole and _NODE_ID.search(item.value):
                return self._formula(_without_comment(item.value), t)
            return Setting(t.parse(item.value if t.kind in ("string", "unicode") else _without_comment(item.value)))
        except ValueError as error:
            self.found.warning(item.pos, f"{item.name}: {error}; the value is ignored.")
            return None

    def _formula(self, words: str, t: DataType) -> Setting:
        """`$NODEID+0x180` in either order, or `$NODEID`."""
        parts = [part.strip() for part in words.split("+")]
        numbers = [part for part in parts if not _NODE_ID.fullmatch(part)]
        if len(parts) - len(numbers) != 1 or len(numbers) > 1:
            raise ValueError(f"'{shown(words)}' is not $NODEID+NUMBER")
        offset = parse_whole(numbers[0]) if numbers else 0
        low, high = t.limits
        if not (low <= offset and offset + LAST_NODE <= high):
            raise ValueError(f"{shown(words)} is outside {t.name} for some nodes")
        return Setting(offset, node_id=True)

    # ---- sections about the device ----

    def _read_head(self) -> None:
        info = self.sections.get("fileinfo")
        if info is None:
            self.found.warning(self.top, "section [FileInfo] is missing.")
        else:
            self.eds.info = {item.name: item.value for item in info.items.values()}
        device = self.sections.get("deviceinfo")
        if device is None:
            self.found.warning(self.top, "section [DeviceInfo] is missing, so the identity is not known.")
        else:
            self.eds.device = self._device(device)
        if dummies := self.sections.get("dummyusage"):
            self.eds.dummies = frozenset(self._dummies(dummies))
        for name in ("devicecomissioning", "devicecommissioning"):  # CiA 306 spells the first
            if section := self.sections.get(name):
                self.eds.commissioning = self._commissioning(section)

    def _device(self, section: Section) -> DeviceInfo:
        for name in ("VendorNumber", "ProductNumber", "RevisionNumber"):
            item = section.items.get(name.casefold())
            if item is None or not item.value:
                pos = section.pos if item is None else item.pos
                self.found.warning(pos, f"{name} is {'missing' if item is None else 'empty'}; any number is accepted.")
        rates = tuple(rate for rate in BIT_RATES if self.flag(section, f"BaudRate_{rate}"))
        if not rates:
            self.found.warning(section.pos, "[DeviceInfo] names no bit rate (BaudRate_500=1, for example).")
        compact = section.get("CompactPDO")
        if self.whole(section, "CompactPDO"):
            assert compact
            self.found.warning(compact.pos, "CompactPDO is not read; PDOs without a section of their own are unknown.")
        return DeviceInfo(
            vendor_name=self.text(section, "VendorName"),
            product_name=self.text(section, "ProductName"),
            order_code=self.text(section, "OrderCode"),
            vendor=self.whole(section, "VendorNumber"),
            product=self.whole(section, "ProductNumber"),
            revision=self.whole(section, "RevisionNumber"),
            bit_rates=rates,
            rx_pdos=self.whole(section, "NrOfRXPDO", high=LAST_PDO + 1),
            tx_pdos=self.whole(section, "NrOfTXPDO", high=LAST_PDO + 1),
            granularity=self.whole(section, "Granularity", high=MAX_PDO_BITS),
            lss=self.flag(section, "LSS_Supported"),
            boot_up_master=self.flag(section, "SimpleBootUpMaster"),
            dynamic_channels=self.whole(section, "DynamicChannelsSupported") or 0,
            group_messaging=self.flag(section, "GroupMessaging"),
        )

    def _dummies(self, section: Section) -> Iterable[int]:
        for key, item in section.items.items():
            code = key.removeprefix("dummy")
            if not _INDEX.fullmatch(code) or not 0 < int(code, 16) < FIRST_COMPLEX:
                self.found.warning(item.pos, f"{shown(item.name)} is not the dummy of a data type (Dummy0005).")
            elif self.flag(section, key):
                yield int(code, 16)

    def _commissioning(self, section: Section) -> Commissioning:
        return Commissioning(
            node=self.whole(section, "NodeID", 1, LAST_NODE),
            node_name=self.text(section, "NodeName"),
            bit_rate=self.whole(section, "Baudrate"),
            network=self.whole(section, "NetNumber"),
            network_name=self.text(section, "NetworkName"),
            manager=self.flag(section, "CANopenManager"),
            serial=self.whole(section, "LSS_SerialNumber"),
        )

    # ---- objects ----

    def _read_objects(self) -> None:
        groups = self._groups()
        for name, section in self.sections.items():
            if _INDEX.fullmatch(name):
                index = int(name, 16)
                if index not in groups:
                    self.found.warning(section.pos, f"no list of objects names {index:04X}; the object is read anyway.")
                self.eds.objects[index] = self._object(index, section, groups.get(index, ""))
            elif not (name in _LISTS or _SUB.fullmatch(name) or _TABLE.fullmatch(name) or _KNOWN.fullmatch(name)):
                hint = did_you_mean(section.name, ("DeviceInfo", "FileInfo", "DummyUsage", "DeviceComissioning"))
                self.found.warning(section.pos, f"section [{shown(section.name)}] is unknown and ignored{hint}")
        for name, section in self.sections.items():
            owner = _SUB.fullmatch(name) or _TABLE.fullmatch(name)
            if owner and int(owner[1], 16) not in self.eds.objects:
                self.found.warning(
                    section.pos, f"[{section.name}] is ignored: section [{owner[1].upper()}] is missing."
                )
        for index in (0x1000, 0x1001):
            if index not in self.eds.objects:
                self.found.warning(self.top, f"object {index:04X} is missing, which every device has.")

    def _groups(self) -> dict[int, str]:
        """The objects that the lists name, with their list."""
        groups: dict[int, str] = {}
        for name, group in _LISTS.items():
            section = self.sections.get(name)
            if section is None:
                continue
            items = [item for key, item in section.items.items() if key != "supportedobjects"]
            count = self.whole(section, "SupportedObjects", high=0xFFFF)
            if count is not None and count != len(items):
                self.found.warning(
                    section.items["supportedobjects"].pos, f"SupportedObjects is {count}, but {len(items)} are listed."
                )
            for item in items:
                self._list(item, group, groups)
        return groups

    def _list(self, item: Item, group: str, groups: dict[int, str]) -> None:
        try:
            index = parse_whole(_without_comment(item.value))
        except ValueError as error:
            self.found.error(item.pos, f"{error}; write the index of an object, such as 0x1018.")
            return
        if not 0 < index <= 0xFFFF:
            self.found.error(item.pos, f"{shown(item.value)} is not the index of an object, 0x1000 to 0xFFFF.")
        elif index in groups:
            self.found.warning(item.pos, f"object {index:04X} is listed a second time.")
        else:
            groups[index] = group
            if f"{index:04x}" not in self.sections:
                self.found.error(item.pos, f"object {index:04X} is listed, but section [{index:04X}] is missing.")
            if (group == "manufacturer") != (0x2000 <= index <= 0x5FFF):
                self.found.warning(item.pos, f"object {index:04X} does not belong to the list of {group} objects.")

    def _object(self, index: int, section: Section, group: str) -> Object:
        self._check_keys(section)
        kind = self.whole(section, "ObjectType")
        if kind is not None and kind not in _OBJECT_TYPES:
            item = section.items["objecttype"]
            self.found.warning(item.pos, f"ObjectType {shown(item.value)} is unknown; {self._assumed(section)}.")
        has_subs = section.get("SubNumber") is not None or section.get("CompactSubObj") is not None
        if kind is None or kind not in _OBJECT_TYPES:
            kind = TYPE_RECORD if has_subs else TYPE_VAR
        found = Object(index, self._name(section, f"{index:04X}"), kind, section.pos, group)
        compact = self.whole(section, "CompactSubObj", high=LAST_SUB)
        if compact:
            self._compact(found, section, compact)
        elif kind in _WITH_SUBS:
            self._subs(found, section)
        else:
            found.entries[0] = self._entry(index, 0, section, kind)
            if (count := self.whole(section, "SubNumber", high=0xFFFF)) and count > 1:
                self.found.warning(section.pos, f"{index:04X} is a {_OBJECT_TYPES[kind]}; SubNumber is ignored.")
        return found

    def _assumed(self, section: Section) -> str:
        return "a RECORD is assumed" if section.get("SubNumber") else "a VAR is assumed"

    def _name(self, section: Section, default: str) -> str:
        name = self.text(section, "ParameterName")
        if not name:
            self.found.warning(section.pos, f"[{section.name}] has no ParameterName.")
        return name or default

    def _check_keys(self, section: Section) -> None:
        known = {key.casefold() for key in _OBJECT_KEYS}
        for key, item in section.items.items():
            if key not in known and (hint := did_you_mean(item.name, _OBJECT_KEYS)):
                self.found.warning(item.pos, f"{shown(item.name)} is unknown and ignored{hint}")

    def _subs(self, found: Object, section: Section) -> None:
        for number, sub in self.subs.get(found.index, ()):
            self._check_keys(sub)
            if number in found.entries:
                self.found.warning(sub.pos, f"{found.entries[number].place} has a section already; that one is used.")
            else:
                found.entries[number] = self._entry(found.index, number, sub, self.whole(sub, "ObjectType"))
        found.entries = dict(sorted(found.entries.items()))
        count = self.whole(section, "SubNumber", high=0x100)
        if count is None:
            self.found.warning(section.pos, f"[{section.name}] has no SubNumber.")
        elif count != len(found.entries):
            entries = counted(len(found.entries), "section")
            self.found.warning(section.items["subnumber"].pos, f"SubNumber is {count}, but there are {entries}.")
        if not found.entries:
            self.found.error(section.pos, f"object {found.index:04X} has no sub-objects.")

    def _compact(self, found: Object, section: Section, count: int) -> None:
        """Sub-objects that have one section for all of them."""
        names, values = self._table(found.index, "name"), self._table(found.index, "value")
        found.entries[0] = Entry(
            found.index, 0, "NrOfObjects", UNSIGNED8, "ro", section.pos, default=Setting(count), flags=0
        )
        pattern = self._entry(found.index, 1, section, TYPE_VAR)
        for sub in range(1, count + 1):
            name = names[sub].value if sub in names else f"{found.name}{sub}"
            value = self.setting_of(values[sub], pattern.type) if sub in values and pattern.type else pattern.value
            found.entries[sub] = replace(pattern, sub=sub, name=name, value=value)
        for item in [i for table in (names, values) for sub, i in table.items() if not 0 < sub <= count]:
            self.found.warning(item.pos, f"{found.index:04X} has sub-objects 1 to {count}; {item.name} is ignored.")

    def _table(self, index: int, kind: str) -> dict[int, Item]:
        section = self.sections.get(f"{index:04x}{kind}")
        if section is None:
            return {}
        return {
            int(key): item for key, item in section.items.items() if key.isascii() and key.isdecimal() and len(key) < 4
        }

    def _entry(self, index: int, sub: int, section: Section, kind: int | None) -> Entry:
        is_domain = kind == TYPE_DOMAIN
        t = self._type(section, is_domain)
        entry = Entry(
            index,
            sub,
            self._name(section, f"{index:04X}:{sub:02X}"),
            t,
            self._access(section, is_domain),
            section.pos,
            default=self.setting(section, "DefaultValue", t),
            low=self.setting(section, "LowLimit", t),
            high=self.setting(section, "HighLimit", t),
            value=self.setting(section, "ParameterValue", t),
            mappable=self.flag(section, "PDOMapping"),
            flags=self.whole(section, "ObjFlags") or 0,
        )
        self._check_limits(entry, section)
        return entry

    def _type(self, section: Section, is_domain: bool) -> DataType | None:
        if section.get("DataType") is None:
            if is_domain:
                return DOMAIN
            self.found.error(section.pos, f"[{section.name}] has no DataType, so its value cannot be used.")
            return None
        code = self.whole(section, "DataType", high=0xFFFF)
        if code is None:
            return None
        if code not in DATA_TYPES:
            what = "a record or of the manufacturer" if code >= FIRST_COMPLEX else "unknown"
            pos = section.items["datatype"].pos
            self.found.warning(pos, f"DataType 0x{code:04X} is {what}; values of [{section.name}] are bytes.")
            return None
        return DATA_TYPES[code]

    def _access(self, section: Section, is_domain: bool) -> str:
        item = section.get("AccessType")
        if item is None:
            if not is_domain:
                self.found.error(section.pos, f"[{section.name}] has no AccessType; rw is assumed.")
            return "rw"
        access = _without_comment(item.value).lower()
        if access not in _ACCESS:
            known = listed(_ACCESS, "or")
            self.found.error(item.pos, f"AccessType '{shown(item.value)}' is not {known}; rw is assumed.")
            return "rw"
        return access

    def _check_limits(self, entry: Entry, section: Section) -> None:
        low, high = (_number(limit) for limit in (entry.low, entry.high))
        if low is not None and high is not None and low > high:
            pos = section.items["lowlimit"].pos
            self.found.warning(pos, f"LowLimit {low} is above HighLimit {high}; neither is checked.")
            return
        for key, setting in (("defaultvalue", entry.default), ("parametervalue", entry.value)):
            value = _number(setting)
            below = value is not None and low is not None and value < low
            above = value is not None and high is not None and value > high
            if (below or above) and setting is not None and not setting.node_id:
                item = section.items[key]
                limit = f"below LowLimit {low}" if below else f"above HighLimit {high}"
                self.found.warning(item.pos, f"{item.name} {value} is {limit}.")

    # ---- PDOs ----

    def _check_mappings(self) -> None:
        device = self.eds.device
        for first, mapping, count, name in (
            (0x1400, 0x1600, device.rx_pdos, "NrOfRXPDO"),
            (0x1800, 0x1A00, device.tx_pdos, "NrOfTXPDO"),
        ):
            there = self.eds.pdos(first)
            if count is not None and count != len(there):
                item = self.sections["deviceinfo"].items[name.casefold()]
                self.found.warning(item.pos, f"{name} is {count}, but the file describes {len(there)}.")
            for number in there:
                self._check_mapping(mapping + number, is_input=first == 0x1800)

    def _check_mapping(self, index: int, is_input: bool) -> None:
        mapping = self.eds.objects.get(index)
        if mapping is None:
            parameters = self.eds.objects[index - 0x200]
            self.found.warning(parameters.pos, f"the PDO of {parameters.index:04X} has no mapping, object {index:04X}.")
            return
        bits = 0
        for entry in mapping_of(self.eds, index):
            bits += entry.bits
            if message := self._mapping_doubt(entry, is_input):
                self.found.warning(mapping.entries[entry.number].pos, message)
        if bits > MAX_PDO_BITS:
            self.found.warning(mapping.pos, f"{index:04X} maps {bits} bits; a PDO has {MAX_PDO_BITS}.")

    def _mapping_doubt(self, mapped: Mapped, is_input: bool) -> str:
        if mapped.index < FIRST_COMPLEX:
            known = mapped.index in self.eds.dummies
            return (
                "" if known or is_input else f"dummy {mapped.index:04X} is mapped, but [DummyUsage] does not allow it."
            )
        entry = self.eds.entry(mapped.index, mapped.sub)
        if entry is None:
            return f"the mapped object {mapped.place} is not in this file."
        if not entry.mappable:
            return f"the mapped object {entry.place} has PDOMapping=0."
        if entry.type is not None and entry.type.bits and entry.type.bits != mapped.bits:
            return f"{entry.place} is mapped with {mapped.bits} bits, but {entry.type.name} has {entry.type.bits}."
        if entry.access not in (_FROM_DEVICE if is_input else _TO_DEVICE):
            return f"{entry.place} is {entry.access} and cannot be in {'a TPDO' if is_input else 'an RPDO'}."
        return ""


@dataclass(frozen=True)
class Mapped:
    """An object in a PDO; `number`: the sub-index of the mapping, 0 if unknown."""

    index: int
    sub: int
    bits: int
    number: int = 0

    @property
    def place(self) -> str:
        """`6041:00`."""
        return f"{self.index:04X}:{self.sub:02X}"


def mapped_of(value: int, number: int = 0) -> Mapped:
    """The object that a value of 1600h or 1A00h names."""
    return Mapped(value >> 16, value >> 8 & 0xFF, value & 0xFF, number)


def mapping_of(eds: Eds, index: int, node: int = 1) -> list[Mapped]:
    """The objects that a PDO has at the beginning, by the mapping at `index`: values of the DCF or else defaults."""
    mapping = eds.objects.get(index)
    if mapping is None:
        return []
    values = {sub: setting_of(entry, node) for sub, entry in mapping.entries.items()}
    count = values.get(0)
    most = count if isinstance(count, int) else 0
    return [
        mapped_of(value, sub)
        for sub, value in values.items()
        if 0 < sub <= most and isinstance(value, int) and 0 < value <= UNSIGNED32.limits[1]
    ]


def setting_of(entry: Entry | None, node: int) -> Value | None:
    """The value that an entry begins with: that of the DCF or else the default; None if the file gives none."""
    setting = None if entry is None else entry.value or entry.default
    return None if setting is None else setting.at(node)


def _number(setting: Setting | None) -> int | float | None:
    return setting.value if setting is not None and isinstance(setting.value, int | float) else None


def _without_comment(value: str) -> str:
    return value.partition(";")[0].strip()
