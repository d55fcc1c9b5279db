"""What is packed into an image is what is read from it; bytes that are no configuration are refused."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.io.configuration import (
    ChannelEntry,
    Configuration,
    ConnectorEntry,
    ConnectorMap,
    ParameterEntry,
    TaskMap,
    pack_configuration,
    parse_configuration,
)
from plctool.io.room import needs_of_io

U16, U32 = st.integers(0, 0xFFFE), st.integers(0, 0xFFFF_FFFE)
NAMES = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=31)
DIRECT = st.binary(min_size=1, max_size=4).map(lambda v: (8 * len(v), v, False))
APART = st.binary(max_size=40).map(lambda v: (8 * len(v), v, True))
PARAMETERS = st.builds(lambda i, t, v: ParameterEntry(i, t, *v), U32, U16, DIRECT | APART)
CONNECTORS = st.builds(
    ConnectorEntry, NAMES, NAMES, U16, U16, st.none() | U16, st.none() | U16, st.none() | U32,
    st.lists(PARAMETERS, max_size=4).map(tuple),
)  # fmt: skip
CHANNELS = st.builds(ChannelEntry, U32, U32, U32, U16, U16, U32)
MAPS = st.builds(ConnectorMap, U16, st.lists(CHANNELS, max_size=3).map(tuple))
TASKS = st.builds(TaskMap, U16, st.sampled_from([0, 1]), st.lists(MAPS, max_size=3).map(tuple))


def in_order(connectors: list[ConnectorEntry]) -> tuple[ConnectorEntry, ...]:
    """Each is on one before it, or on none."""
    return tuple(
        replace(c, parent=c.parent % n if n and c.parent is not None else None) for n, c in enumerate(connectors)
    )


CONFIGURATIONS = st.builds(
    Configuration, st.lists(CONNECTORS, max_size=4).map(in_order), st.lists(TASKS, max_size=3).map(tuple), NAMES
)


@examples(100)
@given(CONFIGURATIONS)
def test_what_is_read_is_what_was_written(configuration: Configuration) -> None:
    packed = pack_configuration(configuration)
    assert parse_configuration(packed) == configuration
    assert len(packed) % 4 == 0


@examples(30)
@given(CONFIGURATIONS, st.data())
def test_what_is_cut_off_is_refused(configuration: Configuration, data: st.DataObject) -> None:
    packed = pack_configuration(configuration)
    with pytest.raises(UsageError, match="build it again"):
        parse_configuration(packed[: data.draw(st.integers(0, len(packed) - 1))])


@examples(60)
@given(CONFIGURATIONS, st.data())
def test_changed_bytes_are_read_or_refused(configuration: Configuration, data: st.DataObject) -> None:
    packed = bytearray(pack_configuration(configuration))
    packed[data.draw(st.integers(0, len(packed) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    with suppress(UsageError):
        needs_of_io(parse_configuration(bytes(packed)))


def test_what_a_device_is_on_comes_before_it() -> None:
    """As the loader demands it."""
    connectors = tuple(ConnectorEntry(f"C{n}", "IoDrvSim", lib.CT_MASTER, lib.CF_ENABLE, parent=2) for n in range(2))
    with pytest.raises(UsageError, match="before that which it is on"):
        parse_configuration(pack_configuration(Configuration(connectors, ())))


def test_ranges_of_tables_follow_each_other() -> None:
    """As the loader demands it (IoConfig.h)."""
    sizes = [2, 0, 3]
    connectors = [
        ConnectorEntry(f"c{n}", "d", 1, 1, parameters=tuple(ParameterEntry(i, 0, 8, b"x") for i in range(size)))
        for n, size in enumerate(sizes)
    ]
    packed = pack_configuration(Configuration(tuple(connectors), ()))
    entries = ffi.from_buffer("IoConfigConnector[]", packed[ffi.sizeof("IO_CONFIG") :][: 3 * 24])
    firsts = [entry.first_parameter for entry in entries]
    assert firsts == [0, *accumulate(sizes)][:3]


def test_more_than_the_tables_have_room_for_is_refused() -> None:
    channels = (ChannelEntry(1, 0, 0, 1, 0),) * 0x8000
    maps = tuple(TaskMap(task, 0, (ConnectorMap(0, channels),)) for task in range(2))
    device = ConnectorEntry("c", "d", 1, 1)
    pack_configuration(Configuration((device,), maps[:1]))
    with pytest.raises(UsageError, match=r"There are 65536 channels, each once for every task .* room for 65534"):
        pack_configuration(Configuration((device,), maps))
    with pytest.raises(UsageError, match="There are 65535 devices"):
        pack_configuration(Configuration((device,) * 0xFFFF, ()))
