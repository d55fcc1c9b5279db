"""Edits lines of random programs of tests/st, and compares the check of bodies alone with a fresh check of all.

`python tests/lsp/random_edits.py [EDITS [SEED]]`, with the environment of the tests, prints each difference, and the
memory at the end.
"""

from __future__ import annotations

import random
import resource
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from plctool.compiler.formats.il_files import has_lists
from plctool.compiler.semantics.lints import LINTS
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.lsp.checks import checked
from plctool.lsp.incremental import Kept, Observer
from plctool.lsp.project import Project
from plctool.lsp.tree import Tree

PROGRAMS = Path(__file__).parents[1] / "st"
EDITS_OF_A_PROGRAM = 20
LATER = frozenset(lint.name for lint in LINTS if not lint.despite_errors)  # what waits until there are no errors
PRELIMINARY = {
    "default_of_a_parameter_is_no_local_variable.st": "a mistake in a default counts as a use of what it names",
}
"""Programs of which the check of all, which follows, shows something else."""

CHANGES = [
    lambda line: "",
    lambda line: line.replace("n", "q", 1),
    lambda line: line.replace(":=", ":= TRUE +", 1),
    lambda line: line.replace(";", "", 1),
    lambda line: line.replace("(", "", 1),
    lambda line: line + "\nRETURN;",
    lambda line: line + "\nzz := 1;",
    lambda line: line + "\nIF n > 2 THEN",
    lambda line: line + "\npump.",
    lambda line: line + " (* open",
    lambda line: line.replace("Pump", "Pumpe"),
    lambda line: line.replace("INT", "REAL"),
    lambda line: line.replace("END_VAR", "", 1),
    lambda line: line.upper(),
]


@dataclass
class Campaign:
    """What some edits have shown."""

    edits: int = 0
    compared: int = 0
    differences: list[str] = field(default_factory=list)


def memory() -> int:
    """Returns the most megabytes that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def programs(rng: random.Random, folder: Path) -> Iterator[Path]:
    """Copies random programs without syntax errors, one after the other."""
    files = sorted(PROGRAMS.rglob("*.st"))
    while True:
        file = rng.choice(files)
        text = file.read_bytes().decode("utf-8", "replace")
        if file.name in PRELIMINARY or has_lists(text):
            continue
        copy = folder / file.name
        copy.write_text(text)
        yield copy
        copy.unlink()


def campaign(edits: int, seed: int, folder: Path) -> Campaign:
    """Makes so many edits."""
    rng, result = random.Random(seed), Campaign()
    for file in programs(rng, folder):
        if result.edits >= edits:
            return result
        _edit(file, rng, result)
    raise AssertionError("there are always more programs")


def _edit(file: Path, rng: random.Random, result: Campaign) -> None:
    texts: dict[str, str] = {}
    project, observer = Project([file], texts), Observer(lambda: None)
    snapshot = project.snapshot()
    found = checked(snapshot, None, observer)
    if any(Tree(source).has_errors for source in snapshot.sources):
        return
    kept = Kept(observer, snapshot.sources, found)
    lines = file.read_text().split("\n")
    for _ in range(EDITS_OF_A_PROGRAM):
        result.edits += 1
        at, changed = rng.randrange(len(lines)), list(lines)
        changed[at] = rng.choice(CHANGES)(changed[at])
        texts[str(file)] = "\n".join(changed)
        project.change(str(file))
        (source,) = project.sources
        shown = kept.check(source)
        if shown is None or Tree(source).has_errors:
            continue
        result.compared += 1
        expected = [d for d in checked(project.snapshot()) if d.file == str(file)]
        if any(d.severity == "error" for d in expected):
            shown = [d for d in shown if d.code not in LATER]
        if shown != expected:
            result.differences.append(
                f"{file.name}:{at + 1}: {changed[at]!r}\n  shown only: {_without(shown, expected)}\n"
                f"  not shown: {_without(expected, shown)}"
            )
            print(result.differences[-1], flush=True)


def _without(some: list[Diagnostic], others: list[Diagnostic]) -> list[tuple[int, str]]:
    return [(d.line, d.message) for d in some if d not in others]


def main() -> int:
    edits, seed = (int(text) for text in (sys.argv[1:] + ["10000", "1"][len(sys.argv) - 1 :]))
    with tempfile.TemporaryDirectory() as folder:
        result = campaign(edits, seed, Path(folder))
    print(f"{result.edits} edits, {result.compared} compared, {len(result.differences)} differ; {memory()} MB")
    return 1 if result.differences else 0


if __name__ == "__main__":
    sys.exit(main())
