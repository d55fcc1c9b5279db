"""The application image (.cdl): building it, and taking it apart without trusting it.

All layouts are the structs of firmware/include/CompactDownload.h, reached through cffi.
"""

from __future__ import annotations

import re
import shlex
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.files import read_image
from plctool.iec.areas import Area
from plctool.image.c_functions import version_text
from plctool.project import IMAGE_SUFFIX, SYMBOL_SUFFIX
from plctool.records import dataclass

NO_AREA = int(lib.APP_AREA_NONE)
DEVICE_VERSION = 0x01000000
COMPILER_VERSION = 0x00010000

_AREA_TYPES = (
    lib.AREA_TYPE_DATA,
    lib.AREA_TYPE_RETAIN,
    lib.AREA_TYPE_INPUT,
    lib.AREA_TYPE_OUTPUT,
    lib.AREA_TYPE_MEMORY,
    lib.AREA_TYPE_CODE | lib.AREA_TYPE_CONSTANT,
)
_SEGMENTS = (
    "application_info", "area_table", "function_table", "external_function_table", "iec_function_table", "blob", "code",
)  # fmt: skip
_MAX_NAME = 255
_HEAD = 4096  # bytes that show whether a file is text
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")
ELF_TAG = b"\x7fELF"
TAG = int(lib.CDL_HEADER_TAG).to_bytes(4, "little")
_BLOB_IO = int(lib.CDL_BLOB_IO)
_VARIABLE = int(lib.CDL_EXPORT_VARIABLE)
_NO_INIT = int(lib.CDL_CHANGE_NO_INIT)


@dataclass(frozen=True)
class ImageProperty:
    """A property of the project. `type`: T text, V version (a text), N number, B BOOL."""

    type: str
    value: str | float | bool


@dataclass(frozen=True)
class ApplicationInfo:
    """Strings for users; `date` in seconds since 1970 (UTC), 0 when unknown; `properties`: for components in C, by key,
    as AppProperties.c reads them."""

    project: str = ""
    author: str = ""
    version: str = ""
    description: str = ""
    profile: str = ""
    date: int = 0
    properties: Mapping[str, ImageProperty] = field(default_factory=dict)


@dataclass(frozen=True)
class ExternalFunction:
    """A function of the runtime that the application calls; `offset`: of its slot in the import table [bytes]."""

    name: str
    signature: int
    version: int
    offset: int


@dataclass(frozen=True)
class ImagePart:
    """What a task uses of the inputs or outputs: `first` and `count` in units of CDL_IMAGE_UNIT bytes. `written`: it
    changes some of them; `shared`: another task uses some of them too."""

    first: int = 0
    count: int = 0
    written: bool = False
    shared: bool = False


NO_PARTS = (ImagePart(), ImagePart())


@dataclass(frozen=True)
class ImageTask:
    """`kind`: KIND_*; `entry`: code offset to call (with the Thumb bit on Arm); `event`: (area, offset) of the byte
    with the BOOL, `ignored`: its other bits; `external`: the name of the event a KIND_EXTERNAL task waits for;
    `parts`: what it uses of inputs and of outputs."""

    name: str
    kind: int
    priority: int
    interval_us: int
    entry: int
    watchdog_us: int = 0
    watchdog_sensitivity: int = 1
    event: tuple[int, int] | None = None
    ignored: int = 0
    external: str = ""
    parts: tuple[ImagePart, ImagePart] = NO_PARTS


@dataclass(frozen=True)
class ImageEvent:
    """A function that the runtime calls on an event. `event`: EVT_*; `name`: of the function in the program; `entry`:
    code offset to call (with the Thumb bit on Arm)."""

    event: int
    name: str
    entry: int


@dataclass(frozen=True)
class ImageExport:
    """A function or variable that components in C find by name. `offset` in `area` and `size` [bytes]: of the variable,
    or of the parameters and result of the function; `entry`: code offset to call, None for a variable."""

    name: str
    signature: int
    area: int
    offset: int
    size: int
    entry: int | None = None


