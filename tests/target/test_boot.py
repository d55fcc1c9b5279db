"""The firmware on its own: it starts, says who it is, and stays reachable."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from environment import CONFIG, IS_RISCV, MACHINE, firmware
from programs import program
from qemu import FACTORY_OFFSET

from plctool.device import Plc
from plctool.errors import LinkError
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

MAIN_WATCHDOG_MS = 20_000  # see main.c
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}  # of processes that find what this one does
ELF_ENTRY = 24  # where an ELF file of 32 bits says its entry, and after it where its program headers are
IS_MPS2 = MACHINE.startswith("mps2")


def test_the_entry_of_the_file_is_where_the_processor_starts():
    elf = firmware(CONFIG).read_bytes()
    entry, headers = struct.unpack_from("<II", elf, ELF_ENTRY)
    offset, address = struct.unpack_from("<II", elf, headers + 4)  # of the first segment: vectors
    assert entry == (address if IS_RISCV else struct.unpack_from("<I", elf, offset + 4)[0])


@pytest.mark.parametrize("config", ["minimal", "standard", "full"])
def test_every_configuration_answers_the_name_service(make_board, config):
    board = make_board(config)
    board.power_on()
    with Connection(board.line()) as connection:
        (node,) = connection.scan(60, enough=1)
    assert node.device_name.startswith(
        {"virt": "QEMU virt", "lm3s6965evb": "LM3S6965", "netduinoplus2": "STM32F405"}.get(MACHINE, "MPS2 AN")
    )


def test_a_fresh_board_has_no_application(plc):
    assert plc.status().state is AppState.NONE


@pytest.mark.skipif(not IS_MPS2, reason="the factory writes it elsewhere")
def test_serial_number_is_what_the_factory_wrote(make_board):
    board = make_board()
    board.write_flash(FACTORY_OFFSET, b"SN-4711\0")
    with board, Plc(Connection(board.line())) as plc:
        assert plc.identity().serial_number == "SN-4711"


@pytest.mark.skipif(MACHINE != "lm3s6965evb", reason="a board without Ethernet")
def test_serial_number_is_the_ethernet_address(plc):
    assert plc.identity().serial_number == "525400123456"  # QEMU's default


def test_first_start_is_logged_as_power_on(plc):
    assert "Reset: power on" in [entry.text for entry in plc.log()]


def test_reset_is_logged_as_such(board):
    with Plc(Connection(board.line())) as plc:
        plc.status()
    board.reset()
    with Plc(Connection(board.line())) as plc:
        assert "Reset: reset pin" in [entry.text for entry in plc.log()]


def test_noise_on_the_line_is_ignored(board):
    line = board.line()
    line.send_raw(bytes(range(256)) * 20)
    with Plc(Connection(line)) as plc:
        assert plc.status().state is AppState.NONE


def test_large_messages_arrive_whole(board):
    from plctool.link.services import echo
    from plctool.link.session import Session

    with Connection(board.line()) as connection:
        session = Session(connection)
        data = bytes(i * 7 % 251 for i in range(700))
        for _ in range(5):
            assert echo(session, data) == data


def test_main_loop_kicks_the_hardware_watchdog(make_board, build):
    board = make_board()
    board.power_on("exact")
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(program("VAR n : DINT; END_VAR", "n := n + 1;", "T#20ms")).path)
        eventually(lambda: plc.read("Main.n") * 20 > MAIN_WATCHDOG_MS + 5_000)
        assert [entry.text for entry in plc.log() if "Reset" in entry.text] == ["Reset: power on"]


PROVEN_MS = 4000  # a program that ran so long is not given up for a crash
LOOP_FOREVER, RETURN = (b"\x01\xa0", b"\x82\x80") if IS_RISCV else (b"\xfe\xe7", b"\x70\x47")


@pytest.mark.skipif(MACHINE == "lm3s6965evb", reason="QEMU does not load its flash again at a reset: it would hang")
@pytest.mark.parametrize(
    ("function", "code"),
    [
        ("CmpScheduleTimer_Hook", LOOP_FOREVER),  # the main loop hangs, tasks go on
        ("ClockInterrupt" if IS_RISCV else "SysTickHandler", RETURN),  # time stands still
        ("TasksInterrupt" if IS_RISCV else "TimerIrq", RETURN),  # no task is called
    ],
    ids=["main loop", "clock", "tasks"],
)
def test_what_hangs_ends_in_a_reset_by_the_watchdog_that_plctool_tells_of(make_board, build, function, code):
    board = make_board()
    board.power_on("slow")
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(program("VAR n : DINT; END_VAR", "n := n + 1;", "T#20ms")).path)
        eventually(lambda: plc.read("Main.n") * 20 > PROVEN_MS)
    board.patch(function, code)
    eventually(lambda: any("hardware watchdog" in text for text in log_of(board)))
    log = [text for text in types_log(board.port) if "hardware watchdog" in text]
    assert log[0].startswith("Reset: hardware watchdog at 0x")
    with Plc(Connection(board.line())) as plc:
        eventually(lambda: plc.read("Main.n") > 10)
        assert plc.status().state is AppState.RUN


def log_of(board) -> list[str]:
    """Asked for as often as possible, at all times between two ticks; nothing while the device does not answer."""
    with suppress(LinkError), Plc(Connection(board.line())) as plc:
        return [entry.text for entry in plc.log()]
    return []


def types_log(port: str) -> list[str]:
    """What `plctool log` prints; nothing while the device does not answer."""
    command = [sys.executable, "-m", "plctool", "log", "--port", port, "--json"]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    return [entry["text"] for entry in json.loads(done.stdout)["entries"]] if done.returncode == 0 else []


def process_status(pid: int) -> list[str]:
    """The fields of /proc/PID/stat after the name."""
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()


def has_ended(pid: int) -> bool:
    try:
        return process_status(pid)[0] in "ZX"
    except OSError:
        return True


def test_the_board_goes_off_with_a_test_that_is_killed(tmp_path):
    code = f"""
import sys, time
sys.path.append({str(Path(__file__).parent)!r})
from pathlib import Path
from environment import MACHINE, firmware
from qemu import Board
with Board(MACHINE, firmware("standard"), Path(sys.argv[1])) as board:
    print(board.pid, flush=True)
    time.sleep(60)
"""
    command = [sys.executable, "-c", code, str(tmp_path)]
    with subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True) as test:
        assert test.stdout
        pid = int(test.stdout.readline())
        assert not has_ended(pid)
        test.kill()
    eventually(lambda: has_ended(pid))


def processor_time(board) -> float:
    """Seconds that QEMU has used of the host's processors."""
    fields = process_status(board.pid)
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_processor_sleeps_while_there_is_nothing_to_do(board):
    with Plc(Connection(board.line())) as plc:
        plc.status()
    begin, before = time.monotonic(), processor_time(board)
    time.sleep(1.0)
    assert processor_time(board) - before < 0.5 * (time.monotonic() - begin)
