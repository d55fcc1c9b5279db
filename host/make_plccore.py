"""Writes the C source of the `_plccore` extension module.

The definitions come from the firmware's own headers, run through the C preprocessor with RTS_CFFI defined: there is
no second copy of a struct, a number or a prototype that could drift.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
from pathlib import Path

import cffi

SHARED = [
    "CmpErrors.h",
    "CompactDownload.h",
    "IoConfig.h",
    "IoDrvGpio.h",
    "IoDrvSim.h",
    "IoDrvModbus.h",
    "IoDrvCanopen.h",
    "CanopenObject.h",
    "CanopenProgram.h",
    "IoDrvCanopenDevice.h",
    "IoDrvSysfs.h",
    "CmpIecAbi.h",
    "SysExcept.h",
    "SysStart.h",
    "CmpAppEmbedded.h",
    "CmpForce.h",
    "CmpOperationControl.h",
    "AppByName.h",
    "AppReason.h",
    "CmpTraceMgr.h",
    "CmpAppBP.h",
    "CmpIecTask.h",
    "CmpTaskLoad.h",
    "CmpItf.h",
    "CmpLog.h",
    "CmpLogKeep.h",
    "SettingsCheck.h",
    "CmpPackets.h",
    "AppRecord.h",
    "BoardFacts.h",
    "CmpSrvNumbers.h",
    "Sim.h",
    "SimLink.h",
    "SimBoards.h",
    "SysFlashLog.h",
    "SysTimeRtc.h",
]


def preprocess(cc: str, include: list[str], *flags: str) -> str:
    """What the preprocessor prints for all shared headers with RTS_CFFI defined."""
    source = "".join(f'#include "{name}"\n' for name in SHARED)
    command = [*shlex.split(cc), "-E", "-xc", "-std=c99", "-DRTS_CFFI", *(f"-I{path}" for path in include), *flags, "-"]
    return subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--cc",
        required=True,
        help="the C compiler, for its preprocessor; with ccache in front of it if meson found one",
    )
    parser.add_argument("--include", nargs="+", required=True, help="where the shared headers are")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--depfile", type=Path, required=True, help="for the build system: the headers that were read")
    args = parser.parse_args()

    ffi = cffi.FFI()
    ffi.cdef(preprocess(args.cc, args.include, "-P"))
    ffi.set_source("_plccore", "".join(f'#include "{name}"\n' for name in SHARED))
    ffi.emit_c_code(str(args.output))
    args.depfile.write_text(preprocess(args.cc, args.include, "-M", "-MT", args.output.name))


if __name__ == "__main__":
    main()
