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
