"""What a program does with a serial port, on any controller: the tests of the simulator and of plcrt."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from plctool.controller import Controller

WRONG_PARAMETER, WRONG_HANDLE, NO_PORT, IN_USE = 5084, 5085, 5091, 5092
PROGRAM = """
PROGRAM Main
VAR
    parameters : ARRAY[0..3] OF COM.PARAMETER := [(udiParameterId := 1, udiValue := 1),
        (udiParameterId := 4, udiValue := 19200), (udiParameterId := 3, udiValue := 0),
        (udiParameterId := 2, udiValue := 1)];
    start, start2, stop, big : BOOL; handle, handle2, echoed, error : UDINT; data : ARRAY[0..99] OF BYTE;
    long : ARRAY[0..8999] OF BYTE;
    open, open2 : COM.Open; close : COM.Close; read : COM.Read; write, writeLong : COM.Write;
END_VAR
open(xExecute := start, usiListLength := 4, pParameterList := ADR(parameters));
open2(xExecute := start2, usiListLength := 4, pParameterList := ADR(parameters));
IF open.xDone AND handle = 0 THEN handle := open.hCom; END_IF
read(xExecute := handle > 0 AND NOT read.xDone AND NOT read.xError AND NOT write.xBusy, hCom := handle,
    pBuffer := ADR(data), szBuffer := SIZEOF(data), udiTimeOut := 100000);
write(xExecute := read.xDone AND read.szSize > 0, hCom := handle, pBuffer := ADR(data), szSize := read.szSize);
IF write.xDone THEN echoed := echoed + 1; END_IF
writeLong(xExecute := big, hCom := handle, pBuffer := ADR(long), szSize := SIZEOF(long));
close(xExecute := stop, hCom := handle);
IF close.xError THEN error := close.eError; END_IF
END_PROGRAM
"""

FUNCTIONS = """
PROGRAM Main
VAR
    go, other : BOOL; handle, none, second, badLine : DWORD; echoed : UDINT; count : DWORD; data : ARRAY[0..99] OF BYTE;
    settings : COMMSETTINGS := (dwBaudRate := 19200, byParity := 2, byStopBits := 2);
    set, odd, closed, again : BOOL;
END_VAR
IF go AND handle = 0 THEN
    none := SysComOpen(COM8);
    handle := FwSysComOpen(COM1);
    second := SysComOpen(COM1);
    set := FwSysComSetSettings(handle, ADR(settings)) = 1;
    settings.byStopBits := 1;
    odd := SysComSetSettings(handle, ADR(settings));
END_IF
IF handle <> 0 THEN
    count := SysComRead(handle, ADR(data), SIZEOF(data), 0);
    IF count > 0 THEN
        echoed := echoed + SysComWrite(handle, ADR(data), count, 0);
    END_IF
    IF other THEN
        closed := SysComClose(handle);
        again := SysComClose(handle);
        other := FALSE;
    END_IF
END_IF
END_PROGRAM
"""
"""With the functions of SysLibCom and FastwelSysLibCom."""


class ProgramSerial:
    """Needs the fixture `plc`, with PROGRAM in it, whose serial port 1 leads to `talk`."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        raise NotImplementedError

    def exchange(self, plc: Controller, data: bytes, size: int) -> bytes:
        """Sends bytes to the port, and returns `size` bytes that come back."""
        raise NotImplementedError

    def code(self, plc: Controller, block: str) -> int:
        return int(plc.read(f"Main.{block}.calls.code"))

    def test_program_answers_and_a_stop_closes_the_port(self, plc: Controller) -> None:
        plc.write({"Main.start": True})
        self.wait(plc, lambda: plc.read("Main.handle"))
        assert self.exchange(plc, b"hello", 5) == b"hello"
        plc.write({"Main.big": True})
        assert self.exchange(plc, b"", 9000) == bytes(9000)
        plc.write({"Main.start2": True})
        self.wait(plc, lambda: self.code(plc, "open2") == IN_USE)
        plc.write({"Main.start2": False})
        plc.stop()
        self.wait_stopped(plc)
        plc.start()
        plc.write({"Main.stop": True})
        self.wait(plc, lambda: plc.read("Main.error") == WRONG_HANDLE)
        plc.write({"Main.start2": True})
        self.wait(plc, lambda: plc.read("Main.open2.xDone"))

    def test_ports_and_settings_that_are_not_there_are_errors(self, plc: Controller) -> None:
        for change, error in (("[0].udiValue", NO_PORT), ("[2].udiValue", WRONG_PARAMETER)):
            plc.write({f"Main.parameters{change}": 77, "Main.start": True})
            self.wait(plc, lambda error=error: self.code(plc, "open") == error)
            plc.write({f"Main.parameters{change}": 1, "Main.start": False})
            self.wait(plc, lambda: not plc.read("Main.open.xError"))

    def wait_stopped(self, plc: Controller) -> None:
        """Lets main make a pass."""


def check_functions(
    plc: Controller, wait: Callable[[Callable[[], Any]], None], exchange: Callable[[bytes, int], bytes]
) -> None:
    """Runs FUNCTIONS, whose port 1 leads to `exchange`."""
    plc.write({"Main.go": True})
    wait(lambda: plc.read("Main.handle"))
    assert plc.read("Main.second") == 0xFFFF_FFFF
    assert plc.read("Main.set") and not plc.read("Main.odd")
    assert exchange(b"hello", 5) == b"hello"
    plc.write({"Main.other": True})
    wait(lambda: plc.read("Main.closed"))
    assert not plc.read("Main.again")
