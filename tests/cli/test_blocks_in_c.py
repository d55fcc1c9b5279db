"""Function blocks whose body and methods are implemented in C: their header, and the simulator that calls them."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import _plccore
import pytest
from conftest import Tool

from plctool.compiler import compile_sources
from plctool.debug.symbols import symbol_path
from plctool.errors import DeviceError
from plctool.sim import Simulator

ROOT = Path(__file__).parents[2]
CC = shutil.which("gcc") or shutil.which("cc")
INCLUDE = [f"-I{ROOT / 'firmware' / folder}" for folder in ("port/sim", "include")]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", *INCLUDE]

BLOCK = """
TYPE Limits : STRUCT low, high : REAL; next : POINTER TO Limits; END_STRUCT END_TYPE
{attribute 'external' := 'acme_pid'}
{attribute 'version' := '1.2.0.4'}
FUNCTION_BLOCK AcmePid
VAR_INPUT setpoint, actual : REAL; END_VAR
VAR_OUTPUT y : REAL; END_VAR
VAR_IN_OUT limits : Limits; END_VAR
VAR gain : REAL; calls : UDINT; me : POINTER TO AcmePid; timer : TON; END_VAR
METHOD FB_Init : BOOL
VAR_INPUT bInitRetains, bInCopyCode : BOOL; gain : REAL; END_VAR
END_METHOD
METHOD Reset : BOOL
VAR_INPUT hard : BOOL; new : REAL; END_VAR
VAR_OUTPUT old : REAL; END_VAR
END_METHOD
METHOD Label : STRING[20]
VAR_INPUT name : STRING; END_VAR
END_METHOD
END_FUNCTION_BLOCK
"""
IMPLEMENTATION = """
#include <string.h>
#include "acmeItf.h"

void acme_pid__fb_init(acme_pid_fb_init_struct *p)
{
    p->pInstance->gain = p->gain;
    p->fb_init = 1;
}

void acme_pid__main(acme_pid_main_struct *p)
{
    acme_pid_struct *pid = p->pInstance;
    RTS_REAL32 y = pid->gain * (pid->setpoint - pid->actual);

    pid->y = y > pid->limits.address->high ? pid->limits.address->high : y;
    pid->limits.address->low += 1;
    pid->calls++;
}

void acme_pid__reset(acme_pid_reset_struct *p)
{
    *p->old = p->pInstance->y;
    p->pInstance->y = p->new;
    p->reset = p->hard;
}

void acme_pid__label(acme_pid_label_struct *p)
{
    strcpy(p->result, p->name);
    strcat(p->result, "!");
}

static const CMP_EXT_FUNCTION functions[] = {ACME_EXT_FUNCTIONS};

RTS_RESULT acme_register(void);
RTS_RESULT acme_register(void)
{
    return CMRegisterExternal(functions, RTS_COUNT(functions));
}
"""
PROGRAM = """
PROGRAM Main
VAR
    slow : AcmePid(gain := 2.5); fast : AcmePid(gain := 100); limits : Limits := (high := 50); y, old, set : REAL;
    ok : BOOL; text : STRING; n : UDINT;
END_VAR
slow(setpoint := 4, actual := 1, limits := limits, y => y);
fast(setpoint := 4, actual := 1, limits := limits);
n := n + 1;
ok := slow.Reset(n = 2, 3.5, old => old);
text := fast.Label('Anna');
set := slow.y;
END_PROGRAM
"""

needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")


def compile_c(*words: str) -> None:
    assert CC is not None
    subprocess.run([CC, *FLAGS, *words], check=True, timeout=60)


def image_of(text: str) -> bytes:
    path = Path("main.st")
    path.write_text(text, "utf-8")
    return compile_sources([path]).image


@pytest.fixture
def device(tool: Tool) -> Iterator[Simulator]:
    """A simulator with the component of the vendor, and no program that uses it."""
    Path("acme.st").write_text(BLOCK, "utf-8")
    assert tool("export-itf", "acme.st").status == 0
    compile_c("-c", "acme.c", "-o", "frame.o")
    Path("acme.c").write_text(IMPLEMENTATION, "utf-8")
    compile_c("-shared", "-fPIC", "acme.c", "-o", "acme.so")
    ctypes.CDLL(_plccore.__file__, ctypes.RTLD_GLOBAL)
    register = ctypes.CDLL(str(Path("acme.so").resolve())).acme_register
    with Simulator(image_of("PROGRAM Main END_PROGRAM")) as plc:
        assert register() == 0
        yield plc


@needs_compiler
def test_body_methods_and_fb_init_run_in_c_on_their_instance(device: Simulator) -> None:
    path = Path("main.st")
    path.write_text(BLOCK + PROGRAM, "utf-8")
    built = compile_sources([path])
    built.symbols.save(symbol_path(Path("main.cdl")))
    Path("main.cdl").write_bytes(built.image)
    device.flash("main.cdl")
    device.run_cycles(2)
    names = ["y", "fast.y", "old", "set", "ok", "text", "limits.low", "slow.calls", "fast.calls"]
    values = device.read_all([f"Main.{name}" for name in names]).values()
    assert list(values) == [7.5, 50.0, 7.5, 3.5, True, "Anna!", 4.0, 2, 2]


@needs_compiler
@pytest.mark.parametrize(
    ("old", "new", "refusal"),
    [
        ("calls : UDINT; me", "calls : LINT; me", r"acme_pid__main \(other parameters\)"),
        ("low, high : REAL;", "high, low : REAL;", r"acme_pid__main \(other parameters\)"),
        ("new : REAL;", "new : LREAL;", r"acme_pid__reset \(other parameters\)"),
        ("1.2.0.4", "1.2.1.0", r"acme_pid__main \(other version\)"),
        ("1.2.0.4", "1.3.0.0", r"acme_pid__main \(other version\)"),
        ("'acme_pid'", "'acme_pi'", r"acme_pi__main \(missing\)"),
    ],
)
def test_image_of_another_structure_or_version_is_refused_by_name(
    device: Simulator, old: str, new: str, refusal: str
) -> None:
    with pytest.raises(DeviceError, match=refusal):
        device.flash(image_of(BLOCK.replace(old, new) + PROGRAM))


@needs_compiler
def test_image_for_an_older_patch_is_taken(device: Simulator) -> None:
    device.flash(image_of(BLOCK.replace("1.2.0.4", "1.2.0.3") + PROGRAM))


@pytest.mark.parametrize("mock", ["", "MOCK(pid);"])
def test_block_that_only_the_device_has_raises_in_unit_tests_unless_mocked(tool: Tool, mock: str) -> None:
    variables = "VAR pid : AcmePid(gain := 1); l : Limits; END_VAR"
    test = f"TEST 'controlled'\n{variables}\n{mock} pid(limits := l); ASSERT_EQ(pid.y, 0.0); END_TEST"
    Path("acme.st").write_text(BLOCK + test, "utf-8")
    done = tool("test", "acme.st")
    assert (done.status == 0) == bool(mock), done.out
    assert "never used" not in done.err
    if not mock:
        assert "UNRESOLVED_EXTREFS" in done.out or "C function" in done.out
