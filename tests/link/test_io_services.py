"""The services of inputs and outputs against a device that lies: what the tool asks comes to an end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import pytest

from plctool.core import lib
from plctool.errors import DeviceError
from plctool.link import bintag, io_services
from plctool.link.bintag import Tag
from plctool.link.wire import Layout

T = TypeVar("T")
MANY = 3000


class Repeating:
    """A session with a device that gives one reply to everything."""

    def __init__(self, *reply: Tag) -> None:
        self._reply = bintag.decode(bintag.encode(list(reply)))
        self._calls = 0

    def recover(self, work: Callable[[], T]) -> T:
        return work()

    def call(self, group: int, command: int, tags: Sequence[Tag] = ()) -> bintag.Tags:
        self._calls += 1
        assert self._calls < MANY, "without end"
        return self._reply


def entry(index: int) -> Tag:
    state = Layout("IO_STATE").pack(index=index)
    name, driver = bintag.text(lib.TAG_IO_NAME, "a"), bintag.text(lib.TAG_IO_DRIVER, "b")
    return bintag.container(lib.TAG_IO_ENTRY, bintag.raw(lib.TAG_IO_STATE, state), name, driver)


def test_a_list_that_begins_again_ends() -> None:
    session: Any = Repeating(entry(0))
    assert [device.name for device in io_services.list_devices(session)] == ["a"]


@pytest.mark.parametrize("with_module", [False, True])
def test_a_scan_that_always_finds_more_ends(with_module: bool) -> None:
    reply = [bintag.u16(lib.TAG_IO_RESULT, lib.ERR_OK)]
    if with_module:
        reply.append(bintag.raw(lib.TAG_IO_MODULE, Layout("IO_MODULE").pack(slot=1) + b"x\0"))
    session: Any = Repeating(*reply)
    with pytest.raises(DeviceError, match="does not come to an end"):
        list(io_services.scan(session, 0))
