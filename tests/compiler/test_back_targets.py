"""Every target: the same program links to position independent code; compiler calls become imports or errors."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import pytest
from back_support import POS, ProgramBuilder, Running, binary, build, const, load, place
from elftools.dwarf.callframe import FDE
from elftools.elf.elffile import ELFFile

from plctool.compiler import Level, compile_sources
from plctool.compiler.codegen.compiler_calls import COMPILER_CALLS
from plctool.compiler.codegen.emit import emit_object
from plctool.compiler.codegen.link import link
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.memory_functions import MEMORY_FUNCTIONS, memory_object
from plctool.compiler.codegen.partition import Part
from plctool.compiler.codegen.relocations import OutOfReach, stub
from plctool.compiler.typed.nodes import (
    Assign,
    BinaryOp,
    Call,
    Case,
    Convert,
    Expr,
    External,
    For,
    IndexPlace,
    Pou,
    PouKind,
    ScalarInit,
    Statement,
    Storage,
    TypedProgram,
    Variable,
)
from plctool.core import lib
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.iec.types import DINT, INT, LINT, LREAL, REAL, ArrayType, StringType
from plctool.image.file import parse_image
from plctool.image.targets import TARGETS, Machine, Target, find_target, host_target

ALL = list(TARGETS.values())


def everything() -> TypedProgram:
    """Uses single and double arithmetic, 64-bit division, strings, a switch, large copies and run-time checks."""
    p = ProgramBuilder()
    x, y = p.variable("x", REAL, ScalarInit(1.5)), p.variable("y", LREAL)
    n, wide, i = p.variable("n", DINT), p.variable("wide", LINT), p.variable("i", INT)
    a, b = p.variable("a", ArrayType(INT, ((0, 499),))), p.variable("b", ArrayType(INT, ((0, 499),)))
    s, t = p.variable("s", StringType(80), ScalarInit("hello")), p.variable("t", StringType(20))
    kept = p.variable("kept", DINT, ScalarInit(7), Area.RETAIN)

    def assign(v: Variable, value: Expr) -> Assign:
        return Assign(place(v), value, POS)

    branches: list[tuple[list[tuple[int, int]], list[Statement]]] = [
        ([(k, k)], [assign(n, const(k * k * 977, DINT))]) for k in range(12)
    ]
    return p.program(
        assign(x, binary(BinaryOp.DIV, binary(BinaryOp.ADD, load(x), const(0.1, REAL)), const(3.0, REAL))),
        assign(y, binary(BinaryOp.MUL, Convert(load(x), LREAL, POS), const(0.7, LREAL))),
        assign(n, Convert(load(x), DINT, POS)),
        assign(n, Convert(load(y), DINT, POS)),
        assign(wide, binary(BinaryOp.DIV, load(wide), Convert(load(n), LINT, POS))),
        Case(load(i), branches, [], POS),
        assign(a, load(b)),
        For(
            place(i),
            const(0),
            const(499),
            const(1),
            [Assign(IndexPlace(place(a), [load(i)], INT, POS), load(i), POS)],
            POS,
        ),
        Assign(IndexPlace(place(b), [load(i)], INT, POS), const(1), POS),
        assign(t, load(s)),
        assign(kept, binary(BinaryOp.ADD, load(kept), const(1, DINT))),
    )


@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize("target", ALL, ids=lambda t: t.name)
def test_a_program_with_everything_links(target: Target, level: int) -> None:
    built = build(everything(), target.name, level)
    image = parse_image(built.image)
    assert image.device_id == getattr(lib, target.device_id)
    size = target.pointer_size
    assert [e.offset for e in image.externals] == [size * i for i in range(len(image.externals))]
    calls = {e.name for e in image.externals} - {"iecraise"}
    assert bool(calls) == target.stubs
    assert all(COMPILER_CALLS[name].signature == e.signature for e in image.externals if (name := e.name) in calls)
    thumb = target.machine in (Machine.THUMB, Machine.THUMB_V6M)
    entries = [t.entry for t in image.tasks] + list(image.functions.values())
    assert all(entry % 2 == int(thumb) for entry in entries)
    assert built.symbols.address_to_line(entries[0]) is None or built.symbols.pous[0].name == "Main"
    assert built.sizes["Main"] > 100


@pytest.mark.parametrize("target", ALL, ids=lambda t: t.name)
def test_builds_are_reproducible(target: Target) -> None:
    assert build(everything(), target.name).image == build(everything(), target.name).image


def test_single_precision_needs_no_calls_with_an_fpu() -> None:
    """No literal becomes double and no conversion is a library call."""
    p = ProgramBuilder()
    x, n = p.variable("x", REAL), p.variable("n", DINT)
    program = p.program(
        Assign(place(x), binary(BinaryOp.MUL, load(x), const(0.1, REAL)), POS),
        Assign(place(n), Convert(load(x), DINT, POS), POS),
    )
    for name in ("cortex-m4f", "cortex-m7", "x86_64-linux", "aarch64-linux", "armv7-linux"):
        assert parse_image(build(program, name).image).externals == []


PROBES = {"x86_64-linux": bytes.fromhex("48c7042400000000"), "aarch64-linux": bytes.fromhex("ff0300f9")}  # [sp] := 0


@pytest.mark.parametrize("target", PROBES)
@pytest.mark.parametrize("level", [0, 1, 2, 3, "s"])
@pytest.mark.parametrize(("bytes_", "probed"), [(400, False), (20_000, True), (17_039_360, True)])
def test_each_page_of_a_large_frame_is_touched(tmp_path, target: str, level: Level, bytes_: int, probed: bool) -> None:
    path = tmp_path / "frame.st"
    path.write_text(
        f"""FUNCTION Far : INT VAR_INPUT i : DINT; END_VAR VAR field : ARRAY[1..{bytes_}] OF SINT; END_VAR
