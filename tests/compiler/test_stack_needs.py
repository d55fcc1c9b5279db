"""How much stack a program needs is read from its machine code: the same chain of calls on every target."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.codegen.calls import branches
from plctool.compiler.codegen.stack import CallGraph
from plctool.errors import UsageError
from plctool.image.c_functions import C_FUNCTIONS
from plctool.image.targets import TARGETS, Machine, find_target

LEVELS = (0, 2, "s")
# Arrays that stay, in functions that are called from two places each, so that they are not inlined at -O0 and -Os.
CHAIN = """FUNCTION Leaf : DINT
VAR_INPUT n : DINT; END_VAR
VAR t : ARRAY[0..99] OF DINT; i : DINT; END_VAR
FOR i := 0 TO 99 DO t[i] := n * i; END_FOR
Leaf := t[n];
END_FUNCTION
FUNCTION Branch : DINT
VAR_INPUT n : DINT; END_VAR
VAR t : ARRAY[0..49] OF DINT; i : DINT; END_VAR
FOR i := 0 TO 49 DO t[i] := Leaf(i) XOR n; END_FOR
Branch := Leaf(t[n]) + t[n + 1];
END_FUNCTION
FUNCTION Wide : DINT
VAR_INPUT n : DINT; END_VAR
VAR t : ARRAY[0..139] OF DINT; i : DINT; END_VAR
FOR i := 0 TO 139 DO t[i] := n + i; END_FOR
Wide := t[n];
END_FUNCTION
PROGRAM Main
VAR a, b : DINT; END_VAR
a := Branch(a) + Wide(b);
b := Branch(b) - Wide(a);
END_PROGRAM
"""
LEAF, BRANCH, WIDE = 400, 200, 560


@pytest.fixture
def chain(tmp_path: Path) -> Path:
    (tmp_path / "chain.st").write_text(CHAIN)
    return tmp_path / "chain.st"


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("target", TARGETS)
def test_the_deepest_chain_counts_and_no_other(chain: Path, target: str, level: int) -> None:
    need = compile_sources([chain], target=target, level=level).needs["stack"]
    inlined = LEAF + BRANCH + WIDE  # at most: what is inlined may lie side by side
    assert LEAF + BRANCH <= need.amount < inlined + 400
    assert need.amount == sum(amount for _, amount in need.parts)


@pytest.mark.parametrize("target", TARGETS)
def test_each_frame_is_named(chain: Path, target: str) -> None:
    frames = dict(compile_sources([chain], target=target, level=0).needs["stack"].parts)
    assert LEAF <= frames["Leaf"] < LEAF + 100
    assert BRANCH <= frames["Branch"] < BRANCH + 100
    assert "Wide" not in frames


@pytest.mark.parametrize("target", TARGETS)
def test_methods_called_through_an_interface_count(tmp_path: Path, target: str) -> None:
    """Which one runs is known when it runs: the deepest counts."""
    classes = "\n".join(
        f"""FUNCTION_BLOCK B{i} IMPLEMENTS IRun
