"""Online changes on plcrt; the rest of the promise is in tests/changing.py."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import rmtree
from subprocess import PIPE
from threading import Timer

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from changing import BLOCKS, BODY, VARIABLES, Changing, program
from conftest import Tool
from online_programs import built

from plctool import connect
from plctool.debug.symbols import SymbolTable
from plctool.device import Plc
from plctool.errors import EXIT_INTERRUPTED, DeviceError
from plctool.link.tcp import TcpTransport
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import PATIENCE, eventually


@pytest.fixture
def plc(plcrt: Plcrt, tmp_path: Path) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    result = built(tmp_path, program())
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.add_symbols(result.symbols)
        plc.flash(result.image)
        eventually(lambda: plc.read("Main.n") > 5)
        yield plc


class TestPlcrt(Changing):
    pass


def test_changed_program_is_what_runs_after_power_off_and_has_its_retain_values(
    plc: Plc, plcrt: Plcrt, tmp_path: Path
) -> None:
    """Also at once, when nothing else was saved since."""
    plc.write({"Main.kept": 123})
    eventually(lambda: plc.read("Main.kept") == 123)
    result = built(tmp_path, program("n := n - 1;"), plc.symbols())
    plc.add_symbols(result.symbols)
    plc.change(result.image)
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as again:
        again.add_symbols(result.symbols)
        eventually(lambda: str(again.status().state) == "run")
        assert again.status().image_crc == result.crc
        assert again.read("Main.kept") == 123
        eventually(lambda: again.read("Main.n") < 0)


def killed_at(step: int, plcrt: Plcrt, symbols: list[SymbolTable], image: bytes) -> bool:
    """A process makes a change and is killed when it sends packet number `step`; False if it has made it before."""
    pid = os.fork()
    if pid == 0:
        sent = 0
        send = TcpTransport.send

        def counted(transport: TcpTransport, *packets: bytes) -> None:
            nonlocal sent
            sent += 1
            send(transport, *packets)
            if sent == step:
                os.kill(os.getpid(), signal.SIGKILL)

        TcpTransport.send = counted  # type: ignore[method-assign]
        try:
            with connect(f"tcp:{plcrt.tcp}") as plc:
                for table in symbols:
                    plc.add_symbols(table)
                plc.change(image)
        finally:
            os._exit(0)
    return os.WIFSIGNALED(os.waitpid(pid, 0)[1])


def test_tool_that_is_killed_at_any_packet_leaves_the_old_or_the_new_program(plcrt: Plcrt, tmp_path: Path) -> None:
    """Whole, running, with all values; and the next change finds a device that takes it."""
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    tables = [built(tmp_path, program())]
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(tables[0].image)
        plc.add_symbols(tables[0].symbols)
        plc.write({"Main.fixed": 70})
    step = 0
    while True:
        step += 1
        tables.append(built(tmp_path, program(BODY.replace("n + 1", f"n + {step + 1}")), tables[-1].symbols))
        killed = killed_at(step, plcrt, [table.symbols for table in tables[-2:]], tables[-1].image)
        with connect(f"tcp:{plcrt.tcp}") as plc:
            eventually(lambda: str(plc.status().state) == "run")
            crc = plc.status().image_crc
            assert crc in [table.crc for table in tables[-2:]]
            if crc != tables[-1].crc:
                tables.pop()
            plc.add_symbols(tables[-1].symbols)
            n = plc.read("Main.n")
            eventually(lambda: plc.read("Main.n") > n)  # noqa: B023
            assert plc.read("Main.fixed") == 70
        if not killed:
            break
    assert step > 8 and tables[-1].crc == crc


PROJECT = 'sources = ["main.st"]\n'


@pytest.fixture
def project(plcrt: Plcrt, tool: Tool) -> Path:
    """A project in the folder of the tool, whose program runs."""
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    (tool.folder / "plc.toml").write_text(PROJECT)
    (tool.folder / "main.st").write_text(program(BODY))
    tool.ok("flash", "--tcp", plcrt.tcp)
    return tool.folder


def test_edited_project_is_changed_in_the_program_that_runs(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    flash = ("flash", "--online-change", "--tcp", plcrt.tcp)
    assert "already" in tool(*flash).out
    tool.ok("write", "--tcp", plcrt.tcp, "Main.fixed=70")
    (project / "main.st").write_text(program(BODY, before="VAR_GLOBAL more : INT := 3; END_VAR" + BLOCKS))
    plan = tool.ok(*flash, "--dry-run")
    assert (plan["new"], plan["removed"], plan["problems"]) == (["more"], [], [])
    assert tool.ok("read", "--tcp", plcrt.tcp, "Main.fixed")["values"] == {"Main.fixed": 70}
    done = tool(*flash)
    assert done.status == 0 and "  new: more\nchanged: " in done.out
    values = tool.ok("read", "--tcp", plcrt.tcp, "Main.fixed", "more")["values"]
    assert values == {"Main.fixed": 70, "more": 3}
    assert tool.ok("flash", "--tcp", plcrt.tcp)["skipped"]  # what runs is the image of the project
    assert "Online change, CRC" in tool("log", "--tcp", plcrt.tcp).out


def test_sources_of_a_changed_program_can_be_kept_on_the_device(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    """With the places that variables have, which only the program before the change explains."""
    (project / "main.st").write_text(program(BODY).replace("VAR n, seen", "VAR more : LINT; n, seen"))
    tool.ok("flash", "--online-change", "--tcp", plcrt.tcp)
    crc = tool.ok("source", "put", "--tcp", plcrt.tcp)["crc"]
    got = tool.ok("source", "get", "--tcp", plcrt.tcp, "-o", "again")
    built = Tool(folder=project / "again").ok("build", *got["build"], "-o", "same.cdl")
    assert got["crc"] == crc == built["crc"]


def test_back_is_the_program_before_with_the_values_of_now(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    flash = ("flash", "--online-change", "--tcp", plcrt.tcp)

    def values() -> dict[str, int]:
        return dict(tool.ok("read", "--tcp", plcrt.tcp, "Main.fixed", "Main.text")["values"])

    first = tool("status", "--tcp", plcrt.tcp).out
    done = tool(*flash, "--back")
    assert (done.status, "there is no way back" in done.err) == (2, True)
    newer = program(BODY + " more := 5;", before="VAR_GLOBAL more : INT := 3; END_VAR" + BLOCKS)
    (project / "main.st").write_text(newer.replace("STRING[20]", "STRING[60]"))
    tool.ok(*flash)
    tool.ok("write", "--tcp", plcrt.tcp, "Main.fixed=70", "Main.kept=77", f"Main.text='{'x' * 40}'")
    plan = tool.ok(*flash, "--back", "--dry-run")
    assert (plan["removed"], len(plan["retyped"]), plan["problems"]) == (["more"], 1, [])
    done = tool(*flash, "--back")
    assert done.status == 0 and done.out.startswith("back to the program with CRC "), done.err
    assert "  lost, since only the newer program has it: more\n" in done.out
    assert values() == {"Main.fixed": 70, "Main.text": "before"}  # which is shorter again
    assert tool("read", "--tcp", plcrt.tcp, "more").status == 2
    assert (project / "main.st").read_text() == newer.replace("STRING[20]", "STRING[60]")
    assert tool("status", "--tcp", plcrt.tcp).out.splitlines()[0] == first.splitlines()[0]
    plcrt.stop(signal.SIGKILL)  # which is a power cut, before anything else was saved
    plcrt.start()
    flash = ("flash", "--online-change", "--tcp", plcrt.tcp)
    assert tool.ok("read", "--tcp", plcrt.tcp, "Main.kept", "Main.fixed")["values"] == {
        "Main.kept": 77,
        "Main.fixed": 7,
    }
    tool.ok("write", "--tcp", plcrt.tcp, "Main.fixed=71")
    tool.ok(*flash, "--back")  # the newer one again
    read = tool.ok("read", "--tcp", plcrt.tcp, "Main.fixed", "Main.kept", "more")["values"]
    assert read == {"Main.fixed": 71, "Main.kept": 77, "more": 5}
    for path in (project / "cache").rglob("*.src"):
        path.unlink()
    done = tool(*flash, "--back")
    assert (done.status, "does not have the sources of the previous program" in done.err) == (2, True)


def test_retain_values_saved_before_a_change_can_be_restored_after_it(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    link = ("--tcp", plcrt.tcp)
    tool.ok("write", *link, "Main.kept=77")
    tool.ok("stop", *link)
    tool.ok("files", "get", "Retain.bin", *link)
    tool.ok("start", *link)
    more = "VAR RETAIN early, kept : LINT := 9; late : DINT := 4; END_VAR"
    for step in (1, 2):
        text = program(
            BODY.replace("n + 1", f"n + {step}"), VARIABLES.replace("VAR RETAIN kept : DINT := 9; END_VAR", more)
        )
        (project / "main.st").write_text(text.replace("kept : LINT", "kept : DINT"))
        tool.ok("flash", "--online-change", *link)
        tool.ok("write", *link, "Main.kept=5", "Main.late=6")
        tool.ok("stop", *link)
        done = tool("files", "put", "Retain.bin", *link)
        values = tool.ok("read", *link, "Main.kept", "Main.late", "Main.early")["values"]
        tool.ok("start", *link)
        if step == 1:
            assert done.status == 0, done.err
            assert values == {"Main.kept": 77, "Main.late": 6, "Main.early": 9}
        else:
            assert done.status == 1 and "another program saved it" in done.err
            assert values == {"Main.kept": 5, "Main.late": 6, "Main.early": 9}


def test_impossible_edit_is_refused_before_anything_is_sent(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    made = "VAR own : DINT := 40; made : Made(by := 3);"
    (project / "main.st").write_text(program(BODY).replace("VAR own : DINT := 40;", made))
    done = tool("flash", "--online-change", "--tcp", plcrt.tcp)
    assert done.status == 2
    assert "Main.d: what is new in Derived has a calculated initial value or FB_Init" in done.err
    assert tool.ok("read", "--tcp", plcrt.tcp, "Main.fixed")["values"] == {"Main.fixed": 7}


def test_change_without_the_symbols_of_what_runs_says_what_to_do(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    rmtree(project / "cache")
    flash = ("flash", "--online-change", "--tcp", plcrt.tcp)
    (project / "main.st").write_text(program(BODY, before="VAR_GLOBAL more : INT := 3; END_VAR" + BLOCKS))
    assert tool.ok(*flash, "--dry-run")["new"] == ["more"]  # those beside the image
    (project / "app.sym").unlink()
    done = tool(*flash)
    assert done.status == 2
    assert "Change it from the computer that flashed it, or download the program with 'plctool flash'." in done.err


def test_force_of_a_removed_variable_ends_and_others_stay(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    tool.ok("force", "--tcp", plcrt.tcp, "Main.gone=1", "Main.fixed=2")
    (project / "main.st").write_text(program(BODY).replace("gone : LINT := 5;", ""))
    assert tool.ok("flash", "--online-change", "--tcp", plcrt.tcp)["released"] == ["Main.gone"]
    assert list(tool.ok("forced", "--tcp", plcrt.tcp)["values"]) == ["Main.fixed"]


def test_force_of_a_variable_that_moves_is_set_again(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    tool.ok("force", "--tcp", plcrt.tcp, "Main.list[2]=5", "Main.fixed=2")
    (project / "main.st").write_text(program(BODY).replace("ARRAY[1..4] OF INT := [4", "ARRAY[0..4] OF INT := [0, 4"))
    assert tool.ok("flash", "--online-change", "--tcp", plcrt.tcp)["released"] == []
    assert tool.ok("forced", "--tcp", plcrt.tcp)["values"] == {"Main.fixed": 2, "Main.list[2]": 5}


def test_trace_of_a_removed_variable_ends_and_others_stay(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    tool.ok("trace", "--tcp", plcrt.tcp, "Main.n", "Main.gone", "--name", "gone", "--keep")
    tool.ok("trace", "--tcp", plcrt.tcp, "Main.n", "Main.fixed", "--name", "stays", "--keep", "--samples", "100")
    (project / "main.st").write_text(program(BODY).replace("gone : LINT := 5;", ""))
    assert tool.ok("flash", "--online-change", "--tcp", plcrt.tcp)["ended"] == ["gone"]
    assert [t["name"] for t in tool.ok("trace", "--tcp", plcrt.tcp, "--list")["traces"]] == ["stays"]


def test_persistent_trace_goes_on_after_a_change_and_a_power_cut_unless_what_it_records_moves(
    project: Path, plcrt: Plcrt, tool: Tool
) -> None:
    for name, *options in (
        ("stays", "Main.n"),
        ("moves", "Main.list[2]"),
        ("compares", "Main.n", "--trigger", "Main.list[2] > 100"),
    ):
        options += ["--name", name, "--persistent", "--samples", "100"]
        tool.ok("trace", "--tcp", plcrt.tcp, *options)
    (project / "main.st").write_text(program(BODY).replace("ARRAY[1..4] OF INT := [4", "ARRAY[0..4] OF INT := [0, 4"))
    assert tool.ok("flash", "--online-change", "--tcp", plcrt.tcp)["ended"] == ["moves", "compares"]
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    traces = tool.ok("trace", "--tcp", plcrt.tcp, "--list")["traces"]
    assert [(t["name"], t["columns"]) for t in traces] == [("stays", ["Main.n"])]
    eventually(lambda: tool.ok("trace", "--tcp", plcrt.tcp, "--open", "stays")["time_ms"])


def test_a_program_may_forbid_online_changes_alone(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    body = "PlcOperationControlInstance.xDisableApplicationOnlineChange := fixed = 8;"
    flash = ("flash", "--online-change", "--tcp", plcrt.tcp)
    (project / "main.st").write_text(program(body))
    tool.ok(*flash)
    tool.ok("write", "--tcp", plcrt.tcp, "Main.fixed=8")
    eventually(lambda: "online change" in tool("status", "--tcp", plcrt.tcp).out)
    (project / "main.st").write_text(program(body + BODY))
    done = tool(*flash)
    assert done.status == 1 and "the running program forbids it" in done.err.lower()
    tool.ok("write", "--tcp", plcrt.tcp, "Main.fixed=7")
    eventually(lambda: tool(*flash).status == 0)


def test_saved_file_runs_and_a_mistake_in_it_is_only_said(project: Path, plcrt: Plcrt, tool: Tool) -> None:
    command = [sys.executable, "-m", "plctool", "flash", "--online-change", "--watch", "--tcp", plcrt.tcp]
    environment = os.environ | {"XDG_CACHE_HOME": str(project / "cache")}
    with (
        subprocess.Popen(command, cwd=project, env=environment, stdout=PIPE, stderr=PIPE, text=True) as watching,
        connect(f"tcp:{plcrt.tcp}") as plc,
    ):
        assert watching.stdout is not None and watching.stderr is not None
        ends = Timer(3 * PATIENCE, watching.kill)  # and with it what is read here
        ends.start()
        try:
            assert "already" in watching.stdout.readline()
            (project / "main.st").write_text(program(BODY + " mistake;"))
            assert watching.stderr.readline().startswith("main.st:")
            (project / "plc.toml").write_text(PROJECT + "nonsense =\n")
            assert next(line for line in iter(watching.stderr.readline, "") if line.startswith("plc.toml:2:"))
            (project / "plc.toml").write_text(PROJECT)
            (project / "main.st").write_text(program(BODY, VARIABLES.replace("seen :", "fresh, seen :")))
            lines = iter(watching.stdout.readline, "")
            assert next(line for line in lines if "new" in line)
            assert next(line for line in lines if line.startswith("changed: "))
            assert plc.raw_status().state == "run"
        finally:
            ends.cancel()
            watching.send_signal(signal.SIGINT)
        assert watching.wait(60) == EXIT_INTERRUPTED


def test_breakpoints_of_the_old_code_are_taken_out(plc: Plc, tmp_path: Path) -> None:
    """With a condition that never holds, so that the program is not halted; a halted one is not changed."""
    text = program("n := n + 1;\nfixed := 7;")
    result = built(tmp_path, text, plc.symbols())
    plc.add_symbols(result.symbols)
    plc.change(result.image)
    line = text.splitlines().index("fixed := 7;") + 1
    plc.breakpoints.set("program.st", line, condition="Main.n < 0")
    changed = built(tmp_path, text.replace("n + 1", "n + 2"), result.symbols)
    plc.add_symbols(changed.symbols)
    plc.change(changed.image)
    n = plc.read("Main.n")
    eventually(lambda: plc.read("Main.n") > n)
    assert plc.breakpoints.list() == []
    plc.breakpoints.set("program.st", line)
    eventually(lambda: plc.status().state == "halted")
    with pytest.raises(DeviceError, match="A debugger has halted the program"):
        plc.change(built(tmp_path, text, changed.symbols).image)
