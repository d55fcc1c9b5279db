"""The keys of a Modbus line and its devices that say how long to wait: timeout, pause, retries, ask_again."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, configuration, messages

from plctool.core import lib

PROGRAM = "PROGRAM Main\nVAR a, b : INT; END_VAR\nEND_PROGRAM\n"
LINE = """\
[[modbus.rs485]]
port = "/dev/ttyS1"
{line}
[[modbus.rs485.device]]
name = "Own"
unit = 3
{own}
read = {{ function = 3, address = 40001, every = "T#100ms", var = "Main.a" }}
[[modbus.rs485.device]]
name = "Other"
unit = {unit}
write = {{ function = 6, address = 40001, every = "T#100ms", var = "Main.b" }}
"""
OF_LINE = 'timeout = "T#300ms"\npause = "T#20ms"\nretries = 4\nask_again = "T#30s"'
OF_DEVICE = 'timeout = "T#700ms"\npause = "T#0ms"\nretries = 0\nask_again = "T#200ms"'
PARAMETERS = {
    "timeout": int(lib.MODBUS_PARAM_TIMEOUT),
    "pause": int(lib.MODBUS_PARAM_PAUSE),
    "retries": int(lib.MODBUS_PARAM_RETRIES),
    "ask_again": int(lib.MODBUS_PARAM_ASK_AGAIN),
}


def patience(folder: Path, line: str = "", own: str = "", unit: int = 4) -> list[dict[str, int]]:
    """What both devices have been given, by the names of the keys."""
    made = configuration(build(folder, PROGRAM, LINE.format(line=line, own=own, unit=unit)))
    values = [{p.id: int.from_bytes(p.value, "little") for p in c.parameters} for c in made.connectors[1:]]
    return [{key: of[number] for key, number in PARAMETERS.items() if number in of} for of in values]


def test_devices_have_the_keys_of_their_line_unless_they_have_their_own(tmp_path: Path) -> None:
    assert patience(tmp_path) == [{"timeout": 1000}, {"timeout": 1000}]
    of_line = {"timeout": 300, "pause": 20, "retries": 4, "ask_again": 30_000}
    assert patience(tmp_path, OF_LINE) == [of_line, of_line]
    assert patience(tmp_path, OF_LINE, OF_DEVICE) == [{"timeout": 700, "retries": 0, "ask_again": 200}, of_line]


def test_all_devices_at_once_have_the_pause_of_their_line_but_not_its_time_out(tmp_path: Path) -> None:
    _, to_all = patience(tmp_path, OF_LINE, unit=0)
    assert to_all == {"timeout": 100, "pause": 20, "retries": 4, "ask_again": 30_000}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('pause = "T#2m"', "pause is T#2m; it can be T#0ms to T#60s"),
        ("pause = 20", 'pause is a number; it has to be a duration: write for example pause = "T#200ms"'),
        ("retries = 11", "retries is 11; it can be 0 to 10"),
        ("retries = -1", "retries is -1; it can be 0 to 10"),
        ('ask_again = "T#10ms"', "ask_again is T#10ms; it can be T#100ms to T#3600s"),
        ('timeout = "T#0ms"', "timeout is T#0ms; it can be T#1ms to T#60s"),
    ],
)
def test_value_that_cannot_be_is_refused(tmp_path: Path, line: str, message: str) -> None:
    for text in (LINE.format(line=line, own="", unit=4), LINE.format(line="", own=line, unit=4)):
        assert any(message in m for m in messages(tmp_path, PROGRAM, text))


def test_key_in_a_request_is_refused(tmp_path: Path) -> None:
    text = LINE.format(line="", own="", unit=4).replace('every = "T#100ms"', 'every = "T#100ms", pause = "T#1ms"', 1)
    assert any("pause cannot be here: it is a key of the device" in m for m in messages(tmp_path, PROGRAM, text))


def test_a_pause_counts_in_the_load_of_a_line(tmp_path: Path) -> None:
    text = LINE.format(line='pause = "T#80ms"', own="", unit=4)
    assert any("is too slow for all that is asked on it" in m for m in messages(tmp_path, PROGRAM, text))
    text = LINE.format(line='pause = "T#10ms"', own="", unit=4)
    assert not any("is too slow" in m for m in messages(tmp_path, PROGRAM, text))


def test_a_device_that_is_asked_on_change_only_is_a_warning(tmp_path: Path) -> None:
    text = LINE.format(line="", own="", unit=4)
    message = (
        "nothing is asked of Other at intervals, so a restart of it is not seen, and its outputs stay off: add every"
    )
    only = text.replace('every = "T#100ms", var = "Main.b"', 'on_change = true, var = "Main.b"')
    assert [message in m for m in messages(tmp_path, PROGRAM, only) if "restart" in m] == [True]
    both = text.replace('every = "T#100ms", var = "Main.b"', 'on_change = true, every = "T#10s", var = "Main.b"')
    assert not any("restart" in m for m in messages(tmp_path, PROGRAM, both))
