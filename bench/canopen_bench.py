"""CANopen: a day in the simulator, the start of many nodes, SDO on a simulated bus, and what a frame and SYNC cost on a
Cortex-M3."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests"))

from canopen_programs import eight_nodes, of_many_writes  # noqa: E402

from plctool.sim import Simulator  # noqa: E402

DAY = 86400  # [s]
NODES, WRITES = 16, 40
STEP_MS, LIMIT_MS = 10, 10_000
FIRMWARE = ROOT / "build-cm3/firmware/port/baremetal/firmware-canopen-manager.elf"


def line(what: str, figure: str, beside: str = "") -> None:
    print(f"  {what:<52}{figure:>14}  {beside}", flush=True)


def bench_day(folder: Path) -> None:
    with Simulator.from_sources(eight_nodes(folder / "day")) as plc:
        plc.run_for(3000)
        begin = time.monotonic()
        plc.run_for(seconds=DAY)
        seconds = time.monotonic() - begin
        assert all(plc.read(f"N{n}.ok") for n in range(1, 9))
        line(
            "a day of 8 nodes with a SYNC of 10 ms",
            f"{seconds:.1f} s",
            "goal 60 s",
        )


def bench_start(folder: Path) -> None:
    with Simulator.from_sources(of_many_writes(folder / "start", NODES, WRITES)) as plc:
        ms = 0
        while not all(plc.read(f"N{n}.ok") for n in range(1, NODES + 1)) and ms < LIMIT_MS:
            plc.run_for(STEP_MS)
            ms += STEP_MS
        line(f"{NODES} nodes with {WRITES} writes each, until all run", f"{ms} ms", "virtual time; goal 1500 ms")


def bench_sdo() -> None:
    done = subprocess.run([ROOT / "build/tests/c/canopen_share"], capture_output=True, text=True, check=True)
    for text in done.stdout.splitlines():
        name, size, seconds, share = text.split("\t")
        rate = int(size) / float(seconds)
        figure = f"{rate / 4:.0f} /s" if name.startswith("expedited") else f"{rate / 1e3:.2f} kB/s"
        line(f"SDO, {name}, 500 kbit/s", figure, f"{float(share):.0%} of the bus; goal 90 %")


def bench_board() -> None:
    if shutil.which("qemu-system-arm") is None or not FIRMWARE.exists():
        line("Cortex-M3", "left out", "needs qemu-system-arm and build-cm3; `make all` builds it")
        return
    sys.stdout.flush()
    subprocess.run([sys.executable, ROOT / "tests/target/canopen_overhead.py", FIRMWARE], check=True)


def main() -> None:
    print("\nCANopen")
    with TemporaryDirectory() as folder:
        bench_day(Path(folder))
        bench_start(Path(folder))
    bench_sdo()
    bench_board()


if __name__ == "__main__":
    main()
