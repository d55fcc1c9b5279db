"""Literals: every form, its value and its type."""

from __future__ import annotations

import struct

import pytest
from front_support import body_of, folded, main, messages
from hypothesis import given
from hypothesis import strategies as st

from plctool.compiler.typed import nodes as typed
from plctool.iec import literals


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", 0),
        ("1_000_000", 1_000_000),
        ("16#FF", 255),
        ("16#ff", 255),
        ("16#1234_ABCD", 0x1234ABCD),
        ("2#1010_1010", 170),
        ("8#17", 15),
        ("INT#5", 5),
        ("INT#-32768", -32768),
        ("int#16#7F", 127),
        ("DINT#8#17", 15),
        ("ULINT#18446744073709551615", 2**64 - 1),
    ],
)
def test_integer_literal_has_its_value(text: str, value: int) -> None:
    assert folded(text, "ULINT" if value > 0 else "LINT").value == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.5", 1.5),
        ("1_0.2_5", 10.25),
        ("1.0E3", 1000.0),
        ("1e-3", 0.001),
        ("REAL#1.5", 1.5),
        ("LREAL#-1.5E+3", -1500.0),
        ("LREAL#7", 7.0),
        ("7", 7.0),
    ],
)
def test_real_literal_has_its_value(text: str, value: float) -> None:
    assert folded(text).value == value


def test_real_literal_is_rounded_to_single_precision_for_real() -> None:
    assert folded("0.1", "REAL").value == struct.unpack("f", struct.pack("f", 0.1))[0]


@pytest.mark.parametrize(
    ("text", "milliseconds"),
    [
        ("T#0s", 0),
        ("T#10ms", 10),
        ("TIME#1d2h3m4s5ms", 93_784_005),
        ("t#1h_30m", 5_400_000),
        ("T#1.5s", 1500),
        ("TIME#-1.5s", -1500),
        ("T#90m", 5_400_000),
        ("T#100ms", 100),
        ("T#1m1ms", 60_001),
    ],
)
def test_duration_counts_milliseconds(text: str, milliseconds: int) -> None:
    assert folded(text, "TIME").value == milliseconds


@pytest.mark.parametrize(
    ("text", "nanoseconds"),
    [
        ("LTIME#1us", 1000),
        ("LT#1s5us7ns", 1_000_005_007),
        ("LTIME#-0.5us", -500),
        ("LTIME#200d", 17_280_000_000_000_000),
    ],
)
def test_long_duration_counts_nanoseconds(text: str, nanoseconds: int) -> None:
    assert folded(text, "LTIME").value == nanoseconds


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("'abc'", "abc"),
        ("''", ""),
        ("'$$'", "$"),
        ("'$''", "'"),
        ("'a$Nb$Lc$R$T$P'", "a\nb\nc\r\t\f"),
        ("'$41$7a'", "Az"),
        ("STRING#'x'", "x"),
        ("'\xe4'", "\xe4"),
    ],
)
def test_string_literal_resolves_escapes(text: str, value: str) -> None:
    assert folded(text, "STRING").value == value


@pytest.mark.parametrize(("text", "value"), [("TRUE", 1), ("false", 0), ("BOOL#1", 1), ("BOOL#FALSE", 0), ("1", 1)])
def test_bool_literal_is_one_or_zero(text: str, value: int) -> None:
    assert folded(text, "BOOL").value == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("16#GG", "base 16"),
        ("2#12", "base 2"),
        ("7#1", "2, 8 or 16"),
        ("1_", "underscore"),
        ("INT#", "missing"),
        ("T#5", "duration"),
        ("T#1s1h", "order"),
        ("T#1.5s1ms", "fraction"),
        ("T#100d", "too long"),
        ("'$Q'", "escape"),
        ("'\u0416'", "Windows-1252"),
        ("1e999", "too large"),
        ("99999999999999999999", "fits no integer type"),
        ("9" * 1000, "too long"),
        ("INT#40000", "does not fit INT"),
        ("USINT#-1", "does not fit USINT"),
        ("BOOL#2", "does not fit BOOL"),
    ],
)
def test_wrong_literal_is_explained_where_it_stands(text: str, words: str) -> None:
    (message,) = messages(main("x : LINT; s : STRING;", f"x := {text};"))
    assert message.startswith("5:6: ")
    assert words in message


def test_duration_below_a_millisecond_is_a_warning_for_time() -> None:
    found = messages(main("x : TIME;", "x := T#500us;"), "warning")
    assert any("LTIME" in m for m in found)


@given(st.integers(0, 2**64 - 1), st.sampled_from([("2#", "b"), ("8#", "o"), ("16#", "x"), ("", "d")]))
def test_integer_text_reads_back(value: int, base: tuple[str, str]) -> None:
    prefix, code = base
    assert literals.unsigned(prefix + format(value, code))[1] == value


@given(st.floats(min_value=0, allow_nan=False, allow_infinity=False))
def test_real_text_reads_back(value: float) -> None:
    text = repr(value) if "." in repr(value) or "e" in repr(value) else f"{value}.0"
    assert literals.unsigned(text)[1] == value


@given(st.integers(0, 200), st.integers(0, 23), st.integers(0, 59), st.integers(0, 59), st.integers(0, 999))
def test_duration_text_reads_back(d: int, h: int, m: int, s: int, ms: int) -> None:
    total = (((d * 24 + h) * 60 + m) * 60 + s) * 1000 + ms
    assert literals.duration(f"{d}d{h}h{m}m{s}s{ms}ms") == total * 1_000_000


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126)))
def test_string_text_reads_back(value: str) -> None:
    text = value.replace("$", "$$").replace("'", "$'")
    assert literals.string(f"'{text}'") == value


NAMESPACED = "NAMESPACE Plant.Parts\nTYPE Color : (Red, Green, Blue); Small : INT(0..9); END_TYPE\nEND_NAMESPACE\n"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("Plant.Parts.Color#Blue", 2),
        ("Plant . Parts.Small#7", 7),
        ("plant.parts.small#16#9", 9),
        ("CIA405.STATE#OPERATIONAL", 5),
        ("CIA405.DEVICE#5", 5),
        ("CIA405_STATE#STOPPED", 4),
    ],
)
def test_value_may_have_a_type_in_a_namespace(text: str, value: int) -> None:
    (statement,) = body_of("x : DINT;", f"x := {text};", NAMESPACED)
    assert isinstance(statement, typed.Assign)
    assert isinstance(statement.value, typed.Const)
    assert statement.value.value == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Plant.Parts.Color#Pink", "Plant.Parts.Color has no value Pink"),
        ("Plant.Parts.Small#10", "10"),
        ("Plant.Color#Red", "Plant.Color"),
        ("Plant.INT#5", "take away what stands before INT#5"),
        ("a[1].Color#Red", "take away what stands before Color#Red"),
    ],
)
def test_value_of_no_type_in_a_namespace_is_reported(text: str, message: str) -> None:
    found = messages(main("x : DINT; a : ARRAY[0..1] OF INT;", f"x := {text};", NAMESPACED))
    assert message in " ".join(found)
