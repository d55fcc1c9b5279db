"""Tasks that interrupt each other: each catches its own exceptions, and they share a pool without losing elements."""

from __future__ import annotations

from plctool.testing.waiting import eventually

PROGRAM = """
{attribute 'pool' := '3'}
TYPE Item : STRUCT owner : DINT; END_STRUCT END_TYPE
VAR_GLOBAL
    stop : BOOL;
    busy : BOOL;
    within : DINT; (* runs of the fast task while the slow one was in its cycle *)
END_VAR

FUNCTION Element : DINT
VAR_IN_OUT a : ARRAY[*] OF DINT; END_VAR
VAR_INPUT index, by : DINT; END_VAR
Element := a[index] / by;
END_FUNCTION

FUNCTION_BLOCK User
VAR_INPUT me : DINT; END_VAR
VAR_OUTPUT caught, passed, wrong, taken : DINT; END_VAR
VAR
    a : ARRAY[1..3] OF DINT := [10, 20, 30];
    mine : ARRAY[0..1] OF POINTER TO Item;
    i, k, x : DINT;
    exc : __SYSTEM.ExceptionCode;
END_VAR
METHOD Back
__DELETE(mine[0]);
__DELETE(mine[1]);
END_METHOD
i := (i + 1) MOD 5;
k := 1 - k;
__TRY
    x := Element(a, i, me - me * SEL(i = 2, 0, 1));
    passed := passed + 1;
    IF i = 0 OR i = 2 OR i > 3 THEN wrong := wrong + 1; END_IF
__CATCH(exc)
    caught := caught + 1;
    IF (exc = __SYSTEM.ExceptionCode.RTSEXCPT_DIVIDEBYZERO) <> (i = 2) THEN wrong := wrong + 1; END_IF
__ENDTRY
IF mine[k] = 0 THEN
    mine[k] := __NEW(Item);
    IF mine[k] <> 0 THEN
        taken := taken + 1;
        IF mine[k]^.owner <> 0 THEN wrong := wrong + 1; END_IF
        mine[k]^.owner := me;
    END_IF
ELSE
    IF mine[k]^.owner <> me THEN wrong := wrong + 1; END_IF
    __DELETE(mine[k]);
END_IF
END_FUNCTION_BLOCK

PROGRAM Fast
VAR user : User; END_VAR
IF stop THEN RETURN; END_IF
IF busy THEN within := within + 1; END_IF
user(me := 1);
END_PROGRAM

PROGRAM Slow
VAR user : User; turn : DINT; END_VAR
IF stop THEN RETURN; END_IF
busy := TRUE;
FOR turn := 1 TO 5000 DO
    user(me := 2);
END_FOR
busy := FALSE;
END_PROGRAM

PROGRAM Count
VAR_INPUT now : BOOL; END_VAR
VAR p : POINTER TO Item; left : DINT; END_VAR
IF now THEN
    now := FALSE;
    Fast.user.Back();
    Slow.user.Back();
    REPEAT
        p := __NEW(Item);
        IF p <> 0 THEN left := left + 1; END_IF
    UNTIL p = 0 END_REPEAT
END_IF
END_PROGRAM

CONFIGURATION Config
    TASK Often(INTERVAL := T#1ms, PRIORITY := 1);
    TASK Long(INTERVAL := T#20ms, PRIORITY := 8);
    TASK Seldom(INTERVAL := T#20ms, PRIORITY := 9);
    PROGRAM Fast WITH Often : Fast;
    PROGRAM Slow WITH Long : Slow;
    PROGRAM Count WITH Seldom : Count;
END_CONFIGURATION
"""


def test_no_exception_is_mixed_up_and_no_element_lost(plc, build):
    plc.flash(build(PROGRAM).path)
    eventually(lambda: plc.read("within") > 500 and plc.read("Slow.user.caught") > 10000)
    eventually(lambda: plc.read("Fast.user.caught") > 500 and plc.read("Fast.user.taken") > 100)
    plc.write({"stop": True})
    before = [task.cycles for task in plc.tasks()]
    eventually(lambda: all(task.cycles > old + 2 for task, old in zip(plc.tasks(), before, strict=True)))
    assert (plc.read("Fast.user.wrong"), plc.read("Slow.user.wrong")) == (0, 0)
    assert plc.read("Fast.user.passed") > 0
    plc.write({"Count.now": True})
    eventually(lambda: plc.read("Count.left") > 0)
    assert plc.read("Count.left") == 3
    assert plc.status().exception is None
