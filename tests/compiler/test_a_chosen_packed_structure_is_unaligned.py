"""What SEL and MUX choose of a packed structure may be at any address, whatever its type wants."""

from __future__ import annotations

import re

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.image.targets import find_target

TEXT = """
TYPE Pair : STRUCT x : LREAL; y : DINT; END_STRUCT END_TYPE
{attribute 'pack_mode' := '1'}
TYPE Packed : STRUCT first : BYTE; a, b : Pair; END_STRUCT END_TYPE
FUNCTION_BLOCK Take
VAR_INPUT pair : Pair; END_VAR
VAR sum : LREAL; END_VAR
sum := sum + pair.x;
END_FUNCTION_BLOCK
FUNCTION Given : Pair
VAR_INPUT pair : Pair; END_VAR
Given := pair;
END_FUNCTION
PROGRAM Main
VAR packed : Packed; whole : Pair; target : Pair; yes : BOOL; k : INT; take : Take; END_VAR
%s
END_PROGRAM
"""


def lowered(statement: str) -> str:
    checked = check_sources([Source("main.st", TEXT % statement)])
    assert checked.program, checked.diagnostics
    text = "".join(part.text for part in lower(checked.program, Options(find_target("cortex-m3"), 0)).parts)
    found = re.search(r"define [^\n]*@st\.Main\(.*?^}", text, re.DOTALL | re.MULTILINE)
    assert found
    return found[0]


@pytest.mark.parametrize(
    "choice", ["SEL(yes, packed.a, packed.b)", "SEL(yes, whole, packed.b)", "MUX(k, packed.a, whole, packed.b)"]
)
@pytest.mark.parametrize("statement", ["target := {};", "target := Given({});", "take(pair := {});"])
def test_it_is_copied_from_an_address_that_may_be_odd(statement: str, choice: str) -> None:
    assert re.search(r"call void @llvm\.mem.*align 1 ", lowered(statement.format(choice)))


def test_what_lies_as_its_type_wants_is_copied_from_such_an_address() -> None:
    assert "align 1 " not in lowered("target := SEL(yes, whole, target);")
