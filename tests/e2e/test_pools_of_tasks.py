"""Tasks that share a pool, on a real plcrt: each element belongs to one of them, and none is lost."""

from __future__ import annotations

import pytest

PROGRAM = """
{attribute 'pool' := '6'}
FUNCTION_BLOCK Item
VAR_INPUT owner, number : DINT; END_VAR
VAR_OUTPUT ready : DINT; END_VAR
METHOD FB_Init : BOOL
VAR_INPUT bInitRetains, bInCopyCode : BOOL; END_VAR
ready := 1;
END_METHOD
METHOD FB_Exit : BOOL
VAR_INPUT bInCopyCode : BOOL; END_VAR
ready := 2;
END_METHOD
END_FUNCTION_BLOCK

VAR_GLOBAL
    stop : BOOL;
    mailbox : POINTER TO Item; (* from Fast to Slow, when it is 0 *)
END_VAR

FUNCTION_BLOCK User
VAR_INPUT me : DINT; turns : INT; END_VAR
VAR_OUTPUT taken, refused, wrong : DINT; END_VAR
VAR mine : ARRAY[0..3] OF POINTER TO Item; turn : INT; k : INT; exc : __SYSTEM.ExceptionCode; END_VAR
METHOD GiveBack
FOR k := 0 TO 3 DO
    __DELETE(mine[k]);
END_FOR
END_METHOD
FOR turn := 1 TO turns DO
    k := (k + turn) MOD 4;
    __TRY
        IF mine[k] = 0 THEN
            mine[k] := __NEW(Item, 1 + k / 3);
            IF mine[k] = 0 THEN
                refused := refused + 1;
            ELSE
                taken := taken + 1;
                IF mine[k]^.ready <> 1 OR mine[k]^.owner <> 0 THEN wrong := wrong + 1; END_IF
                mine[k]^.owner := me;
                mine[k]^.number := k;
            END_IF
        ELSE
            IF mine[k]^.owner <> me OR mine[k]^.number <> k OR mine[k]^.ready <> 1 THEN wrong := wrong + 1; END_IF
            __DELETE(mine[k]);
        END_IF
    __CATCH(exc)
        wrong := wrong + 1000;
    __ENDTRY
END_FOR
END_FUNCTION_BLOCK

PROGRAM Fast
VAR user : User; sent : DINT; END_VAR
IF stop THEN RETURN; END_IF
user(me := 1, turns := 5);
IF mailbox = 0 THEN
    mailbox := __NEW(Item);
    IF mailbox <> 0 THEN sent := sent + 1; END_IF
END_IF
END_PROGRAM

PROGRAM Slow
VAR user : User; END_VAR
IF stop THEN RETURN; END_IF
user(me := 2, turns := 5000);
__DELETE(mailbox);
END_PROGRAM

PROGRAM Count (* what is left when both have stopped, and given back what they have *)
VAR_INPUT now : BOOL; END_VAR
VAR p : ARRAY[0..9] OF POINTER TO Item; k, left : INT := -1; END_VAR
IF now AND left < 0 THEN
    Fast.user.GiveBack();
    Slow.user.GiveBack();
    __DELETE(mailbox);
    left := 0;
    FOR k := 0 TO 9 DO
        p[k] := __NEW(Item);
        IF p[k] <> 0 THEN left := left + 1; END_IF
    END_FOR
END_IF
END_PROGRAM

CONFIGURATION Config
    TASK Often(INTERVAL := T#1ms, PRIORITY := 1);
    TASK Long(INTERVAL := T#5ms, PRIORITY := 2);
    TASK Seldom(INTERVAL := T#20ms, PRIORITY := 3);
    PROGRAM Fast WITH Often : Fast;
    PROGRAM Slow WITH Long : Slow;
    PROGRAM Count WITH Seldom : Count;
END_CONFIGURATION
"""


def read(tool, plcrt, *names: str) -> list[object]:
    values = tool.ok("read", "--port", plcrt.port, *names)["values"]
    return [values[name] for name in names]


@pytest.mark.parametrize("reset", ["", "warm"])
def test_no_element_is_lost_or_has_two_owners(tool, plcrt, eventually, reset):
    tool.ok("flash", "--port", plcrt.port, str(tool.build("pools", PROGRAM)))
    if reset:  # in the midst of it, with elements in use
        eventually(lambda: read(tool, plcrt, "Fast.user.taken")[0] > 500)
        tool.ok("reset", reset, "--port", plcrt.port)
        tool.ok("start", "--port", plcrt.port)
    eventually(lambda: min(read(tool, plcrt, "Fast.user.taken", "Slow.user.taken", "Slow.user.refused")) > 2000)
    eventually(lambda: read(tool, plcrt, "Fast.sent")[0] > 20)
    assert read(tool, plcrt, "Fast.user.wrong", "Slow.user.wrong") == [0, 0]
    tool.ok("write", "--port", plcrt.port, "stop=TRUE")
    cycles = [task["cycles"] for task in tool.ok("tasks", "--port", plcrt.port)["tasks"]]
    eventually(
        lambda: all(
            task["cycles"] > before + 2
            for task, before in zip(tool.ok("tasks", "--port", plcrt.port)["tasks"], cycles, strict=True)
        )
    )
    tool.ok("write", "--port", plcrt.port, "Count.now=TRUE")
    eventually(lambda: read(tool, plcrt, "Count.left")[0] >= 0)
    assert read(tool, plcrt, "Count.left") == [6]
    assert tool.ok("status", "--port", plcrt.port)["exception"] is None
