"""Serial framing: the worked bytes of the specification, resynchronisation, damage."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.core import lib
from plctool.link import simplecom

PACKETS = st.binary(min_size=1, max_size=lib.BLK_MAX_SIZE)


def test_crc_has_the_check_value_of_the_specification() -> None:
    assert simplecom.crc16(b"123456789") == 0xE5CC


@pytest.mark.parametrize(
    ("packet", "frame"),
    [("122334", "233C12235F346D19233E"), ("C50B400100100001", "233CC50B400100100001FA7A233E")],
)
def test_worked_frames_of_the_specification(packet: str, frame: str) -> None:
    assert simplecom.encode(bytes.fromhex(packet)) == bytes.fromhex(frame)
    assert simplecom.Decoder().feed(bytes.fromhex(frame)) == [bytes.fromhex(packet)]


def test_bytes_of_the_crc_are_escaped_too() -> None:
    packet = next(p for p in (n.to_bytes(2, "big") for n in range(65536)) if 0x23 in _crc_bytes(p) and 0x23 not in p)
    frame = simplecom.encode(packet)
    assert b"#_" in frame
    assert simplecom.Decoder().feed(frame) == [packet]


def _crc_bytes(packet: bytes) -> bytes:
    return simplecom.crc16(packet).to_bytes(2, "little")


@given(st.lists(PACKETS, max_size=5), st.integers(1, 600))
def test_packets_arrive_however_the_stream_is_cut(packets: list[bytes], step: int) -> None:
    stream = b"".join(map(simplecom.encode, packets))
    decoder = simplecom.Decoder()
    arrived = [p for at in range(0, len(stream), step) for p in decoder.feed(stream[at : at + step])]
    assert arrived == packets
    assert decoder.dropped == 0


@given(st.binary(max_size=2000), PACKETS)
def test_a_frame_after_any_noise_is_found(noise: bytes, packet: bytes) -> None:
    decoder = simplecom.Decoder()
    decoder.feed(noise)
    assert decoder.feed(simplecom.encode(packet))[-1:] == [packet]


@given(PACKETS, st.randoms(use_true_random=False))
def test_a_flipped_bit_never_gives_another_packet(packet: bytes, rng: random.Random) -> None:
    frame = bytearray(simplecom.encode(packet))
    frame[rng.randrange(len(frame))] ^= 1 << rng.randrange(8)
    assert all(p == packet for p in simplecom.Decoder().feed(bytes(frame)))


@given(PACKETS, PACKETS, st.data())
def test_a_lost_byte_costs_one_frame_only(first: bytes, second: bytes, data: st.DataObject) -> None:
    frame = simplecom.encode(first)
    at = data.draw(st.integers(0, len(frame) - 1))
    decoder = simplecom.Decoder()
    arrived = decoder.feed(frame[:at] + frame[at + 1 :] + simplecom.encode(second))
    assert arrived[-1] == second
    assert all(p in (first, second) for p in arrived)


@pytest.mark.parametrize("body", [b"", b"\x12", b"\x12\x34", b"ab#", b"a#b\x00\x00"])
def test_frames_too_short_or_wrongly_escaped_are_dropped(body: bytes) -> None:
    decoder = simplecom.Decoder()
    assert decoder.feed(b"#<" + body + b"#>") == []
    assert decoder.dropped == 1


def test_the_longest_packet_of_escapes_passes_and_one_byte_more_is_dropped() -> None:
    longest = b"#" * lib.BLK_MAX_SIZE
    assert simplecom.Decoder().feed(simplecom.encode(longest)) == [longest]
    assert simplecom.Decoder().feed(simplecom.encode(longest + b"#")) == []


def test_an_endless_frame_does_not_fill_the_memory() -> None:
    decoder = simplecom.Decoder()
    decoder.feed(b"#<")
    for _ in range(100):
        decoder.feed(b"x" * 1000)
    assert len(decoder._buffer) <= 2 * simplecom.MAX_PACKET + 8 + 1000
    assert decoder.feed(simplecom.encode(b"ok")) == [b"ok"]
