"""`plctool port-check`: whether a port does what programs expect."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import add_link, percent
from plctool.cli.connections import connect
from plctool.cli.documents import Document
from plctool.cli.links import link_of
from plctool.cli.output import EXIT_FAILED, EXIT_OK
from plctool.cli.parser import Parser
from plctool.files import usable_path
from plctool.link.transports import Link
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.device import Plc
    from plctool.port_check import Outcome
    from plctool.port_check import Report as PortReport


def port_check_arguments(command: Parser) -> None:
    command.add_argument("--yes", action="store_true", help="replace the program that is on the board")
    command.add_argument("--power-cycle", action="store_true", help="also ask for the board to be switched off and on")
    command.add_argument(
        "--max-drift", type=percent, default=0.01, metavar="PERCENT",
        help="largest error of its clock; default: 1; a simulated board on a busy host needs more",
    )  # fmt: skip
    command.add_argument(
        "--wire", action="append", default=[], metavar="OUTPUT=INPUT",
        help="lines of the board that are wired: the input has to follow the output; may be given several times",
    )  # fmt: skip
    command.add_argument("--device", type=usable_path, metavar="FILE.toml", help="names of its lines, and its modules")
    add_link(command)
    command.set_defaults(action=_port_check)


def _port_check(args: argparse.Namespace) -> int:
    from plctool.port_check import outcome_text, summary_text

    def power_cycle() -> None:
        output.say("Switch the board off and on, then press Enter.", sys.stderr)
        sys.stdin.readline()

    document, report = port_check(
        lambda: connect(args),
        link=link_of(args),
        replace=args.yes,
        max_drift=args.max_drift,
        power_cycle=power_cycle if args.power_cycle else None,
        wires=args.wire,
        device=args.device,
        show=lambda outcome: None if args.json else output.say(one_line(outcome_text(outcome))),
    )
    output.show(args, document, lambda d: summary_text(report))
    return EXIT_FAILED if document["failed"] else EXIT_OK


def port_check(
    connect: Callable[[], Plc],
    *,
    link: Link,
    replace: bool,
    max_drift: float,
    power_cycle: Callable[[], None] | None,
    wires: Sequence[str],
    device: Path | None,
    show: Callable[[Outcome], None],
) -> tuple[Document, PortReport]:
    """Checks a port; see `port_check.run_port_check`."""
    from plctool.port_check import parse_wire, run_port_check

    report = run_port_check(
        connect, link=link, replace=replace, max_drift=max_drift, power_cycle=power_cycle,
        wires=[parse_wire(wire) for wire in wires], device=device, show=show,
    )  # fmt: skip
    return report.document(), report
