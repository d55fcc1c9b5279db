"""The text of CODESYS 3 objects, which do not end with END_PROGRAM and such."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.front import check_sources
from plctool.sim import Simulator


def written(folder: Path, texts: dict[str, str]) -> Path:
    """A folder with these files."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def started(folder: Path) -> Simulator:
    """Its program, ready to run."""
    built = compile_sources([folder])
    return Simulator(built.image, built.symbols)


def errors(folder: Path) -> list[str]:
    """`line:column: message` of each error."""
    found = check_sources(load_sources([folder])).diagnostics
    return [f"{d.line}:{d.column}: {d.message}" for d in found if d.severity == "error"]


COUNTER = """(* counts *)
FUNCTION_BLOCK FB_Counter IMPLEMENTS I_Counter
VAR_OUTPUT
    total : INT;
END_VAR
VAR
    method, action : INT;
END_VAR
method := method + 1;
action := method;
total := total + 1;

{attribute 'hide'}
METHOD PUBLIC Add : INT
VAR_INPUT
    by : INT;
END_VAR
total := total + by;
Add := total;

PROPERTY Doubled : INT
GET
VAR
    twice : INT;
END_VAR
twice := total * 2;
Doubled := twice;
SET
total := Doubled / 2;

ACTION Reset:
total := 0;  // from now on
"""
INTERFACE = """INTERFACE I_Counter
METHOD Add : INT
VAR_INPUT
    by : INT;
END_VAR
PROPERTY Doubled : INT
GET
SET
"""
PROGRAM = """PROGRAM PLC_PRG
VAR
    f : FB_Counter;
    sum, doubled : INT;
END_VAR
f();
sum := Plus(f.Add(4), 10);
doubled := f.Doubled;
f.Reset();
f.Doubled := 20;
"""
FUNCTION = "FUNCTION Plus : INT\nVAR_INPUT\n    a, b : INT;\nEND_VAR\nPlus := a + b;"


def test_units_without_an_end_run(tmp_path: Path) -> None:
    files = {"FB_Counter.st": COUNTER, "I_Counter.st": INTERFACE, "PLC_PRG.st": PROGRAM, "Plus.st": FUNCTION}
    with started(written(tmp_path, files)) as plc:
        plc.run_cycles(1)
        assert plc.read("PLC_PRG.sum") == 15
        assert plc.read("PLC_PRG.doubled") == 10
        assert plc.read("PLC_PRG.f.total") == 10


@pytest.mark.parametrize("name", ["FB_Pump.Start.st", "FB_Pump/Start.st"])
def test_a_member_in_a_file_of_its_own_belongs_to_the_unit_in_the_name(tmp_path: Path, name: str) -> None:
    files = {
        "FB_Pump.st": "FUNCTION_BLOCK FB_Pump\nVAR_OUTPUT\n    on : BOOL;\nEND_VAR\n",
        name: "METHOD Start : BOOL\nVAR_INPUT\n    now : BOOL;\nEND_VAR\non := now;\nStart := on;\n",
        "PLC_PRG.st": "PROGRAM PLC_PRG\nVAR\n    pump : FB_Pump;\n    b : BOOL;\nEND_VAR\nb := pump.Start(TRUE);\n",
    }
    with started(written(tmp_path, files)) as plc:
        plc.run_cycles(1)
        assert plc.read("PLC_PRG.b") is True
        assert plc.read("PLC_PRG.pump.on") is True


def test_an_error_in_a_member_is_in_its_own_file(tmp_path: Path) -> None:
    files = {
        "FB_Pump.st": "FUNCTION_BLOCK FB_Pump\nVAR_OUTPUT\n    on : BOOL;\nEND_VAR\n",
        "FB_Pump.Start.st": "METHOD Start : BOOL\n\non := nwo;\n",
        "PLC_PRG.st": "PROGRAM PLC_PRG\nVAR\n    pump : FB_Pump;\nEND_VAR\npump.Start();\n",
    }
    found = check_sources(load_sources([written(tmp_path, files)])).diagnostics
    (error,) = [d for d in found if d.severity == "error"]
    assert (Path(error.file).name, error.line, error.column) == ("FB_Pump.Start.st", 3, 7)


def test_a_member_whose_unit_is_no_unit_is_an_error(tmp_path: Path) -> None:
    files = {"Types.st": "TYPE T : INT; END_TYPE", "Types.Start.st": "METHOD Start : BOOL\nStart := TRUE;"}
    message = "the METHOD Start has no FUNCTION_BLOCK or PROGRAM before it"
    assert errors(written(tmp_path, files)) == [f"1:8: {message}"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("PROGRAM P\nVAR i : INT; END_VAR\nIF i > 1 THEN\ni := 2;\n", "END_IF missing for the IF in line 3"),
        ("PROGRAM P\nVAR i : INT; END_VAR\ni := 2\n", "expected ; after the statement"),
        ("FUNCTION F : INT\nF := 1;\nPROGRAM P\nEND_PROGRAM", "END_FUNCTION missing for the FUNCTION in line 1"),
        ("PROGRAM P\nVAR i : INT; END_VAR\ni := 2;\nFUNCTION F : INT\nF := 1;", "END_PROGRAM missing"),
        ("FUNCTION_BLOCK F\nMETHOD m : INT\nm := 1;\nEND_FUNCTION_BLOCK", "METHOD in line 2"),
    ],
)
def test_what_is_forgotten_in_a_text_of_a_person_is_still_an_error(tmp_path: Path, text: str, error: str) -> None:
    found = errors(written(tmp_path, {"f.st": text}))
    assert error in found[0]


def test_places_are_those_of_the_file(tmp_path: Path) -> None:
    text = COUNTER.replace("IMPLEMENTS I_Counter", "").replace("twice := total", "twice := totel")
    line = text.splitlines().index("twice := totel * 2;") + 1
    assert errors(written(tmp_path, {"FB_Counter.st": text}))[0].startswith(f"{line}:10: unknown name totel")


def test_files_may_be_named_without_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, {"a.st": "PROGRAM P\nEND_PROGRAM", ".b.st": "METHOD m\n"})
    monkeypatch.chdir(tmp_path)
    assert [s.path for s in load_sources(["a.st", ".b.st"])] == ["a.st", ".b.st"]


def test_an_end_in_a_comment_or_string_ends_no_unit(tmp_path: Path) -> None:
    text = (
        "PROGRAM Main\nVAR\n    n : INT;\n    s : STRING := 'END_METHOD';\nEND_VAR\n// up to END_PROGRAM\nn := n + 1;\n"
    )
    with started(written(tmp_path, {"Main.st": text})) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.n") == 3
