"""Commands on files, and the frame around all commands."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from plctool.cli import output
from plctool.cli.commands.device import log_text
from plctool.debug.symbols import load_symbols
from plctool.image.targets import host_target

COUNTER = """PROGRAM Main
VAR
    n : INT;
    step : INT := 1;
    pause : TIME;
    text : STRING := 'start';
    list : ARRAY[1..3] OF INT := [1, 2, 3];
END_VAR
n := n + step;
pause := pause + T#20ms;
IF n < 0 THEN
    text := 'negative';
    list[1] := n;
END_IF;
END_PROGRAM
"""
BROKEN = """PROGRAM Main
VAR
    n : INT;
END_VAR
n := nonsense + 1;
n := more;
END_PROGRAM
"""


@pytest.fixture
def counter(tool: Any, scratch: Path) -> Path:
    (scratch / "counter.st").write_text(COUNTER)
    assert tool("build", "counter.st", "-o", "counter.cdl").status == 0
    return scratch / "counter.cdl"


# ---- build, check, info ----------------------------------------------------------------------------------------------


def test_build_writes_image_and_symbols(tool: Any, scratch: Path) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    document = tool("build", "counter.st", "-o", "out.cdl", "--json").json
    data = (scratch / "out.cdl").read_bytes()
    assert document["image"] == "out.cdl"
    assert document["size"] == len(data)
    assert document["crc"] == f"{int.from_bytes(data[100:104], 'little'):08X}"
    assert document["warnings"] == []
    assert load_symbols(scratch / "out.sym").image_crc == int(document["crc"], 16)


def test_the_crc_of_a_build_has_eight_digits(tool: Any, scratch: Path) -> None:
    for n in range(300):  # one in sixteen begins with a zero
        (scratch / "counter.st").write_text(COUNTER.replace("step : INT := 1", f"step : INT := {n}"))
        crc = tool("build", "counter.st", "-o", "out.cdl", "--json").json["crc"]
        if int(crc, 16) < 0x1000_0000:
            break
    assert len(crc) == 8 and crc.startswith("0")
    assert tool("info", "out.cdl", "--json").json["crc"] == crc


def test_build_writes_app_cdl_when_nothing_else_is_said(tool: Any, scratch: Path) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    assert tool("build", "counter.st").out.startswith("app.cdl: ")
    assert (scratch / "app.cdl").exists()
    assert (scratch / "app.sym").exists()


@pytest.mark.parametrize("output", ["counter.st", "other.ST", "counter.sym"])
def test_build_overwrites_no_source_and_no_symbols(tool: Any, scratch: Path, output: str) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    done = tool("build", "counter.st", "-o", output)
    assert done.status == 2
    assert "has the name of a" in done.err
    assert [path.name for path in scratch.iterdir() if path.is_file()] == ["counter.st"]
    assert (scratch / "counter.st").read_text() == COUNTER


def test_build_takes_folders(tool: Any, scratch: Path) -> None:
    (scratch / "src").mkdir()
    (scratch / "src" / "counter.st").write_text(COUNTER)
    assert tool("build", "src", "-o", "out.cdl", "--json").status == 0


def test_build_for_another_target(tool: Any, scratch: Path) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    tool("build", "counter.st", "-o", "m3.cdl", "--target", "cortex-m3", "-O1", "--checks", "none", "--debug")
    assert tool("info", "m3.cdl", "--json").json["target"] == "cortex-m3"


def test_build_for_small_code(tool: Any, scratch: Path) -> None:
    timers = "".join(f"t{n} : TON;" for n in range(9))
    calls = "".join(f"t{n}(IN := NOT t{n}.Q, PT := T#{n + 1}ms);" for n in range(9))
    (scratch / "timers.st").write_text(f"PROGRAM Main VAR {timers} END_VAR {calls} END_PROGRAM")
    small, normal = (tool("build", "timers.st", f"-O{level}", "--json").json["size"] for level in "s2")
    assert small < normal


@pytest.mark.parametrize(
    "options",
    [("--target", "z80"), ("--checks", "spelling"), ("-O7",), ("nothing.st",), ("-o", "no/such/folder/x.cdl")],
)
def test_build_with_wrong_options_exits_2(tool: Any, scratch: Path, options: tuple[str, ...]) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    done = tool("build", "counter.st", *options, "--json")
    assert done.status == 2
    assert done.json["error"]["message"].count("\n") == 0


def test_build_of_a_wrong_program_exits_2_shows_where_and_leaves_no_image(tool: Any, scratch: Path) -> None:
    (scratch / "broken.st").write_text(BROKEN)
    done = tool("build", "broken.st")
    assert (done.status, done.out) == (2, "")
    assert done.err.startswith("broken.st:5:6: error: ")
    assert "n := nonsense + 1;\n     ^" in done.err
    assert "broken.st:6:6: error: " in done.err
    assert not (scratch / "app.cdl").exists()


def test_build_of_a_wrong_program_as_json_has_error_and_diagnostics(tool: Any, scratch: Path) -> None:
    (scratch / "broken.st").write_text(BROKEN)
    done = tool("build", "broken.st", "--json")
    assert done.status == 2
    assert done.json["error"]["code"] == "compile"
    assert [d["line"] for d in done.json["diagnostics"]] == [5, 6]


def test_check_lists_every_diagnostic(tool: Any, scratch: Path) -> None:
    (scratch / "broken.st").write_text(BROKEN)
    done = tool("check", "broken.st", "--json")
    assert done.status == 2
    first = done.json["diagnostics"][0]
    assert set(first) == {"file", "line", "column", "severity", "code", "message"}
    assert (first["file"], first["line"], first["column"], first["severity"]) == ("broken.st", 5, 6, "error")
    people = tool("check", "broken.st")
    assert people.out.startswith("broken.st:5:6: error: ")


def test_check_of_a_good_program_says_nothing(tool: Any, scratch: Path) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    assert tool("check", "counter.st", "--json").json == {"diagnostics": []}
    done = tool("check", "counter.st")
    assert (done.status, done.out, done.err) == (0, "", "")
    assert not (scratch / "app.cdl").exists()


def test_info_describes_the_image(tool: Any, counter: Path) -> None:
    document = tool("info", str(counter), "--json").json
    assert document["size"] == counter.stat().st_size
    assert [task["name"] for task in document["tasks"]]
    assert any(pou["name"] == "Main" for pou in document["pous"])
    text = tool("info", str(counter)).out
    assert document["crc"] in text
    assert "tasks:" in text


def test_info_without_symbols_has_no_pous(tool: Any, image: Path) -> None:
    image.with_suffix(".sym").unlink()
    assert "pous" not in tool("info", str(image), "--json").json


@pytest.mark.parametrize("content", [b"", b"text", bytes(104)])
def test_info_of_what_is_no_image_exits_2(tool: Any, scratch: Path, content: bytes) -> None:
    (scratch / "bad.cdl").write_bytes(content)
    assert tool("info", "bad.cdl", "--json").status == 2


# ---- symbols ---------------------------------------------------------------------------------------------------------


def test_symbols_lists_the_variables_with_their_types(tool: Any, counter: Path) -> None:
    variables = tool("symbols", str(counter), "--json").json["variables"]
    assert [v["name"] for v in variables] == ["Main.n", "Main.step", "Main.pause", "Main.text", "Main.list"]
    assert variables[4] | {"offset": 0} == {
        "name": "Main.list", "type": "ARRAY[1..3] OF INT", "area": "data", "offset": 0, "size": 6,
    }  # fmt: skip


def test_symbols_takes_patterns(tool: Any, counter: Path) -> None:
    lines = tool("symbols", str(counter), "main.?", "*t[2]").out.splitlines()
    assert [line.split()[0] for line in lines] == ["name", "Main.n", "Main.list[2]"]


@pytest.mark.parametrize(("pattern", "message"), [
    ("Nope.*", "No variable matches Nope.*"), ("Main", "Main has no value of its own"),
    ("Mian.n", "Did you mean Main.n?"),
])  # fmt: skip
def test_symbols_of_a_pattern_that_matches_nothing_are_refused(
    tool: Any, counter: Path, pattern: str, message: str
) -> None:
    done = tool("symbols", str(counter), "Main.*", pattern)
    assert done.status == 2 and message in done.err


def test_symbols_of_an_image_without_any_exits_2(tool: Any, image: Path) -> None:
    image.with_suffix(".sym").unlink()
    assert tool("symbols", str(image)).status == 2


@pytest.mark.parametrize("command", ["info", "run", "bench", "symbols"])
def test_a_folder_is_no_image_and_the_error_says_how_to_make_one(tool: Any, scratch: Path, command: str) -> None:
    (scratch / "src").mkdir()
    done = tool(command, "src")
    assert done.status == 2
    assert done.err == ("plctool: src is a folder; make an image of its sources first: plctool build src -o app.cdl.\n")


def test_an_image_for_another_target_names_both_targets(tool: Any, scratch: Path) -> None:
    (scratch / "counter.st").write_text(COUNTER)
    tool("build", "counter.st", "-o", "m3.cdl", "--target", "cortex-m3")
    done = tool("run", "m3.cdl")
    assert done.status == 1
    here = host_target()
    assert done.err.endswith(
        f"The image is for cortex-m3, this device is {here}: build it with --target {here} (ERR_ID_MISMATCH).\n"
    )


# ---- run, bench ------------------------------------------------------------------------------------------------------


def test_run_counts_cycles_of_the_first_task(tool: Any, counter: Path) -> None:
    done = tool("run", str(counter), "--cycles", "100", "--get", "Main.n", "--json")
    assert done.json["values"] == {"Main.n": 100}
    assert done.json["cycles"] == 100


def test_run_takes_virtual_time(tool: Any, counter: Path) -> None:
    document = tool("run", str(counter), "--time", "T#10s", "--get", "Main.n", "--json").json
    assert document["time_ms"] == 10_000
    assert document["values"]["Main.n"] == document["cycles"] > 100


def test_run_writes_a_line_of_a_trace_after_each_cycle(tool: Any, counter: Path, scratch: Path) -> None:
    words = ("--trace", "Main.n", "Main.pause", "Main.list", "-o", "n.csv")
    assert tool("run", str(counter), "--cycles", "3", *words, "--json").json["trace"] == "n.csv"
    assert (scratch / "n.csv").read_text().splitlines() == [
        "time_ms,Main.n,Main.pause,Main.list[1],Main.list[2],Main.list[3]",
        "0,1,T#20ms,1,2,3",
        "10,2,T#40ms,1,2,3",
        "20,3,T#60ms,1,2,3",
    ]


def test_run_traces_for_a_time_and_takes_patterns(tool: Any, counter: Path, scratch: Path) -> None:
    document = tool("run", str(counter), "--time", "T#1s", "--trace", "Main.s*", "Main.n", "--json").json
    head, *rows = (scratch / "trace.csv").read_text().splitlines()
    assert head == "time_ms,Main.step,Main.n"
    assert rows[-1] == f"990,1,{document['cycles']}"
    assert (len(rows), document["time_ms"]) == (100, 1000)


def test_a_trace_of_a_program_that_waits_has_a_line_every_ten_milliseconds(tool: Any, scratch: Path) -> None:
    text = """PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM
