"""Values that nothing can have, in a description or a device file, are mistakes with their line."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import messages

PROGRAM = """\
PROGRAM Main
VAR
    start : BOOL; level : INT; d : DATE; t : TIME; r : REAL; s : STRING(3); u : ULINT;
    big : ARRAY[0..8191] OF BYTE; bits : ARRAY[0..8190] OF BYTE;
END_VAR
level := level + 1;
END_PROGRAM
"""
DIGITS = "9" * 5000
DEEP = 3000
LINE = "[[modbus.tcp]]\nhost = '1.2.3.4'\n[[modbus.tcp.device]]\nname = 'D'\n"

MISTAKES = [
    # numbers and brackets that nothing can read
    (f"[sim]\noptional = {DIGITS}", "2: this is not TOML: a number has at most 64 bits"),
    (f"[sim]\noptional = 0x{'F' * 5000}", "2: this is not TOML: a number has at most 64 bits"),
    ("[sim]\noptional = 0x10000000000000000", "2: this is not TOML: a number has at most 64 bits"),
    (f"[sim]\nx = {{ a = [1, -{DIGITS}] }}", "2: this is not TOML: a number has at most 64 bits"),
    (f"[sim]\nx = {'[' * DEEP}{']' * DEEP}", "2: this is not TOML: there are more than 100 brackets within each other"),
    (f"[sim]\nx = {'{a=' * DEEP}1{'}' * DEEP}", "2: this is not TOML: there are more than 100 brackets within each"),
    (f"[sim]\nx = {'[' * DEEP}", "2: this is not TOML: there are more than 100 brackets within each other"),
    (f"[sim]\nx{'.a' * DEEP} = 1", "2: this is not TOML: there are more than 100 dots in a key"),
    (f"[sim{'.a' * DEEP}]", "1: this is not TOML: there are more than 100 dots in a key"),
    # what a channel becomes
    ("[sim.in]\na = { var = 'Main.d', on_error = 2020-01-01 }", 'a value; a date is written as in ST: "D#2024-02-29"'),
    ("[sim.in]\na = { var = 'Main.level', on_error = 12:00:00 }", "2: on_error can be \"hold\", \"zero\" or a value"),
    ("[sim.in]\na = { var = 'Main.level', on_error = 1.5 }", "2: on_error: '1.5' is not a value of INT"),
    ("[sim.in]\na = { var = 'Main.level', on_error = 1e300 }", "2: on_error: "),
    ("[sim.in]\na = { var = 'Main.level', on_error = inf }", "2: on_error: "),
    ("[sim.in]\na = { var = 'Main.level', on_error = nan }", "2: on_error: "),
    ("[sim.in]\na = { var = 'Main.level', on_error = true }", "2: on_error is true or false, but Main.level is INT"),
    ("[sim.in]\na = { var = 'Main.r', on_error = true }", "2: on_error is true or false, but Main.r is REAL"),
    ("[sim.in]\na = { var = 'Main.start', on_error = 2 }", "2: on_error: '2' is not a value of BOOL"),
    ("[sim.in]\na = { var = 'Main.s', on_error = 'abcd' }", "2: on_error: "),
    ("[sim.in]\na = { var = 'Main.t', on_error = 'soon' }", "2: on_error: 'soon' is not a value of TIME"),
    ("[sim.in]\na = { var = 'Main.u', on_error = 18446744073709551616 }", "2: this is not TOML: a number has at most"),
    ("[sim.in]\na = { var = 'Main.u', on_error = 18446744073709551615 }", "value of at most 32 bits"),
    ("[sim.in]\n'' = 'Main.start'", "2: a channel needs a name"),
    # what the tables of an image have room for
    ("[sim.in]\na = 'Main.big'", "2: Main.big has 65536 bits; a channel has at most 65535: name its elements"),
    # durations
    (f"{LINE}timeout='T#1500us'", "5: timeout is T#1500us; it has to be whole milliseconds"),
    (f"{LINE}timeout='T#99999999999999999999d'", "5: timeout is T#99999999999999999999d; it can be"),
]  # fmt: skip


@pytest.mark.parametrize(("description", "message"), MISTAKES, ids=[m[0][:40] + "#" + m[1][:40] for m in MISTAKES])
def test_value_is_reported_with_its_line(tmp_path: Path, description: str, message: str) -> None:
    found = messages(tmp_path, PROGRAM, description)
    assert any(message in m for m in found), [m[:200] for m in found]


@pytest.mark.parametrize(
    "text",
    [
        "on_error = 18", "on_error = -1", "on_error = 3.0", "on_error = '16#FF'", "on_error = 'hold'"
    ],
)  # fmt: skip
def test_value_that_fits_is_taken(tmp_path: Path, text: str) -> None:
    found = messages(tmp_path, PROGRAM, f"[sim.in]\na = {{ var = 'Main.level', {text} }}")
    assert [m for m in found if "main.st" not in m] == []


def test_channel_of_as_many_bits_as_there_can_be_is_taken(tmp_path: Path) -> None:
    found = messages(tmp_path, PROGRAM, "[sim.in]\na = 'Main.bits'")
    assert [m for m in found if "never used" not in m] == []


DEVICE = """\
name = "IO-16"
[[module]]
name = "Analog"
driver = "IoDrvAdc"
[module.parameter]
p = { id = 1, type = "TIME"%s }
"""


@pytest.mark.parametrize(
    ("more", "use", "message"),
    [
        (
            ', default = "garbage"',
            "",
            "device.toml:6: the default of p cannot be that: 'garbage' is not",
        ),
        (
            ', choices = { short = "T#1s", long = "soon" }',
            "",
            "device.toml:6: the choice long of p cannot be that",
        ),
        ("", "p = 'xx'", "3: p cannot be that: 'xx' is not a value of TIME; write a duration such as T#1s500ms"),
        ("", "p = 12:00:00", "3: p has to be a text such as a TIME has in ST"),
        (f", default = {DIGITS}", "", "device.toml:6: this is not TOML: a number has at most 64 bits"),
        (f", default = {'[' * DEEP}", "", "device.toml:6: this is not TOML: there are more than 100 brackets"),
    ],
)
def test_value_of_a_parameter_is_reported_with_its_line(tmp_path: Path, more: str, use: str, message: str) -> None:
    found = messages(tmp_path, PROGRAM, f"device = 'device.toml'\n[local.Analog]\n{use}\n", DEVICE % more)
    assert any(message in m for m in found), [m[:200] for m in found]
