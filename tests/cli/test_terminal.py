"""What shells and terminals get: colours, completion, the manual page."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from plctool.cli import output
from plctool.cli.command_line import parser

BROKEN = "PROGRAM Main\nVAR n : INT; unused : INT; END_VAR\nn := nonsense;\nEND_PROGRAM\n"
PLAIN = re.compile("\33" + r"\[[\d;]*m")


@pytest.fixture
def broken(scratch: Path) -> str:
    (scratch / "broken.st").write_text(BROKEN)
    return "broken.st"


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if output went to a terminal."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(output, "wants_colour", lambda stream: True)


@pytest.mark.parametrize("command", ["check", "build"])
def test_diagnostics_have_colours_on_a_terminal_and_the_same_words(
    tool: Any, broken: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = tool(command, broken)
    assert "\33" not in plain.out + plain.err
    monkeypatch.setattr(output, "wants_colour", lambda stream: True)
    coloured = tool(command, broken)
    said = coloured.out + coloured.err
    assert "\33[1mbroken.st:3:6:\33[0m \33[1;31merror:\33[0m " in said
    assert "\33[1;32m     ^\33[0m\n" in said
    assert PLAIN.sub("", said) == plain.out + plain.err


def test_warnings_have_a_colour_of_their_own(tool: Any, scratch: Path, terminal: None) -> None:
    (scratch / "unused.st").write_text("PROGRAM Main VAR n : INT; END_VAR END_PROGRAM")
    assert "\33[1;35mwarning:" in tool("check", "unused.st").out


class Terminal:
    def isatty(self) -> bool:
        return True


def test_no_color_turns_colours_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert output.wants_colour(Terminal())  # type: ignore[arg-type]
    monkeypatch.setenv("TERM", "dumb")
    assert not output.wants_colour(Terminal())  # type: ignore[arg-type]
    monkeypatch.delenv("TERM")
    monkeypatch.setenv("NO_COLOR", "1")
    assert not output.wants_colour(Terminal())  # type: ignore[arg-type]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_a_script_for_the_shell(tool: Any, shell: str) -> None:
    assert "plctool" in tool("completion", shell).out


def completions(line: str, folder: Path) -> list[str]:
    """What the shell would offer after `line`, asked as its script asks."""
    answer = folder / "answer"
    environment = os.environ | {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": str(answer), "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9",
    }  # fmt: skip
    subprocess.run([sys.executable, "-m", "plctool"], env=environment, check=True, timeout=60)
    return [word.strip() for word in answer.read_text().splitlines()]


def test_commands_and_their_options_are_completed(scratch: Path) -> None:
    assert completions("plctool st", scratch) == ["status", "start", "stop"]
    assert completions("plctool reset --po", scratch) == ["--port"]
    assert "cortex-m3" in completions("plctool build --target ", scratch)


def test_the_manual_page_has_every_command_and_option(tool: Any) -> None:
    page = tool("man").out
    commands = next(a for a in parser()._actions if a.choices).choices
    for name, command in commands.items():
        section = page.partition(f".SS {name}\n".replace("-", r"\-"))[2].partition("\n.S")[0]
        for action in command._actions:
            for option in action.option_strings if action.dest != "help" else ():
                assert option.replace("-", r"\-") in section, (name, option)
    assert "PLC_LINK" in page and "plc.toml" in page
    requests = {line.split()[0] for line in page.splitlines() if line.startswith((".", "'"))}
    assert requests == {".TH", ".SH", ".SS", ".PP", ".TP", ".B"}
