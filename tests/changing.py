"""Online changes on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

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

    def test_tasks_may_be_new_changed_and_removed(self, plc: Controller, tmp_path: Path) -> None:
        plc.write({"Main.fixed": 70})
        second = "PROGRAM Second VAR k : DINT; END_VAR k := k + 1; END_PROGRAM\n"
        task = "TASK New(INTERVAL := T#10ms, PRIORITY := 3); PROGRAM Second WITH New : Second;\n"
        text = program(before=BLOCKS + second).replace("T#5ms", "T#8ms").replace("END_RESOURCE", task + "END_RESOURCE")
        for _ in range(2):
            self.change(plc, tmp_path, text)
            assert [(task.name, task.interval_us) for task in plc.tasks()] == [("T", 8000), ("New", 10000)]
            n = plc.read("Main.n")
            self.wait(plc, lambda n=n: plc.read("Second.k") > 5 and plc.read("Main.n") > n)  # type: ignore[misc]
            self.change(plc, tmp_path, program())
            assert [(task.name, task.interval_us) for task in plc.tasks()] == [("T", 5000)]
            n = plc.read("Main.n")
            self.wait(plc, lambda n=n: plc.read("Main.n") > n + 5)  # type: ignore[misc]
            assert plc.read("Main.fixed") == 70 and str(plc.status().state) == "run"

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

    def test_what_grew_moves_with_its_values_and_pointers_follow(self, plc: Controller, tmp_path: Path) -> None:
        plc.write({"Main.d.own": 400, "Main.d.base": 5, "Main.fixed": -7, "Main.kept": -77, "Main.text": "now"})
        plc.write({"Main.list[1]": 10, "Main.list[4]": 40})
        self.wait(plc, lambda: plc.read("Main.seen") == 405)
        self.change(plc, tmp_path, grown(BODY))
        assert str(plc.status().state) == "run"
        names = ("Main.d.own", "Main.d.base", "Main.d.more", "Main.fixed", "Main.kept", "Main.text", "Main.list")
        expected = [400, 5, 2.5, -7, -77, "now", [1, 10, 3, 2, 40, 1, 1]]
        assert list(plc.read(*names).values()) == expected
        assert plc.read("Main.p^") == -7
        n = plc.read("Main.n")
        plc.write({"Main.d.own": 500, "Main.fixed": 8})
        self.wait(plc, lambda: plc.read("Main.seen") == 505 and plc.read("Main.p^") == 8 and plc.read("Main.n") > n)
        self.change(plc, tmp_path, grown(BODY).replace("more : LREAL := 2.5; ", ""))
        assert plc.read("Main.d.own", "Main.d.base") == {"Main.d.own": 500, "Main.d.base": 5}
        self.wait(plc, lambda: plc.read("Main.seen") == 505)

    def test_pointer_to_what_is_removed_is_named_and_nothing_moves(self, plc: Controller, tmp_path: Path) -> None:
        self.change(plc, tmp_path, program(BODY, VARIABLES + "VAR q : POINTER TO DINT := ADR(n); END_VAR"))
        crc = plc.status().image_crc
        bad = grown(BODY, VARIABLES.replace("fixed : DINT := 7;", "").replace(" := ADR(fixed)", ""))
        result = self.built(plc, tmp_path, bad)
        with pytest.raises(DeviceError, match=r"Main\.p leads to Main\.fixed, which is removed"):
            plc.change(result.image)
        assert (plc.status().image_crc, str(plc.status().state)) == (crc, "run")
        assert plc.read("Main.p^") == 7
        self.wait(plc, lambda: plc.read("Main.seen") == 41)

    def test_hostile_steps_are_refused_one_by_one(self, plc: Controller, tmp_path: Path) -> None:
        """Every bound of every number in the list, of steps of all kinds."""
        text = grown(
            BODY, VARIABLES.replace("gone : LINT := 5;", ""), "VAR a : ARRAY[0..40] OF DINT := [41(6)]; END_VAR"
        )
        result = self.built(plc, tmp_path, text)
        image = parse_image(result.image)
        assert image.change is not None
        kinds = {step.kind for step in image.change.steps}
        wanted = "MOVE", "GONE", "LEAD", "CLEAR", "PUT", "SIGN"
        assert kinds >= {getattr(lib, f"CDL_CHANGE_{kind}") for kind in wanted}
        crc, refused = plc.status().image_crc, 0
        for data in mutated(result.image, image):
            plc.add_symbols(result.symbols)
            with pytest.raises(DeviceError, match="steps of the change are damaged"):
                plc.change(data, unchecked=True)
            assert plc.status().image_crc == crc
            refused += 1
        assert refused > 40
        plc.change(result.image)


def grown(body: str, variables: str = VARIABLES, more: str = "") -> str:
    """The program with more in a block, an array, a text and numbers."""
    variables = variables.replace("fixed : DINT", "fixed : LINT").replace("kept : DINT", "kept : LINT")
    variables = variables.replace("STRING[20]", "STRING[60]").replace("p : POINTER TO DINT := ADR(fixed)", POINTER)
    variables = variables.replace("ARRAY[1..4] OF INT := [4, 3, 2, 1]", "ARRAY[0..6] OF INT := [7(1)]")
    return program(body, variables + more, BLOCKS.replace("VAR base", "VAR more : LREAL := 2.5; base"))


POINTER = "p : POINTER TO DINT"  # as it is in VARIABLES, which leads to a number that has become wider


class Fault(NamedTuple):
    """Values of a number in a step that cannot be right: where it is, its size, and those."""

    offset: int
    size: int
    values: tuple[int, ...]


def mutated(data: bytes, image: Image) -> list[bytes]:
    """Images with one number of their list of steps out of bounds: of one step of each kind, and its neighbours."""
    assert image.change is not None
    huge = (0x7FFFFFF0, 0xFFFFFFFC)
    to, source = Fault(0, 4, huge), Fault(8, 4, huge)
    area, source_area = Fault(13, 1, (5, 6, 255)), Fault(14, 1, (5, 6, 255))
    every = [Fault(4, 4, huge), Fault(12, 1, (9, 255))]
    old = {lib.CDL_CHANGE_GONE: [], lib.CDL_CHANGE_LEAD: [Fault(0, 4, (0, 7)), Fault(13, 1, (1, 0x81))]}
    both = (lib.CDL_CHANGE_MOVE, lib.CDL_CHANGE_FOLLOW, lib.CDL_CHANGE_COPY)
    found, seen = [], set()
    at = data.index(image.code) + image.change.place
    for step in image.change.steps:
        if step.kind in old:
            faults = [source, source_area, *old[step.kind]]
        else:
            faults = [to, area] + [source, source_area] * (step.kind in both)
        for fault in [*every, *faults] if step.kind not in seen else ():
            found += [with_bytes(data, at + fault.offset, v.to_bytes(fault.size, "little")) for v in fault.values]
        seen.add(step.kind)
        at += 16 + len(step.data) + -len(step.data) % 4
    first, second = image.change.steps[:2]
    assert second.kind <= lib.CDL_CHANGE_GONE and first.source_area == second.source_area
    at = data.index(image.code) + image.change.place
    found.append(with_bytes(data, at + 8, second.source.to_bytes(4, "little")))  # both about the same bytes
    return found


def with_bytes(data: bytes, at: int, part: bytes) -> bytes:
    """The image with other bytes, and a CRC that is right."""
    changed = bytearray(data[:at] + part + data[at + len(part) :])
    changed[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4] = bytes(4)
    changed[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4] = zlib.crc32(changed).to_bytes(4, "little")
    return bytes(changed)
