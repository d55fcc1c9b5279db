"""A program that its device has no room for is refused at build: which limit, how much of it, and by what."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

BIG_DATA = """PROGRAM Main
VAR small : INT; big : ARRAY[0..5999] OF DINT; middle : ARRAY[0..99] OF INT; other : ARRAY[0..9] OF BYTE; END_VAR
big[small] := middle[small] + other[1];
END_PROGRAM
"""
DEEP = """FUNCTION Low : DINT
VAR_INPUT n : DINT; END_VAR
VAR t : ARRAY[0..149] OF DINT; i : DINT; END_VAR
FOR i := 0 TO 149 DO t[i] := n * i; END_FOR
Low := t[n];
END_FUNCTION
FUNCTION_BLOCK Middle
VAR n : DINT; END_VAR
VAR_TEMP t : ARRAY[0..399] OF DINT; i : DINT; END_VAR
FOR i := 0 TO 399 DO t[i] := n + i; END_FOR
n := Low(t[n]) + Low(t[n + 1]);
END_FUNCTION_BLOCK
PROGRAM Main VAR one, two : Middle; END_VAR one(); two(); END_PROGRAM
"""
DEVICE = "[limits]\ntasks = 1\ndata = 100\n"


def tasks(count: int) -> str:
    programs = "".join(f"PROGRAM P{i} VAR n : DINT; END_VAR n := n + 1; END_PROGRAM\n" for i in range(count))
    instances = "".join(f"TASK T{i}(INTERVAL := T#1s); PROGRAM I{i} WITH T{i} : P{i};\n" for i in range(count))
    return f"{programs}CONFIGURATION C RESOURCE R ON PLC\n{instances}END_RESOURCE END_CONFIGURATION\n"


@pytest.fixture
def refused(tool: Any, scratch: Path) -> Any:
    """Builds a text that does not fit; returns the message."""

    def build(text: str, *options: str) -> str:
        (scratch / "app.st").write_text(text)
        done = tool("build", "app.st", "-o", "app.cdl", *options)
        assert done.status == 2
        assert not (scratch / "app.cdl").exists()
        return str(done.err)

    return build


SUM = """FUNCTION Sum : DINT
VAR_INPUT x : ANY_INT; list : ARRAY[1..3000] OF ANY_INT := [2, 3]; END_VAR
Sum := TO_DINT(x + list[1]);
END_FUNCTION
PROGRAM Main
VAR i : INT; d : DINT; END_VAR
i := TO_INT(Sum(i)); d := Sum(d);
END_PROGRAM
"""


def test_too_many_tasks(refused: Any) -> None:
    message = refused(tasks(20), "--target", "cortex-m3")
    assert "It needs 20 tasks, the device has 4 (T0, T1, T2 and 17 more)." in message
    assert "MPS2 AN385" in message
    assert "It needs 17 tasks, the device has 16" in refused(tasks(17))


@pytest.mark.parametrize(("target", "board"), [("cortex-m7", "MPS2 AN500"), ("rv32imac", "QEMU virt RV32")])
def test_a_processor_has_the_limits_of_the_boards_here(refused: Any, target: str, board: str) -> None:
    message = refused(BIG_DATA, "--target", target)
    assert f"{board}" in message
    assert "bytes of variables, the device has 16384" in message
    assert "bytes of stack" in refused(DEEP, "--target", target, "-O0")


@pytest.mark.parametrize(("target", "board", "has"), [("aarch64-linux", "plcrt", 16), ("cortex-m0", "MPS2 AN385", 4)])
def test_a_processor_that_no_board_has_is_held_to_the_limits_of_its_like(
    refused: Any, target: str, board: str, has: int
) -> None:
    message = refused(tasks(20), "--target", target)
    assert f"It needs 20 tasks, the device has {has}" in message and board in message


def test_limits_can_be_left_out(refused: Any, tool: Any) -> None:
    assert "build with --no-limits" in refused(BIG_DATA, "--target", "cortex-m3")
    assert tool("build", "app.st", "-o", "app.cdl", "--target", "cortex-m3", "--no-limits").status == 0


def test_too_much_data_names_the_largest_variables(refused: Any) -> None:
    message = refused(BIG_DATA, "--target", "cortex-m3")
    assert "needs 24214 bytes of variables, the device has 16384" in message
    assert "(the largest: Main.big 24000, Main.middle 200, Main.other 10 and 1 more)" in message


def test_too_much_retain_data(refused: Any) -> None:
    text = BIG_DATA.replace("VAR small", "VAR small : INT; END_VAR VAR RETAIN dummy")
    assert "bytes of RETAIN variables, the device has 2048 (the largest: Main.big 24000" in refused(
        text, "--target", "cortex-m4f"
    )


def test_stack_is_that_of_the_deepest_calls(refused: Any, tool: Any) -> None:
    message = refused(DEEP, "--target", "cortex-m3", "-O0")
    amount = int(message.split(" bytes of stack")[0].rpartition(" ")[2])
    assert 2200 <= amount < 2600  # 600 in Low, 1600 in Middle; each once, though both are called twice
    assert "the deepest calls, largest frames first: Middle 16" in message
    assert "Low 6" in message
    assert tool("build", "app.st", "-o", "app.cdl").status == 0  # plcrt has more


def test_stack_of_a_program_whose_calls_may_lead_back_is_null(tool: Any, scratch: Path) -> None:
    text = """FUNCTION_BLOCK Node
