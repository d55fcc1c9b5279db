"""`plctool demo`, `completion`, `man`: plctool itself."""

from __future__ import annotations

import argparse
import sys
from contextlib import redirect_stdout

from plctool.cli import output
from plctool.cli.output import EXIT_OK
from plctool.cli.parser import Parser
from plctool.errors import PlcError


def demo_arguments(command: Parser) -> None:
    command.set_defaults(action=_demo)


def completion_arguments(command: Parser) -> None:
    command.add_argument("shell", choices=["bash", "zsh", "fish"], metavar="bash|zsh|fish", help="your shell")
    command.set_defaults(action=_completion)


def man_arguments(command: Parser) -> None:
    command.set_defaults(action=_man)


def _demo(args: argparse.Namespace) -> int:
    from plctool.cli import demo

    if not args.json:
        return demo.main()
    with redirect_stdout(sys.stderr):
        status = demo.main()
    if status != EXIT_OK:
        raise PlcError("The demo failed; its story on stderr says where.", "demo")
    return output.show(args, {"passed": True}, lambda d: "")


def _completion(args: argparse.Namespace) -> int:
    from argcomplete.shell_integration import shellcode

    script = shellcode(["plctool"], shell=args.shell)
    return output.show(args, {"script": script}, lambda d: script)


def _man(args: argparse.Namespace) -> int:
    from plctool.cli.command_line import parser
    from plctool.cli.manual import manual_page

    page = manual_page(parser())
    return output.show(args, {"page": page}, lambda d: page)
