"""`plctool run`, `bench`: a program in this process."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_image, count, duration_ms, pairs, utf8
from plctool.cli.builds import Built, program_to_run, simulator
from plctool.cli.documents import Document, Texts
from plctool.cli.output import values_text
from plctool.cli.overwriting import check_output, output_or
from plctool.cli.parser import Parser
from plctool.cli.plants import attached, files_of_plant, plan_faults
from plctool.cli.sim_files import device_files
from plctool.errors import UsageError, counted
from plctool.files import STDOUT, usable_path, write_output

if TYPE_CHECKING:
    from plctool.io.faults import Fault
    from plctool.sim import Simulator

BENCH_CYCLES = 10000


def run_arguments(command: Parser) -> None:
    add_image(command, "which is compiled for this machine")
    length = command.add_mutually_exclusive_group()
    length.add_argument("--cycles", type=count, metavar="N", help="number of cycles of the first task; default: 1")
    length.add_argument("--time", type=duration_ms, metavar="T#10s", help="how much virtual time, instead of cycles")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        type=utf8,
        metavar="NAME=VALUE",
        help="set before the first cycle; may be repeated",
    )
    command.add_argument(
        "--get",
        action="append",
        default=[],
        type=utf8,
        metavar="NAME",
        help="print after the last cycle; may be repeated",
    )

    command.add_argument(
        "--plant",
        type=usable_path,
        metavar="FILE.py|.st|.cdl",
        help="what the inputs and outputs are connected to: Python with 'def step(plc)', or a program (docs/io.md)",
    )
    command.add_argument(
        "--fault",
        action="append",
        default=[],
        type=utf8,
        metavar="DEVICE=FAULT",
        help="of a simulated device, with value and time: Tank=late:150@T#5s (docs/io.md); may be repeated",
    )
    command.add_argument(
        "--files", type=usable_path, metavar="FOLDER",
        help="the files that the device has, which the program reads and changes (docs/library.md)",
    )  # fmt: skip
    command.add_argument(
        "--trace", nargs="+", action="extend", default=[], type=utf8, metavar="NAME",
        help="write the values after each cycle to a file; may be repeated",
    )  # fmt: skip
    command.add_argument(
        "-o",
        "--output",
        type=usable_path,
        metavar="FILE",
        help="of --trace: FILE.csv, .json, .html or .png, - for the standard output; default: trace.csv",
    )
    command.set_defaults(action=_run)


def bench_arguments(command: Parser) -> None:
    add_image(command, "which is compiled for this machine")
    command.add_argument("--cycles", type=count, default=BENCH_CYCLES, metavar="N", help=f"default: {BENCH_CYCLES}")
    command.set_defaults(action=_bench)


def _run(args: argparse.Namespace) -> int:
    from plctool.io.faults import parse_fault

    if args.output and not args.trace:
        raise UsageError("-o is the file of --trace; write for example --trace 'Main.*' -o trace.csv.", "usage")
    output.check_one_output(args)
    trace = TraceFile(args.trace, output_or(args, "trace.csv")) if args.trace else None
    faults = [parse_fault(text) for text in args.fault]
    document, texts = run(
        program_to_run(args),
        args.cycles,
        args.time,
        pairs(args.set),
        args.get,
        args.plant,
        trace,
        faults,
        aside=args.json or args.output == STDOUT,
        files=args.files,
    )
    return output.show(args, document, lambda d: run_text(d, texts), output.beside_output(args))


@dataclass(frozen=True)
class TraceFile:
    """Variables whose values after each cycle of the first task go to a file, as CSV."""

    names: Sequence[str]
    path: Path


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
    files: Path | None = None,
) -> tuple[Document, Texts]:
    """Runs a program on a virtual clock for `cycles` of its first task or for `time_ms`. Returns the document, and the
    values as users read them. `plant`: what the inputs and outputs are connected to, which prints to stderr if `aside`;
    `faults`: what happens to that. `files`: the folder that has the files of the device.

    Raises DeviceError when the program stops with an exception; what was traced until then is in its file.
    """
    if trace:
        check_output(trace.path, _inputs(program, plant), "-o trace.csv")
    with simulator(program) as plc:
        table = plc.symbols()
        table.select([*gets, *(trace.names if trace else ())])  # a wrong name is reported before the run
        plc.write({name: table.resolve(name).parse(text) for name, text in sets.items()})
        plan_faults(plc, faults)
        with (
            device_files(plc, files) if files is not None else nullcontext(),
            attached(plc, plant, aside) if plant is not None else nullcontext(),
        ):
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


def _run_traced(plc: Simulator, cycles: int | None, time_ms: float | None, trace: TraceFile) -> None:
    """As `run`, in steps."""
    from plctool.trace_file import check_format, recording_of, render, run_recorded, trace_csv

    if trace.path.suffix.lower() in (".json", ".html", ".png"):
        check_format(trace.path)
        recording = recording_of(plc, trace.names)
        try:
            run_recorded(plc, trace.names, cycles, time_ms, recording)
        finally:
            write_output(trace.path, render(recording, trace.path))
        plc.check_running()
        return
    lines: list[str] = []
    try:
        lines.extend(trace_csv(plc, trace.names, cycles, time_ms))
    finally:  # also of a run that the user or a plant has ended
        write_output(trace.path, "".join(lines).encode())
    plc.check_running()


def run_text(document: dict[str, Any], texts: dict[str, str]) -> str:
    """Values as ST writes them, how long it ran, and the file of a trace."""
    trace = f"; the values are in {document['trace']}" if "trace" in document else ""
    return (
        f"{values_text(texts)}\n{counted(document['cycles'], 'cycle')}, {document['time_ms']:.10g} ms{trace}".lstrip()
    )


def _bench(args: argparse.Namespace) -> int:
    return output.show(
        args, bench(program_to_run(args), args.cycles), lambda d: output.table(d["tasks"], d["tasks"][0])
    )


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
