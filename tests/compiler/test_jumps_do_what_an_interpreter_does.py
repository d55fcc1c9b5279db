"""Random bodies with labels, and JMPs to them from everywhere they may stand: the compiled program takes the way that
an interpreter of the same statements takes, with and without optimisation."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from shares import share

from plctool.compiler import compile_sources
from plctool.sim import Simulator

FUEL = 60  # turns of all loops together, after which a body returns
UNITS = 12  # per program: compiling one costs more than running it


@dataclass
class Node:
    """A statement: its kind, a number that says what it is about, and the statements in it."""

    kind: str
    number: int = 0
    bodies: list[list[Node]] = field(default_factory=list)


class Writer:
    """Makes a body. `open`: the labels of the lists that the statement is in."""

    def __init__(self, seed: int) -> None:
        self.r = random.Random(seed)
        self.labels = 0
        self.open: list[list[int]] = []
        self.loops = 0

    def body(self, depth: int) -> list[Node]:
        names = list(range(self.labels, self.labels + self.r.randint(0, 2)))
        self.labels += len(names)
        self.open.append(names)
        nodes = [self.statement(depth) for _ in range(self.r.randint(1, 5))]
        for name in names:
            nodes.insert(self.r.randint(0, len(nodes)), Node("label", name))
        self.open.pop()
        return nodes

    def statement(self, depth: int) -> Node:
        reachable = [name for names in self.open for name in names]
        kind = self.r.choice(["mark", "jump", "jump", "if", "if", "for", "while", "repeat", "case", "leave"])
        number = self.r.randint(0, 5)
        if kind == "jump" and reachable:
            return Node("jump", self.r.choice(reachable), [[Node("when", number)]] * self.r.randint(0, 3))
        if kind == "leave" and self.loops:
            return Node(self.r.choice(["exit", "continue"]), number)
        if depth == 0 or kind in ("mark", "jump", "leave"):
            return Node("mark", number)
        inner = kind in ("for", "while", "repeat")
        self.loops += inner
        bodies = [self.body(depth - 1) for _ in range(1 if inner else 2)]
        self.loops -= inner
        return Node(kind, number, bodies)


def when(number: int) -> str:
    return f"h MOD {number % 3 + 2} = {number % 2}"


def text(nodes: list[Node], depth: int = 0) -> Iterator[str]:
    for n in nodes:
        inner = ["\n".join(text(body, depth + 1)) for body in n.bodies]
        if n.kind == "mark":
            yield f"h := (h * 31 + {n.number + 1}) MOD 65521;"
        elif n.kind == "label":
            yield f"lab{n.number}: fuel := fuel - 1; IF fuel <= 0 THEN RETURN; END_IF"
        elif n.kind == "jump":
            jump = f"JMP Lab{n.number};"
            yield f"IF {when(n.bodies[0][0].number)} THEN {jump} END_IF" if n.bodies else jump
        elif n.kind in ("exit", "continue"):
            yield f"IF {when(n.number)} THEN {n.kind.upper()}; END_IF"
        elif n.kind == "if":
            yield f"IF {when(n.number)} THEN\n{inner[0]}\nELSE\n{inner[1]}\nEND_IF"
        elif n.kind == "case":
            # A branch itself has no labels.
            yield f"CASE h MOD 3 OF 0: IF TRUE THEN\n{inner[0]}\nEND_IF\nELSE\n{inner[1]}\nEND_CASE"
        elif n.kind == "for":
            yield f"FOR i{depth} := 0 TO {n.number} DO\n{inner[0]}\nEND_FOR"
        elif n.kind == "while":
            yield f"WHILE fuel > 0 AND {when(n.number)} DO\nfuel := fuel - 1;\n{inner[0]}\nEND_WHILE"
        elif n.kind == "repeat":
            yield f"REPEAT\nfuel := fuel - 1;\n{inner[0]}\nUNTIL fuel <= 0 OR {when(n.number)}\nEND_REPEAT"


class Ends(Exception):
    """RETURN."""


class Machine:
    """Executes a body."""

    def __init__(self) -> None:
        self.h, self.fuel = 1, FUEL

    def when(self, number: int) -> bool:
        return self.h % (number % 3 + 2) == number % 2

    def run(self, nodes: list[Node]) -> str | int | None:
        """Why the statements ended: the label of a JMP out of them, exit, continue, or None at their end."""
        at = 0
        while at < len(nodes):
            why = self.step(nodes[at])
            at += 1
            if isinstance(why, int):
                own = [k for k, node in enumerate(nodes) if node.kind == "label" and node.number == why]
                if not own:
                    return why
                at = own[0]
            elif why is not None:
                return why
        return None

    def burn(self) -> None:
        self.fuel -= 1

    def step(self, n: Node) -> str | int | None:
        if n.kind == "mark":
            self.h = (self.h * 31 + n.number + 1) % 65521
        elif n.kind == "label":
            self.burn()
            if self.fuel <= 0:
                raise Ends
        elif n.kind == "jump":
            return n.number if not n.bodies or self.when(n.bodies[0][0].number) else None
        elif n.kind in ("exit", "continue"):
            return n.kind if self.when(n.number) else None
        elif n.kind == "if":
            return self.run(n.bodies[0 if self.when(n.number) else 1])
        elif n.kind == "case":
            return self.run(n.bodies[0 if self.h % 3 == 0 else 1])
        elif n.kind == "for":
            return self.turns(n.bodies[0], iter([True] * (n.number + 1) + [False]))
        elif n.kind == "while":
            return self.turns(n.bodies[0], self.while_turns(n.number))
        else:
            return self.turns(n.bodies[0], self.repeat_turns(n.number))
        return None

    def while_turns(self, number: int) -> Iterator[bool]:
        while self.fuel > 0 and self.when(number):
            self.burn()
            yield True
        yield False

    def repeat_turns(self, number: int) -> Iterator[bool]:
        while True:
            self.burn()
            yield True
            if self.fuel <= 0 or self.when(number):
                yield False

    def turns(self, body: list[Node], goes_on: Iterator[bool]) -> int | None:
        while next(goes_on):
            why = self.run(body)
            if why == "exit":
                return None
            if isinstance(why, int):
                return why
        return None


def outcome(nodes: list[Node]) -> tuple[int, int]:
    machine = Machine()
    with suppress(Ends):
        machine.run(nodes)
    return machine.h, machine.fuel


@pytest.mark.parametrize(("seed", "level"), share([(0, 0), (1, 2), (2, 2), (3, 0), (4, 2)], 2))
def test_the_compiled_body_takes_the_same_way(seed: int, level: int, tmp_path: Path) -> None:
    bodies = [Writer(seed * UNITS + k).body(3) for k in range(UNITS)]
    counters = ", ".join(f"i{depth}" for depth in range(5))
    units = [
        f"FUNCTION_BLOCK Block{k}\nVAR h : UDINT := 1; fuel : INT := {FUEL}; {counters} : INT; END_VAR\n"
        + "\n".join(text(body))
        + "\nEND_FUNCTION_BLOCK\n"
        for k, body in enumerate(bodies)
    ]
    calls = "".join(f"b{k}();\n" for k in range(UNITS))
    instances = "".join(f"b{k} : Block{k};\n" for k in range(UNITS))
    source = tmp_path / "main.st"
    source.write_text("".join(units) + f"PROGRAM Main\nVAR\n{instances}END_VAR\n{calls}END_PROGRAM\n")
    result = compile_sources([source], level=level)
    with Simulator(result.image, result.symbols) as plc:
        plc.run_cycles(1)
        assert plc.status().exception is None
        found = [(plc.read(f"Main.b{k}.h"), plc.read(f"Main.b{k}.fuel")) for k in range(UNITS)]
    assert found == [outcome(body) for body in bodies]
