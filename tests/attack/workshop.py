"""The programs of the campaigns, compiled once, and what a flash holds after they ran."""

from __future__ import annotations

import platform
import tempfile
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from simulated import Device, Ended, Flash, Geometry, die_with_parent

from plctool.core import lib

PROVING_MS = 4000  # longer than a new program takes to prove itself

GOOD = """
PROGRAM Main
VAR
    n : DINT;
    me : DINT := {number};
    i : DINT;
END_VAR
VAR RETAIN
    first : DINT;
    kept : ARRAY[0..19] OF DINT;
    last : DINT;
END_VAR
n := n + 1;
first := first + 1;
FOR i := 0 TO 19 DO
    kept[i] := first;
END_FOR
last := first;
{more}
END_PROGRAM
"""

# Dies by itself, but not at once: half of the proving time after its start.
DYING = """
PROGRAM Main
VAR
    n : DINT;
    zero : DINT;
END_VAR
n := n + 1;
IF n > 150 THEN
    n := n / zero;
END_IF
END_PROGRAM
"""

# Takes a while to download.
MORE = "\n".join(f"i := i * {number} + n;" for number in range(3, 3000))

GOOD_NAMES = ("good1", "good2", "good3", "large")
SOURCES = {
    name: GOOD.format(number=number, more=MORE if name == "large" else "") for number, name in enumerate(GOOD_NAMES, 1)
} | {"dying": DYING}


@dataclass(frozen=True)
class Program:
    """An image and its symbol file."""

    name: str
    image: bytes
    symbols: Path

    @property
    def crc(self) -> int:
        return int.from_bytes(self.image[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4], "little")


def _compile(job: tuple[str, str, str, Path]) -> tuple[str, bytes, str]:
    """Name, image and what the compiler says when there is none."""
    name, text, checks, folder = job
    from plctool.compiler import CompileError, compile_sources
    from plctool.debug.symbols import symbol_path

    source = folder / f"{name}.st"
    source.write_text(text)
    try:
        built = compile_sources([source], target=f"{platform.machine()}-linux", checks=checks, limits=False)
    except CompileError as error:
        return name, b"", str(error)
    built.symbols.save(symbol_path(source.with_suffix(".cdl")))
    return name, built.image, ""


def compile_all(sources: dict[str, str], folder: Path, jobs: int, checks: str = "all") -> dict[str, Program]:
    """Compiles programs by name, in processes of their own, which take the compiler's memory with them."""
    work = [(name, text, checks, folder) for name, text in sources.items()]
    programs = {}
    with ProcessPoolExecutor(jobs, get_context("fork"), die_with_parent) as pool:
        for name, image, error in pool.map(_compile, work):
            if error:
                raise SystemExit(f"{name}: {error}")
            programs[name] = Program(name, image, folder / f"{name}.sym")
    return programs


@dataclass
class Workshop:
    """What all campaigns work with. `plcrt`: the runtime to attack. `jobs`: processes side by side."""

    folder: Path
    programs: dict[str, Program]
    plcrt: Path
    jobs: int
    seed: int

    def __getitem__(self, name: str) -> Program:
        return self.programs[name]

    def by_crc(self, crc: int) -> Program | None:
        return next((program for program in self.programs.values() if program.crc == crc), None)

    def add(self, sources: dict[str, str], checks: str = "all") -> None:
        """Compiles more programs."""
        self.programs |= compile_all(sources, self.folder, self.jobs, checks)

    def add_image(self, name: str, image: bytes, like: str) -> None:
        """An image that was made of another one; its symbols are those."""
        self.programs[name] = Program(name, image, self.programs[like].symbols)

    def history(self, geometry: Geometry, *names: str) -> bytes:
        """What the flash holds after these programs, one after the other, were downloaded, started and, but for one
        that dies before, have proven themselves."""
        key = (geometry, names)
        if key not in self._histories:
            self._histories[key] = self._live_through(geometry, names)
        return self._histories[key]

    def __post_init__(self) -> None:
        self._histories: dict[tuple[Geometry, tuple[str, ...]], bytes] = {}

    def _live_through(self, geometry: Geometry, names: Iterable[str]) -> bytes:
        flash = Flash(geometry)

        def live(device: Device) -> None:
            for name in names:
                device.plc.flash(self[name].image, unchecked=True)
                device.run(PROVING_MS)

        ended = flash.power(live)
        assert ended == Ended("used"), f"{names}: {ended}"
        return flash.content()


def open_workshop(plcrt: Path, jobs: int, seed: int) -> tuple[Workshop, tempfile.TemporaryDirectory[str]]:
    """A workshop in a folder of its own, which goes with it."""
    folder = tempfile.TemporaryDirectory(prefix="attack-")
    place = Path(folder.name)
    return Workshop(place, compile_all(SOURCES, place, jobs), plcrt, jobs, seed), folder
