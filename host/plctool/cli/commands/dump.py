"""`plctool dump` and `plctool inspect`: what a controller had in memory, in a file. Arguments, actions, output."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from plctool.cli.arguments import add_link, utf8
from plctool.cli.connections import connect
from plctool.cli.output import show
from plctool.cli.parser import Parser
from plctool.files import usable_path, write_output

_DEFAULT = "plc.dump"


def dump_arguments(dump: Parser) -> None:
    dump.add_argument(
        "-o", "--output", type=usable_path, default=Path(_DEFAULT), metavar="FILE", help=f"default: {_DEFAULT}"
    )
    add_link(dump, symbols=True)
    dump.set_defaults(action=_dump)


def inspect_arguments(inspect: Parser) -> None:
    inspect.add_argument("dump", type=usable_path, metavar="FILE", help="what 'dump' wrote, or plcrt with --dump")
    inspect.add_argument(
        "names", nargs="*", type=utf8, metavar="NAME", help="variables, also patterns such as 'Main.*'"
    )
    inspect.add_argument(
        "--symbols",
        type=usable_path,
        metavar="FILE.sym",
        help="of a dump of plcrt, if they are not found automatically",
    )
    inspect.add_argument("--log", action="store_true", help="print the log of the controller as well")
    inspect.set_defaults(action=_inspect)


def _dump(args: argparse.Namespace) -> int:
    from plctool.cli.overwriting import check_no_way_out, check_output
    from plctool.dump_file import save, take_dump

    better = f"-o {_DEFAULT}"
    if str(args.output) == _DEFAULT:
        check_no_way_out(args.output, Path(), f"-o new-{_DEFAULT}")
    check_output(args.output, (), better)
    with connect(args) as plc:
        taken = take_dump(plc)
    write_output(args.output, save(taken))
    stopped = taken.explained()
    document = {
        "file": str(args.output),
        "bytes": sum(len(area.data) for area in taken.areas),
        "exception": None if stopped is None else str(stopped),
    }
    return show(args, document, lambda d: f"{d['bytes']} bytes of variables in {d['file']}")


def _inspect(args: argparse.Namespace) -> int:
    from plctool.controller_documents import exception_document
    from plctool.dump_file import load

    found = load(args.dump, args.symbols)
    stopped = found.explained()
    reading = found.sample(args.names)
    document: dict[str, Any] = {
        "device": vars(found.identity),
        "image_crc": f"{found.image_crc:08X}",
        "exception": None if stopped is None else exception_document(stopped),
        "registers": None if found.registers is None else found.registers.named(),
        "tasks": [vars(task) for task in found.tasks],
        "values": reading.values,
        "log": [vars(entry) for entry in found.log],
    }
    texts = reading.texts

    def words(document: dict[str, Any]) -> str:
        who = document["device"]
        lines = [f"device: {who['device_name']} {who['version']} ({who['node_name']}), image {document['image_crc']}"]
        lines.append("exception: none" if stopped is None else f"exception: {stopped.name}{_task(stopped.task)}")
        if stopped is not None and stopped.file:
            lines.append(
                f"  at {stopped.pou}, {stopped.file}:{stopped.line}" + (f": {stopped.detail}" if stopped.detail else "")
            )
            lines += [f"  called from {call.pou}, {call.file}:{call.line}" for call in stopped.calls]
        lines += ["registers:", *found.registers.lines()] if found.registers else []
        lines += [f"{name} = {text}" for name, text in texts.items()]
        if args.log:
            lines += [f"{e['time_ns'] / 1e9:12.6f} s  {e['component']}: {e['text']}" for e in document["log"]]
        return "\n".join(lines)

    return show(args, document, words)


def _task(name: str | None) -> str:
    return f" in task {name}" if name else ""
