"""Router packets: the worked bytes of the specification and mutations."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.core import lib
from plctool.link import router

ADDRESSES = st.integers(0, 15).flatmap(lambda words: st.binary(min_size=2 * words, max_size=2 * words))


@given(ADDRESSES, ADDRESSES, st.binary(max_size=400), st.integers(0, 255))
def test_packets_survive_encoding(receiver: bytes, sender: bytes, payload: bytes, service: int) -> None:
    packet = router.Packet(service, receiver, sender, payload)
    assert router.decode(router.encode(packet)) == packet


@given(ADDRESSES, ADDRESSES)
def test_payloads_start_at_a_multiple_of_four(receiver: bytes, sender: bytes) -> None:
    encoded = router.encode(router.Packet(64, receiver, sender, b"x"))
    assert (len(encoded) - 1) % 4 == 0
    assert len(encoded) - 1 == router.header_size(receiver, sender)


def test_a_captured_tcp_request_is_understood() -> None:
    packet = router.decode(bytes.fromhex("C56B404000432DDCC0A838722DDF0A00020F830F") + b"data")
    assert packet == router.Packet(64, bytes.fromhex("2DDCC0A83872"), bytes.fromhex("2DDF0A00020F830F"), b"data")


def test_a_captured_broadcast_is_understood() -> None:
    packet = router.decode(bytes.fromhex("C56B40030010000102C2000400000000"))
    assert packet == router.Packet(3, b"", b"\x00\x01", bytes.fromhex("02C2000400000000"))


def test_longer_static_headers_are_honoured() -> None:
    packet = router.decode(bytes.fromhex("C57C40030010123400320000") + b"data")
    assert packet == router.Packet(3, b"", b"\x00\x32", b"data")


def test_filler_is_skipped() -> None:
    packet = router.decode(bytes.fromhex("C5734004001100AF00010000") + b"data")
    assert packet is not None
    assert packet.payload == b"data"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        bytes.fromhex("C56B400300"),  # cut
        bytes.fromhex("C66B40030010000102C20004"),  # wrong magic
        bytes.fromhex("C56A40030010000102C20004"),  # header shorter than it can be
        bytes.fromhex("C56B600300100001"),  # a router's signal
        bytes.fromhex("C56B500300100001"),  # relative address
        bytes.fromhex("C56B400300FF0001"),  # addresses longer than the packet
    ],
)
def test_what_is_no_packet_for_an_end_node_is_refused(data: bytes) -> None:
    assert router.decode(data) is None


@given(st.binary(max_size=64))
def test_random_bytes_never_crash(data: bytes) -> None:
    router.decode(bytes([lib.ROUTER_MAGIC]) + data)
