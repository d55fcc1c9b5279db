"""The library with random values, compared with Python's own strings, numbers and dates."""

from __future__ import annotations

import math
import struct
from datetime import datetime, timedelta
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import partial

from hypothesis import example, given
from hypothesis import strategies as st
from property_support import (
    BITS,
    EXPRESSIONS,
    INTEGERS,
    PROGRAM,
    WIDTH,
    Declarations,
    Term,
    Value,
    batch,
    check,
    comparison,
    evaluate,
    integer_leaf,
    numbers,
    rounded,
    same,
    wrap,
)

from plctool.iec.types import ELEMENTARY
from plctool.iec.value_texts import format_date, format_time

# ---- strings -------------------------------------------------------------------------------------------------------

CHARACTERS = st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$'")


def string_variable(draw: st.DrawFn, known: Declarations, longest: int) -> Term:
    value = draw(st.text(st.sampled_from("ab") | CHARACTERS, max_size=longest))
    return known.variable(f"STRING[{max(len(value), 1)}]", f"'{value}'", value)


def string_function(function: str, s: str, t: str, length: int, place: int) -> Value:
    """The reference: positions from 1, clamped."""
    count, start = max(length, 0), max(place, 1) - 1
    match function:
        case "LEFT":
            return s[:count]
        case "RIGHT":
            return s[max(len(s) - count, 0) :]
        case "MID":
            return s[start : start + count]
        case "DELETE":
            return s[:start] + s[start + count :]
        case "INSERT":
            return s[: max(place, 0)] + t + s[max(place, 0) :]
        case "REPLACE":
            return s[:start] + t + s[start + count :]
        case "CONCAT":
            return s + t
        case "FIND":
            return s.find(t) + 1 if t else 0
        case _:
            return len(s)


ARGUMENTS = {
    "LEFT": "{s}, {l}",
    "RIGHT": "{s}, {l}",
    "MID": "{s}, {l}, {p}",
    "DELETE": "{s}, {l}, {p}",
    "INSERT": "{s}, {t}, {p}",
    "REPLACE": "{s}, {t}, {l}, {p}",
    "CONCAT": "{s}, {t}",
    "FIND": "{s}, {t}",
    "LEN": "{s}",
}


def any_string_call(draw: st.DrawFn, known: Declarations) -> Term:
    function = draw(st.sampled_from(list(ARGUMENTS)))
    s = string_variable(draw, known, 12)
    t = string_variable(draw, known, 4 if function != "FIND" else 2)
    length, place = draw(st.integers(-2, 15)), draw(st.integers(-2, 15))
    value = string_function(function, str(s.value), str(t.value), length, place)
    capacity = draw(st.integers(1, 20))
    arguments = ARGUMENTS[function].format(s=s.text, t=t.text, l=length, p=place)
    if isinstance(value, str):
        return Term(f"{function}({arguments})", f"STRING[{capacity}]", value[:capacity])
    return Term(f"{function}({arguments})", "INT", value)


def any_string_comparison(draw: st.DrawFn, known: Declarations) -> Term:
    a, b = (string_variable(draw, known, 3) for _ in range(2))
    op = draw(st.sampled_from(["=", "<>", "<", "<=", ">", ">="]))
    return Term(f"({a.text} {op} {b.text})", "BOOL", comparison(op, a.value, b.value))


