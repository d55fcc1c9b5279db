"""The passes of the code generator by name: which of them run, and what one of them leaves.

Without a pass the code does the same, larger or slower: so leaving one out shows whether it is what makes a difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from plctool.errors import UsageError, did_you_mean

PASSES = {
    "transient": "variables of blocks that no call needs from the previous one are not kept in memory",
    "closed": "a block that calls nothing and cannot fail returns an output, and gets the context only for the time",
    "registers": "inputs of blocks that every call gives are passed in registers",
    "sections": "a body that is too long for one function becomes several",
    "memory": "what was loaded or stored is not loaded again, and stores that nothing reads are left out",
    "lengths": "the length of a string that was just written is known",
    "splice": "INSERT, DELETE and REPLACE change a string where it is",
    "parts": "a large program is cut into parts that are optimised by themselves",
    "optimise": "LLVM's passes for the level; without them those of level 0",
    "dead-stores": "of a large program: stores that nothing reads are left out",
    "widen": "divisions by constants are done in words",
    "shorten": "short instructions are chosen",
    "lean": "what several blocks could share is computed in each of them, if that is smaller",
}
"""What each pass does, in the order in which they run; those from `sections` to `splice` while IR is written."""


@dataclass(frozen=True)
class Passes:
    """`without`: passes that are left out; `dump_after`: the pass whose result is added to `dumps`, "" for none."""

    without: frozenset[str] = frozenset()
    dump_after: str = ""
    dumps: list[str] = field(default_factory=list, compare=False)

    def runs(self, name: str) -> bool:
        """True if the pass is not left out."""
        assert name in PASSES
        return name not in self.without

    def left(self, names: Iterable[str], text: Callable[[], str]) -> None:
        """Keeps what these passes have left, if one of them is asked for."""
        if self.dump_after in names:
            self.dumps.append(text())


def parse_passes(without: Iterable[str] = (), dump_after: str | None = None) -> Passes:
    """The passes from names, several in one text with commas between them. Raises UsageError for an unknown name."""
    names = [name.strip().lower() for text in without for name in text.split(",")]
    after = "" if dump_after is None else dump_after.strip().lower()
    for name in [*names, *([] if dump_after is None else [after])]:
        if name not in PASSES:
            hint = did_you_mean(name, PASSES) or f"; the passes are {', '.join(PASSES)}."
            raise UsageError(f"There is no pass '{name}' of the code generator{hint}", "unknown-pass")
    return Passes(frozenset(names), after)
