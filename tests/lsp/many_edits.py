"""Random edits of a project and of random programs in a running server: what the server shows, and its memory.

`python tests/lsp/many_edits.py [EDITS [SEED]]`, with the environment of the tests, compares the diagnostics with those
of a fresh check after each edit, and prints the server's memory. `make edits` runs it after `random_edits.py`.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import editor as sessions
from conftest import FILES
from editor import Editor
from random_edits import CHANGES, programs
from test_diagnostics import as_expected, fresh

from plctool.lsp.checks import checked
from plctool.lsp.project import Project

MOST_MEMORY = 300  # MB
EDITS_OF_A_PROGRAM = 10
SHOWN_EVERY = 500  # edits
PATIENCE = 600.0  # seconds for an answer: nothing is wrong with a server that gets no processor


def memory(editor: Editor) -> int:
    """The megabytes that the server has in memory."""
    status = Path(f"/proc/{editor.process.pid}/status").read_text()
    return next(int(line.split()[1]) // 1024 for line in status.split("\n") if line.startswith("VmRSS"))


@contextmanager
def session() -> Iterator[tuple[Path, Editor]]:
    """A server that works on a project."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "project"
        for file, text in FILES.items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text)
        with Editor(folder) as editor:
            yield folder, editor


def changed(text: str, rng: random.Random) -> str:
    """The text with one line changed."""
    lines = text.split("\n")
    at = rng.randrange(len(lines))
    lines[at] = rng.choice(CHANGES)(lines[at])
    return "\n".join(lines)


def edit_project(folder: Path, editor: Editor, rng: random.Random) -> None:
    """Changes one or two files of the project, and waits until the diagnostics of all are those of a fresh check."""
    names = [name for name in FILES if name.endswith(".st")]
    for name in rng.sample(names, rng.randint(1, 2)):
        base = FILES[name] if rng.random() < 0.3 else editor.texts[name]
        editor.type(name, changed(base, rng))
    expected, broken = fresh(folder, {name: editor.texts[name] for name in names})
    editor.wait(lambda: as_expected(editor, expected, broken), f"the diagnostics are {expected}")


def edit_program(file: Path, editor: Editor, rng: random.Random) -> None:
    """Opens a file outside of the project, changes it a few times, and closes it."""
    name, text = f"../{file.name}", file.read_text()
    uri = editor.uri(name)
    editor.open(name)
    for _ in range(EDITS_OF_A_PROGRAM):
        editor.type(name, changed(text, rng))
        texts = {str(file): editor.texts[name]}
        messages = [d.message for d in checked(Project([file], texts).snapshot()) if d.severity == "error"]
        editor.wait(lambda m=messages, u=uri: errors(editor, u) == m, f"the errors of {name} are {messages}")
    editor.shut(name)


def errors(editor: Editor, uri: str) -> list[str]:
    """The errors that the server shows of a file."""
    return [d["message"] for d in editor.diagnostics.get(uri, ()) if d["severity"] == 1]


def many_edits(edits: int, seed: int) -> int:
    """Makes so many edits. Returns the server's memory in MB."""
    rng = random.Random(seed)
    with session() as (folder, editor):
        for name in FILES:
            editor.open(name)
        others = programs(rng, folder.parent)
        for n in range(edits):
            if n % (2 * EDITS_OF_A_PROGRAM) == 0:
                edit_program(next(others), editor, rng)
            edit_project(folder, editor, rng)
            if n % SHOWN_EVERY == 0:
                print(f"{n} edits of the project, {memory(editor)} MB", flush=True)
        return memory(editor)


def main() -> int:
    edits, seed = (int(text) for text in (sys.argv[1:] + ["10000", "1"][len(sys.argv) - 1 :]))
    sessions.WAIT = PATIENCE
    most = many_edits(edits, seed)
    print(f"{edits} edits of the project, and about half as many of other programs; {most} MB")
    return 1 if most > MOST_MEMORY else 0


if __name__ == "__main__":
    sys.exit(main())
