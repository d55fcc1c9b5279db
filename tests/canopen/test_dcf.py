"""DCFs and nodelist.cpj: what other tools get of a description, and what a description takes of theirs."""

from __future__ import annotations

import sys
from pathlib import Path

import canopen
import pytest

from plctool.cli import main as cli
from plctool.io.canopen.dcf import NodeOf, dcf_of
from plctool.io.canopen.eds import read_eds
from plctool.io.canopen.lock import locked
from plctool.io.canopen.manager import CanopenDevice
from plctool.io.description import load_description

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import OTHERS, write_program

NODE = NodeOf("a.dcf", "a.eds", 9, "Valves", 0, "Bus", 500)
LISTED = "[TOPOLOGY]\nNetName=My bus\nNodes=1\nNode9Present=0x01\nNode9Name=Valve 1\nNode9DCFName=valves.dcf\n"


@pytest.fixture
def exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """The folder of the files that `export` writes of three nodes."""
    write_program(tmp_path / "program", others=OTHERS)
    folder = tmp_path / "files"
    assert cli.main(["canopen", "export", str(tmp_path / "program/app.io.toml"), str(folder)]) == 0
    assert "nodelist.cpj written" in capsys.readouterr().out
    return folder


def devices(path: Path) -> list[CanopenDevice]:
    made = load_description(path)
    assert made.mistakes.found == []
    return [c for c in made.connectors if isinstance(c, CanopenDevice)]


def values(device: CanopenDevice) -> dict[tuple[int, int], bytes]:
    """What the manager has written in the end."""
    return {(index, sub): data for index, sub, data in device.writes}


def test_exported_file_has_what_the_manager_writes(exported: Path) -> None:
    dictionary = canopen.import_od(str(exported / "Valves.dcf"), node_id=9)
    assert dictionary.node_id == 9
    written = {
        (0x1017, 0): 200, (0x2000, 0): "press twenty-five", (0x2001, 0): 700, (0x1800, 1): 0x189,
        (0x1A00, 0): 2, (0x1A00, 1): 0x64010110, (0x1A00, 2): 0x60000108, (0x1600, 1): 0x62000108,
    }  # fmt: skip
    for (index, sub), value in written.items():
        found = dictionary[index]
        entry = found if isinstance(found, canopen.objectdictionary.ODVariable) else found[sub]
        assert entry.value == value, f"{index:04X}:{sub:02X}"


def test_imported_description_makes_the_same_nodes(exported: Path, tmp_path: Path) -> None:
    target = exported / "machine.io.toml"
    assert cli.main(["canopen", "import", str(exported), "-o", str(target)]) == 0
    text = target.read_text()
    assert '# in = { "6401:01" = "Main.Valves_6401_01", "6000:01" = "Main.Valves_6000_01" }' in text
    target.write_text(text.replace("# in =", "in =").replace("# out =", "out ="))
    originals, copies = devices(tmp_path / "program/app.io.toml"), devices(target)
    assert [(d.name, d.node) for d in copies] == [("Valves", 9), ("Second", 10), ("Third", 11)]
    assert [values(d) for d in copies] == [values(d) for d in originals]


