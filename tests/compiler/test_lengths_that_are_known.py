"""Lengths that the compiler knows of strings are those that they have: random statements, against a model."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from plctool import Simulator
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.source import Source
from plctool.image.targets import find_target

CAPACITIES = {"a": 5, "b": 80, "c": 255, "d": 300, "e": 20}
LONGEST_RESULT = 255  # of the functions of the library
STATEMENTS = 150
CYCLES = 3
OPTIMISED = 2  # programs: one with a block and one without
DECLARATIONS = "".join(f"{name} : STRING[{capacity}]; " for name, capacity in CAPACITIES.items())


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

        def changes() -> None:  # a string whose length is known, perhaps
            self._assign(y, "changed")
            self._assign(x, (t(x) + "*")[:LONGEST_RESULT])

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
                (f"{x} := INSERT({x}, {y}, {k});", lambda: self._assign(x, (t(x)[:k] + t(y) + t(x)[k:])[:255])),
                *[(f"{x}[{place}] := 0;", cut)] * 2,
                *[(f"p := ADR({x}) + {place}; p^ := 0;", cut)] * 2,
                (f"IF LEN({y}) > {k} THEN {x} := '{literal}'; END_IF", conditional),
            ]
        )

        def noted() -> None:
            change()
            self.lengths[number] = len(t(measured))

        measured = choose((x, y, y))
        return f"{text} lengths[{number}] := LEN({measured});", noted

    def texts_of(self, name: str) -> str:
        return self.texts[name]


def program(model: Model, *, in_block: bool) -> str:
    rest = f"p : POINTER TO BYTE; lengths : ARRAY[0..{STATEMENTS - 1}] OF INT; END_VAR"
    change = "FUNCTION Change : STRING[9] VAR_IN_OUT x : STRING; END_VAR x := 'changed'; Change := '*'; END_FUNCTION\n"
    twice = "FUNCTION Twice : STRING[9] VAR_INPUT x : STRING; END_VAR Twice := CONCAT(x, x); END_FUNCTION\n"
    if in_block:
        return (
            f"{change}{twice}FUNCTION_BLOCK Work VAR {DECLARATIONS} {rest}\n{model.body}\nEND_FUNCTION_BLOCK\n"
            "PROGRAM Main VAR work : Work; END_VAR work(); END_PROGRAM"
        )
    return f"{change}{twice}PROGRAM Main VAR {DECLARATIONS} {rest}\n{model.body}\nEND_PROGRAM"


@pytest.mark.parametrize("seed", range(8))
def test_strings_and_lengths_are_those_of_the_model(seed: int, tmp_path: Path) -> None:
    """The lowering knows the lengths; the optimiser, which takes most of the time, works on two of the programs."""
    model, in_block = Model(seed), seed % 2 == 1
    prefix = "Main.work." if in_block else "Main."
    (tmp_path / "main.st").write_text(program(model, in_block=in_block))
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
    checked = check_sources([Source("main.st", f"PROGRAM Main VAR s : STRING; n : INT; END_VAR {body} END_PROGRAM")])
    assert checked.program, checked.diagnostics
    return "".join(part.text for part in lower(checked.program, Options(find_target("cortex-m3"))).parts)


def test_known_strings_are_not_looked_through_for_their_ends() -> None:
    text = lowered("s := 'a'; s := CONCAT(s, 'b'); s := CONCAT(s, INT_TO_STRING(n)); n := LEN(s);")
    assert "@st.CONCAT" not in text
    assert "@st.LEN" not in text


def test_after_a_branch_nothing_is_known() -> None:
    text = lowered("s := 'a'; IF n > 0 THEN s := 'bc'; END_IF s := CONCAT(s, 'b'); s := CONCAT(s, 'c');")
    assert text.count(" call i32 @st.CONCAT") == 1
