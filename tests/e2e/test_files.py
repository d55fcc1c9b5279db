"""Files and sources on a device: the real tool and the real runtime, over a serial line, a gateway and TCP."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import threading

import pytest

import plctool
from plctool.errors import DeviceError, PlcError, UsageError
from plctool.testing.plcrt import Plcrt

BLOCKS = {
    "main.st": "PROGRAM Main VAR n : DINT; r : Ramp; END_VAR n := n + 1; r(x := n); END_PROGRAM\n",
    "lib/ramp.st": "FUNCTION_BLOCK Ramp VAR_INPUT x : DINT; END_VAR VAR y : DINT; END_VAR y := x; END_FUNCTION_BLOCK\n",
    "plc.toml": 'sources = ["main.st", "lib"]\n',
}


def names(document):
    return [file["name"] for file in document["files"]]


def test_a_file_goes_there_and_comes_back(tool, link):
    data = random.Random(1).randbytes(70_000)
    (tool.folder / "recipe.bin").write_bytes(data)
    tool.ok("files", "put", "recipe.bin", *link)
    tool.ok("files", "put", "recipe.bin", "--name", "other", *link)
    listed = tool.ok("files", "list", *link)
    assert names(listed) == ["PlcLog.txt", "recipe.bin", "other"]
    tool.ok("files", "get", "recipe.bin", "-o", "back.bin", *link)
    assert (tool.folder / "back.bin").read_bytes() == data
    tool.ok("files", "delete", "recipe.bin", *link)
    done = tool("files", "get", "recipe.bin", *link)
    assert done.status == 1 and "it has no such file; 'plctool files list'" in done.err


def test_the_program_comes_back_as_it_was_flashed(tool, link, counter):
    tool.ok("flash", *link, str(counter))
    tool.ok("files", "get", "Application.cdl", *link)
    assert (tool.folder / "Application.cdl").read_bytes() == counter.read_bytes()


@pytest.mark.parametrize("project", [True, False])
def test_the_sources_come_back_and_make_the_same_image(tool, link, project):
    for name, text in BLOCKS.items():
        (tool.folder / name).parent.mkdir(exist_ok=True)
        if project or name != "plc.toml":
            (tool.folder / name).write_text(text)
    sources = [] if project else ["main.st", "lib"]
    tool.ok("build", *sources, "-o", "app.cdl")
    flashed = tool.ok("flash", *link, "app.cdl", "--with-source", *sources)
    assert {"main.st", "ramp.st"} <= {file.rpartition("/")[2] for file in flashed["source"]["files"]}
    got = tool.ok("source", "get", "-o", "back", *link)
    built = subprocess.run(
        [sys.executable, "-m", "plctool", "build", *got["build"], "-o", "again.cdl"],
        cwd=tool.folder / "back", check=False, capture_output=True, text=True,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    assert (tool.folder / "back" / "again.cdl").read_bytes() == (tool.folder / "app.cdl").read_bytes()


def test_a_computer_without_the_symbols_gets_them_from_the_device(tool, plcrt):
    (tool.folder / "main.st").write_text("PROGRAM Main VAR n : DINT; END_VAR n := 7; END_PROGRAM\n")
    tool.ok("build", "main.st", "-o", "app.cdl")
    tool.ok("flash", "--port", plcrt.port, "app.cdl", "--with-source", "main.st")
    (tool.folder / "app.sym").unlink()
    for file in (tool.folder / "cache" / "plctool").glob("*.sym"):
        file.unlink()
    assert tool.ok("read", "--port", plcrt.port, "Main.n")["values"] == {"Main.n": 7}


def test_sources_of_another_program_are_not_put_and_not_got(tool, plcrt, counter):
    port = ["--port", plcrt.port]
    (tool.folder / "other.st").write_text("PROGRAM Main VAR x : INT; END_VAR x := 5; END_PROGRAM\n")
    done = tool("flash", *port, str(counter), "--with-source", "other.st")
    assert done.status == 2 and "do not make this image" in done.err
    assert tool.ok("status", *port)["state"] == "none"
    tool.ok("flash", *port, str(counter), "--with-source", "counter.st")
    tool.ok("build", "other.st", "-o", "other.cdl")
    tool.ok("flash", *port, "other.cdl")
    done = tool("source", "get", *port)
    assert done.status == 1 and "are of another program" in done.err
    tool.ok("source", "put", "other.st", *port)
    assert tool.ok("source", "get", *port)["files"] == ["source/other.st"]


@pytest.mark.parametrize("name", ["../up", "a//b", "..", ".x", "a b", "x" * 33, ""])
def test_a_name_that_no_file_can_have_is_wrong_use(plcrt, name):
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        for use in (plc.read_file, plc.delete_file, lambda n: plc.write_file(n, b"")):
            with pytest.raises(UsageError, match="is not the name of a file"):
                use(name)


def test_a_full_store_says_what_to_do_and_keeps_its_files(plcrt):
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.write_file("a", b"first" * 1000)
        with pytest.raises(DeviceError, match="no room for it; delete others"):
            plc.write_file("b", bytes(plc.files().room + 1))
        assert plc.read_file("a") == b"first" * 1000


def test_with_a_password_nothing_is_there_without_it(tool, link, monkeypatch):
    (tool.folder / "a").write_bytes(b"secret")
    tool.ok("files", "put", "a", *link)
    monkeypatch.setenv("PLC_NEW_PASSWORD", "correct horse")
    tool.ok("passwd", *link)
    for words in (["list"], ["get", "a"], ["put", "a"], ["delete", "a"]):
        done = tool("files", *words, *link, "--json")
        assert (done.status, done.json["error"]["code"]) == (1, "password-needed"), words
    monkeypatch.setenv("PLC_PASSWORD", "correct horse")
    tool.ok("files", "get", "a", "-o", "b", *link)
    assert (tool.folder / "b").read_bytes() == b"secret"


def test_two_clients_at_once_leave_one_of_their_files(tmp_path):
    contents = [bytes([i]) * (40_000 + i) for i in range(2)]
    with Plcrt(tmp_path / "flash", "--tcp", "0") as plcrt:
        refused = []

        def write(data):
            with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
                for _ in range(10):
                    try:
                        plc.write_file("a", data)
                    except DeviceError as error:
                        refused.append(error.message)

        threads = [threading.Thread(target=write, args=(data,)) for data in contents]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert all("another tool or the program is writing" in message for message in refused)
        with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
            assert plc.read_file("a") in contents


def test_a_tool_that_vanishes_leaves_the_previous_file(tmp_path):
    with Plcrt(tmp_path / "flash", "--tcp", "0") as plcrt:
        with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
            plc.write_file("a", b"previous")

        def vanish(done, total):
            raise PlcError("gone")

        vanished = plctool.connect(f"tcp:{plcrt.tcp}")
        with pytest.raises(PlcError, match="gone"):
            vanished.write_file("a", bytes(100_000), vanish)
        vanished.close()
        with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
            assert plc.read_file("a") == b"previous"
            plc.write_file("a", b"next")
            assert plc.read_file("a") == b"next"


def test_killed_at_any_time_it_has_the_previous_file_or_the_next(plcrt):
    now = random.Random(7)
    kept = b""
    for turn in range(12):
        data = now.randbytes(30_000)
        killer = threading.Timer(now.uniform(0, 0.05), plcrt.stop, [signal.SIGKILL])
        try:
            with plctool.connect(f"serial:{plcrt.port}", gateway=False) as plc:
                if turn == 0:
                    plc.write_file("a", kept)
                killer.start()
                plc.write_file("a", data)
                kept = data
        except PlcError:
            pass
        killer.join()
        plcrt.start()
        with plctool.connect(f"serial:{plcrt.port}", gateway=False) as plc:
            found = plc.read_file("a")
        assert found in (kept, data)
        kept = found
