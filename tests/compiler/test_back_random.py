"""Random programs do the same with and without optimisation, whole or in parts: memory, exceptions, lines."""

from __future__ import annotations

import random

import pytest
from back_support import POS, ProgramBuilder, Running, binary, build, const, load, place, pos
from shares import share

from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    BinaryOp,
    BitPlace,
    Call,
    Case,
    Convert,
    DerefPlace,
    Direction,
    Exit,
    Expr,
    FbCall,
    For,
    If,
    IndexPlace,
    Intrinsic,
    IntrinsicCall,
    MemberPlace,
    Parameter,
    Place,
    Pou,
    PouKind,
    ScalarInit,
    Statement,
    Storage,
    TypedProgram,
    Unary,
    UnaryOp,
    Variable,
)
from plctool.debug.symbols import SymbolTable
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    DWORD,
    INT,
    REAL,
    ArrayType,
    Field,
    PointerType,
    StringType,
    StructType,
)

POINT = StructType("Point", [Field("x", DINT), Field("b", BOOL), Field("y", DINT)])
POINT.lay_out()
NUMBERS = ArrayType(DINT, ((-2, 9),))
POINTS = ArrayType(POINT, ((0, 3),))
TEXT = StringType(12)
SAFE = [BinaryOp.ADD, BinaryOp.SUB, BinaryOp.MUL, BinaryOp.AND, BinaryOp.XOR]
ARITHMETIC = [*SAFE * 5, BinaryOp.DIV, BinaryOp.MOD]
COMPARE = [BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE]


