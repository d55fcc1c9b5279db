"""What the commands do, as functions that return the document `--json` prints."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from plctool.cli import io_documents
from plctool.cli.io_documents import Document
from plctool.cli.overwriting import check_no_way_out, check_not_read, check_output
from plctool.cli.plants import attached, files_of_plant, plan_faults
from plctool.controller_documents import exception_document as exception_document
from plctool.controller_documents import log as log
from plctool.controller_documents import program_document, status_document
from plctool.controller_documents import tasks as tasks
from plctool.errors import EXIT_INTERRUPTED, LinkError, PlcError, UsageError
from plctool.files import STDOUT, read_image, write_atomically, write_output

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.base.missing_names import Missing, Use
    from plctool.compiler.base.source import Source
    from plctool.compiler.image.build import BuildResult
    from plctool.compiler.sources.program_files import ProgramFiles
    from plctool.compiler.syntax.diagnostics import Diagnostic
    from plctool.controller import Controller, OtherTool
    from plctool.debug.symbols import SymbolTable
    from plctool.device import Plc
    from plctool.io.faults import Fault
    from plctool.link.names import Node
    from plctool.link.transports import Link
    from plctool.port_check import Outcome
    from plctool.port_check import Report as PortReport
    from plctool.sim import Simulator
    from plctool.st_tests import Report as TestReport

Texts = dict[str, str]
"""Values of variables by name, as ST writes them."""


class Interrupted(PlcError):
    """The user ended an operation by Ctrl-C; the message says what it has left."""

    exit_code = EXIT_INTERRUPTED


# ---- files -----------------------------------------------------------------------------------------------------------


def build(settings: Settings) -> tuple[Document, list[str]]:
    """Compiles to an image and the symbol file beside it. Returns the document and the warnings as users read them.

    Raises CompileError when the program has errors, UsageError when the image would overwrite one of its files. Files
    appear complete or not at all.
    """
    from plctool.cli.fresh_image import fingerprint
    from plctool.debug.symbols import symbol_path
    from plctool.files import make_folder

    output = settings.output
    inputs = settings.every_file
    check_output(output, inputs(), f"-o {output.stem}.cdl", is_image=True)
    check_not_read(symbol_path(output), inputs(), f"-o {output.stem}-image.cdl")
    _check_way_of(settings)
    made_of = fingerprint(settings)  # before the sources are read: a change during the build makes the image stale
    result = _compile(settings, settings.target)
    result.symbols.made_of = made_of
    if settings.own_folder:
        make_folder(output.parent)
    result.write(output)
    channels = result.symbols.io.get("channels", [])
    document = {
        "image": str(output),
        "symbols": str(symbol_path(output)),
        "crc": f"{result.crc:08X}",
        "size": len(result.image),
        "target": result.symbols.target,
        "needs": {name: need.known for name, need in result.needs.items()},
        "warnings": [diagnostic_document(w) for w in result.warnings],
    }
    if channels:
        document["io"] = io_documents.summary(result.symbols.io)
    return document, result.rendered_warnings


def _check_way_of(settings: Settings) -> None:
    """Refuses links out of the project, and out of the current folder if there is no project."""
    from plctool.debug.symbols import symbol_path

    output = settings.output
    if not settings.output_named:
        check_no_way_out(output, settings.files.root or Path(), f"-o {output.stem}-image.cdl")
    folder = None if settings.output_named else settings.files.root
    check_no_way_out(symbol_path(output), folder or output.parent, f"-o {output.stem}-image.cdl")


def compiled(settings: Settings) -> BuildResult:
    """What `build` would write."""
    return _compile(settings, settings.target)


def _compile(settings: Settings, target: str | None) -> BuildResult:
    from plctool.compiler import compile_sources

    is_own = target == settings.target  # else it is for this machine, whatever board the program is for
    return compile_sources(
        settings.files,
        target=target,
        level=settings.level,
        checks=settings.checks,
        debug=settings.debug,
        warnings=settings.warnings,
        board=settings.board if is_own else None,
        firmware=settings.firmware if is_own else None,
        limits=settings.limits,
        dialect=settings.dialect,
    )


def new(folder: Path, template: str) -> Document:
    """Makes a project."""
    from plctool.templates import new_project

    return {"folder": str(folder), "files": [str(file) for file in new_project(folder, template)]}


@dataclass(frozen=True)
class CheckReports:
    """The files that `check` writes for CI systems; None: not wanted."""

    sarif: Path | None = None
    junit: Path | None = None

    def check_names(self, inputs: Iterator[Path]) -> None:
        """Raises UsageError if a report would replace a file that is read, or one of another kind."""
        read = list(inputs)
        for file, option in ((self.sarif, "--sarif check.sarif"), (self.junit, "--junit check.xml")):
            if file is not None and file.suffix.lower() != ".xml":
                check_output(file, read, option)
            elif file is not None:
                check_not_read(file, read, option)

    def write(self, diagnostics: Sequence[Diagnostic], files: Sequence[str] = ()) -> None:
        """Writes those that are wanted; `files`: the sources that were checked."""
        from plctool.cli.check_reports import junit, sarif

        if self.sarif is not None:
            write_atomically(self.sarif, sarif(diagnostics))
        if self.junit is not None:
            write_atomically(self.junit, junit(diagnostics, files))


def check(settings: Settings, reports: CheckReports | None = None) -> tuple[Document, list[str]]:
    """Every diagnostic of a program, also as users read them, and the names it uses that nothing declares."""
    from plctool.compiler.base.missing_names import missing_names
    from plctool.compiler.syntax.diagnostics import render_all

    reports = reports or CheckReports()
    reports.check_names(settings.every_file())
    diagnostics, sources, shown = _checked(settings)
    reports.write(diagnostics, [source.path for source in sources])
    document: Document = {"diagnostics": [diagnostic_document(d) for d in diagnostics]}
    if uses := _missing(diagnostics):
        document["missing"] = [_missing_document(m) for m in missing_names(uses)]
    return document, render_all(diagnostics, shown)


def missing(settings: Settings) -> Document:
    """The names of libraries of other systems that a program uses: those that nothing declares, and those that the
    standard library has. `other_errors`: how many there are besides."""
    from plctool.compiler.base.missing_names import missing_names
    from plctool.compiler.sources.stand_ins import library_of_stand_in, uses_of_stand_ins

    diagnostics, sources, _ = _checked(settings)
    absent = [_missing_document(m) | {"stand_in": False} for m in missing_names(_missing(diagnostics))]
    present = [
        _missing_document(m) | {"library": library_of_stand_in(m.name), "stand_in": True}
        for m in missing_names(uses_of_stand_ins(sources))
    ]
    others = sum(d.severity == "error" and not d.missing for d in diagnostics)
    return {"missing": absent + present, "other_errors": others}


def _checked(settings: Settings) -> tuple[list[Diagnostic], list[Source], list[Source]]:
    """Every diagnostic of a program, its sources, and all files that diagnostics are about."""
    from plctool.compiler import check_with_tests, io_sources, library_sources

    files = settings.files
    sources, libraries = files.load_sources(), files.load_libraries()
    result = check_with_tests(sources, settings.warnings, files.load_io, libraries, settings.dialect)
    return result.diagnostics, sources, [*sources, *io_sources(files.load_io()), *library_sources(libraries)]


def _missing(diagnostics: Sequence[Diagnostic]) -> list[Use]:
    from plctool.compiler.base.missing_names import Use

    return [Use(d.missing, d.file, d.line) for d in diagnostics if d.missing]


def _missing_document(name: Missing) -> Document:
    first = name.first
    return {"name": name.name, "library": name.library, "count": name.count, "file": first.file, "line": first.line}


def export_interface(settings: Settings, folder: Path, force: bool) -> Document:
    """Writes the C header of the functions that are implemented in C, and a C file to fill in, unless there is one.

    Raises CompileError when the sources have errors, UsageError when no function is implemented in C.
    """
    from plctool.compiler import CompileError, io_sources, library_sources
    from plctool.compiler.base.internal import bugs_reported
    from plctool.compiler.export_itf import export_interface as export
    from plctool.compiler.front import check_sources
    from plctool.files import make_folder
    from plctool.iec.dialect import find_dialect

    files, dialect = settings.files, find_dialect(settings.dialect)
    # A file of functions alone has not the programs that a description beside it names.
    io = None if files.project is None and files.io.description is None else files.load_io()
    sources, libraries = files.load_sources(), files.load_libraries()
    with bugs_reported():
        checked = check_sources(sources, io=io, libraries=libraries, dialect=dialect)
    if checked.program is None:
        raise CompileError(checked.diagnostics, [*sources, *io_sources(io), *library_sources(libraries)])
    functions = checked.program.externals
    if not functions:
        raise UsageError(
            "No function is implemented in C; mark those that are by {attribute 'external' := 'name'}.", "no-external"
        )
    named = files.sources[0] if files.project is None else files.project.file.parent
    interface = export(named.resolve().stem, functions)
    header, source = folder / interface.header_name, folder / interface.source_name
    written = force or not source.exists()
    for file in (header, source) if written else (header,):
        check_not_read(file, files.every_file(), "-o interface, a folder for it")
        check_no_way_out(file, folder, "-o interface, a folder for it")
    make_folder(folder)
    write_atomically(header, interface.header.encode("latin-1", "replace"))
    if written:
        write_atomically(source, interface.source.encode("latin-1", "replace"))
    return {
        "header": str(header),
        "source": str(source),
        "source_written": written,
        "functions": [
            {"interface": text, "signature": f"{signature:08X}", "version": f"{version >> 16}.{version & 0xFFFF}"}
            for text, signature, version in interface.functions
        ],
    }


def export(settings: Settings, output: Path, stamp: int) -> tuple[Document, list[str]]:
    """Writes a program as PLCopen XML; also what is left out, as users read it. `stamp`: when, in seconds since 1970.

    Raises CompileError when the program has errors, or a character that XML cannot hold; UsageError for a
    file that would be a source of the program itself.
    """
    from plctool.compiler import CompileError
    from plctool.compiler.base.internal import bugs_reported
    from plctool.compiler.front import check_sources, declared_names_asked_for
    from plctool.compiler.plcopen_export.project import write_project
    from plctool.compiler.syntax.diagnostics import render
    from plctool.compiler.syntax.library import standard_library
    from plctool.iec.dialect import find_dialect

    files = settings.files
    check_not_read(output, files.every_file(), "-o exported.xml, in another folder")
    here = output.resolve()
    if output.suffix.lower() != ".xml":
        raise UsageError(f"PLCopen XML is written to a file whose name ends in .xml, not to {output}.", "bad-output")
    if any(path.is_dir() and here.is_relative_to(path.resolve()) for path in files.sources):
        message = f"{output} would be a source of this program itself; write it to another folder."
        raise UsageError(message, "bad-output")
    dialect = find_dialect(settings.dialect)
    sources, libraries = files.load_sources(), files.load_libraries()
    with bugs_reported():
        checked = check_sources(
            sources, warnings=settings.warnings, io=files.load_io(), libraries=libraries, dialect=dialect
        )
        if checked.program is None:
            raise CompileError(checked.diagnostics, sources)
        declared = declared_names_asked_for(standard_library(), libraries, sources)
        written = write_project(sources, files.info.project or output.stem, declared, stamp)
    if not written.ok:
        raise CompileError(written.diagnostics, sources)
    write_atomically(output, written.text.encode())
    document = {"file": str(output), "left_out": [diagnostic_document(d) for d in written.diagnostics]}
    return document, [render(d, sources) for d in written.diagnostics]


def diagnostic_document(diagnostic: Diagnostic) -> Document:
    return {name: value for name, value in vars(diagnostic).items() if name != "missing"}


def info(path: Path) -> Document:
    """Header, tables and POUs of an image; with its symbols also the bytes of code that each POU made."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.file import describe_image, read_program

    data = read_program(path)
    document = describe_image(data)
    if board := io_documents.board_in(data):
        document["board"] = board
    if devices := io_documents.devices_of(data):
        document["devices"] = devices
    try:
        table = find_symbols(int(document["crc"], 16), path)
    except UsageError:
        return document
    from plctool.compiler.image.build import code_sizes

    units = {unit.name: unit for unit in table.pous}
    document["pous"] = [
        {"name": name, "size": size, "file": units[name].file, "line": units[name].line}
        for name, size in code_sizes(table, document["code_size"]).items()
    ]
    return document


