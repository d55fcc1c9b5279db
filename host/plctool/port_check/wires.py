"""Loop-back wires of the port check: each output is switched, and the input that it is wired to has to follow.

A program on the controller does it, cycle by cycle: one wire after the other, all other outputs low. So an input that
follows another output than its own is found, too: a wire at the wrong terminal, or a short circuit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

from plctool.errors import PlcError, UsageError
from plctool.port_check.bench import Bench, program
from plctool.port_check.report import Check, CheckFailed, Result

EDGES = 10  # of each output
INTERVAL = "T#1ms"  # of the task: delays are known to that
LIMIT_MS = 200  # longest delay of an input, with its filter
HOLD_MS = 10  # how long a level has to stay, besides the longest delay that was seen
PATIENCE = 60.0  # [s] for one wire; simulated boards are slow
NONE = -1

_CODE = """
IF step < 0 THEN
    FOR k := 0 TO {last_wire} DO
        fewest[k] := 16#7FFF_FFFF;
        also[k] := {none};
    END_FOR
    step := 0;
END_IF
now := LTIME_TO_LINT(LTIME());
{read}
CASE step OF
0:  (* all outputs are low, for as long as the slowest input may need *)
    FOR k := 0 TO {last_output} DO drive[k] := FALSE; END_FOR
    began := now;
    step := 1;
1:  IF now - began >= {limit} THEN
        rest := back;
        step := 2;
    END_IF
2:  drive[source[wire]] := NOT drive[source[wire]];
    began := now;
    cycles := 0;
    step := 3;
3:  cycles := cycles + 1;
    IF back[wire] = drive[source[wire]] THEN
        fewest[wire] := MIN(fewest[wire], cycles);
        most[wire] := MAX(most[wire], cycles);
        longest[wire] := MAX(longest[wire], now - began);
        began := now;
        step := 4;
    ELSIF now - began > {limit} THEN
        stuck[wire] := TRUE;
        began := now;
        step := 4;
    END_IF
4:  IF now - began >= {hold} + longest[wire] THEN
        IF NOT stuck[wire] AND back[wire] <> drive[source[wire]] THEN unsteady[wire] := TRUE; END_IF
        FOR k := 0 TO {last_wire} DO
            IF source[k] <> source[wire] AND back[k] <> rest[k] AND drive[source[wire]] THEN also[wire] := k; END_IF
        END_FOR
        edges[wire] := edges[wire] + 1;
        step := 2;
        IF stuck[wire] OR edges[wire] = {edges} THEN
            high[wire] := back[wire];
            step := 0;
            wire := wire + 1;
            IF wire > {last_wire} THEN step := 5; END_IF
        END_IF
    END_IF
5:  FOR k := 0 TO {last_output} DO drive[k] := FALSE; END_FOR
END_CASE
{write}
"""


@dataclass(frozen=True)
class Wire:
    """From a channel that is an output to one that is an input. A channel is a line of the board (IoDrvGpio), or
    MODULE.NAME of its `device.toml`."""

    output: str
    input: str

    @property
    def text(self) -> str:
        return f"{self.output}={self.input}"


@dataclass(frozen=True)
class Found:
    """What the controller saw of one wire. `longest_us` is the longest delay, `cycles` the least and the most cycles of
    the task; `high`: the input's last level; `also`: another wire, whose input followed this output."""

    edges: int
    stuck: bool
    unsteady: bool
    high: bool
    longest_us: float
    cycles: tuple[int, int]
    also: int | None


def parse_wire(text: str) -> Wire:
    """A wire as it is typed: DO0=DI0. Raises UsageError."""
    output, separator, input_ = text.partition("=")
    if not (separator and output.strip() and input_.strip()) or "=" in input_:
        raise UsageError(f"'{text}' is no wire; write OUTPUT=INPUT, for example DO0=DI0.", "wire")
    return Wire(output.strip(), input_.strip())


def check_wires(wires: Sequence[Wire]) -> None:
    """An output may lead to several inputs, an input comes from one output. Raises UsageError."""
    inputs: dict[str, Wire] = {}
    for wire in wires:
        first = inputs.setdefault(wire.input, wire)
        if first is not wire:
            raise UsageError(f"{wire.input} is the input of two wires, {first.text} and {wire.text}.", "wire")
        if any(other.output == wire.input for other in wires):
            raise UsageError(f"{wire.input} is the input of one wire and the output of another one.", "wire")


