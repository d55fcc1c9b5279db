"""What the vendor of a board says of it: `device.toml`.

name = "IO-16"
vendor = "Acme"
target = "cortex-m3"

[limits]                                  # what the firmware has room for
inputs = 64                               # bytes
outputs = 64
connectors = 4
channels = 64

[gpio]                                    # lines of IoDrvGpio, by the names printed on the board
in  = { DI0 = 0, DI1 = { line = 1, text = "terminal X1.2" } }
out = { DO0 = 16 }

[[module]]                                # what a driver of the vendor's own has
name = "Analog"
driver = "IoDrvAcmeAdc"
in = { AI0 = { type = "INT", parameter = 1, text = "terminal X2.1, 0 .. 27648" } }
[module.parameter]
range = { id = 100, type = "USINT", choices = { "0..10V" = 0, "4..20mA" = 1 }, default = "0..10V" }
filter = { id = 101, type = "UINT", low = 0, high = 1000, default = 10, text = "ms" }
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from plctool.errors import UsageError
from plctool.files import Pos
from plctool.iec.types import DEFAULT_STRING_LENGTH, ELEMENTARY, Elementary, Kind, StringType, Type
from plctool.iec.values import encode
from plctool.io.mistakes import Mistakes
from plctool.io.names import MAX_NAME, is_name
from plctool.io.positions import TomlText
from plctool.io.tables import Entry, Table, each

MAX_LINE = 63  # characters
MAX_ID = 0x7FFF_FFFF
LIMITS = {"inputs": 1 << 16, "outputs": 1 << 16, "connectors": 0xFFFE, "channels": 0xFFFE}
"""What a vendor may limit, and the largest value of each; inputs and outputs in bytes."""


@dataclass(frozen=True)
class Line:
    """A line of IoDrvGpio. `line`: what the port calls it; `text`: where it is on the board."""

    name: str
    line: str
    output: bool
    text: str
    pos: Pos


@dataclass(frozen=True)
class ModuleChannel:
    """A channel of a vendor's driver: `parameter` and `bit` are where the driver has it."""

    name: str
    output: bool
    type: Type
    parameter: int
    bit: int
    text: str


@dataclass(frozen=True)
class ModuleParameter:
    """A parameter that an engineer may set. `choices`: words for values; without a `default` the engineer must."""

    name: str
    id: int
    type: Type
    low: float | None
    high: float | None
    default: Any
    choices: dict[str, Any]
    text: str


@dataclass
class Module:
    """What a driver of the vendor's own has."""

    name: str
    driver: str
    channels: dict[str, ModuleChannel] = field(default_factory=dict)
    parameters: dict[str, ModuleParameter] = field(default_factory=dict)


@dataclass
class DeviceFile:
    """A board. `target`: its processor, "" if not said."""

    path: str
    name: str = ""
    vendor: str = ""
    target: str = ""
    limits: dict[str, int] = field(default_factory=dict)
    lines: dict[str, Line] = field(default_factory=dict)
    modules: dict[str, Module] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """How messages call it."""
        return " ".join(part for part in (self.vendor, self.name) if part) or "the device"


def read_device_file(text: TomlText, mistakes: Mistakes) -> DeviceFile:
    """What the text says; mistakes are reported."""
    root = Table(text, (), text.values, mistakes)
    device = DeviceFile(text.path, root.text("name", "") or "", root.text("vendor", "") or "")
    device.target = root.text("target", "") or ""
    limits = root.table("limits")
    if limits is not None:
        for name, largest in LIMITS.items():
            value = limits.number(name, 0, largest)
            if value is not None:
                device.limits[name] = value
        limits.close()
    gpio = root.table("gpio")
    if gpio is not None:
        for line in _lines(gpio):
            device.lines[line.name] = line
        gpio.close()
    for module in each(root.tables("module"), _module):
        device.modules[module.name] = module
    root.close()
    return device


def _entries(table: Table) -> Iterator[tuple[Entry, bool]]:
    """The channels in `in` and `out`, and whether each is an output."""
    seen: set[str] = set()
    for entry, output in table.channels():
        if entry.key in seen:
            table.mistakes.error(entry.key_pos, f"{entry.key} is there already; names are unique")
        elif not is_name(entry.key):
            message = f"'{entry.key}' cannot be a name in C; use at most {MAX_NAME} letters, digits and _"
            table.mistakes.error(entry.key_pos, message)
        else:
            seen.add(entry.key)
            yield entry, output


def _lines(table: Table) -> Iterator[Line]:
    used: dict[str, str] = {}
    for entry, output in _entries(table):
        text, line = "", entry.value
        if isinstance(line, Table):
            inner = line
            line, text = inner.text("line", entry.key), inner.text("text", "") or ""
            inner.close()
        if not isinstance(line, str) or not 0 < len(line) <= MAX_LINE or not line.isascii():
            example = f'{entry.key} = "PA5"'
            table.mistakes.error(entry.pos, f"{entry.key} needs the name that the port gives its line: {example}")
        elif line in used:
            table.mistakes.error(entry.pos, f"{entry.key} is the line {line}, as {used[line]} is")
        else:
            used[line] = entry.key
            yield Line(entry.key, line, output, text, entry.key_pos)


