"""Values that go from task to task, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from plctool.controller import Controller
from plctool.testing.waiting import eventually

PROGRAM = """
TYPE Values : STRUCT a, b, c, d, e, f, g, h : DINT; END_STRUCT END_TYPE
VAR_GLOBAL
    wrong : ARRAY[0..9] OF F_LINK_RESULT;
    late : F_LINK_RESULT;
    linked : F_LINK_RESULT := LinkTasks();
END_VAR
FUNCTION Described
VAR_INPUT address : POINTER TO BYTE; size, index : INT; END_VAR
VAR_IN_OUT d : F_LINK_DESCRIPTOR; END_VAR
d.variableAddress := address;
d.variableSize := size;
d.pouIndex := index;
END_FUNCTION
FUNCTION Result : F_LINK_RESULT
VAR_IN_OUT from, into : F_LINK_DESCRIPTOR; END_VAR
Result := F_IecTasks_linkVariables(ADR(from), ADR(into));
END_FUNCTION
FUNCTION LinkTasks : F_LINK_RESULT
VAR from, into, bad : F_LINK_DESCRIPTOR; END_VAR
Described(ADR(Control.values), SIZEOF(Values), INDEXOF(Control), from);
Described(ADR(Show.values), SIZEOF(Values), INDEXOF(Show), into);
wrong[0] := F_IecTasks_linkVariables(0, ADR(into));
wrong[1] := F_IecTasks_linkVariables(ADR(from), 0);
wrong[2] := Result(bad, into);
wrong[3] := Result(from, bad);
bad := from;
bad.variableSize := 0;
wrong[4] := Result(bad, into);
bad.pouIndex := INDEXOF(Show);
wrong[5] := Result(from, bad);
bad.variableSize := 4;
wrong[6] := Result(from, bad);
bad.variableSize := SIZEOF(Values);
wrong[7] := Result(bad, into);
from.variableSize := 300;
into.variableSize := 300;
wrong[8] := Result(from, into);
from.variableSize := SIZEOF(Values);
into.variableSize := SIZEOF(Values);
LinkTasks := Result(from, into);
Described(ADR(Show.values.h), SIZEOF(DINT), INDEXOF(Show), into);
Described(ADR(Control.values.a), SIZEOF(DINT), INDEXOF(Control), from);
wrong[9] := Result(from, into);
Described(ADR(Show.answer), SIZEOF(DINT), INDEXOF(Show), from);
Described(ADR(Control.answer), SIZEOF(DINT), INDEXOF(Control), into);
LinkTasks := MAX(LinkTasks, Result(from, into));
END_FUNCTION
PROGRAM Control
VAR values : Values; answer : DINT; any : F_LINK_DESCRIPTOR; END_VAR
IF late = F_LINK_RESULT.F_LINK_UNCERTAIN THEN
    late := F_IecTasks_linkVariables(ADR(any), ADR(any));
END_IF
values.a := values.a + 1;
values.b := values.a; values.c := values.a; values.d := values.a;
values.e := values.a; values.f := values.a; values.g := values.a; values.h := values.a;
END_PROGRAM
PROGRAM Show
VAR values : Values; n, torn, changed, answer : DINT; END_VAR
n := values.a;
IF n <> values.h OR n <> values.d OR n <> values.f THEN torn := torn + 1; END_IF
answer := -n;
IF n <> values.a THEN changed := changed + 1; END_IF
END_PROGRAM
CONFIGURATION C
    TASK Fast(INTERVAL := T#2ms, PRIORITY := 1);
    TASK Slow(INTERVAL := T#7ms, PRIORITY := 2);
    PROGRAM Control WITH Fast : Control;
    PROGRAM Show WITH Slow : Show;
END_CONFIGURATION
"""
REFUSED = [
    "INVALID_SOURCE", "INVALID_DESTINATION", "INVALID_SOURCE", "INVALID_DESTINATION", "INVALID_SOURCE_LEN",
    "INVALID_DESTINATION_LEN", "SOURCE_DESTINATION_LEN_NOT_EQUAL", "ONE_TASK_CONNECTION_NOT_ALLOWED",
    "NOT_ENOUGH_RESOURCES", "IMPORT_EXIST_FOR_DESTINATION",
]  # fmt: skip


class TaskLinks:
    """The fixture `plc` is a controller that runs PROGRAM."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def test_values_go_both_ways_and_are_whole(self, plc: Controller) -> None:
        self.wait(plc, lambda: plc.read("Control.answer") < -100)
        assert plc.read("linked") == "F_LINK_OK"
        assert plc.read("Show.torn", "Show.changed") == {"Show.torn": 0, "Show.changed": 0}

    def test_what_cannot_be_linked_is_refused(self, plc: Controller) -> None:
        self.wait(plc, lambda: plc.read("late") != "F_LINK_UNCERTAIN")
        assert plc.read("wrong") == [f"F_LINK_{name}" for name in REFUSED]
        assert plc.read("late") == "F_LINK_CONNECTION_ALLOWED_ON_INIT_INTARGET_ONLY"

    def test_a_reset_makes_the_links_again(self, plc: Controller) -> None:
        self.wait(plc, lambda: plc.read("Show.n") > 0)
        plc.reset()
        plc.start()
        self.wait(plc, lambda: plc.read("Control.answer") < -5)
        assert plc.read("linked") == "F_LINK_OK"
