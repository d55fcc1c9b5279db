"""The manager of a CANopen network replaces, starts and stops the program in the simulator (1F50h to 1F57h)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from canopen.sdo import SdoAbortedError, SdoClient

sys.path.append(str(Path(__file__).parents[1]))
sys.path.append(str(Path(__file__).parent))

from canopen_device_programs import NODE, write_device
from test_canopen_device import HEARTBEAT, SimNetwork, client_of, frames

from plctool.compiler import compile_sources
from plctool.sim import Simulator

STOPPED, STARTED = b"\0", b"\1"


@pytest.fixture
def image(tmp_path: Path) -> bytes:
    """Another program than the one that runs."""
    source = write_device(tmp_path / "second", device=f"node = {NODE}\ndownload = true")
    source.write_text(source.read_text().replace("'none'", "'second'"))
    return compile_sources([source]).image


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    folder = tmp_path / "first"
    compile_sources([write_device(folder, device=f"node = {NODE}\ndownload = true")]).write(folder / "app.cdl")
    with Simulator.from_file(folder / "app.cdl") as plc:
        plc.run_for(20)
        yield plc


def write(sdo: SdoClient, image: bytes, *, block: bool = True, size: int | None = None) -> None:
    with sdo.open(0x1F50, 1, "wb", size=len(image) if size is None else size, block_transfer=block) as writer:
        writer.write(image)


def abort_of(sdo: SdoClient, index: int, sub: int, data: bytes) -> int:
    with pytest.raises(SdoAbortedError) as refused:
        sdo.download(index, sub, data)
    return int(refused.value.code)


@pytest.mark.parametrize("block", [True, False])
def test_started_when_it_is_whole(plc: Simulator, image: bytes, block: bool) -> None:
    network = SimNetwork(plc)
    sdo = client_of(network)
    plc.can_receive()
    write(sdo, image, block=block)
    assert sdo.upload(0x2101, 0) == b"none"
    sdo.download(0x1F51, 1, STARTED)
    assert sdo.upload(0x2101, 0) == b"second"
    plc.run_for(500)
    assert frames(plc, HEARTBEAT)[-1] == b"\x7f", "it has booted, and waits for the manager"


def test_commands_stop_start_and_reset_the_program(plc: Simulator) -> None:
    sdo = client_of(SimNetwork(plc))
    for command, state in ((0, STOPPED), (1, STARTED), (2, STOPPED), (1, STARTED), (3, STARTED)):
        sdo.download(0x1F51, 1, bytes([command]))
        assert sdo.upload(0x1F51, 1) == state, command
    assert abort_of(sdo, 0x1F51, 1, b"\4") == 0x06090030
    assert abort_of(sdo, 0x1F51, 1, b"\1\0") == 0x06070012
    assert abort_of(sdo, 0x1F56, 1, b"\0\0\0\0") == 0x06010002
    assert abort_of(sdo, 0x1F50, 1, b"\0\0\0\0") == 0x06070012, "no image has 4 bytes"


def test_image_that_cannot_be_is_refused_while_it_comes(plc: Simulator, image: bytes) -> None:
    sdo = client_of(SimNetwork(plc))
    for wrong, code, error in (
        (b"x" * 300, 0x08000020, 2),  # not an image
        (image[:100], 0x06070010, 3),  # not even its head
        (image[:-1], 0x06070010, 3),  # not all of it
        (image + b"\0", 0x06070010, 3),  # more
        (image[:12] + b"\xff\xff\xff\x7f" + image[16:], 0x06070010, 3),  # its size is not that of the transfer
    ):
        with pytest.raises(SdoAbortedError) as refused:
            write(sdo, wrong)
        first: BaseException = refused.value
        while isinstance(first.__context__, SdoAbortedError):  # python canopen goes on with the transfer
            first = first.__context__
        assert isinstance(first, SdoAbortedError)
        assert first.code == code, (wrong[:20], len(wrong))
        assert sdo.upload(0x1F57, 1)[0] >> 1 == error
    sdo.download(0x1F51, 1, STARTED)
    assert sdo.upload(0x2101, 0) == b"none"
    write(sdo, image)
    assert sdo.upload(0x1F57, 1) == bytes(4)


def test_lost_or_doubled_frames_leave_the_old_or_the_new_program(plc: Simulator, image: bytes) -> None:
    """One frame of 11 in turn, so that all kinds of frames are among them."""
    sdo = client_of(SimNetwork(plc))
    counting = SimNetwork(plc)
    write(client_of(counting), image)
    before = sdo.upload(0x1F56, 1)
    for wrong in ("lose", "double"):
        for number in (1, 2, 3, 4, *range(5, counting.count, 47), counting.count - 2, counting.count - 1):
            network = SimNetwork(plc)
            setattr(network, wrong, {number})
            whole = True
            try:
                write(client_of(network), image)
            except Exception:  # of any kind: the client's way to give up
                whole = False
            plc.run_for(4000)
            plc.can_receive()
            if not whole:
                sdo.download(0x1F51, 1, STARTED)
                assert sdo.upload(0x1F56, 1) in (before, image_crc(image)), (wrong, number)
    write(sdo, image)
    sdo.download(0x1F51, 1, STARTED)
    assert sdo.upload(0x2101, 0) == b"second"


def image_crc(image: bytes) -> bytes:
    return image[100:104]
