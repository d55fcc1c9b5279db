"""The check of words and of the length of lines that `make lint` runs finds what people read, and only that."""

from __future__ import annotations

from pathlib import Path

import pytest
from words import COLUMNS, complaints


def found(tmp_path: Path, name: str, text: str) -> list[str]:
    (tmp_path / name).write_text(text)
    return list(complaints(tmp_path / name, name))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.c", "int behind; /* one\n * behind */\n"),
        ("a.h", '#define BEHIND behind \\\n    "it is behind"\n'),
        ("a.py", 'behind = """One\nis behind."""\n'),
        ("a.py", 'a = behind\nb = f"{behind} is behind"\n'),
        ("a.py", 'a = "behind"\nb = 1  # behind\n'),
        ("a.st", "behind := 1;\n(* behind *)\n"),
        ("a.md", "`behind`\nis behind\n"),
        ("meson.build", "behind = 1\n# behind\n"),
    ],
)
def test_a_word_is_found_in_prose_and_not_in_code(tmp_path: Path, name: str, text: str) -> None:
    assert found(tmp_path, name, text) == [f"{name}:2: 'behind': write after, past the end"]


def test_long_lines_are_found_but_in_tables_and_code(tmp_path: Path) -> None:
    long = "a" * (COLUMNS + 1)
    text = f"{long}\n| {long} |\n```\n{long}\n```\n{long[1:]}\n"
    assert found(tmp_path, "a.md", text) == [f"a.md:1: {COLUMNS + 1} columns, at most {COLUMNS}"]
