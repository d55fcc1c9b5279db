"""Soak: for a long time clients do what tools do, and what they should not: on every line of one plcrt at once, and in
virtual time.

    tests/soak/run.py                  10 000 channels on each line: serial, CAN, TCP, UDP
    tests/soak/run.py --channels 100   fewer
    tests/soak/run.py --seed 5         other turns
    tests/soak/run.py --sanitized      with what is in build-sanitized instead of build

A turn is a channel and what is done with it: variables are written and read back, a long message is echoed, a download
is begun, replies are not fetched. Some clients vanish in the middle of that, without closing, and there is noise
between the frames. Prints what was done, and exits 1 if the program is not as it was, a client was shut out for longer
than PATIENCE, the memory (without sanitizers) or the open files of the controller have grown, a cycle is missing in
virtual time, or a sanitizer has found something.
"""

from __future__ import annotations

import argparse
import os
import random
import socket
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.device import Plc, connect
from plctool.errors import LinkError, PlcError
from plctool.link import bintag, l7, services
from plctool.link.connection import Connection
from plctool.link.session import Session
from plctool.link.transports import open_transport, parse_link
from plctool.sim import Simulator
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt

KINDS = ("serial", "can", "tcp", "udp")
PATIENCE = 30.0  # a client that is shut out for longer has been locked out [s]
POLITE = 6.0  # while a client has waited for longer others begin nothing: places of vanished ones are free by then [s]
SETTLED = 8.0  # the device waits for no client longer than that [s]
WARM_UP = 20  # channels of each line at least, or a tenth, after which memory is measured first
MAX_GROWTH = 64  # KiB: pages of stacks that are used for the first time
IN_USE = "invalid-state"  # code of a download while another client has one
ECHO = 3000  # bytes: several packages
INTERVAL_NS = 5_000_000  # of the task
REPORTS = "sanitizer"  # files of that name and the number of a process

# A variable for each line. `damaged`: cycles that found something else than what was left.
PROGRAM = """
PROGRAM Main
VAR
    serial, can, tcp, udp : UDINT;
    cycles, damaged : UDINT;
    table : ARRAY[0..99] OF UDINT;
    i : INT;
END_VAR
FOR i := 0 TO 99 DO
    IF table[i] <> cycles * INT_TO_UDINT(i) THEN damaged := damaged + 1; END_IF
END_FOR
cycles := cycles + 1;
FOR i := 0 TO 99 DO
    table[i] := cycles * INT_TO_UDINT(i);
END_FOR
END_PROGRAM
CONFIGURATION Soak
    TASK Fast(INTERVAL := T#5ms);
    PROGRAM Main WITH Fast : Main;
END_CONFIGURATION
"""
OTHER = """
PROGRAM Main
VAR
    a : ARRAY[0..29999] OF DINT := [{values}];
END_VAR
a[0] := a[0] + 1;
END_PROGRAM
"""


class Vanished(Exception):
    """A client goes without a word."""


def build(folder: Path, name: str, text: str) -> Path:
    source, image = folder / f"{name}.st", folder / f"{name}.cdl"
    source.write_text(text)
    compile_sources([source]).write(image)
    return image


def other_image(folder: Path) -> bytes:
    """One that is long on the line: its values are no loop that fills."""
    values = ", ".join(str(i * i % 65521) for i in range(30_000))
    return build(folder, "other", OTHER.format(values=values)).read_bytes()


# ---- one line ----


