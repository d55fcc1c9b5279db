"""Whatever is written in a description or a device file is built or reported, never a failure of plctool."""

from __future__ import annotations

import re
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from plctool.compiler import check_with_tests, compile_sources, io_sources, load_io, load_sources
from plctool.compiler.diagnostics import render_all

PROGRAM = """\
PROGRAM Main
VAR start, motor : BOOL; level : INT; speed : REAL; pump : Pump; list : ARRAY[0..3] OF INT; END_VAR
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
DEVICE = """\
name = "IO-16"
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
"""
TOKEN = re.compile(r'"[^"\n]*"|\w+|[^\w\s]|\s+')
PIECES = [
    *TOKEN.findall(DESCRIPTION),
    *TOKEN.findall(DEVICE),
    "99999999999999999999",
    "-1",
    "[]",
    "{}",
    '""',
    "1.5",
    "\n",
]


@st.composite
def damaged(draw: st.DrawFn, text: str) -> str:
    tokens = TOKEN.findall(text)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(tokens) - 1))
        tokens[at : at + draw(st.integers(0, 2))] = draw(st.lists(st.sampled_from(PIECES), max_size=2))
        if not tokens:
            return ""
    return "".join(tokens)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(damaged(DESCRIPTION), st.just(DEVICE) | damaged(DEVICE))
def test_description_is_taken_or_reported(tmp_path: Path, description: str, device: str) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(description)
    (tmp_path / "device.toml").write_text(device)
    sources = load_sources([tmp_path])
    result = check_with_tests(sources, load=lambda: load_io([tmp_path]))
    shown = [*sources, *io_sources(load_io([tmp_path]))]
    assert len(render_all(result.diagnostics, shown)) >= (0 if result.ok else 1)
    if result.ok:
        compile_sources([tmp_path], target="cortex-m3")
    assert all(d.line >= 1 and d.column >= 1 for d in result.diagnostics)


def test_description_that_is_not_damaged_is_taken(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION)
    (tmp_path / "device.toml").write_text(DEVICE)
    result = check_with_tests(load_sources([tmp_path]), load=lambda: load_io([tmp_path]))
    assert [d.message for d in result.diagnostics] == []
