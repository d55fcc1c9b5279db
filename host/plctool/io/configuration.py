"""The I/O configuration of an image: its tables as records, and the bytes of IoConfig.h."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.image.file import Image
from plctool.records import dataclass

NONE = int(lib.IO_CONFIG_NONE)
NOWHERE = int(lib.IO_CONFIG_NOWHERE)
ALIGN = 4
MAX_ENTRIES = NONE - 1  # of each table
MAX_BITS = 0xFFFF  # of a channel

T = TypeVar("T")


@dataclass(frozen=True)
class ParameterEntry:
    """`type`: TYPE_CLASS; `value`: its bytes, little-endian. `is_data`: a text or array, which is stored apart."""

    id: int
    type: int
    bits: int
    value: bytes
    is_data: bool = False


@dataclass(frozen=True)
class ConnectorEntry:
    """`type`: CT_*; `flags`: CF_*; `parent` and `bus_task`: indices, None for none; `state`: offset of its IO_DEVICE in
    the data area, None for none."""

    name: str
    driver: str
    type: int
    flags: int
    parent: int | None = None
    bus_task: int | None = None
    state: int | None = None
    parameters: tuple[ParameterEntry, ...] = ()


@dataclass(frozen=True)
class ChannelEntry:
    """`parameter` and `parameter_bit`: where the driver has it; `area_bit`: in the inputs or outputs."""

    parameter: int
    parameter_bit: int
    area_bit: int
    bits: int
    flags: int
    value: int = 0

    def single_bits(self) -> Iterator[ChannelEntry]:
        """The channels that it is made of if it is neither whole bytes nor a single bit, else the channel."""
        if self.bits >= 8:
            yield self
        else:
            for n in range(self.bits):
                at, area = self.parameter_bit + n, self.area_bit + n
                yield ChannelEntry(self.parameter, at, area, 1, self.flags, self.value >> n & 1)


@dataclass(frozen=True)
class ConnectorMap:
    """The channels of a connector that a task uses."""

    connector: int
    channels: tuple[ChannelEntry, ...]


@dataclass(frozen=True)
class TaskMap:
    """What a task uses of inputs or of outputs (`type`: IO_MAP_*)."""

    task: int
    type: int
    connectors: tuple[ConnectorMap, ...]


@dataclass(frozen=True)
class Configuration:
    """All tables. `board`: the one whose inputs and outputs are meant, "" for any."""

    connectors: tuple[ConnectorEntry, ...]
    task_maps: tuple[TaskMap, ...]
    board: str = ""


# ---- writing -------------------------------------------------------------------------------------------------------


_TITLES = {
    "connectors": "devices of inputs and outputs",
    "parameters": "parameters of devices",
    "task_maps": "tasks with inputs and outputs",
    "connector_maps": "devices, each once for every task that uses it",
    "channel_maps": "channels, each once for every task that uses it",
}


def pack_configuration(configuration: Configuration) -> bytes:
    """The bytes, whose number is a multiple of 4. Raises UsageError for more than they have room for."""
    return _Writer(configuration).packed()


class _Writer:
    def __init__(self, configuration: Configuration) -> None:
        self._data = bytearray()
        self._known: dict[bytes, int] = {}
        self._configuration = configuration

    def packed(self) -> bytes:
        parameters = [p for c in self._configuration.connectors for p in c.parameters]
        connector_maps = [c for t in self._configuration.task_maps for c in t.connectors]
        channels = [c for m in connector_maps for c in m.channels]
        counts = {
            "connectors": len(self._configuration.connectors),
            "parameters": len(parameters),
            "task_maps": len(self._configuration.task_maps),
            "connector_maps": len(connector_maps),
            "channel_maps": len(channels),
        }
        for name, count in counts.items():
            if count > MAX_ENTRIES:
                raise UsageError(f"There are {count} {_TITLES[name]}; an image has room for {MAX_ENTRIES}.", "io")
        tables = [
            *self._connectors(),
            *map(self._parameter, parameters),
            *self._task_maps(),
            *self._connector_maps(connector_maps),
            *(_struct("IoConfigChannelMap", **vars(c)) for c in channels),
        ]
        board = self._text(self._configuration.board) if self._configuration.board else NOWHERE
        head = _struct(
            "IO_CONFIG", version=int(lib.IO_CONFIG_VERSION), **counts, data_size=len(self._data), board=board
        )
        return b"".join((head, *tables, bytes(self._data)))

    def _connectors(self) -> Iterator[bytes]:
        first = 0
        for c in self._configuration.connectors:
            yield _struct(
                "IoConfigConnector",
                type=c.type,
                parent=_or(c.parent, NONE),
                flags=c.flags,
                bus_task=_or(c.bus_task, NONE),
                first_parameter=first,
                parameter_count=len(c.parameters),
                name=self._text(c.name),
                driver=self._text(c.driver),
                state=_or(c.state, NOWHERE),
            )
            first += len(c.parameters)

    def _parameter(self, p: ParameterEntry) -> bytes:
        value = self._place(p.value) if p.is_data else int.from_bytes(p.value, "little")
        flags = int(lib.PVF_POINTER) if p.is_data else 0
        return _struct("IoConfigParameter", id=p.id, type=p.type, flags=flags, bits=p.bits, value=value)

    def _task_maps(self) -> Iterator[bytes]:
        first = 0
        for t in self._configuration.task_maps:
            count = len(t.connectors)
            yield _struct(
                "IoConfigTaskMap", task=t.task, type=t.type, first_connector_map=first, connector_map_count=count
            )
            first += count

    @staticmethod
    def _connector_maps(maps: Sequence[ConnectorMap]) -> Iterator[bytes]:
        first = 0
        for m in maps:
            count = len(m.channels)
            yield _struct(
                "IoConfigConnectorMap", connector=m.connector, first_channel_map=first, channel_map_count=count
            )
            first += count

    def _text(self, text: str) -> int:
        return self._place(text.encode("ascii", "replace")[: int(lib.IO_CONFIG_MAX_NAME) - 1] + b"\0")

    def _place(self, data: bytes) -> int:
        """The offset of some bytes in the data, where equal ones are once."""
        if data not in self._known:
            self._known[data] = len(self._data)
            self._data += data + bytes(-len(data) % ALIGN)
        return self._known[data]


def _or(number: int | None, otherwise: int) -> int:
    return otherwise if number is None else number


def _struct(kind: str, **values: int) -> bytes:
    return bytes(ffi.buffer(ffi.new(f"{kind} *", values)))


# ---- reading -------------------------------------------------------------------------------------------------------


def configuration_of_image(image: Image) -> Configuration | None:
    """The inputs and outputs of an image, None if it has none. Raises UsageError for what is damaged."""
    if image.io is None:
        return None
    offset, size = image.io
    return parse_configuration(image.code[offset : offset + size])


def parse_configuration(data: bytes) -> Configuration:
    """The tables of an image. Raises UsageError for bytes that are not one; nothing in them is trusted."""
    return _Reader(data).configuration()


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._left = data
        (head,) = self._take("IO_CONFIG", 1)
        if head.version != lib.IO_CONFIG_VERSION:
            raise _damaged(f"has version {head.version}")
        self._connectors = self._take("IoConfigConnector", head.connectors)
        self._parameters = self._take("IoConfigParameter", head.parameters)
        self._task_maps = self._take("IoConfigTaskMap", head.task_maps)
        self._connector_maps = self._take("IoConfigConnectorMap", head.connector_maps)
        self._channels = self._take("IoConfigChannelMap", head.channel_maps)
        self._data = self._left
        if len(self._data) != head.data_size:
            raise _damaged("is cut off")
        self._board = "" if head.board == NOWHERE else self._text(head.board)

    def _take(self, kind: str, count: int) -> list[Any]:
        size = ffi.sizeof(kind)
        if size * count > len(self._left):
            raise _damaged("is cut off")
        entries = ffi.new(f"{kind}[]", count)
        ffi.buffer(entries)[:] = self._left[: size * count]
        self._left = self._left[size * count :]
        self._owners = [*getattr(self, "_owners", []), entries]
        return list(entries)

    def configuration(self) -> Configuration:
        if any(c.parent != NONE and c.parent >= index for index, c in enumerate(self._connectors)):
            raise _damaged("names a device or bus before that which it is on")
        return Configuration(
            tuple(map(self._connector, self._connectors)),
            tuple(
                TaskMap(int(t.task), int(t.type), self._maps(t.first_connector_map, t.connector_map_count))
                for t in self._task_maps
            ),
            self._board,
        )

    def _connector(self, c: Any) -> ConnectorEntry:
        return ConnectorEntry(
            self._text(c.name),
            self._text(c.driver),
            int(c.type),
            int(c.flags),
            None if c.parent == NONE else int(c.parent),
            None if c.bus_task == NONE else int(c.bus_task),
            None if c.state == NOWHERE else int(c.state),
            tuple(map(self._parameter, _part(self._parameters, c.first_parameter, c.parameter_count))),
        )

    def _parameter(self, p: Any) -> ParameterEntry:
        size = -(-p.bits // 8)
        is_data = bool(p.flags & lib.PVF_POINTER)
        value = self._bytes(p.value, size) if is_data else int(p.value).to_bytes(4, "little")[:size]
        return ParameterEntry(int(p.id), int(p.type), int(p.bits), value, is_data)

    def _maps(self, first: int, count: int) -> tuple[ConnectorMap, ...]:
        return tuple(
            ConnectorMap(int(m.connector), tuple(map(_channel, self._channels_of(m))))
            for m in _part(self._connector_maps, first, count)
        )

    def _channels_of(self, m: Any) -> list[Any]:
        return _part(self._channels, m.first_channel_map, m.channel_map_count)

    def _bytes(self, offset: int, size: int) -> bytes:
        if offset + size > len(self._data):
            raise _damaged("names data outside of it")
        return self._data[offset : offset + size]

    def _text(self, offset: int) -> str:
        end = self._data.find(b"\0", offset, offset + int(lib.IO_CONFIG_MAX_NAME))
        if end < 0:
            raise _damaged("names a text outside of it")
        return self._data[offset:end].decode("ascii", "replace")


def _channel(c: Any) -> ChannelEntry:
    return ChannelEntry(
        int(c.parameter), int(c.parameter_bit), int(c.area_bit), int(c.bits), int(c.flags), int(c.value)
    )


def _part(entries: list[T], first: int, count: int) -> list[T]:
    if first + count > len(entries):
        raise _damaged("names an entry that it has not")
    return entries[first : first + count]


def _damaged(what: str) -> UsageError:
    return UsageError(f"The I/O configuration of this image {what}; build it again.", "bad-image")
