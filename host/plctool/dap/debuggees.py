"""What is debugged: a program in the simulator, on a plcrt of its own, or on a controller."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from plctool import compiler
from plctool.controller import Controller
from plctool.dap.dump_target import DumpTarget
from plctool.dap.test_runs import programs_of
from plctool.debug.breakpoints import Debugger
from plctool.device import Plc, connect
from plctool.dump_file import Dump, load
from plctool.errors import UsageError
from plctool.image.targets import host_target
from plctool.sim import Simulator
from plctool.testing.plcrt import Plcrt

WHERE = ("simulator", "plcrt")


class Debuggee:
    """A controller with a program. `simulator`: if it is one, whose time the adapter lets pass; `debugger`: of it."""

    def __init__(self, plc: Controller, closing: ExitStack, *, launched: bool) -> None:
        self._plc = plc
        self.launched = launched
        self.simulator = plc if isinstance(plc, Simulator) else None
        self._closing = closing

    @property
    def plc(self) -> Controller:
        return self._plc

    @property
    def debugger(self) -> Debugger:
        return self.plc.breakpoints

    def end_debugging(self) -> None:
        """The program runs on."""
        self.plc.end_debugging()

    def start(self) -> None:
        """Starts a program that was launched."""
        if self.launched:
            self.plc.start()

    def close(self) -> None:
        self.plc.close()
        self._closing.close()


class TestedDebuggee(Debuggee):
    """The simulator of a test, which lets its time pass, and closes it."""

    __test__ = False  # nothing for pytest to collect

    def __init__(self, plc: Simulator) -> None:
        super().__init__(plc, ExitStack(), launched=True)

    def close(self) -> None:
        self.plc.end_debugging()


class DumpedDebuggee(Debuggee):
    """A core dump: a program that is halted for good."""

    def __init__(self, dump: Dump) -> None:
        self.launched = False
        self.simulator = None
        self._debugger = Debugger(DumpTarget(dump))

    @property
    def plc(self) -> Controller:
        raise UsageError("A dump shows a program at one moment; it does not run and cannot be changed.", "dump")

    @property
    def debugger(self) -> Debugger:
        return self._debugger

    def end_debugging(self) -> None:
        pass

    def close(self) -> None:
        pass


def launch(arguments: dict[str, Any]) -> Debuggee:
    """`program`: a source file, a folder, a project or several of them; `on`: simulator or plcrt. Raises PlcError."""
    paths, where = programs_of(arguments), arguments.get("on", "simulator")
    if where not in WHERE:
        raise UsageError(f'"on" is {" or ".join(WHERE)}, not {where!r}.', "launch")
    built = compiler.compile_sources(
        paths,
        target=host_target(),
        level=0,
        debug=True,
        checks=str(arguments.get("checks", "all")),
    )
    if where == "simulator":
        return Debuggee(Simulator(built.image, built.symbols, start=False), ExitStack(), launched=True)
    with ExitStack() as closing:
        folder = Path(closing.enter_context(tempfile.TemporaryDirectory(prefix="plctool-")))
        plcrt = closing.enter_context(Plcrt(folder / "flash", "--tcp", "0"))
        plc = closing.enter_context(connect(f"tcp:{plcrt.tcp}"))
        plc.add_symbols(built.symbols)
        plc.flash(built.image, start=False)
        return Debuggee(plc, closing.pop_all(), launched=True)


def attach(arguments: dict[str, Any]) -> Debuggee:
    """`link`: as the command line has it, such as tcp:192.168.1.5; `symbols`: a file; `password`. Or `dump`: a file.
    Raises PlcError."""
    dump = arguments.get("dump")
    if isinstance(dump, str) and dump:
        return DumpedDebuggee(load(Path(dump)))
    link, symbols, password = (arguments.get(name) for name in ("link", "symbols", "password"))
    if not isinstance(link, str) or not link:
        raise UsageError('An attach names a controller, such as "link": "tcp:192.168.1.5", or a "dump".', "attach")
    plc: Plc = connect(link, symbols=symbols, password=password)
    try:
        plc.symbols()
    except BaseException:
        plc.close()
        raise
    return Debuggee(plc, ExitStack(), launched=False)
