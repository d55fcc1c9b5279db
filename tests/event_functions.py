"""Functions that events call, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest

from plctool.controller import Controller
from plctool.core import lib
from plctool.errors import DeviceError
from plctool.testing.waiting import eventually

PROGRAM = """
VAR_GLOBAL
    heard : ARRAY[0..9] OF DINT;
    door_open, silent, trip_start, trip_stop, hang : BOOL;
    zero : DINT;
    when : TIME;
END_VAR
VAR_GLOBAL PERSISTENT
    resets : DINT;
END_VAR

FUNCTION Says : BOOL
Says := door_open;
IF door_open AND NOT silent THEN
    EventSetReason('the door is open');
END_IF
END_FUNCTION

{attribute 'call_on' := 'EVT_DenyStart, EVT_DenyStop, EVT_PrepareDownload'}
FUNCTION MayChange : BOOL
heard[0] := heard[0] + 1;
MayChange := Says();
END_FUNCTION

{attribute 'call_on' := 'OnStart'}
FUNCTION Begins
heard[1] := heard[1] + 1;
IF trip_start THEN
    heard[1] := heard[1] / zero;
END_IF
END_FUNCTION

{attribute 'call_on' := 'evt_startdone'}
FUNCTION HasBegun : BOOL
heard[2] := heard[2] + 1;
when := TIME();
HasBegun := TRUE; // of no account: nothing is asked
END_FUNCTION

{attribute 'call_on' := 'EVT_StopDone'}
FUNCTION HasEnded
heard[3] := heard[3] + 1;
IF trip_stop THEN
    heard[3] := heard[3] / zero;
END_IF
WHILE hang DO
    heard[4] := heard[4] + 1;
END_WHILE
END_FUNCTION

{attribute 'call_on' := 'EVT_ResetDone'}
FUNCTION IsReset
heard[5] := 7;
resets := resets + 1;
END_FUNCTION

PROGRAM Main
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
"""


class EventFunctions:
    """The fixture `plc` is a controller that runs PROGRAM, whose image is the fixture `image`."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def runs(self, plc: Controller) -> None:
        n = plc.read("Main.n")
        self.wait(plc, lambda: plc.read("Main.n") > n + 3)

    def test_functions_are_called_at_start_and_stop(self, plc: Controller) -> None:
        self.runs(plc)
        before = plc.read("heard[0]", "heard[1]", "heard[2]", "heard[3]")
        plc.stop()
        plc.start()
        after = plc.read("heard[0]", "heard[1]", "heard[2]", "heard[3]")
        assert [after[name] - before[name] for name in after] == [2, 1, 1, 1]
        self.runs(plc)
        assert plc.read("when").timedelta > timedelta(0)

    def test_answer_and_reason_are_those_of_the_program(self, plc: Controller, image: Any) -> None:
        plc.write({"door_open": True})
        for operate in (plc.stop, plc.reset, lambda: plc.flash(image, force=True)):
            with pytest.raises(DeviceError, match="the door is open") as caught:
                operate()
            assert caught.value.result == lib.ERR_OPERATION_DENIED
            assert str(plc.status().state) == "run"
        plc.write({"door_open": False})
        plc.stop()
        plc.write({"door_open": True})
        with pytest.raises(DeviceError, match="the door is open"):
            plc.start()
        assert str(plc.status().state) == "stop"

    def test_denial_without_reason_says_who_denies(self, plc: Controller) -> None:
        plc.write({"door_open": True, "silent": True})
        with pytest.raises(DeviceError, match="the program denies it"):
            plc.stop()

    def test_reset_to_the_origin_is_never_asked(self, plc: Controller) -> None:
        plc.write({"door_open": True})
        plc.reset("origin")
        assert str(plc.status().state) == "none"

    def test_function_after_a_reset_finds_the_initial_values(self, plc: Controller) -> None:
        before = plc.read("resets")
        plc.reset("warm")
        assert plc.read("heard[5]") == 7
        assert plc.read("resets") == before + 1

    def test_program_whose_function_fails_does_not_start(self, plc: Controller) -> None:
        plc.stop()
        plc.write({"trip_start": True})
        with pytest.raises(DeviceError):
            plc.start()
        self.check_exception(plc, "DIVIDEBYZERO", "BEGINS")
        plc.reset("warm")
        plc.start()
        self.runs(plc)

    def test_exception_in_a_function_is_the_program_s(self, plc: Controller) -> None:
        plc.write({"trip_stop": True})
        plc.stop()
        self.check_exception(plc, "DIVIDEBYZERO", "HASENDED")

    def check_exception(self, plc: Controller, name: str, pou: str) -> None:
        status = plc.status()
        assert str(status.state) == "exception"
        assert status.exception is not None
        assert (status.exception.name, str(status.exception.pou).upper()) == (name, pou)
        assert any(entry.text.startswith("Event: ") for entry in plc.log())


