"""What a program does with files, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from plctool.controller import Controller
from plctool.testing.waiting import eventually

NO_ERROR, HANDLE_INVALID, NOT_EXIST, EXIST, NO_MORE_ENTRIES = 0, 5103, 5104, 5105, 5106
NOT_EMPTY, READ_ONLY, WRONG_PARAMETER, INCOMPLETE, NOT_IMPLEMENTED, TOO_MANY = 5107, 5108, 5109, 5111, 5112, 5113
WRITE, READ, READ_WRITE, APPEND, APPEND_OR_CREATE = 0, 1, 2, 3, 5

DATA = 600  # bytes of the buffer of the program: several calls
PROGRAM = f"""
PROGRAM Main
VAR
    op : INT; name, other : STRING(255); mode : INT; handle, size, result : UDINT; error : UDINT; entry : STRING(255);
    data : ARRAY[0..{DATA - 1}] OF BYTE;
    open : FILE.Open; close : FILE.Close; read : FILE.Read; write : FILE.Write; setPos : FILE.SetPos;
    getPos : FILE.GetPos; atEnd : FILE.EOF; delete : FILE.Delete; rename : FILE.Rename; getSize : FILE.GetSize;
    dirOpen : FILE.DirOpen; dirList : FILE.DirList; dirClose : FILE.DirClose; copy : FILE.Copy;
    dirCreate : FILE.DirCreate; dirRemove : FILE.DirRemove; dirRename : FILE.DirRename; all : BOOL;
    modes : ARRAY[0..5] OF FILE.MODE := [FILE.MODE.MWRITE, FILE.MODE.MREAD, FILE.MODE.MRDWR, FILE.MODE.MAPPD,
        FILE.MODE.MREADPLUS, FILE.MODE.MAPPDPLUS];
    flood : UDINT; opened : UDINT; refused : UDINT; many : FILE.Open; again : BOOL; idle : BOOL;
END_VAR
idle := op = 0; // all blocks see no xExecute
open(xExecute := op = 1, sFileName := name, eFileMode := modes[mode]);
IF open.xDone THEN ended(open.hFile, 0); ELSIF open.xError THEN ended(0, open.eError); END_IF
close(xExecute := op = 2, hFile := handle);
IF close.xDone OR close.xError THEN ended(0, close.eError); END_IF
read(xExecute := op = 3, hFile := handle, pBuffer := ADR(data), szBuffer := size);
IF read.xDone OR read.xError THEN ended(read.szSize, read.eError); END_IF
write(xExecute := op = 4, hFile := handle, pBuffer := ADR(data), szSize := size);
IF write.xDone OR write.xError THEN ended(0, write.eError); END_IF
setPos(xExecute := op = 5, hFile := handle, udiPos := size);
IF setPos.xDone OR setPos.xError THEN ended(0, setPos.eError); END_IF
getPos(xExecute := op = 6, hFile := handle);
IF getPos.xDone OR getPos.xError THEN ended(getPos.udiPos, getPos.eError); END_IF
atEnd(xExecute := op = 7, hFile := handle);
IF atEnd.xDone OR atEnd.xError THEN ended(BOOL_TO_UDINT(atEnd.xEOF), atEnd.eError); END_IF
delete(xExecute := op = 8, sFileName := name);
IF delete.xDone OR delete.xError THEN ended(0, delete.eError); END_IF
rename(xExecute := op = 9, sFileNameOld := name, sFileNameNew := other);
IF rename.xDone OR rename.xError THEN ended(0, rename.eError); END_IF
getSize(xExecute := op = 10, sFileName := name);
IF getSize.xDone OR getSize.xError THEN ended(getSize.szSize, getSize.eError); END_IF
dirOpen(xExecute := op = 11, sDirName := name);
IF dirOpen.xDone OR dirOpen.xError THEN ended(dirOpen.hDir, dirOpen.eError); END_IF
dirList(xExecute := op = 12, hDir := handle);
IF dirList.xDone OR dirList.xError THEN
    entry := dirList.deDirEntry.sEntry;
    all := dirList.deDirEntry.xDirectory;
    ended(dirList.deDirEntry.szSize, dirList.eError);
