"""The command `plctool`: reads the arguments, runs the command, reports errors, and returns the exit status."""

from __future__ import annotations

import errno
import io
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any

from plctool.cli import output
from plctool.cli.command_line import parse, parser
from plctool.cli.commands import ROWS
from plctool.cli.documents import diagnostic_document
from plctool.cli.output import EXIT_OK
from plctool.cli.unknown_commands import check_command
from plctool.controller_documents import exception_document
from plctool.errors import EXIT_INTERRUPTED, InternalError, PlcError, UsageError
from plctool.files import path_error
from plctool.printable import one_line
from plctool.version import plctool_version

EXIT_BROKEN_PIPE = 141


def _command(words: Sequence[str]) -> int:
    if words and not words[0].startswith("-"):
        check_command(words[0], ROWS)
    args = parse(words)
    if args.command:
        status: int = args.action(args)
        return status
    if not args.version:
        raise UsageError("Say what to do; 'plctool --help' lists the commands.", "usage")
    output.say(f"plctool {plctool_version()}")
    return EXIT_OK


def _report(error: PlcError, as_json: bool) -> int:
    if as_json:
        document: dict[str, Any] = {"error": {"code": error.code, "message": error.message}}
        if diagnostics := getattr(error, "diagnostics", None):
            document["diagnostics"] = [diagnostic_document(d) for d in diagnostics]
        if exception := getattr(error, "exception", None):
            document["exception"] = exception_document(exception)
        output.say(output.as_json(document))
    else:
        is_compilers = hasattr(error, "diagnostics")  # these begin with their location
        text = error.message if is_compilers else f"plctool: {one_line(error.message)}"
        output.say(text, sys.stderr, colours=is_compilers)
    return error.exit_code


def _internal_error(error: Exception, as_json: bool) -> int:
    if os.environ.get("PLCTOOL_DEBUG"):
        output.say(traceback.format_exc(), sys.stderr)
    return _report(error if isinstance(error, InternalError) else InternalError(error), as_json)


def _show_every_character() -> None:
    """A character that the terminal or pipe cannot show becomes an escape, like `\\u65e5`, and is not an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")


def _complete() -> None:
    """The shell asks what may come next on the command line; ends the process."""
    import argcomplete

    argcomplete.autocomplete(parser())


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status of the process."""
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    words = list(sys.argv[1:] if arguments is None else arguments)
    as_json = "--json" in words
    _show_every_character()
    try:
        status = _run_reported(words, as_json)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        _close_output()
        return EXIT_BROKEN_PIPE
    except OSError as error:
        _close_output()
        return _report(UsageError(f"The output cannot be written: {error.strerror}.", "output"), as_json=False)


def _close_output() -> None:
    """The reader of the output has closed it, or there is no room: nothing more may be written, not even at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run_reported(words: Sequence[str], as_json: bool) -> int:
    try:
        return _command(words)
    except InternalError as error:
        return _internal_error(error, as_json)
    except PlcError as error:
        return _report(error, as_json)
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        raise
    except OSError as error:
        if error.filename is not None:
            return _report(path_error(error), as_json)
        if error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
            raise  # only the output has no name
        return _internal_error(error, as_json)
    except Exception as error:
        return _internal_error(error, as_json)
