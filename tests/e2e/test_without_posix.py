"""The tool works where Python has only what Windows has: no fcntl, termios or pwd, no fork, no sockets with paths.

It cannot be run on Windows here. What is hidden is what Python's documentation calls "Unix"; the compiled simulator and
pyserial are those of this machine.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from plctool.testing.plcrt import Plcrt

WINDOWS = """
import os, signal, socket, sys
import serial  # pyserial has a module for Windows, which cannot be loaded here

hidden = {"crypt", "curses", "fcntl", "grp", "nis", "posix", "pty", "pwd", "readline", "resource", "spwd", "syslog",
          "termios", "tty"}
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name in hidden:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
for name in hidden - {"posix"}:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Hidden())
for name in ("chown", "fchmod", "fork", "forkpty", "geteuid", "getgid", "getloadavg", "getpgid", "getpgrp", "getuid",
             "killpg", "mkfifo", "posix_spawn", "pread", "pwrite", "register_at_fork", "sched_getaffinity",
             "sched_setaffinity", "setsid", "statvfs", "sysconf", "tcgetpgrp", "uname", "wait3", "wait4", "waitid",
             "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW"):
    delattr(os, name)
for name in ("SIGALRM", "SIGCONT", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGTSTP", "SIGUSR1", "SIGUSR2",
             "SIGWINCH", "alarm", "pthread_sigmask", "setitimer"):
    delattr(signal, name)
del socket.AF_UNIX
from plctool.cli.main import main
sys.argv[0] = "plctool"
sys.exit(main())
"""
MAIN = "PROGRAM Main\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n"
TEST = "TEST 'counts'\nVAR m : Main; END_VAR\nm(); ASSERT_EQ(m.n, 1);\nEND_TEST\n"


@pytest.fixture
def windows(tmp_path: Path):
    """Runs plctool in a process that has no more; gives what it printed."""

    def run(*words: str) -> str:
        done = subprocess.run([sys.executable, "-c", WINDOWS, *words], cwd=tmp_path, capture_output=True, text=True,
                              env=os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}, timeout=300)  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    (tmp_path / "main.st").write_text(MAIN + TEST)
    return run


def test_a_program_is_made_tested_and_run(windows, tmp_path: Path) -> None:
    windows("check", "main.st")
    assert "1 passed" in windows("test", "main.st")
    windows("build", "main.st", "-o", "app.cdl")
    assert "Main.n = 3" in windows("run", "app.cdl", "--cycles", "3", "--get", "Main.n")
    assert "Main.n" in windows("symbols", "app.cdl")
    windows("fmt", "main.st")
    windows("doc", "main.st", "-o", "pages")
    windows("new", "project")
    assert "passed" in windows("test", "project")


def test_a_device_on_the_network_is_flashed_and_read(windows, plcrt: Plcrt) -> None:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    link = ("--tcp", plcrt.tcp)
    windows("build", "main.st", "-o", "app.cdl")
    windows("flash", *link, "app.cdl")
    assert "Main.n = " in windows("read", *link, "Main.n")
    windows("stop", *link)
    assert "stop" in windows("status", *link)
    windows("log", *link)


def test_a_serial_line_is_used_without_a_gateway(windows, plcrt: Plcrt) -> None:
    windows("build", "main.st", "-o", "app.cdl")
    windows("flash", "--port", str(plcrt.port), "app.cdl")
    assert "Main.n = " in windows("read", "--port", str(plcrt.port), "Main.n")
