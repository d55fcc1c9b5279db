"""A block that is passed a structure reads it as one that lies as its type wants, so a packed one is copied first."""

from __future__ import annotations

import re

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.image.targets import find_target

TEXT = """
TYPE Pair : STRUCT a, b : DINT; END_STRUCT END_TYPE
{attribute 'pack_mode' := '1'}
TYPE Packed : STRUCT first : BYTE; pair : Pair; END_STRUCT END_TYPE
FUNCTION_BLOCK Sum
VAR_INPUT pair : Pair; END_VAR
VAR_OUTPUT sum : DINT; END_VAR
sum := pair.a + pair.b;
END_FUNCTION_BLOCK
PROGRAM Main VAR packed : Packed; whole : Pair; sum : Sum; END_VAR
sum(pair := %s);
END_PROGRAM
"""


def passed(argument: str) -> str:
    """The instruction that makes the address that the block is passed."""
    checked = check_sources([Source("main.st", TEXT % argument)])
    assert checked.program, checked.diagnostics
    options = Options(find_target("cortex-m0"), 3)  # of which the input is not kept in memory
    text = "".join(part.text for part in lower(checked.program, options).parts)
    call = re.search(r"call \w+ @st.Sum\(ptr (%\w+),", text)
    assert call
    found = re.search(rf"{call[1]} = (.*)", text)
    assert found
    return found[1]


def test_a_structure_in_a_packed_one_is_copied() -> None:
    assert passed("packed.pair").startswith("alloca [8 x i8], align 4")


def test_a_structure_that_lies_as_its_type_wants_is_not() -> None:
    assert passed("whole").startswith("getelementptr")