field[i] := 1;
Far := field[i + 1];
END_FUNCTION
PROGRAM Main VAR n : INT; i : DINT; END_VAR n := Far(i); END_PROGRAM
"""
    )
    code = parse_image(compile_sources([path], target=target, level=level, checks="none", limits=False).image).code
    assert (PROBES[target] in code) == probed


def test_armv7_linux_has_no_frame_beyond_the_guard(tmp_path: Path) -> None:
    """Its frames are not touched page by page."""
    path = tmp_path / "frame.st"
    path.write_text(
        """FUNCTION Far : SINT VAR_INPUT i : DINT; END_VAR VAR field : ARRAY[0..4_200_000] OF SINT; END_VAR
Far := field[i];
END_FUNCTION
PROGRAM Main VAR n : SINT; i : DINT; END_VAR n := Far(i); END_PROGRAM
"""
    )
    with pytest.raises(UsageError, match="stack"):
        compile_sources([path], target="armv7-linux")


@pytest.mark.parametrize(
    ("machine", "pointer", "target"),
    [
        ("armv7l", 4, "armv7-linux"),
        ("aarch64", 8, "aarch64-linux"),
        ("aarch64", 4, "armv7-linux"),  # Raspberry Pi OS of 32 bits has a kernel of 64
        ("x86_64", 8, "x86_64-linux"),
        ("riscv64", 8, "x86_64-linux"),
    ],
)
def test_this_machine_has_a_target(machine: str, pointer: int, target: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: machine)
    monkeypatch.setattr("struct.calcsize", lambda _: pointer)
    assert host_target() == target


def test_an_unknown_target_is_refused_with_the_names_of_the_others() -> None:
    with pytest.raises(UsageError, match="cortex-m3"):
        find_target("z80")


@pytest.mark.parametrize("target", ALL, ids=lambda t: t.name)
def test_a_large_program_is_compiled_in_parts(target: Target, monkeypatch: pytest.MonkeyPatch) -> None:
    p = ProgramBuilder()
    x, n = p.variable("x", REAL, ScalarInit(2.0)), p.variable("n", DINT)
    small = Pou("Small", PouKind.FUNCTION, POS, result=Variable("Small", DINT, Storage.LOCAL, POS))
    assert small.result is not None
    small.locals.append(small.result)
    small.body.append(Assign(place(small.result), Convert(load(x), DINT, POS), POS))
    call = Call(small, [], DINT, POS)
    sums: list[Statement] = [Assign(place(n), binary(BinaryOp.ADD, load(n), call), POS)]
    program = p.program()
    program.tasks[0].programs[:] = [Pou(f"P{k}", PouKind.PROGRAM, POS, body=sums * 5) for k in range(9)]
    monkeypatch.setattr("plctool.compiler.codegen.partition._WHOLE", 40)
    built = build(program, target.name)
    assert {unit.name for unit in built.symbols.pous} == {"Small", *(f"P{k}" for k in range(9))}
    if target.name == "x86_64-linux":
        run = Running(built)
        run.cycle()
        assert run["n"] == 90


def test_parts_are_the_same_without_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("plctool.compiler.codegen.partition._WHOLE", 40)
    image = build(everything()).image
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    assert build(everything()).image == image


# ---- the linker alone ----


def ir(body: str, target: Target) -> str:
    return f'target triple = "{target.triple}"\n{body}'


@pytest.mark.parametrize("name", ["x86_64-linux", "cortex-m3"])
def test_an_undefined_function_is_named(name: str) -> None:
    target = find_target(name)
    text = ir("declare void @mystery()\ndefine void @entry() {\n call void @mystery()\n ret void\n}", target)
    with pytest.raises(UsageError, match="mystery"):
        link([emit_object(Part(text), Options(target))], target, ["entry"], [])


@pytest.mark.parametrize("target", ALL, ids=lambda t: t.name)
def test_writable_data_are_refused(target: Target) -> None:
    entry = "define i32 @entry() {\n %o = atomicrmw add ptr @state, i32 1 monotonic\n ret i32 %o\n}"
    text = ir(f"@state = internal global i32 5\n{entry}", target)
    with pytest.raises(UsageError, match=r"\.data|__atomic|__sync"):
        link([emit_object(Part(text), Options(target))], target, ["entry"], [])


def test_absolute_addresses_are_refused() -> None:
    target = find_target("x86_64-linux")
    text = ir(
        "@table = internal constant [2 x ptr] [ptr @entry, ptr @other]\n"
        "define ptr @entry(i64 %i) {\n"
        " %p = getelementptr ptr, ptr @table, i64 %i\n %f = load ptr, ptr %p\n ret ptr %f\n}\n"
        "define void @other() {\n ret void\n}",
        target,
    )
    with pytest.raises(UsageError, match=r"position independent|writable"):
        link([emit_object(Part(text), Options(target))], target, ["entry"], [])


@pytest.mark.parametrize("target", ALL, ids=lambda t: t.name)
def test_frames_of_memory_functions_are_known(target: Target) -> None:
    """The call stack of an exception in one of them leads on to its caller."""
    dwarf = ELFFile(io.BytesIO(memory_object(target))).get_dwarf_info(relocate_dwarf_sections=False)
    frames = [entry for entry in dwarf.CFI_entries() if isinstance(entry, FDE)]
    assert len(frames) == len(MEMORY_FUNCTIONS)


def test_unreachable_sections_are_left_out() -> None:
    target = find_target("x86_64-linux")
    text = ir('define void @entry() {\n ret void\n}\ndefine void @far() section ".text.far" {\n ret void\n}\n', target)
    linked = link([emit_object(Part(text), Options(target))], target, ["entry"], [])
    assert "far" not in linked.symbols


@pytest.mark.parametrize("slot", [0, 1, 31, 32, 60])
def test_stubs_jump_through_their_slot(slot: int) -> None:
    """Each stub, run by hand."""
    ldr, imm, bx = struct.unpack("<HHH", stub(Machine.THUMB, slot))
    assert (ldr, imm >> 12, imm & 0xFFF, bx) == (0xF8D9, 12, 4 * slot, 0x4760)
    code = struct.unpack("<7H", stub(Machine.THUMB_V6M, slot))
    assert code[0] == 0xB410 and code[1] == 0x464C and code[5] == 0xBC10 and code[6] == 0x4760
    assert (code[2] & 0xFF) + 4 * (code[3] >> 6 & 31) == 4 * slot
    lw, jr = struct.unpack("<II", stub(Machine.RISCV32, slot))
    assert (lw >> 20, lw >> 15 & 31, lw >> 7 & 31, jr >> 15 & 31, jr & 0x7F) == (4 * slot, 27, 6, 6, 0x67)


@pytest.mark.parametrize(("machine", "slots"), [(Machine.THUMB, 1024), (Machine.THUMB_V6M, 64), (Machine.RISCV32, 512)])
def test_a_stub_out_of_reach_is_an_error(machine: Machine, slots: int) -> None:
    assert stub(machine, slots - 1)
    with pytest.raises(OutOfReach):
        stub(machine, slots)


@pytest.mark.parametrize("name", ["cortex-m0", "cortex-m3", "rv32imac"])
def test_a_program_with_too_many_imports_is_refused(name: str) -> None:
    target = find_target(name)
    text = ir("define double @entry(double %x) {\n %y = fadd double %x, %x\n ret double %y\n}", target)
    imports = [External(f"f{i}", 0, 0) for i in range(1024)]
    with pytest.raises(UsageError, match=r"too large for .* imports"):
        link([emit_object(Part(text), Options(target))], target, ["entry"], imports)


def test_constants_are_reached_at_any_distance_from_the_code() -> None:
    """Many functions between the first one and its constants."""
    p = ProgramBuilder()
    y = p.variable("y", StringType(40))
    statements: list[Statement] = [
        Assign(place(y), const(f"text number {k} that is long enough", StringType(33)), POS) for k in range(300)
    ]
    pous = [Pou(f"P{k}", PouKind.PROGRAM, POS, body=statements[k : k + 1]) for k in range(300)]
    program = p.program()
    program.tasks[0].programs[:] = pous
    for target in ALL:
        assert len(parse_image(build(program, target.name).image).code) > 300 * 33
