"""What plctool knows of the runtime's C functions: each of them, and the component that offers it."""

from __future__ import annotations

import re

from test_firmware_layers import FIRMWARE

from plctool.image.c_functions import C_FUNCTIONS

TABLES = re.compile(r"CMP_EXT_FUNCTION (\w+)\[\] = \{(.*?)\n *\};", re.DOTALL)
COMPONENTS = {
    "CmpIecTask.externals": "CmpIecTask",
    "CmpMath.functions": "CmpMath",
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
