"""`plctool alarms`: the alarms of a program, their history, and acknowledging them."""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import DEFAULT_INTERVAL, add_link, duration_s, utf8
from plctool.cli.connections import connect
from plctool.cli.documents import Document
from plctool.cli.output import EXIT_OK
from plctool.cli.parser import Parser
from plctool.controller_documents import alarms
from plctool.errors import DeviceError
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.debug.alarms import AlarmEvent
    from plctool.device import Plc

_TAKEN_S = 5.0  # longest wait for the program to take an acknowledgement


def alarms_arguments(command: Parser) -> None:
    what = command.add_mutually_exclusive_group()
    what.add_argument("--all", action="store_true", help="also the alarms that are normal")
    what.add_argument("--history", action="store_true", help="the changes that the device still has, also of before")
    what.add_argument(
        "--ack", nargs="+", type=utf8, metavar="NAME", help="acknowledge alarms, by name or pattern: --ack '*'"
    )
    what.add_argument("--follow", action="store_true", help="print each change when it happens, until Ctrl-C")
    command.add_argument(
        "--interval", type=duration_s, default=DEFAULT_INTERVAL, metavar="S",
        help="seconds between looks of --follow; default: 0.5",
    )  # fmt: skip
    command.json_line_for_each("change, with --follow")
    add_link(command, symbols=True)
    command.set_defaults(action=_alarms)


def _alarms(args: argparse.Namespace) -> int:
    with connect(args) as plc:
        if args.follow:
            return _follow(args, plc)
        if args.history:
            events = [_event(event) for event in plc.alarm_history().events]
            return output.show(args, {"events": events}, lambda d: "\n".join(map(_event_text, d["events"])) or "none")
        if args.ack:
            return output.show(args, _acknowledge(plc, args.ack), _acknowledged_text)
        document = alarms(plc, all=args.all)
    return output.show(args, document, _alarms_text)


def _acknowledge(plc: Plc, names: list[str]) -> Document:
    """Raises DeviceError if the program does not take it."""
    done = plc.acknowledge(names)
    end = time.monotonic() + _TAKEN_S
    while done and (left := plc.unconfirmed(done)):
        if time.monotonic() > end:
            raise DeviceError(
                f"The program has not taken the acknowledgement of {', '.join(left)}: it is stopped, or does not call "
                "the alarm.",
                "not-acknowledged",
            )
        time.sleep(0.02)
    return {"acknowledged": done}


def _acknowledged_text(document: Document) -> str:
    return "\n".join(f"{name}: acknowledged" for name in document["acknowledged"]) or "none waits"


def _follow(args: argparse.Namespace, plc: Plc) -> int:
    """The changes after the start of the command."""
    seen = plc.alarm_history().count
    with suppress(KeyboardInterrupt):
        while True:
            history = plc.alarm_history()
            new = (history.count - seen) & 0x7FFF_FFFF
            if new > len(history.events):
                output.say(f"plctool: {new - len(history.events)} changes were lost; look more often.", sys.stderr)
            for event in history.events[-new:] if new else ():
                document = _event(event)
                output.say(output.as_json(document) if args.json else _event_text(document))
            seen = history.count
            time.sleep(args.interval)
    return EXIT_OK


def _alarms_text(document: Document) -> str:
    rows = [
        {**alarm, "since": alarm["since"] or _age(alarm["age_s"]), "text": one_line(alarm["text"])}
        for alarm in document["alarms"]
    ]
    return output.table(rows, ("state", "class", "since", "name", "text")) if rows else "no alarms"


def _age(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.1f} s ago"


def _event(event: AlarmEvent) -> dict[str, Any]:
    return {
        "name": event.name,
        "before": event.before,
        "state": event.state,
        "start": event.start,
        "at": None if event.at is None else event.at.isoformat(" ", "milliseconds"),
        "time_s": None if event.at else round(event.time_s, 6),
    }


def _event_text(event: dict[str, Any]) -> str:
    when = event["at"] or f"start {event['start']}, {event['time_s']:10.3f} s"
    return f"{when}  {one_line(event['name'])}: {event['before']} -> {event['state']}"
