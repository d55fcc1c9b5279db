"""Core dumps: what a controller had in memory when its program stopped, in a file that needs no device to be read."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from plctool.archives import ArchiveError, inflate
from plctool.controller import ExceptionInfo
from plctool.core import lib
from plctool.debug.registers import Registers
from plctool.debug.symbols import SymbolTable, find_symbols
from plctool.debug.trace import Trace
from plctool.debug.variables import Reading, Symbol
from plctool.errors import DeviceError, UsageError
from plctool.files import read_regular
from plctool.link.services import AppException, Identity, LogEntry, TaskInfo

if TYPE_CHECKING:
    from plctool.device import Plc

_T = TypeVar("_T")
_FORMAT = "plctool dump"
_VERSION = 1
_GZIP = b"\x1f\x8b"
_MOST_BYTES = 256 << 20  # of a dump, unpacked
_MOST_WORDS = 1024  # of its stack


@dataclass(frozen=True)
class AreaContent:
    """The bytes of a memory area (APP_AREA_*) from its beginning on, and what pointers to it contain."""

    area: int
    address: int
    data: bytes


@dataclass(frozen=True)
class Dump:
    """A controller at one moment; `exception` is None if the program had not stopped with one."""

    identity: Identity
    image_crc: int
    exception: AppException | None
    tasks: list[TaskInfo]
    log: list[LogEntry]
    areas: list[AreaContent]
    symbols: SymbolTable
    pointer_size: int
    registers: Registers | None

    def sample(self, names: Sequence[str]) -> Reading:
        """Variables by name, as `Controller.sample` has them. Raises UsageError, DeviceError as that does."""
        symbols = self.symbols.select(names)
        contents = {name: self.content(symbol) for name, symbol in symbols.items()}
        reading = Reading(symbols, contents)
        reading.check([name for name in names if name in contents], self.content)
        return reading

    def explained(self) -> ExceptionInfo | None:
        """The exception with the lines of the source: where it was, and the calls that led there."""
        if self.exception is None:
            return None
        e = self.exception
        read = partial(map, self.content)
        places = self.symbols.whole_stack(e.code_offset, e.trace, lambda symbols: list(read(symbols)))
        task = self.tasks[e.task].name if 0 <= e.task < len(self.tasks) else None
        if not places:
            return ExceptionInfo(e.code, e.name, task)
        place, detail = places[0], ""
        if e.code == lib.RTSEXCPT_ARRAYBOUNDS:
            detail = self.symbols.what_was_outside(place, lambda symbols: list(read(symbols)))
        return ExceptionInfo(e.code, e.name, task, place.pou, place.file, place.line, places[1:], detail)

    def content(self, symbol: Symbol) -> bytes | None:
        """None if a pointer leads to nothing that is in the dump."""
        if symbol.fixed is not None:
            return symbol.fixed
        place = self._place(symbol)
        if place is None:
            return None
        area, offset = place
        content = area.data[offset : offset + symbol.size]
        if len(content) == symbol.size:
            return content
        if symbol.pointer is not None:
            return None
        raise DeviceError(f"The dump does not contain {symbol.name}.", "no-memory")

    def _place(self, symbol: Symbol) -> tuple[AreaContent, int] | None:
        if symbol.pointer is None:
            found = next((area for area in self.areas if area.area == symbol.area), None)
            return None if found is None else (found, symbol.offset)
        held = self.content(symbol.pointer)
        if held is None:
            return None
        pointer = int.from_bytes(held[: self.pointer_size], "little")
        for area in self.areas:
            if area.address and 0 <= pointer - area.address < len(area.data):
                return area, pointer - area.address + symbol.offset
        return None


# ---- from a controller -----------------------------------------------------------------------------------------------


def take_dump(plc: Plc) -> Dump:
    """Reads all of it. Raises UsageError if the symbols of the program are not found."""
    status = plc.raw_status()
    table = plc.symbols()
    return Dump(
        plc.identity(),
        table.image_crc,
        status.exception,
        plc.tasks(),
        plc.log(),
        [AreaContent(*content) for content in plc.areas(table)],
        table,
        plc.pointer_size(),
        None if status.exception is None else plc.registers(),
    )


# ---- files -----------------------------------------------------------------------------------------------------------


def save(dump: Dump) -> bytes:
    """The content of a file."""
    e = dump.exception
    document = {
        "format": _FORMAT,
        "version": _VERSION,
        "identity": vars(dump.identity),
        "image_crc": dump.image_crc,
        "exception": None
        if e is None
        else {
            "code": e.code,
            "code_offset": e.code_offset,
            "task": e.task,
            "words": sorted(e.trace.words.items()),
            "link": e.trace.link,
        },
        "tasks": [vars(task) for task in dump.tasks],
        "log": [vars(entry) for entry in dump.log],
        "areas": [
            {"area": a.area, "address": a.address, "data": base64.b64encode(a.data).decode()} for a in dump.areas
        ],
        "pointer_size": dump.pointer_size,
        "registers": None
        if dump.registers is None
        else {"kind": dump.registers.kind, "values": list(dump.registers.values)},
        "symbols": dump.symbols.to_json(),
    }
    return gzip.compress(json.dumps(document).encode(), mtime=0)


def load(path: Path, symbols: Path | None = None) -> Dump:
    """Reads a file. Raises UsageError for one that is not a dump, or is damaged. `symbols`: the symbol file, or the
    image, of a dump that plcrt wrote; without it they are looked for beside the dump and among those of images that
    were built or flashed here."""
    try:
        return parse(read_regular(path, _MOST_BYTES), str(path), symbols or path)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "bad-dump") from None


def parse(data: bytes, name: str = "The file", beside: Path | None = None) -> Dump:
    """The same of its content."""
    try:
        text = inflate(data, _MOST_BYTES, gzip=True) if data.startswith(_GZIP) else data
        document = json.loads(text)
        if not isinstance(document, dict) or document.get("format") != _FORMAT:
            raise ValueError
    except (ArchiveError, ValueError, RecursionError):
        raise UsageError(f"{name} is not a dump; 'plctool dump -o FILE' writes one.", "bad-dump") from None
    if document.get("version") != _VERSION:
        raise UsageError(f"{name} is a dump of another version of plctool; update plctool.", "bad-dump")
    try:
        return _dump(document, name, beside)
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError, IndexError, RecursionError):
        raise UsageError(f"{name} is a damaged dump; take another one.", "bad-dump") from None


def _dump(document: dict[str, Any], name: str, beside: Path | None) -> Dump:
    image_crc = _number(document["image_crc"])
    if document["symbols"] is None:  # as plcrt writes it
        table = find_symbols(image_crc, beside)
    else:
        table = SymbolTable.from_json(_text(document["symbols"]), name)
    if table.image_crc != image_crc:
        raise ValueError
    pointer_size = _number(document["pointer_size"])
    if pointer_size not in (4, 8):
        raise ValueError
    return Dump(
        _record(Identity, document["identity"]),
        table.image_crc,
        None if document["exception"] is None else _exception(document["exception"]),
        [_record(TaskInfo, task) for task in document["tasks"]],
        [_record(LogEntry, entry) for entry in document["log"]],
        [_area(area) for area in document["areas"]],
        table,
        pointer_size,
        _registers(document["registers"], pointer_size),
    )


def _registers(entry: dict[str, Any] | None, pointer_size: int) -> Registers | None:
    if entry is None:
        return None
    return Registers.checked(_number(entry["kind"]), tuple(map(_number, entry["values"])), pointer_size)


def _exception(entry: dict[str, Any]) -> AppException:
    words = {_number(distance): _number(target) for distance, target in entry["words"][:_MOST_WORDS]}
    link = None if entry["link"] is None else _number(entry["link"])
    offset = None if entry["code_offset"] is None else _number(entry["code_offset"])
    return AppException(_number(entry["code"]), offset, _number(entry["task"], lib.APP_IN_EVENT), Trace(words, link))


def _area(entry: dict[str, Any]) -> AreaContent:
    if "hex" in entry:  # as plcrt writes it
        data = bytes.fromhex(_text(entry["hex"]))
    else:
        data = base64.b64decode(_text(entry["data"]), validate=True)
    return AreaContent(_number(entry["area"]), _number(entry["address"]), data)


def _record(kind: type[_T], entry: dict[str, Any]) -> _T:
    """A dataclass of numbers, perhaps None, and strings. Raises ValueError, KeyError for what does not fit it."""
    values: dict[str, object] = {}
    for field in fields(kind):  # type: ignore[arg-type]
        if field.type == "int | None" and entry.get(field.name) is None:
            values[field.name] = None
        else:
            value = entry[field.name]
            values[field.name] = _text(value) if field.type == "str" else _number(value, -(1 << 63))
    return kind(**values)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError
    return value


def _number(value: object, least: int = 0) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < 1 << 64:
        raise ValueError
    return value
