"""plcrt as a process: its options, its signals, its files, and what it costs when nothing happens."""

from __future__ import annotations

import math
import os
import random
import resource
import select
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from elftools.elf.enums import ENUM_DT_FLAGS
from processes import is_alive, processor_ns, started

from plctool import connect
from plctool.core import lib
from plctool.link import names, router, simplecom
from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.link.services import read_identity, read_status
from plctool.link.session import Session
from plctool.link.transport import NO_PLACES, TOOL_ADDRESS
from plctool.testing.plcrt import Plcrt, find_plcrt, find_worker

PATIENCE = 60  # for what is bound to happen [s]
IDLE_SHARE = 0.05  # of one processor; 0.005 is usual, but machines under load count otherwise


def run_plcrt(*options: str, prepare: Callable[[], object] | None = None) -> subprocess.CompletedProcess[str]:
    """plcrt with options that make it end by itself; `prepare` runs in its process before it."""
    return subprocess.run(
        [find_plcrt(), *options], capture_output=True, text=True, timeout=PATIENCE, check=False, preexec_fn=prepare
    )


def ask_without_reading(port: str, questions: int) -> None:
    """Sends name requests, and leaves all replies on the line."""
    request = router.Packet(int(lib.ROUTER_SVC_NAME_REQUEST), router.BROADCAST, TOOL_ADDRESS, names.encode_request(1))
    transport = SerialTransport(port)
    for _ in range(questions):
        transport.send(router.encode(request))
    transport.close()


def device_name(port: str) -> str:
    """Opens the port as a client of its own, asks, and leaves."""
    with Connection(SerialTransport(port)) as connection:
        return read_identity(Session(connection)).device_name


@pytest.mark.parametrize(
    ("options", "advice"),
    [
        ([], "--flash FILE"),
        (["--flash"], "--help"),
        (["--flash", "f", "--nonsense"], "--nonsense"),
        (["--flash", "f", "extra"], "extra"),
        (["--flash", "f", "-xy"], "-x is not an option"),
        (["--flash", "f", "--baud", "115201"], "115200"),
        (["--flash", "f", "--baud", "fast"], "--baud fast"),
        (["--flash", "f", "--serial", "pty:"], "pty:/tmp/plc"),
        (["--flash", "f", "--can", "can0", "--node", "300"], "give 1 to 127"),
        (["--flash", "f", "--udp", "127.0.0.1:3"], "--udp 127.0.0.1:3 is not a valid"),
        (["--flash", "f", "--udp=1740"], "192.168.1.5:1741 for one of the ports 1740 to 1743"),
        (["--flash", "f", "--tcp", "host:1"], "--tcp host:1 is not a valid"),
        (["--flash", "f", "--tcp=65536"], "192.168.1.5:11740"),
        (["--flash", "f", "--mdns"], "give --tcp too"),
        (["--flash", "f", "--metrics", ""], "/run/plcrt/main.prom"),
        (["--flash", "f", "--metrics-every", "0"], "give 1 to 86400"),
        (["--flash", "f", "--metrics-every", "5x"], "--metrics-every 5x"),
    ],
)
def test_wrong_use_is_said_in_one_sentence_and_exits_2(tmp_path, monkeypatch, options, advice):
    monkeypatch.chdir(tmp_path)
    done = run_plcrt(*options)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("plcrt: ") and done.stderr.count("\n") == 1
    assert advice in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("option", "text"), [("--help", "usage: plcrt --flash FILE"), ("--version", "plcrt ")])
def test_help_and_version_exit_0(option, text):
    done = run_plcrt(option)
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.startswith(text)


@pytest.mark.parametrize("serial", ["/dev/null", "/dev", "/", "does-not-exist", "/dev/null/line"])
def test_a_serial_line_that_cannot_be_opened_exits_1_and_is_named(tmp_path, serial):
    done = run_plcrt("--flash", str(tmp_path / "flash"), "--serial", serial)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and serial in done.stderr


def test_a_serial_line_that_may_not_be_opened_exits_1(tmp_path):
    (tmp_path / "line").symlink_to("/dev/null")
    done = run_plcrt("--flash", str(tmp_path / "flash"), "--serial", str(tmp_path / "line"))
    assert done.returncode == 1 and done.stderr.count("\n") == 1


