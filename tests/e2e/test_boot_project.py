"""What plcrt runs after it was killed, which is a power cut for it, and after its commit log was lost."""

from __future__ import annotations

import signal
import struct
import zlib
from pathlib import Path

SECTOR = 4096
RECORD = b"RLOG"
HEAD = struct.Struct("<4sIIII")  # magic, sequence, tag, size, CRC


def commit_log(flash: Path) -> int:
    """Where the commit log is: it is the first of the logs of records."""
    data = flash.read_bytes()
    return next(at for at in range(0, len(data), SECTOR) if data.startswith(RECORD, at))


def overwrite(flash: Path, offset: int, data: bytes) -> None:
    with flash.open("r+b") as file:
        file.seek(offset)
        file.write(data)


def state(tool, plcrt) -> tuple[str, str]:
    status = tool.ok("status", "--port", plcrt.port)
    return status["state"], status["image_crc"]


def crc_of(tool, image: Path) -> str:
    return tool.ok("info", str(image))["crc"]


def test_ten_kills_soon_after_the_start_change_nothing(tool, plcrt, counter):
    newest = tool.build("newest", "PROGRAM Main VAR n : DINT; END_VAR n := n + 2; END_PROGRAM")
    tool.ok("flash", "--port", plcrt.port, str(counter))
    tool.ok("flash", "--port", plcrt.port, str(newest))
    for _ in range(10):
        plcrt.stop(signal.SIGKILL)
        plcrt.start()
        assert state(tool, plcrt) == ("run", crc_of(tool, newest))


def test_a_program_that_was_flashed_but_not_started_runs_after_a_power_cut(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, "--no-start", str(counter))
    assert state(tool, plcrt)[0] == "stop"
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert state(tool, plcrt)[0] == "run"


def test_a_lost_commit_log_costs_no_program(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    plcrt.stop()
    overwrite(plcrt.flash, commit_log(plcrt.flash), b"\xff" * 2 * SECTOR)
    plcrt.start()
    assert state(tool, plcrt) == ("run", crc_of(tool, counter))
    texts = [entry["text"] for entry in tool.ok("log", "--port", plcrt.port)["entries"]]
    assert "No commit record: newest program taken, no password known" in texts


def test_a_flash_that_another_firmware_laid_out_is_said_on_stderr(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    plcrt.stop()
    head = struct.pack("<4sIII", RECORD, 1000, 0x11223344, 8)
    record = HEAD.pack(RECORD, 1000, 0x11223344, 8, zlib.crc32(head + bytes(8))) + bytes(8)
    place = commit_log(plcrt.flash)
    overwrite(plcrt.flash, place, record.ljust(2 * SECTOR, b"\xff"))
    plcrt.start()
    assert state(tool, plcrt) == ("run", crc_of(tool, counter))
    process = plcrt.process
    process.send_signal(signal.SIGTERM)
    assert "plcrt: Flash laid out by another firmware" in process.stderr.read()


def test_a_program_that_is_tried_is_gone_after_a_power_cut_unless_it_is_made_the_boot_project(tool, plcrt, counter):
    other = tool.build("other", "PROGRAM Main VAR n : DINT; END_VAR n := n + 2; END_PROGRAM")
    third = tool.build("third", "PROGRAM Main VAR n : DINT; END_VAR n := n + 3; END_PROGRAM")
    port = ("--port", plcrt.port)
    tool.ok("flash", *port, str(counter))
    for image in (other, third):  # the second one takes the room of the first
        assert tool.ok("flash", *port, "--no-boot", str(image))["boot_project"] is False
        assert state(tool, plcrt) == ("run", crc_of(tool, image))
        assert tool.ok("status", *port)["boot_project"] is False
    assert "boot" in tool("status", *port).out
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert state(tool, plcrt) == ("run", crc_of(tool, counter))
    tool.ok("flash", *port, "--no-boot", str(other))
    assert tool.ok("boot", *port)["boot_project"] is True
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert state(tool, plcrt) == ("run", crc_of(tool, other))


def test_a_setting_says_whether_a_download_is_the_boot_project(tool, plcrt, counter, tmp_path):
    settings = tmp_path / "plc.cfg"
    settings.write_text("[CmpApp]\nCreateBootprojectOnDownload=no\n")
    tool.ok("settings", "put", "--port", plcrt.port, str(settings))
    plcrt.stop()
    plcrt.start()
    port = ("--port", plcrt.port)
    assert tool.ok("flash", *port, str(counter))["boot_project"] is False
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert state(tool, plcrt)[0] == "none"
    assert tool.ok("flash", *port, "--boot", str(counter))["boot_project"] is True
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert state(tool, plcrt)[0] == "run"
