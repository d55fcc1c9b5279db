"""What is known of the lengths of strings, so that the functions of the library need not look for their ends.

Those that write a string know how long it has become, and return that. It holds until something may write the string:
for a run of instructions without branches, over calls that touch only their own result, and over an IF that leaves the
string alone. A function of which all strings have a known length is called in a form that is given their lengths.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import Value
from plctool.compiler.typed.nodes import Assign, Call, Pou, Storage, Variable, VarPlace
from plctool.iec.types import StringType

_MEASURING = ("LEN", "LEN__WSTRING", "WLEN")
_SPANNING = ("SPAN__", "WSPAN__")
_APPENDING = ("CONCAT", "CONCAT__WSTRING", "WCONCAT")
_COPYING = ("COPY__", "WCOPY__")
_PUTTING = "PUT_"  # the functions that write a number begin with it

KnownLengths = dict[tuple[Value, int], Value]  # in characters, by pointer and offset


class Lengths:
    """The lengths of strings. `since`: as Function.writes counts; with another number nothing of it holds any more."""

    def __init__(self) -> None:
        self._since = -1
        self._known: KnownLengths = {}

    def known(self, writes: int) -> KnownLengths:
        """All that is known here."""
        return self._known if self._since == writes else {}

    def set(self, known: KnownLengths, writes: int) -> None:
        """Only these are known from here on."""
        self._known, self._since = known, writes


def known_by_all(ways: list[KnownLengths]) -> KnownLengths:
    """What is known where ways meet."""
    first, *others = ways or [{}]
    return {place: length for place, length in first.items() if all(way.get(place) == length for way in others)}


def is_measuring(pou: Pou) -> bool:
    """Whether a function is LEN."""
    return pou.no_init and pou.name in _MEASURING


def is_spanning(pou: Pou) -> bool:
    """Whether a function is SPAN__."""
    return pou.no_init and pou.name in _SPANNING


def is_copying(pou: Pou) -> bool:
    """Whether a function is COPY__."""
    return pou.no_init and pou.name in _COPYING


def takes_lengths(pou: Pou) -> bool:
    """Whether a function has a form that is given the lengths of its strings."""
    strings = [p for p in pou.parameters if isinstance(p.variable.type, StringType)]
    return pou.no_init and not pou.name.endswith("__") and bool(strings) and all(p.by_reference for p in strings)


def is_appending(pou: Pou) -> bool:
    """Whether a function is CONCAT."""
    return pou.no_init and pou.name in _APPENDING


def length_variable(pou: Pou) -> Variable | None:
    """The variable of a function of the library with the length of its string result: its last statement assigns it
    what COPY__ or a PUT_...__ returns."""
    last = pou.body[-1] if pou.no_init and pou.body else None
    if not isinstance(last, Assign) or not isinstance(last.value, Call) or not isinstance(last.target, VarPlace):
        return None
    target, writer, place = last.target.var, last.value.function, last.value.args[0]
    writes = writer.name in _COPYING or writer.name.startswith(_PUTTING)
    writes_result = isinstance(place, VarPlace) and place.var is pou.result
    return target if writes and writes_result and target.storage is Storage.LOCAL else None
