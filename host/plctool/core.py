"""The C core in this process: shared structs and numbers (`ffi`, `lib`), and the runtime on the simulator port.

One definition of every protocol number, error code and image struct: the firmware's headers. `lib.ERR_OK`,
`ffi.new("CDL_HEADER *")` and `lib.SimStart()` all come from there.

The runtime is one controller, with static memory, as on a device. What simulates several at once takes a `Core` for
each: the first is that of `lib`; the others are copies of the extension module, which are libraries of their own.
"""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from pathlib import Path
from typing import Any

import _plccore
from _plccore import ffi, lib

from plctool.errors import UsageError

__all__ = ["Core", "error_name", "exception_name", "ffi", "give_back_core", "lib", "take_core"]


@dataclass(frozen=True)
class Core:
    """One runtime with its memory. What its `lib` takes is made by its own `ffi`."""

    ffi: Any
    lib: Any


_FIRST = Core(ffi, lib)
_free = [_FIRST]  # the last is taken first


def take_core() -> Core:
    """A runtime that nothing else in this process uses; the first one if possible. Raises UsageError when another copy
    cannot be loaded."""
    return _free.pop() if _free else _loaded_copy()


def give_back_core(core: Core) -> None:
    """It is off and may be taken again: a library is never unloaded."""
    _free.append(core)
    _free.sort(key=lambda free: free is _FIRST)


def _loaded_copy() -> Core:
    """Each file of its own gets memory of its own; once it is loaded, its name is not needed any more."""
    original = Path(_plccore.__file__)
    try:
        with tempfile.TemporaryDirectory(prefix="plctool-") as folder:
            copy = shutil.copy(original, folder)
            loader = ExtensionFileLoader("_plccore", copy)
            module = loader.create_module(ModuleSpec("_plccore", loader, origin=copy))
    except (ImportError, OSError) as error:
        hint = "TMPDIR names a folder from which libraries may be loaded"
        raise UsageError(f"Another simulator cannot be made: {error}; {hint}.", "no-simulator") from None
    return Core(module.ffi, module.lib)


@cache
def _names(prefix: str) -> dict[int, str]:
    return {getattr(lib, name): name for name in reversed(dir(lib)) if name.startswith(prefix)}


def error_name(result: int) -> str:
    """ERR_* of a result code, or its number in hex."""
    return _names("ERR_").get(result, f"error 0x{result:04X}")


def exception_name(code: int) -> str:
    """The name of an RTSEXCPT_* code without its prefix, or its number in hex."""
    name = _names("RTSEXCPT_").get(code)
    return name.removeprefix("RTSEXCPT_") if name else f"0x{code:04X}"