@dataclass(frozen=True)
class KeptVariable:
    """A variable that is kept, or the elements of an array (`is_run`), `stride` bytes apart. `hash`: of its name and
    type; `offset` in the retain area and `size` of one element [bytes]; `first`: index of the first element in the
    program."""

    hash: bytes
    offset: int
    size: int
    persistent: bool
    stride: int
    count: int
    first: int
    is_run: bool


@dataclass(frozen=True)
class ChangeStep:
    """A step of an online change (CDL_CHANGE_STEP): what becomes of `size` bytes at `to` of an area in the new program,
    or at `source` of `source_area` in the old one."""

    kind: int
    area: int
    to: int
    size: int
    source_area: int = 0
    source: int = 0
    data: bytes = b""

    @property
    def writes(self) -> bool:
        """True if it writes its bytes into the memory of the new program."""
        return bool(self.kind == lib.CDL_CHANGE_MOVE or self.kind >= lib.CDL_CHANGE_COPY)


@dataclass(frozen=True)
class ImageChange:
    """How the application takes the place of the one with CRC `base` while that runs. `init`: code offset to call, None
    if nothing; `place`: offset of the steps in the code."""

    base: int
    init: int | None
    place: int
    steps: tuple[ChangeStep, ...]


@dataclass(frozen=True)
class Image:
    """An application. `areas`: bytes of RAM by area index. `functions`: CDL_FUNCTION_* -> code offset to call. `kept`:
    in ascending order of their hashes. `io`: offset and size of the I/O configuration in the code."""

    device_id: int
    code: bytes
    areas: dict[int, int]
    functions: dict[int, int]
    externals: list[ExternalFunction]
    tasks: list[ImageTask]
    info: ApplicationInfo = field(default_factory=ApplicationInfo)
    device_type: int = int(lib.TARGET_TYPE_PROGRAMMABLE)
    device_version: int = DEVICE_VERSION
    compiler_version: int = COMPILER_VERSION
    flags: int = 0
    events: list[ImageEvent] = field(default_factory=list)
    exports: list[ImageExport] = field(default_factory=list)
    kept: list[KeptVariable] = field(default_factory=list)
    io: tuple[int, int] | None = None
    change: ImageChange | None = None
    crc: int = 0  # set by `parse_image`


def _pack(kind: str, values: dict[str, Any], size: int | None = None) -> bytes:
    struct = ffi.new(f"{kind} *")
    for name, value in values.items():
        setattr(struct, name, value)
    return bytes(ffi.buffer(struct))[:size]


def _padded(data: bytes, align: int = 4) -> bytes:
    return data + bytes(-len(data) % align)


def _text(text: str) -> bytes:
    return _padded(text.encode("ascii", "replace") + b"\0")


# ---- building ------------------------------------------------------------------------------------------------------


def build_image(image: Image) -> bytes:
    """The bytes of the file, with their CRC."""
    segments = {
        "application_info": _info_segment(image.info),
        "area_table": b"".join(_area_entries(image)),
        "function_table": b"".join(_function_entries(image)),
        "external_function_table": b"".join(_external_entries(image)),
        "iec_function_table": b"".join(_event_entries(image)),
        "blob": b"".join(_blobs(image)),
        "code": image.code,
    }
    header = ffi.new("CDL_HEADER *")
    body = bytearray(int(lib.CDL_HEADER_SIZE))
    for name in _SEGMENTS:
        data = segments[name]
        if not data:
            continue
        align = int(lib.APP_CODE_ALIGN) if name == "code" else 4
        body += bytes(-len(body) % align)
        segment = getattr(header, name)
        segment.offset, segment.size = len(body), len(data)
        body += data
    header.header_tag = lib.CDL_HEADER_TAG
    header.header_version = lib.CDL_HEADER_VERSION
    header.header_size = lib.CDL_HEADER_SIZE
    header.total_size = len(body)
    header.device_type, header.device_id, header.device_version = (
        image.device_type,
        image.device_id,
        image.device_version,
    )
    header.flags, header.compiler_version = image.flags, image.compiler_version
    header.code_area_size = len(image.code)
    header.code_area_index, header.code_area_flags = lib.APP_AREA_CODE, _AREA_TYPES[lib.APP_AREA_CODE]
    body[: lib.CDL_HEADER_SIZE] = bytes(ffi.buffer(header))
    header.crc = zlib.crc32(body)
    body[: lib.CDL_HEADER_SIZE] = bytes(ffi.buffer(header))
    return bytes(body)


