"""The command line: the parser of one command, or of all of them, made of the table in `commands`."""

from __future__ import annotations

import argparse
import shutil
import textwrap
from collections.abc import Sequence
from importlib import import_module

from plctool.cli.commands import GROUPS, ROWS, Row
from plctool.cli.parser import Parser, sentence

_DESCRIPTION = "Compile IEC 61131-3 Structured Text and run it on small controllers."
_INDENT = 4
_SUMMARY_COLUMN = 16


class _Root(Parser):
    """The parser of plctool itself; its help lists the commands in groups."""

    def format_help(self) -> str:
        """Returns the usage, the commands, then the options."""
        usage, _, options = super().format_help().partition("options:")
        groups = "\n\n".join(f"{title}:\n{_rows_text(rows)}" for title, rows in GROUPS.items())
        more = "'plctool COMMAND --help' shows the arguments of a command."
        return f"{usage}{groups}\n\noptions:{options}\n{more}\n"


def _rows_text(rows: Sequence[Row]) -> str:
    width = max(40, shutil.get_terminal_size().columns - 2)  # as argparse does
    after = " " * _SUMMARY_COLUMN
    return "\n".join(
        textwrap.fill(row.summary, width, initial_indent=f"{'':{_INDENT}}{row.name}".ljust(_SUMMARY_COLUMN),
                      subsequent_indent=after)
        for row in rows
    )  # fmt: skip


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Reads the words after `plctool`. Of the commands only the one that is named is imported; `command` is its name,
    "" if there is none."""
    if words and words[0] in ROWS:
        row = ROWS[words[0]]
        parser = Parser(prog=f"plctool {row.name}", description=sentence(row.summary))
        _fill(parser, row)
        return parser.parse_args(words[1:])
    root = _root()
    root.add_argument("words", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    return root.parse_args(words)


def parser() -> Parser:
    """Returns the parser of all commands, which completion and the manual page need."""
    root = _root()
    commands = root.add_subparsers(metavar="COMMAND", prog="plctool", help=argparse.SUPPRESS, parser_class=Parser)
    for row in ROWS.values():
        _fill(commands.add_parser(row.name, help=row.summary, description=sentence(row.summary)), row)
    return root


def _root() -> _Root:
    root = _Root(prog="plctool", usage="plctool [-h] [--version] COMMAND ...", description=_DESCRIPTION)
    root.add_argument("--version", action="store_true", help="print the version and exit")
    root.set_defaults(command="")
    return root


def _fill(parser: Parser, row: Row) -> None:
    """Adds the arguments of a command."""
    parser.add_json()
    parser.set_defaults(command=row.name)
    module = import_module(f"plctool.cli.commands.{row.module}")
    getattr(module, f"{row.name.replace('-', '_')}_arguments")(parser)
