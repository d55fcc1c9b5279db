"""`plctool read`, `write`, `force`, `watch` and others: the values of variables."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from plctool.cli import output
from plctool.cli.arguments import DEFAULT_INTERVAL, add_link, add_names, count, duration_s, pairs, utf8
from plctool.cli.connections import connect
from plctool.cli.documents import Document, Texts
from plctool.cli.output import EXIT_OK, values_text
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import STDOUT, usable_path
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.controller import Controller
    from plctool.device import Plc


def read_arguments(command: Parser) -> None:
    add_names(command)
    add_link(command, symbols=True)
    command.set_defaults(action=_read)


def write_arguments(command: Parser) -> None:
    command.add_argument(
        "values", nargs="+", type=utf8, metavar="NAME=VALUE", help="value as 'read' shows it: Main.pause=T#2s"
    )
    add_link(command, symbols=True)
    command.set_defaults(action=_write)


def force_arguments(command: Parser) -> None:
    command.add_argument(
        "values",
        nargs="+",
        type=utf8,
        metavar="NAME=VALUE",
        help="value as 'read' shows it: Main.pause=T#2s, %%IX0.3=1",
    )
    add_link(command, symbols=True)
    command.set_defaults(action=_force)


def unforce_arguments(command: Parser) -> None:
    command.add_argument(
        "names", nargs="*", type=utf8, metavar="NAME", help="a variable, as 'force' or 'forced' names it"
    )
    command.add_argument("--all", action="store_true", help="all that is forced")
    add_link(command, symbols=True)
    command.set_defaults(action=_unforce)


def forced_arguments(command: Parser) -> None:
    add_link(command, symbols=True)
    command.set_defaults(action=_forced)


def watch_arguments(command: Parser) -> None:
    add_names(command)
    command.json_line_for_each("reading")
    command.add_argument(
        "--interval", type=duration_s, default=DEFAULT_INTERVAL, metavar="S", help="seconds; default: 0.5"
    )
    command.add_argument("--count", type=count, metavar="N", help="readings; default: until Ctrl-C")
    command.add_argument(
        "--csv", type=usable_path, metavar="FILE", help="write a line a reading to this file, - for the standard output"
    )
    add_link(command, symbols=True)
    command.set_defaults(action=_watch)


def _read(args: argparse.Namespace) -> int:
    with connect(args) as plc:
        document, texts = read(plc, args.names)
    if not (document["consistent"] or args.json):
        output.say("plctool: a task ran during the read; the values may come from different cycles.", sys.stderr)
    return output.show(args, document, lambda d: values_text(texts))


def read(plc: Controller, names: Sequence[str]) -> tuple[Document, Texts]:
    """The values of variables, and how ST writes them."""
    reading = plc.sample(names)
    document = {"values": reading.values, "consistent": reading.consistent, "forced": reading.forced}
    return document, reading.marked_texts


def _write(args: argparse.Namespace) -> int:
    with connect(args) as plc:
        document, texts = write(plc, pairs(args.values))
    return output.show(args, document, lambda d: values_text(texts))


def write(plc: Controller, texts: Mapping[str, str]) -> tuple[Document, Texts]:
    """Writes values as typed and reads them back."""
    table = plc.symbols()
    plc.write({name: table.resolve(name).parse(text) for name, text in texts.items()})
    return _read_back(plc, list(texts))


def _read_back(plc: Controller, names: Sequence[str]) -> tuple[Document, Texts]:
    reading = plc.sample(names)
    return {"values": reading.values, "forced": reading.forced}, reading.marked_texts


def _force(args: argparse.Namespace) -> int:
    with connect(args) as plc:
        document, texts = force(plc, pairs(args.values))
    return output.show(args, document, lambda d: values_text(texts))


def force(plc: Controller, texts: Mapping[str, str]) -> tuple[Document, Texts]:
    """Forces values as typed and reads them back."""
    table = plc.symbols()
    plc.force({name: table.resolve(name).parse(text) for name, text in texts.items()})
    return _read_back(plc, list(texts))


def _unforce(args: argparse.Namespace) -> int:
    if bool(args.names) == args.all:
        raise UsageError("Name what is not to be forced any more, or write --all; 'plctool forced' shows it.", "usage")
    with connect(args) as plc:
        document, texts = unforce(plc, args.names)
    return output.show(args, document, lambda d: unforced_text(d, texts))


def unforce(plc: Controller, names: Sequence[str]) -> tuple[Document, Texts]:
    """Ends the force of these variables, and reads them; of all without names."""
    if names:
        plc.unforce(names)
        return _read_back(plc, names)
    were = list(plc.forced())
    plc.unforce()
    return {"values": {}, "forced": [], "unforced": were}, {}


def unforced_text(document: dict[str, Any], texts: dict[str, str]) -> str:
    """The values that variables have without force, or how many are forced no more."""
    if texts:
        return values_text(texts)
    names = document["unforced"]
    return f"{', '.join(names)}: not forced any more" if names else "nothing was forced"


def _forced(args: argparse.Namespace) -> int:
    with connect(args) as plc:
        document, texts = forced(plc)
    return output.show(args, document, lambda d: forced_text(texts))


def forced(plc: Controller) -> tuple[Document, Texts]:
    """What is forced."""
    reading = plc.forced_reading()
    return {"values": reading.values, "forced": reading.forced}, reading.texts


def forced_text(texts: dict[str, str]) -> str:
    return values_text(texts) or "nothing is forced"


def _watch(args: argparse.Namespace) -> int:
    if args.csv is not None:
        return _watch_csv(args)
    if args.json:
        return _watch_json(args)
    if sys.stdout.isatty():
        return _watch_live(args)
    with connect(args) as plc:
        for sample, texts in _samples(args, plc, _say_waiting):
            output.say(f"{sample['time_s']:8.3f} s  {values_text(texts, '  ')}")
    return EXIT_OK


def _samples(
    args: argparse.Namespace, plc: Plc, waiting: Callable[[str], None]
) -> Iterator[tuple[Document, dict[str, str]]]:
    return watch(plc, args.names, args.interval, args.count, waiting)


def _say_waiting(reason: str) -> None:
    output.say(f"plctool: {one_line(reason)}", sys.stderr)


def _watch_json(args: argparse.Namespace) -> int:
    """A document a line, each at once, until the count is reached or Ctrl-C."""
    with connect(args) as plc, suppress(KeyboardInterrupt):
        for sample, _ in _samples(args, plc, _say_waiting):
            output.say(output.as_json(sample))
    return EXIT_OK


def _watch_csv(args: argparse.Namespace) -> int:
    """A line a reading, each at once, until the count is reached or Ctrl-C."""
    from plctool.cli.overwriting import check_output

    if args.json:
        raise UsageError("--csv and --json are two formats; choose one.", "usage")
    check_output(args.csv, (), "--csv values.csv")
    with connect(args) as plc, _written(args.csv) as file, suppress(KeyboardInterrupt):
        for line in watch_csv(plc, args.names, args.interval, args.count, _say_waiting):
            file.write(line)
            file.flush()
    return EXIT_OK


def _written(path: Path) -> AbstractContextManager[TextIO]:
    """Opens a file that grows while the command runs, or the standard output."""
    return nullcontext(sys.stdout) if path == STDOUT else path.open("w", encoding="utf-8")


def _watch_live(args: argparse.Namespace) -> int:
    from plctool.cli.live_table import LiveTable

    with connect(args) as plc, LiveTable().shown() as table:
        for sample, texts in _samples(args, plc, lambda reason: table.say(f"plctool: {one_line(reason)}")):
            table.show(sample["time_s"], texts)
    return EXIT_OK


def watch(
    plc: Plc, names: Sequence[str], interval: float, count: int | None, waiting: Callable[[str], None]
) -> Iterator[tuple[Document, Texts]]:
    """Readings, one after the other; see `Plc.watch`. What is named comes before what patterns match."""
    for seconds, reading in plc.watch(_named_first(names), interval, count, waiting):
        document = {
            "time_s": round(seconds, 6),
            "values": reading.values,
            "consistent": reading.consistent,
            "forced": reading.forced,
        }
        yield document, reading.marked_texts


def watch_csv(
    plc: Plc, names: Sequence[str], interval: float, count: int | None, waiting: Callable[[str], None]
) -> Iterator[str]:
    """The same as lines of a CSV file: the names, then time and values. Structures and arrays have a column for each
    value, as in the file of `run --trace`."""
    from plctool.trace_file import csv_cells, csv_line

    columns = list(plc.symbols().scalars(_named_first(names)))
    yield csv_line(["time_s", *columns])
    for seconds, reading in plc.watch(columns, interval, count, waiting):
        yield csv_line([f"{seconds:.6f}", *csv_cells(reading)])


def _named_first(names: Sequence[str]) -> list[str]:
    from plctool.debug.symbols import is_pattern

    return sorted(names, key=is_pattern)
