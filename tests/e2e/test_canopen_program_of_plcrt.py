"""The manager of a CANopen network replaces the program of plcrt by 1F50h to 1F57h: python canopen and plctool."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))
sys.path.append(str(Path(__file__).parent))

from canopen_device_programs import NODE, write_device
from done import run_here
from test_canopen_device_of_plcrt import TIMEOUT_S, Manager

from plctool import connect
from plctool.cli.commands.canopen.eds import write_eds
from plctool.compiler import compile_sources
from plctool.image.file import describe_image
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

LOCAL_CONTROL, STORE, LENGTH = 0x08000021, 0x08000020, 0x06070010


def built(folder: Path, batch: str) -> Path:
    """A program that can be replaced; `batch`: what it says of itself."""
    source = write_device(folder, device=f"node = {NODE}\ndownload = true")
    source.write_text(source.read_text().replace("'none'", f"'{batch}'"))
    compile_sources([source]).write(folder / "app.cdl")
    return folder / "app.cdl"


def crc_of(image: Path) -> int:
    return int(describe_image(image.read_bytes())["crc"], 16)


@pytest.fixture
def hub() -> Iterator[CanHub]:
    with CanHub(3) as hub:
        yield hub


def test_manager_replaces_the_program(hub: CanHub, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = built(tmp_path / "first", "first"), built(tmp_path / "second", "second")
    write_eds(first, None)
    with (
        Plcrt(tmp_path / "flash", "--can", f"slcan:{hub.paths[0]}", "--node", "5") as plcrt,
        connect(f"serial:{plcrt.port}") as plc,
    ):
        plc.flash(first)
        manager = Manager(hub.paths[1], first.with_suffix(".eds"))
        manager.node.nmt.wait_for_heartbeat(TIMEOUT_S)
        sdo = manager.node.sdo

        def write(image: bytes, block: bool = True) -> None:
            with sdo.open(0x1F50, 1, "wb", size=len(image), block_transfer=block) as writer:
                writer.write(image)

        def identification() -> int:
            return int.from_bytes(sdo.upload(0x1F56, 1), "little")

        def replies_have_come() -> None:
            """Those to plctool, which this manager gets, too, are before the next heartbeat."""
            manager.node.nmt.wait_for_heartbeat(TIMEOUT_S)

        assert identification() == crc_of(first)
        assert manager.abort_of(0x1F50, 1) == 0x06010001
        write(second.read_bytes())
        assert sdo.upload(0x2101, 0) == b"first", "it runs until the other one is started"
        sdo.download(0x1F51, 1, b"\1")
        assert (identification(), sdo.upload(0x2101, 0)) == (crc_of(second), b"second")
        assert sdo.upload(0x1F51, 1) == b"\1"
        damaged = bytearray(first.read_bytes())
        damaged[-1] ^= 1
        write(bytes(damaged), block=False)
        assert manager.abort_of(0x1F51, 1, b"\1") == STORE
        assert sdo.upload(0x5FFF, 1).startswith(b"The image is damaged: CRC")
        assert sdo.upload(0x1F57, 1) == (3 << 1).to_bytes(4, "little")
        assert (identification(), sdo.upload(0x2101, 0)) == (crc_of(second), b"second")

        bus = ("--can", f"slcan:{hub.paths[2]}", "--timeout", str(TIMEOUT_S))
        done = run_here(capsys, "canopen", "download", str(NODE), str(first), *bus)
        assert done.status == 0, done.err
        assert f"CRC {crc_of(first):08X}, started" in done.out
        replies_have_come()
        eventually(lambda: sdo.upload(0x2101, 0) == b"first")
        stopped = run_here(capsys, "canopen", "download", str(NODE), str(second), "--stop", *bus)
        replies_have_come()
        assert (stopped.status, sdo.upload(0x2101, 0)) == (0, b"second")

        plc.set_password("correct horse")
        refused = run_here(capsys, "canopen", "download", str(NODE), str(first), *bus)
        assert refused.status == 1
        assert "refuses the program: it has a password" in refused.err
        replies_have_come()
        assert manager.abort_of(0x1F51, 1, b"\0") == LOCAL_CONTROL
        assert sdo.upload(0x2101, 0) == b"second"
        manager.network.disconnect()
