"""What the runtime costs on a Cortex-M, in instructions, which repeat exactly: a task cycle, a task switch,
a variable read.

    overhead.py mps2-an385 build-cm3/firmware/port/baremetal/firmware-standard.elf

Counted by a plugin of QEMU on the running firmware. The program's own instructions are in it: one addition per cycle.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "host"), str(HERE.parents[1] / "build" / "host")]

from elftools.elf.elffile import ELFFile  # noqa: E402
from environment import TARGETS  # noqa: E402
from plugins import compile_plugin  # noqa: E402
from programs import Built, compile_text, program  # noqa: E402
from qemu import Board  # noqa: E402

from plctool.debug.symbols import symbol_path  # noqa: E402
from plctool.device import Plc  # noqa: E402
from plctool.link.connection import Connection  # noqa: E402
from plctool.link.traces import RunningTrace, TraceOptions  # noqa: E402

VARIABLES = 11
FORCED = 8
TRACED = 8
ENOUGH = 200  # counts
PATIENCE = 30.0  # [s]

Range = tuple[int, int]


class Firmware:
    """A firmware file and its functions by name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with path.open("rb") as file:
            symbols = ELFFile(file).get_section_by_name(".symtab").iter_symbols()
            found = [(s.name, s["st_value"] & ~1, s["st_size"]) for s in symbols if s["st_info"]["type"] == "STT_FUNC"]
        # A function that was optimised has a suffix.
        self.functions: dict[str, Range] = {name.split(".")[0]: (start, start + size) for name, start, size in found}


class Counter:
    """Counts on a board that has `built` in its flash already."""

    def __init__(self, machine: str, firmware: Firmware, built: Built, folder: Path) -> None:
        self.board = Board(machine, firmware.path, folder)
        self.firmware, self.built, self.folder = firmware, built, folder
        with self.board, Plc(Connection(self.board.line())) as plc:
            plc.flash(built.path)
        self.plugin = compile_plugin("count", self.board.qemu.program, folder)

    def count(self, start: str, end: Range, work: Callable[[Plc], None] = lambda plc: time.sleep(0.05)) -> int:
        """The usual number of instructions from function `start` to the range `end`, while `work` is repeated."""
        counts = self.counts(self.firmware.functions[start][0], end, work)
        return max(counts, key=lambda number: counts[number])

    def counts(
        self, begin: int, end: Range, work: Callable[[Plc], None] = lambda plc: time.sleep(0.05)
    ) -> dict[int, int]:
        """How often there was which number of instructions from an address to the range `end`."""
        out = self.folder / "counts"
        out.unlink(missing_ok=True)
        plugin = f"file={self.plugin},start={begin:#x},lo={end[0]:#x},hi={end[1]:#x},out={out}"
        self.board.power_on(plugin=plugin)
        give_up = time.monotonic() + PATIENCE
        counts: dict[int, int] = {}
        with Plc(Connection(self.board.line()), symbol_path(self.built.path)) as plc:
            while sum(counts.values()) < ENOUGH:
                work(plc)
                if out.exists():
                    lines = (line.split() for line in out.read_text().splitlines())
                    counts = {int(number): int(times) for number, times in lines}
                if time.monotonic() > give_up:
                    raise SystemExit(f"{begin:#x} was not seen often enough: {counts}")
        self.board.power_off()
        return counts


IMAGE_BYTES = 32  # half of them inputs


def image_program(*, shared: bool) -> str:
    """A task that copies inputs to outputs; `shared`: another task, which hardly ever runs, uses them too."""
    words = IMAGE_BYTES // 8
    moves = " ".join(f"out[{i}] := in[{i}];" for i in range(words))
    sums = " + ".join(f"in[{i}] + out[{i}]" for i in range(words))
    rest = f"n := {sums};" if shared else ""
    return f"""
VAR_GLOBAL in AT %ID0 : ARRAY[0..{words - 1}] OF UDINT; out AT %QD0 : ARRAY[0..{words - 1}] OF UDINT; END_VAR
PROGRAM Main {moves} END_PROGRAM
PROGRAM Other VAR n : UDINT; END_VAR {rest} END_PROGRAM
CONFIGURATION C
    RESOURCE R ON PLC
        TASK A(INTERVAL := T#1ms, PRIORITY := 1);
        TASK B(INTERVAL := T#30m, PRIORITY := 9);
        PROGRAM Main WITH A : Main;
        PROGRAM Other WITH B : Other;
    END_RESOURCE
END_CONFIGURATION
"""


def count_images(machine: str, firmware: Firmware, folder: Path) -> list[int]:
    """A cycle in which a task alone uses the inputs and outputs, and one in which it has copies of them. Between two
    cycles of the program nothing is written, so its outputs do not change."""
    counts = []
    for shared in (False, True):
        built = compile_text(image_program(shared=shared), TARGETS[machine], folder, checks="none")
        counts.append(Counter(machine, firmware, built, folder).count("AlarmIrq", firmware.functions["main"]))
    return counts


LINES = """
[gpio.in]
BUTTON0 = "Main.pressed"
[gpio.out]
LED0 = "Main.lit"
LED1 = "Main.dark"
"""


