"""Eight REALs of a 1 ms task, traced over a serial line: bytes of a packed sample, how many samples such a line carries
in a second, and whether any of a trace is lost while it waits in the buffer of plcrt."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from plctool.compiler import compile_sources
from plctool.core import ffi, lib
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.link.traces import TraceOptions
from plctool.sim import Simulator
from plctool.testing.line import SerialLine
from plctool.testing.plcrt import Plcrt

BAUD = 115200
COUNT = 8  # REALs
SAMPLES = 3000
MESSAGE = 1990  # bytes of samples in a message of a board
NAMES = [f"Main.v{i}" for i in range(COUNT)]


def _each(text: str, count: int = COUNT) -> str:
    return " ".join(text.format(i=i, n=i + 1) for i in range(count))


SIGNALS = {
    "constant": "",
    "ramps": _each("v{i} := v{i} + 0.25;"),
    "two sines, six constant": "t := t + 0.00628;" + _each("v{i} := SIN(t + {i}.0) * {n}0.0;", 2),
    "eight sines of 1 Hz": "t := t + 0.00628;" + _each("v{i} := SIN(t + {i}.0) * {n}0.0;"),
    "noise": _each("s := s * 1664525 + 1013904223; v{i} := UDINT_TO_REAL(SHR(s, 8)) / 1000.0;"),
}


def _source(body: str) -> str:
    names = ", ".join(f"v{i}" for i in range(COUNT))
    return f"""PROGRAM Main VAR {names}, t : REAL; s : UDINT; END_VAR {body} END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#1ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION"""


def packed_size(source: Path) -> float:
    """Bytes of a sample in a full message, on the virtual clock."""
    with Simulator.from_sources(source) as plc:
        plc.start_trace(NAMES, TraceOptions(samples=SAMPLES))
        plc.run_for(SAMPLES)
        data, size, state = ffi.new("RTS_UI8[]", MESSAGE), ffi.new("RTS_UI32 *", MESSAGE), ffi.new("TRACE_STATE *")
        packet = plc.next_trace(0)
        assert packet is not None
        lib.TraceRead(packet[0], 0, data, size, state)
        return float(size[0] / int.from_bytes(bytes(state.count), "little"))


def over_serial(source: Path, folder: Path) -> tuple[int, float]:
    """Samples that are lost of SAMPLES, and seconds until all have arrived."""
    image = folder / "trace.cdl"
    compile_sources([source]).write(image)
    with Plcrt(folder / "plc.flash") as plcrt, SerialLine(plcrt.port, BAUD) as line:
        transport = SerialTransport(line.path, BAUD, paced=True)
        with Plc(Connection(transport), image.with_suffix(".sym")) as plc:
            plc.flash(image)
            begin = time.perf_counter()
            found = plc.trace(NAMES, samples=SAMPLES)
            return found.lost, time.perf_counter() - begin


def main() -> None:
    print(f"\nA trace of {COUNT} REALs in each ms, {BAUD} baud: {SAMPLES} samples from plcrt")
    with tempfile.TemporaryDirectory() as name:
        for number, (what, body) in enumerate(SIGNALS.items()):
            folder = Path(name) / str(number)
            folder.mkdir()
            source = folder / "trace.st"
            source.write_text(_source(body))
            size = packed_size(source)
            lost, seconds = over_serial(source, folder)
            rate = SAMPLES / seconds
            print(
                f"  {what:<26}{size:6.1f} bytes a sample, {lost} lost, all there after {seconds:.1f} s ({rate:.0f}/s)"
            )


if __name__ == "__main__":
    main()
