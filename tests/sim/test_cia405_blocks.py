"""The blocks of CiA 405 over the manager: C405-13 to C405-28 as far as a manager has them, on virtual time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import BLOCKS, write_program

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator
from plctool.sim_can import CanFrame

NODE, OTHER, STRANGER = 9, 10, 50
NMT, EMCY, SDO_REPLY, SDO, HEARTBEAT = 0x000, 0x080, 0x580, 0x600, 0x700
OBJECT = 0x2000
BOOT_MS = 400
NO_OBJECT, GENERAL = 0x06020000, 0x08000000
OTHER_ERROR, OVERFLOW, TIMEOUT, BUS_OFF, NO_NETWORK = 0x01, 0x02, 0x03, 0x10, 0x21
ERROR_PASSIVE = 0x11


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    return compile_sources([write_program(tmp_path_factory.mktemp("program"), source=BLOCKS)])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        simulator.run_for(BOOT_MS)
        simulator.can_receive()
        yield simulator


def give(plc: Simulator, block: str, **inputs: Any) -> None:
    plc.write({f"Main.{block}.{name}": value for name, value in inputs.items()})
    plc.run_cycles(1)


def outputs(plc: Simulator, block: str, *names: str) -> tuple[Any, ...]:
    return tuple(plc.read(f"Main.{block}.{name}") for name in names)


def finish(plc: Simulator, block: str, cycles: int = 400) -> tuple[Any, ...]:
    """CONFIRM, ERROR and, if there is one, ERRORINFO when one of the first two comes."""
    for _ in range(cycles):
        confirm, error = outputs(plc, block, "CONFIRM", "ERROR")
        if confirm or error:
            break
        plc.run_cycles(1)
    return outputs(plc, block, "CONFIRM", "ERROR")


def do(plc: Simulator, block: str, **inputs: Any) -> tuple[Any, ...]:
    """What a block says of a job that begins now; ENABLE stays TRUE."""
    give(plc, block, ENABLE=False)
    give(plc, block, **inputs, ENABLE=True)
    return finish(plc, block)


def requests(plc: Simulator, node: int = NODE) -> list[bytes]:
    return [f.data for f in plc.can_receive() if f.id == SDO + node]


def reply(plc: Simulator, node: int, text: str) -> None:
    plc.can_send(SDO_REPLY + node, bytes.fromhex(text))


@pytest.mark.parametrize(
    ("block", "data"),
    [("w4", b"\x11"), ("w4", b"\x11\x22\x33\x44"), ("w7", bytes(range(1, 8))), ("w14", bytes(range(1, 15))),
     ("w21", bytes(range(1, 22)))],
)  # fmt: skip
def test_bytes_are_written_and_read_back(plc: Simulator, block: str, data: bytes) -> None:  # C405-13, -20, -21
    size = {f"DATA[{i}]": value for i, value in enumerate(data, 1)}
    assert do(plc, block, DEVICE=NODE, INDEX=OBJECT, SUBINDEX=0, DATALENGTH=len(data), **size) == (True, 0)
    sent = requests(plc)
    if len(data) <= 4:
        assert sent == [bytes([0x23 | (4 - len(data)) << 2, 0x00, 0x20, 0]) + data.ljust(4, b"\0")]
    else:
        assert b"".join(frame[1:8] for frame in sent[1:])[: len(data)] == data
    give(plc, block, ENABLE=False)
    assert outputs(plc, block, "CONFIRM", "ERROR", "ERRORINFO") == (False, 0, 0)
    reader = block.replace("w", "r")
    assert do(plc, reader, DEVICE=NODE, INDEX=OBJECT, SUBINDEX=0) == (True, 0)
    assert plc.read(f"Main.{reader}.DATALENGTH") == len(data)
    assert bytes(plc.read(f"Main.{reader}.DATA[{i}]") for i in range(1, len(data) + 1)) == data


def test_object_that_is_too_long_gives_its_first_bytes(plc: Simulator) -> None:  # C405-20
    data = {f"DATA[{i}]": i for i in range(1, 11)}
    assert do(plc, "w14", DEVICE=NODE, INDEX=OBJECT, SUBINDEX=0, DATALENGTH=10, **data) == (True, 0)
    assert do(plc, "r4", DEVICE=NODE, INDEX=OBJECT, SUBINDEX=0) == (False, OVERFLOW)
    assert [plc.read(f"Main.r4.DATA[{i}]") for i in range(1, 5)] == [1, 2, 3, 4]
    assert plc.read("Main.r4.DATALENGTH") == 4


def test_inputs_are_those_of_the_edge(plc: Simulator) -> None:  # C405-14
    plc.fault("Valves", "late", 30)
    give(plc, "w4", DEVICE=NODE, INDEX=OBJECT, SUBINDEX=0, DATALENGTH=2, **{"DATA[1]": 7, "DATA[2]": 8}, ENABLE=True)
    assert outputs(plc, "w4", "CONFIRM", "ERROR") == (False, 0)
    give(plc, "w4", INDEX=0x2001, **{"DATA[1]": 99})
    assert finish(plc, "w4") == (True, 0)
    assert requests(plc) == [bytes.fromhex("2b00200007080000")]


def test_job_is_done_once_however_long_it_is_enabled(plc: Simulator) -> None:  # C405-15
    assert do(plc, "r4", DEVICE=NODE, INDEX=0x1000, SUBINDEX=0) == (True, 0)
    plc.run_cycles(20)
    assert len(requests(plc)) == 1
    assert outputs(plc, "r4", "CONFIRM", "DATALENGTH") == (True, 4)


def test_nothing_is_sent_without_enable(plc: Simulator) -> None:  # C405-16
    give(plc, "r4", DEVICE=NODE, INDEX=0x1000)
    plc.run_cycles(10)
    assert requests(plc) == []
    assert outputs(plc, "r4", "CONFIRM", "ERROR") == (False, 0)


def test_reply_to_a_job_that_was_given_up_is_not_that_of_the_next_one(plc: Simulator) -> None:  # C405-17
    give(plc, "r4", DEVICE=STRANGER, INDEX=OBJECT, SUBINDEX=0, ENABLE=True)
    plc.run_cycles(2)
    give(plc, "r4", ENABLE=False)
    assert outputs(plc, "r4", "CONFIRM", "ERROR") == (False, 0)
    give(plc, "r4", ENABLE=True)
    plc.run_cycles(2)
    assert requests(plc, STRANGER) == [bytes.fromhex("4000200000000000"), bytes.fromhex("8000200000000008")]
    reply(plc, STRANGER, "4b00200001000000")  # the old one, late
    plc.run_cycles(3)
    assert outputs(plc, "r4", "CONFIRM", "ERROR") == (False, 0)
    assert requests(plc, STRANGER) == [bytes.fromhex("4000200000000000")]
    reply(plc, STRANGER, "4b00200002000000")
    assert finish(plc, "r4") == (True, 0)
    assert plc.read("Main.r4.DATA[1]") == 2


def test_abort_code_of_a_node_is_told(plc: Simulator) -> None:  # C405-18
    assert do(plc, "r4", DEVICE=NODE, INDEX=0x5555, SUBINDEX=1) == (False, OTHER_ERROR)
    assert plc.read("Main.r4.ERRORINFO") == NO_OBJECT
    plc.fault("Valves", "answers", 1)
    assert do(plc, "w4", DEVICE=NODE, INDEX=OBJECT, SUBINDEX=0, DATALENGTH=1) == (False, OTHER_ERROR)
    assert plc.read("Main.w4.ERRORINFO") == GENERAL


def test_silent_node_is_a_time_out_and_blocks_nothing(plc: Simulator) -> None:  # C405-19
    before = plc.read("Main.cycles")
    assert do(plc, "r4", DEVICE=STRANGER, INDEX=0x1000, SUBINDEX=0, TIMEOUT=200) == (False, TIMEOUT)
    assert 18 <= plc.read("Main.cycles") - before <= 26
    assert plc.read("Valves.ok")
    assert do(plc, "r4", DEVICE=NODE, INDEX=0x1000, SUBINDEX=0) == (True, 0)


def test_own_object_dictionary_is_asked_without_a_frame(plc: Simulator) -> None:  # C405-22
    for device in (0, 127):
        confirm, error = do(plc, "r4", DEVICE=device, INDEX=0x1000, SUBINDEX=0)
        assert (confirm, error, plc.read("Main.r4.ERRORINFO")) == (False, OTHER_ERROR, 0x08000023)
    assert not [f for f in plc.can_receive() if f.id >= SDO_REPLY and f.id < HEARTBEAT]


def test_own_number_is_that_of_the_description(plc: Simulator) -> None:  # C405-23
    give(plc, "id", ENABLE=True)
    assert outputs(plc, "id", "CONFIRM", "DEVICE") == (True, 127)
    give(plc, "id", ENABLE=False)
    assert outputs(plc, "id", "CONFIRM") == (False,)


def state(plc: Simulator, device: int) -> str:
    give(plc, "state", ENABLE=False)
    give(plc, "state", DEVICE=device, ENABLE=True)
    assert plc.read("Main.state.CONFIRM")
    return str(plc.read("Main.state.STATE"))


def test_states_are_those_of_heartbeats(plc: Simulator) -> None:  # C405-24
    assert [state(plc, n) for n in (0, 127, NODE, STRANGER)] == ["OPERATIONAL", "OPERATIONAL", "OPERATIONAL", "UNKNOWN"]
    for command, name in (("STOP_REMOTE_NODE", "STOPPED"), ("ENTER_PRE_OPERATIONAL", "PRE_OPERATIONAL")):
        assert do(plc, "nmt", DEVICE=NODE, STATE=command) == (True, 0)
        plc.run_for(300)
        assert state(plc, NODE) == name
    assert do(plc, "nmt", DEVICE=NODE, STATE="START_REMOTE_NODE") == (True, 0)
    plc.run_for(300)
    assert state(plc, NODE) == "OPERATIONAL"
    plc.fault("Valves", "absent")
    plc.run_for(600)
    assert state(plc, NODE) == "NOT_AVAIL"


@pytest.mark.parametrize(("destroyed", "state"), [(0, 0), (20, ERROR_PASSIVE), (40, BUS_OFF)])
def test_kernel_state_follows_the_error_counters(plc: Simulator, destroyed: int, state: int) -> None:  # C405-25
    plc.fault("Bus", "cut", destroyed)
    plc.run_for(120)  # our heartbeat is among them
    give(plc, "kernel", ENABLE=True)
    assert outputs(plc, "kernel", "CONFIRM", "STATE") == (True, state)


def test_nodes_are_regained_after_bus_off(plc: Simulator) -> None:
    plc.fault("Bus", "cut", 40)
    plc.run_for(120)
    assert not plc.read("Valves.ok")
    plc.run_for(5000)
    assert plc.read("Valves.ok")
    give(plc, "kernel", ENABLE=True)
    assert outputs(plc, "kernel", "CONFIRM", "STATE") == (True, 0)


def test_bus_may_go_off_again_and_again(plc: Simulator) -> None:
    for number in range(1000):
        plc.fault("Bus", "cut", 40)
        plc.run_for(120 + number % 50 * 7)
        assert not plc.read("Valves.ok"), number
        plc.fault("Bus", "cut", 0)
        plc.run_for(5000)
        assert plc.read("Valves.ok"), number


def test_kernel_state_is_that_of_the_network(plc: Simulator) -> None:  # C405-25
    give(plc, "kernel", ENABLE=True)
    assert outputs(plc, "kernel", "CONFIRM", "STATE") == (True, 0)
    give(plc, "kernel", ENABLE=False)
    give(plc, "kernel", NETWORK=3, ENABLE=True)
    assert outputs(plc, "kernel", "CONFIRM", "STATE") == (True, NO_NETWORK)


@pytest.mark.parametrize(
    ("command", "byte"),
    [("START_REMOTE_NODE", 0x01), ("STOP_REMOTE_NODE", 0x02), ("ENTER_PRE_OPERATIONAL", 0x80), ("RESET_NODE", 0x81),
     ("RESET_COMMUNICATION", 0x82)],
)  # fmt: skip
@pytest.mark.parametrize("device", [0, NODE])
def test_commands_are_sent(plc: Simulator, command: str, byte: int, device: int) -> None:  # C405-26
    assert do(plc, "nmt", DEVICE=device, STATE=command) == (True, 0)
    assert next(f.data for f in plc.can_receive() if f.id == NMT) == bytes([byte, device])


def test_node_that_the_program_has_stopped_stays_stopped(plc: Simulator) -> None:
    assert do(plc, "nmt", DEVICE=NODE, STATE="STOP_REMOTE_NODE") == (True, 0)
    plc.run_for(5000)
    assert (state(plc, NODE), plc.read("Valves.ok")) == ("STOPPED", False)
    plc.fault("Valves", "absent")  # its power fails
    plc.run_for(1000)
    plc.fault("Valves", "absent", 0)
    plc.run_for(10_000)
    assert (state(plc, NODE), plc.read("Valves.ok")) == ("STOPPED", False)
    assert do(plc, "nmt", DEVICE=0, STATE="START_REMOTE_NODE") == (True, 0)
    plc.run_for(500)
    assert (state(plc, NODE), plc.read("Valves.ok")) == ("OPERATIONAL", True)


def test_node_that_the_program_has_reset_comes_back(plc: Simulator) -> None:
    assert do(plc, "nmt", DEVICE=NODE, STATE="RESET_NODE") == (True, 0)
    plc.run_for(1000)
    assert plc.read("Valves.ok")


def emergency(plc: Simulator, node: int, number: int = 0x8130) -> None:
    plc.can_send(EMCY + node, number.to_bytes(2, "little") + bytes([0x11, 1, 2, 3, 4, 5]))
    plc.run_for(20)


def test_emergency_is_reported_once(plc: Simulator) -> None:  # C405-27
    give(plc, "emcy", ENABLE=True)
    assert outputs(plc, "emcy", "CONFIRM", "ERROR") == (False, 0)
    emergency(plc, NODE)
    assert outputs(plc, "emcy", "CONFIRM", "ERROR", "DEVICE") == (True, 0, NODE)
    fields = ("EMCY_ERROR_CODE", "ERROR_REGISTER", *(f"ERROR_FIELD[{i}]" for i in range(1, 6)))
    assert outputs(plc, "emcy", *(f"ERRORINFO.{name}" for name in fields)) == (0x8130, 0x11, 1, 2, 3, 4, 5)
    give(plc, "emcy", ENABLE=False)
    give(plc, "emcy", ENABLE=True)
    plc.run_cycles(5)
    assert outputs(plc, "emcy", "CONFIRM", "ERROR") == (False, 0)


def test_emergency_of_another_node_is_not_taken(plc: Simulator) -> None:  # C405-28
    give(plc, "emcy_dev", DEVICE=6, ENABLE=True)
    emergency(plc, 5)
    assert outputs(plc, "emcy_dev", "CONFIRM", "ERROR") == (False, 0)
    give(plc, "emcy", ENABLE=True)
    assert outputs(plc, "emcy", "CONFIRM", "DEVICE") == (True, 5)
    emergency(plc, 6, 0x1000)
    assert outputs(plc, "emcy_dev", "CONFIRM", "ERRORINFO.EMCY_ERROR_CODE") == (True, 0x1000)


def test_lost_emergencies_are_told_once_and_the_newest_stay(plc: Simulator) -> None:
    for number in range(20):
        emergency(plc, STRANGER, 0x1000 + number)
    give(plc, "emcy", ENABLE=True)
    assert outputs(plc, "emcy", "CONFIRM", "ERROR") == (False, OVERFLOW)
    seen = []
    for _ in range(17):
        give(plc, "emcy", ENABLE=False)
        give(plc, "emcy", ENABLE=True)
        if plc.read("Main.emcy.CONFIRM"):
            seen.append(plc.read("Main.emcy.ERRORINFO.EMCY_ERROR_CODE"))
    assert seen == list(range(0x1004, 0x1014))


def test_variables_of_any_type_are_written_and_read(plc: Simulator) -> None:
    plc.write({"Main.real": 1.5, "Main.text": "press"})
    assert do(plc, "write_real", INDEX=OBJECT) == (True, 0)
    assert do(plc, "read_real", INDEX=OBJECT) == (True, 0)
    assert plc.read("Main.real2") == 1.5
    assert do(plc, "write_text", INDEX=OBJECT) == (True, 0)
    plc.write({"Main.text2": "something longer"})
    assert do(plc, "read_text", INDEX=OBJECT) == (True, 0)
    assert (plc.read("Main.text2"), plc.read("Main.read_text.DATALENGTH")) == ("press", 5)
    assert do(plc, "read_flag", INDEX=OBJECT) == (False, OVERFLOW)
    assert plc.read("Main.flag") is True


def test_length_that_data_does_not_have_is_refused(plc: Simulator) -> None:
    assert do(plc, "w4", DEVICE=NODE, INDEX=OBJECT, DATALENGTH=5) == (False, OVERFLOW)
    assert do(plc, "write_real", INDEX=OBJECT, DATALENGTH=9) == (False, OVERFLOW)
    assert do(plc, "w4", DEVICE=NODE, INDEX=OBJECT, DATALENGTH=0) == (False, OTHER_ERROR)
    assert do(plc, "r4", NETWORK=1, DEVICE=NODE, INDEX=OBJECT) == (False, NO_NETWORK)
    assert requests(plc) == []


def test_two_jobs_for_one_node_go_one_after_the_other(plc: Simulator) -> None:
    plc.write({"Main.r4.DEVICE": NODE, "Main.r4.INDEX": 0x1000, "Main.w4.DEVICE": NODE, "Main.w4.INDEX": OBJECT})
    plc.write({"Main.w4.DATALENGTH": 1, "Main.r4.ENABLE": True, "Main.w4.ENABLE": True})
    assert finish(plc, "r4") == (True, 0)
    assert finish(plc, "w4") == (True, 0)
    frames = [f for f in plc.can_receive() if f.id in (SDO + NODE, SDO_REPLY + NODE)]
    assert [f.id for f in frames] == [SDO + NODE, SDO_REPLY + NODE] * 2


def test_job_waits_while_the_manager_configures_the_node(built: BuildResult) -> None:
    with Simulator(built.image, built.symbols) as plc:
        plc.write({"Main.r4.DEVICE": NODE, "Main.r4.INDEX": 0x1000, "Main.r4.ENABLE": True})
        assert finish(plc, "r4") == (True, 0)
        plc.run_for(BOOT_MS)
        assert plc.read("Valves.ok")
        open_ = 0
        for frame in plc.can_receive():
            open_ += (frame.id == SDO + NODE) - (frame.id == SDO_REPLY + NODE)
            assert 0 <= open_ <= 1, frame


def test_stop_of_the_program_ends_its_jobs(plc: Simulator) -> None:
    give(plc, "r4", DEVICE=STRANGER, INDEX=0x1000, ENABLE=True)
    plc.run_cycles(2)
    plc.stop()
    plc.run_for(50)
    assert requests(plc, STRANGER)[-1] == bytes.fromhex("8000100000000008")
    plc.start()
    assert finish(plc, "r4") == (False, 0x23)


def test_nonsense_of_a_node_is_never_taken_for_data(plc: Simulator) -> None:
    give(plc, "r21", DEVICE=STRANGER, INDEX=OBJECT, SUBINDEX=0, ENABLE=True)
    for first in range(256):
        plc.can_send(SDO_REPLY + STRANGER, bytes([first, 0x11, 0x22, 3, 4, 5, 6, 7]))
        plc.can_send(SDO_REPLY + STRANGER, bytes([first]))
        plc.run_for(2)
    assert outputs(plc, "r21", "CONFIRM", "ERROR") == (False, 0)
    assert isinstance(plc.can_receive()[0], CanFrame)
