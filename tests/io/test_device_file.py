"""Every key of a device file has a type and a range; what is outside is a mistake with its line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.errors import UsageError
from plctool.iec.types import ELEMENTARY
from plctool.iec.values import encode
from plctool.io.device_file import DeviceFile, parameter_value, read_device_file
from plctool.io.mistakes import Mistakes
from plctool.io.positions import TomlText


def read(text: str) -> tuple[DeviceFile, list[str]]:
    """A device file, and `line: message` of each mistake."""
    mistakes = Mistakes()
    return read_device_file(TomlText("device.toml", text), mistakes), [
        f"{m.pos.line}: {m.message}" for m in mistakes.found
    ]


def module(text: str, head: str = "name = 'Analog'\ndriver = 'IoDrvAdc'") -> str:
    """A module, whose own lines begin with the fourth."""
    return f"[[module]]\n{head}\n{text}"


def parameter(text: str, more: str = "") -> str:
    """A module with a parameter p, which is in line 5."""
    return module(f"[module.parameter]\np = {{ id = 1, {text} }}\n{more}")


MISTAKES = [
    ("name = 3", "1: name is a number; it has to be a text in quotes"),
    ('name = "a\\nb"', "1: name has to be one line, without control characters"),
    ('vendor = "a\\u0007"', "1: vendor has to be one line"),
    ("target = 3", "1: target is a number"),
    ("target = 'cortex-m3'\nvendor_id = 1", "2: vendor_id belongs to device_id; write both"),
    ("target = 'cortex-m3'\ndevice_id = 1", "2: device_id belongs to vendor_id; write both"),
    ("target = 'cortex-m3'\ndevice_id = 1\nvendor_id = 32768", "3: vendor_id is 32768; it can be 1 to 32767"),
    ("target = 'cortex-m3'\ndevice_id = 0\nvendor_id = 1", "2: device_id is 0; it can be 1 to 65535"),
    ("device_id = 1\nvendor_id = 1", "2: vendor_id and device_id are of a board; name its processor in target"),
    ("target = 'x86_64-linux'\nvendor_id = 1\ndevice_id = 1", "2: vendor_id and device_id are of a board"),
    ("target = 'z80'", "1: target cannot be 'z80'; it can be"),
    ("target = 'cortex-m33'", "1: target cannot be 'cortex-m33'; did you mean cortex-m3?"),
    ("limits = 3", "1: limits is a number; it has to be a table"),
    ("[limits]\ninputs = 1.5", "2: inputs is a number; it has to be a"),
    ("[limits]\nchannels = 65535", "2: channels is 65535; it can be 0 to 65534"),
    ("[gpio]\nin = { A = 3 }", "2: A needs the name that the port gives its line"),
    ("[gpio]\nin = { A = '' }", "2: the name of a line has 1 to 63 ASCII characters"),
    (f"[gpio]\nin = {{ A = '{'x' * 64}' }}", "2: the name of a line has 1 to 63 ASCII characters"),
    ('[gpio]\nin = { A = "P\\n1" }', "2: the name of a line has 1 to 63 ASCII characters"),
    ("[gpio]\nin = { A = 'P1', a = 'P2' }", "2: a is there already; names are unique"),
    ("[gpio]\nin = { A = 'P1' }\nout = { B = 'P1' }", "3: B is the line P1, as A is"),
    ('[gpio]\nin = { A = { line = "P1", text = "a\\nb" } }', "2: text has to be one line"),
    (module("", "name = 'An 1'\ndriver = 'D'"), "2: 'An 1' cannot be a name in C; use at most 31 letters"),
    (module("", "name = '8DI'\ndriver = 'D'"), "2: '8DI' cannot be a name in C"),
    (module("", "name = 'Größe'\ndriver = 'D'"), "2: 'Größe' cannot be a name in C"),
    (module("", f"name = '{'x' * 32}'\ndriver = 'D'"), "cannot be a name in C"),
    (module("", "name = 'A'\ndriver = 'Dö'"), "3: the name of a driver has 1 to 31 ASCII characters"),
    (module("", f"name = 'A'\ndriver = '{'x' * 32}'"), "3: the name of a driver has 1 to 31 ASCII characters"),
    (module(module("", "name = 'analog'\ndriver = 'D'")), "5: there is a module Analog in line 2 already"),
    (module("in = { A = 'INT' }"), "4: A needs a table"),
    (module("in = { A = { type = 'INT' } }"), "needs parameter"),
    (module("in = { A = { parameter = 1 } }"), "needs type"),
    (module("in = { A = { type = 'INT', parameter = -1 } }"), "4: parameter is -1; it can be 0 to 2147483647"),
    (module("in = { A = { type = 'INT', parameter = 1, bit = 65536 } }"), "4: bit is 65536; it can be 0 to 65535"),
    (module("in = { A = { type = 'INT', parameter = 1, bit = 4 } }"), "4: bit is 4; INT begins at a multiple of 8"),
    (module("in = { A = { type = 'INT', length = 4, parameter = 1 } }"), "4: there is no 'length' here"),
    (module("in = { A = { type = 'STRING', length = 0, parameter = 1 } }"), "4: length is 0; it can be 1 to 255"),
    (
        module("[module.in]\nA = { type = 'INT', parameter = 1 }\nB = { type = 'INT', parameter = 1, bit = 0 }"),
        "6: B is at the parameter and bit of A in line 5",
    ),
    (parameter("type = 'INT'", "'my p' = { id = 2, type = 'INT' }"), "6: 'my p' cannot be a name in C"),
    (parameter("type = 'INT'", "q = { id = 1, type = 'INT' }"), "6: q has the id of p in line 5"),
    (parameter("type = 'INT'", "task = { id = 2, type = 'INT' }"), "6: a parameter cannot be task, which all modules"),
    (parameter("type = 'INT'", "in = { id = 2, type = 'INT' }"), "6: a parameter cannot be in, which all modules have"),
    (parameter("type = 'INT', low = 'x'"), "5: low has to be an integer"),
    (parameter("type = 'INT', low = 0.5"), "5: low has to be an integer"),
    (parameter("type = 'INT', low = true"), "5: low has to be an integer"),
    (parameter("type = 'INT', low = 9, high = 3"), "5: low is 9, more than high, which is 3"),
    (parameter("type = 'USINT', low = -1"), "5: low is -1; a USINT can be 0 to 255"),
    (parameter("type = 'USINT', high = 256"), "5: high is 256; a USINT can be 0 to 255"),
    (parameter("type = 'REAL', high = nan"), "5: high is nan; a REAL can be"),
    (parameter("type = 'REAL', high = 1e300"), "5: high is 1e+300; a REAL can be"),
    (parameter("type = 'BOOL', low = 0"), "5: low is for numbers; this is BOOL"),
    (parameter("type = 'STRING', high = 5"), "5: high is for numbers; this is STRING"),
    (parameter("type = 'REAL', default = 1e300"), "5: the default of p is 1e+300; it can be"),
    (parameter("type = 'LREAL', default = inf"), "5: the default of p is inf; it can be"),
    (parameter("type = 'LREAL', default = nan"), "5: the default of p is nan; it can be"),
    (parameter("type = 'USINT', choices = { a = 0, b = 1 }, default = true"), "the default of p cannot be true; it"),
    (parameter("type = 'USINT', choices = { a = 0, b = 1 }, default = 1.0"), "the default of p cannot be 1.0; it"),
    (parameter("type = 'USINT', choices = { a = true }"), "5: the choice a of p has to be an integer"),
    (parameter("type = 'USINT', choices = 3"), "5: choices is a number; it has to be a table"),
    (parameter("type = 'USINT', choices = { '' = 1 }"), "5: a choice of p needs a word of one line"),
    (parameter("type = 'DATE', default = 2020-01-01"), "5: the default of p has to be a text such as a DATE has in ST"),
    (parameter("type = 'CHAR', default = 'ab'"), "5: the default of p cannot be that"),
    (parameter("type = 'STRING', length = 2, default = 'abc'"), "5: the default of p has to be a text of at most 2"),
    (parameter('type = "STRING", default = "a\\u0000"'), "5: the default of p has to be a text of at most"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), MISTAKES, ids=[m[1] for m in MISTAKES])
def test_mistake_is_reported_with_its_line(text: str, message: str) -> None:
    _, found = read(text)
    assert any(message in m for m in found), found


@pytest.mark.parametrize(
    "text",
    [
        "type = 'LREAL', default = 1e300", "type = 'REAL', low = 0, high = 2.5, default = 1",
        "type = 'CHAR', default = 'a'",
        "type = 'ULINT', default = 18446744073709551615", "type = 'USINT', choices = { a = 0 }, default = 0",
        "type = 'TIME', choices = { short = 'T#1s' }, default = 'short'", "type = 'BOOL', choices = { on = true }",
    ],
)  # fmt: skip
def test_parameter_that_can_be_is_taken(text: str) -> None:
    assert read(parameter(text))[1] == []


NAMES = [n for n in ELEMENTARY if "_" not in n and "X" not in n]
VALUES = st.one_of(
    st.integers(-(1 << 63), (1 << 64) - 1).map(str), st.floats().map(str), st.sampled_from(["true", "false"]),
    st.sampled_from(["'T#1s'", "'a'", "''", "'D#2020-01-01'", "'TOD#12:00'", "'16#FF'", "2020-01-01", "[1]", "{}"]),
)  # fmt: skip


@examples(300)
@given(st.sampled_from(NAMES), VALUES)
def test_default_that_is_taken_is_a_value_of_its_type(name: str, value: str) -> None:
    device, found = read(parameter(f"type = '{name}', default = {value}"))
    if found:
        return
    made = device.modules["Analog"].parameters["p"]
    try:
        encode(made.type, parameter_value(made, made.default))
    except UsageError as error:
        raise AssertionError(error.message) from None
