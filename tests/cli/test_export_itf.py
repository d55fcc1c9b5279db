"""`plctool export-itf`: what it writes compiles without a warning, and is what images ask for."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import sys
from pathlib import Path

import _plccore
import pytest
from conftest import Tool

sys.path.insert(0, str(Path(__file__).parents[1] / "compiler"))

from library_support import library

from plctool.core import lib
from plctool.sim import Simulator

ROOT = Path(__file__).parents[2]
CC = shutil.which("gcc") or shutil.which("cc")
INCLUDE = [f"-I{ROOT / 'firmware' / folder}" for folder in ("port/sim", "include")]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", *INCLUDE]

LIBRARY = """
TYPE
    Unit : (Celsius, Kelvin := 10, Fahrenheit);
    Digit : INT (0..9);
    Point : STRUCT
        x, y : REAL;
        name : STRING[10];
        unit : Unit;
        next : POINTER TO INT;
        grid : ARRAY[0..2, 1..4] OF INT;
        default : Digit;
    END_STRUCT;
    Path : STRUCT
        points : ARRAY[1..3] OF Point;
        count : USINT;
    END_STRUCT;
END_TYPE

{attribute 'external' := 'Sensor_Scale'}
{attribute 'version' := '2.3'}
FUNCTION SensorScale : REAL
VAR_INPUT raw : INT; factor : REAL; on : BOOL; unit : Unit; digit : Digit; t : TIME; w : LWORD; END_VAR
END_FUNCTION

{attribute 'external' := 'sensor_label'}
FUNCTION SensorLabel : STRING[20]
VAR_INPUT channel : USINT; label : STRING; END_VAR
VAR_IN_OUT path : Path; text : STRING[30]; END_VAR
VAR_OUTPUT length : UINT; valid : BOOL; END_VAR
END_FUNCTION

{attribute 'external' := 'sensor_reset'}
FUNCTION SensorReset
END_FUNCTION

{attribute 'external' := 'sensor_sum'}
FUNCTION SensorSum : LREAL
VAR_INPUT values : ARRAY[0..3] OF LREAL; int : POINTER TO INT; p : Point; END_VAR
END_FUNCTION

{attribute 'external' := 'sensor_mean'}
FUNCTION SensorMean : REAL
VAR_IN_OUT CONSTANT values : ARRAY[*, *] OF INT; END_VAR
VAR_INPUT int : INT; END_VAR
END_FUNCTION

