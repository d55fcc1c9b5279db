"""What the vendor of a board says of it: `device.toml`.

name = "IO-16"                            # what its firmware calls itself
vendor = "Acme"
target = "cortex-m3"
vendor_id = 0x1234                        # with device_id: images are for this device alone
device_id = 0x0005

[limits]                                  # what the firmware has room for
inputs = 64                               # bytes
outputs = 64
connectors = 4
channels = 64
tasks = 3                                 # of the program; also functions, memory, image (its slot of the flash)
data = 4096                               # bytes
retain = 512
code = 65536
stack = 1024                              # of each task

[gpio]                                    # lines of IoDrvGpio: the names printed on the board, those of the port
in  = { DI0 = "PA5", DI1 = { line = "PA6", text = "terminal X1.2" } }
out = { DO0 = "PC0" }

[[module]]                                # what a driver of the vendor's own has
name = "Analog"
driver = "IoDrvAcmeAdc"
in = { AI0 = { type = "INT", parameter = 1, text = "terminal X2.1, 0 .. 27648" } }
[module.parameter]
range = { id = 100, type = "USINT", choices = { "0..10V" = 0, "4..20mA" = 1 }, default = "0..10V" }
filter = { id = 101, type = "UINT", low = 0, high = 1000, default = 10, text = "ms" }
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from plctool.errors import UsageError, with_article
from plctool.files import Pos
from plctool.iec.types import BOOL, DEFAULT_STRING_LENGTH, ELEMENTARY, Elementary, Kind, StringType, Type
from plctool.iec.values import encode
from plctool.image.targets import TARGETS
from plctool.io.mistakes import Mistakes
from plctool.io.names import MAX_LINE, MAX_NAME, is_line, is_name
from plctool.io.positions import TomlText
from plctool.io.tables import Entry, Table, each

MAX_ID = 0x7FFF_FFFF
_IDS = ("vendor_id", "device_id")
IO_LIMITS = {"inputs": 1 << 16, "outputs": 1 << 16, "connectors": 0xFFFE, "channels": 0xFFFE}
PROGRAM_LIMITS = dict.fromkeys(("tasks", "functions", "data", "retain", "memory", "code", "image", "stack"), MAX_ID)
LIMITS = IO_LIMITS | PROGRAM_LIMITS
"""What a vendor may limit, and the largest value of each; sizes in bytes."""


OWN_KEYS = ("name", "task", "optional", "enabled", "in", "out")
"""What [local.MODULE] has besides the parameters."""


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
    pos: Pos


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
    pos: Pos


@dataclass
class Module:
    """What a driver of the vendor's own has."""

    name: str
    driver: str
    pos: Pos
    channels: dict[str, ModuleChannel] = field(default_factory=dict)
    parameters: dict[str, ModuleParameter] = field(default_factory=dict)


@dataclass
class DeviceFile:
    """A board. `target`: its processor, "" if not said. `id`: vendor << 16 | device, 0 if the vendor has no numbers."""

    path: str
    name: str = ""
    vendor: str = ""
    target: str = ""
    id: int = 0
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
    device = DeviceFile(text.path, _device_name(root), _one_line(root, "vendor"))
    device.target = root.choice("target", {name: name for name in TARGETS}) or ""
    device.id = _device_id(root, device)
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
        other = next((m for m in device.modules.values() if m.name.casefold() == module.name.casefold()), None)
        if other is not None:
            mistakes.error(module.pos, f"there is a module {other.name} in line {other.pos.line} already")
        device.modules[module.name] = module
    root.close()
    return device


def _device_name(table: Table) -> str:
    """What its firmware calls itself, which an image has room for."""
    name = _one_line(table, "name")
    if len(name) > MAX_NAME or not name.isascii():
        table.error(f"name is what the firmware calls itself, at most {MAX_NAME} ASCII characters", "name")
        return ""
    return name


def _device_id(table: Table, device: DeviceFile) -> int:
    """The number that images are for; 0 without."""
    vendor, number = (table.number(key, 1, 0x7FFF if key == "vendor_id" else 0xFFFF) for key in _IDS)
    if vendor is None and number is None:
        return 0
    if vendor is None or number is None:
        given, missing = _IDS if number is None else _IDS[::-1]
        table.error(f"{given} belongs to {missing}; write both", given)
        return 0
    if not device.target or TARGETS[device.target].hosted:
        table.error("vendor_id and device_id are of a board; name its processor in target, such as cortex-m3", _IDS[0])
        return 0
    return int(vendor) << 16 | int(number)


