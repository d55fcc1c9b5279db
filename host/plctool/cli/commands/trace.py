"""`plctool trace`: records variables in the cycles of a task, on a controller."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_link, count, duration_ms, utf8
from plctool.cli.connections import connect
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError
from plctool.files import STDOUT, usable_path, write_output

if TYPE_CHECKING:
    from plctool.debug.recording import Recording
    from plctool.device import Plc
    from plctool.link.traces import RunningTrace, TraceOptions

_SAMPLES = 500
_REDRAW = 0.2  # shortest time between two drawings [s]
_SHOWN = 2000  # samples of a plot that goes on

Say = Callable[[str], None]


def trace_arguments(trace: Parser) -> None:
    trace.add_argument(
        "names", nargs="*", type=utf8, metavar="NAME", help="variables; @cycle, @late [us] and @load [%%] of the task"
    )
    trace.add_argument("--task", type=utf8, metavar="TASK", help="in whose cycles; default: the first one")
    trace.add_argument("--every", type=count, default=1, metavar="N", help="record every n-th cycle; default: 1")
    trace.add_argument("--samples", type=count, metavar="N", help=f"how many; default: {_SAMPLES}")
    trace.add_argument("--time", type=duration_ms, metavar="T#10s", help="how long instead")
    trace.add_argument(
        "--trigger", type=utf8, metavar="'NAME > VALUE'",
        help="begin when this becomes true: =, <>, <, <=, >, >= and a constant, or a BOOL, or NOT and a BOOL",
    )  # fmt: skip
    trace.add_argument("--level", action="store_true", help="the trigger need not have been false before")
    trace.add_argument("--pre", type=utf8, metavar="N|N%", help="how many samples of them are from before the trigger")
    trace.add_argument("--follow", action="store_true", help="go on until Ctrl-C, and show what comes")
    trace.add_argument(
        "-o", "--output", type=usable_path, metavar="FILE",
        help="FILE.csv, .json, .html (opens offline) or .png; - for CSV on the standard output; default: a plot here",
    )  # fmt: skip
    kept = trace.add_argument_group("traces that stay on the controller")
    kept.add_argument("--name", type=utf8, metavar="TRACE", help="the name of this one")
    kept.add_argument("--keep", action="store_true", help="begin it and leave; it records without this tool")
    kept.add_argument("--persistent", action="store_true", help="the same, and again after each start of the program")
    kept.add_argument("--list", action="store_true", help="print the traces of the controller")
    kept.add_argument("--open", type=utf8, metavar="TRACE", help="show what it has recorded")
    kept.add_argument("--end", type=utf8, metavar="TRACE", help="end it, also a persistent one")
    add_link(trace, symbols=True)
    trace.set_defaults(action=_trace)


def _trace(args: argparse.Namespace) -> int:
    say = output.say
    _check(args)
    with connect(args) as plc:
        if args.list:
            return _list(args, plc, say)
        if args.end is not None:
            return _end(args, plc, say)
        if args.open is not None:
            with plc.open_trace(args.open) as running:
                return _record(args, plc, running, say, wait=0.0 if not args.follow else None)
        options = _options(args, plc)
        if args.keep or args.persistent:
            return _keep(args, plc, options, say)
        with plc.start_trace(args.names, options, args.task) as running:
            return _record(args, plc, running, say, wait=None)


def _check(args: argparse.Namespace) -> None:
    from plctool.cli.overwriting import check_output
    from plctool.trace_file import check_format

    others = [f"--{name}" for name in ("list", "open", "end") if getattr(args, name)]
    if len(others) > 1 or (others and (args.names or args.name or args.keep or args.persistent)):
        raise UsageError(f"{others[0]} stands alone; see 'plctool trace --help'.", "usage")
    if not others and not args.names:
        raise UsageError("Name what is to be traced, such as Main.speed or '@cycle'.", "usage")
    if args.samples and args.time:
        raise UsageError("--samples and --time both say how long; choose one.", "usage")
    if args.follow and (args.samples or args.time):
        raise UsageError("--follow goes on until Ctrl-C; leave out --samples and --time.", "usage")
    if (args.keep or args.persistent) and not args.name:
        raise UsageError("A trace that stays needs a name; add --name TRACE.", "usage")
    if args.json and args.output == STDOUT:
        raise UsageError("-o - and --json both write to the standard output; name a file after -o.", "usage")
    if args.output is not None:
        check_output(args.output, (), "-o trace.csv")
        check_format(args.output)


# ---- options ---------------------------------------------------------------------------------------------------------


def _options(args: argparse.Namespace, plc: Plc) -> TraceOptions:
    from plctool.link.traces import TraceOptions

    samples = None if args.follow or (args.keep and not args.samples and not args.time) else args.samples or _SAMPLES
    if args.persistent and not args.samples and not args.time:
        samples = None
    if args.time:
        samples = _samples_in(args, plc)
    return TraceOptions(
        every=args.every,
        samples=samples,
        trigger=args.trigger,
        before=_before(args.pre, samples),
        level=args.level,
        name=args.name or "",
        keep=args.keep or args.persistent,
    )


def _samples_in(args: argparse.Namespace, plc: Plc) -> int:
    from plctool.core import lib

    tasks = [task for task in plc.tasks() if args.task is None or task.name.casefold() == args.task.casefold()]
    if tasks and tasks[0].kind != lib.KIND_CYCLIC:
        raise UsageError(f"{tasks[0].name} is not cyclic, so a time is no number of samples; use --samples.", "usage")
    interval_us = tasks[0].interval_us if tasks else 1000
    every_us: int = interval_us * args.every
    count: int = round(args.time * 1000 / every_us)
    return max(1, count)


def _before(text: str | None, samples: int | None) -> int:
    if text is None:
        return 0
    share = text.removesuffix("%")
    if not share.isdecimal() or (share != text and (samples is None or int(share) >= 100)):
        raise UsageError(f"--pre {text} is neither a number of samples nor a share below 100%.", "usage")
    return int(share) if share == text or samples is None else samples * int(share) // 100


# ---- recording -------------------------------------------------------------------------------------------------------


def _record(args: argparse.Namespace, plc: Plc, running: RunningTrace, say: Say, wait: float | None) -> int:
    """Reads what is recorded until it is complete, or Ctrl-C; without `wait` also what is still to come."""
    recording = running.recording
    lines = _Lines(recording, say) if args.output == STDOUT and args.follow else None
    with _shown(args, recording) as show, suppress(KeyboardInterrupt):
        while not running.is_complete:
            came = running.poll()
            if lines:
                lines.write()
            show(running)
            if came == 0 and wait is not None:
                break
            if came == 0:
                time.sleep(min(max(recording.interval_us / 1e6, 0.05), 0.5))
    return _finish(args, recording, say, written=lines is not None)


def _finish(args: argparse.Namespace, recording: Recording, say: Say, written: bool) -> int:
    import json

    from plctool.trace_file import finite_document, render

    if args.output is not None and not written:
        write_output(args.output, render(recording, args.output))
    if args.json:
        say(json.dumps({**finite_document(recording), **({"file": str(args.output)} if args.output else {})}))
        return 0
    if args.output is None:
        say(_plot(recording))
    elif args.output != STDOUT:
        say(f"{_summary(recording)} in {args.output}")
    if recording.lost and args.output is None:
        say(_summary(recording))
    return 0


def _summary(recording: Recording) -> str:
    lost = f", {recording.lost} lost: the line is too slow for all of them" if recording.lost else ""
    return f"{len(recording)} samples of {len(recording.columns)} values{lost}"


def _plot(recording: Recording) -> str:
    from plctool.trace_plot import plot

    return plot(recording, shutil.get_terminal_size().columns - 1)


class _Lines:
    """Prints samples as lines of CSV when they come."""

    def __init__(self, recording: Recording, say: Say) -> None:
        self._recording = recording
        self._say = say
        self._written = 0
        self._say_row(["time_ms", *recording.names])

    def write(self) -> None:
        for row in self._recording.rows_from(self._written):
            self._say_row(row)
        self._written = len(self._recording)

    def _say_row(self, row: list[str]) -> None:
        from plctool.trace_file import csv_line

        self._say(csv_line(row).rstrip("\n"))


@contextmanager
def _shown(args: argparse.Namespace, recording: Recording) -> Iterator[Callable[[RunningTrace], None]]:
    """What shows progress on a terminal while samples come: the plot with --follow, else how many there are."""
    if args.json or not sys.stderr.isatty():
        yield lambda running: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from plctool.trace_plot import plot

    console, drawn = Console(stderr=True), 0.0
    with Live(console=console, auto_refresh=False, transient=True) as live:

        def show(running: RunningTrace) -> None:
            nonlocal drawn
            if time.monotonic() < drawn + _REDRAW:
                return
            drawn = time.monotonic()
            if running.is_waiting:
                live.update(Text("waiting for the trigger; Ctrl-C ends"), refresh=True)
            elif args.follow and args.output != STDOUT:
                size = console.size
                live.update(Text(plot(recording.newest(_SHOWN), size.width - 1, size.height - 1)), refresh=True)
            else:
                live.update(Text(_summary(recording)), refresh=True)

        yield show


# ---- traces that stay ------------------------------------------------------------------------------------------------


def _keep(args: argparse.Namespace, plc: Plc, options: TraceOptions, say: Say) -> int:
    from plctool.core import lib
    from plctool.link.traces import TRACE_FILE

    running = plc.start_trace(args.names, options, args.task)
    if args.persistent:
        if len(running.config.places) > lib.TRACE_KEPT_RECORDS:
            running.end()
            raise UsageError(f"A persistent trace takes {lib.TRACE_KEPT_RECORDS} values; name fewer.", "too-many")
        try:
            plc.write_file(TRACE_FILE + options.name, running.config.data)
        except DeviceError:
            running.end()
            raise
    words = " and begins again when the program starts" if args.persistent else ""
    return _say_document(args, say, {"name": options.name}, f"{options.name} records{words}")


def _end(args: argparse.Namespace, plc: Plc, say: Say) -> int:
    """The file first: a tool that is killed then leaves what another call ends."""
    from plctool.link.traces import TRACE_FILE

    had_file = False
    with suppress(DeviceError):
        plc.delete_file(TRACE_FILE + args.end)
        had_file = True
    try:
        plc.end_trace(args.end)
    except UsageError:
        if not had_file:
            raise
    return _say_document(args, say, {"ended": args.end}, f"{args.end} has ended")


def _list(args: argparse.Namespace, plc: Plc, say: Say) -> int:
    from plctool.link.traces import columns_on

    tasks = plc.tasks()
    table = None
    with suppress(UsageError):
        table = plc.symbols()
    entries: list[dict[str, Any]] = [
        {
            "name": config.name,
            "task": tasks[config.task].name if config.task < len(tasks) else "",
            "every": config.every,
            "samples": config.samples or None,
            "kept": config.is_kept,
            "columns": [column.name for column in columns_on(config, table)],
        }
        for config in plc.traces()
    ]
    lines = [f"{e['name'] or '(a tool)'}: {', '.join(e['columns'])} in {e['task']}" for e in entries]
    return _say_document(args, say, {"traces": entries}, "\n".join(lines) or "nothing is traced")


def _say_document(args: argparse.Namespace, say: Say, document: dict[str, Any], words: str) -> int:
    import json

    say(json.dumps(document) if args.json else words)
    return 0