{attribute 'external' := 'sensor_best'}
FUNCTION SensorBest : POINTER TO INT
VAR_INPUT int : POINTER TO INT; END_VAR
END_FUNCTION
"""

needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")


def export(tool: Tool, text: str = LIBRARY) -> None:
    Path("sensors.st").write_text(text, "utf-8")
    done = tool("export-itf", "sensors.st")
    assert done.status == 0, done.err


def compile_c(*words: str) -> None:
    assert CC is not None
    subprocess.run([CC, *FLAGS, *words], check=True, timeout=60)


@needs_compiler
def test_header_and_frame_compile_without_a_warning(tool: Tool) -> None:
    export(tool)
    compile_c("-c", "sensors.c", "-o", "sensors.o")


@needs_compiler
@pytest.mark.parametrize("library", ["1st library.st", "int.st", "ä.st"])
def test_any_file_name_will_do(tool: Tool, library: str) -> None:
    Path(library).write_text(LIBRARY, "utf-8")
    document = tool("export-itf", library, "--json").json
    compile_c("-c", document["source"], "-o", "library.o")


@needs_compiler
def test_a_packed_structure_is_packed_in_c(tool: Tool) -> None:
    """The header itself asserts sizes and offsets."""
    packed = "".join(
        f"{{attribute 'pack_mode' := '{mode}'}}\n"
        f"Packed{mode} : STRUCT head : BYTE; value : LREAL; next : POINTER TO INT; END_STRUCT\n"
        for mode in (1, 2, 4, 8)
    )
    members = "".join(f"p{mode} : Packed{mode}; " for mode in (1, 2, 4, 8))
    all_of_them = f"{{attribute 'pack_mode' := '1'}}\nAll : STRUCT head : BYTE; {members} END_STRUCT\n"
    function = "{attribute 'external' := 'take'}\nFUNCTION Take\nVAR_INPUT a : All; END_VAR\nEND_FUNCTION\n"
    Path("packed.st").write_text(f"TYPE\n{packed}{all_of_them}END_TYPE\n{function}", "utf-8")
    assert tool("export-itf", "packed.st").status == 0
    compile_c("-c", "packed.c", "-o", "packed.o")


@needs_compiler
def test_bits_of_a_structure_are_bit_fields(tool: Tool) -> None:
    """The header itself asserts the size; the frame is made to return what it finds in memory."""
    export(
        tool,
        "TYPE Bits : STRUCT a, b, c, d, e, f, g, h, ninth : BIT; n : INT; last : BIT; END_STRUCT END_TYPE\n"
        "{attribute 'external' := 'take'}\nFUNCTION Take\nVAR_INPUT v : Bits; END_VAR\nEND_FUNCTION\n",
    )
    Path("bits.c").write_text(
        '#include "sensorsItf.h"\n#include <string.h>\n'
        "int main(void) { unsigned char m[] = {0x04, 0x01, 0x34, 0x12, 0x01, 0}; Bits v; memcpy(&v, m, sizeof v); "
        "return v.c && !v.b && v.ninth && v.n == 0x1234 && v.last ? 0 : 1; }\n"
    )
    compile_c("bits.c", "-o", "bits")
    subprocess.run(["./bits"], check=True)


@needs_compiler
def test_types_of_one_name_in_two_namespaces_are_two_in_c(tool: Tool) -> None:
    types = "TYPE Mode : (Off, {0});\nConfig : STRUCT pad : {1}; mode : Mode; END_STRUCT; END_TYPE"
    spaces = {"Press": ("Down", "INT"), "Oven": ("Hot", "LINT")}
    text = "".join(f"NAMESPACE {n}\n{types.format(*words)}\nEND_NAMESPACE\n" for n, words in spaces.items())
    function = "{attribute 'external' := 'heat'}\nFUNCTION Heat\nVAR_INPUT a : Press.Config; b : Oven.Config; END_VAR\n"
    export(tool, f"{text}{function}END_FUNCTION\n")
    compile_c("-c", "sensors.c", "-o", "sensors.o")


@needs_compiler
def test_wide_strings_unions_and_a_parameter_called_result(tool: Tool) -> None:
    Path("wide.st").write_text(
        "TYPE Wide : STRUCT w : WSTRING(5); n : INT; both : Both; END_STRUCT; "
        "Both : UNION a : DWORD; b : LREAL; END_UNION; END_TYPE\n"
        "{attribute 'external' := 'wide'}\n"
        "FUNCTION Take : INT VAR_INPUT result, result_ : INT; w : WSTRING; s : Wide; END_VAR END_FUNCTION\n"
        "{attribute 'external' := 'made'}\nFUNCTION Made : Wide VAR_INPUT result : Wide; END_VAR END_FUNCTION\n"
    )
    tool("export-itf", "wide.st", "-o", ".")
    compile_c("-c", "wide.c", "-o", "wide.o")
    assert "RTS_UI16 w[6];" in Path("wideItf.h").read_text()


def test_an_array_of_any_size_comes_with_its_bounds(tool: Tool) -> None:
    export(tool)
    words = " ".join(Path("sensorsItf.h").read_text("utf-8").split())
    bounds = ", ".join(f"RTS_I32 values_{end}{n}" for n in (1, 2) for end in ("lower", "upper"))
    assert f"sensor_mean(RTS_I16 *values, RTS_I16 int_, {bounds})" in words


def test_the_table_has_what_images_ask_for(tool: Tool) -> None:
    export(tool)
    calls = "SensorReset(); r := SensorScale(raw := 1, unit := Unit.Kelvin); q := SensorBest(p);"
    program = f"PROGRAM Main VAR r : REAL; p, q : POINTER TO INT; END_VAR {calls} END_PROGRAM"
    Path("main.st").write_text(program, "utf-8")
    assert tool("build", "main.st", "sensors.st").status == 0
    wanted = {e["name"]: (e["signature"], e["version"]) for e in tool("info", "app.cdl", "--json").json["externals"]}
    entry = re.compile(r'\{"(\w+)", 0x(\w+), 0x(\w+), \(RTS_PFN\)APP_GATED\(\1\)\}')
    offered = {n: (s, int(v, 16)) for n, s, v in entry.findall(Path("sensorsItf.h").read_text("utf-8"))}
    assert set(wanted) - {"iecraise"} == {"sensor_reset", "sensor_scale", "sensor_best"}
    for name in set(wanted) - {"iecraise"}:
        signature, version = wanted[name]
        assert int(str(signature), 16) == int(offered[name][0], 16)
        assert str(version) in (f"{offered[name][1] >> 16}.{offered[name][1] & 0xFFFF}", str(offered[name][1]))


IMPLEMENTATION = """
#include <string.h>
#include "boardItf.h"

