"""SIZEOF of what the caller chooses, a string or an ARRAY[*]."""

from __future__ import annotations

import pytest
from front_support import check

BODY = """FUNCTION F : DINT
VAR_IN_OUT io : {type}; END_VAR
VAR n : {result}; END_VAR
MEMSET(ADR(io), 0, SIZEOF(io));
n := SIZEOF(io);
F := 0;
END_FUNCTION
"""


@pytest.mark.parametrize("type_", ["STRING", "WSTRING", "ARRAY[*] OF INT"])
@pytest.mark.parametrize(("result", "said"), [("UDINT", []), ("DINT", []), ("ULINT", []), ("INT", ["narrowing"])])
def test_a_size_fits_where_none_is_cut_off(type_: str, result: str, said: list[str]) -> None:
    result_of = check(BODY.format(type=type_, result=result) + "PROGRAM Main END_PROGRAM")
    assert [d.code for d in result_of.diagnostics] == said