def _info_segment(info: ApplicationInfo) -> bytes:
    texts = (info.project, info.author, info.version, info.description, info.profile)
    properties = b"".join(_property(key, found) for key, found in info.properties.items())
    return b"".join(map(_text, texts)) + info.date.to_bytes(4, "little") + properties


def _property(key: str, found: ImageProperty) -> bytes:
    head = _padded((found.type + key).encode("latin-1", "replace") + b"\0")
    if isinstance(found.value, str):
        return head + _padded(found.value.encode("latin-1", "replace") + b"\0")
    return head + (struct.pack("<d", found.value) if found.type == "N" else struct.pack("<I", bool(found.value)))


def _area_entries(image: Image) -> Iterator[bytes]:
    for index, kind in enumerate(_AREA_TYPES):
        size = len(image.code) if index == lib.APP_AREA_CODE else image.areas.get(index, 0)
        if size:
            yield _pack("AREA_INFO", {"size": size, "index": index, "type": kind})


def _function_entries(image: Image) -> Iterator[bytes]:
    for number in range(lib.CDL_FUNCTION_COUNT):
        offset = image.functions.get(number)
        area = NO_AREA if offset is None else lib.APP_AREA_CODE
        yield _pack("POU_REF", {"area": area, "offset": offset or 0})


def _external_entries(image: Image) -> Iterator[bytes]:
    for number, external in enumerate(image.externals):
        values = {
            "signature_id": external.signature,
            "identifier": number,
            "version": external.version,
            "offset": external.offset,
            "area": NO_AREA,
        }
        head = _pack("EXT_REF_INFO", values, int(lib.EXT_REF_INFO_SIZE))
        yield _padded(head + external.name.encode("ascii") + b"\0")


def _event_entries(image: Image) -> Iterator[bytes]:
    for event in image.events:
        values = {"area": lib.APP_AREA_CODE, "offset": event.entry, "identifier": event.event}
        name = event.name[: lib.APP_NAME_SIZE - 1]
        yield _padded(_pack("FUNCTION_INFO", values) + name.encode("ascii", "replace") + b"\0")


def _blobs(image: Image) -> Iterator[bytes]:
    yield _blob(lib.CDL_BLOB_TASKS, b"".join(map(_task_entry, image.tasks)))
    events = b"".join(_event_name(task) + b"\0" for task in image.tasks if task.external)
    if events:
        yield _blob(lib.CDL_BLOB_EVENTS, events)
    if image.kept:
        yield _blob(lib.CDL_BLOB_RETAIN, b"".join(map(_kept_entry, image.kept)))
    if image.exports:
        yield _blob(lib.CDL_BLOB_EXPORTS, b"".join(map(_export_entry, image.exports)))
    if image.io is not None:
        offset, size = image.io
        yield _blob(_BLOB_IO, _pack("IO_CONFIG_PLACE", {"offset": offset, "size": size}))
    if image.change is not None:
        yield _blob(lib.CDL_BLOB_CHANGE, _change_entry(image.change))
    if any(task.parts != NO_PARTS for task in image.tasks):
        yield _blob(lib.CDL_BLOB_IMAGES, b"".join(_part_entry(part) for task in image.tasks for part in task.parts))


def _export_entry(export: ImageExport) -> bytes:
    values = {
        "signature": export.signature,
        "entry": _VARIABLE if export.entry is None else export.entry,
        "offset": export.offset,
        "size": export.size,
        "area": export.area,
    }
    return _padded(_pack("CDL_EXPORT", values) + export.name.encode("ascii") + b"\0")