END_IF
copy(xExecute := op = 13, sFileNameSource := name, sFileNameDest := other, xOverWrite := all);
IF copy.xDone OR copy.xError THEN ended(copy.szSize, copy.eError); END_IF
dirCreate(xExecute := op = 14, sDirName := name, xParent := all);
IF dirCreate.xDone OR dirCreate.xError THEN ended(0, dirCreate.eError); END_IF
dirRemove(xExecute := op = 15, sDirName := name, xRecursive := all);
IF dirRemove.xDone OR dirRemove.xError THEN ended(0, dirRemove.eError); END_IF
dirRename(xExecute := op = 16, sDirNameOld := name, sDirNameNew := other);
IF dirRename.xDone OR dirRename.xError THEN ended(0, dirRename.eError); END_IF
many(xExecute := flood > 0 AND NOT again, sFileName := name);
again := many.xDone OR many.xError;
IF again AND flood > 0 THEN
    flood := flood - 1;
    opened := opened + BOOL_TO_UDINT(many.xDone);
    refused := refused + BOOL_TO_UDINT(many.eError = FILE.ERROR.TOO_MANY_OPEN);
END_IF

METHOD ended
VAR_INPUT what, why : UDINT; END_VAR
result := what;
error := why;
op := 0;
END_METHOD
END_PROGRAM
"""


WAITING = """
PROGRAM Main
VAR
    go : BOOL; done : BOOL; wrong : INT; count : INT; opened, refused : UDINT;
    f, d : RTS_IEC_HANDLE; r : RTS_IEC_RESULT; n, position : UDINT; text : STRING := 'hello'; name : STRING;
    info : DirInfo; data : ARRAY[0..4999] OF BYTE; got : ARRAY[0..4999] OF BYTE; i : DINT; fw : DWORD;
