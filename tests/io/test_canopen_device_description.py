"""`[[canopen_device]]`: mistakes are reported where they are, and what is right becomes a dictionary."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_device_programs import NODE, WRITE, write_device

from plctool.compiler import CompileError, compile_sources
from plctool.image.file import parse_image
from plctool.io.canopen.eds import read_eds
from plctool.io.canopen.eds_of_image import eds_of_image


def compiled(folder: Path, old: str = "", new: str = "", **keys: str) -> bytes:
    path = write_device(folder, **keys)
    description = folder / "app.io.toml"
    text = description.read_text()
    assert old in text
    description.write_text(text.replace(old, new, 1))
    return compile_sources([path]).image


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("node = 9", "node = 128", "node is 128; it can be 1 to 127"),
        ("node = 9", "", "needs node: write for example node = 9"),
        ('"2200" =', '"1017" =', "'1017' is not an object from 2000 to BFFF"),
        ('"2200" =', '"setpoint" =', "'setpoint' is not an object"),
        ('"2203" =', '"2200" =', "there is one of this name already"),
        ('"2203" =', '"2201:00" =', "2201:00 is the number of the sub-indices that 2201 has"),
        ('"2203" =', '"2201:1" =', "the object 2201:01 is there already"),
        ('"2203" =', '"2203:FF" =', "the sub-indices of 2203 are 00 to FE"),
        ('"2102" = "Main.temps"', '"2102:01" = "Main.temps"', 'write "2102", whose sub-indices it has'),
        ('["2104", "2103:01"]', '["2104", "2200"]', "2200 is not an object of .canopen_device.read. for a PDO"),
        ('["2104", "2103:01"]', '["2101"]', "2101 is not an object of .canopen_device.read. for a PDO"),
        ('["2104", "2103:01"]', "[]", "a PDO needs objects"),
        ('["2201:02"]', '["2203", "2200"]', "a PDO has 64 bits; with 2200 there are 80"),
        ('"sync/2"', '"sync/241"', "transmission cannot be 'sync/241'"),
        ('every = "T#500ms"', "every = 500", "it has to be a duration"),
        ('every = "T#500ms"', 'every = "T#500ms", cob = 0x601', "the identifier 0x601 is one of SDO"),
        ('name = "Mixer"', 'name = "Mixér"', "name can have 63 printable ASCII characters"),
        ('"Main.error"', '"Main.count"', "Main.count is UDINT, but Field.emergency is 16 bits"),
        ("heartbeat", "heartbeet", "there is no 'heartbeet' here"),
        ('"A140:01"', '"A480:01"', "A480 is in an area of CiA 405 that others write, and Main.narrow is in read"),
        ('"A140:01"', '"A040:01"', "A040 is an object of UNSIGNED8, but Main.narrow is DINT"),
        ('"A140:01"', '"A900:01"', "CiA 405 assigns no type to A900"),
        ('"2102"', '"A0C0:FD"', "A0C0:FD and those that follow have no room for Main.temps"),
        ('["Main.energy"]', '["Main.batch2"]', "batch2"),
        ('["2104", "2103:01"]', '["Main.nothing"]', "Main.nothing is not an object of .canopen_device.read. for a PDO"),
    ],
)
def test_mistakes_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(CompileError, match=message):
        compiled(tmp_path, old, new)


def test_two_devices_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="the CANopen device of this PLC"):
        compiled(tmp_path, write=WRITE + '[[canopen_device]]\nname = "Second"\nnode = 10\n')


@pytest.mark.parametrize(("network", "is_taken"), [(0, True), (1, False)])
def test_number_of_the_manager_on_the_same_network_is_refused(tmp_path: Path, network: int, is_taken: bool) -> None:
    manager = f'[[canopen]]\nname = "Bus"\nnetwork = {network}\nnode = 9\n'
    if is_taken:
        with pytest.raises(CompileError, match="has the node number 9, too"):
            compiled(tmp_path, write=WRITE + manager)
    else:
        assert compiled(tmp_path, write=WRITE + manager)


def test_fifth_pdo_needs_an_identifier(tmp_path: Path) -> None:
    pdos = ", ".join(['{ objects = ["2104"] }'] * 3)
    with pytest.raises(CompileError, match="only 4 PDOs have an identifier by the node; give it a cob"):
        compiled(tmp_path, "tpdo = [", f"tpdo = [{pdos},")


def test_text_is_no_network_variable(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="CiA 405 has no network variables of STRING"):
        compiled(tmp_path, 'read."2101" = "Main.batch"\n', "", write=WRITE.replace('["Main.night"]', '["Main.batch"]'))


@pytest.mark.parametrize("name", ["TIME", "DATE", "TOD", "DT", "WSTRING(20)"])
def test_types_without_an_object_are_refused(tmp_path: Path, name: str) -> None:  # C405-07
    path = write_device(tmp_path)
    path.write_text(path.read_text().replace("batch : STRING(20) := 'none'", f"batch : {name}"))
    with pytest.raises(CompileError, match="no object of CANopen can be"):
        compile_sources([path])


def test_eds_is_the_same_for_the_same_image_and_has_no_doubts(tmp_path: Path) -> None:
    image = parse_image(compiled(tmp_path))
    text = eds_of_image(image, [], "app.eds")
    assert text == eds_of_image(image, [], "app.eds")
    eds = read_eds("app.eds", text.encode())
    assert not eds.findings.found
    assert eds.device.vendor == 0x319
    assert (eds.device.rx_pdos, eds.device.tx_pdos) == (4, 4)
    angle = eds.entry(0x2205)
    assert angle is not None
    assert angle.low is not None
    assert angle.high is not None
    assert (angle.low.value, angle.high.value) == (-90, 90)
    cob = eds.entry(0x1800, 1)
    assert cob is not None
    assert cob.default is not None
    assert cob.default.at(NODE) == 0x4000_0189
