"""Habits of programs that people have (habits.toml), and what `plctool check` says of each; see `make habits`."""

from __future__ import annotations

import io
import json
import re
import tomllib
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from plctool.cli import main as cli

TESTS = Path(__file__).parents[1]
_REFUSED = re.compile(r"^\(\* expect-error: ", re.MULTILINE)


@dataclass(frozen=True)
class Habit:
    """`name`: letter and number. `shown_by`: programs, tests and files of tests, below tests/."""

    name: str
    habit: str
    shown_by: tuple[str, ...]

    @property
    def programs(self) -> list[str]:
        """What can be checked."""
        return [shown for shown in self.shown_by if ".py" not in shown]


@dataclass(frozen=True)
class Checked:
    """What `plctool check` says of a program."""

    status: int
    errors: tuple[str, ...]
    warnings: tuple[str, ...]
    """Their kinds."""

    def __str__(self) -> str:
        if self.errors:
            return f"refused: {self.errors[0]}"
        return f"warnings: {', '.join(self.warnings)}" if self.warnings else "clean"


def habits() -> list[Habit]:
    """All of them, in order."""
    listed = tomllib.loads((TESTS / "corpus/habits.toml").read_text())
    return [Habit(name, row["habit"], tuple(row["shown_by"])) for name, row in listed.items()]


def checked(program: str) -> Checked:
    """Runs `plctool check --json`."""
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(io.StringIO()):
        status = cli.main(["check", "--json", str(TESTS / program)])
    found = json.loads(said.getvalue())["diagnostics"]
    errors = tuple(d["message"] for d in found if d["severity"] == "error")
    return Checked(status, errors, tuple(sorted({d["code"] for d in found if d["severity"] == "warning"})))


def is_refused(program: str) -> bool:
    """Whether a program shows what is refused: by its own comments (tests/st/README.md)."""
    path = TESTS / program
    return path.is_file() and bool(_REFUSED.search(path.read_text("utf-8")))


def main() -> None:
    """Prints the table."""
    for habit in habits():
        print(f"{habit.name:4} {habit.habit}")
        for shown in habit.shown_by:
            said = str(checked(shown)) if shown in habit.programs else "tested"
            print(f"     {shown.partition('::')[2] or shown:80} {said}")


if __name__ == "__main__":
    main()