@st.composite
def string_scripts(draw: st.DrawFn) -> tuple[str, str, list[Term]]:
    """Declarations, statements, and what the variables must hold after them; targets are often arguments as well."""
    capacities = draw(st.lists(st.sampled_from([1, 3, 8, 15, 16, 17, 40]), min_size=2, max_size=4))
    values = [draw(st.text(CHARACTERS, max_size=c)) for c in capacities]
    declared = "".join(
        f"s{i} : STRING[{c}] := '{v}';\n" for i, (c, v) in enumerate(zip(capacities, values, strict=True))
    )
    statements = []
    for _ in range(EXPRESSIONS):
        target, first, second = (draw(st.integers(0, len(values) - 1)) for _ in range(3))
        function = draw(st.sampled_from([f for f in ARGUMENTS if f not in ("LEN", "FIND")]))
        length, place = draw(st.integers(-1, 20)), draw(st.integers(-1, 20))
        arguments = ARGUMENTS[function].format(s=f"s{first}", t=f"s{second}", l=length, p=place)
        statements.append(f"s{target} := {function}({arguments});")
        result = string_function(function, values[first], values[second], length, place)
        values[target] = str(result)[: capacities[target]]
    expected = [Term(f"s{i}", f"STRING[{c}]", v) for i, (c, v) in enumerate(zip(capacities, values, strict=True))]
    return declared, "\n".join(statements), expected


@PROGRAM
@given(string_scripts())
def test_strings_may_be_assigned_what_is_made_of_them(script: tuple[str, str, list[Term]]) -> None:
    declared, statements, expected = script
    check(expected, declared, statements)


@PROGRAM
@given(batch(any_string_call))
def test_string_functions_agree_with_slices(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_string_comparison))
def test_strings_compare_as_in_python(program: tuple[list[Term], str]) -> None:
    check(*program)


# ---- text ----------------------------------------------------------------------------------------------------------


def any_integer_text(draw: st.DrawFn, known: Declarations) -> Term:
    name = draw(st.sampled_from(list(WIDTH)))
    a = integer_leaf(draw, known, name)
    if draw(st.booleans()):
        return Term(f"{name}_TO_STRING({a.text})", "STRING", str(a.value))
    return Term(f"STRING_TO_{name}('{a.value}')", name, a.value)


def any_duration_text(draw: st.DrawFn, known: Declarations) -> Term:
    """Durations are read as the text the language uses."""
    name, whole = draw(st.sampled_from([("TIME", "DINT"), ("LTIME", "LINT")]))
    value = draw(numbers(whole) | st.integers(-1000, 1000).map(lambda n: n * 1000))
    text = str(format_time(value, ELEMENTARY[name]))
    if draw(st.booleans()):
        return Term(f"STRING_TO_{name}('{text}')", name, text)
    a = known.variable(whole, f"{whole}#{value}", value)
    return Term(f"{name}_TO_STRING({whole}_TO_{name}({a.text}))", "STRING", text)


def shortest_digits(value: float, name: str) -> str:
    """The fewest significant digits that read back as the same value, without zeros at the end."""
    for precision in range(17):
        text = f"{abs(value):.{precision}e}"
        if rounded(float(text), name) == abs(value):
            return text.split("e")[0].replace(".", "").rstrip("0") or "0"
    raise AssertionError(value)


def digits_of(text: str) -> str:
    return text.lstrip("-").split("E")[0].replace(".", "").strip("0") or "0"


@st.composite
def real_texts(draw: st.DrawFn) -> tuple[str, list[float]]:
    name = draw(st.sampled_from(["REAL", "LREAL"]))
    floats = st.floats(allow_nan=False, allow_infinity=False, width=32 if name == "REAL" else 64)
    powers = st.integers(-149, 127) if name == "REAL" else st.integers(-1074, 1023)
    decimals = st.integers(-99999, 99999).map(lambda n: rounded(n / 1000, name))
    value = floats | decimals | powers.map(partial(math.ldexp, 1.0))
    return name, draw(st.lists(value, min_size=EXPRESSIONS, max_size=EXPRESSIONS))