def test_it_runs_without_its_serial_adapter_and_serves_it_when_it_comes(tmp_path, eventually):
    """The link stands for a name that udev gives an adapter."""
    adapter = tmp_path / "adapter"
    adapter.symlink_to(tmp_path / "unplugged")
    options = ["--flash", str(tmp_path / "flash"), "--serial", str(adapter), "--tcp", "127.0.0.1:0"]
    with started([find_plcrt(), *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        place = process.stdout.readline().removeprefix("tcp: ").strip()
        assert process.stderr.readline() == f"plcrt: serial line {adapter} is missing: it is used when it comes\n"
        with connect(f"tcp:{place}") as plc:
            assert plc.identity().device_name == "plcrt"
            assert any(f"{adapter} is away" in entry.text for entry in plc.log())
        ours, theirs = os.openpty()
        (tmp_path / "unplugged").symlink_to(os.ttyname(theirs))
        with Connection(Wire(ours)) as connection:
            eventually(lambda: read_identity(Session(connection)).device_name == "plcrt")
        os.close(theirs)
        with connect(f"tcp:{place}") as plc:
            assert any(f"{adapter} is back" in entry.text for entry in plc.log())
        process.terminate()
        assert process.wait(PATIENCE) == 0


def test_the_flash_file_is_for_its_owner_alone(plcrt):
    assert stat.S_IMODE(plcrt.flash.stat().st_mode) == 0o600


@pytest.mark.parametrize(("mode", "said"), [(0o600, ""), (0o640, "chmod 600"), (0o604, "chmod 600")])
def test_a_flash_file_that_others_may_open_is_said(tmp_path, mode, said):
    flash = tmp_path / "flash"
    command = [find_plcrt(), "--flash", str(flash), "--tcp", "127.0.0.1:0"]
    for _ in range(2):
        flash.touch()
        flash.chmod(mode)
        with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            process.stdout.readline()
            process.terminate()
            errors = process.communicate(timeout=PATIENCE)[1]
        assert said in errors and bool(errors) == bool(said)
        assert stat.S_IMODE(flash.stat().st_mode) == mode


def test_a_flash_file_in_a_folder_that_does_not_exist_exits_1(tmp_path):
    done = run_plcrt("--flash", str(tmp_path / "no" / "flash"))
    assert done.returncode == 1 and "no/flash" in done.stderr


def test_a_file_that_is_no_flash_is_not_touched(tmp_path):
    film = tmp_path / "film"
    film.write_bytes(b"x" * (6 * 1024 * 1024))
    done = run_plcrt("--flash", str(film))
    assert done.returncode == 1 and "not a flash file" in done.stderr
    assert film.read_bytes().strip(b"x") == b"" and film.stat().st_size == 6 * 1024 * 1024


def test_a_small_file_of_another_program_is_not_touched(tmp_path):
    notes = tmp_path / "notes"
    notes.write_text("milk, bread")
    done = run_plcrt("--flash", str(notes))
    assert done.returncode == 1 and "not a flash file" in done.stderr
    assert notes.read_text() == "milk, bread"


PROGRAMS = 4 * 1024 * 1024  # bytes of the flash; files come after them
KEPT_LOG = 2 * 4096  # LOG_KEEP_SIZE


@pytest.mark.parametrize("change", [-1, -4096, 1, 4096])
def test_a_flash_file_that_was_cut_short_or_grew_is_not_touched_and_its_size_is_said(plcrt, change):
    plcrt.stop()
    flash = plcrt.flash.read_bytes()
    whole = b"\0" * 4096 + flash[4096:PROGRAMS] + b"\0" + flash[PROGRAMS + 1 :]  # a program, and a file
    content = whole[:change] if change < 0 else whole + bytes(change)
    plcrt.flash.write_bytes(content)
    done = run_plcrt("--flash", str(plcrt.flash))
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert f"{len(content)} bytes and not {len(whole)}" in done.stderr and "name another file" in done.stderr
    assert plcrt.flash.read_bytes() == content


def test_a_flash_file_from_before_there_were_files_is_made_longer(plcrt):
    plcrt.stop()
    flash = plcrt.flash.read_bytes()
    plcrt.flash.write_bytes(flash[:PROGRAMS])
    plcrt.start()
    plcrt.stop()
    again = plcrt.flash.read_bytes()
    assert len(again) == len(flash)
    assert again[:-KEPT_LOG] == flash[:-KEPT_LOG]  # which has the times of starts


@pytest.mark.skipif(not Path("/sys/kernel/uevent_seqnum").exists(), reason="no file that not even root may write")
def test_a_flash_file_that_may_not_be_written_is_said_with_what_to_do():
    done = run_plcrt("--flash", "/sys/kernel/uevent_seqnum")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "plcrt has to write it" in done.stderr


def test_a_limit_of_file_sizes_is_an_error_and_not_a_signal(tmp_path):
    limit = 100_000
    done = run_plcrt(
        "--flash", str(tmp_path / "flash"), prepare=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    assert done.returncode == 1 and "too large" in done.stderr


def test_a_closed_standard_output_is_not_replaced_by_the_flash_file(tmp_path, eventually):
    flash = tmp_path / "flash"
    command = [find_plcrt(), "--flash", str(flash), "--serial", "pty"]
    with started(command, preexec_fn=lambda: os.close(1)) as process:
        eventually(lambda: find_worker(process.pid))
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.3)
        process.terminate()
        assert process.wait(PATIENCE) == 0
    assert b"serial" not in flash.read_bytes()


def test_the_device_answers_on_the_terminal_it_names(plcrt):
    assert os.readlink(plcrt.port).startswith("/dev/pts/")
    assert device_name(plcrt.port) == "plcrt"


def test_without_a_link_it_names_the_terminal_itself(tmp_path):
    command = [find_plcrt(), "--flash", str(tmp_path / "flash"), "--serial", "pty"]
    with started(command, stdout=subprocess.PIPE, text=True) as process:
        port = process.stdout.readline().removeprefix("serial: ").strip()
        assert port.startswith("/dev/pts/") and device_name(port) == "plcrt"
        process.terminate()


def test_its_terminal_has_the_same_name_after_a_restart_and_none_when_it_has_ended(plcrt):
    port = plcrt.port
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert plcrt.port == port and device_name(port) == "plcrt"
    plcrt.stop()
    assert not os.path.lexists(port)


def test_a_file_in_place_of_its_link_is_not_touched(tmp_path):
    notes = tmp_path / "notes"
    notes.write_text("milk, bread")
    done = run_plcrt("--flash", str(tmp_path / "flash"), "--serial", f"pty:{notes}")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert str(notes) in done.stderr and "name another path" in done.stderr
    assert notes.read_text() == "milk, bread"


def test_clients_come_and_go(plcrt):
    for _ in range(5):
        assert device_name(plcrt.port) == "plcrt"


def test_garbage_on_the_line_does_no_harm(plcrt):
    noise = random.Random(1).randbytes(100_000).replace(b"x", b"#<")
    with open(plcrt.port, "wb", buffering=0) as line:
        line.write(noise)
    assert device_name(plcrt.port) == "plcrt"


def test_replies_that_are_not_read_do_not_block_it(plcrt, eventually):
    """Name requests without end from a client that never reads: the terminal fills up."""
    ask_without_reading(plcrt.port, 2000)
    assert device_name(plcrt.port) == "plcrt"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_in_order_when_asked_to(plcrt, number):
    assert plcrt.stop(number) == 0


def test_it_ends_when_asked_to_though_the_signal_was_blocked_before_it_started(tmp_path):
    command = [find_plcrt(), "--flash", str(tmp_path / "flash"), "--serial", "pty"]
    block = lambda: signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])  # noqa: E731
    with started(command, stdout=subprocess.PIPE, preexec_fn=block) as process:
        assert process.stdout.readline()
        process.terminate()
        assert process.wait(PATIENCE) == 0


