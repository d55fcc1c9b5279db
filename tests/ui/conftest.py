"""A page of `plctool ui`, and a browser of it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from page_browsers import Browser, Page

PROGRAM = """
TYPE Mode : (Off, Automatic, Manual); END_TYPE
TYPE Point : STRUCT x : INT; y : LREAL; END_STRUCT END_TYPE
VAR_GLOBAL CONSTANT LIMIT : INT := 7; END_VAR
PROGRAM Main
VAR
    n : DINT; still : INT := 5; lamp : BOOL; mode : Mode := Automatic; text : STRING := '<b>bold</b>';
    point : Point; list : ARRAY[1..1000] OF INT; next : POINTER TO INT; divisor : DINT := 1; ratio : DINT;
END_VAR
n := n + 1;
IF next = 0 THEN next := ADR(still); END_IF
ratio := 100 / divisor;
END_PROGRAM
CONFIGURATION Config RESOURCE Res ON PLC
    TASK Fast(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH Fast : Main;
END_RESOURCE END_CONFIGURATION
"""


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With app.st, app.cdl and its symbols."""
    made = tmp_path_factory.mktemp("page")
    (made / "app.st").write_text(PROGRAM)
    command = [sys.executable, "-m", "plctool", "build", "app.st", "-o", "app.cdl"]
    subprocess.run(command, cwd=made, check=True, capture_output=True)
    return made


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Page]:
    """The page of a simulator."""
    shown = Page(folder, "--sim", "app.cdl")
    yield shown
    assert shown.end() == 0


@pytest.fixture
def browser(page: Page) -> Iterator[Browser]:
    made = Browser(page)
    with made.socket:
        yield made.ready()
