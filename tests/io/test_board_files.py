"""What is written from a device file is read again: the header by a C compiler, the description by plctool."""

from __future__ import annotations

import json
import os
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.cli.commands.exports import export_board
from plctool.cli.commands.io import init
from plctool.errors import UsageError
from plctool.iec.types import ELEMENTARY
from plctool.io.beginning import toml_value
from plctool.io.description import load_description, load_device

# ---- device files --------------------------------------------------------------------------------------------------

TEXTS = st.lists(st.sampled_from([*"abcÄ漢\"'\\#/*?=(-<> ", "*/", "/*", "??/", "??="]), max_size=9).map("".join)
PLAIN = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=9)
NAMES = st.sampled_from(["A", "A_BIT", "b", "int", "IF", "x1", "_y", "DRIVER", "LINE", "while", "Range", "N" * 31])
INTEGERS = [n for n, t in ELEMENTARY.items() if t.kind.name in ("INT", "BIT") and "_" not in n and "X" not in n]
OTHERS = ["BOOL", "REAL", "LREAL", "TIME", "LTIME", "DATE", "TOD", "DT", "CHAR", "STRING"]


@st.composite
def parameters(draw: st.DrawFn) -> dict[str, Any]:
    made: dict[str, Any] = {"id": draw(st.integers(0, 0x7FFF_FFFF)), "text": draw(TEXTS)}
    name = made["type"] = draw(st.sampled_from([*INTEGERS, *OTHERS]))
    t = ELEMENTARY.get(name)
    if name == "STRING" and draw(st.booleans()):
        made["default"] = draw(PLAIN)
    elif t is not None and name in INTEGERS:
        low, high = (-(1 << t.bits - 1), (1 << t.bits - 1) - 1) if t.signed else (0, (1 << t.bits) - 1)
        numbers = st.integers(low, high) | st.sampled_from([low, high])
        if draw(st.booleans()):
            made["choices"] = draw(st.dictionaries(TEXTS, numbers, min_size=1, max_size=3))
        elif draw(st.booleans()):
            made["low"], made["high"] = sorted((draw(numbers), draw(numbers)))
        elif draw(st.booleans()):
            made["default"] = draw(numbers)
    elif name in ("REAL", "LREAL") and draw(st.booleans()):
        made["low"] = draw(st.floats(-1e30, 1e30))
    return made


MODULES = st.fixed_dictionaries(
    {
        "name": NAMES,
        "driver": PLAIN,
        "in": st.dictionaries(
            NAMES, st.fixed_dictionaries({"type": st.just("BYTE"), "parameter": st.integers(0, 99), "text": TEXTS}),
            max_size=3,
        ),
        "parameter": st.dictionaries(NAMES, parameters(), max_size=3),
    }
)  # fmt: skip
DEVICES = st.fixed_dictionaries(
    {
        "name": TEXTS,
        "vendor": TEXTS,
        "limits": st.dictionaries(st.sampled_from(["inputs", "outputs"]), st.integers(64, 65536)),
        "gpio": st.fixed_dictionaries(
            {"in": st.dictionaries(NAMES, st.fixed_dictionaries({"line": PLAIN, "text": TEXTS}), max_size=3)}
        ),
        "module": st.lists(MODULES, max_size=2),
    }
)


def toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k, ensure_ascii=False)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value).lower()


def written(folder: Path, device: dict[str, Any]) -> Path | None:
    """A device file; None if it has mistakes."""
    path = folder / "device.toml"
    path.write_text("\n".join(f"{key} = {toml(value)}" for key, value in device.items()))
    _, mistakes, _ = load_device(path)
    return None if mistakes.found else path


# ---- what is written -----------------------------------------------------------------------------------------------

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only"]
COMMENTED = re.compile(r"^# (?=\[|\w+ = )", re.MULTILINE)
SETTINGS = examples(30)


