"""What CANopen costs on a Cortex-M3, in instructions: a PDO that is received, and how exact SYNC is.

    canopen_overhead.py build-cm3/firmware/port/baremetal/firmware-canopen-manager.elf

Counted by a plugin of QEMU on the running firmware (overhead.py).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import overhead  # noqa: E402
from canopen_programs import with_more_pdos, write_program  # noqa: E402
from elftools.elf.elffile import ELFFile  # noqa: E402
from environment import TARGETS  # noqa: E402
from programs import Built  # noqa: E402

from plctool.compiler import compile_sources  # noqa: E402
from plctool.debug.symbols import symbol_path  # noqa: E402
from plctool.link.canbus import open_bus  # noqa: E402
from plctool.testing.waiting import eventually  # noqa: E402

MACHINE = "mps2-an385"
NODES, PDOS = 4, 8  # of each
MHZ = 25  # of the board: about as many instructions in a microsecond


def functions_named(firmware: Path, name: str) -> list[overhead.Range]:
    """Functions that may be static, in order of their addresses."""
    with firmware.open("rb") as opened:
        symbols = ELFFile(opened).get_section_by_name(".symtab").iter_symbols()
        starts = [
            (s["st_value"] & ~1, s["st_size"])
            for s in symbols
            if s["st_info"]["type"] == "STT_FUNC" and s.name.split(".")[0] == name
        ]
    if not starts:
        raise SystemExit(f"{firmware} has no {name}")
    return sorted((start, start + size) for start, size in starts)


def handler_of(counter: overhead.Counter) -> int:
    """The handler that gets each frame of 11 bits, from the memory of the board."""
    counter.board.power_on()
    place = counter.board.address_of("urgent")
    address = eventually(lambda: int.from_bytes(counter.board.read_memory(place, 4), "little"))
    counter.board.power_off()
    return address & ~1


def of_many_pdos(folder: Path) -> Path:
    """Sources with NODES x PDOS inputs of eight bytes, and a SYNC of 10 ms."""
    names = [f"n{n}_{i}" for n in range(1, NODES + 1) for i in range(1, PDOS + 1)]
    path = write_program(folder, source=f"PROGRAM Main VAR {', '.join(names)} : ULINT; END_VAR END_PROGRAM")
    eds = folder / "valves.eds"
    eds.write_text(with_more_pdos(eds.read_text(), PDOS))
    nodes = "".join(
        f'[[canopen.device]]\nname = "N{n}"\nnode = {n}\neds = "valves.eds"\nheartbeat = "T#10s"\nin = {{ '
        + ", ".join(f'"6444:{i:02X}" = "Main.n{n}_{i}"' for i in range(1, PDOS + 1))
        + " }\n"
        for n in range(1, NODES + 1)
    )
    (folder / "app.io.toml").write_text('[[canopen]]\nname = "Bus"\nnode = 127\nsync = { every = "T#10ms" }\n' + nodes)
    return path


def build(folder: Path) -> Built:
    source = of_many_pdos(folder)
    program = compile_sources([source], target=TARGETS[MACHINE], limits=False)
    path = source.with_suffix(".cdl")
    path.write_bytes(program.image)
    program.symbols.save(symbol_path(path))
    return Built(program.image, path, program.symbols)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("firmware", type=Path)
    args = parser.parse_args()
    path = args.firmware.resolve()
    with tempfile.TemporaryDirectory() as folder:
        counter = overhead.Counter(MACHINE, overhead.Firmware(path), build(Path(folder) / "program"), Path(folder))
        handler, caller = handler_of(counter), functions_named(path, "CmpCan_Hook")[-1]
        counts = counter.counts(handler, caller, lambda plc: send(counter))
        usual = max(counts, key=lambda number: counts[number])
        line(f"a PDO of {NODES * PDOS} arrives, {MACHINE}", f"{usual}", "instructions of the handler; goal 150")
        (sync,) = functions_named(path, "call_sync")
        counts = counter.counts(counter.firmware.functions["AlarmIrq"][0], sync)
        span = f"{min(counts)} to {max(counts)} instructions after the timer; goal 20 us beside a frame"
        line("SYNC is late, at most", f"{(max(counts) - min(counts)) / MHZ:.1f} us", span)


def line(what: str, figure: str, beside: str) -> None:
    print(f"  {what:<52}{figure:>14}  {beside}")


def send(counter: overhead.Counter) -> None:
    """A frame of each node's PDOs."""
    bus = open_bus(counter.board.can, 500000, 0)
    try:
        for node in range(1, NODES + 1):
            for function in (0x180, 0x280, 0x380, 0x480):
                bus.send(frame(function + node))
        time.sleep(0.1)
    finally:
        bus.shutdown()


def frame(number: int) -> object:
    import can

    return can.Message(arbitration_id=number, data=bytes(8), is_extended_id=False)


if __name__ == "__main__":
    main()
