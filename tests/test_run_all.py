"""`make test` repeats what failed, alone, and does not call a test broken that passes then."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from run_all import ROOT, Done, Job, command_of, most_used, processes, repeat, repetition, run

FOLDER = ROOT / "tests" / "c"  # below tests, but in none of the suites that run beside this one


@pytest.fixture
def test_file() -> Iterator[Path]:
    """A file among the tests, so that pytest names its tests as it names those of the repository."""
    file = FOLDER / "test_made_by_test_run_all.py"
    yield file
    file.unlink(missing_ok=True)


def job_of(test_file: Path, folder: Path) -> Job:
    report = folder / "report.xml"
    command = [sys.executable, "-m", "pytest", str(test_file), f"--junit-xml={report}"]
    return Job("made", command, 1, 60.0, report, folder / "output.txt", str(ROOT))


def failed_of(job: Job) -> Done:
    (done,) = run([job], 1)
    assert not done.is_good
    return done


def test_a_test_that_passes_alone_is_flaky(test_file: Path, tmp_path: Path) -> None:
    marker = tmp_path / "marker"
    test_file.write_text(
        "import pathlib, pytest\n"
        f"marker = pathlib.Path({str(marker)!r})\n"
        "def test_good():\n    assert not marker.exists()\n"
        "@pytest.mark.parametrize('x', ['a b', 'c[d]'])\n"
        "def test_second_time(x):\n"
        "    known = marker.read_text() if marker.exists() else ''\n"
        "    marker.write_text(known + x)\n"
        "    assert x in known\n"
    )
    done = failed_of(job_of(test_file, tmp_path))
    assert len(done.outcome.failures) == 2
    assert [passed for _, passed in repeat([done])] == [True]  # test_good would fail now: it is not repeated


def test_a_test_that_fails_again_is_broken(test_file: Path, tmp_path: Path) -> None:
    test_file.write_text("class TestIt:\n    def test_bad(self):\n        assert False\n")
    done = failed_of(job_of(test_file, tmp_path))
    assert done.outcome.failed == [f"{test_file.relative_to(ROOT)}::TestIt::test_bad"]
    assert [passed for _, passed in repeat([done])] == [False]


def test_a_job_that_does_not_say_what_failed_is_repeated_as_a_whole(test_file: Path, tmp_path: Path) -> None:
    test_file.write_text("import os\nos._exit(3)\n")
    done = failed_of(job_of(test_file, tmp_path))
    assert repetition(done) == done.job


def test_of_the_c_tests_those_that_failed_are_repeated_by_name(tmp_path: Path) -> None:
    report = tmp_path / "testlog.json"
    report.write_text(
        '{"name": "c - plctool:app_life", "result": "OK"}\n{"name": "c - plctool:comm_srv", "result": "FAIL"}\n'
    )
    job = Job("build c", ["meson", "test", "-C", "build", "--suite", "c"], 1, 60.0, report, tmp_path / "c.txt")
    assert repetition(Done(job, 1, 0.0, 0.0)).command == ["meson", "test", "-C", "build", "comm_srv"]


def target_test(name: str, priority: int = 5, **env: str) -> dict[str, Any]:
    command = ["python", "-m", "pytest", f"test_{name}.py", f"--junit-xml={name}.xml"]
    return {"name": name, "suite": ["x:python", "x:target"], "priority": priority, "cmd": command, "env": env}


def test_short_tests_of_a_board_with_the_same_environment_are_one_process(tmp_path: Path) -> None:
    tests = [target_test("a"), target_test("long", 50), target_test("b"), target_test("c", FIRMWARE_CONFIG="full")]
    commands = [command_of(group, tmp_path / "report.xml") for group in processes(tests)]
    assert [[word for word in command if word.startswith("test_")] for command in commands] == [
        ["test_a.py", "test_b.py"],
        ["test_long.py"],
        ["test_c.py"],
    ]
    assert commands[0][-1] == f"--junit-xml={tmp_path / 'report.xml'}"


def test_the_tests_that_take_most_of_the_processors_are_known(test_file: Path, tmp_path: Path) -> None:
    busy = "import subprocess, sys, time\nWORK = 'import time\\nwhile time.process_time() < 0.3: pass'\n"
    own = "def test_own():\n    end = time.process_time() + 0.15\n    while time.process_time() < end: pass\n"
    child = "def test_child():\n    subprocess.run([sys.executable, '-c', WORK], check=True)\n"
    test_file.write_text(f"{busy}def test_waits():\n    time.sleep(0.3)\n{own}{child}")
    (done,) = run([job_of(test_file, tmp_path)], 1)
    most = most_used(done.outcome.used)
    assert [name.rpartition("::")[2] for _, name in most] == ["test_child", "test_own", "test_waits"]
    assert most[0][0] >= 0.25 > most[1][0] >= 0.1 > most[2][0]
