"""A project to edit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from editor import Editor

FILES = {
    "plc.toml": 'sources = ["src"]\nlibraries = []\n',
    "src/types.st": """\
TYPE Color : (Red, Green, Blue); END_TYPE
TYPE Mode : (Off := 0, Slow := 1, Fast := 2) INT; END_TYPE
// A point in the plane.
TYPE Point :
STRUCT
    x : REAL; // from the left
    y : REAL;
END_STRUCT
END_TYPE
""",
    "src/globals.st": """\
VAR_GLOBAL
    gCount : DINT; // of parts
    gStart AT %IX0.0 : BOOL;
END_VAR
VAR_GLOBAL CONSTANT
    LIMIT_HIGH : INT := 100;
END_VAR
""",
    "src/pump.st": """\
INTERFACE IDrive
METHOD Start : BOOL
VAR_INPUT
    speed : INT;
END_VAR
END_METHOD
END_INTERFACE

(* Moves water.
   It needs a motor. *)
FUNCTION_BLOCK Pump IMPLEMENTS IDrive
VAR_INPUT
    enable : BOOL; // switches it on
    level : INT := 5;
END_VAR
VAR_OUTPUT
    running : BOOL;
END_VAR
VAR
    timer : TON;
    color : Color;
    place : Point;
    points : ARRAY[0..3] OF Point;
END_VAR
timer(IN := enable, PT := T#1s);
IF timer.Q THEN
    running := TRUE;
    color := Green;
    place.x := points[1].y;
END_IF;
METHOD Start : BOOL
VAR_INPUT
    speed : INT;
END_VAR
Start := speed > level;
END_METHOD
END_FUNCTION_BLOCK

FUNCTION_BLOCK BigPump EXTENDS Pump
VAR
    count : INT;
END_VAR
count := count + 1;
SUPER^();
END_FUNCTION_BLOCK
""",
    "src/main.st": """\
FUNCTION Scaled : INT
VAR_INPUT
    raw : INT;
    factor : INT;
END_VAR
Scaled := raw * factor;
END_FUNCTION

PROGRAM Main
VAR
    pump : Pump;
    big : BigPump;
    n : INT;
END_VAR
pump(enable := gStart, level := LIMIT_HIGH);
big(enable := pump.running);
n := Scaled(n, 3);
IF pump.Start(speed := n) THEN
    gCount := gCount + 1;
END_IF;
END_PROGRAM
CONFIGURATION Config
    TASK Quick(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH Quick : Main;
END_CONFIGURATION
""",
}


def write_project(folder: Path) -> Path:
    """Writes the project into a folder."""
    for name, text in FILES.items():
        file = folder / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project on disk."""
    return write_project(tmp_path)


@pytest.fixture(scope="module")
def _running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    with Editor(write_project(tmp_path_factory.mktemp("project"))) as session:
        yield session


@pytest.fixture
def editor(_running: Editor) -> Iterator[Editor]:
    """An editor with the project, in which no file is open. The tests of a module share it; files stay as they are."""
    yield _running
    for name in list(_running.texts):
        _running.shut(name)
