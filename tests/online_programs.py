"""Random programs, and random edits of them, for online changes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

from plctool.compiler import build, program_files
from plctool.compiler.image.build import BuildResult
from plctool.compiler.sources.request import BuildRequest
from plctool.debug.symbols import SymbolTable

SCALARS = ("BOOL", "SINT", "INT", "DINT", "LINT", "UINT", "REAL", "LREAL", "TIME")
VALUES = {"BOOL": "TRUE", "REAL": "1.5", "LREAL": "-2.25", "TIME": "T#3s"}


@dataclass(frozen=True)
class Line:
    """A variable of the program; `value`: its initial value, "" for none."""

    name: str
    type: str
    value: str = ""
    section: str = "VAR"

    @property
    def text(self) -> str:
        value = f" := {self.value}" if self.value else ""
        return f"{self.section} {self.name} : {self.type}{value}; END_VAR"


@dataclass(frozen=True)
class Source:
    """A program: its variables, and what its body counts up by."""

    lines: tuple[Line, ...]
    step: int = 1

    @property
    def text(self) -> str:
        lines = "\n".join(line.text for line in self.lines)
        return (
            f"FUNCTION_BLOCK Block VAR_INPUT by : DINT := 3; END_VAR VAR_OUTPUT sum : DINT; END_VAR\n"
            f"VAR calls : UINT; END_VAR sum := sum + by; calls := calls + 1; END_FUNCTION_BLOCK\n"
            f"PROGRAM Main VAR cycles : DINT; block : Block; to : POINTER TO DINT := ADR(cycles); END_VAR\n{lines}\n"
            f"cycles := cycles + {self.step}; block(); to^ := to^ + 0; END_PROGRAM\n"
            "CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1);\n"
            "PROGRAM Main WITH T : Main; END_RESOURCE END_CONFIGURATION\n"
        )


def random_line(random: Random, number: int) -> Line:
    t = random.choice(SCALARS)
    section = random.choice(("VAR", "VAR", "VAR", "VAR RETAIN", "VAR PERSISTENT"))
    value = random.choice(("", VALUES.get(t, str(random.randrange(100)))))
    kind = random.randrange(6)
    if kind == 0:
        return Line(f"v{number}", f"ARRAY[1..{random.randrange(1, 9)}] OF {t}", "", section)
    if kind == 1:
        return Line(f"v{number}", f"STRING[{random.randrange(1, 40)}]", "'text'", section)
    if kind == 2:
        return Line(f"v{number}", "Block", "", "VAR")
    return Line(f"v{number}", t, value, section)


def random_source(random: Random) -> Source:
    return Source(tuple(random_line(random, n) for n in range(random.randrange(1, 15))))


def edited(random: Random, source: Source, numbers: int) -> Source:
    """The program with variables removed, added and in another order; new ones are numbered from `numbers` on."""
    lines = [line for line in source.lines if random.random() < 0.8]
    lines += [random_line(random, numbers + n) for n in range(random.randrange(0, 5))]
    random.shuffle(lines)
    return replace(source, lines=tuple(lines), step=source.step * 10 % 997)


def built(folder: Path, text: str, base: SymbolTable | None = None, target: str | None = None) -> BuildResult:
    """The program as `build` makes it."""
    file = folder / "program.st"
    file.write_text(text)
    request = BuildRequest(program_files([file]), base=base, target=target)
    return build(request)
