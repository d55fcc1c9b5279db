"""Random bodies with nested __TRY, exceptions of all kinds, loops, jumps and calls: the compiled program takes the way
that an interpreter of the same statements takes, with and without optimisation."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from shares import share

from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.sim import Simulator

FUEL = 80  # statements of a block, after which its bodies return
UNITS = 8  # per program: compiling one costs more than running it
METHODS = 3  # each may call those after it
RAISES = {
    "h := h / zero;": lib.RTSEXCPT_DIVIDEBYZERO,
    "h := h MOD zero;": lib.RTSEXCPT_DIVIDEBYZERO,
    "a[h MOD 4 + 4] := 1;": lib.RTSEXCPT_ARRAYBOUNDS,
    "small := UDINT_TO_INT(h MOD 7) + 10;": lib.RTSEXCPT_ARRAYBOUNDS,
    "h := nothing^;": lib.RTSEXCPT_ACCESS_VIOLATION,
    "h := Quotient(h, zero);": lib.RTSEXCPT_DIVIDEBYZERO,
    "other(index := h MOD 4 + 4);": lib.RTSEXCPT_ARRAYBOUNDS,
    "h := some.Value(zero);": lib.RTSEXCPT_DIVIDEBYZERO,
    "text := Shown(zero);": lib.RTSEXCPT_DIVIDEBYZERO,
}
"""Statements that raise, and what."""

LIBRARY = """
INTERFACE IValue
METHOD Value : UDINT
VAR_INPUT by : UDINT; END_VAR
END_METHOD
END_INTERFACE
FUNCTION_BLOCK One IMPLEMENTS IValue
METHOD Value : UDINT
VAR_INPUT by : UDINT; END_VAR
Value := 10 / by;
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Two IMPLEMENTS IValue
METHOD Value : UDINT
VAR_INPUT by : UDINT; END_VAR
Value := Quotient(20, by);
END_METHOD
END_FUNCTION_BLOCK
FUNCTION Quotient : UDINT
VAR_INPUT a, b : UDINT; END_VAR
Quotient := a / b;
END_FUNCTION
FUNCTION Shown : STRING
VAR_INPUT by : UDINT; END_VAR
Shown := 'wrong';
Shown := UDINT_TO_STRING(1000 / by);
END_FUNCTION
FUNCTION_BLOCK Elements
VAR_INPUT index : UDINT; END_VAR
VAR a : ARRAY[0..3] OF INT; END_VAR
a[index] := 1;
END_FUNCTION_BLOCK
"""

VARIABLES = f"""
h : UDINT := 1; zero : UDINT; fuel : INT := {FUEL}; a : ARRAY[0..3] OF INT; small : INT(0..9);
nothing : POINTER TO UDINT; exc : __SYSTEM.ExceptionCode; other : Elements; one : One; two : Two; some : IValue;
text : STRING := 'kept';
"""


@dataclass
class Node:
    """A statement: its kind, a number that says what it is about, and the statements in it."""

    kind: str
    number: int = 0
    bodies: list[list[Node] | None] = field(default_factory=list)


class Writer:
    """Makes a body. `labels`: of the lists that the statement is in, as far as a JMP may lead there."""

    def __init__(self, r: random.Random, method: int) -> None:
        self.r = r
        self.method = method
        self.count = 0
        self.labels: list[int] = []
        self.loops = 0
        self.final = False  # in a __FINALLY

    def body(self, depth: int) -> list[Node]:
        nodes = [self.statement(depth) for _ in range(self.r.randint(1, 5))]
        if self.r.random() < 0.3:  # a label at the end, for a way out
            self.count += 1
            self.labels.append(self.count)
            nodes += [self.statement(depth), Node("label", self.labels.pop())]
        return nodes

    def statement(self, depth: int) -> Node:
        kinds = ["mark", "raise", "raise", "call", "try", "try", "try", "if", "for", "while", "leave", "leave"]
        kind, number = self.r.choice(kinds), self.r.randint(0, 99)
        if kind == "call" and self.method < METHODS:
            return Node("call", self.r.randint(self.method + 1, METHODS))
        if kind == "leave":
            return self.leave(number)
        if kind == "raise":
            return Node("raise", number)
        if depth == 0 or kind in ("mark", "call"):
            return Node("mark", number)
        if kind == "try":
            return self.attempt(depth - 1)
        inner = kind in ("for", "while")
        self.loops += inner
        bodies: list[list[Node] | None] = [self.body(depth - 1) for _ in range(1 if inner else 2)]
        self.loops -= inner
        return Node(kind, number, bodies)

    def attempt(self, depth: int) -> Node:
        body = self.body(depth)
        catch = self.body(depth) if self.r.random() < 0.7 else None
        last = None
        if catch is None or self.r.random() < 0.5:
            keep = self.loops, self.labels, self.final
            self.loops, self.labels, self.final = 0, [], True
            last = self.body(depth)
            self.loops, self.labels, self.final = keep
        return Node("try", 0, [body, catch, last])

    def leave(self, number: int) -> Node:
        ways = ["exit", "continue"] if self.loops else []
        ways += [] if self.final else ["return"]
        ways += ["jump"] * (2 * bool(self.labels))
        if not ways:
            return Node("mark", number)
        way = self.r.choice(ways)
        return Node(way, number, [[Node("to", self.r.choice(self.labels))]] if way == "jump" else [])


def when(number: int) -> str:
    return f"h MOD {number % 3 + 2} = {number % 2}"


def text(nodes: list[Node], depth: int = 0) -> Iterator[str]:
    for n in nodes:
        inner = ["" if body is None else "\n".join(text(body, depth + 1)) for body in n.bodies]
        yield "fuel := fuel - 1;"
        if n.kind == "mark":
            yield f"h := (h * 31 + {n.number + 1}) MOD 65521;"
        elif n.kind == "raise":
            yield f"IF {when(n.number)} THEN {list(RAISES)[n.number % len(RAISES)]} END_IF"
        elif n.kind == "call":
            yield f"IF fuel > 0 THEN THIS^.M{n.number}(); END_IF"
        elif n.kind == "label":
            yield f"lab{n.number}:"
        elif n.kind == "jump":
            assert n.bodies[0] is not None
            yield f"IF {when(n.number)} THEN JMP lab{n.bodies[0][0].number}; END_IF"
        elif n.kind in ("exit", "continue", "return"):
            yield f"IF {when(n.number)} THEN {n.kind.upper()}; END_IF"
        elif n.kind == "if":
            yield f"IF {when(n.number)} THEN\n{inner[0]}\nELSE\n{inner[1]}\nEND_IF"
        elif n.kind == "for":
            yield f"FOR i{depth} := 0 TO {n.number % 4} DO\n{inner[0]}\nEND_FOR"
        elif n.kind == "while":
            yield f"WHILE fuel > 0 AND {when(n.number)} DO\nfuel := fuel - 1;\n{inner[0]}\nEND_WHILE"
        elif n.kind == "try":
            yield f"__TRY\n{inner[0]}"
            if n.bodies[1] is not None:
                yield f"__CATCH(exc)\nh := (h * 31 + exc) MOD 65521;\n{inner[1]}"
            if n.bodies[2] is not None:
                yield f"__FINALLY\nh := (h * 31 + 7) MOD 65521;\n{inner[2]}"
            yield "__ENDTRY"


class Raised(Exception):
    """An exception of the program."""


class Machine:
    """Executes the bodies of one block."""

    def __init__(self, bodies: list[list[Node]]) -> None:
        self.bodies = bodies
        self.h, self.fuel = 1, FUEL

    def when(self, number: int) -> bool:
        return self.h % (number % 3 + 2) == number % 2

    def mix(self, number: int) -> None:
        self.h = (self.h * 31 + number) % 65521

    def run(self, nodes: list[Node]) -> str | int | None:
        """Why the statements ended: the label of a JMP out of them, return, exit, continue, or None at their end."""
        for at, node in enumerate(nodes):
            why = self.step(node)
            if isinstance(why, int) and any(n.kind == "label" and n.number == why for n in nodes[at:]):
                return None  # labels are last
            if why is not None:
                return why
        return None

    def step(self, n: Node) -> str | int | None:
        self.fuel -= 1
        if n.kind == "mark":
            self.mix(n.number + 1)
        elif n.kind == "raise":
            if self.when(n.number):
                raise Raised(list(RAISES.values())[n.number % len(RAISES)])
        elif n.kind == "call":
            if self.fuel > 0:
                self.run(self.bodies[n.number])
        elif n.kind == "jump":
            assert n.bodies[0] is not None
            return n.bodies[0][0].number if self.when(n.number) else None
        elif n.kind in ("exit", "continue", "return"):
            return n.kind if self.when(n.number) else None
        elif n.kind == "if":
            return self.run(n.bodies[0 if self.when(n.number) else 1] or [])
        elif n.kind == "for":
            return self.turns(n.bodies[0] or [], iter([True] * (n.number % 4 + 1) + [False]))
        elif n.kind == "while":
            return self.turns(n.bodies[0] or [], self.while_turns(n.number))
        elif n.kind == "try":
            return self.attempt(*n.bodies)
        return None

    def attempt(self, body: list[Node] | None, catch: list[Node] | None, last: list[Node] | None) -> str | int | None:
        try:
            try:
                return self.run(body or [])
            except Raised as error:
                if catch is None:
                    raise
                self.mix(error.args[0])
                return self.run(catch)
        finally:
            if last is not None:
                self.mix(7)
                assert self.run(last) is None

    def while_turns(self, number: int) -> Iterator[bool]:
        while self.fuel > 0 and self.when(number):
            self.fuel -= 1
            yield True
        yield False

    def turns(self, body: list[Node], goes_on: Iterator[bool]) -> str | int | None:
        while next(goes_on):
            why = self.run(body)
            if why == "exit":
                return None
            if why is not None and why != "continue":
                return why
        return None


def outcome(bodies: list[list[Node]]) -> tuple[int, int, int]:
    machine = Machine(bodies)
    try:
        machine.run(bodies[0])
    except Raised as error:
        return machine.h, machine.fuel, error.args[0]
    return machine.h, machine.fuel, 0


def block(number: int, bodies: list[list[Node]]) -> str:
    counters = f"VAR {', '.join(f'i{depth}' for depth in range(5))} : INT; END_VAR\n"
    methods = "".join(
        f"METHOD M{k}\n{counters}{chr(10).join(text(body))}\nEND_METHOD\n" for k, body in enumerate(bodies) if k
    )
    first = "IF fuel MOD 2 = 0 THEN some := one; ELSE some := two; END_IF\n" + "\n".join(text(bodies[0]))
    return f"FUNCTION_BLOCK Block{number}\nVAR\n{VARIABLES}END_VAR\n{counters}{methods}{first}\nEND_FUNCTION_BLOCK\n"


@pytest.mark.parametrize(("seed", "level"), share([(0, 0), (1, 2), (2, 2), (3, 0)], 2))
def test_the_compiled_body_takes_the_same_way(seed: int, level: int, tmp_path: Path) -> None:
    r = random.Random(seed)
    blocks = [[Writer(r, method).body(3) for method in range(METHODS + 1)] for _ in range(UNITS)]
    calls = "".join(f"__TRY b{k}();\n__CATCH(e{k})\n__ENDTRY\n" for k in range(UNITS))
    instances = "".join(f"b{k} : Block{k}; e{k} : __SYSTEM.ExceptionCode;\n" for k in range(UNITS))
    source = tmp_path / "main.st"
    source.write_text(
        LIBRARY
        + "".join(block(k, bodies) for k, bodies in enumerate(blocks))
        + f"PROGRAM Main\nVAR\n{instances}END_VAR\n{calls}END_PROGRAM\n"
    )
    result = compile_sources([source], level=level)
    with Simulator(result.image, result.symbols) as plc:
        plc.run_cycles(1)
        assert plc.status().exception is None
        found = [
            (plc.read(f"Main.b{k}.h"), plc.read(f"Main.b{k}.fuel"), getattr(lib, str(plc.read(f"Main.e{k}"))))
            for k in range(UNITS)
        ]
        assert {plc.read(f"Main.b{k}.text") for k in range(UNITS)} == {"kept"}
    assert found == [outcome(bodies) for bodies in blocks]


def test_the_random_bodies_raise_catch_and_go_outward() -> None:
    ends = []
    for seed in range(40):
        r = random.Random(seed)
        ends.append(outcome([Writer(r, method).body(3) for method in range(METHODS + 1)]))
    codes = {code for _, _, code in ends}
    assert codes >= {0, *RAISES.values()}
