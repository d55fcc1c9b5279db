"""Several plctool processes on one line, through the gateway that the first of them starts."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from processes import is_alive

import plctool
from plctool.errors import LinkError
from plctool.gateway import client
from plctool.gateway.control import gateways, stop_gateways
from plctool.gateway.place import Place, find_holder, find_place, runtime_folder
from plctool.testing.line import Damage, SerialLine

PATIENCE = 60.0
NOTHING_ARRIVES = Damage(lose=1.0)

Eventually = Callable[[Callable[[], Any]], Any]


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A runtime folder of the test's own, and gateways that live until the end of the test."""
    folder = tempfile.mkdtemp(prefix="gw")
    monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
    monkeypatch.setenv("PLCTOOL_GATEWAY_IDLE", "600")
    monkeypatch.setattr("plctool.gateway.control._ANSWER_PATIENCE", PATIENCE)  # one that is late is not stuck
    yield
    for pid in _gateways_of(folder):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    shutil.rmtree(folder, ignore_errors=True)


def _gateways_of(folder: str) -> Iterator[int]:
    """Processes of gateways with this runtime folder, also those that are being started and serve nothing yet."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended, or is another user's
            words = (process / "cmdline").read_bytes().split(b"\0")
            variables = (process / "environ").read_bytes().split(b"\0")
            if b"plctool.gateway" in words and f"XDG_RUNTIME_DIR={folder}".encode() in variables:
                yield int(process.name)


class Running:
    """A plctool command that runs beside the test."""

    def __init__(self, tool: Any, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "plctool", *words],
            cwd=tool.folder,
            env=os.environ | {"XDG_CACHE_HOME": str(tool.folder / "cache")},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def line(self) -> str:
        assert self.process.stdout
        return self.process.stdout.readline()

    def end(self, how: signal.Signals | None = None) -> tuple[int, str, str]:
        """Exit status, output, errors; after a signal or when it ends by itself."""
        if how is not None:
            self.process.send_signal(how)
        out, err = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, out, err


@pytest.fixture
def start(tool: Any) -> Iterator[Callable[..., Running]]:
    """Starts a command; what still runs at the end of the test is killed."""
    running: list[Running] = []

    def start(*words: str) -> Running:
        running.append(Running(tool, *words))
        return running[-1]

    yield start
    for command in running:
        if command.process.poll() is None:
            command.end(signal.SIGKILL)


@pytest.fixture
def slow(plcrt: Any) -> Iterator[SerialLine]:
    """A line of 115200 baud to plcrt, which can be made to lose everything."""
    with SerialLine(plcrt.port, 115200) as line:
        yield line


@pytest.fixture
def program(tool: Any, plcrt: Any, counter: Path) -> Path:
    """The image of a program that counts, which runs."""
    tool.ok("flash", "--port", plcrt.port, str(counter))
    return counter


@pytest.fixture
def large(tool: Any) -> Path:
    """An image that takes seconds on a slow line."""
    lines = "\n".join(f"a[{i % 50}] := a[{i * 7 % 50}] * {i * 7919 + 13} + a[{i * 3 % 50}];" for i in range(1500))
    return tool.build("large", f"PROGRAM Main VAR a : ARRAY[0..49] OF DINT; END_VAR\n{lines}\nEND_PROGRAM")


def only_gateway() -> dict[str, Any]:
    (found,) = gateways()
    return found


# ---- side by side ----------------------------------------------------------------------------------------------------


def test_fifty_writes_beside_a_watch(tool, plcrt, program, start):
    watch = start("watch", "--port", plcrt.port, "Main.step", "--interval", "0.01")
    assert "Main.step = 1" in watch.line()
    for step in range(2, 51):
        with plctool.connect(f"serial:{plcrt.port}") as plc:
            plc.write({"Main.step": step})
            assert plc.read("Main.step") == step
    tool.ok("write", "--port", plcrt.port, "Main.step=51")
    while "Main.step = 51\n" not in watch.line():
        assert watch.process.poll() is None
    status, _, err = watch.end(signal.SIGINT)
    assert (status, err) == (130, "")


def test_a_port_whose_link_has_just_come_back_is_shared_under_its_own_name(tool, plcrt, program, monkeypatch):
    too_early = iter([Place(runtime_folder(), plcrt.port)])  # as if there had been no link a moment ago
    monkeypatch.setattr(client, "find_place", lambda port: next(too_early, None) or find_place(port))
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        assert plc.status().state == "run"
        assert [gateway["line"] for gateway in gateways()] == [os.path.realpath(plcrt.port)]


def test_a_tool_that_goes_on_finds_the_controller_where_the_link_leads_now(plcrt):
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.status()
        before = os.path.realpath(plcrt.port)
        plcrt.stop(signal.SIGKILL)
        with pytest.raises(LinkError):
            plc.status()
        plcrt.start()
        assert os.path.realpath(plcrt.port) != before
        plc.status()


def test_eight_tools_at_once(tool, plcrt, program):
    def work(number: int) -> int:
        return tool.ok("read", "--port", plcrt.port, "Main.kept")["values"]["Main.kept"]

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(work, range(8))) == [7] * 8


def test_flash_says_who_is_watching(tool, plcrt, program, start):
    watch = start("watch", "--port", plcrt.port, "Main.step")
    watch.line()
    pid = watch.process.pid
    flashed = tool("flash", "--port", plcrt.port, str(program), "--force")
    assert f"1 other tool uses this line: plctool watch Main.step (pid {pid})" in flashed.out
    others = tool.ok("flash", "--port", plcrt.port, str(program))["others"]
    assert others == [{"tool": "plctool watch Main.step", "pid": pid}]


OTHER = "PROGRAM Main VAR step : INT; END_VAR step := 3; END_PROGRAM"


def test_watch_ends_with_a_sentence_when_another_program_was_flashed(tool, plcrt, program, start):
    """One whose symbols this machine has not."""
    watch = start("watch", "--port", plcrt.port, "Main.step", "--interval", "0.05")
    watch.line()
    other = tool.build("other", OTHER)
    other.with_suffix(".sym").unlink()
    shutil.rmtree(tool.folder / "cache")
    tool.ok("flash", "--port", plcrt.port, str(other))
    status, _, err = watch.end()
    assert status == 1 and "Another application was loaded" in err


def test_watch_goes_on_with_another_program_whose_symbols_are_found(tool, plcrt, program, start):
    watch = start("watch", "--port", plcrt.port, "Main.step", "--interval", "0.05")
    watch.line()
    tool.ok("flash", "--port", plcrt.port, str(tool.build("other", OTHER)))
    while "Main.step = 3\n" not in watch.line():
        assert watch.process.poll() is None


def test_two_programs_of_python_share_a_line(plcrt, program, tmp_path):
    code = """
