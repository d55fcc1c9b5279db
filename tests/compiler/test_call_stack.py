"""The calls that led to an exception are exact, whether they were inlined or made, at each level of optimisation."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from checked_program import checked
from hypothesis import example, given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import Level, compile_sources
from plctool.debug.symbols import SymbolTable
from plctool.debug.trace import Trace
from plctool.image.file import parse_image
from plctool.sim import Simulator

LEVELS: list[Level] = [0, 1, 2, 3, "s"]


@dataclass(frozen=True)
class Unit:
    """One on the way down: how it is called, and how much stack it uses."""

    kind: str
    locals: int
    twice: bool  # called a second time, so that it is not worth inlining


UNITS = st.lists(
    st.builds(Unit, st.sampled_from(["FUNCTION", "FUNCTION_BLOCK", "METHOD"]), st.integers(0, 70), st.booleans()),
    min_size=1,
    max_size=6,
)


class Program:
    """Main calls unit 0, that calls unit 1 ..., the last one divides by zero in the fourth cycle. `connected`: what a
    CONFIGURATION assigns before and after it is part of Main."""

    def __init__(self, units: list[Unit], connected: bool) -> None:
        self.lines = ["VAR_GLOBAL seen : DINT; END_VAR"]
        self.places: list[tuple[str, int]] = []  # unit and line of the calls, the innermost first
        for n in reversed(range(len(units))):
            self._unit(n, units)
        self.lines += [
            "PROGRAM Main",
            "VAR_INPUT given : DINT; END_VAR VAR_OUTPUT x : DINT; END_VAR",
            "VAR cycle : DINT;",
            *self._instance(0, units),
            "END_VAR",
            "cycle := cycle + 1;",
        ]
        self._body("Main", 0, units, "4 - cycle")
        self.lines += ["END_PROGRAM"]
        if connected:
            instance = "PROGRAM Main WITH T : Main(given := 7 / (seen + 1), x => seen);"
            self.lines += ["CONFIGURATION C TASK T(INTERVAL := T#1ms);", instance, "END_CONFIGURATION"]

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def _instance(self, n: int, units: list[Unit]) -> list[str]:
        return [f"u{n} : Unit{n};"] if n < len(units) and units[n].kind != "FUNCTION" else []

    def _unit(self, n: int, units: list[Unit]) -> None:
        unit = units[n]
        names = {"FUNCTION": f"FUNCTION Unit{n} : DINT", "METHOD": "METHOD PUBLIC Run : DINT"}
        if unit.kind == "METHOD":
            self.lines += [f"FUNCTION_BLOCK Unit{n}", "VAR", *self._instance(n + 1, units), "END_VAR"]
        self.lines += [names.get(unit.kind, f"FUNCTION_BLOCK Unit{n}"), "VAR_INPUT n : DINT; END_VAR"]
        own = [] if unit.kind == "METHOD" else self._instance(n + 1, units)
        self.lines += ["VAR x, i : DINT;", f"a : ARRAY[0..{unit.locals}] OF DINT;", *own, "END_VAR"]
        self.lines += [f"FOR i := 0 TO {unit.locals} DO a[i] := n + i * 3; END_FOR"]
        name = f"Unit{n}.Run" if unit.kind == "METHOD" else f"Unit{n}"
        self._body(name, n + 1, units, f"n + a[{unit.locals}] - a[{unit.locals}]")
        self.lines += {
            "FUNCTION": [f"Unit{n} := x;", "END_FUNCTION"],
            "METHOD": ["Run := x;", "END_METHOD", "END_FUNCTION_BLOCK"],
        }.get(unit.kind, ["END_FUNCTION_BLOCK"])

    def _body(self, name: str, callee: int, units: list[Unit], argument: str) -> None:
        if callee == len(units):
            self.places.append((name, len(self.lines) + 1))
            self.lines += [f"x := 100 / ({argument});"]
            return
        calls = {"FUNCTION": "x := Unit{0}({1});", "METHOD": "x := u{0}.Run({1});"}
        call = calls.get(units[callee].kind, "u{0}({1});")
        if units[callee].twice:
            self.lines += [call.format(callee, "1000")]
        self.places.append((name, len(self.lines) + 1))
        # A call at the end may become a jump; a global variable has to be written after the call, which may not return.
        self.lines += [call.format(callee, argument), "x := x + cycle;" if name == "Main" else "x := x + n; seen := x;"]


def places(plc: Simulator, symbols: SymbolTable) -> list[tuple[str, int]]:
    """Unit and line where the program stopped, and of the calls that led there."""
    exception = plc.raw_status().exception
    assert exception is not None
    return [(place.pou, place.line) for place in symbols.call_stack(exception.code_offset, exception.trace)]


@examples(25)
@given(units=UNITS, connected=st.booleans())
@example(
    units=[
        Unit("METHOD", 0, True),
        Unit("METHOD", 0, True),
        Unit("FUNCTION_BLOCK", 2, True),
        Unit("FUNCTION_BLOCK", 2, False),
    ],
    connected=False,
)
@example(
    units=[
        Unit("FUNCTION", 0, False),
        Unit("FUNCTION_BLOCK", 57, False),
        Unit("FUNCTION", 0, False),
        Unit("FUNCTION_BLOCK", 57, False),
    ],
    connected=False,
)
def test_each_call_is_reported_at_each_level(tmp_path_factory, units: list[Unit], connected: bool) -> None:
    program = Program(units, connected)
    path = tmp_path_factory.mktemp("calls") / "calls.st"
    path.write_text(program.text)
    once = checked([path])
    for level in LEVELS:
        built = once.built(level)
        with Simulator(built.image, built.symbols) as plc:
            plc.run_cycles(4, check=False)
            assert places(plc, built.symbols) == program.places, level


@pytest.mark.parametrize("statement", ["n := n + n * 3 - 1; m := m + n;", "f(n := n); n := f.n + 1;"])
def test_the_parts_of_a_long_body_are_one_place_at_each_level(tmp_path, statement: str) -> None:
    path = tmp_path / "long.st"
    block = "FUNCTION_BLOCK F VAR_INPUT n : DINT; END_VAR n := n * 3; END_FUNCTION_BLOCK"
    lines = [f"{block} PROGRAM Main VAR n, m : DINT; f : F; END_VAR", *[statement] * 2000, "n := 10 / (m - m);"]
    path.write_text("\n".join([*lines, "END_PROGRAM"]))
    once = checked([path])
    for level in LEVELS:
        built = once.built(level)
        with Simulator(built.image, built.symbols) as plc:
            plc.run_cycles(1, check=False)
            assert places(plc, built.symbols) == [("Main", len(lines))], level


@pytest.mark.parametrize("level", LEVELS)
def test_what_a_configuration_assigns_is_one_place(tmp_path, level: Level) -> None:
    path = tmp_path / "connected.st"
    task = "CONFIGURATION c TASK t(INTERVAL := T#1ms);"
    lines = ["VAR_GLOBAL n : INT; END_VAR PROGRAM Work VAR_INPUT x : INT; END_VAR n := x; END_PROGRAM", task]
    path.write_text("\n".join([*lines, "PROGRAM p WITH t : Work(x := 10 / n);", "END_CONFIGURATION"]))
    built = compile_sources([path], level=level)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1, check=False)
        assert places(plc, built.symbols) == [("p.inputs", 3)]


def test_a_function_of_the_runtime_and_the_jump_to_it_are_reported_by_their_caller(tmp_path) -> None:
    path = tmp_path / "product.st"
    path.write_text("PROGRAM Main\nVAR a, b : REAL; END_VAR\na := a * b;\nb := a + 1.0;\nEND_PROGRAM\n")
    built = compile_sources([path], target="cortex-m3")
    after_call = next(offset for offset, _, line in built.symbols.lines if line == 4)
    jump = len(parse_image(built.image).code) - 2  # calls of soft-float functions go through jumps at the end
    for stopped in (None, jump):
        (place,) = built.symbols.call_stack(stopped, Trace(link=after_call))
        assert (place.pou, place.line) == ("Main", 3)


def test_a_function_that_never_returns_is_reported_once(tmp_path) -> None:
    """It has no need to save where it would return to."""
    path = tmp_path / "loop.st"
    path.write_text("PROGRAM Main\nVAR x : REAL; END_VAR\nWHILE TRUE DO\nx := x * 1.5;\nEND_WHILE\nEND_PROGRAM\n")
    built = compile_sources([path], target="cortex-m3")
    after_call = next(offset for offset, _, line in built.symbols.lines if line == 4) + 2
    (place,) = built.symbols.call_stack(None, Trace(link=after_call))
    assert (place.pou, place.line) == ("Main", 4)


@pytest.mark.parametrize("level", LEVELS)
def test_a_frame_that_finds_no_room_names_the_unit_that_takes_it(tmp_path, level: Level) -> None:
    """The exception comes while the unit makes room, before its first line: at its declaration."""
    path = tmp_path / "far.st"
    path.write_text(
        """FUNCTION Far : DINT
