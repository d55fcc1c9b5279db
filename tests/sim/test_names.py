"""Variables by name, as a compiled program has them: through pointers, references and interfaces, and in every form."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.debug.symbols import SymbolTable
from plctool.errors import DeviceError, UsageError
from plctool.sim import Simulator

TYPES = """
TYPE
    Colour : (Red, Green := 5, Blue);
    Point : STRUCT x : INT; y : REAL := 1.5; END_STRUCT;
    Node : STRUCT value : INT; next : REF_TO Node; END_STRUCT;
    Level : INT(0..100);
END_TYPE
INTERFACE IDrive
    METHOD Run : INT
    END_METHOD
END_INTERFACE
FUNCTION_BLOCK Drive IMPLEMENTS IDrive
    VAR speed : INT := 3; END_VAR
    METHOD Run : INT
        speed := speed + 1;
        Run := speed;
    END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Servo EXTENDS Drive
    VAR angle : INT; END_VAR
END_FUNCTION_BLOCK
FUNCTION_BLOCK Scale
    VAR_IN_OUT data : ARRAY[1..4] OF INT; point : Point; END_VAR
    VAR_TEMP scratch : INT; END_VAR
    VAR n : INT; END_VAR
    scratch := data[1] + 1;
    data[2] := scratch;
    point.x := scratch;
    n := n + 1;
END_FUNCTION_BLOCK
"""
MAIN = """
PROGRAM Main
VAR
    n : UDINT;
    list : ARRAY[1..4] OF INT := [10, 20, 30, 40];
    grid : ARRAY[0..1, 0..2] OF INT := [1, 2, 3, 4, 5, 6];
    point : Point;
    colour : Colour := Green;
    level : Level := 50;
    nodes : ARRAY[0..2] OF Node;
    head, nowhere : REF_TO Node;
    raw : POINTER TO INT;
    stray : POINTER TO INT;
    ref : REFERENCE TO Point;
    loose : REFERENCE TO Point;
    drive, none : IDrive;
    first : Drive;
    second : Servo;
    scale : Scale;
    text : STRING[10] := 'it$'s';
    wide : WSTRING[6] := "a$00E9";
    letter : CHAR := 'x';
    day : DATE := D#2024-02-29;
    word : WORD := 16#8001;
    pause : LTIME := LTIME#5us;
END_VAR
VAR CONSTANT
    limit : TIME := T#1s500ms;
    colours : ARRAY[0..1] OF Colour := [Red, Blue];
END_VAR
VAR_TEMP
    scratch : INT;
END_VAR
n := n + 1;
nodes[0].next := REF(nodes[1]);
nodes[1].next := REF(nodes[2]);
nodes[2].value := 42;
head := REF(nodes[0]);
IF n MOD 2 = 1 THEN
    raw := ADR(list[1]);
    drive := first;
ELSE
    raw := ADR(list[4]);
    drive := second;
END_IF;
scratch := drive.Run();
stray := ADR(scratch);
ref REF= point;
scale(data := list, point := point);
END_PROGRAM
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    folder = tmp_path_factory.mktemp("names")
    (folder / "types.st").write_text(TYPES)
    (folder / "GVL.st").write_text("VAR_GLOBAL total : DINT := 11; END_VAR")
    (folder / "main.st").write_text(MAIN)
    return compile_sources([folder])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    table = SymbolTable.from_json(built.symbols.to_json())  # as they come from the file
    with Simulator(built.image, table) as simulator:
        simulator.run_cycles(1)
        yield simulator


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Main.head^.next^.next^.value", 42),
        ("main.HEAD^.NEXT^.next^", {"value": 42, "next": None}),
        ("Main.raw^", 10),
        ("Main.raw^.1", True),
        ("Main.ref.y", 1.5),
        ("Main.ref", {"x": 11, "y": 1.5}),
        ("Main.scale.data[2]", 11),
        ("Main.scale.data", [10, 11, 30, 40]),
        ("Main.scale.point.x", 11),
        ("Main.drive", "Drive"),
        ("Main.none", None),
        ("Main.second", {"speed": 3, "angle": 0}),
        ("Main.nowhere", None),
        ("GVL.total", 11),
        ("total", 11),
        ("Main.colour", "Green"),
        ("Main.grid[1,2]", 6),
        ("Main.limit", "T#1s500ms"),
        ("Main.colours", ["Red", "Blue"]),
    ],
)
def test_every_variable_has_a_name(plc: Simulator, name: str, value: object) -> None:
    assert plc.read(name) == value


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("Main.text", "'it$'s'"),
        ("Main.wide", '"aé"'),
        ("Main.letter", "'x'"),
        ("Main.day", "D#2024-02-29"),
        ("Main.pause", "LTIME#5us"),
        ("Main.grid", "[[1, 2, 3], [4, 5, 6]]"),
        ("Main.ref", "(x := 11, y := 1.5)"),
        ("Main.word.15", "TRUE"),
        ("Main.none", "NULL"),
    ],
)
def test_values_are_shown_as_literals(plc: Simulator, name: str, text: str) -> None:
    assert plc.sample([name]).texts == {name: text}


def test_a_pointer_that_changes_is_followed_each_time(plc: Simulator) -> None:
    assert (plc.read("Main.raw^"), plc.read("Main.drive")) == (10, "Drive")
    plc.run_cycles(1)
    assert (plc.read("Main.raw^"), plc.read("Main.drive")) == (40, "Servo")


