"""Builds in a process that stays have the images, symbols and messages of builds of their own, and compile what has
changed only."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.compiler import build, program_files
from plctool.compiler.front import Trees
from plctool.compiler.kept.kept_build import KeptBuild
from plctool.compiler.sources.request import BuildRequest
from plctool.compiler.syntax.diagnostics import CompileError
from plctool.debug.symbols import SymbolTable

PROGRAMS = Path(__file__).parents[1] / "st"
EDITS = 60
EDITS_OF_A_PROGRAM = 4

MOTOR = """INTERFACE Switch
METHOD On : BOOL
VAR_INPUT speed : INT; END_VAR
END_METHOD
END_INTERFACE
FUNCTION_BLOCK Motor IMPLEMENTS Switch
VAR_INPUT enable : BOOL; END_VAR
VAR_OUTPUT hours : REAL; name : STRING[20]; END_VAR
VAR t : TON; n, unused : INT; last : ARRAY[0..3] OF INT; END_VAR
METHOD On : BOOL
VAR_INPUT speed : INT; END_VAR
VAR i : INT; END_VAR
i := speed + n;
On := i > 3;
END_METHOD
t(IN := enable, PT := T#50ms);
IF t.Q AND enable THEN
    n := n + 1;
    last[n MOD 4] := n;
END_IF;
hours := hours + 0.5;
name := CONCAT('motor', INT_TO_STRING(n));
n := Limited(n);
END_FUNCTION_BLOCK
"""
FILES = {
    "limited.st": "FUNCTION Limited : INT\nVAR_INPUT x : INT; END_VAR\nIF x > 100 THEN\n    Limited := 0;\nELSE\n"
    "    Limited := x;\nEND_IF;\nEND_FUNCTION\n",
    "motor.st": MOTOR,
    "globals.st": "VAR_GLOBAL count : DINT; limit : DINT := 9; END_VAR\nTYPE Mode : (Off, Slow, Fast); END_TYPE\n",
    "main.st": "PROGRAM Main\nVAR a, b : Motor; s : Switch; mode : Mode; i : INT; x : LREAL; END_VAR\n"
    "a(enable := mode = Mode.Slow);\nb(enable := a.hours > 1.0);\ns := a;\nIF s.On(speed := i) THEN\n    i := i + 1;\n"
    "END_IF;\nFOR i := 0 TO 5 DO\n    x := x * 1.5 + i;\nEND_FOR;\ncount := count + 1;\nEND_PROGRAM\n",
}
LINES = {
    "limited.st": ["Limited := x / 3;", "x := x + 1;", "IF x < 0 THEN RETURN; END_IF;"],
    "motor.st": ["n := n - 2;", "unused := n;", "hours := 0.0;", "name := 'stopped';", "n := Limited(n) * 2;",
                 "last[0] := last[1];", "(* nothing *)", "t(IN := FALSE);", "n := absent;"],
    "main.st": ["i := i * 3;", "x := x - 1.0;", "count := limit;", "a.enable := TRUE;", "i := a.On(speed := 2);",
                "b(enable := FALSE);", "mode := Mode.Fast;", "i := Limited(i);", "VAR y : INT; END_VAR"],
}  # fmt: skip

Result = tuple[bytes, str, list[str]] | str


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small programs are cut as large ones are, and compiled in this process."""
    monkeypatch.setattr("plctool.compiler.codegen.partition._WHOLE", 40)
    monkeypatch.setattr("plctool.compiler.codegen.partition._GROUP", 100)
    monkeypatch.setattr("plctool.compiler.codegen.partition._COPIED", 30)
    monkeypatch.setattr("os.cpu_count", lambda: 1)


class Resident:
    """Builds a program again and again, and compares each build with one of its own."""

    def __init__(self, path: Path, **options: object) -> None:
        self._path = path
        self._options = options
        self.kept = KeptBuild(Trees())
        self.base: SymbolTable | None = None
        self.symbols: SymbolTable | None = None

    @property
    def is_kept(self) -> bool:
        """True if the last build has compiled only what has changed."""
        return self.kept.changed is not None

    def compare(self) -> Result:
        """Builds once more; returns what has come of it."""
        mine, fresh = self._built(self.kept), self._built(None)
        assert mine == fresh
        return mine

    def _built(self, kept: KeptBuild | None) -> Result:
        request = BuildRequest(program_files([self._path]), base=self.base, **self._options)  # type: ignore[arg-type]
        try:
            result = build(request, kept=kept)
        except CompileError as error:
            return error.message
        self.symbols = result.symbols
        return result.image, repr(result.symbols.to_json()), result.rendered_warnings


def _edit(text: str, lines: list[str], rng: random.Random) -> str:
    """Changes, adds, doubles or deletes one line of a text, most often among its statements."""
    old = text.split("\n")
    at = rng.randrange(max(0, len(old) - 12), len(old) - 1)
    kind = rng.randrange(5)
    if kind == 0:
        old[at] = "".join(str(rng.randrange(1, 9)) if c.isdigit() else c for c in old[at])
    elif kind == 1:
        old.insert(at, old[at])
    elif kind == 2:
        del old[at]
    else:
        old.insert(at, rng.choice(lines))
    return "\n".join(old)


@pytest.mark.parametrize("options", [{}, {"target": "cortex-m3", "level": "s"}, {"level": 0, "debug": True}])
@pytest.mark.usefixtures("small_parts")
def test_after_random_edits_builds_are_as_fresh_ones(folder: Path, options: dict[str, object]) -> None:
    rng, resident, kept = random.Random(1), Resident(folder, **options), 0
    resident.compare()
    for _ in range(EDITS):
        name = rng.choice(list(LINES))
        before = (folder / name).read_text()
        (folder / name).write_text(_edit(before, LINES[name], rng))
        found = resident.compare()
        kept += resident.is_kept
        if isinstance(found, str):  # it has errors
            (folder / name).write_text(before)
            resident.compare()
        resident.base = resident.symbols if rng.randrange(3) else None
    assert kept > EDITS / 20


def _programs(rng: random.Random) -> Iterator[Path]:
    files = sorted(PROGRAMS.rglob("*.st"))
    return (rng.choice(files) for _ in range(EDITS // EDITS_OF_A_PROGRAM))


def test_after_edits_of_programs_of_all_kinds_builds_are_as_fresh_ones(tmp_path: Path) -> None:
    rng, kept = random.Random(2), 0
    for file in _programs(rng):
        copy = tmp_path / file.name
        original = file.read_bytes().decode("utf-8", "replace")
        copy.write_text(original)
        resident = Resident(copy)
        if not isinstance(resident.compare(), str):
            for _ in range(EDITS_OF_A_PROGRAM):
                copy.write_text(_edit(original, ["RETURN;", "", "(* nothing *)"], rng))
                resident.compare()
                kept += resident.is_kept
        copy.unlink()
    assert kept


def _with_line(folder: Path, name: str, after: str, line: str) -> None:
    text = (folder / name).read_text()
    (folder / name).write_text(text.replace(after, f"{after}\n{line}", 1))


@pytest.mark.parametrize(
    ("after", "line"),
    [("    n := n + 1;", "    n := n - 3;"), ("hours := hours + 0.5;", "last[2] := n;"), ("END_IF;", "// nothing")],
)
def test_changed_statements_of_a_unit_are_compiled_alone(folder: Path, after: str, line: str) -> None:
    resident = Resident(folder)
    resident.compare()
    _with_line(folder, "motor.st", after, line)
    resident.compare()
    assert [pou.name for pou in resident.kept.changed or ()] == ["Motor"]


@pytest.mark.parametrize(
    ("name", "after", "line"),
    [
        ("motor.st", "    n := n + 1;", "unused := 1;"),
        ("motor.st", "    n := n + 1;", "name := LEFT(name, 3);"),
        ("motor.st", "i := speed + n;", "i := i + 1;"),
        ("main.st", "s := a;", "count := limit;"),
        ("main.st", "VAR", "y : INT;"),
        ("globals.st", "VAR_GLOBAL", "other : INT;"),
    ],
)
def test_what_may_change_others_is_compiled_as_a_whole(folder: Path, name: str, after: str, line: str) -> None:
    resident = Resident(folder)
    resident.compare()
    _with_line(folder, name, after, line)
    resident.compare()
    assert not resident.is_kept


def test_changes_of_several_files_are_compiled_alone(folder: Path) -> None:
    resident = Resident(folder)
    resident.compare()
    _with_line(folder, "motor.st", "    n := n + 1;", "    n := n - 3;")
    _with_line(folder, "limited.st", "    Limited := 0;", "    x := x - 1;")
    resident.compare()
    assert {pou.name for pou in resident.kept.changed or ()} == {"Motor", "Limited"}


def test_after_a_build_with_errors_the_next_one_is_right(folder: Path) -> None:
    resident = Resident(folder)
    good = resident.compare()
    text = (folder / "motor.st").read_text()
    for wrong in ("n := absent;", "n := 'text';", "IF n THEN"):
        (folder / "motor.st").write_text(text.replace("n := Limited(n);", wrong))
        assert isinstance(resident.compare(), str)
        (folder / "motor.st").write_text(text)
        assert resident.compare() == good


def test_other_options_are_another_build(folder: Path) -> None:
    resident = Resident(folder)
    resident.compare()
    resident._options["level"] = 0
    resident.compare()
    assert not resident.is_kept


def test_program_that_replaces_another_one_than_the_last_is_compiled_as_a_whole(folder: Path) -> None:
    resident = Resident(folder)
    resident.compare()
    first = resident.symbols
    _with_line(folder, "motor.st", "    n := n + 1;", "    n := n - 3;")
    resident.base = first
    resident.compare()
    assert resident.is_kept
    resident.base = first
    resident.compare()
    assert not resident.is_kept
