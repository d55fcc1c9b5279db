"""TEST blocks as tests of pytest."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import plctool_commands
import pytest

from plctool.templates import new_project

TESTS = """TEST 'counts by one'
VAR c : Counter; END_VAR
c();
ASSERT_EQ(c.n, 1);
END_TEST
TEST 'counts by two'
VAR c : Counter; END_VAR
c();
ASSERT_EQ(c.n, 2, 'so far');
END_TEST
"""
COUNTER = "FUNCTION_BLOCK Counter VAR_OUTPUT n : INT; END_VAR n := n + 1; END_FUNCTION_BLOCK\n"
PYTHON = """from plctool import Simulator
def test_in_python():
    with Simulator.from_sources("counter.st", "main.st") as plc:
        plc.run_for(ms=10)
        assert plc.read("Main.c.n") == 1
"""


WORDS = ["-p", "plctool.pytest_plugin", "-p", "no:cacheprovider", "-v"]
ALONE = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # where plctool is installed, the plugin would be loaded twice


def run_pytest(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return plctool_commands.run_pytest([*WORDS, *options], folder, os.environ | ALONE, timeout=120)


@pytest.fixture
def project(scratch: Path) -> Path:
    (scratch / "counter.st").write_text(COUNTER)
    (scratch / "main.st").write_text("PROGRAM Main VAR c : Counter; END_VAR c(); END_PROGRAM")
    (scratch / "tests.st").write_text(TESTS)
    return scratch


def test_they_run_beside_tests_in_python_and_failures_show_their_line(project: Path) -> None:
    (project / "test_counter.py").write_text(PYTHON)
    command, env = [sys.executable, "-m", "pytest", *WORDS], os.environ | ALONE
    done = subprocess.run(command, cwd=project, env=env, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    assert "tests.st::counts by one PASSED" in done.stdout
    assert "tests.st::counts by two FAILED" in done.stdout
    assert "test_counter.py::test_in_python PASSED" in done.stdout
    assert "tests.st:9: ASSERT_EQ: expected 2, got 1 (so far)\n    ASSERT_EQ(c.n, 2, 'so far');" in done.stdout
    assert "1 failed, 2 passed" in done.stdout


def test_they_are_chosen_like_other_tests(project: Path) -> None:
    assert run_pytest(project, "-k", "one", "tests.st").returncode == 0
    assert run_pytest(project, "tests.st::counts by one").returncode == 0


def test_sources_of_other_folders_are_named_in_the_configuration(project: Path) -> None:
    (project / "unit").mkdir()
    (project / "tests.st").rename(project / "unit" / "tests.st")
    assert "Counter" in run_pytest(project, "-k", "one").stdout  # not found
    (project / "pytest.ini").write_text("[pytest]\nplc_sources =\n    counter.st\n    unit\n")
    assert run_pytest(project, "-k", "one").returncode == 0


def test_errors_of_the_compiler_are_errors_of_the_collection(project: Path) -> None:
    (project / "counter.st").write_text(COUNTER.replace("n := n", "n := m"))
    done = run_pytest(project)
    assert done.returncode == 2
    assert re.search(r"counter\.st:1:\d+: error: .*\bm\b", done.stdout) and "Traceback" not in done.stdout


@pytest.mark.parametrize("template", ["minimal", "io", "library"])
def test_program_of_a_test_is_the_project_that_has_it(tmp_path: Path, template: str) -> None:
    new_project(tmp_path / "pump", template)
    done = run_pytest(tmp_path)
    assert "1 passed" in done.stdout, done.stdout


PROJECT = "sources = ['src']\n[options]\ndialect = 'codesys'\n"
LIMIT = """TEST 'limit of a FOR is looked at each time'
VAR i, n, k : INT; END_VAR
n := 3;
FOR i := 1 TO n DO n := 5; k := k + 1; END_FOR
ASSERT_EQ(k, 5);
END_TEST
"""


@pytest.fixture
def pump(scratch: Path) -> Path:
    """A folder with a project, whose sources are in a folder of their own."""
    (scratch / "src").mkdir()
    (scratch / "plc.toml").write_text(PROJECT)
    (scratch / "src" / "main.st").write_text("PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM\n" + LIMIT)
    return scratch


def test_a_file_beside_the_project_that_is_none_of_its_sources_is_collected(pump: Path) -> None:
    (pump / "smoke.st").write_text("TEST 'smoke' ASSERT_EQ(1, 1); END_TEST\n")
    assert "2 passed" in run_pytest(pump).stdout


@pytest.mark.parametrize("named", ["", "plc_sources = ."])
def test_the_dialect_is_that_of_the_project(pump: Path, named: str) -> None:
    (pump / "pytest.ini").write_text(f"[pytest]\n{named}\n")
    done = run_pytest(pump)
    assert "1 passed" in done.stdout, done.stdout


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        ("TEST 'a' ASSERT_EQ(1, 1); END_TEST", "utf-8-sig"),
        ("TEST 'a' ASSERT_EQ(1, 1); END_TEST", "utf-16"),
        ("{warning 'none'} TEST 'a' ASSERT_EQ(1, 1); END_TEST", "utf-8"),
        ("test'a' ASSERT_EQ(1, 1); END_TEST", "utf-8"),
    ],
)
def test_a_test_is_found_however_it_is_written(scratch: Path, text: str, encoding: str) -> None:
    (scratch / "only.st").write_text(text, encoding)
    done = run_pytest(scratch)
    assert "1 passed" in done.stdout, done.stdout


@pytest.mark.parametrize("before", ["(* why *) ", "// why\n/* and how */ ", "{attribute 'x'} (* a (* b *) *) "])
@pytest.mark.parametrize("between", [" ", " (* of it *) "])
def test_a_test_after_a_comment_is_found(project: Path, before: str, between: str) -> None:
    (project / "tests.st").write_text(f"{before}TEST{between}'alone'\nASSERT_TRUE(TRUE);\nEND_TEST\n")
    assert "tests.st::alone PASSED" in run_pytest(project).stdout


def test_a_test_in_a_comment_is_none(project: Path) -> None:
    (project / "tests.st").write_text("(* as in\n   (* nested *) x TEST 'alone' *)\n")
    assert run_pytest(project).returncode == 5  # no tests
