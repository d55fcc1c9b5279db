"""Lengths that the compiler knows of strings are those that they have: random statements, against a model."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
from shares import share

from plctool import Simulator
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.image.targets import find_target

CAPACITIES = {"a": 5, "b": 80, "c": 255, "d": 300, "e": 20}
LONGEST_RESULT = 255  # of the functions of the library
STATEMENTS = 150
CYCLES = 3
KINDS = ("program", "block", "function")
OPTIMISED = len(KINDS)  # programs: one of each
DECLARATIONS = "".join(f"{name} : STRING[{capacity}]; " for name, capacity in CAPACITIES.items())
OTHER_NAMES = "p : POINTER TO BYTE; holder : Holder; " + "".join(
    f"to_{name} : POINTER TO STRING[{capacity}]; " for name, capacity in CAPACITIES.items()
)
UNITS = """
FUNCTION Change : STRING[9] VAR_IN_OUT x : STRING; END_VAR x := 'changed'; Change := '*'; END_FUNCTION
FUNCTION Twice : STRING[9] VAR_INPUT x : STRING; END_VAR Twice := CONCAT(x, x); END_FUNCTION
FUNCTION_BLOCK Holder VAR_IN_OUT held : STRING; END_VAR
METHOD Put held := 'put'; END_METHOD
METHOD Marked : STRING Marked := CONCAT('-', held); END_METHOD
END_FUNCTION_BLOCK
"""


Step = tuple[str, Callable[[], None]]  # a statement, and what it does


class Model:
    """Writes statements, and does what they do."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.steps = [self._step(number) for number in range(STATEMENTS)]
        self.texts = dict.fromkeys(CAPACITIES, "")
        self.lengths = [0] * STATEMENTS

    @property
    def body(self) -> str:
        return "\n".join(text for text, _ in self.steps)

    def run(self) -> None:
        for _, change in self.steps:
            change()

    def _assign(self, name: str, text: str) -> None:
        self.texts[name] = text[: CAPACITIES[name]]

    def _number(self, place: int, value: int, name: str, text: str) -> None:
        self.lengths[place] = value
        self._assign(name, text)

    def _step(self, number: int) -> Step:
        choose = self.random.choice
        x, y, z = (choose("abbcde") for _ in range(3))  # few, so that much is known of them
        k, n = self.random.randrange(12), self.random.randrange(9)
        literal = "".join(choose("pqrs") for _ in range(self.random.randrange(12)))
        t = self.texts_of
        place = min(k, CAPACITIES[x] - 1)

        def appended(*names: str) -> str:
            return "".join(t(name) for name in names)[:LONGEST_RESULT]

        def cut() -> None:  # a character becomes the end; what is after it stays in memory, but is never looked at
            self._assign(x, t(x)[:place])

        def conditional() -> None:
            if len(t(y)) > k:
                self._assign(x, literal)

        def chosen() -> None:
            self._assign(x, literal if len(t(y)) > k else appended(x, z))

        def replaced() -> None:
            self._assign(x, (t(y)[:k] + t(z) + t(y)[k + n :])[:LONGEST_RESULT])

        def spliced(text: str, removed: int) -> None:
            self._assign(x, (t(x)[:k] + text + t(x)[k + removed :])[:LONGEST_RESULT])

        def put_in_after_a_change() -> None:  # of x itself, perhaps: IN1 is as it was
            before = t(x)
            self._assign(y, "changed")
            self._assign(x, (before[:k] + "*" + before[k:])[:LONGEST_RESULT])

        def found() -> None:
            self._assign(x, str(t(y).find(literal) + 1 if literal else 0))

        def changes() -> None:  # a string whose length is known, perhaps
            before = t(x)
            self._assign(y, "changed")
            self._assign(x, (before + "*")[:LONGEST_RESULT])

        def marked() -> None:
            self._assign(x, ("-" + t("b"))[:80])

        text, change = choose(
            [
                (f"{x} := '{literal}';", lambda: self._assign(x, literal)),
                (f"{x} := {y};", lambda: self._assign(x, t(y))),
                *[(f"{x} := CONCAT({x}, {y});", lambda: self._assign(x, appended(x, y)))] * 4,
                *[(f"{x} := CONCAT({x}, '{literal}');", lambda: self._assign(x, (t(x) + literal)[:LONGEST_RESULT]))]
                * 4,
                (f"{x} := CONCAT({y}, {z});", lambda: self._assign(x, appended(y, z))),
                *[(f"{x} := CONCAT({x}, Change({y}));", changes)] * 3,
                *[(f"{x} := Twice({y});", lambda: self._assign(x, (t(y)[:80] * 2)[:9]))] * 2,
                (f"{x} := LEFT({y}, {n});", lambda: self._assign(x, t(y)[:n])),
                (f"{x} := RIGHT({y}, {n});", lambda: self._assign(x, t(y)[max(0, len(t(y)) - n) :])),
                (f"{x} := MID({y}, {n}, {k + 1});", lambda: self._assign(x, t(y)[k : k + n])),
                (f"{x} := DELETE({x}, {n}, {k + 1});", lambda: self._assign(x, (t(x)[:k] + t(x)[k + n :])[:255])),
                (f"{x} := DELETE({y}, {n}, {k + 1});", lambda: self._assign(x, (t(y)[:k] + t(y)[k + n :])[:255])),
                (f"{x} := DELETE({x}, {-n}, {k + 1});", lambda: spliced("", 0)),
                (f"{x} := DELETE({x}, {n}, {-k});", lambda: self._assign(x, t(x)[n:][:LONGEST_RESULT])),
                *[(f"{x} := INSERT({x}, {y}, {k});", lambda: spliced(t(y), 0))] * 2,
                (f"{x} := INSERT({x}, '{literal}', {-k});", lambda: self._assign(x, (literal + t(x))[:255])),
                (f"{x} := INSERT({x}, Change({y}), {k});", put_in_after_a_change),
                (f"to_{x} := ADR({x}); {x} := INSERT({x}, to_{x}^, {k});", lambda: spliced(t(x), 0)),
                *[(f"{x} := REPLACE({x}, {y}, {n}, {k + 1});", lambda: spliced(t(y), n))] * 2,
                (f"{x} := REPLACE({x}, '{literal}', LEN({y}), {k + 1});", lambda: spliced(literal, len(t(y)))),
                (f"{x} := REPLACE({x}, Twice({y}), {-n}, {k + 1});", lambda: spliced((t(y)[:80] * 2)[:9], 0)),
                (f"to_{y} := ADR({y}); {x} := CONCAT({z}, to_{y}^);", lambda: self._assign(x, appended(z, y))),
                (f"to_{x} := ADR({x}); {x} := CONCAT({z}, to_{x}^);", lambda: self._assign(x, appended(z, x))),
                (f"to_{x} := ADR({x}); to_{x}^ := {y};", lambda: self._assign(x, t(y))),
                (f"holder(held := b); b := '{literal}'; holder.Put();", lambda: self._assign("b", "put")),
                (f"holder(held := b); {x} := holder.Marked();", marked),
                *[(f"{x}[{place}] := 0;", cut)] * 2,
                *[(f"p := ADR({x}) + {place}; p^ := 0;", cut)] * 2,
                (f"IF LEN({y}) > {k} THEN {x} := '{literal}'; END_IF", conditional),
                (f"IF LEN({y}) <= {k} THEN ; ELSE {x} := '{literal}'; END_IF", conditional),
                (f"IF {y} <> {y} THEN RETURN; END_IF {x} := '{literal}';", lambda: self._assign(x, literal)),
                (
                    f"IF LEN({y}) > {k} THEN {x} := '{literal}'; ELSIF {z} = {z} THEN {x} := CONCAT({x}, {z}); END_IF",
                    chosen,
                ),
                (f"{x} := '{literal}$00pqrs';", lambda: self._assign(x, literal)),
                (f"{x} := REPLACE({y}, {z}, {n}, {k + 1});", replaced),
                (f"{x} := INT_TO_STRING(FIND({y}, '{literal}'));", found),
                (f"{x} := MAX({y}, {z});", lambda: self._assign(x, max(t(y), t(z))[:LONGEST_RESULT])),
                (f"lengths[{n * 9}] := {n}; {x} := {y};", lambda: self._number(n * 9, n, x, t(y))),
            ]
        )

        def noted() -> None:
            change()
            self.lengths[number] = len(t(measured))

        measured = choose((x, y, y))
        return f"{text} lengths[{number}] := LEN({measured});", noted

    def texts_of(self, name: str) -> str:
        return self.texts[name]


