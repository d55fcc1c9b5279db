"""What the inputs and outputs of a simulated controller are connected to, as `run --plant` and `--fault` say."""

from __future__ import annotations

import runpy
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.errors import PlcError, UsageError

if TYPE_CHECKING:
    from plctool.io.faults import Fault
    from plctool.sim import Simulator
    from plctool.sim_plant import PlantProgram

_LONGEST_MS = 1e9


@contextmanager
def attached(plc: Simulator, path: Path, aside: bool = False) -> Iterator[None]:
    """The plant in a file is connected to a simulator: Python with a function `step`, or a program in ST. `aside`: what
    it prints goes to stderr. Raises UsageError, with file and line, when Python code of the plant fails."""
    if path.suffix.lower() == ".py":
        plc.attach(*_python_plant(path, aside))
        yield
        return
    from plctool.sim_plant import PlantProgram

    with PlantProgram.from_file(path) if path.suffix.lower() == ".cdl" else _compiled_plant(path) as plant:
        plc.attach(plant, plant.every_ms)
        yield


def plan_faults(plc: Simulator, faults: Sequence[Fault]) -> None:
    """Raises UsageError or DeviceError at once for what is not there."""
    for fault in faults:
        plc.fault(fault.device, fault.fault, 0)
    for fault in faults:
        step = partial(_happen, fault=fault)
        if fault.at_ms == 0:
            step(plc)
        else:
            plc.at(fault.at_ms, step)


def _happen(plc: Simulator, fault: Fault) -> None:
    plc.fault(fault.device, fault.fault, fault.value)


def files_of_plant(path: Path) -> Iterator[Path]:
    """The files that `attached` reads."""
    from plctool.compiler import IoFiles, program_files

    if path.suffix.lower() in (".py", ".cdl"):
        yield path
    else:
        yield from program_files([path], IoFiles(wanted=False)).every_file()


def _compiled_plant(path: Path) -> PlantProgram:
    """It runs on this machine, and its variables are its own, whatever description and board lie beside it."""
    from plctool.compiler import IoFiles, compile_sources
    from plctool.image.targets import host_target
    from plctool.sim_plant import PlantProgram

    built = compile_sources([path], target=host_target(), io=IoFiles(wanted=False))
    return PlantProgram(built.image, built.symbols)


def _python_plant(path: Path, aside: bool) -> tuple[Callable[[Simulator], None], float]:
    """Its function, and how often it is called [ms]."""
    with _said_with_its_line(path), _prints(aside):
        names = runpy.run_path(str(path))
    step, every = names.get("step"), names.get("EVERY_MS", 1)
    if not callable(step):
        raise UsageError(f"{path} has no function step; write: def step(plc): ...", "no-plant")
    if not isinstance(every, int | float) or not 0 < every < _LONGEST_MS:
        raise UsageError(f"EVERY_MS in {path} is not a number of milliseconds above 0.", "no-plant")

    def guarded(plc: Simulator) -> None:
        with _said_with_its_line(path), _prints(aside):
            step(plc)

    return guarded, every


def _prints(aside: bool) -> AbstractContextManager[object]:
    return redirect_stdout(sys.stderr) if aside else nullcontext()


@contextmanager
def _said_with_its_line(path: Path) -> Iterator[None]:
    try:
        yield
    except PlcError:
        raise
    except SyntaxError as error:
        place = f"{error.filename}:{error.lineno}" if error.filename else str(path)
        raise UsageError(f"{place}: {error.msg}", "no-plant") from error
    except (Exception, SystemExit) as error:
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        if not own and isinstance(error, OSError):
            raise UsageError(f"{path} cannot be read: {error.strerror}.", "no-plant") from None
        place = f"{path}:{own[-1].lineno}" if own else str(path)
        reason = f"{type(error).__name__}: {error}"
        if isinstance(error, SystemExit):
            reason = "exit would end plctool, not the plant; return instead."
        raise UsageError(f"{place}: {reason}", "no-plant") from error
