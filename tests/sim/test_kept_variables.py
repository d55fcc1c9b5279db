"""Each cell of the table in docs/language.md of what is kept: every kind of declaration through every event."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from kept_table import CHANGED, INITIAL, KEPT, LOST, QUALIFIERS, program, table

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.core import lib
from plctool.link.services import AppState
from plctool.sim import Simulator


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    built: dict[str, BuildResult] = {}

    def compile_text(text: str) -> BuildResult:
        if text not in built:
            path: Path = folder / f"p{len(built)}.st"
            path.write_text(text)
            built[text] = compile_sources([path])
        return built[text]

    return compile_text


def bring_about(plc: Simulator, event: str, qualifier: str, build) -> None:
    if event == "stop, start":
        plc.stop()
        plc.start()
    elif event == "exception, reset warm":
        plc.write({"Main.trip": True})
        plc.run_cycles(2, check=False)
        assert plc.status().state is AppState.EXCEPTION
        plc.reset("warm")
    elif event == "power off and on":
        plc.run_for(2500)
        assert lib.SimStart() == lib.ERR_OK  # without a warning
    elif event == "download":
        download(plc, build(program(qualifier, changed=True)))
    elif event == "download, rolled back":
        bad = program(qualifier, changed=True).replace("Seven := 7", "Seven := Seven / Seven")
        bad = bad.replace("zero : DINT", "zero : DINT := Seven()")
        crc = plc.status().image_crc
        download(plc, build(bad))
        assert plc.status().state is AppState.EXCEPTION
        assert lib.SimStart() == lib.ERR_OK
        assert plc.status().image_crc == crc
    elif event == "reset origin":
        image = build(program(qualifier))
        plc.reset("origin")
        download(plc, image)
    else:
        option = {"reset warm": "warm", "reset cold": "cold"}[event]
        plc.reset(option)


def download(plc: Simulator, built: BuildResult) -> None:
    plc.flash(built.image, start=False)
    plc.add_symbols(built.symbols)


@contextmanager
def changed_everything(build, qualifier: str) -> Iterator[Simulator]:
    """A program that runs, with another value in every variable."""
    built = build(program(qualifier))
    with Simulator(built.image, built.symbols) as plc:
        assert plc.read_all(KEPT + LOST) == dict.fromkeys(KEPT + LOST, INITIAL)
        for name in KEPT + LOST:
            plc.write({name: CHANGED})
        yield plc


CASES = [
    pytest.param(event, qualifier, cell, id=f"{event}: {qualifier or 'VAR'}")
    for event, kind, cell in table()
    for qualifier in QUALIFIERS[kind]
]


@pytest.mark.parametrize(("event", "qualifier", "cell"), CASES)
def test_what_is_kept(event: str, qualifier: str, cell: str, build) -> None:
    with changed_everything(build, qualifier) as plc:
        bring_about(plc, event, qualifier, build)
        expected = {"kept": CHANGED, "initial": INITIAL}[cell]
        lost = CHANGED if event == "stop, start" else INITIAL
        assert plc.read_all(KEPT) == dict.fromkeys(KEPT, expected)
        assert plc.read_all(LOST) == dict.fromkeys(LOST, lost)
        if event.endswith("download"):
            added = ["Main.added_too", "Main.p.added", "Main.points[1].added", "Main.whole.added", "Second.added"]
            assert list(plc.read_all(added).values()) == [2.5, 1.5, 1.5, 1.5, 1.5]


def test_the_table_has_all_that_can_happen() -> None:
    assert len({event for event, _, _ in table()}) == 8
    assert {kind for _, kind, _ in table()} == set(QUALIFIERS)
    assert {cell for _, _, cell in table()} == {"kept", "initial"}


@pytest.mark.parametrize("qualifier", ["", "RETAIN", "PERSISTENT"])
def test_a_value_that_was_kept_once_is_kept_again(qualifier: str, build) -> None:
    """Over a download, a power cut, and the download back."""
    with changed_everything(build, qualifier) as plc:
        for changed in (True, False, True):
            download(plc, build(program(qualifier, changed=changed)))
            for _ in range(2):
                plc.start()
                plc.run_for(5000)
                assert lib.SimStart() == lib.ERR_OK
        expected = CHANGED if qualifier == "PERSISTENT" else INITIAL
        assert plc.read_all(KEPT) == dict.fromkeys(KEPT, expected)


METHODS = """
FUNCTION_BLOCK Counter
METHOD Count : DINT
VAR_INST RETAIN total : DINT := 7; END_VAR
VAR_INST lost : DINT := 7; END_VAR
total := total + 1;
lost := lost + 1;
Count := 1000 * total + lost;
END_METHOD
END_FUNCTION_BLOCK
PROGRAM Main
VAR counter : Counter; seen : DINT; END_VAR
seen := counter.Count();
END_PROGRAM
"""


def test_variables_of_methods_that_last_are_kept_with_their_instance(build) -> None:
    built = build(METHODS)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(3)
        plc.reset("warm")
        plc.start()
        plc.run_cycles(1)
        assert plc.read("Main.seen") == 11008


CLASSES = """
FUNCTION_BLOCK Base
VAR_INPUT total : DINT; END_VAR
METHOD Step : DINT
Step := 1;
END_METHOD
END_FUNCTION_BLOCK
{other}
FUNCTION_BLOCK Derived EXTENDS Base
METHOD Step : DINT
Step := 10;
END_METHOD
END_FUNCTION_BLOCK
PROGRAM Main
VAR PERSISTENT base : Base; derived : Derived; {instance} END_VAR
VAR which : BOOL; p : POINTER TO Base; END_VAR
which := NOT which;
p := ADR(base);
IF which THEN p := ADR(derived); END_IF
p^.total := p^.total + p^.Step();
END_PROGRAM
"""


def test_kept_instances_are_of_their_class_in_a_program_that_numbers_it_again(build) -> None:
    other = "FUNCTION_BLOCK Aaa EXTENDS Base METHOD Step : DINT Step := 100; END_METHOD END_FUNCTION_BLOCK"
    built = build(CLASSES.format(other="", instance=""))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(4)
        download(plc, build(CLASSES.format(other=other, instance="aaa : Aaa;")))
        plc.start()
        plc.run_cycles(4)
        assert plc.read_all(["Main.base.total", "Main.derived.total"]) == {
            "Main.base.total": 4,
            "Main.derived.total": 40,
        }