def program(model: Model, kind: str) -> str:
    rest = f"{OTHER_NAMES} lengths : ARRAY[0..{STATEMENTS - 1}] OF INT; END_VAR"
    if kind == "block":
        return (
            f"{UNITS}FUNCTION_BLOCK Work VAR {DECLARATIONS} {rest}\n{model.body}\nEND_FUNCTION_BLOCK\n"
            "PROGRAM Main VAR work : Work; END_VAR work(); END_PROGRAM"
        )
    if kind == "function":  # its variables, which live on the stack, are put back from those of the program
        back = "".join(f"{name} := kept_{name}; " for name in CAPACITIES)
        keep = "".join(f"kept_{name} := {name}; " for name in CAPACITIES)
        kept = "".join(f"kept_{name} : STRING[{capacity}]; " for name, capacity in CAPACITIES.items())
        arguments = ", ".join(f"kept_{name} := {name}" for name in CAPACITIES)
        return (
            f"{UNITS}FUNCTION Work : BOOL VAR {DECLARATIONS} {OTHER_NAMES} END_VAR "
            f"VAR_IN_OUT {kept} lengths : ARRAY[0..{STATEMENTS - 1}] OF INT; END_VAR\n"
            f"{back}\n{model.body}\n{keep}\nEND_FUNCTION\n"
            f"PROGRAM Main VAR {DECLARATIONS} {rest} Work({arguments}, lengths := lengths); END_PROGRAM"
        )
    return f"{UNITS}PROGRAM Main VAR {DECLARATIONS} {rest}\n{model.body}\nEND_PROGRAM"


