"""`plctool run --files`: a folder has the files of the device."""

from __future__ import annotations

from pathlib import Path

import pytest

PROGRAM = """
PROGRAM Main
VAR
    append : FILE.Open; write : FILE.Write; close : FILE.Close; delete : FILE.Delete;
    line : STRING := 'two$N'; stop : BOOL; zero, bad : INT;
END_VAR
append(xExecute := TRUE, sFileName := 'log.txt', eFileMode := FILE.MODE.MAPPDPLUS);
write(xExecute := append.xDone, hFile := append.hFile, pBuffer := ADR(line), szSize := 4);
close(xExecute := write.xDone, hFile := append.hFile);
delete(xExecute := close.xDone, sFileName := 'old.txt');
IF delete.xDone AND stop THEN
    bad := 1 / zero;
END_IF
END_PROGRAM
"""


@pytest.fixture
def image(tool, tmp_path: Path) -> Path:
    source = tmp_path / "files.st"
    source.write_text(PROGRAM)
    assert tool("build", str(source), "-o", str(tmp_path / "files.cdl")).status == 0
    return tmp_path / "files.cdl"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "device"
    made.mkdir()
    (made / "log.txt").write_bytes(b"one\n")
    (made / "old.txt").write_bytes(b"")
    (made / ".hidden").write_bytes(b"x")
    (made / "more").mkdir()
    return made


@pytest.mark.parametrize(("stop", "status"), [("FALSE", 0), ("TRUE", 1)])
def test_folder_has_what_the_program_made_of_its_files_also_when_it_fails(tool, image, folder, stop, status) -> None:
    done = tool("run", str(image), "--cycles", "30", "--files", str(folder), "--set", f"Main.stop={stop}")
    assert (done.status != 0) == (status != 0), done.err
    assert (folder / "log.txt").read_bytes() == b"one\ntwo\n"
    assert sorted(path.name for path in folder.iterdir()) == [".hidden", "log.txt", "more"]


def test_folder_that_the_device_cannot_have_is_refused(tool, image, folder) -> None:
    (folder / "two words.txt").write_bytes(b"")
    done = tool("run", str(image), "--files", str(folder))
    assert done.status == 2 and "two words.txt cannot be a file of the device" in done.err
    assert (folder / "log.txt").read_bytes() == b"one\n"


def test_folder_that_is_not_there_is_made(tool, image, tmp_path) -> None:
    assert tool("run", str(image), "--cycles", "30", "--files", str(tmp_path / "new")).status == 0
    assert (tmp_path / "new" / "log.txt").read_bytes() == b"two\n"


def test_file_in_place_of_the_folder_is_refused(tool, image, tmp_path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    assert tool("run", str(image), "--files", str(tmp_path / "file")).status == 2
    assert (tmp_path / "file").read_bytes() == b"x"


def test_folders_are_those_of_the_program_and_links_lead_nowhere(tool, tmp_path) -> None:
    source = tmp_path / "folders.st"
    source.write_text("""
PROGRAM Main
VAR file : RTS_IEC_HANDLE; result : RTS_IEC_RESULT; END_VAR
SysDirCreate2('trend/empty', TRUE);
SysFileCopy('trend/new', 'trend/old', 0);
SysFileDelete('trend/old');
SysFileClose(SysFileOpen('away', AM_WRITE, ADR(result)));
END_PROGRAM
""")
    assert tool("build", str(source), "-o", str(tmp_path / "folders.cdl")).status == 0
    device, outside = tmp_path / "device", tmp_path / "outside"
    (device / "trend").mkdir(parents=True)
    (device / "trend" / "old").write_bytes(b"1")
    outside.write_bytes(b"mine")
    (device / "away").symlink_to(outside)
    done = tool("run", str(tmp_path / "folders.cdl"), "--cycles", "1", "--files", str(device))
    assert done.status == 2 and "away is a link" in done.err
    assert outside.read_bytes() == b"mine"
    (device / "away").unlink()
    (device / "trend" / "old").write_bytes(b"1")
    assert tool("run", str(tmp_path / "folders.cdl"), "--cycles", "1", "--files", str(device)).status == 0
    assert [path.name for path in sorted((device / "trend").iterdir())] == ["empty", "new"]
    assert (device / "trend" / "new").read_bytes() == b"1" and (device / "away").read_bytes() == b""
