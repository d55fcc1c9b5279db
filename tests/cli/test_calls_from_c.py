"""What {attribute 'from_c'} offers: a component in C calls functions of the program and uses its variables, by name."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import _plccore
import online_programs
import pytest
from conftest import Tool

from plctool.compiler import CompileError, compile_sources
from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.sim import Simulator

ROOT = Path(__file__).parents[2]
CC = shutil.which("cc")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}/firmware/include", f"-I{ROOT}/firmware/port/sim"]
TYPES = """
TYPE
    Mode : (idle, busy := 5);
    Limits : STRUCT low, high : REAL; END_STRUCT
END_TYPE
"""
PROGRAM = """
VAR_GLOBAL
    {attribute 'from_c'}
    limits : Limits := (high := 50);
    zero : DINT;
    kicks : DINT;
END_VAR
{attribute 'from_c'}
FUNCTION Scale : LREAL
VAR_INPUT
    raw : INT;
    who : STRING[10];
    mode : Mode;
END_VAR
VAR_OUTPUT
    valid : BOOL;
END_VAR
VAR_IN_OUT
    total : DINT;
END_VAR
valid := who = 'Anna' AND mode = Mode.busy;
total := total + raw;
IF raw < 0 THEN
    total := total / zero;
END_IF
Scale := raw * 2.5;
END_FUNCTION
{attribute 'from_c'}
FUNCTION Kick
kicks := kicks + 1;
END_FUNCTION
FUNCTION_BLOCK Pump
VAR
    n : DINT;
END_VAR
{attribute 'from_c'}
METHOD Add : DINT
VAR_INPUT
    by : DINT;
END_VAR
n := n + by;
Add := n;
END_METHOD
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    pump : Pump;
    pumps : ARRAY[1..2] OF Pump;
    {attribute 'from_c'}
    count : UDINT;