def _one_line(table: Table, key: str) -> str:
    """A text that is shown; "" if it is missing."""
    text = table.text(key, "") or ""
    if not text.isprintable():
        table.error(f"{key} has to be one line, without control characters", key)
        return ""
    return text


def _entries(table: Table) -> Iterator[tuple[Entry, bool]]:
    """The channels in `in` and `out`, and whether each is an output."""
    seen: set[str] = set()
    for entry, output in table.channels():
        if entry.key.casefold() in seen:
            table.mistakes.error(entry.key_pos, f"{entry.key} is there already; names are unique")
        elif _is_c_name(entry, table.mistakes):
            seen.add(entry.key.casefold())
            yield entry, output


def _is_c_name(entry: Entry, mistakes: Mistakes) -> bool:
    """Whether a key can be a name in C; reports it if not."""
    if not is_name(entry.key):
        message = f"'{entry.key}' cannot be a name in C; use at most {MAX_NAME} letters, digits and _"
        mistakes.error(entry.key_pos, message)
        return False
    return True


def _lines(table: Table) -> Iterator[Line]:
    used: dict[str, str] = {}
    for entry, output in _entries(table):
        text, line = "", entry.value
        if isinstance(line, Table):
            inner = line
            line, text = inner.text("line", entry.key), _one_line(inner, "text")
            inner.close()
        if not isinstance(line, str):
            example = f'{entry.key} = "PA5"'
            table.mistakes.error(entry.pos, f"{entry.key} needs the name that the port gives its line: {example}")
        elif not is_line(line):
            table.mistakes.error(entry.pos, f"the name of a line has 1 to {MAX_LINE} ASCII characters")
        elif line in used:
            table.mistakes.error(entry.pos, f"{entry.key} is the line {line}, as {used[line]} is")
        else:
            used[line] = entry.key
            yield Line(entry.key, line, output, text, entry.key_pos)


def _module(table: Table) -> Module | None:
    name, driver = table.text("name", required="Analog"), table.text("driver", required="IoDrvAcmeAdc")
    if name is not None and not is_name(name):
        table.error(f"'{name}' cannot be a name in C; use at most {MAX_NAME} letters, digits and _", "name")
        name = None
    if driver is not None and not (0 < len(driver) <= MAX_NAME and driver.isascii() and driver.isprintable()):
        table.error(f"the name of a driver has 1 to {MAX_NAME} ASCII characters", "driver")
        driver = None
    module = Module(name or "", driver or "", table.value_pos("name"))
    for entry, output in _entries(table):
        channel = _channel(entry, output, table.mistakes)
        if channel is not None:
            _add_channel(module, channel, table.mistakes)
    parameters = table.table("parameter")
    for entry in parameters.items() if parameters is not None else ():
        parameter = _parameter(entry, table.mistakes)
        if parameter is not None:
            _add_parameter(module, parameter, table.mistakes)
    return module if name and driver else None


def _add_channel(module: Module, channel: ModuleChannel, mistakes: Mistakes) -> None:
    place = (channel.output, channel.parameter, channel.bit, channel.type)
    for other in module.channels.values():
        if (other.output, other.parameter, other.bit, other.type) == place:
            message = f"{channel.name} is at the parameter and bit of {other.name} in line {other.pos.line}"
            mistakes.error(channel.pos, message)
    module.channels[channel.name] = channel


def _add_parameter(module: Module, parameter: ModuleParameter, mistakes: Mistakes) -> None:
    for other in module.parameters.values():
        if other.id == parameter.id:
            mistakes.error(parameter.pos, f"{parameter.name} has the id of {other.name} in line {other.pos.line}")
    module.parameters[parameter.name] = parameter


