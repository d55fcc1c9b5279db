"""Random programs that write single bits in every way there is, and what the bytes hold afterwards.

A byte of an area is the sum of its bits, so a write that misses its bit, or takes a neighbour with it, shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from hypothesis import strategies as st

AREA_BYTES = 3  # of each area that the programs use
INTEGERS = {"BYTE": 8, "SINT": 8, "USINT": 8, "WORD": 16, "INT": 16, "DWORD": 32, "UDINT": 32, "LWORD": 64, "LINT": 64}

HEAD = """TYPE On : BOOL := TRUE; END_TYPE
TYPE Holder : STRUCT before : BYTE; w : WORD; END_STRUCT END_TYPE
FUNCTION Same : BOOL
VAR_INPUT x : BOOL; END_VAR
Same := x;
END_FUNCTION
FUNCTION Give : INT
VAR_INPUT x : BOOL; END_VAR
VAR_OUTPUT y : BOOL; END_VAR
y := x;
Give := 1;
END_FUNCTION
FUNCTION_BLOCK Block
VAR_INPUT x : BOOL; END_VAR
VAR_OUTPUT y : BOOL; END_VAR
VAR inner : WORD; END_VAR
METHOD Method
VAR_INPUT x : BOOL; END_VAR
VAR_OUTPUT y : BOOL; END_VAR
y := x;
END_METHOD
y := x;
END_FUNCTION_BLOCK
"""


@dataclass
class BitProgram:
    """`text` declares PROGRAM Main; `expected`: what its variables hold after one cycle."""

    text: str
    expected: dict[str, int]


@dataclass
class _Writer:
    """The program as far as it is made. `memory`: the bytes of each area, `words`: integers by the text that reaches
    them, with their number of bits."""

    draw: st.DrawFn
    memory: dict[str, list[int]] = field(default_factory=lambda: {a: [0] * AREA_BYTES for a in "IQM"})
    words: dict[str, tuple[str, int, int]] = field(default_factory=dict)  # type, bits, value
    globals: list[str] = field(default_factory=list)
    locals: list[str] = field(default_factory=list)
    config: list[str] = field(default_factory=list)
    body: list[str] = field(default_factory=list)
    bits: list[tuple[str, str, int]] = field(default_factory=list)  # name, area, number

    def set(self, area: str, number: int, value: bool) -> None:
        byte, bit = divmod(number, 8)
        self.memory[area][byte] = self.memory[area][byte] & ~(1 << bit) | value << bit

    # ---- declarations ----

    def background(self) -> None:
        """Whole bytes with initial values, declared before the bits that are in them."""
        for area in "IQM":
            for byte in range(AREA_BYTES):
                value = self.draw(st.sampled_from([None, 0x00, 0xFF, 0xA5, 0x5A]))
                if value is not None:
                    self.globals.append(f"b{area}{byte} AT %{area}B{byte} : BYTE := 16#{value:02X};")
                    self.memory[area][byte] = value

    def declare(self, index: int, area: str, number: int) -> None:
        """A located bit, somewhere, with some initial value."""
        address = f"%{area}X{number // 8}.{number % 8}"
        kind = self.draw(st.sampled_from(["global", "local", "config", "config init", "nameless", "direct"]))
        name = f"bit{index}"
        first = self.draw(st.sampled_from([None, True, False]))
        text, spec = "" if first is None else f" := {str(first).upper()}", "BOOL"
        if kind in ("global", "local") and self.draw(st.booleans()):
            if first is None:
                spec, first = "On", True
            else:
                text = f" := Same({'NOT ' * (not first)}yes)"
        if kind == "direct":
            first, name = None, address
        elif kind == "nameless":
            self.globals.append(f"AT {address} : BOOL{text};")
            name = address
        elif kind in ("global", "local"):
            (self.globals if kind == "global" else self.locals).append(f"{name} AT {address} : {spec}{text};")
        else:
            opposite = "" if first is None else f" := {str(not first).upper()}"
            here, there = (opposite, text) if kind == "config init" else (text, "")
            self.locals.append(f"{name} AT %{area}* : BOOL{here};")
            self.config.append(f"Main.{name} AT {address} : BOOL{there};")
        if first is not None:
            self.set(area, number, first)
        self.bits.append((name, area, number))

    def declare_words(self) -> None:
        """Integers, whose bits are written by number: alone, in arrays, structures and blocks, through a pointer."""
        for index, (name, bits) in enumerate(INTEGERS.items()):
            value = self.draw(st.integers(0, (1 << bits) - 1))
            self.locals.append(f"n{index} : {name};")
            self.body.append(f"n{index} := LWORD_TO_{name}(16#{value:X});")
            self.words[f"n{index}"] = (name, bits, value)
        self.locals += ["s : Holder;", "a : ARRAY[1..3] OF DWORD;", "p : POINTER TO WORD;", "r : REFERENCE TO WORD;"]
        self.locals += ["pw, rw : WORD;", "i : INT := 2;"]
        self.body += ["p := ADR(pw); r REF= rw;"]
        for reach, name in (("s.w", "WORD"), ("a[i]", "DWORD"), ("p^", "WORD"), ("r", "WORD")):
            self.words[reach] = (name, INTEGERS[name], 0)

    # ---- statements ----

    def write(self) -> None:
        """One bit written in one of the ways; what the program knows of it is kept."""
        value = self.draw(st.booleans())
        how = self.draw(st.sampled_from(_WAYS))
        if self.draw(st.booleans()):
            name, area, number = self.draw(st.sampled_from(self.bits))
            old = bool(self.memory[area][number // 8] >> number % 8 & 1)
            new = how(self, name, old, value)
            self.set(area, number, new)
            return
        reach = self.draw(st.sampled_from(sorted(self.words)))
        kind, bits, word = self.words[reach]
        bit = self.draw(st.integers(0, bits - 1))
        target = f"{reach}.{bit}" if self.draw(st.booleans()) else f"{reach}.%X{bit}"
        new = how(self, target, bool(word >> bit & 1), value)
        self.words[reach] = (kind, bits, word & ~(1 << bit) | new << bit)

    def say(self, text: str) -> None:
        self.body.append(text)


def _constant(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"{name} := {str(value).upper()};")
    return value


def _value(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"{name} := {'NOT ' * (not value)}yes;")
    return value


def _toggled(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"{name} := NOT {name};")
    return not old


def _chained(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"x := {name} := {'NOT ' * (not value)}yes;")
    return value


def _set(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"{name} S= {'NOT ' * (not value)}yes;")
    return old or value


def _reset(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"{name} R= {'NOT ' * (not value)}yes;")
    return old and not value


def _result(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"{name} := Same({'NOT ' * (not value)}yes);")
    return value


def _function_output(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"Give(x := {'NOT ' * (not value)}yes, y => {name});")
    return value


def _block_output(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"block(x := {'NOT ' * (not value)}yes, y => {name});")
    return value


def _negated_output(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"block(x := {'NOT ' * value}yes, NOT y => {name});")
    return value


def _method_output(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"block.Method(x := {'NOT ' * (not value)}yes, y => {name});")
    return value


def _enabled(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"Give(EN := {'NOT ' * (not value)}yes, x := TRUE, ENO => {name});")
    return value


def _in_loop(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"FOR k := 0 TO 3 DO {name} := k {'=' if value else '<>'} 3; END_FOR;")
    return value


def _in_branch(w: _Writer, name: str, old: bool, value: bool) -> bool:
    w.say(f"IF {'NOT ' * (not value)}yes THEN {name} := yes; ELSE {name} := NOT yes; END_IF;")
    return value


_WAYS: list[Callable[[_Writer, str, bool, bool], bool]] = [
    _constant, _value, _toggled, _chained, _set, _reset, _result, _function_output, _block_output, _negated_output,
    _method_output, _enabled, _in_loop, _in_branch,
]  # fmt: skip


@st.composite
def bit_programs(draw: st.DrawFn) -> BitProgram:
    """A program of located bits and integers, many of them written one bit at a time."""
    w = _Writer(draw)
    w.background()
    places = st.tuples(st.sampled_from("IQM"), st.integers(0, 8 * AREA_BYTES - 1))
    for index, (area, number) in enumerate(draw(st.lists(places, min_size=2, max_size=12, unique=True))):
        w.declare(index, area, number)
    w.declare_words()
    for _ in range(draw(st.integers(0, 24))):
        w.write()
    return _program(w)


def _program(w: _Writer) -> BitProgram:
    expected: dict[str, int] = {}
    for area, data in w.memory.items():
        for byte, value in enumerate(data):
            w.body.append(f"seen{area}[{byte}] := %{area}B{byte};")
            expected[f"Main.seen{area}[{byte}]"] = value
    for reach, (kind, bits, word) in w.words.items():
        name = f"see_{len(expected)}"
        w.locals.append(f"{name} : LWORD;")
        unsigned = {8: "BYTE", 16: "WORD", 32: "DWORD", 64: "LWORD"}[bits]
        value = reach if kind == unsigned else f"{kind}_TO_{unsigned}({reach})"
        w.body.append(f"{name} := {value};")
        expected[f"Main.{name}"] = word
    w.locals += [f"seen{area} : ARRAY[0..{AREA_BYTES - 1}] OF BYTE;" for area in "IQM"]
    w.locals += ["block : Block;", "x : BOOL;", "k : INT;"]
    parts = [
        HEAD,
        "VAR_GLOBAL\nyes : BOOL := TRUE;\n" + "".join(f"{line}\n" for line in w.globals) + "END_VAR\n",
        "PROGRAM Main\nVAR\n" + "".join(f"{line}\n" for line in w.locals) + "END_VAR\n",
        "".join(f"{line}\n" for line in w.body) + "END_PROGRAM\n",
    ]
    if w.config:
        parts.append("VAR_CONFIG\n" + "".join(f"{line}\n" for line in w.config) + "END_VAR\n")
    return BitProgram("".join(parts), expected)


BLOCKS = """FUNCTION_BLOCK Sensor
VAR bit AT %I* : BOOL; END_VAR
VAR_OUTPUT y : BOOL; END_VAR
y := bit;
END_FUNCTION_BLOCK
FUNCTION_BLOCK Coil
VAR_INPUT x : BOOL; END_VAR
VAR bit AT %Q* : BOOL; END_VAR
bit := x;
END_FUNCTION_BLOCK
FUNCTION_BLOCK Flag
VAR_INPUT invert : BOOL; END_VAR
VAR bit AT %M* : BOOL; END_VAR
IF invert THEN bit := NOT bit; END_IF;
END_FUNCTION_BLOCK
"""


@st.composite
def block_programs(draw: st.DrawFn) -> BitProgram:
    """Blocks whose bits are at addresses that VAR_CONFIG gives: the task copies each in or out."""
    bools = st.lists(st.booleans(), min_size=8 * AREA_BYTES, max_size=8 * AREA_BYTES)
    order = draw(st.permutations(range(8 * AREA_BYTES)))
    first, written, inverted = draw(bools), draw(bools), draw(bools)
    config, body = [], []
    expected: dict[str, int] = {}
    for number in order:
        place, value = f"{number // 8}.{number % 8}", str(first[number]).upper()
        for name, area in (("sensor", "I"), ("coil", "Q"), ("flag", "M")):
            config.append(f"Main.{name}[{number}].bit AT %{area}X{place} : BOOL := {value};")
        body.append(f"sensor[{number}](y => seen[{number}]);")
        body.append(f"coil[{number}](x := {str(written[number]).upper()});")
        body.append(f"flag[{number}](invert := {str(inverted[number]).upper()});")
        expected[f"Main.seen[{number}]"] = first[number]
        expected[f"coils.{number}"] = written[number]
        expected[f"flags.{number}"] = first[number] != inverted[number]
    last = 8 * AREA_BYTES - 1
    text = [
        BLOCKS, "VAR_GLOBAL coils AT %QD0 : DWORD; flags AT %MD0 : DWORD; END_VAR\n", "PROGRAM Main\nVAR\n",
        f"sensor : ARRAY[0..{last}] OF Sensor; coil : ARRAY[0..{last}] OF Coil; flag : ARRAY[0..{last}] OF Flag;\n",
        f"seen : ARRAY[0..{last}] OF BOOL;\nEND_VAR\n", *(f"{line}\n" for line in body), "END_PROGRAM\nVAR_CONFIG\n",
        *(f"{line}\n" for line in config), "END_VAR\n",
    ]  # fmt: skip
    return BitProgram("".join(text), expected)
