"""Values that are not loaded again and stores that are left out: the program does the same as with all of them."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from front_support import main, program
from hypothesis import given
from hypothesis import strategies as st
from shares import examples, share

from plctool import Simulator
from plctool.compiler import compile_sources
from plctool.compiler.codegen.emit import optimised
from plctool.compiler.codegen.ir import Value
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.memory import Memory
from plctool.compiler.image.build import build_program
from plctool.image.targets import find_target

SIZES = {"i8": 1, "i16": 2, "i32": 4, "i64": 8, "float": 4}
BASES = {Value("%a"): 0, Value("%b"): 5, Value("%far"): 24}  # bytes of one memory: the first two reach the same
ROOM = 64

ACCESSES = st.lists(
    st.tuples(st.booleans(), st.sampled_from([*BASES]), st.integers(0, 16), st.sampled_from([*SIZES])),
    min_size=30,
    max_size=60,
)


@examples(300)
@given(ACCESSES)
def test_memory_and_values_are_as_with_every_load_and_store(accesses: list[tuple[bool, Value, int, str]]) -> None:
    whole, held = bytearray(ROOM), Memory()
    left_out: set[int] = set()
    given_instead: dict[int, bytes] = {}
    values: dict[Value, bytes] = {}
    stores: dict[int, bytes] = {}
    for line, (is_store, base, offset, text) in enumerate(accesses):
        at = BASES[base] + offset
        place = slice(at, at + SIZES[text])
        value = Value(f"%v{line}")
        if is_store:
            stores[line] = values[value] = bytes([line + 1] * SIZES[text])
            useless = held.note_store(base, offset, text, value, line)
            if useless is not None:
                left_out.add(useless)
            whole[place] = stores[line]
            continue
        known = held.value(base, offset, text)
        if known is None:
            held.note_load(base, offset, text, value)
            values[value] = bytes(whole[place])
        else:
            assert values[known] == whole[place]
            given_instead[line] = values[known]
    shorter = bytearray(ROOM)
    full = bytearray(ROOM)
    for line, (is_store, base, offset, text) in enumerate(accesses):
        at = BASES[base] + offset
        place = slice(at, at + SIZES[text])
        if is_store:
            full[place] = stores[line]
            if line not in left_out:
                shorter[place] = stores[line]
        elif line not in given_instead:
            assert shorter[place] == full[place], "a load found what a left out store should have changed"
    assert shorter == full


SIMPLE = {  # a type and a value that is not its zero
    "BOOL": "TRUE", "SINT": "-7", "WORD": "500", "DINT": "-70000", "REAL": "2.5", "LREAL": "-0.25", "STRING(2)": "'x'",
}  # fmt: skip


@examples(25)
@given(st.lists(st.sampled_from([*SIMPLE, "BOOL", "BOOL"]), min_size=8, max_size=8), st.permutations(range(8)))
@pytest.mark.parametrize("packed", ["", "{attribute 'pack_mode' := '1'}\n"])
def test_constants_in_a_block_leave_what_is_beside_them_alone(packed: str, types: list[str], order: list[int]) -> None:
    declared = "".join(f"v{i} : {t} := {SIMPLE[t]};" for i, t in enumerate(types))
    zeros = {"BOOL": "FALSE", "STRING(2)": "''"}
    body = "".join(f"v{i} := {zeros.get(types[i], '0')};" for i in order[:5])
    source = f"{packed}FUNCTION_BLOCK Work VAR {declared} END_VAR {body} END_FUNCTION_BLOCK\n"
    built = build_program(program(source + main("f : Work;", "f();")), Options(find_target("x86_64-linux")))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        found = [plc.read(f"Main.f.v{i}") for i in range(8)]
    values = {"BOOL": True, "SINT": -7, "WORD": 500, "DINT": -70000, "REAL": 2.5, "LREAL": -0.25, "STRING(2)": "x"}
    assert found == [type(values[t])() if i in order[:5] else values[t] for i, t in enumerate(types)]


def test_a_timer_is_reset_by_one_store() -> None:
    target = find_target("x86_64-linux")
    (part,) = lower(program(main("t : TON; on : BOOL;", "t(IN := on, PT := T#1s);")), Options(target)).parts
    module, machine = optimised(part, Options(target))
    assert len(re.findall(r"mov[bwlq]\t\$0, \d+\(%r\w+\)", machine.emit_assembly(module))) == 1


PLACES = [
    "a", "b", "p^", "q^", "r", "u.whole", "u.low", "u.part[1]", "u.part[2]", "t.x", "t.y", "t.z", "w", "at_w",
    "list[2]", "a.3", "list[i]", "list[1]",
]  # fmt: skip
DECLARED = """TYPE
U : UNION whole : DWORD; low : WORD; part : ARRAY[0..3] OF BYTE; END_UNION
{attribute 'pack_mode' := '1'}
T : STRUCT x : BYTE; y : DINT; z : INT; END_STRUCT
END_TYPE
PROGRAM Main
VAR
    a, b, i : DINT; p, q : POINTER TO DINT; r : REFERENCE TO DINT; u : U; t : T;
    w AT %MD1 : DINT; at_w AT %MW3 : INT; list : ARRAY[1..3] OF DINT;
END_VAR
p := ADR(a); q := ADR(list[2]); r REF= b; i := 2;
"""


@pytest.mark.parametrize("seed", share(range(12), 6))
def test_a_program_does_the_same_as_without_optimisation(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)

    def operand() -> str:
        place = chance.choice([*PLACES, str(chance.randint(0, 99))])
        return f"TO_DINT({place})" if not place[0].isdigit() else place

    body = ""
    for _ in range(150):
        target = chance.choice(PLACES)
        types = {"u.whole": "DWORD", "u.low": "WORD", "t.x": "BYTE", "t.z": "INT", "at_w": "INT", "a.3": "BOOL"}
        wanted = types.get(target, "BYTE" if target.startswith("u.part") else "DINT")
        body += f"{target} := TO_{wanted}({operand()} * 3 + {operand()});\n"
    source = tmp_path / "main.st"
    source.write_text(DECLARED + body + "END_PROGRAM\n")
    found = []
    for level in (0, 1, 2):
        result = compile_sources([source], level=level)
        with Simulator(result.image, result.symbols) as plc:
            plc.run_cycles(2)
            names = ["a", "b", "u.whole", "t.x", "t.y", "t.z", "w", *(f"list[{n}]" for n in (1, 2, 3))]
            found.append([plc.read(f"Main.{name}") for name in names])
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize(
    ("body", "loads", "stores"),
    [
        ("a := b; c := a + b;", 1, 2),
        ("a := b; a := c;", 2, 1),
        ("a := b; p^ := 1; c := a;", 3, 3),
        ("a := b; c := p^; a := 0;", 3, 3),
        ("a := b; IF c > 0 THEN c := a; END_IF", 3, 2),
        ("a := b; F(); c := a;", 2, 2),
    ],
    ids=["what was stored", "an overwritten store", "a pointer's store", "a pointer's load", "a branch", "a call"],
)
def test_what_is_written(body: str, loads: int, stores: int) -> None:
    other = "FUNCTION F\nEND_FUNCTION\n"
    checked = program(main("a, b, c : DINT; p : POINTER TO DINT;", body, other))
    lowered = lower(checked, Options(find_target("cortex-m3"), checks=frozenset()))
    text = next(t for t in re.split(r"\ndefine ", lowered.parts[0].text) if "@st.Main(" in t.split("\n", 1)[0])
    assert len(re.findall(r" = load (?!.*invariant)", text)) == loads
    assert len(re.findall(r"^  store ", text, re.MULTILINE)) == stores
