"""plcrt as a service of systemd: the journal gets the log, and systemd hears that plcrt is up and alive."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conftest import Tool

from plctool import connect
from plctool.testing.children import ends_with_us
from plctool.testing.plcrt import END_TIMEOUT, find_plcrt, find_worker

Eventually = Callable[[Callable[[], Any]], Any]
ENTRY = re.compile(r"<([0-7])>(.+)")


class Service:
    """plcrt as systemd starts it. `entries` is what its journal has: the priority and the text of each line."""

    def __init__(self, process: subprocess.Popen[str], listener: socket.socket) -> None:
        self.process, self._listener = process, listener
        self.entries: list[tuple[int, str]] = []
        self.notes: list[str] = []
        assert process.stdout
        self.tcp = process.stdout.readline().removeprefix("tcp: ").strip()
        self._threads = [threading.Thread(target=read, daemon=True) for read in (self._read_journal, self._read_notes)]
        for thread in self._threads:
            thread.start()

    def _read_journal(self) -> None:
        assert self.process.stderr
        for line in self.process.stderr:
            entry = ENTRY.fullmatch(line.rstrip("\n"))
            assert entry, line
            self.entries.append((int(entry[1]), entry[2]))

    def _read_notes(self) -> None:
        while note := self._listener.recv(4096).decode():
            self.notes.append(note)

    def is_quiet_for(self, seconds: float) -> bool:
        """True if no message comes for so long, several times as long as the watchdog waits."""
        before = len(self.notes)
        threading.Event().wait(seconds)
        return len(self.notes) == before

    def stop(self) -> int:
        self.process.terminate()
        return self.process.wait(timeout=END_TIMEOUT)

    def close(self) -> None:
        """Ends the process and the threads that read what it sends."""
        self.process.kill()
        self.process.wait()
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
            end.sendto(b"", self._listener.getsockname())
        for thread in self._threads:
            thread.join()


@contextmanager
def as_service(flash: Path, place: str, *options: str, watchdog_us: int = 200_000) -> Iterator[Service]:
    """A service that listens for messages at `place`; an end that has not come is forced."""
    read_end, write_end = os.pipe()
    stream = os.fstat(write_end)
    environment = os.environ | {
        "JOURNAL_STREAM": f"{stream.st_dev}:{stream.st_ino}",
        "NOTIFY_SOCKET": place,
        "WATCHDOG_USEC": str(watchdog_us),
    }
    command = ends_with_us([find_plcrt(), "--flash", str(flash), "--tcp", "0", *options])
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind("\0" + place[1:] if place.startswith("@") else place)
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=write_end, text=True)
        os.close(write_end)
        process.stderr = os.fdopen(read_end)
        running = Service(process, listener)
        try:
            yield running
        finally:
            running.close()


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with as_service(tmp_path / "plc.flash", str(tmp_path / "notify")) as running:
        yield running


def test_the_journal_has_each_entry_of_the_log_with_its_priority(
    service: Service, tool: Tool, eventually: Eventually
) -> None:
    image = tool.build(
        "bad", "PROGRAM Main VAR n, d : DINT; go : BOOL; END_VAR IF go THEN n := 1 / d; END_IF END_PROGRAM"
    )
    tool.ok("flash", "--tcp", service.tcp, str(image))
    tool.ok("write", "--tcp", service.tcp, "Main.go=TRUE")
    with connect(f"tcp:{service.tcp}") as plc:
        eventually(lambda: any("division by zero" in entry.text for entry in plc.log()))
        log = [entry.text for entry in plc.log()]
    eventually(lambda: len(service.entries) >= len(log))
    texts = [text for _, text in service.entries]
    assert [text.partition(": ")[2] for text in texts] == log
    [exception] = [priority for priority, text in service.entries if "division by zero" in text]
    assert exception == 2


def test_a_journal_that_takes_nothing_does_not_stop_the_controller(tmp_path: Path, tool: Tool, counter: Path) -> None:
    read_end, write_end = os.pipe()
    fcntl.fcntl(write_end, fcntl.F_SETPIPE_SZ, 4096)
    stream = os.fstat(write_end)
    process = subprocess.Popen(
        ends_with_us([find_plcrt(), "--flash", str(tmp_path / "plc.flash"), "--tcp", "0"]),
        env=os.environ | {"JOURNAL_STREAM": f"{stream.st_dev}:{stream.st_ino}"},
        stdout=subprocess.PIPE,
        stderr=write_end,
        text=True,
    )
    os.close(write_end)
    assert process.stdout
    with connect(f"tcp:{process.stdout.readline().removeprefix('tcp: ').strip()}") as plc:
        plc.flash(counter)
        for _ in range(100):  # each has two entries of more than 40 characters
            plc.stop()
            plc.start()
        assert plc.status().state == "run"
    process.terminate()
    assert process.wait(timeout=END_TIMEOUT) == 0
    lines = os.read(read_end, 8192).splitlines()
    assert lines and all(ENTRY.fullmatch(line.decode()) for line in lines)
    os.close(read_end)
    process.stdout.close()


def test_a_death_of_the_controller_is_in_the_journal_and_the_next_one_is_ready(
    service: Service, eventually: Eventually
) -> None:
    eventually(lambda: "READY=1" in service.notes)
    worker = find_worker(service.process.pid)
    assert worker
    os.kill(worker, signal.SIGKILL)
    eventually(lambda: service.notes.count("READY=1") == 2)
    eventually(lambda: any("was started again" in text for _, text in service.entries))
    assert (
        3,
        "the controller died (signal SIGKILL) and is started again; its program stays stopped",
    ) in service.entries


def test_systemd_hears_that_it_is_up_what_the_program_does_and_that_it_ends(
    service: Service, tool: Tool, counter: Path, eventually: Eventually
) -> None:
    eventually(lambda: service.notes[:2] == ["READY=1", "STATUS=No program"])
    tool.ok("flash", "--tcp", service.tcp, str(counter))
    eventually(lambda: "STATUS=The program runs" in service.notes)
    tool.ok("stop", "--tcp", service.tcp)
    eventually(lambda: "STATUS=The program is stopped" in service.notes)
    assert service.stop() == 0
    eventually(lambda: service.notes[-1] == "STOPPING=1")


def test_the_watchdog_is_fed_as_long_as_main_has_its_passes(service: Service, eventually: Eventually) -> None:
    eventually(lambda: service.notes.count("WATCHDOG=1") >= 3)
    worker = find_worker(service.process.pid)
    assert worker
    os.kill(worker, signal.SIGSTOP)
    eventually(lambda: Path(f"/proc/{worker}/stat").read_text().rsplit(")", 1)[1].split()[0] == "T")
    eventually(lambda: service.is_quiet_for(seconds=0.5))
    os.kill(worker, signal.SIGCONT)
    fed = service.notes.count("WATCHDOG=1")
    eventually(lambda: service.notes.count("WATCHDOG=1") > fed)


def test_a_name_outside_of_the_file_system_is_reached(tmp_path: Path, eventually: Eventually) -> None:
    with as_service(tmp_path / "plc.flash", f"@plcrt-test-{os.getpid()}") as running:
        eventually(lambda: "READY=1" in running.notes)


@pytest.mark.parametrize("place", ["", "relative", "/" + "x" * 200, "/nothing/listens"])
def test_a_place_that_systemd_does_not_listen_at_is_passed_over(tmp_path: Path, place: str) -> None:
    process = subprocess.Popen(
        ends_with_us([find_plcrt(), "--flash", str(tmp_path / "flash"), "--tcp", "0"]),
        env=os.environ | {"NOTIFY_SOCKET": place, "WATCHDOG_USEC": "x"},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout and process.stdout.readline().startswith("tcp: ")
    process.terminate()
    assert process.wait(timeout=END_TIMEOUT) == 0
    process.stdout.close()


def test_a_stream_that_is_not_the_journal_gets_sentences_for_users(tmp_path: Path) -> None:
    done = subprocess.run(
        [find_plcrt(), "--flash", str(tmp_path / "none" / "flash")],
        env=os.environ | {"JOURNAL_STREAM": "1:2"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1 and done.stderr.startswith("plcrt: ")