def variables(path: Path, patterns: Sequence[str]) -> Document:
    """The variables of an image, and parts of them, whose names match one of the patterns; without patterns all
    variables. Raises UsageError for a pattern that matches nothing."""
    from plctool.debug.symbols import find_symbols
    from plctool.iec.areas import Area
    from plctool.image.file import describe_image, read_program

    symbols = find_symbols(int(describe_image(read_program(path))["crc"], 16), path)
    areas = {area.value: area.name.lower() for area in Area}
    return {
        "variables": [
            {"name": s.name, "type": str(s.type), "area": areas[s.area], "offset": s.offset, "size": s.size}
            for s in symbols.listed(patterns)
        ]
    }


def test(settings: Settings, pattern: str, junit: Path | None, coverage: Path | None) -> tuple[Document, TestReport]:
    """Runs the unit tests of a program, and writes their report to `junit` as well, and which lines ran into the folder
    `coverage`."""
    from plctool import st_tests

    if junit:
        check_output(junit, settings.files.every_file(), "--junit report.xml")
    if coverage:
        check_output(coverage / "cobertura.xml", settings.files.every_file(), "--coverage coverage")
        for file in coverage.iterdir() if coverage.is_dir() else ():
            check_no_way_out(file, coverage, "--coverage new-folder")
    report = st_tests.run_tests(
        settings.files,
        pattern=pattern,
        level=int(settings.level),
        warnings=settings.warnings,
        coverage=coverage is not None,
        dialect=settings.dialect,
    )
    if junit:
        write_atomically(junit, st_tests.junit_xml(report))
    if coverage and report.coverage:
        report.coverage.write_reports(coverage)
    return report.document(), report


