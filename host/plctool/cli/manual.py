"""The manual page, made from the parser of the command line, so that it always says what the command does."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator

from plctool.cli.commands import GROUPS
from plctool.cli.links import VARIABLE
from plctool.link import mdns
from plctool.project import PROJECT_FILE
from plctool.version import plctool_version

_ENVIRONMENT = {
    VARIABLE: "the link of commands that name none, such as serial:/dev/ttyS0?baud=9600 or tcp:192.168.1.5",
    "PLCTOOL_GATEWAY": "off: no gateway shares a serial line among tools",
    mdns.VARIABLE: "the address of this machine on whose network scan looks for controllers; off: on none",
    "PLCTOOL_DEBUG": "1: an internal error shows its traceback",
    "NO_COLOR": "if set, diagnostics have no colours on a terminal either",
}
_FILES = {
    PROJECT_FILE: "the project of this folder or of one above: sources, target, options, which build, check, test and "
    f"run take when no sources are named, and the link when {VARIABLE} is not set",
}
_EXIT_STATUS = {
    "0": "success",
    "1": "the device or the program said no",
    "2": "wrong use or bad input",
    "3": "the link was lost or nothing answered",
    "130": "interrupted by Ctrl-C; 0 of watch --json",
}


def manual_page(parser: argparse.ArgumentParser) -> str:
    """In the language of man(7)."""
    return "\n".join(_lines(parser)) + "\n"


def _lines(parser: argparse.ArgumentParser) -> Iterator[str]:
    description = parser.description or ""
    yield f'.TH PLCTOOL 1 "" "plctool {plctool_version()}" "User Commands"'
    yield from (".SH NAME", _text(f"plctool - {description[:1].lower()}{description[1:].rstrip('.')}"))
    yield from (".SH SYNOPSIS", ".B plctool", r"\fICOMMAND\fR [\fIOPTION\fR]...")
    commands = _commands(parser)
    for title, rows in GROUPS.items():
        yield f".SH {_text(title.upper())}"
        for row in rows:
            yield from _command_lines(row.name, commands[row.name])
    for title, entries in (("ENVIRONMENT", _ENVIRONMENT), ("FILES", _FILES), ("EXIT STATUS", _EXIT_STATUS)):
        yield f".SH {title}"
        for name, text in entries.items():
            yield from (".TP", f".B {_text(name)}", _text(text))


def _commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    group = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(group.choices)


def _command_lines(name: str, command: argparse.ArgumentParser) -> Iterator[str]:
    usage = " ".join(command.format_usage().removeprefix("usage: ").split())
    yield from (f".SS {_text(name)}", _text(command.description or ""), ".PP", _text(usage))
    for action in _shown(command._actions):
        yield from (".TP", f".B {_text(_head(action))}", _text(action.help or ""))


def _shown(actions: Iterable[argparse.Action]) -> Iterator[argparse.Action]:
    return (a for a in actions if a.help != argparse.SUPPRESS and not isinstance(a, argparse._HelpAction))


def _head(action: argparse.Action) -> str:
    """`-o, --output IMAGE`, or the name of what has a place of its own."""
    if action.nargs == 0:
        return ", ".join(action.option_strings)
    value = action.metavar or ("|".join(map(str, action.choices)) if action.choices else action.dest)
    return " ".join([", ".join(action.option_strings), str(value)]).strip()


def _text(text: str) -> str:
    """As running text: nothing in it is a request or an escape of the formatter."""
    escaped = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped.startswith((".", "'")) else escaped
