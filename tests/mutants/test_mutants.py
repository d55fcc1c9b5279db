"""The mutants of the firmware's checks die, and those that cannot are listed with the reason."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from mutate import Mutator  # noqa: E402
from run import EQUIVALENT, FILES, ROOT, equivalents, files  # noqa: E402

# A file whose mutants die by fast tests that `meson test` builds without sanitizers.
QUICK = "load/IoConfigCheck"
QUICK_TESTS = "io_(bounds|refused)|app_unreadable"


def changes(source: str) -> set[str]:
    return {mutant.change for mutant in Mutator(source.encode()).mutants}


def test_a_bound_is_moved_by_one_to_either_side() -> None:
    assert changes("void f(int a) { int b = a < 3; }") == {"f: a < 3 -> a <= 3", "f: a < 3 -> a < 3 - 1"}


def test_each_operand_of_a_condition_is_dropped() -> None:
    assert changes("void f(int a, int b) { if (a && !b) g(); }") == {
        "f: a && !b -> true",
        "f: a && !b -> false",
        "f: a -> true",
        "f: !b -> true",
    }


def test_an_error_becomes_success() -> None:
    assert changes("RTS_RESULT f(void) { return g(); }") == {"f: return g(); -> return ERR_OK;"}


def test_an_error_behind_a_condition_is_dropped_with_it() -> None:
    assert changes("RTS_RESULT f(int a) { if (a) return ERR_FAILED; return ERR_OK; }") == {
        "f: a -> true",
        "f: a -> false",
    }


def test_constants_of_a_configuration_have_no_mutants() -> None:
    assert changes("enum { A = 1 < 2 }; static int b[3 < 4]; void f(void) { if (SIZE > 0) g(); }") == set()


def test_a_choice_of_the_smaller_one_is_the_same_at_equality() -> None:
    assert "f: a < b -> a <= b" not in changes("int f(int a, int b) { return a < b ? a : b; }")
    assert "f: a < b -> a <= b" not in changes("void f(int a, int b) { if (a < b) a = b; }")
    assert "f: a < b -> a <= b" in changes("void f(int a, int b) { if (a < b) a = 1; }")


PROGRAM = """
#include <assert.h>
static int is_digit(int c) { return c >= '0' && c <= '9'; }
int main(void) { assert(is_digit('0')); assert(!is_digit('/')); assert(is_digit('5')); return 0; }
"""


@pytest.mark.parametrize(("number", "lives"), [(0, True), (1, False), (2, False), (4, True)])
def test_the_number_chooses_the_mutant_that_runs(tmp_path: Path, number: int, lives: bool) -> None:
    mutator = Mutator(PROGRAM.encode())
    (tmp_path / "program.c").write_bytes(mutator.text)
    names = [str(tmp_path / "program.c"), str(HERE / "switch.c"), "-o", str(tmp_path / "program")]
    count = f"-DMUTANTS={len(mutator.mutants)}"
    subprocess.run(["cc", "-w", count, "-include", str(HERE / "switch.h"), *names], check=True)
    done = subprocess.run([tmp_path / "program"], env={"MUTANT": str(number)}, capture_output=True, check=False)
    assert (done.returncode == 0) == lives, mutator.mutants


@pytest.mark.parametrize("file", files())
def test_each_equivalent_mutant_is_one_of_the_source(file: str) -> None:
    assert equivalents(file).keys() <= changes((ROOT / file).read_text()), f"copy the names again to {EQUIVALENT}"


@pytest.mark.parametrize("file", files())
def test_the_parser_understands_every_function(file: str) -> None:
    assert Mutator((ROOT / file).read_bytes()).unread == [], f"see LOOPS of mutate.py, or leave it out of {FILES}"


def test_no_mutant_of_a_sample_lives() -> None:
    which = ["--only", QUICK, "--tests", QUICK_TESTS, "--sample", "30"]
    command = [sys.executable, str(HERE / "run.py"), "--built", *which]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert ": 30 mutants, 0 live" in done.stdout
