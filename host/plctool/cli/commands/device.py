"""`plctool status`, `start`, `log` and others: one request to a device."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_link, utf8
from plctool.cli.connections import connect, on_device
from plctool.cli.documents import Document
from plctool.cli.output import EXIT_OK, table
from plctool.cli.parser import Parser
from plctool.controller_documents import (
    LOG_CLASSES,
    follow_log,
    log,
    log_entries,
    program_document,
    status_document,
    tasks,
)

if TYPE_CHECKING:
    from plctool.device import Plc

_LOG_COLUMN = 27  # where the text of a log entry begins
_FOLLOW_S = 0.5  # between two questions for new entries


def status_arguments(command: Parser) -> None:
    add_link(command)
    command.set_defaults(action=_status)


def start_arguments(command: Parser) -> None:
    add_link(command)
    command.set_defaults(action=_start)


def stop_arguments(command: Parser) -> None:
    add_link(command)
    command.set_defaults(action=_stop)


def boot_arguments(command: Parser) -> None:
    add_link(command)
    command.set_defaults(action=_boot)


def cycle_arguments(command: Parser) -> None:
    add_link(command)
    command.set_defaults(action=_cycle)


def reset_arguments(command: Parser) -> None:
    command.add_argument(
        "option", choices=["warm", "cold", "origin"], metavar="warm|cold|origin",
        help="warm keeps RETAIN variables, cold only PERSISTENT ones, origin deletes the program",
    )  # fmt: skip
    add_link(command)
    command.set_defaults(action=_reset)


def tasks_arguments(command: Parser) -> None:
    add_link(command)
    command.set_defaults(action=_tasks)


def log_arguments(command: Parser) -> None:
    command.add_argument("--follow", action="store_true", help="go on until Ctrl-C, and show what is added")
    command.add_argument(
        "--kept", action="store_true", help="what outlasts power-off: starts, stops, exceptions, causes of resets"
    )
    command.add_argument("--clock", action="store_true", help="date and time in UTC in place of seconds, if known")
    command.add_argument(
        "--class", dest="log_class", choices=LOG_CLASSES, default=LOG_CLASSES[0], help="this class and graver ones"
    )
    command.add_argument(
        "--component", action="append", type=utf8, metavar="NAME", help="messages of this component, such as IecLog"
    )
    add_link(command)
    command.set_defaults(action=_log)


def shell_arguments(command: Parser) -> None:
    add_link(command)
    command.add_argument(
        "words", nargs="+", type=utf8, metavar="COMMAND", help="for example ?, rtsinfo, tasklist, plcload"
    )
    command.set_defaults(action=_shell)


def passwd_arguments(command: Parser) -> None:
    add_link(command)
    command.add_argument("--remove", action="store_true", help="every tool that reaches the device may use it again")
    command.add_argument(
        "--new-password-file", type=Path, metavar="FILE",
        help="its first line; else the environment's PLC_NEW_PASSWORD, or what you type",
    )  # fmt: skip
    command.set_defaults(action=_passwd)


def _status(args: argparse.Namespace) -> int:
    return on_device(args, status, status_text)


def status(plc: Plc) -> Document:
    """Returns the state of the program, with the name and version that plc.toml gave it."""
    status = plc.status()
    return status_document(status) | {
        "program": program_document(plc) if status.image_crc else None,
        "boot_project": status.boots if status.image_crc else None,
    }


def status_text(document: dict[str, Any]) -> str:
    lines = [f"state: {document['state']}"]
    if program := document.get("program"):
        lines.append(f"program: {' '.join(filter(None, program.values()))}")
    if document["image_crc"]:
        lines.append(f"image: {document['image_crc']}")
    if exception := document["exception"]:
        task = f" in task {exception['task']}" if exception["task"] else ""
        where = f"{place_text(exception)}{detail_text(exception)}{calls_text(exception)}"
        lines.append(f"exception: {exception['name']}{task}{where}")
    if document.get("boot_project") is False:
        lines.append("boot project: another one, or none; 'plctool boot' makes it this program")
    if document["forced"]:
        lines.append(f"forced: {', '.join(document['forced'])}")
    if document["forbidden"]:
        lines.append(f"forbidden by the program: {', '.join(document['forbidden'])}")
    return "\n".join(lines)


def _start(args: argparse.Namespace) -> int:
    return on_device(args, start, status_text)


def start(plc: Plc) -> Document:
    """Starts the program; the state that it leads to."""
    plc.start()
    return status(plc)


def _boot(args: argparse.Namespace) -> int:
    return on_device(args, boot, status_text)


def boot(plc: Plc) -> Document:
    """Makes the program what starts at power-up; the state."""
    plc.create_boot_project()
    return status(plc)


def _stop(args: argparse.Namespace) -> int:
    return on_device(args, stop, status_text)


def stop(plc: Plc) -> Document:
    """Stops the program; the state that it leads to."""
    plc.stop()
    return status(plc)


def _cycle(args: argparse.Namespace) -> int:
    return on_device(args, cycle, status_text)


def cycle(plc: Plc) -> Document:
    """Runs one cycle of a stopped program; the state that it leads to."""
    plc.cycle()
    return status(plc)


def _reset(args: argparse.Namespace) -> int:
    return on_device(args, lambda plc: reset(plc, args.option), status_text)


def reset(plc: Plc, option: str) -> Document:
    """Resets the program; the state that it leads to."""
    plc.reset(option)
    return status(plc)


def _tasks(args: argparse.Namespace) -> int:
    return on_device(args, tasks, tasks_text)


def tasks_text(document: dict[str, Any]) -> str:
    """A line for each task, and the load of all."""
    columns = ["name", "cycles", "last_us", "avg_us", "min_us", "max_us", "jitter_us", "overruns"]
    load = document["load_percent"]
    if load is None:
        return table(document["tasks"], columns)
    return f"{table(document['tasks'], [*columns, 'load_percent'])}\nload of all tasks: {load} %"


def _log(args: argparse.Namespace) -> int:
    wanted = _wanted(args)
    text = partial(log_text, clock=args.clock or args.kept)
    if not args.follow:
        return on_device(args, lambda plc: {"entries": [*filter(wanted, log(plc, kept=args.kept)["entries"])]}, text)
    with connect(args) as plc, suppress(KeyboardInterrupt):
        for entries in follow_log(plc, kept=args.kept):
            for entry in filter(wanted, log_entries(plc, entries)):
                output.say(output.as_json(entry) if args.json else text({"entries": [entry]}))
            time.sleep(_FOLLOW_S)
    return EXIT_OK


def _wanted(args: argparse.Namespace) -> Callable[[Document], bool]:
    """True for entries of the classes and components that are asked for, and of classes that plctool does not know."""
    others = LOG_CLASSES[: LOG_CLASSES.index(args.log_class)]
    components = [name.casefold() for name in args.component or ()]
    return lambda entry: (
        entry["class"] not in others and (not components or entry["component"].casefold() in components)
    )


def log_text(document: dict[str, Any], clock: bool = False) -> str:
    """A line for each entry; `clock`: with date and time where they are known."""
    return "\n".join(
        f"{_start_text(e)}{_moment_text(e, clock)}  {e['class']:<9}  {e['component']}: {e['text']}{place_text(e)}"
        f"{detail_text(e)}{calls_text(e, _LOG_COLUMN)}"
        for e in document["entries"]
    )


def _start_text(entry: dict[str, Any]) -> str:
    """Which power-up an entry of the kept log is of."""
    return f"start {entry['start']:<5}" if "start" in entry else ""


def _moment_text(entry: dict[str, Any], clock: bool) -> str:
    return f"{entry['utc']:>23}" if clock and entry["utc"] else f"{entry['time_s']:{21 if clock else 12}.6f} s"


def place_text(place: dict[str, Any]) -> str:
    """`, Main, main.st:12` for what has a source line, else nothing."""
    return f", {place['pou']}, {place['file']}:{place['line']}" if place.get("file") else ""


def detail_text(place: dict[str, Any]) -> str:
    """What is known of an exception besides its location."""
    return f": {place['detail']}" if place.get("detail") else ""


def calls_text(place: dict[str, Any], column: int = 2) -> str:
    """A line for each call that led to a location, indented to a column."""
    return "".join(
        f"\n{'':{column}}called from {call['pou']}, {call['file']}:{call['line']}" for call in place.get("calls", [])
    )


def _shell(args: argparse.Namespace) -> int:
    return on_device(args, lambda plc: shell(plc, " ".join(args.words)), lambda d: str(d["answer"]))


def shell(plc: Plc, command: str) -> Document:
    """What the device's PLC shell answers."""
    return {"command": command, "answer": plc.shell(command)}


def _passwd(args: argparse.Namespace) -> int:
    from plctool.cli.passwords import new_password

    def change(plc: Plc) -> Document:
        plc.raw_status()  # asks for the present one first
        return passwd(plc, None if args.remove else new_password(args.new_password_file))

    return on_device(
        args, change, lambda d: "The password is set." if d["password"] else "The device has no password now."
    )


def passwd(plc: Plc, password: str | None) -> Document:
    """Sets or removes the password; whether there is one now."""
    plc.set_password(password)
    return {"password": password is not None}
