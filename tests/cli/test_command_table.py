"""Each command is a row of one table and a function of one module; help, completion and the manual page follow it."""

from __future__ import annotations

import argparse
import inspect
import re
import subprocess
import sys
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import plctool.cli.commands
from plctool.cli.command_line import parser
from plctool.cli.commands import GROUPS, ROWS, Row
from plctool.cli.parser import LINK_GROUP, Parser

FOLDER = Path(plctool.cli.commands.__file__).parent
MODULES = sorted(path.stem for path in FOLDER.iterdir() if not path.stem.startswith("__"))
EVERYDAY = ("build", "check", "test", "run", "flash", "status", "read", "write", "force", "watch")
WITHOUT_LINK = ("new", "build", "check", "run", "test", "io map", "canopen scan", "gateway", "man")


def help_of(capsys: pytest.CaptureFixture[str], tool: Any, *words: str) -> str:
    with pytest.raises(SystemExit):
        tool(*words, "--help")
    return capsys.readouterr().out


def parsers() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command, and of each action such as `io map`."""
    found: dict[str, argparse.ArgumentParser] = {}

    def collect(of: argparse.ArgumentParser, before: str) -> None:
        for action in of._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, child in action.choices.items():
                    found[before + name] = child
                    collect(child, f"{before}{name} ")

    collect(parser(), "")
    return found


def test_every_command_is_in_exactly_one_group() -> None:
    names = Counter(row.name for rows in GROUPS.values() for row in rows)
    assert set(names.values()) == {1}
    assert set(names) == set(ROWS) == {name for name in parsers() if " " not in name}


@pytest.mark.parametrize("module", MODULES)
def test_every_command_of_a_module_has_its_row(module: str) -> None:
    functions = dict(inspect.getmembers(import_module(f"plctool.cli.commands.{module}"), inspect.isfunction))
    commands = {name for name, f in functions.items() if name.endswith("_arguments") and f.__module__.endswith(module)}
    assert commands == {f"{row.name.replace('-', '_')}_arguments" for row in ROWS.values() if row.module == module}
    assert commands, f"{module} has no command"


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.name)
def test_a_row_says_in_a_line_what_the_command_does(row: Row) -> None:
    assert row.module in MODULES
    assert 5 < len(row.summary) < 100
    assert row.summary[0].islower() and not row.summary.endswith(".")


@pytest.mark.parametrize("name", [name for name, of in parsers().items() if of._subparsers is None])
def test_each_command_and_each_action_names_the_function_that_runs_it(name: str) -> None:
    assert callable(parsers()[name].get_default("action"))


def test_help_shows_everyday_commands_first_and_the_others_under_headings(
    tool: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    text = help_of(capsys, tool)
    headings = re.findall(r"^(\S.*):$", text, re.MULTILINE)
    assert headings == [*GROUPS, "options"]
    assert headings[0] == "everyday commands"
    first = text.partition("everyday commands:")[2].partition("\n\n")[0]
    for name in EVERYDAY:
        assert f"\n    {name} " in first
    listed = re.findall(r"^ {4}([a-z-]+) ", text, re.MULTILINE)
    assert listed == list(ROWS)


@pytest.mark.parametrize("columns", ["20", "80", "200"])
def test_help_fits_the_terminal(
    tool: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: str
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert max(map(len, help_of(capsys, tool).splitlines())) <= max(70, int(columns))


def test_a_command_is_added_by_one_row(
    tool: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def hello_there_arguments(command: Parser) -> None:
        command.add_argument("name")
        command.set_defaults(action=lambda args: len(args.name))

    module = import_module("plctool.cli.commands.about")
    monkeypatch.setattr(module, "hello_there_arguments", hello_there_arguments, raising=False)
    row = Row("hello-there", "about", "greet")
    monkeypatch.setitem(ROWS, row.name, row)
    monkeypatch.setitem(GROUPS, "greetings", (row,))
    assert tool("hello-there", "you").status == 3
    assert "hello-there you" not in tool("hello-ther").err and "did you mean hello-there?" in tool("hello-ther").err
    assert "greetings:\n    hello-there greet\n" in help_of(capsys, tool)
    assert "Greet." in help_of(capsys, tool, "hello-there")
    assert r".SS hello\-there" in tool("man").out
    assert "hello-there" in parsers()


def test_a_command_imports_no_module_of_another() -> None:
    code = (
        "import sys; from plctool.cli.main import main; main(['completion', 'bash']);"
        "print([m for m in sys.modules if m.startswith('plctool.cli.commands.')], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "['plctool.cli.commands.about']\n"


def test_help_imports_no_command() -> None:
    code = (
        "import sys, contextlib\nfrom plctool.cli.main import main\n"
        "with contextlib.suppress(SystemExit): main(['--help'])\n"
        "print([m for m in sys.modules if m.startswith('plctool.cli.commands.')], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def options_of_links(of: argparse.ArgumentParser) -> list[tuple[list[str], str | None]]:
    groups = [group for group in of._action_groups if group.title == LINK_GROUP]
    assert len(groups) <= 1
    return [(action.option_strings, action.help) for group in groups for action in group._group_actions]


def test_options_of_links_are_the_same_for_every_command_on_a_device() -> None:
    found = {name: options_of_links(of) for name, of in parsers().items()}
    status = found["status"]
    assert ["--port"] in [names for names, _ in status] and ["--password-file"] in [names for names, _ in status]
    assert {name: options for name, options in found.items() if options and options != status} == {}
    assert [name for name in WITHOUT_LINK if found[name]] == []


@pytest.mark.parametrize("words", [("status",), ("files", "get"), ("flash",)])
def test_options_of_links_are_one_word_in_the_usage(
    tool: Any, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    usage, _, rest = help_of(capsys, tool, *words).partition("\n\n")
    assert "[link options]" in usage and "--tcp" not in usage
    assert rest.count("\nlink options:\n") == 1 and rest.count("\n  --tcp ") == 1


@pytest.mark.parametrize("words", [("--json", "io", "map"), ("io", "--json", "map"), ("io", "map", "--json")])
def test_json_is_wanted_wherever_the_option_stands_after_the_command(
    tool: Any, image: Path, words: tuple[str, ...]
) -> None:
    done = tool(*words, str(image))
    if words[0] == "--json":
        assert done.status == 2 and "Unrecognized arguments: --json" in done.json["error"]["message"]
    else:
        assert done.json == {"channels": []}


@pytest.mark.parametrize("words", [("",), ("-",), ("--",), ("--", "build"), ("-x", "build")])
def test_what_is_not_a_command_is_one_sentence(tool: Any, words: tuple[str, ...]) -> None:
    done = tool(*words)
    assert (done.status, done.out) == (2, "")
    assert done.err.startswith("plctool: ") and done.err.count("\n") == 1 and "Internal error" not in done.err


def test_the_version_is_printed_whatever_follows(tool: Any) -> None:
    assert tool("--version").out == tool("--version", "build", "x.st").out