# ---- in this process -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TraceFile:
    """Variables whose values after each cycle of the first task go to a file, as CSV."""

    names: Sequence[str]
    path: Path


@dataclass(frozen=True)
class Built:
    """A program that was compiled from `files`, and is in none itself."""

    image: bytes
    symbols: SymbolTable
    files: ProgramFiles


def built_for_here(settings: Settings) -> tuple[Built, list[str]]:
    """A program compiled for this machine, whatever it is for otherwise, and the warnings as users read them."""
    from plctool.image.targets import host_target

    result = _compile(settings, host_target())
    return Built(result.image, result.symbols, settings.files), result.rendered_warnings


def run(
    program: Path | Built,
    cycles: int | None,
    time_ms: float | None,
    sets: Mapping[str, str],
    gets: Sequence[str],
    plant: Path | None = None,
    trace: TraceFile | None = None,
    faults: Sequence[Fault] = (),
    aside: bool = False,
) -> tuple[Document, Texts]:
    """Runs a program on a virtual clock for `cycles` of its first task or for `time_ms`. Returns the document, and the
    values as users read them. `plant`: what the inputs and outputs are connected to, which prints to stderr if `aside`;
    `faults`: what happens to that.

    Raises DeviceError when the program stops with an exception; what was traced until then is in its file.
    """
    if trace:
        check_output(trace.path, _inputs(program, plant), "-o trace.csv")
    with simulator(program) as plc:
        table = plc.symbols()
        table.select([*gets, *(trace.names if trace else ())])  # a wrong name is reported before the run
        plc.write({name: table.resolve(name).parse(text) for name, text in sets.items()})
        plan_faults(plc, faults)
        with attached(plc, plant, aside) if plant is not None else nullcontext():
            if trace:
                _run_traced(plc, cycles, time_ms, trace)
            elif time_ms is None:
                plc.run_cycles(1 if cycles is None else cycles)
            else:
                plc.run_for(time_ms)
        tasks, reading = plc.tasks(), plc.sample(gets)
        document = {
            "values": reading.values,
            "cycles": tasks[0].cycles if tasks else 0,
            "time_ms": plc.now_ns / 1e6,
            **({"trace": str(trace.path)} if trace and trace.path != STDOUT else {}),
        }
        return document, reading.texts


