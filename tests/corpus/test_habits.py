"""Each habit of programs that people have is shown by a program or a test, and `plctool check` says what it should."""

from __future__ import annotations

import re

import pytest
from habits import TESTS, Habit, checked, habits, is_refused

HABITS = habits()
SHOWN = sorted({shown for habit in HABITS for shown in habit.shown_by})
PROGRAMS = sorted({program for habit in HABITS for program in habit.programs})


@pytest.mark.parametrize("habit", HABITS, ids=lambda habit: habit.name)
def test_each_habit_is_shown_by_something(habit: Habit) -> None:
    assert habit.habit
    assert habit.shown_by


@pytest.mark.parametrize(("letter", "last"), [("A", 17), ("B", 27), ("C", 7), ("D", 4)])
def test_no_habit_is_missing(letter: str, last: int) -> None:
    assert [h.name for h in HABITS if h.name[0] == letter] == [f"{letter}{number}" for number in range(1, last + 1)]


@pytest.mark.parametrize("shown", SHOWN)
def test_what_shows_a_habit_is_there(shown: str) -> None:
    file, _, test = shown.partition("::")
    assert (TESTS / file).exists()
    if test:
        assert re.search(rf"^def {test}\(", (TESTS / file).read_text(), re.MULTILINE)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_is_refused_where_it_should_be_and_nowhere_else(program: str) -> None:
    found = checked(program)
    assert (found.status, bool(found.errors)) == ((2, True) if is_refused(program) else (0, False)), found.errors


@pytest.mark.parametrize("program", [p for p in PROGRAMS if p.endswith(".st")])
def test_a_program_says_what_must_come_out(program: str) -> None:
    """That it compiles is not enough: it has values, an exception or an error, or asserts them itself."""
    text = (TESTS / program).read_text("utf-8")
    assert re.search(r"^\(\* expect(-error|-exception)?: |\bASSERT_\w+\(", text, re.MULTILINE)
