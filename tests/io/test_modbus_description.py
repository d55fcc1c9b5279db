"""What [modbus] of a description becomes, and every mistake in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, configuration, messages

from plctool.cli.main import main
from plctool.core import ffi, lib
from plctool.io.configuration import ChannelEntry, ConnectorEntry
from plctool.io.modbus import wire_address

PROGRAM = """\
PROGRAM Main
VAR
    on, off : BOOL; small : BYTE; word_1, word_2 : WORD; real_1, real_2 : REAL; long : LREAL; text : STRING(9);
    words : ARRAY[0..9] OF INT; reals : ARRAY[0..3] OF REAL; bools : ARRAY[0..3] OF BOOL; pair : PAIR;
END_VAR
on := off;
END_PROGRAM
TYPE PAIR : STRUCT a : INT; b : REAL; END_STRUCT; END_TYPE
"""

DEVICE = """\
[[modbus.rs485]]
port = "/dev/ttyS1"
baud = 9600
[[modbus.rs485.device]]
name = "Meter"
unit = 3
order = "{order}"
[[modbus.rs485.device.read]]
function = {function}
address = {address}
every = "T#100ms"
vars = [{names}]
"""


def device(names: str, order: str = "ABCD", function: int = 3, address: int = 40001) -> str:
    """A device with one read of some variables of Main."""
    listed = ", ".join(f'"Main.{n}"' for n in names.split())
    return DEVICE.format(names=listed, order=order, function=function, address=address)


def structure(connector: ConnectorEntry, kind: str, number: int) -> object:
    """The value of a parameter that is a structure."""
    (value,) = (p.value for p in connector.parameters if p.id == number)
    made = ffi.new(f"{kind} *")
    ffi.buffer(made)[:] = value
    return made


def read_job(folder: Path, text: str) -> tuple[object, list[ChannelEntry]]:
    """The one job of a description, and its channels in order."""
    made = configuration(build(folder, PROGRAM, text))
    channels = [c for t in made.task_maps for m in t.connectors for c in m.channels]
    return structure(made.connectors[1], "MODBUS_JOB", int(lib.MODBUS_PARAM_JOB)), channels


# How bytes ABCD.. of numbers lie in the driver's memory for each order, and which channels are turned round.
ORDERS = [
    ("word_1 words", "ABCD", 11, 2, [False, False]),
    ("real_1 reals", "ABCD", 10, 4, [False, False]),
    ("long", "ABCD", 4, 8, [False]),
    ("word_1 real_1 long", "ABCD", 7, 1, [True, True, True]),
    ("word_1 text", "ABCD", 6, 1, [True, False]),
    ("text", "ABCD", 5, 1, [False]),
    ("word_1 real_1 long reals", "CDAB", 15, 2, [False, False, False, False]),
    ("word_1 real_1 reals text", "DCBA", 16, 1, [False, False, False, False]),
    ("word_1 real_1", "BADC", 3, 2, [True, True]),
    ("word_1 words", "BADC", 11, 1, [False, False]),
]


@pytest.mark.parametrize(("names", "order", "count", "reverse", "turned"), ORDERS)
def test_order_of_bytes(tmp_path: Path, names: str, order: str, count: int, reverse: int, turned: list[bool]) -> None:
    job, channels = read_job(tmp_path, device(names, order))
    assert job.read_count == count
    assert max(1, job.flags >> lib.MODBUS_JOB_REVERSE_SHIFT & 14) == reverse
    assert [bool(c.flags & lib.IO_CHANNEL_BIG_ENDIAN) for c in channels] == turned


WIRE = bytes([0x3F, 0xC0, 0x12, 0x34, 0x40, 0x49, 0x0F, 0xDB])


@pytest.mark.parametrize("order", ["ABCD", "CDAB", "BADC", "DCBA"])
def test_numbers_are_those_on_the_wire(tmp_path: Path, order: str) -> None:
    """What the driver and the manager do to the bytes of a DWORD, step by step."""
    permutation = {"ABCD": [0, 1, 2, 3], "CDAB": [2, 3, 0, 1], "BADC": [1, 0, 3, 2], "DCBA": [3, 2, 1, 0]}[order]
    number = bytes([0xA, 0xB, 0xC, 0xD])
    wire = bytes(number[permutation.index(i)] for i in range(4))
    wire = bytes(number[i] for i in permutation)
    for names in ("real_1", "word_1 real_1"):
        job, channels = read_job(tmp_path, device(names, order))
        reverse = max(1, job.flags >> lib.MODBUS_JOB_REVERSE_SHIFT & 14)
        all_bytes = bytes(2 * job.read_count - 4) + wire
        memory = bytes(all_bytes[i ^ (reverse - 1)] for i in range(len(all_bytes)))
        at = channels[-1].parameter_bit // 8
        found = memory[at : at + 4]
        found = found[::-1] if channels[-1].flags & lib.IO_CHANNEL_BIG_ENDIAN else found
        assert found == number[::-1]  # little-endian, as the CPU has it


def test_bool_and_byte_take_a_register_each(tmp_path: Path) -> None:
    job, channels = read_job(tmp_path, device("on small word_1 off"))
    assert job.read_count == 4
    assert [c.parameter_bit for c in channels] == [0, 16, 32, 48]


def test_coils_are_bits_one_after_the_other(tmp_path: Path) -> None:
    job, channels = read_job(tmp_path, device("word_1 small on off", function=1, address=17))
    assert (job.read_address, job.read_count) == (16, 26)
    assert [(c.parameter_bit, c.bits) for c in channels] == [(0, 16), (16, 8), (24, 1), (25, 1)]


def test_write_has_the_bits_that_it_writes(tmp_path: Path) -> None:
    text = device("word_2") + "[[modbus.rs485.device.write]]\nfunction = 22\naddress = 40005\non_change = true\n"
    made = configuration(build(tmp_path, PROGRAM, text + 'verify = true\nvar = "Main.small"\n'))
    job = structure(made.connectors[1], "MODBUS_JOB", int(lib.MODBUS_PARAM_JOB) + 1)
    assert (job.function, job.write_address, job.write_count, job.mask, job.interval_ms) == (22, 4, 1, 0xFF, 0)
    assert job.flags & 0xF == lib.MODBUS_JOB_ON_CHANGE | lib.MODBUS_JOB_VERIFY


SERVER = """\
[modbus.server.tcp]
as_bits = {bits}
holding = {{ {holding} }}
input = {{ {input} }}
coils = {{ {coils} }}
"""


def server(holding: str = "", input: str = "", coils: str = "", bits: str = "false") -> str:
    """A server with some objects."""
    return SERVER.format(holding=holding, input=input, coils=coils, bits=bits)


def test_server_has_a_range_for_each_object(tmp_path: Path) -> None:
    text = server('40001 = "Main.word_1", 40002 = "Main.reals"', '30001 = "Main.real_2"', '200 = "Main.on"', "true")
    made = configuration(build(tmp_path, PROGRAM, text))
    ranges = [structure(made.connectors[0], "MODBUS_RANGE", int(lib.MODBUS_PARAM_RANGE) + i) for i in range(3)]
    found = [(r.tables, r.flags, r.first_register, r.first_bit, r.reverse, r.bits) for r in ranges]
    registers, outputs = int(lib.MODBUS_HOLDING_REGISTERS), int(lib.MODBUS_INPUT_REGISTERS)
    coils, discrete = int(lib.MODBUS_COILS), int(lib.MODBUS_DISCRETE_INPUTS)
    number = int(lib.MODBUS_RANGE_NUMBER_SHIFT)
    assert found == [
        (registers | coils, 1, 0, 0, 2, 16),
        (registers | coils, 1 | 1 << number, 1, 16, 4, 128),
        (outputs | discrete, 1 << number, 0, 0, 4, 32),
    ]


def test_numbers_of_several_registers_are_written_as_a_whole_but_words_of_bits_are_not(tmp_path: Path) -> None:
    program = """PROGRAM Main
