"""What a description becomes: connectors with parameters and channels. The interface of a kind of driver.

A kind (`kinds.py` has one row for each) is a function that reads one table of a description and returns connectors:

    def read_acme(table: Table, context: Context) -> list[Connector]

It is called once for the top-level table with its name. It reads every key with the functions of `Table`, which report
mistakes with their location, reads channels with `channels.read_channel()`, and calls `close()` of every table that it
has opened but `table` itself. It raises nothing.

A channel names a variable, whose type only the compiler knows. When all of them are known the compiler calls
`Connector.complete()`, in which a kind's own class makes the parameters that depend on types: how many registers are
read, for example. Then `configuration.py` writes the tables of IoConfig.h.
"""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar

from plctool.core import lib
from plctool.files import Pos
from plctool.iec.addresses import parse_address
from plctool.iec.types import BOOL, ArrayType, Type, base_of
from plctool.io.faults import FAULTS
from plctool.io.mistakes import Mistakes
from plctool.records import dataclass

if TYPE_CHECKING:
    from plctool.io.canopen.profile import ProgramFacts
    from plctool.io.device_file import DeviceFile

HOLD, ZERO, VALUE = int(lib.IO_HOLD), int(lib.IO_ZERO), int(lib.IO_VALUE)


@dataclass(frozen=True)
class Parameter:
    """A parameter of a connector. `id`: the driver's own. `value`: a number, BOOL or text that `iec.values.encode`
    takes for the type; bytes for an ARRAY OF BYTE. `name`: what users call it, if they do."""

    id: int
    type: Type
    value: Any
    name: str = ""


@dataclass(frozen=True)
class Substitute:
    """What an output becomes when the program stops, or an input when its device is lost: HOLD, ZERO, or VALUE with
    `value` as the engineer wrote it, at `pos`."""

    what: int
    value: Any = None
    pos: Pos | None = None


@dataclass(eq=False)
class Channel:
    """An input or output. `parameter` and `parameter_bit`: where the driver has it.

    `name`: within its connector, as the engineer or the vendor calls it. `target`: a variable (`Main.start`), an
    address (`%IX0.1`), or that of a module's channel at which a variable is (`%IX4.0.1`), written at `pos`. `bits`: its
    size, 1 for a BOOL; None: that of the variable. `type`: what the device has, None if any type of that size will do.
    `age_us`: how old a value may be when the driver hands it over, 0
    if it reads the line itself. `event`: what happens when the input rises (`rising`), falls or both; "" for nothing.
    The compiler sets what follows.
    """

    name: str
    target: str
    pos: Pos
    output: bool
    parameter: int = 0
    parameter_bit: int = 0
    bits: int | None = None
    type: Type | None = None
    big_endian: bool = False
    substitute: Substitute = Substitute(HOLD)
    age_us: int = 0
    event: str = ""
    rising: bool = False
    falling: bool = False

    variable_type: Type | None = None
    area_bit: int = -1
    variable: str = ""  # its full name; "" for an address without one
    tasks: list[int] = field(default_factory=list)  # that use it

    @property
    def at_address(self) -> bool:
        """Whether it leads to a place that its target gives, not to that of a variable."""
        return parse_address(self.target) is not None

    @property
    def size_bits(self) -> int:
        """The bits that are copied, once the type of the variable is known."""
        if self.bits is not None:
            return self.bits
        assert self.variable_type is not None
        return bits_of(self.variable_type)


@dataclass(eq=False)
class Connector:
    """A bus, device or module. `type`: CT_*. `name`: as in `plctool io map`, at most 31 ASCII characters, unique.
    `driver`: szDriverName of the driver that takes it. `task`: in whose cycle the bus cycle is started, None for the
    fastest. `variable`: it has an IO_DEVICE of its name in the program. `faults`: those that it may have when it is
    simulated. `counters`: parameters of 32 bits that its driver counts, by name."""

    faults: ClassVar[tuple[str, ...]] = tuple(FAULTS)
    counters: ClassVar[dict[str, int]] = {}

    name: str
    driver: str
    pos: Pos
    type: int = int(lib.CT_MASTER)
    parent: Connector | None = None
    optional: bool = False
    enabled: bool = True
    task: str | None = None
    task_pos: Pos | None = None
    variable: bool = False
    parameters: list[Parameter] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    state_offset: int | None = None  # of its IO_DEVICE in the data area; set by the compiler
    takes: str = ""  # what one device alone can have, such as "the line /dev/ttyS1"
    load: float | None = None  # of a line: the share of the time that its cyclic requests take; set by complete()

    @property
    def contents(self) -> dict[str, str]:
        """The files that its table names, with what is in them; a kind's own class overrides it if there are any."""
        return {}

    def complete(self, mistakes: Mistakes) -> None:
        """The types of all channels are known: a kind's own class overrides it to make what depends on them."""

    def describe(self, program: ProgramFacts) -> None:
        """The image is made: a kind's own class overrides it if its parameters describe the program."""


@dataclass
class Context:
    """What kinds share. `device`: what the vendor says of the board, None if nothing. `lines`: where each line of the
    board that is in use was named. `nodes`: who has a node number, by the number of a CANopen network."""

    mistakes: Mistakes
    device: DeviceFile | None = None
    lines: dict[str, Pos] = field(default_factory=dict)
    nodes: dict[int, dict[int, str]] = field(default_factory=dict)


@dataclass
class Description:
    """A description that was read. A parent comes before its children. `contents`: those of the files, by path, for
    messages. `readable`: the files are TOML. `board`: what the device it is for calls itself, "" for any; the compiler
    sets it."""

    path: str
    connectors: list[Connector]
    mistakes: Mistakes
    contents: dict[str, str]
    device: DeviceFile | None = None
    readable: bool = True
    board: str = ""

    @property
    def channels(self) -> list[tuple[Connector, Channel]]:
        """All of them, in order."""
        return [(connector, channel) for connector in self.connectors for channel in connector.channels]


def bits_of(t: Type) -> int:
    """The bits of a variable that a channel has: one of a BOOL, which takes a byte in memory."""
    return 1 if base_of(t) is BOOL else t.size * 8


def holds_bools(t: Type) -> bool:
    """Whether a type is an array of BOOL, each in a byte of its own."""
    while isinstance(t, ArrayType):
        t = t.element
        if base_of(t) is BOOL:
            return True
    return False
