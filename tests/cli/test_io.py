"""plctool build, check, test, info and io on files with a description of inputs and outputs."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

PROGRAM = """\
PROGRAM Main
VAR start : BOOL; motor : BOOL; level : INT; END_VAR
motor := start AND level > 3;
END_PROGRAM
"""
DESCRIPTION = """\
[[sim]]
name = "Bench"
in = { button = "Main.start", level = "Main.level" }
out = { motor = "Main.motor" }
"""
DEVICE = """\
name = "IO-16"
target = "cortex-m3"
[limits]
inputs = 64
[gpio]
in = { DI0 = "PA5", DI1 = { line = "PA6", text = "terminal X1.2" } }
out = { DO0 = "PC0" }
[[module]]
name = "Analog"
driver = "IoDrvAdc"
in = { AI0 = { type = "INT", parameter = 1, bit = 16 } }
[module.parameter]
range = { id = 100, type = "USINT", choices = { "0..10V" = 0, "4..20mA" = 1 }, default = "0..10V" }
label = { id = 101, type = "STRING", length = 8, default = "a" }
"""


@pytest.fixture
def program(scratch: Path) -> Path:
    (scratch / "main.st").write_text(PROGRAM)
    (scratch / "main.io.toml").write_text(DESCRIPTION)
    return scratch


def test_build_prints_how_old_inputs_may_be(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    done = tool("build", "main.st")
    assert done.out.splitlines()[1] == "3 channels of inputs and outputs; oldest input: Bench.button, up to 10 ms"
    oldest = {"channel": "Bench.button", "age_us": 10000}
    assert tool("build", "main.st", "--json").json["io"] == {"channels": 3, "oldest_input": oldest, "lines": []}


def test_map_lists_channels(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    tool("build", "main.st")
    lines = tool("io", "map", "app.cdl").out.splitlines()
    assert lines[0].split() == ["device", "channel", "direction", "variable", "type", "address", "tasks", "age"]
    assert [line.split()[:4] for line in lines[1:]] == [
        ["Bench", "button", "in", "Main.start"],
        ["Bench", "level", "in", "Main.level"],
        ["Bench", "motor", "out", "Main.motor"],
    ]
    assert tool("io", "map", "app.cdl", "--json").json["channels"][0]["variable"] == "Main.start"


def test_map_of_a_program_without_description_says_so(tool, image: Path) -> None:  # type: ignore[no-untyped-def]
    assert "no inputs and outputs" in tool("io", "map", str(image)).out


def test_info_lists_devices(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    tool("build", "main.st")
    device = {"name": "Bench", "driver": "IoDrvSim", "optional": False, "channels": 3, "parameters": 0}
    assert tool("info", "app.cdl", "--json").json["devices"] == [device]


def test_mistake_is_quoted_with_a_caret(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "main.io.toml").write_text('[sim]\nin = { a = "Main.strat" }\n')
    for command in ("check", "build", "test"):
        done = tool(command, "main.st")
        assert done.status == 2
        text = done.out + done.err
        assert "main.io.toml:2:18: error: program Main has no strat; did you mean start?" in text
        assert '\nin = { a = "Main.strat" }\n                 ^' in text


def test_several_descriptions_are_an_error_that_names_them(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "other.io.toml").write_text("[sim]\nin = { a = 'Main.start' }\n")
    done = tool("build", ".")
    assert done.status == 2
    assert "choose one with --io: main.io.toml, other.io.toml" in done.err
    assert tool("build", "main.st", "--json").json["io"]["channels"] == 3  # that with its name
    assert tool("build", "main.st", "--io", "other.io.toml", "--json").json["io"]["channels"] == 1


def test_description_that_is_not_there_is_an_error(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    assert "none.io.toml cannot be read" in tool("build", "main.st", "--io", "none.io.toml").err


def test_unit_tests_see_the_devices(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "tests.st").write_text(
        "TEST 'motor waits for the level'\nVAR p : Main; END_VAR\np.start := TRUE;\np();\nASSERT_FALSE(p.motor);\n"
        "p.level := 4;\np();\nASSERT_TRUE(p.motor);\nASSERT_FALSE(Bench.ok AND Bench.errors > 0);\nEND_TEST\n"
    )
    assert tool("test", ".").status == 0


def test_plant_in_a_file_is_attached(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "plant.py").write_text(
        "EVERY_MS = 10\ndef step(plc):\n    plc.set_input('level', plc.now_ns // 10**7)\n"
    )
    tool("build", "main.st")
    found = tool("run", "app.cdl", "--time", "T#95ms", "--plant", "plant.py", "--get", "Bench.level", "--json").json
    assert found["values"]["Bench.level"] == 9


@pytest.mark.parametrize("words", [("--json",), ("--trace", "Main.level", "-o", "-")])
def test_a_plant_that_prints_does_not_disturb_what_is_for_machines(tool, program: Path, words) -> None:  # type: ignore[no-untyped-def]
    (program / "plant.py").write_text("print('made')\ndef step(plc):\n    print('stepped')\n")
    tool("build", "main.st")
    done = tool("run", "app.cdl", "--cycles", "2", "--plant", "plant.py", *words)
    assert done.out.startswith(("{", "time_ms,")) and done.err.startswith("made\nstepped\n")
    assert "stepped" not in done.out
    assert tool("run", "app.cdl", "--plant", "plant.py").out.startswith("made\n")


def test_plant_in_st_is_compiled_and_attached(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "plant").mkdir()
    (program / "plant" / "p.st").write_text("PROGRAM P\nVAR level : INT; END_VAR\nlevel := level + 1;\nEND_PROGRAM\n")
    tool("build", "main.st")
    found = tool("run", "app.cdl", "--time", "T#95ms", "--plant", "plant/p.st", "--get", "Bench.level", "--json").json
    assert found["values"]["Bench.level"] == 9


def test_the_kind_of_a_plant_is_told_by_its_suffix_in_any_case(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "PLANT.PY").write_text("def step(plc):\n    plc.set_input('level', 7)\n")
    tool("build", "main.st")
    found = tool("run", "app.cdl", "--cycles", "3", "--plant", "PLANT.PY", "--get", "Bench.level", "--json").json
    assert found["values"]["Bench.level"] == 7


@pytest.mark.parametrize(("text", "reason"), [("x = 1\n", "has no function step"), (None, "cannot be read")])
def test_plant_that_is_none_is_an_error(tool, program: Path, text: str | None, reason: str) -> None:  # type: ignore[no-untyped-def]
    if text is not None:
        (program / "plant.py").write_text(text)
    tool("build", "main.st")
    assert reason in tool("run", "app.cdl", "--plant", "plant.py").err


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def step(plc):\n    plc.set_input('level', 1 / 0)\n", "plant.py:2: ZeroDivisionError: division by zero"),
        ("import math\nmath.nothing\n", "plant.py:2: AttributeError"),
        ("def step(plc)\n", "plant.py:1: expected ':'"),
        ("x = 1\0\n", "source code string cannot contain null bytes"),  # before Python 3.11.4 a ValueError
        ("EVERY_MS = 'often'\ndef step(plc): pass\n", "EVERY_MS in plant.py is not a number of milliseconds above 0"),
        ("def step(plc, what): pass\n", "plant.py: TypeError"),
        ("import sys\nsys.exit()\ndef step(plc): pass\n", "plant.py:2: exit would end plctool, not the plant; return"),
        ("def step(plc):\n    raise SystemExit('over')\n", "plant.py:2: exit would end plctool, not the plant; return"),
        ("def step(plc):\n    exit(3)\n", "plant.py:2: exit would end plctool, not the plant; return"),
    ],
)
def test_mistake_in_a_plant_is_said_with_its_line(tool, program: Path, text: str, reason: str) -> None:  # type: ignore[no-untyped-def]
    (program / "plant.py").write_text(text)
    tool("build", "main.st")
    done = tool("run", "app.cdl", "--cycles", "3", "--plant", "plant.py")
    assert done.status == 2
    assert reason in done.err


def test_plant_has_nothing_of_the_board_beside_it(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "main.io.toml").write_text('device = "device.toml"\n' + DESCRIPTION)
    (program / "device.toml").write_text(DEVICE)
    (program / "plant.st").write_text("PROGRAM P\nVAR level : INT; END_VAR\nlevel := level + 1;\nEND_PROGRAM\n")
    tool("build", "main.st", "--target", "x86_64-linux")
    found = tool("run", "app.cdl", "--time", "T#95ms", "--plant", "plant.st", "--get", "Bench.level", "--json").json
    assert found["values"]["Bench.level"] == 9


def test_board_says_what_to_compile_for(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "device.toml").write_text(DEVICE)
    assert tool("build", "main.st", "--device", "device.toml", "--json").json["target"] == "cortex-m3"
    simulated = tool("build", "main.st", "--device", "device.toml", "--target", "x86_64-linux", "--json")
    assert simulated.json["target"] == "x86_64-linux"


def test_init_writes_what_can_be_built_without_its_comment_signs(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "device.toml").write_text(DEVICE)
    (program / "main.io.toml").unlink()
    assert tool("io", "init", "main.io.toml", "--device", "device.toml").status == 0
    assert tool("build", "main.st").status == 0
    text = (program / "main.io.toml").read_text()
    for old, new in (
        ("# [", "["), ("# DI0", "DI0"), ("# DI1", "#"), ("# DO0", "DO0"), ("# AI0", "AI0"), ("# range", "range"),
        ("Main.di0", "Main.start"), ("Main.do0", "Main.motor"), ("Main.ai0", "Main.level"),
    ):  # fmt: skip
        text = text.replace(old, new)
    (program / "main.io.toml").write_text(text)
    assert tool("build", "main.st", "--json").json["io"]["channels"] == 3
    again = tool("io", "init", "main.io.toml")
    assert again.status == 2
    assert "is there already" in again.err


def test_init_without_a_board_is_a_description_too(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "main.io.toml").unlink()
    assert tool("io", "init").status == 0
    assert tool("build", "main.st").status == 0


def test_header_of_a_board_compiles(tool, program: Path) -> None:  # type: ignore[no-untyped-def]
    (program / "device.toml").write_text(DEVICE)
    assert tool("export-itf", "--device", "device.toml", "-o", "c").status == 0
    code = (
        '#include "IO_16Io.h"\n#include <string.h>\nint main(void) { return strcmp(IO_LINE_DI1, "PA6") '
        '|| strcmp(ANALOG_DRIVER, "IoDrvAdc") || ANALOG_AI0_BIT != 16 || ANALOG_range_4__20mA != 1 '
        "|| IO_LIMIT_INPUTS != 64; }\n"
    )
    (program / "c" / "main.c").write_text(code)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run(["cc", *flags, "main.c", "-o", "main"], cwd=program / "c", check=True)
    subprocess.run(["./main"], cwd=program / "c", check=True)


@pytest.mark.parametrize(
    ("device", "message"),
    [
        ("nam = 'x'", "device.toml:1:1: error: there is no 'nam' here; did you mean name?"),
        ("[limits]\ninputs = -1", "device.toml:2:10: error: inputs is -1; it can be 0 to 65536"),
        ("[gpio]\nin = { A = 'P1', B = 'P1' }", "device.toml:2:22: error: B is the line P1, as A is"),
        ("[gpio]\nin = { 'A-1' = 'P1' }", "device.toml:2:8: error: 'A-1' cannot be a name in C"),
        ("[[module]]\nname = 'A'", "device.toml:1:1: error: [module] needs driver: write for example"),
        (
            "[[module]]\nname = 'A'\ndriver = 'D'\nin = { X = { type = 'INTT', parameter = 1 } }",
            "device.toml:4:21: error: type cannot be 'INTT'; did you mean",
        ),
        (
            "[[module]]\nname = 'A'\ndriver = 'D'\n[module.parameter]\np = { id = 1, type = 'BYTE', choices.a = -1 }",
            "device.toml:5:42: error: the choice a of p is -1; it can be 0 to 255",
        ),
        (
            "[[module]]\nname = 'A'\ndriver = 'D'\n[module.parameter]\np = { id = 1, type = 'USINT', default = 256 }",
            "device.toml:5:41: error: the default of p is 256; it can be 0 to 255",
        ),
    ],
)
def test_mistake_in_a_device_file_is_reported(tool, scratch: Path, device: str, message: str) -> None:  # type: ignore[no-untyped-def]
    (scratch / "device.toml").write_text(device)
    done = tool("export-itf", "--device", "device.toml")
    assert done.status == 2
    assert message in done.err


def test_controller_without_io_manager_says_so(tool, plc) -> None:  # type: ignore[no-untyped-def]
    done = tool("io", "status", "--port", "/dev/fake")
    assert (done.status, "has no I/O manager" in done.err) == (1, True)