VAR
    a : INT; b : REAL; c : DWORD; d : ARRAY[0..1] OF LREAL; e : TIME; f : STRING(3); g : ARRAY[0..1] OF DWORD;
END_VAR
END_PROGRAM
"""
    at = {"a": 40001, "b": 40002, "c": 40004, "d": 40006, "e": 40014, "f": 40016, "g": 40018}
    text = server(", ".join(f'{n} = "Main.{v}"' for v, n in at.items()))
    made = configuration(build(tmp_path, program, text))
    numbers = range(int(lib.MODBUS_PARAM_RANGE), int(lib.MODBUS_PARAM_RANGE) + len(at))
    ranges = [structure(made.connectors[0], "MODBUS_RANGE", n) for n in numbers]
    others = [r.flags >> lib.MODBUS_RANGE_NUMBER_SHIFT for r in ranges]
    assert dict(zip(at, others, strict=True)) == {"a": 0, "b": 1, "c": 0, "d": 3, "e": 1, "f": 0, "g": 0}


def test_bits_of_one_register_are_one_range(tmp_path: Path) -> None:
    made = configuration(build(tmp_path, PROGRAM, server('"40001.0" = "Main.on", "40001.9" = "Main.off"')))
    assert sum(p.id >= lib.MODBUS_PARAM_RANGE for p in made.connectors[0].parameters) == 1
    channels = [c for t in made.task_maps for m in t.connectors for c in m.channels]
    assert [(c.parameter, c.parameter_bit) for c in channels] == [(int(lib.MODBUS_PARAM_RANGE), b) for b in (0, 9)]


def test_references_are_those_of_the_field() -> None:
    coils, discrete = int(lib.MODBUS_COILS), int(lib.MODBUS_DISCRETE_INPUTS)
    inputs, holding = int(lib.MODBUS_INPUT_REGISTERS), int(lib.MODBUS_HOLDING_REGISTERS)
    assert [wire_address(n, coils) for n in (1, 9999, 65536, 0, 65537)] == [0, 9998, 65535, None, None]
    assert [wire_address(n, discrete) for n in (10001, 100001, 1, 20001)] == [0, 0, None, None]
    assert [wire_address(n, inputs) for n in (30001, 39999, 300001, 365536, 40001)] == [0, 9998, 0, 65535, None]
    assert [wire_address(n, holding) for n in (40001, 49999, 400001, 465536, 50000)] == [0, 9998, 0, 65535, None]


def test_load_of_a_line_is_known(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, device("word_1"))
    load = built.symbols.io["devices"][0]["load"]
    # 8 and 7 characters of 11 bits, two silences of 3.5, and 5 ms for the device, every 100 ms
    assert load == pytest.approx((15 + 7) * 11 / 9600 / 0.1 + 0.05, rel=0.01)


def test_line_that_is_too_slow_is_warned_of(tmp_path: Path) -> None:
    text = device("words").replace('"T#100ms"', '"T#20ms"')
    assert any("too slow" in m for m in messages(tmp_path, PROGRAM, text))


def test_device_that_is_not_enabled_takes_no_time_of_its_line(tmp_path: Path) -> None:
    spare = "".join(device("words").replace("Meter", "Spare").replace("100ms", "1ms").splitlines(True)[3:])
    spare = spare.replace("unit = 3", "unit = 4\nenabled = false")
    alone, both = (build(tmp_path, PROGRAM, device("word_1") + more) for more in ("", spare))
    assert not any("too slow" in w.message for w in both.warnings)
    assert both.symbols.io["devices"][0]["load"] == alone.symbols.io["devices"][0]["load"]
    ages = [c["age_us"] for c in both.symbols.io["channels"]]
    assert ages == [alone.symbols.io["channels"][0]["age_us"], None]


def test_line_that_is_not_enabled_has_no_load_and_no_device_that_is(tmp_path: Path) -> None:
    text = device("words").replace('"T#100ms"', '"T#20ms"').replace("baud", "enabled = false\nbaud")
    built = build(tmp_path, PROGRAM, text)
    assert not any("too slow" in w.message for w in built.warnings)
    assert [(d["load"], d["enabled"]) for d in built.symbols.io["devices"]] == [(None, False), (None, False)]
    assert [c["age_us"] for c in built.symbols.io["channels"]] == [None]


BOTH = """\
[[modbus.tcp]]
host = "127.0.0.1"
[[modbus.tcp.device]]
name = "Drive"
{order}
[[modbus.tcp.device.read_write]]
every = "T#100ms"
[modbus.tcp.device.read_write.read]
address = 40001
vars = ["Main.{read}"]
[modbus.tcp.device.read_write.write]
address = 40011
vars = ["Main.{write}"]
"""


def test_one_job_reads_and_writes(tmp_path: Path) -> None:
    job, channels = read_job(tmp_path, BOTH.format(order='order = "CDAB"', read="words", write="real_1"))
    assert (job.function, job.read_address, job.read_count) == (23, 0, 10)
    assert (job.write_address, job.write_count) == (10, 2)
    assert sorted((c.parameter_bit, c.bits) for c in channels) == [(0, 32), (0, 160)]


def writes(when: str, name: str, function: int = 16, address: int = 40001) -> str:
    """A device to which a variable is written."""
    head, _, _ = device("word_1").partition("[[modbus.rs485.device.read]]")
    return f"""{head}[[modbus.rs485.device.write]]