@pytest.mark.parametrize("failed_before", [False, True])
def test_its_exit_status_says_that_retain_variables_were_not_saved(tool, plcrt, counter, eventually, failed_before):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    resource.prlimit(plcrt.worker, resource.RLIMIT_FSIZE, (0, 0))  # a disk that takes nothing
    if failed_before:
        eventually(lambda: "Retain variables cannot" in tool("log", "--port", plcrt.port).out)
    plcrt.process.terminate()
    _, said = plcrt.process.communicate(timeout=PATIENCE)
    assert plcrt.process.returncode == 1
    assert "Retain variables cannot be saved" in said


def test_it_does_not_stop_when_its_terminal_closes(plcrt):
    plcrt.process.send_signal(signal.SIGHUP)
    assert device_name(plcrt.port) == "plcrt"
    assert plcrt.stop() == 0


def test_it_goes_on_when_its_output_is_not_read(tmp_path, eventually):
    """Standard output is a pipe whose other end is closed already."""
    reader, writer = os.pipe()
    os.close(reader)
    command = [find_plcrt(), "--flash", str(tmp_path / "flash"), "--serial", "pty"]
    with started(command, stdout=writer) as process:
        os.close(writer)
        eventually(lambda: find_worker(process.pid))
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.3)
        process.terminate()
        assert process.wait(PATIENCE) == 0


def test_two_do_not_share_a_flash_file(plcrt):
    done = run_plcrt("--flash", str(plcrt.flash))
    assert done.returncode == 1 and "in use by another plcrt" in done.stderr
    assert device_name(plcrt.port) == "plcrt"


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_the_flash_file_is_free_when_it_has_ended(plcrt, how):
    plcrt.stop(how)
    plcrt.start()
    assert device_name(plcrt.port) == "plcrt"