VAR_INPUT next : POINTER TO Node; END_VAR
IF next <> 0 THEN next^(); END_IF
END_FUNCTION_BLOCK
PROGRAM Main VAR one, other : Node; END_VAR one(next := ADR(other)); END_PROGRAM
"""
    (scratch / "app.st").write_text(text)
    needs = tool("build", "app.st", "-o", "app.cdl", "--json").json["needs"]
    assert needs["stack"] is None and needs["tasks"] == 1


def test_all_limits_are_named_at_once(refused: Any) -> None:
    message = refused(BIG_DATA.replace("VAR small", "VAR_TEMP t : ARRAY[0..999] OF DINT; i : INT; END_VAR VAR small")
                      .replace("big[small] :=", "FOR i := 0 TO 999 DO t[i] := i; END_FOR big[small] := t[small] +"),
                      "--board", "mps2-an385/minimal")  # fmt: skip
    assert "24214 bytes of variables, the device has 4096" in message
    assert "bytes of stack, the device has 944" in message  # of 1024: guard, entry, frame of an interrupt


def test_a_board_gives_target_and_limits(refused: Any, tool: Any, scratch: Path) -> None:
    assert "MPS2 AN385 (minimal). It needs 3 tasks, the device has 2" in refused(
        tasks(3), "--board", "mps2-an385/minimal"
    )
    document = tool("build", "app.st", "-o", "app.cdl", "--board", "mps2-an385/standard", "--json").json
    assert document["target"] == "cortex-m3"
    assert document["needs"]["tasks"] == 3


def test_a_board_and_a_target_that_it_does_not_have_are_refused(tool: Any, scratch: Path) -> None:
    (scratch / "app.st").write_text(tasks(1))
    words = ("build", "app.st", "--board", "mps2-an385/standard", "--target")
    done = tool(*words, "cortex-m4f")
    assert done.status == 2
    assert done.err == (
        "plctool: MPS2 AN385 (standard) has a cortex-m3, not a cortex-m4f; leave the target out, or name a board "
        "that has it.\n"
    )
    assert not (scratch / "app.cdl").exists()
    assert tool(*words, "cortex-m4f", "--no-limits").status == 2
    assert "There is no target 'z80'" in tool(*words, "z80").err
    assert tool(*words, "cortex-m3").status == 0


def test_a_board_of_the_command_line_holds_before_the_target_of_the_project(tool: Any, scratch: Path) -> None:
    (scratch / "plc.toml").write_text('target = "cortex-m4f"\n')
    (scratch / "app.st").write_text(tasks(1))
    assert tool("build", "--board", "mps2-an385/standard", "--json").json["target"] == "cortex-m3"


def test_code_that_does_not_fit_names_the_largest_units(refused: Any) -> None:
    many = "\n".join(f"n := n * {i + 3} + {i}; m[n MOD 10] := n;" for i in range(400))
    text = f"PROGRAM Main VAR n : DINT; m : ARRAY[0..9] OF DINT; END_VAR\n{many}\nEND_PROGRAM"
    message = refused(text, "--board", "lm3s6965-board/full")
    assert "bytes of code, the device has 8192 (the largest: Main " in message


def test_a_device_file_has_limits_of_its_own(refused: Any, tool: Any, scratch: Path) -> None:
    (scratch / "device.toml").write_text(f'name = "IO-16"\nvendor = "Acme"\n{DEVICE}')
    (scratch / "app.io.toml").write_text('device = "device.toml"\n')
    message = refused(tasks(2))
    assert "does not fit Acme IO-16. It needs 2 tasks, the device has 1 (T0, T1)." in message
    assert "correct device.toml" in message
    (scratch / "device.toml").write_text(f'target = "cortex-m3"\n{DEVICE.replace("100", "30000")}')
    (scratch / "app.st").write_text(BIG_DATA)
    assert tool("build", "app.st", "-o", "app.cdl").status == 0


def test_what_fits_the_stack_runs_on_it(tool: Any, scratch: Path, refused: Any) -> None:
    """The limit is that of plcrt and of the simulator, which both stop a program that passes it."""
    text = """PROGRAM Main
VAR n : DINT; END_VAR
VAR_TEMP t : ARRAY[0..{last}] OF BYTE; i : DINT; END_VAR
FOR i := 0 TO {last} DO t[i] := DINT_TO_BYTE(n + i); END_FOR
n := n + 1 + t[n];
END_PROGRAM
"""
    (scratch / "fits.st").write_text(text.format(last=1024 * 1024 - 1280))
    assert tool("build", "fits.st", "-o", "fits.cdl").status == 0
    assert tool("run", "fits.cdl", "--cycles", "1", "--get", "Main.n").status == 0
    assert "bytes of stack, the device has 1047552" in refused(text.format(last=1024 * 1024))


def test_default_of_a_parameter_is_named_after_its_function(refused: Any) -> None:
    message = refused(SUM, "--board", "mps2-an385/minimal")
    assert "default of Sum(DINT).list 12000, default of Sum(INT).list 6000" in message


def test_each_default_of_a_parameter_is_listed(tool: Any, scratch: Path) -> None:
    (scratch / "app.st").write_text(SUM)
    assert tool("build", "app.st", "-o", "app.cdl").status == 0
    names = {v["name"] for v in tool("symbols", "app.cdl", "--json").json["variables"]}
    assert {"default of Sum(DINT).list", "default of Sum(INT).list"} <= names
