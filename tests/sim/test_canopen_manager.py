"""The CANopen manager and simulated nodes, on virtual time."""

from __future__ import annotations

import datetime
import re
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import GUARD, OTHERS, of_many_writes, with_more_pdos, write_guarded_program, write_program

from plctool.compiler.syntax.diagnostics import CompileError
from plctool.errors import UsageError
from plctool.iec.types import UDINT
from plctool.io.canopen import manager
from plctool.sim import Simulator

NMT, SDO, HEARTBEAT = 0x000, 0x600, 0x700
RESERVED = 0x202
EMERGENCIES = 0x8005
REFUSED = """
[[canopen.device]]
name = "Refused"
node = 12
eds = "valves.eds"
optional = true
set = { "2001" = 5 }
"""
BOOT_MS = 400  # for all nodes to be in operation


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    with Simulator.from_sources(write_program(tmp_path, others=OTHERS)) as simulator:
        simulator.run_for(BOOT_MS)
        yield simulator


def in_operation(plc: Simulator, *names: str) -> bool:
    return all(plc.read(f"{name}.ok") for name in names or ("Valves", "Second", "Third"))


def of_manager(plc: Simulator) -> list[str]:
    return [entry.text for entry in plc.log() if entry.component == "CmpIoMgrEmbedded"]


def written(plc: Simulator, node: int) -> list[tuple[int, int]]:
    """The objects that were written to a node, in order."""
    frames = [f.data for f in plc.can_receive() if f.id == SDO + node and f.data[0] & 0xE0 == 0x20]
    return [(int.from_bytes(data[1:3], "little"), data[3]) for data in frames]


def test_nodes_are_configured_and_started(plc: Simulator) -> None:
    assert in_operation(plc)
    assert plc.read("Bus.ok")
    assert of_manager(plc) == []


def test_each_value_is_written_before_the_pdos_and_these_in_the_order_that_devices_want(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path)) as plc:
        plc.run_for(BOOT_MS)
        rpdo = [(0x1400, 1), (0x1600, 0), (0x1600, 1), (0x1600, 0), (0x1400, 2), (0x1400, 1)]
        tpdo = [(0x1800, 1), (0x1A00, 0), (0x1A00, 1), (0x1A00, 2), (0x1A00, 0), (0x1800, 2), (0x1800, 5), (0x1800, 1)]
        assert written(plc, 9) == [(0x1017, 0), (0x2001, 0), (0x2000, 0), *rpdo, *tpdo]


def test_values_go_both_ways(plc: Simulator) -> None:
    plc.set_input("Main.inputs", 0x5A)
    plc.set_input("Main.pressure", -7)
    plc.run_for(40)
    assert (plc.read("Main.inputs"), plc.read("Main.door"), plc.read("Main.pressure")) == (0x5A, True, -7)
    assert plc.output("Main.coils") == 0x5A
    plc.write({"Main.coils2": 3})
    plc.run_for(40)
    assert plc.output("Main.coils2") == 3


@pytest.mark.parametrize("name", ["Valves", "Second", "Third"])
def test_node_that_is_pulled_is_lost_and_comes_back_while_others_keep_running(plc: Simulator, name: str) -> None:
    others = {"Valves", "Second", "Third"} - {name}
    plc.fault(name, "absent")
    plc.run_for(520)
    assert not plc.read(f"{name}.ok")
    for _ in range(200):
        plc.run_for(100)
        assert in_operation(plc, *others)
    plc.fault(name, "absent", 0)
    plc.run_for(BOOT_MS)
    assert in_operation(plc)
    assert of_manager(plc) == [f"{name} is lost: its heartbeat is missing", f"{name} is back"]


@pytest.mark.parametrize("seconds", [0.01, 0.1, 1, 10, 60, 600, 3600])
def test_node_is_back_after_10_ms_to_an_hour(plc: Simulator, seconds: float) -> None:
    plc.fault("Second", "absent")
    plc.run_for(round(seconds * 1000))
    assert in_operation(plc, "Valves", "Third")
    plc.fault("Second", "absent", 0)
    plc.run_for(BOOT_MS + 600)  # a node that was away for a moment is lost by its boot-up
    assert in_operation(plc)
    assert of_manager(plc)[-1] == "Second is back"


