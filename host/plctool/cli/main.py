"""The command line: reads arguments, has `documents` do it, prints. Imports are late, so that every start is quick."""

from __future__ import annotations

import argparse
import errno
import io
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext, redirect_stdout, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from plctool.cli import documents, io_documents, output
from plctool.cli.arguments import pairs, parser
from plctool.cli.io_documents import Document
from plctool.cli.links import all_serial_ports, find_link, link_of
from plctool.cli.unknown_commands import check_command
from plctool.errors import EXIT_INTERRUPTED, InternalError, PlcError, UsageError
from plctool.files import STDIN, STDOUT, path_error, write_output
from plctool.link.transports import Link
from plctool.printable import one_line
from plctool.project import IMAGE_SUFFIX
from plctool.version import plctool_version

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.cli.source_archive import Archive
    from plctool.controller import OtherTool
    from plctool.device import Plc
    from plctool.link.passwords import AskPassword

ShowProgress = Callable[[int, int], None]
EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
EXIT_BROKEN_PIPE = 141


# ---- commands on files -----------------------------------------------------------------------------------------------


def _print_warnings(args: argparse.Namespace, warnings: Sequence[str]) -> None:
    if not args.json:
        for warning in warnings:
            output.say(warning, sys.stderr, colours=True)


def _build(args: argparse.Namespace) -> int:
    image = next((path for path in args.sources if path.suffix.lower() == IMAGE_SUFFIX), None)
    if image is not None:
        raise UsageError(f"{image} is not a source; to name the image that is built, write -o {image}.", "usage")
    document, warnings = documents.build(_settings(args))
    _print_warnings(args, warnings)
    return _show(args, document, output.build_text)


def _settings(args: argparse.Namespace) -> Settings:
    from plctool.cli.projects import settings_of

    settings = settings_of(args)
    _print_dialect(args, settings)
    return settings


def _print_dialect(args: argparse.Namespace, settings: Settings) -> None:
    """Says which dialect was taken because of the files."""
    if settings.dialect_file is not None and not args.json:
        name, file = settings.dialect, settings.dialect_file
        output.say(f"plctool: {one_line(file.name)} makes this a program for --dialect {name}.", sys.stderr)


def _check(args: argparse.Namespace) -> int:
    settings = _settings(args)
    if args.missing:
        document = documents.missing(settings)
        _show(args, document, output.missing_text)
        return EXIT_OK if all(name["stand_in"] for name in document["missing"]) else EXIT_USAGE
    document, texts = documents.check(settings, documents.CheckReports(args.sarif, args.junit))
    _show(args, document, lambda d: "\n".join(texts), colours=True)
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else EXIT_OK


def _fmt(args: argparse.Namespace) -> int:
    from plctool.cli import fmt_documents
    from plctool.cli.projects import needed_project

    writes = not (args.check or args.diff)
    if STDIN in args.sources:
        if len(args.sources) > 1:
            raise UsageError("- stands alone: plctool fmt - < main.st", "usage")
        document, text = fmt_documents.format_input(sys.stdin.buffer, args.lines, writes=writes)
        if writes and not args.json:
            write_output(STDOUT, text)
            return EXIT_OK
    else:
        document = fmt_documents.format_files(args.sources or [needed_project()], args.lines, writes=writes)
    for message in fmt_documents.complaints(document):
        if not args.json:
            output.say(f"plctool: {one_line(message)}", sys.stderr)
    _show(args, document, partial(fmt_documents.shown_text, diff=args.diff))
    if fmt_documents.complaints(document):
        return EXIT_USAGE
    return EXIT_FAILED if not writes and document["changed"] else EXIT_OK


def _new(args: argparse.Namespace) -> int:
    return _show(args, documents.new(args.folder, args.template), output.new_text)


def _info(args: argparse.Namespace) -> int:
    from plctool.cli.image_documents import production_info
    from plctool.image.production import is_production

    image = _image_of(args)
    if is_production(image):
        return _show(args, production_info(image), output.production_info_text)
    return _show(args, documents.info(image), output.info_text)


def _image_of(args: argparse.Namespace) -> Path:
    """Returns the image that the arguments name. Builds that of a project first if it is not fresh."""
    return _fresh_image(args, _project_of(args))


def _fresh_image(args: argparse.Namespace, settings: Settings | None) -> Path:
    if settings is None:
        return Path(args.image)
    from plctool.cli.fresh_image import is_fresh

    if not is_fresh(settings):
        document, warnings = documents.build(settings)
        _print_warnings(args, warnings)
        if not args.json:
            output.say(f"Built {output.build_text(document)}", sys.stderr)
    return settings.output