def test_dcf_gives_node_number_heartbeat_and_values(exported: Path) -> None:
    dcf = exported / "Valves.dcf"
    dcf.write_text(dcf.read_text().replace("ParameterValue=0xC8", "ParameterValue=350"))
    path = exported / "app.io.toml"
    path.write_text('[[canopen]]\n[[canopen.device]]\nname = "V"\ndcf = "Valves.dcf"\nset = { "2001" = 5 }\n')
    (device,) = devices(path)
    assert device.node == 9
    assert values(device)[0x1017, 0] == (350).to_bytes(2, "little")
    assert values(device)[0x2001, 0] == (5).to_bytes(2, "little")  # `set` has the last word
    assert values(device)[0x2000, 0] == b"press twenty-five"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('dcf = "Valves.dcf"\nnode = 7', "Valves.dcf is of node 9 (DeviceComissioning), not 7"),
        ('dcf = "Valves.dcf"\neds = "Valves.dcf"', "write eds or dcf, not both"),
        ('dcf = "none.dcf"\nnode = 5', "none.dcf cannot be read"),
        ('dcf = "../program/valves.eds"\nnode = 5', "is outside"),
    ],
)
def test_dcf_that_does_not_fit_is_refused_with_its_line(exported: Path, keys: str, message: str) -> None:
    path = exported / "app.io.toml"
    path.write_text(f'[[canopen]]\n[[canopen.device]]\nname = "V"\n{keys}\n')
    found = load_description(path).mistakes.found
    assert found
    assert message in found[0].message
    assert found[0].pos.line >= 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[Nodes]\n", ":1:1: section [TOPOLOGY] is missing; give a nodelist.cpj."),
        (LISTED.replace("0x01", "yes"), ":4:14: 'yes' is not a number; write 0x01 for a node that is present"),
        (LISTED.replace("Node9", "Node200"), ":4:16: Node200Present: a node has a number from 1 to 127 (2 more)."),
        (LISTED.replace("Node9DCFName=valves.dcf\n", ""), ":4:14: node 9 has no Node9DCFName."),
        (LISTED.replace("valves.dcf", "x.dcf"), ":6:14: there is no file"),
        (LISTED.replace("valves.dcf", "../program/valves.eds"), "is outside"),
        (LISTED.replace("valves.dcf", "Second.dcf"), ":4:14: node 9 has the DCF of node 10"),
        (LISTED.replace("valves.dcf", "bad.dcf"), "bad.dcf:3:1: [2000] has no DataType"),
        ("\0", "nodelist.cpj is not a text file"),
    ],
)
def test_bad_list_is_refused_with_file_and_line(
    exported: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    (exported / "nodelist.cpj").write_text(text)
    (exported / "bad.dcf").write_text("[ManufacturerObjects]\n1=0x2000\n[2000]\nParameterName=x\nAccessType=rw\n")
    assert cli.main(["canopen", "import", str(exported)]) == 2
    assert message in capsys.readouterr().err
    assert not (exported / "network.io.toml").exists()


def test_names_of_other_tools_become_names_of_a_description(exported: Path) -> None:
    (exported / "nodelist.cpj").write_text(LISTED.replace("valves.dcf", "Valves.dcf"))
    assert cli.main(["canopen", "import", str(exported)]) == 0
    (device,) = devices(exported / "network.io.toml")
    assert (device.name, device.parent.name if device.parent else "") == ("Valve_1", "My_bus")


def test_values_of_compact_objects_and_missing_entries_are_written() -> None:
    eds = read_eds(
        "a.eds",
        b"[ManufacturerObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2100\n[2000]\nParameterName=x\nDataType=5\n"
        b"AccessType=rw\nCompactSubObj=3\n[2100]\nParameterName=y\nObjectType=9\nSubNumber=1\n[2100sub0]\n"
        b"ParameterName=n\nDataType=5\nAccessType=ro\n",
    )
    text = dcf_of(eds, [(0x2000, 2, b"\x07"), (0x2000, 2, b"\x08"), (0x2100, 1, bytes([1, 0, 0, 0]))], NODE)
    found = read_eds("a.dcf", text.encode())
    for index, sub, value in ((0x2000, 2, 8), (0x2100, 1, 1)):
        entry = found.entry(index, sub)
        assert entry is not None
        assert entry.value is not None
        assert entry.value.value == value
    assert not found.has_errors
    assert found.commissioning is not None
    assert (found.commissioning.node, found.commissioning.bit_rate) == (9, 500)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", (), "has no [[canopen]]"),
        ('[[canopen]]\nname = "A"\n[[canopen]]\nname = "B"\nnetwork = 1\n', (), "choose one with --network: A, B"),
        ('[[canopen]]\nname = "A"\n', ("--network", "C"), "no [[canopen]] with the name C"),
        ("[[canopen]]\nnode = 200\n", (), "app.io.toml:2:8: node is 200; it can be 1 to 127"),
    ],
)
def test_description_without_a_network_is_not_exported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, options: tuple[str, ...], message: str
) -> None:
    path = tmp_path / "app.io.toml"
    path.write_text(text)
    assert cli.main(["canopen", "export", str(path), str(tmp_path / "out"), *options]) == 2
    assert message in capsys.readouterr().err


def test_tools_of_an_eds_are_in_the_dcf(tmp_path: Path) -> None:  # C405-39
    description = write_program(tmp_path).with_name("app.io.toml")
    eds = tmp_path / "valves.eds"
    tools = "[Tools]\nItems=1\n\n[Tool1]\nName=Valve tool\nCommand=valves.exe $DCF\n"
    eds.write_text(eds.read_text() + "\n" + tools)
    assert cli.main(["canopen", "export", str(description), str(tmp_path / "files")]) == 0
    assert tools in (tmp_path / "files/Valves.dcf").read_text()


def test_folder_that_another_tool_has_locked_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:  # C405-38
    description = write_program(tmp_path).with_name("app.io.toml")
    files = tmp_path / "files"
    files.mkdir()
    with locked(files, "Network tool"):
        assert cli.main(["canopen", "export", str(description), str(files)]) == 2
        assert "Network tool has locked" in capsys.readouterr().err
        assert [path.name for path in files.iterdir()] == ["lock"]
    assert cli.main(["canopen", "export", str(description), str(files)]) == 0
    assert (files / "lock").read_text() == ""
    with locked(files):  # who reads need not wait
        assert cli.main(["canopen", "import", str(files), "-o", str(tmp_path / "other.io.toml")]) == 0
