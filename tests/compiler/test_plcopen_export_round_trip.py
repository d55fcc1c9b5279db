"""PLCopen XML out and in again gives the same image, for every example and programs of tests/st.

So does the file without the plain text of the declarations, as systems read it that know only the elements of the
standard, unless the export named what they will not see.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from shares import share
from test_st_programs import PROGRAMS, build, read_script, runs

from plctool.compiler import IoFiles, check_with_tests, program_files
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower_unit import Options, parse_checks
from plctool.compiler.formats.plcopen import read_project
from plctool.compiler.front import CheckResult, check_sources, declared_names_asked_for
from plctool.compiler.image.build import build_program
from plctool.compiler.plcopen_export.inferred import with_types
from plctool.compiler.plcopen_export.project import Written, write_project
from plctool.compiler.syntax.library import standard_library
from plctool.image.targets import DEFAULT_TARGET, find_target

_ROOT = Path(__file__).parents[2]
EXAMPLES = sorted(path for path in (_ROOT / "examples").iterdir() if any(path.rglob("*.st")))
SYSTEMS = [_ROOT / "tests/corpus" / system for system in ("codesys", "openplc", "twincat")]
CORPUS = [path for system in SYSTEMS for path in sorted(system.iterdir())]
ALL_RUNNING = [path for path in PROGRAMS if runs(read_script(path))]
RUNNING = share(ALL_RUNNING, 4)
OPTIONS = Options(find_target(DEFAULT_TARGET), 0, parse_checks("all"))
PLAIN = re.compile(r'<data name="[^"]*interfaceasplaintext".*?</data>', re.DOTALL)
ASKS_FOR_ITS_PLACE = "__POSITION"  # of which the place in the XML is another one
ACTIONS_COME_FIRST = ("building",)  # PLCopen XML has them before methods, so parts of the image are in another order


def exported(sources: list[Source]) -> Written:
    return write_project(sources, "p", declared_names_asked_for(standard_library(), (), sources))


@cache
def exported_program(path: Path) -> Written:
    return exported(program_files([path]).load_sources())


def image_of(result: CheckResult) -> bytes:
    assert result.program is not None, "\n".join(f"{d.line}: {d.message}" for d in result.diagnostics)
    return build_program(result.program, OPTIONS).image


@pytest.mark.parametrize("path", RUNNING, ids=lambda p: p.stem)
def test_program(path: Path) -> None:
    written = exported_program(path)
    assert written.ok
    image = build(path, 0, "all").image
    again = check_sources(read_project("p.xml", written.text))
    if ASKS_FOR_ITS_PLACE in path.read_text("utf-8"):
        assert again.ok
        return
    assert image_of(again) == image
    if not written.diagnostics:
        assert image_of(check_sources(read_project("p.xml", PLAIN.sub("", written.text)))) == image


@pytest.mark.parametrize("path", [*EXAMPLES, *CORPUS], ids=lambda p: p.stem)
def test_project(path: Path) -> None:
    files = program_files([path])
    sources = files.load_sources()
    original = check_with_tests(sources, load=files.load_io)
    assert original.program is not None
    written = exported(with_types(sources, original.program.inferred))
    assert written.ok
    again = check_sources(read_project("p.xml", written.text), io=program_files([path], IoFiles()).load_io())
    if path.stem in ACTIONS_COME_FIRST:
        assert len(image_of(again)) == len(image_of(original))
    else:
        assert image_of(again) == image_of(original)


def test_a_task_without_priority_keeps_the_lowest() -> None:
    program = "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM\n"
    task = "CONFIGURATION C TASK T(INTERVAL := T#1ms); PROGRAM P WITH T : Main; END_CONFIGURATION\n"
    sources = [Source("a.st", program + task)]
    written = exported(sources)
    assert not written.diagnostics
    standard = PLAIN.sub("", written.text)
    assert standard != written.text
    assert image_of(check_sources(read_project("p.xml", standard))) == image_of(check_sources(sources))


def test_a_priority_that_is_a_constant_is_named_as_lost() -> None:
    program = "VAR_GLOBAL CONSTANT HIGH : INT := 3; END_VAR PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM\n"
    task = "CONFIGURATION C TASK T(INTERVAL := T#1ms, PRIORITY := HIGH); PROGRAM P WITH T : Main; END_CONFIGURATION\n"
    written = exported([Source("a.st", program + task)])
    assert "PRIORITY" in " ".join(d.message for d in written.diagnostics)
    assert 'priority="31"' in written.text


def test_globals_of_a_file_with_units_keep_their_names(tmp_path: Path) -> None:
    program = "PROGRAM Main hours := hours + 1; units.days := GVL.years; END_PROGRAM\n"
    (tmp_path / "units.st").write_text(f"VAR_GLOBAL PERSISTENT hours : UDINT; days : INT; END_VAR {program}")
    (tmp_path / "GVL.st").write_text("VAR_GLOBAL PERSISTENT years : INT; END_VAR\n")
    sources = program_files([tmp_path]).load_sources()
    original = check_sources(sources)
    written = exported(sources)
    for _ in range(2):
        again = read_project("p.xml", written.text)
        assert image_of(check_sources(again)) == image_of(original)
        written = exported(again)


def test_few_programs_are_kept_as_text() -> None:
    """Of all of them: those of a share may be many by chance."""
    kept = [path for path in ALL_RUNNING if "SourceText" in exported_program(path).text]
    assert 0 < len(kept) < len(ALL_RUNNING) // 30
