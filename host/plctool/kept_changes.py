"""What a download does to PERSISTENT values, as far as the symbols of both programs tell.

The device does the same by name and type (firmware/src/app/CmpRetain.c) and counts; here the values have names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from plctool.symbols import KeptName


@dataclass(frozen=True)
class KeptChanges:
    """Names of PERSISTENT values, `[]` for all elements of an array: those that are taken over, those that are new, and
    those that are lost, each with the reason."""

    kept: list[str]
    new: list[str]
    lost: dict[str, str]


def kept_changes(before: Sequence[KeptName], after: Sequence[KeptName]) -> KeptChanges:
    """Compares what the program before keeps with what the next one does."""
    had, has = {_key(k) for k in before}, {_key(k): k for k in after}
    wanted = [k for k in after if k.persistent]
    kept = [k.name for k in wanted if _key(k) in had]
    new = [k.name for k in wanted if _key(k) not in had]
    others = {k.name.casefold(): k for k in after}
    lost = {}
    for k in before:
        same = has.get(_key(k))
        if k.persistent and (same is None or not same.persistent):
            lost[k.name] = _reason(k, others.get(k.name.casefold()))
    return KeptChanges(kept, new, lost)


def _key(kept: KeptName) -> tuple[str, str]:
    return kept.name.casefold(), kept.type


def _reason(before: KeptName, after: KeptName | None) -> str:
    if after is None:
        return "is not there any more"
    if after.type != before.type:
        return f"was {before.type}, is {after.type}"
    return "is RETAIN only"
