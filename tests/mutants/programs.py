"""The test programs that contain a C file, each linked once more with all mutants of this file in its place."""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import re
import shlex
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from mutate import Mutator, used

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LEAST_LIMIT_S = 3.0  # of a test; the machine may be busy
LIMIT_FACTOR = 10


@dataclass(frozen=True)
class Test:
    """A C test as meson starts it."""

    name: str
    program: str  # relative to the build folder
    arguments: tuple[str, ...]


@dataclass
class Program:
    """A test with the mutants of a file."""

    test: Test
    path: Path
    seconds: float = 0.0
    seen: frozenset[int] = frozenset()  # mutants that would decide otherwise in it


@dataclass
class Mutated:
    """A file with its mutants, and what runs them."""

    mutator: Mutator
    compiled: set[int] = field(default_factory=set)
    programs: list[Program] = field(default_factory=list)


@cache
def tests_of(build: Path) -> tuple[Test, ...]:
    """Returns the C tests of a build folder."""
    said = subprocess.check_output(["meson", "introspect", "--tests", str(build)], text=True)
    found = []
    for test in json.loads(said):
        program = os.path.relpath(test["cmd"][0], build)
        if program.startswith("tests/c/"):
            found.append(Test(test["name"], program, tuple(test["cmd"][1:])))
    return tuple(found)


@cache
def commands(build: Path, program: str) -> list[list[str]]:
    """Returns the commands that build a program, the last one links it."""
    said = subprocess.check_output(["ninja", "-C", str(build), "-t", "commands", program], text=True)
    lines = [line for line in said.splitlines() if not line.startswith("ninja: ")]
    return [shlex.split(line) for line in lines]


def object_of(command: list[str]) -> str:
    return command[command.index("-o") + 1]


def compile_command(build: Path, program: str, source: Path) -> list[str] | None:
    """Returns the command that compiles what the program contains of a source, None if it contains nothing."""
    compiled: dict[str, list[str]] = {}
    archives: dict[str, list[str]] = {}
    *others, link = commands(build, program)
    for command in others:
        if "-c" in command and (build / command[-1]).resolve() == source:
            compiled[object_of(command)] = command
        for at, word in enumerate(command):
            if word.endswith(".a") and command[at + 1 :]:
                archives[word] = command[at + 1 :]
                break
    for word in link:
        for name in [word, *archives.get(word, ())]:
            if name in compiled:
                return compiled[name]
    return None


class Workshop:
    """Builds in a folder of its own; the build folder is only read."""

    def __init__(self, build: Path, folder: Path) -> None:
        self.build = build.resolve()
        self.folder = folder
        self.objects: dict[str, Path] = {}

    def run(self, command: list[str], harmless: str = "\n\n") -> bool:
        """Runs a command as ninja does, but without the cache of compilers: no other build compiles these files.
        Returns False if it failed with a harmless message."""
        if Path(command[0]).name == "ccache":
            command = command[1:]
        done = subprocess.run(command, cwd=self.build, capture_output=True, text=True, check=False)
        if done.returncode and harmless not in done.stderr:
            raise SystemExit(f"{shlex.join(command)}\n{done.stderr}")
        return done.returncode == 0

    def mutate(self, source: Path, tests: list[Test]) -> Mutated:
        """Compiles a file with its mutants, once for each way the tests compile it, and links the tests with it."""
        result = Mutated(Mutator(source.read_bytes()))
        text = self.folder / source.name
        text.write_bytes(b'#line 1 "%s"\n' % str(source).encode() + result.mutator.text)
        switch = self.folder / "switch.o"
        count = f"-DMUTANTS={len(result.mutator.mutants)}"
        self.run(["cc", "-O1", "-fPIC", count, "-c", str(HERE / "switch.c"), "-o", str(switch)])
        for test in tests:
            command = compile_command(self.build, test.program, source)
            if command is not None:
                mutated = self.compile(command, text, source, result)
                program = Program(test, self.folder / f"{test.name}")
                if self.link(test, program.path, object_of(command), [str(mutated), str(switch)]):
                    result.programs.append(program)
        return result

    def compile(self, command: list[str], text: Path, source: Path, result: Mutated) -> Path:
        """Compiles with the flags of a command, unless that was done before."""
        name = object_of(command)
        if name in self.objects:
            return self.objects[name]
        dropped = {"-MD", "-Werror", "-g", "-c", command[-1]}
        flags: list[str] = []
        for at, word in enumerate(command):
            if word not in dropped and command[at - 1] not in ("-MQ", "-MF", "-o") and word not in ("-MQ", "-MF", "-o"):
                flags.append(word)
        flags += ["-w", "-I", str(source.parent), "-include", str(HERE / "switch.h")]
        made = self.folder / f"mutants_{len(self.objects)}.o"
        self.run([*flags, "-O1", "-c", str(text), "-o", str(made)])
        self.run([*flags, "-E", str(text), "-o", str(made.with_suffix(".i"))])
        result.compiled |= set(used(made.with_suffix(".i").read_text()))
        self.objects[name] = made
        return made

    def link(self, test: Test, path: Path, replaced: str, objects: list[str]) -> bool:
        """Links as the build folder does. What comes before the archives keeps these from adding their own. Returns
        False if the program does without the file, and has other functions in its place."""
        command = [word for word in commands(self.build, test.program)[-1] if word != replaced]
        command[command.index("-o") + 1] = str(path)
        first = next(at for at, word in enumerate(command) if word.endswith(".o"))
        return self.run([*command[:first], *objects, *command[first:]], harmless="multiple definition of")


def start(program: Program, limit_s: float, variables: dict[str, str]) -> bool:
    """Returns whether a test passes within its time."""
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen([program.path, *program.test.arguments], cwd=folder, env=os.environ | variables,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   start_new_session=True)  # fmt: skip
        try:
            return process.wait(limit_s) == 0
        except subprocess.TimeoutExpired:
            return False
        finally:
            stop(process)


def stop(process: subprocess.Popen[bytes]) -> None:
    """Ends a test with the processes that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def measure(program: Program, mutants: int, limit_s: float) -> bool:
    """Runs a test without an active mutant: how long it takes, and what it sees. Returns whether it passes."""
    with tempfile.NamedTemporaryFile() as seen:
        seen.write(bytes(mutants + 1))
        seen.flush()
        begin = time.monotonic()
        passed = start(program, limit_s, {"MUTANTS_SEEN": seen.name})
        program.seconds = time.monotonic() - begin
        with mmap.mmap(seen.fileno(), 0) as view:
            program.seen = frozenset(number for number in range(mutants + 1) if view[number])
    return passed


def dies(program: Program, number: int) -> bool:
    limit_s = max(LEAST_LIMIT_S, LIMIT_FACTOR * program.seconds)
    return not start(program, limit_s, {"MUTANT": str(number)})


def killers(number: int, programs: list[Program]) -> Iterator[Program]:
    """Returns the tests that see a difference, the fastest first."""
    yield from sorted((program for program in programs if number in program.seen), key=lambda program: program.seconds)


def matches(name: str, only: str | None) -> bool:
    return only is None or re.search(only, name) is not None
