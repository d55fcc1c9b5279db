"""A plcrt whose flash was burned in production runs the program at once, also when its flash was used before."""

from __future__ import annotations

import signal

from intelhex import IntelHex

OTHER = "PROGRAM Main VAR RETAIN n : DINT; END_VAR n := n + 1; END_PROGRAM"


def status_and_log(tool, plcrt):
    status = tool.ok("status", "--port", plcrt.port)
    texts = [entry["text"] for entry in tool.ok("log", "--port", plcrt.port)["entries"]]
    return (status["state"], status["image_crc"]), texts


def test_a_burned_flash_runs_its_program_at_once(tool, plcrt, counter):
    plcrt.stop()
    plcrt.flash.unlink()
    document = tool.ok("image", str(counter), "--board", "plcrt", "-o", "flash.bin")
    plcrt.flash.write_bytes((tool.folder / "flash.bin").read_bytes())
    plcrt.start()
    (state, crc), texts = status_and_log(tool, plcrt)
    assert (state, crc) == ("run", document["crc"])
    assert not any("commit" in text.lower() or "laid out" in text for text in texts)
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert status_and_log(tool, plcrt)[0] == ("run", document["crc"])


def test_programs_can_be_downloaded_afterwards(tool, plcrt, counter):
    other = tool.build("other", OTHER)
    plcrt.stop()
    tool.ok("image", str(counter), "--board", "plcrt", "-o", "flash.bin")
    plcrt.flash.write_bytes((tool.folder / "flash.bin").read_bytes())
    plcrt.start()
    tool.ok("flash", "--port", plcrt.port, str(other))
    plcrt.stop()
    plcrt.start()
    assert status_and_log(tool, plcrt)[0] == ("run", tool.ok("info", str(other))["crc"])


def test_hex_over_a_used_flash_runs_its_program(tool, plcrt, counter):
    """A programmer writes what the file has, and leaves the rest as it was."""
    other = tool.build("other", OTHER)
    for image in (other, counter, other):
        tool.ok("flash", "--port", plcrt.port, str(image))
    plcrt.stop()
    document = tool.ok("image", str(counter), "--board", "plcrt", "-o", "flash.hex")
    content = IntelHex(str(tool.folder / "flash.hex"))
    data = bytearray(plcrt.flash.read_bytes())
    for begin, end in content.segments():
        data[begin:end] = content.tobinarray(start=begin, end=end - 1)
    plcrt.flash.write_bytes(data)
    plcrt.start()
    assert status_and_log(tool, plcrt)[0] == ("run", document["crc"])