@SETTINGS
@given(DEVICES)
def test_header_that_is_written_is_c(tmp_path: Path, device: dict[str, Any]) -> None:
    path = written(tmp_path, device)
    if path is None:
        return
    header = Path(export_board(path, tmp_path)["header"])
    header.rename(tmp_path / "board.h")
    (tmp_path / "main.c").write_text('#include "board.h"\nint main(void) { return 0; }\n')
    done = subprocess.run(["cc", *FLAGS, "main.c"], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode() + (tmp_path / "board.h").read_text()


@SETTINGS
@given(DEVICES, st.text(st.sampled_from(list("aé\"' #\\")), min_size=1, max_size=4).map(lambda t: f"x{t}"))
def test_description_that_is_written_is_read_with_all_its_lines(
    tmp_path: Path, device: dict[str, Any], folder: str
) -> None:
    (tmp_path / folder).mkdir(exist_ok=True)
    path = written(tmp_path / folder, device)
    if path is None:
        return
    beginning = tmp_path / "new.io.toml"
    beginning.unlink(missing_ok=True)
    init(beginning, path)
    assert load_description(beginning).mistakes.found == []
    head, line, rest = beginning.read_text("utf-8").partition("\ndevice = ")
    beginning.write_text(head + line + COMMENTED.sub("", rest), "utf-8")
    made = load_description(beginning)
    assert [m.message for m in made.mistakes.found] == []
    assert len(made.channels) == len(device["gpio"]["in"]) + sum(len(m["in"]) for m in device["module"])


@given(st.text() | st.integers(-(1 << 63), (1 << 63) - 1) | st.floats(allow_nan=False) | st.booleans())
def test_value_is_written_as_toml_has_it(value: str | float) -> None:
    assert tomllib.loads(f"x = {toml_value(value)}") == {"x": value}


# ---- names ---------------------------------------------------------------------------------------------------------

MODULE = "[[module]]\nname = 'Mod'\ndriver = 'D'\n"

TWICE = [
    (f"{MODULE}in.A = {{ type = 'INT', parameter = 1 }}\nin.A_BIT = {{ type = 'INT', parameter = 2 }}", "MOD_A_BIT"),
    (f"{MODULE}in = {{ DRIVER = {{ type = 'BYTE', parameter = 1 }} }}", "MOD_DRIVER"),
    (
        f"{MODULE}in = {{ A = {{ type = 'BYTE', parameter = 1 }} }}\nparameter = {{ A = {{ id = 1, type = 'BYTE' }} }}",
        "MOD_A",
    ),
    (f"{MODULE}[module.parameter]\np = {{ id = 1, type = 'BYTE', choices = {{ 'a b' = 1, a-b = 2 }} }}", "MOD_p_a_b"),
    (f"{MODULE}[module.parameter]\np = {{ id = 1, type = 'BYTE', choices = {{ 'ä' = 1, 'ö' = 2 }} }}", "MOD_p__"),
    ("[gpio]\nin.DI = 'P1'\n[[module]]\nname = 'IO_LINE'\ndriver = 'D'\nin = { DI = { type = 'INT', parameter = 1 } }",
     "IO_LINE_DI"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "name"), TWICE, ids=[name for _, name in TWICE])
def test_two_of_one_name_in_c_are_a_mistake(tmp_path: Path, text: str, name: str) -> None:
    (tmp_path / "device.toml").write_text(text)
    _, mistakes, _ = load_device(tmp_path / "device.toml")
    assert any(f"this is {name} in the C header" in m.message for m in mistakes.found), mistakes.found


def test_board_whose_name_begins_with_a_digit_has_a_header(tmp_path: Path) -> None:
    (tmp_path / "device.toml").write_text("name = '16IO'\n[limits]\ninputs = 4\n")
    header = Path(export_board(tmp_path / "device.toml", tmp_path)["header"])
    assert header.name == "16IOIo.h"
    assert "#ifndef BOARD_16IOIO_H" in header.read_text()


def test_device_file_whose_name_is_no_text_is_refused(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path) + b"/x\xff"
    os.mkdir(folder)
    device = Path(os.fsdecode(folder)) / "device.toml"
    device.write_text("name = 'IO'\n")
    with pytest.raises(UsageError, match="is not UTF-8"):
        init(tmp_path / "new.io.toml", device)