@pytest.mark.parametrize(
    ("name", "value", "seen_as"),
    [
        ("Main.head^.next^.next^.value", -7, "Main.nodes[2].value"),
        ("Main.ref.y", 2.5, "Main.point.y"),
        ("Main.scale.data[3]", 99, "Main.list[3]"),
        ("Main.raw^", 16, "Main.list[1]"),
        ("Main.scale.data", [1, 2, 3, 4], "Main.list"),
        ("Main.ref", {"x": 1, "y": 0.5}, "Main.point"),
    ],
)
def test_what_pointers_lead_to_is_written(plc: Simulator, name: str, value: object, seen_as: str) -> None:
    plc.write({name: value})
    assert plc.read(seen_as) == value


def test_a_bit_through_a_pointer_is_written(plc: Simulator) -> None:
    plc.write({"Main.raw^.2": True})
    assert plc.read("Main.list[1]") == 14


@pytest.mark.parametrize(
    ("name", "text", "seen"),
    [
        ("Main.colour", "Blue", "Blue"),
        ("Main.list", "[1, 3(7)]", [1, 7, 7, 7]),
        ("Main.point", "(x := 5, y := 2)", {"x": 5, "y": 2.0}),
        ("Main.text", "'$41'", "A"),
        ("Main.wide", '"$0041é"', "Aé"),
        ("Main.day", "D#2025-01-01", "D#2025-01-01"),
        ("Main.letter", "'y'", "y"),
        ("Main.head", "NULL", None),
    ],
)
def test_strings_are_written_as_they_are_shown(plc: Simulator, name: str, text: str, seen: object) -> None:
    plc.write({name: plc.symbols().resolve(name).parse(text)})
    assert plc.read(name) == seen


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Main.nowhere^.value", "Main.nowhere is NULL"),
        ("Main.loose.x", "Main.loose is NULL"),
        ("Main.head^.next^.next^.next^.value", "Main.head^.next^.next^.next is NULL"),
        ("Main.stray^", "Main.stray leads to no variable that lasts"),
    ],
)
def test_a_pointer_to_nothing_is_a_device_error_that_names_it(plc: Simulator, name: str, words: str) -> None:
    with pytest.raises(DeviceError) as read:
        plc.read(name)
    with pytest.raises(DeviceError) as written:
        plc.write({name: 1})
    assert words in read.value.message and words in written.value.message


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Main.scratch", "lives only while Main runs"),
        ("Main.scale.scratch", "lives only while Scale runs"),
        ("Main.drive.speed", "its value is the class of its instance"),
        ("Main.head.value", "write Main.head^.value"),
        ("Main.hed", "Did you mean Main.head?"),
        ("Main.scale.dta", "Did you mean Main.scale.data?"),
        ("totl", "Did you mean"),
    ],
)
def test_a_name_that_leads_nowhere_gets_advice(plc: Simulator, name: str, words: str) -> None:
    with pytest.raises(UsageError) as error:
        plc.read(name)
    assert words in error.value.message


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Main.drive", 1),
        ("Main.head", 1),
        ("Main.second", {"speed": 1, "angle": 2}),
        ("Main.limit", "T#1s"),
        ("Main.colours[0]", "Blue"),
    ],
)
def test_what_only_the_program_may_set_is_not_written(plc: Simulator, name: str, value: object) -> None:
    with pytest.raises(UsageError):
        plc.write({name: value})


def test_a_subrange_keeps_its_limits(plc: Simulator) -> None:
    plc.write({"Main.level": 100})
    with pytest.raises(UsageError, match="0 to 100"):
        plc.write({"Main.level": 101})


@pytest.mark.parametrize(
    ("pattern", "name", "value"),
    [
        ("Main.r?f", "Main.ref", {"x": 11, "y": 1.5}),
        ("Main.scale.*", "Main.scale.data", [10, 11, 30, 40]),
        ("Main.dr*", "Main.drive", "Drive"),
        ("Main.lo*e", "Main.loose", None),
    ],
)
def test_a_pattern_finds_the_value_that_a_name_has(plc: Simulator, pattern: str, name: str, value: object) -> None:
    assert plc.read(pattern)[name] == value


def test_a_pattern_that_also_matches_does_not_change_what_a_name_shows(plc: Simulator) -> None:
    assert plc.read("Main.ref", "Main.r*")["Main.ref"] == {"x": 11, "y": 1.5}


def test_a_name_that_leads_nowhere_is_an_error_beside_a_pattern_that_matches_it(plc: Simulator) -> None:
    with pytest.raises(DeviceError, match=r"Main\.loose is NULL"):
        plc.read("Main.lo*e", "Main.loose")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Main.list[1].x", "Main.list[1] is an INT and has no member x"),
        ("Main.list.x", "Main.list is an ARRAY[1..4] OF INT and has no member x"),
        ("Main.pause.3", "Main.pause is an LTIME and has no bit 3"),
        ("Main.n[2]", "Main.n is a UDINT and cannot be indexed"),
    ],
)
def test_a_type_has_its_article(plc: Simulator, name: str, words: str) -> None:
    with pytest.raises(UsageError) as caught:
        plc.read(name)
    assert caught.value.message.startswith(words)
