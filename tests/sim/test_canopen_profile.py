"""CiA 405 in the simulator: network variables in their areas, and the objects that describe the program."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from canopen.sdo import SdoAbortedError

sys.path.append(str(Path(__file__).parents[1]))
sys.path.append(str(Path(__file__).parent))

from test_canopen_device import NODE, SimNetwork, client_of, frames, nmt

from plctool.compiler import compile_sources
from plctool.debug.symbols import load_symbols
from plctool.image.file import parse_image
from plctool.io.canopen.eds import read_eds
from plctool.io.canopen.eds_of_image import eds_of_image
from plctool.io.canopen.profile import Segment, dynamic_channels, segment_at
from plctool.sim import Simulator

SOURCE = """
PROGRAM Main
VAR
    b1, b2 : BOOL; i24 : DINT := -3; u24 : UDINT := 16#1234567; r : REAL := 1.5; u64 : ULINT; s24 : DINT; s48 : LINT;
    arr : ARRAY[1..3] OF INT := [1, 2, 3]; energy : UDINT := 77; low : INT(-5..5); u40 : ULINT; alone : USINT := 8;
END_VAR
IF b2 THEN i24 := s24; END_IF
END_PROGRAM
PROGRAM Other
VAR n : INT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Plant
RESOURCE Cpu ON PLC
TASK Fast(INTERVAL := T#10ms, PRIORITY := 3);
TASK Alarm(EVENT := 'stop', PRIORITY := 7);
PROGRAM Main WITH Fast : Main;
PROGRAM Other WITH Alarm : Other;
END_RESOURCE
END_CONFIGURATION
"""
DESCRIPTION = """
[[canopen_device]]
name = "Field"
node = 9
program = true
read."A140:01" = "Main.i24"
read."A180" = "Main.u24"
read."A040:05" = "Main.alone"
read."A0C0:05" = "Main.arr"
read.auto = ["Main.b1", "Main.energy", "Main.r"]
write."A5C0:01" = "Main.s24"
write."A7C0:FE" = "Main.s48"
write."A700:01" = "Main.u40"
write.auto = ["Main.b2", "Main.low", "Main.u64"]
tpdo = [{ objects = ["A140:01", "Main.energy", "Main.b1"] }]
rpdo = [{ objects = ["A5C0"] }, { objects = ["A7C0:FE", "Main.b2"] }, { objects = ["A700:01"] }]
"""
PROJECT = """
sources = ["app.st"]
[information]
name = "Mixing plant"
version = "12.34.0.0"
"""


def built(folder: Path, source: str = SOURCE, description: str = DESCRIPTION) -> str:
    """Builds a program in a folder; returns its EDS."""
    folder.mkdir(exist_ok=True)
    (folder / "app.st").write_text(source)
    (folder / "app.io.toml").write_text(description)
    (folder / "plc.toml").write_text(PROJECT)
    compile_sources([folder / "plc.toml"]).write(folder / "app.cdl")
    channels = load_symbols(folder / "app.sym").io["channels"]
    return eds_of_image(parse_image((folder / "app.cdl").read_bytes()), channels, "app.eds")


class Bed:
    """The program with its EDS."""

    def __init__(self, folder: Path) -> None:
        text = built(folder)
        self.eds_text, self.eds = text, read_eds("app.eds", text.encode())
        self.plc = Simulator.from_file(folder / "app.cdl")
        self.plc.run_for(20)
        self.sdo = client_of(SimNetwork(self.plc))

    def place(self, name: str) -> tuple[int, int]:
        """The object of a variable, by its name in the EDS."""
        return next((e.index, e.sub) for o in self.eds.objects.values() for e in o.entries.values() if e.name == name)

    def abort_of(self, index: int, sub: int, data: bytes | None = None) -> int:
        with pytest.raises(SdoAbortedError) as refused:
            if data is None:
                self.sdo.upload(index, sub)
            else:
                self.sdo.download(index, sub, data)
        return int(refused.value.code)


@pytest.fixture
def bed(tmp_path: Path) -> Iterator[Bed]:
    bed = Bed(tmp_path)
    with bed.plc:
        yield bed


def test_each_entry_of_the_eds_has_its_value_and_no_other_exists(bed: Bed) -> None:
    assert not bed.eds.findings.found
    for index in [*range(0xA000, 0xA900, 0x40), *range(0xA03F, 0xA900, 0x40), 0xA900, 0xAFFF]:
        if index not in bed.eds.objects:
            assert bed.abort_of(index, 0) == 0x06020000, hex(index)
    for found in bed.eds.objects.values():
        for entry in found.entries.values():
            assert entry.type is not None
            value = entry.type.decode(bed.sdo.upload(entry.index, entry.sub))
            assert entry.default is None or value == entry.default.at(NODE), entry.place
        if found.index >= 0x9000 and 0 in found.entries:
            highest = max(found.entries)
            assert bed.sdo.upload(found.index, 0)[0] == highest or found.index == 0x9800
            missing = next((sub for sub in range(1, 256) if sub not in found.entries), 255)
            assert bed.abort_of(found.index, missing) == 0x06090011, "a gap"
            assert bed.abort_of(found.index, 0, b"\1") == 0x06010002


def test_variables_are_in_the_areas_of_their_types_and_directions(bed: Bed) -> None:
    for name, kind, is_output in (
        ("Main.b1", "BOOLEAN", False), ("Main.energy", "UNSIGNED32", False), ("Main.r", "REAL32", False),
        ("Main.b2", "BOOLEAN", True), ("Main.low", "INTEGER16", True), ("Main.u64", "UNSIGNED64", True),
    ):  # fmt: skip
        segment = segment_at(bed.place(name)[0])
        assert segment is not None
        assert (segment.type.name, segment.is_output) == (kind, is_output)
    assert bed.place("Main.arr, element 3") == (0xA0C0, 7)
    index, sub = bed.place("Main.low")
    assert bed.abort_of(index, sub, b"\6\0") == 0x06090031
    assert bed.abort_of(0xA140, 1, b"\1\2\3") == 0x06010002
    bed.sdo.download(index, sub, b"\5\0")
    nmt(bed.plc, 1)
    bed.plc.run_for(20)
    assert bed.plc.read("Main.low") == 5


def test_narrow_integers_are_widened_with_their_sign(bed: Bed) -> None:
    plc = bed.plc
    assert bed.sdo.upload(0xA140, 1) == b"\xfd\xff\xff"
    assert bed.sdo.upload(0xA180, 1) == b"\x67\x45\x23", "the low bytes of 16#1234567"
    nmt(plc, 1)
    for number in (-1, -(1 << 23), (1 << 23) - 1, 5):
        wire = number.to_bytes(3, "little", signed=True)
        plc.can_send(0x200 + NODE, wire)
        plc.run_for(20)
        assert plc.read("Main.s24") == number
        bed.sdo.download(0xA5C0, 1, b"\0\0\0")
        bed.sdo.download(0xA5C0, 1, wire)
        plc.run_for(20)
        assert plc.read("Main.s24") == number
    plc.can_send(0x300 + NODE, (-2).to_bytes(6, "little", signed=True) + b"\1")
    plc.can_send(0x400 + NODE, b"\xff" * 5)
    plc.can_receive()
    plc.run_for(50)
    assert (plc.read("Main.s48"), plc.read("Main.u40"), plc.read("Main.i24")) == (-2, (1 << 40) - 1, 5)
    assert frames(plc, 0x180 + NODE)[-1] == b"\5\0\0" + (77).to_bytes(4, "little") + b"\0"


def test_objects_describe_the_program(bed: Bed) -> None:
    def record(index: int, *subs: int) -> list[object]:
        entries = [bed.eds.entry(index, sub) for sub in subs]
        return [e.type.decode(bed.sdo.upload(index, e.sub)) for e in entries if e is not None and e.type is not None]

    name = "Mixing plant"
    assert bed.sdo.upload(0x9800, 0) == name.encode().ljust(32, b"\0")
    assert record(0x9501, 0, 1, 2, 3) == [3, name, 0x0012_0034, 1]
    assert record(0x9600, 0, 1, 2, 3, 4) == [4, name, 0x0012_0034, 2, 0x9700]
    assert record(0x9700, 0, 1, 2, 3, 4, 5) == [5, "Fast", 0, 2, 3, 10_000]
    assert record(0x9701, 0, 1, 2, 3, 4, 5) == [5, "Alarm", 1, 1, 7, 0]
    assert len(bed.sdo.upload(0x9701, 1)) == 32
    bed.sdo.download(0x1800, 1, (0xC000_0189).to_bytes(4, "little"))
    bed.sdo.download(0x1A00, 0, b"\0")
    assert bed.abort_of(0x1A00, 1, (0x9700_0320).to_bytes(4, "little")) == 0x06040041, "not for PDOs"
    assert bed.eds_text.count("ObjFlags=1") == 4 + 5 + 6 + 6 + 1


def test_areas_are_those_of_the_standard(bed: Bed) -> None:
    def area(index: int) -> tuple[str, bool] | None:
        found: Segment | None = segment_at(index)
        return None if found is None else (found.type.name, found.is_output)

    for before, after, first, second in (
        (0xA03F, 0xA040, ("INTEGER8", False), ("UNSIGNED8", False)),
        (0xA27F, 0xA280, ("REAL32", False), ("UNSIGNED40", False)),
        (0xA47F, 0xA480, ("UNSIGNED64", False), ("INTEGER8", True)),
        (0xA8FF, 0xA900, ("UNSIGNED64", True), None),
    ):
        assert (area(before), area(after)) == (first, second)
    assert "DynamicChannelsSupported=3" in bed.eds_text
    assert "\n".join(["[DynamicChannels]", *dynamic_channels()]) in bed.eds_text
    ranges = sorted(line.partition("=")[2] for line in dynamic_channels() if line.startswith("Range"))
    assert len(ranges) == 36
    assert (ranges[0], ranges[-1]) == ("0xA000-0xA03F", "0xA8C0-0xA8FF")
    assert all(int(a[7:], 16) + 1 == int(b[:6], 16) for a, b in itertools.pairwise(ranges))


def test_another_variable_moves_none(tmp_path: Path, bed: Bed) -> None:
    source = SOURCE.replace("alone :", "first : UDINT; alone :")
    text = built(tmp_path / "more", source, DESCRIPTION.replace('["Main.b1"', '["Main.first", "Main.b1"'))
    more = read_eds("app.eds", text.encode())
    names = {(e.index, e.sub): e.name for o in more.objects.values() for e in o.entries.values() if e.sub}
    before = {(e.index, e.sub): e.name for o in bed.eds.objects.values() for e in o.entries.values() if e.sub}
    assert before.items() <= names.items()
    assert "Main.first" in names.values()