class Generator:
    """Makes one program. `places` and `conditions` are what the POU being written can reach."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.line = 1
        self.numbers: list[Place] = []
        self.bools: list[Place] = []
        self.texts: list[Place] = []
        self.functions: list[Pou] = []
        self.blocks: list[tuple[Pou, list[Place]]] = []
        self.loops = 0

    # ---- expressions ----

    def number(self, depth: int = 2) -> Expr:
        choice = self.random.random()
        if depth == 0 or choice < 0.35:
            return load(self.random.choice(self.numbers))
        if choice < 0.5:
            return const(self.random.choice([0, 1, 2, 3, 7, -1, 100, 2**31 - 1, -(2**31)]), DINT)
        if choice < 0.57:
            return Convert(self.boolean(depth - 1), DINT, POS)
        if choice < 0.62 and self.functions:
            function = self.random.choice(self.functions)
            return Call(function, [self.number(depth - 1), self.random.choice(self.numbers)], DINT, POS)
        if choice < 0.67:
            narrow = Convert(self.number(depth - 1), INT, POS)
            return Convert(narrow, DINT, POS)
        if choice < 0.72:
            args = [self.number(depth - 1), self.number(depth - 1)]
            return IntrinsicCall(self.random.choice([Intrinsic.MIN, Intrinsic.MAX]), args, DINT, POS)
        if choice < 0.76:
            real = binary(BinaryOp.MUL, Convert(self.number(depth - 1), REAL, POS), const(0.37, REAL))
            return Convert(real, DINT, POS)
        e = binary(self.random.choice(ARITHMETIC), self.number(depth - 1), self.number(depth - 1))
        e.pos = pos(self.line)
        return e

    def boolean(self, depth: int = 2) -> Expr:
        choice = self.random.random()
        if depth == 0 or choice < 0.3:
            return load(self.random.choice(self.bools))
        if choice < 0.4:
            return Unary(UnaryOp.NOT, self.boolean(depth - 1), BOOL, POS)
        if choice < 0.7:
            return binary(self.random.choice(COMPARE), self.number(depth - 1), self.number(depth - 1))
        if choice < 0.75 and self.texts:
            return binary(self.random.choice(COMPARE), load(self.random.choice(self.texts)), self.text())
        ops = [BinaryOp.AND, BinaryOp.OR, BinaryOp.XOR, BinaryOp.AND_THEN, BinaryOp.OR_ELSE]
        e = binary(self.random.choice(ops), self.boolean(depth - 1), self.boolean(depth - 1))
        e.type = BOOL
        return e

    def text(self) -> Expr:
        if self.texts and self.random.random() < 0.6:
            return load(self.random.choice(self.texts))
        value = self.random.choice(["", "a", "abc", "hello world", "0123456789ABCDEF"])
        return const(value, StringType(len(value)))

    # ---- statements ----

    def statement(self, depth: int) -> Statement:
        self.line += 1
        here, choice = pos(self.line), self.random.random()
        if choice < 0.35 or depth == 0:
            return Assign(self.random.choice(self.numbers), self.number(), here)
        if choice < 0.5:
            return Assign(self.random.choice(self.bools), self.boolean(), here)
        if choice < 0.57 and self.texts:
            return Assign(self.random.choice(self.texts), self.text(), here)
        if choice < 0.72:
            branches = [(self.boolean(), self.body(depth - 1)) for _ in range(self.random.randint(1, 2))]
            return If(branches, self.body(depth - 1), here)
        if choice < 0.8:
            cases = [([(k * 3, k * 3 + 1)], self.body(depth - 1)) for k in range(3)]
            return Case(self.number(), cases, self.body(depth - 1), here)
        if choice < 0.87 and self.blocks:
            block, instances = self.random.choice(self.blocks)
            step, link = block.parameters[0].variable, block.parameters[1].variable
            linked, out = self.random.choice(self.numbers), self.random.choice(self.numbers)
            results = [(block.parameters[2].variable, out)]
            instance = self.random.choice(instances)
            return FbCall(block, instance, [(step, self.number(1))], [(link, linked)], results, here)
        return self.loop(depth, here.line)

    def loop(self, depth: int, line: int) -> Statement:
        """At most three deep and short, so that every program ends soon."""
        if self.loops >= 2:
            return Assign(self.random.choice(self.numbers), self.number(), pos(line))
        self.loops += 1
        body = self.body(depth - 1)
        if self.random.random() < 0.3:
            body.append(If([(self.boolean(1), [Exit(POS)])], [], POS))
        self.loops -= 1
        low, step = self.random.randint(-2, 3), self.random.choice([1, 1, 1, 2, 3])
        control = self.random.choice(self.counters)
        # Whatever the body does to the control variable, the count of turns ends the loop.
        turns = self.turns[self.loops]
        body.append(Assign(place(turns), binary(BinaryOp.ADD, load(turns), const(1, DINT)), POS))
        body.append(If([(binary(BinaryOp.GT, load(turns), const(12, DINT)), [Exit(POS)])], [], POS))
        start, stop = const(low, DINT), const(low + self.random.randint(-1, 8), DINT)
        loop = For(control, start, stop, const(step, DINT), body, pos(line))
        return If([(const(1, BOOL), [Assign(place(turns), const(0, DINT), POS), loop])], [], POS)

    def body(self, depth: int) -> list[Statement]:
        return [self.statement(depth) for _ in range(self.random.randint(1, 3))]

    # ---- program ----

    def function(self, name: str) -> Pou:
        """Name(a, b by reference): may change b, has locals of its own."""
        a, b = Variable("a", DINT, Storage.LOCAL, POS), Variable("b", DINT, Storage.REFERENCE, POS)
        result = Variable(name, DINT, Storage.LOCAL, POS)
        array = Variable("t", NUMBERS, Storage.LOCAL, POS)
        text = Variable("s", TEXT, Storage.LOCAL, POS, initial=ScalarInit("xyz"))
        flag = Variable("f", BOOL, Storage.LOCAL, POS)
        turns = [Variable(f"turns{i}", DINT, Storage.LOCAL, POS) for i in range(3)]
        self.numbers = [place(a), place(b), place(result), self.element(array, place(a)), self.element(array, None)]
        self.bools, self.texts = [place(flag)], [place(text)]
        self.counters, self.turns = [place(a), place(result)], turns
        parameters = [Parameter(a, Direction.INPUT), Parameter(b, Direction.IN_OUT, True)]
        start = self.line = self.line + 10
        body = [self.statement(2) for _ in range(3)]
        return Pou(
            name, PouKind.FUNCTION, pos(start), parameters, [result, array, text, flag, *turns], result, body=body
        )

    def block(self, name: str) -> tuple[Pou, StructType]:
        """Name(step, link by reference => out): has an array and counters that last."""
        members = {"step": DINT, "link": PointerType(DINT), "out": DINT, "f": BOOL, "n": DINT, "t": NUMBERS, "s": TEXT}
        members |= {f"turns{i}": DINT for i in range(3)}
        layout = StructType(name, [Field(n, t) for n, t in members.items()])
        layout.lay_out()
        fields = {f.name: f for f in layout.fields}
        v = {n: Variable(n, t, Storage.SELF, POS, offset=fields[n].offset) for n, t in members.items()}
        v["link"] = Variable("link", DINT, Storage.REFERENCE, POS, offset=fields["link"].offset)
        self.numbers = [place(v["step"]), place(v["link"]), place(v["out"]), place(v["n"])]
        self.numbers += [self.element(v["t"], place(v["n"])), self.element(v["t"], None)]
        self.bools, self.texts = [place(v["f"])], [place(v["s"])]
        self.counters, self.turns = [place(v["n"]), place(v["out"])], [v[f"turns{i}"] for i in range(3)]
        parameters = [
            Parameter(v["step"], Direction.INPUT), Parameter(v["link"], Direction.IN_OUT, True),
            Parameter(v["out"], Direction.OUTPUT),
        ]  # fmt: skip
        start = self.line = self.line + 10
        body = [self.statement(2) for _ in range(4)]
        return Pou(name, PouKind.FUNCTION_BLOCK, pos(start), parameters, instance=layout, body=body), layout

    def element(self, array: Variable, index: Place | None) -> IndexPlace:
        """With an index that stays within the bounds mostly."""
        if index is None:
            return IndexPlace(place(array), [const(self.random.randint(-2, 9), DINT)], DINT, POS)
        risky = self.random.random() < 0.1
        number = binary(BinaryOp.MOD if risky else BinaryOp.AND, load(index), const(11 if risky else 7, DINT))
        return IndexPlace(place(array), [number], DINT, POS)

    def program(self) -> TypedProgram:
        p = ProgramBuilder()
        self.functions = [self.function("F0")]
        self.functions.append(self.function("F1"))
        block, layout = self.block("Fb")
        d = [p.variable(f"d{i}", DINT, ScalarInit(self.random.randint(-9, 9))) for i in range(4)]
        b = [p.variable(f"b{i}", BOOL) for i in range(3)]
        array, points = p.variable("array", NUMBERS), p.variable("points", POINTS)
        word, bytes_ = p.variable("word", DWORD), p.variable("bytes", ArrayType(BYTE, ((0, 15),)))
        pointer, over = p.variable("pointer", PointerType(DINT)), p.variable("over", PointerType(POINT))
        texts = [
            p.variable("s0", TEXT, ScalarInit("start")),
            p.variable("s1", StringType(5)),
            p.variable("s2", StringType(40)),
        ]
        one, many = p.variable("one", layout), p.variable("many", ArrayType(layout, ((0, 1),)))
        index = IntrinsicCall(
            Intrinsic.MIN, [binary(BinaryOp.AND, load(d[0]), const(7, DINT)), const(3, DINT)], DINT, POS
        )
        point = IndexPlace(place(points), [index], POINT, POS)
        head = DerefPlace(load(over), POINT, POS)
        self.numbers = [*map(place, d), self.element(array, place(d[1])), self.element(array, None)]
        self.numbers += [
            MemberPlace(point, 0, DINT, POS),
            MemberPlace(point, 8, DINT, POS),
            DerefPlace(load(pointer), DINT, POS),
        ]
        self.numbers += [MemberPlace(head, 8, DINT, POS), MemberPlace(place(one), layout.fields[4].offset, DINT, POS)]
        self.bools = [*map(place, b), MemberPlace(point, 4, BOOL, POS), BitPlace(place(word), 5, BOOL, POS)]
        self.texts = [place(t) for t in texts]
        self.counters, self.turns = [place(d[2]), place(d[3])], [p.variable(f"turns{i}", DINT) for i in range(3)]
        self.blocks = [(block, [place(one), IndexPlace(place(many), [const(1, DINT)], layout, POS)])]
        first: list[Statement] = [
            Assign(place(pointer), AddressOf(self.random.choice(self.numbers[:6]), PointerType(DINT), POS), POS),
            Assign(place(over), AddressOf(place(bytes_), PointerType(POINT), POS), POS),
        ]
        self.line += 10
        return p.program(*first, *(self.statement(3) for _ in range(8)))


def meaningful(symbols: SymbolTable, memory: bytes) -> bytes:
    """The data area without addresses, and without what is after the NUL of strings."""
    data = bytearray(memory)
    for variable in symbols.variables.values():
        for leaf in variable.leaves():
            end = leaf.offset + leaf.size
            if isinstance(leaf.type, PointerType):
                data[leaf.offset : end] = bytes(leaf.size)
            elif isinstance(leaf.type, StringType):
                nul = data.find(0, leaf.offset, end)
                data[nul:end] = bytes(end - nul)
    return bytes(data)


def outcome(program: TypedProgram, level: int) -> list[tuple[int, object, bytes]]:
    """Of each cycle: what was raised, where, and the memory afterwards."""
    run = Running(build(program, level=level))
    found: list[tuple[int, object, bytes]] = []
    for _ in range(3):
        code = run.cycle()
        line = run.built.symbols.address_to_line(run.raised_at) if code else None
        memory = run.memory(0, 0, run.image.areas[0])
        found.append((code, line and (line.pou, line.line), meaningful(run.built.symbols, memory)))
    return found


@pytest.mark.parametrize("seed", share(range(36), 6))
def test_optimised_programs_do_the_same(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = outcome(Generator(seed).program(), 0)
    assert outcome(Generator(seed).program(), 2) == expected
    if seed % 6 == 0:
        monkeypatch.setattr("plctool.compiler.codegen.partition._WHOLE", 100)
        assert outcome(Generator(seed).program(), 2) == expected