def _change_entry(change: ImageChange) -> bytes:
    init = _NO_INIT if change.init is None else change.init
    values = {"base": change.base, "init": init, "offset": change.place, "size": len(packed_steps(change))}
    return _pack("CDL_CHANGE", values)


def packed_steps(change: ImageChange) -> bytes:
    """The steps of an online change as they are in the code."""
    return b"".join(map(_step_entry, change.steps))


def _step_entry(step: ChangeStep) -> bytes:
    values = {
        "to": step.to,
        "size": step.size,
        "from": step.source,
        "kind": step.kind,
        "area": step.area,
        "from_area": step.source_area,
    }
    return _pack("CDL_CHANGE_STEP", values) + _padded(step.data)


def _blob(number: int, payload: bytes) -> bytes:
    return _pack("CDL_BLOB", {"magic": lib.CDL_BLOB_MAGIC, "id": number, "size": len(payload)}) + _padded(payload)


def _event_name(task: ImageTask) -> bytes:
    return task.external.encode("ascii", "replace")


def _part_entry(part: ImagePart) -> bytes:
    flags = lib.CDL_IMAGE_WRITTEN * part.written | lib.CDL_IMAGE_SHARED * part.shared
    return _pack("CDL_IMAGE", {"first": part.first, "count": part.count, "flags": flags})


def _task_entry(task: ImageTask) -> bytes:
    area, offset = task.event or (NO_AREA, zlib.crc32(_event_name(task)))
    name = task.name.encode("ascii", "replace")[: lib.CDL_TASK_NAME_SIZE - 1]
    return _pack(
        "CDL_TASK",
        {
            "interval_us": task.interval_us,
            "watchdog_us": task.watchdog_us,
            "watchdog_sensitivity": task.watchdog_sensitivity,
            "priority": task.priority,
            "kind": task.kind,
            "entry_offset": task.entry,
            "event_area": area,
            "event_ignored": task.ignored,
            "event_offset": offset,
            "name": name,
        },
    )


def _kept_entry(kept: KeptVariable) -> bytes:
    shape = 0 if kept.is_run else kept.size.bit_length() - 1
    bits = shape | lib.CDL_KEPT_IS_RUN * kept.is_run | lib.CDL_KEPT_PERSISTENT * kept.persistent
    entry = _pack("CDL_KEPT", {"hash": kept.hash, "place": kept.offset << lib.CDL_KEPT_OFFSET_SHIFT | bits})
    if not kept.is_run:
        return entry
    run = {"size": kept.size, "stride": kept.stride, "count": kept.count, "first": kept.first}
    return entry + _pack("CDL_KEPT_RUN", run)


# ---- taking apart --------------------------------------------------------------------------------------------------


class BadImage(UsageError):
    """Bytes that are not an image. `what`: their file, if known."""

    def __init__(self, reason: str, advice: str = "build it again", what: str = "This") -> None:
        super().__init__(f"{what} is not a valid application image: {reason}; {advice}.", "bad-image")
        self.reason = reason


def _refuse(reason: str) -> BadImage:
    return BadImage(reason)