def _project_of(args: argparse.Namespace) -> Settings | None:
    """Returns the project that the arguments name instead of an image, or that of the current folder if they name
    neither. None: they name an image."""
    from plctool.cli.projects import needed_project, settings_of_project
    from plctool.project import project_named

    file = needed_project() if args.image is None else project_named([args.image])
    if file is None:
        return None
    settings = settings_of_project(file)
    _print_dialect(args, settings)
    return settings


def _image(args: argparse.Namespace) -> int:
    from plctool.cli.image_documents import production
    from plctool.cli.overwriting import check_not_read

    project = _project_of(args)
    image = _fresh_image(args, project)
    if args.board is None and args.firmware is None and project is not None:
        args.board = project.board
    inputs = [file for file in (image, args.firmware) if file is not None]
    check_not_read(args.output, inputs, f"-o {args.output.stem}-production{args.output.suffix}")
    return _show(args, production(image, args.board, args.firmware, args.output), output.production_text)


def _symbols(args: argparse.Namespace) -> int:
    if args.image is not None and _is_pattern(args.image):
        args.image, args.patterns = None, [str(args.image), *args.patterns]
    return _show(args, documents.variables(_image_of(args), args.patterns), output.variables_text)


def _is_pattern(image: Path) -> bool:
    """True if the first argument of `symbols` names variables of the project of the current folder."""
    from plctool.image.production import is_production
    from plctool.project import find_project

    is_image = image.exists() or image.suffix.lower() == IMAGE_SUFFIX or is_production(image)
    return not is_image and find_project() is not None


def _run(args: argparse.Namespace) -> int:
    from plctool.io.faults import parse_fault

    if args.output and not args.trace:
        raise UsageError("-o is the file of --trace; write for example --trace 'Main.*' -o trace.csv.", "usage")
    _check_one_output(args)
    trace = documents.TraceFile(args.trace, _output_or(args, "trace.csv")) if args.trace else None
    faults = [parse_fault(text) for text in args.fault]
    document, texts = documents.run(
        _program_to_run(args),
        args.cycles,
        args.time,
        pairs(args.set),
        args.get,
        args.plant,
        trace,
        faults,
        aside=args.json or args.output == STDOUT,
    )
    return _show(args, document, lambda d: output.run_text(d, texts), _beside_output(args))


def _output_or(args: argparse.Namespace, default: str) -> Path:
    """The output that the arguments name, else `default` in the current folder. Raises UsageError if that is a link to
    elsewhere."""
    from plctool.cli.overwriting import check_no_way_out

    if args.output is None:
        check_no_way_out(Path(default), Path(), f"-o new-{default}")
    return Path(default) if args.output is None else args.output


def _program_to_run(args: argparse.Namespace) -> Path | documents.Built:
    """The image that the arguments name, or the project, compiled for this machine."""
    settings = _project_of(args)
    if settings is None:
        return Path(args.image)
    built, warnings = documents.built_for_here(settings)
    _print_warnings(args, warnings)
    return built


def _test(args: argparse.Namespace) -> int:
    from plctool.st_tests import report_text

    document, report = documents.test(_settings(args), args.filter, args.junit, args.coverage)
    _print_warnings(args, report.warning_texts())
    _show(args, document, lambda d: report_text(report), colours=True)
    return EXIT_FAILED if report.failed else EXIT_OK


def _export(args: argparse.Namespace) -> int:
    from plctool.compiler import source_date

    document, warnings = documents.export(_settings(args), args.xml, source_date())
    _print_warnings(args, warnings)
    return _show(args, document, lambda d: str(d["file"]))


def _export_itf(args: argparse.Namespace) -> int:
    if args.device is not None:
        return _show(args, io_documents.export_board(args.device, args.output), lambda d: str(d["header"]))
    args.no_warn, args.werror = [], None
    return _show(args, documents.export_interface(_settings(args), args.output, args.force), output.interface_text)


def _bench(args: argparse.Namespace) -> int:
    return _show(
        args, documents.bench(_program_to_run(args), args.cycles), lambda d: output.table(d["tasks"], d["tasks"][0])
    )


def _completion(args: argparse.Namespace) -> int:
    from argcomplete.shell_integration import shellcode

    script = shellcode(["plctool"], shell=args.shell)
    return _show(args, {"script": script}, lambda d: script)


