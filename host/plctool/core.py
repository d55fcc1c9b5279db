"""The C core in this process: shared structs and numbers (`ffi`, `lib`), and the runtime on the simulator port.

One definition of every protocol number, error code and image struct: the firmware's headers. `lib.ERR_OK`,
`ffi.new("CDL_HEADER *")` and `lib.SimStart()` all come from there.
"""

from __future__ import annotations

from functools import cache

from _plccore import ffi, lib

__all__ = ["error_name", "exception_name", "ffi", "lib"]


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
