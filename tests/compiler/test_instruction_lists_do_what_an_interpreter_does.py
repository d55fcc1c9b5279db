"""Random lists of instructions: the compiled program stores what a machine with an accumulator and a stack stores."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from shares import share

from plctool.compiler import compile_sources
from plctool.sim import Simulator

BODIES = 10  # per program: compiling one costs more than running it
FUEL = 40  # labels that a body passes at most
BOOLS = [f"b{i}" for i in range(4)]
INTS = [f"i{i}" for i in range(4)]
LOGIC = ["AND", "OR", "XOR", "ANDN", "ORN", "XORN"]
ARITHMETIC = ["ADD", "SUB", "MUL"]
COMPARISONS = ["GT", "GE", "EQ", "NE", "LE", "LT"]


@dataclass
class Writer:
    """Makes a body. `kind`: of the result, B, I or "" for none. `labels`: the kind of result each is reached with."""

    r: random.Random
    lines: list[tuple[str, str, str]] = field(default_factory=list)  # label, operator, operand
    kind: str = ""

    def body(self) -> list[tuple[str, str, str]]:
        self.labels = {f"lab{n}": self.r.choice(["", "B", "I"]) for n in range(self.r.randint(0, 4))}
        waiting = list(self.labels)
        for _ in range(self.r.randint(3, 25)):
            if waiting and self.r.random() < 0.2:
                self.label(waiting.pop())
            self.instruction(depth=0)
        for name in waiting:
            self.label(name)
        return self.lines

    def label(self, name: str) -> None:
        wanted = self.labels[name]
        if wanted and self.kind != wanted:
            self.load(wanted)
        self.lines.append((name, "", ""))
        self.kind = wanted

    def add(self, word: str, operand: str = "", label: str = "") -> None:
        self.lines.append((label, word, operand))

    def load(self, kind: str) -> None:
        self.add(self.r.choice(["LD", "LDN"]) if kind == "B" else "LD", self.operand(kind))
        self.kind = kind

    def operand(self, kind: str) -> str:
        if kind == "B":
            return self.r.choice([*BOOLS, "TRUE", "FALSE"])
        return self.r.choice([*INTS, str(self.r.randint(-5, 300))])

    def instruction(self, depth: int) -> None:
        choice = self.r.randint(0, 9)
        if not self.kind or choice == 0:
            self.load(self.r.choice("BI") if not depth or not self.kind else self.kind)
        elif choice == 1 and depth == 0:
            self.jump()
        elif choice <= 3:
            self.store()
        elif choice <= 5 and depth < 3:
            self.bracket(depth)
        else:
            self.operator(self.operand(self.kind))

    def jump(self) -> None:
        fitting = [name for name, kind in self.labels.items() if kind in ("", self.kind)]
        words = ["JMP"] if self.kind == "I" else ["JMP", "JMPC", "JMPCN", "RETC", "RETCN"]
        word = self.r.choice(words)
        if word.startswith("RET"):
            self.add(word)
        elif fitting:
            self.add(word, self.r.choice(fitting))
            self.kind = "" if word == "JMP" else self.kind

    def store(self) -> None:
        if self.kind == "I":
            self.add("ST", self.r.choice(INTS))
        else:
            self.add(self.r.choice(["ST", "STN", "S", "R", "NOT"]), self.r.choice(BOOLS))
            if self.lines[-1][1] == "NOT":
                self.lines[-1] = ("", "NOT", "")

    def operator(self, operand: str, *, opens: bool = False) -> None:
        words = LOGIC if self.kind == "B" else ARITHMETIC if self.r.random() < 0.7 else COMPARISONS
        word = self.r.choice(words)
        self.add(word + "(" * opens, operand)
        if word in COMPARISONS:
            self.kind = "B"

    def bracket(self, depth: int) -> None:
        kind = self.kind
        first = self.operand(kind) if self.r.random() < 0.5 else ""
        self.operator(first, opens=True)
        result, self.kind = self.kind, kind if first else ""
        for _ in range(self.r.randint(1, 3)):
            self.instruction(depth + 1)
        if self.kind != kind:
            self.load(kind)
        self.add(")")
        self.kind = result


def text(lines: list[tuple[str, str, str]]) -> str:
    written = []
    for label, word, operand in lines:
        written.append(f"{label}:" if label else f"    {word} {operand}")
    return "\n".join(written)


def wrapped(value: int) -> int:
    return (value + 0x8000) % 0x10000 - 0x8000


class Machine:
    """Executes a body."""

    def __init__(self) -> None:
        self.memory: dict[str, int] = {**dict.fromkeys(BOOLS, 0), **dict(zip(INTS, (1, 7, -3, 100), strict=True))}

    def value(self, operand: str) -> int:
        if operand in ("TRUE", "FALSE"):
            return operand == "TRUE"
        return self.memory[operand] if operand in self.memory else int(operand)

    def combine(self, word: str, left: int, right: int) -> int:
        if word in LOGIC:
            right = not right if word.endswith("N") else right
            return {"A": left and right, "O": left or right, "X": left != right}[word[0]]
        if word in ARITHMETIC:
            return wrapped({"ADD": left + right, "SUB": left - right, "MUL": left * right}[word])
        return {
            "GT": left > right, "GE": left >= right, "EQ": left == right,
            "NE": left != right, "LE": left <= right, "LT": left < right,
        }[word]  # fmt: skip

    def run(self, lines: list[tuple[str, str, str]]) -> bool:
        """Whether the body ended before it ran out of fuel."""
        at, result, fuel = 0, 0, FUEL
        stack: list[tuple[str, int]] = []
        labels = {label: number for number, (label, *_) in enumerate(lines) if label}
        while at < len(lines):
            _, word, operand = lines[at]
            at += 1
            if not word:
                fuel -= 1
                if not fuel:
                    return False
            elif word in ("LD", "LDN"):
                result = self.value(operand) if word == "LD" else not self.value(operand)
            elif word in ("ST", "STN"):
                self.memory[operand] = result if word == "ST" else not result
            elif word in ("S", "R"):
                self.memory[operand] = word == "S" if result else self.memory[operand]
            elif word == "NOT":
                result = not result
            elif word == ")":
                opened, left = stack.pop()
                result = self.combine(opened, left, result)
            elif word.endswith("("):
                stack.append((word[:-1], result))
                result = self.value(operand) if operand else result
            elif word in LOGIC or word in ARITHMETIC or word in COMPARISONS:
                result = self.combine(word, result, self.value(operand))
            elif word == "JMP" or (word == "JMPC" and result) or (word == "JMPCN" and not result):
                at = labels[operand]
            elif (word == "RETC" and result) or (word == "RETCN" and not result):
                return True
        return True


def bodies(seed: int) -> list[list[tuple[str, str, str]]]:
    """Bodies that end."""
    r, found = random.Random(seed), list[list[tuple[str, str, str]]]()
    while len(found) < BODIES:
        lines = Writer(r).body()
        if Machine().run(lines):
            found.append(lines)
    return found


@pytest.mark.parametrize("seed", share(range(12), 3))
def test_random_lists(tmp_path: Path, seed: int) -> None:
    made = bodies(seed)
    numbers = "i0 : INT := 1; i1 : INT := 7; i2 : INT := -3; i3 : INT := 100;"
    variables = f"VAR_OUTPUT {', '.join(BOOLS)} : BOOL; {numbers} END_VAR"
    units = [f"FUNCTION_BLOCK Body{n}\n{variables}\n{text(lines)}\nEND_FUNCTION_BLOCK" for n, lines in enumerate(made)]
    instances = "\n".join(f"x{n} : Body{n};" for n in range(len(made)))
    calls = "\n".join(f"x{n}();" for n in range(len(made)))
    source = tmp_path / "lists.st"
    source.write_text("\n".join([*units, f"PROGRAM Main\nVAR\n{instances}\nEND_VAR\n{calls}\nEND_PROGRAM\n"]))
    built = compile_sources([source], level=seed % 3)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        for number, lines in enumerate(made):
            machine = Machine()
            machine.run(lines)
            found = {name: plc.read(f"Main.x{number}.{name}") for name in machine.memory}
            assert found == machine.memory, text(lines)