def test_it_starts_again_after_being_killed_at_any_moment_of_its_start(tmp_path):
    chance = random.Random(2)
    flash = tmp_path / "flash"
    command = [find_plcrt(), "--flash", str(flash), "--serial", "pty"]
    for _ in range(20):
        with started(command, stdout=subprocess.DEVNULL) as process:
            time.sleep(chance.random() * 0.02)
            process.kill()
    with Plcrt(flash) as running, Connection(SerialTransport(running.port)) as connection:
        assert read_status(Session(connection)).state.value == "none"


@pytest.mark.parametrize("questions", [1, 2000])
def test_it_needs_next_to_no_processor_time_when_idle(plcrt, questions):
    """Also when the line is full of replies that no tool reads, and when it was."""
    ask_without_reading(plcrt.port, questions)
    device_name(plcrt.port)
    pids = (plcrt.process.pid, plcrt.worker)
    before, begun = sum(map(processor_ns, pids)), time.monotonic_ns()
    time.sleep(2)
    share = (sum(map(processor_ns, pids)) - before) / (time.monotonic_ns() - begun)
    assert share < IDLE_SHARE


def test_it_ends_with_a_test_that_is_killed(tmp_path, eventually):
    code = """
import sys, time
from plctool.testing.plcrt import Plcrt
with Plcrt(sys.argv[1]) as running:
    print(running.process.pid, flush=True)
    time.sleep(60)
"""
    command = [sys.executable, "-c", code, str(tmp_path / "flash")]
    with started(command, stdout=subprocess.PIPE, text=True) as test:
        pid = int(test.stdout.readline())
        assert is_alive(pid)
        test.kill()
    eventually(lambda: not is_alive(pid))


def test_a_stack_beyond_its_limit_has_nothing_unused(plcrt):
    resource.prlimit(plcrt.worker, resource.RLIMIT_STACK, (64 * 1024, 64 * 1024))
    with connect(f"serial:{plcrt.port}") as plc:
        stack = plc.stack()
    assert (stack.size, stack.unused) == (64 * 1024, 0)


def test_no_function_is_looked_up_by_the_linker_while_it_runs():
    with open(find_plcrt(), "rb") as file:
        tags = ELFFile(file).get_section_by_name(".dynamic").iter_tags("DT_FLAGS")
        assert any(tag.entry.d_val & ENUM_DT_FLAGS["DF_BIND_NOW"] for tag in tags)


def test_it_runs_without_any_line(tmp_path, eventually):
    command = [find_plcrt(), "--flash", str(tmp_path / "flash")]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        eventually(lambda: find_worker(process.pid))
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.3)
        process.terminate()
        assert process.wait(PATIENCE) == 0
        assert process.stdout.read() == ""
        said = "plcrt: no tool can reach this controller: give --serial, --tcp, --udp, --can or --tunnel\n"
        assert process.stderr.read() == said


def test_two_do_not_share_a_serial_device(tmp_path):
    ours, theirs = os.openpty()
    options = ["--serial", os.ttyname(theirs), "--flash"]
    with started([find_plcrt(), *options, str(tmp_path / "a")]) as process:
        with Connection(Wire(ours)) as connection:
            assert read_identity(Session(connection)).device_name == "plcrt"
            done = run_plcrt(*options, str(tmp_path / "b"))
        os.close(theirs)
        process.terminate()
    assert done.returncode == 1 and "busy" in done.stderr


class Wire:
    """The other end of a serial line, as a transport."""

    name = "wire"
    local_address = b"\x00\x02"
    max_packet = simplecom.MAX_PACKET
    long_packet = simplecom.LONG_PACKET
    packet_overhead = simplecom.FRAME_OVERHEAD
    point_to_point = False
    heard_at = -math.inf
    peer_words = 1
    places = NO_PLACES
    byte_rate = math.inf
    is_slow = False
    is_bus = False

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self.decoder = simplecom.Decoder()
        self.packets: list[bytes] = []

    def now(self) -> float:
        return time.monotonic()

    def send(self, *packets: bytes) -> None:
        os.write(self.fd, b"".join(map(simplecom.encode, packets)))

    def receive(self, timeout: float) -> bytes | None:
        if not self.packets and select.select([self.fd], [], [], timeout)[0]:
            self.packets += self.decoder.feed(os.read(self.fd, 4096))
        return self.packets.pop(0) if self.packets else None

    def close(self) -> None:
        os.close(self.fd)


def test_it_serves_a_serial_device_by_its_path(tmp_path):
    ours, theirs = os.openpty()
    command = [find_plcrt(), "--flash", str(tmp_path / "flash"), "--serial", os.ttyname(theirs), "--baud", "9600"]
    with started(command, stdout=subprocess.PIPE, text=True) as process:
        with Connection(Wire(ours)) as connection:
            assert read_identity(Session(connection)).device_name == "plcrt"
        os.close(theirs)
        process.terminate()
        assert process.wait(PATIENCE) == 0
        assert process.stdout.read() == ""
