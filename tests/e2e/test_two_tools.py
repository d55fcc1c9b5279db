"""Two tools at work on one plcrt: one debugs, the other one forces variables and changes the program."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))

from online_programs import built

from plctool import connect
from plctool.errors import PlcError
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

SOURCE = """PROGRAM Main
VAR n, stepped : DINT; forced : INT; kept : DINT := 7; END_VAR
n := n + {step};
stepped := stepped + 1;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#5ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""
HALTS, CHANGES = 12, 8


def test_tools_that_debug_force_and_change_at_once_leave_a_program_that_runs(plcrt: Plcrt, tmp_path: Path) -> None:
    """What one of them cannot do just now is refused in words; at the end the last change runs, with its values."""
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    link = f"tcp:{plcrt.tcp}"
    programs = [built(tmp_path, SOURCE.format(step=1))]
    for step in range(2, CHANGES + 2):
        programs.append(built(tmp_path, SOURCE.format(step=step), programs[-1].symbols))
    with connect(link) as plc:
        plc.add_symbols(programs[0].symbols)
        plc.flash(programs[0].image)
    broken: list[BaseException] = []
    halts: list[int] = []
    changing = threading.Event()
    changing.set()

    def debug() -> None:
        with connect(link) as plc:
            for program in programs:
                plc.add_symbols(program.symbols)
            while changing.is_set() or len(halts) < HALTS:
                try:
                    plc.breakpoints.set("program.st", 4)
                    if plc.breakpoints.wait(1) is not None:
                        halts.append(1)
                        plc.breakpoints.step_over()
                        plc.breakpoints.wait(1)
                    plc.breakpoints.clear_all()
                    plc.breakpoints.go()
                except PlcError as refused:
                    assert len(refused.message) > 20
                    plc.breakpoints.forget_halt()
            plc.end_debugging()

    def change() -> None:
        with connect(link) as plc:
            for program in programs:
                plc.add_symbols(program.symbols)
            for number, program in enumerate(programs[1:]):
                plc.force({"Main.forced": number})
                _until_taken(lambda program=program: plc.change(program.image))  # type: ignore[misc]
                assert plc.status().image_crc == program.crc
            changing.clear()

    threads = [threading.Thread(target=_guarded, args=(work, broken, changing)) for work in (debug, change)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(300)
    assert not broken and not any(thread.is_alive() for thread in threads), broken
    with connect(link) as plc:
        plc.add_symbols(programs[-1].symbols)
        eventually(lambda: str(plc.status().state) == "run")
        assert plc.status().image_crc == programs[-1].crc and len(halts) >= HALTS
        n = plc.read("Main.n")
        eventually(lambda: plc.read("Main.n") > n)
        assert plc.read("Main.forced", "Main.kept") == {"Main.forced": CHANGES - 1, "Main.kept": 7}


def _until_taken(change: Callable[[], object]) -> None:
    """A program that the other tool has halted is not changed."""

    def taken() -> bool:
        try:
            change()
        except PlcError as refused:
            assert "halted" in refused.message or "debugger" in refused.message, refused.message
            return False
        return True

    eventually(taken)


def _guarded(work: Callable[[], None], broken: list[BaseException], changing: threading.Event) -> None:
    try:
        work()
    except BaseException as error:
        broken.append(error)
        changing.clear()
