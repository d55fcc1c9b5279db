"""How much stack the C functions of a firmware take is read from its ELF file."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.firmware_stacks import FirmwareStacks
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import build_program
from plctool.errors import UsageError
from plctool.image.c_functions import interface_signature
from plctool.image.limits import Need
from plctool.image.targets import find_target

sys.path.append(str(Path(__file__).parents[1] / "same_results"))

from runners import RUNNERS

TARGETS = ("cortex-m0", "cortex-m3", "cortex-m4f", "rv32imac")
SOURCE = """\
#define KEPT __attribute__((noinline, noclone))
#define USE(bytes) volatile char a[bytes]; a[0] = (char)n; a[bytes - 1] = a[0]
typedef struct { const char *name; unsigned signature, version; void (*function)(int n); } CMP_EXT_FUNCTION;
static void (*volatile hook)(int n);
volatile int seen;
KEPT static void leaf(int n) { USE(100); seen = a[0]; }
KEPT static void deep(int n) { USE(200); leaf(n); seen = a[0]; }
KEPT static void jumps(int n) { leaf(n + 1); }
KEPT static void by_pointer(int n) { hook(n); seen = n; }
KEPT static void jumps_by_pointer(int n) { seen = n; hook(n); }
KEPT static void above_a_pointer(int n) { USE(16); by_pointer(n); seen = a[0]; }
KEPT static void itself(int n) { USE(40); if (n > 0) itself(n - 1); seen = a[0]; }
KEPT static void to_and_fro(int n);
KEPT static void fro(int n) { USE(8); to_and_fro(n - 1); seen = a[0]; }
static void to_and_fro(int n) { USE(8); if (n > 0) fro(n); seen = a[0]; }
__attribute__((section(".ram"))) KEPT void in_ram(int n) { USE(400); seen = a[0]; }
KEPT static void calls_ram(int n) { in_ram(n); seen = n; }
KEPT static void cases(int n) {
    switch (n) { case 0: seen = 7; break; case 1: seen = 3; leaf(1); break; case 2: leaf(2); break;
                 case 3: seen = 9; leaf(3); break; case 4: seen = n * n; break; case 5: leaf(n + n); break; }
}
void _start(void) { for (;;) { } }
"""
NAMES = ("leaf", "deep", "jumps", "by_pointer", "jumps_by_pointer", "above_a_pointer", "itself", "to_and_fro",
         "calls_ram", "cases")  # fmt: skip
SIGNATURES = {name: interface_signature(f"{name}(DINT)") for name in NAMES}
ENTRIES = [f'{{"{name}", {signature:#x}, 0x10000, {name}}}' for name, signature in SIGNATURES.items()]
TABLE = f"__attribute__((used)) const CMP_EXT_FUNCTION table[] = {{{', '.join(ENTRIES)}}};"
HEAD = 64  # bytes of saved registers and what is rounded up, at most, in each of these functions


@pytest.fixture(scope="module", params=TARGETS)
def target(request: pytest.FixtureRequest) -> str:
    RUNNERS[request.param].skip_without_tools()
    return str(request.param)


def linked(folder: Path, target: str, *flags: str) -> Path:
    runner = RUNNERS[target]
    own = [flag for flag in runner.flags if not flag.startswith("-Wl,")]
    source, program = folder / "firmware.c", folder / "firmware.elf"
    source.write_text(SOURCE + TABLE)
    places = ["-Wl,-Ttext=0x8000000", "-Wl,--section-start=.ram=0x20000000", "-Wl,-e,_start"]
    subprocess.run(
        [runner.compiler, *own, "-Os", "-nostdlib", *places, *flags, "-o", program, source, "-lgcc"], check=True
    )
    return program


@pytest.fixture(scope="module")
def stacks(target: str, tmp_path_factory: pytest.TempPathFactory) -> FirmwareStacks:
    return FirmwareStacks(linked(tmp_path_factory.mktemp(target), target, "-g"), find_target(target).machine)


@pytest.mark.parametrize(("name", "arrays", "functions"), [("leaf", 100, 1), ("deep", 300, 2), ("jumps", 100, 1)])
def test_frames_of_all_calls_count(stacks: FirmwareStacks, name: str, arrays: int, functions: int) -> None:
    size = stacks.of_function(SIGNATURES[name])
    assert size is not None and arrays <= size <= arrays + functions * HEAD


@pytest.mark.parametrize("name", ["by_pointer", "jumps_by_pointer", "above_a_pointer"])
def test_what_is_called_by_pointer_is_not_known(stacks: FirmwareStacks, name: str) -> None:
    assert stacks.of_function(SIGNATURES[name]) is None
    assert stacks.of_function(SIGNATURES[name], with_pointers=True) is not None


@pytest.mark.parametrize("name", ["itself", "to_and_fro", "calls_ram"])
def test_recursion_and_code_in_ram_are_not_known(stacks: FirmwareStacks, name: str) -> None:
    assert stacks.of_function(SIGNATURES[name]) is None
    assert stacks.of_function(SIGNATURES[name], with_pointers=True) is None or name == "calls_ram"


def test_a_choice_of_cases_is_no_pointer_where_it_can_be_told_apart(stacks: FirmwareStacks, target: str) -> None:
    size = stacks.of_function(SIGNATURES["cases"])
    assert size is None if target == "rv32imac" else size is not None and size >= 100


def test_what_is_not_in_the_firmware_is_not_known(stacks: FirmwareStacks) -> None:
    assert stacks.of_function(interface_signature("leaf(INT)")) is None
    assert stacks.of_function(0) is None


def test_without_debugging_information_nothing_is_known(target: str, tmp_path: Path) -> None:
    stacks = FirmwareStacks(linked(tmp_path, target, "-fno-asynchronous-unwind-tables"), find_target(target).machine)
    assert stacks.of_function(SIGNATURES["leaf"]) is None


def test_a_damaged_file_is_refused_or_nothing_is_known(target: str, tmp_path: Path) -> None:
    program = linked(tmp_path, target, "-g")
    whole = program.read_bytes()
    for kept in range(0, len(whole), 97):
        program.write_bytes(whole[:kept])
        try:
            FirmwareStacks(program, find_target(target).machine).of_function(SIGNATURES["deep"])
        except UsageError as error:
            assert "cannot be read" in str(error)


def test_changed_bytes_are_refused_or_do_no_harm(target: str, tmp_path: Path) -> None:
    program = linked(tmp_path, target, "-g")
    whole, random = program.read_bytes(), Random(7)
    for _ in range(100):
        data = bytearray(whole)
        for at in (random.randrange(64), random.randrange(len(data)), len(data) - 1 - random.randrange(1000)):
            data[at] = random.randrange(256)
        program.write_bytes(data)
        with suppress(UsageError):
            FirmwareStacks(program, find_target(target).machine).of_function(SIGNATURES["deep"])


# ---- a program that calls one ----------------------------------------------------------------------------------------


def stack_needed(target: str, function: str, stacks: FirmwareStacks | None) -> Need:
    text = (
        f"{{attribute 'external' := '{function}'}} FUNCTION Own VAR_INPUT n : DINT; END_VAR END_FUNCTION "
        "PROGRAM Main Own(1); END_PROGRAM"
    )
    checked = check_sources([Source("own.st", text)])
    assert checked.program, checked.diagnostics
    return build_program(checked.program, Options(find_target(target), firmware=stacks)).needs["stack"]


def test_a_program_is_counted_with_its_functions(stacks: FirmwareStacks, target: str) -> None:
    without, need = stack_needed(target, "deep", None), stack_needed(target, "deep", stacks)
    of_function = stacks.of_function(SIGNATURES["deep"])
    assert of_function is not None and need.amount == without.amount + of_function
    assert (without.at_least, need.at_least) == (True, False)
    assert ("deep", of_function) in need.parts


def test_what_is_not_known_makes_it_at_least(stacks: FirmwareStacks, target: str) -> None:
    assert stack_needed(target, "by_pointer", stacks).at_least