import sys, plctool
with plctool.connect("serial:" + sys.argv[1]) as plc:
    plc.write({"Main.step": 77})
    print([other.tool for other in plc.others()])
"""
    with plctool.connect(f"serial:{plcrt.port}", tool="the test") as plc:
        done = subprocess.run([sys.executable, "-c", code, plcrt.port], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "['the test']"
        assert plc.read("Main.step") == 77


# ---- downloads -------------------------------------------------------------------------------------------------------


def test_the_second_of_two_flashes_learns_of_the_first(tool, plcrt, counter, large, start, slow, eventually):
    first = start("flash", "--port", slow.path, str(large))
    eventually(lambda: slow.to_device.carried > 2000)
    slow.to_device.damage = NOTHING_ARRIVES  # the first one lasts until we have seen the second
    second = tool("flash", "--port", slow.path, str(counter))
    slow.to_device.damage = Damage()
    assert second.status == 3
    pid = first.process.pid
    assert f"plctool flash large.cdl (pid {pid}) is downloading large.cdl; try again when it is done." in second.err
    assert first.end()[0] == 0


def test_a_flash_that_is_killed_leaves_the_old_program_to_the_next_tool(
    tool, plcrt, program, large, start, slow, eventually
):
    stop_gateways()
    crc = tool.ok("status", "--port", slow.path)["image_crc"]
    flash = start("flash", "--port", slow.path, str(large))
    eventually(lambda: slow.to_device.carried > 5000)
    slow.to_device.damage = NOTHING_ARRIVES
    assert only_gateway()["claim"]
    flash.end(signal.SIGKILL)
    slow.to_device.damage = Damage()
    eventually(lambda: only_gateway()["claim"] is None)
    status = tool.ok("status", "--port", slow.path)
    assert (status["state"], status["image_crc"]) == ("run", crc)


def test_a_flash_goes_on_when_its_gateway_is_killed(tool, plcrt, large, start, slow, eventually):
    flash = start("flash", "--port", slow.path, str(large), "--json")
    eventually(lambda: slow.to_device.carried > 5000)
    os.kill(only_gateway()["pid"], signal.SIGKILL)
    status, out, err = flash.end()
    assert (status, err) == (0, "") and json.loads(out)["bytes"] == large.stat().st_size
    assert tool.ok("status", "--port", slow.path)["state"] == "run"


# ---- a gateway that is killed ----------------------------------------------------------------------------------------


def test_a_read_is_repeated_when_the_gateway_is_killed_in_the_middle_of_it(plcrt, program, slow, eventually):
    stop_gateways()
    with plctool.connect(f"serial:{slow.path}") as plc:
        assert plc.read("Main.kept") == 7
        slow.to_device.damage = NOTHING_ARRIVES
        with ThreadPoolExecutor(1) as pool:
            reading = pool.submit(plc.read, "Main.kept")
            eventually(lambda: only_gateway()["requests"])
            os.kill(only_gateway()["pid"], signal.SIGKILL)
            slow.to_device.damage = Damage()
            assert reading.result(PATIENCE) == 7


def test_a_write_says_so_when_the_gateway_is_killed_in_the_middle_of_it(plcrt, program, slow, eventually):
    stop_gateways()
    with plctool.connect(f"serial:{slow.path}") as plc:
        plc.write({"Main.step": 2})
        slow.to_device.damage = NOTHING_ARRIVES
        with ThreadPoolExecutor(1) as pool:
            writing = pool.submit(plc.write, {"Main.step": 3})
            eventually(lambda: only_gateway()["requests"])
            os.kill(only_gateway()["pid"], signal.SIGKILL)
            with pytest.raises(LinkError, match="which may have been carried out; look, and try again"):
                writing.result(PATIENCE)
        eventually(lambda: slow.is_quiet)  # the rest of the write is lost too
        slow.to_device.damage = Damage()
        assert plc.read("Main.step") == 2


def test_a_write_after_the_gateway_was_killed_is_done(plcrt, program, eventually):
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.read("Main.step")
        os.kill(only_gateway()["pid"], signal.SIGKILL)
        eventually(lambda: find_holder(find_place(plcrt.port).lock) is None)  # all its threads have ended
        plc.write({"Main.step": 9})
        assert plc.read("Main.step") == 9


# ---- start and end ---------------------------------------------------------------------------------------------------


def test_ten_tools_that_start_at_once_start_one_gateway(tool, plcrt):
    ready = threading.Barrier(10)

    def work(number: int) -> int:
        ready.wait(PATIENCE)
        assert tool.ok("status", "--port", plcrt.port)["state"] == "none"
        return only_gateway()["pid"]

    with ThreadPoolExecutor(10) as pool:
        assert len(set(pool.map(work, range(10)))) == 1


def test_it_survives_the_tool_that_started_it(tool, plcrt, program, start):
    stop_gateways()
    first = start("watch", "--port", plcrt.port, "Main.step")
    first.line()
    second = start("watch", "--port", plcrt.port, "Main.step", "--interval", "0.01")
    second.line()
    first.end(signal.SIGKILL)
    for _ in range(5):
        assert "Main.step = 1" in second.line()


def line_of(plcrt) -> str:
    """The terminal itself, which its link leads to."""
    return os.path.realpath(plcrt.port)


def test_a_link_to_a_port_meets_the_same_gateway(tool, plcrt, tmp_path):
    link = tmp_path / "my-plc"
    link.symlink_to(plcrt.port)
    tool.ok("status", "--port", plcrt.port)
    tool.ok("status", "--port", str(link))
    assert only_gateway()["line"] == line_of(plcrt)


def test_it_ends_when_it_is_idle_and_lets_go_of_the_port(tool, plcrt, monkeypatch, eventually):
    monkeypatch.setenv("PLCTOOL_GATEWAY_IDLE", "0.05")
    tool.ok("status", "--port", plcrt.port)
    place = find_place(plcrt.port)
    eventually(lambda: find_holder(place.lock) is None)
    assert not place.socket.exists()


def test_it_ends_with_its_line(tool, plcrt, eventually):
    tool.ok("status", "--port", plcrt.port)
    pid = only_gateway()["pid"]
    plcrt.stop(signal.SIGKILL)
    eventually(lambda: not is_alive(pid))
    assert gateways() == []


def test_a_termination_signal_ends_it_in_order(tool, plcrt, program, start, eventually):
    watch = start("watch", "--port", plcrt.port, "Main.step", "--interval", "0.01")
    watch.line()
    pid, place = only_gateway()["pid"], find_place(plcrt.port)
    os.kill(pid, signal.SIGTERM)
    status, _, err = watch.end()
    assert status == 3 and "was ended (SIGTERM)" in err
    eventually(lambda: not is_alive(pid))
    assert not place.socket.exists()


def test_a_gateway_that_does_not_answer_can_be_stopped(tool, plcrt, eventually):
    tool.ok("status", "--port", plcrt.port)
    pid = only_gateway()["pid"]
    os.kill(pid, signal.SIGSTOP)
    line = line_of(plcrt)
    assert tool.ok("gateway", "status")["gateways"] == [{"line": line, "pid": pid, "stuck": True, "tools": []}]
    assert tool.ok("gateway", "stop", "--port", plcrt.port)["stopped"] == [{"line": line, "pid": pid}]
    assert tool.ok("status", "--port", plcrt.port)["state"] == "none"


def test_gateway_status_and_stop(tool, plcrt, program, start):
    watch = start("watch", "--port", plcrt.port, "Main.step")
    watch.line()
    (found,) = tool.ok("gateway", "status")["gateways"]
    assert (found["line"], found["baud"], found["stuck"], found["claim"]) == (line_of(plcrt), 115200, False, None)
    assert found["tools"] == [{"tool": "plctool watch Main.step", "pid": watch.process.pid}]
    assert f"plctool watch Main.step (pid {watch.process.pid})" in tool("gateway", "status").out
    assert tool.ok("gateway", "stop")["stopped"] == [{"line": line_of(plcrt), "pid": found["pid"]}]
    assert "No gateway runs." in tool("gateway", "status").out
    status, _, err = watch.end()
    assert status == 3 and "was ended by plctool gateway" in err


# ---- without ---------------------------------------------------------------------------------------------------------


def test_another_baud_rate_is_an_error_in_words(tool, plcrt, program, start):
    watch = start("watch", "--port", plcrt.port, "Main.step")
    watch.line()
    done = tool("read", "--port", plcrt.port, "--baud", "9600", "Main.step")
    assert done.status == 3 and "with 115200 baud by plctool watch Main.step (pid" in done.err


def test_no_gateway_locks_the_port_as_long_as_it_is_used(tool, plcrt, program, start):
    watch = start("watch", "--port", plcrt.port, "--no-gateway", "Main.step")
    watch.line()
    assert gateways() == []
    done = tool("read", "--port", plcrt.port, "Main.step")
    assert done.status == 3 and "another program uses it" in done.err


def test_no_gateway_takes_the_line_from_an_idle_one(tool, plcrt, program):
    assert only_gateway()["tools"] == []
    assert tool.ok("read", "--port", plcrt.port, "--no-gateway", "Main.kept")["values"] == {"Main.kept": 7}
    assert gateways() == []


@pytest.mark.parametrize("what", ["python", "folder"])
def test_where_there_can_be_no_gateway_the_line_is_used_directly(plcrt, program, monkeypatch, what):
    stop_gateways()
    if what == "python":
        monkeypatch.setattr(sys, "executable", "/does/not/exist")
    else:
        monkeypatch.setattr("plctool.gateway.place._bases", lambda: iter([(Path("/proc/self"), "plctool")]))
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        assert plc.read("Main.kept") == 7
        assert plc.others() == []
    assert gateways() == []
