"""What the standard library has: every function and block of the standard's tables, and nothing that is not used."""

from __future__ import annotations

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.library import Library
from plctool.iec.types import ELEMENTARY

NUMBERS = ["SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT"]
BITS = ["BYTE", "WORD", "DWORD", "LWORD"]
TYPES = [
    *dict.fromkeys(t.name for t in ELEMENTARY.values()), "STRING", "WSTRING", "TIME_OF_DAY", "DATE_AND_TIME",
    "LTIME_OF_DAY", "LDATE_AND_TIME",
]  # fmt: skip


def errors(text: str) -> list[str]:
    return [d.message for d in check_sources([Source("main.st", text)]).diagnostics if d.severity == "error"]


def assignments(pairs: list[tuple[str, str, str]]) -> str:
    """A program that assigns `function(variable of a type)` to a variable of another type, for each triple."""
    declared = "".join(f"v_{t} : {t};\n" for t in TYPES)
    body = "".join(f"v_{target} := {function}(v_{source});\n" for target, function, source in pairs)
    return f"PROGRAM Main\nVAR\n{declared}END_VAR\n{body}END_PROGRAM\n"


def test_there_is_a_conversion_from_every_type_to_every_type() -> None:
    assert errors(assignments([(b, f"{a}_TO_{b}", a) for a in TYPES for b in TYPES if a != b])) == []


def test_there_is_a_conversion_to_every_type_from_any() -> None:
    assert errors(assignments([(b, f"TO_{b}", a) for a in TYPES for b in TYPES])) == []


def test_reals_are_cut_off_to_every_integer() -> None:
    pairs = [(b, f"{a}_TRUNC_{b}", a) for a in ("REAL", "LREAL") for b in NUMBERS + BITS]
    assert errors(assignments(pairs + [(b, f"TRUNC_{b}", "LREAL") for b in NUMBERS + BITS])) == []


def test_every_integer_becomes_decimal_digits_in_every_bit_string_and_back() -> None:
    there = [(b, f"{a}_TO_BCD_{b}", a) for a in NUMBERS for b in BITS] + [(b, f"TO_BCD_{b}", "INT") for b in BITS]
    back = [(a, f"{b}_BCD_TO_{a}", b) for a in NUMBERS for b in BITS] + [(a, f"BCD_TO_{a}", "WORD") for a in NUMBERS]
    assert errors(assignments(there + back)) == []


def test_the_byte_order_of_every_scalar_may_be_changed() -> None:
    scalars = [t for t in TYPES if "STRING" not in t]
    orders = [f"{way}_{end}_ENDIAN" for way in ("TO", "FROM") for end in ("BIG", "LITTLE")]
    assert errors(assignments([(t, order, t) for t in scalars for order in orders])) == []