VAR_INPUT i : DINT; END_VAR
VAR field : ARRAY[0..4259839] OF DINT; END_VAR
field[i] := i;
Far := field[i + 1];
END_FUNCTION
PROGRAM Main
VAR n, i : DINT; END_VAR
n := Far(i);
i := n;
END_PROGRAM
"""
    )
    built = compile_sources([path], level=level, checks="none", limits=False)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1, check=False)
        assert places(plc, built.symbols) in ([("Far", 1), ("Main", 9)], [("Main", 7)])  # the latter when inlined


INITIALISED = """FUNCTION Z : DINT
VAR_INPUT d : DINT; END_VAR
Z := 10 / d;
END_FUNCTION
FUNCTION_BLOCK Pump
VAR x : DINT; END_VAR
METHOD FB_Init : BOOL
VAR_INPUT bInitRetains : BOOL; bInCopyCode : BOOL; END_VAR
x := Z(x);
END_METHOD
END_FUNCTION_BLOCK
"""
MAIN = """PROGRAM Main
VAR
    n : DINT;
    {0}
END_VAR
n := n + 1;
END_PROGRAM
"""


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("variable", "calls"), [("v : DINT := Z(0);", []), ("pump : Pump;", [("Pump.FB_Init", "units.st", 9)])]
)
def test_an_exception_in_initialisation_names_unit_and_line(tmp_path, level: Level, variable: str, calls: list) -> None:
    """The initial values of all sources are written by one function."""
    (tmp_path / "units.st").write_text(INITIALISED)
    (tmp_path / "main.st").write_text(MAIN.format(variable))
    built = compile_sources([tmp_path], level=level)
    with Simulator(built.image, built.symbols, start=False) as plc:
        exception = plc.raw_status().exception
        assert exception is not None
        found = built.symbols.call_stack(exception.code_offset, exception.trace)
    told = [(place.pou, place.file.rpartition("/")[2], place.line) for place in found]
    assert told == [("Z", "units.st", 3), *calls, ("Main", "main.st", 4)]


CLEANED = """FUNCTION Ratio : INT
VAR_INPUT a, b : INT; END_VAR
Ratio := a / b;
END_FUNCTION
FUNCTION_BLOCK Cell
VAR n : INT; END_VAR
METHOD Run : INT
VAR_INPUT by : INT; END_VAR
Run := Ratio(n, by) + 1;
END_METHOD
END_FUNCTION_BLOCK
FUNCTION Spared : INT
VAR_INPUT by : INT; END_VAR
VAR exc : __SYSTEM.ExceptionCode; END_VAR
__TRY
    Spared := Ratio(1, by);