def _inputs(program: Path | Built, plant: Path | None) -> Iterator[Path]:
    """The files that `run` reads."""
    if isinstance(program, Path):
        yield program
    else:
        yield from program.files.every_file()
    if plant is not None:
        yield from files_of_plant(plant)


def simulator(program: Path | Built) -> Simulator:
    """A simulator that runs a program."""
    from plctool.sim import Simulator

    if isinstance(program, Path):
        return Simulator.from_file(program)
    return Simulator(program.image, program.symbols)


def _run_traced(plc: Simulator, cycles: int | None, time_ms: float | None, trace: TraceFile) -> None:
    """As `run`, in steps."""
    from plctool.trace_file import trace_csv

    lines: list[str] = []
    try:
        lines.extend(trace_csv(plc, trace.names, cycles, time_ms))
    finally:  # also of a run that the user or a plant has ended
        write_output(trace.path, "".join(lines).encode())
    plc.check_running()


def bench(program: Path | Built, cycles: int) -> Document:
    """Real time per cycle of each task."""
    with simulator(program) as plc:
        tasks = []
        for index, task in enumerate(plc.tasks()):
            code_ns, cycle_ns = plc.bench(index, cycles)
            tasks.append(
                {
                    "name": task.name,
                    "ns_per_cycle": round(code_ns, 2),
                    "runtime_ns": round(max(0.0, cycle_ns - code_ns), 2),
                }
            )
        return {"tasks": tasks}


