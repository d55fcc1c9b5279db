"""Words that are not understood are answered with what is likely meant, not with a list of all commands."""

from __future__ import annotations

from typing import Any

import pytest

MEANT = [
    ("compile", "'compile' is not a command; did you mean build?"),
    ("biuld", "'biuld' is not a command; did you mean build?"),
    ("blink.st", "'blink.st' is not a command; did you mean plctool build blink.st?"),
    ("blink.cdl", "'blink.cdl' is not a command; did you mean plctool run blink.cdl?"),
    ("help", "'help' is not a command; write plctool --help."),
    ("xyzzy", "'xyzzy' is not a command; 'plctool --help' lists the commands."),
    ("--verison", "Unrecognized arguments: --verison (did you mean --version?); see 'plctool --help'."),
    ("build blink.st out.cdl", "out.cdl is not a source; to name the image that is built, write -o out.cdl."),
    ("gateway", "The following arguments are required: status|stop; see 'plctool gateway --help'."),
    ("reset", "The following arguments are required: warm|cold|origin; see 'plctool reset --help'."),
    ("test --coverage", "--coverage is followed by DIR; see 'plctool test --help'."),
    ("build -o", "--output is followed by IMAGE; see 'plctool build --help'."),
]


@pytest.mark.parametrize(("words", "message"), MEANT)
def test_words_that_are_not_understood_are_answered_with_what_was_meant(tool: Any, words: str, message: str) -> None:
    done = tool(*words.split())
    assert (done.status, done.err) == (2, f"plctool: {message}\n")


def test_help_of_watch_says_that_each_reading_is_a_document(tool: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        tool("watch", "--help")
    assert "a JSON document a line" in " ".join(capsys.readouterr().out.split())