@dataclass
class Line:
    """A line and the one client on it."""

    kind: str
    link: str
    noise: Callable[[bytes], None]
    symbols: Path
    other: bytes
    random: random.Random
    channels: int = 0
    done: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    longest: tuple[float, str] = 0.0, ""  # turn, with all tries [s], and what it was
    waiting_since: float | None = None  # for a place [s of time.monotonic]

    def __str__(self) -> str:
        done = ", ".join(f"{count} {name}" for name, count in sorted(self.done.items()))
        refused = ", ".join(f"{count} {code}" for code, count in sorted(self.refused.items())) or "none"
        seconds, name = self.longest
        return f"{self.channels} channels: {done}; refused: {refused}; longest {seconds:.1f} s ({name})"

    def turn(self) -> None:
        """One channel and what is done with it. It is tried until there is a place for it: clients that have vanished
        hold theirs until the device misses them, and a new channel is given away before others. Raises PlcError when
        that takes too long, or the device says what it must not."""
        name, action = self.random.choice(TURNS)
        begin = self.waiting_since = time.monotonic()
        while not self._try(action):
            if time.monotonic() > begin + PATIENCE:
                raise PlcError(f"there was no place for longer than {PATIENCE} s", "soak")
            time.sleep(random.uniform(0.01, 0.1))  # not of the seed: how often depends on the machine
        self.done[name] += 1
        self.longest = max(self.longest, (time.monotonic() - begin, name))

    def _try(self, action: Callable[[Line, Connection], None]) -> bool:
        """False if there was no place, or the channel was given away before the login."""
        connection = Connection(open_transport(parse_link(self.link)))
        try:
            connection.open()
            if action is not Line.knock:
                Session(connection).ensure()
        except LinkError as error:
            connection.close()
            if error.code not in ("busy", "closed"):
                raise
            self.refused[error.code] += 1
            return False
        self.channels += 1
        self.waiting_since = None
        try:
            action(self, connection)
        except Vanished:
            connection.transport.close()
        else:
            connection.close()
        return True

    # ---- what is done with a channel ----

    def knock(self, connection: Connection) -> None:
        """Nothing, not even a login."""

    def vanish(self, connection: Connection) -> None:
        raise Vanished

    def talk(self, connection: Connection) -> None:
        plc = Plc(connection, self.symbols)
        number = self.random.randrange(1 << 32)
        plc.write({f"Main.{self.kind}": number})
        if (found := plc.read(f"Main.{self.kind}")) != number:
            raise PlcError(f"{number} was written, {found} read", "soak")

    def echo(self, connection: Connection) -> None:
        data = self.random.randbytes(ECHO)
        if services.echo(Session(connection), data) != data:
            raise PlcError("the echo is another one", "soak")

    def half_a_download(self, connection: Connection) -> None:
        """Another client may be at it, and is not disturbed."""
        until = self.random.randrange(len(self.other) // 2)  # of the other half not all is under way

        def go_until(arrived: int) -> None:
            if arrived >= until:
                raise Vanished

        try:
            services.download(Session(connection), self.other, restart=True, progress=go_until)
        except PlcError as error:
            if error.code != IN_USE:
                raise
            self.refused[error.code] += 1

    def fetch_nothing(self, connection: Connection) -> None:
        """Many requests, of whose replies one is read."""
        request = services.echo_request(bytes(ECHO))
        message = Session(connection).message(request.group, request.service, bintag.encode(request.tags))
        stream = connection.stream([l7.encode(message)] * 20)  # until it is let go, nothing is closed
        next(stream)
        raise Vanished

    def make_noise(self, connection: Connection) -> None:
        """In the midst of a conversation."""
        for _ in range(3):
            self.noise(self.random.randbytes(self.random.randrange(1, 200)))
            self.talk(connection)


# Those that go without a word are few: on all lines but TCP each takes one of the four places for 5 s, until the device
# misses it. Of 10 000 channels of a line they are some 80 of each kind: all places are taken at times, and most of the
# time is not spent on waiting.
TURNS: list[tuple[str, Callable[[Line, Connection], None]]] = [
    *[("talk", Line.talk)] * 200,
    *[("knock", Line.knock)] * 120,
    *[("echo", Line.echo)] * 40,
    *[("noise", Line.make_noise)] * 20,
    ("vanish", Line.vanish),
    ("half a download", Line.half_a_download),
    ("fetch nothing", Line.fetch_nothing),
]


# ---- noise ----


def to_file(path: str) -> Callable[[bytes], None]:
    """Into a terminal that a client has as well."""

    def send(data: bytes) -> None:
        terminal = os.open(path, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
        with suppress(BlockingIOError):
            os.write(terminal, data)
        os.close(terminal)

    return send


def to_tcp(place: str) -> Callable[[bytes], None]:
    host, _, port = place.rpartition(":")

    def send(data: bytes) -> None:
        with suppress(OSError), socket.create_connection((host, int(port)), timeout=PATIENCE) as connection:
            connection.sendall(data)

    return send


def to_udp(place: str) -> Callable[[bytes], None]:
    host, _, port = place.rpartition(":")

    def send(data: bytes) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
            datagrams.sendto(data, (host, int(port)))

    return send


# ---- the controller ----


@dataclass(frozen=True)
class Use:
    """What the controller uses: memory in KiB, that it may write and what of it is in RAM, and files."""

    data: int
    resident: int
    files: int

    def __str__(self) -> str:
        return f"{self.data} KiB of data, {self.resident} KiB in RAM, {self.files} files"


def use_of(pid: int) -> Use:
    """Exactly: the resident size of /proc/PID/status is not, and has pages of files. Raises OSError or KeyError when it
    died."""
    process = Path(f"/proc/{pid}")
    lines = (process / "status").read_text() + (process / "smaps_rollup").read_text()
    kib = {name: int(rest.split()[0]) for name, _, rest in (line.partition(":") for line in lines.splitlines())
           if rest.endswith("kB")}  # fmt: skip
    return Use(kib["VmData"], kib["Anonymous"], len(os.listdir(process / "fd")))


def worker_of(plcrt: Plcrt) -> int:
    if (worker := plcrt.worker) is None:
        raise PlcError("the controller is being started again", "soak")
    return worker


class Soak:
    """The lines of one plcrt, each with a thread."""

    def __init__(self, lines: list[Line], plcrt: Plcrt) -> None:
        self.lines = lines
        self.plcrt = plcrt
        self.worker = worker_of(plcrt)
        self.errors: list[str] = []

    def run(self, channels: int) -> Use:
        """Until each line has had so many channels, or one has failed. What the controller uses then, when it has
        missed those that vanished. Raises PlcError when it has died."""
        threads = [threading.Thread(target=self._serve, args=(line, channels)) for line in self.lines]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        try:
            return self._settled()
        except (OSError, KeyError):
            raise PlcError("the controller died", "soak") from None

    def _serve(self, line: Line, channels: int) -> None:
        try:
            while line.channels < channels and not self.errors:
                self._let_others_in()
                line.turn()
        except PlcError as error:
            self.errors.append(f"{line.kind}, channel {line.channels}: {error} ({error.code})")
        except Exception:
            self.errors.append(f"{line.kind}, channel {line.channels}:\n{traceback.format_exc()}")

    def _let_others_in(self) -> None:
        """Lines take a place that is free as fast as they can, and a slow one would come too late each time. What is to
        be found is a client that the device shuts out, not one whom others outrun."""
        while not self.errors and any(self._waits_long(line) for line in self.lines):
            time.sleep(0.02)

    @staticmethod
    def _waits_long(line: Line) -> bool:
        since = line.waiting_since
        return since is not None and time.monotonic() > since + POLITE

    def _settled(self) -> Use:
        """When the number of files has been the same for longer than the device waits for a client."""
        use, since = use_of(self.worker), time.monotonic()
        while time.monotonic() < since + SETTLED:
            time.sleep(0.5)
            now = use_of(self.worker)
            if now.files != use.files:
                use, since = now, time.monotonic()
        return now

    def check_use(self, before: Use, after: Use, sanitized: bool) -> None:
        """Sanitizers take memory themselves."""
        print(f"before: {before}\nafter:  {after}")
        more_memory = after.data > before.data or after.resident > before.resident + MAX_GROWTH
        if after.files > before.files or (more_memory and not sanitized):
            raise PlcError("the controller uses more than before", "soak")

    def check_program(self, image: Path) -> tuple[int, int]:
        """Cycles and the longest delay of one [us]. Raises PlcError when the program is not as it was."""
        if worker_of(self.plcrt) != self.worker:
            raise PlcError("the controller died and was started again", "soak")
        with connect(f"tcp:{self.plcrt.tcp}", image.with_suffix(".sym")) as plc:
            status = plc.status()
            values = plc.read_all(["Main.cycles", "Main.damaged"])
            task = plc.tasks()[0]
        if status.state != "run" or values["Main.damaged"]:
            raise PlcError(
                f"the program is in the state {status.state}, {values['Main.damaged']} cycles damaged", "soak"
            )
        return values["Main.cycles"], task.jitter_us


# ---- all of it ----


def lines_of(plcrt: Plcrt, hub: CanHub, folder: Path, seed: int) -> list[Line]:
    links = {
        "serial": (f"serial:{plcrt.port}", to_file(plcrt.port)),
        "can": (f"can:slcan:{hub.paths[0]}?node=1", to_file(hub.paths[1])),
        "tcp": (f"tcp:{plcrt.tcp}", to_tcp(plcrt.tcp)),
        "udp": (f"udp:{plcrt.udp}", to_udp(plcrt.udp)),
    }
    other = other_image(folder)
    symbols = folder / "soak.sym"
    return [
        Line(kind, *links[kind], symbols=symbols, other=other, random=random.Random(f"{seed} {kind}")) for kind in KINDS
    ]


def report_to(folder: Path) -> None:
    """The sanitizers of processes that start from now on write to files."""
    for name in ("ASAN_OPTIONS", "UBSAN_OPTIONS"):
        os.environ[name] = f"{os.environ.get(name, '')}:log_path={folder / REPORTS}"


def reports_in(folder: Path) -> list[str]:
    return [path.read_text(errors="replace") for path in sorted(folder.glob(f"{REPORTS}.*"))]


def soak(folder: Path, channels: int, seed: int, sanitized: bool) -> list[str]:
    """What went wrong."""
    image = build(folder, "soak", PROGRAM)
    address = f"127.{random.randint(1, 250)}.{random.randint(1, 250)}.{random.randint(1, 250)}"  # its ports are fixed
    with ExitStack() as stack:
        hub = stack.enter_context(CanHub(3))
        options = ("--tcp", "0", "--udp", address, "--can", f"slcan:{hub.paths[2]}")
        plcrt = stack.enter_context(Plcrt(folder / "plc.flash", *options))
        with connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
        lines = lines_of(plcrt, hub, folder, seed)
        soaked, begin = Soak(lines, plcrt), time.monotonic()
        try:
            before = soaked.run(max(WARM_UP, channels // 10))
            after = soaked.run(channels)
            soaked.check_use(before, after, sanitized)
            cycles, delay = soaked.check_program(image)
            seconds = time.monotonic() - begin
            print(f"{cycles} cycles of 5 ms in {seconds:.0f} s, delayed by {delay} us at most")
        except PlcError as error:
            soaked.errors.append(str(error))
        for line in lines:
            print(f"{line.kind:7} {line}")
        return soaked.errors


# ---- in virtual time ----


def to_simulator(data: bytes) -> None:
    lib.SimLinkSend(data, len(data))


def virtual(folder: Path, channels: int, seed: int) -> list[str]:
    """What went wrong: there is one cycle for each interval of the task, whatever the client does."""
    image = build(folder, "soak", PROGRAM)
    line = Line(
        "udp", "sim:", to_simulator, image.with_suffix(".sym"), other_image(folder), random.Random(f"{seed} virtual")
    )
    with Simulator.from_file(image) as plc:
        try:
            while line.channels < channels:
                lib.SimRunFor(line.random.randrange(3 * INTERVAL_NS))
                line.turn()
        except PlcError as error:
            return [f"virtual, channel {line.channels}: {error} ({error.code})"]
        cycles, damaged = plc.read("Main.cycles"), plc.read("Main.damaged")
        missing = lib.SimNow() // INTERVAL_NS + 1 - cycles  # the first one is at 0
    print(f"{'virtual':7} {line}; {cycles} cycles of 5 ms, {missing} missing")
    return [f"{missing} cycles are missing, {damaged} are damaged in virtual time"] if missing or damaged else []


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--channels", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sanitized", action="store_true", help="what is in build-sanitized")
    parser.add_argument("--build", help="what is in this folder")
    args = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        report_to(folder)
        errors = virtual(folder, args.channels, args.seed)
        errors += soak(folder, args.channels, args.seed, args.sanitized) + reports_in(folder)
    print("\n".join(errors) or "nothing was lost")
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
