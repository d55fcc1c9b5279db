"""Each file of tests on a target is in the list of those that Meson runs."""

from __future__ import annotations

from test_firmware_layers import FIRMWARE

TESTS = FIRMWARE.parent / "tests/target"


def test_all_tests_of_targets_are_run() -> None:
    build = (TESTS / "meson.build").read_text()
    names = {path.stem.removeprefix("test_") for path in TESTS.glob("test_*.py")}
    assert {name for name in names if f"'{name}'" not in build} == set()
    assert len(names) > 20
