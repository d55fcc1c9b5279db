"""Errors and warnings in diagrams name the unit, the network and the element, beside line and column."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import test_codesys2_networks as codesys2
import test_plcopen_cfc as cfc
import test_plcopen_charts as sfc
import test_plcopen_diagrams as plcopen
import twincat_archive as twincat
from plcopen_support import pou, project, variables

from plctool.cli.documents import diagnostic_document
from plctool.compiler import load_sources
from plctool.compiler.front import Diagnostic, check_sources, render

VARIABLES = variables("localVars", "a:BOOL", "n:INT", "c:BOOL", "t:TON")


def xml(body: str) -> tuple[str, str]:
    return "plc.xml", project(pou("Main", body, VARIABLES))


def found_in(folder: Path, name: str, text: str) -> tuple[list[Diagnostic], list[str]]:
    """The errors, and the same as users read them."""
    path = folder / name
    path.write_text(text, "utf-8")
    sources = load_sources([path])
    errors = [d for d in check_sources(sources).diagnostics if d.severity == "error"]
    return errors, [render(d, sources) for d in errors]


def ladder() -> tuple[str, str]:
    """The second of two rungs has a coil of another type."""
    good = (plcopen.contact(2, "a", "1"), plcopen.coil(3, "c", "2"))
    return xml(plcopen.ladder(*good, plcopen.contact(4, "a", "1"), plcopen.coil(5, "n", "4", row=40)))


def blocks() -> tuple[str, str]:
    timer = plcopen.block(2, "TON", {"IN": "1", "PT": "3"}, "Q ET", "t")
    return xml(plcopen.network(plcopen.given(1, "a"), timer, plcopen.given(3, "n"), plcopen.taken(4, "c", "2.Q")))


def results() -> tuple[str, str]:
    """The result of a function goes to an input of another type."""
    added = plcopen.block(5, "ADD", {"IN1": "3", "IN2": "3"})
    timer = plcopen.block(2, "TON", {"IN": "1", "PT": "5.OUT"}, "Q ET", "t")
    return xml(plcopen.network(plcopen.given(1, "a"), plcopen.given(3, "n"), added, timer))


def continuous() -> tuple[str, str]:
    return xml(cfc.chart(plcopen.given(7, "n"), cfc.numbered(plcopen.taken(9, "c", "7"), 0)))


def sequence() -> tuple[str, str]:
    steps = sfc.step(1, "First", "2", initial=True)
    return xml(f"<SFC>{steps}{sfc.transition(2, '1', 'n')}{sfc.jump(3, '2', 'First')}</SFC>")


def twincat_ladder() -> tuple[str, str]:
    rungs = [twincat.network(twincat.assign(twincat.given("a"), (name, 0))) for name in ("c", "n")]
    declared = "PROGRAM Main\nVAR a, c : BOOL; n : INT; END_VAR"
    return "Main.TcPOU", twincat.unit(declared, twincat.archive(*rungs, mode="Ld"))


def codesys2_ladder() -> tuple[str, str]:
    rungs = [codesys2.rung(codesys2.contact("a"), (name, "=")) for name in ("c", "n")]
    return "main.exp", codesys2.export("LD", rungs, "a, c : BOOL; n : INT;", name="Main")


@pytest.mark.parametrize(
    ("program", "element"),
    [
        (ladder, "Main: network 2, contact a (localId 4)"),
        (blocks, "Main: network 1, input n (localId 3)"),
        (results, "Main: network 1, block t (localId 2), input PT"),
        (continuous, "Main: input n (localId 7)"),
        (sequence, "Main: transition (localId 2), condition"),
        (twincat_ladder, "Main: network 2, input a"),
        (codesys2_ladder, "Main: network 2, input a"),
    ],
    ids=lambda p: getattr(p, "__name__", ""),
)
def test_an_error_names_the_element(tmp_path: Path, program: Callable[[], tuple[str, str]], element: str) -> None:
    (found,), (text,) = found_in(tmp_path, *program())
    assert found.element == element
    assert text.endswith(f"\n    in {element}")
    assert json.loads(json.dumps(diagnostic_document(found)))["element"] == element


def test_what_cannot_be_compiled_names_the_element(tmp_path: Path) -> None:
    name, text = xml(plcopen.ladder(plcopen.contact(2, "a", "1"), plcopen.coil(3, "c")))
    (found,), _ = found_in(tmp_path, name, text)
    assert found.element == "Main: network 2, coil c (localId 3)"


def test_the_condition_of_a_coil_that_sets_stands_at_the_coil(tmp_path: Path) -> None:
    """There the program stops at a breakpoint."""
    coil = plcopen.coil(3, "c", "2", more='storage="set"')
    (found,), _ = found_in(tmp_path, *xml(plcopen.ladder(plcopen.contact(2, "n", "1"), coil)))
    assert found.element == "Main: network 1, coil c (localId 3)"


def test_errors_before_and_after_a_diagram_name_none(tmp_path: Path) -> None:
    drawn = pou("Main", plcopen.ladder(plcopen.contact(2, "a", "1"), plcopen.coil(3, "a", "2")), VARIABLES)
    before = pou("Before", plcopen.st("wrong();"))
    after = pou("After", plcopen.st("wrong();"))
    found, _ = found_in(tmp_path, "plc.xml", project(before + drawn + after))
    assert [(d.message, d.element) for d in found] == [("unknown function wrong", "")] * 2
    assert all("element" not in diagnostic_document(d) for d in found)