def test_node_is_back_whenever_it_is_pulled_while_it_boots(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    with Simulator.from_sources(path) as plc:
        for ms in range(40, 80):
            plc.restart()
            plc.run_for(ms)
            plc.fault("Valves", "absent")
            plc.run_for(30)
            plc.fault("Valves", "absent", 0)
            plc.run_for(10_000)
            assert in_operation(plc, "Valves"), ms


def test_node_without_reply_costs_the_bus_a_frame_in_eight_seconds(plc: Simulator) -> None:
    plc.fault("Third", "absent")
    plc.run_for(60_000)
    plc.can_receive()
    plc.run_for(60_000)
    asked = [f for f in plc.can_receive() if f.id == SDO + 11]
    assert 0 < len(asked) <= 4 * 8


def test_other_device_with_the_number_is_not_started(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path)) as plc:
        plc.fault("Valves", "type")
        plc.run_for(5000)
        assert not plc.read("Valves.ok")
        assert of_manager(plc) == ["Valves is lost: its device type is 0x00030192"]
        plc.fault("Valves", "type", 0)
        plc.run_for(10_000)
        assert plc.read("Valves.ok")


def test_refused_write_is_named_and_tried_again(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path)) as plc:
        plc.run_for(54)
        plc.fault("Valves", "answers", 1)
        plc.run_for(1000)
        (text,) = of_manager(plc)[:1]
        assert re.fullmatch(r"Valves is lost: it refuses [0-9A-F]{4}:[0-9A-F]{2}, 0x08000000", text)
        plc.run_for(5000)
        assert plc.read("Valves.ok")


def test_slow_replies_are_waited_for(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path)) as plc:
        plc.fault("Valves", "late", 900)
        plc.run_for(40_000)
        assert plc.read("Valves.ok")


def test_our_heartbeat_is_sent(plc: Simulator) -> None:
    plc.can_receive()
    plc.run_for(1000)
    assert [f.data for f in plc.can_receive() if f.id == HEARTBEAT + 127] == [b"\x05"] * 10


def test_outputs_are_safe_while_the_program_is_stopped(plc: Simulator) -> None:
    plc.set_input("Main.inputs", 0xFF)
    plc.run_for(50)
    assert plc.output("Main.coils") == 0xFF
    plc.stop()
    plc.run_for(200)
    assert plc.output("Main.coils") == 0
    plc.start()
    plc.run_for(50)
    assert plc.output("Main.coils") == 0xFF


def test_input_that_is_late_is_a_loss(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path, device='every = "T#50ms"')) as plc:
        plc.run_for(BOOT_MS)
        plc.fault("Valves", "absent")
        plc.run_for(250)
        assert of_manager(plc) == ["Valves is lost: one of its PDOs is late"]


def test_synchronous_pdos_follow_each_sync(tmp_path: Path) -> None:
    path = write_program(tmp_path, line="sync = true", device='transmission = "sync"')
    with Simulator.from_sources(path) as plc:
        plc.run_for(BOOT_MS)
        plc.can_receive()
        plc.run_for(1000)
        frames = [f.id for f in plc.can_receive()]
        assert frames.count(0x080) == 100
        assert frames.count(0x189) in (99, 100, 101)
        assert frames.count(0x209) in (99, 100, 101)
        plc.set_input("Main.inputs", 0x11)
        plc.run_for(50)
        assert plc.read("Main.inputs") == 0x11


@pytest.mark.parametrize("number", [0x000, 0x080, 0x189, 0x209, 0x609, 0x77F])
def test_program_cannot_send_what_the_manager_does(plc: Simulator, number: int) -> None:
    plc.write({"Main.id": number, "Main.go": True})
    plc.run_cycles(3)
    assert plc.read("Main.frame.ErrorID") == RESERVED


def test_emergency_is_logged_and_counted(plc: Simulator) -> None:
    plc.can_send(0x089, bytes.fromhex("3012040000000000"))
    plc.run_for(20)
    assert [e.text for e in plc.log() if e.component == "IoDrvCanopen"] == ["Valves reports emergency 0x1230"]
    assert in_operation(plc)


