"""Every function of Modbus, in both roles of plcrt, on both transports, with pymodbus, libmodbus and mbpoll as the
other end: values, the largest request, one more than that, and exceptions."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from free_ports import free_port
from modbus_clients import CLIENTS, Client, Place, Refused
from modbus_servers import SERVERS, TABLE_OF, TRAP, WORDS, PymodbusServer, Server, first_words
from modbus_support import Wire

import plctool
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.iec.types import UDINT
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

# ---- the matrix ------------------------------------------------------------------------------------------------------

FUNCTIONS = (1, 2, 3, 4, 5, 6, 8, 15, 16, 17, 22, 23, 43)
TRANSPORTS = ("tcp", "rtu")
COUNTERPARTS = ("pymodbus", "libmodbus", "mbpoll")
# What plcrt asks as a client, by the description, by MODBUS_READ and MODBUS_WRITE, and by `plctool io scan`.
ROLES = {
    "server": FUNCTIONS,
    "description": (1, 2, 3, 4, 5, 6, 15, 16, 22, 23),
    "block": (1, 2, 3, 4, 5, 6, 15, 16),
    "scan": (17, 43),
}


@dataclass(frozen=True)
class LeftOut:
    """Cells that a counterpart cannot have."""

    roles: tuple[str, ...]
    counterpart: str
    functions: tuple[int, ...]
    transports: tuple[str, ...]
    why: str


CLIENT_ROLES = ("description", "block", "scan")
LEFT_OUT = (
    LeftOut(("server",), "libmodbus", (8, 43), TRANSPORTS, "has no such request"),
    LeftOut(("server",), "mbpoll", (8, 22, 23, 43), TRANSPORTS, "has no such request"),
    LeftOut(("server",), "mbpoll", (17,), ("tcp",), "asks it on serial lines only"),
    LeftOut(CLIENT_ROLES, "mbpoll", FUNCTIONS, TRANSPORTS, "is no server"),
    LeftOut(("scan",), "libmodbus", (43,), TRANSPORTS, "does not know it"),
    LeftOut(("scan",), "libmodbus", (17,), ("rtu",), "has no reply to 43/14, which comes first"),
)


def is_left_out(role: str, function: int, transport: str, counterpart: str) -> bool:
    return any(
        role in cells.roles
        and counterpart == cells.counterpart
        and function in cells.functions
        and transport in cells.transports
        for cells in LEFT_OUT
    )


def cells(role: str) -> pytest.MarkDecorator:
    """Parameters `function`, `transport` and `counterpart`: all that there are of a role."""
    every = itertools.product(ROLES[role], TRANSPORTS, COUNTERPARTS)
    names = ("function", "transport", "counterpart")
    return pytest.mark.parametrize(names, [cell for cell in every if not is_left_out(role, *cell)])


def test_the_matrix_has_every_function_of_the_documentation() -> None:
    text = (Path(__file__).parents[2] / "docs" / "modbus.md").read_text()
    table = text.partition("| function | limit of a request |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([\d, /]+) ", table, re.MULTILINE)
    named = {int(code) for row in rows if row.strip() != "43/128" for code in re.findall(r"\d+", row.partition("/")[0])}
    assert named == set(FUNCTIONS)


# ---- plcrt as a server -----------------------------------------------------------------------------------------------

SERVER_BAUD = 9600
UNIT = 7
READ_ONLY = 200  # address on the wire of registers that are outputs
SERVER_PROGRAM = """
PROGRAM Main
VAR
    tcp_words, rtu_words : ARRAY[0..124] OF WORD; (* others write *)
    tcp_held, rtu_held, tcp_inputs, rtu_inputs : ARRAY[0..124] OF WORD;
END_VAR
VAR i : UINT; END_VAR
FOR i := 0 TO 124 DO
    tcp_held[i] := rtu_held[i] := UINT_TO_WORD(i * 263 + 21);
    tcp_inputs[i] := rtu_inputs[i] := UINT_TO_WORD(i * 523 + 34);
