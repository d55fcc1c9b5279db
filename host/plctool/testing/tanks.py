"""examples/tanks with its plant as a process, a Modbus device of pymodbus, at a free port: for the demo and tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from plctool.errors import UsageError
from plctool.testing.children import ends_with_us

_DESCRIBED_PORT = "port = 5020"


def examples() -> Path:
    """The folder of examples: in the installed package, or at the root of the source tree."""
    package = Path(__file__).parents[1]
    inside = package / "examples"
    return inside if inside.is_dir() else package.parents[1] / "examples"


def describe_tanks(folder: Path, port: int) -> Path:
    """The description of the example in a file of `folder`, with another port of the plant."""
    text = (examples() / "tanks" / "tanks.io.toml").read_text()
    assert text.count(_DESCRIBED_PORT) == 1
    description = folder / "tanks.io.toml"
    description.write_text(text.replace(_DESCRIBED_PORT, f"port = {port}"))
    return description


class PlantServer:
    """Context manager around the process of examples/tanks/plant_server.py; `port` is where it listens on 127.0.0.1.
    Raises UsageError when it does not start, for example without pymodbus."""

    port = 0

    def __enter__(self) -> PlantServer:
        command = [sys.executable, str(examples() / "tanks" / "plant_server.py"), "--port", "0"]
        self._process = subprocess.Popen(
            ends_with_us(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        said = self._line()
        if not said.startswith("modbus: "):
            reason = self._process.communicate()[1].strip()
            raise UsageError(reason or f"The plant did not start: {said}", "no-plant")
        self.port = int(said.rpartition(":")[2])
        return self

    def __exit__(self, *exc: object) -> None:
        self._process.kill()
        self._process.communicate()

    def press_enter(self) -> str:
        """Pulls the bus, or plugs it in again; what the process says of it."""
        assert self._process.stdin
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return self._line()

    def _line(self) -> str:
        assert self._process.stdout
        return self._process.stdout.readline().strip()