def test_a_flood_of_emergencies_does_not_drive_all_else_out_of_the_log(plc: Simulator) -> None:
    for number in range(500):
        plc.can_send(0x089, bytes([number & 0xFF, 0x10, 1, 0, 0, 0, 0, 0]))
        plc.run_for(5)
    plc.run_for(1500)
    told = [e.text for e in plc.log() if e.component == "IoDrvCanopen"]
    assert told[0] == "Valves reports emergency 0x1000"
    assert told[-1] == f"Valves reports emergency 0x{0x1000 + (499 & 0xFF):X}"
    assert len(told) <= 5
    assert plc.io_read_parameter("Valves", EMERGENCIES, UDINT) == 500
    assert in_operation(plc)


def test_restart_of_a_node_is_noticed_and_configured_again(plc: Simulator) -> None:
    plc.can_receive()
    plc.can_send(NMT, b"\x81\x09")  # another tool resets it
    plc.run_for(BOOT_MS)
    assert in_operation(plc)
    assert "Valves is lost: it has restarted" in of_manager(plc)
    assert (0x2001, 0) in written(plc, 9)


def test_frames_of_others_do_no_harm(plc: Simulator) -> None:
    for node in (9, 10, 11, 50):
        for function in (0x080, 0x180, 0x580, 0x700):
            for size in range(9):
                plc.can_send(function + node, bytes([0xFF] * size))
                plc.run_for(2)
    plc.run_for(10_000)
    assert in_operation(plc)


@pytest.mark.parametrize(
    ("device", "message"),
    [
        ('timeout = "T#1ms"', "timeout is T#1ms"),
        ('transmission = "sync"', "there is no SYNC: write sync = true"),
        ("colour = 1", "there is no 'colour' here"),
    ],
)
def test_mistakes_of_a_device_are_reported(tmp_path: Path, device: str, message: str) -> None:
    with pytest.raises(CompileError, match=message):
        Simulator.from_sources(write_program(tmp_path, device=device))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("node = 9", "node = 127", "this PLC has the node number 127, too"),
        ('"valves.eds"', '"other.eds"', "other.eds"),
        ('"2001" = 700', '"2001" = 1001', r"2001:00 \(Pressure limit\) can be 0 to 1000, not 1001"),
        ('"2001" = 700', '"1000" = 1', r"1000:00 \(Device type\) cannot be written"),
        ('"6000:01" =', '"6000:02" =', "valves.eds has no object 6000:02"),
        ('"6000:01" =', '"speed" =', "'speed' is not an object"),
        ('"6000:01.3" =', '"6000:01.8" =', "6000:01 has the bits 0 to 7"),
        ('"6000:01" =', '"6200:01" =', r"6200:01 \(Outputs 1 to 8\): it cannot be an input"),
        ('"6200:01" =', '"2001" =', "it cannot be in a PDO"),
    ],
)
def test_mistakes_about_objects_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = write_program(tmp_path)
    description = path.with_name("app.io.toml")
    text = description.read_text()
    assert old in text
    description.write_text(text.replace(old, new, 1))
    with pytest.raises((CompileError, UsageError), match=message):
        Simulator.from_sources(path)


def test_optional_node_that_is_refused_is_not_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = manager.concise_dcf
    of_refused = (0x2001, 0, b"\x05\x00")
    monkeypatch.setattr(manager, "concise_dcf", lambda writes: made(writes)[: -1 if of_refused in writes else None])
    path = write_program(tmp_path, others=REFUSED)
    with Simulator.from_sources(path) as plc:
        plc.run_for(5000)
        assert in_operation(plc, "Valves")
        assert not plc.read("Refused.ok")
        assert [f for f in plc.can_receive() if f.id == SDO + 12 or f.data == b"\x82\x0c"] == []
        assert any("its concise DCF is damaged" in entry.text for entry in plc.log())


def of_many_pdos(folder: Path, count: int, inputs: int) -> Path:
    names = [f"big{n}" for n in range(1, inputs + 1)]
    source = (
        f"PROGRAM Main VAR {', '.join(names)} : ULINT; sum : ULINT; END_VAR\nsum := {' + '.join(names)};\nEND_PROGRAM"
    )
    path = write_program(folder, source=source)
    eds = folder / "valves.eds"
    eds.write_text(with_more_pdos(eds.read_text(), count))
    channels = ", ".join(f'"6444:{n:02X}" = "Main.big{n}"' for n in range(1, inputs + 1))
    node = f'[[canopen.device]]\nname = "Valves"\nnode = 9\neds = "valves.eds"\nin = {{ {channels} }}\n'
    (folder / "app.io.toml").write_text('[[canopen]]\nname = "Bus"\nnode = 127\n' + node)
    return path


