"""A program and a page.toml for operators, with an element of each kind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = """
TYPE Mode : (Off, Automatic, Manual); END_TYPE
TYPE Tank : STRUCT level : REAL := 42.256; END_STRUCT END_TYPE
VAR_GLOBAL CONSTANT LIMIT : INT := 7; END_VAR
PROGRAM Main
VAR
    n : DINT; tanks : ARRAY[1..2] OF Tank; lamp : BOOL; mode : Mode := Automatic; text : STRING := '<b>bold</b>';
    alarms : ARRAY[1..3] OF BOOL := [FALSE, TRUE, FALSE]; manual : REAL := 10.0; wanted : INT := 50; hidden : INT := 1;
    start_now : BOOL; starts : DINT; edge : R_TRIG; auto : BOOL; recipe : INT;
    fire : ALARM := (Text := '<b>Fire</b>');
END_VAR
n := n + 1;
edge(CLK := start_now);
IF edge.Q THEN starts := starts + 1; END_IF
lamp := auto;
fire(Condition := auto);
END_PROGRAM
CONFIGURATION Config RESOURCE Res ON PLC
    TASK Fast(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH Fast : Main;
END_RESOURCE END_CONFIGURATION
"""
ELEMENTS = """
[[element]]
kind = "value"
variable = "Main.tanks[1].level"
text = "<i>Level</i>"
unit = "%"
decimals = 1
colours = [{ above = 40, colour = "red" }]

[[element]]
kind = "bar"
variable = "Main.tanks[2].level"
low = 0
high = 100

[[element]]
kind = "lamp"
variable = "Main.lamp"
words = { TRUE = "runs", FALSE = "stands" }

[[element]]
kind = "button"
variable = "Main.start_now"
text = "Start"

[[element]]
kind = "button"
variable = "Main.auto"
text = "On"
mode = "toggle"

[[element]]
kind = "button"
variable = "Main.recipe"
text = "Recipe 3"
mode = "set"
value = 3

[[element]]
kind = "slider"
variable = "Main.manual"
low = 0
high = 20
step = 1

[[element]]
kind = "setpoint"
variable = "Main.wanted"
text = "Wanted"
low = 0
high = 60

[[element]]
kind = "setpoint"
variable = "Main.mode"

[[element]]
kind = "trend"
rows = [{ variable = "Main.tanks[1].level", text = "Level" }, { variable = "Main.lamp" }]

[[element]]
kind = "list"
text = "Alarms"
only_true = true
rows = [{ variable = "Main.alarms", text = "Alarm" }]

[[element]]
kind = "picture"
file = "plant.svg"
places = [
    { variable = "Main.text", x = 25, y = 50 },
    { variable = "Main.lamp", x = 75, y = 50, kind = "lamp" },
]

[[element]]
kind = "alarms"
text = "All alarms"
"""
KINDS = (
    "value",
    "bar",
    "lamp",
    "press",
    "toggle",
    "set",
    "slider",
    "setpoint",
    "choice",
    "trend",
    "list",
    "picture",
    "alarms",
)
"""A name for each element, in this order."""
HEAD = 'title = "Plant <b>1</b>"\noperate = {operate}\n'
PICTURE = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 50"><rect width="100" height="50" fill="#ccd"/></svg>'
)


def make_folder(folder: Path) -> Path:
    """Makes plant.cdl and plant.sym, operate.toml, view.toml and the picture."""
    (folder / "plant.st").write_text(PROGRAM)
    (folder / "plant.svg").write_text(PICTURE)
    (folder / "operate.toml").write_text(HEAD.format(operate="true") + ELEMENTS)
    (folder / "view.toml").write_text(HEAD.format(operate="false") + ELEMENTS)
    command = [sys.executable, "-m", "plctool", "build", "plant.st", "-o", "plant.cdl"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder
