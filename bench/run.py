"""`make bench`: what the runtime and the compiled code cost, each figure beside its yardstick, all in one run.

Absolute times depend on the machine and its load; the ratios are what counts.
"""

from __future__ import annotations

import gc
import subprocess
import tempfile
import time
from pathlib import Path

import canopen_bench
import compiling
import editor_speed
import latency
import links
import modbus
import online_changes
import overheads
import page
import serial_share
import tanks
import targets
import tracing

from plctool.compiler import IoFiles, compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.sim import Simulator
from plctool.testing.line import BITS_PER_BYTE, SerialLine
from plctool.testing.plcrt import Plcrt

ROOT = Path(__file__).parents[1]
BAUD = 115200
CYCLES = 1000  # before the time is taken
CALLS = 900_000

EMPTY = "PROGRAM Main VAR x : INT; END_VAR END_PROGRAM"


def line(what: str, figure: str, beside: str = "") -> None:
    print(f"  {what:<52}{figure:>14}  {beside}", flush=True)


def build(text: str, description: str = "") -> BuildResult:
    """Compiles a program given as text, with a description of its inputs and outputs if there is one."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.st"
        path.write_text(text)
        if description:
            path.with_name("bench.io.toml").write_text(description)
        return compile_sources([path], io=IoFiles())


# ---- serial --------------------------------------------------------------------------------------------------------


def large_program(statements: int) -> str:
    """A program whose image is large: every statement is its own code."""
    body = "\n".join(
        f"a[{i % 50}] := a[{(i * 7) % 50}] * {i * 7919 + 13} + a[{(i * 3) % 50}];" for i in range(statements)
    )
    return f"PROGRAM Main VAR a : ARRAY[0..49] OF DINT; END_VAR\n{body}\nEND_PROGRAM"


def flash_seconds(image: bytes, packed: bool) -> float:
    """How long it takes until an image runs, over a paced line; the better of two."""
    return min(_flash_once(image, packed) for _ in range(2))


def _flash_once(image: bytes, packed: bool) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.cdl"
        path.write_bytes(image)
        with Plcrt(Path(folder) / "flash") as runtime, SerialLine(runtime.port, BAUD) as serial:
            transport = SerialTransport(serial.path, BAUD, paced=True)
            transport.is_slow = packed
            with Plc(Connection(transport)) as plc:
                begin = time.monotonic()
                plc.flash(path)
                return time.monotonic() - begin


def bench_serial() -> None:
    print(f"\nFlashing over a serial line of {BAUD} baud, to running (share: image bytes of what the line carries)")
    images = {
        "examples/tanks": compile_sources([ROOT / "examples/tanks"]).image,
        "a large program": build(large_program(4000)).image,
    }
    gc.collect()
    gc.freeze()  # what the compiler has left would be looked through again and again
    for name, image in images.items():
        seconds = {packed: flash_seconds(image, packed) for packed in (False, True)}
        for packed, taken in seconds.items():
            share = len(image) * BITS_PER_BYTE / BAUD / taken
            beside = f"share {share:.1%}" + (f"; {seconds[False] / taken:.2f} times as fast" if packed else "")
            line(f"{name}, {len(image)} bytes, {'packed' if packed else 'as it is'}", f"{taken:.2f} s", beside)
    serial_share.main(images)


# ---- CAN -------------------------------------------------------------------------------------------------------------


def bench_can() -> None:
    print(
        "\nA download over CAN on a simulated bus, by the longest message and packet, beside what ISO-TP allows at"
        "\nbest, and ISO-TP with the heads of the protocol"
    )
    done = subprocess.run([ROOT / "build/tests/c/can_share"], capture_output=True, text=True, check=True)
    for text in done.stdout.splitlines():
        name, longest, packet, size, seconds, isotp, framed = text.split("\t")
        rate = float(size) / float(seconds)
        line(
            f"{name}, {longest} in {packet}",
            f"{rate / 1e3:.2f} kB/s",
            f"ISO-TP {float(isotp) / 1e3:.2f}: {rate / float(isotp):.1%}; with the protocol {float(framed) / 1e3:.2f}: "
            f"{rate / float(framed):.1%}",
        )


# ---- cycles --------------------------------------------------------------------------------------------------------


def best_bench(result: BuildResult) -> list[tuple[str, float, float]]:
    """Task name, ns of its code, ns of a whole cycle; the best of three."""
    runs = []
    for _ in range(3):
        with Simulator(result.image, result.symbols) as plc:
            plc.run_cycles(CYCLES)
            runs.append([plc.bench(task, CALLS) for task in range(len(result.symbols.tasks))])
    return [
        (name, min(r[i][0] for r in runs), min(r[i][1] for r in runs)) for i, name in enumerate(result.symbols.tasks)
    ]


def bench_empty_task() -> None:
    print("\nOne cycle of an empty task")
    ((_, code, cycle),) = best_bench(build(EMPTY))
    line("call of the compiled code", f"{code:.1f} ns")
    line(
        "complete cycle: clock, code, statistics, watchdog",
        f"{cycle:.1f} ns",
        f"the runtime adds {cycle - code:.1f} ns",
    )


def image_program(size: int, *, shared: bool) -> str:
    """A task that uses `size` bytes, half of them inputs that it copies to as many outputs. `shared`: another task,
    which hardly ever runs, uses them too."""
    use = f"FOR i := 1 TO {size // 8} DO out[i] := in[i] + 1; END_FOR"
    rest = f"n := in[{size // 8}] + out[{size // 8}] + in[1] + out[1];" if shared else ""
    return (
        f"VAR_GLOBAL in AT %ID0 : ARRAY[1..{size // 8}] OF UDINT; out AT %QD0 : ARRAY[1..{size // 8}] OF UDINT; "
        f"END_VAR PROGRAM Main VAR i : INT; END_VAR {use} END_PROGRAM "
        f"PROGRAM Other VAR n : UDINT; END_VAR {rest} END_PROGRAM CONFIGURATION C RESOURCE R ON D "
        f"TASK A(INTERVAL := T#1ms); TASK B(INTERVAL := T#30m); PROGRAM Main WITH A : Main; "
        f"PROGRAM Other WITH B : Other; END_RESOURCE END_CONFIGURATION"
    )


def bench_image() -> None:
    print("\nOne cycle with inputs and outputs (half of the bytes each, all of them changed), with the lock of Linux")
    for size in (8, 32, 64):
        alone, both = (best_bench(build(image_program(size, shared=shared)))[0] for shared in (False, True))
        alone_ns, both_ns = alone[2] - alone[1], both[2] - both[1]
        line(
            f"{size} bytes that another task uses too", f"{both_ns:.1f} ns", f"{both_ns - alone_ns:+.1f} ns for copies"
        )


BUS = """[[modbus.rs485]]
port = "/dev/null"
baud = 115200
[[modbus.rs485.device]]
name = "Meter"
unit = 1
read = [{function = 4, address = 30001, every = "T#100ms", vars = ["Main.power", "Main.energy"]}]
[[modbus.rs485.device]]
name = "Valve"
unit = 2
read = [{function = 2, address = 10001, every = "T#100ms", var = "Main.open"}]
write = [{function = 16, address = 40001, every = "T#100ms", on_change = true, var = "Main.n"}]
[[modbus.tcp]]
host = "127.0.0.1"
[[modbus.tcp.device]]
name = "Drive"
read = [{function = 3, address = 40001, every = "T#100ms", var = "Main.speed"}]
"""


def bench_day() -> None:
    print("\nA day of PLC time with a 10 ms task, in the simulator")
    own = "n : UDINT; t : TON;"
    text = f"PROGRAM Main VAR {own} {{}} END_VAR n := n + 1; t(IN := NOT t.Q, PT := T#1s); END_PROGRAM"
    bus = text.format("power, energy : REAL; open : BOOL; speed : INT;")
    for devices, result in (((), build(text.format(""))), (("Meter", "Valve", "Drive"), build(bus, BUS))):
        with Simulator(result.image, result.symbols) as plc:
            begin = time.monotonic()
            plc.run_for(seconds=86400)
            seconds = time.monotonic() - begin
            assert all(plc.read(f"{name}.ok") and plc.read(f"{name}.errors") == 0 for name in devices)
            what = f"{plc.read('Main.n')} cycles" + " and three Modbus devices" * bool(devices)
            line(what, f"{seconds:.2f} s", f"{86400 / seconds:,.0f} times as fast")


def main() -> None:
    compiling.main()
    with targets.one_processor():
        bench_empty_task()
        bench_image()
        tanks.main()
    targets.main()
    overheads.main()
    bench_day()
    bench_serial()
    bench_can()
    canopen_bench.main()
    links.main()
    tracing.main()
    page.main()
    online_changes.main()
    latency.main()
    print("\nlanguage server, 10 000 lines in 100 files (median / 95 %)")
    editor_speed.report(line)
    modbus.main()


if __name__ == "__main__":
    main()
