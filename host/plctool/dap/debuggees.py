"""What is debugged: a program in the simulator, on a plcrt of its own, or on a controller."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from plctool import compiler
from plctool.controller import Controller
from plctool.device import Plc, connect
from plctool.errors import UsageError
from plctool.image.targets import host_target
from plctool.sim import Simulator
from plctool.testing.plcrt import Plcrt

WHERE = ("simulator", "plcrt")


class Debuggee:
    """A controller with a program. `simulator`: if it is one, whose time the adapter lets pass."""

    def __init__(self, plc: Controller, closing: ExitStack, *, launched: bool) -> None:
        self.plc = plc
        self.launched = launched
        self.simulator = plc if isinstance(plc, Simulator) else None
        self._closing = closing

    def start(self) -> None:
        """Starts a program that was launched."""
        if self.launched:
            self.plc.start()

    def close(self) -> None:
        self.plc.close()
        self._closing.close()


def launch(arguments: dict[str, Any]) -> Debuggee:
    """`program`: a source file, a folder, a project or several of them; `on`: simulator or plcrt. Raises PlcError."""
    program, where = arguments.get("program"), arguments.get("on", "simulator")
    paths = [p for p in (program if isinstance(program, list) else [program]) if isinstance(p, str) and p]
    if not paths:
        raise UsageError('A launch names its program, such as "program": "src"; a path, or a list of paths.', "launch")
    if where not in WHERE:
        raise UsageError(f'"on" is {" or ".join(WHERE)}, not {where!r}.', "launch")
    built = compiler.compile_sources(
        [Path(path) for path in paths],
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
    """`link`: as the command line has it, such as tcp:192.168.1.5; `symbols`: a file; `password`. Raises PlcError."""
    link, symbols, password = (arguments.get(name) for name in ("link", "symbols", "password"))
    if not isinstance(link, str) or not link:
        raise UsageError('An attach names a controller, such as "link": "tcp:192.168.1.5".', "attach")
    plc: Plc = connect(link, symbols=symbols, password=password)
    try:
        plc.symbols()
    except BaseException:
        plc.close()
        raise
    return Debuggee(plc, ExitStack(), launched=False)
