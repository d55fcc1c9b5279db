"""Calls through pointers and interfaces that may lead back to their caller: one warning for each circle."""

from __future__ import annotations

import pytest

from plctool.compiler.front import Source, check_sources

INTERFACES = (
    "INTERFACE IRun METHOD Run : DINT END_METHOD END_INTERFACE\n"
    "INTERFACE IStop METHOD Stop : DINT END_METHOD END_INTERFACE\n"
)
VARIABLES = "VAR_INPUT runner : IRun; stopper : IStop; END_VAR"


def block(name: str, method: str, statements: str) -> str:
    """A block with one method, whose statements are on its third line."""
    head = f"FUNCTION_BLOCK {name} IMPLEMENTS I{method}\n{VARIABLES} METHOD {method} : DINT"
    return f"{head}\n{statements}\nEND_METHOD END_FUNCTION_BLOCK\n"


def main(variables: str, statements: str = "") -> str:
    return f"PROGRAM Main VAR {variables} END_VAR {statements} END_PROGRAM\n"


def warned(text: str) -> list[str]:
    """`line: what may call itself` of each warning."""
    found = check_sources([Source("f.st", INTERFACES + text)]).diagnostics
    assert not [d for d in found if d.severity == "error"]
    return [f"{d.line}: {d.message.partition(':')[0]}" for d in found if d.code == "recursion"]


A = block("A", "Run", "Run := stopper.Stop() + stopper.Stop();")
B = block("B", "Stop", "Stop := runner.Run();")


def test_circle_through_two_interfaces_is_one_warning_at_its_first_call() -> None:
    assert warned(A + B + main("a : A; b : B;")) == ["5: A.Run may call itself here through B.Stop"]
    assert warned(B + A + main("a : A; b : B;")) == ["5: B.Stop may call itself here through A.Run"]


def test_circle_may_go_through_calls_that_are_certain() -> None:
    helper = "FUNCTION Help : DINT VAR_INPUT runner : IRun; END_VAR\nHelp := runner.Run();\nEND_FUNCTION\n"
    b = block("B", "Stop", "Stop := Help(runner);")
    assert warned(A + b + helper + main("a : A; b : B;")) == ["5: A.Run may call itself here through B.Stop and Help"]


def test_two_circles_are_two_warnings() -> None:
    c = block("C", "Stop", "Stop := stopper.Stop();")
    assert warned(c + main("c : C;")) == ["5: C.Stop may call itself here"]
    assert [w.partition(" ")[2] for w in warned(A + B + c + main("a : A; b : B; c : C;"))] == [
        "A.Run may call itself here through B.Stop",
        "C.Stop may call itself here",
    ]


@pytest.mark.parametrize("variables", ["a : A;", "b : B;"])
def test_class_without_an_instance_is_in_no_circle(variables: str) -> None:
    assert warned(A + B + main(variables)) == []


def test_calls_that_do_not_lead_back_are_no_circle() -> None:
    leaf = block("Leaf", "Stop", "Stop := 1;")
    assert warned(A + leaf + main("a : A; leaf : Leaf; r : DINT;", "a.stopper := leaf; r := a.Run();")) == []


NODE = "FUNCTION_BLOCK Node\nVAR_INPUT next : {kind} TO {other}; END_VAR\n{call}\nEND_FUNCTION_BLOCK\n"


@pytest.mark.parametrize(("kind", "call"), [("POINTER", "next^();\nnext^();"), ("REFERENCE", "next();\nnext();")])
def test_body_that_may_call_itself_through_a_pointer_is_one_warning(kind: str, call: str) -> None:
    text = NODE.format(kind=kind, other="Node", call=call)
    assert warned(text + main("one, other : Node;")) == ["5: Node may call itself here"]


def test_body_that_calls_another_block_through_a_pointer_is_no_circle() -> None:
    text = NODE.format(kind="POINTER", other="Other", call="next^();")
    other = "FUNCTION_BLOCK Other VAR n : DINT; END_VAR n := n + 1; END_FUNCTION_BLOCK\n"
    assert warned(text + other + main("one : Node; other : Other;")) == []


def test_body_of_a_derived_block_that_calls_one_of_its_base_may_call_itself() -> None:
    text = (
        "FUNCTION_BLOCK Base VAR n : DINT; END_VAR n := n + 1; END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK Derived EXTENDS Base VAR_IN_OUT other : Base; END_VAR\nother();\nEND_FUNCTION_BLOCK\n"
    )
    assert warned(text + main("base : Base; one : Derived;", "one(other := base);")) == [
        "5: Derived may call itself here"
    ]