__CATCH(exc)
    Spared := 7;
__ENDTRY
END_FUNCTION
PROGRAM Main
VAR cell : Cell; cells : ARRAY[1..2] OF INT; cycle, x, ended : INT; exc : __SYSTEM.ExceptionCode; END_VAR
cycle := cycle + 1;
__TRY
{0}
__FINALLY
    ended := ended + Spared(0);
__ENDTRY
x := x + 1;
END_PROGRAM
"""


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("x := Ratio(1, 2 - cycle);", [("Ratio", 3), ("Main", 25)]),
        ("x := cell.Run(2 - cycle);", [("Ratio", 3), ("Cell.Run", 9), ("Main", 25)]),
        ("x := cells[2 / (2 - cycle)];", [("Main", 25)]),
        ("x := Spared(0);\ncells[cycle] := cells[cycle] + 1; x := cell.Run(2 - cycle);",
         [("Ratio", 3), ("Cell.Run", 9), ("Main", 26)]),
        ("__TRY\nx := Spared(2 - cycle);\nx := cell.Run(2 - cycle);\n__FINALLY\nended := Spared(0);\n__ENDTRY",
         [("Ratio", 3), ("Cell.Run", 9), ("Main", 27)]),
        ("__TRY\nx := cell.Run(0);\n__CATCH(exc)\nx := Ratio(1, 2 - cycle);\n__ENDTRY",
         [("Ratio", 3), ("Main", 28)]),
    ],
)  # fmt: skip
def test_an_exception_that_passes_finally_names_where_it_was_raised(
    tmp_path, level: Level, body: str, expected: list[tuple[str, int]]
) -> None:
    path = tmp_path / "cleaned.st"
    path.write_text(CLEANED.format(body))
    built = compile_sources([path], level=level)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        plc.run_cycles(1, check=False)
        exception = plc.status().exception
        assert exception is not None
        found = [(exception.pou, exception.line), *((call.pou, call.line) for call in exception.calls)]
        assert found == expected
        assert plc.read("Main.ended") > 0


@pytest.mark.parametrize("depth", [2, 7, 8, 9, 30])
def test_of_a_long_way_through_calls_the_first_lines_and_the_last_are_kept(tmp_path, depth: int) -> None:
    functions = [
        f"FUNCTION F{n} : INT VAR_INPUT a : INT; END_VAR\nF{n} := {f'F{n - 1}(a) + 1' if n else '1 / a'};\nEND_FUNCTION"
        for n in range(depth)
    ]
    main = (
        f"PROGRAM Main VAR x, n : INT; END_VAR\n__TRY\nx := F{depth - 1}(x);\n__FINALLY\nn := 1;\n__ENDTRY END_PROGRAM"
    )
    path = tmp_path / "deep.st"
    path.write_text("\n".join([*functions, main]))
    built = compile_sources([path])
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1, check=False)
        exception = plc.status().exception
    assert exception is not None
    assert (exception.pou, exception.line) == ("F0", 2)
    calls = [(f"F{n}", 3 * n + 2) for n in range(1, depth)][: 8 - 2]
    assert [(call.pou, call.line) for call in exception.calls] == [*calls, ("Main", 3 * depth + 3)]


def test_a_program_without_a_way_out_of_a_try_has_no_trail(tmp_path) -> None:
    path = tmp_path / "caught.st"
    path.write_text("PROGRAM Main VAR x : INT; END_VAR\n__TRY\nx := 1 / x;\n__CATCH\nx := 2;\n__ENDTRY END_PROGRAM")
    assert "%trail" not in compile_sources([path]).symbols.variables


def test_the_trail_is_not_listed_among_the_variables(tmp_path) -> None:
    path = tmp_path / "cleaned.st"
    path.write_text(CLEANED.format("x := Ratio(1, 2);"))
    symbols = compile_sources([path]).symbols
    assert "%trail" in symbols.variables
    assert not [s for s in symbols.find(["*"]) if "%" in s.name]
