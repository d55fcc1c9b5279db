"""At -O3 and -Os function blocks keep in registers what no call needs of the previous one. What the program does stays
the same; for such a variable plctool says where it is."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import pytest
from shares import share

from plctool import ProgramStopped, Simulator, UsageError
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import ALL_CHECKS, Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.typed.nodes import TypedProgram
from plctool.debug.symbols import SymbolTable
from plctool.image.targets import find_target

HOST = "x86_64-linux"
DECLARED = (
    "VAR_INPUT i : INT; k : INT := 3; END_VAR VAR_OUTPUT o : INT; END_VAR "
    "VAR a, b, n : INT; t : BOOL; e : __SYSTEM.ExceptionCode; END_VAR"
)


def checked(text: str) -> TypedProgram:
    found = check_sources([Source("main.st", text)])
    assert found.program, found.diagnostics
    return found.program


def program(body: str, call: str = "f(i := x, k := x);", more: str = "", rest: str = "") -> str:
    return (
        f"FUNCTION_BLOCK Work {DECLARED}\n{body}\n{more}END_FUNCTION_BLOCK\n"
        f"PROGRAM Main VAR f : Work; x, y : INT; END_VAR {call} {rest} END_PROGRAM"
    )


def unkept(text: str) -> str:
    """The names of the variables that are not kept, in alphabetical order."""
    lowered = lower(checked(text), Options(find_target(HOST), 3))
    return " ".join(sorted(v.name for variables in lowered.transient.values() for v in variables))


@pytest.mark.parametrize(
    ("body", "names"),
    [
        ("o := i + k;", "i k"),
        ("o := 1;", "i k"),
        ("a := i; o := a;", "a i k"),
        ("o := a; a := i;", "i k"),
        ("a := a + i; o := a;", "i k"),
        ("IF t THEN a := 1; END_IF o := a;", "i k"),
        ("t := i > 2; IF t THEN a := 1; ELSE a := k; END_IF o := a;", "a i k t"),
        ("IF i > 2 THEN a := 1; ELSIF i > 1 THEN ; ELSE a := k; END_IF o := a;", "i k"),
        ("IF i > 2 THEN a := 1; ELSE RETURN; END_IF o := a;", "a i k"),
        ("CASE i OF 1: a := 1; 2: a := 2; END_CASE o := a;", "i k"),
        ("CASE i OF 1: a := 1; 2: a := 2; ELSE a := 3; END_CASE o := a;", "a i k"),
        ("FOR n := 1 TO i DO o := o + n; END_FOR", "i k n"),
        ("FOR n := 1 TO i DO a := n; END_FOR o := a;", "i k n"),
        ("a := 0; WHILE a < i DO a := a + 1; END_WHILE o := a;", "a i k"),
        ("WHILE b < i DO b := b + 1; a := b; END_WHILE o := a;", "i k"),
        ("REPEAT IF i > 2 THEN EXIT; END_IF a := 1; UNTIL i < 9 END_REPEAT o := a;", "i k"),
        ("a := 1; again: o := o + a; IF o < 3 THEN JMP again; END_IF", "i k"),
        ("__TRY a := 1; b := i / k; __CATCH(e) o := a; __ENDTRY o := o + b;", "i k"),
        ("a := 5; b := a; n := b; o := n; a := o;", "a b i k n"),
        ("a.3 := t; o := a;", "i k"),
        ("o := i; o := o + Twice(a); a := 4;", "i k"),
    ],
)
def test_what_a_call_needs_of_the_previous_one_is_kept(body: str, names: str) -> None:
    twice = "FUNCTION Twice : INT VAR_IN_OUT v : INT; END_VAR v := v * 2; Twice := v; END_FUNCTION\n"
    assert unkept((twice if "Twice" in body else "") + program(body)) == names


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (program("o := i + k;", "f(i := x);"), "i"),  # `k` stays as it is, or as a user writes it
        (program("o := i + k;", "f(i := x, k := x); f(k := y);"), "k"),
        (program("a := i; o := a;", rest="y := f.a;"), "i k"),
        (program("a := i; o := a;", rest="y := f.i;"), "a k"),
        (program("a := i; o := THIS^.a;"), "i k"),
        (program("a := i; o := a;", more="METHOD m : INT m := a; END_METHOD\n", rest="y := f.m();"), "i k"),
        (program("a := i; o := a; Set();", more="ACTION Set: b := a; END_ACTION\n"), "i k"),
        (program("a := i; p := ADR(a); o := p^;").replace("t : BOOL", "p : POINTER TO INT; t : BOOL"), "i k p"),
        (program("a := i; o := a;") + " FUNCTION_BLOCK More EXTENDS Work SUPER^(); END_FUNCTION_BLOCK "
         "PROGRAM Other VAR m : More; END_VAR m(i := 1, k := 2); END_PROGRAM", ""),
    ],
)  # fmt: skip
def test_what_others_name_is_kept(text: str, names: str) -> None:
    assert unkept(text) == names


PAIRS = """TYPE
Inner : STRUCT c : INT; list : ARRAY[0..3] OF INT; END_STRUCT
Pair : STRUCT a, b : INT; in : Inner; END_STRUCT
END_TYPE
"""


@pytest.mark.parametrize(
    ("body", "names"),
    [
        ("o := p.a + p.in.c;", "p"),
        ("o := p.in.list[2];", ""),
        ("o := p.in.list[p.a];", ""),
        ("last := p; o := p.a;", ""),
        ("p.b := 3; o := p.a;", ""),
        ("p.b.2 := TRUE; o := p.a;", ""),
        ("o := Twice(p.b);", ""),
        ("w := ADR(p); o := p.a;", "w"),
    ],
)
def test_a_structure_is_not_kept_where_only_its_scalars_are_read(body: str, names: str) -> None:
    text = PAIRS + "FUNCTION Twice : INT VAR_IN_OUT v : INT; END_VAR v := v * 2; Twice := v; END_FUNCTION\n"
    text += "FUNCTION_BLOCK Work VAR_INPUT p : Pair; END_VAR VAR_OUTPUT o : INT; END_VAR "
    text += f"VAR last : Pair; w : POINTER TO Pair; END_VAR {body} END_FUNCTION_BLOCK "
    assert unkept(text + "PROGRAM Main VAR f : Work; s : Pair; END_VAR f(p := s); END_PROGRAM") == names


@pytest.mark.parametrize(
    ("call", "sums"),
    [
        ("f(p := one, q := two, n := 1);", [4321, 4321]),
        ("f(p := f.q, q := two, n := 1);", [4300, 4343]),
        ("f(q := two, p := f.q, n := 1);", [4300, 4343]),
        ("f(p := one, q := two, n := Swap(one));", [4321, 4312]),
        ("f(p := Swapped(one), q := one, n := 1);", [2112, 2112]),
        ("f(p := several[i], q := one, n := Swap(several[i]));", [2165, 2156]),
        ("g(p := one, n := Swap(one));", [21, 12]),
    ],
)
@pytest.mark.parametrize("size", [False, True])
def test_a_structure_has_the_value_of_the_moment_it_was_given(call: str, sums: list[int], size: bool) -> None:
    text = PAIRS + (
        "FUNCTION Swap : INT VAR_IN_OUT s : Pair; END_VAR VAR h : INT; END_VAR "
        "h := s.a; s.a := s.b; s.b := h; Swap := 1; END_FUNCTION\n"
        "FUNCTION Swapped : Pair VAR_INPUT s : Pair; END_VAR Swapped.a := s.b; Swapped.b := s.a; END_FUNCTION\n"
        "FUNCTION_BLOCK Work VAR_INPUT p, q : Pair; n : INT; END_VAR VAR_OUTPUT sum : INT; END_VAR "
        "VAR last : Pair; END_VAR last := q; sum := p.a + 10 * p.b + 100 * q.a + 1000 * q.b * n; END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK Small VAR_INPUT p : Pair; n : INT; END_VAR VAR_OUTPUT sum : INT; END_VAR "
        "sum := p.a + 10 * p.b; END_FUNCTION_BLOCK\n"
        "PROGRAM Main VAR f : Work; g : Small; one : Pair := (a := 1, b := 2); two : Pair := (a := 3, b := 4); "
        "i : INT := 2; several : ARRAY[1..2] OF Pair := [(a := 7), (a := 5, b := 6)]; "
        f"sums : ARRAY[0..1] OF INT; END_VAR {call} sums[0] := sums[1]; sums[1] := f.sum + g.sum; END_PROGRAM"
    )
    assert set(unkept(text).split()) == {"n", "p"}
    built = build(text, size=size)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(2)
        assert plc.read("Main.sums") == sums


def test_reading_a_member_of_one_says_where_it_is() -> None:
    text = PAIRS + "FUNCTION_BLOCK Work VAR_INPUT p : Pair; END_VAR VAR_OUTPUT o : INT; END_VAR o := p.in.c; "
    text += "END_FUNCTION_BLOCK PROGRAM Main VAR f : Work; s : Pair; END_VAR f(p := s); END_PROGRAM"
    built = build(text, size=True)
    with Simulator(built.image, built.symbols) as plc, pytest.raises(UsageError, match="is in a register"):
        plc.read("Main.f.p.in.c")


def test_what_can_be_watched_at_o2_is_kept() -> None:
    typed = checked(program("a := i; o := a;"))
    assert not lower(typed, Options(find_target(HOST), 2)).transient
    assert not lower(typed, Options(find_target(HOST), 3, debug=True)).transient
    assert lower(typed, Options(find_target(HOST), 2, size=True)).transient


def build(text: str, *, size: bool) -> BuildResult:
    return build_program(checked(text), Options(find_target(HOST), 0, ALL_CHECKS, size=size))


def test_reading_one_says_where_it_is(tmp_path: Path) -> None:
    built = build(program("a := i; o := a;", call="x := x + 1; f(i := x, k := 5);"), size=True)
    built.symbols.save(tmp_path / "app.sym")
    with Simulator(built.image, SymbolTable.from_json((tmp_path / "app.sym").read_text())) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.f.o") == 3
        assert plc.read("Main.f").keys() == {"o", "b", "n", "t", "e"}
        with pytest.raises(UsageError, match=r"Main\.f\.a is in a register.*build it with -O2"):
            plc.read("Main.f.a")
        with pytest.raises(UsageError, match=r"Main\.f\.i is in a register"):
            plc.write({"Main.f.i": 1})
        assert plc.symbols().select(["Main.f.*"]).keys() == {f"Main.f.{name}" for name in "obnte"}


def test_an_index_that_is_not_kept_is_no_wrong_one_in_the_message() -> None:
    text = program("a := i + 5; s[a] := 1;", call="f(i := 2, k := 5);")
    text = text.replace("a, b, n : INT", "s : ARRAY[0..3] OF INT; a : INT := 9; b, n : INT")  # 9 stays in memory
    for size, wanted in ((False, "the index of Main.f.s is 7, outside 0..3"), (True, "the index of s is outside 0..3")):
        built = build(text, size=size)
        with Simulator(built.image, built.symbols) as plc:
            with pytest.raises(ProgramStopped) as stop:
                plc.run_cycles(1)
            assert stop.value.exception.detail == wanted


class Writer:
    """Random blocks that call each other, and the program of them."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def expression(self, names: Sequence[str], depth: int = 2) -> str:
        choose = self.random.choice
        if depth == 0 or self.random.random() < 0.3:
            return choose([*names, *names, str(self.random.randrange(-3, 9))])
        left, right = (self.expression(names, depth - 1) for _ in range(2))
        return f"({left} {choose(['+', '-', '*', 'AND', 'XOR'])} {right})"

    def statements(self, names: Sequence[str], depth: int, inner: str) -> str:
        return "\n".join(self.statement(names, depth, inner) for _ in range(self.random.randrange(1, 5)))

    def statement(self, names: Sequence[str], depth: int, inner: str) -> str:
        e, name = self.expression(names), self.random.choice(names)
        kind = self.random.randrange(4 if depth == 0 else 10)
        if kind < 3:
            return f"{name} := {e};"
        if kind == 3:
            return f"{inner}(i := {e}, k := {self.expression(names)}, o => {name});" if inner else f"o := {e};"
        is_loop = kind in (7, 9)  # which has no loop in it, because they share their variables
        body, other = (self.statements(names, 0 if is_loop else depth - 1, inner) for _ in range(2))
        return [
            f"IF {e} > 3 THEN {body} ELSIF {name} < 0 THEN {other} ELSE {name} := 1; END_IF",
            f"IF {e} < 2 THEN {body} END_IF",
            f"CASE {e} OF 0..2: {body} 5: {other} END_CASE",
            f"FOR n := 0 TO 3 DO {body} IF {e} = 2 THEN EXIT; END_IF {other} END_FOR",
            f"IF {e} = 4 THEN o := {name}; RETURN; END_IF",
            f"w := 0; WHILE w < 3 DO w := w + 1; IF {e} > 5 THEN CONTINUE; END_IF {body} END_WHILE",
        ][kind - 4]

    def block(self, name: str, inner: str) -> str:
        names = ["i", "k", "o", "a", "b", "c"]
        used = f"inner : {inner};" if inner else ""
        return (
            (
                f"FUNCTION_BLOCK {name} VAR_INPUT i, k : WORD; END_VAR VAR_OUTPUT o : WORD; END_VAR "
                f"VAR a, b, c, n, w : WORD; {used} END_VAR\n{self.statements(names, 2, 'inner' if inner else '')}\n"
                f"{self.statements(names, 2, 'inner' if inner else '')}\nEND_FUNCTION_BLOCK\n"
            )
            .replace("WORD", "INT")
            .replace("AND", "+")
            .replace("XOR", "-")
        )

    def text(self) -> str:
        blocks = self.block("Small", "") + self.block("Large", "Small")
        call = self.random.choice(
            ["large(i := x, k := y, o => y);", "large(i := x); large(k := y, i := y); y := large.o;"]
        )
        return (
            f"{blocks}PROGRAM Main VAR large : Large; small : Small; x, y : INT; END_VAR\n"
            f"x := x + 1; {call} small(i := y, k := x);\nEND_PROGRAM"
        )


@pytest.mark.parametrize("seed", share(range(25), 4))
def test_the_program_does_the_same(seed: int) -> None:
    text = Writer(seed).text()
    all_kept, less_kept = build(text, size=False), build(text, size=True)
    with Simulator(all_kept.image, all_kept.symbols) as one, Simulator(less_kept.image, less_kept.symbols) as other:
        names = [s.name for variable in less_kept.symbols.variables.values() for s in variable.leaves()]
        assert len(names) < sum(1 for v in all_kept.symbols.variables.values() for _ in v.leaves())
        for _ in range(20):
            one.run_cycles(1)
            other.run_cycles(1)
            assert one.read_all(names) == other.read_all(names), text
