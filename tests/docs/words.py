"""Words that CONTRIBUTING.md ("Words") rules out, and lines of Markdown that are too long: `make lint` runs this.

It reads what people read (`prose.py`), not code. An exception is a file and the words it may have, with the reason.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import prose

COLUMNS = 120

# What not to write, and what to write instead.
BANNED = {
    r"behind": "after, past the end",
    r"diagnos[ei]s": "diagnostic",
    r"texts": "strings, messages",
    r"anew|afresh": "again",
    r"told": "shown, reported",
    r"nobody|somebody|someone|everybody|anybody|whoever|whomever": "the component's name; users",
    r"he|she|his|him": "the component's name; the user",
    r"held up|holds up": "waits, is delayed",
    r"brok(?:en|e) (?:off|out of)|breaks (?:off|out of)": "aborted",
    r"(?:the|an?) \w+ that is none|is no such thing|that are none": "not a valid ...",
    r"the (?:one|ones) before(?! the)": "the previous one",
    r"of a folder all": "for a folder, all",
    r"by (?:itself|themselves) found|found by (?:itself|themselves)": "found automatically",
}
_PATTERN = re.compile("|".join(rf"(?P<w{i}>\b(?:{words})\b)" for i, words in enumerate(BANNED)), re.IGNORECASE)
_INSTEAD = list(BANNED.values())

# The glossary names the words; a changelog is history.
EXEMPT = {"CONTRIBUTING.md", "CHANGELOG.md", "tests/docs/words.py", "tests/docs/test_words.py"}
# The name of a user that clients send.
ALLOWED = {"firmware/src/comm/CmpDevice.c": {"nobody"}}


def banned(words: str) -> Iterator[tuple[str, str]]:
    """Each banned word in a line, and what to write instead."""
    for found in _PATTERN.finditer(words):
        yield found.group(), _INSTEAD[int((found.lastgroup or "w0")[1:])]


def complaints(path: Path, name: str) -> Iterator[str]:
    """What is wrong in a file, with the line."""
    if name not in EXEMPT:
        for number, words in prose.lines(path):
            for word, instead in banned(words):
                if word.lower() not in ALLOWED.get(name, set()):
                    yield f"{name}:{number}: '{word}': write {instead}"
    if path.suffix == ".md":
        for number, line in prose.outside_code(path.read_text(encoding="utf-8")):
            if len(line) > COLUMNS and not line.lstrip().startswith("|"):
                yield f"{name}:{number}: {len(line)} columns, at most {COLUMNS}"


def main() -> int:
    wrong = [text for name in prose.project_files() for text in complaints(prose.ROOT / name, name)]
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
