"""A description with comments, for an engineer to begin with: `plctool io init`."""

from __future__ import annotations

from collections.abc import Iterator

from plctool.errors import UsageError
from plctool.iec.values import decode
from plctool.io.device_file import DeviceFile, Module, ModuleParameter, parameter_problem

_HEAD = """\
# Inputs and outputs: docs/io.md. A channel leads to a variable (Main.start), or to an address (%IX0.1).
# Take away the # before the lines that you need, and write your variables.
"""

_WITHOUT_DEVICE = """
# Lines of the board, by the names that its port gives them.
# [gpio]
# in  = { "gpiochip0:17" = "Main.start", "gpiochip0:27" = { var = "Main.door", pull = "up", invert = true } }
# out = { "gpiochip0:22" = { var = "Main.motor", on_stop = "zero" } }     # zero, hold or a value

# A device in memory, for tests without hardware.
# [[sim]]
# name = "Bench"                       # Bench.ok, Bench.errors, Bench.age in the program
# in  = { button = "Main.start" }
# out = { motor = "Main.motor" }
"""


def beginning(device: DeviceFile | None, device_path: str | None) -> str:
    """The text. `device_path`: how the description names the device file."""
    if device is None:
        return _HEAD + _WITHOUT_DEVICE
    lines = [_HEAD, f"device = {toml_value(device_path or '')}", ""]
    if device.lines:
        lines += ["# Lines of the board.", "# [gpio]", "# [gpio.in]"]
        lines += [_channel(line.name, line.text) for line in device.lines.values() if not line.output]
        lines.append("# [gpio.out]")
        lines += [_channel(line.name, line.text) for line in device.lines.values() if line.output]
        lines.append("")
    for module in device.modules.values():
        lines += [*_module(module), ""]
    return "\n".join(lines)


def toml_value(value: str | float) -> str:
    """A text, number or BOOL as TOML has it. Raises UsageError for the name of a file that is no text."""
    if isinstance(value, str):
        if any("\ud800" <= character <= "\udfff" for character in value):
            shown = value.encode("ascii", "backslashreplace").decode()
            raise UsageError(f"{shown} is not UTF-8, which a description has to be; rename the file or folder.", "io")
        return '"' + "".join(map(_escaped, value)) + '"'
    return str(value).lower() if isinstance(value, bool) else str(value)


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    return character if character.isprintable() else f"\\U{ord(character):08X}"


def _channel(name: str, text: str) -> str:
    comment = f"  # {text}" if text else ""
    return f'# {name} = "Main.{name.lower()}"{comment}'


def _module(module: Module) -> Iterator[str]:
    yield f"# [local.{module.name}]"
    yield from map(_parameter, module.parameters.values())
    for output, key in ((False, "in"), (True, "out")):
        channels = [c for c in module.channels.values() if c.output is output]
        if channels:
            yield f"# [local.{module.name}.{key}]"
            yield from (_channel(c.name, ", ".join(t for t in (str(c.type), c.text) if t)) for c in channels)


def _parameter(p: ModuleParameter) -> str:
    limits = f"{p.low} to {p.high}" if p.low is not None and p.high is not None else ""
    also = "; ".join(part for part in (", ".join(p.choices), limits, p.text) if part)
    return f"# {p.name} = {toml_value(_value(p))}" + (f"  # {also}" if also else "")


def _value(p: ModuleParameter) -> str | float:
    """The default, or without one a value that the parameter can have."""
    if p.default is not None:
        return p.default  # type: ignore[no-any-return]  # it was checked
    if p.choices:
        return next(iter(p.choices))
    zero: str | float = decode(p.type, bytes(p.type.size))
    if not parameter_problem(p, zero):
        return zero
    if isinstance(zero, str):
        return "-"  # a character
    return p.low if p.low is not None and p.low > 0 else p.high or 0