# ---- on a controller -------------------------------------------------------------------------------------------------


def flash(
    plc: Controller,
    image: Path,
    *,
    start: bool = True,
    force: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
    announce: Callable[[Sequence[OtherTool]], None] = lambda others: None,
) -> Document:
    """Brings an image onto a controller; see `Controller.flash`. `announce` gets the other tools on the line first."""
    others = plc.others()
    announce(others)
    result = plc.flash(image, start=start, force=force, progress=progress)
    return {
        "bytes": result.bytes,
        "seconds": round(result.seconds, 3),
        "skipped": result.skipped,
        "state": str(result.state),
        "others": [vars(other) for other in others],
        "persistent": None if result.persistent is None else vars(result.persistent),
    }


def interrupted_flash(connections: Mapping[str, Callable[[], Controller]], image: Path) -> Interrupted:
    """After a download that was given up: what is on each controller now, asked on a link of its own. They have the
    names of their nodes, the only one perhaps none."""
    now = [_now_on(f"Node {node}" if node else "The device", connect, image) for node, connect in connections.items()]
    return Interrupted(" ".join(["Interrupted.", *now]), "interrupted")


def _now_on(device: str, connect: Callable[[], Controller], image: Path) -> str:
    from plctool.image.file import image_crc
    from plctool.link.services import AppState

    try:
        with connect() as plc:
            status = plc.raw_status()
    except PlcError as error:
        return f"{device} does not say what it has, see 'plctool status': {error.message}"
    if status.state is AppState.NONE:
        return f"{device} has no program."
    which = "the new" if status.image_crc == image_crc(read_image(image)) else "still the previous"
    return f"{device} has {which} program (CRC {status.image_crc:08X}), state: {status.state}."


def flash_several(
    plcs: Mapping[str, Plc],
    image: Path,
    *,
    start: bool = True,
    force: bool = False,
    progress: Callable[[str, int, int], None] = lambda node, done, total: None,
) -> tuple[Document, list[PlcError]]:
    """Brings an image onto several controllers at once. Returns also what went wrong; the document has it by node."""
    from concurrent.futures import ThreadPoolExecutor

    ended = Event()  # by Ctrl-C

    def one(node: str, plc: Plc) -> Document:
        def show(done: int, total: int) -> None:
            if ended.is_set():
                raise Interrupted("Interrupted.", "interrupted")
            progress(node, done, total)

        return {"node": node, **flash(plc, image, start=start, force=force, progress=show)}

    devices: list[Document] = []
    errors: list[PlcError] = []
    with ThreadPoolExecutor(len(plcs)) as threads:
        results = [(node, threads.submit(one, node, plc)) for node, plc in plcs.items()]
        for node, result in results:
            try:
                devices.append(result.result())
            except PlcError as error:
                errors.append(error)
                devices.append({"node": node, "error": {"code": error.code, "message": error.message}})
            except KeyboardInterrupt:
                ended.set()
                raise
    return {"devices": devices}, errors


def start(plc: Plc) -> Document:
    """Starts the program; the state that it leads to."""
    plc.start()
    return status(plc)


def stop(plc: Plc) -> Document:
    """Stops the program; the state that it leads to."""
    plc.stop()
    return status(plc)


def cycle(plc: Plc) -> Document:
    """Runs one cycle of a stopped program; the state that it leads to."""
    plc.cycle()
    return status(plc)


def reset(plc: Plc, option: str) -> Document:
    """Resets the program; the state that it leads to."""
    plc.reset(option)
    return status(plc)


def status(plc: Plc) -> Document:
    """Returns the state of the program, with the name and version that plc.toml gave it."""
    status = plc.status()
    return status_document(status) | {"program": program_document(plc) if status.image_crc else None}


def read(plc: Controller, names: Sequence[str]) -> tuple[Document, Texts]:
    """The values of variables, and how ST writes them."""
    reading = plc.sample(names)
    document = {"values": reading.values, "consistent": reading.consistent, "forced": reading.forced}
    return document, reading.marked_texts


def write(plc: Controller, texts: Mapping[str, str]) -> tuple[Document, Texts]:
    """Writes values as typed and reads them back."""
    table = plc.symbols()
    plc.write({name: table.resolve(name).parse(text) for name, text in texts.items()})
    return _read_back(plc, list(texts))


