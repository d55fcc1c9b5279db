"""Function blocks as classes: what instances look like, what calls become, what stays over a restart."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import BuildResult
from plctool.compiler.typed.nodes import TypedProgram
from plctool.debug.symbols import SymbolTable
from plctool.errors import UsageError
from plctool.image.targets import TARGETS, find_target
from plctool.sim import Simulator

FAMILY = """
FUNCTION_BLOCK Base
METHOD Value : INT
Value := 1;
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Derived EXTENDS Base
METHOD Value : INT
Value := 2;
END_METHOD
END_FUNCTION_BLOCK
"""
CALL = """
PROGRAM Main
VAR
    {instances}
    p : POINTER TO Base;
    x : INT;
END_VAR
x := p^.Value();
END_PROGRAM
"""


def checked(text: str) -> TypedProgram:
    result = check_sources([Source("f.st", text)])
    assert result.program is not None, result.diagnostics
    return result.program


def code(text: str) -> str:
    return "\n".join(part.text for part in lower(checked(text), Options(find_target("x86_64-linux"))).parts)


def test_call_is_direct_when_only_one_class_has_instances() -> None:
    text = code(FAMILY + CALL.format(instances="d : Derived;"))
    assert "@class." not in text
    assert "call signext i16 @st.Derived.Value" in text


def test_call_is_decided_by_the_class_when_there_are_several() -> None:
    text = code(FAMILY + CALL.format(instances="b : Base; d : Derived;"))
    assert re.search(r"call signext i16 @class\.Base\.Value\(", text)


def test_call_of_a_declared_instance_is_direct() -> None:
    text = code(
        FAMILY + "PROGRAM Main VAR b : Base; d : Derived; x : INT; END_VAR x := b.Value() + d.Value(); END_PROGRAM"
    )
    assert "@class." not in text


def test_class_number_exists_only_where_classes_have_to_be_distinguished() -> None:
    program = checked(FAMILY + "FUNCTION_BLOCK Alone METHOD M END_METHOD END_FUNCTION_BLOCK "
                      "PROGRAM Main VAR a : Alone; d : Derived; END_VAR a.M(); d.Value(); END_PROGRAM")  # fmt: skip
    sizes = {v.name: v.type.size for v in program.globals}
    assert sizes == {"Main.a": 1, "Main.d": 4}


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_dispatch_compiles_for_every_target(target: str, tmp_path: Path) -> None:
    file = tmp_path / "f.st"
    file.write_text(FAMILY + CALL.format(instances="b : Base; d : Derived;"), "latin-1")
    assert compile_sources([file], target=target).image


def test_members_of_the_base_are_found_by_name(tmp_path: Path) -> None:
    file = tmp_path / "f.st"
    file.write_text(
        "FUNCTION_BLOCK A VAR one : INT; END_VAR END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK B EXTENDS A VAR two : INT; END_VAR one := two; END_FUNCTION_BLOCK\n"
        "PROGRAM Main VAR b : B; END_VAR b(); END_PROGRAM\n",
        "latin-1",
    )
    symbols = compile_sources([file]).symbols
    assert symbols.resolve("Main.b.one").offset == symbols.resolve("Main.b.two").offset - 2


def test_symbols_of_interfaces_and_of_blocks_that_point_to_themselves_are_read_back(tmp_path: Path) -> None:
    file = tmp_path / "f.st"
    file.write_text(
        "INTERFACE I METHOD M END_METHOD END_INTERFACE\n"
        "FUNCTION_BLOCK A IMPLEMENTS I VAR_INPUT next : POINTER TO A; i : I; END_VAR\n"
        "METHOD M END_METHOD END_FUNCTION_BLOCK\n"
        "PROGRAM Main VAR a : A; i : I; END_VAR i := a; a.next := ADR(a); END_PROGRAM\n",
        "latin-1",
    )
    symbols = compile_sources([file]).symbols
    again = SymbolTable.from_json(symbols.to_json())
    assert again.resolve("Main.a.i").offset == symbols.resolve("Main.a.i").offset
    assert again.variables["Main.i"].type.size == 8


def test_properties_cannot_be_read_by_name(tmp_path: Path) -> None:
    file = tmp_path / "f.st"
    file.write_text(
        "FUNCTION_BLOCK A PROPERTY P : INT GET P := 1; END_GET END_PROPERTY END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK B EXTENDS A END_FUNCTION_BLOCK\n"
        "PROGRAM Main VAR b : B; x : INT; END_VAR x := b.P; END_PROGRAM\n",
        "latin-1",
    )
    symbols = SymbolTable.from_json(compile_sources([file]).symbols.to_json())
    with pytest.raises(UsageError, match=r"Main\.b\.p is a property"):
        symbols.resolve("Main.b.p")


LEAVING = """
VAR_GLOBAL RETAIN log : STRING; END_VAR
FUNCTION_BLOCK Base
VAR_INPUT n : INT; END_VAR
METHOD FB_Exit : BOOL
VAR_INPUT bInCopyCode : BOOL; END_VAR
log := CONCAT(log, CONCAT('b', INT_TO_STRING(n)));
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Derived EXTENDS Base
METHOD FB_Exit : BOOL
VAR_INPUT bInCopyCode : BOOL; END_VAR
log := CONCAT(log, CONCAT('d', INT_TO_STRING(n)));
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Holder
VAR inner : Base := (n := 5); END_VAR
METHOD FB_Exit
log := CONCAT(log, 'h');
END_METHOD
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    first : Base := (n := 1);
    second : Derived := (n := 2);
    holder : Holder;
    several : ARRAY[1..2] OF Base := [(n := 7), (n := 8)];
END_VAR
first(); second(); holder(); several[1]();
END_PROGRAM
"""


def built_from(folder: Path, text: str) -> BuildResult:
    file = folder / "f.st"
    file.write_text(text, "latin-1")
    return compile_sources([file])


def test_fb_exit_runs_in_the_opposite_order_of_fb_init_before_a_reset(tmp_path: Path) -> None:
    built = built_from(tmp_path, LEAVING)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(2)
        assert plc.read("log") == ""
        plc.reset("warm")
        assert plc.read("log") == "b8b7hb5d2b2b1"


def test_without_fb_exit_the_image_has_no_such_function() -> None:
    program = checked(FAMILY + CALL.format(instances="d : Derived;"))
    assert program.shutdown is None
