"""The passes of the code generator: each can be left out, and the program does the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from plctool.compiler.codegen import partition
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.objects import emit_objects
from plctool.compiler.codegen.passes import PASSES, parse_passes
from plctool.compiler.front import Source, check_sources
from plctool.compiler.image.build import build_program
from plctool.compiler.typed.nodes import TypedProgram
from plctool.errors import UsageError
from plctool.image.targets import find_target
from plctool.sim import Simulator

STRINGS = Path(__file__).parents[1] / "st/strings/insert_delete_and_replace_may_change_their_own_string.st"
LINES = 800  # of one body, which is more than one function takes

TEXT = """FUNCTION_BLOCK Ramp
VAR_INPUT target : INT; END_VAR
VAR_OUTPUT value : INT; END_VAR
VAR step : INT; END_VAR
step := LIMIT(-3, target - value, 3);
value := value + step;
END_FUNCTION_BLOCK
FUNCTION_BLOCK Long
VAR_OUTPUT sum : DINT; END_VAR
VAR a : ARRAY[0..9] OF DINT; END_VAR
{body}
sum := a[0] + a[9];
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    ramp : Ramp; long : Long; t, second : TON; dead : INT; done : BOOL;
    text : STRING := 'abc'; length : INT; small : USINT := 201;
    quotient : USINT; wide : LWORD := 16#0123456789ABCDEF; shift : INT; i : INT; total : INT;
END_VAR
ramp(target := 10);
long();
t(IN := ramp.value >= 3, PT := T#25ms);
done := t.Q;
second(IN := done, PT := T#5ms);
IF done THEN dead := shift; END_IF;
dead := 5;
text := INSERT(text, 'xy', 1);
text := DELETE(text, 1, 2);
length := LEN(text);
quotient := small / 7;
shift := shift + 1;
wide := SHL(wide, shift);
FOR i := 0 TO 5 DO
    IF done THEN total := total + i * length; ELSE total := total - 1; END_IF;
END_FOR;
END_PROGRAM
"""


@pytest.fixture(scope="module")
def program() -> TypedProgram:
    body = "\n".join(f"a[{i % 10}] := a[{i * 7 % 10}] + {i};" for i in range(LINES))
    return program_of(Source("main.st", TEXT.replace("{body}", body)))


def program_of(source: Source) -> TypedProgram:
    checked = check_sources([source])
    assert checked.program is not None, checked.diagnostics
    return checked.program


@pytest.fixture(scope="module")
def with_all_passes(program: TypedProgram) -> list[object]:
    return results(program, Options(find_target("x86_64-linux"), 3))


def results(program: TypedProgram, options: Options) -> list[object]:
    """Of all variables that every level keeps, after each cycle."""
    names = ("ramp.value", "long.sum", "done", "text", "length", "quotient", "wide", "shift", "total")
    built = build_program(program, options)
    found: list[object] = []
    with Simulator(built.image, built.symbols) as plc:
        for _ in range(6):
            plc.run_cycles(1)
            found += [plc.read(f"Main.{name}") for name in names]
    return found


@pytest.mark.parametrize("name", PASSES)
def test_program_does_the_same_without_a_pass(name: str, program: TypedProgram, with_all_passes: list[object]) -> None:
    options = Options(find_target("x86_64-linux"), 3)
    assert results(program, replace(options, passes=parse_passes([name]))) == with_all_passes


def test_program_does_the_same_without_any_pass(program: TypedProgram, with_all_passes: list[object]) -> None:
    options = Options(find_target("x86_64-linux"), 3)
    assert results(program, replace(options, passes=parse_passes(PASSES))) == with_all_passes


@pytest.mark.parametrize("name", PASSES)
def test_each_pass_changes_the_code(name: str, program: TypedProgram, monkeypatch: pytest.MonkeyPatch) -> None:
    if name in ("parts", "dead-stores"):  # of large programs
        monkeypatch.setattr(partition, "_WHOLE", 500)
        monkeypatch.setattr(partition, "_FEW", 100)
    if name == "lean":
        program = program_of(Source("strings.st", STRINGS.read_text()))
    options = Options(find_target("cortex-m3"), 2, size=name in ("shorten", "lean", "transient", "closed"))

    def objects(without: list[str]) -> list[bytes]:
        chosen = replace(options, passes=parse_passes(without))
        return emit_objects(lower(program, chosen).parts, chosen)

    assert objects([name]) != objects([])


@pytest.mark.parametrize("name", PASSES)
def test_what_a_pass_leaves_can_be_seen(name: str, program: TypedProgram) -> None:
    passes = parse_passes(dump_after=name)
    options = Options(find_target("cortex-m3"), size=True, passes=passes)
    emit_objects(lower(program, options).parts, options)
    (dump,) = passes.dumps
    first = {"transient": "TON: IN", "closed": "TON: returns Q, gets the context", "registers": "Ramp: target"}
    assert first.get(name, "code_init") in dump


def test_several_passes_are_named_in_one_text() -> None:
    assert parse_passes(["closed, Memory", "lean"]).without == {"closed", "memory", "lean"}


@pytest.mark.parametrize(
    ("without", "after", "message"),
    [
        (["closd"], None, "There is no pass 'closd' of the code generator; did you mean closed?"),
        (
            [""],
            None,
            "There is no pass '' of the code generator; the passes are transient, closed, .*, shorten, lean\\.",
        ),
        ([], "x", "There is no pass 'x' of the code generator; the passes are .*"),
    ],
)
def test_unknown_pass_is_refused(without: list[str], after: str | None, message: str) -> None:
    with pytest.raises(UsageError, match=f"^{message.replace('?', '[?]')}$"):
        parse_passes(without, after)


def test_every_pass_is_in_the_documentation() -> None:
    text = (Path(__file__).parents[2] / "docs/internals.md").read_text()
    rows = [line for line in text.splitlines() if line in {f"| `{name}` | {what} |" for name, what in PASSES.items()}]
    assert rows == [f"| `{name}` | {what} |" for name, what in PASSES.items()]
