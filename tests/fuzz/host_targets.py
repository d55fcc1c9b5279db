"""What plctool reads, as fuzz targets: each takes any bytes and raises nothing but errors with plctool's own words."""

from __future__ import annotations

import io
import random
import re
import struct
import tempfile
import zipfile
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from plctool.cli.links import project_link
from plctool.cli.source_archive import Archive, unpacked
from plctool.compiler import check_with_tests, compile_sources, load_io
from plctool.compiler.sources.library_files import read_library
from plctool.compiler.sources.project import read_project
from plctool.compiler.sources.source_files import load
from plctool.core import lib
from plctool.debug.symbols import SymbolTable
from plctool.device import Plc
from plctool.errors import DeviceError, LinkError, UsageError
from plctool.files import Pos
from plctool.gateway.frames import Decoder, Frame, FrameError, Kind, Reply, Request, encode
from plctool.image.board import find_board
from plctool.image.file import describe_image, parse_image
from plctool.image.production import describe_production, production_pieces, write_production
from plctool.io.canopen.dcf import NodeOf, dcf_of, writes_of_dcf
from plctool.io.canopen.eds import load_eds, read_eds
from plctool.io.canopen.nodelist import ListedNode, nodelist_text, read_nodelist
from plctool.io.mistakes import Mistakes
from plctool.link import bintag, file_services, io_services, l7, router, services, simplecom
from plctool.link.connection import PATIENCE, Connection
from plctool.link.session import Session
from plctool.link.sim import SimTransport
from plctool.sim import Simulator
from plctool.v3.component import export_component
from plctool.v3.m4_interface import read_m4

ROOT = Path(__file__).parents[2]
_temporary = tempfile.TemporaryDirectory(prefix="fuzz-")  # as long as this process
FOLDER = Path(_temporary.name)
PROGRAM = "PROGRAM Main VAR n : INT; in1 AT %IX0.0 : BOOL; name : STRING; END_VAR n := n + 1; END_PROGRAM\n"


def in_file(name: str, data: bytes) -> Path:
    """In a folder with others that have this name before the first dot: a program has what lies beside it."""
    path = FOLDER / name.partition(".")[0] / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(data)
    return path


# ---- what a device says ----

READERS: tuple[Callable[[Session], object], ...] = (
    services.read_identity,
    services.read_stack,
    services.read_status,
    services.read_tasks,
    services.read_application_info,
    services.read_log,
    file_services.list_files,
    io_services.list_devices,
    lambda session: services.run_shell(session, "?"),
    lambda session: file_services.read_file(session, "log"),
    lambda session: services.set_password(session, "long enough"),
    lambda session: services.prepare_download(session, bytes(100)),
    lambda session: list(io_services.scan(session, 1)),
    lambda session: session.application(),
)
MAX_REPLIES = 30  # or packets


class Replies(Connection):
    """Replies from a list; when it is empty the channel is lost."""

    def __init__(self, contents: Iterable[bytes]) -> None:
        super().__init__(SimTransport())
        self._contents = iter(contents)

    is_open = True
    buffer_size = best_size = 2048
    is_slow = False
    is_bus = False

    def exchange(self, message: bytes, patience: float = PATIENCE, *, more: bool = False) -> bytes:
        asked = l7.decode(message)
        content = next(self._contents, None)
        if content is None:
            raise LinkError("The device is gone.", "timeout")
        return l7.encode(l7.Message(asked.group | lib.L7_REPLY, asked.service, asked.session, content))

    def stream(self, messages: Iterable[bytes], *rest: object, **options: object) -> Iterator[bytes]:  # type: ignore[override]
        return map(self.exchange, messages)


class Recorded(Connection):
    """A connection to the simulator that keeps the contents of replies."""

    def __init__(self) -> None:
        super().__init__(SimTransport())
        self.contents: list[bytes] = []

    def stream(self, *args: Any, **options: Any) -> Generator[bytes, None, None]:
        for reply in super().stream(*args, **options):
            self.contents.append(l7.decode(reply).content)
            yield reply


def pieces(data: bytes) -> list[bytes]:
    """Byte strings, each after its length (16 bits)."""
    found = []
    while len(data) >= 2 and len(found) < MAX_REPLIES:
        (size,) = struct.unpack_from("<H", data)
        found.append(data[2 : 2 + size])
        data = data[2 + size :]
    return found


def joined(found: Iterable[bytes]) -> bytes:
    return b"".join(struct.pack("<H", len(piece)) + piece for piece in found)


def replies(data: bytes) -> None:
    if data:
        with suppress(DeviceError, LinkError):
            READERS[data[0] % len(READERS)](Session(Replies(pieces(data[1:]))))


