"""Variables of a program that runs: through pointers, and together at one moment."""

from __future__ import annotations

import pytest

import plctool

POINTERS = """
TYPE Node : STRUCT value : INT; next : REF_TO Node; END_STRUCT; END_TYPE
FUNCTION_BLOCK Fill
    VAR_IN_OUT list : ARRAY[1..3] OF INT; END_VAR
    list[2] := 22;
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    a, b : Node := (value := 1);
    head, nowhere : REF_TO Node;
    choose : BOOL;
    list : ARRAY[1..3] OF INT;
    fill : Fill;
END_VAR
VAR CONSTANT
    limit : INT := 7;
END_VAR
a.next := REF(b);
b.value := 5;
IF choose THEN head := REF(b); ELSE head := REF(a); END_IF;
fill(list := list);
END_PROGRAM
"""
PAIRS = """
PROGRAM Main
VAR
    first : UDINT;
    field : ARRAY[1..40] OF UDINT;
    i : INT;
    p : REF_TO UDINT;
    last : UDINT;
END_VAR
first := first + 1;
FOR i := 1 TO 40 DO
    field[i] := first;
END_FOR;
p := REF(last);
last := first;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
        PROGRAM Main WITH Fast : Main;
    END_RESOURCE
END_CONFIGURATION
"""


@pytest.fixture
def plc(tool, plcrt, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tool.folder / "cache"))
    with plctool.connect(f"serial:{plcrt.port}") as connected:
        yield connected


def test_pointers_are_followed_on_the_device(tool, plc, eventually):
    plc.flash(tool.build("pointers", POINTERS))
    assert eventually(lambda: plc.read("Main.list[2]") == 22)
    values = plc.read("Main.head^.value", "Main.head^.next^.value", "Main.fill.list", "Main.nowhere", "Main.limit")
    assert list(values.values()) == [1, 5, [0, 22, 0], None, 7]
    plc.write({"Main.fill.list[3]": 33, "Main.head^.value": 9})
    assert plc.read("Main.list[3]", "Main.a.value") == {"Main.list[3]": 33, "Main.a.value": 9}


def test_a_pointer_to_nothing_is_an_error_that_names_it(tool, plcrt):
    tool.ok("flash", "--port", plcrt.port, str(tool.build("pointers", POINTERS)))
    for words in (["read", "Main.nowhere^.value"], ["write", "Main.nowhere^.value=1"]):
        done = tool(words[0], "--port", plcrt.port, words[1])
        assert done.status == 1
        assert done.err == "plctool: Main.nowhere^.value cannot be reached: Main.nowhere is NULL.\n"


def test_watch_follows_a_pointer_as_it_changes(tool, plc, eventually):
    plc.flash(tool.build("pointers", POINTERS))
    assert eventually(lambda: plc.read("Main.list[2]") == 22)
    seen = []
    for _, reading in plc.watch(["Main.head^.value", "Main.nowhere^.value"], interval=0.05, count=200):
        seen.append(reading.values["Main.head^.value"])
        assert reading.values["Main.nowhere^.value"] is None
        if len(seen) == 2:
            plc.write({"Main.choose": True})
        if seen[-1] == 5:
            break
    assert seen[0] == 1 and seen[-1] == 5


def test_values_read_together_are_of_one_cycle(tool, plc, eventually):
    plc.flash(tool.build("pairs", PAIRS))
    names = ["Main.first", "Main.field", "Main.p^", "Main.last"]
    assert eventually(lambda: plc.read("Main.last") > 3)
    readings = [plc.sample(names) for _ in range(60)]
    consistent = [reading.values for reading in readings if reading.consistent]
    assert consistent
    for values in consistent:
        assert {values["Main.first"], values["Main.p^"], values["Main.last"], *values["Main.field"]} == {
            values["Main.first"]
        }