CALLS = """
ABS(x) SQRT(x) LN(x) LOG(x) EXP(x) SIN(x) COS(x) TAN(x) ASIN(x) ACOS(x) ATAN(x) ATAN2(x,x) FLOOR(x) CEIL(x) EXPT(x,x)
ADD(x,x,x) SUB(x,x) MUL(x,x,x) DIV(x,x) MOD(i,i) MOVE(x) SHL(w,1) SHR(w,1) ROL(w,1) ROR(w,1)
AND(w,w,w) OR(w,w,w) XOR(w,w,w) SEL(b,x,x) MUX(i,x,x,x) MIN(x,x,x) MAX(x,x,x) LIMIT(x,x,x)
GT(x,x,x) GE(x,x,x) EQ(x,x,x) LE(x,x,x) LT(x,x,x) NE(x,x)
LEN(s) LEFT(s,1) RIGHT(s,1) MID(s,1,1) CONCAT(s,s,s) INSERT(s,s,1) DELETE(s,1,1) REPLACE(s,s,1,1) FIND(s,s)
ADD_TIME(t,t) ADD_LTIME(lt,lt) ADD_TOD_TIME(tod,t) ADD_LTOD_LTIME(ltod,lt) ADD_DT_TIME(dt,t) ADD_LDT_LTIME(ldt,lt)
SUB_TIME(t,t) SUB_LTIME(lt,lt) SUB_DATE_DATE(d,d) SUB_LDATE_LDATE(ld,ld) SUB_TOD_TIME(tod,t) SUB_LTOD_LTIME(ltod,lt)
SUB_TOD_TOD(tod,tod) SUB_LTOD_LTOD(ltod,ltod) SUB_DT_TIME(dt,t) SUB_LDT_LTIME(ldt,lt) SUB_DT_DT(dt,dt)
SUB_LDT_LDT(ldt,ldt) MUL_TIME(t,x) MUL_LTIME(lt,x) DIV_TIME(t,x) DIV_LTIME(lt,x) MULTIME(t,i) DIVTIME(t,i)
CONCAT_DATE_TOD(d,tod) CONCAT_DATE_LTOD(d,ltod) CONCAT_LDATE_LTOD(ld,ltod) CONCAT_DATE(i,i,i) CONCAT_LDATE(i,i,i)
CONCAT_TOD(i,i,i,i) CONCAT_LTOD(i,i,i,i) CONCAT_DT(i,i,i,i,i,i,i) CONCAT_LDT(i,i,i,i,i,i,i) DAY_OF_WEEK(d)
DAY_OF_WEEK(ld) IS_VALID(x) IS_VALID_BCD(w) SPLIT_DATE(d,i,i,i) SPLIT_LDATE(ld,i,i,i) SPLIT_TOD(tod,i,i,i,i)
SPLIT_LTOD(ltod,i,i,i,i) SPLIT_DT(dt,i,i,i,i,i,i,i) SPLIT_LDT(ldt,i,i,i,i,i,i,i) TRUNC(x) TRUNC_INT(x)
"""


@pytest.mark.parametrize("call", CALLS.split())
def test_every_function_of_the_tables_is_there(call: str) -> None:
    declared = (
        "x : LREAL; i : INT; w : WORD; b : BOOL; s : STRING; t : TIME; lt : LTIME; d : DATE; ld : LDATE; tod : TOD;"
        "ltod : LTOD; dt : DT; ldt : LDT;"
    )
    text = f"PROGRAM Main VAR {declared} END_VAR\n{call};\nEND_PROGRAM"
    assert errors(text) == []


BLOCKS = [
    "SR", "RS", "SEMA", "R_TRIG", "F_TRIG", "RTC",
    *(f"{c}{suffix}" for c in ("CTU", "CTD", "CTUD") for suffix in ("", "_INT", "_DINT", "_LINT", "_UDINT", "_ULINT")),
    *(f"{t}{suffix}" for t in ("TON", "TOF", "TP") for suffix in ("", "_TIME", "_LTIME")), "LTON", "LTOF", "LTP",
]  # fmt: skip


def test_every_block_of_the_tables_is_there() -> None:
    instances = "".join(f"b{i} : {name};\n" for i, name in enumerate(BLOCKS))
    calls = "".join(f"b{i}();\n" for i in range(len(BLOCKS)))
    assert errors(f"PROGRAM Main\nVAR\n{instances}END_VAR\n{calls}END_PROGRAM\n") == []


def test_only_what_a_program_uses_is_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[str] = []
    original = Library.parse

    def parse(self: Library, key: str, diagnostics: object) -> list[object]:
        found = original(self, key, diagnostics)  # type: ignore[arg-type]
        parsed.extend([key] if found else [])
        return list(found)

    monkeypatch.setattr(Library, "parse", parse)
    assert errors("PROGRAM Main VAR i : INT; f : R_TRIG; END_VAR i := MAX(i + 1, 2); f(); END_PROGRAM") == []
    assert parsed == ["r_trig"]