class EndlessFunctions(EventFunctions):
    """Where time passes in an endless loop."""

    def test_endless_function_is_ended(self, plc: Controller) -> None:
        plc.write({"hang": True})
        plc.stop()
        self.check_exception(plc, "WATCHDOG", "HASENDED")


REGISTERED = """
VAR_GLOBAL
    heard : ARRAY[0..5] OF DWORD;
    door_open : BOOL;
END_VAR
FUNCTION OnEvent : DWORD
VAR_INPUT
    dwEvent, dwFilter, dwOwner : DWORD;
END_VAR
heard[0] := heard[0] + 1;
heard[1] := dwEvent;
heard[2] := dwFilter + dwOwner;
OnEvent := 1;
END_FUNCTION
FUNCTION MayStop : BOOL
heard[3] := heard[3] + 1;
MayStop := door_open;
IF door_open THEN
    EventSetReason('the door is open');
END_IF
END_FUNCTION
PROGRAM Main
VAR
    n : INT; ok : ARRAY[0..5] OF BOOL; take, back : BOOL;
END_VAR
n := n + 1;
IF take THEN
    ok[0] := SysCallbackRegister(INDEXOF(OnEvent), EVENT_STOP)
        AND EventRegisterCallbackFunction(EventOpen(RTS_EVENT.EVT_StartDone, 0, 0), INDEXOF(OnEvent)) = 0;
    ok[1] := SysCallbackRegister(INDEXOF(MayStop), RTS_EVENT.EVT_DenyStop)
        AND SysCallbackRegister(INDEXOF(MayStop), RTS_EVENT.EVT_DenyStop);
    ok[2] := NOT SysCallbackUnregister(INDEXOF(MayStop), EVENT_START)
        AND EventUnregisterCallbackFunction(EVENT_START, INDEXOF(MayStop)) = 16#10 AND EventClose(EVENT_START) = 0;
    take := FALSE;
END_IF
IF back THEN
    ok[3] := SysCallbackUnregister(INDEXOF(MayStop), RTS_EVENT.EVT_DenyStop);
    back := FALSE;
END_IF
END_PROGRAM
"""
"""Functions that the program registers."""


def check_registered(plc: Controller, run: Callable[[], None]) -> None:
    """Lets events call the functions of REGISTERED. `run`: lets the program run for a cycle at least."""
    stop_done, start_done = 0x10004, 0x10002
    plc.write({"Main.take": True})
    run()
    assert plc.read("Main.ok")[:3] == [True] * 3
    plc.write({"door_open": True})
    with pytest.raises(DeviceError, match="the door is open"):
        plc.stop()
    plc.write({"door_open": False})
    plc.stop()
    assert plc.read("heard") == [1, stop_done, 0, 2, 0, 0]
    plc.start()
    assert plc.read("heard") == [2, start_done, 0, 2, 0, 0]
    plc.write({"door_open": True, "Main.back": True})
    run()
    plc.stop()
    assert plc.read("heard") == [3, stop_done, 0, 2, 0, 0] and plc.read("Main.ok")[3]
    plc.reset("warm")  # ends all of it
    plc.start()
    plc.stop()
    assert plc.read("heard")[0] == 0
