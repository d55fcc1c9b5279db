"""The variables that channels of inputs and outputs lead to.

A variable of a program, or a global one, that a channel names lives in the inputs or outputs, as if it had AT: where is
decided when the whole program is known (`io/layout.py`). A part of a variable, or of an instance, that a channel names
is copied by the task, as VAR_CONFIG does it. What is declared at an address of modules, such as %IX4.0.1, is where the
channel that names this address leads.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from plctool.compiler.base.source import Piece, Source
from plctool.compiler.semantics.allocation import Allocation
from plctool.compiler.semantics.names import Names
from plctool.compiler.semantics.symbols import GlobalSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics, did_you_mean
from plctool.compiler.typed.nodes import Pos, Pou, Storage, Task, Variable
from plctool.compiler.typed.typed_nodes import root_of, walk, written_places
from plctool.errors import UsageError
from plctool.iec.addresses import ModuleAddress, parse_address, parse_module_address
from plctool.iec.areas import Area
from plctool.iec.literals import LiteralKind
from plctool.iec.types import BOOL, Elementary, Kind, Type, base_of
from plctool.iec.values import encode
from plctool.io.configuration import MAX_BITS, MAX_ENTRIES
from plctool.io.layout import lay_out
from plctool.io.mistakes import CODE, Mistakes
from plctool.io.model import VALUE, Channel, Connector, Description, bits_of, holds_bools

DEVICE_TYPE = "IO_DEVICE"
_LIST = "Devices"  # the list of globals in which the variables of devices are
_PART = re.compile(r"[A-Za-z_]\w*|\[[^\]]*\]", re.ASCII)


def report(mistakes: Mistakes, diagnostics: Diagnostics) -> None:
    """Reports what was found since the last call."""
    found, mistakes.found[:] = mistakes.found[:], []
    for mistake in found:
        if mistake.severity == "error":
            diagnostics.error(mistake.pos, CODE, mistake.message)
        else:
            diagnostics.warning(mistake.pos, "io", mistake.message)


def device_variables(description: Description, declared: Iterable[str]) -> Source | None:
    """A list of globals with the IO_DEVICE of each device that has a name, but for those that the program has
    `declared` itself (names in small letters)."""
    first = {c.name.casefold(): c for c in reversed(description.connectors) if c.variable}  # two of a name are reported
    devices = [c for name, c in first.items() if name not in declared][::-1]
    if not devices:
        return None
    text, pieces = "VAR_GLOBAL ", [Piece(0, devices[0].pos.line, devices[0].pos.column, copied=False)]
    for connector in devices:
        pieces.append(Piece(len(text), connector.pos.line, connector.pos.column, copied=False))
        text += f"{connector.name} : {DEVICE_TYPE}; "
    path = description.path
    return Source(path, f"{text}END_VAR", _LIST, original=description.contents[path], pieces=tuple(pieces))


class IoChannels:
    """What a description says of the variables of a program; without one it says nothing."""

    def __init__(self, description: Description | None = None) -> None:
        self.description = description
        self._channels: dict[str, Channel] = {}  # by the full name of what they lead to, case-folded
        self._in_modules: dict[str, Channel] = {}  # by the address that they name, such as %IX4.0.1
        self._unmapped: dict[ModuleAddress, Pos] = {}  # such addresses that no channel names, where they are first
        self._without_channel: dict[str, str] = {}  # the variables at them, by address
        self._faulty = False  # the description has errors, so there may be more channels
        self._connected: dict[Variable, list[tuple[int, int, Channel]]] = {}  # bytes of it: first, end
        self.variables: dict[str, Variable] = {}  # that have become inputs or outputs, by full name case-folded

    @property
    def readable(self) -> bool:
        """Whether anything can be said of inputs and outputs."""
        return self.description is None or self.description.readable

    def is_device_without_name(self, name: str) -> bool:
        """Whether messages call a device by this name, which is none that the description gives it."""
        connectors = () if self.description is None else self.description.connectors
        return any(c.name.casefold() == name.casefold() and not c.variable for c in connectors)

    # ---- while variables are declared ----

    def begin(self, names: Names, diagnostics: Diagnostics) -> None:
        """Finds out what the targets are called in full, when all names are known. Declares the programs they are
        in."""
        if self.description is None:
            return
        self._faulty = any(mistake.severity == "error" for mistake in self.description.mistakes.found)
        report(self.description.mistakes, diagnostics)
        for _, channel in self.description.channels:
            if channel.at_address:
                continue
            if channel.target.startswith("%"):
                first = self._in_modules.setdefault(channel.target.upper(), channel)
                if first is not channel:
                    diagnostics.error(*_twice(channel, first))
                continue
            channel.variable = _full_name(channel.target, names)
            first = self._channels.setdefault(channel.variable.casefold(), channel)
            if first is not channel:
                diagnostics.error(*_twice(channel, first))
        for connector in self.description.connectors:
            key = connector.name.casefold()
            if connector.variable and (key in names.planned or names.own_unit(key) is not None):
                message = f"the program has a {connector.name} already; give the device another name"
                diagnostics.error(connector.pos, CODE, message)
        for key in {name.partition(".")[0] for name in self._channels} & names.planned.keys():
            names.instance(key)

    def area(self, name: str) -> Area | None:
        """Where the variable with this full name lives because a channel names it; None if none does."""
        channel = self._channels.get(name.casefold())
        return None if channel is None else _area(channel)

    def claims(self, letter: str, names: Sequence[str], diagnostics: Diagnostics) -> bool:
        """Whether a channel leads to a variable that is declared AT %I* or the like (`letter`) under these names."""
        channel = next((c for n in names if (c := self._channels.get(n.casefold())) is not None), None)
        if channel is None:
            return False
        if letter != _letter(channel):
            message = f"{names[0]} is declared AT %{letter}*, but the channel {channel.name} is an {_kind(channel)}"
            diagnostics.error(channel.pos, CODE, message)
        return True

    def bind(self, address: ModuleAddress, names: Sequence[str], pos: Pos, diagnostics: Diagnostics) -> None:
        """Notes that the variable with these names, the first of them in full, is at an address of modules: it lives
        where a channel leads that names the one or the other."""
        channel = self._in_modules.get(address.text)
        bound = self.bound(address)
        if bound:
            message = f"{address.text} is {bound} already; use that variable, or another address"
            diagnostics.error(pos, "location", message)
            return
        if channel is None:
            if not self.claims(address.text[1], names, diagnostics):
                self._unmapped.setdefault(address, pos)
                self._without_channel[address.text] = names[0]
            return
        channel.variable = names[0]
        other = self._channels.setdefault(names[0].casefold(), channel)
        if other is not channel:
            diagnostics.error(*_twice(channel, other))

    def bound(self, address: ModuleAddress) -> str:
        """The full name of the variable at an address of modules, "" if there is none yet."""
        channel = self._in_modules.get(address.text)
        return self._without_channel.get(address.text, "") if channel is None else channel.variable

    # ---- parts of variables ----

    def parts(self, variables: Iterable[Variable]) -> list[Channel]:
        """The channels that lead to no whole variable."""
        self.variables = {v.name.casefold(): v for v in variables if v.storage is Storage.AREA}
        self._connected = {
            v: [(0, v.type.size, self._channels[key])] for key, v in self.variables.items() if key in self._channels
        }
        return [c for key, c in self._channels.items() if key not in self.variables]

    def source(self) -> Source:
        """The description as a source, so that what is wrong with a name is reported where it stands."""
        assert self.description is not None
        return Source(self.description.path, self.description.contents[self.description.path])

    def path(self, channel: Channel, source: Source) -> ast.Expr:
        """The name of a channel's target as the program would write it."""
        at = source.line_starts[channel.pos.line - 1] + channel.pos.column  # after the quote
        path: ast.Expr | None = None
        for match in _PART.finditer(channel.target):
            text, offset = match.group(), at + match.start()
            if path is None:
                path = ast.Name(offset, text)
            elif text.startswith("["):
                indices: list[ast.Expr] = [_index(offset, i) for i in text[1:-1].split(",")]
                path = ast.Index(at, path, indices)
            else:
                path = ast.Member(at, path, text, offset)
        assert path is not None
        return path

    def place(
        self, channel: Channel, t: Type, root: Variable, offset: int, allocation: Allocation, diagnostics: Diagnostics
    ) -> Variable | None:
        """The input or output that is copied to or from what the channel names: a `t` at an offset in a variable. None
        if that variable has an address, so that nothing is to be copied."""
        self._connect(channel, root, offset, offset + t.size, diagnostics)
        variable = Variable(channel.target, t, Storage.AREA, channel.pos, _area(channel))
        self.variables[channel.variable.casefold()] = variable
        if root.area in (Area.INPUT, Area.OUTPUT) and root.offset >= 0:
            variable.area, variable.offset = root.area, root.offset + offset
            return None
        variable.shared_output = True  # a global instance is copied by every task
        allocation.add(variable)
        return variable

    def _connect(self, channel: Channel, root: Variable, start: int, end: int, diagnostics: Diagnostics) -> None:
        """Notes that a channel leads to these bytes of a variable, whatever it calls them; reports another one that
        does."""
        others = self._connected.setdefault(root, [])
        other = next((c for first, stop, c in others if first < end and start < stop), None)
        if other is not None:
            diagnostics.error(*_twice(channel, other))
        others.append((start, end, channel))

    # ---- when all is known ----

    def check_tasks(self, tasks: Sequence[Task], diagnostics: Diagnostics) -> None:
        """Reports tasks that the description names and the program does not have, and events that no task waits for."""
        if self.description is not None and not diagnostics.errors:
            _check_tasks(self.description, [task.name for task in tasks], diagnostics)
            _check_events(self.description, [task.external for task in tasks if task.external], diagnostics)

    def finish(self, allocation: Allocation, diagnostics: Diagnostics) -> None:
        """Gives the variables their addresses, and the channels type and offset."""
        self._report_unmapped(diagnostics)
        if self.description is None and self._unmapped:
            _lay_out_open(allocation)
        if self.description is None or diagnostics.errors:
            return
        self._report_devices(diagnostics)
        for _, channel in self.description.channels:
            if channel.at_address:
                self._reserve(channel, allocation)
            elif not channel.variable:
                self._declare(channel, allocation)
        self.variables |= {v.name.casefold(): v for v in allocation.variables if v.name.casefold() in self._channels}
        _lay_out_open(allocation)
        for connector, channel in self.description.channels:
            self._settle(connector, channel, diagnostics)
        if not diagnostics.errors:
            self._finish_devices(allocation, diagnostics)

    def _report_unmapped(self, diagnostics: Diagnostics) -> None:
        """Reports the first address for all. Without a description it is memory, so that a program of another system
        can be tried at once; in a description it is forgotten or mistyped."""
        if not self._unmapped or self._faulty:
            return
        address, pos = next(iter(self._unmapped.items()))
        more = f" (and {len(self._unmapped) - 1} more)" if len(self._unmapped) > 1 else ""
        message = f"no channel leads to {address.text}{more}"
        if self.description is None:
            hint = "name each address in a description of inputs and outputs (NAME.io.toml)"
            diagnostics.warning(pos, "unlocated", f"{message}, so it is memory that no device reads or writes; {hint}")
            return
        where = Path(self.description.path).name
        hint = f"name {address.text} in {where}, or number the bytes or words as in {address.numbered}"
        diagnostics.error(
            pos, "location", f"{message}, and only a description of inputs and outputs can say where it is; {hint}"
        )

    def _report_devices(self, diagnostics: Diagnostics) -> None:
        """What a device reports of itself is not what its channels lead to. An output may show it of another one."""
        assert self.description is not None
        names = {c.name.casefold() for c in self.description.connectors if c.variable}
        roots = {id(c): root for root, parts in self._connected.items() for _, _, c in parts}
        for connector, channel in self.description.channels:
            root = roots.get(id(channel))
            name = "" if root is None else root.name.rpartition(".")[2].casefold()
            if root is None or root.type.name != DEVICE_TYPE or name not in names:
                continue
            own, whole = name == connector.name.casefold(), channel.variable.casefold() == root.name.casefold()
            if own or whole or not channel.output:
                what = ("the device itself" if own else "a device") if whole else "what a device reports"
                message = f"{channel.target} is {what}; name a variable such as Main.x"
                diagnostics.error(channel.pos, CODE, message)

    def _declare(self, channel: Channel, allocation: Allocation) -> None:
        """The input or output of a channel that names an address of modules at which there is no variable."""
        address = parse_module_address(channel.target)
        assert address is not None
        channel.variable = address.text
        self._channels[address.text.casefold()] = channel
        allocation.add(Variable(address.text, address.type, Storage.AREA, channel.pos, address.area))

    @staticmethod
    def _reserve(channel: Channel, allocation: Allocation) -> None:
        """The area goes as far as a channel without a variable does."""
        address = parse_address(channel.target)
        assert address is not None
        end = address.offset + max(1, (channel.bits or address.type.bits) // 8)
        allocation.sizes[address.area] = max(allocation.sizes[address.area], end)

    def _settle(self, connector: Connector, channel: Channel, diagnostics: Diagnostics) -> None:
        if channel.at_address:
            address = parse_address(channel.target)
            assert address is not None
            channel.variable_type = address.type
            channel.area_bit = address.offset * 8 + address.bit
        else:
            variable = self.variables[channel.variable.casefold()]
            if variable.area is not _area(channel):
                diagnostics.error(channel.pos, CODE, _misplaced(channel, variable))
                return
            channel.variable_type = variable.type
            channel.area_bit = variable.offset * 8 + (variable.bit or 0)
        if problem := _misfit(connector, channel):
            diagnostics.error(channel.pos, CODE, problem)
        elif problem := _bad_substitute(channel):
            diagnostics.error(channel.substitute.pos or channel.pos, CODE, problem)

    def _finish_devices(self, allocation: Allocation, diagnostics: Diagnostics) -> None:
        assert self.description is not None
        devices = {v.name.rpartition(".")[2].casefold(): v for v in allocation.variables if v.type.name == DEVICE_TYPE}
        for connector in self.description.connectors:
            variable = devices.get(connector.name.casefold())
            if connector.variable and variable is None:
                message = f"the program has a variable {connector.name} already; declare it as {DEVICE_TYPE}"
                diagnostics.error(connector.pos, CODE, f"{message}, or give the device another name")
            elif connector.variable and variable is not None:
                connector.state_offset = variable.offset
            connector.complete(self.description.mistakes)
        report(self.description.mistakes, diagnostics)
        _report_double_use(self.description, diagnostics)
        _check_limits(self.description, allocation, diagnostics)

    def report_written_inputs(self, pous: Iterable[Pou], diagnostics: Diagnostics) -> None:
        """Warns of inputs that the program writes: the next cycle overwrites them."""
        if self.description is None:
            return
        inputs = sorted(
            ((c.area_bit, c.area_bit + c.size_bits, c) for _, c in self.description.channels if not c.output),
            key=lambda i: i[0],
        )
        reported = set[Variable]()
        for place in (place for pou in pous for node in walk(pou.body) for place in written_places(node)):
            root = root_of(place)
            if root is None or root.storage is not Storage.AREA or root.area is not Area.INPUT or root in reported:
                continue
            first = root.offset * 8 + (root.bit or 0)
            end = first + (1 if root.bit is not None else root.type.size * 8)
            channel = next((c for start, stop, c in inputs if start < end and first < stop), None)
            if channel is not None:
                reported.add(root)
                message = f"{root.name} is the input {channel.name}: the next cycle overwrites what is written here"
                diagnostics.warning(place.pos, "written-input", message)


# ---- questions -----------------------------------------------------------------------------------------------------


def _lay_out_open(allocation: Allocation) -> None:
    """Gives the inputs and outputs without an address one after those that have one."""
    for area in (Area.INPUT, Area.OUTPUT):
        open_ones = {v.name: v for v in allocation.variables if v.area is area and v.offset < 0}
        if open_ones:
            places = lay_out({name: v.type for name, v in open_ones.items()}, allocation.sizes[area])
            for name, offset in places.items():
                open_ones[name].offset = offset
                allocation.sizes[area] = max(allocation.sizes[area], offset + open_ones[name].type.size)


def _area(channel: Channel) -> Area:
    return Area.OUTPUT if channel.output else Area.INPUT


def _letter(channel: Channel) -> str:
    return "Q" if channel.output else "I"


def _kind(channel: Channel) -> str:
    return "output" if channel.output else "input"


def _full_name(target: str, names: Names) -> str:
    """`GVL.x` for `x`, if that is what the program calls it."""
    first, dot, rest = target.partition(".")
    if not dot:
        symbol = names.global_named(first.casefold())
        return target if symbol is None else symbol.full_name
    members = names.own_list(first.casefold())
    listed = members.members.get(rest.casefold()) if members is not None else None
    return listed.full_name if isinstance(listed, GlobalSymbol) else target


def _index(offset: int, text: str) -> ast.Expr:
    number = int(text)
    literal: ast.Expr = ast.Literal(offset, LiteralKind.INT, abs(number))
    return literal if number >= 0 else ast.Unary(offset, ast.Operator.SUB, literal)


def _where(first: Pos, pos: Pos) -> str:
    return f"in line {first.line}" if first.file == pos.file else f"in {first.file}:{first.line}"


def _twice(one: Channel, other: Channel, verb: str = "belongs to", end: str = "already") -> tuple[Pos, str, str]:
    """Two channels have the same memory: an error at the second of them."""
    first, second = sorted((one, other), key=lambda c: (c.pos.file, c.pos.line, c.pos.column))
    where = _where(first.pos, second.pos)
    return second.pos, CODE, f"{second.target} {verb} the channel {first.name} {where} {end}"


def _misplaced(channel: Channel, variable: Variable) -> str:
    """Why a variable is not where its channel needs it."""
    name = channel.target
    if variable.constant:
        return f"{name} is a constant; name a variable"
    if variable.keep.kept or variable.area is Area.RETAIN:
        return f"{name} is kept over a restart, which an {_kind(channel)} is not; copy it in the program"
    if variable.area is Area.DATA:
        return f"{name} is {variable.type}, which cannot be an {_kind(channel)}; name a variable in it"
    return f"{name} is at an address of the {variable.area.name.lower()}s, but {channel.name} is an {_kind(channel)}"


def _misfit(connector: Connector, channel: Channel) -> str:
    """Why a variable cannot be at a channel; "" if it can."""
    t, wanted = channel.variable_type, channel.type
    assert t is not None
    name = f"{connector.name}.{channel.name}"
    if channel.bits is not None and (bits_of(t) != channel.bits or holds_bools(t)):
        has = f"{channel.bits} bits" if wanted is None else f"{wanted}"
        return f"{channel.target} is {t}, but {name} is {has}{_fitting(channel)}"
    if bits_of(t) > MAX_BITS:
        return f"{channel.target} has {bits_of(t)} bits; a channel has at most {MAX_BITS}: name its elements"
    base, other = base_of(t), base_of(wanted) if wanted is not None else None
    if isinstance(base, Elementary) and isinstance(other, Elementary) and not _same_kind(base, other):
        return f"{channel.target} is {t}, but {name} is {wanted}: declare it as {wanted}"
    return ""


def _bad_substitute(channel: Channel) -> str:
    """What is wrong with `on_stop` or `on_error`; "" for nothing."""
    given = channel.substitute
    if given.what != VALUE:
        return ""
    assert channel.variable_type is not None
    key = "on_stop" if channel.output else "on_error"
    if isinstance(given.value, bool) and base_of(channel.variable_type) is not BOOL:
        return f"{key} is true or false, but {channel.target} is {channel.variable_type}"
    try:
        data = encode(channel.variable_type, given.value)
    except UsageError as error:
        words = ', or "hold" or "zero"' if isinstance(given.value, str) else ""
        return f"{key}: {error.message.removesuffix('.')}{words}"
    if any(data[4:]):
        return f'{key} can be "hold", "zero" or a value of at most 32 bits, not {given.value}'
    return ""


def _fitting(channel: Channel) -> str:
    if channel.type is not None:
        return f": declare it as {channel.type}" if not channel.target.startswith("%") else ""
    return ""


def _same_kind(one: Elementary, other: Elementary) -> bool:
    """Whether values mean the same: WORD goes with UINT and INT, INT not with UINT."""
    if Kind.BIT in (one.kind, other.kind):
        return {one.kind, other.kind} <= {Kind.BIT, Kind.INT}
    return one.kind is other.kind and one.signed == other.signed


def _report_double_use(description: Description, diagnostics: Diagnostics) -> None:
    for output in (False, True):
        channels = sorted(
            ((c.area_bit, c) for _, c in description.channels if c.output is output), key=lambda pair: pair[0]
        )
        last: Channel | None = None
        for start, channel in channels:
            if last is not None and start < last.area_bit + last.size_bits:
                diagnostics.error(*_twice(last, channel, "is where", "leads to already"))
            if last is None or start + channel.size_bits > last.area_bit + last.size_bits:
                last = channel


def _check_tasks(description: Description, tasks: Sequence[str], diagnostics: Diagnostics) -> None:
    known = {name.casefold() for name in tasks}
    for connector in description.connectors:
        if connector.task is not None and connector.task.casefold() not in known:
            hint = did_you_mean(connector.task, tasks) or f"; the program has {', '.join(tasks)}"
            diagnostics.error(connector.task_pos or connector.pos, CODE, f"there is no task {connector.task}{hint}")


def _check_events(description: Description, waited_for: Sequence[str], diagnostics: Diagnostics) -> None:
    """Warns of events that no task waits for. Their names differ in case, too."""
    for connector, channel in description.channels:
        event = channel.event
        if not event or event in waited_for or not connector.enabled:
            continue
        same = next((name for name in waited_for if name.casefold() == event.casefold()), None)
        hint = did_you_mean(event, waited_for) if same is None else f"; did you mean {same}?"
        hint = hint or f": write for example TASK Fast(EVENT := '{event}')"
        diagnostics.warning(channel.pos, CODE, f"no task waits for the event '{event}'{hint}")


def _check_limits(description: Description, allocation: Allocation, diagnostics: Diagnostics) -> None:
    device = description.device
    limits = dict.fromkeys(("connectors", "channels"), (MAX_ENTRIES, "an image"))
    if device is not None:
        limits |= {name: (limit, device.title) for name, limit in device.limits.items()}
    used = {
        "inputs": (allocation.sizes[Area.INPUT], "bytes of inputs"),
        "outputs": (allocation.sizes[Area.OUTPUT], "bytes of outputs"),
        "connectors": (len(description.connectors), "devices"),
        "channels": (len(description.channels), "channels"),
    }
    for name, (count, what) in used.items():
        limit, title = limits.get(name, (count, ""))
        if count > limit:
            where = description.channels[0][1].pos if description.channels else Pos(description.path, 1, 1)
            diagnostics.error(where, CODE, f"there are {count} {what}; {title} has room for {limit}")
