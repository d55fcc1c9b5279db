"""A plant that is a program in ST: what the inputs and outputs of a simulated controller are connected to.

A process has one runtime, so the plant runs in another, on a virtual clock of its own that follows the controller's.
Its variables are found by the names of the controller's channels: for the channel `motor` of the device `Bench` it has
a variable `Bench_motor` or `motor` in one of its programs; so it has for the channel `Main.motor` of a bus. Outputs of
the controller are written to the plant, and what the plant makes of them is what the inputs measure.
"""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from plctool.debug.symbols import SymbolTable, find_symbols
from plctool.errors import DeviceError, PlcError, UsageError
from plctool.iec.types import StructType
from plctool.image.file import image_crc, read_program
from plctool.sim import Simulator


class PlantProgram:
    """The program in an image, to be attached: `plc.attach(plant, plant.every_ms)`. Use it as a context manager. Raises
    DeviceError if the image is refused."""

    def __init__(self, image: bytes, symbols: SymbolTable) -> None:
        command = [sys.executable, "-m", __name__]
        self._process = subprocess.Popen(  # Ctrl-C is for this process: the plant ends with it
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )
        self._symbols = symbols
        self._names: dict[str, tuple[bool, str]] | None = None  # by channel: whether it is an output, and the variable
        self._now_ns = 0
        try:
            interval_us = self._ask({"image": image.hex(), "symbols": symbols.to_json()})["interval_us"]
        except BaseException:
            self.close()
            raise
        self.every_ms = interval_us / 1000

    @classmethod
    def from_file(cls, path: Path | str) -> PlantProgram:
        """The program in `plant.cdl` with its symbols (`plant.sym` beside it)."""
        image = read_program(Path(path))
        return cls(image, find_symbols(image_crc(image), Path(path)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends its process; harmless when repeated."""
        if self._process.stdin and self._process.stdout:
            with suppress(BrokenPipeError):  # it has ended, and a request is left
                self._process.stdin.close()
            self._process.wait(timeout=10)
            self._process.stdout.close()

    def __call__(self, plc: Simulator) -> None:
        """A step: as much time passes in the plant as in the controller. Raises DeviceError if the plant has an
        exception, UsageError if none of its variables has the name of a channel."""
        if self._names is None:
            self._names = self._connections(plc)
        given = {variable: plc.output(c) for c, (output, variable) in self._names.items() if output}
        wanted = {c: variable for c, (output, variable) in self._names.items() if not output}
        began = self._now_ns if self._now_ns <= plc.now_ns else 0  # after a restart its clock begins again
        passed, self._now_ns = plc.now_ns - began, plc.now_ns
        values = self._ask({"set": given, "ns": passed, "get": list(wanted.values())})["values"]
        for channel, variable in wanted.items():
            plc.set_input(channel, values[variable])

    def _connections(self, plc: Simulator) -> dict[str, tuple[bool, str]]:
        own: dict[tuple[str, bool], str] = {}  # a tank is not the lamp of the same name
        for name, symbol in self._symbols.variables.items():
            own.setdefault((_last(name), isinstance(symbol.type, StructType)), name)
        found = {}
        for c in (c for c in plc.io.channels if c.enabled):
            name, whole = _last(c.name), isinstance(c.symbol.type, StructType)
            variable = own.get((f"{c.device}_{name}".casefold(), whole)) or own.get((name, whole))
            if variable is not None:
                found[c.title] = (c.output, variable)
        if not found:
            names = ", ".join(_last(c.name) for c in plc.io.channels)
            raise UsageError(f"The plant has none of the variables {names}; declare those that it needs.", "no-plant")
        return found

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin
        assert self._process.stdout
        ended = '{"error": "its process ended"}'
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline() or ended
        except BrokenPipeError:
            line = ended
        reply: dict[str, Any] = json.loads(line)
        if "error" in reply:
            raise DeviceError(f"The plant failed: {reply['error']}", "plant")
        return reply


def _last(name: str) -> str:
    """`motor` of `Main.motor`, for comparison."""
    return name.rpartition(".")[2].casefold()


def _serve() -> None:
    """The process of a plant: answers requests until there are no more."""
    plc: Simulator | None = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if plc is None:
                plc = Simulator(bytes.fromhex(request["image"]), SymbolTable.from_json(request["symbols"]))
                reply: dict[str, Any] = {"interval_us": next((t.interval_us for t in plc.tasks()), 0) or 1000}
            else:
                reply = {"values": _step(plc, request)}
        except PlcError as error:
            reply = {"error": error.message}
        print(json.dumps(reply), flush=True)


def _step(plc: Simulator, request: dict[str, Any]) -> dict[str, Any]:
    plc.write(request["set"])
    plc.run_for(request["ns"] / 1e6)
    return plc.read_all(request["get"])


if __name__ == "__main__":
    _serve()