def parse_image(data: bytes) -> Image:
    """The contents of an image. Raises UsageError saying what is wrong with it."""
    header = _parse_header(data)
    segments = {name: _segment(data, header, name) for name in _SEGMENTS}
    code = segments["code"]
    if not code:
        raise _refuse("it has no code")
    areas = {}
    for entry in _entries("AREA_INFO", segments["area_table"], "area table"):
        if entry.index >= lib.APP_AREA_COUNT or entry.index in areas:
            raise _refuse(f"its area table names area {entry.index}, which does not exist or is there already")
        areas[int(entry.index)] = int(entry.size)
    areas.pop(int(lib.APP_AREA_CODE), None)
    blobs = _parse_blobs(segments["blob"])
    return Image(
        device_id=int(header.device_id),
        code=code,
        areas=areas,
        functions=_parse_functions(segments["function_table"], len(code)),
        externals=list(_parse_externals(segments["external_function_table"])),
        tasks=_parse_tasks(blobs, len(code)),
        info=_parse_info(segments["application_info"]),
        events=list(_parse_events(segments["iec_function_table"], len(code))),
        device_type=int(header.device_type),
        device_version=int(header.device_version),
        compiler_version=int(header.compiler_version),
        flags=int(header.flags),
        exports=list(_parse_exports(blobs.get(int(lib.CDL_BLOB_EXPORTS), b""))),
        kept=list(_parse_kept(blobs.get(int(lib.CDL_BLOB_RETAIN), b""))),
        io=_parse_io(blobs.get(_BLOB_IO, b""), len(code)),
        change=_parse_change(blobs.get(int(lib.CDL_BLOB_CHANGE), b""), code),
        crc=int(header.crc),
    )


def read_program(path: Path, unchecked: bool = False) -> bytes:
    """The bytes of an image that is to run. Raises UsageError for what a programmer burns, which has one in it, and
    unless `unchecked` for what is not a valid image."""
    data = read_image(path)
    if path.suffix.lower() == ".hex" or _is_flash(path, data):
        message = f"{path} is a production image, for a programmer; name the .cdl that it was made of."
        raise UsageError(message, "production-image")
    if not unchecked:
        check_image(path, data)
    return data


def _is_flash(path: Path, data: bytes) -> bool:
    size = int(lib.CDL_HEADER_SIZE)
    if path.suffix.lower() != ".bin" or not data.startswith(TAG) or len(data) < size:
        return False
    return int(ffi.from_buffer("CDL_HEADER *", data[:size]).total_size) < len(data)


def check_image(path: Path, data: bytes) -> None:
    """Raises UsageError that names the file, and what to name in its place, if it is not a valid image."""
    try:
        parse_image(data)
    except BadImage as bad:
        raise _other_file(path, data) or BadImage(bad.reason, what=str(path)) from None


def _other_file(path: Path, data: bytes) -> BadImage | None:
    """What to say of the files that are near an image and mistaken for it."""
    if data.startswith(ELF_TAG):
        advice = "name what 'plctool build' wrote; 'plctool image' takes firmware with --firmware"
        return BadImage("it is an ELF file", advice, str(path))
    if path.suffix.lower() == SYMBOL_SUFFIX:
        return BadImage("it has the symbols of one", f"name {path.with_suffix(IMAGE_SUFFIX)}", str(path))
    if data and not _NO_TEXT.search(data[:_HEAD]):
        advice = f"make an image of it first: plctool build {shlex.join([str(path), '-o', path.stem + IMAGE_SUFFIX])}"
        return BadImage("it is text, such as a source", advice, str(path))
    return None


def image_crc(data: bytes) -> int:
    """The checksum that the header of an image carries; 0 for what is too short to have one."""
    return int.from_bytes(data[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4], "little")


def _parse_header(data: bytes) -> Any:
    size = int(lib.CDL_HEADER_SIZE)
    if len(data) < size:
        raise _refuse(f"it has {len(data)} bytes, a header alone has {size}")
    header = ffi.new("CDL_HEADER *")
    ffi.buffer(header)[:] = data[:size]
    if header.header_tag != lib.CDL_HEADER_TAG:
        raise _refuse("it does not begin with the tag of an image")
    if header.header_version != lib.CDL_HEADER_VERSION or header.header_size < size:
        raise _refuse(f"its header version {header.header_version} is unknown")
    if header.total_size != len(data):
        raise _refuse(f"it has {len(data)} bytes, its header says {header.total_size}")
    crc = zlib.crc32(data[lib.CDL_CRC_OFFSET + 4 :], zlib.crc32(bytes(4), zlib.crc32(data[: lib.CDL_CRC_OFFSET])))
    if crc != header.crc:
        raise _refuse("its checksum does not match its contents")
    return header