def test_node_may_have_more_than_four_pdos_in_a_direction(tmp_path: Path) -> None:
    with Simulator.from_sources(of_many_pdos(tmp_path, 8, 6)) as plc:
        plc.run_for(BOOT_MS)
        assert in_operation(plc, "Valves")
        off = [index for index, sub in written(plc, 9) if sub == 1 and 0x1806 <= index <= 0x1807]
        assert off == []  # they are off in the node
        for n in range(1, 7):
            plc.set_input(f"Main.big{n}", 10**n)
        plc.run_for(50)
        assert plc.read("Main.sum") == 1_111_110
        sent = {f.id for f in plc.can_receive() if len(f.data) == 8 and (f.id & 0x780 < 0x580 or 0x680 <= f.id < 0x6E0)}
        assert sent == {0x189, 0x289, 0x389, 0x489, 0x6DF, 0x6DE}


def test_more_inputs_than_a_node_has_pdos_for_are_reported(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="Valves has 5 PDOs for inputs, which have no room for 6444:06"):
        Simulator.from_sources(of_many_pdos(tmp_path, 5, 6))


# ---- guarding, and nodes that others depend on -----------------------------------------------------------------------


def requests(plc: Simulator, node: int) -> int:
    """How often the node was asked for its state since the last call."""
    return sum(frame.remote and frame.id == HEARTBEAT + node for frame in plc.can_receive())


def test_guarded_node_runs_is_lost_and_comes_back(tmp_path: Path) -> None:
    with Simulator.from_sources(write_guarded_program(tmp_path)) as plc:
        plc.run_for(BOOT_MS)
        assert in_operation(plc)
        plc.can_receive()
        plc.run_for(1000)
        assert requests(plc, 9) == 10
        plc.fault("Valves", "absent")
        plc.run_for(380)
        assert plc.read("Valves.ok")
        plc.run_for(150)  # five requests without a reply
        assert not plc.read("Valves.ok")
        plc.fault("Valves", "absent", 0)
        plc.run_for(2000)
        assert in_operation(plc)
        assert of_manager(plc) == ["Valves is lost: it does not reply to guarding", "Valves is back"]


def test_guarding_is_written_into_the_node_and_its_heartbeat_switched_off(tmp_path: Path) -> None:
    with Simulator.from_sources(write_guarded_program(tmp_path)) as plc:
        plc.run_for(BOOT_MS)
        frames = [f.data for f in plc.can_receive() if f.id == SDO + 9 and f.data[0] & 0xE0 == 0x20]
        values = {int.from_bytes(f[1:3], "little"): int.from_bytes(f[4:], "little") for f in frames}
        assert [values[index] for index in (0x1017, 0x100C, 0x100D)] == [0, 100, 5]


def test_reply_with_the_wrong_toggle_does_not_count(tmp_path: Path) -> None:
    with Simulator.from_sources(write_guarded_program(tmp_path)) as plc:
        plc.run_for(BOOT_MS)
        plc.fault("Valves", "absent")
        for _ in range(60):  # another device that sends the same byte for ever
            plc.can_send(HEARTBEAT + 9, b"\x05")
            plc.run_for(10)
        assert of_manager(plc) == ["Valves is lost: it does not reply to guarding"]


@pytest.mark.parametrize(
    ("guard", "message"),
    [
        (GUARD + '\nheartbeat = "T#100ms"', "write guard or heartbeat, not both"),
        ("guard = {}", "every"),
        ('guard = { every = "T#100ms", life = 0 }', "life is 0; it can be 1 to 255"),
        ('on_lost = "panic"', "on_lost cannot be 'panic'"),
        ("required = true\noptional = true", "write required or optional, not both"),
    ],
)
def test_mistakes_of_guarding_are_reported(tmp_path: Path, guard: str, message: str) -> None:
    with pytest.raises(CompileError, match=message):
        Simulator.from_sources(write_guarded_program(tmp_path, guard=guard))


