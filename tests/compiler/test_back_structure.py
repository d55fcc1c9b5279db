"""How the lowering cuts a program into functions: what is inlined, what is passed in registers, what is cut."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from plctool.compiler import load_sources
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.elf_object import code_size
from plctool.compiler.codegen.emit import emit_object, optimised
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.partition import Part
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.typed.nodes import TypedProgram
from plctool.controller import ProgramStopped
from plctool.image.file import parse_image
from plctool.image.targets import find_target
from plctool.sim import Simulator

BLOCK = """FUNCTION_BLOCK Block
VAR_INPUT a, b : DINT; c : LREAL; END_VAR
VAR_OUTPUT sum : DINT; END_VAR
sum := sum + a * b;
END_FUNCTION_BLOCK
"""


def checked(text: str) -> TypedProgram:
    result = check_sources([Source("main.st", text)])
    assert result.program, result.diagnostics
    return result.program


def parts(text: str, target: str = "x86_64-linux", **options: object) -> list[Part]:
    return lower(checked(text), Options(find_target(target), **options)).parts  # type: ignore[arg-type]


def lowered(text: str, target: str = "x86_64-linux", **options: object) -> str:
    return "\n".join(part.text for part in parts(text, target, **options))


def signature(text: str, symbol: str) -> str:
    found = re.search(rf"^define (.*@{re.escape(symbol)}\(.*)\{{$", text, re.M)
    assert found, symbol
    return found[1]


def run(text: str, *names: str) -> list[object]:
    built = build_program(checked(text), Options(find_target("x86_64-linux")))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(2)
        return [plc.read(name) for name in names]


def main(calls: str) -> str:
    return f"{BLOCK}PROGRAM Main VAR x : Block; p : POINTER TO Block; END_VAR {calls} END_PROGRAM"


def test_inputs_that_every_call_gives_are_handed_over() -> None:
    text = lowered(main("x(a := 1, b := 2, c := 3.0); x(a := 3, b := 4);"))
    assert signature(text, "st.Block").count("%p") == 2
    assert re.search(r"@st\.Block\(i32 1, [^)]*, i32 2\)", text)


def test_inputs_that_a_call_leaves_out_stay_in_the_instance() -> None:
    text = lowered(main("x(a := 1, b := 2); x(b := 3);"))
    assert signature(text, "st.Block").count("%p") == 1


def test_inputs_go_as_far_as_there_are_registers() -> None:
    calls = "x(a := 1, b := 2, c := 3.0);"
    assert signature(lowered(main(calls), "aarch64-linux"), "st.Block").count("%p") == 3
    assert signature(lowered(main(calls), "cortex-m3"), "st.Block").count("%p") == 2  # an LREAL has no register there


OPEN_BLOCK = BLOCK.replace("sum := sum + a * b;", "sum := sum + a * b; used := used + 1;")
OPEN_BLOCK = f"VAR_GLOBAL used : DINT; END_VAR {OPEN_BLOCK}"


def test_outputs_of_a_block_that_touches_nothing_else_are_results() -> None:
    calls = "x(a := 1, b := 2);"
    assert signature(lowered(main(calls)), "st.Block").startswith("internal i32 @st.Block(i32 %p0, ptr nonnull %self,")
    open_ = main(calls).replace(BLOCK, OPEN_BLOCK)
    assert signature(lowered(open_), "st.Block").startswith(
        "internal void @st.Block(i32 %p0, ptr noalias nonnull readonly %ctx,"
    )


@pytest.mark.parametrize(
    "body",
    [
        "sum := a / b;",  # may raise an exception
        "p := ADR(sum); p^ := a;",
        "inner(IN := a > 0, PT := T#1s);",
        "FOR sum := 0 TO a DO b := b + 1; END_FOR",  # may be interrupted by the watchdog
        "sum := LEN(name) + a;",
    ],
)
def test_what_a_block_may_touch_or_raise_makes_it_an_ordinary_one(body: str) -> None:
    block = f"""FUNCTION_BLOCK Block VAR_INPUT a, b : DINT; END_VAR VAR_OUTPUT sum : DINT; END_VAR
    VAR p : POINTER TO DINT; inner : TON; name : STRING; END_VAR {body} END_FUNCTION_BLOCK"""
    text = lowered(f"{block} PROGRAM Main VAR x : Block; END_VAR x(a := 1, b := 2); END_PROGRAM")
    assert signature(text, "st.Block").startswith("internal void @st.Block(i32 %p0, ptr noalias nonnull readonly %ctx,")


@pytest.mark.parametrize(("block", "loads"), [(BLOCK, 1), (OPEN_BLOCK, 2)])
def test_what_is_known_of_other_variables_holds_after_a_call(block: str, loads: int) -> None:
    text = f"""{block} PROGRAM Main VAR x, y : Block; wanted, one, two : DINT; END_VAR
    one := wanted; x(a := one, b := 2); y(a := 3, b := 4); two := wanted; END_PROGRAM"""
    target = find_target("cortex-m3")
    module, _ = optimised(Part(lowered(text, target.name, debug=True)), Options(target))
    program = next(str(f) for f in module.functions if f.name == "st.Main")
    assert program.count("load i32") == loads


def test_an_output_is_what_was_last_written_to_it() -> None:
    calls = "p := ADR(x.sum); x(a := 2, b := 3); one := x.sum; p^ := 1; two := x.sum; x(a := 1, b := 1); three := p^;"
    text = (
        f"{BLOCK}PROGRAM Main VAR x : Block; p : POINTER TO DINT; one, two, three : DINT; END_VAR {calls} END_PROGRAM"
    )
    assert run(text, "Main.one", "Main.two", "Main.three") == [8, 1, 2]


def large_callers(blocks: int) -> str:
    body = "\n".join(f"sum := sum + a * {k} - b;" for k in range(40))
    texts = [BLOCK.replace("Block", f"Block{n}").replace("sum := sum + a * b;", body) for n in range(blocks)]
    variables = "".join(f"x{n} : Block{n};" for n in range(blocks))
    calls = "".join(f"x{n}(a := 1, b := 2);" for n in range(blocks))
    return f"{''.join(texts)}PROGRAM Main VAR {variables} END_VAR {calls} END_PROGRAM"


def test_blocks_that_are_called_once_may_be_inlined() -> None:
    assert "noinline" not in signature(lowered(large_callers(3)), "st.Block0")


def connected(given: str) -> str:
    return (
        "VAR_GLOBAL source, n : INT; END_VAR PROGRAM Work VAR_INPUT x : INT; END_VAR VAR_OUTPUT y : INT; END_VAR\n"
        "y := x + 1; END_PROGRAM CONFIGURATION c TASK t(INTERVAL := T#1ms);\n"
        f"PROGRAM p WITH t : Work(x := {given}, y => n); END_CONFIGURATION"
    )


@pytest.mark.parametrize("given", ["source", "5", "10 / source"])
def test_what_a_configuration_connects_is_part_of_the_program(given: str) -> None:
    text = lowered(connected(given))
    run, *parts_of_it = re.findall(r"^define (.*@st\.p\S*\(.*)\{$", text, re.M)
    assert "noinline" in run
    assert len(parts_of_it) == 3 and not any("noinline" in part for part in parts_of_it)


def test_a_program_reads_what_is_connected_to_it_from_registers() -> None:
    module, _ = optimised(parts(connected("source"))[0], Options(find_target("x86_64-linux")))
    loads = [text for text in str(module).splitlines() if re.search(r"= load i16\b", text)]
    assert len(loads) == 1  # of `source`; neither of x, nor of y


def test_an_exception_in_what_is_connected_has_the_line_of_the_configuration() -> None:
    built = build_program(checked(connected("10 / source")), Options(find_target("x86_64-linux")))
    with Simulator(built.image, built.symbols) as plc, pytest.raises(ProgramStopped, match=r"main\.st:3"):
        plc.run_cycles(1)


def test_no_function_grows_without_limit_by_inlining() -> None:
    assert "noinline" in signature(lowered(large_callers(100)), "st.Block0")


@pytest.mark.parametrize(("target", "room"), [("x86_64-linux", 4096), ("cortex-m3", 256), ("rv32imac", 256)])
def test_a_caller_has_no_room_for_large_variables_of_a_function_before_it_calls(target: str, room: int) -> None:
    """Its stack would overflow in every cycle, and an interrupt would find it out."""
    call = "PROGRAM Main VAR n : DINT; trip : BOOL; END_VAR IF trip THEN n := Large(n); END_IF END_PROGRAM"
    function = "FUNCTION Large : DINT VAR_INPUT i : DINT; END_VAR VAR f : ARRAY[1..{}] OF DINT; END_VAR {} END_FUNCTION"
    for count, inlined in ((room // 4 - 8, True), (room // 4 + 1, False)):
        text = f"{function.format(count, 'f[i] := i; Large := f[i + 1];')} {call}"
        assert ("noinline" not in signature(lowered(text, target), "st.Large")) is inlined


def long_body(statement: str, count: int = 1000) -> str:
    body = "\n".join([*["n := n + n * 3 - 1; m := m + n;"] * count, statement])
    return f"PROGRAM Main VAR n, m : DINT; END_VAR\n{body}\nEND_PROGRAM"


def test_a_long_body_becomes_several_functions() -> None:
    text = long_body("m := m + 1;")
    assert len(re.findall(r"^define internal void @st\.Main", lowered(text), re.M)) > 3
    assert run(text, "Main.m") == run(text.replace("n := n + n * 3 - 1;", "n := n * 4 - 1;"), "Main.m")


DIVIDED = "a[{i}] := a[{j}] * {k} + a[{i}] / {k};"


def much(statement: str) -> str:
    """A program of 5000 statements, which is too large to be compiled as one."""
    body = "\n".join(statement.format(i=n % 50, j=n * 7 % 50, k=n * 13 % 99 + 2) for n in range(5000))
    return f"PROGRAM Main VAR a : ARRAY[0..49] OF DINT := [50(3)]; k : INT; END_VAR\n{body}\nEND_PROGRAM"


def test_long_runs_of_a_large_program_are_parts_of_their_own() -> None:
    found = [part.plain for part in parts(much(DIVIDED))]
    assert found.count(True) == 20  # cut at names that do not change with the statements
    assert found.count(False) == 1  # what calls them, and initial values


BRANCH, LOOP = "IF a[{j}] > {k} THEN a[{i}] := {k}; END_IF", "FOR k := 0 TO 9 DO a[k] := {j}; END_FOR"


@pytest.mark.parametrize("statement", [BRANCH, LOOP])
def test_branches_and_loops_of_a_large_program_have_all_passes(statement: str) -> None:
    found = parts(much(statement + ";"))
    assert len(found) > 1
    assert not any(part.plain for part in found)


def test_a_small_program_is_one_part_with_all_passes() -> None:
    assert [(part.large, part.plain) for part in parts(long_body("m := m + 1;", 10))] == [(False, False)]


def test_parts_with_fewer_passes_give_the_same_results() -> None:
    program = checked(much(DIVIDED))
    found = []
    for level in (0, 2):
        built = build_program(program, Options(find_target("x86_64-linux"), opt_level=level))
        with Simulator(built.image, built.symbols) as plc:
            plc.run_cycles(2)
            found.append([plc.read(f"Main.a[{i}]") for i in range(50)])
    assert found[0] == found[1]
    assert len(set(found[0])) > 20


def test_a_long_body_with_return_stays_one_function() -> None:
    assert len(re.findall(r"^define internal void @st\.Main", lowered(long_body("RETURN;")), re.M)) == 1


def test_an_exception_in_a_long_body_names_its_line() -> None:
    text = long_body("m := 1 / (n - n);")
    built = build_program(checked(text), Options(find_target("x86_64-linux")))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1, check=False)
        found = plc.raw_status().exception
    assert found is not None and found.code_offset is not None
    place = built.symbols.address_to_line(found.code_offset)
    assert place is not None
    assert (place.pou, place.line) == ("Main", len(text.split("\n")) - 1)


@pytest.fixture(scope="module")
def timers(tmp_path_factory: pytest.TempPathFactory) -> TypedProgram:
    declarations = "".join(f"t{n} : TON;" for n in range(30))
    calls = "".join(f"t{n}(IN := NOT t{n}.Q, PT := T#{n + 1}ms);" for n in range(30))
    path = tmp_path_factory.mktemp("timers") / "timers.st"
    path.write_text(f"PROGRAM Main VAR {declarations} END_VAR {calls} END_PROGRAM")
    result = check_sources(load_sources([Path(path)]))
    assert result.program, result.diagnostics
    return result.program


def code(built: BuildResult) -> int:
    return len(parse_image(built.image).code)


@pytest.mark.parametrize("target", ["cortex-m0", "cortex-m3", "rv32imac"])
def test_blocks_of_the_library_are_not_inlined_where_flash_is_small(timers: TypedProgram, target: str) -> None:
    normal, fast = (code(build_program(timers, Options(find_target(target), level))) for level in (2, 3))
    assert normal < fast / 2


@pytest.mark.parametrize("target", ["cortex-m3", "cortex-m4f"])
def test_loops_of_the_library_are_not_unrolled_where_flash_is_small(target: str) -> None:
    text = lowered("PROGRAM Main VAR s, t : STRING; END_VAR s := CONCAT(s, t); END_PROGRAM", target)
    normal, fast = (
        str(optimised(Part(text), Options(find_target(target), level))[0]).count("load i8") for level in (2, 3)
    )
    assert 0 < normal < fast


def test_short_numbers_fill_the_registers_they_are_passed_in() -> None:
    declarations = "VAR_INPUT i : INT; u : UINT; s : SINT; b : BOOL; d : DINT; END_VAR"
    text = lowered(
        f"FUNCTION F : INT {declarations} F := i; END_FUNCTION\n"
        "PROGRAM Main VAR i : INT; END_VAR i := F(1, 2, 3, TRUE, 5); END_PROGRAM"
    )
    types = r"ptr [^,]*, i16 signext [^,]*, i16 zeroext [^,]*, i8 signext [^,]*, i8 zeroext [^,]*, i32 [%\w]*\)"
    assert re.search(rf"^define .* signext i16 @st\.F\({types}", text, re.M)
    assert re.search(rf"call signext i16 @st\.F\({types}", text)


EDGE = """
FUNCTION_BLOCK Edge
VAR_INPUT clk : BOOL; n : INT; END_VAR VAR_OUTPUT q : BOOL; more : INT; END_VAR VAR last : BOOL; END_VAR
q := clk AND NOT last; last := clk; more := n;
END_FUNCTION_BLOCK
"""


def test_the_first_input_of_a_block_comes_where_the_first_output_of_another_one_is_returned() -> None:
    calls = "e(clk := TRUE, n := 1); f(clk := e.q, n := 2);"
    text = lowered(f"{EDGE}PROGRAM Main VAR e, f : Edge; END_VAR {calls} END_PROGRAM")
    types = r"i8 zeroext [^,]*, ptr [^,]*, i16 signext [^,]*\)"
    assert re.search(rf"^define .* zeroext i8 @st\.Edge\({types}", text, re.M)
    assert len(re.findall(rf"call zeroext i8 @st\.Edge\({types}", text)) == 2


@pytest.mark.parametrize("condition", ["a", "NOT a", "a AND b"])
def test_a_bool_is_tested_as_the_byte_that_it_is(condition: str) -> None:
    body = f"IF {condition} THEN n := 1; END_IF"
    text = lowered(f"PROGRAM Main VAR a, b : BOOL; n : INT; END_VAR {body} END_PROGRAM", "cortex-m3")
    code = str(optimised(Part(text), Options(find_target("cortex-m3")))[0])
    assert "icmp eq i8" in code or "icmp ne i8" in code
    assert "trunc" not in code


@pytest.mark.parametrize(("target", "tests"), [("x86_64-linux", 1), ("aarch64-linux", 1), ("cortex-m3", 3)])
def test_a_condition_of_variables_is_one_test_where_branches_are_dear(target: str, tests: int) -> None:
    body = "IF a AND NOT b OR c THEN n := 1; END_IF"
    text = lowered(f"PROGRAM Main VAR a, b, c : BOOL; n : INT; END_VAR {body} END_PROGRAM", target)
    assert text.count("icmp ne i8") == tests


@pytest.mark.parametrize(("target", "short"), [("cortex-m3", True), ("rv32imac", True), ("cortex-m0", False)])
def test_small_code_takes_short_instructions_where_there_are_others(target: str, short: bool) -> None:
    text = lowered("PROGRAM Main VAR a : BOOL; END_VAR a := NOT a; END_PROGRAM", target, size=True)
    assert ("minsize" in str(optimised(Part(text), Options(find_target(target), size=True))[0])) == short


def test_small_code_has_a_body_once_unless_it_is_called_once() -> None:
    options = Options(find_target("cortex-m3"), size=True)
    once = "x(a := 1, b := 2);"
    modules = [optimised(Part(lowered(main(c), "cortex-m3", size=True)), options)[0] for c in (once, once * 2)]
    assert [str(module).count("define internal") for module in modules] == [1, 2]  # st.Main, st.Block


def test_small_code_is_smaller(timers: TypedProgram) -> None:
    normal, small = (
        code(build_program(timers, Options(find_target("x86_64-linux"), size=size))) for size in (False, True)
    )
    assert small < normal / 2


def test_small_code_is_the_smaller_one_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    text = lowered("PROGRAM Main VAR s, t : STRING; END_VAR s := CONCAT(s, LEFT(t, 3)); END_PROGRAM", size=True)
    options = Options(find_target("x86_64-linux"), size=True)
    chosen = code_size(emit_object(Part(text), options))
    sizes = []
    for worth in (0.0, 1000.0):  # always one of the two
        monkeypatch.setattr("plctool.compiler.codegen.emit._WORTH", worth)
        sizes.append(code_size(emit_object(Part(text), options)))
    lean, usual = sizes
    assert lean < usual and chosen == lean


def test_small_code_leaves_the_code_generator_as_it_was(timers: TypedProgram) -> None:
    options = Options(find_target("cortex-m3"))
    before = build_program(timers, options).image
    build_program(timers, Options(find_target("cortex-m3"), size=True))
    assert build_program(timers, options).image == before