def _segment(data: bytes, header: Any, name: str) -> bytes:
    segment = getattr(header, name)
    if not segment.size:
        return b""
    if segment.offset < header.header_size or segment.offset + segment.size > len(data):
        raise _refuse(f"its {name.replace('_', ' ')} is outside of it")
    return data[segment.offset : segment.offset + segment.size]


def _entries(kind: str, data: bytes, title: str) -> Iterator[Any]:
    size = ffi.sizeof(kind)
    if len(data) % size:
        raise _refuse(f"its {title} is cut off")
    for at in range(0, len(data), size):
        entry = ffi.new(f"{kind} *")
        ffi.buffer(entry)[:] = data[at : at + size]
        yield entry


def _parse_functions(data: bytes, code_size: int) -> dict[int, int]:
    functions = {}
    for number, entry in enumerate(_entries("POU_REF", data, "function table")):
        if entry.area == NO_AREA:
            continue
        if number >= lib.CDL_FUNCTION_COUNT:
            break  # no device of ours calls them
        if entry.area != lib.APP_AREA_CODE or entry.offset >= code_size:
            raise _refuse(f"entry {number} of its function table is outside the code")
        functions[number] = int(entry.offset)
    return functions


def _parse_externals(data: bytes) -> Iterator[ExternalFunction]:
    size, at = int(lib.EXT_REF_INFO_SIZE), 0
    while at < len(data):
        end = data.find(b"\0", at + size, at + size + _MAX_NAME)
        if end < 0:
            raise _refuse("its external function table is cut off")
        entry = ffi.new("EXT_REF_INFO *")
        ffi.buffer(entry)[:size] = data[at : at + size]
        name = data[at + size : end].decode("ascii", "replace")
        yield ExternalFunction(name, int(entry.signature_id), int(entry.version), int(entry.offset))
        at = end + 1 + -(end + 1) % 4


def _parse_events(data: bytes, code_size: int) -> Iterator[ImageEvent]:
    """The entries of the IEC function table that belong to events."""
    size, at = ffi.sizeof("FUNCTION_INFO"), 0
    while at < len(data):
        end = data.find(b"\0", at + size, at + size + _MAX_NAME)
        if end < 0:
            raise _refuse("its IEC function table is cut off")
        (entry,) = _entries("FUNCTION_INFO", data[at : at + size], "IEC function table")
        name = data[at + size : end].decode("ascii", "replace")
        if entry.area != lib.APP_AREA_CODE or entry.offset >= code_size:
            raise _refuse(f"its function {name} is outside the code")
        if entry.identifier:
            yield ImageEvent(int(entry.identifier), name, int(entry.offset))
        at = end + 1 + -(end + 1) % 4


def _parse_exports(data: bytes) -> Iterator[ImageExport]:
    size, at = ffi.sizeof("CDL_EXPORT"), 0
    while at < len(data):
        end = data.find(b"\0", at + size, at + size + _MAX_NAME)
        if end < 0:
            raise _refuse("its table of exported functions is cut off")
        (entry,) = _entries("CDL_EXPORT", data[at : at + size], "table of exported functions")
        name, where = (
            data[at + size : end].decode("ascii", "replace"),
            None if entry.entry == _VARIABLE else int(entry.entry),
        )
        yield ImageExport(name, int(entry.signature), int(entry.area), int(entry.offset), int(entry.size), where)
        at = end + 1 + -(end + 1) % 4


def _parse_blobs(data: bytes) -> dict[int, bytes]:
    """Payloads by id."""
    blobs, at, head = {}, 0, ffi.sizeof("CDL_BLOB")
    while at < len(data):
        blob = ffi.new("CDL_BLOB *")
        if at + head > len(data):
            raise _refuse("its blob is cut off")
        ffi.buffer(blob)[:] = data[at : at + head]
        payload = data[at + head : at + head + blob.size]
        if blob.magic != lib.CDL_BLOB_MAGIC or len(payload) != blob.size:
            raise _refuse("its blob is damaged")
        blobs[int(blob.id)] = payload
        at += head + len(payload) + -len(payload) % 4
    return blobs