CONFIGURATION c RESOURCE r ON PLC TASK t(EVENT := 'door', PRIORITY := 1); PROGRAM Main WITH t : Main;
END_RESOURCE END_CONFIGURATION"""
    (scratch / "waits.st").write_text(text)
    assert tool("build", "waits.st").status == 0
    assert tool("run", "app.cdl", "--time", "T#25ms", "--trace", "Main.n").status == 0
    assert (scratch / "trace.csv").read_text().splitlines() == ["time_ms,Main.n", "10,0", "20,0", "25,0"]


def test_a_trace_ends_where_the_program_stops_with_an_exception(tool: Any, scratch: Path) -> None:
    text = "PROGRAM Main VAR n : INT; on : BOOL; END_VAR\nn := n + 1; on := 12 / (3 - n) > 0;\nEND_PROGRAM"
    (scratch / "ends.st").write_text(text)
    tool("build", "ends.st")
    done = tool("run", "app.cdl", "--cycles", "9", "--trace", "Main.*")
    assert done.status == 1 and "DIVIDEBYZERO" in done.err
    rows = (scratch / "trace.csv").read_text().splitlines()
    assert [row.partition(",")[2] for row in rows] == ["Main.n,Main.on", "1,1", "2,1", "3,1"]


def test_a_trace_replaces_neither_the_image_nor_its_symbols(tool: Any, counter: Path) -> None:
    for name in ("counter.cdl", "counter.sym"):
        done = tool("run", str(counter), "--trace", "Main.n", "-o", name)
        assert done.status == 2 and "write for example -o trace.csv" in done.err


def test_a_run_names_the_file_of_its_trace(tool: Any, counter: Path) -> None:
    assert tool("run", str(counter), "--trace", "Main.n").out == "1 cycle, 0 ms; the values are in trace.csv\n"


def test_a_file_for_a_trace_without_names_is_refused(tool: Any, counter: Path, scratch: Path) -> None:
    done = tool("run", str(counter), "-o", "n.csv")
    assert done.status == 2 and "-o is the file of --trace" in done.err
    assert not (scratch / "n.csv").exists()


def test_run_takes_patterns_of_what_to_print(tool: Any, scratch: Path) -> None:
    text = """TYPE P : STRUCT x : INT; y : REAL; END_STRUCT END_TYPE