END_FOR
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
    TASK T(INTERVAL := T#2ms, PRIORITY := 1);
    PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""
SERVER_DESCRIPTION = """
as_bits = true
identification = {{ vendor = "Acme", product = "Tanks", version = "1.2", product_name = "Tanks" }}
holding = {{ 40001 = "Main.{0}_words", 40201 = {{ var = "Main.{0}_held", read_only = true }} }}
input = {{ 30001 = "Main.{0}_inputs" }}
"""
HELD = [i * 263 + 21 for i in range(125)]
INPUTS = [i * 523 + 34 for i in range(125)]
MOST_OF_MBPOLL = 125  # values
MOST = {1: 2000, 2: 2000, 3: 125, 4: 125, 5: 1, 6: 1, 15: 1968, 16: 123}


@dataclass
class Served:
    plc: Plc
    places: dict[str, Place]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("matrix")
    port = free_port()
    with Wire() as wire:
        tcp = f'[modbus.server.tcp]\nname = "Tcp"\naddress = "127.0.0.1"\nport = {port}\nunit = {UNIT}\n'
        rtu = f'[modbus.server.rs485]\nname = "Rtu"\nport = "{wire.plc}"\nbaud = {SERVER_BAUD}\nunit = {UNIT}\n'
        description = tcp + SERVER_DESCRIPTION.format("tcp") + rtu + SERVER_DESCRIPTION.format("rtu")
        with running(folder, SERVER_PROGRAM, description) as plc:
            places = {name: Place(name, port, wire.other, SERVER_BAUD, UNIT) for name in TRANSPORTS}
            yield Served(plc, places)


@contextmanager
def running(folder: Path, program: str, description: str) -> Iterator[Plc]:
    """A plcrt with a program."""
    (folder / "main.st").write_text(program)
    (folder / "main.io.toml").write_text(description)
    image = folder / "main.cdl"
    compile_sources([folder / "main.st"]).write(image)
    with Plcrt(folder / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.flash(image)
        yield plc


def bits(words: list[int]) -> list[int]:
    return [word >> i & 1 for word in words for i in range(16)]


_seeds = itertools.count(1)


def fresh(count: int) -> list[int]:
    """Words that no test has used."""
    seed = next(_seeds)
    return [(seed * 1009 + 17 * i) & 0xFFFF for i in range(count)]


def values(plc: Plc, array: str, count: int) -> list[int]:
    """The first elements."""
    found = plc.read(*(f"{array}[{i}]" for i in range(count)))
    return list(found.values()) if isinstance(found, dict) else [found]


def is_of_bits(function: int) -> bool:
    return TABLE_OF[function] in ("coils", "discrete")


def check_reads(client: Client, function: int, most: int) -> None:
    """Outputs of the program are read as a whole, and the last one alone."""
    words, address = (INPUTS, 0) if function in (2, 4) else (HELD, READ_ONLY)
    expected, first = (bits(words), 16 * address) if is_of_bits(function) else (words, address)
    eventually(lambda: client.read(function, first, most) == expected[:most])
    assert client.read(function, first + len(expected) - 1, 1) == expected[-1:]


def check_writes(client: Client, function: int, most: int, plc: Plc, array: str) -> None:
    """What is written is what the program has."""
    if function == 5:
        client.write(5, 0, [1])
        eventually(lambda: values(plc, array, 1)[0] & 1 == 1)
        client.write(5, 0, [0])
        eventually(lambda: values(plc, array, 1)[0] & 1 == 0)
        return
    words = fresh(-(-most // 16) if is_of_bits(function) else most)
    client.write(function, 0, bits(words)[:most] if is_of_bits(function) else words)
    eventually(lambda: values(plc, array, len(words)) == words)


@cells("server")
def test_plcrt_serves(served: Served, function: int, transport: str, counterpart: str) -> None:
    array = f"Main.{transport}_words"
    with CLIENTS[counterpart](served.places[transport]) as client:
        most = MOST.get(function, 0)
        if counterpart == "mbpoll":
            most = min(most, MOST_OF_MBPOLL if function != 15 else MOST_OF_MBPOLL // 16 * 16)
        if function < 5:
            check_reads(client, function, most)
        elif function == 8:
            assert client.loopback(0x55AA) == 0x55AA
        elif function < 17:
            check_writes(client, function, most, served.plc, array)
        elif function == 17:
            assert client.server_id() == ("Tank?" if counterpart == "pymodbus" else "Tanks")
        elif function == 22:
            client.write(6, 3, [0x1234])
            client.mask(3, 0xF0F0, 0x0A05)
            eventually(lambda: served.plc.read(f"{array}[3]") == 0x1A35)
        elif function == 23:
            words = fresh(121)
            assert client.read_write(0, 125, 0, words)[:121] == words
            eventually(lambda: served.plc.read(f"{array}[120]") == words[120])
        else:
            assert client.identification() == ["Acme", "Tanks", "1.2"]


def request(function: int, *numbers: int, data: bytes = b"") -> bytes:
    """A PDU: 16 bit numbers, and what follows."""
    return bytes([function]) + b"".join(number.to_bytes(2, "big") for number in numbers) + data


def with_size(size: int) -> bytes:
    """The count of bytes, and so many."""
    return bytes([size]) + bytes(size)


NOWHERE = 600  # registers; 9600 is the first bit of them
NO_FUNCTION, NO_ADDRESS, NO_VALUE = 1, 2, 3
REFUSED = {
    **{f"function {code}": (bytes([code]), NO_FUNCTION) for code in (7, 11, 12, 20, 21, 24, 65, 100)},
    "8 but loopback": (request(8, 1, 0xFF00), NO_FUNCTION),
    "43/13": (bytes([43, 13, 1, 0]), NO_FUNCTION),
    "43/128 without a tunnel": (bytes([43, 128, 0, 0]), NO_FUNCTION),
    # Addresses that are not there.
    "1 nowhere": (request(1, 16 * NOWHERE, 1), NO_ADDRESS),
    "2 nowhere": (request(2, 16 * NOWHERE, 1), NO_ADDRESS),
    "3 nowhere": (request(3, NOWHERE, 1), NO_ADDRESS),
    "4 nowhere": (request(4, NOWHERE, 1), NO_ADDRESS),
    "5 nowhere": (request(5, 16 * NOWHERE, 0xFF00), NO_ADDRESS),
    "6 nowhere": (request(6, NOWHERE, 1), NO_ADDRESS),
    "15 nowhere": (request(15, 16 * NOWHERE, 8, data=with_size(1)), NO_ADDRESS),
    "16 nowhere": (request(16, NOWHERE, 1, data=with_size(2)), NO_ADDRESS),
    "22 nowhere": (request(22, NOWHERE, 0, 0), NO_ADDRESS),
    "23 reads nowhere": (request(23, NOWHERE, 1, 0, 1, data=with_size(2)), NO_ADDRESS),
    "23 writes nowhere": (request(23, 0, 1, NOWHERE, 1, data=with_size(2)), NO_ADDRESS),
    "43/14 object": (bytes([43, 14, 4, 99]), NO_ADDRESS),
    # The last one is not there.
    "1 past the end": (request(1, 1999, 2), NO_ADDRESS),
    "2 past the end": (request(2, 1999, 2), NO_ADDRESS),
    "3 past the end": (request(3, 124, 2), NO_ADDRESS),
    "4 past the end": (request(4, 124, 2), NO_ADDRESS),
    "15 past the end": (request(15, 1999, 2, data=with_size(1)), NO_ADDRESS),
    "16 past the end": (request(16, 124, 2, data=with_size(4)), NO_ADDRESS),
    "23 past the end": (request(23, 124, 2, 0, 1, data=with_size(2)), NO_ADDRESS),
    "3 past 65535": (request(3, 65535, 2), NO_ADDRESS),
    # Outputs of the program.
    "5 read-only": (request(5, 16 * READ_ONLY, 0xFF00), NO_ADDRESS),
    "6 read-only": (request(6, READ_ONLY, 1), NO_ADDRESS),
    "15 read-only": (request(15, 16 * READ_ONLY, 8, data=with_size(1)), NO_ADDRESS),
    "16 read-only": (request(16, READ_ONLY, 1, data=with_size(2)), NO_ADDRESS),
    "22 read-only": (request(22, READ_ONLY, 0, 0), NO_ADDRESS),
    "23 read-only": (request(23, 0, 1, READ_ONLY, 1, data=with_size(2)), NO_ADDRESS),
    # One more than the largest count; of 16 and 23 its data do not fit into a frame.
    "1 one more": (request(1, 0, 2001), NO_VALUE),
    "2 one more": (request(2, 0, 2001), NO_VALUE),
    "3 one more": (request(3, 0, 126), NO_VALUE),
    "4 one more": (request(4, 0, 126), NO_VALUE),
    "15 one more": (request(15, 0, 1969, data=with_size(247)), NO_VALUE),
    "16 one more": (request(16, 0, 124, data=with_size(246)), NO_VALUE),
    "23 reads one more": (request(23, 0, 126, 0, 1, data=with_size(2)), NO_VALUE),
    "23 writes one more": (request(23, 0, 1, 0, 122, data=with_size(242)), NO_VALUE),
    # Counts, lengths and values that cannot be.
    **{f"{code} none": (request(code, 0, 0), NO_VALUE) for code in (1, 2, 3, 4)},
    **{f"{code} none": (request(code, 0, 0, data=b"\0"), NO_VALUE) for code in (15, 16)},
    "23 reads none": (request(23, 0, 0, 0, 1, data=with_size(2)), NO_VALUE),
    "23 writes none": (request(23, 0, 1, 0, 0, data=b"\0"), NO_VALUE),
    "5 value": (request(5, 0, 1), NO_VALUE),
    "15 size": (request(15, 0, 9, data=with_size(1)), NO_VALUE),
    "16 size": (request(16, 0, 2, data=with_size(2)), NO_VALUE),
    "16 more data than it says": (request(16, 0, 1, data=with_size(2) + b"\0"), NO_VALUE),
    "3 too short": (request(3, 0), NO_VALUE),
    "43/14 category": (bytes([43, 14, 5, 0]), NO_VALUE),
}


@pytest.mark.parametrize("counterpart", ["pymodbus", "libmodbus"])
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_plcrt_refuses(served: Served, transport: str, counterpart: str) -> None:
    """Nothing of what is refused is written."""
    found = {}
    with CLIENTS[counterpart](served.places[transport]) as client:
        words = fresh(123)
        client.write(16, 0, words)
        for name, (pdu, _) in REFUSED.items():
            with pytest.raises(Refused) as refused:
                client.send(pdu)
            found[name] = refused.value.code
        assert client.read(3, 0, 123) == words
    assert found == {name: code for name, (_, code) in REFUSED.items()}


@pytest.mark.parametrize("counterpart", COUNTERPARTS)
@pytest.mark.parametrize("transport", TRANSPORTS)
@pytest.mark.parametrize("function", MOST)
def test_a_client_understands_that_plcrt_refuses(
    served: Served, function: int, transport: str, counterpart: str
) -> None:
    address = 16 * NOWHERE if TABLE_OF[function] in ("coils", "discrete") else NOWHERE
    with CLIENTS[counterpart](served.places[transport]) as client, pytest.raises(Refused) as refused:
        if function < 5:
            client.read(function, address, 1)
        else:
            client.write(function, address, [1, 0] if function > 6 else [1])
    assert refused.value.code == NO_ADDRESS


# ---- plcrt as a client -----------------------------------------------------------------------------------------------

CLIENT_BAUD = 115200
SERVED_UNIT = 1
# Words at which requests of the description write, from the first one on.
PLACES = {1: 0, 2: 0, 3: 0, 4: 0, 5: 130, 6: 130, 15: 140, 16: 140, 22: 131, 23: 300}
BLOCK_WORD = 450  # where blocks read and write
LAST_EXCEPTION = 32773  # parameter of a device
NO_REPLY, INVALID = 0x104, 0x102  # ErrorID
TRIES = 5  # of a request of a block, and of a scan
FAILURE = 4  # the exception that the device None replies with
CLIENT_PROGRAM = """
TYPE Line : STRUCT
    in1, in2, in3, in4, in23 : ARRAY[0..124] OF WORD;
    out5 : BOOL; out6 : WORD; out22 : BYTE;
    out15, out16 : ARRAY[0..122] OF WORD;
    out23 : ARRAY[0..120] OF WORD;
END_STRUCT END_TYPE

FUNCTION Drive : BOOL
VAR_IN_OUT line : Line; END_VAR
VAR_INPUT seed : WORD; END_VAR
VAR i : UINT; END_VAR
line.out5 := seed.0;
line.out6 := seed;
line.out22 := WORD_TO_BYTE(seed);
FOR i := 0 TO 122 DO
    line.out15[i] := line.out16[i] := UINT_TO_WORD(WORD_TO_UINT(seed) + 17 * i);
END_FOR
FOR i := 0 TO 120 DO
    line.out23[i] := line.out16[i];
END_FOR
END_FUNCTION

PROGRAM Main
VAR
    seed : WORD;
    all, none : Line; (* of a device that replies, and of one that refuses *)
    readNow, writeNow : BOOL; reader : MODBUS_READ; writer : MODBUS_WRITE;
    device : STRING := 'All'; code : USINT; reference : UDINT; count : UINT; data : ARRAY[0..199] OF WORD;
END_VAR
Drive(line := all, seed := seed);
Drive(line := none, seed := seed);
reader(Execute := readNow, Device := device, FunctionCode := code, Address := reference, Count := count, Data := data);
writer(Execute := writeNow, Device := device, FunctionCode := code, Address := reference, Count := count, Data := data);
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
    TASK T(INTERVAL := T#2ms, PRIORITY := 1);
    PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""


def reference(function: int, word: int) -> int:
    """Of a register; of coils that of the first bit of a word."""
    first = {"coils": 1, "discrete": 100001, "holding": 400001, "inputs": 300001}[TABLE_OF[function]]
    return first + (16 * word if is_of_bits(function) else word)


def job(kind: str, variable: str, function: int, word: int, every: str) -> str:
    """A read or a write of the description, or both."""
    name = {23: "read_write"}.get(function, "read" if function < 5 else "write")
    text = f'[[modbus.{kind}.device.{name}]]\nevery = "{every}"\n'
    address = f"address = {reference(function, word)}\n"
    if function != 23:
        member = f"{'in' if function < 5 else 'out'}{function}"
        return text + f'function = {function}\n{address}var = "{variable}.{member}"\n'
    for part, member in (("read", "in23"), ("write", "out23")):
        text += f'[modbus.{kind}.device.{name}.{part}]\n{address}var = "{variable}.{member}"\n'
    return text


def line_description(place: Place) -> str:
    """A line with a device for all functions, and one of which all are refused."""
    kind = {"tcp": "tcp", "rtu": "rs485"}[place.transport]
    tcp, rtu = f'host = "127.0.0.1"\nport = {place.port}\n', f'port = "{place.line}"\nbaud = {place.baud}\n'
    text = f'[[modbus.{kind}]]\nname = "Bus"\n{tcp if kind == "tcp" else rtu}'
    for name, places, every in (("All", PLACES, "T#200ms"), ("None", dict.fromkeys(PLACES, TRAP + FAILURE), "T#5s")):
        text += f'[[modbus.{kind}.device]]\nname = "{name}"\nunit = {place.unit}\ntimeout = "T#5s"\n'
        text += "".join(job(kind, f"Main.{name.lower()}", function, word, every) for function, word in places.items())
    return text


@dataclass
class Asking:
    plc: Plc
    server: Server
    line: tuple[str, str]  # transport and counterpart


@pytest.fixture(scope="module")
def asking(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Asking]:
    """A plcrt with one line to one server."""
    transport, counterpart = request.param
    folder, port = tmp_path_factory.mktemp("matrix"), free_port()
    with Wire() as wire:
        there = Place(transport, port, wire.other, CLIENT_BAUD, SERVED_UNIT)
        description = line_description(replace(there, line=wire.plc))
        with SERVERS[counterpart](there) as server, running(folder, CLIENT_PROGRAM, description) as plc:
            yield Asking(plc, server, request.param)


def lines(role: str) -> pytest.MarkDecorator:
    """Parameter `asking`: lines on which something is asked."""
    every = itertools.product(TRANSPORTS, COUNTERPARTS)
    made = [line for line in every if not all(is_left_out(role, function, *line) for function in ROLES[role])]
    return pytest.mark.parametrize("asking", made, indirect=True, ids="-".join)


@lines("description")
@pytest.mark.parametrize("function", ROLES["description"])
def test_plcrt_asks_what_the_description_says(asking: Asking, function: int) -> None:
    """All with the largest count."""
    plc, server, word, table = asking.plc, asking.server, PLACES[function], TABLE_OF[function]
    if function < 5:
        eventually(lambda: values(plc, f"Main.all.in{function}", 125) == first_words(table)[:125])
    else:
        seed = fresh(1)[0]
        plc.write({"Main.seed": seed})
        count = {15: 123, 16: 123, 23: 121}.get(function, 1)
        expected = [(seed + 17 * i) & 0xFFFF for i in range(count)]
        if function == 5:
            old = first_words(table)[word]
            expected = [(old & ~1) | (seed & 1)]
        elif function == 22:
            expected = [(first_words(table)[word] & 0xFF00) | (seed & 0xFF)]
        eventually(lambda: server.words(table, word, count) == expected)
        if function == 23:
            expected += first_words(table)[word + 121 : word + 125]
            eventually(lambda: values(plc, "Main.all.in23", 125) == expected)
    eventually(lambda: plc.read("All.ok"))


@lines("description")
@pytest.mark.parametrize("function", ROLES["description"])
def test_plcrt_takes_the_exception_to_each_request(asking: Asking, function: int) -> None:
    eventually(lambda: function in asking.server.refused)
    eventually(lambda: asking.plc.io_read_parameter("None", LAST_EXCEPTION, UDINT) == FAILURE)
    assert not asking.plc.read("None.ok")


def ask(plc: Plc, function: int, word: int, count: int) -> int:
    """One request of a block; its ErrorID. One that a busy machine has cut in two has no reply, and is made again."""
    start, block = ("Main.readNow", "Main.reader") if function < 5 else ("Main.writeNow", "Main.writer")
    place = {"Main.reference": reference(function, word), "Main.count": count}
    plc.write({"Main.code": function, **place})

    for _ in range(TRIES):
        plc.write({start: True})
        eventually(lambda: any(plc.read(f"{block}.Done", f"{block}.Error").values()))
        error = int(plc.read(f"{block}.ErrorID"))
        plc.write({start: False})
        eventually(lambda: not any(plc.read(f"{block}.Done", f"{block}.Error").values()))
        if error != NO_REPLY:
            break
    return error


@lines("block")
@pytest.mark.parametrize("function", ROLES["block"])
def test_a_block_asks(asking: Asking, function: int) -> None:
    """With the largest count."""
    plc, server, table = asking.plc, asking.server, TABLE_OF[function]
    most = MOST[function]
    count = -(-most // 16) if is_of_bits(function) else most
    if function < 5:
        plc.write({f"Main.data[{i}]": 0 for i in range(count)})
        assert ask(plc, function, BLOCK_WORD, most) == 0
        assert values(plc, "Main.data", count) == server.words(table, BLOCK_WORD, count)
    else:
        words = fresh(count)
        plc.write({f"Main.data[{i}]": word for i, word in enumerate(words)})
        expected = words if function != 5 else [(server.words(table, BLOCK_WORD, 1)[0] & ~1) | (words[0] & 1)]
        assert ask(plc, function, BLOCK_WORD, most) == 0
        assert server.words(table, BLOCK_WORD, count) == expected


@lines("block")
@pytest.mark.parametrize("function", ROLES["block"])
def test_a_block_has_the_exception_of_the_server(asking: Asking, function: int) -> None:
    words = {NO_FUNCTION: TRAP + NO_FUNCTION, NO_ADDRESS: WORDS, NO_VALUE: TRAP + NO_VALUE}
    assert {code: ask(asking.plc, function, word, 1) for code, word in words.items()} == {code: code for code in words}


@pytest.mark.parametrize("asking", [("tcp", "pymodbus")], indirect=True, ids="-".join)
@pytest.mark.parametrize("function", ROLES["block"])
def test_a_block_does_not_ask_for_one_more(asking: Asking, function: int) -> None:
    assert ask(asking.plc, function, BLOCK_WORD, MOST[function] + 1) == INVALID
    assert ask(asking.plc, function, BLOCK_WORD, 0) == INVALID


@lines("scan")
def test_scan_asks_who_is_there(asking: Asking) -> None:
    """43/14 first, and 17 of a device that refuses it."""
    functions = [function for function in ROLES["scan"] if not is_left_out("scan", function, *asking.line)]
    for function in functions:
        if isinstance(asking.server, PymodbusServer):
            asking.server.identifies = function == 43
        slot = 255 if asking.line[0] == "tcp" else SERVED_UNIT
        for _ in range(TRIES):  # a unit whose reply is late is left out
            found = next(asking.plc.io_scan("Bus"), None)
            if found and found.slot == slot:
                break
        assert found
        assert found.slot == slot
        name = {"pymodbus": "Tanks", "libmodbus": "LMB3"}[asking.line[1]]
        assert name in found.name if function == 17 else found.name == " ".join(PymodbusServer.NAMES)
