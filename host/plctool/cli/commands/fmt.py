"""`plctool fmt`: one style for Structured Text."""

from __future__ import annotations

import argparse
import re
import sys
from functools import partial
from pathlib import Path

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.output import EXIT_FAILED, EXIT_OK, EXIT_USAGE
from plctool.cli.parser import Parser
from plctool.errors import UsageError, counted, listed
from plctool.files import STDIN, STDOUT, usable_path, write_output
from plctool.printable import one_line


def fmt_arguments(command: Parser) -> None:
    command.add_argument(
        "sources", nargs="*", type=_input, metavar="FILE.st|DIR|-",
        help="for a folder, all sources in it; -: from the standard input to the standard output; without any, the "
        "project of the current folder (plc.toml)",
    )  # fmt: skip
    command.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a file is not formatted")
    command.add_argument("--diff", action="store_true", help="the same, and print what would change")
    command.add_argument(
        "--lines", action="append", default=[], type=_lines, metavar="A:B",
        help="only lines A to B, from 1, of one file; may be repeated",
    )  # fmt: skip
    command.set_defaults(action=_fmt)


def _input(text: str) -> Path:
    """A path, or - for the standard input."""
    return STDIN if text == str(STDIN) else usable_path(text)


def _lines(text: str) -> tuple[int, int]:
    """The first and the last line of a range."""
    found = re.fullmatch(r"(\d{1,9}):(\d{1,9})", text, re.ASCII)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise UsageError(f"--lines {text} is not a range of lines; write for example --lines 10:20.", "usage")
    return int(found[1]), int(found[2])


def _fmt(args: argparse.Namespace) -> int:
    from plctool.cli import formatted_files
    from plctool.cli.projects import needed_project

    writes = not (args.check or args.diff)
    if STDIN in args.sources:
        if len(args.sources) > 1:
            raise UsageError("- stands alone: plctool fmt - < main.st", "usage")
        document, text = formatted_files.format_input(sys.stdin.buffer, args.lines, writes=writes)
        if writes and not args.json:
            write_output(STDOUT, text)
            return EXIT_OK
    else:
        document = formatted_files.format_files(args.sources or [needed_project()], args.lines, writes=writes)
    for message in complaints(document):
        if not args.json:
            output.say(f"plctool: {one_line(message)}", sys.stderr)
    output.show(args, document, partial(shown_text, diff=args.diff))
    if complaints(document):
        return EXIT_USAGE
    return EXIT_FAILED if not writes and document["changed"] else EXIT_OK


def complaints(document: Document) -> list[str]:
    """What to say of files that could not be formatted."""
    return [file["message"] for file in document["files"] if file["state"] == "refused"]


def shown_text(document: Document, *, diff: bool) -> str:
    """A line for each file that is not formatted, or the differences, and the counts."""
    from plctool.cli.formatted_files import CHANGED, TEXT_ONLY

    changed = [file for file in document["files"] if file["state"] in CHANGED]
    if diff:
        return "\n".join(file["diff"].rstrip("\n") for file in changed)
    lines = [f"{file['file']}: {file['state']}" for file in changed]
    texts = [file for file in document["files"] if file["state"] in (*CHANGED, "unchanged")]
    if changed:
        lines.append(f"{len(changed)} of {counted(len(texts), 'file')} {changed[0]['state']}.")
    elif texts:
        lines.append(f"{counted(len(texts), 'file')} formatted already.")
    if left := [Path(file["file"]) for file in document["files"] if file["state"] == "left"]:
        kinds = listed(sorted({path.suffix or path.name for path in left}))
        lines.append(f"{counted(len(left), 'file')} ({kinds}) left as written: {TEXT_ONLY}.")
    return "\n".join(lines)