class Wires:
    """All wires of a board. They are measured by one program, when the first check asks."""

    def __init__(self, bench: Bench, wires: Sequence[Wire], device: Path | None) -> None:
        self._bench = bench
        self.wires = wires
        self._device = device
        self._problem = ""  # with all of them

    def checks(self) -> list[Check]:
        """One for each wire."""
        limits: Mapping[str, tuple[str, object]] = {"longest_ms": ("max", LIMIT_MS), "edges": ("equal", EDGES)}
        return [Check(f"wire {wire.text}", partial(self._check, i), limits) for i, wire in enumerate(self.wires)]

    def _check(self, index: int) -> Result:
        if self._problem:
            raise CheckFailed(self._problem)
        try:
            found = self._found[index]
        except (CheckFailed, PlcError) as error:
            self._problem = str(error)
            raise
        return judge_wire(self.wires, index, found)

    @cached_property
    def _outputs(self) -> list[str]:
        return list(dict.fromkeys(wire.output for wire in self.wires))

    @cached_property
    def _found(self) -> list[Found]:
        from plctool.compiler import CompileError

        try:
            self._bench.flash(self._program(), self._description(), self._device)
        except CompileError as error:
            raise CheckFailed("; ".join(d.message for d in error.diagnostics)) from None
        self._bench.need_monitoring()
        self._bench.wait_until_it_runs()
        count = len(self.wires)
        self._bench.wait(
            lambda: self._bench.plc.read("Main.wire") == count, "The wires are not through", PATIENCE * count
        )
        return [self._read(i) for i in range(count)]

    def _read(self, index: int) -> Found:
        names = ("edges", "stuck", "unsteady", "high", "longest", "fewest", "most", "also")
        values = self._bench.plc.read_all([f"Main.{name}[{index}]" for name in names])
        found = {name: values[f"Main.{name}[{index}]"] for name in names}
        also = found["also"] if found["also"] != NONE else None
        longest_us = found["longest"] / 1000
        cycles = (found["fewest"], found["most"])
        return Found(found["edges"], found["stuck"], found["unsteady"], found["high"], longest_us, cycles, also)

    # ---- the program ----

    def _program(self) -> str:
        last_wire, last_output = len(self.wires) - 1, len(self._outputs) - 1
        lines = "".join(f"q{k} : BOOL; " for k in range(last_output + 1))
        lines += "".join(f"i{k} : BOOL; " for k in range(last_wire + 1))
        source = ", ".join(str(self._outputs.index(wire.output)) for wire in self.wires)
        each_wire = f"ARRAY[0..{last_wire}] OF"
        variables = f"""VAR
    {lines}
    wire, k : DINT; step : DINT := -1; cycles : DINT;
    drive : ARRAY[0..{last_output}] OF BOOL;
    back, rest, stuck, unsteady, high : {each_wire} BOOL;
    source : {each_wire} DINT := [{source}];
    edges, fewest, most, also : {each_wire} DINT;
    longest : {each_wire} LINT;
    now, began : LINT; (* ns *)
END_VAR"""
        code = _CODE.format(
            none=NONE, limit=LIMIT_MS * 1_000_000, hold=HOLD_MS * 1_000_000, edges=EDGES,
            last_wire=last_wire, last_output=last_output,
            read="\n".join(f"back[{k}] := i{k};" for k in range(last_wire + 1)),
            write="\n".join(f"q{k} := drive[{k}];" for k in range(last_output + 1)),
        )  # fmt: skip
        return program(variables, code, INTERVAL)

    def _description(self) -> str:
        """What the channels are wired to in the program."""
        places: dict[str, list[str]] = {}
        for kind, channels in (("out", self._outputs), ("in", [wire.input for wire in self.wires])):
            for k, channel in enumerate(channels):
                module, name = self._place(channel)
                variable = f"Main.{'q' if kind == 'out' else 'i'}{k}"
                places.setdefault(f"{module}.{kind}", []).append(f'{json.dumps(name)} = "{variable}"\n')
        return "".join(f"[{table}]\n{''.join(lines)}" for table, lines in places.items())

    def _place(self, channel: str) -> tuple[str, str]:
        """The table of a channel, and its name in it."""
        module, _, name = channel.partition(".")
        if name and module in self._modules:
            return f"local.{module}", name
        return "gpio", channel

    @cached_property
    def _modules(self) -> frozenset[str]:
        """Names of the modules that the board has besides its lines."""
        from plctool.io.description import load_device

        device = load_device(self._device)[0] if self._device is not None else None
        return frozenset(device.modules) if device is not None else frozenset()


def judge_wire(wires: Sequence[Wire], index: int, found: Found) -> Result:
    """The text and figures of a wire that is as it should be. Raises CheckFailed for others."""
    wire = wires[index]
    other = wires[found.also].input if found.also is not None else None
    moved = found.cycles[1] > 0
    figures = {
        "edges": found.edges,
        "longest_ms": round(found.longest_us / 1000, 3) if moved else None,
        "cycles": list(found.cycles) if moved else None,
        "also": other,
    }
    if found.stuck:
        level = "high" if found.high else "low"
        follows = f"; {other} follows it" if other else ""
        raise CheckFailed(
            f"{wire.input} does not follow {wire.output} within {LIMIT_MS} ms: it stays {level}{follows}", **figures
        )
    if found.unsteady:
        raise CheckFailed(f"{wire.input} follows {wire.output} and does not keep the level", **figures)
    if other:
        raise CheckFailed(f"{other} follows {wire.output}, too", **figures)
    least, most = found.cycles
    cycles = f"{least}" if least == most else f"{least} to {most}"
    plural = "" if most == 1 else "s"
    text = f"follows within {found.longest_us / 1000:.1f} ms, {cycles} cycle{plural} of 1 ms; {found.edges} edges"
    return text, figures
