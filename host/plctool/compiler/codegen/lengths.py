"""What is known of the lengths of strings, so that LEN and an appending CONCAT need not look for their ends.

The functions of the library that write a string know how long it has become, and return that. It holds until something
may write the string: for a run of instructions without branches, and over calls that touch only their own result.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import Value
from plctool.compiler.typed import Assign, Call, Pou, Storage, Variable, VarPlace

_MEASURING = ("LEN", "LEN__WSTRING", "WLEN")
_APPENDING = ("CONCAT", "CONCAT__WSTRING", "WCONCAT")
_COPYING = ("COPY__", "WCOPY__")

_Place = tuple[Value, int]  # a pointer and an offset


class Lengths:
    """The lengths of strings in characters, by where they are. `since`: as Function.barriers counts; with another
    number nothing of it holds any more."""

    def __init__(self) -> None:
        self._since = -1
        self._known: dict[_Place, Value] = {}

    def known(self, barriers: int) -> dict[_Place, Value]:
        """All that is known here."""
        return self._known if self._since == barriers else {}

    def set(self, known: dict[_Place, Value], barriers: int) -> None:
        """Only these are known from here on."""
        self._known, self._since = known, barriers


def is_measuring(pou: Pou) -> bool:
    """Whether a function is LEN."""
    return pou.no_init and pou.name in _MEASURING


def is_appending(pou: Pou) -> bool:
    """Whether a function is CONCAT."""
    return pou.no_init and pou.name in _APPENDING


def length_variable(pou: Pou) -> Variable | None:
    """The variable of a function of the library with the length of its string result: its last statement assigns it
    what COPY__ returns."""
    last = pou.body[-1] if pou.cuts_result and pou.no_init and pou.body else None
    if not isinstance(last, Assign) or not isinstance(last.value, Call) or not isinstance(last.target, VarPlace):
        return None
    target, place = last.target.var, last.value.args[0]
    writes_result = isinstance(place, VarPlace) and place.var is pou.result
    copies = last.value.function.name in _COPYING and writes_result
    return target if copies and target.storage is Storage.LOCAL else None