RTS_I32 board_sum(const RTS_I16 *values, RTS_I8 sign)
{
    return sign * (values[0] + values[1] + values[2]);
}

void board_text(char *result, const char *name, RTS_UI32 name_capacity, RTS_UI16 *length, RTS_UI8 *long_name)
{
    *length = (RTS_UI16)strlen(name);
    *long_name = *length > 3;
    strcpy(result, *length <= name_capacity ? "fits" : "full");
}

RTS_REAL64 board_move(Place *place, RTS_REAL32 by, RTS_UI8 up)
{
    place->steps++;
    place->height += up ? by : -by;
    return place->height;
}

static const CMP_EXT_FUNCTION functions[] = {
    BOARD_EXT_FUNCTIONS
};

RTS_RESULT board_register(void);
RTS_RESULT board_register(void)
{
    return CMRegisterExternal(functions, RTS_COUNT(functions));
}
"""

BOARD = """
TYPE Place : STRUCT steps : USINT; height : LREAL; END_STRUCT; END_TYPE
{attribute 'external' := 'board_sum'}
FUNCTION BoardSum : DINT
VAR_INPUT values : ARRAY[1..3] OF INT; sign : SINT; END_VAR
END_FUNCTION
{attribute 'external' := 'board_text'}
FUNCTION BoardText : STRING[10]
VAR_INPUT name : STRING; END_VAR
VAR_OUTPUT length : UINT; long_name : BOOL; END_VAR
END_FUNCTION
{attribute 'external' := 'board_move'}
FUNCTION BoardMove : LREAL
VAR_IN_OUT place : Place; END_VAR
VAR_INPUT by : REAL; up : BOOL; END_VAR
END_FUNCTION
"""

USER = """
PROGRAM Main
VAR
    sum : DINT; text : STRING; length : UINT; is_long : BOOL; height : LREAL;
    place : Place := (height := 1.5);
    values : ARRAY[1..3] OF INT := [1000, -1, 32767];
