"""Every mistake in a description is reported with its line, and with what to do."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import messages

PROGRAM = """\
PROGRAM Main
VAR start, motor : BOOL; level : INT; power : REAL; pump : Pump; list : ARRAY[0..3] OF BOOL; END_VAR
VAR RETAIN total : INT; END_VAR
VAR CONSTANT limit : ARRAY[0..1] OF INT := [1, 2]; END_VAR
VAR raw AT %QW5 : INT; ready AT %Q* : BOOL; END_VAR
motor := start;
pump();
END_PROGRAM
FUNCTION_BLOCK Pump
VAR run : BOOL; END_VAR
run := NOT run;
END_FUNCTION_BLOCK
"""

DEVICE = """\
name = "IO-16"
[limits]
channels = 2
[gpio]
in = { DI0 = "PA5" }
out = { DO0 = "PC0" }
[[module]]
name = "Analog"
driver = "IoDrvAdc"
in = { AI0 = { type = "INT", parameter = 1 } }
[module.out]
DO = { type = "BYTE", parameter = 2 }
DO7 = { type = "BOOL", parameter = 2, bit = 7 }
DO8 = { type = "BOOL", parameter = 2, bit = 8 }
[module.parameter]
range = { id = 100, type = "USINT", choices = { low = 0, high = 1 } }
"""

MISTAKES = [
    # TOML
    ("[sim]\nin = { a = }", 2, "this is not TOML: invalid value; write true, false, a number, or a text in quotes"),
    ("[sim.in]\na = '%IX0.0'\na = '%IX0.1'\n", 3, "cannot overwrite a value: there is one of this name already"),
    ("[sim]\n[sim]\n", 2, "cannot declare ('sim',) twice; of several tables each has two brackets: [[sim]]"),
    ("[sim\n", 1, "this is not TOML: expected ']' at the end of a table declaration"),
    # tables and keys
    ("[gpoi]", 1, "there is no 'gpoi' here; did you mean gpio?"),
    ("[sim]\nnane = 'x'", 2, "there is no 'nane' here; did you mean name?"),
    ("[sim]\nzzz = 1", 2, "there is no 'zzz' here; [sim] has name, optional, enabled, task, in or out"),
    ("[sim]\nname = 3", 2, "name is a number; it has to be a text in quotes"),
    ("[sim]\nname = 'a b'", 2, "'a b' cannot be a variable; the name of a device is one of a variable"),
    ("[sim]\noptional = 1", 2, "optional is a number; it has to be true or false"),
    ("[sim]\nin = 3", 2, "in is a number; it has to be a table"),
    ("sim = 3", 1, "sim is a number; write a table [[sim]] for each"),
    ("[[sim]]\nname = 'A'\n[[sim]]\nname = 'a'", 4, "there is a device a in line 2 already; give it another name"),
    ("[[sim]]\n[[sim]]", 2, 'there is a device sim in line 1 already; give it a name: name = "..."'),
    ("device = 'none.toml'", 1, "there is no file "),
    ("[sim]\ntask = 'Fast'", 2, "there is no task Fast; the program has Main"),
    # channels
    ("[sim]\nin = { a = 1 }", 2, 'a needs the name of a variable: write for example a = "Main.start"'),
    ("[sim.in]\na = { vr = 'Main.start' }", 2, "[sim.in.a] needs var: write for example var = \"Main.start\""),
    ("[sim]\nin = { a = 'Main start' }", 2, "'Main start' is not a variable such as Main.start"),
    ("[sim]\nin = { a = '%IX0.9' }", 2, "%IX0.9 is not an address such as %IX0.3 or %IW2"),
    ("[sim]\nin = { a = '%QX0.0' }", 2, "%QX0.0 cannot be here: an input leads to %I"),
    ("[sim]\nin = { a = 'Main.strat' }", 2, "program Main has no strat; did you mean start?"),
    ("[sim]\nin = { a = 'Man.start' }", 2, "unknown name Man; did you mean Main?"),
    ("[sim.in]\na = 'Main.start'\nb = 'Main.START'", 3, "Main.START belongs to the channel a in line 2 already"),
    ("[sim]\nin = { a = 'Main.start' }\nout = { b = 'Main.start' }", 3, "Main.start belongs to the channel a in line"),
    ("[sim.in]\na = '%IW1'\nb = '%IX2.3'", 3, "%IX2.3 is where the channel a in line 2 leads to already"),
    ("[sim]\nin = { a = 'Main.total' }", 2, "Main.total is kept over a restart, which an input is not"),
    ("[sim]\nin = { a = 'Main.limit' }", 2, "Main.limit is a constant; name a variable"),
    ("[sim]\nin = { a = 'Main.pump' }", 2, "Main.pump is Pump, which cannot be an input; name a variable in it"),
    ("[sim]\nin = { a = 'Main.raw' }", 2, "Main.raw is at an address of the outputs, but a is an input"),
    ("[sim]\nin = { a = 'Main.ready' }", 2, "Main.ready is declared AT %Q*, but the channel a is an input"),
    ("[sim]\nin = { a = 'Main.list[7]' }", 2, "index 7 is outside 0..3"),
    ("[sim]\nin = { a = 'Main.level.3' }", 2, "'Main.level.3' is not a variable"),
    ("[sim]\nout = { a = { var = 'Main.level', on_stop = 'maybe' } }", 2, "on_stop: 'maybe' is not a value of INT"),
    ("[sim]\nout = { a = { var = 'Main.motor', on_stop = 'keep' } }", 2, 'write TRUE or FALSE, or "hold" or "zero"'),
    ("[sim.out.a]\nvar = 'Main.level'\non_stop = 70000\n", 3, "on_stop: '70000' is not a value of INT"),
    ("[sim]\nout = { a = { var = 'Main.motor', on_stop = [1] } }", 2, 'on_stop can be "hold", "zero" or a value'),
    ("[sim]\nin = { a = { var = 'Main.start', on_stop = 0 } }", 2, "there is no 'on_stop' here"),
    # lines of the board
    ("[gpio]\nin = { DI0 = 'Main.level' }", 2, "Main.level is INT, but gpio.DI0 is BOOL: declare it as BOOL"),
    ("[gpio]\nin = { DI0 = { var = 'Main.start', pull = 'upp' } }", 2, "pull cannot be 'upp'; did you mean up?"),
    ("[gpio]\nin = { DI0 = { var = 'Main.start', edge = 'both' } }", 2, "edge says when the event is posted; name it"),
    ("[local.Analog]", 1, 'the board has no module Analog; say which board it is: device = "device.toml"'),
]  # fmt: skip

DEVICE_MISTAKES = [
    ("[gpio]\nin = { DI1 = 'Main.start' }", 2, "IO-16 has no line DI1; it has DI0"),
    ("[gpio]\nin = { DO0 = 'Main.start' }", 2, "DO0 is an output of IO-16; move it to out"),
    ("[local.Analogue]", 1, "IO-16 has no module Analogue; did you mean Analog?"),
    ("[local.Analog]", 1, "Analog needs range: the vendor gives no default"),
    ("[local.Analog]\nrange = 'mid'", 2, "range cannot be 'mid'; it can be low, high"),
    ("[local.Analog]\nrange = 'low'\nin = { AI1 = 'Main.level' }", 3, "Analog has no input AI1; it has AI0"),
    ("[local.Analog]\nrange = 'low'\nin = { AI0 = 'Main.power' }", 3, "Main.power is REAL, but Analog.AI0 is INT"),
    ("[local.Analog]\nrange = 'low'\nout = { DO = '%QB1', DO8 = '%QX2.0', DO7 = '%QX3.0' }", 3, "DO7 has bits of DO"),
    ("[sim.in]\na = '%IX0.0'\nb = '%IX0.1'\nc = '%IX0.2'", 2, "there are 3 channels; IO-16 has room for 2"),
]  # fmt: skip


def check(found: list[str], line: int, message: str) -> None:
    assert any(text.startswith(f"{line}: ") and message in text for text in found), found


@pytest.mark.parametrize(("description", "line", "message"), MISTAKES, ids=[m[2][:50] for m in MISTAKES])
def test_mistake_is_reported_with_its_line(tmp_path: Path, description: str, line: int, message: str) -> None:
    check(messages(tmp_path, PROGRAM, description), line, message)


@pytest.mark.parametrize(("description", "line", "message"), DEVICE_MISTAKES, ids=[m[2][:50] for m in DEVICE_MISTAKES])
def test_what_the_board_has_not_is_reported(tmp_path: Path, description: str, line: int, message: str) -> None:
    check(messages(tmp_path, PROGRAM, description, DEVICE), line, message)


def test_unreadable_description_hides_what_follows_from_it(tmp_path: Path) -> None:
    program = "PROGRAM Main\nVAR x : BOOL; END_VAR\nx := Bench.ok;\nEND_PROGRAM\n"
    assert len(messages(tmp_path, program, "[[sim]]\nname = ")) == 1


def test_a_mistake_does_not_leave_channels_that_overlap(tmp_path: Path) -> None:
    description = "[sim]\nin = { a = 'Main.start', b = 'Main.level' }\nout = { c = 'Main.motr' }"
    found = messages(tmp_path, PROGRAM, description)
    check(found, 3, "did you mean motor?")
    assert not [text for text in found if "shares its memory" in text]


def test_device_becomes_a_variable_by_a_name_of_its_own(tmp_path: Path) -> None:
    program = PROGRAM.replace("motor := start", "motor := start AND Analog.ok")
    description = "device = 'device.toml'\n[local.Analog]\nrange = 'low'\n"
    found = messages(tmp_path, program, description, DEVICE)
    name = 'name = "Analog"'
    said = f"unknown name Analog; write {name} into the table of the device, which makes it a variable"
    assert [text for text in found if "Analog" in text] == [f"main.st:6: {said}"]
    assert not [text for text in messages(tmp_path, program, description + name, DEVICE) if "Analog" in text]
