"""Packed downloads: what the simulated device has afterwards is what was packed, and it takes less of the line."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples
from test_runtime import SimSerial, damage, power_on

from plctool.compiler import compile_sources
from plctool.core import ffi, lib
from plctool.errors import DeviceError
from plctool.image.file import Image, ImageTask, build_image
from plctool.link import bintag, services
from plctool.link.connection import Connection
from plctool.link.packing import Packer
from plctool.link.session import Session

PIECE = st.one_of(
    st.binary(min_size=1, max_size=60),
    st.tuples(st.binary(min_size=1, max_size=5), st.integers(1, 300)).map(lambda p: p[0] * p[1]),
)
CODE = st.lists(PIECE, min_size=1, max_size=30).map(b"".join)


def image_of(code: bytes) -> bytes:
    """An image that can be loaded, and is never started."""
    return build_image(
        Image(
            device_id=int(lib.TARGET_ID_X86_64_LINUX),
            code=code,
            areas={},
            functions={},
            externals=[],
            tasks=[ImageTask("Main", 0, 1, 10_000, 0)],
        )
    )


def code_of_the_device(size: int) -> bytes:
    return bytes(ffi.buffer(lib.AppGetAreaAddress(lib.APP_AREA_CODE, 0, size), size))


@pytest.fixture(autouse=True)
def runtime() -> Iterator[None]:
    power_on()
    yield


@examples(60)
@given(code=CODE)
def test_what_was_packed_arrives(code: bytes) -> None:
    power_on()
    services.download(Session(Connection(SimSerial())), image_of(code))
    assert code_of_the_device(len(code)) == code


@pytest.mark.parametrize("seed", range(3))
def test_what_was_packed_arrives_over_a_bad_line(seed: int) -> None:
    rng = random.Random(seed)
    code = bytes(rng.choice(b"abcdefgh") for _ in range(30_000))
    line = SimSerial(damage(seed, 0.001), damage(seed + 1, 0.001))
    services.download(Session(Connection(line)), image_of(code))
    assert code_of_the_device(len(code)) == code


def test_a_packed_transfer_goes_on_in_the_middle() -> None:
    rng = random.Random(1)
    code = bytes(rng.choice(b"abcdefgh") for _ in range(90_000))
    session, seen = Session(Connection(SimSerial())), []

    class Stopped(Exception):
        pass

    def stop(done: int) -> None:
        seen.append(done)
        if done > 20_000:
            raise Stopped

    with pytest.raises(Stopped):
        services.download(session, image_of(code), progress=stop)
    rest: list[int] = []
    services.download(Session(Connection(SimSerial())), image_of(code), progress=rest.append)
    assert 0 < seen[-1] == rest[0] < 90_000
    assert code_of_the_device(len(code)) == code


def seconds(image: bytes, packed: bool) -> float:
    """How long a download takes on the line."""
    power_on()
    line = SimSerial()
    line.is_slow = packed
    session = Session(Connection(line))
    session.ensure()
    begin = line.now()
    services.download(session, image)
    return line.now() - begin


def test_a_program_arrives_a_third_faster(tmp_path) -> None:
    body = "\n".join(f"a[{i % 50}] := a[{(i * 7) % 50}] * {i * 7919 + 13} + a[{(i * 3) % 50}];" for i in range(1000))
    source = tmp_path / "large.st"
    source.write_text(f"PROGRAM Main VAR a : ARRAY[0..49] OF DINT; END_VAR\n{body}\nEND_PROGRAM")
    image = compile_sources([source], target="x86_64-linux").image
    assert seconds(image, packed=False) / seconds(image, packed=True) > 1.3


def test_what_cannot_be_packed_costs_next_to_nothing() -> None:
    image = image_of(random.Random(1).randbytes(20_000))
    assert seconds(image, packed=True) < 1.01 * seconds(image, packed=False)


@pytest.mark.parametrize("data", [b"", b"\xff" * 50, bytes(50), random.Random(2).randbytes(200)])
def test_wrong_packed_data_are_refused(data: bytes) -> None:
    session = Session(Connection(SimSerial()))
    session.ensure()
    position = services._POSITION.pack(flags=0, offset=0, total_size=1000, crc=1)
    packed = (500).to_bytes(4, "little") + data
    tags = [bintag.raw(lib.TAG_CDL_POSITION, position), bintag.raw(lib.TAG_CDL_PACKED, packed)]
    try:
        reply = session.call(lib.SG_APPLICATION, lib.SRV_APP_DOWNLOAD_COMPACT, tags)
    except DeviceError as error:
        assert error.result == lib.ERR_SIZE_MISMATCH
    else:
        assert reply.u16(lib.TAG_SERVICE_RESULT) in (lib.ERR_NO_CONSISTENCY, lib.ERR_OUT_OF_LIMITS)


@given(
    image=CODE,
    start=st.integers(0, 8000),
    room=st.integers(33, 400),
    first=st.integers(33, 500) | st.just(0),
    longest=st.integers(2, 9000),
)
def test_blocks_keep_to_their_limits(image: bytes, start: int, room: int, first: int, longest: int) -> None:
    start %= len(image)
    blocks = list(Packer(image).blocks(start, room, longest, first))
    assert sum(block.size for block in blocks) == len(image) - start
    assert all(len(block.data) <= room and 0 < block.size <= longest for block in blocks)
    assert len(blocks[0].data) <= (first or room)


def test_the_first_block_does_not_wait_for_a_search_of_the_whole_image() -> None:
    image = random.Random(3).randbytes(100_000)
    packer = Packer(image)
    next(packer.blocks(0, 4000, 65536, 900))
    assert len(packer._same.previous) <= 2 * 900