END_VAR
sum := BoardSum(values, -1);
text := BoardText(name := 'Anna', length => length, long_name => is_long);
height := BoardMove(place, 0.25, TRUE);
END_PROGRAM
"""


@needs_compiler
def test_compiled_code_calls_the_implementation(tool: Tool) -> None:
    """The C side in a shared object, registered with the simulator, called by an image."""
    Path("board.st").write_text(BOARD, "utf-8")
    Path("main.st").write_text(USER, "utf-8")
    Path("board.c").write_text(IMPLEMENTATION, "utf-8")
    document = tool("export-itf", "board.st", "--json").json
    assert document["source_written"] is False
    assert Path("board.c").read_text("utf-8") == IMPLEMENTATION
    compile_c("-shared", "-fPIC", "board.c", "-o", "board.so")
    ctypes.CDLL(_plccore.__file__, ctypes.RTLD_GLOBAL)
    register = ctypes.CDLL(str(Path("board.so").resolve())).board_register
    assert tool("build", "main.st", "board.st").status == 0
    image = Path("app.cdl").read_bytes()
    small = Path("small.st")
    small.write_text("PROGRAM Main END_PROGRAM", "utf-8")
    assert tool("build", "small.st", "-o", "small.cdl").status == 0
    with Simulator(Path("small.cdl").read_bytes()) as plc:
        assert register() == lib.ERR_OK
        plc.flash(image)
        plc.run_cycles(2)
        names = ["Main.sum", "Main.text", "Main.length", "Main.is_long", "Main.height", "Main.place.steps"]
        assert list(plc.read_all(names).values()) == [-33766, "fits", 4, True, 2.0, 2]


def test_an_implementation_is_replaced_on_demand_only(tool: Tool) -> None:
    export(tool)
    Path("sensors.c").write_text("mine", "utf-8")
    done = tool("export-itf", "sensors.st")
    assert "kept as it is" in done.out
    assert Path("sensors.c").read_text("utf-8") == "mine"
    assert tool("export-itf", "sensors.st", "--force").status == 0
    assert Path("sensors.c").read_text("utf-8") != "mine"


def test_files_go_where_they_are_wanted(tool: Tool) -> None:
    Path("sensors.st").write_text(LIBRARY, "utf-8")
    Path("out").mkdir()
    assert tool("export-itf", "sensors.st", "-o", "out").status == 0
    assert {p.name for p in Path("out").iterdir()} == {"sensorsItf.h", "sensors.c"}


def test_the_document_lists_the_functions(tool: Tool) -> None:
    Path("sensors.st").write_text(LIBRARY, "utf-8")
    functions = tool("export-itf", "sensors.st", "--json").json["functions"]
    assert functions[0]["interface"].startswith("sensor_scale(INT,REAL,BOOL,UNIT,DIGIT,TIME,LWORD):REAL")
    assert functions[0]["version"] == "2.3"
    assert len(functions[0]["signature"]) == 8


@pytest.mark.parametrize("words", [[], ["."], ["src", "--library", "Base", "--io", "a.io.toml"]])
def test_a_program_has_its_libraries_and_devices(tool: Tool, scratch: Path, words: list[str]) -> None:
    library(scratch, "Base", {"pair.st": "TYPE Pair : STRUCT a : INT; b : LREAL; END_STRUCT END_TYPE\n"})
    (scratch / "src").mkdir()
    (scratch / "src/main.st").write_text(
        "{attribute 'external' := 'mean'}\nFUNCTION Mean : LREAL\nVAR_INPUT p : Base.Pair; END_VAR\nEND_FUNCTION\n"
        "PROGRAM Main\nVAR p : Base.Pair; r : LREAL; END_VAR\n"
        "IF Drive.ok THEN r := Mean(p); END_IF\nEND_PROGRAM\n"
    )
    (scratch / "a.io.toml").write_text("[sim]\nname = 'Drive'\n")
    (scratch / "plc.toml").write_text("sources = 'src'\nlibraries = 'Base'\nio = 'a.io.toml'\n")
    assert tool("export-itf", *words, "-o", "c").status == 0
    assert (scratch / f"c/{'src' if 'src' in words else scratch.name}Itf.h").exists()


def test_a_library_without_c_functions_is_reported(tool: Tool) -> None:
    Path("a.st").write_text("FUNCTION F : INT\nEND_FUNCTION", "utf-8")
    done = tool("export-itf", "a.st")
    assert done.status == 2
    assert "{attribute 'external'" in done.err


@pytest.mark.parametrize("name", ["int", "1st", "a-b"])
def test_names_that_c_cannot_have_are_reported(tool: Tool, name: str) -> None:
    Path("a.st").write_text(f"{{attribute 'external' := '{name}'}}\nFUNCTION F : INT\nEND_FUNCTION", "utf-8")
    done = tool("export-itf", "a.st")
    assert done.status == 2
    assert f"'{name}' cannot be the name of a function in C" in done.err


def test_a_description_beside_a_file_of_functions_does_not_matter(tool: Tool, scratch: Path) -> None:
    (scratch / "acmefn.st").write_text(
        "{attribute 'external' := 'acme_fn'}\nFUNCTION AcmeFn : INT\nVAR_INPUT x : INT; END_VAR\nEND_FUNCTION\n"
    )
    (scratch / "main.io.toml").write_text('[sim]\nchannels = {"in" = {variable = "Main.x", type = "BOOL"}}\n')
    assert tool("export-itf", "acmefn.st").status == 0