function = {function}
address = {address}
{when}
var = "Main.{name}"
"""


MISTAKES = [
    (BOTH.format(order="unit = 3", read="on", write="bools"), "Main.bools"),
    (BOTH.format(order="", read="reals", write="word_1"), "Main.reals is ARRAY[0..3] OF REAL: with this order"),
    (BOTH.format(order="", read="word_1", write="word_2").replace("40011", "11"), "11 is not the address of holding"),
    (
        BOTH.format(order="", read="word_1", write="word_2").split("[modbus.tcp.device.read_write.write]")[0],
        "reads and writes: add a table [modbus.tcp.device.read_write.write]",
    ),
    (
        BOTH.format(order="", read="word_1", write="word_2").replace("every", "function = 3\nevery"),
        "function 3 cannot be here: to read and write at a time there are 23",
    ),
    (device("word_1", address=30001), "10: 30001 is not the address of holding registers: they are 40001 to 49999"),
    (device("word_1", function=7), "9: function 7 cannot be here: to read there are 1, 2, 3, 4"),
    (device("bools"), "Main.bools"),
    (device("pair"), "Main.pair is PAIR, which registers cannot have"),
    (device("word_1 real_1 reals"), "Main.reals is ARRAY[0..3] OF REAL: with this order of bytes it needs a table"),
    (device("reals", "BADC"), "which cannot have this order of bytes: name its elements"),
    (device("on word_1", function=1, address=1), "Main.word_1 would begin within a byte"),
    (device("word_1", "ACDB"), "order cannot be 'ACDB'"),
    (device("word_1").replace("9600", "9601"), "9601 is not a speed of serial lines"),
    (device("word_1").replace("unit = 3", "unit = 300"), "unit is 300; it can be 0 to 247"),
    (device("word_1").replace("unit = 3", "unit = 0"), "unit 0 is all devices of the line"),
    (
        device("word_1")
        .replace("unit = 3", "unit = 0")
        .replace("device.read]]\nfunction = 3", "device.write]]\nfunction = 16\nverify = true"),
        "unit 0 is all devices of the line",
    ),
    (device("word_1").replace("address = 40001", "address = 40001\nwire = 0"), "write address or wire, not both"),
    (device("word_1").replace("address = 40001", "address = 0"), "they are 40001 to 49999, and wire = 0 is the first"),
    (device("word_1").replace("address = 40001\n", ""), "needs address: write for example address = 40001"),
    (server('40001 = "Main.real_1", 40002 = "Main.word_1"'), "are at the same addresses of the holding registers"),
    (server('30001 = "Main.word_1"'), "30001 is not the address of holding registers"),
    (server('"40001.3" = "Main.word_1"'), "a bit of a register is for a BOOL"),
    (server('465536 = "Main.real_1"'), "goes beyond the last address"),
    (server('40001 = "Main.word_1"', coils='5 = "Main.on"', bits="true"), "are at the same addresses of the coils"),
    (
        server('"40001.0" = { var = "Main.on", read_only = true }, "40001.1" = "Main.off"'),
        "40001.1 can be written, 40001.0 in line 3 is read_only: the bits of one register are all the same",
    ),
    (
        server('"40001.1" = "Main.off", "40001.0" = { var = "Main.on", read_only = true }'),
        "40001.0 is read_only, 40001.1 in line 3 can be written: the bits of one register are all the same",
    ),
    (server('"\u0664000\u0661" = "Main.word_1"'), "is not the address of holding registers"),
    (server('"40001.3" = "Main.on", "40001.03" = "Main.off"'), "40001.03 is the bit 40001.3 in line 3"),
    (server('"40001.3" = "Main.on", "400001.3" = "Main.off"'), "400001.3 is the bit 40001.3 in line 3"),
    (server('40001.3 = "Main.on", 40001.4 = "Main.off"'), 'a bit of a register is written in quotes: "40001.3"'),
    ('[modbus.server.tcp]\naddress = "plc"', "'plc' is not an IPv4 address: write for example"),
    ('[[modbus.tcp]]\nhost = ""', "'' is not an address or a name: a name has at most 253 letters"),
    ('[[modbus.tcp]]\nhost = "10.0.0.1:503"', 'is not an address or a name: write host = "10.0.0.1" and port = 503'),
    ('[[modbus.tcp]]\nhost = "[fd00::7]:503"', 'write host = "fd00::7" and port = 503'),
    ('[[modbus.tcp]]\nhost = "tcp://meter.plant/"', 'write host = "meter.plant"'),
    ('[[modbus.tcp]]\nhost = "10.0.0.256"', "an IPv4 address is four numbers of 0 to 255"),
    ('[[modbus.tcp]]\nhost = "10.1"', "an IPv4 address is four numbers of 0 to 255"),
    ('[[modbus.tcp]]\nhost = "0x7f000001"', "an IPv4 address is four numbers of 0 to 255"),
    ('[[modbus.tcp]]\nhost = "fd00::1::2"', 'an IPv6 address is written as "fd00::7"'),
    ('[[modbus.tcp]]\nhost = "[fd00::1"', 'an IPv6 address is written as "fd00::7"'),
    ('[[modbus.tcp]]\nhost = "fe80::1%"', 'an IPv6 address is written as "fd00::7"'),
    ('[[modbus.tcp]]\nhost = "z\u00e4hler.plant"', 'write "xn--zhler-gra.plant"'),
    ('[[modbus.tcp]]\nhost = "meter_7"', "no hyphen beside a dot: write for example"),
    ('[[modbus.tcp]]\nhost = "-meter"', "no hyphen beside a dot"),
    ('[[modbus.tcp]]\nhost = "meter..plant"', "63 between two dots"),
    ('[[modbus.tcp]]\nhost = " meter"', "letters, digits, hyphens and dots"),
    (f'[[modbus.tcp]]\nhost = "{"a" * 64}.plant"', "63 between two dots"),
    (f'[[modbus.tcp]]\nhost = "{"a." * 126}ab"', "at most 253 letters"),
    ('[modbus.server.tcp]\naddress = "::1"', "'::1' is not an IPv4 address"),
    (server('"40001.16" = "Main.on"'), "3: 40001.16: the bits of a register are 0 to 15"),
    (device("word_1", address=-1), "10: -1 is not the address of holding registers: they are 40001 to 49999"),
    (device("word_1").replace("9600", '"9600"'), "baud is a text in quotes; it has to be a number: write baud = 9600"),
    (
        device("word_1").replace("unit = 3", "unit = 3\ntimeout = 200"),
        '7: timeout is a number; it has to be a duration: write for example timeout = "T#200ms"',
    ),
    (f"{device('word_1')}\nvar = 'Main.word_2'", "write var or vars, not both"),
    (f"{device('word_1')}\norder = 'CDAB'", "order cannot be here: it is a key of the device"),
    (f"{device('word_1')}\nverify = true", "verify cannot be here: only what is written has it"),
    (writes("", "word_1"), 'device.write] needs every = "T#1s" or on_change = true, or both'),
    (writes("on_change = true", "real_1", 6), "function 6 has one register at most, these are 2: use 16"),
    (writes("on_change = true", "word_1", 5, 1), "function 5 has one bit at most, these are 16: use 15"),
    (writes("on_change = true", "real_1", 22), "these are 2: it is for a variable of at most 16 bits"),
    (
        device("words").replace('"Main.words"', ", ".join(f'"%IW{n}"' for n in range(126))),
        "function 3 has 125 registers at most, these are 126: name the others in a further table",
    ),
    ("[modbus.serve.tcp]\nport = 1", "there is no 'serve' here"),
]


@pytest.mark.parametrize(("text", "message"), MISTAKES)
def test_mistake_is_reported(tmp_path: Path, text: str, message: str) -> None:
    found = messages(tmp_path, PROGRAM, text)
    assert any(message in m for m in found), found


def test_build_prints_the_load_of_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(device("word_1"))
    assert main(["build", str(tmp_path), "-o", str(tmp_path / "main.cdl")]) == 0
    assert "modbus_ttyS1 is 30% in use" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("tables", "what"),
    [
        ('[[modbus.rs485]]\nname = "A"\nport = "COM2"\n[[modbus.rs485]]\nname = "B"\nport = "COM2"\n', "the line COM2"),
        (
            '[[modbus.rs485]]\nname = "A"\nport = "COM2"\n[[modbus.server.rs485]]\nname = "B"\nport = "COM2"\n',
            "the line COM2",
        ),
        (
            '[[modbus.server.tcp]]\nname = "A"\n[[modbus.server.tcp]]\nname = "B"\nport = 502\n',
            "the TCP port 502 of 0.0.0.0",
        ),
    ],
)
def test_two_devices_cannot_have_one_line_or_port(tmp_path: Path, tables: str, what: str) -> None:
    found = messages(tmp_path, PROGRAM, tables)
    assert any(f"B cannot have {what}, which A in line 2 has" in message for message in found), found


def test_a_line_that_is_there_twice_is_one_mistake(tmp_path: Path) -> None:
    tables = '[[modbus.rs485]]\nport = "COM2"\n[[modbus.rs485]]\nport = "COM2"\n'
    message = "modbus_COM2 cannot have the line COM2, which modbus_COM2 in line 1 has: write its devices there"
    found = messages(tmp_path, PROGRAM, tables)
    assert [m for m in found if not m.startswith("main.st:")] == [f"3: {message}"]


def second_device(key: str, name: str = "Second") -> str:
    return f'{device("word_1")}[[modbus.rs485.device]]\nname = "{name}"\n{key}\n'


def test_two_devices_with_one_unit_are_a_warning(tmp_path: Path) -> None:
    found = messages(tmp_path, PROGRAM, second_device("unit = 3"))
    assert any("Second has the unit 3 of " in message and "both are one device" in message for message in found), found


def test_two_devices_with_the_unit_of_one_that_is_not_enabled_are_a_warning(tmp_path: Path) -> None:
    text = second_device("unit = 3").replace("unit = 3", "unit = 3\nenabled = false", 1)
    found = messages(tmp_path, PROGRAM, f'{text}[[modbus.rs485.device]]\nname = "Third"\nunit = 3\n')
    assert any("Third has the unit 3 of Second" in message for message in found), found


@pytest.mark.parametrize("key", ["unit = 4", 'unit = 3\norder = "CDAB"', "unit = 3\nenabled = false"])
def test_another_unit_or_order_of_bytes_is_no_warning(tmp_path: Path, key: str) -> None:
    assert not any("has the unit" in message for message in messages(tmp_path, PROGRAM, second_device(key)))


def two_writes(*jobs: tuple[int, int, str], second: str = "") -> str:
    """Writes (function, address, variable) of one device, or the last one of a `second` one."""
    head, _, _ = device("word_1").partition("[[modbus.rs485.device.read]]")
    tables = [f"[[modbus.rs485.device.write]]\nfunction = {f}\naddress = {a}\non_change = true\nvar = 'Main.{v}'\n"
              for f, a, v in jobs]  # fmt: skip
    extra = f'[[modbus.rs485.device]]\nname = "Second"\n{second}\n' if second else ""
    return head + "".join(tables[:-1]) + extra + tables[-1]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (two_writes((16, 40001, "real_1"), (6, 40002, "word_1")), "holding registers 40002 of Meter"),
        (two_writes((16, 40001, "real_1"), (16, 40001, "words")), "holding registers 40001 to 40002 of Meter"),
        (two_writes((6, 40005, "word_1"), (22, 40005, "small")), "holding registers 40005 of Meter"),
        (two_writes((15, 1, "word_1"), (5, 16, "on")), "coils 16 of Meter"),
        (two_writes((16, 410000, "real_1"), (6, 410001, "word_1"), second='unit = 3\norder = "CDAB"'),
         "holding registers 410001 of Second"),
    ],
)  # fmt: skip
def test_two_writes_of_one_register_are_a_warning(tmp_path: Path, text: str, what: str) -> None:
    found = [m for m in messages(tmp_path, PROGRAM, text) if "undoes" in m]
    assert len(found) == 1 and f"{what} are written by line 8 as well: each undoes what the other wrote" in found[0]


@pytest.mark.parametrize(
    "text",
    [
        two_writes((16, 40001, "real_1"), (6, 40003, "word_1")),
        two_writes((6, 40001, "word_1"), (5, 1, "on")),
        two_writes((6, 40001, "word_1"), (6, 40001, "word_2"), second="unit = 4"),
    ],
)
def test_writes_of_other_registers_are_no_warning(tmp_path: Path, text: str) -> None:
    assert not any("undoes" in m for m in messages(tmp_path, PROGRAM, text))


@pytest.mark.parametrize("key", ["optional = true", "enabled = false"])
def test_device_that_need_not_be_there_may_name_what_another_one_has(tmp_path: Path, key: str) -> None:
    tables = '[[modbus.rs485]]\nname = "A"\nport = "COM2"\n[[modbus.rs485]]\nname = "B"\nport = "COM2"\n'
    assert not any("cannot have" in message for message in messages(tmp_path, PROGRAM, f"{tables}{key}\n"))


NETWORK = """\
[[modbus.tcp]]
host = "192.168.0.5"
{line}
[[modbus.tcp.device]]
name = "Meter"
{device}
read = [ {{ function = 3, address = 40001, every = "T#100ms", var = "Main.word_1" }} ]
"""


def test_a_serial_line_in_the_network_has_a_role_of_its_own(tmp_path: Path) -> None:
    for framing, role in (("tcp", lib.MODBUS_ROLE_TCP_CLIENT), ("rtu", lib.MODBUS_ROLE_RTU_TCP_CLIENT)):
        text = NETWORK.format(line=f'framing = "{framing}"', device="unit = 3")
        line = configuration(build(tmp_path, PROGRAM, text)).connectors[0]
        assert [p.value[0] for p in line.parameters if p.id == lib.MODBUS_PARAM_ROLE] == [role]


@pytest.mark.parametrize(
    ("host", "found"),
    [
        ("meter-7.plant.example", "meter-7.plant.example"),
        ("localhost", "localhost"),
        ("7eleven.", "7eleven."),
        ("::1", "::1"),
        ("[fd00::7]", "fd00::7"),
        ("fe80::1%eth0", "fe80::1%eth0"),
        ("a" * 63 + ".b", "a" * 63 + ".b"),
    ],
)
@pytest.mark.parametrize("framing", ["tcp", "rtu"])
def test_a_host_that_is_looked_up_has_a_role_that_older_firmware_refuses(
    tmp_path: Path, host: str, found: str, framing: str
) -> None:
    text = NETWORK.format(line=f'framing = "{framing}"', device="unit = 3").replace("192.168.0.5", host)
    line = configuration(build(tmp_path, PROGRAM, text)).connectors[0]
    values = {p.id: p.value for p in line.parameters}
    roles = {"tcp": lib.MODBUS_ROLE_NAMED_TCP_CLIENT, "rtu": lib.MODBUS_ROLE_NAMED_RTU_TCP_CLIENT}
    assert values[lib.MODBUS_PARAM_ROLE][0] == roles[framing]
    assert values[lib.MODBUS_PARAM_HOST].rstrip(b"\0") == found.encode()
    assert lib.MODBUS_PARAM_ADDRESS not in values
    assert line.name == f"modbus_{found}"[: lib.IO_CONFIG_MAX_NAME - 1]


@pytest.mark.parametrize(
    ("line", "device", "message"),
    [
        ('framing = "ascii"', "unit = 3", "framing cannot be 'ascii'; it can be tcp or rtu"),
        ('framing = "rtu"', "", "[modbus.tcp.device] needs unit: write for example unit = 1"),
        ('framing = "rtu"', "unit = 255", "unit is 255; it can be 0 to 247"),
        ('framing = "rtu"', "unit = 0", "unit 0 is all devices of the line"),
    ],
)
def test_framing_and_units_that_cannot_be(tmp_path: Path, line: str, device: str, message: str) -> None:
    found = messages(tmp_path, PROGRAM, NETWORK.format(line=line, device=device))
    assert any(message in m for m in found), found


@pytest.mark.parametrize(
    ("port", "hint"),
    [
        ("socket://192.168.0.5:8899", 'with host = "192.168.0.5", port = 8899 and framing = "rtu"'),
        ("tcp://gateway/", 'with host = "gateway" and framing = "rtu"'),
        ("rfc2217://[::1]:4000", 'with host = "::1", port = 4000 and framing = "rtu"'),
        ("socket://a b:4000", 'with host = "192.168.0.7" and framing = "rtu"'),
    ],
)
def test_url_in_place_of_a_serial_line_is_refused_with_what_to_write(tmp_path: Path, port: str, hint: str) -> None:
    text = device("word_1").replace("/dev/ttyS1", port)
    found = messages(tmp_path, PROGRAM, text)
    assert any(
        f"'{port}' is not a serial line of the controller: write it as [[modbus.tcp]] {hint}" in m for m in found
    )
    server = f'[modbus.server.rs485]\nport = "{port}"\nholding = {{ 40001 = "Main.word_1" }}\n'
    found = messages(tmp_path, PROGRAM, server)
    assert any(m.endswith(f"'{port}' is not a serial line of the controller") for m in found)


def test_gaps_of_a_server_are_a_number_of_a_register(tmp_path: Path) -> None:
    text = "[modbus.server.tcp]\n{line}\nholding = {{ 40001 = 'Main.word_1' }}\n"
    for line, expected in (("gaps = 0", [0]), ("gaps = 65535", [0xFFFF]), ("", [])):
        server = configuration(build(tmp_path, PROGRAM, text.format(line=line))).connectors[0]
        found = [int.from_bytes(p.value, "little") for p in server.parameters if p.id == lib.MODBUS_PARAM_GAPS]
        assert found == expected
    for line, message in (("gaps = -1", "gaps is -1; it can be 0 to 65535"), ("gaps = true", "it has to be a number")):
        found_messages = messages(tmp_path, PROGRAM, text.format(line=line))
        assert any(message in m for m in found_messages), found_messages
