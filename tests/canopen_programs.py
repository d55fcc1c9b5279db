"""A program and its description with CANopen nodes, for the tests of the simulator and of plcrt."""

from __future__ import annotations

import shutil
from pathlib import Path

VALVES = Path(__file__).parents[1] / "examples/canopen/valves.eds"
SOURCE = """
PROGRAM Main
VAR inputs, inputs2, inputs3, coils, coils2 : BYTE; door : BOOL; pressure : INT; lost : UDINT; frame : CAN_SEND;
    bytes : ARRAY[0..7] OF BYTE; id : DWORD; go : BOOL; END_VAR
frame(Execute := go, ID := id, Data := bytes);
coils := inputs;
IF NOT Valves.ok THEN lost := lost + 1; END_IF
END_PROGRAM
"""
BLOCKS = """
PROGRAM Main
VAR
    inputs, coils : BYTE; door : BOOL; pressure : INT; cycles : UDINT;
    r4 : CIA405_SDO_READ4; r7 : CIA405_SDO_READ7; r14 : CIA405.SDO_READ14; r21 : CIA405.SDO_READ21;
    w4 : CIA405_SDO_WRITE4; w7 : CIA405_SDO_WRITE7; w14 : CIA405.SDO_WRITE14; w21 : CIA405.SDO_WRITE21;
    read_real, read_text, read_flag : CIA405.SDO_READ; write_real, write_text : CIA405.SDO_WRITE;
    real, real2 : LREAL; text, text2 : STRING(20); flag : BOOL;
    id : CIA405.GET_LOCAL_NODE_ID; state : CIA405.GET_STATE; kernel : CIA405.GET_CANOPEN_KERNEL_STATE; nmt : CIA405.NMT;
    emcy : CIA405.RECV_EMCY; emcy_dev : CIA405.RECV_EMCY_DEV;
END_VAR
cycles := cycles + 1;
r4(); r7(); r14(); r21(); w4(); w7(); w14(); w21(); id(); state(); kernel(); nmt(); emcy(); emcy_dev();
read_real(DEVICE := 9, DATA => real2);
read_text(DEVICE := 9, DATA => text2);
read_flag(DEVICE := 9, DATA => flag);
write_real(DEVICE := 9, DATA := real);
write_text(DEVICE := 9, DATA := text);
END_PROGRAM
"""
ONE = """
[[canopen]]
name = "Bus"
node = 127
heartbeat = "T#100ms"
{line}

[[canopen.device]]
name = "Valves"
node = 9
eds = "valves.eds"
heartbeat = "T#200ms"
set = {{ "2001" = 700, "2000" = "press twenty-five" }}
in = {{ "6000:01" = "Main.inputs", "6000:01.3" = "Main.door", "6401:01" = "Main.pressure" }}
out = {{ "6200:01" = "Main.coils" }}
{device}
"""
OTHERS = """
[[canopen.device]]
name = "Second"
node = 10
eds = "valves.eds"
in = { "6000:01" = "Main.inputs2" }
out = { "6200:01" = "Main.coils2" }

[[canopen.device]]
name = "Third"
node = 11
eds = "valves.eds"
in = { "6000:01" = "Main.inputs3" }
"""

GUARD = 'guard = { every = "T#100ms", life = 5 }'
GUARD_OBJECTS = """
[100C]
ParameterName=Guard time
DataType=0x0006
AccessType=rw
DefaultValue=0

[100D]
ParameterName=Life time factor
DataType=0x0005
AccessType=rw
DefaultValue=0
"""


def write_program(folder: Path, *, others: str = "", line: str = "", device: str = "", source: str = SOURCE) -> Path:
    """The sources in a folder; `line` and `device`: more keys of the network and its first node."""
    folder.mkdir(exist_ok=True)
    shutil.copy(VALVES, folder / "valves.eds")
    (folder / "app.io.toml").write_text(ONE.format(line=line, device=device) + others)
    path = folder / "app.st"
    path.write_text(source)
    return path


def write_guarded_program(folder: Path, *, guard: str = GUARD, others: str = OTHERS) -> Path:
    """The sources of a program whose first node is guarded instead of having a heartbeat."""
    path = write_program(folder, others=others)
    description, eds = folder / "app.io.toml", folder / "valves.eds"
    description.write_text(description.read_text().replace('heartbeat = "T#200ms"', guard, 1))
    listed = "[OptionalObjects]\nSupportedObjects=13\n12=0x100C\n13=0x100D"
    eds.write_text(eds.read_text().replace("[OptionalObjects]\nSupportedObjects=11", listed) + GUARD_OBJECTS)
    return path


def eight_nodes(folder: Path) -> Path:
    """The sources of a program that runs by a SYNC of 10 ms, with eight nodes that follow it."""
    folder.mkdir(exist_ok=True)
    shutil.copy(VALVES, folder / "valves.eds")
    numbers = range(1, 9)
    variables = ", ".join(f"in{n}, out{n}" for n in numbers)
    moves = " ".join(f"out{n} := in{n};" for n in numbers)
    path = folder / "app.st"
    path.write_text(
        f"""
VAR_GLOBAL motions : UDINT; END_VAR
PROGRAM Main VAR {variables} : BYTE; END_VAR {moves} motions := motions + 1; END_PROGRAM
CONFIGURATION Plant RESOURCE Cpu ON Plc
TASK Motion(EVENT := 'Bus.sync', PRIORITY := 1);
PROGRAM m WITH Motion : Main;
END_RESOURCE END_CONFIGURATION
"""
    )
    nodes = "".join(
        f"""
[[canopen.device]]
name = "N{n}"
node = {n}
eds = "valves.eds"
heartbeat = "T#1s"
transmission = "sync"
in = {{ "6000:01" = "m.in{n}" }}
out = {{ "6200:01" = "m.out{n}" }}
"""
        for n in numbers
    )
    (folder / "app.io.toml").write_text('[[canopen]]\nname = "Bus"\nnode = 127\nsync = { every = "T#10ms" }\n' + nodes)
    return path