def _module(table: Table) -> Module | None:
    name, driver = table.text("name", required="Analog"), table.text("driver", required="IoDrvAcmeAdc")
    if driver is not None and not 0 < len(driver) <= MAX_NAME:
        table.error(f"the name of a driver has 1 to {MAX_NAME} letters", "driver")
    module = Module(name or "", driver or "")
    for entry, output in _entries(table):
        channel = _channel(entry, output, table.mistakes)
        if channel is not None:
            module.channels[channel.name] = channel
    parameters = table.table("parameter")
    for entry in parameters.items() if parameters is not None else ():
        parameter = _parameter(entry, table.mistakes)
        if parameter is not None:
            module.parameters[parameter.name] = parameter
    return module if name and driver else None


def _channel(entry: Entry, output: bool, mistakes: Mistakes) -> ModuleChannel | None:
    inner = entry.value
    if not isinstance(inner, Table):
        mistakes.error(entry.pos, f'{entry.key} needs a table: {entry.key} = {{ type = "INT", parameter = 1 }}')
        return None
    t = _type(inner)
    parameter, bit = inner.number("parameter", 0, MAX_ID, required=True), inner.number("bit", 0, 0xFFFF, 0)
    text = inner.text("text", "") or ""
    inner.close()
    if t is None or parameter is None or bit is None:
        return None
    return ModuleChannel(entry.key, output, t, parameter, bit, text)


def _type(table: Table) -> Type | None:
    name = table.text("type", required="INT")
    if name is None:
        return None
    if name.upper() == "STRING":
        return StringType(table.number("length", 1, 255, DEFAULT_STRING_LENGTH) or DEFAULT_STRING_LENGTH)
    found = ELEMENTARY.get(name.upper())
    if found is None:
        table.choice("type", dict.fromkeys((*(t for t in ELEMENTARY if "X" not in t and "_" not in t), "STRING")))
    return found


def _parameter(entry: Entry, mistakes: Mistakes) -> ModuleParameter | None:
    inner = entry.value
    if not isinstance(inner, Table):
        mistakes.error(entry.pos, f'{entry.key} needs a table: {entry.key} = {{ id = 1, type = "UINT" }}')
        return None
    number = inner.number("id", 0, MAX_ID, required=True)
    t = _type(inner)
    low, high = inner.raw("low"), inner.raw("high")
    for key, value in (("low", low), ("high", high)):
        if value is not None and type(value) not in (int, float):
            inner.error(f"{key} has to be a number", key)
            return None
    words = inner.table("choices")
    choices = {choice.key: choice.value for choice in words.items()} if words is not None else {}
    text, default = inner.text("text", "") or "", inner.raw("default")
    if number is None or t is None:
        inner.close()
        return None
    made = ModuleParameter(entry.key, number, t, low, high, default, choices, text)
    plain = replace(made, choices={})
    for word, value in choices.items():
        problem = parameter_problem(plain, value)
        if problem:
            inner.error(f"the choice {word} of {entry.key} {problem}", "choices")
    if default is not None:
        problem = parameter_problem(made, default)
        if problem:
            inner.error(f"the default of {entry.key} {problem}", "default")
    inner.close()
    return made


def parameter_value(parameter: ModuleParameter, value: Any) -> Any:
    """What a value of a description stands for: a word of the choices, or itself."""
    return parameter.choices.get(value, value) if isinstance(value, str) else value


def parameter_problem(parameter: ModuleParameter, value: Any) -> str:
    """What is wrong with a value, as the end of a sentence; "" for nothing."""
    t = parameter.type
    if parameter.choices and (not isinstance(value, str) or value not in parameter.choices):
        if value not in parameter.choices.values():
            return f"cannot be {value!r}; it can be {', '.join(parameter.choices)}"
        return ""
    value = parameter_value(parameter, value)
    if isinstance(t, StringType):
        fits = isinstance(value, str) and len(value) <= t.length and value.isascii()
        return "" if fits else f"has to be a text of at most {t.length} ASCII characters"
    assert isinstance(t, Elementary)
    if t.kind is Kind.BOOL:
        return "" if isinstance(value, bool) else "has to be true or false"
    if t.kind is Kind.REAL:
        if type(value) not in (int, float):
            return "has to be a number"
    elif t.kind in (Kind.INT, Kind.BIT):
        if type(value) is not int:
            return "has to be an integer"
    else:
        return _text_problem(t, value)
    low, high = _range(t, parameter)
    return "" if low <= value <= high else f"is {value}; it can be {low} to {high}"


def _text_problem(t: Elementary, value: Any) -> str:
    """The same for a duration, a date or a character."""
    if not isinstance(value, str):
        return f"has to be a text such as a {t} has in ST"
    try:
        encode(t, value)
    except UsageError as error:
        return f"cannot be that: {error.message.rstrip('.')}"
    return ""


def _range(t: Elementary, parameter: ModuleParameter) -> tuple[float, float]:
    if t.kind is Kind.REAL:
        low, high = -3.4e38, 3.4e38
    else:
        low, high = (-(1 << t.bits - 1), (1 << t.bits - 1) - 1) if t.signed else (0, (1 << t.bits) - 1)
    low = low if parameter.low is None else max(low, parameter.low)
    return low, high if parameter.high is None else min(high, parameter.high)
