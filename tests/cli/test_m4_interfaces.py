"""`plctool export-itf --from`: interface and dependency files of CODESYS components, and the component of
docs/v3-components.md in the simulator."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import _plccore
import pytest
from conftest import Tool

from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.errors import UsageError
from plctool.sim import Simulator
from plctool.v3.component import export_component
from plctool.v3.m4_interface import read_m4

ROOT = Path(__file__).parents[2]
CC = shutil.which("gcc") or shutil.which("cc")
INCLUDE = ["-I.", *(f"-I{ROOT / 'firmware' / folder}" for folder in ("port/sim", "include"))]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", *INCLUDE]
PAGE = dict(
    re.findall(r"^```\w+ (\S+)\n(.*?)^```", (ROOT / "docs/v3-components.md").read_text(), re.MULTILINE | re.DOTALL)
)
INTERFACE, DEPENDENCY, SOURCE = (PAGE[f"CmpFoo{end}"] for end in ("Itf.m4", "Dep.m4", ".c"))
PROGRAM = """
PROGRAM Main
VAR total : DINT; valid, other : BOOL; r : REAL; END_VAR
r := FooScale(total, 3, 2.5, 'Anna', valid => valid);
r := r + FooScale(factor := 1, raw := 1, name := '', total := total, valid => other);
END_PROGRAM
"""

needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")


def export(tool: Tool, dependency: str = DEPENDENCY) -> None:
    Path("CmpFooItf.m4").write_text(INTERFACE)
    Path("CmpFooDep.m4").write_text(dependency)
    Path("CmpFoo.c").write_text(SOURCE)
    done = tool("export-itf", "--from", "CmpFooItf.m4", "CmpFooDep.m4")
    assert done.status == 0, done.err


def compiled(*files: str) -> ctypes.CDLL:
    """The component as a library of this process."""
    assert CC is not None
    subprocess.run([CC, *FLAGS, "-shared", "-fPIC", *files, "-o", "foo.so"], check=True, timeout=60)
    ctypes.CDLL(_plccore.__file__, ctypes.RTLD_GLOBAL)
    return ctypes.CDLL(str(Path("foo.so").resolve()))


def image_of(text: str) -> Path:
    path = Path("main.st")
    path.write_text(text)
    built = compile_sources([path])
    path.with_suffix(".cdl").write_bytes(built.image)
    built.symbols.save(symbol_path(path.with_suffix(".cdl")))
    return path.with_suffix(".cdl")


@needs_compiler
def test_component_of_the_page_starts_and_is_called_by_a_program(tool: Tool) -> None:
    export(tool)
    hook = compiled("CmpFoo.c", "CmpFooV3.c").CmpFoo_Hook
    with Simulator(image_of("PROGRAM Main END_PROGRAM").read_bytes()) as plc:
        for number in (lib.CH_INIT_SYSTEM, lib.CH_INIT, lib.CH_INIT3, lib.CH_INIT_FINISHED):
            assert hook(number) == lib.ERR_OK
        assert ctypes.CDLL(_plccore.__file__).CMGetVersion(0x12342001) == 0x03040500
        assert "Foo is there, 4" in [entry.text for entry in plc.log()]
        plc.flash(image_of(Path("CmpFoo.st").read_text() + PROGRAM))
        plc.run_cycles(1)
        values = plc.read_all(["Main.r", "Main.valid", "Main.other", "Main.total"]).values()
        assert list(values) == [8.5, True, False, 3]


@needs_compiler
@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("0x03040500", "0x03050000", lib.ERR_VERSION_MISMATCH),
        ("0x1234", "0x1235", lib.ERR_ID_MISMATCH),
        ("0x2001", "0x2002", lib.ERR_ID_MISMATCH),
        ("0x03040500", "0x03040600", lib.ERR_OK),
    ],
)
def test_component_compiled_with_another_dependency_file_does_not_start(
    tool: Tool, old: str, new: str, error: int
) -> None:
    export(tool)
    assert CC is not None
    subprocess.run([CC, *FLAGS, "-fPIC", "-c", "CmpFoo.c", "-o", "CmpFoo.o"], check=True, timeout=60)
    export(tool, DEPENDENCY.replace(old, new))
    hook = compiled("CmpFoo.o", "CmpFooV3.c").CmpFoo_Hook
    with Simulator(image_of("PROGRAM Main END_PROGRAM").read_bytes()) as plc:
        assert hook(lib.CH_INIT_SYSTEM) == error
        texts = " ".join(entry.text for entry in plc.log())
        assert ("in its dependency file" in texts) is (error != lib.ERR_OK)


@needs_compiler
def test_interface_without_a_component_is_one_of_functions(tool: Tool) -> None:
    Path("FooItf.m4").write_text(INTERFACE.replace("0xFFADC096", "0").replace("`CmpFoo'", "`Foo'"))
    assert tool("export-itf", "--from", "FooItf.m4", "-o", "c").status == 0
    assert {p.name for p in Path("c").iterdir()} == {"FooItf.h", "Foo.st", "FooV3.c"}
    assert '{"fooscale", 0x00000000, 0x03040500' in Path("c/FooV3.c").read_text()
    assert CC is not None
    subprocess.run([CC, *FLAGS, "-c", "c/FooV3.c", "-o", "foo.o"], check=True, timeout=60)


def test_comments_and_other_text_are_passed_on() -> None:
    text = "SET_INTERFACE_NAME(`X')\n/* it's DEF_API(`a') */\n#define Y(a) (a)\nchar c = ')';\n"
    header = export_component([read_m4("XItf.m4", text)]).files["XItf.h"]
    assert all(line in header for line in text.splitlines()[1:])


FUNCTION = "DEF_API(`void',`CDECL',`fooscale',`(fooscale_struct *p)',1,0xFFADC096,0x03040500)"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("SET_INTERFACE_NAME(`CmpFoo')\n", "", "a.m4:1: SET_INTERFACE_NAME or SET_COMPONENT_NAME is missing"),
        (FUNCTION, FUNCTION[:-1], "a.m4:17: the parenthesis has no end"),
        (FUNCTION, FUNCTION.replace("`fooscale'", "`fooscale"), "a.m4:17: "),
        (FUNCTION, "DEF_APY(`a')", "a.m4:17: unknown macro DEF_APY; did you mean DEF_API?"),
        (FUNCTION, "define(`a',`b')", "a.m4:17: unknown macro define; expand it with GNU m4 before"),
        (FUNCTION, "DEF_API(`void')", "a.m4:17: DEF_API has 1 arguments, not result, convention, name, parameters"),
        (FUNCTION, FUNCTION.replace("0xFFADC096", "0xFGADC096"), "a.m4:17: '0xFGADC096' is not a number"),
        (FUNCTION, FUNCTION.replace("0xFFADC096", "0x1FFADC096"), "a.m4:17: '0x1FFADC096' has more than 32 bits"),
        (
            FUNCTION,
            FUNCTION.replace("`(fooscale_struct *p)'", "`int'"),
            "a.m4:17: the parameters of fooscale are not in",
        ),
        (FUNCTION, FUNCTION.replace("fooscale'", "foo-scale'"), "a.m4:17: 'foo-scale' is not a name of C"),
        (FUNCTION, FUNCTION.replace("fooscale'", "foo__main'"), "a.m4:17: foo__main belongs to a function block"),
        (FUNCTION, FUNCTION.replace("fooscale_struct", "f_struct"), "a.m4:17: the file does not define f_struct"),
        (FUNCTION, FUNCTION.replace("`void'", "`int'"), "a.m4:17: fooscale returns int; for programs it is void"),
        ("RTS_IEC_INT raw", "struct x raw", "a.m4:17: fooscale_struct has a member that is not a variable: struct"),
        (
            "RTS_IEC_INT raw",
            "FILE raw",
            "the member raw of the structure of fooscale is a FILE; it can be RTS_IEC_BOOL",
        ),
        ("RTS_IEC_INT raw", "RTS_IEC_INT raw[N]", "is neither a value, a pointer to one nor an array of numbers"),
        ("*total", "total", "total of the structure of fooscale is a VAR_IN_OUT, so it is a pointer"),
        ("REF_ITF(`CmpLogItf.m4')", "REF_ITF(`../x y')", "a.m4:3: '../x y' is not a file of an interface"),
        (INTERFACE[INTERFACE.index("DEF_ITF_API") :], "/* no end", "a.m4:18: the comment has no end"),
        ("#define FOO_MAX 4", "#define CMPID_CmpFoo 0x1000", "CMPID_CmpFoo is 0x1000; a component of a vendor has one"),
    ],
)
def test_mistakes_are_named_with_their_line(old: str, new: str, message: str) -> None:
    assert old in INTERFACE
    with pytest.raises(UsageError) as raised:
        export_component([read_m4("a.m4", INTERFACE.replace(old, new))])
    assert message in str(raised.value)