VAR n : DINT; END_VAR
METHOD Run : DINT
VAR t : ARRAY[0..{size}] OF DINT; i : DINT; END_VAR
FOR i := 0 TO {size} DO t[i] := n * i; END_FOR
Run := t[n];
END_METHOD
END_FUNCTION_BLOCK"""
        for i, size in enumerate((9, 299, 19))
    )
    (tmp_path / "app.st").write_text(
        f"INTERFACE IRun METHOD Run : DINT END_METHOD END_INTERFACE\n{classes}\n"
        "PROGRAM Main VAR b0 : B0; b1 : B1; b2 : B2; which : IRun; n : DINT; END_VAR\n"
        "CASE n OF 0: which := b0; 1: which := b1; ELSE which := b2; END_CASE\nn := which.Run() + n;\nEND_PROGRAM"
    )
    need = compile_sources([tmp_path], target=target, level=0).needs["stack"]
    assert 1200 <= need.amount < 1500


RECURSIVE = """FUNCTION_BLOCK Node
VAR_INPUT next : POINTER TO Node; n : DINT; END_VAR
VAR_TEMP t : ARRAY[0..299] OF DINT; i : DINT; END_VAR
FOR i := 0 TO 299 DO t[i] := n + i; END_FOR
IF next <> 0 THEN next^(n := t[n]); n := t[n + 1]; END_IF
END_FUNCTION_BLOCK
PROGRAM Main VAR one, other : Node; END_VAR one(next := ADR(other)); END_PROGRAM
"""


def test_stack_of_calls_that_may_lead_back_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "app.st").write_text(RECURSIVE)
    assert compile_sources([tmp_path]).needs["stack"].known is None


def test_calls_that_may_lead_back_are_refused_where_not_even_one_of_them_fits(tmp_path: Path) -> None:
    (tmp_path / "app.st").write_text(RECURSIVE)
    with pytest.raises(UsageError, match=r"It needs at least 12\d\d bytes of stack, the device has"):
        compile_sources([tmp_path], board="mps2-an385/standard")


def test_a_distance_that_looks_like_a_call_leads_to_a_function_or_is_none() -> None:
    for target in TARGETS.values():
        assert list(branches(bytes(64), target.machine, frozenset({4}))) == []
        assert list(branches(b"\xff" * 64, target.machine, frozenset({1}))) == []
        assert list(branches(b"\xe8\xf0", target.machine, frozenset({0}))) == []


def test_the_second_half_of_a_risc_v_instruction_is_no_call() -> None:
    load, jump, back = bytes.fromhex("370511a0"), bytes.fromhex("11a0"), bytes.fromhex("8280")
    code = load + back + jump + back + back  # `lui a0, 0xA0110`, which ends in the bytes of `jump`, 4 bytes on
    assert [(b.place, b.target) for b in branches(code, Machine.RISCV32, frozenset({0, 6, 10}))] == [(6, 10)]


def test_data_between_risc_v_functions_hide_no_call() -> None:
    data, jump, back = bytes.fromhex("0300"), bytes.fromhex("11a0"), bytes.fromhex("8280")
    code = data + jump + back + back  # `data` looks like the first half of an instruction of 4 bytes
    assert [(b.place, b.target) for b in branches(code, Machine.RISCV32, frozenset({2, 6}))] == [(2, 6)]


def x86_calls(chain: list[list[int]]) -> tuple[bytes, dict[int, tuple[int, int]]]:
    """Machine code of functions that call those of these numbers, and their frames: 16 bytes each."""
    size = 5 * max(map(len, chain)) + 1
    code = b""
    for number, targets in enumerate(chain):
        calls = b"".join(
            b"\xe8" + (target * size - (number * size + 5 * (i + 1))).to_bytes(4, "little", signed=True)
            for i, target in enumerate(targets)
        )
        code += calls.ljust(size, b"\xc3")
    return code, {number * size: (size, 16) for number in range(len(chain))}


@pytest.mark.parametrize("length", [1, 2, 1500, 10_000])
def test_chain_of_calls_may_be_long(length: int) -> None:
    code, frames = x86_calls([*([n + 1] for n in range(length - 1)), []])
    chain = CallGraph(code, Machine.X86_64, frames).deepest([0])
    assert [offset for offset, _ in chain] == sorted(frames)
    assert sum(amount for _, amount in chain) == 16 * length


def test_calls_that_meet_again_are_followed_once() -> None:
    length = 2000  # with 2 ** 1000 ways through them
    code, frames = x86_calls([[min(n + 1, length - 1), min(n + 2, length - 1)] for n in range(length - 1)] + [[]])
    assert sum(amount for _, amount in CallGraph(code, Machine.X86_64, frames).deepest([0])) == 16 * length


def test_what_looks_like_a_recursion_has_an_end() -> None:
    code, frames = x86_calls([[1, 2], [0, 2], [1, 0]])
    assert 16 < sum(amount for _, amount in CallGraph(code, Machine.X86_64, frames).deepest([0])) <= 48


def test_program_with_a_chain_of_1500_functions_is_built(tmp_path: Path) -> None:
    first = "FUNCTION F0 : DINT VAR_INPUT x : DINT; END_VAR F0 := x; END_FUNCTION"
    calls = "".join(
        f"FUNCTION F{i} : DINT VAR_INPUT x : DINT; END_VAR F{i} := F{i - 1}(x) + F{i - 1}(2); END_FUNCTION\n"
        for i in range(1, 1500)
    )
    main = "PROGRAM Main VAR n : DINT; END_VAR IF n > 0 THEN n := F1499(n); END_IF END_PROGRAM"
    (tmp_path / "long.st").write_text(f"{first}\n{calls}{main}")
    assert compile_sources([tmp_path / "long.st"], level=0, limits=False).needs["stack"].amount >= 1500 * 8


@pytest.mark.parametrize(
    ("target", "statement", "function"),
    [
        ("cortex-m0", "r := SIN(r);", "sinf"),
        ("cortex-m3", "r := SIN(r);", "sinf"),
        ("cortex-m4f", "r := SIN(r);", "sinf"),
        ("rv32imac", "l := EXPT(l, 2.5);", "pow"),
        ("cortex-m3", "r := r * 1.5;", "__mulsf3"),
        ("cortex-m7", "l := l / 3.0;", "__divdf3"),
        ("rv32imac", "n := n MOD 7;", "__moddi3"),
    ],
)
def test_a_c_function_counts_with_what_it_takes(tmp_path: Path, target: str, statement: str, function: str) -> None:
    text = "PROGRAM Main VAR r : REAL; l : LREAL; n : LINT; END_VAR {} END_PROGRAM"
    (tmp_path / "a.st").write_text(text.format(statement))
    need = compile_sources([tmp_path / "a.st"], target=target, limits=False).needs["stack"]
    taken = C_FUNCTIONS[function].stack(find_target(target).machine)
    assert (function, taken) in need.parts and not need.at_least
    assert taken <= need.amount < taken + 64


def test_a_c_function_counts_where_it_is_called(chain: Path) -> None:
    """Below the shorter branch it changes nothing until it is the deepest."""
    options = {"target": "cortex-m3", "level": 0, "checks": "none"}
    without = compile_sources([chain], **options).needs["stack"].amount
    text = chain.read_text()
    chain.write_text(text.replace("Wide := t[n];", "Wide := t[n] + REAL_TO_DINT(ATAN(DINT_TO_REAL(n)));"))
    shallow = compile_sources([chain], **options).needs["stack"]
    chain.write_text(text.replace("Leaf := t[n];", "Leaf := t[n] + REAL_TO_DINT(SIN(DINT_TO_REAL(n)));"))
    deep = compile_sources([chain], **options).needs["stack"]
    sine, arc = C_FUNCTIONS["sinf"].cortex_m, C_FUNCTIONS["atanf"].cortex_m
    assert without + sine <= deep.amount < without + sine + 64
    assert shallow.amount < without + arc


def test_what_an_unknown_c_function_takes_is_not_known(tmp_path: Path) -> None:
    text = "{attribute 'external' := 'acme'}\nFUNCTION Acme : DINT VAR_INPUT n : DINT; END_VAR END_FUNCTION\n"
    (tmp_path / "a.st").write_text(text + "PROGRAM Main VAR n : DINT; END_VAR n := Acme(n); END_PROGRAM")
    assert compile_sources([tmp_path / "a.st"], target="cortex-m3").needs["stack"].at_least


def test_a_c_function_is_not_called_together_with_that_of_the_library(tmp_path: Path) -> None:
    own = "{attribute 'external' := 'sinf'}\nFUNCTION Own : DINT VAR_INPUT a : DINT; END_VAR END_FUNCTION\n"
    text = f"{own}PROGRAM Main VAR n : DINT; r : REAL; END_VAR n := Own(n); r := SIN(r); END_PROGRAM"
    (tmp_path / "a.st").write_text(text)
    with pytest.raises(UsageError, match="The C function sinf of the program has other parameters"):
        compile_sources([tmp_path / "a.st"], target="cortex-m3")


@pytest.mark.parametrize("target", ["cortex-m0", "cortex-m3"])
def test_a_program_may_call_more_c_functions_than_stubs_reach(tmp_path: Path, target: str) -> None:
    functions = "".join(
        f"{{attribute 'external' := 'f{i}'}}\nFUNCTION F{i} : DINT VAR_INPUT a : DINT; END_VAR END_FUNCTION\n"
        for i in range(90)
    )
    calls = "".join(f"n := F{i}(n);" for i in range(90))
    (tmp_path / "a.st").write_text(f"{functions}PROGRAM Main VAR n : DINT; END_VAR {calls} END_PROGRAM")
    built = compile_sources([tmp_path / "a.st"], target=target, limits=False)
    assert built.needs["functions"].amount == 90 and built.needs["stack"].at_least