@PROGRAM
@given(batch(any_integer_text))
def test_integers_and_their_strings_convert_both_ways(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_duration_text))
def test_durations_and_their_strings_convert_both_ways(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(real_texts())
def test_real_strings_are_as_short_as_possible_and_read_back(case: tuple[str, list[float]]) -> None:
    name, values = case
    known = Declarations([])
    variables = [known.variable(name, f"{name}#{v:.17E}", v) for v in values]
    to_text = [Term(f"{name}_TO_STRING({v.text})", "STRING", "") for v in variables]
    and_back = [Term(f"STRING_TO_{name}({t.text})", name, v) for t, v in zip(to_text, values, strict=True)]
    results = evaluate([*to_text, *and_back], known.text())
    texts, read_back = results[: len(values)], results[len(values) :]
    for text, result, term in zip(texts, read_back, and_back, strict=True):
        assert isinstance(text, str) and isinstance(term.value, float)
        assert same(float(text), term), text
        assert same(result, term), text
        assert len(digits_of(text)) <= len(shortest_digits(term.value, name)), text


DECIMAL = st.from_regex(r"-?[0-9]{1,10}(\.[0-9]{1,9})?(E[+-]?[0-9]{1,3})?", fullmatch=True)


@PROGRAM
@given(st.lists(DECIMAL, min_size=EXPRESSIONS, max_size=EXPRESSIONS))
def test_decimal_strings_read_as_the_nearest_real(texts: list[str]) -> None:
    check([Term(f"STRING_TO_LREAL('{t}')", "LREAL", float(t)) for t in texts])


MANY_DIGITS = st.from_regex(r"-?[0-9]{1,30}(\.[0-9]{1,30})?(E[+-]?[0-9]{1,2})?", fullmatch=True)


def nearest_real(text: str) -> float:
    """The REAL nearest to a decimal number, the one with an even mantissa of two: without an LREAL between."""
    wanted, guess = Fraction(text), rounded(float(text), "REAL")
    if abs(wanted) >= (2 - Fraction(2) ** -24) * Fraction(2) ** 127:
        return math.copysign(math.inf, guess)
    (bits,) = struct.unpack("<i", struct.pack("<f", abs(guess)))
    near = [b for b in (bits - 1, bits, bits + 1) if b >= 0]
    values = {b: Fraction(b & 0x7FFFFF | (b >> 23 > 0) << 23) * Fraction(2) ** (max(b >> 23, 1) - 150) for b in near}
    best = min(near, key=lambda b: (abs(values[b] - abs(wanted)), b & 1))
    return math.copysign(struct.unpack("<f", struct.pack("<i", best))[0], guess)


@st.composite
def half_way_texts(draw: st.DrawFn) -> str:
    """A number half-way between two REAL or LREAL ones, or beside it by so little that only its last digits show it."""
    precision, exponent = draw(st.sampled_from([24, 53])), draw(st.integers(-60, 60))
    half_way = Fraction(2 * draw(st.integers(1 << (precision - 1), (1 << precision) - 1)) + 1) * Fraction(2) ** exponent
    with localcontext(prec=400):
        digits = f"{Decimal(half_way.numerator) / Decimal(half_way.denominator):f}"
    beside = draw(st.sampled_from(["", "0000", "1", "0" * 20 + "1", "0" * 60 + "1"]))
    return digits + ("" if "." in digits else ".0") + beside


@PROGRAM
@given(st.lists(MANY_DIGITS | half_way_texts(), min_size=EXPRESSIONS, max_size=EXPRESSIONS))
@example(["1.00000005960464477539062500001", "1.000000059604644775390625", "1.00000017881393432617187499999"])
def test_strings_of_many_digits_read_as_the_nearest_real(texts: list[str]) -> None:
    lreals = [Term(f"STRING_TO_LREAL('{t}')", "LREAL", float(t)) for t in texts]
    check([*lreals, *(Term(f"STRING_TO_REAL('{t}')", "REAL", nearest_real(t)) for t in texts)])


def test_the_longest_strings_read_as_the_nearest_real() -> None:
    """Also at the ends of the range, where a number has the most digits."""
    smallest, largest = Fraction(2) ** -1075, (2 - Fraction(2) ** -53) * Fraction(2) ** 1023
    with localcontext(prec=250):
        numbers = [
            Decimal(f.numerator) / Decimal(f.denominator) for f in (smallest, smallest * 3, largest, largest / 3)
        ]
    texts = [f"{number:.150E}" for number in numbers] + [
        "9" * 250 + "E-200",
        "0." + "0" * 200 + "1E200",
        "7E-46",
        "1E-400",
    ]
    terms = [Term(f"STRING_TO_LREAL('{t}')", "LREAL", float(t)) for t in texts]
    reals = ["7E-46", "7.1E-46", "3.4028235677973366E38", "3.4028235677973365E38", "1E-400", "0." + "3" * 240]
    check([*terms, *(Term(f"STRING_TO_REAL('{t}')", "REAL", nearest_real(t)) for t in reals)])


# ---- wide strings and limits of length ------------------------------------------------------------------------------

WIDE_CHARACTERS = st.characters(min_codepoint=32, max_codepoint=0xFFFF, exclude_categories=["Cs", "Cc"])
LENGTHS = st.sampled_from([0, 1, 79, 80, 81, 127, 128, 129, 254, 255, 256, 300])


def wide_variable(draw: st.DrawFn, known: Declarations, longest: int) -> Term:
    value = draw(st.text(st.sampled_from("aé€") | WIDE_CHARACTERS, max_size=longest))
    literal = "".join(f"${ord(c):04X}" for c in value)
    return known.variable(f"WSTRING[{max(len(value), 1)}]", f'"{literal}"', value)


def any_wide_string_call(draw: st.DrawFn, known: Declarations) -> Term:
    function = draw(st.sampled_from(list(ARGUMENTS)))
    s = wide_variable(draw, known, 12)
    t = wide_variable(draw, known, 4 if function != "FIND" else 2)
    length, place = draw(st.integers(-2, 15)), draw(st.integers(-2, 15))
    value = string_function(function, str(s.value), str(t.value), length, place)
    capacity = draw(st.integers(1, 20))
    arguments = ARGUMENTS[function].format(s=s.text, t=t.text, l=length, p=place)
    if isinstance(value, str):
        return Term(f"{function}({arguments})", f"WSTRING[{capacity}]", value[:capacity])
    return Term(f"{function}({arguments})", "INT", value)


def any_wide_conversion(draw: st.DrawFn, known: Declarations) -> Term:
    if draw(st.booleans()):
        s = wide_variable(draw, known, 12)
        narrow = "".join(c if ord(c) < 256 else "?" for c in str(s.value))
        return Term(f"WSTRING_TO_STRING({s.text})", "STRING", narrow)
    s = string_variable(draw, known, 12)
    return Term(f"STRING_TO_WSTRING({s.text})", "WSTRING", s.value)


def any_long_string_call(draw: st.DrawFn, known: Declarations) -> Term:
    """A text may have any length, the result of a function 255 characters."""
    lengths = [draw(LENGTHS) for _ in range(2)]
    values = [(letter * n) for letter, n in zip("ab", lengths, strict=True)]
    s, t = (known.variable(f"STRING[{max(len(v), 1)}]", f"'{v}'", v) for v in values)
    function = draw(st.sampled_from([f for f in ARGUMENTS if f not in ("FIND", "LEN")]))
    length, place = draw(st.integers(0, 310)), draw(st.integers(0, 310))
    value = str(string_function(function, values[0], values[1], length, place))[:255]
    call = f"{function}({ARGUMENTS[function].format(s=s.text, t=t.text, l=length, p=place)})"
    if draw(st.booleans()):
        return Term(f"LEN({call})", "INT", len(value))
    capacity = draw(LENGTHS.filter(bool))
    return Term(call, f"STRING[{capacity}]", value[:capacity])


@PROGRAM
@given(batch(any_wide_string_call))
def test_wide_string_functions_agree_with_slices(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_wide_conversion))
def test_strings_and_wide_strings_convert_character_by_character(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_long_string_call))
def test_string_results_are_cut_at_255_characters_and_at_the_target(program: tuple[list[Term], str]) -> None:
    check(*program)