def test_node_that_cannot_be_guarded_is_reported(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    description = tmp_path / "app.io.toml"
    description.write_text(description.read_text().replace('heartbeat = "T#200ms"', GUARD, 1))
    with pytest.raises(CompileError, match=r"Valves cannot be guarded \(its EDS has no 100C and 100D\)"):
        Simulator.from_sources(path)


def test_no_node_is_started_before_a_required_one(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path, others=OTHERS, device="required = true")) as plc:
        plc.fault("Valves", "absent")
        plc.run_for(5000)
        assert not any(plc.read(f"{name}.ok") for name in ("Valves", "Second", "Third"))
        plc.fault("Valves", "absent", 0)
        plc.run_for(10_000)
        assert in_operation(plc)
        plc.fault("Valves", "absent")  # now the others keep running
        plc.run_for(5000)
        assert in_operation(plc, "Second", "Third")
        assert not plc.read("Valves.ok")


def test_nodes_are_stopped_while_a_node_is_lost_and_started_without_a_boot(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path, others=OTHERS, device='on_lost = "stop"')) as plc:
        plc.run_for(BOOT_MS)
        assert in_operation(plc)
        plc.fault("Valves", "absent")
        plc.run_for(560)
        assert {b"\x02\x0a", b"\x02\x0b"} < {f.data for f in plc.can_receive() if f.id == NMT}
        assert not any(plc.read(f"{name}.ok") for name in ("Valves", "Second", "Third"))
        assert "Second is lost: it waits for a node that is lost" in of_manager(plc)
        plc.run_for(20_000)
        plc.can_receive()
        plc.fault("Valves", "absent", 0)
        plc.run_for(10_000)
        assert in_operation(plc)
        assert written(plc, 10) == []  # the configuration was not written again


def test_node_that_is_lost_while_it_is_stopped_is_regained(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path, others=OTHERS, device='on_lost = "stop"')) as plc:
        plc.run_for(BOOT_MS)
        plc.fault("Valves", "absent")
        plc.run_for(2000)
        plc.fault("Second", "absent")
        plc.run_for(5000)
        plc.fault("Valves", "absent", 0)
        plc.run_for(10_000)
        assert in_operation(plc, "Valves", "Third")
        plc.fault("Second", "absent", 0)
        plc.run_for(10_000)
        assert in_operation(plc)


def test_outputs_of_the_others_are_safe_while_a_node_is_lost(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path, others=OTHERS, device='on_lost = "safe"')) as plc:
        plc.run_for(BOOT_MS)
        plc.write({"Main.coils2": 0x55})
        plc.run_for(50)
        assert plc.output("Main.coils2") == 0x55
        plc.fault("Valves", "absent")
        plc.run_for(560)
        assert plc.output("Main.coils2") == 0
        assert in_operation(plc, "Second", "Third")
        plc.fault("Valves", "absent", 0)
        plc.run_for(10_000)
        assert plc.output("Main.coils2") == 0x55


# ---- scale -----------------------------------------------------------------------------------------------------------

EVERY_NODE = 126  # and ours


def of_all_nodes(folder: Path) -> Path:
    """A program with a node of each number but ours, each with an output of its own."""
    names = [f"N{n}" for n in range(1, EVERY_NODE + 1)]
    path = write_program(
        folder, source=f"PROGRAM Main VAR {', '.join(n + 'out' for n in names)} : BYTE; END_VAR END_PROGRAM"
    )
    nodes = "".join(
        f'[[canopen.device]]\nname = "{name}"\nnode = {number}\neds = "valves.eds"\nheartbeat = "T#1s"\n'
        f'out = {{ "6200:01" = "Main.{name}out" }}\n'
        for number, name in enumerate(names, 1)
    )
    (folder / "app.io.toml").write_text('[[canopen]]\nname = "Bus"\nnode = 127\n' + nodes)
    return path


def test_all_127_nodes_of_a_network_run_and_one_is_lost_alone(tmp_path: Path) -> None:
    with Simulator.from_sources(of_all_nodes(tmp_path)) as plc:
        plc.run_for(5000)
        assert [n for n in range(1, EVERY_NODE + 1) if not plc.read(f"N{n}.ok")] == []
        plc.fault("N77", "absent")
        plc.run_for(3000)
        assert [n for n in range(1, EVERY_NODE + 1) if not plc.read(f"N{n}.ok")] == [77]
        plc.fault("N77", "absent", 0)
        plc.run_for(3000)
        assert plc.read("N77.ok")


WRITES, CONFIGURED = 40, 16
START_LIMIT_MS = 1500