def _man(args: argparse.Namespace) -> int:
    from plctool.cli.manual import manual_page

    page = manual_page(parser())
    return _show(args, {"page": page}, lambda d: page)


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


def _connect(args: argparse.Namespace) -> Plc:
    return _connect_to(args, link_of(args))


def _connect_to(args: argparse.Namespace, link: Link) -> Plc:
    from plctool.device import connect

    return connect(
        link,
        getattr(args, "symbols", None),
        gateway=_gateway_wanted(args),
        tool=_me(args),
        password=_password_source(args),
    )


def _password_source(args: argparse.Namespace) -> AskPassword:
    """One for all links of this command, so that users are asked once."""
    from plctool.cli.passwords import password_source

    if "password" not in args:
        args.password = password_source(args.password_file)
    source: AskPassword = args.password
    return source


def _gateway_wanted(args: argparse.Namespace) -> bool | None:
    return False if args.no_gateway else None


def _me(args: argparse.Namespace) -> str:
    """How this tool is shown to others on the line: the command and its arguments without options."""
    image = [args.image.name] if getattr(args, "image", None) else []
    option = [args.option] if "option" in args else []
    return " ".join(["plctool", args.command, *option, *image, *getattr(args, "names", getattr(args, "values", []))])


def _on_device(args: argparse.Namespace, operation: Callable[[Plc], Document], text: Callable[[Document], str]) -> int:
    with _connect(args) as plc:
        document = operation(plc)
    return _show(args, document, text)


def _flash_several(args: argparse.Namespace, link: Link) -> int:
    from plctool.device import connect_several

    try:
        with connect_several(link, password=_password_source(args)) as plcs, _Progress(not args.json) as progress:
            document, errors = documents.flash_several(
                plcs,
                args.image,
                start=not args.no_start,
                force=args.force,
                progress=lambda node, done, total: progress.show(done, total, node),
            )
    except KeyboardInterrupt:
        again = {node: partial(_connect_to, args, link.of_node(node)) for node in link.nodes or ()}
        raise documents.interrupted_flash(again, args.image) from None
    _show(args, document, output.flash_several_text)
    return max((error.exit_code for error in errors), default=EXIT_OK)


def _flash(args: argparse.Namespace) -> int:
    from plctool.cli.file_documents import store_source

    link = link_of(args)
    args.image = _image_of(args)
    if len(link.nodes or ()) > 1:
        if args.with_source is not None:
            raise UsageError("--with-source is for one device; name one with --node.", "usage")
        return _flash_several(args, link)

    prepared = _prepared_source(args)

    def announce(others: Sequence[OtherTool]) -> None:
        if others and not args.json:
            users = "1 other tool uses" if len(others) == 1 else f"{len(others)} other tools use"
            output.say(f"{users} this line: {', '.join(one_line(str(other)) for other in others)}")

    def flash(plc: Plc) -> Document:
        with _Progress(not args.json) as progress:
            document = documents.flash(
                plc, args.image, start=not args.no_start, force=args.force, progress=progress.show, announce=announce
            )
        if prepared is not None:
            document["source"] = store_source(plc, prepared)
        return document

    try:
        return _on_device(args, flash, output.flash_text)
    except KeyboardInterrupt:
        raise documents.interrupted_flash({"": partial(_connect, args)}, args.image) from None


def _prepared_source(args: argparse.Namespace) -> tuple[Archive, bytes] | None:
    """The sources that are to go with an image, if that is wanted: checked before anything is sent."""
    if args.with_source is None:
        return None
    from plctool.cli.file_documents import prepared_source
    from plctool.cli.projects import settings_of_sources
    from plctool.files import read_image
    from plctool.image.file import image_crc

    return prepared_source(settings_of_sources(args.with_source), image_crc(read_image(args.image)), args.image)


class _Progress:
    """A progress bar for each download on a terminal, silence elsewhere. It begins with the first bytes."""

    def __init__(self, wanted: bool) -> None:
        self._bar: Any = None
        self._tasks: dict[str, Any] = {}
        if wanted and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                DownloadColumn,
                Progress,
                TextColumn,
                TimeRemainingColumn,
                TransferSpeedColumn,
            )

            label = TextColumn("{task.description}", markup=False)
            columns = (label, BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *exc: object) -> None:
        if self._bar:
            self._bar.stop()

    def show(self, done: int, total: int, device: str = "") -> None:
        if not self._bar:
            return
        self._bar.start()  # harmless when repeated
        if device not in self._tasks:
            self._tasks[device] = self._bar.add_task(device, total=total)
        self._bar.update(self._tasks[device], completed=done, total=total)


