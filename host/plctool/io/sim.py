"""`[sim]` and `[[sim]]`: a device that exists in memory only (IoDrvSim), for programs without hardware and for tests.

    [[sim]]
    name = "Bench"
    in  = { button = "Main.start", level = "Main.level" }
    out = { motor = { var = "Main.motor", on_stop = 0 } }

A channel has any type; its parameter is its number in the device, from 1.
"""

from __future__ import annotations

from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.model import Connector, Context
from plctool.io.tables import Table

DRIVER = "IoDrvSim"


def read_sim(table: Table, context: Context) -> list[Connector]:
    """The device of a table."""
    connector = read_connector(Connector, table, DRIVER, default_name="sim")
    for number, (entry, output) in enumerate(table.channels(), 1):
        channel = channel_of(entry, table.mistakes, output=output, parameter=number)
        if channel is not None:
            connector.channels.append(channel)
    return [connector]
