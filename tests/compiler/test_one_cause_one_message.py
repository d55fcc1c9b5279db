"""One mistake is one message: what follows from it is not reported, and what is suggested is of the kind that is
wanted."""

from __future__ import annotations

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.diagnostics import MAX_ERRORS, render_all


def errors(text: str) -> list[str]:
    """Line and message of each error."""
    found = check_sources([Source("f.st", text)]).diagnostics
    return [f"{d.line}: {d.message}" for d in found if d.severity == "error"]


DERIVED = """INTERFACE I_Run
METHOD Go : BOOL
END_METHOD
END_INTERFACE
FUNCTION_BLOCK Job EXTENDS Vendor.Base IMPLEMENTS I_Run
METHOD OVERRIDE Cyclic : BOOL
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Special EXTENDS Job
END_FUNCTION_BLOCK
FUNCTION Use : BOOL
VAR_INPUT r : I_Run; END_VAR
VAR_IN_OUT j : Job; END_VAR
END_FUNCTION
PROGRAM Main
VAR
    a : Job(THIS^, 3);
    b : Special := (mode := 5);
    c : ARRAY[1..2] OF Special[(1), (name := 'x')];
    i : I_Run;
END_VAR
i := b;
a(in := 3);
Use(i, b);
a.Property := b.Start();
END_PROGRAM
"""


def test_a_block_that_extends_an_unknown_one_may_have_any_member_input_and_interface() -> None:
    assert errors(DERIVED) == ["5: unknown function block Vendor.Base"]


def test_the_same_mistakes_are_errors_where_the_base_is_known() -> None:
    found = errors(f"FUNCTION_BLOCK Base\nEND_FUNCTION_BLOCK\n{DERIVED.replace('Vendor.Base', 'Base')}")
    for part in ("overrides nothing", "does not implement Go", "no FB_Init that takes this value", "no member mode"):
        assert any(part in message for message in found), (part, found)


def test_an_interface_that_extends_an_unknown_one_may_have_any_method() -> None:
    text = """INTERFACE I_Own EXTENDS I_Vendor
END_INTERFACE
FUNCTION_BLOCK Impl IMPLEMENTS I_Own
END_FUNCTION_BLOCK
FUNCTION_BLOCK Other IMPLEMENTS I_Vendor
END_FUNCTION_BLOCK
PROGRAM Main
VAR a : Impl; o : Other; i : I_Own; END_VAR
i := a;
i.Go();
i := o;
END_PROGRAM
"""
    assert errors(text) == ["1: unknown interface I_Vendor", "5: unknown interface I_Vendor"]


def test_an_unknown_name_is_shown_once_with_the_number_of_its_other_places() -> None:
    uses = "\n".join(f"n := Main.x + {i};" for i in range(9))
    source = Source("f.st", f"PROGRAM PLC_PRG\nVAR n : INT; END_VAR\n{uses}\nEND_PROGRAM\n")
    found = check_sources([source]).diagnostics
    shown = [text for text in render_all(found, [source]) if "error" in text]
    assert [text.splitlines()[0] for text in shown] == ["f.st:3:6: error: unknown name Main (and 8 more places)"]
    assert len(found) == 9, "for an editor each of the places is a finding"


def test_a_name_used_often_does_not_hide_other_errors() -> None:
    uses = "\n".join("n := Spede;" for _ in range(2 * MAX_ERRORS))
    text = f"PROGRAM Main\nVAR n, speed : INT; END_VAR\n{uses}\nn := TRUE;\nspeed := 1;\nEND_PROGRAM\n"
    found = errors(text)
    assert found[0] == "3: unknown name Spede; did you mean speed?"
    assert found[-1].startswith(f"{3 + 2 * MAX_ERRORS}: BOOL does not fit INT")
    source = Source("f.st", text)
    assert "There may be more" not in "".join(render_all(check_sources([source]).diagnostics, [source]))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("r := Scal(1.0);", "unknown function Scal; did you mean Scale?"),
        ("r := flor(1.0);", "unknown function flor; did you mean FLOOR?"),
        ("i := foo(1);", "unknown function foo"),
        ("Suply();", "unknown function Suply; did you mean Supply?"),
        ("motr(IN := TRUE);", "unknown function motr; did you mean motor?"),
        ("i := LIMTI;", "unknown name LIMTI"),
        ("i := Man.x;", "unknown name Man"),
        ("i := Suply.x;", "unknown name Suply; did you mean Supply?"),
        ("i := spede;", "unknown name spede; did you mean speed?"),
        ("i := Colour.Red;", "unknown name Colour; did you mean Color?"),
        ("i := Colour;", "unknown name Colour"),
    ],
)
def test_a_suggestion_is_of_the_kind_that_is_wanted(line: str, message: str) -> None:
    text = f"""FUNCTION Scale : REAL
VAR_INPUT x : REAL; END_VAR
END_FUNCTION
TYPE Color : (Red, Green); END_TYPE
PROGRAM Supply
VAR x : INT; END_VAR
END_PROGRAM
PROGRAM PLC_PRG
VAR i : INT; r : REAL; motor : TON; speed : INT; c : Color; END_VAR
{line}
END_PROGRAM
"""
    assert errors(text) == [f"10: {message}"]


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ("FUNCTION_BLOCK A EXTENDS Spedd", "unknown function block Spedd"),
        ("FUNCTION_BLOCK A EXTENDS Pmup", "unknown function block Pmup; did you mean Pump?"),
        ("FUNCTION_BLOCK A IMPLEMENTS Pmup", "unknown interface Pmup"),
        ("FUNCTION_BLOCK A VAR x : Spedd; END_VAR", "unknown type Spedd; did you mean Speed?"),
        ("FUNCTION_BLOCK A VAR x : Scael; END_VAR", "unknown type Scael"),
        ("FUNCTION_BLOCK A VAR x : Mani; END_VAR", "unknown type Mani"),
    ],
)
def test_a_suggested_type_is_a_type_and_a_suggested_base_a_block(declared: str, message: str) -> None:
    text = f"""TYPE Speed : INT; END_TYPE
FUNCTION_BLOCK Pump
END_FUNCTION_BLOCK
FUNCTION Scale : REAL
END_FUNCTION
PROGRAM Main
END_PROGRAM
{declared}
END_FUNCTION_BLOCK
"""
    assert errors(text) == [f"8: {message}"]
