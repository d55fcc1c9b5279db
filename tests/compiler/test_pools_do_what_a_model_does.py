"""Random calls of __NEW and __DELETE, with pointers that are valid, old or foreign: the elements in use are those of a
model, and each keeps its value."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator

SIZE = 7
POINTERS = 5
SOURCE = f"""
{{attribute 'pool' := '{SIZE}'}}
FUNCTION_BLOCK Item
VAR_INPUT owner : DINT; END_VAR
METHOD FB_Init : BOOL
VAR_INPUT bInitRetains, bInCopyCode : BOOL; END_VAR
owner := -1;
END_METHOD
END_FUNCTION_BLOCK

PROGRAM Main
VAR_INPUT operation, k, n : INT; END_VAR
VAR_OUTPUT at : DINT; raised, changed : BOOL; END_VAR
VAR
    p, old : ARRAY[0..{POINTERS - 1}] OF POINTER TO Item;
    first : POINTER TO Item;
    stamp, i : DINT;
    exc : __SYSTEM.ExceptionCode;
END_VAR
IF first = 0 THEN
    first := __NEW(Item);
    old[0] := first;
    __DELETE(old[0]);
END_IF
raised := FALSE;
__TRY
    CASE operation OF
    1:
        p[k] := __NEW(Item, n);
        IF p[k] <> 0 THEN
            old[k] := p[k];
            stamp := stamp + 1;
            FOR i := 0 TO n - 1 DO
                changed := changed OR p[k][i].owner <> -1;
                p[k][i].owner := stamp;
            END_FOR
        END_IF
    2: __DELETE(p[k]);
    3: __DELETE(old[k]);
    END_CASE
__CATCH(exc)
    raised := TRUE;
__ENDTRY
at := -1;
IF p[k] <> 0 THEN at := TO_DINT((p[k] - first) / SIZEOF(Item)); END_IF
END_PROGRAM
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    source = tmp_path_factory.mktemp("pools") / "main.st"
    source.write_text(SOURCE)
    return compile_sources([source])


class Model:
    """Which elements are in use: the length of what begins at each, by the number of its first element."""

    def __init__(self) -> None:
        self.lengths: dict[int, int] = {}
        self.p = [-1] * POINTERS
        self.old = [-1] * POINTERS

    def do(self, operation: int, k: int, n: int) -> bool:
        """Whether the operation raises an exception."""
        if operation == 1:
            self.new(k, n)
            return False
        return self.delete(k) if operation == 2 else self.delete_old(k)

    def new(self, k: int, n: int) -> None:
        used = {at + i for at, length in self.lengths.items() for i in range(length)}
        fits = [at for at in range(SIZE - n + 1) if used.isdisjoint(range(at, at + n))] if n > 0 else []
        self.p[k] = fits[0] if fits else -1
        if fits:
            self.lengths[fits[0]] = n
            self.old[k] = fits[0]

    def delete(self, k: int) -> bool:
        if self.p[k] < 0:
            return False
        if self.lengths.pop(self.p[k], None) is None:
            return True
        self.p[k] = -1
        return False

    def delete_old(self, k: int) -> bool:
        if self.old[k] >= 0 and self.lengths.pop(self.old[k], None) is None:
            return True
        self.old[k] = -1
        return False


OPERATIONS = st.tuples(st.integers(1, 3), st.integers(0, POINTERS - 1), st.integers(-1, SIZE + 1))


@examples(60)
@given(st.lists(OPERATIONS, max_size=40))
def test_the_elements_in_use_are_those_of_a_model(built: BuildResult, operations: list[tuple[int, int, int]]) -> None:
    model = Model()
    with Simulator(built.image, built.symbols) as plc:
        for operation, k, n in operations:
            plc.write({"Main.operation": operation, "Main.k": k, "Main.n": n})
            plc.run_cycles(1)
            raised = model.do(operation, k, n)
            assert (plc.read("Main.raised"), plc.read("Main.at")) == (raised, model.p[k])
            assert not plc.read("Main.changed")
