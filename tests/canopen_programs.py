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


def of_many_writes(folder: Path, nodes: int, writes: int) -> Path:
    """The sources of a program with nodes into each of which so many values are written before they start."""
    folder.mkdir(exist_ok=True)
    indices = range(0x2100, 0x2100 + writes)
    text = VALVES.read_text().replace("[ManufacturerObjects]\nSupportedObjects=2", "[ManufacturerObjects]\n{listed}")
    listed = [f"SupportedObjects={writes + 2}", *(f"{n}=0x{index:X}" for n, index in enumerate(indices, 3))]
    objects = (f"[{index:X}]\nParameterName=x\nDataType=0x0006\nAccessType=rw\n\n" for index in indices)
    (folder / "many.eds").write_text(text.replace("{listed}", "\n".join(listed)) + "\n" + "".join(objects))
    values = ", ".join(f'"{index:X}" = {index & 0xFF}' for index in indices)
    described = "".join(
        f"""
[[canopen.device]]
name = "N{n}"
node = {n}
eds = "many.eds"
set = {{ {values} }}
out = {{ "6200:01" = "Main.out{n}" }}
"""
        for n in range(1, nodes + 1)
    )
    (folder / "app.io.toml").write_text('[[canopen]]\nname = "Bus"\nnode = 127\n' + described)
    path = folder / "app.st"
    variables = ", ".join(f"out{n}" for n in range(1, nodes + 1))
    path.write_text(f"PROGRAM Main VAR {variables} : BYTE; END_VAR END_PROGRAM")
    return path


SUB_OBJECT = "[{index:04X}sub{sub}]\nParameterName=x\nDataType=0x{type:04X}\nAccessType={access}\n{more}\n"


def with_more_pdos(text: str, count: int) -> str:
    """valves.eds with `count` TPDOs, and three more inputs of 64 bits."""
    added = []
    for n in range(1, count):
        added.append(f"[{0x1800 + n:04X}]\nParameterName=x\nObjectType=0x9\nSubNumber=3\n\n")
        for sub, kind, value in ((0, 5, "5"), (1, 7, f"$NODEID+0x{0x80000180 + n:X}"), (2, 5, "255"), (5, 6, "0")):
            access, more = "rw" if sub else "const", f"DefaultValue={value}\n"
            added.append(SUB_OBJECT.format(index=0x1800 + n, sub=sub, type=kind, access=access, more=more))
        added.append(f"[{0x1A00 + n:04X}]\nParameterName=x\nObjectType=0x9\nSubNumber=2\n\n")
        for sub, kind in ((0, 5), (1, 7)):
            added.append(SUB_OBJECT.format(index=0x1A00 + n, sub=sub, type=kind, access="rw", more="DefaultValue=0\n"))
    added.append(f"[6444]\nParameterName=x\nObjectType=0x8\nSubNumber={count + 4}\n\n")
    added.append(SUB_OBJECT.format(index=0x6444, sub=0, type=5, access="const", more=f"DefaultValue={count + 3}\n"))
    for sub in range(1, count + 4):
        added.append(SUB_OBJECT.format(index=0x6444, sub=f"{sub:X}", type=0x1B, access="ro", more="PDOMapping=1\n"))
    listed = [*(0x1800 + n for n in range(1, count)), *(0x1A00 + n for n in range(1, count)), 0x6444]
    text = text.replace(
        "[OptionalObjects]\nSupportedObjects=11", f"[OptionalObjects]\nSupportedObjects={11 + len(listed)}"
    )
    lines = "".join(f"{12 + i}=0x{index:04X}\n" for i, index in enumerate(listed))
    return text.replace("11=0x6401\n", "11=0x6401\n" + lines) + "\n" + "".join(added)
