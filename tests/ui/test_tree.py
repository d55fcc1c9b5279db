"""The tree of large and unusual programs."""

from __future__ import annotations

from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.iec.areas import Area
from plctool.iec.types import ELEMENTARY, ArrayType
from plctool.ui.variables import AT_ONCE, Tree


def tree(*variables: Symbol) -> Tree:
    return Tree(SymbolTable(0, "x86_64", "", [], {variable.name: variable for variable in variables}))


def array(*bounds: tuple[int, int]) -> Symbol:
    return Symbol("Main.big", Area.DATA.value, 0, ArrayType(ELEMENTARY["BYTE"], tuple(bounds)))


def test_elements_of_several_dimensions_are_named_as_they_are_read() -> None:
    big = array((1, 2), (-1, 1))
    found = [row["name"] for row in tree(big).children("Main.big")["rows"]]
    assert found == [part.name for part in big.parts()]
    assert found[4:] == [row["name"] for row in tree(big).children("Main.big", 4)["rows"]]


def test_an_array_of_billions_opens_at_any_place() -> None:
    big = tree(array((0, 1 << 31)))
    assert len(big.children("Main.big")["rows"]) == AT_ONCE
    assert big.children("Main.big", (1 << 31) - 1)["rows"][-1]["name"] == f"Main.big[{1 << 31}]"
