"""plcrt and a client of others, in two dialects, on each kind of link."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import pytest
from reference_client import SHORT, THOROUGH, Client, Serial, Tcp, Udp, find, serial_path, u16, u32

import plctool
from plctool.testing.plcrt import Plcrt

PROGRAM = """PROGRAM Main VAR n : DINT := 7; text : ARRAY[0..2999] OF BYTE := [3000(16#A5)]; END_VAR
text[2999] := text[2999]; END_PROGRAM
"""


@pytest.fixture
def device(tool, tmp_path) -> Iterator[Plcrt]:
    """With a program that does not write n, and a file."""
    image = tool.build("app", PROGRAM)
    with Plcrt(tmp_path / "flash", "--tcp", "0", "--udp", "127.0.0.1") as plcrt:
        with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
            plc.write_file("recipe", bytes(range(256)) * 150)
        yield plcrt


@pytest.fixture(params=["tcp", "udp", "serial"])
def link(request, device):
    if request.param == "tcp":
        return Tcp(device.tcp)
    return Udp(device.udp) if request.param == "udp" else Serial(serial_path(device.port))


@pytest.fixture(params=[THOROUGH, SHORT], ids=["long-header", "short-header"])
def client(request, link):
    client = Client(link, request.param)
    yield client
    client.close()


def test_it_does_what_published_clients_do(client, tool, device):
    assert u16(client.scan()) == 0xC280
    response = client.open()
    assert len(response) == (24 if client.dialect.words else 20)
    ident = client.call(1, 1, session=0)
    assert u32(find(ident, 7)) == 0 and u16(find(ident, 5)) == 0
    client.login()
    listed = client.call(2, 0x18, client.tag(1, struct.pack("<II", 0, 0x7FFFFFFF)))
    assert find(listed, 0x81, 3).rstrip(b"\0") == b"Application"
    assert "Runtime: 0x" in client.shell("rtsinfo") and "rtsinfo: " in client.shell("?")
    assert u32(find(client.call(1, 7), 0x54)) == 1
    assert u32(find(client.call(2, 0x14), 0x32)) == 1
    assert find(client.call(5, 3), 1).rstrip(b"\0") == b"PlcLog"
    assert find(client.call(5, 2, client.tag(5, struct.pack("<I", 2))), 5).rstrip(b"\0") == b"CmpAppEmbedded"
    assert client.list_files() == ["Application.cdl", "PlcLog.txt", "recipe"]
    assert client.get_file("recipe") == bytes(range(256)) * 150
    assert client.get_file("Application.cdl") == (tool.folder / "app.cdl").read_bytes()


def test_it_reads_and_writes_variables_in_replies_of_many_blocks(client, device):
    client.scan()
    client.open()
    client.login()
    app = client.login_app()
    with plctool.connect(f"tcp:{device.tcp}") as plc:
        symbols = plc.symbols().variables
        n, text = symbols["Main.n"], symbols["Main.text"]
        area, at, _ = n.place
        values = client.read(app, [(area, at, 4), (text.place[0], text.place[1], 3000)])
        assert values == [struct.pack("<i", 7), b"\xa5" * 3000] and client.fragments > 6
        client.write(app, area, at, struct.pack("<i", -5))
        assert plc.read("Main.n") == -5
    assert client.read(app, [(area, at, 4)]) == [struct.pack("<i", -5)]


def test_after_an_abrupt_end_the_next_client_gets_in(device):
    for _ in range(12):  # more than there are channels
        client = Client(Tcp(device.tcp), SHORT)
        client.open()
        client.login()
        client.link.close()


def test_a_login_with_a_key_is_refused_where_such_clients_look(device):
    client = Client(Tcp(device.tcp), THOROUGH)
    client.open()
    content = client.tag(0x22, struct.pack("<I", 2)) + client.tag(0x25, struct.pack("<I", 1))
    assert u16(find(client.call(1, 2, content, session=0), 0xFF82, 0x20)) == 0x18
    client.close()
