"""What stands in for libraries of other systems: its tests in ST, and that there is one for each of its names."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import Tool

from plctool.compiler.sources.imports import words_of
from plctool.compiler.syntax.library import standard_library

FOLDER = Path(__file__).parent / "stand_ins"
WORDS = words_of("\n".join(file.read_text() for file in FOLDER.glob("*.st")))
FILES = [
    f"stdlib/{name}.st"
    for name in ("util", "caa_memory", "fastwel_utils", "oscat_strings", "string_utils", "tc2_system", "tc2_utilities")
]
NAMES = [entry.name for file in FILES for entry in standard_library().defined_in(file)]


def test_stand_ins_pass_their_tests(tool: Tool) -> None:
    status, said = tool("test", str(FOLDER))
    assert status == 0, said


@pytest.mark.parametrize("name", NAMES)
def test_every_stand_in_is_tested(name: str) -> None:
    assert name.casefold() in WORDS