def recorded_replies() -> Iterator[bytes]:
    result = compile_sources([in_file("recorded.st", PROGRAM.encode())])
    for number, reader in enumerate(READERS):
        with Simulator(result.image, result.symbols):
            recorded = Recorded()
            with suppress(DeviceError, LinkError, UsageError):
                reader(Session(recorded))
        yield bytes([number]) + joined(recorded.contents)


class Packets(SimTransport):
    """Packets from a list; time passes when there are none."""

    name = "packets"

    def __init__(self, packets: Iterable[bytes]) -> None:
        self._packets = iter(packets)
        self._now = 0.0

    def now(self) -> float:
        return self._now

    def send(self, *packets: bytes) -> None:
        self._now += 0.001 * len(packets)

    def receive(self, timeout: float) -> bytes | None:
        packet = next(self._packets, None)
        self._now += 0.001 if packet is not None else max(timeout, 0.001)
        return packet


def ask(link: Connection) -> object:
    """With the same request ids each time: recorded replies are for those."""
    with patch("secrets.randbits", random.Random(1).getrandbits):
        return Plc(link).identity()


def scan(link: Connection) -> object:
    with patch("secrets.randbits", random.Random(1).getrandbits):
        return link.scan()


def packets(data: bytes) -> None:
    """Packets to the tool: in frames of a serial line, or each after its length."""
    for found in (simplecom.Decoder().feed(data), pieces(data)):
        for packet in found:
            router.decode(packet)
        with suppress(DeviceError, LinkError):
            ask(Connection(Packets(found)))
        with suppress(LinkError):
            scan(Connection(Packets(found)))


class Heard(SimTransport):
    """Keeps the packets that the simulator sends."""

    def __init__(self) -> None:
        self.packets: list[bytes] = []

    def receive(self, timeout: float) -> bytes | None:
        packet = super().receive(timeout)
        self.packets += [packet] if packet else []
        return packet


def heard_packets() -> Iterator[bytes]:
    with Simulator.from_sources(in_file("heard.st", PROGRAM.encode())):
        for action in (ask, scan):
            heard = Heard()
            action(Connection(heard))
            yield joined(heard.packets)
            yield b"".join(map(simplecom.encode, heard.packets))


# ---- files ----


def image(data: bytes) -> None:
    with suppress(UsageError):
        parse_image(data)
        describe_image(data)


def symbols(data: bytes) -> None:
    with suppress(UsageError, UnicodeDecodeError):
        SymbolTable.from_json(data.decode(), "a.sym")


def symbol_files() -> Iterator[bytes]:
    yield compile_sources([in_file("named.st", PROGRAM.encode())]).symbols.to_json().encode()


def production(data: bytes) -> None:
    with suppress(UsageError):
        describe_production(in_file("a.hex", data), data)


def production_files() -> Iterator[bytes]:
    source, path = in_file("burnt.st", PROGRAM.encode()), FOLDER / "burnt/burnt.hex"
    board = find_board("mps2-an385/standard")
    write_production(path, production_pieces(compile_sources([source], target="cortex-m3").image, board, None), board)
    yield path.read_bytes()


SUFFIXES = (".st", ".xml", ".EXP", ".TcPOU", ".TcTTO", ".TcGVL", ".TcDUT", ".plcproj", ".tsproj", ".IO", ".sln", ".xti")


def sources(data: bytes) -> None:
    """The first byte is the kind of file."""
    if data:
        with suppress(UsageError):
            check_with_tests(load([in_file("a" + SUFFIXES[data[0] % len(SUFFIXES)], data[1:])]))


def source_files() -> Iterator[bytes]:
    for number, suffix in enumerate(SUFFIXES):
        for folder in (ROOT / "examples", ROOT / "tests/corpus", ROOT / "tests/st"):
            for path in sorted(folder.rglob(f"*{suffix}"))[:40]:
                yield bytes([number]) + path.read_bytes()


def description(data: bytes) -> None:
    program = in_file("main.st", PROGRAM.encode())
    in_file("main.io.toml", data)
    with suppress(UsageError):
        check_with_tests(load([program]), load=lambda: load_io([program]))


def eds(data: bytes) -> None:
    """An EDS or DCF of a CANopen device."""
    with suppress(UsageError):
        read_eds("a.eds", data)


def nodelist(data: bytes) -> None:
    """A nodelist.cpj, and a DCF, which a description takes and another one is made of."""
    with suppress(UsageError):
        read_nodelist("nodelist.cpj", data)
        found = read_eds("a.dcf", data)
        writes = list(writes_of_dcf(found, 5, Mistakes()))
        dcf_of(found, writes, NodeOf("b.dcf", "a.eds", 5, "A", 0, "Bus", 500))


