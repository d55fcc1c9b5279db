"""A program that locks a device in any combination of denied events and forbidden operations, and the way out.

For each combination, under each start policy, a tool logs in, reads the status, resets to the origin and downloads
another program, which runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import BuildResult, build_program
from plctool.controller import OPERATIONS
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.image.targets import DEFAULT_TARGET, find_target
from plctool.link.connection import Connection
from plctool.link.sim import SimTransport
from plctool.sim import Simulator

MEMBERS = ("OnlineChange", "Download", "Stop", "BP", "Write", "Force", "Reset")  # as OPERATIONS
EVENTS = ("DenyStart", "DenyStop", "DenyStartBootproject", "PrepareDownload", "PrepareOnlineChange")
POLICIES = {
    "always": "Bootproject.Start=always",
    "never": "Bootproject.Start=never",
    "clean": "Bootproject.Start=clean",
    "on demand": "CreateBootprojectOnDownload=no",
}
CYCLES = 3

_FUNCTION = """
{{attribute 'call_on' := 'EVT_{event}'}}
FUNCTION On{event} : BOOL
On{event} := denied.{bit};
EventSetReason('{event}');
IF failing.{bit} THEN zero := 1 / zero; END_IF
WHILE hanging.{bit} DO zero := 0; END_WHILE
END_FUNCTION
"""
LOCK = (
    "VAR_GLOBAL PERSISTENT denied, forbidden, failing, hanging : WORD; END_VAR\n"
    + "VAR_GLOBAL trip : BOOL; zero : DINT; END_VAR\n"
    + "".join(_FUNCTION.format(event=event, bit=bit) for bit, event in enumerate(EVENTS))
    + "PROGRAM Main\n"
    + "".join(
        f"PlcOperationControlInstance.xDisableApplication{member} := forbidden.{bit};\n"
        for bit, member in enumerate(MEMBERS)
    )
    + f"PlcOperationControlInstance.xDisableAll := forbidden.{len(MEMBERS)};\n"
    + "IF trip THEN zero := 1 / zero; END_IF\n"
    + "END_PROGRAM\n"
)
"""Its functions also fail, or never end, where `failing` and `hanging` have a bit; `trip` makes its task fail."""
NEXT = "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM\n"


@dataclass(frozen=True)
class Lock:
    """`denied`, `forbidden`: a bit for each of EVENTS and OPERATIONS."""

    policy: str
    denied: int
    forbidden: int

    def denies(self, event: str) -> bool:
        return bool(self.denied >> EVENTS.index(event) & 1)

    @property
    def operations(self) -> list[str]:
        return [name for bit, name in enumerate(OPERATIONS) if self.forbidden >> bit & 1]

    @property
    def state_after_power_up(self) -> str:
        if self.policy == "on demand":
            return "none"  # it was on trial
        return "stop" if self.policy == "never" or self.denies("DenyStartBootproject") else "run"


@cache
def built(text: str) -> BuildResult:
    checked = check_sources([Source("lock.st", text)])
    assert checked.program is not None, checked.diagnostics
    return build_program(checked.program, Options(find_target(DEFAULT_TARGET), 2))


class Locked:
    """A simulated device with a start policy, and the tool that logs in on it over its protocol."""

    def __init__(self, policy: str) -> None:
        self.lock, self.next = built(LOCK), built(NEXT)
        self.device = Simulator(self.next.image, self.next.symbols)
        self.device.add_symbols(self.lock.symbols)
        self.device.put_file("Settings.cfg", f"[CmpApp]\n{POLICIES[policy]}\n".encode())
        self.device.restart()

    def __enter__(self) -> Locked:
        return self

    def __exit__(self, *_: object) -> None:
        self.device.close()

    def login(self) -> Plc:
        """A tool that was not there before."""
        lib.SimLinkReset()
        plc = Plc(Connection(SimTransport()))
        plc.add_symbols(self.lock.symbols)
        plc.add_symbols(self.next.symbols)
        return plc

    def runs(self) -> None:
        assert lib.SimAdvance(CYCLES * 10_000_000) == lib.ERR_OK

    def put_on(self, lock: Lock) -> None:
        """The program locks the device, from the next cycle on."""
        self.device.flash(self.lock.image)
        self.device.write({"denied": lock.denied, "forbidden": lock.forbidden})
        self.runs()

    def check(self, lock: Lock) -> None:
        """Locks the device and unlocks it, where the lock was put on and after a loss of power."""
        self.put_on(lock)
        self.unlock(lock, "run")
        self.put_on(lock)
        self.device.restart()
        self.runs()
        self.unlock(lock, lock.state_after_power_up)

    def unlock(self, lock: Lock, state: str) -> None:
        with self.login() as plc:
            status = plc.status()
            assert (str(status.state), status.forbidden) == (state, lock.operations if state == "run" else [])
            if state == "stop":
                self.start(lock, plc)
            elif state == "run":
                self.stop(lock, plc)
            if state != "none":
                plc.reset("origin")
            assert str(plc.status().state) == "none"
            plc.flash(self.next.image)
            self.runs()
            assert str(plc.status().state) == "run"
            assert plc.read("Main.n") > 0

    def start(self, lock: Lock, plc: Plc) -> None:
        """Only an event denies a start; what the program forbids counts again then."""
        if lock.denies("DenyStart"):
            assert refusal(plc.start) == lib.ERR_OPERATION_DENIED
            return
        plc.start()
        self.runs()
        assert plc.status().forbidden == lock.operations
        self.stop(lock, plc)

    def stop(self, lock: Lock, plc: Plc) -> None:
        if lock.denies("DenyStop") or "stop" in lock.operations:
            assert refusal(plc.stop) == lib.ERR_OPERATION_DENIED
        else:
            plc.stop()
            assert plc.status().forbidden == []


def refusal(operate: Callable[[], object]) -> int:
    """The result with which the device refuses."""
    try:
        operate()
    except DeviceError as error:
        return error.result or 0
    return int(lib.ERR_OK)
