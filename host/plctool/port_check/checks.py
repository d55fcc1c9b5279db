"""The checks of the port check, in the order in which they are run."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial

from plctool.device import Plc
from plctool.errors import LinkError
from plctool.link.services import AppState, TaskInfo
from plctool.link.transport import BITS_PER_BYTE
from plctool.port_check.bench import INTERVAL_US, TASK, Bench, program
from plctool.port_check.clock import Rate, Reading, measure
from plctool.port_check.report import Check, CheckFailed, NotAvailable, Result

CLOCK_SPAN = 4.0  # seconds over which clocks are compared; up to CLOCK_PATIENCE while their drift is not known well
CLOCK_PATIENCE = 16.0
CLOCK_PAUSE = 0.02  # between readings, about: they must not keep a simulated board busy
MAX_DRIFT = 0.01  # default, of the controller's clock against the host's
TIMER_SPAN = 2.0  # seconds of the controller's clock
TIMER_TRIES = 3  # the best counts: hosts and simulated boards are sometimes kept from running
MAX_MISSED = 0.01  # share of due times
DOWNLOAD_UNITS = (20, 200, 1, 300, 50, 150, 5)  # sizes of the programs, in statements
DOWNLOAD_TRIES = 5  # of the throughput, until one is fast enough
COMMITS = 300  # changes of the commit record: several times what two sectors of 4 KiB hold
MIN_LINE_SHARE = 0.5  # of the byte rate, downloads with their writing to flash
INITIAL, KEPT = 7, 4711  # values of the retain variable
FAULT_PATIENCE = 60.0  # the default watchdog needs 10 s, simulated boards are slower
MIN_STACK_SHARE = 0.05  # of the main stack, after all that the checks did

_WATCH_TIME = (
    "VAR now : LTIME; before : LTIME; now_ns : LINT; backwards : DINT; END_VAR",
    "now := LTIME(); IF now < before THEN backwards := backwards + 1; END_IF "
    "before := now; now_ns := LTIME_TO_LINT(now);",
)
_CLOCK = program(*_WATCH_TIME, interval="T#5ms")  # how fresh the time is that is read
_TIMER = program(*_WATCH_TIME)
_COUNTER = program("", "")
_RETAIN = program(f"VAR RETAIN kept : DINT := {INITIAL}; END_VAR", "")

_HEALTHY_CYCLES = 30  # before a faulty program fails
_FAULTS = {
    "division by zero": ("VAR a : DINT := 1; b : DINT; END_VAR", "a := a / b;", {"DIVIDEBYZERO"}),
    "array bounds": ("VAR f : ARRAY[0..3] OF INT; i : INT := 9; END_VAR", "f[i] := 1;", {"ARRAYBOUNDS"}),
    "null reference": ("VAR p : POINTER TO DINT; END_VAR", "p^ := 1;", {"ACCESS_VIOLATION"}),
    "endless loop": ("VAR x : DINT; END_VAR", "WHILE TRUE DO x := x + 1; END_WHILE", {"WATCHDOG"}),
    "stack overflow": ("VAR i : DINT; END_VAR", "i := Large(i);", {"STACK_OVERFLOW", "ACCESS_VIOLATION"}),
}
_SMALL_FRAME, _LARGE_FRAME = 1000, 500_000  # DINTs that no stack of a controller, or of an operating system, holds


class Checks:
    """Each check returns its text and figures, or raises CheckFailed or NotAvailable."""

    def __init__(
        self, bench: Bench, power_cycle: Callable[[], None] | None, max_drift: float, wires: Sequence[Check] = ()
    ) -> None:
        self._bench = bench
        self._wires = wires
        self._power_cycle = power_cycle
        self._max_drift = max_drift

    @property
    def _plc(self) -> Plc:
        return self._bench.plc

    def all(self) -> Iterator[Check]:
        """In their order."""
        drift_ppm = round(self._max_drift * 1e6)
        clock = {
            "drift_ppm": ("max_magnitude", drift_ppm),
            "uncertainty_ppm": ("max", drift_ppm),
            "stood_still_share": ("max_magnitude", self._max_drift),
            "backwards": ("max", 0),
        }
        yield Check("clock", self.clock, clock)
        yield Check("timer", self.timer, {"missed_share": ("max", MAX_MISSED)})
        yield Check("serial throughput", self.throughput, {"share": ("min", MIN_LINE_SHARE)})
        yield Check("flash downloads", self.downloads, {"downloads": ("min", len(DOWNLOAD_UNITS))})
        yield Check("flash commit log", self.commits, {"records": ("min", COMMITS)})
        yield Check("retain, warm reset", self.warm_reset, {"value": ("equal", KEPT)})
        yield Check("retain, cold reset", self.cold_reset, {"value": ("equal", INITIAL)})
        if self._power_cycle is not None:
            yield Check("power cycle", self.power_cycle, {"value": ("equal", KEPT)})
        for name, (_, _, expected) in _FAULTS.items():
            limits = {"exception": ("one_of", sorted(expected)), "seconds": ("max", FAULT_PATIENCE)}
            yield Check(f"exception: {name}", partial(self.exception, name), limits)
        yield from self._wires
        yield Check("stack headroom", self.stack, {"unused_share": ("min", MIN_STACK_SHARE)})
        yield Check("origin reset", self.origin_reset)

    # ---- time ----

    def _read_clock(self) -> Reading:
        before = time.monotonic()
        now_ns = self._plc.read("Main.now_ns")
        after = time.monotonic()
        return Reading(now_ns / 1e9, (before + after) / 2, after - before)

    def _measure_clock(self) -> Rate:
        """Reads until the drift is known well enough to judge it, or patience is over."""
        begin = time.monotonic()
        readings: list[Reading] = []
        for span in (CLOCK_SPAN, CLOCK_PATIENCE):
            while time.monotonic() - begin < span:
                readings.append(self._read_clock())
                time.sleep(random.uniform(0.5, 1.5) * CLOCK_PAUSE)  # in no step with the task
            rate = measure(readings, self._max_drift / 2)
            if rate.uncertainty <= self._max_drift / 2:
                break
        return rate

    def clock(self) -> Result:
        """Goes forward, and as fast as the host's."""
        self._bench.flash(_CLOCK)
        self._bench.need_monitoring()
        self._bench.wait_until_it_runs()
        rate = self._measure_clock()
        backwards = self._plc.read("Main.backwards")
        figures = {
            "drift_ppm": round(rate.drift * 1e6),
            "uncertainty_ppm": round(min(rate.uncertainty, 1) * 1e6),
            "stood_still_share": round(rate.lost, 4),
            "backwards": backwards,
        }
        text = (
            f"drift {rate.drift * 100:+.2f} % (+-{rate.uncertainty * 100:.2f} %), "
            f"stood still {rate.lost * 100:.1f} % of the time, {backwards} steps back"
        )
        if rate.uncertainty > self._max_drift:
            raise CheckFailed(f"{text}: not known well enough{_host_load()}", **figures)
        unsteady = abs(rate.lost) > self._max_drift + rate.uncertainty and not _host_load()
        if backwards or unsteady or abs(rate.drift) > self._max_drift + rate.uncertainty:
            raise CheckFailed(f"{text}; allowed are {self._max_drift * 100:g} % and 0{_host_load()}", **figures)
        return text, figures

    def _let_pass(self, seconds: float) -> None:
        """Waits, by the controller's clock."""
        end = self._read_clock().device + seconds
        self._bench.wait(lambda: self._read_clock().device >= end, f"The clock does not go on by {seconds:g} s")

    def timer(self) -> Result:
        """A cyclic task runs at its interval, by the controller's own clock. The best of several runs counts."""
        best: TaskInfo | None = None
        for _ in range(TIMER_TRIES):
            self._bench.flash(_TIMER)
            self._bench.tasks()
            self._bench.need_monitoring()
            self._bench.wait_until_it_runs()
            self._let_pass(TIMER_SPAN)
            task = self._bench.tasks()[0]
            if best is None or task.jitter_us < best.jitter_us:
                best = task
            if best.overruns == 0 and best.jitter_us < INTERVAL_US // 10:
                break
        assert best
        missed = best.overruns / max(1, best.cycles + best.overruns)
        figures = {
            "jitter_us": best.jitter_us,
            "overruns": best.overruns,
            "cycles": best.cycles,
            "missed_share": round(missed, 4),
        }
        text = f"latest start {best.jitter_us} us after its due time, {best.overruns} of {best.cycles} cycles missed"
        expected = TIMER_SPAN * 1e6 / INTERVAL_US
        if best.cycles + best.overruns < expected or missed > MAX_MISSED:
            raise CheckFailed(f"{text}; at least {expected:.0f} cycles and no misses are expected", **figures)
        return text, figures

    # ---- line and flash ----

    def throughput(self) -> Result:
        """How much of the line's byte rate a download gets: the best of some, as what keeps this machine from its work
        for a moment says nothing about the port."""
        baud = self._bench.link.options.get("baud")
        if baud is None:
            raise NotAvailable("this link has no fixed byte rate")
        size, rate, share = 0, 0.0, 0.0
        for _ in range(DOWNLOAD_TRIES):
            result = self._bench.flash(_padded(max(DOWNLOAD_UNITS)))
            size, rate = result.bytes, max(rate, result.bytes / max(result.seconds, 1e-6))
            share = rate / (int(baud) / BITS_PER_BYTE)
            if share >= MIN_LINE_SHARE:
                break
        figures = {"bytes": size, "bytes_per_s": round(rate), "share": round(share, 3)}
        text = f"{size} bytes at {rate:.0f} bytes/s: {share * 100:.0f} % of the byte rate"
        if share < MIN_LINE_SHARE:
            raise CheckFailed(f"{text}; at least {MIN_LINE_SHARE * 100:.0f} % are expected", **figures)
        return text, figures

    def downloads(self) -> Result:
        """Programs of different sizes take each other's place in the two slots, and run."""
        sizes = []
        for units in DOWNLOAD_UNITS:
            sizes.append(self._bench.flash(_padded(units)).bytes)
            self._bench.wait_until_it_runs()
            if self._bench.has_monitoring and (found := self._plc.read("Main.units")) != units:
                raise CheckFailed(f"Program {len(sizes)} of {sizes[-1]} bytes does not run as built: {found}.")
        figures = {"downloads": len(sizes), "smallest": min(sizes), "largest": max(sizes)}
        return f"{len(sizes)} programs of {min(sizes)} to {max(sizes)} bytes", figures

    def commits(self) -> Result:
        """The log of the commit record goes round. Stop and start of a new program write a record each."""
        self._bench.flash(_COUNTER)
        image = self._plc.status().image_crc
        for _ in range(COMMITS // 2):
            self._plc.stop()
            self._plc.start()
        status = self._plc.status()
        if status.image_crc != image or status.state is not AppState.RUN:
            raise CheckFailed(f"After {COMMITS} records the program is another one, or it is in {status.state}.")
        faults = [entry.text for entry in self._bench.log() if entry.text.startswith("Commit record cannot")]
        if faults:
            raise CheckFailed(f"The log says: {faults[-1]}")
        return f"{COMMITS} records written", {"records": COMMITS}

    # ---- what is kept ----

    def _flash_retain(self) -> None:
        self._bench.need_monitoring()
        self._bench.flash(_RETAIN)
        self._bench.wait_until_it_runs()
        self._plc.write({"Main.kept": KEPT})

    def _expect_kept(self, value: int) -> Result:
        if (found := self._plc.read("Main.kept")) != value:
            raise CheckFailed(f"The retain variable is {found}, it should be {value}.", value=found)
        return f"retain variable {value}", {"value": value}

    def warm_reset(self) -> Result:
        """Retain variables stay, others have their initial values again."""
        self._flash_retain()
        self._plc.reset("warm")
        if (count := self._bench.cycles()) != 0:
            raise CheckFailed(f"Main.n is {count} after the reset, it should be 0.")
        result = self._expect_kept(KEPT)
        self._plc.start()
        self._bench.wait_until_it_runs()
        return result

    def cold_reset(self) -> Result:
        """Retain variables have their initial values again."""
        self._flash_retain()
        self._plc.reset("cold")
        return self._expect_kept(INITIAL)

    def power_cycle(self) -> Result:
        """The application is booted from flash, with its retain variables if those can be looked at."""
        assert self._power_cycle
        if self._bench.has_monitoring:
            self._flash_retain()
        else:
            self._bench.flash(_COUNTER)
        self._plc.stop()  # saves
        image = self._plc.status().image_crc
        self._power_cycle()
        self._bench.reconnect()
        status = self._plc.status()
        if status.image_crc != image or status.state is not AppState.RUN:
            raise CheckFailed(f"The application was not booted: the state is {status.state}.")
        return self._expect_kept(KEPT) if self._bench.has_monitoring else ("the program was booted", {})

    # ---- what goes wrong ----

    def exception(self, name: str) -> Result:
        """A fault stops the application, not the controller; after a reset it runs again."""
        variables, body, expected = _FAULTS[name]
        self._bench.flash(self._faulty(variables, body))
        seconds = self._bench.wait(self._has_failed, "No exception", FAULT_PATIENCE)
        found = self._plc.status().exception
        figures = {"exception": found.name if found else None, "seconds": round(seconds, 3)}
        if found is None or found.name not in expected or found.task not in (TASK, None):
            raise CheckFailed(f"Reported as {found}; expected {' or '.join(sorted(expected))}.", **figures)
        self._plc.reset("warm")
        self._plc.start()
        self._bench.wait_until_it_runs(fails=True)
        place = ", ".join(filter(None, (found.task, found.pou)))
        return f"{found.name} in {place} after {seconds:.2f} s; runs again", figures

    def _has_failed(self) -> bool:
        """An endless loop may keep the controller from answering until it is aborted."""
        with suppress(LinkError):
            return self._plc.status().state is AppState.EXCEPTION
        return False

    def _faulty(self, variables: str, body: str) -> str:
        """A program that fails after some good cycles."""
        from plctool.image.targets import find_target

        text = program(variables, f"IF n > {_HEALTHY_CYCLES} THEN\n{body}\nEND_IF")
        if "Large" not in body:
            return text
        size = _LARGE_FRAME if find_target(self._bench.target).hosted else _SMALL_FRAME
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
{text}"""

    # ---- at the end ----

    def stack(self) -> Result:
        """What all this has left of the main stack."""
        stack = self._plc.stack()
        if stack is None:
            raise NotAvailable("the controller does not report what is left of its stack")
        share = stack.unused / stack.size
        figures = {"size": stack.size, "unused": stack.unused, "unused_share": round(share, 3)}
        text = f"{stack.unused} of {stack.size} bytes of the main stack were never used"
        if share < MIN_STACK_SHARE:
            raise CheckFailed(f"{text}; at least {MIN_STACK_SHARE * 100:.0f} % are expected", **figures)
        return text, figures

    def origin_reset(self) -> Result:
        """Deletes the application; the controller is empty afterwards."""
        self._plc.reset("origin")
        if (state := self._plc.status().state) is not AppState.NONE:
            raise CheckFailed(f"The state is {state}, there should be no application.")
        return "the controller is empty", {}


def _host_load() -> str:
    """The remark on a host that is overloaded; "" for others."""
    load, processors = os.getloadavg()[0], os.cpu_count() or 1
    if load <= processors:
        return ""
    return f". This host is busy (load {load:.1f}, {processors} processors): a simulated board loses time on it"


def _padded(units: int) -> str:
    """A program that is longer the more `units`, and reports them."""
    lines = "\n".join(f"x := (x XOR {i * 7919 + 1}) * {2 * i + 3};" for i in range(units))
    return program(f"VAR x : DINT; units : DINT := {units}; END_VAR", lines)