def node_files() -> Iterator[bytes]:
    eds = load_eds(ROOT / "examples/canopen/valves.eds")
    writes = [(0x1017, 0, b"\xc8\0"), (0x2000, 0, b"text"), (0x1A00, 3, bytes(4))]
    yield dcf_of(eds, writes, NodeOf("b.dcf", "a.eds", 5, "A", 0, "Bus", 500)).encode()
    yield nodelist_text("Bus", [ListedNode(5, Pos("", 1, 1), "A", "a.dcf")]).encode()


def project(data: bytes) -> None:
    """plc.toml and its link."""
    file = in_file("plc.toml", data)
    in_file("plc.st", PROGRAM.encode())
    with suppress(UsageError):
        found = read_project(file)
        if found.link:
            project_link(file, found.link_line, found.link)


def project_files() -> Iterator[bytes]:
    yield b"""sources = ["plc.st", "*.st", "../x"]
libraries = ["lib", "Util"]
target = "cortex-m3"
board = "mps2-an385/full"
device = "device.toml"
io = "main.io.toml"
output = "out/app.cdl"
link = "can:socketcan:can0?node=1,press&bitrate=500000/2000000"
[options]
optimisation = "s"
checks = ["div"]
dialect = "codesys"
no-warn = ["unused"]
[information]
name = "x"
"""
    yield from files("host/plctool/templates/*/plc.toml")()


def library(data: bytes) -> None:
    """A library that is a .zip."""
    with suppress(UsageError):
        check_with_tests(read_library(in_file("lib.zip", data)).sources)


def library_files() -> Iterator[bytes]:
    contents = {
        "lib/library.toml": 'name = "L"\nversion = "1.0"\n',
        "lib/a.st": "FUNCTION f : INT\nf := 1;\nEND_FUNCTION",
    }
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", method) as archive:
            for name, text in contents.items():
                archive.writestr(name, text)
        yield out.getvalue()


def source_archive(data: bytes) -> None:
    """What a device keeps as the sources of its program; it is written where nothing is yet."""
    with suppress(DeviceError, UsageError), tempfile.TemporaryDirectory(dir=FOLDER) as folder:
        for file in unpacked(data).unpack(Path(folder) / "source"):
            assert file.resolve().is_relative_to(Path(folder).resolve() / "source"), file


def source_archives() -> Iterator[bytes]:
    yield Archive(0x1234, ["plc.toml"], {"plc.toml": b"", "src/main.st": PROGRAM.encode()}).pack()


def gateway(data: bytes) -> None:
    with suppress(FrameError):
        for frame in Decoder().feed(data):
            for kind in (Request, Reply):
                with suppress(FrameError):
                    kind.decode(frame.payload)


def gateway_frames() -> Iterator[bytes]:
    frames = [Frame(kind, 7, message) for kind in Kind for message in (b"", bytes(16), Reply(3, b"reply").encode())]
    yield b"".join(map(encode, frames))


def tags(data: bytes) -> None:
    with suppress(LinkError):
        bintag.decode(data)


def files(*patterns: str) -> Callable[[], Iterator[bytes]]:
    return lambda: (path.read_bytes() for pattern in patterns for path in sorted(ROOT.glob(pattern)) if path.is_file())


def m4(data: bytes) -> None:
    with suppress(UsageError):
        export_component([read_m4("CmpFooItf.m4", data.decode("latin-1"))])


def m4_files() -> Iterator[bytes]:
    page = (ROOT / "docs/v3-components.md").read_text()
    yield from (text.encode() for text in re.findall(r"^```m4 \S+\n(.*?)^```", page, re.MULTILINE | re.DOTALL))


@dataclass(frozen=True)
class Target:
    run: Callable[[bytes], None]
    first: Callable[[], Iterator[bytes]]  # inputs to begin with


TARGETS = {
    "replies": Target(replies, recorded_replies),
    "packets": Target(packets, heard_packets),
    "tags": Target(tags, recorded_replies),
    "gateway": Target(gateway, gateway_frames),
    "image": Target(image, files("tests/fuzz/corpus/loader/*")),
    "symbols": Target(symbols, symbol_files),
    "production": Target(production, production_files),
    "sources": Target(sources, source_files),
    "eds": Target(eds, files("examples/canopen/*.eds", "tests/canopen/*.eds")),
    "nodelist": Target(nodelist, node_files),
    "m4": Target(m4, m4_files),
    "project": Target(project, project_files),
    "library": Target(library, library_files),
    "source_archive": Target(source_archive, source_archives),
    "description": Target(description, files("examples/**/*.io.toml", "host/plctool/templates/**/*.toml")),
}
