"""The command line: reads arguments, calls `documents`, prints. Imports are late, so that every start is quick."""

from __future__ import annotations

import argparse
import io
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from plctool.cli import output
from plctool.errors import InternalError, PlcError, UsageError
from plctool.version import plctool_version

if TYPE_CHECKING:
    from plctool.compiler import Level
    from plctool.compiler.warnings import WarningOptions
    from plctool.device import Plc

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
EXIT_INTERRUPTED, EXIT_BROKEN_PIPE = 130, 141
DEFAULT_INTERVAL = 0.5
BENCH_CYCLES = 10000
LATER = {
    "force": "use write, which a program may overwrite",
    "unforce": "there is nothing to unforce",
}


class _Parser(argparse.ArgumentParser):
    """Reports wrong arguments as UsageError, like everything else that is wrong."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.", "usage")


# ---- arguments -------------------------------------------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="plctool", description="Compile IEC 61131-3 Structured Text and run it on small controllers.")
    parser.add_argument("--version", action="store_true", help="print the version and end")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", parser_class=_Parser)

    def command(name: str, action: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text[:1].upper() + text[1:] + ".")
        sub.add_argument("--json", action="store_true", help="print one JSON document and nothing else")
        sub.set_defaults(action=action, command=name)
        return sub

    _add_file_commands(command)
    _add_device_commands(command)
    command("demo", _demo, "show the whole story on this machine")
    return parser


def _add_file_commands(command: Callable[..., argparse.ArgumentParser]) -> None:
    build = command("build", _build, "compile a program to an image")
    _add_sources(build)
    build.add_argument("-o", "--output", type=Path, default=Path("app.cdl"), metavar="IMAGE", help="default: app.cdl")
    build.add_argument("--target", default="x86_64-linux", metavar="NAME", help="processor; default: x86_64-linux")
    build.add_argument(
        "-O", dest="level", type=_level, metavar="0..3|s", default=2, help="optimisation, s for small code; default: 2"
    )
    build.add_argument(
        "--checks",
        default="all",
        metavar="all|none|LIST",
        help="run-time checks: div, bounds, subrange, null; default: all",
    )
    build.add_argument("--debug", action="store_true", help="keep the code close to its source")
    _add_warnings(build)

    check = command("check", _check, "print every diagnosis of a program")
    _add_sources(check)
    _add_warnings(check)

    info = command("info", _info, "describe an image")
    _add_image(info)

    symbols = command("symbols", _symbols, "list the variables of an image with their types")
    _add_image(symbols)
    symbols.add_argument("patterns", nargs="*", metavar="PATTERN", help="names with * and ?: 'Main.pump.*'")

    run = command("run", _run, "run an image in this process, on a virtual clock")
    _add_image(run)
    length = run.add_mutually_exclusive_group()
    length.add_argument("--cycles", type=_count, metavar="N", help="cycles of the first task; default: 1")
    length.add_argument("--time", type=_duration_ms, metavar="T#10s", help="virtual time instead")
    run.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="before the first cycle; may be repeated"
    )
    run.add_argument("--get", action="append", default=[], metavar="NAME", help="after the last cycle; may be repeated")

    test = command("test", _test, "run the unit tests of a program in this process, on a virtual clock")
    _add_sources(test)
    test.add_argument(
        "-k",
        "--filter",
        default="*",
        metavar="PATTERN",
        help="only tests whose name holds this, or fits it with * and ?",
    )
    test.add_argument("--junit", type=Path, metavar="FILE", help="write a report in JUnit's format as well")
    test.add_argument("-O", dest="level", type=int, choices=range(4), default=0, help="optimisation; default: 0")
    _add_warnings(test)

    export = command("export-itf", _export_itf, "write the C header and frame for functions implemented in C")
    _add_sources(export)
    export.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: this folder")
    export.add_argument("--force", action="store_true", help="also replace an implementation that is there already")

    bench = command("bench", _bench, "measure the time of a cycle on this machine")
    _add_image(bench)
    bench.add_argument("--cycles", type=_count, default=BENCH_CYCLES, metavar="N", help=f"default: {BENCH_CYCLES}")


def _add_device_commands(command: Callable[..., argparse.ArgumentParser]) -> None:
    flash = command("flash", _flash, "bring an image onto a device and start it")
    _add_image(flash)
    flash.add_argument("--no-start", action="store_true", help="leave it stopped until it is started or power returns")
    flash.add_argument("--force", action="store_true", help="also when the device has this image already")
    _add_link(flash)

    _add_link(command("scan", _scan, "list the devices that answer"))
    _add_link(command("status", _status, "tell what the program on a device does"))
    _add_link(command("start", _start, "start the program"))
    _add_link(command("stop", _stop, "stop the program"))
    reset = command("reset", _reset, "reset the program; it is stopped afterwards")
    reset.add_argument(
        "option", choices=["warm", "cold", "origin"],
        help="warm keeps RETAIN variables, cold only PERSISTENT ones, origin deletes the program",
    )  # fmt: skip
    _add_link(reset)
    _add_link(command("tasks", _tasks, "show the times of the tasks"))
    _add_link(command("log", _log, "print the log of a device"))

    port = command("port-check", _port_check, "check a port: run programs on a board and compare with what is expected")
    port.add_argument("--yes", action="store_true", help="replace the program that is on the board")
    port.add_argument("--power-cycle", action="store_true", help="ask for the board to be switched off and on, too")
    port.add_argument(
        "--max-drift", type=_percent, default=0.01, metavar="PERCENT",
        help="of its clock, default: 1; a simulated board on a busy host needs more",
    )  # fmt: skip
    _add_link(port)

    read = command("read", _read, "print values of variables")
    _add_names(read)
    _add_link(read, symbols=True)
    write = command("write", _write, "set variables")
    write.add_argument("values", nargs="+", metavar="NAME=VALUE", help="value as 'read' shows it: Main.pause=T#2s")
    _add_link(write, symbols=True)
    watch = command("watch", _watch, "print values of variables again and again")
    _add_names(watch)
    watch.add_argument("--interval", type=_seconds, default=DEFAULT_INTERVAL, metavar="S", help="seconds; default: 0.5")
    watch.add_argument("--count", type=_count, metavar="N", help="readings; default: until Ctrl-C")
    _add_link(watch, symbols=True)

    gateway = command("gateway", _gateway, "show or end the processes that share a serial line among tools")
    gateway.add_argument(
        "what", choices=["status", "stop"], help="status: who uses which line; stop: end it and tell its tools"
    )
    gateway.add_argument("--port", metavar="PORT", help="of this port only; default: all of this user")


def _add_sources(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "sources", nargs="+", type=Path, metavar="FILE.st|DIR", help="of a folder all sources are taken"
    )


def _add_image(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("image", type=Path, help="what 'plctool build' wrote")


def _add_names(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="+", metavar="NAME", help="such as Main.lamp, Main.list[3], Main.pump.level")


def _add_warnings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--no-warn", action="append", default=[], metavar="NAME,...", help="without these warnings; may be repeated"
    )
    parser.add_argument("--werror", action="store_true", help="treat warnings as errors")


def _add_link(parser: argparse.ArgumentParser, symbols: bool = False) -> None:
    link = parser.add_argument_group("link")
    link.add_argument("--port", metavar="PORT", help="serial port or pyserial URL, for example /dev/ttyS0")
    link.add_argument("--baud", type=_count, default=115200, metavar="N", help="default: 115200")
    link.add_argument(
        "--no-gateway", action="store_true", help="do not share the port; default: with PLCTOOL_GATEWAY=off"
    )
    for kind, metavar in (("can", "INTERFACE:CHANNEL"), ("udp", "HOST[:PORT]"), ("tcp", "HOST[:PORT]")):
        link.add_argument(f"--{kind}", metavar=metavar, help="not in this version")
    link.add_argument("--node", type=int, metavar="N", help="not in this version")
    if symbols:
        parser.add_argument("--symbols", type=Path, metavar="FILE.sym", help="when they are not found by themselves")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return int(text)


def _seconds(text: str) -> float:
    with suppress(ValueError):
        if 0 <= (seconds := float(text)) < 1e6:
            return seconds
    raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds")


def _level(text: str) -> Level:
    if text == "s":
        return "s"
    if text not in ("0", "1", "2", "3"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a level of optimisation; use 0, 1, 2, 3 or s")
    return int(text)


def _percent(text: str) -> float:
    return _seconds(text.removesuffix("%")) / 100


def _duration_ms(text: str) -> int:
    from plctool.iec.value_texts import parse_time

    milliseconds = parse_time(text)
    if milliseconds < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is in the past")
    return milliseconds


def _pairs(texts: Sequence[str]) -> dict[str, str]:
    """NAME=VALUE or NAME:=VALUE arguments."""
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().removesuffix(":").strip()
        if not equals or not name:
            raise UsageError(f"'{text}' is not NAME=VALUE; write for example Main.speed=5.", "usage")
        pairs[name] = value
    return pairs


# ---- commands on files -----------------------------------------------------------------------------------------------


def _warnings(args: argparse.Namespace) -> WarningOptions:
    from plctool.compiler.warnings import warning_options

    return warning_options(args.no_warn, as_errors=args.werror)


def _build(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    document, warnings = documents.build(
        args.sources, args.output, args.target, args.level, args.checks, args.debug, _warnings(args)
    )
    if not args.json:
        for warning in warnings:
            print(warning, file=sys.stderr)
    return _show(args, document, lambda d: f"{d['image']}: {d['size']} bytes, CRC {d['crc']}")


def _check(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    document, texts = documents.check(args.sources, _warnings(args))
    _show(args, document, lambda d: "\n".join(texts))
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else EXIT_OK


def _info(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    return _show(args, documents.info(args.image), output.info_text)


def _symbols(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    document = documents.variables(args.image, args.patterns)
    return _show(args, document, lambda d: output.table(d["variables"], ("name", "type", "area")))


def _run(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    document, texts = documents.run(args.image, args.cycles, args.time, _pairs(args.set), args.get)
    return _show(
        args,
        document,
        lambda d: f"{output.values_text(texts)}\n{d['cycles']} cycles, {d['time_ms']:.10g} ms".lstrip(),
    )


def _test(args: argparse.Namespace) -> int:
    from plctool import st_tests
    from plctool.cli import documents
    from plctool.files import write_atomically

    if args.junit:
        documents.check_output(args.junit, args.sources, "--junit report.xml")
    report = st_tests.run_tests(args.sources, pattern=args.filter, level=args.level, warnings=_warnings(args))
    if args.junit:
        write_atomically(args.junit, st_tests.junit_xml(report))
    if not args.json:
        for warning in report.warning_texts():
            print(warning, file=sys.stderr)
    colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    _show(args, report.document(), lambda d: st_tests.report_text(report, colour=colour))
    return EXIT_FAILED if report.failed else EXIT_OK


def _export_itf(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    def text(d: dict[str, Any]) -> str:
        kept = "" if d["source_written"] else " (kept as it is; --force replaces it)"
        return f"{output.table(d['functions'], d['functions'][0])}\n{d['header']}\n{d['source']}{kept}"

    return _show(args, documents.export_interface(args.sources, args.output, args.force), text)


def _bench(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    return _show(args, documents.bench(args.image, args.cycles), lambda d: output.table(d["tasks"], d["tasks"][0]))


def _demo(args: argparse.Namespace) -> int:
    from plctool.cli import demo

    if not args.json:
        return demo.main()
    with redirect_stdout(sys.stderr):
        status = demo.main()
    if status != EXIT_OK:
        raise PlcError("The demo failed; its story on stderr says where.", "demo")
    return _show(args, {"passed": True}, lambda d: "")


# ---- commands on devices ---------------------------------------------------------------------------------------------


def _link(args: argparse.Namespace) -> str:
    """The link the arguments name."""
    for kind in ("can", "udp", "tcp", "node"):
        if getattr(args, kind) is not None:
            raise UsageError(f"--{kind} is not in this version; use a serial line (--port).", "no-such-link")
    if not args.port:
        raise UsageError("Say where the device is: --port /dev/ttyS0, for example.", "no-link")
    return f"serial:{args.port}"


def _connect(args: argparse.Namespace) -> Plc:
    from plctool.device import connect

    return connect(
        _link(args), args.baud, getattr(args, "symbols", None), gateway=_gateway_wanted(args), tool=_me(args)
    )


def _gateway_wanted(args: argparse.Namespace) -> bool | None:
    return False if args.no_gateway else None


def _me(args: argparse.Namespace) -> str:
    """What other tools on the line are told this one is: the command and its arguments without options."""
    image = [args.image.name] if "image" in args else []
    option = [args.option] if "option" in args else []
    return " ".join(["plctool", args.command, *option, *image, *getattr(args, "names", getattr(args, "values", []))])


def _flash(args: argparse.Namespace) -> int:
    with _connect(args) as plc:
        others = plc.others()
        if others and not args.json:
            users = "1 other tool uses" if len(others) == 1 else f"{len(others)} other tools use"
            print(f"{users} this line: {', '.join(map(str, others))}", flush=True)
        with _Progress(not args.json) as progress:
            result = plc.flash(args.image, start=not args.no_start, force=args.force, progress=progress.show)
    document = {
        "bytes": result.bytes,
        "seconds": round(result.seconds, 3),
        "skipped": result.skipped,
        "state": str(result.state),
        "others": [vars(other) for other in others],
        "persistent": None if result.persistent is None else vars(result.persistent),
    }

    def text(d: dict[str, Any]) -> str:
        done = "already on the device" if d["skipped"] else f"{d['bytes']} bytes in {d['seconds']:.2f} s"
        lines = [f"{done}; state: {d['state']}"]
        if d["persistent"]:
            lines += [f"PERSISTENT value lost: {name} {why}" for name, why in d["persistent"]["lost"].items()]
            lines += [f"PERSISTENT value new: {name}" for name in d["persistent"]["new"]]
        return "\n".join(lines)

    return _show(args, document, text)


class _Progress:
    """A progress bar on a terminal, silence elsewhere."""

    def __init__(self, wanted: bool) -> None:
        self._bar: Any = None
        self._task: Any = None
        if wanted and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn, TransferSpeedColumn

            columns = (BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task("flash", total=None)

    def __enter__(self) -> _Progress:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *exc: object) -> None:
        if self._bar:
            self._bar.stop()

    def show(self, done: int, total: int) -> None:
        if self._bar:
            self._bar.update(self._task, completed=done, total=total)


def _scan(args: argparse.Namespace) -> int:
    from plctool.device import scan
    from plctool.image.file import target_name

    devices = [
        {
            "address": node.address_text,
            "node_name": node.node_name,
            "device_name": node.device_name,
            "vendor_name": node.vendor_name,
            "target": target_name(node.target_id),
            "version": node.version,
            "serial_number": node.serial_number,
        }
        for node in scan(_link(args), args.baud, gateway=_gateway_wanted(args), tool=_me(args))
    ]
    return _show(args, {"devices": devices}, lambda d: output.table(d["devices"], devices[0]))


def _status(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    with _connect(args) as plc:
        return _show(args, documents.status(plc), output.status_text)


def _start(args: argparse.Namespace) -> int:
    return _control(args, lambda plc: plc.start())


def _stop(args: argparse.Namespace) -> int:
    return _control(args, lambda plc: plc.stop())


def _reset(args: argparse.Namespace) -> int:
    return _control(args, lambda plc: plc.reset(args.option))


def _control(args: argparse.Namespace, action: Callable[[Plc], None]) -> int:
    """Does something and tells the state it leads to."""
    from plctool.cli import documents

    with _connect(args) as plc:
        action(plc)
        return _show(args, documents.status(plc), output.status_text)


def _tasks(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    columns = ("name", "cycles", "last_us", "avg_us", "min_us", "max_us", "jitter_us", "overruns")
    with _connect(args) as plc:
        return _show(args, documents.tasks(plc), lambda d: output.table(d["tasks"], columns))


def _log(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    with _connect(args) as plc:
        return _show(args, documents.log(plc), output.log_text)


def _port_check(args: argparse.Namespace) -> int:
    from plctool import port_check

    def power_cycle() -> None:
        print("Switch the board off and on, then press Enter.", file=sys.stderr)
        sys.stdin.readline()

    report = port_check.run_port_check(
        lambda: _connect(args),
        baud=args.baud,
        replace=args.yes,
        max_drift=args.max_drift,
        power_cycle=power_cycle if args.power_cycle else None,
        show=lambda outcome: None if args.json else print(port_check.outcome_text(outcome), flush=True),
    )
    _show(args, report.document(), lambda d: port_check.summary_text(report))
    return EXIT_FAILED if report.count("failed") else EXIT_OK


def _read(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    with _connect(args) as plc:
        document, texts = documents.read(plc, args.names)
    if not (document["consistent"] or args.json):
        print("plctool: a task ran meanwhile: these values are of more than one cycle.", file=sys.stderr)
    return _show(args, document, lambda d: output.values_text(texts))


def _write(args: argparse.Namespace) -> int:
    from plctool.cli import documents

    with _connect(args) as plc:
        document, texts = documents.write(plc, _pairs(args.values))
    return _show(args, document, lambda d: output.values_text(texts))


def _watch(args: argparse.Namespace) -> int:
    if args.json:
        return _watch_json(args)
    if sys.stdout.isatty():
        return _watch_live(args)
    with _connect(args) as plc:
        for seconds, reading in plc.watch(args.names, args.interval, args.count, _say_waiting):
            print(f"{seconds:8.3f} s  {output.values_text(reading.texts, '  ')}", flush=True)
    return EXIT_OK


def _say_waiting(reason: str) -> None:
    print(f"plctool: {reason}", file=sys.stderr, flush=True)


def _watch_json(args: argparse.Namespace) -> int:
    """All samples as one document, when the count is reached or at Ctrl-C."""
    samples = []
    with _connect(args) as plc, suppress(KeyboardInterrupt):
        for seconds, reading in plc.watch(args.names, args.interval, args.count, _say_waiting):
            sample = {"time_s": round(seconds, 6), "values": reading.values, "consistent": reading.consistent}
            samples.append(sample)
    return _show(args, {"samples": samples}, lambda d: "")


def _watch_live(args: argparse.Namespace) -> int:
    from rich.live import Live
    from rich.table import Table
    from rich.text import Text

    with _connect(args) as plc, Live(auto_refresh=False) as live:
        waiting = lambda reason: live.console.print(f"plctool: {reason}", markup=False)  # noqa: E731
        for seconds, reading in plc.watch(args.names, args.interval, args.count, waiting):
            table = Table("variable", "value", caption=f"{seconds:.1f} s, Ctrl-C ends")
            for name, text in reading.texts.items():
                table.add_row(Text(name), Text(text))
            live.update(table, refresh=True)
    return EXIT_OK


def _gateway(args: argparse.Namespace) -> int:
    from plctool.gateway.control import gateways, stop_gateways

    if args.what == "status":
        return _show(args, {"gateways": gateways(args.port)}, output.gateways_text)
    return _show(args, {"stopped": stop_gateways(args.port)}, output.stopped_text)


# ---- the frame -------------------------------------------------------------------------------------------------------


def _show(args: argparse.Namespace, document: dict[str, Any], text: Callable[[dict[str, Any]], str]) -> int:
    """Prints a result for machines or for people."""
    shown = output.as_json(document) if args.json else text(document)
    if shown:
        print(shown)
    return EXIT_OK


def _command(arguments: Sequence[str]) -> int:
    if arguments and arguments[0] in LATER:
        raise UsageError(f"'{arguments[0]}' is not in this version of plctool; {LATER[arguments[0]]}.", "not-yet")
    args = _parser().parse_args(arguments)
    if args.version:
        print(f"plctool {plctool_version()}")
        return EXIT_OK
    if "action" not in args:
        raise UsageError("Say what to do; 'plctool --help' lists the commands.", "usage")
    return int(args.action(args))


def _report(error: PlcError, as_json: bool) -> int:
    if as_json:
        document: dict[str, Any] = {"error": {"code": error.code, "message": error.message}}
        if diagnostics := getattr(error, "diagnostics", None):
            document["diagnostics"] = [vars(d) for d in diagnostics]
        if exception := getattr(error, "exception", None):
            document["exception"] = exception
        print(output.as_json(document))
    else:
        prefix = "" if hasattr(error, "diagnostics") else "plctool: "  # diagnoses begin with their place
        print(f"{prefix}{error.message}", file=sys.stderr)
    return error.exit_code


def _internal_error(error: Exception, as_json: bool) -> int:
    if os.environ.get("PLCTOOL_DEBUG"):
        traceback.print_exc()
    return _report(error if isinstance(error, InternalError) else InternalError(error), as_json)


def _show_every_character() -> None:
    """What the terminal or a pipe has no character for is shown as an escape, like `\\u65e5`, and is no error."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status of the process."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    as_json = "--json" in words
    _show_every_character()
    try:
        status = _run_reported(words, as_json)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # Whoever read our output has gone; nothing may be written any more, also not at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE


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
    except Exception as error:
        return _internal_error(error, as_json)
