"""Commands of plctool and of pytest as processes of their own, without the imports, most of a short command's work.

A server, this file as a program, has imported plctool and forks for each command. What that leaves out is the start of
Python, the imports, the tables of the grammar and the reading of the standard library; `python -m plctool` is tested in
tests/cli.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import io
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import IO, Any, NoReturn

IMPORTED = (
    "pytest",
    "plctool.__main__",
    "plctool.cli.main",
    "plctool.compiler.image.build",
    "plctool.compiler.syntax.library",
    "plctool.device",
    "plctool.gateway.client",
    "plctool.port_check",
    "plctool.sim",
    "plctool.st_tests",
    "plctool.trace_file",
)
TARGET = "PLCRT_TARGET"
"""A variable of the environment: the target of a $PLCRT for another processor, which programs are built for then."""

FIRST_PROGRAM = """
PROGRAM Main
VAR
    t : TON;
END_VAR
    t(IN := TRUE, PT := T#1S);
END_PROGRAM

TEST 'the first'
    ASSERT_TRUE(TRUE);
END_TEST
"""
"""What the server checks and builds before the first command."""

LONGEST = 1 << 18  # bytes of a request; the environment is its greatest part


def build_for_plcrt() -> None:
    """Has programs built for the processor of plcrt, in this process, if $PLCRT_TARGET names it."""
    if TARGET in os.environ:
        importlib.import_module("plctool.compiler").DEFAULT_TARGET = os.environ[TARGET]  # type: ignore[attr-defined]


@cache
def _server() -> socket.socket:
    """Where requests go: JSON with the files stdin, stdout, stderr and a pipe for the process id and its end."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with there:
        command = [sys.executable, __file__, str(there.fileno())]
        env = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        process = subprocess.Popen(command, pass_fds=[there.fileno()], env=env)

    def end() -> None:
        here.close()
        process.wait()

    here.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LONGEST)
    atexit.register(end)
    return here


def run_plctool(
    words: Sequence[str], folder: Path, env: Mapping[str, str], timeout: float
) -> subprocess.CompletedProcess[str]:
    """Runs `plctool WORDS` in a folder; raises TimeoutExpired after `timeout` [s], as subprocess.run does."""
    return _run(["plctool", *words], folder, env, timeout)


def run_pytest(
    words: Sequence[str], folder: Path, env: Mapping[str, str], timeout: float
) -> subprocess.CompletedProcess[str]:
    """Runs `python -m pytest WORDS`, which may load plctool's plugin, in the same way."""
    return _run(["pytest", *words], folder, env, timeout)


def _run(
    command: Sequence[str], folder: Path, env: Mapping[str, str], timeout: float
) -> subprocess.CompletedProcess[str]:
    request = {"command": command, "folder": str(folder), "env": dict(env)}
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err, open(os.devnull) as nothing:
        reader, writer = os.pipe()
        with open(reader) as told:
            files = [nothing.fileno(), out.fileno(), err.fileno(), writer]
            socket.send_fds(_server(), [json.dumps(request).encode()], files)
            os.close(writer)
            pid = int(told.readline())
            if not select.select([told], [], [], timeout)[0]:
                os.kill(pid, signal.SIGKILL)
                raise subprocess.TimeoutExpired(command, timeout, _content(out), _content(err))
            status = int(told.readline())
        return subprocess.CompletedProcess(command, status, _content(out), _content(err))


def _content(file: IO[str]) -> str:
    file.seek(0)
    return file.read()


def _serve(requests: socket.socket) -> None:
    """Until pytest has ended and no command runs. The pipe of each gets the process id, and then its end."""
    tellers: dict[int, tuple[int, int]] = {}  # by file of the process: its id, and the pipe
    asked = [requests]
    while asked or tellers:
        for ready in select.select([*asked, *tellers], [], [])[0]:
            if ready is requests:
                data, files, _, _ = socket.recv_fds(requests, LONGEST, 4)
                if not data:
                    asked = []
                    continue
                *streams, teller = files
                if (pid := os.fork()) == 0:
                    requests.close()
                    _work(json.loads(data), streams)
                os.write(teller, b"%d\n" % pid)
                tellers[os.pidfd_open(pid)] = pid, teller
                for file in streams:
                    os.close(file)
            else:
                pid, teller = tellers.pop(ready)
                _, status = os.waitpid(pid, 0)
                with contextlib.suppress(BrokenPipeError):  # it was not waited for
                    os.write(teller, b"%d\n" % os.waitstatus_to_exitcode(status))
                os.close(teller)
                os.close(ready)


def _work(request: dict[str, Any], streams: list[int]) -> NoReturn:
    """The process of a command."""
    for number, file in enumerate(streams):
        os.dup2(file, number)
    os.closerange(3, max(streams) + 64)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["env"])
    sys.argv = request["command"]
    sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115 # buffered as a file
    try:
        if sys.argv[0] == "pytest":
            sys.path.insert(0, request["folder"])  # as `python -m` does
            status = int(sys.modules["pytest"].main(sys.argv[1:]))
        else:
            status = sys.modules["plctool.__main__"].run()
    except SystemExit as end:
        status = end.code or 0
    except BaseException:
        traceback.print_exc()
        status = 1
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and not thread.daemon:
            thread.join()
    sys.stdout.flush()
    os._exit(status)  # without taking everything down that was imported


def _prepare() -> None:
    """Does what a process does once: imports the module of each command, reads the tables and the standard library."""
    run = importlib.import_module("plctool.cli.main").main
    sys.modules["plctool.cli.command_line"].parser()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as out:
        source = Path(folder) / "first.st"
        source.write_text(FIRST_PROGRAM)
        for command in (["check", str(source)], ["build", str(source), "-o", str(source.with_suffix(".cdl"))]):
            if run(command) != 0:
                sys.exit(f"plctool {command[0]} failed before the first command:\n{out.getvalue()}")


def main() -> None:
    for module in IMPORTED:
        importlib.import_module(module)
    build_for_plcrt()
    _prepare()
    gc.freeze()  # so that the pages stay common to all processes
    with socket.socket(fileno=int(sys.argv[1])) as requests:
        _serve(requests)


if __name__ == "__main__":
    main()