END_VAR
IF go THEN
    go := FALSE;
    // a file in a folder, from its begin to its end
    f := SysFileOpen('trend/a', AM_WRITE, ADR(r));
    check(f = 16#FFFFFFFF AND r = 16#10);
    check(SysDirCreate('trend') = 0);
    check(SysDirCreate('trend') = 16#12);
    f := SysFile.SysFileOpen('trend/a', SysFile.ACCESS_MODE.AM_WRITE, ADR(r));
    check(r = 0);
    FOR i := 0 TO 4999 DO data[i] := DINT_TO_BYTE(i * 7 + i / 251); END_FOR
    check(SysFileWrite(f, ADR(data), 5000, ADR(r)) = 5000 AND r = 0);
    check(SysFileGetPos(f, ADR(position)) = 0 AND position = 5000);
    check(SysFileGetSize('trend/a', ADR(r)) = 0 AND r = 16#10);
    check(SysFileClose(f) = 0);
    check(SysFileClose(f) = 16#14);
    f := SysFileOpen('trend/a', AM_READ, ADR(r));
    check(SysFileGetSizeByHandle(f, ADR(r)) = 5000);
    check(SysFileEOF(f) = 1);
    check(SysFileRead(f, ADR(got), 6000, ADR(r)) = 5000 AND r = 0);
    check(MEMCMP(ADR(got), ADR(data), 5000) = 0);
    check(SysFileEOF(f) = 0);
    check(SysFileSetPos(f, 4998) = 0);
    MEMSET(ADR(got), 16#AA, 10);
    check(SysFileRead(f, ADR(got), 10, ADR(r)) = 2 AND got[0] = data[4998] AND got[2] = 16#AA);
    check(SysFileSetPos(f, 5001) = 2);
    check(SysFileWrite(f, ADR(data), 1, ADR(r)) = 0 AND r = 16#14);
    check(SysFileClose(f) = 0);
    f := SysFileOpen('trend/a', AM_READ_PLUS, ADR(r));
    check(r = 16#0C);
    check(SysFileRename('trend/a', 'b') = 0);
    check(SysFileCopy('c', 'b', ADR(n)) = 0 AND n = 5000);
    check(SysFileDelete('b') = 0);
    check(SysFileDelete('b') = 16#10);
    // names that lead out of the folder
    check(SysFileDelete('../c') = 2);
    check(SysFileDelete('/c') = 2);
    check(SysDirCreate('') = 2);
    check(SysDirDelete2('..', TRUE, FALSE) = 2);
    check(SysFileDelete('Application.cdl') = 16#27);
    // folders
    check(SysDirCreate2('x/y/z', TRUE) = 0);
    check(SysDirDelete('x') = 16#1B);
    check(SysDirRename('x', 'trend/x') = 0);
    check(SysDirDelete2('trend/x', TRUE, TRUE) = 0);
    d := SysDirOpen('trend', ADR(name), 80, ADR(info), ADR(r));
    check(r = 0 AND name = 'x' AND info.ulFlags = DF_DIRECTORY);
    check(SysDirRead(d, ADR(name), 80, ADR(info)) = 16#15);
    check(SysDirClose(d) = 0);
    d := SysDirOpen('', ADR(name), 2, 0, ADR(r));
    check(r = 0 OR r = 16#0F); // trend and c, in whatever order
    check(SysDirClose(d) = 0);
    check(SysDirDelete2('trend', TRUE, FALSE) = 0);
    // what stays of a file that is written over, under the names of Fastwel
    check(FwSysDirCreate('log\\deep') = 1 AND FwSysDirExist('log/deep') = 1 AND FwSysDirExist('\\USB Storage') = 0);
    fw := FwSysFileOpen('log\\f', 'cw');
    check(fw <> 0 AND FwSysFileWrite(fw, ADR(data), 3000) = 3000 AND FwSysFileClose(fw) = 1);
    fw := FwSysFileOpen('log\\f', 'w');
    check(FwSysFileWrite(fw, ADR(text), 5) = 5 AND FwSysFileSetPos(fw, 2998) = 1);
    check(FwSysFileSetPos(fw, 5) = 0 AND FwSysFileSetPos(fw, 3001) = 0);
    check(FwSysFileWrite(fw, ADR(text), 5) = 5 AND FwSysFileClose(fw) = 1);
    check(FwSysFileGetSize('log/f') = 3003 AND FwSysFileExists('log/g') = 0 AND FwSysFileGetSize('log/g') = -1);
    fw := FwSysFileOpen('log/f', 'r');
    check(FwSysFileRead(fw, ADR(got), 5000) = 3003 AND FwSysFileEOF(fw) = 1 AND FwSysFileClose(fw) = 1);
    MEMCPY(ADR(data), ADR(text), 5);
    check(MEMCMP(ADR(got), ADR(data), 2998) = 0 AND MEMCMP(ADR(got) + 2998, ADR(text), 5) = 0);
    fw := FwSysFileOpen('log/f', 'w'); // nothing is written over
    check(FwSysFileClose(fw) = 1 AND FwSysFileGetSize('log/f') = 3003);
    check(FwSysFileOpen('log/f', 'rw') = 0 AND FwSysDirRemove('log') = 0 AND FwSysFileDelete('log\\f') = 1);
    // 10 000 opens, none closed
    FOR i := 1 TO 10000 DO
        f := SysFileOpen('c', AM_READ, ADR(r));
        opened := opened + SEL(r = 0, UDINT#0, UDINT#1);
        refused := refused + SEL(r = 16#11, UDINT#0, UDINT#1);
    END_FOR
    done := TRUE;
END_IF

METHOD check
VAR_INPUT right : BOOL; END_VAR
count := count + 1;
IF NOT right AND wrong = 0 THEN
    wrong := count;
END_IF
END_METHOD
END_PROGRAM
"""

FULL = """
PROGRAM Main
VAR
    go, done : BOOL; f : RTS_IEC_HANDLE; r, closed : RTS_IEC_RESULT; n, total : UDINT; data : ARRAY[0..39999] OF BYTE;
END_VAR
IF go THEN
    go := FALSE;
    f := SysFileOpen('c', AM_WRITE, ADR(r));
    REPEAT
        n := SysFileWrite(f, ADR(data), 40000, ADR(r));
        total := total + n;
    UNTIL r <> 0
    END_REPEAT
    closed := SysFileClose(f);
    done := TRUE;
END_IF
END_PROGRAM
"""


@dataclass
class Files:
    """The blocks of PROGRAM, called one at a time; each returns the error."""

    plc: Controller
    wait: Callable[[Callable[[], Any]], None]
    result: int = 0

    def call(self, op: int, **values: object) -> int:
        self.plc.write({"Main." + name: value for name, value in {**values, "idle": False, "op": op}.items()})
        self.wait(lambda: self.plc.read("Main.idle"))
        self.result = self.plc.read("Main.result")
        return int(self.plc.read("Main.error"))

    def open(self, name: str, mode: int = READ) -> int:
        return self.call(1, name=name, mode=mode)

    def close(self, handle: int) -> int:
        return self.call(2, handle=handle)

    def read(self, handle: int, size: int = DATA) -> bytes:
        assert self.call(3, handle=handle, size=size) == NO_ERROR
        return bytes(self.plc.read("Main.data")[: self.result])

    def write(self, handle: int, data: bytes) -> int:
        self.plc.write({f"Main.data[{at}]": byte for at, byte in enumerate(data)})
        return self.call(4, handle=handle, size=len(data))

    def put(self, name: str, data: bytes, mode: int = WRITE) -> int:
        """Writes a whole file."""
        error = self.open(name, mode)
        handle = self.result
        for at in range(0, len(data), DATA):
            error = error or self.write(handle, data[at : at + DATA])
        return error or self.close(handle)

    def get(self, name: str) -> bytes | int:
        """The content of a file, or the error."""
        error = self.open(name)
        if error:
            return error
        handle, content = self.result, b""
        while part := self.read(handle):
            content += part
        assert self.close(handle) == NO_ERROR
        return content

    def names(self, folder: str = "") -> dict[str, int]:
        """What FILE.DirList gives; the name of a folder has a / at its end."""
        assert self.call(11, name=folder) == NO_ERROR
        handle, found = self.result, {}
        while not (error := self.call(12, handle=handle)):
            found[self.plc.read("Main.entry") + "/" * self.plc.read("Main.all")] = self.result
        assert error == NO_MORE_ENTRIES
        assert self.close(handle) == NO_ERROR
        return found


PATTERN = bytes(range(256)) * 8


class ProgramFiles:
    """The fixture `plc` is a controller that runs PROGRAM and has no files of its own."""

    open_files = 4

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def of(self, plc: Controller) -> Files:
        return Files(plc, lambda condition: self.wait(plc, condition))

    def test_file_that_was_closed_has_what_was_written(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("log.csv", PATTERN[:1500]) == NO_ERROR
        assert files.get("log.csv") == PATTERN[:1500]
        assert files.call(10, name="log.csv") == NO_ERROR
        assert files.result == 1500

    def test_file_is_the_previous_one_until_it_is_closed(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"old") == NO_ERROR
        assert files.open("a", WRITE) == NO_ERROR
        handle = files.result
        assert files.write(handle, b"newer") == NO_ERROR
        assert files.get("a") == b"old"
        assert files.close(handle) == NO_ERROR
        assert files.get("a") == b"newer"

    def test_append_adds_to_the_end(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.open("a", APPEND) == NOT_EXIST
        assert files.put("a", PATTERN[:1000], APPEND_OR_CREATE) == NO_ERROR
        assert files.put("a", PATTERN[1000:1100], APPEND) == NO_ERROR
        assert files.put("a", PATTERN[1100:1101], APPEND_OR_CREATE) == NO_ERROR
        assert files.get("a") == PATTERN[:1101]

    def test_position_says_where_the_next_read_begins(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"0123456789") == NO_ERROR
        assert files.open("a") == NO_ERROR
        handle = files.result
        assert files.read(handle, 3) == b"012"
        assert (files.call(6, handle=handle), files.result) == (NO_ERROR, 3)
        assert files.call(5, handle=handle, size=8) == NO_ERROR
        assert (files.call(7, handle=handle), files.result) == (NO_ERROR, 0)
        assert files.read(handle) == b"89"
        assert (files.call(7, handle=handle), files.result) == (NO_ERROR, 1)
        assert files.call(5, handle=handle, size=11) == WRONG_PARAMETER
        assert files.close(handle) == NO_ERROR

    def test_list_has_each_file_with_its_size(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"1") == NO_ERROR
        assert files.put("b" * 32, b"") == NO_ERROR
        assert files.names() == {"a": 1, "b" * 32: 0}

    def test_file_is_renamed_and_deleted(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"1") == NO_ERROR
        assert files.put("b", b"2") == NO_ERROR
        assert files.call(9, name="a", other="b") == EXIST
        assert files.call(9, name="none", other="c") == NOT_EXIST
        assert files.call(9, name="a", other="c/d") == NOT_EXIST
        assert files.call(9, name="a", other="c") == NO_ERROR
        assert files.call(8, name="b") == NO_ERROR
        assert files.call(8, name="b") == NOT_EXIST
        assert files.names() == {"c": 1}

    def test_name_that_leads_out_of_the_folder_is_refused(self, plc: Controller) -> None:
        files = self.of(plc)
        for name in (
            "../a",
            "/etc/passwd",
            "..",
            ".",
            "",
            ".a",
            "a/../b",
            "a//b",
            "a/",
            "a/.b",
            "a\\b",
            "a b",
            "x" * 33,
            "x" * 255,
        ):
            assert files.open(name, WRITE) == WRONG_PARAMETER, name
            assert files.open(name) == WRONG_PARAMETER, name
            assert files.call(10, name=name) == WRONG_PARAMETER, name
            assert files.call(8, name=name) == WRONG_PARAMETER, name
            assert files.call(9, name=name, other="b") == WRONG_PARAMETER, name

    def test_folder_has_files_and_folders_until_it_is_removed(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("trend/may.csv", b"1") == NOT_EXIST  # the folder
        assert files.call(14, name="trend/2026", all=False) == NOT_EXIST
        assert files.call(14, name="trend/2026", all=True) == NO_ERROR
        assert files.call(14, name="trend", all=False) == EXIST
        assert files.put("trend/may.csv", b"12") == NO_ERROR
        assert files.put("trend/2026/b", b"123") == NO_ERROR
        assert files.put("trend", b"") == EXIST
        assert files.names() == {"trend/": 0}
        assert files.names("trend") == {"2026/": 0, "may.csv": 2}
        assert files.names("trend/2026") == {"b": 3}
        assert files.call(15, name="trend", all=False) == NOT_EMPTY
        assert files.call(16, name="trend", other="trend/2026/x") == WRONG_PARAMETER
        assert files.call(16, name="trend", other="x" * 25) == WRONG_PARAMETER  # 2026/b would have 32 characters
        assert files.call(16, name="trend", other="old") == NO_ERROR
        assert files.get("old/2026/b") == b"123"
        assert files.call(11, name="trend") == NOT_EXIST
        assert files.call(15, name="old", all=True) == NO_ERROR
        assert files.names() == {}
        assert files.call(15, name="old", all=True) == NOT_EXIST
        for name in ("", "/", "..", "../x", "a/..", "/tmp", "x" * 33):
            assert files.call(14, name=name, all=True) == WRONG_PARAMETER
            assert files.call(15, name=name, all=True) == WRONG_PARAMETER
            assert name == "" or files.call(11, name=name) == WRONG_PARAMETER

    def test_copy_has_what_the_file_has(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", PATTERN[:1500]) == NO_ERROR
        assert (files.call(13, name="a", other="b", all=False), files.result) == (NO_ERROR, 1500)
        assert files.get("b") == PATTERN[:1500]
        assert files.put("a", b"new") == NO_ERROR
        assert files.call(13, name="a", other="b", all=False) == EXIST
        assert files.call(13, name="a", other="b", all=True) == NO_ERROR
        assert files.get("b") == b"new"
        assert files.call(13, name="none", other="c", all=True) == NOT_EXIST
        assert files.call(13, name="a", other="Application.cdl", all=True) == READ_ONLY

    def test_program_cannot_change_what_the_device_makes(self, plc: Controller) -> None:
        files = self.of(plc)
        for name in ("Application.cdl", "PlcLog.txt", "Retain.bin", "Settings.cfg"):
            assert files.open(name, WRITE) == READ_ONLY
            assert files.call(8, name=name) == READ_ONLY

    def test_handle_that_is_not_open_is_refused(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"1") == NO_ERROR
        assert files.open("a") == NO_ERROR
        handle = files.result
        assert files.write(handle, b"x") == HANDLE_INVALID  # it is read
        assert files.close(handle) == NO_ERROR
        for bad in (0, 1, handle, handle + 1, handle + 256, 0xFFFF_FFFF):
            assert files.call(3, handle=bad, size=1) == HANDLE_INVALID
            assert files.call(2, handle=bad) == HANDLE_INVALID
            assert files.call(12, handle=bad) == HANDLE_INVALID

    def test_mode_that_changes_a_part_of_a_file_is_not_there(self, plc: Controller) -> None:
        assert self.of(plc).open("a", READ_WRITE) == NOT_IMPLEMENTED

    def test_one_file_is_written_at_a_time(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.open("a", WRITE) == NO_ERROR
        handle = files.result
        assert files.open("b", WRITE) == TOO_MANY
        assert files.call(8, name="a") == TOO_MANY
        assert files.close(handle) == NO_ERROR
        assert files.put("b", b"1") == NO_ERROR

    def test_program_that_opens_and_never_closes_is_refused_and_leaves_nothing_behind(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"1") == NO_ERROR
        for _ in range(2):
            plc.write({"Main.name": "a", "Main.flood": 100})
            self.wait(plc, lambda: plc.read("Main.flood") == 0)
            assert (plc.read("Main.opened"), plc.read("Main.refused")) == (self.open_files, 100 - self.open_files)
            plc.reset()
            plc.start()
        assert files.get("a") == b"1"

    def test_reset_while_a_file_is_written_leaves_the_previous_one(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"old") == NO_ERROR
        assert files.open("a", WRITE) == NO_ERROR
        assert files.write(files.result, b"new") == NO_ERROR
        plc.reset()
        plc.start()
        assert files.get("a") == b"old"
        assert files.put("a", b"new") == NO_ERROR
        assert files.get("a") == b"new"

    def test_full_store_is_refused_and_keeps_the_previous_file(self, plc: Controller) -> None:
        files = self.of(plc)
        assert files.put("a", b"old") == NO_ERROR
        assert files.open("a", WRITE) == NO_ERROR
        handle = files.result
        plc.write({"Main.handle": handle, "Main.size": DATA})
        error = NO_ERROR
        for _ in range(3000):
            error = files.call(4)
            if error:
                break
        assert error == INCOMPLETE
        assert files.close(handle) == HANDLE_INVALID
        assert files.get("a") == b"old"
        assert files.put("a", b"new") == NO_ERROR
