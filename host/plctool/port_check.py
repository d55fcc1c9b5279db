"""`plctool port-check`: does a port keep what the runtime expects of it? A conformance run over the normal protocol.

What the controller had before is replaced, and nothing is left on it at the end.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from plctool.core import lib
from plctool.device import FlashResult, Plc
from plctool.errors import DeviceError, LinkError, PlcError, UsageError
from plctool.link.services import AppState, Identity, TaskInfo

CLOCK_SPAN = 4.0  # seconds over which clocks are compared
MAX_DRIFT = 0.01  # default, of the controller's clock against the host's, beyond what the link leaves uncertain
TIMER_TRIES = 3  # the best counts: hosts and simulated boards are sometimes kept from running
MAX_MISSED = 0.01  # share of due times
DOWNLOAD_UNITS = (20, 200, 1, 400, 50, 600, 5, 300)  # sizes of the programs, in statements
COMMITS = 300  # changes of the commit record: several times what two sectors of 4 KiB hold
BITS_PER_BYTE = 10
MIN_LINE_SHARE = 0.5  # of the byte rate, downloads with their writing to flash
FAULT_PATIENCE = 40.0  # the default watchdog needs 10 s, simulated boards are slower
PATIENCE = 15.0

_TIMER_US = 10_000
_COUNT = "Main.n"


class CheckFailed(Exception):
    """What a check found wrong, for people; `figures` as far as there are any."""

    def __init__(self, text: str, **figures: Any) -> None:
        super().__init__(text)
        self.figures = figures


class NotReported(Exception):
    """The port does not tell what a check is about; that is no failure."""


@dataclass(frozen=True)
class Outcome:
    """One line of the report: `verdict` is "passed", "failed" or "not reported"."""

    name: str
    verdict: str
    text: str
    seconds: float
    figures: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """All that a vendor files: who was checked, and how each check went."""

    identity: Identity
    target: str
    outcomes: list[Outcome]

    def count(self, verdict: str) -> int:
        return sum(outcome.verdict == verdict for outcome in self.outcomes)

    def document(self) -> dict[str, Any]:
        """For --json."""
        return {
            "device": vars(self.identity) | {"target": self.target},
            "checks": [vars(outcome) for outcome in self.outcomes],
            "passed": self.count("passed"),
            "failed": self.count("failed"),
            "not_reported": self.count("not reported"),
        }


def outcome_text(outcome: Outcome) -> str:
    """The line of one check."""
    return f"{outcome.verdict:<13}{outcome.name:<28}{outcome.text}"


def summary_text(report: Report) -> str:
    """The last line."""
    missing = report.count("not reported")
    tail = f", {missing} not reported" if missing else ""
    return f"{report.count('passed')} passed, {report.count('failed')} failed{tail}"


def run_port_check(
    connect: Callable[[], Plc],
    *,
    baud: int,
    replace: bool = False,
    max_drift: float = MAX_DRIFT,
    power_cycle: Callable[[], None] | None = None,
    show: Callable[[Outcome], None] = lambda outcome: None,
) -> Report:
    """Runs all checks and returns their report; `show` gets each outcome when it is known.

    `replace`: also when there is an application on the controller, which is lost. `power_cycle` returns when the
    controller was without power and is on again; without it that check is left out. `max_drift`: share by which the
    controller's clock may differ from the host's. Raises UsageError when the
    application may not be replaced or the controller has a processor plctool does not compile for, LinkError when
    nobody answers.
    """
    plc = connect()
    try:
        identity, status = plc.identity(), plc.status()
        if status.state is not AppState.NONE and not replace:
            raise UsageError(
                f"There is an application on {identity.node_name} that the check would replace; say --yes.", "occupied"
            )
        with tempfile.TemporaryDirectory(prefix="port-check-") as folder:
            bench = _Bench(connect, plc, _target_of(identity), Path(folder), baud)
            checks = _Checks(bench, power_cycle, max_drift)
            outcomes = []
            for name, check in checks.all():
                outcomes.append(_run(name, check))
                show(outcomes[-1])
            plc = bench.plc
        return Report(identity, bench.target, outcomes)
    finally:
        plc.close()


def _target_of(identity: Identity) -> str:
    from plctool.compiler.targets import TARGETS

    for target in TARGETS.values():
        if getattr(lib, target.device_id) == identity.target_id:
            return target.name
    raise UsageError(
        f"plctool has no target for the device id 0x{identity.target_id:08X}; the check needs one to compile for.",
        "unknown-target",
    )


def _run(name: str, check: Callable[[], tuple[str, dict[str, Any]]]) -> Outcome:
    begin = time.monotonic()
    try:
        verdict, (text, figures) = "passed", check()
    except NotReported as reason:
        verdict, text, figures = "not reported", str(reason), {}
    except CheckFailed as failure:
        verdict, text, figures = "failed", str(failure), failure.figures
    except PlcError as error:
        verdict, text, figures = "failed", error.message, {}
    return Outcome(name, verdict, text, round(time.monotonic() - begin, 3), figures)


# ---- the bench: a controller and programs for it ---------------------------------------------------------------------


def _program(variables: str, body: str) -> str:
    return f"""
