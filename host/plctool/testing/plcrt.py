"""A real `plcrt` process on a pseudo terminal and the network, for tests, benchmarks and the demo."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

from plctool.errors import UsageError
from plctool.testing.children import ends_with_us

END_TIMEOUT = 30.0  # plcrt kills after 9 s what does not end when it is asked to [s]


def find_plcrt() -> str:
    """The path of plcrt: $PLCRT, beside this Python, or on the PATH."""
    named = os.environ.get("PLCRT")
    beside = Path(sys.executable).parent / "plcrt"
    found = named or (str(beside) if beside.exists() else shutil.which("plcrt"))
    if not found:
        raise UsageError("plcrt was not found: install the package with 'pip install .' or set PLCRT to its path")
    return found


def _is_child(pid: int, parent: int) -> bool:
    """Whether a process runs and was started by `parent`."""
    try:
        state, ppid = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[:2]
    except OSError:
        return False
    return int(ppid) == parent and state not in "ZX"


def find_worker(supervisor: int) -> int | None:
    """Process id of the child of plcrt that runs the controller; None while it is being started. With a worker plcrt
    takes the signals that end it."""
    pids = map(int, filter(str.isdigit, os.listdir("/proc")))
    return next((pid for pid in pids if _is_child(pid, supervisor)), None)


class Plcrt:
    """Context manager around one process; `port` is the pseudo terminal it serves, by a link beside the flash file that
    stays the same over restarts, `tcp`, `udp` and `can` are its other places if `options` ask for some (`--tcp 0`,
    `--can slcan:pty`)."""

    def __init__(self, flash: Path | str, *options: str) -> None:
        self.flash = Path(flash)
        self.options = options
        self.process: subprocess.Popen[str] | None = None
        self.port = f"{self.flash}.tty"
        self._terminals: list[int] = []  # that it has had
        self.tcp = self.udp = self.can = ""

    def start(self) -> None:
        """Starts the process and waits for the lines that say where it is."""
        command = [find_plcrt(), "--flash", str(self.flash), "--serial", f"pty:{self.port}", *self.options]
        self.process = subprocess.Popen(
            ends_with_us(command), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout and self.process.stderr
        # Kept open, so that no other process gets its number when this one is killed: a tool that looks whether the
        # controller is back would take that one's.
        self._terminals.append(os.open(self._place("serial"), os.O_RDWR | os.O_NOCTTY))
        self.tcp = self._place("tcp") if "--tcp" in self.options else ""
        self.udp = self._place("udp") if "--udp" in self.options else ""
        self.can = self._place("can") if "slcan:pty" in self.options else ""

    def _place(self, kind: str) -> str:
        """What the process says next: where it serves one kind of link."""
        assert self.process and self.process.stdout and self.process.stderr
        line = self.process.stdout.readline()
        if not line.startswith(f"{kind}: "):
            self.process.kill()
            raise UsageError(f"plcrt did not start: {self.process.stderr.read().strip() or line.strip()}")
        return line.removeprefix(f"{kind}: ").strip()

    @property
    def worker(self) -> int | None:
        """Process id of the child that runs the controller; None while it is being started again."""
        assert self.process
        return find_worker(self.process.pid)

    def stop(self, how: signal.Signals = signal.SIGTERM) -> int:
        """Ends the process; SIGKILL stands for a power cut. Returns the exit status."""
        if self.process is None:
            return 0
        self.process.send_signal(how)
        status = self.process.wait(timeout=END_TIMEOUT)
        Path(self.port).unlink(missing_ok=True)  # left if it was killed; its terminal may become that of another one
        for stream in (self.process.stdout, self.process.stderr):
            if stream:
                stream.close()
        self.process = None
        return status

    def __enter__(self) -> Plcrt:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.stop(signal.SIGKILL if exc[0] else signal.SIGTERM)
        while self._terminals:
            os.close(self._terminals.pop())
