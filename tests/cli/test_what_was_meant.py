"""Words that are not understood are answered with what is likely meant, not with a list of all commands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool.cli.commands.source import source_text

MEANT = [
    ("compile", "'compile' is not a command; did you mean build?"),
    ("biuld", "'biuld' is not a command; did you mean build?"),
    ("blink.st", "'blink.st' is not a command; did you mean plctool build blink.st?"),
    ("blink.cdl", "'blink.cdl' is not a command; did you mean plctool run blink.cdl?"),
    ("help", "'help' is not a command; write plctool --help."),
    ("xyzzy", "'xyzzy' is not a command; 'plctool --help' lists the commands."),
    ("--verison", "Unrecognized arguments: --verison (did you mean --version?); see 'plctool --help'."),
    ("status x", "Unrecognized arguments: x; see 'plctool status --help'."),
    ("read Main.n --xyzzy", "Unrecognized arguments: --xyzzy; see 'plctool read --help'."),
    (
        "watch Main.n --intreval 1",
        "Unrecognized arguments: --intreval 1 (did you mean --interval?); see 'plctool watch --help'.",
    ),
    ("files list x", "Unrecognized arguments: x; see 'plctool files list --help'."),
    ("build blink.st out.cdl", "out.cdl is not a source; to name the image that is built, write -o out.cdl."),
    ("gateway", "The following arguments are required: status|stop; see 'plctool gateway --help'."),
    ("reset", "The following arguments are required: warm|cold|origin; see 'plctool reset --help'."),
    ("test --coverage", "--coverage is followed by DIR; see 'plctool test --help'."),
    ("build -o", "--output is followed by IMAGE; see 'plctool build --help'."),
]


@pytest.mark.parametrize("words", [("my plant.st",), ("my plant.cdl",), ("info", "my plant")])
def test_what_is_to_be_typed_is_quoted_for_the_shell(tool: Any, scratch: Path, words: tuple[str, ...]) -> None:
    (scratch / "my plant").mkdir()
    assert " 'my plant" in tool(*words).err.rpartition("plctool")[2]


def test_the_command_that_makes_the_same_image_is_quoted() -> None:
    document = {"folder": "source", "files": ["a"], "build": ["my plant/main.st", "-O2"]}
    assert source_text(document).endswith("plctool build 'my plant/main.st' -O2")


@pytest.mark.parametrize(("words", "message"), MEANT)
def test_words_that_are_not_understood_are_answered_with_what_was_meant(tool: Any, words: str, message: str) -> None:
    done = tool(*words.split())
    assert (done.status, done.err) == (2, f"plctool: {message}\n")


def test_help_of_watch_says_that_each_reading_is_a_document(tool: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        tool("watch", "--help")
    assert "a JSON document a line" in " ".join(capsys.readouterr().out.split())
