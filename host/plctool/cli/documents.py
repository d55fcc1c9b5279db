"""What the commands do, as functions that return the document `--json` prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.errors import DeviceError, UsageError
from plctool.files import read_image

if TYPE_CHECKING:
    from plctool.compiler import Level
    from plctool.compiler.diagnostics import Diagnostic
    from plctool.compiler.warnings import WarningOptions
    from plctool.device import ExceptionInfo, Plc, PlcStatus
    from plctool.sim import Simulator

Document = dict[str, Any]
Texts = dict[str, str]
"""Values of variables by name, as ST writes them."""


class ProgramStopped(DeviceError):
    """The program ended with an exception. `exception` is for machines, in the words of `plctool status --json`."""

    def __init__(self, exception: ExceptionInfo) -> None:
        super().__init__(f"The program stopped: {exception}.", "exception")
        self.exception = _exception_document(exception)


# ---- files -----------------------------------------------------------------------------------------------------------


def build(
    paths: Sequence[Path],
    output: Path,
    target: str,
    level: Level,
    checks: str,
    debug: bool,
    warnings: WarningOptions,
) -> tuple[Document, list[str]]:
    """Compiles to `output` and the symbol file beside it. Returns the document and the warnings as people read them.

    Raises CompileError when the program has errors, UsageError when `output` would overwrite a source. Files appear
    complete or not at all.
    """
    from plctool.compiler import compile_sources
    from plctool.debug.symbols import symbol_path

    check_output(output, paths, f"-o {output.stem}.cdl")
    result = compile_sources(paths, target=target, level=level, checks=checks, debug=debug, warnings=warnings)
    result.write(output)
    document = {
        "image": str(output),
        "symbols": str(symbol_path(output)),
        "crc": f"{result.crc:08X}",
        "size": len(result.image),
        "target": target,
        "warnings": [diagnostic_document(w) for w in result.warnings],
    }
    return document, result.rendered_warnings


def check_output(output: Path, sources: Sequence[Path], better: str) -> None:
    """A file that is written takes the place of no source and of no symbol file. `better`: what to type instead."""
    from plctool.compiler.source_files import SUFFIXES

    is_source = output.suffix.lower() in SUFFIXES or output.resolve() in {source.resolve() for source in sources}
    if is_source or output.suffix == ".sym":
        kind = "source" if is_source else "symbol file"
        raise UsageError(f"{output} has the name of a {kind}; write for example {better}.", "bad-output")


def check(paths: Sequence[Path], warnings: WarningOptions) -> tuple[Document, list[str]]:
    """Every diagnosis of a program; the texts are as people read them."""
    from plctool.compiler import check_with_tests, load_sources
    from plctool.compiler.diagnostics import render_all

    sources = load_sources(paths)
    result = check_with_tests(sources, warnings)
    document = {"diagnostics": [diagnostic_document(d) for d in result.diagnostics]}
    return document, render_all(result.diagnostics, sources)


def export_interface(paths: Sequence[Path], folder: Path, force: bool) -> Document:
    """Writes the C header of the functions that are implemented in C, and a frame for them unless there is one.

    Raises CompileError when the sources have errors, UsageError when no function is implemented in C.
    """
    from plctool.compiler import CompileError, load_sources
    from plctool.compiler.export_itf import export_interface as export
    from plctool.compiler.front import check_sources
    from plctool.compiler.internal import bugs_reported
    from plctool.files import make_folder, write_atomically

    sources = load_sources(paths)
    with bugs_reported():
        program = check_sources(sources)
    if program.program is None:
        raise CompileError(program.diagnostics, sources)
    functions = program.program.externals
    if not functions:
        raise UsageError(
            "No function is implemented in C; mark those that are by {attribute 'external' := 'name'}.", "no-external"
        )
    interface = export(paths[0].resolve().stem, functions)
    header, source = folder / interface.header_name, folder / interface.source_name
    make_folder(folder)
    write_atomically(header, interface.header.encode("latin-1", "replace"))
    written = force or not source.exists()
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


def diagnostic_document(diagnostic: Diagnostic) -> Document:
    return vars(diagnostic)


def info(path: Path) -> Document:
    """Header, tables and POUs of an image; with its symbols also the bytes of code that each POU made."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.file import describe_image

    data = read_image(path)
    document = describe_image(data)
    try:
        table = find_symbols(int(document["crc"], 16), path)
    except UsageError:
        return document
    from plctool.compiler.build import code_sizes

    units = {unit.name: unit for unit in table.pous}
    document["pous"] = [
        {"name": name, "size": size, "file": units[name].file, "line": units[name].line}
        for name, size in code_sizes(table, document["code_size"]).items()
    ]
    return document


