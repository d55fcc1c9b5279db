"""A program that makes its controller a CANopen device, for the tests of plcrt, of boards and of the simulator."""

from __future__ import annotations

from pathlib import Path

NODE = 9
SOURCE = """
PROGRAM Main
VAR
    count : UDINT; batch : STRING(20) := 'none'; temps : ARRAY[1..3] OF INT := [10, -20, 30];
    setpoint : UINT := 700; run, running : BOOL; level : REAL; error : WORD; recipe : STRING(100) := 'first';
    echo : UINT; long : LINT; small : USINT; angle : INT(-90..90); ok : BOOL;
    narrow : DINT := -3; wanted : DINT; energy : UDINT := 77; night : BOOL;
END_VAR
count := count + 1;
echo := setpoint;
running := run;
narrow := wanted - 3;
energy := SEL(night, 77, 78);
ok := Field.ok;
END_PROGRAM
"""
DESCRIPTION = """
[[canopen_device]]
name = "Field"
heartbeat = "T#200ms"
emergency = "Main.error"
program = true
identity = { name = "Mixer", hardware = "A1", software = "1.2", vendor = 0x319, product = 7, revision = 0x10002 }
read."2101" = "Main.batch"
read."2102" = "Main.temps"
read."2103:01" = "Main.running"
read."2104" = "Main.echo"
read."A140:01" = "Main.narrow"
read.auto = ["Main.energy"]
tpdo = [
    { objects = ["2104", "2103:01"], every = "T#500ms" },
    { objects = ["2102:01", "2102:02"], transmission = "sync/2" },
]
rpdo = [
    { objects = ["2200", "2201:01"] },
    { objects = ["2201:02"], transmission = "sync" },
]
"""
WRITE = """
[canopen_device.write]
"2200" = { var = "Main.setpoint", store = true }
"2201:01" = "Main.run"
"2201:02" = "Main.level"
"2202" = { var = "Main.recipe", store = true }
"2203" = "Main.long"
"2205" = "Main.angle"
"2204" = { var = "Main.small", on_error = 7 }
"A5C0:01" = "Main.wanted"
auto = ["Main.night"]
"""


def write_device(folder: Path, *, device: str = f"node = {NODE}", write: str = WRITE) -> Path:
    """The sources in a folder; `device`: more keys of the device."""
    folder.mkdir(exist_ok=True)
    (folder / "app.io.toml").write_text(DESCRIPTION + device + write)
    path = folder / "app.st"
    path.write_text(SOURCE)
    return path
