"""The SDO client against PyPI canopen's server and one with block transfer: each frame lost, doubled and late."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from contextlib import suppress

import can
import pytest
from sdo_bed import FRAME_TIME, NODE, Bed, BlockServer, Foreign

from plctool.canopen.bus import CanopenBus
from plctool.canopen.sdo import MAX_VALUE, SdoAbort, SdoClient
from plctool.errors import DeviceError, LinkError

SIZES = (1, 2, 3, 4, 5, 7, 8, 14, 100, 889, 890, 2000)


@pytest.mark.parametrize("size", SIZES)
def test_segmented_and_expedited_values_arrive_as_they_were_sent(size: int) -> None:
    value = random.Random(size).randbytes(size)
    client = Bed(Foreign()).client()
    client.write(0x2100, 0, value, block=False)
    assert client.read(0x2100, 0) == value


def test_an_empty_value_is_one_segment_without_bytes() -> None:
    bed = Bed(Foreign())
    bed.client().write(0x2100, 0, b"")
    assert bed.sent == [bytes.fromhex("2100210000000000"), bytes.fromhex("0f00000000000000")]


@pytest.mark.parametrize("crc", [True, False])
@pytest.mark.parametrize("block", [1, 2, 8, 127])
@pytest.mark.parametrize("size", [64, 65, 70, 889, 890, 2000])
def test_block_transfers_have_the_same_bytes(size: int, block: int, crc: bool) -> None:
    value = random.Random(size).randbytes(size)
    server = BlockServer(block=block, crc=crc)
    client = Bed(server).client()
    client.write(0x2100, 0, value)
    assert server.value == value
    assert client.read(0x2100, 0, block=True) == value


def test_a_device_without_block_transfer_is_written_in_segments() -> None:
    bed = Bed(Foreign())
    bed.client().write(0x2100, 0, bytes(100))
    assert bed.sent[0][0] == 0xC6
    assert bed.sent[1][0] == 0x21
    assert bed.client().read(0x2100, 0, block=True) == bytes(100)


@pytest.mark.parametrize(
    ("index", "sub", "words"),
    [
        (0x5555, 0, "Node 5 refuses 5555:00: the object does not exist (06020000)."),
        (0x1018, 77, "Node 5 refuses 1018:4D: the sub-index does not exist (06090011)."),
    ],
)
def test_aborts_are_in_words(index: int, sub: int, words: str) -> None:
    with pytest.raises(SdoAbort) as error:
        Bed(Foreign()).client().read(index, sub)
    assert error.value.message == words


def test_four_bytes_without_a_size_are_cut_to_what_is_expected() -> None:
    bed = Bed(lambda data: iter([bytes([0x42]) + data[1:4] + b"\1\2\3\4"]))
    assert bed.client().read(0x2000, 0, expected=2) == b"\1\2"
    assert bed.client().read(0x2000, 0) == b"\1\2\3\4"


# ---- frames that are lost, doubled, late ----

Action = Callable[[SdoClient], bytes | None]
VALUE = random.Random(1).randbytes(100)


def _read(client: SdoClient) -> bytes:
    return client.read(0x2100, 0)


def _write(client: SdoClient) -> None:
    client.write(0x2100, 0, VALUE, block=False)


def _read_block(client: SdoClient) -> bytes:
    return client.read(0x2100, 0, block=True)


def _write_block(client: SdoClient) -> None:
    client.write(0x2100, 0, VALUE)


def _foreign() -> Foreign:
    server = Foreign()
    Bed(server).client().write(0x2100, 0, VALUE, block=False)
    return server


def _stored(server: Foreign | BlockServer) -> bytes:
    return server.value if isinstance(server, BlockServer) else bytes(server.node.data_store[0x2100][0])


CASES: list[tuple[Callable[[], Foreign | BlockServer], Action]] = [
    (_foreign, _read),
    (Foreign, _write),
    (lambda: BlockServer(VALUE), _read_block),
    (lambda: BlockServer(), _write_block),
]


def _faults() -> Iterator[tuple[str, list[float]]]:
    yield "lost", []
    yield "doubled", [0.0, 0.0]
    for late in (FRAME_TIME * 1.5, 0.02, 0.5, 0.999, 1.5, 2.0):
        yield f"late {late}", [late]
    yield "doubled late", [0.0, 0.5]


@pytest.mark.parametrize(("fault", "copies"), list(_faults()), ids=[name for name, _ in _faults()])
@pytest.mark.parametrize("case", range(len(CASES)), ids=["read", "write", "read_block", "write_block"])
def test_a_bad_frame_ends_well_or_with_a_named_error_and_never_with_wrong_data(
    case: int, fault: str, copies: list[float]
) -> None:
    make, action = CASES[case]
    clean = Bed(make())
    action(clean.client())
    named = 0
    for bad in range(clean.frames):
        server = make()
        bed = Bed(server, lambda number, data, bad=bad: copies if number == bad else [0.0])
        try:
            result = action(bed.client())
        except (DeviceError, LinkError) as error:
            named += 1
            assert error.code in ("timeout", "sdo-abort", "sdo-protocol"), error.message
            assert bed.now() < 5
        else:
            assert (result if result is not None else _stored(server)) == VALUE, f"frame {bad}"
        assert _works_again(bed, server), f"frame {bad}"
    if fault == "lost" and case in (0, 1):
        assert named == clean.frames  # nothing is repeated


def _works_again(bed: Bed, server: Foreign | BlockServer) -> bool:
    """After all late frames the client can use the server, at the latest after its abort has ended a transfer that a
    late frame began."""
    bed.receive(5.0)
    while bed.receive(1.0) is not None:
        pass
    client = bed.client()
    if isinstance(server, BlockServer):
        with suppress(LinkError):
            client.write(0x2100, 0, VALUE)
        client.write(0x2100, 0, VALUE)
        return server.value == VALUE
    return client.read(0x1000, 0) == bytes.fromhex("91010300")


# ---- hostile devices ----


class Hostile:
    """Replies with any bytes; its time passes."""

    def __init__(self, replies: Callable[[bytes], bytes | None]) -> None:
        self._replies = replies
        self._waiting: list[bytes] = []
        self._now = 0.0
        self.frames = 0

    def send(self, message: can.Message) -> None:
        self._now += FRAME_TIME
        if (reply := self._replies(bytes(message.data))) is not None:
            self._waiting.append(reply)

    def receive(self, timeout: float) -> can.Message | None:
        if not self._waiting:
            self._now += max(timeout, 0.0)
            return None
        self._now += FRAME_TIME
        self.frames += 1
        return can.Message(arbitration_id=0x580 + NODE, is_extended_id=False, data=self._waiting.pop(0))

    def now(self) -> float:
        return self._now

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        pass


def test_random_replies_end_with_an_error_or_a_value() -> None:
    rng = random.Random(1)
    for _ in range(1500):

        def reply(data: bytes) -> bytes | None:
            echo = bytes([rng.choice([0x41, 0x43, 0x60, 0xA0, 0xA2, 0xC0, 0xC6, 0x00, 0x10, 0x80, rng.randrange(256)])])
            frame = echo + data[1:4] + rng.randbytes(4) if rng.random() < 0.7 else rng.randbytes(8)
            return frame[: rng.choice([8, 8, 8, rng.randrange(9)])] if rng.random() < 0.95 else None

        client = SdoClient(CanopenBus(Hostile(reply), "test"), NODE, 0.1)
        for action in (_read, _write, _read_block, _write_block):
            with suppress(DeviceError, LinkError):
                action(client)


def test_a_device_cannot_make_the_tool_read_for_ever() -> None:
    def endless(data: bytes) -> bytes:
        if data[0] == 0x40:
            return b"\x40" + data[1:4] + bytes(4)
        return bytes([data[0] & 0x10]) + bytes(7)

    import plctool.canopen.sdo as sdo

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sdo, "MAX_VALUE", 4096)
        with pytest.raises(DeviceError, match="was given up: the value has more than"):
            _read(SdoClient(CanopenBus(Hostile(endless), "test"), NODE))


@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (lambda d: b"\x41" + d[1:4] + (MAX_VALUE + 1).to_bytes(4, "little"), "more than 16 MiB"),
        (lambda d: b"\x41" + d[1:4] + b"\2\0\0\0" if d[0] == 0x40 else b"\x01" + bytes(7), "2 bytes were announced, 7"),
        (lambda d: b"\x41" + d[1:4] + b"\2\0\0\0" if d[0] == 0x40 else b"\x11" + bytes(7), "came twice or is missing"),
    ],
)
def test_what_is_not_the_protocol_is_named(reply: Callable[[bytes], bytes], words: str) -> None:
    with pytest.raises(DeviceError, match=words):
        _read(SdoClient(CanopenBus(Hostile(reply), "test"), NODE))


@pytest.mark.parametrize("size", [0, 128, 255])
def test_block_sizes_that_cannot_be_are_refused(size: int) -> None:
    client = SdoClient(CanopenBus(Hostile(lambda d: b"\xa4" + d[1:4] + bytes([size, 0, 0, 0])), "test"), NODE)
    with pytest.raises(DeviceError, match=f"blocks of {size} segments"):
        _write_block(client)


def test_a_wrong_crc_of_a_block_is_an_error() -> None:
    class Damaged(BlockServer):
        def __call__(self, data: bytes) -> Iterator[bytes]:
            for reply in super().__call__(data):
                yield reply if reply[0] & 0xE3 != 0xC1 else reply[:1] + b"\x12\x34" + reply[3:]

    with pytest.raises(DeviceError, match="CRC of the value is wrong"):
        _read_block(Bed(Damaged(VALUE)).client())


def test_another_client_in_the_middle_of_a_transfer_is_named() -> None:
    class Busy(Bed):
        def receive(self, timeout: float) -> can.Message | None:
            if len(self.sent) == 3:
                return can.Message(arbitration_id=0x600 + NODE, is_extended_id=False, data=bytes(8))
            return super().receive(timeout)

    with pytest.raises(DeviceError, match="Another client began to use the SDO server of node 5"):
        _read(Busy(_foreign()).client())
