"""Random programs, and random edits of them, for online changes."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any

from plctool.compiler import build, program_files
from plctool.compiler.image.build import BuildResult
from plctool.compiler.sources.request import BuildRequest
from plctool.debug.symbols import SymbolTable

SCALARS = ("BOOL", "SINT", "INT", "DINT", "LINT", "UINT", "REAL", "LREAL", "TIME")
VALUES = {"BOOL": "TRUE", "REAL": "1.5", "LREAL": "-2.25", "TIME": "T#3s"}
WIDER = {"SINT": ("INT", "DINT", "LINT"), "INT": ("DINT", "LINT"), "DINT": ("LINT",), "UINT": ("DINT", "LINT")}
_LENGTH = re.compile(r"\d+\]")


@dataclass(frozen=True)
class Line:
    """A variable of the program, or a member of its block; `value`: its initial value, "" for none."""

    name: str
    type: str
    value: str = ""
    section: str = "VAR"

    @property
    def text(self) -> str:
        value = f" := {self.value}" if self.value else ""
        return f"{self.section} {self.name} : {self.type}{value}; END_VAR"

    @property
    def pointer(self) -> str:
        """A pointer to it, or to the first element of an array."""
        element, place = self.type.rpartition(" OF ")[2], f"{self.name}[1]" if "ARRAY" in self.type else self.name
        return f"VAR to_{self.name} : POINTER TO {element} := ADR({place}); END_VAR"


@dataclass(frozen=True)
class Source:
    """A program: its variables, the members of its block, and what its body counts up by."""

    lines: tuple[Line, ...]
    members: tuple[Line, ...] = ()
    step: int = 1

    @property
    def text(self) -> str:
        lines = "\n".join(f"{line.text} {line.pointer}" for line in self.lines)
        members = " ".join(member.text for member in self.members)
        return (
            f"FUNCTION_BLOCK Block {members} VAR_INPUT by : DINT := 3; END_VAR VAR_OUTPUT sum : DINT; END_VAR\n"
            f"VAR calls : UINT; END_VAR sum := sum + by; calls := calls + 1; END_FUNCTION_BLOCK\n"
            f"PROGRAM Main VAR cycles : DINT; block : Block; to : POINTER TO DINT := ADR(cycles); END_VAR\n{lines}\n"
            f"cycles := cycles + {self.step}; block(); to^ := to^ + 0; END_PROGRAM\n"
            "CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1);\n"
            "PROGRAM Main WITH T : Main; END_RESOURCE END_CONFIGURATION\n"
        )

    @property
    def types(self) -> dict[str, str]:
        """The types of variables by their names, and of the members of blocks by theirs, in small letters."""
        return {line.name: line.type for line in (*self.lines, *self.members)}


def random_line(random: Random, number: int) -> Line:
    t = random.choice(SCALARS)
    section = random.choice(("VAR", "VAR", "VAR", "VAR RETAIN", "VAR PERSISTENT"))
    value = random.choice(("", VALUES.get(t, str(random.randrange(100)))))
    kind = random.randrange(6)
    if kind == 0:
        return Line(f"v{number}", f"ARRAY[1..{random.randrange(1, 9)}] OF {t}", "", section)
    if kind == 1:
        return Line(f"v{number}", f"STRING[{random.randrange(4, 40)}]", "'text'", section)
    if kind == 2:
        return Line(f"v{number}", random.choice(("Block", "ARRAY[1..3] OF Block")), "", "VAR")
    return Line(f"v{number}", t, value, section)


def random_member(random: Random, number: int) -> Line:
    t = random.choice(SCALARS)
    return Line(f"m{number}", t, random.choice(("", VALUES.get(t, str(random.randrange(100))))))


def random_source(random: Random) -> Source:
    return Source(tuple(random_line(random, n) for n in range(random.randrange(1, 15))))


def edited(random: Random, source: Source, numbers: int) -> Source:
    """The program with variables and members removed, added, in another order and of other types; new ones are numbered
    from `numbers` on."""
    lines = [_edited_type(random, line) for line in source.lines if random.random() < 0.8]
    lines += [random_line(random, numbers + n) for n in range(random.randrange(0, 5))]
    random.shuffle(lines)
    members = [_edited_type(random, member) for member in source.members if random.random() < 0.9]
    members += [random_member(random, numbers + n) for n in range(random.randrange(0, 3))]
    random.shuffle(members)
    return Source(tuple(lines), tuple(members), source.step * 10 % 997)


def _edited_type(random: Random, line: Line) -> Line:
    if random.random() < 0.7:
        return line
    if line.type in WIDER:
        return replace(line, type=random.choice(WIDER[line.type]))
    if line.type in SCALARS:
        return replace(line, type="DINT", value="")
    if "[" in line.type:
        return replace(line, type=_LENGTH.sub(f"{random.randrange(4, 40)}]", line.type))
    return line


def carried(name: str, before: Any, initial: Any, had: dict[str, str], has: dict[str, str]) -> Any:
    """The value that a variable has after a change: what it had, as far as its type allows that, else what a new one
    begins with. `had` and `has`: `Source.types` of both programs."""
    if isinstance(initial, dict):
        return {k: carried(k, before[k], v, had, has) if k in before else v for k, v in initial.items()}
    if isinstance(initial, list):
        element = (had.get(name, "").rpartition(" OF ")[2], has.get(name, "").rpartition(" OF ")[2])
        rows = zip(before, initial, strict=False)
        kept = [carried(element[1], b, i, {element[1]: element[0]}, {element[1]: element[1]})
                if not isinstance(i, dict) else carried("", b, i, had, has) for b, i in rows]  # fmt: skip
        return kept + initial[len(kept) :]
    old, new = had.get(name), has.get(name)
    if old == new or new in WIDER.get(old or "", ()):
        return before
    is_longer_text = old is not None and new is not None and "STRING" in old and len(old) <= len(new) and old <= new
    return before if is_longer_text else initial


def built(folder: Path, text: str, base: SymbolTable | None = None, target: str | None = None) -> BuildResult:
    """The program as `build` makes it."""
    file = folder / "program.st"
    file.write_text(text)
    request = BuildRequest(program_files([file]), base=base, target=target)
    return build(request)