def _scan(args: argparse.Namespace) -> int:
    link = find_link(args)
    if link is None:
        document = documents.scan_all(all_serial_ports(args), _gateway_wanted(args), _me(args), args.long)
    else:
        document = documents.scan(link, _gateway_wanted(args), _me(args), args.long)
    return _show(args, document, output.devices_text)


def _status(args: argparse.Namespace) -> int:
    return _on_device(args, documents.status, output.status_text)


def _start(args: argparse.Namespace) -> int:
    return _on_device(args, documents.start, output.status_text)


def _stop(args: argparse.Namespace) -> int:
    return _on_device(args, documents.stop, output.status_text)


def _cycle(args: argparse.Namespace) -> int:
    return _on_device(args, documents.cycle, output.status_text)


def _reset(args: argparse.Namespace) -> int:
    return _on_device(args, lambda plc: documents.reset(plc, args.option), output.status_text)


def _tasks(args: argparse.Namespace) -> int:
    return _on_device(args, documents.tasks, output.tasks_text)


def _log(args: argparse.Namespace) -> int:
    return _on_device(args, documents.log, output.log_text)


def _shell(args: argparse.Namespace) -> int:
    return _on_device(args, lambda plc: documents.shell(plc, " ".join(args.words)), lambda d: str(d["answer"]))


def _passwd(args: argparse.Namespace) -> int:
    from plctool.cli.passwords import new_password

    def change(plc: Plc) -> Document:
        plc.raw_status()  # asks for the present one first
        return documents.passwd(plc, None if args.remove else new_password(args.new_password_file))

    return _on_device(
        args, change, lambda d: "The password is set." if d["password"] else "The device has no password now."
    )


def _files(args: argparse.Namespace) -> int:
    from plctool.cli import file_documents

    operations: dict[str, Callable[[Plc, ShowProgress], Document]] = {
        "list": lambda plc, show: file_documents.list_files(plc),
        "get": lambda plc, show: file_documents.get_file(plc, args.name, _output_or(args, args.name), show),
        "put": lambda plc, show: file_documents.put_file(plc, args.file, args.name, show),
        "delete": lambda plc, show: file_documents.delete_file(plc, args.name),
    }
    texts: dict[str, Callable[[Document], str]] = {
        "list": file_documents.list_text,
        "get": lambda d: f"{d['name'] if d['file'] == str(STDOUT) else d['file']}: {d['size']} bytes",
        "put": lambda d: f"{d['name']}: {d['size']} bytes",
        "delete": lambda d: f"{d['name']} is deleted.",
    }
    if args.what != "get":
        return _with_progress(args, operations[args.what], texts[args.what])
    _check_one_output(args)
    return _with_progress(args, operations["get"], texts["get"], _beside_output(args))


def _source(args: argparse.Namespace) -> int:
    from plctool.cli import file_documents

    if args.what == "get":
        output = _output_or(args, "source")
        return _with_progress(
            args, lambda plc, show: file_documents.get_source(plc, output, show), file_documents.source_text
        )
    settings = _settings(args)
    return _with_progress(
        args,
        lambda plc, show: file_documents.put_source(plc, settings, show),
        lambda d: f"{len(d['files'])} files of the program with CRC {d['crc']} are on the device.",
    )


def _with_progress(
    args: argparse.Namespace,
    operation: Callable[[Plc, ShowProgress], Document],
    text: Callable[[Document], str],
    stream: TextIO | None = None,
) -> int:
    with _connect(args) as plc, _Progress(not args.json) as progress:
        document = operation(plc, progress.show)
    return _show(args, document, text, stream)


def _port_check(args: argparse.Namespace) -> int:
    from plctool.port_check import outcome_text, summary_text

    def power_cycle() -> None:
        output.say("Switch the board off and on, then press Enter.", sys.stderr)
        sys.stdin.readline()

    document, report = documents.port_check(
        lambda: _connect(args),
        link=link_of(args),
        replace=args.yes,
        max_drift=args.max_drift,
        power_cycle=power_cycle if args.power_cycle else None,
        wires=args.wire,
        device=args.device,
        show=lambda outcome: None if args.json else output.say(one_line(outcome_text(outcome))),
    )
    _show(args, document, lambda d: summary_text(report))
    return EXIT_FAILED if document["failed"] else EXIT_OK


