"""The simulated devices in tests with faults: time passes for them as it does for the test."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from plctool.compiler.semantics.assertions import LTIME_NOW
from plctool.compiler.semantics.unit_test_devices import FAULTS, PASS, START
from plctool.core import lib
from plctool.iec.areas import Area
from plctool.sim_functions import EndProgram, SimFunctions

if TYPE_CHECKING:
    from plctool.compiler.semantics.unit_tests import TestCase
    from plctool.io.faults import Fault
    from plctool.sim import Simulator

_NS_PER_MS = 1_000_000
_LOOK_EVERY_NS = 60_000 * _NS_PER_MS  # of virtual time, whether the test takes too long


class Devices:
    """What a test calls, `functions`. `input_size`: bytes of the inputs; `limit_ms`: as that of a test, of the
    processor's time."""

    def __init__(self, input_size: int, limit_ms: int) -> None:
        calls = {START: self._start, FAULTS: self._begin_faults, PASS: self._pass}
        self.functions = SimFunctions.without_parameters([calls[number] for number in sorted(calls)])
        self._input_size, self._limit_s = input_size, limit_ms / 1000
        self._has_run = False

    def prepare(self, plc: Simulator, case: TestCase) -> None:
        """Before the cold start of any test: a test with faults begins with devices that nothing has happened to, and
        leaves none of its own to the next."""
        if case.faults or self._has_run:
            plc.restart()
        self._has_run = bool(case.faults)
        self._plc, self._case = plc, case
        self._planned: list[tuple[int, Fault]] = []  # by their times [ns]
        self._now_ns = 0  # on the clock of the test, until which time has passed for the devices

    # ---- what the test calls ----

    def _start(self) -> None:
        self._inputs = self._read_inputs()
        self._started_s = time.process_time()

    def _begin_faults(self) -> None:
        begin = self._clock_ns()
        planned = [(begin + round(fault.at_ms * _NS_PER_MS), fault) for fault in self._case.faults]
        self._planned = sorted(planned, key=lambda entry: entry[0])
        self._set_faults(begin)

    def _pass(self) -> None:
        """Until the time of the test."""
        self._follow_inputs()
        end = self._clock_ns()
        while self._planned and self._planned[0][0] <= end:
            self._run_until(self._planned[0][0])
            self._set_faults(self._now_ns)
        self._run_until(end)
        self._inputs = self._read_inputs()

    # ---- time ----

    def _clock_ns(self) -> int:
        symbol = self._plc.symbols().resolve(LTIME_NOW)
        return int.from_bytes(self._plc.memory(Area(symbol.area), symbol.offset, symbol.size), "little", signed=True)

    def _run_until(self, end_ns: int) -> None:
        while self._now_ns < end_ns:
            step = min(end_ns - self._now_ns, _LOOK_EVERY_NS)
            self._plc.run_devices(step)
            self._now_ns += step
            if time.process_time() - self._started_s > self._limit_s:
                raise EndProgram(int(lib.RTSEXCPT_WATCHDOG))

    def _set_faults(self, now_ns: int) -> None:
        """Those whose time has come."""
        while self._planned and self._planned[0][0] <= now_ns:
            fault = self._planned.pop(0)[1]
            self._plc.fault(fault.device, fault.fault, fault.value)

    # ---- inputs ----

    def _read_inputs(self) -> bytes:
        return bytes(self._plc.memory(Area.INPUT, 0, self._input_size)) if self._input_size else b""

    def _follow_inputs(self) -> None:
        """What the test has written to an input its device measures. Inputs that it has not written are left alone:
        they may be those of a lost device."""
        now = self._read_inputs()
        if now == self._inputs:
            return
        for at, (new, old) in enumerate(zip(now, self._inputs, strict=True)):
            for bit in range(8):
                if (new ^ old) >> bit & 1:
                    self._plc.follow_inputs(8 * at + bit, 8 * at + bit + 1)
