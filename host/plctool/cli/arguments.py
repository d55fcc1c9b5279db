"""Arguments that several commands have, and what reads values. Imports are late, so that every start is quick."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli.parser import LINK_GROUP, Parser
from plctool.errors import UsageError
from plctool.files import file_path, usable_path
from plctool.iec.dialect import DIALECTS
from plctool.image.targets import DEFAULT_TARGET, TARGETS
from plctool.link.transports import TRANSPORTS, Value

if TYPE_CHECKING:
    from plctool.compiler import Level

DEFAULT_INTERVAL = 0.5  # seconds between two readings


# ---- programs --------------------------------------------------------------------------------------------------------


def add_build_arguments(parser: Parser) -> None:
    """Adds all that decides which image `build` makes."""
    add_sources(parser)
    parser.add_argument(
        "-o", "--output", type=file_path, metavar="IMAGE", help="default: app.cdl, of a project beside plc.toml"
    )
    add_target(parser, f"processor; default: that of the board, or {DEFAULT_TARGET}")
    add_board(parser, "whose limits the program must keep, such as mps2-an385/standard")
    add_firmware(parser, "the same for a board of your own: what runs on it")
    parser.add_argument(
        "--no-limits", action="store_true", help="build also what no device that plctool knows has room for"
    )
    parser.add_argument(
        "--base", type=usable_path, metavar="OLD.cdl",
        help="keep the places that variables have in this image or symbol file, so that the new one can replace it "
        "while it runs",
    )  # fmt: skip
    parser.add_argument("--dry-run", action="store_true", help="with --base: say what the change does, write nothing")
    add_build_options(parser)
    parser.add_argument(
        "--no-cache", action="store_true", help="compile all, also what has not changed since an earlier build"
    )
    add_passes(parser)
    add_warnings(parser)
    add_io_files(parser)


def add_target(parser: Parser, text: str) -> None:
    target = parser.add_argument("--target", metavar="NAME", help=text)
    target.completer = lambda **words: TARGETS  # type: ignore[attr-defined]  # for argcomplete


def add_firmware(parser: Parser, text: str) -> None:
    parser.add_argument("--firmware", type=usable_path, metavar="FILE.elf", help=text)


def add_board(parser: Parser, text: str) -> None:
    def names(**words: object) -> list[str]:
        from plctool.image.board import known_boards

        return [board.slug for board in known_boards()]

    parser.add_argument("--board", metavar="NAME", help=text).completer = names  # type: ignore[attr-defined]


def add_sources(parser: Parser) -> None:
    parser.add_argument(
        "sources", nargs="*", type=usable_path, metavar="FILE.st|DIR",
        help="for a folder, all sources in it; without any, the project of the current folder (plc.toml)",
    )  # fmt: skip
    parser.add_argument(
        "--library", action="append", default=[], type=usable_path, metavar="DIR|FILE.zip",
        help="a library (with library.toml), or a folder of them; may be repeated",
    )  # fmt: skip


def add_build_options(parser: Parser) -> None:
    parser.add_argument(
        "-O", dest="level", type=level, metavar="0..3|s",
        help="optimisation, 3 for the fastest code, s for the smallest, both with fewer variables of blocks to watch; "
        "default: 2",
    )  # fmt: skip
    parser.add_argument(
        "--checks",
        metavar="all|none|LIST",
        help="run-time checks: div, bounds, subrange, null; default: all",
    )
    parser.add_argument(
        "--debug", action=argparse.BooleanOptionalAction, help="optimise less, so that the code is close to its source"
    )


def add_passes(parser: Parser) -> None:
    parser.add_argument(
        "--no-pass", action="append", default=[], metavar="NAME,...",
        help="leave out passes of the code generator, to find the one that makes a difference; may be repeated",
    )  # fmt: skip
    parser.add_argument("--dump-after", metavar="NAME", help="print what this pass of the code generator leaves")


def add_image(parser: Parser, built: str = "which is built first if it has changed") -> None:
    parser.add_argument(
        "image", type=usable_path, nargs="?", metavar="IMAGE|PROJECT",
        help=f"what 'plctool build' wrote, or a project, {built}; default: the project of this folder (plc.toml)",
    )  # fmt: skip


def add_names(parser: Parser) -> None:
    parser.add_argument(
        "names", nargs="+", type=utf8, metavar="NAME", help="such as Main.lamp, Main.list[3], Main.pump.*"
    )


def add_dialect(parser: Parser) -> None:
    dialect = parser.add_argument(
        "--dialect", metavar="|".join(DIALECTS), help="the system whose rules hold where they disagree"
    )
    dialect.completer = lambda **words: DIALECTS  # type: ignore[attr-defined]


def add_warnings(parser: Parser) -> None:
    add_dialect(parser)
    parser.add_argument(
        "--no-warn",
        action="append",
        default=[],
        metavar="NAME,...",
        help="do not report these warnings or groups of them; may be repeated",
    )
    parser.add_argument("--werror", action=argparse.BooleanOptionalAction, help="treat warnings as errors")


def add_io_files(parser: Parser, device: str = "what the vendor says of the board") -> None:
    parser.add_argument(
        "--io", type=usable_path, metavar="FILE.io.toml", help="inputs and outputs; default: what is beside the sources"
    )
    parser.add_argument("--device", type=usable_path, metavar="FILE.toml", help=device)


def add_link(parser: Parser, symbols: bool = False) -> None:
    link = parser.add_argument_group(LINK_GROUP)
    for kind in TRANSPORTS.values():
        if kind.flag:
            link.add_argument(f"--{kind.flag}", metavar=kind.shape, help=kind.help)
    for name, text in option_helps().items():
        link.add_argument(f"--{name}", metavar="N", help=text)
    link.add_argument("--no-gateway", action="store_true", help="do not share the port, as with PLCTOOL_GATEWAY=off")
    link.add_argument(
        "--password-file", type=Path, metavar="FILE",
        help="first line: the device's password, if it has one; else the environment's PLC_PASSWORD, or what you type",
    )  # fmt: skip
    if symbols:
        parser.add_argument(
            "--symbols", type=usable_path, metavar="FILE.sym", help="if they are not found automatically"
        )


def option_helps() -> dict[str, str]:
    """What is said of each option of links; one that several kinds have may have a default of its own in each."""
    helps: dict[str, str] = {}
    defaults: dict[str, dict[Value, str]] = {}
    for kind in TRANSPORTS.values():
        for name, option in kind.options.items():
            helps[name] = option.help
            defaults.setdefault(name, {}).setdefault(option.default, kind.flag)
    for name, of_kinds in defaults.items():
        texts = [
            f"{value} with --{flag}" if i else f"default: {value}" for i, (value, flag) in enumerate(of_kinds.items())
        ]
        helps[name] += "; " + ", ".join(texts) if any(of_kinds) else ""
    return helps


def utf8(text: str) -> str:
    """What is no path. The bytes that the encoding of the locale does not have came as surrogates: they are UTF-8."""
    if text.isascii():
        return text
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8")
    except UnicodeError:
        shown = text.encode("ascii", "backslashreplace").decode()
        raise UsageError(f"{shown} is not UTF-8; type it in the encoding of this terminal.", "usage") from None


def count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return int(text)


def port_number(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to 65535")
    return int(text)


def duration_s(text: str) -> float:
    with suppress(ValueError):
        if 0 <= (seconds := float(text)) < 1e6:
            return seconds
    raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds")


def level(text: str) -> Level:
    if text == "s":
        return "s"
    if text not in ("0", "1", "2", "3"):
        raise argparse.ArgumentTypeError(f"'{text}' is not an optimisation level; use 0, 1, 2, 3 or s")
    return int(text)


def percent(text: str) -> float:
    return duration_s(text.removesuffix("%")) / 100


def duration_ms(text: str) -> float:
    from plctool.iec.value_texts import parse_milliseconds

    milliseconds = parse_milliseconds(text)
    if milliseconds < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is in the past")
    return milliseconds


def pairs(texts: Sequence[str]) -> dict[str, str]:
    """NAME=VALUE or NAME:=VALUE arguments."""
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().removesuffix(":").strip()
        if not equals or not name:
            raise UsageError(f"'{text}' is not NAME=VALUE; write for example Main.speed=5.", "usage")
        found[name] = value
    return found
