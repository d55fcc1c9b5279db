"""Whatever is written in a description or a device file is built or reported, never a failure of plctool."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.cli.commands.exports import export_board
from plctool.cli.commands.io import init
from plctool.cli.links import _link_in
from plctool.compiler import CompileError, check_with_tests, compile_sources, io_sources, load_io, load_sources
from plctool.compiler.syntax.diagnostics import render_all
from plctool.errors import UsageError

PROGRAM = """\
PROGRAM Main
VAR start, motor : BOOL; level : INT; speed : REAL; pump : Pump; list : ARRAY[0..3] OF INT; END_VAR
VAR a, b : BOOL; v, w : WORD; r : REAL; d : DATE; t : TIME; s : STRING(5); bits : ARRAY[0..3] OF BOOL; END_VAR
VAR big : ARRAY[0..9000] OF BYTE; p : POINTER TO INT; row : ARRAY[0..3] OF INT; END_VAR
motor := start; speed := level; pump(); list[1] := 2;
END_PROGRAM
FUNCTION_BLOCK Pump
VAR run : BOOL; END_VAR
run := NOT run;
END_FUNCTION_BLOCK
"""
DESCRIPTION = """\
device = "device.toml"
[gpio]
task = "Main"
[gpio.in]
DI0 = { var = "Main.start", pull = "up", invert = true, event = "e", edge = "both", on_error = "hold" }
[gpio.out]
DO0 = { var = "Main.motor", on_stop = 1, open_drain = false }
[local.Analog]
range = "4..20mA"
filter = 12
in = { AI0 = "Main.level" }
[[sim]]
name = "Bench"
optional = true
out = { a = "Main.speed", b = "Main.pump.run", c = "%QX20.3", d = { var = "Main.list[2]", on_stop = -3 } }
"""
MODBUS = """\
[[modbus.rs485]]
port = "/dev/ttyS1"
baud = 9600
parity = "even"
drive = true
[[modbus.rs485.device]]
name = "Meter"
unit = 3
order = "BADC"
timeout = "T#200ms"
[[modbus.rs485.device.read]]
function = 1
address = 17
every = "T#100ms"
vars = ["Main.w", "Main.a"]
on_error = 1
[[modbus.rs485.device.write]]
function = 22
wire = 4
on_change = true
verify = true
var = "Main.b"
[[modbus.tcp]]
host = "192.168.0.7"
[[modbus.tcp.device]]
name = "Drive"
[[modbus.tcp.device.read]]
function = 3
address = 40001
every = "T#1s"
vars = ["Main.row", "Main.v"]
[modbus.server.tcp]
port = 1502
as_bits = true
coils = { 2000 = "Main.start" }
identification = { vendor = "Acme" }
[modbus.server.tcp.holding]
40001 = "Main.level"
"40020.0" = { var = "Main.motor", read_only = true }
"40020.3" = { var = "Main.pump.run", read_only = true, on_stop = true }
"""
DEVICE = """\
name = "IO-16"
target = "cortex-m3"
vendor = "Acme"
[limits]
inputs = 640
[gpio]
in = { DI0 = "PA5", DI1 = { line = "PA6", text = "X1" } }
out = { DO0 = "PC0" }
[[module]]
name = "Analog"
driver = "IoDrvAdc"
in = { AI0 = { type = "INT", parameter = 1, bit = 16 } }
[module.parameter]
range = { id = 100, type = "USINT", choices = { "0..10V" = 0, "4..20mA" = 1 }, default = "0..10V" }
filter = { id = 101, type = "UINT", low = 0, high = 1000, default = 10 }
delay = { id = 102, type = "TIME", default = "T#1s" }
label = { id = 103, type = "STRING", length = 5, default = "a" }
"""
TOKEN = re.compile(r'"[^"\n]*"|\w+|[^\w\s]|\s+')
VALUES = [
    "99999999999999999999", "9" * 4400, "0x" + "F" * 5000, "-1", "0", "65536", "4294967296", "1.5", "1e400",
    "inf", "nan", "true", "2020-01-01", "12:00:00", "2020-01-01T12:00:00Z", "[]", "{}", "[" * 200, "{a=" * 200,
    "]" * 200, '""', "\n", '"T#1500us"', '"T#99999999d"', '"%IB99999999999"', '"%IB70000"', '"%QX0.0"',
    '"Main.big"', '"Main.bits"', '"Main.p"', '"Main.list"', '"Main.list[01]"', '"Main.list[ 1 ]"', '"Main.d"',
    '"Main.t"', '"Main.s"', '"Main"', '"g[1]"', '"IF"', '"TIME"', '"STRING"', '"LREAL"', '"hold"', '"CDAB"',
    '"\\u0000"', '"\\U0001F600"', "'" + "x" * 300 + "'", '"""a\nb"""',
]  # fmt: skip
PIECES = [*TOKEN.findall(DESCRIPTION + MODBUS + DEVICE), *VALUES * 4]


@st.composite
def damaged(draw: st.DrawFn, text: str) -> str:
    tokens = TOKEN.findall(text)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(tokens) - 1))
        tokens[at : at + draw(st.integers(0, 2))] = draw(st.lists(st.sampled_from(PIECES), max_size=2))
        if not tokens:
            return ""
    return "".join(tokens)


def taken_or_reported(folder: Path, description: str, device: str) -> None:
    """Builds or says why not; anything else is raised."""
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text(description)
    (folder / "device.toml").write_text(device)
    sources = load_sources([folder])
    result = check_with_tests(sources, load=lambda: load_io([folder]))
    shown = [*sources, *io_sources(load_io([folder]))]
    assert len(render_all(result.diagnostics, shown)) >= (0 if result.ok else 1)
    assert all(d.line >= 1 and d.column >= 1 for d in result.diagnostics)
    if result.ok:
        with suppress(UsageError):  # more than a whole image has room for
            compile_sources([folder], target="cortex-m3")


HOW = examples(40)


@HOW
@given(damaged(DESCRIPTION), st.just(DEVICE) | damaged(DEVICE))
def test_description_is_taken_or_reported(tmp_path: Path, description: str, device: str) -> None:
    taken_or_reported(tmp_path, description, device)


@HOW
@given(damaged(MODBUS))
def test_description_of_modbus_is_taken_or_reported(tmp_path: Path, description: str) -> None:
    taken_or_reported(tmp_path, description, DEVICE)


@HOW
@given(damaged(DEVICE))
def test_header_and_beginning_of_a_board_are_written_or_its_mistakes_reported(tmp_path: Path, device: str) -> None:
    (tmp_path / "device.toml").write_text(device)
    (tmp_path / "new.io.toml").unlink(missing_ok=True)
    with suppress(UsageError, CompileError):
        export_board(tmp_path / "device.toml", tmp_path)
        init(tmp_path / "new.io.toml", tmp_path / "device.toml")


@HOW
@given(damaged('link = "serial:/dev/ttyS0"\n[other]\na = [1, { b = 2 }]\n'))
def test_link_of_a_project_is_taken_or_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "plc.toml").write_text(text)
    with suppress(UsageError):
        _link_in(tmp_path / "plc.toml")


@pytest.mark.parametrize("description", [DESCRIPTION, MODBUS], ids=["all kinds", "modbus"])
def test_description_that_is_not_damaged_is_taken(tmp_path: Path, description: str) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(description)
    (tmp_path / "device.toml").write_text(DEVICE)
    result = check_with_tests(load_sources([tmp_path]), load=lambda: load_io([tmp_path]))
    usual = ("never used", "no task waits")
    assert [d.message for d in result.diagnostics if not any(words in d.message for words in usual)] == []
