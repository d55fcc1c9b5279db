"""Values of variables: bytes in memory, Python values, strings."""

from __future__ import annotations

import math
from datetime import UTC, date, datetime, time, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.debug.variables import Change, Symbol
from plctool.errors import UsageError
from plctool.iec.types import (
    BOOL,
    BYTE,
    CHAR,
    DATE,
    DINT,
    DT,
    ELEMENTARY,
    INT,
    LDATE,
    LDT,
    LREAL,
    LTIME,
    LTOD,
    LWORD,
    REAL,
    SINT,
    TIME,
    TOD,
    UDINT,
    ULINT,
    USINT,
    WCHAR,
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
from plctool.iec.value_texts import format_time, literal, parse_milliseconds, parse_time, parse_value
from plctool.iec.values import decode, encode


def laid_out(t: StructType) -> StructType:
    t.lay_out()
    return t


POINT = laid_out(StructType("Point", [Field("x", INT), Field("y", LREAL)]))
COLOUR = EnumType("Colour", INT, {"Red": 0, "Green": 5, "Blue": 6})
LAMP = EnumType("Lamp", BYTE, {"Off": 0, "On": 255})
BLOCK = laid_out(
    StructType(
        "Block",
        [Field("q", BOOL), Field("arr", ArrayType(POINT, ((2, 4),))), Field("grid", ArrayType(INT, ((0, 1), (-1, 1))))],
    )
)
COUNTED = laid_out(StructType("Counted", [Field("%class", UDINT), Field("x", INT)]))
OVERLAY = laid_out(StructType("Overlay", [Field("w", WORD), Field("n", INT)], union=True))

# ---- values ----

NUMBERS = [SINT, USINT, INT, WORD, DINT, UDINT, ULINT]


@pytest.mark.parametrize("t", NUMBERS, ids=str)
def test_numbers_are_read_as_they_were_written(t: Elementary) -> None:
    low = -(1 << (t.bits - 1)) if t.signed else 0

    @examples(50)
    @given(st.integers(low, low + (1 << t.bits) - 1))
    def check(value: int) -> None:
        assert decode(t, encode(t, value)) == value
        assert parse_value(t, str(value)) == value

    check()


@given(st.floats(width=32))
def test_reals_are_shown_with_the_fewest_digits_that_read_back(value: float) -> None:
    shown = decode(REAL, encode(REAL, value))
    assert isinstance(shown, float)
    assert encode(REAL, shown) == encode(REAL, value) or math.isnan(value)
    assert len(repr(shown)) <= len(repr(value))


@pytest.mark.parametrize("t", [REAL, LREAL], ids=str)
@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity"])
def test_a_real_that_is_no_number_has_a_word(t: Elementary, text: str) -> None:
    assert literal(t, decode(t, encode(t, float(text)))) == text
    assert literal(t, parse_value(t, text)) == text


TYPED = {
    "TIME": "T#{}d",
    "LTIME": "LTIME#{}d",
    "DINT": "{}",
    "ULINT": "16#{}",
    "BOOL": "{}",
    "REAL": "{}",
    "LREAL": "1e{}",
    "DATE": "D#{}-01-01",
    "TOD": "TOD#{}:00:00",
}


@pytest.mark.parametrize("digits", [290, 400, 5000])
@pytest.mark.parametrize("name", TYPED)
def test_what_is_far_too_large_is_refused(name: str, digits: int) -> None:
    text = TYPED[name].format("9" * digits)
    with pytest.raises(UsageError, match=f"is not a value of {name}"):
        encode(ELEMENTARY[name], parse_value(ELEMENTARY[name], text))
    if digits > 300 and text.startswith("T#"):
        with pytest.raises(UsageError, match="characters"):
            parse_milliseconds(text)


@given(st.floats(allow_nan=False))
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
    assert format_time(ms, TIME).timedelta == timedelta(milliseconds=ms)


@given(st.integers(-(2**63), 2**63 - 1))
def test_any_ltime_is_read_as_it_is_shown(ns: int) -> None:
    assert parse_time(format_time(ns, LTIME), LTIME) == ns
    assert 0 <= ns - format_time(ns, LTIME).timedelta // timedelta(microseconds=1) * 1000 < 1000


@pytest.mark.parametrize(
    ("text", "ms"),
    [("T#1.5s", 1500), ("time#2m_30s", 150_000), ("80ms", 80), ("T#0.25h", 900_000), ("T#1s2000us", 1002)],
)
def test_durations_may_be_typed_in_many_ways(text: str, ms: int) -> None:
    assert parse_time(text) == ms


OUTSIDE = [
    (TIME, "T#25d", "it takes T#-24d20h31m23s648ms to T#24d20h31m23s647ms"),
    (TIME, timedelta(25), "it takes T#-24d20h31m23s648ms to T#24d20h31m23s647ms"),
    (TIME, 2_160_000_000, "it takes T#-24d20h31m23s648ms to T#24d20h31m23s647ms"),
    (TIME, "T#1.0001s", "it takes a whole number of milliseconds, LTIME shorter ones"),
    (TIME, timedelta(microseconds=1), "it takes a whole number of milliseconds, LTIME shorter ones"),
    (
        LTIME,
        "LTIME#200000d",
        "it takes LTIME#-106751d23h47m16s854ms775us808ns to LTIME#106751d23h47m16s854ms775us807ns",
    ),
    (LTIME, "LTIME#0.5ns", "it takes a whole number of nanoseconds"),
    (DATE, "D#1969-12-31", "it takes D#1970-01-01 to D#2106-02-07"),
    (DATE, date(2107, 1, 1), "it takes D#1970-01-01 to D#2106-02-07"),
    (DATE, datetime(2024, 2, 29), "give a datetime.date without a time zone"),
    (DT, "DT#2107-01-01-00:00:00", "it takes DT#1970-01-01-00:00:00 to DT#2106-02-07-06:28:15"),
    (DT, "DT#2024-02-29-12:30:15.5", "it takes a whole number of seconds, LDT shorter ones"),
    (DT, datetime(2024, 2, 29, tzinfo=UTC), "give a datetime.datetime without a time zone"),
    (TOD, "TOD#12:30:15.0001", "it takes a whole number of milliseconds, LTOD shorter ones"),
    (TOD, time(12, 30, 15, 1), "it takes a whole number of milliseconds, LTOD shorter ones"),
    (TOD, 2**32, "it takes TOD#00:00:00 to TOD#23:59:59.999"),
]


@pytest.mark.parametrize(("t", "value", "hint"), OUTSIDE, ids=str)
def test_a_time_that_is_outside_or_finer_than_its_type_is_refused_as_written(t: Type, value: object, hint: str) -> None:
    with pytest.raises(UsageError) as caught:
        encode(t, parse_value(t, value) if isinstance(value, str) else value)
    assert caught.value.message == f"'{value}' is not a value of {t}; {hint}."


@pytest.mark.parametrize(
    ("t", "value", "shown"),
    [
        (DATE, date(2024, 2, 29), "D#2024-02-29"),
        (TOD, time(12, 30, 15, 500_000), "TOD#12:30:15.500"),
        (DT, datetime(2024, 2, 29, 12, 30, 15), "DT#2024-02-29-12:30:15"),
        (LTOD, time(12, 30, 15, 1), "LTOD#12:30:15.000001"),
        (LDT, datetime(2024, 2, 29, 12, 30, 15, 1), "LDT#2024-02-29-12:30:15.000001"),
        (LDATE, date(2300, 1, 1), "LDATE#2300-01-01"),
    ],
    ids=str,
)
def test_dates_and_times_of_python_are_written(t: Type, value: object, shown: str) -> None:
    assert decode(t, encode(t, value)) == shown


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
    symbol = Symbol("Main.word.3", 0, 0, WORD, bit=3)
    assert symbol.change(True) == Change(0, b"\x08", 0x08)
    assert symbol.change("FALSE") == Change(0, b"\x00", 0x08)
    assert Symbol("Main.word.12", 0, 0, WORD, bit=12).change(True) == Change(1, b"\x10", 0x10)
    assert symbol.decode(b"\x08\x00") is True


def test_enums_are_shown_by_name() -> None:
    assert decode(COLOUR, encode(COLOUR, 5)) == "Green"
    assert decode(COLOUR, b"\x09\x00") == 9


@pytest.mark.parametrize("value", [7, "7", "16#07", "Colour#7", "Purple", -1, [0, 7], {"x": 7}, True])
def test_what_an_enumeration_has_not_is_refused(value: object) -> None:
    """The program would not know what to do with it: no branch of a CASE is for it."""
    t: Type = COLOUR
    if isinstance(value, list):
        t = ArrayType(COLOUR, ((0, 1),))
    elif isinstance(value, dict):
        t = laid_out(StructType("Painted", [Field("x", COLOUR)]))
    with pytest.raises(
        UsageError, match=r"is not a value of Colour; choose one of Red \(0\), Green \(5\), Blue \(6\)\."
    ):
        encode(t, value)


@pytest.mark.parametrize("value", [5, "5", "16#05", "Green", "green", "Colour#Green", "Colour.Green"])
def test_an_enumeration_takes_its_values_by_name_and_number(value: object) -> None:
    assert encode(COLOUR, value) == b"\5\0"


def test_a_message_does_not_list_hundreds_of_values() -> None:
    many = EnumType("Many", INT, {f"v{n}": n for n in range(500)})
    with pytest.raises(UsageError, match=r"v11 \(11\), \.\.\.\.$"):
        encode(many, 700)


# ---- as ST writes them ----

SCALARS = [BOOL, SINT, INT, UDINT, WORD, LWORD, REAL, LREAL, TIME, LTIME, DATE, TOD, DT, LDT, CHAR, WCHAR]
TYPES = [
    *SCALARS,
    COLOUR,
    LAMP,
    StringType(12),
    StringType(5, wide=True),
    SubrangeType("S", INT, -32768, 32767),
    PointerType(INT),
    POINT,
    ArrayType(DINT, ((1, 3),)),
    ArrayType(StringType(3), ((0, 1), (0, 2))),
    ArrayType(ArrayType(INT, ((0, 1),)), ((0, 2),)),
    laid_out(StructType("Mixed", [Field("name", StringType(4)), Field("points", ArrayType(POINT, ((0, 1),)))])),
]


@pytest.mark.parametrize("t", TYPES, ids=str)
def test_what_is_shown_can_be_typed(t: Type) -> None:
    @examples(60)
    @given(st.binary(min_size=t.size, max_size=t.size))
    def check(data: bytes) -> None:
        if isinstance(t, PointerType):
            data = bytes(t.size)
        if isinstance(t, EnumType):
            data = encode(t, list(t.values)[data[0] % len(t.values)])
        text = literal(t, decode(t, data))
        assert literal(t, decode(t, encode(t, parse_value(t, text)))) == text

    check()


@pytest.mark.parametrize(
    ("t", "data", "text"),
    [
        (BOOL, b"\1", "TRUE"),
        (INT, b"\xfb\xff", "-5"),
        (WORD, b"\x1f\0", "16#001F"),
        (REAL, b"\0\0\xc0\x3f", "1.5"),
        (COLOUR, b"\5\0", "Green"),
        (COLOUR, b"\7\0", "7"),
        (LAMP, b"\xff", "On"),
        (LAMP, b"\x10", "16#10"),
        (TIME, b"\x50\0\0\0", "T#80ms"),
        (StringType(9), b"it's $\n\0\0\0", "'it$'s $$$0A'"),
        (StringType(3, wide=True), 'é"'.encode("utf-16-le") + bytes(4), '"é$""'),
        (StringType(2, wide=True), b"\x29\xd8\x41\xdc\0\0", '"$D829$DC41"'),
        (CHAR, b"a", "'a'"),
        (CHAR, b"\0", "'$00'"),
        (WCHAR, b"a\0", '"a"'),
        (PointerType(INT), bytes(8), "NULL"),
        (PointerType(INT), b"\x10\x20" + bytes(6), "16#2010"),
        (ArrayType(BOOL, ((0, 1), (0, 1))), b"\1\0\0\1", "[[TRUE, FALSE], [FALSE, TRUE]]"),
        (COUNTED, b"\7\0\0\0\2\0\0\0", "(x := 2)"),
    ],
)
def test_values_are_shown_as_literals(t: Type, data: bytes, text: str) -> None:
    assert literal(t, decode(t, data)) == text


@pytest.mark.parametrize(
    ("t", "text", "value"),
    [
        (ArrayType(INT, ((1, 3),)), "[1, 2,3 ]", [1, 2, 3]),
        (ArrayType(INT, ((1, 5),)), "[1, 3(7), 2]", [1, 7, 7, 7, 2]),
        (ArrayType(INT, ((1, 4),)), "[2(1, 2)]", [1, 2, 1, 2]),
        (ArrayType(INT, ((0, 1), (0, 1))), "[2([1, 2])]", [[1, 2], [1, 2]]),
        (ArrayType(COLOUR, ((1, 2),)), "[Red, Colour#Green]", [0, 5]),
        (ArrayType(StringType(5), ((1, 2),)), "['a,]', '$'']", ["a,]", "'"]),
        (POINT, "(y := -1.5, x := 16#10)", {"x": 16, "y": -1.5}),
        (ArrayType(POINT, ((1, 2),)), "[2((x := 1, y := 2))]", [{"x": 1, "y": 2.0}] * 2),
        (PointerType(INT), "null", None),
        (StringType(5, wide=True), '"$00E9"', "é"),
    ],
)
def test_lists_and_members_may_be_typed(t: Type, text: str, value: object) -> None:
    assert parse_value(t, text) == value


@pytest.mark.parametrize(
    ("t", "text", "words"),
    [
        (ArrayType(INT, ((1, 3),)), "[1, 2]", "3 elements"),
        (ArrayType(INT, ((1, 3),)), "5", "list in [ ]"),
        (ArrayType(INT, ((1, 3),)), "[999999999999(1)]", "3 elements"),
        (ArrayType(INT, ((1, 3),)), "[9(9(9(1)))]", "3 elements"),
        (ArrayType(INT, ((1, 2),)), "[1, x]", "whole number"),
        (ArrayType(INT, ((0, 1), (0, 1))), "[1, 2, 3, 4]", "list in [ ]"),
        (POINT, "(1, 2)", "x := ..."),
        (POINT, "(x := 1, z := 2)", "x := ..."),
        (PointerType(INT), "16#1000", "only the program"),
        (StringType(5), "'$q'", "escape"),
        (CHAR, "''", "one character"),
    ],
)
def test_what_cannot_be_typed_gets_a_sentence(t: Type, text: str, words: str) -> None:
    with pytest.raises(UsageError) as error:
        parse_value(t, text)
    assert words in error.value.message


@pytest.mark.parametrize(("t", "value"), [(COUNTED, {"x": 1}), (OVERLAY, {"w": 1, "n": 1}), (POINT, {"x": 1})])
def test_what_is_not_all_of_a_variable_cannot_be_written_as_a_whole(t: Type, value: object) -> None:
    with pytest.raises(UsageError, match="member"):
        encode(t, value)


@examples(300)
@given(st.sampled_from(TYPES), st.text("[](),'\"$ 0123456789abcTRUE#:=-.xy", max_size=24))
def test_any_text_is_a_value_or_refused(t: Type, text: str) -> None:
    try:
        value = parse_value(t, text)
    except UsageError as error:
        assert error.message
    else:
        try:
            assert len(encode(t, value)) == t.size
        except UsageError as error:
            assert error.message


SIMPLE = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.timedeltas()
PYTHON = st.recursive(
    SIMPLE | st.binary(max_size=4),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=2), inner, max_size=2),
    max_leaves=4,
)


@examples(500)
@given(st.sampled_from(TYPES), PYTHON)
def test_any_object_of_python_is_a_value_or_refused(t: Type, value: object) -> None:
    try:
        assert len(encode(t, value)) == t.size
    except UsageError as error:
        assert error.message