def _parse_tasks(blobs: dict[int, bytes], code_size: int) -> list[ImageTask]:
    tasks = []
    names = blobs.get(int(lib.CDL_BLOB_EVENTS), b"").split(b"\0")
    events = {zlib.crc32(name): name.decode("ascii", "replace") for name in names}
    parts = [_parse_part(e) for e in _entries("CDL_IMAGE", blobs.get(int(lib.CDL_BLOB_IMAGES), b""), "image list")]
    for number, task in enumerate(_entries("CDL_TASK", blobs.get(int(lib.CDL_BLOB_TASKS), b""), "task list")):
        name = bytes(ffi.buffer(task.name)).split(b"\0")[0].decode("ascii", "replace")
        if task.entry_offset >= code_size:
            raise _refuse(f"the entry of task {name} is outside the code")
        event = None if task.event_area == NO_AREA else (int(task.event_area), int(task.event_offset))
        external = events.get(int(task.event_offset), "") if task.kind == lib.KIND_EXTERNAL else ""
        inputs, outputs = (*parts[2 * number : 2 * number + 2], *NO_PARTS)[:2]
        tasks.append(
            ImageTask(
                name, int(task.kind), int(task.priority), int(task.interval_us), int(task.entry_offset),
                int(task.watchdog_us), int(task.watchdog_sensitivity), event, int(task.event_ignored), external,
                (inputs, outputs),
            )
        )  # fmt: skip
    return tasks


def _parse_part(entry: Any) -> ImagePart:
    written, shared = bool(entry.flags & lib.CDL_IMAGE_WRITTEN), bool(entry.flags & lib.CDL_IMAGE_SHARED)
    return ImagePart(int(entry.first), int(entry.count), written, shared)


def _parse_kept(payload: bytes) -> Iterator[KeptVariable]:
    size, at = ffi.sizeof("CDL_KEPT"), 0
    while at < len(payload):
        (entry,) = _entries("CDL_KEPT", payload[at : at + size], "table of kept variables")
        at += size
        shape = entry.place & lib.CDL_KEPT_SHAPE
        length, stride, count, first = 1 << shape, 1 << shape, 1, 0
        is_run = bool(entry.place & lib.CDL_KEPT_IS_RUN)
        if is_run:
            runs = list(_entries("CDL_KEPT_RUN", payload[at : at + size], "table of kept variables"))
            if not runs:
                raise _refuse("its table of kept variables is cut off")
            at += size
            run = runs[0]
            length, stride, count, first = int(run.size), int(run.stride), int(run.count), int(run.first)
        persistent = bool(entry.place & lib.CDL_KEPT_PERSISTENT)
        offset = int(entry.place >> lib.CDL_KEPT_OFFSET_SHIFT)
        yield KeptVariable(
            bytes(ffi.buffer(entry.hash)), offset, length, persistent, stride, count, first, is_run
        )  # fmt: skip


def _parse_io(payload: bytes, code_size: int) -> tuple[int, int] | None:
    if not payload:
        return None
    (place,) = _entries("IO_CONFIG_PLACE", payload[: ffi.sizeof("IO_CONFIG_PLACE")], "place of its I/O configuration")
    if place.offset + place.size > code_size:
        raise _refuse("its I/O configuration is outside the code")
    return int(place.offset), int(place.size)


def _parse_change(payload: bytes, code: bytes) -> ImageChange | None:
    if not payload:
        return None
    (change,) = _entries("CDL_CHANGE", payload[: ffi.sizeof("CDL_CHANGE")], "online change")
    at, end = int(change.offset), int(change.offset + change.size)
    if end > len(code):
        raise _refuse("the steps of its online change are outside the code")
    steps, size = [], ffi.sizeof("CDL_CHANGE_STEP")
    while at < end:
        (step,) = _entries("CDL_CHANGE_STEP", code[at : at + size], "online change")
        at += size
        length = step.size if step.kind == lib.CDL_CHANGE_PUT else 0
        if length > end - at:
            raise _refuse("the steps of its online change are cut off")
        source = int(getattr(step, "from"))
        steps.append(
            ChangeStep(
                int(step.kind), int(step.area), int(step.to), int(step.size), int(step.from_area), source,
                code[at : at + length],
            )
        )  # fmt: skip
        at += length + -length % 4
    init = None if change.init == lib.CDL_CHANGE_NO_INIT else int(change.init)
    return ImageChange(int(change.base), init, int(change.offset), tuple(steps))