# ---- binary coded decimals ------------------------------------------------------------------------------------------


def any_bcd(draw: st.DrawFn, known: Declarations) -> Term:
    """The digits that have room, there and back."""
    bits = draw(st.sampled_from(list(BITS)))
    name = draw(st.sampled_from(INTEGERS))
    digits, number = BITS[bits] // 4, integer_leaf(draw, known, name)
    pattern = int(str(max(int(number.value), 0))[-digits:], 16)
    if draw(st.booleans()):
        return Term(f"{name}_TO_BCD_{bits}({number.text})", bits, pattern)
    a = known.variable(bits, f"{bits}#{pattern}", pattern)
    return Term(f"{bits}_BCD_TO_{name}({a.text})", name, wrap(int(f"{pattern:x}"), name))


@PROGRAM
@given(batch(any_bcd))
def test_binary_coded_decimals_hold_the_last_digits(program: tuple[list[Term], str]) -> None:
    check(*program)


# ---- dates -----------------------------------------------------------------------------------------------------------

EPOCH = datetime(1970, 1, 1)
SECOND, DAY = 10**9, 86_400 * 10**9
UNIT = {"DATE": SECOND, "TOD": 10**6, "DT": SECOND, "LDATE": 1, "LTOD": 1, "LDT": 1, "TIME": 10**6, "LTIME": 1}
DATES = [name for name in UNIT if "TIME" not in name]