def _read_back(plc: Controller, names: Sequence[str]) -> tuple[Document, Texts]:
    reading = plc.sample(names)
    return {"values": reading.values, "forced": reading.forced}, reading.marked_texts


def force(plc: Controller, texts: Mapping[str, str]) -> tuple[Document, Texts]:
    """Forces values as typed and reads them back."""
    table = plc.symbols()
    plc.force({name: table.resolve(name).parse(text) for name, text in texts.items()})
    return _read_back(plc, list(texts))


def unforce(plc: Controller, names: Sequence[str]) -> tuple[Document, Texts]:
    """Ends the force of these variables, and reads them; of all without names."""
    if names:
        plc.unforce(names)
        return _read_back(plc, names)
    were = list(plc.forced())
    plc.unforce()
    return {"values": {}, "forced": [], "unforced": were}, {}


def forced(plc: Controller) -> tuple[Document, Texts]:
    """What is forced."""
    reading = plc.forced_reading()
    return {"values": reading.values, "forced": reading.forced}, reading.texts


def shell(plc: Plc, command: str) -> Document:
    """What the device's PLC shell answers."""
    return {"command": command, "answer": plc.shell(command)}


def passwd(plc: Plc, password: str | None) -> Document:
    """Sets or removes the password; whether there is one now."""
    plc.set_password(password)
    return {"password": password is not None}


# ---- on a link -------------------------------------------------------------------------------------------------------


def scan(link: Link, gateway: bool | None, tool: str, long: bool = False) -> Document:
    """Returns the controllers that answer on a link; if `long`, with what each of them runs. Raises LinkError when
    there are none."""
    return {"devices": _scan(link, gateway, tool, long)}


def scan_all(links: Sequence[Link], gateway: bool | None, tool: str, long: bool = False) -> Document:
    """Returns the same for several links, which are asked at the same time, each device with its link. Raises
    LinkError when there are none, with the reason of each link."""
    from concurrent.futures import ThreadPoolExecutor

    def ask(link: Link) -> list[Document] | LinkError:
        try:
            return [{"link": f"{link.scheme}:{link.place}", **found} for found in _scan(link, gateway, tool, long)]
        except LinkError as error:
            return error

    with ThreadPoolExecutor(max_workers=len(links)) as pool:
        answers = list(pool.map(ask, links))
    devices = [device for answer in answers if not isinstance(answer, LinkError) for device in answer]
    if not devices:
        reasons = " ".join(answer.message for answer in answers if isinstance(answer, LinkError))
        raise LinkError(f"No device answers on the serial ports of this machine. {reasons}", "no-answer")
    return {"devices": devices}


def _scan(link: Link, gateway: bool | None, tool: str, long: bool) -> list[Document]:
    from plctool.device import scan as nodes_on
    from plctool.image.file import target_name

    return [
        {
            "address": node.address_text,
            "node_name": node.node_name,
            "device_name": node.device_name,
            "vendor_name": node.vendor_name,
            "target": target_name(node.target_id),
            "version": node.version,
            "serial_number": node.serial_number,
            **({"place": node.place} if node.place else {}),
            **({"problem": "a component failed to start: see plctool log"} if node.left_out else {}),
            **(_runs_on(link, node, gateway, tool) if long else {}),
        }
        for node in nodes_on(link, gateway=gateway, tool=tool)
    ]


def _runs_on(link: Link, node: Node, gateway: bool | None, tool: str) -> Document:
    """Returns the state of a device and its program. A device that does not say gives the reason in place of its
    state, so that the others are listed."""
    from plctool.device import connect

    try:
        with connect(_link_to(link, node), gateway=gateway, tool=tool) as plc:
            found = status(plc)
    except PlcError as error:
        return {"state": error.code, "program": "", "program_version": ""}
    program = found["program"] or {"name": "", "version": ""}
    return {"state": found["state"], "program": program["name"], "program_version": program["version"]}


def _link_to(link: Link, node: Node) -> Link:
    """Returns the link to one of the devices that a scan of `link` found."""
    if link.nodes is not None:
        return link.of_node(str(int.from_bytes(node.address, "big")))
    return replace(link, place=node.place) if node.place else link


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


def gateways(port: str | None) -> Document:
    """What each gateway of this user does, or the one of a port."""
    from plctool.gateway.control import gateways as found

    return {"gateways": found(port)}


def stop_gateways(port: str | None) -> Document:
    """Ends the gateways of this user, or the one of a port."""
    from plctool.gateway.control import stop_gateways as stopped

    return {"stopped": stopped(port)}