def _read(args: argparse.Namespace) -> int:
    with _connect(args) as plc:
        document, texts = documents.read(plc, args.names)
    if not (document["consistent"] or args.json):
        output.say("plctool: a task ran during the read; the values may come from different cycles.", sys.stderr)
    return _show(args, document, lambda d: output.values_text(texts))


def _write(args: argparse.Namespace) -> int:
    with _connect(args) as plc:
        document, texts = documents.write(plc, pairs(args.values))
    return _show(args, document, lambda d: output.values_text(texts))


def _force(args: argparse.Namespace) -> int:
    with _connect(args) as plc:
        document, texts = documents.force(plc, pairs(args.values))
    return _show(args, document, lambda d: output.values_text(texts))


def _unforce(args: argparse.Namespace) -> int:
    if bool(args.names) == args.all:
        raise UsageError("Name what is not to be forced any more, or write --all; 'plctool forced' shows it.", "usage")
    with _connect(args) as plc:
        document, texts = documents.unforce(plc, args.names)
    return _show(args, document, lambda d: output.unforced_text(d, texts))


def _forced(args: argparse.Namespace) -> int:
    with _connect(args) as plc:
        document, texts = documents.forced(plc)
    return _show(args, document, lambda d: output.forced_text(texts))


def _watch(args: argparse.Namespace) -> int:
    if args.csv is not None:
        return _watch_csv(args)
    if args.json:
        return _watch_json(args)
    if sys.stdout.isatty():
        return _watch_live(args)
    with _connect(args) as plc:
        for sample, texts in _samples(args, plc, _say_waiting):
            output.say(f"{sample['time_s']:8.3f} s  {output.values_text(texts, '  ')}")
    return EXIT_OK


def _samples(
    args: argparse.Namespace, plc: Plc, waiting: Callable[[str], None]
) -> Iterator[tuple[Document, dict[str, str]]]:
    return documents.watch(plc, args.names, args.interval, args.count, waiting)


def _say_waiting(reason: str) -> None:
    output.say(f"plctool: {one_line(reason)}", sys.stderr)


def _watch_json(args: argparse.Namespace) -> int:
    """A document a line, each at once, until the count is reached or Ctrl-C."""
    with _connect(args) as plc, suppress(KeyboardInterrupt):
        for sample, _ in _samples(args, plc, _say_waiting):
            output.say(output.as_json(sample))
    return EXIT_OK


def _watch_csv(args: argparse.Namespace) -> int:
    """A line a reading, each at once, until the count is reached or Ctrl-C."""
    from plctool.cli.overwriting import check_output

    if args.json:
        raise UsageError("--csv and --json are two formats; choose one.", "usage")
    check_output(args.csv, (), "--csv values.csv")
    with _connect(args) as plc, _written(args.csv) as file, suppress(KeyboardInterrupt):
        for line in documents.watch_csv(plc, args.names, args.interval, args.count, _say_waiting):
            file.write(line)
            file.flush()
    return EXIT_OK


def _written(path: Path) -> AbstractContextManager[TextIO]:
    """Opens a file that grows while the command runs, or the standard output."""
    return nullcontext(sys.stdout) if path == STDOUT else path.open("w", encoding="utf-8")


def _watch_live(args: argparse.Namespace) -> int:
    from plctool.cli.live_table import LiveTable

    with _connect(args) as plc, LiveTable().shown() as table:
        for sample, texts in _samples(args, plc, lambda reason: table.say(f"plctool: {one_line(reason)}")):
            table.show(sample["time_s"], texts)
    return EXIT_OK


def _ui(args: argparse.Namespace) -> int:
    from plctool.cli.page import check_installed, device_page, simulated_page

    check_installed()
    if args.plant is not None and args.image is None:
        raise UsageError("--plant is for --sim; a device has a plant of its own.", "usage")
    from plctool.ui.server import serve

    if args.image is not None:
        target = simulated_page(_program_to_run(args), args.plant)
    else:
        target = device_page(str(link_of(args)), lambda: _connect(args))

    def announce(address: str) -> None:
        _show(args, {"url": address}, lambda d: f"{d['url']}\nCtrl-C ends it.")
        if args.open:
            import webbrowser

            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        serve(target, target.open(), args.port_number, announce)
    return EXIT_OK


def _io(args: argparse.Namespace) -> int:
    return IO_ACTIONS[args.what](args)


def _io_map(args: argparse.Namespace) -> int:
    return _show(args, io_documents.channels_of(_image_of(args)), output.io_map_text)