def test_sixteen_nodes_with_forty_writes_are_in_operation_in_time(tmp_path: Path) -> None:
    with Simulator.from_sources(of_many_writes(tmp_path, CONFIGURED, WRITES)) as plc:
        plc.run_for(START_LIMIT_MS)
        assert in_operation(plc, *(f"N{n}" for n in range(1, CONFIGURED + 1)))
        assert len(written(plc, 7)) > WRITES


# ---- devices that should not be there --------------------------------------------------------------------------------


def of_driver(plc: Simulator) -> list[str]:
    return [entry.text for entry in plc.log() if entry.component == "IoDrvCanopen"]


def beginnings(plc: Simulator, node: int) -> int:
    """How often the manager has begun with a node since the last call: it reads 1000h first."""
    return sum(f.id == SDO + node and f.data[:3] == b"\x40\x00\x10" for f in plc.can_receive())


def test_node_that_restarts_again_and_again_is_tried_later_each_time(plc: Simulator) -> None:
    plc.can_receive()
    begun = []
    for _ in range(6):
        count = 0
        for _ in range(10):  # it restarts 10 times in 4 s
            plc.can_send(HEARTBEAT + 9, b"\0")
            plc.run_for(400)
            count += beginnings(plc, 9)
        begun.append(count)
    assert begun[0] >= 2
    assert sum(begun[2:]) <= 4
    assert in_operation(plc, "Second", "Third")
    plc.run_for(10_000)
    assert in_operation(plc)
    plc.run_for(11_000)  # a steady run
    plc.can_send(HEARTBEAT + 9, b"\0")
    plc.run_for(BOOT_MS)
    assert in_operation(plc)


def test_two_nodes_with_one_number_are_not_started(plc: Simulator) -> None:
    """Each boot-up comes from both."""
    plc.can_send(HEARTBEAT + 9, b"\0")
    begun = 0
    for _ in range(4000):
        plc.run_for(5)
        frames = plc.can_receive()
        begun += sum(f.id == NMT and f.data == b"\x01\x09" for f in frames)
        if any(f.id == HEARTBEAT + 9 and f.data == b"\0" for f in frames):
            plc.run_for(20)
            plc.can_receive()
            plc.can_send(HEARTBEAT + 9, b"\0")
    assert begun <= 1
    assert not plc.read("Valves.ok")
    assert in_operation(plc, "Second", "Third")
    plc.run_for(20_000)
    assert in_operation(plc)  # the other one is away


def test_heartbeats_of_two_nodes_with_one_number_are_noticed(plc: Simulator) -> None:
    for _ in range(12):
        plc.can_send(HEARTBEAT + 9, b"\5")
        plc.run_for(200)
    assert "Valves is lost: two devices have its number" in of_manager(plc)
    assert in_operation(plc, "Second", "Third")


def test_second_master_is_named_once_a_minute_and_nodes_run_on(plc: Simulator) -> None:
    for _ in range(20):
        plc.can_send(NMT, b"\x01\x00")
        plc.run_for(50)
    assert of_driver(plc) == ["Bus: another NMT master sends commands"]
    assert in_operation(plc)
    plc.can_send(NMT, b"\x02\x00")
    plc.run_for(2000)
    assert in_operation(plc)  # what it has stopped is started again


def test_device_with_our_number_is_named(plc: Simulator) -> None:
    plc.can_send(HEARTBEAT + 127, b"\5")
    plc.run_for(50)
    assert of_driver(plc) == ["Bus: another device has number 127, as we"]
    assert in_operation(plc)


# ---- TIME ------------------------------------------------------------------------------------------------------------


def test_time_of_the_wall_clock_is_sent(tmp_path: Path) -> None:
    with Simulator.from_sources(write_program(tmp_path, line='time = "T#1s"')) as plc:
        plc.run_for(500)
        plc.can_receive()
        plc.run_for(3000)
        frames = [f.data for f in plc.can_receive() if f.id == 0x100]
        assert [len(data) for data in frames] == [6, 6, 6]
        parts = [(int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")) for data in frames]
        times = [ms + 86_400_000 * days for ms, days in parts]
        assert [b - a for a, b in pairwise(times)] == [1000, 1000]
        days = datetime.date(1984, 1, 1) + datetime.timedelta(days=times[0] // 86_400_000)
        assert datetime.date(2000, 1, 1) <= days < datetime.date(2002, 1, 1)  # where clocks of simulators begin
