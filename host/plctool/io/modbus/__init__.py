"""`[modbus]`: devices that this PLC asks as a client (master), and this PLC as a server (slave). IoDrvModbus.

    [[modbus.rs485]]                       # a serial line
    port = "/dev/ttyS1"
    baud = 38400
    [[modbus.rs485.device]]
    name = "Meter"
    unit = 3
    [[modbus.rs485.device.read]]
    function = 4
    address = 30001
    every = "T#100ms"
    var = "Main.power"

    [[modbus.tcp]]                         # a device, or a gateway with several
    host = "192.168.0.7"
    [[modbus.tcp.device]]
    name = "Drive"
    [[modbus.tcp.device.write]]
    function = 16
    address = 40011
    on_change = true
    vars = ["Main.speed", "Main.ramp"]

    [modbus.server.tcp]
    holding = { 40001 = "Main.setpoint", 40003 = "Main.recipe" }
    input = { 30001 = "Main.power" }

An address is a reference as manuals of devices have it: 1.. for coils, 10001.. for discrete inputs, 30001.. for input
registers, 40001.. for holding registers, with six digits for more than 9999. It is checked against the function, so
that a number from 0 is not taken for one from 1; `wire = 0` is the number as it is sent. docs/modbus.md.
"""

from __future__ import annotations

from plctool.io.modbus.client import read_serial_client, read_tcp_client
from plctool.io.modbus.registers import wire_address
from plctool.io.modbus.server import read_serial_server, read_tcp_server
from plctool.io.model import Connector, Context
from plctool.io.tables import Table, each

__all__ = ["read_modbus", "wire_address"]


def read_modbus(table: Table, context: Context) -> list[Connector]:
    """All lines and servers, each line before its devices."""
    made: list[Connector] = []
    for key, read in (("rs485", read_serial_client), ("tcp", read_tcp_client)):
        for one in table.tables(key):
            made += read(one)
            one.close()
    servers = table.table("server")
    if servers is not None:
        made += each(servers.tables("rs485"), read_serial_server)
        made += each(servers.tables("tcp"), read_tcp_server)
        servers.close()
    return made
