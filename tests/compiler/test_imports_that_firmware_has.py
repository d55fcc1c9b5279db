"""Every operator and conversion of every type, at every level, calls only what the firmware of the processor has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from checked_program import CheckedProgram, checked
from shares import share

from plctool.compiler import compile_sources
from plctool.compiler.base.level import Level
from plctool.errors import UsageError
from plctool.image.board import find_board
from plctool.image.c_functions import C_FUNCTIONS, find_c_function
from plctool.image.file import parse_image
from plctool.image.targets import TARGETS, Target
from plctool.io.fit import check_board

INTEGERS = ["SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT"]
BITS = ["BYTE", "WORD", "DWORD", "LWORD"]
REALS = ["REAL", "LREAL"]
WITH_STUBS = [target for target in TARGETS.values() if target.stubs]


def statements() -> tuple[list[str], list[str]]:
    """Declarations, and statements about them."""
    declared, body = ["n, m : INT;", "yes : BOOL;", "t : TIME; lt : LTIME; s : STRING;"], []
    for t in [*INTEGERS, *BITS, *REALS]:
        declared.append(f"a{t}, b{t}, c{t} : {t};")
        a, b, c = f"a{t}", f"b{t}", f"c{t}"
        body += [f"{c} := {a} {op} {b};" for op in "+-*/"]
        body += [f"yes := yes XOR ({a} {op} {b});" for op in ("=", "<>", "<", "<=", ">", ">=")]
        body += [f"{c} := MAX({a}, MIN({b}, {c})); {c} := SEL(yes, {a}, {b}); {c} := LIMIT({a}, {b}, {c});"]
        body += [f"{c} := -{c};" if t in (*REALS, "SINT", "INT", "DINT", "LINT") else ""]
        body += [f"{c} := ABS({a});"] * (t not in BITS)
        body += [f"a{other} := {t}_TO_{other}({c});" for other in [*INTEGERS, *BITS, *REALS] if other != t]
        body += [f"s := {t}_TO_STRING({a}); {b} := STRING_TO_{t}(s);"]
        if t in REALS:
            body += [f"{c} := SQRT({a}) + EXPT({a}, {b}) + SIN({b}); n := TRUNC_INT({a}); {c} := {a} ** 2;"]
            continue
        body += [f"{c} := {a} MOD {b};"]
        body += [
            f"{c} := {operation}({a}, n); {c} := {operation}({b}, 3);" for operation in ("SHL", "SHR", "ROL", "ROR")
        ]
        body += [f"{c} := {a} {op} {b}; {c} := NOT {c};" for op in ("AND", "OR", "XOR")]
        body += [f"yes := {a}.3; {b}.2 := yes;"]
    body += ["t := t * n + LTIME_TO_TIME(lt / 3); lt := lt * aREAL; t := t / aLINT;"]
    return declared, body


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> CheckedProgram:
    """One program for each group of statements: in a large function LLVM would hide what it does in a small one."""
    folder = tmp_path_factory.mktemp("operators")
    declared, body = statements()
    parts = [body[i : i + 12] for i in range(0, len(body), 12)]
    text = "".join(f"VAR_GLOBAL\n{line}\nEND_VAR\n" for line in declared)
    for number, part in enumerate(parts):
        lines = "\n".join(part)
        text += f"FUNCTION Part{number} : BOOL\n{lines}\nEND_FUNCTION\n"
    calls = "\n".join(f"Part{number}();" for number in range(len(parts)))
    (folder / "m.st").write_text(f"{text}PROGRAM Main\n{calls}\nEND_PROGRAM\n")
    return checked([folder])


CASES = [(target, level) for target in WITH_STUBS for level in (0, 2, "s", 1, 3)]


@pytest.mark.parametrize(("target", "level"), share(CASES, 4), ids=lambda x: getattr(x, "name", str(x)))
def test_imports_are_those_of_the_processor(program: CheckedProgram, target: Target, level: Level) -> None:
    image = parse_image(program.built(level, target.name).image)
    found = {external.name: find_c_function(external.name, external.signature) for external in image.externals}
    missing = [name for name, function in found.items() if function is None or not function.is_registered(target)]
    assert found and not missing


@pytest.mark.parametrize("shift", ["SHL(x, n)", "SHR(x, n)", "ROL(x, n)", "ROR(x, n)"])
@pytest.mark.parametrize("kind", ["LINT", "ULINT", "LWORD"])
def test_shifts_of_64_bits_need_no_function(tmp_path: Path, shift: str, kind: str) -> None:
    (tmp_path / "m.st").write_text(
        f"PROGRAM Main\nVAR x : {kind}; n : INT; END_VAR\nn := n + 1;\nx := {shift};\nEND_PROGRAM\n"
    )
    for name in ("cortex-m3", "rv32imac"):
        image = parse_image(compile_sources([tmp_path], target=name, level="s").image)
        assert not any(external.name.endswith("di3") for external in image.externals)


def test_a_board_refuses_a_function_that_its_processor_lacks(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text("PROGRAM Main\nVAR a, b : LINT := 1; END_VAR\na := a / b;\nEND_PROGRAM\n")
    image = parse_image(compile_sources([tmp_path], target="cortex-m3").image)
    check_board(image, {}, find_board("mps2-an385/full"), "")
    shift = replace(image.externals[0], name="__ashldi3", signature=C_FUNCTIONS["__ashldi3"].signature)
    other = replace(image, externals=[*image.externals, shift])
    with pytest.raises(UsageError, match="It calls __ashldi3, which firmware for cortex-m3 does not have"):
        check_board(other, {}, find_board("mps2-an385/full"), "")