def variables(path: Path, patterns: Sequence[str]) -> Document:
    """The variables of an image, and parts of them, whose names match one of the patterns; without patterns all
    variables."""
    from plctool.debug.symbols import find_symbols
    from plctool.iec.areas import Area
    from plctool.image.file import describe_image

    symbols = find_symbols(int(describe_image(read_image(path))["crc"], 16), path)
    areas = {area.value: area.name.lower() for area in Area}
    return {
        "variables": [
            {"name": s.name, "type": str(s.type), "area": areas[s.area], "offset": s.offset, "size": s.size}
            for s in symbols.find(patterns)
        ]
    }


# ---- in this process -------------------------------------------------------------------------------------------------


def run(
    path: Path, cycles: int | None, time_ms: int | None, sets: Mapping[str, str], gets: Sequence[str]
) -> tuple[Document, Texts]:
    """Runs a program on a virtual clock for `cycles` of its first task or for `time_ms`. Returns the document, and the
    values as people read them.

    Raises DeviceError when the program stops with an exception.
    """
    from plctool.sim import Simulator

    with Simulator.from_file(path) as plc:
        assert plc.symbols
        for name in gets:
            plc.symbols.resolve(name)  # a wrong name is told before the run
        for name, text in sets.items():
            plc.write(name, plc.symbols.resolve(name).parse(text))
        if time_ms is None:
            plc.run_cycles(1 if cycles is None else cycles)
        else:
            plc.run_for(time_ms)
        _raise_exception(plc)
        tasks, reading = plc.tasks(), plc.sample(gets)
        document = {
            "values": reading.values,
            "cycles": tasks[0].cycles if tasks else 0,
            "time_ms": plc.now_ns / 1e6,
        }
        return document, reading.texts


def _raise_exception(plc: Simulator) -> None:
    from plctool.device import explain_exception

    exception = plc.status().exception
    if exception is None:
        return
    tasks = plc.tasks()
    task = tasks[exception.task].name if 0 <= exception.task < len(tasks) else None
    raise ProgramStopped(explain_exception(exception, task, plc.symbols))


def bench(path: Path, cycles: int) -> Document:
    """Real time per cycle of each task."""
    from plctool.sim import Simulator

    with Simulator.from_file(path) as plc:
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


# ---- on a device -----------------------------------------------------------------------------------------------------


def status(plc: Plc) -> Document:
    return status_document(plc.status())


def status_document(status: PlcStatus) -> Document:
    from plctool.link.services import AppState

    return {
        "state": str(status.state),
        "image_crc": None if status.state is AppState.NONE else f"{status.image_crc:08X}",
        "exception": None if status.exception is None else _exception_document(status.exception),
    }


def _exception_document(exception: ExceptionInfo) -> Document:
    return {**vars(exception), "calls": [vars(call) for call in exception.calls]}


def tasks(plc: Plc) -> Document:
    return {"tasks": [vars(task) for task in plc.tasks()]}


def read(plc: Plc, names: Sequence[str]) -> tuple[Document, Texts]:
    reading = plc.sample(names)
    return {"values": reading.values, "consistent": reading.consistent}, reading.texts


def write(plc: Plc, texts: Mapping[str, str]) -> tuple[Document, Texts]:
    """Writes values as typed and reads them back."""
    table = plc.symbols()
    plc.write({name: table.resolve(name).parse(text) for name, text in texts.items()})
    reading = plc.sample(list(texts))
    return {"values": reading.values}, reading.texts


def log(plc: Plc) -> Document:
    """The log; the exception that holds the program at present comes with its source line."""
    from plctool.core import lib

    names = {lib.LOG_INFO: "info", lib.LOG_WARNING: "warning", lib.LOG_ERROR: "error", lib.LOG_EXCEPTION: "exception",
             lib.LOG_DEBUG: "debug"}  # fmt: skip
    entries: list[Document] = [
        {
            "handle": entry.handle,
            "time_s": entry.time_ns / 1e9,
            "component": entry.component,
            "class": names.get(entry.log_class, f"0x{entry.log_class:X}"),
            "error": entry.error,
            "text": entry.text,
        }
        for entry in plc.log()
    ]
    exception = plc.status().exception
    last = next((e for e in reversed(entries) if e["class"] == "exception"), None)
    if exception and exception.file and last:
        known = _exception_document(exception)
        last |= {name: known[name] for name in ("pou", "file", "line", "calls")}
    return {"entries": entries}