def _parse_info(data: bytes) -> ApplicationInfo:
    texts: list[str] = []
    at = 0
    while len(texts) < 5 and (end := data.find(b"\0", at)) >= 0:
        texts.append(data[at:end].decode("ascii", "replace"))
        at = end + 1 + -(end + 1) % 4
    project, author, version, description, profile = texts + [""] * (5 - len(texts))
    date = int.from_bytes(data[at : at + 4], "little")
    return ApplicationInfo(project, author, version, description, profile, date)


# ---- for people ----------------------------------------------------------------------------------------------------


def target_name(device_id: int) -> str:
    """The name of the target with this TARGET_ID_*, or the numbers of vendor and device in hex."""
    from plctool.image.targets import TARGETS

    for target in TARGETS.values():
        if getattr(lib, target.device_id) == device_id:
            return target.name
    return f"{device_id >> 16:04X}:{device_id & 0xFFFF:04X}"


def built_for(device_id: int) -> str:
    """How an image for this number is built, as the end of a sentence."""
    name = target_name(device_id)
    return "with the device.toml of its vendor, or --firmware" if ":" in name else f"with --target {name}"


def _numbered(prefix: str) -> dict[int, str]:
    """The names of an enumeration of the firmware, in small letters and without their prefix, by number."""
    return {int(getattr(lib, name)): name.removeprefix(prefix).lower() for name in dir(lib) if name.startswith(prefix)}


def event_name(number: int) -> str:
    """The name of an event, EVT_*, or its number in hex."""
    names = (n for n in dir(lib) if n.startswith("EVT_") and getattr(lib, n) == number)
    return next(names, f"0x{number:X}")


def describe_image(data: bytes) -> dict[str, Any]:
    """What `plctool info` shows, ready for JSON. Raises UsageError for what is not an image."""
    image = parse_image(data)
    kinds = _numbered("KIND_")
    functions = _numbered("CDL_FUNCTION_")
    info = image.info
    return {
        "size": len(data),
        "crc": f"{image.crc:08X}",
        "target": target_name(image.device_id),
        "device_type": image.device_type,
        "device_id": image.device_id,
        "device_version": image.device_version,
        "compiler_version": image.compiler_version,
        "code_size": len(image.code),
        **({} if image.change is None else {"replaces": f"{image.change.base:08X}"}),
        "info": {
            "project": info.project,
            "author": info.author,
            "version": info.version,
            "description": info.description,
            "profile": info.profile,
            "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(info.date)) if info.date else "",
        },
        "areas": [{"name": Area(index).name.lower(), "size": size} for index, size in sorted(image.areas.items())],
        "functions": [
            {"name": functions[number], "offset": offset} for number, offset in sorted(image.functions.items())
        ],
        "externals": [
            {"name": e.name, "signature": f"{e.signature:08X}", "version": version_text(e.version)}
            for e in image.externals
        ],
        "tasks": [
            {
                "name": t.name,
                "kind": kinds.get(t.kind, str(t.kind)),
                "priority": t.priority,
                "interval_us": t.interval_us,
                "watchdog_us": t.watchdog_us,
                "watchdog_sensitivity": t.watchdog_sensitivity,
                "entry": t.entry,
            }
            for t in image.tasks
        ],
        "exports": [
            {"name": e.name, "kind": "variable" if e.entry is None else "function", "signature": f"{e.signature:08X}"}
            for e in image.exports
        ],
        "events": [{"event": event_name(e.event), "function": e.name, "entry": e.entry} for e in image.events],
    }
