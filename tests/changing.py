"""Online changes on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from online_programs import built

from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.core import lib
from plctool.errors import DeviceError, UsageError
from plctool.image.file import Image, parse_image
from plctool.testing.waiting import eventually

BLOCKS = """
INTERFACE Named METHOD Number : DINT END_METHOD END_INTERFACE
FUNCTION_BLOCK Base IMPLEMENTS Named VAR base : DINT := 1; END_VAR
METHOD Number : DINT Number := base; END_METHOD END_FUNCTION_BLOCK
FUNCTION_BLOCK Derived EXTENDS Base VAR own : DINT := 40; END_VAR
METHOD Number : DINT Number := base + own; END_METHOD END_FUNCTION_BLOCK
FUNCTION_BLOCK Made VAR_OUTPUT by : DINT; END_VAR
METHOD FB_Init : BOOL VAR_INPUT bInitRetains, bInCopyCode : BOOL; by : DINT; END_VAR THIS^.by := by; END_METHOD
END_FUNCTION_BLOCK
"""
VARIABLES = """VAR n, seen : DINT; fixed : DINT := 7; text : STRING[20] := 'before'; gone : LINT := 5;
list : ARRAY[1..4] OF INT := [4, 3, 2, 1]; t : TON; d : Derived; i : Named := d; p : POINTER TO DINT := ADR(fixed);
END_VAR
VAR RETAIN kept : DINT := 9; END_VAR
"""
BODY = "n := n + 1; t(IN := TRUE, PT := T#1h); seen := i.Number();"


def program(body: str = BODY, variables: str = VARIABLES, before: str = BLOCKS) -> str:
    return (
        f"{before}PROGRAM Main\n{variables}\n{body}\nEND_PROGRAM\n"
        "CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#5ms, PRIORITY := 1); PROGRAM Main WITH T : Main;\n"
        "END_RESOURCE END_CONFIGURATION\n"
    )


class Changing:
    """The fixture `plc` is a controller that runs `program()`; `target`: what its programs are built for."""

    target: str | None = None

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def built(self, plc: Controller, folder: Path, text: str) -> BuildResult:
        result = built(folder, text, plc.symbols(), self.target)
        assert result.change is not None and result.change.problems == []
        plc.add_symbols(result.symbols)
        return result

    def change(self, plc: Controller, folder: Path, text: str) -> None:
        plc.change(self.built(plc, folder, text).image)

    def cycles(self, plc: Controller) -> int:
        (task,) = plc.tasks()
        return task.cycles

    def test_variables_keep_their_values_and_the_new_code_goes_on_with_them(
        self, plc: Controller, tmp_path: Path
    ) -> None:
        plc.write({"Main.text": "now", "Main.list[2]": 33, "Main.kept": 77, "Main.d.own": 400})
        self.wait(plc, lambda: plc.read("Main.seen") == 401)
        before = plc.read("Main.n", "Main.t.ET")
        self.change(plc, tmp_path, program(BODY.replace("n + 1", "n + 1000")))
        assert str(plc.status().state) == "run"
        names = ("Main.text", "Main.list", "Main.kept", "Main.fixed", "Main.gone")
        assert list(plc.read(*names).values()) == ["now", [4, 33, 2, 1], 77, 7, 5]
        self.wait(plc, lambda: plc.read("Main.n") >= before["Main.n"] + 2000)
        assert plc.read("Main.t.ET").timedelta >= before["Main.t.ET"].timedelta
        assert plc.read("Main.p^") == 7 and plc.read("Main.seen") == 401
        assert self.cycles(plc) > 2  # statistics go on

    def test_new_variables_have_their_initial_values_and_removed_ones_are_gone(
        self, plc: Controller, tmp_path: Path
    ) -> None:
        new = "VAR x : INT := -3; a : ARRAY[0..40] OF DINT := [41(6)]; s : STRING := 'new'; z : LREAL; END_VAR"
        new += " VAR PERSISTENT k : DINT := 12; END_VAR"
        text = program(BODY, VARIABLES.replace("gone : LINT := 5;", "") + new)
        for _ in range(2):  # the second one finds all of them
            self.change(plc, tmp_path, text)
            values = plc.read("Main.x", "Main.a", "Main.s", "Main.z", "Main.k")
            assert list(values.values()) == [-3, [6] * 41, "new", 0.0, 12]
            with pytest.raises(UsageError):
                plc.read("Main.gone")
            text = text.replace("n + 1;", "n + 2;")

    def test_new_instances_are_constructed_and_classes_stay_what_they_are(
        self, plc: Controller, tmp_path: Path
    ) -> None:
        blocks = BLOCKS + "FUNCTION_BLOCK Third EXTENDS Derived METHOD Number : DINT Number := 3; END_METHOD\n"
        variables = VARIABLES + "VAR m : Made(by := n + 0 * fixed + 5); q : POINTER TO DINT := ADR(kept); e : Third;\n"
        text = program(
            BODY + "IF fixed = 8 THEN i := e; END_IF", variables + "END_VAR", blocks + "END_FUNCTION_BLOCK\n"
        )
        self.change(plc, tmp_path, text)
        assert plc.read("Main.m.by") >= 5 and plc.read("Main.q^") == 9
        self.wait(plc, lambda: plc.read("Main.seen") == 41)
        plc.write({"Main.fixed": 8})
        self.wait(plc, lambda: plc.read("Main.seen") == 3)

    def test_change_of_another_program_is_refused(self, plc: Controller, tmp_path: Path) -> None:
        result = self.built(plc, tmp_path, program(BODY + " n := n + 1;"))
        other = built(tmp_path, program(BODY + " n := n + 2;"), None, self.target)
        plc.add_symbols(other.symbols)
        plc.flash(other.image)
        with pytest.raises(UsageError, match="build it again with that as --base"):
            plc.change(result.image)
        with pytest.raises(UsageError, match=r"build it with --base OLD\.cdl"):
            plc.change(other.image)

    def test_what_fails_to_initialise_leaves_the_program_as_it_was(self, plc: Controller, tmp_path: Path) -> None:
        bad = VARIABLES + "VAR zero : DINT; m : Made(by := n / (fixed - 7)); END_VAR"
        crc = plc.status().image_crc
        result = self.built(plc, tmp_path, program(BODY.replace("n + 1", "n - 1"), bad))
        with pytest.raises(DeviceError, match="initial values of new variables failed"):
            plc.change(result.image)
        assert (plc.status().image_crc, str(plc.status().state)) == (crc, "run")
        n = plc.read("Main.n")
        self.wait(plc, lambda: plc.read("Main.n") > n)

    def test_hostile_steps_are_refused_one_by_one(self, plc: Controller, tmp_path: Path) -> None:
        """Every bound of every number in the list."""
        variables = VARIABLES + "VAR a : ARRAY[0..40] OF DINT := [41(6)]; END_VAR VAR RETAIN r : LINT; END_VAR"
        result = self.built(plc, tmp_path, program(BODY, variables))
        image = parse_image(result.image)
        assert image.change is not None and len(image.change.steps) >= 2
        crc, refused = plc.status().image_crc, 0
        for data in mutated(result.image, image):
            plc.add_symbols(result.symbols)
            with pytest.raises(DeviceError, match="steps of the change are damaged"):
                plc.change(data, unchecked=True)
            assert plc.status().image_crc == crc
            refused += 1
        assert refused > 10
        plc.change(result.image)


def mutated(data: bytes, image: Image) -> list[bytes]:
    """Images with one number of their list of steps out of bounds."""
    assert image.change is not None
    found = []
    numbers = (("to", 0, 4, (0x7FFFFFF0, 0xFFFFFFFF)), ("size", 4, 4, (0x7FFFFFF0, 0xFFFFFFFC)),
               ("kind", 12, 1, (3, 255)), ("area", 13, 1, (5, 6, 255)))  # fmt: skip
    at = data.index(image.code) + image.change.place
    for step in image.change.steps:
        for _, offset, size, wrong in numbers:
            found += [with_bytes(data, at + offset, value.to_bytes(size, "little")) for value in wrong]
        at += 16 + len(step.data) + -len(step.data) % 4
    return found


def with_bytes(data: bytes, at: int, part: bytes) -> bytes:
    """The image with other bytes, and a CRC that is right."""
    changed = bytearray(data[:at] + part + data[at + len(part) :])
    changed[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4] = bytes(4)
    changed[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4] = zlib.crc32(changed).to_bytes(4, "little")
    return bytes(changed)
