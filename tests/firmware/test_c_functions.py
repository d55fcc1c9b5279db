"""What plctool knows of the runtime's C functions: each of them, and the component that offers it."""

from __future__ import annotations

import re
import subprocess

import pytest
from test_firmware_layers import FIRMWARE

from plctool.image.c_functions import C_FUNCTIONS, COMPILER_COMPONENTS
from plctool.image.targets import TARGETS, Machine, Target

TABLES = re.compile(r"CMP_EXT_FUNCTION (\w+)\[\] = \{(.*?)\n *\};", re.DOTALL)
COMPONENTS = {
    "CmpIecTask.externals": "CmpIecTask",
    "CmpMath.functions": "CmpMath",
    "IecEvents.functions": "IecEvents",
    "CmpAppCalls.functions": "CmpAppCalls",
    "IecFile.functions": "IecFile",
    "IecSocket.functions": "IecSocket",
    "IecCom.functions": "IecCom",
    "IecCan.functions": "IecCan",
    "CanopenCalls.functions": "IoDrvCanopen",
    "IecClock.functions": "IecClock",
    "IecLog.functions": "IecLog",
    "IecTaskCalls.functions": "IecTaskCalls",
    "IecTaskHandler.functions": "IecTaskHandler",
    "CmpOperationControl.functions": "CmpOperationControl",
    "CmpRetain.externals": "CmpRetain",
    "ModbusCalls.functions": "IoDrvModbus",
    "CmpCompilerCalls.int_calls": "CmpIntCalls",
    "CmpCompilerCalls.real_calls": "CmpRealCalls",
    "CmpCompilerCalls.lreal_calls": "CmpLrealCalls",
}


def test_all_functions_are_known_with_their_component() -> None:
    sources = [*(FIRMWARE / "src").rglob("*.c"), *(FIRMWARE / "port/baremetal").rglob("*.c")]
    found = {
        name: COMPONENTS[f"{path.stem}.{table}"]
        for path in sources
        for table, entries in TABLES.findall(path.read_text())
        for name in re.findall(r'\{"(\w+)", 0x', entries)
    }
    assert found == {name: function.component for name, function in C_FUNCTIONS.items()}


@pytest.mark.parametrize("target", [t for t in TARGETS.values() if t.stubs], ids=lambda t: t.name)
def test_the_functions_of_a_processor_are_those_its_firmware_registers(target: Target) -> None:
    text = (FIRMWARE / "port/baremetal/common/CmpCompilerCalls.c").read_text().replace("#include", "//")
    defined = {"__arm__": target.machine is not Machine.RISCV32, "__ARM_FP": target.has_fpu}
    defined["__ARM_ARCH_6M__"] = target.machine is Machine.THUMB_V6M
    profile = "A" if target.hosted else "M"
    words = [f"-D{name}=1" if on else f"-U{name}" for name, on in defined.items()]
    words.append(f"-D__ARM_ARCH_PROFILE='{profile}'")
    done = subprocess.run(["cc", "-E", "-P", *words, "-"], input=text, capture_output=True, text=True, check=True)
    found = set(re.findall(r'\{"(\w+)", 0x', done.stdout))
    compiler = [f for f in C_FUNCTIONS.values() if f.component in COMPILER_COMPONENTS]
    assert found == {f.name for f in compiler if f.is_registered(target)}
