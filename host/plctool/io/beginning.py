"""A description with comments, for an engineer to begin with: `plctool io init`."""

from __future__ import annotations

from collections.abc import Iterator

from plctool.io.device_file import DeviceFile, Module, ModuleParameter

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
    lines = [_HEAD, f'device = "{device_path}"', ""]
    if device.lines:
        lines += ["# Lines of the board.", "# [gpio]", "# [gpio.in]"]
        lines += [_channel(line.name, line.text) for line in device.lines.values() if not line.output]
        lines.append("# [gpio.out]")
        lines += [_channel(line.name, line.text) for line in device.lines.values() if line.output]
        lines.append("")
    for module in device.modules.values():
        lines += [*_module(module), ""]
    return "\n".join(lines)


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
    value = p.default
    if value is None:
        value = next(iter(p.choices), p.low if p.low is not None else 0)
    shown = f'"{value}"' if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else str(value)
    limits = f"{p.low} to {p.high}" if p.low is not None and p.high is not None else ""
    also = "; ".join(part for part in (", ".join(p.choices), limits, p.text) if part)
    return f"# {p.name} = {shown}" + (f"  # {also}" if also else "")
