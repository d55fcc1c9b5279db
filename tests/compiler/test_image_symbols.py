"""The symbol file: names to places, code to lines."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.debug.symbols import (
    CodeUnit,
    SourceLine,
    SymbolTable,
    cache_path,
    find_symbols,
    load_symbols,
    symbol_path,
)
from plctool.debug.variables import Symbol, constant_symbol, unreachable
from plctool.errors import UsageError
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    INT,
    LREAL,
    TIME,
    UDINT,
    WORD,
    ArrayType,
    EnumType,
    Field,
    InterfaceType,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)
from plctool.image.limits import Need


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
NODE = StructType("Node", [Field("%class", UDINT), Field("value", INT)])
NODE.fields.append(Field("next", PointerType(NODE)))
NODE.fields.append(Field("list", ReferenceType(ArrayType(INT, ((1, 3),)))))
NODE.lay_out()
TITLE = constant_symbol("Main.title", StringType(4), b"abc\0\0")


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
        "Main.head": (0, 144, PointerType(NODE)),
        "Main.ref": (0, 152, ReferenceType(POINT)),
        "Main.raw": (0, 160, RawPointerType(WORD)),
        "Main.itf": (0, 168, InterfaceType(StructType("IDrive"))),
        "Main.open": (0, 176, ReferenceType(OpenArrayType(INT, ((0, -1),)))),
        "GVL.x": (0, 184, DINT),
        "%hidden": (0, 188, DINT),
    }
    symbols = {name: Symbol(name, *place) for name, place in variables.items()}
    units = [
        CodeUnit("Main", 16, 100, "a.st", 10, ["tmp"]),
        CodeUnit("Fb", 0, 0, "a.st", 2),
        CodeUnit("Node", 0, 0, "a.st", 5, ["Swap"]),
        CodeUnit("Other", 116, 20, "b.st", 1),
    ]
    lines = [(0, -1, 0), (16, 0, 11), (20, 0, 4), (24, 0, 0), (40, 0, 12), (116, 1, 3), (130, 1, 0), (136, -1, 0)]
    return SymbolTable(
        0xCAFE, "x86_64-linux", "demo", ["task"], symbols, units, lines, ["a.st", "b.st"],
        {"x": "GVL.x", "gone": "GVL.gone"}, {"Motor": 1, "Pump": 2},
        {"Main.limit": constant_symbol("Main.limit", WORD, b"\7\1"), "Main.title": TITLE},
    )  # fmt: skip


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
        ("", "A name is empty"),
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
        ("Main.p.x", "write Main.p^.x"),
        ("Main.p[1]", "write Main.p^[1]"),
        ("Main.n^", "not a pointer"),
        ("Main.ref^", "not a pointer"),
        ("Main.p^^", "not a pointer"),
        ("Main.itf.speed", "the class of its instance"),
        ("Main.itf^", "not a pointer"),
        ("Main.open[1]", "whose bounds change with each call"),
        ("Main.open", "whose bounds change with each call"),
        ("Main.tmp", "lives only while Main runs"),
        ("main.TMP", "lives only while main runs"),
        ("Main.head^.swap", "lives only while Node runs"),
        ("Main.head^.valu", "Did you mean Main.head^.value?"),
        ("Main.fb.arr[2", "cannot be read"),
    ],
)
def test_wrong_paths_get_a_sentence(path: str, words: str) -> None:
    with pytest.raises(UsageError) as error:
        table().resolve(path)
    assert words in error.value.message


@pytest.mark.parametrize(
    ("path", "place", "t"),
    [
        ("Main.p^", (0, 128, (0,)), POINT),
        ("main.P^.Y", (0, 128, (8,)), LREAL),
        ("Main.raw^", (0, 160, (0,)), WORD),
        ("Main.ref", (0, 152, (0,)), POINT),
        ("Main.ref.y", (0, 152, (8,)), LREAL),
        ("Main.head^.next", (0, 144, (8,)), PointerType(NODE)),
        ("Main.head^.next^.value", (0, 144, (8, 4)), INT),
        ("Main.head^.next^.list[3]", (0, 144, (8, 16, 4)), INT),
        ("Main.head^.list", (0, 144, (16, 0)), ArrayType(INT, ((1, 3),))),
    ],
)
def test_pointers_and_references_are_part_of_the_place(
    path: str, place: tuple[int, int, tuple[int, ...]], t: Type
) -> None:
    symbol = table().resolve(path)
    assert (symbol.place, symbol.type) == (place, t)


def test_bits_through_pointers_are_read() -> None:
    symbol = table().resolve("Main.raw^.9")
    assert (symbol.place, symbol.bit) == ((0, 160, (0,)), 9)
    assert symbol.decode(b"\0\2") is True


def test_an_interface_variable_shows_the_class_of_its_instance() -> None:
    symbol = table().resolve("Main.itf")
    assert symbol.place == (0, 168, (0,))
    assert symbol.decode((2).to_bytes(4, "little")) == "Pump"
    with pytest.raises(UsageError, match="only the program"):
        symbol.check_writable(symbol.area)


@pytest.mark.parametrize(("path", "value"), [("main.LIMIT", 263), ("Main.limit.8", True), ("Main.title[1]", 98)])
def test_constants_have_their_value_in_the_file(path: str, value: object) -> None:
    symbol = SymbolTable.from_json(table().to_json()).resolve(path)
    assert symbol.fixed is not None and symbol.decode(symbol.fixed) == value
    with pytest.raises(UsageError, match="is a constant"):
        symbol.check_writable(symbol.area)


def test_constants_that_lie_in_memory_cannot_be_written_either() -> None:
    symbols = SymbolTable(1, "t", "", [], {"list": Symbol("list", 0, 0, BLOCK, constant=True)})
    with pytest.raises(UsageError, match="is a constant"):
        SymbolTable.from_json(symbols.to_json()).resolve("list.arr[3].x").check_writable(0)


def test_other_names_of_globals_are_known() -> None:
    assert table().resolve("X") == table().resolve("gvl.x")
    with pytest.raises(UsageError, match=r"Did you mean GVL\.x\?"):
        table().resolve("GVLx")


@pytest.mark.parametrize(
    ("held", "code", "words"),
    [
        ([b"\1" * 8, bytes(8)], "null", "Main.head^.next is NULL"),
        ([bytes(8), None], "null", "Main.head is NULL"),
        ([b"\1" * 8, b"\2" * 8], "no-target", "Main.head^.next leads to no variable"),
        ([b"\1" * 8, None], "no-target", "Main.head leads to no variable"),
    ],
)
def test_the_pointer_that_leads_nowhere_is_named(held: list[bytes | None], code: str, words: str) -> None:
    by_name = dict(zip(("Main.head", "Main.head^.next"), held, strict=True))
    error = unreachable(table().resolve("Main.head^.next^.value"), lambda pointer: by_name[pointer.name])
    assert error.code == code
    assert "Main.head^.next^.value cannot be reached" in error.message and words in error.message


@pytest.mark.parametrize(
    ("patterns", "names"),
    [
        (["main.fb*"], ["Main.fb", "Main.fb.q", "Main.fb.arr", "Main.fb.grid"]),
        (["*.arr[3]*"], ["Main.fb.arr[3]", "Main.fb.arr[3].x", "Main.fb.arr[3].y"]),
        (["Main.?"], ["Main.n", "Main.p"]),
        (["gvl.x", "Main.n"], ["Main.n", "GVL.x"]),
        (["nothing"], []),
        (["*hidden*"], []),
    ],
)
def test_variables_are_found_by_pattern(patterns: list[str], names: list[str]) -> None:
    assert [symbol.name for symbol in table().find(patterns)] == names


def test_without_a_pattern_all_variables_are_listed_as_they_were_declared() -> None:
    names = [symbol.name for symbol in table().find([])]
    assert names[:3] == ["Main.n", "Main.word", "Main.fb"] and names[-3:] == ["GVL.x", "Main.limit", "Main.title"]


@examples(300)
@given(st.text("Mainfb.arr[]234,^-xyq ", max_size=24))
def test_any_text_is_resolved_or_refused(path: str) -> None:
    try:
        assert table().resolve(path).size > 0
    except UsageError as error:
        assert error.message


def test_leaves_are_the_scalars_of_a_variable() -> None:
    assert [s.name for s in table().resolve("Main.fb").leaves()] == [
        "Main.fb.q",
        *(f"Main.fb.arr[{i}].{m}" for i in (2, 3, 4) for m in "xy"),
        *(f"Main.fb.grid[{i},{k}]" for i in (0, 1) for k in (-1, 0, 1)),
    ]


def test_every_leaf_resolves_to_itself() -> None:
    symbols = table()
    for leaf in symbols.resolve("Main.fb").leaves():
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


@pytest.mark.parametrize("path", ["Main.head^.next^.list[3]", "Main.ref.y", "Main.raw^.9", "Main.itf", "x"])
def test_pointers_are_read_from_the_file_as_they_were_written(path: str) -> None:
    read, original = SymbolTable.from_json(table().to_json()).resolve(path), table().resolve(path)
    assert (read.place, read.bit, read.type.name) == (original.place, original.bit, original.type.name)


def test_members_keep_their_offsets_in_the_file() -> None:
    base = StructType("Base", [Field("a", LREAL), Field("b", BOOL)])
    base.lay_out()
    derived = StructType("Derived", [*base.fields, Field("c", BOOL)], base=base)
    derived.lay_out()
    symbols = SymbolTable(1, "t", "", [], {"d": Symbol("d", 0, 0, derived)})
    read = SymbolTable.from_json(symbols.to_json())
    assert read.resolve("d.c").offset == derived.fields[2].offset
    assert read.resolve("d").size == derived.size


def test_types_that_refer_to_themselves_are_kept() -> None:
    node = StructType("Node", [Field("value", INT)])
    node.fields.append(Field("next", PointerType(node)))
    node.lay_out()
    symbols = SymbolTable(1, "t", "", [], {"list": Symbol("list", 0, 0, node)})
    read = SymbolTable.from_json(symbols.to_json())
    found = read.resolve("list.next").type
    assert isinstance(found, PointerType) and found.target is read.resolve("list").type


@pytest.mark.parametrize("text", ["", "{}", "[]", "null", '{"format":1}', '{"format":2}', '{"format":2,"types":3}'])
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
        (30, SourceLine("Main", "a.st", 12)),  # without a line of its own
        (100, SourceLine("Main", "a.st", 12)),
        (120, SourceLine("Other", "b.st", 3)),
        (132, SourceLine("Other", "b.st", 3)),  # nor is there one after it
        (5, None),
        (140, None),
    ],
)
def test_code_offsets_become_lines(offset: int, expected: SourceLine | None) -> None:
    assert table().address_to_line(offset) == expected


# ---- the stack -------------------------------------------------------------------------------------------------------


def test_stack_goes_through_the_file() -> None:
    symbols = table()
    symbols.stack = Need(96, (("Main", 64), ("F", 32)), deepest=True, at_least=True)
    assert SymbolTable.from_json(symbols.to_json()).stack == symbols.stack
    assert SymbolTable.from_json(table().to_json()).stack is None


@pytest.mark.parametrize(
    "stack",
    [5, "many", {}, {"amount": "x", "parts": [], "at_least": False}, {"amount": 1, "parts": [1], "at_least": 0}],
)
def test_a_damaged_stack_is_refused(stack: object) -> None:
    document = json.loads(table().to_json()) | {"stack": stack}
    with pytest.raises(UsageError, match="cannot be read; build again"):
        SymbolTable.from_json(json.dumps(document))
