"""plctool: compile IEC 61131-3 Structured Text to native code and run it on small controllers.

    with plctool.connect("serial:/dev/ttyS0") as plc:
        plc.flash("app.cdl")
        print(plc.read("Main.counter"))

Names are imported when they are first used, so that `plctool --version` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from plctool.errors import DeviceError, LinkError, PlcError, UsageError

if TYPE_CHECKING:
    from plctool.controller import ProgramStopped
    from plctool.device import Plc, connect, scan
    from plctool.sim import Simulator

    __version__: str

__all__ = [
    "DeviceError",
    "LinkError",
    "Plc",
    "PlcError",
    "ProgramStopped",
    "Simulator",
    "UsageError",
    "__version__",
    "connect",
    "scan",
]

_HOMES = {
    **dict.fromkeys(("Plc", "connect", "scan"), "plctool.device"),
    "ProgramStopped": "plctool.controller",
    "Simulator": "plctool.sim",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from plctool.version import plctool_version

        return plctool_version()
    if name not in _HOMES:
        raise AttributeError(f"module 'plctool' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
