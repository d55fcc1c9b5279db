"""`plctool dap`: what an editor gets for its requests."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))
sys.path.append(str(Path(__file__).parent))

from breakpoints import FILE, PROGRAM, build
from dap_client import Editor, InProcess, Refused

from plctool import connect
from plctool.dump_file import save, take_dump
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

FOREIGN = Path(__file__).parents[2] / "editors/vscode/node_modules/@vscode/debugadapter-testsupport"
DAP = [sys.executable, "-m", "plctool", "dap"]


@pytest.fixture
def source(tmp_path: Path) -> str:
    (tmp_path / FILE).write_text(PROGRAM)
    return str(tmp_path / FILE)


@pytest.fixture
def editor() -> Iterator[Editor]:
    with InProcess() as editor:
        yield editor


@pytest.fixture(params=["simulator", "plcrt"])
def on(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_a_launched_program_halts_shows_its_variables_and_steps(editor: Editor, source: str, on: str) -> None:
    (found,) = editor.begin("launch", {source: [{"line": 15}]}, program=source, on=on)
    assert (found["verified"], found["line"]) == (True, 15)
    assert editor.stopped() == [("Counter", 15), ("Main", 25)]
    assert editor.request("threads")["threads"] == [{"id": 1, "name": "Fast"}, {"id": 2, "name": "Slow"}]
    assert editor.scope("Locals")["twice"] == "2"
    assert editor.scope("Counter")["step"] == "1"
    assert editor.scope("Main", 2)["k"] == "1"
    assert "Main.cycles" in editor.scope("Globals")
    editor.request("setBreakpoints", source={"path": source}, breakpoints=[])
    editor.request("stepIn", threadId=1)
    assert editor.stopped()[0] == ("Add", 4)
    editor.request("next", threadId=1)
    assert editor.stopped()[0] == ("Add", 5)
    editor.request("stepOut", threadId=1)
    assert editor.stopped()[0] == ("Counter", 15)
    editor.request("continue", threadId=1)
    editor.request("pause", threadId=1)
    assert editor.event("stopped")["reason"] == "pause"
    editor.request("disconnect")


def test_parts_of_variables_are_shown_and_set(editor: Editor, source: str, on: str) -> None:
    editor.begin("launch", {source: [{"line": 7}]}, program=source, on=on)
    editor.stopped()
    scopes = editor.request("scopes", frameId=1)["scopes"]
    reference = scopes[0]["variablesReference"]
    variables = editor.request("variables", variablesReference=reference)["variables"]
    inner = next(v["variablesReference"] for v in variables if v["name"] == "list")
    assert [v["name"] for v in editor.request("variables", variablesReference=inner)["variables"]][2] == "[2]"
    assert editor.request("setVariable", variablesReference=inner, name="[1]", value="77")["value"] == "77"
    assert editor.request("setVariable", variablesReference=reference, name="sum", value="5")["value"] == "5"
    assert editor.request("evaluate", expression="list[1] + sum * 2", frameId=1)["result"] == "87"
    assert editor.request("evaluate", expression="list[1] > 76 AND NOT Main.on", frameId=1)["result"] in (
        "TRUE",
        "FALSE",
    )
    written = editor.request("evaluate", expression="Main.word := 16#FF", frameId=1, context="repl")
    assert written["result"] == "16#00FF"
    with pytest.raises(Refused):
        editor.request("setVariable", variablesReference=reference, name="sum", value="many")
    with pytest.raises(Refused, match="no variable"):
        editor.request("evaluate", expression="nobody", frameId=1)


def test_conditions_hits_and_logs(editor: Editor, source: str, on: str) -> None:
    lines = [
        {"line": 15, "logMessage": "step {step}"},
        {"line": 27, "condition": "Main.cycles >= 5"},
        {"line": 30, "hitCondition": ">= 3"},
        {"line": 1000},
        {"line": 23, "condition": "1 +"},
    ]
    found = editor.begin("launch", {source: lines}, program=source, on=on)
    assert [b["verified"] for b in found] == [True, True, True, False, False]
    assert "no code at line 1000" in found[3]["message"]
    assert editor.stopped()[0] == ("Main", 30)
    assert editor.event("output")["output"] == "step 1\n"
    editor.request("continue", threadId=1)
    editor.stopped()


def test_an_exception_halts_and_is_explained(editor: Editor, source: str, on: str) -> None:
    editor.begin("launch", {source: [{"line": 23}]}, program=source, on=on)
    editor.stopped()
    editor.request("evaluate", expression="Main.divisor := 0", context="repl")
    editor.request("setBreakpoints", source={"path": source}, breakpoints=[])
    editor.request("continue", threadId=1)
    stopped = editor.event("stopped")
    assert (stopped["reason"], stopped["text"]) == ("exception", "DIVIDEBYZERO")
    info = editor.request("exceptionInfo", threadId=1)
    assert info["exceptionId"] == "DIVIDEBYZERO"
    assert "halting.st:31" in info["description"]
    editor.request("continue", threadId=1)
    editor.event("terminated")


def test_a_program_halts_at_its_first_line(editor: Editor, source: str) -> None:
    editor.begin("launch", {}, program=source, stopOnEntry=True)
    assert editor.event("stopped")["reason"] == "entry"


def test_force_and_a_cycle_are_requests_of_our_own(editor: Editor, source: str) -> None:
    editor.begin("launch", {source: [{"line": 23}]}, program=source)
    editor.stopped()
    assert editor.request("force", values={"Main.word": 5}) == {"forced": ["Main.word"]}
    editor.request("setBreakpoints", source={"path": source}, breakpoints=[])
    before = int(editor.request("evaluate", expression="Main.cycles")["result"])
    editor.request("stepCycle")
    assert editor.stopped()[0] == ("Main", 23)
    assert editor.request("evaluate", expression="Main.cycles")["result"] == str(before + 1)
    assert editor.request("unforce") == {"forced": []}
    editor.request("runTo", source={"path": source}, line=30)
    assert editor.stopped()[0] == ("Main", 30)


def test_a_restart_begins_again_with_its_breakpoints(editor: Editor, source: str, on: str) -> None:
    editor.begin("launch", {source: [{"line": 27, "condition": "Main.cycles = 3"}]}, program=source, on=on)
    editor.stopped()
    editor.request("restart")
    editor.stopped()
    assert editor.request("evaluate", expression="Main.cycles")["result"] == "3"


def test_an_editor_attaches_to_a_controller_and_leaves_it_running(editor: Editor, tmp_path: Path) -> None:
    with Plcrt(tmp_path / "flash", "--tcp", "0") as plcrt, connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(build(tmp_path))
        editor.begin("attach", {FILE: [{"line": 15}]}, link=f"tcp:{plcrt.tcp}")
        assert editor.stopped()[0] == ("Counter", 15)
        editor.request("disconnect")
        eventually(lambda: plc.status().state == "run")
        before = plc.read("Main.cycles")
        eventually(lambda: plc.read("Main.cycles") > before + 5)


def test_an_editor_that_vanishes_leaves_the_controller_running(tmp_path: Path) -> None:
    with Plcrt(tmp_path / "flash", "--tcp", "0") as plcrt, connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(build(tmp_path))
        with InProcess() as editor:
            editor.begin("attach", {FILE: [{"line": 15}]}, link=f"tcp:{plcrt.tcp}")
            editor.stopped()
        eventually(lambda: plc.status().state == "run")


@pytest.mark.parametrize(
    ("command", "arguments", "words"),
    [
        ("launch", {}, 'names its program, such as "program"'),
        ("launch", {"program": "a.st", "on": "moon"}, "simulator or plcrt"),
        ("launch", {"program": "/nothing/there.st"}, "there"),
        ("attach", {}, "names a controller"),
        ("attach", {"link": "moon:1"}, "moon"),
        ("scopes", {"frameId": 1}, "Nothing is debugged yet"),
        ("continue", {"threadId": 1}, "Nothing is debugged yet"),
        ("fly", {}, "no request fly"),
    ],
)
def test_bad_requests_are_refused_with_what_to_do(
    editor: Editor, command: str, arguments: dict[str, str], words: str
) -> None:
    with pytest.raises(Refused, match=words):
        editor.request(command, **arguments)
    assert editor.request("initialize")["supportsLogPoints"]


def test_errors_of_the_program_are_shown(editor: Editor, tmp_path: Path) -> None:
    (tmp_path / "bad.st").write_text("PROGRAM Main\nx := 1;\nEND_PROGRAM\n")
    with pytest.raises(Refused, match="The program has errors: "):
        editor.request("launch", program=str(tmp_path / "bad.st"))
    assert "bad.st:2" in editor.event("output")["output"]


def test_a_running_program_shows_its_variables_only(editor: Editor, source: str) -> None:
    editor.begin("launch", {}, program=source)
    assert editor.request("evaluate", expression="Main.divisor")["result"] == "1"
    with pytest.raises(Refused, match="The program runs; pause it first"):
        editor.request("stackTrace", threadId=1)
    with pytest.raises(Refused, match="runs"):
        editor.request("next", threadId=1)


BAD_MESSAGES = [
    b"Content-Length: x\r\n\r\n",
    b"\r\n\r\n",
    b"Content-Length: 3\r\n\r\n{{{",
    b"Content-Length: 2\r\n\r\n[]",
    b"Content-Length: 999999999\r\n\r\n",
]


@pytest.mark.parametrize("data", BAD_MESSAGES)
def test_what_is_no_message_ends_the_adapter(data: bytes) -> None:
    done = subprocess.run(DAP, input=data, capture_output=True, timeout=120, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


def test_the_command_serves_an_editor_at_its_standard_streams(source: str) -> None:
    with subprocess.Popen(DAP, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin and process.stdout
        pipe = process.stdin

        def write(data: bytes) -> None:
            pipe.write(data)
            pipe.flush()

        editor = Editor(write, process.stdout)
        editor.begin("launch", {source: [{"line": 15}]}, program=source)
        assert editor.stopped()[0] == ("Counter", 15)
        editor.request("disconnect")
        process.wait(60)
        assert process.returncode == 0
        pipe.close()


def test_the_command_listens_at_a_port_of_this_machine(source: str) -> None:
    with subprocess.Popen([*DAP, "--listen", "0"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        port = int(process.stdout.readline().split()[-1])
        with socket.create_connection(("127.0.0.1", port), 60) as line:
            editor = Editor(line.sendall, line.makefile("rb"))
            editor.begin("launch", {source: [{"line": 15}]}, program=source)
            assert editor.stopped()[0] == ("Counter", 15)
            editor.request("disconnect")
        process.terminate()
        process.wait(60)


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node: ./bootstrap.sh --node")
@pytest.mark.skipif(not FOREIGN.exists(), reason="needs packages of npm: npm ci --prefix editors/vscode")
def test_a_client_of_others_debugs_a_program(source: str) -> None:
    with subprocess.Popen([*DAP, "--listen", "0"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        port = process.stdout.readline().split()[-1]
        command = ["node", str(Path(__file__).with_name("foreign_client.js")), str(FOREIGN), port, source, "15"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        process.terminate()
        process.wait(60)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert seen["calls"][:2] == [["Counter", 15], ["Main", 25]]
    assert (seen["seen"]["Locals"]["twice"], seen["seen"]["Counter"]["step"], seen["value"]) == ("2", "1", "10")
    assert seen["inside"] == ["Add", 4]


def test_messages_are_numbered_json() -> None:
    request = json.dumps({"seq": 1, "type": "request", "command": "initialize"}).encode()
    data = f"Content-Length: {len(request)}\r\n\r\n".encode() + request
    done = subprocess.run(DAP, input=data, capture_output=True, timeout=120, check=True)
    head, _, body = done.stdout.partition(b"\r\n\r\n")
    message = json.loads(body)
    assert head == f"Content-Length: {len(body)}".encode()
    assert (message["seq"], message["request_seq"], message["success"]) == (1, 1, True)


# ---- data breakpoints ----


def test_a_change_of_a_variable_halts(editor: Editor, source: str, on: str) -> None:
    editor.begin("launch", {source: [{"line": 15}]}, program=source, on=on)
    editor.stopped()
    scopes = editor.request("scopes", frameId=1)["scopes"]
    counter = next(s["variablesReference"] for s in scopes if s["name"] == "Counter")
    info = editor.request("dataBreakpointInfo", variablesReference=counter, name="n")
    assert (info["dataId"], info["accessTypes"]) == ("Main.counter.n", ["write"])
    on_stack = editor.request("dataBreakpointInfo", variablesReference=scopes[0]["variablesReference"], name="twice")
    assert on_stack["dataId"] is None
    assert "a variable of a call" in on_stack["description"]
    editor.request("setBreakpoints", source={"path": source}, breakpoints=[])
    wanted = [{"dataId": "Main.counter.n"}, {"dataId": "Main.nothing"}, {"dataId": "Main.k", "accessType": "read"}]
    found = editor.request("setDataBreakpoints", breakpoints=wanted)["breakpoints"]
    assert [b["verified"] for b in found] == [True, False, False]
    assert found[0]["message"] == "Main.counter.n is compared before each statement."
    editor.request("continue", threadId=1)
    stopped = editor.event("stopped")
    assert (stopped["reason"], stopped["hitBreakpointIds"]) == ("data breakpoint", [found[0]["id"]])
    assert stopped["text"] == "Main.counter.n: 0 -> 1"
    assert editor.request("stackTrace", threadId=1)["stackFrames"][0]["line"] == 16


# ---- dumps ----


def test_a_dump_shows_the_calls_and_variables_of_the_past(editor: Editor, tmp_path: Path) -> None:
    with Plcrt(tmp_path / "flash", "--tcp", "0") as plcrt, connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(build(tmp_path))
        plc.write({"Main.divisor": 0})
        eventually(lambda: plc.status().exception)
        (tmp_path / "x.dump").write_bytes(save(take_dump(plc)))
    (found,) = editor.begin("attach", {FILE: [{"line": 15}]}, dump=str(tmp_path / "x.dump"))
    assert (found["verified"], "does not run" in found["message"]) == (False, True)
    assert editor.stopped() == [("Main", 31)]
    assert editor.request("exceptionInfo", threadId=1)["exceptionId"] == "DIVIDEBYZERO"
    assert editor.scope("Main")["divisor"] == "0"
    assert editor.request("evaluate", expression="Main.divisor + 7", frameId=1)["result"] == "7"
    for command in ("continue", "next", "stepCycle", "restart"):
        with pytest.raises(Refused, match="does not run"):
            editor.request(command, threadId=1)
    with pytest.raises(Refused, match="cannot be changed"):
        editor.request("evaluate", expression="Main.divisor := 1", frameId=1, context="repl")
    assert editor.request("stackTrace", threadId=1)["totalFrames"] == 1


def test_a_file_that_is_no_dump_is_refused(editor: Editor, source: str) -> None:
    with pytest.raises(Refused, match="is not a dump"):
        editor.request("attach", dump=source)


# ---- tests ----

TESTED = """\
FUNCTION_BLOCK Pump
VAR_INPUT on : BOOL; END_VAR
VAR_OUTPUT speed : INT; END_VAR
VAR delay : TON; END_VAR
delay(IN := on, PT := T#1s);
IF delay.Q THEN
    speed := speed + 1;         // 7
END_IF
END_FUNCTION_BLOCK
PROGRAM Main VAR pump : Pump; END_VAR
pump(on := TRUE);
END_PROGRAM
TEST 'a pump waits for a second'
VAR p : Pump; n : INT; END_VAR
p(on := TRUE);                  // 15
ADVANCE_TIME(T#2s);
p(on := TRUE);
n := p.speed;
ASSERT_EQ(n, 1);                // 19
END_TEST
TEST 'a pump stands still'
VAR p : Pump; END_VAR
p(on := FALSE);                 // 23
ASSERT_EQ(p.speed, 1);
END_TEST
"""


@pytest.fixture
def tested(tmp_path: Path) -> str:
    (tmp_path / "pump.st").write_text(TESTED)
    return str(tmp_path / "pump.st")


def begin_tests(editor: Editor, breakpoints: dict[str, list[int]], **arguments: object) -> None:
    lines = {path: [{"line": line} for line in found] for path, found in breakpoints.items()}
    found = editor.begin("launch", lines, **arguments)
    assert not any(b["verified"] for b in found)
    assert all("when a test runs" in b["message"] for b in found)


def ended(editor: Editor) -> tuple[int, str]:
    """The exit status of the tests, and what they wrote."""
    status = editor.event("exited")["exitCode"]
    editor.event("terminated")
    return status, "".join(e["body"]["output"] for e in editor.events if e["event"] == "output")


def test_a_test_block_halts_steps_and_goes_on_to_its_result(editor: Editor, tested: str) -> None:
    begin_tests(editor, {tested: [7, 19, 23]}, program=tested, tests=True)
    assert editor.event("breakpoint")["breakpoint"]["verified"]
    assert [line for _, line in editor.stopped()] == [7, 17]
    assert editor.scope("Pump")["speed"] == "0"
    editor.request("next", threadId=1)
    assert editor.stopped()[0][0] != ""
    editor.request("continue", threadId=1)
    assert editor.stopped()[0][1] == 19
    assert editor.request("evaluate", expression="n", frameId=1)["result"] == "1"
    editor.request("continue", threadId=1)
    assert editor.stopped()[0][1] == 23
    editor.request("continue", threadId=1)
    status, text = ended(editor)
    assert (status, "2 tests, 1 passed, 1 failed" in text) == (1, True)
    assert "pump.st:24: ASSERT_EQ: expected 1, got 0" in text


def test_time_stands_still_while_a_test_is_halted(editor: Editor, tested: str) -> None:
    begin_tests(editor, {tested: [15]}, program=tested, tests="waits")
    editor.stopped()
    assert editor.request("evaluate", expression="p.speed", frameId=1)["result"] == "0"
    editor.request("evaluate", expression="p.speed := 41", frameId=1, context="repl")
    editor.request("continue", threadId=1)
    status, text = ended(editor)
    assert (status, "expected 1, got 42" in text) == (1, True)


def test_tests_end_when_the_editor_disconnects(editor: Editor, tested: str) -> None:
    begin_tests(editor, {tested: [15]}, program=tested, tests=True)
    editor.stopped()
    editor.request("disconnect")
    assert editor.event("exited")["exitCode"] == 1


PYTHON_TEST = """\
from plctool import Simulator


def test_a_pump_turns():
    with Simulator.from_sources("pump.st") as plc:
        plc.run_for(2000)
        assert plc.read("Main.pump.speed") > 0
        before = plc.now_ns
        plc.run_for(10)
        assert plc.now_ns == before + 10_000_000
"""


def test_a_test_of_pytest_halts_in_the_program(tested: str, tmp_path: Path) -> None:
    (tmp_path / "test_pump.py").write_text(PYTHON_TEST)
    with subprocess.Popen(DAP, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin and process.stdout
        pipe = process.stdin

        def write(data: bytes) -> None:
            pipe.write(data)
            pipe.flush()

        editor = Editor(write, process.stdout)
        begin_tests(editor, {tested: [7]}, pytest=["test_pump.py"], cwd=str(tmp_path))
        assert editor.stopped()[0] == ("Pump", 7)
        assert editor.scope("Pump")["speed"] == "0"
        editor.request("setBreakpoints", source={"path": tested}, breakpoints=[])
        editor.request("continue", threadId=1)
        status, text = ended(editor)
        assert (status, "1 passed" in text) == (0, True)
        editor.request("disconnect")
        process.wait(60)
        pipe.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"pytest": "tests"}, '"pytest" is a list'),
        ({"tests": 5, "program": "a.st"}, '"tests" is true, or a pattern'),
        ({"tests": True}, "names its program"),
    ],
)
def test_bad_launches_of_tests_are_refused(editor: Editor, arguments: dict[str, object], words: str) -> None:
    with pytest.raises(Refused, match=words):
        editor.request("launch", **arguments)


def test_a_pattern_that_no_test_has_is_refused(editor: Editor, tested: str) -> None:
    with pytest.raises(Refused, match="No test matches 'fan'"):
        editor.request("launch", program=tested, tests="fan")
