"""Random programs written from the grammar: the result is a diagnostic or a program, and what it builds does the same
with and without optimisation."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable

import pytest
from front_support import verify
from shares import share
from test_back_random import meaningful

from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import CheckResult, Source, check_sources
from plctool.compiler.image.build import build_program
from plctool.compiler.syntax.diagnostics import render
from plctool.compiler.typed.nodes import TypedProgram
from plctool.core import ffi, lib
from plctool.debug.symbols import SymbolTable
from plctool.iec.areas import Area
from plctool.iec.types import LREAL, REAL
from plctool.image.targets import find_target
from plctool.sim import Simulator

NUMBERS = ["SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT"]
REALS = ["REAL", "LREAL"]
TYPES = """
TYPE
    Color : (Red, Green := 5, Blue);
    Level : UINT (1..9) := 3;
    Point : STRUCT x : INT := 2; y : REAL; name : STRING[7]; on : BOOL; END_STRUCT;
    Row : ARRAY[-1..2] OF DINT;
    Both : UNION d : DINT; b : ARRAY[0..3] OF BYTE; END_UNION;
END_TYPE
INTERFACE Counts
METHOD Count : DINT
VAR_INPUT by : DINT; END_VAR
END_METHOD
END_INTERFACE
"""


class Writer:
    """Writes one program. `wild` is the share of expressions of another type than the one that is needed."""

    def __init__(self, seed: int, wild: float) -> None:
        self.r = random.Random(seed)
        self.wild = wild
        self.names: dict[str, list[str]] = {}
        self.functions: list[str] = []
        self.calls: list[Callable[[], str]] = []
        self.loops = 0  # loops around the statement being written
        self.counters = 0  # variables for loops that are used already

    def pick(self, *choices: str) -> str:
        return self.r.choice(choices)

    # ---- expressions ----

    def expression(self, kind: str, depth: int = 3) -> str:
        if self.r.random() < self.wild:
            kind = self.pick("number", "real", "bool", "text", "time", "enum")
        simple = depth == 0 or self.r.random() < 0.3
        if simple and self.names.get(kind) and self.r.random() < 0.7:
            return self.r.choice(self.names[kind])
        return getattr(self, f"_{kind}")(0 if simple else depth)  # type: ignore[no-any-return]

    def _number(self, depth: int) -> str:
        if not depth:
            typed = f"{self.r.choice(NUMBERS)}#{self.r.randint(0, 127)}"
            return self.pick("0", "1", "7", "100", "16#7F", "2#110_1010", "INT#-128", "DINT#-1", typed)
        a, b = self.expression("number", depth - 1), self.expression("number", depth - 1)
        return self.r.choice(
            [
                f"({a} {self.pick('+', '-', '*')} {b})",
                f"({a} {self.pick('/', 'MOD')} {self.r.choice(self.names['number'])})",
                f"-TO_INT({a})",
                f"TO_{self.r.choice(NUMBERS)}({a})",
                f"TO_{self.r.choice(NUMBERS)}({self.expression('real', depth - 1)})",
                f"{self.pick('MIN', 'MAX')}({a}, {b})",
                f"LIMIT(DINT#-5, TO_DINT({a}), DINT#50)",
                f"SEL({self.expression('bool', depth - 1)}, {a}, {b})",
                f"ABS({a})",
                f"LEN({self.expression('text', depth - 1)})",
                f"TO_DINT(SHL(TO_DWORD({a}), {self.r.randint(0, 40)}))",
                f"TO_INT(TO_WORD({a}) {self.pick('AND', 'OR', 'XOR')} TO_WORD({b}))",
                f"row[{self.index(a)}]",
                self.function(depth),
            ]
        )

    def index(self, number: str) -> str:
        if self.r.random() < 0.05:
            return self.r.choice(self.names["number"])
        return f"TO_INT(ABS(TO_INT(TO_USINT({number}))) MOD 4) - 1"

    def function(self, depth: int) -> str:
        if not self.functions or self.loops:  # each turn of a loop would multiply the time
            return "TO_DINT(7)"
        a, b = self.expression("number", depth - 1), self.expression("bool", depth - 1)
        where = self.pick("tally", "row[0]")
        return f"{self.r.choice(self.functions)}" + self.pick(f"(TO_INT({a}), {b}, {where})",
                                                              f"(n := TO_INT({a}), io := {where})")  # fmt: skip

    def _real(self, depth: int) -> str:
        if not depth:
            return self.pick("0.0", "1.5", "-2.25E3", "REAL#0.1", "1E-3")
        a, b = self.expression("real", depth - 1), self.expression("real", depth - 1)
        return self.r.choice(
            [
                f"({a} {self.pick('+', '-', '*')} {b})",
                f"({a} / {self.r.choice(self.names['real'])})",
                f"-({a})",
                f"TO_{self.r.choice(REALS)}({self.expression('number', depth - 1)})",
                f"SQRT(ABS({a}))",
                f"MAX({a}, {b})",
                f"SEL({self.expression('bool', depth - 1)}, {a}, {b})",
            ]
        )

    def _bool(self, depth: int) -> str:
        if not depth:
            return self.pick("TRUE", "FALSE", "BOOL#1")
        kind = self.pick("number", "number", "real", "text", "time", "enum")
        operator = self.pick("=", "<>") if kind == "enum" else self.pick("=", "<>", "<", "<=", ">", ">=")
        compared = f"({self.expression(kind, depth - 1)} {operator} {self.expression(kind, depth - 1)})"
        a, b = self.expression("bool", depth - 1), self.expression("bool", depth - 1)
        joined = f"({a} {self.pick('AND', 'OR', 'XOR', 'AND_THEN', 'OR_ELSE', '&')} {b})"
        converted = f"TO_BOOL({self.expression('number', depth - 1)})"
        return self.r.choice([compared, compared, joined, f"NOT ({a})", converted])

    def _text(self, depth: int) -> str:
        if not depth:
            return self.pick("''", "'abc'", "'$N$27x'", "'a longer text that does not fit'")
        a, b = self.expression("text", depth - 1), self.expression("text", depth - 1)
        n = f"TO_INT({self.expression('number', depth - 1)})"
        return self.r.choice([f"CONCAT({a}, {b})", f"LEFT({a}, {n})", f"MID({a}, 2, {n})", f"REPLACE({a}, {b}, 1, 2)",
                              f"TO_STRING(TO_DINT({n}))"])  # fmt: skip

    def _time(self, depth: int) -> str:
        if not depth:
            return self.pick("T#0s", "T#1h2m3s4ms", "T#-5ms", "TIME#1.5s")
        a = self.expression("time", depth - 1)
        return self.r.choice([f"({a} {self.pick('+', '-')} {self.expression('time', depth - 1)})", f"({a} * 2)"])

    def _enum(self, depth: int) -> str:
        if not depth:
            return self.pick("Red", "Color.Green", "Color#Blue")
        return f"SEL({self.expression('bool', depth - 1)}, {self._enum(0)}, {self.expression('enum', 0)})"

    # ---- statements ----

    def statements(self, depth: int, count: int = 3) -> str:
        return "\n".join(self.statement(depth) for _ in range(self.r.randint(1, count)))

    def statement(self, depth: int) -> str:
        if depth == 0 or self.r.random() < 0.45:
            return self.assignment()
        choices: list[Callable[[int], str]] = [self._if, self._case, self._leave, self._jump, self._try]
        choices.append(lambda _: self._call())
        if self.loops < 2:
            choices += [self._for, self._while, self._repeat]
        return self.r.choice(choices)(depth - 1)

    def assignment(self) -> str:
        kind = self.pick("number", "number", "real", "bool", "text", "time", "enum")
        if self.r.random() < 0.03:
            return "in_level := TO_UINT(tally);"
        targets = [name for name in self.names.get(kind, []) if not name.startswith("in_")]
        if not targets:
            return ";"
        if kind == "bool" and self.r.random() < 0.2:
            return f"{self.r.choice(targets)} {self.pick('S=', 'R=')} {self.expression('bool')};"
        target = self.r.choice(targets)
        value = self.expression(kind)
        return f"{target} := {value};"

    def _if(self, depth: int) -> str:
        text = f"IF {self.expression('bool')} THEN\n{self.statements(depth)}\n"
        if self.r.random() < 0.4:
            text += f"ELSIF {self.expression('bool')} THEN\n{self.statements(depth)}\n"
        if self.r.random() < 0.5:
            text += f"ELSE\n{self.statements(depth)}\n"
        return text + "END_IF;"

    def _case(self, depth: int) -> str:
        if self.r.random() < 0.4:
            text = f"CASE {self.expression('enum', 1)} OF\nRed:\n{self.statements(depth)}\nGreen, Blue:\n"
            return text + f"{self.statements(depth)}\nEND_CASE;"
        text = f"CASE TO_INT({self.expression('number')}) OF\n-1, 0:\n{self.statements(depth)}\n"
        text += f"1..{self.r.randint(2, 99)}:\n{self.statements(depth)}\n"
        return text + f"ELSE\n{self.statements(depth)}\nEND_CASE;"

    def _loop(self, depth: int) -> tuple[str, str]:
        """The variable that counts a loop, and its body."""
        self.counters += 1
        turn = f"turn{self.counters}"
        self.loops += 1
        body = self.statements(depth, 2)
        self.loops -= 1
        return turn, body

    def _for(self, depth: int) -> str:
        turn, body = self._loop(depth)
        step = self.pick("", " BY 2", " BY -1")
        return f"FOR {turn} := {self.r.randint(-3, 3)} TO {self.r.randint(-3, 5)}{step} DO\n{body}\nEND_FOR;"

    def _while(self, depth: int) -> str:
        turn, body = self._loop(depth)
        head = f"{turn} := 0;\nWHILE {turn} < 3 AND ({self.expression('bool')}) DO\n{turn} := {turn} + 1;"
        return f"{head}\n{body}\nEND_WHILE;"

    def _repeat(self, depth: int) -> str:
        turn, body = self._loop(depth)
        head = f"{turn} := 0;\nREPEAT\n{turn} := {turn} + 1;"
        return f"{head}\n{body}\nUNTIL {turn} > 2 OR {self.expression('bool')} END_REPEAT;"

    def _leave(self, depth: int) -> str:
        word = self.pick("EXIT", "CONTINUE", "RETURN") if self.loops else "RETURN"
        return f"IF {self.expression('bool')} THEN {word}; END_IF;"

    def _jump(self, depth: int) -> str:
        """Around statements, or back to repeat them; in an IF, as a branch of a CASE has no labels of its own."""
        self.counters += 1
        turn, label = f"turn{self.counters}", f"place{self.counters}"
        body, condition = self.statements(depth, 2), self.expression("bool")
        if self.r.random() < 0.5:
            return f"IF TRUE THEN\nIF {condition} THEN JMP {label}; END_IF\n{body}\n{label}:\nEND_IF;"
        again = f"IF {turn} < 3 AND ({condition}) THEN JMP {label}; END_IF"
        return f"IF TRUE THEN\n{turn} := 0;\n{label}:\n{turn} := {turn} + 1;\n{body}\n{again}\nEND_IF;"

    def _try(self, depth: int) -> str:
        body, caught = self.statements(depth), self.statements(depth, 2)
        last = self.pick("", f"__FINALLY\n{self.assignment()}\n")
        return f"__TRY\n{body}\n__CATCH(trouble)\n{caught}\n{last}__ENDTRY"

    def _call(self) -> str:
        return self.r.choice(self.calls)() if self.calls and not self.loops else self.assignment()

    # ---- units ----

    def variables(self) -> str:
        """The VAR section every unit has; it fills `names`."""
        lines, names = ["p : Point;", "row : Row;", "both : Both;", "tally : DINT;", "in_level : Level;"], self.names
        lines.append("trouble : __SYSTEM.ExceptionCode;")
        names.clear()
        names |= {"number": ["p.x", "tally", "row[0]", "both.d", "in_level"], "real": ["p.y"], "time": [], "enum": []}
        names |= {"bool": ["p.on", "both.b[1].3"], "text": ["p.name"]}
        kinds = {"real": REALS, "bool": ["BOOL"], "text": ["STRING", "STRING[5]"], "time": ["TIME"], "enum": ["Color"]}
        for kind, types in {"number": NUMBERS, **kinds}.items():
            for i in range(self.r.randint(1, 3)):
                name = f"{kind}{i}"
                names[kind].append(name)
                given = self._literal(kind) if self.r.random() < 0.4 else ""
                lines.append(f"{name} : {self.r.choice(types)}{given};")
        self.counters = 0
        return "\n".join(lines)

    def _literal(self, kind: str) -> str:
        if kind == "number":
            return f" := {self.r.randint(0, 127)}"
        given = {"real": "1.25", "bool": "TRUE", "text": "'ab'", "time": "T#3s", "enum": "Blue"}
        return f" := {given[kind]}"

    def unit(self, head: str, extra: str, foot: str, *, members: str = "", section: str = "VAR") -> str:
        variables = self.variables()
        self.names["number"].append("in_n")
        self.names["bool"].append("in_on")
        body = self.statements(3, 6)
        turns = "".join(f"turn{i + 1} : INT;\n" for i in range(self.counters))
        return f"{head}\n{extra}{section}\n{variables}\n{turns}END_VAR\n{members}{body}\n{foot}\n"

    def program(self) -> str:
        parts = [TYPES]
        for name in ("F0", "F1"):
            extra = "VAR_INPUT n : INT; on : BOOL := TRUE; END_VAR\nVAR_IN_OUT io : DINT; END_VAR\n"
            extra += "VAR in_n : INT := 3; in_on : BOOL; END_VAR\n"
            text = self.unit(f"FUNCTION {name} : DINT", extra, f"{name} := tally + io + n;\nio := tally;\nEND_FUNCTION")
            parts.append(text)
            self.functions.append(name)
        inputs = "VAR_INPUT in_n : INT; in_on : BOOL; END_VAR\nVAR_OUTPUT out : DINT; END_VAR\n"
        method = "METHOD Count : DINT\nVAR_INPUT by : DINT; END_VAR\nout := out + by;\nCount := out;\nEND_METHOD\n"
        parts.append(self.unit("FUNCTION_BLOCK Base IMPLEMENTS Counts", inputs, "END_FUNCTION_BLOCK", members=method))
        override = method.replace("METHOD", "METHOD OVERRIDE", 1).replace("out + by", "SUPER^.Count(by) - 1")
        parts.append(
            f"FUNCTION_BLOCK Derived EXTENDS Base\nVAR more : DINT; END_VAR\n{override}"
            "SUPER^();\nmore := THIS^.Count(2);\nEND_FUNCTION_BLOCK\n"
        )
        self.calls = [self._block_call, self._method_call]
        inside = "VAR in_n : INT := 4; in_on : BOOL; one : Base; many : ARRAY[0..1] OF Derived; any : Counts; END_VAR\n"
        text = self.unit("PROGRAM Main", inside, "END_PROGRAM")
        parts.append(text)
        return "".join(parts)

    def _block_call(self) -> str:
        block = self.pick("one", "many[1]", "many[0]")
        n, on = self.expression("number", 2), self.expression("bool", 2)
        inputs = self.pick(f"TO_INT({n}), {on}", f"in_on := {on}", f"in_n := TO_INT({n}), out => tally", "")
        return f"{block}({inputs});"

    def _method_call(self) -> str:
        block = self.pick("one", "many[1]")
        return f"any := {block};\ntally := any.Count({self.pick('1', 'tally', 'by := 3')});"


def checked(text: str) -> CheckResult:
    source = Source("main.st", text)
    result = check_sources([source])
    for diagnostic in result.diagnostics:
        assert render(diagnostic, [source])
    assert (result.program is None) == any(d.severity == "error" for d in result.diagnostics)
    if result.program is not None:
        verify(result.program)
    return result


def canonical(symbols: SymbolTable, memory: bytes) -> bytes:
    """The data without what has no meaning; that includes the sign of a NaN, which IEEE 754 leaves open."""
    data = bytearray(meaningful(symbols, memory))
    for leaf in (leaf for variable in symbols.variables.values() for leaf in variable.leaves()):
        if leaf.area == Area.DATA.value and leaf.type in (REAL, LREAL):
            (value,) = struct.unpack_from("<f" if leaf.type == REAL else "<d", data, leaf.offset)
            if math.isnan(value):
                data[leaf.offset : leaf.offset + leaf.size] = b"\xff" * leaf.size
    return bytes(data)


def outcome(program: TypedProgram, level: int) -> list[object]:
    """After each cycle: the exception and its line, and the memory."""
    built = build_program(program, Options(find_target("x86_64-linux"), level))
    found: list[object] = []
    with Simulator(built.image, built.symbols) as plc:
        for _ in range(2):
            plc.run_cycles(1, check=False)
            exception = plc.raw_status().exception
            line = exception and built.symbols.address_to_line(exception.code_offset or 0)
            size = program.area_sizes[Area.DATA]
            memory = bytes(ffi.buffer(lib.AppGetAreaAddress(Area.DATA.value, 0, size), size))
            found.append((exception and exception.name, line and line.line, canonical(built.symbols, memory)))
    return found


@pytest.mark.parametrize("seed", share(range(14), 3))
def test_random_program_does_the_same_at_every_level(seed: int) -> None:
    text = Writer(seed, 0).program()
    result = checked(text)
    assert result.program is not None, [d for d in result.diagnostics if d.severity == "error"]
    assert outcome(result.program, 2) == outcome(checked(text).program or result.program, 0), text


@pytest.mark.parametrize("seed", share(range(4), 2))
def test_random_program_with_wrong_types_is_diagnosed(seed: int) -> None:
    errors = 0
    for number in range(15):
        errors += not checked(Writer(1000 * seed + number, 0.04).program()).ok
    assert errors