PROGRAM Main
VAR
    n : DINT;
END_VAR
{variables}
n := n + 1;
{body}
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Cycle(INTERVAL := T#10ms, PRIORITY := 1);
        PROGRAM Main WITH Cycle : Main;
    END_RESOURCE
END_CONFIGURATION
"""


class _Bench:
    """The controller under test, its target, and where programs for it are built."""

    def __init__(self, connect: Callable[[], Plc], plc: Plc, target: str, folder: Path, baud: int) -> None:
        self.plc = plc
        self.target = target
        self.baud = baud
        self._connect = connect
        self._folder = folder
        self._built: dict[str, Path] = {}

    def reconnect(self) -> None:
        """A new link, after the controller was without power."""
        self.plc.close()
        self.plc = self._connect()

    def flash(self, text: str) -> FlashResult:
        """Builds a program and starts it afresh, with its initial values."""
        return self.plc.flash(self.build(text), force=True)

    def build(self, text: str) -> Path:
        """The image of a program; its symbols lie beside it."""
        from plctool.compiler import compile_sources
        from plctool.symbols import symbol_path

        if text not in self._built:
            source = self._folder / f"check{len(self._built)}.st"
            source.write_text(text)
            built = compile_sources([source], target=self.target)
            image = source.with_suffix(".cdl")
            image.write_bytes(built.image)
            built.symbols.save(symbol_path(image))
            self._built[text] = image
        return self._built[text]

    def wait(self, question: Callable[[], bool], what: str, patience: float = PATIENCE) -> float:
        """Asks until the answer is yes; the seconds that took. Fails with `what` when patience is over."""
        begin = time.monotonic()
        while not question():
            if time.monotonic() - begin > patience:
                raise CheckFailed(f"{what} within {patience:.0f} s.")
            time.sleep(0.02)
        return time.monotonic() - begin

    def wait_for_cycles(self, count: int = 3) -> None:
        self.wait(lambda: bool(self.plc.read(_COUNT) >= count), "The program does not run: no cycles")

    def tasks(self) -> list[TaskInfo]:
        try:
            return self.plc.tasks()
        except LinkError:
            raise
        except DeviceError:
            raise NotReported("built without task information") from None


# ---- the checks ------------------------------------------------------------------------------------------------------

_Result = tuple[str, dict[str, Any]]

_CLOCK = _program(
    "VAR now : LTIME; before : LTIME; backwards : DINT; END_VAR",
    "now := LTIME(); IF now < before THEN backwards := backwards + 1; END_IF before := now;",
)
_RETAIN = _program("VAR RETAIN kept : DINT := 7; END_VAR", "")

_FAULTS = {
    "division by zero": ("VAR a : DINT := 1; b : DINT; END_VAR", "a := a / b;", {"DIVIDEBYZERO"}),
    "array bounds": ("VAR f : ARRAY[0..3] OF INT; i : INT := 9; END_VAR", "f[i] := 1;", {"ARRAYBOUNDS"}),
    "null reference": ("VAR p : POINTER TO DINT; END_VAR", "p^ := 1;", {"ACCESS_VIOLATION"}),
    "endless loop": ("VAR x : DINT; END_VAR", "WHILE TRUE DO x := x + 1; END_WHILE", {"WATCHDOG"}),
    "stack overflow": ("VAR i : DINT; END_VAR", "i := Large(i);", {"STACK_OVERFLOW", "ACCESS_VIOLATION"}),
}
_SMALL_FRAME, _LARGE_FRAME = 1000, 500_000  # DINTs that no stack of a controller, or of an operating system, holds


class _Checks:
    """The checks in the order in which they are run; each returns its text and figures or raises CheckFailed."""

    def __init__(self, bench: _Bench, power_cycle: Callable[[], None] | None, max_drift: float) -> None:
        self._bench = bench
        self._power_cycle = power_cycle
        self._max_drift = max_drift
        self._drift = 0.0  # as it was measured

    @property
    def _plc(self) -> Plc:
        return self._bench.plc

    def all(self) -> Iterator[tuple[str, Callable[[], _Result]]]:
        yield "clock", self.clock
        yield "timer", self.timer
        yield "serial throughput", self.throughput
        yield "flash downloads", self.downloads
        yield "flash commit log", self.commits
        yield "retain, warm reset", self.warm_reset
        yield "retain, cold reset", self.cold_reset
        if self._power_cycle is not None:
            yield "power cycle", self.power_cycle
        for name in _FAULTS:
            yield f"exception: {name}", lambda name=name: self.exception(name)  # type: ignore[misc]
        yield "stack headroom", self.stack
        yield "origin reset", self.origin_reset

    def _read_clock(self) -> tuple[float, float, float]:
        """The controller's time, the host's time at the middle of the question, and half of what that took [s]."""
        before = time.monotonic()
        now_ns = self._plc.read("Main.now")
        after = time.monotonic()
        return _seconds(now_ns), (before + after) / 2, (after - before) / 2

    def clock(self) -> _Result:
        """Goes forward, and as fast as the host's."""
        self._bench.flash(_CLOCK)
        self._bench.wait_for_cycles()
        device, host, doubt = self._read_clock()
        begin = time.monotonic()
        while time.monotonic() - begin < CLOCK_SPAN:
            time.sleep(0.1)
            self._plc.read("Main.now")
        last_device, last_host, last_doubt = self._read_clock()
        backwards = self._plc.read("Main.backwards")
        span = last_host - host
        drift = self._drift = (last_device - device) / span - 1
        doubt = (doubt + last_doubt + 2 * _TIMER_US / 1e6) / span
        figures = {"drift_ppm": round(drift * 1e6), "uncertainty_ppm": round(doubt * 1e6), "backwards": backwards}
        text = f"drift {drift * 100:+.2f} % (known to {doubt * 100:.2f} %) in {span:.1f} s, {backwards} steps back"
        if backwards or abs(drift) > self._max_drift + doubt:
            raise CheckFailed(f"{text}; allowed are {self._max_drift * 100:g} % and 0", **figures)
        return text, figures

    def timer(self) -> _Result:
        """A cyclic task runs at its interval. The best of several runs counts."""
        best: TaskInfo | None = None
        for _ in range(TIMER_TRIES):
            self._bench.flash(_program("", ""))
            time.sleep(CLOCK_SPAN / 2)
            task = self._bench.tasks()[0]
            if best is None or task.jitter_us < best.jitter_us:
                best = task
            if best.overruns == 0 and best.jitter_us < _TIMER_US // 10:
                break
        assert best
        missed = best.overruns / max(1, best.cycles + best.overruns)
        figures = {"jitter_us": best.jitter_us, "overruns": best.overruns, "cycles": best.cycles}
        text = f"latest start {best.jitter_us} us after its due time, {best.overruns} of {best.cycles} cycles missed"
        expected = CLOCK_SPAN / 2 * 1e6 / _TIMER_US * max(0.0, 1 + self._drift)
        if best.cycles + best.overruns < expected / 2 or missed > MAX_MISSED:
            raise CheckFailed(f"{text}; about {expected:.0f} cycles and no misses are expected", **figures)
        return text, figures

    def throughput(self) -> _Result:
        """How much of the line's byte rate a download gets."""
        result = self._bench.flash(_padded(max(DOWNLOAD_UNITS)))
        rate = result.bytes / max(result.seconds, 1e-6)
        share = rate / (self._bench.baud / BITS_PER_BYTE)
        figures = {"bytes": result.bytes, "bytes_per_s": round(rate), "share": round(share, 3)}
        text = f"{result.bytes} bytes at {rate:.0f} bytes/s: {share * 100:.0f} % of the byte rate"
        if share < MIN_LINE_SHARE and abs(self._drift) > 2 * MAX_DRIFT:
            raise NotReported(f"{text}; a clock that differs from the host's makes it meaningless")
        if share < MIN_LINE_SHARE:
            raise CheckFailed(f"{text}; at least {MIN_LINE_SHARE * 100:.0f} % are expected", **figures)
        return text, figures

    def downloads(self) -> _Result:
        """Programs of different sizes take each other's place in the two slots, and run."""
        sizes = []
        for units in DOWNLOAD_UNITS:
            sizes.append(self._bench.flash(_padded(units)).bytes)
            self._bench.wait_for_cycles()
            if (found := self._plc.read("Main.units")) != units:
                raise CheckFailed(f"Program {len(sizes)} of {sizes[-1]} bytes does not run as built: {found}.")
        figures = {"downloads": len(sizes), "smallest": min(sizes), "largest": max(sizes)}
        return f"{len(sizes)} programs of {min(sizes)} to {max(sizes)} bytes", figures

    def commits(self) -> _Result:
        """The log of the commit record goes round. Stop and start of a new program write a record each."""
        self._bench.flash(_program("", ""))
        image = self._plc.status().image_crc
        for _ in range(COMMITS // 2):
            self._plc.stop()
            self._plc.start()
        status = self._plc.status()
        if status.image_crc != image or status.state is not AppState.RUN:
            raise CheckFailed(f"After {COMMITS} records the program is another one, or it is in {status.state}.")
        faults = [entry.text for entry in self._log() if entry.text.startswith("The commit record cannot")]
        if faults:
            raise CheckFailed(f"The log says: {faults[-1]}")
        return f"{COMMITS} records written", {"records": COMMITS}

    def _log(self) -> list[Any]:
        try:
            return list(self._plc.log())
        except LinkError:
            raise
        except DeviceError:
            return []  # built without a log

    def _flash_retain(self) -> None:
        self._bench.flash(_RETAIN)
        self._bench.wait_for_cycles()
        self._plc.write({"Main.kept": 4711})

    def _expect_kept(self, value: int) -> _Result:
        if (found := self._plc.read("Main.kept")) != value:
            raise CheckFailed(f"The retain variable is {found}, it should be {value}.", found=found, expected=value)
        return f"retain variable {value}", {"value": value}

    def warm_reset(self) -> _Result:
        """Retain variables stay, others start afresh."""
        self._flash_retain()
        self._plc.reset("warm")
        if (count := self._plc.read(_COUNT)) != 0:
            raise CheckFailed(f"Main.n is {count} after the reset, it should be 0.")
        result = self._expect_kept(4711)
        self._plc.start()
        self._bench.wait_for_cycles()
        return result

    def cold_reset(self) -> _Result:
        """Retain variables have their initial values again."""
        self._flash_retain()
        self._plc.reset("cold")
        return self._expect_kept(7)

    def power_cycle(self) -> _Result:
        """The application is booted from flash, with its retain variables."""
        assert self._power_cycle
        self._flash_retain()
        self._plc.stop()  # saves
        image = self._plc.status().image_crc
        self._power_cycle()
        self._bench.reconnect()
        status = self._plc.status()
        if status.image_crc != image or status.state is not AppState.RUN:
            raise CheckFailed(f"The application was not booted: the state is {status.state}.")
        return self._expect_kept(4711)

    def exception(self, name: str) -> _Result:
        """A fault stops the application, not the controller; after a reset it runs again."""
        variables, body, expected = _FAULTS[name]
        self._bench.flash(self._faulty(variables, body))
        self._bench.wait_for_cycles()
        begin = time.monotonic()
        self._plc.write({"Main.trip": True})
        while self._plc.status().state is not AppState.EXCEPTION:
            if time.monotonic() - begin > FAULT_PATIENCE:
                raise CheckFailed(f"No exception within {FAULT_PATIENCE:.0f} s.")
            time.sleep(0.02)
        seconds = time.monotonic() - begin
        found = self._plc.status().exception
        figures = {"exception": found.name if found else None, "seconds": round(seconds, 3)}
        if found is None or found.name not in expected or found.task != "Cycle":
            raise CheckFailed(f"Reported as {found}; expected {' or '.join(sorted(expected))}.", **figures)
        self._plc.reset("warm")
        self._plc.start()
        self._bench.wait_for_cycles()
        return f"{found.name} in {found.task}, {found.pou} after {seconds:.2f} s; runs again", figures

    def _faulty(self, variables: str, body: str) -> str:
        from plctool.compiler.targets import find_target

        trip = f"VAR trip : BOOL; END_VAR\n{variables}"
        program = _program(trip, f"IF trip THEN\n{body}\nEND_IF")
        if "Large" not in body:
            return program
        size = _LARGE_FRAME if find_target(self._bench.target).pointer_size == 8 else _SMALL_FRAME
        return f"""
FUNCTION Large : DINT
VAR_INPUT
    i : DINT;
END_VAR
VAR
    f : ARRAY[0..{size - 1}] OF DINT;
END_VAR
f[i] := i;
Large := f[i + 1] + f[i];
END_FUNCTION
{program}"""

    def stack(self) -> _Result:
        """There is no service that tells; see StackUnused() of a port."""
        raise NotReported("no service tells it; StackUnused() does on Cortex-M")

    def origin_reset(self) -> _Result:
        """Deletes the application; the controller is empty afterwards."""
        self._plc.reset("origin")
        if (state := self._plc.status().state) is not AppState.NONE:
            raise CheckFailed(f"The state is {state}, there should be no application.")
        return "the controller is empty", {}


def _padded(units: int) -> str:
    """A program that is longer the more `units`, and tells them."""
    lines = "\n".join(f"x := (x XOR {i * 7919 + 1}) * {2 * i + 3};" for i in range(units))
    return _program(f"VAR x : DINT; units : DINT := {units}; END_VAR", lines)


def _seconds(value: str) -> float:
    """An LTIME as it was read, in seconds."""
    from plctool.compiler.types import ELEMENTARY
    from plctool.values import parse_time

    return parse_time(value, ELEMENTARY["LTIME"]) / 1e9