def _io_init(args: argparse.Namespace) -> int:
    return _show(args, io_documents.init(args.file, args.device), lambda d: f"{d['description']} written")


def _io_status(args: argparse.Namespace) -> int:
    return _on_device(args, io_documents.status, output.io_status_text)


def _io_scan(args: argparse.Namespace) -> int:
    return _on_device(args, lambda plc: io_documents.scan(plc, args.io_device), output.io_scan_text)


def _io_identify(args: argparse.Namespace) -> int:
    operation = lambda plc: io_documents.identify(plc, args.io_device)  # noqa: E731
    return _on_device(args, operation, lambda d: f"{d['device']} shows itself")


def _io_param(args: argparse.Namespace) -> int:
    name, equals, text = args.parameter.partition("=")
    if (args.verb == "set") != bool(equals):
        example = f"set {args.io_device} {name}=1" if args.verb == "set" else f"get {args.io_device} {name}"
        raise UsageError(f"Write for example: plctool io param {example}.", "usage")
    value = text if args.verb == "set" else None
    operation = lambda plc: io_documents.parameter(plc, args.io_device, name, args.type, value)  # noqa: E731
    return _on_device(args, operation, lambda d: f"{d['device']} {d['parameter']} = {d['text']}")


def _canopen(args: argparse.Namespace) -> int:
    from plctool.cli.canopen_commands import CANOPEN_ACTIONS

    return CANOPEN_ACTIONS[args.what](args, partial(_show, args))


def _gateway(args: argparse.Namespace) -> int:
    if args.what == "status":
        return _show(args, documents.gateways(args.port), output.gateways_text)
    return _show(args, documents.stop_gateways(args.port), output.stopped_text)


IO_ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "map": _io_map, "init": _io_init, "status": _io_status, "scan": _io_scan, "identify": _io_identify,
    "param": _io_param,
}  # fmt: skip

ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "build": _build, "check": _check, "info": _info, "image": _image, "symbols": _symbols, "run": _run,
    "test": _test, "new": _new, "fmt": _fmt,
    "export": _export, "export-itf": _export_itf, "bench": _bench, "demo": _demo, "io": _io,
    "canopen": _canopen,
    "flash": _flash, "scan": _scan, "status": _status, "start": _start, "stop": _stop, "cycle": _cycle,
    "reset": _reset,
    "tasks": _tasks, "log": _log, "shell": _shell, "passwd": _passwd,
    "files": _files, "source": _source, "port-check": _port_check,
    "read": _read, "write": _write, "force": _force, "unforce": _unforce, "forced": _forced, "watch": _watch, "ui": _ui,
    "gateway": _gateway, "completion": _completion, "man": _man,
}  # fmt: skip


# ---- the frame -------------------------------------------------------------------------------------------------------


def _show(
    args: argparse.Namespace,
    document: Document,
    text: Callable[[Document], str],
    stream: TextIO | None = None,
    *,
    colours: bool = False,
) -> int:
    """Prints a result for machines or for users."""
    words = output.as_json(document) if args.json else text(output.shown(document))
    if words:
        output.say(words, stream, colours=colours and not args.json)
    return EXIT_OK


def _check_one_output(args: argparse.Namespace) -> None:
    """Raises UsageError if a file and the document would both go to the standard output."""
    if args.json and args.output == STDOUT:
        raise UsageError("-o - and --json both write to the standard output; name a file after -o.", "usage")


def _beside_output(args: argparse.Namespace) -> TextIO:
    """Where a result is printed that must not be among what goes to the standard output."""
    return sys.stderr if args.output == STDOUT else sys.stdout


def _command(arguments: Sequence[str]) -> int:
    if arguments and arguments[0] and not arguments[0].startswith("-"):
        check_command(arguments[0], ACTIONS)
    args = parser().parse_args(arguments)
    if args.version:
        output.say(f"plctool {plctool_version()}")
        return EXIT_OK
    if not args.command:
        raise UsageError("Say what to do; 'plctool --help' lists the commands.", "usage")
    return ACTIONS[args.command](args)


def _report(error: PlcError, as_json: bool) -> int:
    if as_json:
        document: dict[str, Any] = {"error": {"code": error.code, "message": error.message}}
        if diagnostics := getattr(error, "diagnostics", None):
            document["diagnostics"] = [documents.diagnostic_document(d) for d in diagnostics]
        if exception := getattr(error, "exception", None):
            document["exception"] = documents.exception_document(exception)
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