@pytest.mark.parametrize("seed", share(range(9), 5))
def test_strings_and_lengths_are_those_of_the_model(seed: int, tmp_path: Path) -> None:
    """The lowering knows the lengths; the optimiser, which takes most of the time, works on some of the programs."""
    model, kind = Model(seed), KINDS[seed % len(KINDS)]
    prefix = "Main.work." if kind == "block" else "Main."
    (tmp_path / "main.st").write_text(program(model, kind))
    with Simulator.from_sources(tmp_path / "main.st", level=2 if seed < OPTIMISED else 0) as plc:
        for _ in range(CYCLES):
            model.run()
            plc.run_cycles(1)
            assert {name: plc.read(prefix + name) for name in CAPACITIES} == model.texts
            assert plc.read(prefix + "lengths") == model.lengths


def test_a_string_that_is_longer_than_a_result_is_cut(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(
        "PROGRAM Main VAR s : STRING[300]; after : DINT := 7; END_VAR "
        f"s := '{'x' * 290}'; s := CONCAT(s, 'y'); END_PROGRAM"
    )
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.s"), plc.read("Main.after")) == ("x" * LONGEST_RESULT, 7)


def lowered(body: str) -> str:
    checked = check_sources([Source("main.st", f"PROGRAM Main VAR s, t : STRING; n : INT; END_VAR {body} END_PROGRAM")])
    assert checked.program, checked.diagnostics
    return "".join(part.text for part in lower(checked.program, Options(find_target("cortex-m3"))).parts)


def test_known_strings_are_not_looked_through_for_their_ends() -> None:
    text = lowered("s := 'a'; s := CONCAT(s, 'b'); s := CONCAT(s, INT_TO_STRING(n)); n := LEN(s);")
    assert "@st.CONCAT" not in text
    assert "@st.LEN" not in text


def test_after_a_branch_nothing_is_known() -> None:
    text = lowered("s := 'a'; IF n > 0 THEN s := 'bc'; END_IF s := CONCAT(s, 'b'); s := CONCAT(s, 'c');")
    assert text.count(" call i32 @st.CONCAT") == 1


def test_after_a_branch_that_writes_no_string_all_is_known() -> None:
    text = lowered("s := 'a'; IF n > 0 THEN n := 3; ELSIF s = 'x' THEN RETURN; END_IF s := CONCAT(s, 'b');")
    assert "@st.CONCAT" not in text


def test_functions_of_known_strings_are_given_the_lengths() -> None:
    text = lowered("s := 'abc'; s := LEFT(s, n); n := FIND(s, 'b'); s := REPLACE(s, 'xy', 1, n);")
    assert "@str.copy" not in text
    assert "@str.span" not in text


def test_looking_for_the_end_of_one_string_leaves_the_lengths_of_others_known() -> None:
    text = lowered("t := 'abc'; IF n > 0 THEN s := 'x'; END_IF s := INSERT(s, t, n);")
    assert text.count(" call i32 @str.span(") == 1


ALIASES = """
TYPE Pair : STRUCT b : INT; a : STRING[20]; END_STRUCT END_TYPE
VAR_GLOBAL g : STRING; END_VAR
FUNCTION Make : Pair VAR_INPUT n : INT; END_VAR Make.a := 'longer than before'; Make.b := n; END_FUNCTION
FUNCTION Put : BOOL VAR_IN_OUT s : STRING; END_VAR s := CONCAT('x', g); END_FUNCTION
FUNCTION Append : BOOL VAR_IN_OUT s : STRING; END_VAR g := 'abcdef'; s := 'zz'; s := CONCAT(s, g); END_FUNCTION
FUNCTION Cut : BOOL VAR_IN_OUT s : STRING; END_VAR g := 'abcdef'; s := LEFT(g, 2); s := CONCAT(g, 'q'); END_FUNCTION
PROGRAM Main VAR p : Pair; n, m : INT; done : BOOL; put_, appended, cut_, ended : STRING; END_VAR
p.a := 'x'; p := Make(3); n := LEN(p.a); p.a := CONCAT(p.a, '!');
g := 'abc'; done := Put(g); put_ := g;
done := Append(g); appended := g;
done := Cut(g); cut_ := g;
ended := 'ab$00cd'; m := LEN(ended); ended := CONCAT(ended, 'e');
END_PROGRAM"""


@pytest.mark.parametrize("level", [0, 2])
def test_a_string_may_be_written_under_another_name(level: int, tmp_path: Path) -> None:
    """As a whole structure, or as the VAR_IN_OUT of a function; and it may end within a constant."""
    (tmp_path / "main.st").write_text(ALIASES)
    with Simulator.from_sources(tmp_path / "main.st", level=level) as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.p.a"), plc.read("Main.n")) == ("longer than before!", 18)
        assert [plc.read(f"Main.{name}") for name in ("put_", "appended", "cut_")] == ["xabc", "zzzz", "abq"]
        assert (plc.read("Main.ended"), plc.read("Main.m")) == ("abe", 2)


VALUES_AS_TEXT = {
    "REAL": [
        "0.0",
        "-0.0",
        "1.5",
        "-1.5E30",
        "1.0E-38",
        "SQRT(REAL#-1.0)",
        "EXP(REAL#1.0E9)",
        "-EXP(REAL#1.0E9)",
        "123456.7",
    ],
    "LREAL": ["0.0", "1.0E300", "-2.5E-300", "0.1", "SQRT(LREAL#-1.0)", "EXP(LREAL#1.0E9)"],
    "BOOL": ["TRUE", "FALSE"],
    "SINT": ["-128", "0"],
    "DINT": ["-2147483648", "9", "10"],
    "UDINT": ["4294967295"],
    "LINT": ["-9223372036854775808", "1000000000"],
    "ULINT": ["18446744073709551615", "999999999", "1000000000000000000"],
    "WORD": ["16#FFFF"],
    "TIME": ["T#0s", "T#-1ms", "T#24d20h31m23s647ms", "T#1h"],
    "LTIME": ["LTIME#0s", "LTIME#-1ns", "LTIME#1d1us", "LTIME#2h"],
    "DATE": ["D#1970-01-01", "D#2106-02-07"],
    "LDATE": ["LDATE#2200-12-31"],
    "TOD": ["TOD#0:0:0", "TOD#23:59:59.999"],
    "LTOD": ["LTOD#0:0:0.000000001", "LTOD#1:0:0"],
    "DT": ["DT#2026-11-26-12:00:00"],
    "LDT": ["LDT#2026-11-26-12:00:00.5"],
}


def test_the_length_of_every_value_as_text_is_right(tmp_path: Path) -> None:
    cases = [(t, value) for t, values in VALUES_AS_TEXT.items() for value in values]
    body = "".join(
        f"v{n} := {value}; s := {t}_TO_STRING(v{n}); lengths[{n}] := LEN(s); written[{n}] := s;\n"
        for n, (t, value) in enumerate(cases)
    )
    variables = "".join(f"v{n} : {t}; " for n, (t, _) in enumerate(cases))
    arrays = f"lengths : ARRAY[0..{len(cases) - 1}] OF INT; written : ARRAY[0..{len(cases) - 1}] OF STRING;"
    (tmp_path / "main.st").write_text(f"PROGRAM Main VAR s : STRING; {variables}{arrays} END_VAR\n{body}END_PROGRAM")
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        plc.run_cycles(1)
        written = plc.read("Main.written")
        assert all(written)
        assert plc.read("Main.lengths") == [len(text) for text in written]
