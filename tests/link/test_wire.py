"""Layouts of packets: packed and unpacked as CmpPackets.h has them."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.core import ffi
from plctool.link.wire import Layout, signed32


def test_members_that_are_not_aligned_have_no_padding() -> None:
    head = Layout("MON2_VALUE")
    assert head.pack(id=0x1234, size=0x56789ABC) == bytes.fromhex("3412bc9a7856")
    assert head.size == ffi.sizeof("MON2_VALUE") == 6


def test_members_that_are_not_given_are_zero() -> None:
    assert Layout("CHANNEL_ACK").pack(type=2, acknowledged=7) == bytes([2, 0, 0, 0, 7, 0, 0, 0])


def test_members_of_the_head_count_as_its_own() -> None:
    data = Layout("CHANNEL_DATA").unpack(bytes(range(12)))
    assert (data.type, data.flags, data.id, data.block) == (0, 1, 0x0302, 0x07060504)


def test_a_layout_may_end_before_a_member() -> None:
    assert Layout("L7_HEADER", before="customer").size == 16


def test_an_unknown_member_is_an_error() -> None:
    with pytest.raises(TypeError, match="colour"):
        Layout("CHANNEL_ACK").pack(colour=1)


def test_too_few_bytes_are_an_error() -> None:
    with pytest.raises(struct.error):
        Layout("CHANNEL_ACK").unpack(bytes(7))


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF), st.binary(min_size=16, max_size=16))
def test_what_is_packed_is_unpacked(result: int, session: int, guid: bytes) -> None:
    reply = Layout("APP_LOGIN_REPLY")
    packed = reply.pack(result=result, session=session, code_guid=guid, data_guid=guid)
    assert reply.unpack(packed) == (result, session, guid, guid)
    in_c = ffi.from_buffer("APP_LOGIN_REPLY *", packed)
    assert int.from_bytes(bytes(in_c.session), "little") == session and bytes(in_c.data_guid) == guid


def test_signed_members() -> None:
    assert [signed32(value) for value in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)] == [0, 1, 2**31 - 1, -(2**31), -1]