def _channel(entry: Entry, output: bool, mistakes: Mistakes) -> ModuleChannel | None:
    inner = entry.value
    if not isinstance(inner, Table):
        mistakes.error(entry.pos, f'{entry.key} needs a table: {entry.key} = {{ type = "INT", parameter = 1 }}')
        return None
    t = _type(inner)
    parameter, bit = inner.number("parameter", 0, MAX_ID, required=0), inner.number("bit", 0, 0xFFFF, 0)
    text = _one_line(inner, "text")
    inner.close()
    if t is None or parameter is None or bit is None:
        return None
    if t is not BOOL and bit % 8:
        inner.error(f"bit is {bit}; {t} begins at a multiple of 8", "bit")
        return None
    return ModuleChannel(entry.key, output, t, parameter, bit, text, entry.key_pos)


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
    number = inner.number("id", 0, MAX_ID, required=0)
    t = _type(inner)
    low, high = inner.raw("low"), inner.raw("high")
    words = inner.table("choices")
    choices = {choice.key: choice.value for choice in words.items()} if words is not None else {}
    text, default = _one_line(inner, "text"), inner.raw("default")
    inner.close()
    if entry.key in OWN_KEYS:
        mistakes.error(
            entry.key_pos, f"a parameter cannot be {entry.key}, which all modules have; give it another name"
        )
        return None
    if number is None or t is None or not _is_c_name(entry, mistakes) or not _are_limits(inner, t, low, high):
        return None
    made = ModuleParameter(entry.key, number, t, low, high, default, choices, text, entry.key_pos)
    _check_choices(inner, made)
    if default is not None:
        problem = parameter_problem(made, default)
        if problem:
            inner.error(f"the default of {entry.key} {problem}", "default")
    return made


def _are_limits(table: Table, t: Type, low: Any, high: Any) -> bool:
    """Whether these are limits of a number of this type, or missing; reports them if not."""
    if isinstance(t, Elementary) and t.kind in (Kind.INT, Kind.BIT, Kind.REAL):
        allowed = (int, float) if t.kind is Kind.REAL else (int,)
        least, most = _range_of(t)
        for key, value in (("low", low), ("high", high)):
            if value is None:
                continue
            if type(value) not in allowed:
                table.error(f"{key} has to be {'a number' if t.kind is Kind.REAL else 'an integer'}", key)
                return False
            if not least <= value <= most:
                table.error(f"{key} is {value}; a {t} can be {least} to {most}", key)
                return False
        if low is not None and high is not None and low > high:
            table.error(f"low is {low}, more than high, which is {high}", "low")
            return False
        return True
    given = [key for key, value in (("low", low), ("high", high)) if value is not None]
    for key in given:
        table.error(f"{key} is for numbers; this is {t}", key)
    return not given


def _check_choices(table: Table, made: ModuleParameter) -> None:
    plain = replace(made, choices={})
    for word, value in made.choices.items():
        problem = parameter_problem(plain, value)
        if problem:
            table.error(f"the choice {word} of {made.name} {problem}", "choices")
        if not word or not word.isprintable():
            table.error(f"a choice of {made.name} needs a word of one line", "choices")


def parameter_value(parameter: ModuleParameter, value: Any) -> Any:
    """What a value of a description stands for: a word of the choices, or itself."""
    return parameter.choices.get(value, value) if isinstance(value, str) else value


def parameter_problem(parameter: ModuleParameter, value: Any) -> str:
    """What is wrong with a value, as the end of a sentence; "" for nothing."""
    meant = parameter_value(parameter, value)
    problem = _problem(parameter, meant)
    if parameter.choices and (problem or meant not in parameter.choices.values()):
        shown = str(value).lower() if isinstance(value, bool) else repr(value)
        return f"cannot be {shown}; it can be {', '.join(parameter.choices)}"
    return problem


def _problem(parameter: ModuleParameter, value: Any) -> str:
    """The same without the choices."""
    t = parameter.type
    if isinstance(t, StringType):
        fits = isinstance(value, str) and len(value) <= t.length and value.isascii() and value.isprintable()
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
    low, high = _range_of(t)
    low = low if parameter.low is None else max(low, parameter.low)
    high = high if parameter.high is None else min(high, parameter.high)
    return "" if low <= value <= high else f"is {value}; it can be {low} to {high}"


def _text_problem(t: Elementary, value: Any) -> str:
    """The same for a duration, a date or a character."""
    if not isinstance(value, str):
        return f"has to be a text such as {with_article(t)} has in ST"
    try:
        encode(t, value)
    except UsageError as error:
        return f"cannot be that: {error.message.rstrip('.')}"
    return ""


def _range_of(t: Elementary) -> tuple[float, float]:
    """The least and the largest number of a type."""
    if t.kind is Kind.REAL:
        largest = 3.4028234663852886e38 if t.bits == 32 else sys.float_info.max
        return -largest, largest
    return (-(1 << t.bits - 1), (1 << t.bits - 1) - 1) if t.signed else (0, (1 << t.bits) - 1)