def highest(name: str) -> int:
    """The last value of a date type that means something."""
    if "TOD" in name:
        return DAY // UNIT[name] - 1
    last = (1 << ELEMENTARY[name].bits) - 1
    return last if name.endswith("T") else last * UNIT[name] // DAY * DAY // UNIT[name]


def moments(name: str) -> st.SearchStrategy[int]:
    """Values of a date type: whole days for dates; ends of months and of the type more often."""
    step = DAY // UNIT[name] if "DATE" in name else 1
    turns = [datetime(y, m, 1) - EPOCH for y in (1970, 1972, 2000, 2024, 2100, 2104) for m in (1, 2, 3, 12) if y < 2105]
    edges = [0, 1, highest(name) // step] if "TOD" in name else [
        0, 1, highest(name) // step, *(t.days * DAY // UNIT[name] // step - b for t in turns for b in (0, 1) if t.days)
    ]  # fmt: skip
    return (st.sampled_from(edges) | st.integers(0, highest(name) // step)).map(lambda n: n * step)


def moment(draw: st.DrawFn, known: Declarations, name: str) -> tuple[str, int]:
    """A variable or literal of a date type, and its nanoseconds."""
    value = draw(moments(name))
    literal = format_date(value, ELEMENTARY[name])
    text = known.variable(name, literal, value).text if draw(st.booleans()) else literal
    return text, value * UNIT[name]


def date_text(ns: int, name: str) -> str:
    """What the simulator shows of a date that began so many nanoseconds after 1970, or midnight."""
    return format_date(ns // UNIT[name] % (1 << ELEMENTARY[name].bits), ELEMENTARY[name])


def any_date_conversion(draw: st.DrawFn, known: Declarations) -> Term:
    source, target = draw(st.sampled_from(DATES)), draw(st.sampled_from(DATES))
    text, ns = moment(draw, known, source)
    if "TOD" in target:
        ns %= DAY
    elif "DATE" in target:
        ns -= ns % DAY
    return Term(text if source == target else f"{source}_TO_{target}({text})", target, date_text(ns, target))


def any_date_text(draw: st.DrawFn, known: Declarations) -> Term:
    name = draw(st.sampled_from(DATES))
    text, ns = moment(draw, known, name)
    written = date_text(ns, name)
    if draw(st.booleans()):
        return Term(f"{name}_TO_STRING({text})", "STRING", written)
    return Term(f"STRING_TO_{name}('{written}')", name, written)


def any_moved_date(draw: st.DrawFn, known: Declarations) -> Term:
    """Plus or minus a duration: a time of day stays within the day, a date within its bits."""
    name, long = draw(st.sampled_from(["DT", "TOD", "LDT", "LTOD"])), draw(st.booleans())
    text, ns = moment(draw, known, name)
    span, whole = ("LTIME", "LINT") if long and name[0] == "L" else ("TIME", "DINT")
    amount = draw(st.integers(-(10**6), 10**6).map(lambda n: n * 1000) | numbers(whole))
    d = known.variable(whole, f"{whole}#{amount}", amount)
    op = draw(st.sampled_from("+-"))
    moved = amount * UNIT[span]
    moved = int(math.copysign(abs(moved) // UNIT[name], moved)) * UNIT[name] if abs(moved) < 1 << 53 else moved
    ns += moved if op == "+" else -moved
    if "TOD" in name:
        ns %= DAY
    return Term(f"{text} {op} {whole}_TO_{span}({d.text})", name, date_text(ns, name))


def any_difference(draw: st.DrawFn, known: Declarations) -> Term:
    name = draw(st.sampled_from(DATES))
    (a, x), (b, y) = (moment(draw, known, name) for _ in range(2))
    wide = "LTIME" if name[0] == "L" else "TIME"
    value = wrap((x - y) // UNIT[wide], "LINT" if wide == "LTIME" else "DINT")
    function = draw(st.sampled_from(["{a} - {b}", f"SUB_{name}_{name}({{a}}, {{b}})"]))
    return Term(function.format(a=a, b=b), wide, str(format_time(value, ELEMENTARY[wide])))


def any_calendar_day(draw: st.DrawFn, known: Declarations) -> Term:
    """Year, month and day put together; what is no day gives the first one."""
    year, month, day = draw(st.integers(1960, 2110)), draw(st.integers(0, 13)), draw(st.integers(0, 32))
    try:
        days = (datetime(year, month, day) - EPOCH).days
    except ValueError:
        days = 0
    days = days if days >= 0 and year >= 1970 else 0
    name = draw(st.sampled_from(["DATE", "LDATE"])) if days * 86_400 < 1 << 32 else "LDATE"
    parts = [known.variable("INT", str(n), n).text for n in (year, month, day)]
    return Term(f"CONCAT_{name}({', '.join(parts)})", name, date_text(days * DAY, name))


@PROGRAM
@given(batch(any_date_conversion))
def test_dates_convert_into_each_other(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_date_text))
def test_dates_and_their_strings_convert_both_ways(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_moved_date))
def test_dates_are_moved_by_durations(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_difference))
def test_differences_of_dates_are_durations(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_calendar_day))
def test_dates_are_put_together_from_numbers(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(st.lists(st.tuples(st.sampled_from(["DT", "LDT"]), st.integers(0, 10**6)), min_size=6, max_size=6), st.data())
def test_dates_are_split_as_datetime_does_it(kinds: list[tuple[str, int]], data: st.DataObject) -> None:
    known, statements, terms = Declarations([]), [], list[Term]()
    for i, (name, _) in enumerate(kinds):
        value = data.draw(moments(name)) * UNIT[name]
        at, outputs = EPOCH + timedelta(microseconds=value // 1000), []
        stamp = known.variable(name, date_text(value, name), value)
        for part in ("year", "month", "day", "hour", "minute", "second"):
            known.lines.append(f"{part}{i} : INT;")
            outputs.append(f"{part.upper()} => {part}{i}")
            terms.append(Term(f"{part}{i}", "INT", getattr(at, part)))
        statements.append(f"SPLIT_{name}({stamp.text}, {', '.join(outputs)});")
        day = f"{name.removesuffix('DT')}DATE"
        terms.append(Term(f"DAY_OF_WEEK({name}_TO_{day}({stamp.text}))", "INT", at.isoweekday() % 7))
    check(terms, known.text(), "\n".join(statements))
