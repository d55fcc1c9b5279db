"""SYNC of a timer and of another device, and tasks that run by it, on virtual time."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import eight_nodes, write_program

from plctool.compiler.syntax.diagnostics import CompileError
from plctool.sim import Simulator

SYNC, NMT, TPDO, RPDO = 0x080, 0x000, 0x189, 0x209
SYNCS = 100_000
FRAME_NS = 300_000  # the longest frame at 500 kbit/s, with its pause
SOURCE = """
VAR_GLOBAL motions, answers : UDINT; END_VAR
PROGRAM Main
VAR inputs, coils : BYTE; door : BOOL; pressure : INT; END_VAR
coils := inputs;
END_PROGRAM
PROGRAM Motion
motions := motions + 1;
END_PROGRAM
PROGRAM Answer
answers := answers + 1;
END_PROGRAM
CONFIGURATION Plant
RESOURCE Cpu ON Plc
{tasks}
END_RESOURCE
END_CONFIGURATION
"""
CYCLIC = "TASK Slow(INTERVAL := T#100ms, PRIORITY := 5);\nPROGRAM m WITH Slow : Main;\n"
BY_SYNC = "TASK Motion(EVENT := 'Bus.sync', PRIORITY := 1);\nPROGRAM x WITH Motion : Motion;\n"
BY_WINDOW = "TASK Answer(EVENT := 'Bus.window', PRIORITY := 2);\nPROGRAM a WITH Answer : Answer;\n"
IN_SYNC = "TASK Motion(EVENT := 'Bus.sync', PRIORITY := 1);\nPROGRAM m WITH Motion : Main;\n"
EVERY = 'sync = { every = "T#5ms", window = "T#2ms" }'


def of(folder: Path, tasks: str, line: str = EVERY, device: str = 'transmission = "sync"') -> Simulator:
    """A program with these tasks."""
    return Simulator.from_sources(
        write_program(folder, line=line, device=device, source=SOURCE.replace("{tasks}", tasks))
    )


def test_timer_sends_sync_in_its_period_whatever_the_tasks_do(tmp_path: Path) -> None:
    with of(tmp_path, CYCLIC + BY_SYNC) as plc:
        plc.run_for(500)
        plc.can_receive()
        plc.run_for(1000)
        times = [f.time_ns for f in plc.can_receive() if f.id == SYNC]
        assert len(times) == 200
        assert all(abs(b - a - 5_000_000) <= FRAME_NS for a, b in pairwise(times))


def test_sync_is_in_time_beside_a_bus_full_of_a_download(tmp_path: Path) -> None:
    """Frames of 29 bits, as a download has them, take nine tenths of the bus."""
    with of(tmp_path, CYCLIC + BY_SYNC) as plc:
        plc.run_for(500)
        plc.can_receive()
        for _ in range(200):
            for number in range(16):  # 4.3 ms
                plc.can_send(0x1F400000 + number, bytes(8), extended=True)
            plc.run_for(5)
        times = [f.time_ns for f in plc.can_receive() if f.id == SYNC]
        assert len(times) == 200
        assert all(abs(b - a - 5_000_000) <= FRAME_NS for a, b in pairwise(times))


def test_tasks_run_at_each_sync_and_at_the_end_of_each_window(tmp_path: Path) -> None:
    with of(tmp_path, CYCLIC + BY_SYNC + BY_WINDOW) as plc:
        plc.run_for(500)
        before = plc.read("motions"), plc.read("answers")
        plc.run_for(1000)
        assert (plc.read("motions") - before[0], plc.read("answers") - before[1]) == (200, 200)


def test_sync_counts_and_the_nodes_know_how_far(tmp_path: Path) -> None:
    line = 'sync = { every = "T#5ms", counter = 3 }'
    path = write_program(tmp_path, line=line, source=SOURCE.replace("{tasks}", CYCLIC))
    eds = path.with_name("valves.eds")
    listed = "[OptionalObjects]\nSupportedObjects=12\n12=0x1019"
    text = eds.read_text().replace("[OptionalObjects]\nSupportedObjects=11", listed)
    eds.write_text(text + "\n[1019]\nParameterName=x\nDataType=0x0005\nAccessType=rw\nDefaultValue=0\n")
    with Simulator.from_sources(path) as plc:
        plc.run_for(100)
        frames = plc.can_receive()
        counters = [f.data for f in frames if f.id == SYNC]
        assert counters[:7] == [bytes([n]) for n in (1, 2, 3, 1, 2, 3, 1)]
        assert bytes.fromhex("2f19100003000000") in [f.data for f in frames if f.id == 0x609]


def test_outputs_of_a_task_that_runs_by_sync_leave_after_it(tmp_path: Path) -> None:
    with of(tmp_path, IN_SYNC) as plc:
        plc.run_for(500)
        plc.set_input("Main.inputs", 0x5A)
        plc.run_for(30)
        assert plc.output("Main.coils") == 0x5A
        plc.can_receive()
        plc.run_for(500)
        frames = [f for f in plc.can_receive() if f.id in (SYNC, TPDO, RPDO)]
        assert [f.id for f in frames].count(RPDO) == 100
        syncs = [f.time_ns for f in frames if f.id == SYNC]
        outputs = [f.time_ns for f in frames if f.id == RPDO]
        assert all(0 < out - sync < 3 * FRAME_NS for sync, out in zip(syncs, outputs, strict=True))


def test_values_of_all_nodes_pass_within_two_periods_of_sync(tmp_path: Path) -> None:
    with of(tmp_path, IN_SYNC) as plc:
        plc.run_for(500)
        for value in range(1, 200):  # at every phase of the period
            plc.set_input("Main.inputs", value)
            plc.run_for(11)
            assert plc.read("Main.inputs") == value


def test_sync_of_another_device_runs_the_tasks(tmp_path: Path) -> None:
    with of(tmp_path, CYCLIC + BY_SYNC + BY_WINDOW, 'sync = { produce = false, window = "T#2ms" }') as plc:
        plc.run_for(500)
        assert [f for f in plc.can_receive() if f.id == SYNC] == []
        assert plc.read("motions") == 0
        for _ in range(50):
            plc.can_send(SYNC, b"")
            plc.run_for(7)
        assert (plc.read("motions"), plc.read("answers")) == (50, 50)


def test_sync_goes_on_while_the_program_is_stopped_and_ends_with_its_description(tmp_path: Path) -> None:
    with of(tmp_path, CYCLIC + BY_SYNC) as plc:
        plc.run_for(500)
        plc.stop()
        plc.can_receive()
        plc.run_for(100)
        assert [f.id for f in plc.can_receive()].count(SYNC) == 20
        plc.start()
        plc.run_for(100)
        assert plc.read("Valves.ok")


def test_eight_nodes_exchange_their_values_at_each_sync(tmp_path: Path) -> None:
    path = eight_nodes(tmp_path)
    with Simulator.from_sources(path) as plc:
        plc.run_for(3000)
        before = plc.read("motions")
        plc.run_for(SYNCS * 10 - 2000)
        plc.can_receive()
        plc.run_for(2000)
        ids = [f.id for f in plc.can_receive()]
        assert plc.read("motions") - before == SYNCS
        assert [ids.count(SYNC)] + [ids.count(base + n) for base in (0x180, 0x200) for n in range(1, 9)] == [200] * 17
        assert all(plc.read(f"N{n}.ok") for n in range(1, 9))
        assert [entry.text for entry in plc.log() if "lost" in entry.text] == []


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("sync = {}", "needs every"),
        ('sync = { every = "T#5ms", window = "T#5ms" }', "the window has to end before the next SYNC of Bus"),
        ("sync = 3", "sync is"),
        ('sync = { every = "T#5ms", counter = 1 }', "counter is 1; it can be 2 to 240"),
        ("sync = { produce = false, counter = 3 }", "the device that sends SYNC counts it"),
    ],
)
def test_mistakes_of_sync_are_reported(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(CompileError, match=message):
        of(tmp_path, CYCLIC, line)
