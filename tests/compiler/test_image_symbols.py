"""The symbol file: names to places, values to text, code to lines."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plctool.compiler.types import (
    BOOL,
    BYTE,
    DINT,
    INT,
    LREAL,
    LTIME,
    REAL,
    SINT,
    TIME,
    UDINT,
    ULINT,
    USINT,
    WORD,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)
from plctool.errors import UsageError
from plctool.symbols import (
    CodeUnit,
    SourceLine,
    Symbol,
    SymbolTable,
    cache_path,
    find_symbols,
    load_symbols,
    symbol_path,
)
from plctool.values import decode, encode, format_time, parse_time, parse_value


def point() -> StructType:
    t = StructType("Point", [Field("x", INT), Field("y", LREAL)])
    t.lay_out()
    return t


POINT = point()
COLOUR = EnumType("Colour", INT, {"Red": 0, "Green": 5, "Blue": 6})
BLOCK = StructType(
    "Block",
    [Field("q", BOOL), Field("arr", ArrayType(POINT, ((2, 4),))), Field("grid", ArrayType(INT, ((0, 1), (-1, 1))))],
)
BLOCK.lay_out()


def table() -> SymbolTable:
    variables = {
        "Main.n": (0, 0, INT),
        "Main.word": (4, 2, WORD),
        "Main.fb": (1, 8, BLOCK),
        "Main.text": (0, 100, StringType(10)),
        "Main.colour": (0, 120, COLOUR),
        "Main.level": (0, 122, SubrangeType("INT(1..10)", INT, 1, 10)),
        "Main.p": (0, 128, PointerType(POINT)),
        "total": (0, 136, TIME),
    }
    symbols = {name: Symbol(name, *place) for name, place in variables.items()}
    units = [
        CodeUnit("Main", 16, 100, "a.st", 10),
        CodeUnit("Fb", 0, 0, "a.st", 2),
        CodeUnit("Other", 116, 20, "b.st", 1),
    ]
    lines = [(0, -1, 0), (16, 0, 11), (20, 0, 4), (24, 0, 0), (40, 0, 12), (116, 1, 3), (136, -1, 0)]
    return SymbolTable(0xCAFE, "x86_64-linux", "demo", ["task"], symbols, units, lines, ["a.st", "b.st"])


# ---- names ----


@pytest.mark.parametrize(
    ("path", "area", "offset", "t", "bit"),
    [
        ("Main.n", 0, 0, INT, None),
        ("MAIN.N", 0, 0, INT, None),
        ("total", 0, 136, TIME, None),
        ("Main.fb.q", 1, 8, BOOL, None),
        ("main.FB.arr[3].y", 1, 8 + 8 + 16 + 8, LREAL, None),
        ("Main.fb.arr[2]", 1, 16, POINT, None),
        ("Main.fb.grid[1,-1]", 1, 8 + 8 + 48 + 6, INT, None),
        ("Main.fb.grid[ 0 , 1 ]", 1, 8 + 8 + 48 + 4, INT, None),
        ("Main.word.15", 4, 2, WORD, 15),
        ("Main.text[1]", 0, 101, BYTE, None),
        ("Main.p", 0, 128, PointerType(POINT), None),
    ],
)
def test_paths_are_resolved(path: str, area: int, offset: int, t: Type, bit: int | None) -> None:
    symbol = table().resolve(path)
    assert (symbol.area, symbol.offset, symbol.type, symbol.bit) == (area, offset, t, bit)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("Main.nn", "Did you mean Main.n?"),
        ("Main.wrod", "Did you mean Main.word?"),
        ("Mian.n", "Did you mean Main.n?"),
        ("nothing", "There is no variable nothing."),
        ("", "There is no variable"),
        ("Main", "name one of its variables, such as Main.n"),
        ("Main.fb.arr[5]", "has the elements 2 to 4, not 5"),
        ("Main.fb.arr[1,2]", "cannot be indexed"),
        ("Main.fb.arr[x]", "is not an index"),
        ("Main.fb.ar[2]", "Did you mean Main.fb.arr?"),
        ("Main.n.x", "has no member x"),
        ("Main.n.16", "has no bit 16"),
        ("Main.word.3.1", "has no parts"),
        ("Main.n[1]", "cannot be indexed"),
        ("Main.text[11]", "has the characters 0 to 9"),
        ("Main.p^.x", "is a reference"),
        ("Main.fb.arr[2", "cannot be read"),
    ],
)
def test_wrong_paths_get_a_sentence(path: str, words: str) -> None:
    with pytest.raises(UsageError) as error:
        table().resolve(path)
    assert words in error.value.message


@settings(max_examples=300, deadline=None)
@given(st.text("Mainfb.arr[]234,^-xyq ", max_size=24))
def test_any_text_is_resolved_or_refused(path: str) -> None:
    try:
        assert table().resolve(path).size > 0
    except UsageError as error:
        assert error.message


def test_leaves_are_the_scalars_of_a_variable() -> None:
    symbols = table()
    assert [s.name for s in symbols.leaves(symbols.resolve("Main.fb"))] == [
        "Main.fb.q",
        *(f"Main.fb.arr[{i}].{m}" for i in (2, 3, 4) for m in "xy"),
        *(f"Main.fb.grid[{i},{k}]" for i in (0, 1) for k in (-1, 0, 1)),
    ]


def test_every_leaf_resolves_to_itself() -> None:
    symbols = table()
    for leaf in symbols.leaves(symbols.resolve("Main.fb")):
        assert symbols.resolve(leaf.name) == leaf


# ---- file ----


def test_the_file_is_read_as_it_was_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    original = table()
    original.save(tmp_path / "app.sym")
    read = load_symbols(tmp_path / "app.sym")
    assert read.to_json() == original.to_json()
    assert read.resolve("Main.fb.arr[4].y").offset == original.resolve("Main.fb.arr[4].y").offset
    assert read.lines == original.lines and read.pous == original.pous


def test_types_that_refer_to_themselves_are_kept() -> None:
    node = StructType("Node", [Field("value", INT)])
    node.fields.append(Field("next", PointerType(node)))
    node.lay_out()
    symbols = SymbolTable(1, "t", "", [], {"list": Symbol("list", 0, 0, node)})
    read = SymbolTable.from_json(symbols.to_json())
    found = read.resolve("list.next").type
    assert isinstance(found, PointerType) and found.target is read.resolve("list").type


@pytest.mark.parametrize("text", ["", "{}", "[]", "null", '{"format":1}', '{"format":2}', '{"format":1,"types":3}'])
def test_what_is_no_symbol_file_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="symbol file"):
        SymbolTable.from_json(text)


def test_symbols_are_found_beside_the_image_or_in_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    image = tmp_path / "app.cdl"
    table().save(symbol_path(image))
    assert cache_path(0xCAFE) == tmp_path / "cache" / "plctool" / "0000cafe.sym"
    assert find_symbols(0xCAFE, image).project == "demo"
    symbol_path(image).unlink()
    assert find_symbols(0xCAFE, image).project == "demo"
    assert find_symbols(0xCAFE).project == "demo"
    with pytest.raises(UsageError, match="no symbols"):
        find_symbols(0xBEEF)


def test_symbols_of_another_image_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    table().save(tmp_path / "app.sym")
    with pytest.raises(UsageError, match="another image"):
        find_symbols(0xBEEF, tmp_path / "app.cdl")


# ---- code ----


@pytest.mark.parametrize(
    ("offset", "expected"),
    [
        (16, SourceLine("Main", "a.st", 11)),
        (19, SourceLine("Main", "a.st", 11)),
        (20, SourceLine("Fb", "a.st", 4)),  # inlined into Main
        (30, SourceLine("Fb", "a.st", 4)),  # without a line of its own
        (100, SourceLine("Main", "a.st", 12)),
        (120, SourceLine("Other", "b.st", 3)),
        (5, None),
        (140, None),
    ],
)
def test_code_offsets_become_lines(offset: int, expected: SourceLine | None) -> None:
    assert table().address_to_line(offset) == expected


# ---- values ----

NUMBERS = [SINT, USINT, INT, WORD, DINT, UDINT, ULINT]


@pytest.mark.parametrize("t", NUMBERS, ids=str)
def test_numbers_are_read_as_they_were_written(t: Elementary) -> None:
    low = -(1 << (t.bits - 1)) if t.signed else 0

    @settings(max_examples=50, deadline=None)
    @given(st.integers(low, low + (1 << t.bits) - 1))
    def check(value: int) -> None:
        assert decode(t, encode(t, value)) == value
        assert parse_value(t, str(value)) == value

    check()


@given(st.floats(width=32))
def test_reals_are_shown_with_the_fewest_digits_that_read_back(value: float) -> None:
    shown = decode(REAL, encode(REAL, value))
    if math.isfinite(value):
        assert encode(REAL, shown) == encode(REAL, value)
        assert len(repr(shown)) <= len(repr(value))
    else:
        assert shown in ("NaN", "Infinity", "-Infinity")
        assert encode(REAL, shown) == encode(REAL, float(shown))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_lreals_are_read_as_they_were_written(value: float) -> None:
    assert decode(LREAL, encode(LREAL, value)) == value


@pytest.mark.parametrize(
    ("ms", "text"),
    [(0, "T#0ms"), (80, "T#80ms"), (1500, "T#1s500ms"), (-250, "T#-250ms"), (90_061_001, "T#1d1h1m1s1ms")],
)
def test_time_is_shown_as_a_literal(ms: int, text: str) -> None:
    assert format_time(ms, TIME) == text
    assert parse_time(text) == ms


@given(st.integers(-(2**31), 2**31 - 1))
def test_any_time_is_read_as_it_is_shown(ms: int) -> None:
    assert parse_time(format_time(ms, TIME)) == ms


@given(st.integers(-(2**63), 2**63 - 1))
def test_any_ltime_is_read_as_it_is_shown(ns: int) -> None:
    assert parse_time(format_time(ns, LTIME), LTIME) == ns


@pytest.mark.parametrize(
    ("text", "ms"),
    [("T#1.5s", 1500), ("time#2m_30s", 150_000), ("80ms", 80), ("T#0.25h", 900_000), ("T#1s200us", 1000)],
)
def test_durations_may_be_typed_in_many_ways(text: str, ms: int) -> None:
    assert parse_time(text) == ms


@pytest.mark.parametrize("text", ["", "T#", "T#5", "T#5x", "5 s", "T#1.2.3s", "T#s"])
def test_what_is_no_duration_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="duration"):
        parse_time(text)


@pytest.mark.parametrize(
    ("t", "text", "value"),
    [
        (BOOL, "true", True), (BOOL, "0", False), (INT, "16#7F", 127), (INT, "-2#101", -5), (INT, "INT#5", 5), (DINT,
        "1_000", 1000), (REAL, "1e3", 1000.0), (COLOUR, "green", 5), (COLOUR, "Colour#Blue", 6), (COLOUR, "6", 6),
        (StringType(9), "'a b'", "a b"), (StringType(9), "it's", "it's"),
    ],
)  # fmt: skip
def test_typed_values(t: Type, text: str, value: object) -> None:
    assert parse_value(t, text) == value


@pytest.mark.parametrize(
    ("t", "value"),
    [
        (BOOL, "maybe"), (BOOL, 2), (INT, "1.5"), (INT, 40000), (INT, "x"), (USINT, -1), (COLOUR, "Pink"), (REAL,
        "one"), (StringType(2), "abc"), (StringType(9), "\u20ac"), (SubrangeType("S", INT, 1, 10), 11), (POINT, 5),
        (ArrayType(INT, ((0, 2),)), [1, 2]), (PointerType(INT), 5), (INT, 1.5),
    ],
)  # fmt: skip
def test_values_that_do_not_fit_are_refused(t: Type, value: object) -> None:
    with pytest.raises(UsageError):
        encode(t, value)


def test_structs_and_arrays_are_dicts_and_lists() -> None:
    value = {"q": True, "arr": [{"x": i, "y": i / 2} for i in range(3)], "grid": [[1, 2, 3], [4, 5, 6]]}
    assert decode(BLOCK, encode(BLOCK, value)) == value


def test_bits_are_changed_in_their_word() -> None:
    symbol = table().resolve("Main.word.3")
    assert symbol.encode(True, b"\x01\x80") == b"\x09\x80"
    assert symbol.encode("FALSE", b"\xff\xff") == b"\xf7\xff"
    assert symbol.decode(b"\x08\x00") is True
    with pytest.raises(UsageError):
        symbol.encode(True)


def test_enums_are_shown_by_name() -> None:
    assert decode(COLOUR, encode(COLOUR, 5)) == "Green"
    assert decode(COLOUR, b"\x09\x00") == 9