END_VAR
count := count + 1;
pump(); pumps[1]();
END_PROGRAM
{attribute 'from_c'}
PROGRAM Extra
kicks := kicks + 100;
END_PROGRAM
CONFIGURATION c
    RESOURCE r ON cpu
        TASK t(INTERVAL := T#10ms, PRIORITY := 1);
        PROGRAM Main WITH t : Main;
    END_RESOURCE
END_CONFIGURATION
"""
COMPONENT = """
#include <string.h>
#include "mainItf.h"

static APP_NAMED scale;
RTS_RESULT find_scale(void);
RTS_RESULT find_scale(void)
{
    return AppFindFunctionByName("SCALE", SCALE_SIGNATURE, &scale);
}
RTS_RESULT call_scale(int raw, int *total, double *result);
RTS_RESULT call_scale(int raw, int *total, double *result)
{
    scale_call p = {.raw = (RTS_I16)raw, .who = "Anna", .mode = Mode_busy, .total = *total};
    RTS_RESULT done = AppCallFunction(&scale, &p, sizeof p);
    *total = p.total;
    *result = p.valid ? p.scale : -1;
    return done;
}
RTS_RESULT add(const char *name, int by, int *sum);
RTS_RESULT add(const char *name, int by, int *sum)
{
    pump_add_call p = {by, 0};
    APP_NAMED method;
    RTS_RESULT result = AppFindFunctionByName(name, MAIN_PUMP_ADD_SIGNATURE, &method);
    if (result == ERR_OK)
        result = AppCallFunction(&method, &p, sizeof p);
    *sum = p.add;
    return result;
}
RTS_RESULT call_plain(const char *name);
RTS_RESULT call_plain(const char *name)
{
    APP_NAMED function;
    RTS_RESULT result = AppFindFunctionByName(name, KICK_SIGNATURE, &function);
    return result == ERR_OK ? AppCallFunction(&function, NULL, 0) : result;
}
RTS_RESULT raise_high(void);
RTS_RESULT raise_high(void)
{
    APP_NAMED variable;
    limits_value value;
    RTS_RESULT result = AppFindVariableByName("Limits", LIMITS_SIGNATURE, &variable);
    if (result == ERR_OK)
        result = AppReadVariable(&variable, &value, sizeof value);
    value.high += 1;
    if (result == ERR_OK)
        result = AppWriteVariable(&variable, &value, sizeof value);
    if (result == ERR_OK && AppWriteVariable(&variable, &value, sizeof value - 1) != ERR_SIZE_MISMATCH)
        return ERR_FAILED;
    if (AppFindVariableByName("limits", LIMITS_SIGNATURE + 1, &variable) != ERR_TYPE_MISMATCH)
        return ERR_FAILED;
    if (AppFindVariableByName(SCALE_NAME, SCALE_SIGNATURE, &variable) != ERR_NO_OBJECT)
        return ERR_FAILED;
    return AppFindVariableByName(MAIN_COUNT_NAME, MAIN_COUNT_SIGNATURE, &variable) == ERR_OK ? result : ERR_FAILED;
}
"""

needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")


class Component:
    """The C functions of the component."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self.library = library

    def scale(self, raw: int, total: int = 1) -> tuple[int, int, float]:
        sum_, result = ctypes.c_int(total), ctypes.c_double()
        done = self.library.call_scale(raw, ctypes.byref(sum_), ctypes.byref(result))
        return done, sum_.value, result.value

    def add(self, name: str, by: int) -> tuple[int, int]:
        total = ctypes.c_int()
        return self.library.add(name.encode(), by, ctypes.byref(total)), total.value


def build(text: str, name: str = "main.cdl") -> str:
    path = Path("main.st")
    path.write_text(text, "utf-8")
    built = compile_sources([path])
    built.symbols.save(symbol_path(Path(name)))
    Path(name).write_bytes(built.image)
    return name


@pytest.fixture
def component(tool: Tool) -> Component:
    Path("main.st").write_text(TYPES + PROGRAM, "utf-8")
    done = tool("export-itf", "main.st")
    assert done.status == 0, done.err
    assert not Path("main.c").exists()
    Path("acme.c").write_text(COMPONENT, "utf-8")
    assert CC is not None
    subprocess.run([CC, *FLAGS, "-shared", "-fPIC", "acme.c", "-o", "acme.so"], check=True, timeout=60)
    ctypes.CDLL(_plccore.__file__, ctypes.RTLD_GLOBAL)
    return Component(ctypes.CDLL(str(Path("acme.so").resolve())))


@pytest.fixture
def plc(component: Component) -> Iterator[Simulator]:
    name = build(TYPES + PROGRAM)
    with Simulator(Path(name).read_bytes()) as plc:
        plc.flash(name)
        yield plc


@needs_compiler
def test_functions_methods_programs_and_variables_are_found_by_name(component: Component, plc: Simulator) -> None:
    plc.run_cycles(1)
    assert component.library.find_scale() == lib.ERR_OK
    assert component.scale(3) == (lib.ERR_OK, 4, 7.5)
    assert [component.add("main.PUMP.add", n) for n in (5, 6)] == [(lib.ERR_OK, 5), (lib.ERR_OK, 11)]
    assert component.add("Main.pumps[2].Add", 7) == (lib.ERR_OK, 7)
    assert [component.library.call_plain(name) for name in (b"Kick", b"Extra")] == [lib.ERR_OK] * 2
    assert component.library.raise_high() == lib.ERR_OK
    values = plc.read_all(["kicks", "limits.high", "Main.pump.n", "Main.pumps[2].n"]).values()
    assert list(values) == [101, 51.0, 11, 7]
    for name in ("Main.pump", "Add", "Kic", "Kicks", ""):
        assert component.add(name, 1)[0] == lib.ERR_NO_OBJECT
    assert component.add("Kick", 1)[0] == lib.ERR_APP_SIGNATURE_MISMATCH


@needs_compiler
def test_exception_in_a_call_is_the_program_s_and_a_reset_makes_it_callable_again(
    component: Component, plc: Simulator
) -> None:
    plc.run_cycles(1)
    component.library.find_scale()
    assert component.scale(-3, 9)[:2] == (lib.ERR_EXCEPTION, 9)
    status = plc.status()
    assert status.exception is not None
    assert (status.exception.name, str(status.exception.pou).upper()) == ("DIVIDEBYZERO", "SCALE")
    assert any(entry.text.startswith("Call from C: ") for entry in plc.log())
    assert component.scale(3)[0] == lib.ERR_EXCEPTION
    assert component.library.raise_high() == lib.ERR_OK  # values can be looked at
    plc.reset("warm")
    assert component.scale(3) == (lib.ERR_OK, 4, 7.5)


@needs_compiler
def test_another_program_has_to_be_searched_again(component: Component, plc: Simulator) -> None:
    component.library.find_scale()
    plc.flash(build(TYPES + PROGRAM.replace("raw * 2.5", "raw * 3.5"), "other.cdl"))
    assert component.scale(2)[0] == lib.ERR_INVALID_HANDLE
    assert component.library.find_scale() == lib.ERR_OK
    assert component.scale(2) == (lib.ERR_OK, 3, 7.0)
    plc.flash(build(TYPES + PROGRAM.replace("raw : INT", "raw : DINT"), "third.cdl"))
    assert component.library.find_scale() == lib.ERR_APP_SIGNATURE_MISMATCH
    plc.flash(build(TYPES.replace("low, high", "high, low") + PROGRAM, "fourth.cdl"))
    assert component.library.raise_high() == lib.ERR_TYPE_MISMATCH
    plc.reset("origin")
    assert component.library.find_scale() == lib.ERR_APP_NOT_LOADED
    assert component.scale(2)[0] == lib.ERR_APP_NOT_LOADED


@needs_compiler
def test_online_change_makes_what_was_found_stale(component: Component, plc: Simulator) -> None:
    plc.start()
    plc.run_cycles(1)
    component.library.find_scale()
    component.library.call_plain(b"Kick")
    changed = TYPES + PROGRAM.replace("raw * 2.5", "raw * 3.5")
    built = online_programs.built(Path(), changed, base=plc.symbols())
    built.symbols.save(symbol_path(Path("changed.cdl")))
    Path("changed.cdl").write_bytes(built.image)
    plc.change("changed.cdl")
    assert component.scale(2)[0] == lib.ERR_INVALID_HANDLE
    assert component.library.find_scale() == lib.ERR_OK
    assert component.scale(2) == (lib.ERR_OK, 3, 7.0)
    assert plc.read("kicks") == 1


F = "{attribute 'from_c'}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{F}\nFUNCTION G VAR_INPUT p : POINTER TO INT; END_VAR END_FUNCTION", "G, p cannot be used .* a pointer"),
        (f"{F}\nFUNCTION G : REFERENCE TO INT END_FUNCTION", "the result of G cannot be used"),
        (f"{F}\nFUNCTION G VAR_INPUT a : ANY_INT; END_VAR END_FUNCTION", "parameters of any type"),
        (f"{F}\nFUNCTION G VAR_IN_OUT a : ARRAY[*] OF INT; END_VAR END_FUNCTION", "any length"),
        (f"{F}\nFUNCTION G VAR_IN_OUT t : TON; END_VAR END_FUNCTION", "instance of a function block"),
        (f"{F}\nFUNCTION {'G' * 60} END_FUNCTION", "at most 59 characters"),
        (f"FUNCTION G VAR_INPUT\n{F}\na : INT; END_VAR END_FUNCTION", "not of G"),
        (f"FUNCTION_BLOCK B VAR\n{F}\na : INT; END_VAR END_FUNCTION_BLOCK", "not of B"),
        (f"VAR_GLOBAL\n{F}\nt : TON; END_VAR", "instance of a function block"),
        (f"VAR_GLOBAL\n{F}\nx AT %MX0.3 : BOOL; END_VAR", "a bit in a byte"),
        (f"{{attribute 'external' := 'g'}}\n{F}\nFUNCTION G END_FUNCTION", "is in C itself"),
        (
            f"FUNCTION_BLOCK B\n{F}\nMETHOD M END_METHOD END_FUNCTION_BLOCK\n"
            "VAR_GLOBAL b : ARRAY[1..300] OF B; END_VAR",
            "300 instances",
        ),
    ],
)
def test_what_c_cannot_use_is_an_error_that_says_why(tool: Tool, text: str, message: str) -> None:
    path = Path("main.st")
    path.write_text(f"{text}\nPROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM", "utf-8")
    with pytest.raises(CompileError, match=message):
        compile_sources([path])
