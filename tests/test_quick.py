"""`make quick` chooses the tests nearest to a change."""

from __future__ import annotations

from pathlib import Path

import pytest
from quick import C_TEST_S, choose, within


@pytest.mark.parametrize(
    ("changed", "test"),
    [
        ("tests/link/test_can.py", "tests/link/test_can.py"),
        ("host/plctool/link/simplecom.py", "tests/link/test_serial.py"),
        ("firmware/src/core/CmpLog.c", "tests/c/test_core_log.c"),
        ("firmware/include/CmpSrvNumbers.h", "tests/link/test_services.py"),
    ],
)
def test_a_test_that_uses_what_changed_is_chosen(changed: str, test: str) -> None:
    assert Path(test) in list(choose([Path(changed)]))


def test_tests_that_import_the_module_come_before_those_that_import_its_users() -> None:
    chosen = list(dict.fromkeys(choose([Path("host/plctool/link/names.py")])))
    assert chosen.index(Path("tests/link/test_scans.py")) < chosen.index(Path("tests/cli/test_devices.py"))


def test_a_document_needs_none() -> None:
    assert list(choose([Path("docs/can.md")])) == []


def test_what_does_not_fit_the_time_is_left_out() -> None:
    files = [Path(f"tests/c/test_{name}.c") for name in "abc"]
    assert within(files, 2.5 * C_TEST_S) == (files[:2], files[2:])
