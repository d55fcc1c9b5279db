"""The files of the project, and the words in them that people read: comments, docstrings, messages, text of Markdown.

Code is left out: names in it follow other rules than English.
"""

import io
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path

Line = tuple[int, str]

ROOT = Path(__file__).parents[2]


def project_files() -> list[str]:
    """Paths from ROOT: what git knows; in a copy without git all but hidden files and what was built."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        return [name for name in listed.splitlines() if (ROOT / name).is_file()]
    found = (path.relative_to(ROOT) for path in ROOT.rglob("*") if path.is_file())
    return sorted(str(path) for path in found if not re.match(r"\.|build|.*(/\.|__pycache__)", str(path)))


# In C and Structured Text: a comment, or a string (of which only the content is read).
_C = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)
_ST = re.compile(r"\(\*.*?\*\)|/\*.*?\*/|//[^\n]*|'(?:\$.|[^'$\n])*'|\"(?:\$.|[^\"$\n])*\"", re.DOTALL)
_FENCE = re.compile(r"\s*(```|~~~)")
# In an f-string (before Python 3.12 it is one token): an expression.
_FIELD = re.compile(r"\{[^{}\n]*\}")
_CODE = re.compile(r"(`+)[^`]+\1")


def _matches(pattern: re.Pattern[str], source: str) -> Iterator[Line]:
    for found in pattern.finditer(source):
        first = source.count("\n", 0, found.start()) + 1
        yield from enumerate(found.group().split("\n"), first)


def _python(source: str) -> Iterator[Line]:
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        kind = tokenize.tok_name[token.type]
        if kind in ("COMMENT", "FSTRING_MIDDLE") or (kind == "STRING" and " " in token.string):
            words = _FIELD.sub("", token.string) if token.string.startswith("f") else token.string
            yield from enumerate(words.split("\n"), token.start[0])


def _hash_comments(source: str) -> Iterator[Line]:
    for number, line in enumerate(source.split("\n"), 1):
        _, mark, comment = line.partition("#")
        if mark:
            yield number, comment


def outside_code(source: str) -> Iterator[Line]:
    """The lines of Markdown that are not in a code block."""
    inside = False
    for number, line in enumerate(source.split("\n"), 1):
        if _FENCE.match(line):
            inside = not inside
        elif not inside:
            yield number, line


def _markdown(source: str) -> Iterator[Line]:
    return ((number, _CODE.sub("`", line)) for number, line in outside_code(source))


_READERS = {
    ".c": lambda source: _matches(_C, source),
    ".h": lambda source: _matches(_C, source),
    ".st": lambda source: _matches(_ST, source),
    ".py": _python,
    ".md": _markdown,
    ".build": _hash_comments,
    ".options": _hash_comments,
    ".toml": _hash_comments,
    ".ini": _hash_comments,
    ".sh": _hash_comments,
    "Makefile": _hash_comments,
}


def lines(path: Path) -> Iterator[Line]:
    """Line number and words of each line of prose in a file; nothing for a kind of file that has none."""
    reader = _READERS.get(path.suffix or path.name)
    if reader is not None:
        yield from reader(path.read_text(encoding="utf-8"))