def count_lines(machine: str, firmware: Firmware, folder: Path) -> list[int]:
    """A cycle of a program without lines of the board, and with them."""
    text = program("VAR pressed, lit, dark : BOOL; END_VAR", "lit := pressed; dark := NOT pressed;")
    counts = []
    for described in (False, True):
        if described:
            (folder / "lines.io.toml").write_text(LINES)
        built = compile_text(text, TARGETS[machine], folder, checks="none")
        counts.append(Counter(machine, firmware, built, folder).count("AlarmIrq", firmware.functions["main"]))
    return counts


def count_forced(machine: str, firmware: Firmware, folder: Path) -> list[int]:
    """A cycle with nothing forced, one after that has ended, and one with FORCED numbers of four bytes."""
    names = [f"v{i}" for i in range(FORCED)]
    text = program(f"VAR n, {', '.join(names)} : DINT; END_VAR", "n := n + 1;")
    counter = Counter(machine, firmware, compile_text(text, TARGETS[machine], folder, checks="none"), folder)

    def force_and_end(plc: Plc) -> None:
        plc.force({"Main.v0": 1})
        plc.unforce()
        time.sleep(0.05)

    def force(plc: Plc) -> None:
        plc.force({f"Main.{name}": 1 for name in names})
        time.sleep(0.05)

    irq, end = "AlarmIrq", firmware.functions["main"]
    return [counter.count(irq, end), counter.count(irq, end, force_and_end), counter.count(irq, end, force)]


def count_traced(machine: str, firmware: Firmware, folder: Path) -> list[int]:
    """A cycle with nothing traced, one after that has ended, and one with TRACED REALs."""
    names = [f"v{i}" for i in range(TRACED)]
    text = program(f"VAR n : DINT; {', '.join(names)} : REAL; END_VAR", "n := n + 1;")
    counter = Counter(machine, firmware, compile_text(text, TARGETS[machine], folder, checks="none"), folder)
    running: list[RunningTrace] = []

    def trace_and_end(plc: Plc) -> None:
        plc.start_trace(["Main.v0"], TraceOptions()).end()
        time.sleep(0.05)

    def trace(plc: Plc) -> None:
        if not running:
            running.append(plc.start_trace([f"Main.{name}" for name in names], TraceOptions(keep=True)))
        time.sleep(0.05)

    irq, end = "AlarmIrq", firmware.functions["main"]
    return [counter.count(irq, end), counter.count(irq, end, trace_and_end), counter.count(irq, end, trace)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("machine", choices=TARGETS)
    parser.add_argument("firmware", type=Path)
    args = parser.parse_args()
    firmware = Firmware(args.firmware.resolve())
    names = [f"v{i}" for i in range(VARIABLES)]
    text = program(f"VAR {', '.join(names)} : DINT; END_VAR", "v0 := v0 + 1;")
    full_names = [f"Main.{name}" for name in names]
    with tempfile.TemporaryDirectory() as folder:
        built = compile_text(text, TARGETS[args.machine], Path(folder), checks="none")
        counter = Counter(args.machine, firmware, built, Path(folder))
        main_loop, enter = firmware.functions["main"], firmware.functions["IecCall"]
        cycle = counter.count("AlarmIrq", main_loop)
        until_program = counter.count("AlarmIrq", (enter[0], enter[0] + 2))
        caller = firmware.functions["ChannelHandlePackage"]
        one = counter.count("SrvHandleMessage", caller, lambda plc: plc.read_all(full_names[:1]) and None)
        more = counter.count("SrvHandleMessage", caller, lambda plc: plc.read_all(full_names) and None)
        alone, shared = count_images(args.machine, firmware, Path(folder))
        can_force = "mon_force" in firmware.functions
        forced = count_forced(args.machine, firmware, Path(folder)) if can_force else []
        can_trace = "TraceCreate" in firmware.functions
        traced = count_traced(args.machine, firmware, Path(folder)) if can_trace else []
        lines = count_lines(args.machine, firmware, Path(folder)) if "IoDrvGpio_Hook" in firmware.functions else []
    print(f"{args.machine}: instructions of the runtime, {args.firmware.stem}")
    print(f"{cycle:6}  a task cycle: from the alarm's interrupt back to the main loop")
    print(f"{until_program:6}    of it the switch to the task: until its program begins")
    print(
        f"{shared - alone:6}  more for copies of {IMAGE_BYTES} bytes of inputs and outputs that another task uses too"
    )
    if lines:
        print(f"{lines[1] - lines[0]:6}  more for three lines of the board: one input, two outputs")
    if forced:
        print(f"{forced[2] - forced[0]:6}  more for {FORCED} forced numbers")
        print(f"{forced[1] - forced[0]:6}  more when the force of all has ended")
    if traced:
        print(f"{traced[2] - traced[0]:6}  more for {TRACED} traced REALs")
        print(f"{traced[1] - traced[0]:6}  more when the trace has ended")
    print(f"{one:6}  a request that reads one variable")
    print(f"{(more - one) / (VARIABLES - 1):6.0f}  each further variable")


if __name__ == "__main__":
    main()
