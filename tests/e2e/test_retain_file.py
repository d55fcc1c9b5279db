"""Retain.bin: retain variables leave a device and come back, on the same one and another."""

from __future__ import annotations

from pathlib import Path

from plctool import connect
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


def test_values_are_got_and_put_back_on_another_device(plcrt: Plcrt, tool, counter: Path, tmp_path: Path) -> None:
    tool.ok("flash", "--port", plcrt.port, str(counter))
    with connect(f"serial:{plcrt.port}") as plc:
        eventually(lambda: plc.read("Main.total") > 20)
    tool.ok("stop", "--port", plcrt.port)
    saved = tool.ok("read", "--port", plcrt.port, "Main.total")
    tool.ok("files", "get", "Retain.bin", "--port", plcrt.port)
    with Plcrt(tmp_path / "other.flash") as other:
        refused = tool("files", "put", "Retain.bin", "--port", other.port)
        assert refused.status == 1 and "the device has no program with retain variables" in refused.err
        tool.ok("flash", "--port", other.port, str(counter))
        refused = tool("files", "put", "Retain.bin", "--port", other.port)
        assert refused.status == 1 and "the program runs; stop it with 'plctool stop'" in refused.err
        tool.ok("stop", "--port", other.port)
        tool.ok("files", "put", "Retain.bin", "--port", other.port)
        restored = tool.ok("read", "--port", other.port, "Main.total")
        assert restored["values"] == saved["values"]
        tool.ok("start", "--port", other.port)


def test_a_file_of_another_program_and_a_damaged_one_are_refused_in_words(plcrt: Plcrt, tool, counter: Path) -> None:
    link = ("--port", plcrt.port)
    tool.ok("flash", *link, str(counter))
    tool.ok("stop", *link)
    tool.ok("files", "get", "Retain.bin", *link)
    path = tool.folder / "Retain.bin"
    (tool.folder / "cut.bin").write_bytes(path.read_bytes()[:-1])
    refused = tool("files", "put", "cut.bin", "--name", "Retain.bin", *link)
    assert refused.status == 1 and "it is damaged, or not a file of retain variables" in refused.err
    other = tool.build("other", "PROGRAM Main VAR RETAIN total : DINT; END_VAR total := total + 2; END_PROGRAM")
    tool.ok("flash", *link, str(other))
    tool.ok("stop", *link)
    refused = tool("files", "put", "Retain.bin", *link)
    assert refused.status == 1 and "another program saved it; flash that one" in refused.err
    assert "Retain.bin  (made by the device)" in tool("files", "list", *link).out
