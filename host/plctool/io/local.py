"""`[local.NAME]`: a module of the board that `device.toml` describes, with a driver of the vendor's own.

[local.Analog]
in = { AI0 = "Main.level" }
range = "4..20mA"
"""

from __future__ import annotations

from plctool.errors import did_you_mean
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.device_file import Module, parameter_problem, parameter_value
from plctool.io.mistakes import Mistakes
from plctool.io.model import Channel, Connector, Context, Parameter, bits_of
from plctool.io.tables import Entry, Table


def read_local(table: Table, context: Context) -> list[Connector]:
    """The modules that the description uses."""
    modules = context.device.modules if context.device is not None else {}
    made = []
    for entry in table.items():
        if not isinstance(entry.value, Table):
            table.mistakes.error(entry.pos, f"write a table [local.{entry.key}]")
        elif entry.key not in modules:
            if context.device is None:
                hint = '; say which board it is: device = "device.toml"'
            else:
                hint = did_you_mean(entry.key, modules) or (f"; it has {', '.join(modules)}" if modules else "")
            where = context.device.title if context.device is not None else "the board"
            table.mistakes.error(entry.key_pos, f"{where} has no module {entry.key}{hint}")
        else:
            made.append(_connector(entry.value, modules[entry.key]))
    return made


def _connector(table: Table, module: Module) -> Connector:
    connector = read_connector(Connector, table, module.driver, default_name=module.name)
    for entry, output in table.channels():
        _add_channel(connector, entry, module, output, table.mistakes)
    for parameter in sorted(module.parameters.values(), key=lambda p: p.id):
        value = table.raw(parameter.name)
        if value is None:
            value = parameter.default
            if value is None:
                table.error(f"{module.name} needs {parameter.name}: {parameter.text or 'the vendor gives no default'}")
                continue
        elif problem := parameter_problem(parameter, value):
            table.error(f"{parameter.name} {problem}", parameter.name)
            continue
        value = parameter_value(parameter, value)
        connector.parameters.append(Parameter(parameter.id, parameter.type, value, parameter.name))
    table.close()
    return connector


def _add_channel(connector: Connector, entry: Entry, module: Module, output: bool, mistakes: Mistakes) -> None:
    known = module.channels.get(entry.key)
    if known is None or known.output is not output:
        names = [c.name for c in module.channels.values() if c.output is output]
        hint = did_you_mean(entry.key, names) or (f"; it has {', '.join(names)}" if names else "")
        what = "output" if output else "input"
        mistakes.error(entry.key_pos, f"{module.name} has no {what} {entry.key}{hint}")
        return
    bits, t = bits_of(known.type), known.type
    channel = channel_of(entry, mistakes, output=output, bits=bits, type=t, parameter=known.parameter)
    if channel is None:
        return
    channel.parameter_bit = known.bit
    other = next((c for c in connector.channels if output and c.output and _overlap(c, channel)), None)
    if other is not None:
        mistakes.error(channel.pos, f"{channel.name} has bits of {other.name}, which is used in line {other.pos.line}")
    connector.channels.append(channel)


def _overlap(one: Channel, other: Channel) -> bool:
    """Whether two channels of known size are in the same bits of a parameter."""
    start, end = other.parameter_bit, other.parameter_bit + other.size_bits
    same = one.parameter == other.parameter
    return same and one.parameter_bit < end and start < one.parameter_bit + one.size_bits