INTERFACE I END_INTERFACE
PROGRAM Main VAR n : INT; p : P; t : TON; r : REFERENCE TO INT; i : I; a : POINTER TO INT; END_VAR
t(IN := TRUE, PT := T#1s); END_PROGRAM"""
    (scratch / "all.st").write_text(text)
    tool("build", "all.st")
    values = tool("run", "app.cdl", "--get", "Main.*", "--json").json["values"]
    assert values.items() >= {"Main.n": 0, "Main.p.x": 0, "Main.p.y": 0.0, "Main.t.IN": True, "Main.t.Q": False}.items()
    assert "Main.p" not in values and "Main.t" not in values


def test_run_sets_variables_first(tool: Any, counter: Path) -> None:
    words = ("--set", "Main.step=7", "--set", "Main.pause=T#1s", "--set", "Main.text=a b")
    gets = ("--get", "Main.n", "--get", "Main.pause", "--get", "Main.text", "--get", "Main.list")
    values = tool("run", str(counter), *words, *gets, "--json").json["values"]
    assert values == {"Main.n": 7, "Main.pause": "T#1s20ms", "Main.text": "a b", "Main.list": [1, 2, 3]}


def test_run_shows_values_to_people(tool: Any, counter: Path) -> None:
    lines = tool("run", str(counter), "--cycles", "3", "--get", "Main.n").out.splitlines()
    assert lines[0] == "Main.n = 3"
    assert lines[1].startswith("3 cycles, ")


@pytest.mark.parametrize(
    "words",
    [
        ("--get", "Main.x"),
        ("--set", "Main.n"),
        ("--set", "Main.n=x"),
        ("--cycles", "0"),
        ("--cycles", "x"),
        ("--time", "soon"),
        ("--time", "T#1s", "--cycles", "5"),
    ],
)
def test_run_of_nonsense_exits_2(tool: Any, counter: Path, words: tuple[str, ...]) -> None:
    assert tool("run", str(counter), *words, "--json").status == 2


def test_run_of_a_program_that_fails_exits_1_and_names_the_line(tool: Any, scratch: Path) -> None:
    (scratch / "zero.st").write_text("PROGRAM Main\nVAR\n  a, b : INT;\nEND_VAR\na := 1;\na := a / b;\nEND_PROGRAM\n")
    tool("build", "zero.st", "-o", "zero.cdl")
    done = tool("run", "zero.cdl", "--cycles", "5", "--json")
    assert done.status == 1
    assert done.json["error"]["code"] == "exception"
    assert "DIVIDEBYZERO" in done.json["error"]["message"]
    assert "zero.st:6" in done.json["error"]["message"]


def test_run_of_a_program_that_fails_gives_machines_what_status_gives(tool: Any, scratch: Path) -> None:
    (scratch / "zero.st").write_text("PROGRAM Main\nVAR\n  a, b : INT;\nEND_VAR\na := 1;\na := a / b;\nEND_PROGRAM\n")
    tool("build", "zero.st", "-o", "zero.cdl")
    exception = tool("run", "zero.cdl", "--json").json["exception"]
    assert (exception["name"], exception["pou"], exception["line"]) == ("DIVIDEBYZERO", "Main", 6)
    assert exception["calls"] == []


def test_run_of_what_is_no_image_says_so(tool: Any, counter: Path) -> None:
    done = tool("run", "counter.st")
    assert (done.status, done.out) == (2, "")
    assert "not a valid application image" in done.err


def test_a_structure_in_part_names_the_member_that_has_no_value(tool: Any, scratch: Path) -> None:
    (scratch / "point.st").write_text(
        "TYPE Point : STRUCT\n  x, y : INT;\nEND_STRUCT; END_TYPE\n"
        "PROGRAM Main\nVAR\n  p : Point;\nEND_VAR\np.x := p.y;\nEND_PROGRAM\n"
    )
    tool("build", "point.st", "-o", "point.cdl")
    done = tool("run", "point.cdl", "--set", "Main.p=(x := 1)")
    assert done.status == 2
    assert "The member y " in done.err


def test_a_file_that_cannot_be_written_leaves_nothing(
    tool: Any, counter: Path, scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*paths: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    before = set(scratch.iterdir())
    done = tool("build", "counter.st", "-o", "new.cdl")
    assert done.status == 2
    assert "No space left" in done.err
    assert set(scratch.iterdir()) == before


def test_what_is_written_goes_through_a_link_to_its_file(tool: Any, counter: Path, scratch: Path) -> None:
    (scratch / "old.cdl").write_bytes(b"old")
    (scratch / "link.cdl").symlink_to("old.cdl")
    assert tool("build", "counter.st", "-o", "link.cdl").status == 0
    assert (scratch / "link.cdl").is_symlink()
    assert (scratch / "old.cdl").read_bytes() == counter.read_bytes()


def test_what_is_no_file_is_written_to_and_not_replaced(tool: Any, counter: Path, scratch: Path) -> None:
    os.mkfifo(scratch / "pipe")
    reader = os.open(scratch / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    assert tool("run", str(counter), "--trace", "Main.n", "-o", "pipe").status == 0
    assert os.read(reader, 100) == b"time_ms,Main.n\n0,1\n"
    os.close(reader)
    assert (scratch / "pipe").is_fifo()


def test_a_folder_is_no_file_to_write(tool: Any, counter: Path, scratch: Path) -> None:
    done = tool("run", str(counter), "--trace", "Main.n", "-o", ".")
    assert (done.status, done.err) == (2, "plctool: . cannot be written: Is a directory.\n")


def test_run_of_a_missing_image_exits_2(tool: Any) -> None:
    assert tool("run", "nothing.cdl", "--json").status == 2


def test_bench_measures_each_task(tool: Any, counter: Path) -> None:
    (task,) = tool("bench", str(counter), "--cycles", "1000", "--json").json["tasks"]
    assert task["name"]
    assert 0 < task["ns_per_cycle"] < 1e6
    assert 0 <= task["runtime_ns"] < 1e6


# ---- demo ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("status", "document"), [(0, {"passed": True}), (1, None)])
def test_demo_as_json_is_one_document(
    tool: Any, monkeypatch: pytest.MonkeyPatch, status: int, document: dict[str, bool] | None
) -> None:
    def story() -> int:
        print("once upon a time")
        return status

    monkeypatch.setattr("plctool.cli.demo.main", story)
    done = tool("demo", "--json")
    assert done.status == status
    assert done.json == document if document else "error" in done.json


# ---- the frame -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("words", [(), ("nonsense",), ("read",), ("status", "--nonsense"), ("reset", "hot")])
def test_wrong_words_exit_2_with_one_sentence(tool: Any, words: tuple[str, ...]) -> None:
    done = tool(*words)
    assert (done.status, done.out) == (2, "")
    assert done.err.startswith("plctool: ")
    assert done.err.count("\n") == 1
    assert tool(*words, "--json").json["error"]["code"] == "usage"


def test_options_are_written_whole(tool: Any) -> None:
    done = tool("build", "none.st", "--jso")
    assert (done.status, done.out) == (2, "")
    assert "Unrecognized arguments: --jso (did you mean --json?)" in done.err


@pytest.mark.parametrize("text", ["abc", "-1", "5000000000", "1.5", "²"])
@pytest.mark.parametrize("command", ["build", "export"])
def test_a_time_of_build_that_is_none_exits_2(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch, command: str, text: str
) -> None:
    (scratch / "main.st").write_text("PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", text)
    done = tool(command, "main.st", *(("-o", "main.xml") if command == "export" else ()))
    assert done.status == 2
    assert "SOURCE_DATE_EPOCH in the environment is" in done.err


def test_diagnostics_are_the_same_documents_whatever_command_has_them(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main VAR n : INT; END_VAR n := m; END_PROGRAM")
    built, checked = (tool(command, "main.st", "--json").json for command in ("build", "check"))
    assert built["diagnostics"] == checked["diagnostics"]


@pytest.mark.parametrize("command", ["online"])
def test_commands_of_later_versions_say_so(tool: Any, command: str) -> None:
    done = tool(command, "Main.n=1", "--port", "/dev/x", "--json")
    assert done.status == 2
    assert "not in this version" in done.json["error"]["message"]


def test_help_lists_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    from plctool.cli import main as cli

    with pytest.raises(SystemExit) as caught:
        cli.main(["--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    for command in ("build", "check", "info", "flash", "scan", "status", "start", "stop", "reset", "tasks", "read",
                    "write", "watch", "log", "run", "symbols", "bench", "demo"):  # fmt: skip
        assert f"    {command} " in text


def plctool(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "plctool", *words], capture_output=True, text=True, check=False, **options
    )


def test_the_version_is_printed() -> None:
    done = plctool("--version")
    assert (done.returncode, done.stdout.split()[0]) == (0, "plctool")


def test_starting_does_not_import_what_is_slow() -> None:
    code = "import sys; from plctool.cli import main; main.main(['--version']); print([m for m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for module in ("llvmlite", "lark", "rich", "elftools", "serial", "_plccore"):
        assert f"'{module}'" not in done.stdout


def test_a_reader_that_goes_away_is_no_error(image: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "plctool", "info", str(image)]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode == 141


@pytest.mark.parametrize("command", ["info", "check", "check --json"])
def test_output_without_room_is_said_in_a_sentence(command: str, image: Path) -> None:
    file = image if command == "info" else image.with_name("wrong.st")
    if not file.exists():
        file.write_text("PROGRAM Main x := 1; END_PROGRAM")
    words = [sys.executable, "-m", "plctool", *command.split(), str(file)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.stderr == "plctool: The output cannot be written: No space left on device.\n"
    assert done.returncode == 2


@pytest.mark.parametrize(("closed", "word", "status"), [(">&-", "app", 0), ("2>&-", "app", 0), ("2>&-", "no", 2)])
def test_output_may_be_closed(closed: str, word: str, status: int, tmp_path: Path) -> None:
    (tmp_path / "app.st").write_text("PROGRAM Main VAR x : INT; END_VAR x := 1; END_PROGRAM")
    words = ["sh", "-c", f"exec {sys.executable} -m plctool build {word}.st {closed}"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert "Traceback" not in done.stderr and "cannot" not in done.stdout


def test_tables_align_numbers_right() -> None:
    rows = [{"name": "a", "n": 5}, {"name": "long", "n": 1234}]
    assert output.table(rows, ["name", "n"]) == "name     n\na        5\nlong  1234"


def test_characters_that_the_output_cannot_hold_are_escaped(tool: Any, scratch: Path) -> None:
    (scratch / "names.st").write_text("PROGRAM Main\nVAR\n  größe : INT;\nEND_VAR\ngröße := 1;\nEND_PROGRAM\n")
    tool("build", "names.st", "-o", "names.cdl")
    done = subprocess.run(
        [sys.executable, "-m", "plctool", "symbols", "names.cdl"], env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert r"Main.gr\xf6\xdfe  INT" in done.stdout


def test_calls_stand_below_the_text_of_their_log_entry() -> None:
    call = {"pou": "Main", "file": "main.st", "line": 8}
    entry = {"time_s": 1.5, "class": "exception", "component": "C", "text": "oops", "calls": [call]}
    first, second = log_text({"entries": [entry]}).splitlines()
    assert second.index("called from Main, main.st:8") == first.index("C: oops")
