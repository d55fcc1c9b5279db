"""`[sim]` and `[[sim]]`: a device that exists in memory only (IoDrvSim), for programs without hardware and for tests.

    [[sim]]
    name = "Bench"
    in  = { button = "Main.start", level = "Main.level" }
    out = { motor = { var = "Main.motor", on_stop = 0 } }

A channel has any type; its parameter is its number in the device, from 1.
"""

from __future__ import annotations

from collections.abc import Iterator

from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.model import Channel, Connector, Context
from plctool.io.tables import Table

DRIVER = "IoDrvSim"


def read_sim(table: Table, context: Context) -> list[Connector]:
    """The device of a table."""
    connector = read_connector(Connector, table, DRIVER, default_name="sim")
    for number, channel in enumerate(_channels(table), 1):
        channel.parameter = number
        connector.channels.append(channel)
    return [connector]


def _channels(table: Table) -> Iterator[Channel]:
    for key, output in (("in", False), ("out", True)):
        names = table.table(key)
        for entry in names.items() if names else ():
            channel = channel_of(entry, table.mistakes, output=output)
            if channel is not None:
                yield channel
