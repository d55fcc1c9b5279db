"""What a download does to PERSISTENT values, according to the symbols of both programs.

The device does the same by name and type (firmware/src/cycle/CmpRetain.c) and counts; here the values have names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from plctool.debug.symbols import KeptName


@dataclass(frozen=True)
class KeptChanges:
    """Names of PERSISTENT values, `[]` for all elements of an array: those that are taken over, those that are new, and
    those that are lost, each with the reason."""

    kept: list[str]
    new: list[str]
    lost: dict[str, str]


def kept_changes(before: Sequence[KeptName], after: Sequence[KeptName]) -> KeptChanges:
    """Compares what the previous program keeps with what the new one keeps."""
    had, has = ({k.name.casefold(): k for k in program} for program in (before, after))
    wanted = {name: _why_lost(had.get(name), k) for name, k in has.items() if k.persistent}
    kept = [has[name].name for name, why in wanted.items() if not why]
    new = [has[name].name for name, why in wanted.items() if why]
    fates = {k.name: _why_lost(k, has.get(name)) for name, k in had.items() if k.persistent}
    return KeptChanges(kept, new, {name: why for name, why in fates.items() if why})


def _why_lost(before: KeptName | None, after: KeptName | None) -> str:
    """Why a value is not taken over; "" when it is."""
    if before is None or after is None:
        return "is not there any more"
    if after.type != before.type:
        return f"was {before.type}, is {after.type}"
    if after.size < before.size:
        return "is shorter"
    return "" if after.persistent else "is RETAIN only"
